#include "scenes/gltf_draco.h"

namespace ivis {

Result<DracoTriangles> decode_draco(std::span<const std::uint8_t>, std::uint32_t, std::size_t,
                                    std::size_t, GltfBudget&, const std::string& where) {
  return unsupported(where + ": not yet");
}

}  // namespace ivis
