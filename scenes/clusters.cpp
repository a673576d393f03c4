#include "scenes/clusters.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

#include "core/assert.h"

namespace ivis {
namespace {

bool large(const Mesh& mesh) {
  return mesh.triangles() > kClusterTriangles;
}

/// How many clusters cut() makes of n triangles.
std::size_t cluster_count(std::size_t n) {
  return n <= kClusterTriangles ? 1 : cluster_count(n / 2) + cluster_count(n - n / 2);
}

using Run = std::vector<std::uint32_t>::iterator;

void cut(const std::vector<Vec3>& centroids, Run first, Run last,
         std::vector<std::vector<std::uint32_t>>& out) {
  const auto n = last - first;
  if (static_cast<std::size_t>(n) <= kClusterTriangles) {
    out.emplace_back(first, last);
    std::sort(out.back().begin(), out.back().end());
    return;
  }
  Aabb box;
  for (Run i = first; i != last; ++i)
    box.add(centroids[*i]);
  const Vec3 size = box.size();
  int axis = size.y > size.x ? 1 : 0;
  if (size.z > size[axis]) axis = 2;
  const Run middle = first + n / 2;
  // The order is strict, so which triangles come first does not depend on how they are selected.
  std::nth_element(first, middle, last, [&](std::uint32_t a, std::uint32_t b) {
    const double u = centroids[a][axis];
    const double v = centroids[b][axis];
    return u != v ? u < v : a < b;
  });
  cut(centroids, first, middle, out);
  cut(centroids, middle, last, out);
}

/// Copies of some triangles of one mesh.
class Parts {
 public:
  explicit Parts(const Mesh& mesh) : mesh_(mesh), renumbered_(mesh.positions.size(), kNone) {}

  /// `triangles` ascend, so the primitives stay in order.
  Mesh of(const std::vector<std::uint32_t>& triangles) {
    Mesh out;
    out.indices.reserve(3 * triangles.size());
    std::vector<std::uint32_t> used;
    auto primitive = mesh_.primitives.begin();
    const auto* last_from = static_cast<const Primitive*>(nullptr);
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      const std::uint32_t t = triangles[i];
      while (t - primitive->first_triangle >= primitive->triangles)
        ++primitive;
      if (last_from != &*primitive) {
        last_from = &*primitive;
        out.primitives.push_back(*primitive);
        out.primitives.back().first_triangle = static_cast<std::uint32_t>(i);
        out.primitives.back().triangles = 0;
      }
      ++out.primitives.back().triangles;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t v = mesh_.indices[3 * std::size_t{t} + k];
        if (renumbered_[v] == kNone) {
          renumbered_[v] = static_cast<std::uint32_t>(out.positions.size());
          out.positions.push_back(mesh_.positions[v]);
          used.push_back(v);
        }
        out.indices.push_back(renumbered_[v]);
      }
    }
    for (const std::uint32_t v : used)
      renumbered_[v] = kNone;
    return out;
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffU;
  const Mesh& mesh_;
  std::vector<std::uint32_t> renumbered_;
};

}  // namespace

Result<Granularity> parse_granularity(const std::string& text) {
  for (const Granularity g : {Granularity::kObject, Granularity::kCluster})
    if (text == granularity_name(g)) return g;
  return invalid_argument("found '" + text + "', expected object or cluster");
}

const char* granularity_name(Granularity granularity) {
  return granularity == Granularity::kCluster ? "cluster" : "object";
}

std::vector<std::vector<std::uint32_t>> cluster_triangles(const Mesh& mesh) {
  const std::size_t n = mesh.triangles();
  std::vector<Vec3> centroids;  // three times over, which leaves their order as it is
  if (large(mesh)) {
    centroids.reserve(n);
    for (std::size_t t = 0; t < n; ++t)
      centroids.push_back(Vec3(mesh.positions[mesh.indices[3 * t]]) +
                          Vec3(mesh.positions[mesh.indices[3 * t + 1]]) +
                          Vec3(mesh.positions[mesh.indices[3 * t + 2]]));
  }
  std::vector<std::uint32_t> all(n);
  std::iota(all.begin(), all.end(), 0U);
  std::vector<std::vector<std::uint32_t>> out;
  out.reserve(cluster_count(n));
  cut(centroids, all.begin(), all.end(), out);
  return out;
}

Result<Scene> split_into_clusters(Scene scene) {
  IVIS_ASSERT(scene.wholes.empty(), "the scene is not split yet");
  const auto splits = [&](const Object& o) { return !o.always_visible && large(scene.mesh_of(o)); };
  std::vector<std::size_t> count(scene.meshes.size(), 0);
  std::size_t objects = 0;
  bool any = false;
  for (const Object& o : scene.objects) {
    if (!splits(o)) {
      ++objects;
      continue;
    }
    any = true;
    if (count[o.mesh] == 0) count[o.mesh] = cluster_count(scene.mesh_of(o).triangles());
    objects += count[o.mesh];
  }
  if (!any) return scene;
  if (objects > kMaxClusteredObjects)
    return input_error("splits into " + std::to_string(objects) + " clusters, expected at most " +
                       std::to_string(kMaxClusteredObjects) + ": take the granularity 'object'");

  std::vector<std::uint32_t> first(count.size(), 0);  // cluster mesh, by whole mesh
  for (std::size_t m = 0; m < count.size(); ++m) {
    if (count[m] == 0) continue;
    first[m] = static_cast<std::uint32_t>(scene.meshes.size());
    std::vector<Mesh> made;
    {
      Parts parts(scene.meshes[m]);
      for (const auto& triangles : cluster_triangles(scene.meshes[m]))
        made.push_back(parts.of(triangles));
    }
    std::move(made.begin(), made.end(), std::back_inserter(scene.meshes));
  }
  std::vector<Object> clusters;
  clusters.reserve(objects);
  for (const Object& whole : scene.objects) {
    if (!splits(whole)) {
      clusters.push_back(whole);
      continue;
    }
    for (std::uint32_t k = 0; k < count[whole.mesh]; ++k) {
      Object& o = clusters.emplace_back(whole);
      o.cluster = k;
      o.mesh = first[whole.mesh] + k;
    }
  }
  scene.wholes = std::move(scene.objects);
  scene.objects = std::move(clusters);
  const SceneHash before = scene.hash;
  if (auto s = finish_scene(scene); !s) return s.error();
  scene.whole_hash = before;
  return scene;
}

}  // namespace ivis
