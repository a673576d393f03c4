#include "client_lib/walk.h"

#include <cstdio>
#include <iostream>
#include <memory>

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
  options.policy =
      args.policy == "stall" ? WalkOptions::Policy::kStall : WalkOptions::Policy::kIncomplete;
  options.hz = args.hz;
  options.reach = args.reach;
  if (!args.record.empty()) options.record_file = args.record;
  std::function<void(const WalkProgress&)> on_frame;
  if (!args.json && isatty(STDERR_FILENO) != 0) on_frame = live_line;
  const auto r = walk(args.endpoint, *path, options, context, on_frame);
  if (!r) return r.error();
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
           {"method", r->method}});
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
                  "outside the cell of the last PVS: stall there, or draw incomplete")
      ->capture_default_str()
      ->check(CLI::IsMember({"stall", "incomplete"}));
  sub->add_option("--reach", args->reach, "ask for a smaller reach than the server's")
      ->type_name("R");
  sub->add_option("--hz", args->hz,
                  "poses a second; 0: as fast as answers come, each pose waits for its own")
      ->capture_default_str()
      ->check(number_within(0, 1000));
  sub->add_option("--record", args->record,
                  "write what the client was told, for 'ivis verify --record'");
  sub->add_flag("--json", args->json, "print JSON");
  sub->callback([&action, args] { action = [args] { return run_walk(*args); }; });
}

}  // namespace ivis::tool
