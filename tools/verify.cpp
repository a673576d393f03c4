#include "visibility/verify.h"

#include <algorithm>
#include <iostream>
#include <map>
#include <memory>
#include <tuple>

#include "client_lib/record.h"
#include "scenes/edited.h"
#include "tools/common.h"

namespace ivis::tool {
namespace {

struct VerifyArgs {
  SceneArgs scene;
  SolveArgs solve;
  std::filesystem::path path;
  std::filesystem::path record;
  std::size_t rays = 64;
  std::size_t stride = 1;
  std::uint64_t seed = 1;
  bool strict = false;
  bool json = false;
};

/// Sums up the reports of all cells.
class Summary {
 public:
  void add(const CellReport& r) {
    rays_ += r.rays;
    false_negatives_ += r.false_negatives;
    for (const Miss& m : r.missing)
      if (missing_.size() < 20) missing_.push_back(m);
    pvs_.push_back(static_cast<double>(r.pvs));
    seen_.push_back(static_cast<double>(r.seen));
    if (r.seen > 0) ratio_.push_back(static_cast<double>(r.pvs) / static_cast<double>(r.seen));
  }
  int report(bool json) const {
    if (json) {
      Json missing = Json::array();
      for (const Miss& m : missing_)
        missing.push_back({{"id", m.id}, {"eye", to_json(m.eye)}, {"hit", to_json(m.hit)}});
      print({{"rays", rays_},
             {"false_negatives", false_negatives_},
             {"missing", missing},
             {"pvs_median", median(pvs_)},
             {"seen_median", median(seen_)},
             {"overestimate", median(ratio_)}});
    } else {
      std::cout << pvs_.size() << " cells, " << rays_
                << " rays at culled objects: " << false_negatives_ << " objects missed; median PVS "
                << median(pvs_) << ", seen by rays " << median(seen_) << ", ratio "
                << median(ratio_) << '\n';
      for (const Miss& m : missing_)
        std::cout << "  missed: object " << m.id << " from " << to_json(m.eye).dump() << " at "
                  << to_json(m.hit).dump() << '\n';
    }
    return false_negatives_ > 0 ? kCheckFailed : kOk;
  }

 private:
  std::size_t rays_ = 0;
  std::size_t false_negatives_ = 0;
  std::vector<Miss> missing_;
  std::vector<double> pvs_, seen_, ratio_;
};

/// Progress of cells, not of each cell's rays.
Context without_progress(Context context) {
  context.progress = nullptr;
  return context;
}

BlockerChoice blockers(const VerifyArgs& args) {
  return args.strict ? BlockerChoice::kOccluding : BlockerChoice::kDrawn;
}

VerifyOptions verify_options(const VerifyArgs& args) {
  VerifyOptions options;
  options.rays_per_culled_object = args.rays;
  options.seed = args.seed;
  return options;
}

Outcome verify_path(const VerifyArgs& args, const Context& context) {
  const auto reach = args.solve.parse_reach();
  if (!reach) return reach.error();
  const auto path = read_path(args.path);
  if (!path) return path.error();
  const auto prepared = prepare(args.scene, args.solve, *reach, context);
  if (!prepared) return prepared.error();
  const auto& [scene, occluders, method] = **prepared;
  VerifyOptions options = verify_options(args);
  const auto frustum = args.solve.parse_frustum();
  if (!frustum) return frustum.error();
  options.frustum = *frustum;
  const Verifier verifier(scene, &occluders, blockers(args));
  Summary summary;
  LastShown last;
  for (std::size_t row = 0; row < path->size(); row += args.stride) {
    const auto pvs = method->solve({(*path)[row].eye, *reach}, last);
    if (!pvs) return pvs.error();
    const auto report = verifier.check(*pvs, options, without_progress(context));
    if (!report) return report.error();
    summary.add(*report);
    context.report("verify", std::min(row + args.stride, path->size()), path->size());
  }
  return summary.report(args.json);
}

/// The verifier of the scene as each frame of a record showed it, first to last.
class SceneInUse {
 public:
  SceneInUse(const Scene& scene, const client::Record& record, const OccluderSet& occluders,
             const VerifyArgs& args)
      : scene_(scene), record_(record), occluders_(occluders), args_(args) {}
  const Verifier& at(std::size_t frame) {
    for (; next_ <= frame; ++next_)
      for (const ObjectState& s : record_.frames[next_].edits) {
        verifier_.reset();
        if (s.as_in_the_file())
          states_.erase(s.id);
        else
          states_[s.id] = s;
      }
    if (!verifier_) {
      // An occluder that is off may be anything, an open door too: rays pass what is tagged so.
      const bool off =
          std::ranges::any_of(states_, [](const auto& s) { return s.second.occluder_off; });
      edited_ = edited(scene_, states_);
      verifier_ = std::make_unique<Verifier>(edited_, &occluders_,
                                             off ? BlockerChoice::kOccluding : blockers(args_));
    }
    return *verifier_;
  }

