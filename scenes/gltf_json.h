#pragma once
// What is done to the JSON text of a glTF file before tinygltf may see it.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"

namespace ivis {

/// A buffer as the JSON tells it.
struct GltfBufferEntry {
  std::size_t byte_length = 0;
  std::string uri;        ///< empty: the GLB's BIN chunk
  bool fallback = false;  ///< EXT_meshopt_compression: has no bytes of its own
};

struct GltfJson {
  std::string text;  ///< safe for tinygltf
  std::vector<GltfBufferEntry> buffers;
  std::vector<std::uint32_t> animated_nodes;
};

/// Checks nesting (at most 64 deep: tinygltf recurses) and takes out what ivis reads itself or
/// never:
/// - buffers: tinygltf would copy the BIN chunk once for each, open absolute paths, and fail on
///   EXT_meshopt_compression's fallback buffers;
/// - animations: tinygltf copies an animation's extensions once for each of its samplers;
/// - images, textures, samplers, cameras, skins, extensions, extras: not needed; tinygltf indexes
///   buffers unchecked for images.
/// The index accessor of a Draco primitive, which tinygltf refuses for want of a buffer view, is
/// moved to the attribute kDracoIndices. Errors: kInput naming the section and the value.
Result<GltfJson> prepare_gltf_json(std::string_view json);

inline constexpr const char* kDracoIndices = "_IVIS_DRACO_INDICES";

}  // namespace ivis
