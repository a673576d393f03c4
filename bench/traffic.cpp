// A simulation beside the renderers: cars that drive up and down, doors that open and shut, a
// building that moves, told to a daemon at a steady rate.
//   traffic ENDPOINT SCENE [SECONDS] [CARS] [HZ]
// Cars are the objects named `car` nearest to the origin, at 10 m/s along their length; doors are
// the occluders of the 20 nearest buildings, one of which is switched every half second; every
// three seconds the 21st is moved by 6 m, or back.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include <ivis/ivis.h>

#include "bench/common.h"
#include "scenes/load.h"

namespace {

using namespace ivis;
using Clock = std::chrono::steady_clock;

constexpr double kSpeed = 10;
constexpr double kHalfWayM = 15;
constexpr std::size_t kDoors = 20;

std::vector<ObjectId> nearest(const Scene& scene, const char* name) {
  std::vector<ObjectId> ids;
  for (ObjectId id = 0; id < scene.objects.size(); ++id)
    if (scene.name_of(scene.objects[id]).starts_with(name)) ids.push_back(id);
  std::ranges::sort(ids, {}, [&](ObjectId id) {
    const Vec3 c = scene.objects[id].bounds.centre();
    return c.x * c.x + c.z * c.z;
  });
  return ids;
}

ivis_edit edit_of(ivis_edit_kind kind, ObjectId id, const Vec3& position) {
  ivis_edit e{};
  e.kind = static_cast<std::uint8_t>(kind);
  e.id = id;
  for (int k = 0; k < 3; ++k)
    e.position[k] = position[k];
  e.rotation[3] = 1;
  return e;
}

/// Up and down, from 0, with the given phase of a round.
double shuttle(double t, double phase) {
  const double round = 4 * kHalfWayM / kSpeed;
  const double at = std::fmod(t + phase * round, round) * kSpeed;
  return at < 2 * kHalfWayM ? at - kHalfWayM : 3 * kHalfWayM - at;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || argc > 6) {
    std::fprintf(stderr, "usage: traffic ENDPOINT SCENE [SECONDS] [CARS] [HZ]\n");
    return 2;
  }
  const auto number = [&](int i, double otherwise, double most) {
    const double v = argc > i ? std::atof(argv[i]) : otherwise;
    if (v >= 1 && v <= most) return v;
    std::fprintf(stderr, "traffic: '%s', expected 1 to %g\n", argv[i], most);
    std::exit(2);
  };
  const double seconds = number(3, 20, 86400);
  const auto wanted = static_cast<std::size_t>(number(4, 100, 1000));
  const double hz = number(5, 60, 1000);
  const Scene scene = bench::get(load_scene(argv[2], {}, {}));
  std::vector<ObjectId> cars = nearest(scene, "car");
  cars.resize(std::min(cars.size(), wanted));
  std::vector<ObjectId> buildings = nearest(scene, "building");
  buildings.resize(std::min(buildings.size(), kDoors + 1));
  if (cars.empty() || buildings.size() <= kDoors) {
    std::fprintf(stderr, "traffic: '%s' has %zu objects named car, %zu named building\n", argv[2],
                 cars.size(), buildings.size());
    return 3;
  }

  ivis_client_options options = ivis_client_options_default();
  options.endpoint = argv[1];
  options.scene_hash = scene.hash;
  ivis_client* client = nullptr;
  char error[256];
  if (ivis_client_connect(&options, &client, error, sizeof error) != IVIS_OK) {
    std::fprintf(stderr, "traffic: %s\n", error);
    return 4;
  }
  std::unordered_map<std::uint32_t, Clock::time_point> asked;
  std::vector<double> took_ms;
  std::size_t edits = 0;
  std::size_t refused = 0;
  const auto take_results = [&] {
    ivis_edit_result result;
    while (ivis_client_edit_result(client, &result) != 0) {
      took_ms.push_back(
          std::chrono::duration<double, std::milli>(Clock::now() - asked[result.request]).count());
      asked.erase(result.request);
      if (result.epoch != 0) continue;
      if (refused++ == 0) std::fprintf(stderr, "traffic: refused: %s\n", result.refused);
    }
  };
  const auto ask = [&](const std::vector<ivis_edit>& what) {
    std::uint32_t request = 0;
    if (ivis_client_edit(client, what.data(), what.size(), &request) != IVIS_OK) {
      ++refused;
      return;
    }
    asked[request] = Clock::now();
    edits += what.size();
  };
  const auto start = Clock::now();
  const auto ticks = static_cast<std::size_t>(seconds * hz);
  std::vector<bool> open(kDoors, false);
  for (std::size_t tick = 0; tick < ticks; ++tick) {
    const double t = static_cast<double>(tick) / hz;
    std::this_thread::sleep_until(
        start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(t)));
    std::vector<ivis_edit> moves;
    for (std::size_t c = 0; c < cars.size(); ++c) {
      const Object& car = scene.objects[cars[c]];
      const bool along_x = car.bounds.size().x > car.bounds.size().z;
      const double s = shuttle(t, static_cast<double>(c) / static_cast<double>(cars.size()));
      ivis_edit e = edit_of(IVIS_EDIT_MOVE, cars[c],
                            Vec3(car.to_world[3]) + (along_x ? Vec3{s, 0, 0} : Vec3{0, 0, s}));
      e.speed_m_s = static_cast<float>(kSpeed * 1.05);
      moves.push_back(e);
    }
    ask(moves);
    const auto every = [&](double s) {
      return tick % static_cast<std::size_t>(std::max(1.0, s * hz)) == 0;
    };
    if (every(0.5)) {
      const auto door = static_cast<std::size_t>(t / 0.5) % kDoors;
      ask({edit_of(open[door] ? IVIS_EDIT_OCCLUDER_ON : IVIS_EDIT_OCCLUDER_OFF, buildings[door],
                   Vec3{0})});
      open[door] = !open[door];
    }
    if (every(3)) {
      const Vec3 at(scene.objects[buildings[kDoors]].to_world[3]);
      const bool away = static_cast<std::size_t>(t / 3) % 2 == 0;
      ask({edit_of(IVIS_EDIT_MOVE, buildings[kDoors], at + Vec3{away ? 6.0 : 0.0, 0, 0})});
    }
    take_results();
  }
  const auto until = Clock::now() + std::chrono::seconds(5);
  while (!asked.empty() && Clock::now() < until) {
    take_results();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ivis_client_close(client);
  if (took_ms.empty()) took_ms.push_back(NAN);
  std::ranges::sort(took_ms);
  std::printf(
      "%zu cars, %zu edits in %.0f s: %zu messages refused, %zu unanswered; answered within "
      "%.2f ms (median), %.2f ms (99 in 100)\n",
      cars.size(), edits, seconds, refused, asked.size(), took_ms[took_ms.size() / 2],
      took_ms[took_ms.size() * 99 / 100]);
  return refused == 0 && asked.empty() ? 0 : 1;
}
