#pragma once
// The node graph of a glTF file: who is in the scene, and where. Used inside scenes/ only.

#include <cstdint>
#include <vector>

#include "core/math.h"
#include "scenes/gltf_accessor.h"
#include "scenes/scene.h"

namespace ivis {

struct PlacedNode {
  std::uint32_t node = 0;
  Mat4 to_world{1};
  bool animated = false;  ///< it or an ancestor is the target of an animation
};

/// Nodes reachable from the default scene (the first if none is named, all roots if there is no
/// scene), in ascending node index. No recursion: chains may be as long as the file. Errors: kInput
/// naming the node: a child out of range, two parents, a cycle, a transform that is none.
Result<std::vector<PlacedNode>> reachable_nodes(const GltfDocument& document);

/// The node's instances under EXT_mesh_gpu_instancing, relative to the node; one identity without
/// it. Errors: kInput naming the accessor.
Result<std::vector<Mat4>> node_instances(const tinygltf::Node& node, GltfAccessors& accessors,
                                         GltfBudget& budget);

/// `extras.ivis.occluder`. Errors: kInput naming the value.
Result<OccluderTag> occluder_tag(const tinygltf::Node& node);

}  // namespace ivis