 private:
  const Scene& scene_;
  const client::Record& record_;
  const OccluderSet& occluders_;
  const VerifyArgs& args_;
  std::size_t next_ = 0;
  std::map<ObjectId, ObjectState> states_;
  Scene edited_;
  std::unique_ptr<Verifier> verifier_;
};

/// A covered frame was promised for its whole cell, an uncovered one was drawn from its eye alone.
Outcome verify_record(const VerifyArgs& args, const Context& context) {
  const auto record = client::read_record(args.record);
  if (!record) return record.error();
  if (auto s = args.solve.check_files(); !s) return s.error();
  const auto scene = args.scene.load(context);
  if (!scene) return scene.error();
  if (scene->hash != record->scene_hash)
    return mismatch("'" + args.record.string() + "' was recorded with scene " +
                    to_hex(record->scene_hash) + ", '" + args.scene.file.string() + "' is " +
                    to_hex(scene->hash) +
                    " (another file, or the same with another --granularity)");
  if (scene->objects.size() != record->objects)
    return input_error("'" + args.record.string() + "' is of " + std::to_string(record->objects) +
                       " objects, the scene has " + std::to_string(scene->objects.size()));
  if (record->frames.empty())
    return input_error("'" + args.record.string() +
                       "' holds no frame, so there is nothing to verify");
  const auto occluders = args.solve.get_occluders(*scene, record->reach, context);
  if (!occluders) return occluders.error();
  Summary summary;
  client::RecordedSets sets(*record);
  SceneInUse in_use(*scene, *record, *occluders, args);
  std::tuple<std::uint32_t, bool, bool> last;
  for (std::size_t row = 0; row < record->frames.size(); row += args.stride) {
    // The same PVS, promised for the same cell, is checked once.
    const client::RecordedFrame& frame = record->frames[row];
    const auto promise = std::tuple(frame.sequence, frame.covered, frame.everything);
    if (row != 0 && frame.covered && frame.sequence != 0 && promise == last) continue;
    last = promise;
    Pvs pvs = sets.at(row);
    if (!record->frames[row].covered) pvs.cell = {record->frames[row].eye, Reach::ball(0)};
    const auto report = in_use.at(row).check(pvs, verify_options(args), without_progress(context));
    if (!report) return report.error();
    summary.add(*report);
    context.report("verify", std::min(row + args.stride, record->frames.size()),
                   record->frames.size());
  }
  return summary.report(args.json);
}

Outcome run_verify(const VerifyArgs& args) {
  const Context context = make_context(args.json);
  return args.record.empty() ? verify_path(args, context) : verify_record(args, context);
}

}  // namespace

void add_verify(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand(
      "verify", "shoot rays at what a PVS leaves out; exit code 1 if one arrives");
  auto args = std::make_shared<VerifyArgs>();
  args->scene.add_to(*sub);
  args->solve.add_to(*sub, false);
  auto* path = sub->add_option("--path", args->path, "CSV of poses; needs --reach");
  sub->add_option("--record", args->record,
                  "what a client was told, recorded by 'ivis walk --record'")
      ->excludes(path);
  sub->add_option("--rays", args->rays, "aimed rays a culled object")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  sub->add_option("--stride", args->stride, "every K-th pose")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000000));
  sub->add_flag("--strict", args->strict,
                "see through nodes tagged 'never', which no method takes as occluders: finds more, "
                "proves more");
  sub->add_option("--seed", args->seed, "of the rays")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  sub->add_flag("--json", args->json, "print JSON");
  sub->callback([&action, args] {
    if (args->path.empty() && args->record.empty()) throw CLI::RequiredError("--path or --record");
    if (!args->record.empty() && !args->solve.frustum.empty())
      throw CLI::ExcludesError("--record", "--frustum");  // a client is told of every direction
    if (!args->path.empty() && args->solve.reach.empty()) throw CLI::RequiredError("--reach");
    action = [args] { return run_verify(*args); };
  });
}

}  // namespace ivis::tool
