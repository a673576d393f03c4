#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "scenes/gltf_document.h"

namespace ivis {

/// Decodes a buffer view of EXT_meshopt_compression, filter included: count * byteStride bytes.
/// Errors: kInput starting with `where`.
Result<std::vector<std::uint8_t>> decode_meshopt(
    const tinygltf::Value& extension, const std::vector<std::span<const std::uint8_t>>& buffers,
    GltfBudget& budget, const std::string& where);

}  // namespace ivis
