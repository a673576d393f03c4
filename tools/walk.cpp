#include "client_lib/walk.h"

#include <cstdio>
#include <iostream>
#include <memory>
#include <numbers>

#include <unistd.h>

#include "tools/common.h"

namespace ivis::tool {
namespace {

struct WalkArgs {
  std::string endpoint;
  std::filesystem::path path;
  std::string policy = "stall";
  std::filesystem::path record;
  std::string reach;
  double hz = 0;
  double fps = 0;
  double seconds = 0;
  double speed_limit = 0;
  bool predict = false;
  double turning_deg_s = 0;
  std::string strategy;
  double budget_ms = 0;
  bool json = false;
};

void live_line(const WalkProgress& p) {
  std::fprintf(stderr,
               "\rpose %zu/%zu  visible %u  visibility %.3f ms  round trip %.3f ms  %.0f B/pose  "
               "stalls %llu  uncovered %llu\x1b[K%s",
               p.done, p.total, p.visible, p.solve_ms, p.round_trip_ms,
               static_cast<double>(p.bytes) / static_cast<double>(p.done),
               static_cast<unsigned long long>(p.stalls),
               static_cast<unsigned long long>(p.uncovered_frames), p.done == p.total ? "\n" : "");
}

Outcome run_walk(const WalkArgs& args) {
  if (!args.reach.empty())
    if (auto reach = Reach::parse(args.reach); !reach) return reach.error();
  if (!args.record.empty())
    if (auto s = check_output_file(args.record); !s) return s.error();
  const Context context = make_context(args.json);
  const auto path = read_path(args.path);
  if (!path) return path.error();
  WalkOptions options;
  options.policy = args.policy == "stall"      ? WalkOptions::Policy::kStall
                   : args.policy == "show-all" ? WalkOptions::Policy::kEverything
                                               : WalkOptions::Policy::kIncomplete;
  options.fps = args.fps;
  options.seconds = args.seconds;
  options.speed_limit_m_s = args.speed_limit;
  options.predict = args.predict || args.turning_deg_s > 0;
  options.turning_rad_s = args.turning_deg_s * std::numbers::pi / 180;
  options.strategy = parse_strategy(args.strategy);
  options.budget_ms = args.budget_ms;
  options.hz = args.hz;
  options.reach = args.reach;
  if (!args.record.empty()) options.record_file = args.record;
  std::function<void(const WalkProgress&)> on_frame;
  if (!args.json && isatty(STDERR_FILENO) != 0) on_frame = live_line;
  const auto r = walk(args.endpoint, *path, options, context, on_frame);
  if (!r) return r.error();
  nlohmann::json causes = nlohmann::json::object();
  for (const auto& [cause, frames] : r->causes)
    causes[cause] = frames;
  if (args.json) {
    print({{"poses", r->poses},
           {"stalls", r->stalls},
           {"uncovered_frames", r->uncovered_frames},
           {"bytes_mean", r->bytes_mean},
           {"bytes_median", r->bytes_median},
           {"round_trip_ms_p50", r->round_trip_ms_p50},
           {"round_trip_ms_p99", r->round_trip_ms_p99},
           {"solve_ms_p50", r->solve_ms_p50},
           {"overhead_ms_p50", r->overhead_ms_p50},
           {"pvs_median", r->pvs_median},
           {"objects", r->objects},
           {"answers", r->answers},
           {"reconnects", r->reconnects},
           {"reach", r->reach},
           {"method", r->method},
           {"t_vis_ms_p50", r->round_trip_ms_p50},
           {"t_vis_ms_p99", r->round_trip_ms_p99},
           {"reach_median", r->reach_median},
           {"held_m", r->held_m},
           {"stall_causes", causes},
           {"pvs_age_ms_p99", r->age_ms_p99},
           {"margin_m_p01", r->margin_m_p01},
           {"latency_ms", r->latency_ms},
           {"interval_ms", r->interval_ms},
           {"hold_ms", r->hold_ms},
           {"epoch", r->epoch},
           {"frames", r->frames}});
    return kOk;
  }
  std::printf(
      "poses               %llu (%llu answered)\n"
      "PVS                 median %.0f of %u objects (%s, %s)\n"
      "visibility time     %.3f ms p50\n"
      "round trip          %.3f ms p50, %.3f ms p99\n"
      "bytes a pose        %.0f mean, %.0f median\n"
      "stalls              %llu\n"
      "uncovered frames    %llu\n",
      static_cast<unsigned long long>(r->poses), static_cast<unsigned long long>(r->answers),
      r->pvs_median, r->objects, r->method.c_str(), r->reach.c_str(), r->solve_ms_p50,
      r->round_trip_ms_p50, r->round_trip_ms_p99, r->bytes_mean, r->bytes_median,
      static_cast<unsigned long long>(r->stalls),
      static_cast<unsigned long long>(r->uncovered_frames));
  if (args.fps > 0)
    std::printf(
        "cells               %.2f m median reach, %.3f m left to the border (1 in 100 less)\n"
        "a PVS is used       %.1f ms past its pose (L %.1f ms, T %.1f ms); its age %.1f ms p99\n",
        r->reach_median, r->margin_m_p01, r->hold_ms, r->latency_ms, r->interval_ms, r->age_ms_p99);
  if (r->stalls > 0) std::printf("held back           %.3f m in all\n", r->held_m);
  for (const auto& [cause, frames] : r->causes)
    std::printf("  outside the cell  %llu frames: %s\n", static_cast<unsigned long long>(frames),
                cause.c_str());
  return kOk;
}

}  // namespace

void add_walk(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand(
      "walk", "walk a client along a path past a running ivisd, and account for it");
  auto args = std::make_shared<WalkArgs>();
  sub->add_option("--connect", args->endpoint, "the daemon's address, as in tcp://127.0.0.1:7447")
      ->required()
      ->type_name("E");
  sub->add_option("--path", args->path, "CSV of poses: columns x,y,z by name")->required();
  sub->add_option("--policy", args->policy,
                  "outside the cell of the last PVS: stall at its border, draw incomplete, or "
                  "show all objects")
      ->capture_default_str()
      ->check(CLI::IsMember({"stall", "incomplete", "show-all"}));
  sub->add_option("--reach", args->reach,
                  "cells of this reach, at most the server's (default: the server chooses)")
      ->type_name("R");
  auto* fps = sub->add_option("--fps", args->fps,
                              "walk in real time, so many frames a second: the path is played by "
                              "its column t, and the server is told how fast that is")
                  ->check(number_within(1, 1000));
  sub->add_option("--seconds", args->seconds,
                  "how long, there and back again (default: once along the path)")
      ->needs(fps)
      ->check(number_within(0, 1e6));
  sub->add_option("--speed-limit", args->speed_limit,
                  "walk no faster than this, and tell the server (default: the path's speed)")
      ->needs(fps)
      ->type_name("M_S")
      ->check(number_within(0, 1e6));
  sub->add_option("--strategy", args->strategy,
                  "how the server keeps to its time: all there is, stop drawing, or choose before "
                  "drawing (default: the server's)")
      ->check(CLI::IsMember({"guaranteed", "abort", "predictive"}));
  sub->add_option("--budget-ms", args->budget_ms,
                  "of one solve, for abort and predictive (default: the server's)")
      ->check(number_within(0.001, 1e6));
  sub->add_flag("--predict", args->predict,
                "centre cells where the observer is going instead of where it is")
      ->needs(fps);
  sub->add_option("--turning", args->turning_deg_s,
                  "by how much the direction of travel turns at most, as a vehicle's, which makes "
                  "cells ahead smaller; implies --predict")
      ->needs(fps)
      ->type_name("DEG_S")
      ->check(number_within(0, 1e6));
  sub->add_option("--hz", args->hz,
                  "rows of the path a second; 0: as fast as answers come, each pose waits for its "
                  "own")
      ->capture_default_str()
      ->excludes(fps)
      ->check(number_within(0, 1000));
  sub->add_option("--record", args->record,
                  "write what the client was told, for 'ivis verify --record' and 'ivis replay'");
  sub->add_flag("--json", args->json, "print JSON");
  sub->callback([&action, args] { action = [args] { return run_walk(*args); }; });
}

}  // namespace ivis::tool
