// What edits cost a server: the edit, the first answer after it, and what mends beside it.
//   edit_bench SCENE [REACH]
// Times are thread CPU time, medians over 40 buildings; solves are beside those of the same run
// without edits.

#include <chrono>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "bench/common.h"
#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "scenes/load.h"
#include "server/scene_state.h"
#include "visibility/method.h"

namespace {

using namespace ivis;
using namespace ivis::bench;
using server::SceneState;

SceneState::Time now() {
  return std::chrono::steady_clock::now();
}

template <class F>
double us(const F& f) {
  const double start = cpu_ms();
  f();
  return 1e3 * (cpu_ms() - start);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::fprintf(stderr, "usage: edit_bench SCENE [REACH]\n");
    return 2;
  }
  const Reach reach = get(Reach::parse(argc > 2 ? argv[2] : "cylinder:1.5,0.1"));
  const Scene scene = get(load_scene(argv[1], {}, {}));
  ShrinkOptions options;
  options.reach = reach;
  options.margins = false;
  const OccluderSet set = get(shrink(scene, options, FastEroder{})).set;
  std::optional<OccluderIndex> index;
  const double index_us = us([&] { index.emplace(set); });
  const auto method = get(make_method("cull-map", scene, set, {}));
  SceneState state(scene);
  std::vector<ObjectId> buildings;
  std::vector<ObjectId> others;
  for (ObjectId id = 0; id < scene.objects.size(); ++id) {
    const Object& o = scene.objects[id];
    if (is_matter(scene, o) && !holds_ground(scene, o))
      buildings.push_back(id);
    else if (o.tag == OccluderTag::kNever && !holds_ground(scene, o))
      others.push_back(id);
  }
  if (buildings.size() < 80 || others.size() < 100) {
    std::fprintf(stderr, "edit_bench: '%s' has %zu objects that occlude, %zu that do not\n",
                 argv[1], buildings.size(), others.size());
    return 3;
  }
  std::size_t refused = 0;
  const auto edit = [&](const std::vector<Edit>& edits) {
    const auto outcome = state.apply(edits, now());
    if (outcome.epoch == 0 && refused++ == 0) std::printf("refused: %s\n", outcome.why.c_str());
  };
  const auto amendment = [&] { return state.amendment(*index, now(), now()); };
  const auto moved = [&](ObjectId id, double by, float speed) {
    return Edit{EditKind::kMove,
                id,
                {Vec3(scene.objects[id].to_world[3]) + Vec3{by, 0, 0}, {1, 0, 0, 0}},
                speed};
  };
  const auto mended = [&] {
    const auto start = now();
    do {
      std::this_thread::yield();
      static_cast<void>(amendment());
    } while (state.mending());
    return std::chrono::duration<double, std::micro>(now() - start).count();
  };
  const Vec3 eye{0, 1.7, 0};
  /// Of a solve by the amendment, to one without, by turns.
  const auto ratio = [&](const Amendment& a) {
    std::vector<double> plain;
    std::vector<double> amended;
    const auto timed = [&](const auto& solve) {
      return us([&] {
        if (!solve()) ++refused;
      });
    };
    for (int k = 0; k < 101; ++k) {
      Work work;
      plain.push_back(timed([&] { return method->solve({eye, reach}, {}, work); }));
      amended.push_back(timed([&] { return method->solve({eye, reach}, {}, a, work); }));
    }
    return median(amended) / median(plain);
  };
  edit({moved(buildings[0], 1, 0)});  // the first edit makes the rung's counts
  static_cast<void>(amendment());
  mended();

  std::vector<double> off, on, again, first, move, first_moved, mending;
  for (std::size_t k = 0; k < 40; ++k) {
    const ObjectId id = buildings[(k + 1) * buildings.size() / 42];
    off.push_back(us([&] { edit({{EditKind::kOccluderOff, id, {}, 0}}); }));
    first.push_back(us([&] { static_cast<void>(amendment()); }));
    mending.push_back(mended());
    on.push_back(us([&] { edit({{EditKind::kOccluderOn, id, {}, 0}}); }));
    mended();
    again.push_back(us([&] { edit({{EditKind::kOccluderOff, id, {}, 0}}); }));
    edit({{EditKind::kOccluderOn, id, {}, 0}});
    mended();
    move.push_back(us([&] { edit({moved(id, 5, 0)}); }));
    first_moved.push_back(us([&] { static_cast<void>(amendment()); }));
    mending.push_back(mended());
    edit({moved(id, 0, 0)});
    mended();
  }
  std::printf("%zu prisms, %zu objects; index made in %.0f us\n", set.shrunk.size(),
              scene.objects.size(), index_us);
  std::printf(
      "occluder off %.1f us, on %.1f us, off again %.1f us; first amendment after it %.1f us\n",
      median(off), median(on), median(again), median(first));
  std::printf(
      "building moved %.1f us, first amendment after it %.1f us; mended %.0f us later "
      "(elapsed)\n",
      median(move), median(first_moved), median(mending));
  std::printf("a solve with one building displaced takes %.2f times that without edits\n",
              ratio(*amendment()));
  std::vector<double> cars, amended;
  for (int tick = 0; tick < 50; ++tick) {
    std::vector<Edit> edits;
    for (std::size_t c = 0; c < 100; ++c)
      edits.push_back(moved(others[c * others.size() / 100], 0.1 * tick, 10));
    cars.push_back(us([&] { edit(edits); }));
    amended.push_back(us([&] { static_cast<void>(amendment()); }));
  }
  const auto a = amendment();
  std::printf(
      "100 movers told %.1f us, amendment %.1f us; a solve takes %.2f times that without "
      "edits\n",
      median(cars), median(amended), ratio(*a));
  return refused == 0 ? 0 : 1;
}
