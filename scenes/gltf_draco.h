#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/math.h"
#include "core/result.h"
#include "scenes/gltf_document.h"

namespace ivis {

struct DracoTriangles {
  std::vector<glm::vec3> positions;
  std::vector<std::uint32_t> indices;  ///< 3 a triangle, each < positions.size()
};

/// What a stream says of itself before its connectivity.
struct DracoStreamCounts {
  std::uint32_t triangles = 0;
  std::uint32_t vertices = 0;
  std::uint32_t symbols = 0;
  std::uint32_t split_symbols = 0;
  std::uint8_t attribute_tables = 0;
};

/// Reads the head of a Draco 2.2 stream, allocating nothing by its counts.
/// Errors: kInput starting with `where`. Source: Draco Bitstream Specification, sections 3 and 5.
Result<DracoStreamCounts> read_draco_counts(std::span<const std::uint8_t> bytes,
                                            const std::string& where);

/// Decodes the positions and faces of KHR_draco_mesh_compression.
/// position_id: the extension's id of POSITION. The counts of the stream must be those of the
/// accessors and are checked before anything of their size is allocated. Errors: kInput starting
/// with `where`.
Result<DracoTriangles> decode_draco(std::span<const std::uint8_t> bytes, std::uint32_t position_id,
                                    std::size_t vertices, std::size_t triangles, GltfBudget& budget,
                                    const std::string& where);

}  // namespace ivis
