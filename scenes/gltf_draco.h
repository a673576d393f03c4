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

/// Decodes the positions and faces of KHR_draco_mesh_compression.
/// position_id: the extension's id of POSITION. The counts of the stream must be those of the
/// accessors and are checked before anything of their size is allocated. Errors: kInput starting
/// with `where`.
Result<DracoTriangles> decode_draco(std::span<const std::uint8_t> bytes, std::uint32_t position_id,
                                    std::size_t vertices, std::size_t triangles, GltfBudget& budget,
                                    const std::string& where);

}  // namespace ivis
