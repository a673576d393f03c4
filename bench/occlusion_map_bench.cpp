// The CPU occlusion map against the pinned yardstick, in one run on one thread: medians of CPU time
// a pose, interleaved round by round, and a hash of all answers, so that a fast wrong answer shows;
// then the same by SIMD target.
//
//   occlusion_map_bench SCENE.glb PATH.csv REACH [ROUNDS] [PIXELS] [targets|turned]
//
// `targets` adds the time by SIMD target, `turned` the same scene and path turned by a rotation in
// space.

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
#include "visibility/occlusion_map.h"

#include <glm/gtc/matrix_transform.hpp>

namespace {

using namespace ivis;
using bench::cpu_ms;
using bench::get;
using bench::median;

Mat4 turn() {
  return glm::rotate(Mat4{1}, 0.7, glm::normalize(Vec3{1, 2, 3}));
}

Scene turned(const Scene& scene) {
  Scene out;
  out.meshes = scene.meshes;
  out.node_names = scene.node_names;
  for (Object o : scene.objects) {
    o.to_world = turn() * o.to_world;
    out.objects.push_back(o);
  }
  if (const auto s = finish_scene(out); !s) std::exit(3);
  return out;
}

struct Subject {
  std::string name;
  Scene scene;
  OccluderSet occluders;
  std::unique_ptr<OcclusionMap> map;
  std::vector<double> ms;
  std::vector<double> counts;
  std::vector<double> boxes;  ///< without buildings
  std::uint64_t hash = 1469598103934665603ULL;
  OcclusionMap::Stats stats;

  Subject(std::string n, Scene s, const Reach& reach, std::uint32_t pixels)
      : name(std::move(n)), scene(std::move(s)) {
    ShrinkOptions options;
    options.reach = reach;
    occluders = get(shrink(scene, options, FastEroder{})).set;
    MethodOptions method;
    method.map_pixels = pixels;
    map = std::make_unique<OcclusionMap>(scene, occluders, method);
  }

  void run(const std::vector<Pose>& path, const Reach& reach, bool first) {
    for (const Pose& pose : path) {
      OcclusionMap::Stats s;
      const double begin = cpu_ms();
      const auto pvs = map->solve({pose.eye, reach}, s);
      ms.push_back(cpu_ms() - begin);
      if (!first || !pvs) continue;
      stats.pieces_drawn += s.pieces_drawn;
      stats.pieces_tested += s.pieces_tested;
      stats.faces_drawn += s.faces_drawn;
      stats.blocks_drawn += s.blocks_drawn;
      stats.nodes_tested += s.nodes_tested;
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
    std::fprintf(
        stderr,
        "usage: occlusion_map_bench SCENE.glb PATH.csv REACH [ROUNDS] [PIXELS] [targets|turned]\n");
    return 2;
  }
  const std::vector<Pose> path = get(read_path(argv[2]));
  const Reach reach = get(Reach::parse(argv[3]));
  const int rounds = argc > 4 ? std::atoi(argv[4]) : 5;
  const auto pixels = static_cast<std::uint32_t>(argc > 5 ? std::atoi(argv[5]) : 512);
  if (pixels % 16 != 0 || pixels < 64 || pixels > 4096) {
    std::fprintf(stderr, "occlusion_map_bench: PIXELS is a multiple of 16 from 64 to 4096\n");
    return 2;
  }
  Scene scene = get(load_scene(argv[1]));
  std::vector<std::unique_ptr<Subject>> subjects;
  bench::Yardstick yardstick(scene);
  const std::string extra = argc > 6 ? argv[6] : "";
  std::vector<Pose> turned_path = path;
  for (Pose& pose : turned_path)
    pose.eye = Vec3(turn() * glm::dvec4(pose.eye, 1));
  if (extra == "turned")
    subjects.push_back(std::make_unique<Subject>("turned", turned(scene), reach, pixels));
  subjects.push_back(std::make_unique<Subject>("occlusion", std::move(scene), reach, pixels));

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
      s->run(s->name == "turned" ? turned_path : path, reach, r == 0);
  }
  const double yard = median(yard_ms);
  std::printf("%zu poses, %d rounds, reach %s, %u pixels a face\n", path.size(), rounds, argv[3],
              pixels);
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
        "           a pose: %.0f pieces drawn of %.0f tested, %.0f faces, %.0f blocks, %.0f nodes "
        "tested\n",
        s->stats.pieces_drawn / poses, s->stats.pieces_tested / poses, s->stats.faces_drawn / poses,
        s->stats.blocks_drawn / poses, s->stats.nodes_tested / poses);
  }
  for (const char* target : depth_targets()) {
    if (extra != "targets" || !use_depth_target(target)) continue;
    Subject& s = *subjects.front();
    s.ms.clear();
    s.run(path, reach, false);
    std::printf("%-10s %9.4f ms a pose\n", target, median(s.ms));
  }
  return 0;
}
