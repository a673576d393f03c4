#pragma once
// Large meshes cut into compact clusters of triangles, each an object of its own, so that a scene
// that is one merged mesh is culled too.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/result.h"
#include "scenes/scene.h"

namespace ivis {

/// What an object of a scene is.
enum class Granularity : std::uint8_t {
  kObject,   ///< one instance of a mesh-bearing node; default
  kCluster,  ///< the same, but instances of large meshes are split into clusters
};
/// Errors: kInvalidArgument with what was found and what is expected.
Result<Granularity> parse_granularity(const std::string& text);  ///< "object", "cluster"
const char* granularity_name(Granularity granularity);

/// A mesh of more triangles than this is split; no cluster has more.
inline constexpr std::size_t kClusterTriangles = 256;
/// Objects that a scene may be split into: a message with four words a row names so many.
inline constexpr std::size_t kMaxClusteredObjects = 4'194'304;

/// The triangles of each cluster of the mesh, ascending: all of them once, one cluster if the mesh
/// is not large. While a run has more than kClusterTriangles = 256, it is cut in two: its triangles
/// are put in order along the axis of the mesh's own space along which the box of their centroids
/// is longest (x before y before z when equal) by centroid, then by number; the first half, rounded
/// down, becomes one run, the rest the other. Clusters are numbered in that order. A centroid's
/// coordinate is the sum of its three corners', in double, first to last.
/// Cost: O(n log n).
std::vector<std::vector<std::uint32_t>> cluster_triangles(const Mesh& mesh);

/// Replaces every object with a large mesh by its clusters: same node, instance, tag and to_world,
/// `cluster` 0..k-1, a mesh of its own that the instances of the whole share, with the flags of
/// the primitives its triangles come from. Movers (always_visible) stay whole. The objects as they
/// were go to Scene::wholes, their meshes stay where they are. A scene without a large mesh comes
/// back as it is, with its hash. Requires: a finished scene that is not split. Guarantee: corners
/// of triangles are the same to the last bit.
/// Errors: kInput when there would be more than kMaxClusteredObjects.
Result<Scene> split_into_clusters(Scene scene);

}  // namespace ivis
