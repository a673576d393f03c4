#include "client_lib/replay.h"

#include <iostream>
#include <memory>

#include "tools/common.h"

namespace ivis::tool {
namespace {

struct ReplayArgs {
  std::filesystem::path record;
  std::string endpoint;
  std::string strategy;
  double budget_ms = 0;
  bool json = false;
};

Outcome run_replay(const ReplayArgs& args) {
  const auto record = client::read_record(args.record);
  if (!record) return record.error();
  ReplayOptions options;
  options.strategy = parse_strategy(args.strategy);
  options.budget_ms = args.budget_ms;
  const auto r = replay(args.endpoint, *record, options, make_context(args.json));
  if (!r) {
    if (r.error().code == ErrorCode::kInput)
      return input_error("'" + args.record.string() + "': " + r.error().message);
    return r.error();
  }
  const bool good = r->same == r->poses && r->poses > 0;
  if (args.json) {
    nlohmann::json differences = nlohmann::json::array();
    for (const ReplayDifference& d : r->differences)
      differences.push_back({{"frame", d.frame}, {"missing", d.missing}, {"extra", d.extra}});
    print({{"frames", record->frames.size()},
           {"poses", r->poses},
           {"same", r->same},
           {"different", r->different},
           {"other_cell", r->other_cell},
           {"differences", differences}});
    return good ? kOk : kCheckFailed;
  }
  std::cout << r->poses << " poses of " << record->frames.size() << " frames: " << r->same
            << " answered as recorded, " << r->different << " not";
  if (r->other_cell > 0) std::cout << ", " << r->other_cell << " for a cell of another reach";
  std::cout << '\n';
  for (const ReplayDifference& d : r->differences)
    std::cout << "  frame " << d.frame << ": " << d.missing << " objects fewer, " << d.extra
              << " more than recorded\n";
  return good ? kOk : kCheckFailed;
}

}  // namespace

void add_replay(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand(
      "replay", "ask a running ivisd again for every PVS of a record, and compare");
  auto args = std::make_shared<ReplayArgs>();
  sub->add_option("record", args->record, "what 'ivis walk --record' wrote")
      ->required()
      ->type_name("F");
  sub->add_option("--connect", args->endpoint, "the daemon's address, as in tcp://127.0.0.1:7447")
      ->required()
      ->type_name("E");
  sub->add_option("--strategy", args->strategy, "as the walk wished (default: the server's)")
      ->check(CLI::IsMember({"guaranteed", "abort", "predictive"}));
  sub->add_option("--budget-ms", args->budget_ms, "likewise")->check(number_within(0, 1e6));
  sub->add_flag("--json", args->json, "print JSON");
  sub->callback([&action, args] { action = [args] { return run_replay(*args); }; });
}

}  // namespace ivis::tool
