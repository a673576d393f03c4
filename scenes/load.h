#pragma once

#include <filesystem>

#include "core/context.h"
#include "scenes/scene.h"

namespace ivis {

struct SceneOptions {
  /// Honour glTF's doubleSided = false; default: every opaque triangle blocks from both sides, as
  /// winding in city and CAD data is not to be trusted.
  bool honour_sidedness = false;
};

/// Loads a .glb or .gltf file: the nodes reachable from its default scene, as in docs/architecture.md.
/// Extensions: EXT_mesh_gpu_instancing, KHR_mesh_quantization, EXT_meshopt_compression,
/// KHR_draco_mesh_compression; materials' extensions are ignored.
/// Units:   metres, +Y up, as glTF says.
/// Errors:  kIo; kInput naming file, node or accessor, found and expected; kUnsupported naming an
///          entry of extensionsRequired that is not known. Untrusted bytes never crash, hang or
///          allocate more than a small multiple of the file's size (instances: of their count).
/// Threads: reentrant. Ownership: the scene owns all its data.
/// Source:  glTF 2.0 specification (Khronos).
Result<Scene> load_scene(const std::filesystem::path& file, const SceneOptions& options = {},
                         const Context& context = {});

}  // namespace ivis
