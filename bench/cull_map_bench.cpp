// The polar cull map against the pinned yardstick, in one run on one thread: medians of CPU time a
// pose, interleaved round by round, and a hash of all answers, so that a fast wrong answer shows.
//
//   cull_map_bench SCENE.glb PATH.csv REACH [ROUNDS] [TILES]
//
// TILES n > 1 adds the same scene tiled n x n, walked in its middle tile: cost must follow what is
// seen.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "bench/common.h"
#include "bench/yardstick.h"
#include "core/path.h"
#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "scenes/load.h"
#include "visibility/cull_map.h"

namespace {

using namespace ivis;
using bench::cpu_ms;
using bench::get;
using bench::median;

/// The scene n x n times side by side; meshes are shared.
Scene tile(const Scene& scene, int n) {
  Scene out;
  out.meshes = scene.meshes;
  out.node_names = scene.node_names;
  const Vec3 size = scene.bounds.size();
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      for (Object o : scene.objects) {
        o.to_world[3] += glm::dvec4((i - n / 2) * size.x, 0, (k - n / 2) * size.z, 0);
        out.objects.push_back(o);
      }
  if (const auto s = finish_scene(out); !s) std::exit(3);
  return out;
}

struct Subject {
  std::string name;
  Scene scene;
  OccluderSet occluders;
  std::unique_ptr<CullMap> map;
  std::vector<double> ms;
  std::vector<double> counts;
  std::vector<double> boxes;  ///< without buildings
  std::uint64_t hash = 1469598103934665603ULL;
  CullMap::Stats stats;

  Subject(std::string n, Scene s, const Reach& reach) : name(std::move(n)), scene(std::move(s)) {
    ShrinkOptions options;
    options.reach = reach;
    options.margins = false;
    occluders = get(shrink(scene, options, FastEroder{})).set;
    map = std::make_unique<CullMap>(scene, occluders, MethodOptions{});
  }

  void run(const std::vector<Pose>& path, const Reach& reach, bool first) {
    for (const Pose& pose : path) {
      CullMap::Stats s;
      const double begin = cpu_ms();
      const auto pvs = map->solve({pose.eye, reach}, s);
      ms.push_back(cpu_ms() - begin);
      if (!first || !pvs) continue;
      stats.polar.solids_drawn += s.polar.solids_drawn;
      stats.polar.solids_tested += s.polar.solids_tested;
      stats.polar.walls_drawn += s.polar.walls_drawn;
      stats.polar.nodes_tested += s.polar.nodes_tested;
      counts.push_back(static_cast<double>(pvs->objects.size()));
      double n = 0;
      for (const ObjectId id : pvs->objects) {
        hash = (hash ^ id) * 1099511628211ULL;
        if (scene.name_of(scene.objects[id]).rfind("building", 0) != 0) ++n;
      }
      boxes.push_back(n);
    }
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: cull_map_bench SCENE.glb PATH.csv REACH [ROUNDS] [TILES]\n");
    return 2;
  }
  const std::vector<Pose> path = get(read_path(argv[2]));
  const Reach reach = get(Reach::parse(argv[3]));
  const int rounds = argc > 4 ? std::atoi(argv[4]) : 5;
  const int tiles = argc > 5 ? std::atoi(argv[5]) : 1;
  Scene scene = get(load_scene(argv[1]));
  std::vector<std::unique_ptr<Subject>> subjects;
  bench::Yardstick yardstick(scene);
  if (tiles > 1) subjects.push_back(std::make_unique<Subject>("tiled", tile(scene, tiles), reach));
  subjects.insert(subjects.begin(), std::make_unique<Subject>("polar", std::move(scene), reach));

  std::vector<double> yard_ms;
  std::vector<double> yard_boxes;
  for (int r = 0; r < rounds; ++r) {
    for (const Pose& pose : path) {
      const double begin = cpu_ms();
      const std::size_t n = yardstick.run(pose.eye);
      yard_ms.push_back(cpu_ms() - begin);
      if (r == 0) yard_boxes.push_back(static_cast<double>(n));
    }
    for (auto& s : subjects)
      s->run(path, reach, r == 0);
  }
  const double yard = median(yard_ms);
  std::printf("SIMD target %s, %zu poses, %d rounds, reach %s\n", simd_target(), path.size(),
              rounds, argv[3]);
  std::printf("%-10s %9.4f ms a pose  %6.0f boxes\n", "yardstick", yard, median(yard_boxes));
  for (const auto& s : subjects) {
    const double ms = median(s->ms);
    const auto poses = static_cast<double>(path.size());
    std::printf(
        "%-10s %9.4f ms a pose  %6.0f boxes (%.0f objects of %zu)  yardstick / it %.1f  hash "
        "%016llx\n",
        s->name.c_str(), ms, median(s->boxes), median(s->counts), s->scene.objects.size(),
        yard / ms, static_cast<unsigned long long>(s->hash));
    std::printf(
        "           a pose: %.0f solids drawn of %zu, %.0f walls, %.0f nodes tested; undersides "
        "%u\n",
        s->stats.polar.solids_drawn / poses, s->occluders.shrunk.size(),
        s->stats.polar.walls_drawn / poses, s->stats.polar.nodes_tested / poses,
        s->stats.undersides);
  }
  if (subjects.size() > 1)
    std::printf("tiled / plain %.2f\n", median(subjects[1]->ms) / median(subjects[0]->ms));
  return 0;
}
