// Many renderers on one daemon, in one process: each walks a stretch of the path of its own, at its
// own phase of the frame, and is timed from a pose to the moment its PVS is decoded.
//   many_clients ENDPOINT PATH [CLIENTS] [SECONDS] [FPS]
// One thread: what it takes off the daemon's cores is counted and printed.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <thread>
#include <vector>

#include <ivis/ivis.h>

#include "bench/common.h"
#include "core/path.h"

namespace {

using namespace ivis;
using Clock = std::chrono::steady_clock;
constexpr double kWarmUpS = 3;  // sessions begun, latencies known

struct Renderer {
  ivis_client* client = nullptr;
  std::size_t start = 0;  ///< row of the path
  double next = 0;        ///< seconds, of its next frame
  std::uint32_t posed = 0, seen = 0;
  std::vector<double> t_vis_ms, solve_ms;
  std::uint64_t frames = 0, uncovered = 0, visible = 0;
};

double seconds_since(Clock::time_point t) {
  return std::chrono::duration<double>(Clock::now() - t).count();
}

double quantile(std::vector<double> v, double q) {
  if (v.empty()) return NAN;
  const auto at =
      std::min(v.size() - 1, static_cast<std::size_t>(q * static_cast<double>(v.size())));
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(at), v.end());
  return v[at];
}

/// There and back again.
Vec3 eye_at(const std::vector<Pose>& path, const Renderer& r, double t) {
  const double row = t / (path[1].t - path[0].t);
  const std::size_t last = path.size() - 1;
  const auto eye = [&](std::size_t i) {
    i %= 2 * last;
    return path[i <= last ? i : 2 * last - i].eye;
  };
  const auto whole = static_cast<std::size_t>(row);
  return glm::mix(eye(r.start + whole), eye(r.start + whole + 1), row - static_cast<double>(whole));
}

void look(Renderer& r, const Vec3& eye, bool timed) {
  ivis_frame frame;
  ivis_client_view(r.client, &eye.x, &frame);
  if (frame.sequence == r.seen) return;
  r.seen = frame.sequence;
  ivis_stats stats;
  ivis_client_stats(r.client, &stats);
  if (!timed) return;
  r.t_vis_ms.push_back(stats.last_round_trip_ms);
  r.solve_ms.push_back(stats.last_solve_ms);
  r.visible += frame.visible_count;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || argc > 6) {
    std::fprintf(stderr, "usage: many_clients ENDPOINT PATH [CLIENTS] [SECONDS] [FPS]\n");
    return 2;
  }
  const std::vector<Pose> path = bench::get(read_path(argv[2]));
  const auto number = [&](int i, double otherwise, double most) {
    const double v = argc > i ? std::atof(argv[i]) : otherwise;
    if (v >= 1 && v <= most) return v;
    std::fprintf(stderr, "many_clients: '%s', expected 1 to %g\n", argv[i], most);
    std::exit(2);
  };
  const auto count = static_cast<std::size_t>(number(3, 64, 1000));
  const double seconds = number(4, 20, 86400);
  const double fps = number(5, 60, 1000);
  if (path.size() < 2 || !(path[1].t > path[0].t)) {
    std::fprintf(stderr, "many_clients: '%s' needs two rows with times, at even steps\n", argv[2]);
    return 3;
  }
  double speed = 0;
  for (std::size_t i = 1; i < path.size(); ++i)
    speed = std::max(
        speed, std::hypot(path[i].eye.x - path[i - 1].eye.x, path[i].eye.z - path[i - 1].eye.z) /
                   (path[i].t - path[i - 1].t));

  std::vector<Renderer> all(count);
  for (std::size_t i = 0; i < count; ++i) {
    ivis_client_options options = ivis_client_options_default();
    options.endpoint = argv[1];
    options.policy = IVIS_POLICY_STALL;
    options.pace = {speed * 1.01, 0.01, 1 / fps, 0};
    char error[256];
    if (ivis_client_connect(&options, &all[i].client, error, sizeof error) != IVIS_OK) {
      std::fprintf(stderr, "many_clients: client %zu: %s\n", i, error);
      return 4;
    }
    all[i].start = i * (path.size() - 1) / count;
    all[i].next = static_cast<double>(i) / (fps * static_cast<double>(count));
  }

  const auto start = Clock::now();
  double begun_cpu = bench::cpu_ms();
  bool warm = false;
  for (double t = 0; t < kWarmUpS + seconds; t = seconds_since(start)) {
    if (!warm && t >= kWarmUpS) {
      warm = true;
      begun_cpu = bench::cpu_ms();
    }
    double soonest = t + 1;
    for (Renderer& r : all) {
      if (r.next <= t) {
        const Vec3 eye = eye_at(path, r, t);
        ivis_client_pose(r.client, &eye.x);
        ++r.posed;
        ivis_frame frame;
        ivis_client_view(r.client, &eye.x, &frame);
        if (warm) {
          ++r.frames;
          r.uncovered += frame.covered == 0 || frame.stalled != 0 ? 1 : 0;
        }
        r.next += 1 / fps;
        if (r.next < t) r.next = t;  // hitched: frames are not made up for
      }
      if (r.seen != r.posed) look(r, eye_at(path, r, t), warm);
      soonest = std::min(soonest, r.next);
    }
    const double left = soonest - seconds_since(start);
    std::this_thread::sleep_for(std::chrono::duration<double>(std::clamp(left, 0.0001, 0.0005)));
  }
  const double cpu = (bench::cpu_ms() - begun_cpu) / 1000 / seconds;

  std::vector<double> p50;
  std::vector<double> p99;
  std::vector<double> solve;
  std::vector<double> hold;
  std::uint64_t visible = 0;
  std::uint64_t frames = 0;
  std::uint64_t outside = 0;
  std::uint64_t answers = 0;
  for (Renderer& r : all) {
    p50.push_back(quantile(r.t_vis_ms, 0.5));
    p99.push_back(quantile(r.t_vis_ms, 0.99));
    solve.push_back(quantile(r.solve_ms, 0.5));
    ivis_stats stats;
    ivis_client_stats(r.client, &stats);
    hold.push_back(stats.hold_ms);
    visible += r.visible;
    frames += r.frames;
    outside += r.uncovered;
    answers += r.t_vis_ms.size();
    ivis_client_close(r.client);
  }
  std::printf("%zu clients, %.0f frames/s, %.0f s: %.2f answers a frame\n", count, fps, seconds,
              static_cast<double>(answers) / static_cast<double>(frames));
  std::printf("t_vis p50: median client %.2f ms, worst %.2f ms\n", quantile(p50, 0.5),
              quantile(p50, 1));
  std::printf("t_vis p99: median client %.2f ms, worst %.2f ms\n", quantile(p99, 0.5),
              quantile(p99, 1));
  std::printf(
      "solve p50: median client %.2f ms; PVS held for: median %.1f ms, worst %.1f ms; PVS of "
      "%.0f objects\n",
      quantile(solve, 0.5), quantile(hold, 0.5), quantile(hold, 1),
      static_cast<double>(visible) / static_cast<double>(answers));
  std::printf("held or uncovered: %llu of %llu frames; this thread: %.2f of a core\n",
              static_cast<unsigned long long>(outside), static_cast<unsigned long long>(frames),
              cpu);
  return 0;
}
