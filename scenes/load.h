#pragma once

#include <filesystem>

#include "core/context.h"
#include "scenes/clusters.h"
#include "scenes/scene.h"

namespace ivis {

struct SceneOptions {
  /// Honour glTF's doubleSided = false; default: every opaque triangle blocks from both sides, as
  /// winding in city and CAD data is not to be trusted.
  bool honour_sidedness = false;
  /// kCluster: large meshes are split into several objects.
  Granularity granularity = Granularity::kObject;
};

/// Loads a .glb or .gltf file: the nodes reachable from its default scene, as in
/// docs/architecture.md. Extensions: EXT_mesh_gpu_instancing, KHR_mesh_quantization,
/// EXT_meshopt_compression, KHR_draco_mesh_compression; materials' extensions are ignored, but what
/// transmits light is not opaque. Buffers come from the file or its own folder; images are never
/// read. What is skinned, morphed or animated is always visible and never an occluder, with a
/// warning; a node marked `only` that moves is left out. Units:   metres, +Y up, as glTF says.
/// Errors:  kIo; kInput naming file, node or accessor, found and expected; kUnsupported naming an
///          entry of extensionsRequired that is not known; kCancelled. Untrusted bytes never crash
///          or hang; what they may make the loader produce is bounded by the file's size (at most
///          256 bytes a byte, and 64 MiB that are free).
/// Threads: reentrant. Ownership: the scene owns all its data.
/// Cost:    time and memory mostly of the JSON: 57,800 nodes of 31 MB take about 1 s and 500 MB.
/// Source:  glTF 2.0 specification (Khronos).
Result<Scene> load_scene(const std::filesystem::path& file, const SceneOptions& options = {},
                         const Context& context = {});

}  // namespace ivis
