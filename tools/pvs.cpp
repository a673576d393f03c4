#include <chrono>
#include <iostream>
#include <memory>
#include <sstream>

#include "tools/common.h"

namespace ivis::tool {
namespace {

struct PvsArgs {
  SceneArgs scene;
  SolveArgs solve;
  std::vector<std::string> eyes;
  std::filesystem::path path;
  std::filesystem::path dump;
  bool json = false;
};

struct Timed {
  Pvs pvs;
  double compute_ms = 0;
  double wall_ms = 0;
};

Result<Timed> timed_solve(const Method& method, const ViewCell& cell, LastShown& last) {
  const auto wall = std::chrono::steady_clock::now();
  const double cpu = cpu_seconds();
  auto pvs = method.solve(cell, last);
  const double cpu_ms = (cpu_seconds() - cpu) * 1e3;
  const std::chrono::duration<double, std::milli> wall_ms = std::chrono::steady_clock::now() - wall;
  if (!pvs) return pvs.error();
  return Timed{std::move(*pvs), cpu_ms, wall_ms.count()};
}

Outcome one_eye(const PvsArgs& args, const Scene& scene, const Method& method,
                const ViewCell& cell) {
  // Once to warm caches and take memory, once to time.
  if (auto warm = method.solve(cell); !warm) return warm.error();
  LastShown last;
  const auto t = timed_solve(method, cell, last);
  if (!t) return t.error();
  const MethodTraits& traits = method.traits();
  const char* guarantee = to_string(traits.guarantee);
  if (args.json) {
    Json j{{"method", traits.name},         {"guarantee", guarantee},
           {"objects", t->pvs.objects},     {"count", t->pvs.objects.size()},
           {"total", scene.objects.size()}, {"compute_ms", t->compute_ms},
           {"wall_ms", t->wall_ms},         {"backend", to_string(method.backend())}};
    if (!t->pvs.everything_because.empty()) j["everything_because"] = t->pvs.everything_because;
    print(j);
    return kOk;
  }
  std::cout << t->pvs.objects.size() << " of " << scene.objects.size()
            << " objects can be seen from " << cell.reach.to_string() << " about "
            << to_json(cell.eye).dump() << "  (" << traits.name << ", " << guarantee << ", "
            << t->compute_ms << " ms)\n";
  if (!t->pvs.everything_because.empty())
    std::cout << "everything is listed: " << t->pvs.everything_because << '\n';
  return kOk;
}

std::string row_name(std::size_t row) {
  std::string digits = std::to_string(row);
  return std::string(digits.size() < 5 ? 5 - digits.size() : 0, '0') + digits + ".txt";
}

Outcome along_path(const PvsArgs& args, const std::vector<Pose>& path, const Scene& scene,
                   const Method& method, const Reach& reach, const Context& context) {
  if (!args.dump.empty()) {
    std::error_code ec;
    std::filesystem::create_directories(args.dump, ec);
    if (ec) return io_error("cannot make folder '" + args.dump.string() + "': " + ec.message());
  }
  if (auto warm = method.solve({path.front().eye, reach}); !warm) return warm.error();
  Json poses = Json::array();
  LastShown last;
  std::vector<double> counts;
  std::vector<double> compute;
  std::vector<double> wall;
  for (std::size_t row = 0; row < path.size(); ++row) {
    if (context.stopped()) return cancelled();
    const auto t = timed_solve(method, {path[row].eye, reach}, last);
    if (!t) return t.error();
    counts.push_back(static_cast<double>(t->pvs.objects.size()));
    compute.push_back(t->compute_ms);
    wall.push_back(t->wall_ms);
    poses.push_back({{"eye", to_json(path[row].eye)},
                     {"count", t->pvs.objects.size()},
                     {"compute_ms", t->compute_ms}});
    if (!args.dump.empty()) {
      std::string ids;
      for (const ObjectId id : t->pvs.objects)
        ids += std::to_string(id) + '\n';
      if (auto s = write_file_whole(args.dump / row_name(row), ids); !s) return s.error();
    }
    context.report("poses", row + 1, path.size());
  }
  if (args.json) {
    print({{"poses", poses},
           {"count_median", median(counts)},
           {"compute_ms_median", median(compute)},
           {"compute_ms_p99", percentile(compute, 0.99)},
           {"wall_ms_median", median(wall)},
           {"backend", to_string(method.backend())}});
    return kOk;
  }
  std::cout << path.size() << " poses: median " << median(counts) << " of " << scene.objects.size()
            << " objects, median " << median(compute) << " ms CPU (p99 "
            << percentile(compute, 0.99) << "), " << method.traits().name << ", "
            << to_string(method.traits().guarantee) << '\n';
  return kOk;
}

Outcome run_pvs(const PvsArgs& args) {
  const auto reach = args.solve.parse_reach();
  if (!reach) return reach.error();
  ViewCell cell{{}, *reach};
  std::vector<Vec3> eyes;
  for (const std::string& text : args.eyes) {
    const auto eye = parse_point(text);
    if (!eye) return eye.error();
    eyes.push_back(*eye);
  }
  if (!eyes.empty() && args.solve.selection != "conservative")
    return invalid_argument("--selection " + args.solve.selection +
                            " goes by the last pose: it needs --path, not --eye");
  if (!eyes.empty()) cell = cover(eyes, *reach);
  std::vector<Pose> path;
  if (eyes.empty()) {
    auto poses = read_path(args.path);
    if (!poses) return poses.error();
    path = std::move(*poses);
  }
  if (!args.dump.empty())
    if (auto s = check_output_folder(args.dump); !s) return s.error();
  const Context context = make_context(args.json);
  const auto prepared = prepare(args.scene, args.solve, cell.reach, context);
  if (!prepared) return prepared.error();
  const auto& [scene, occluders, method] = **prepared;
  return eyes.empty() ? along_path(args, path, scene, *method, *reach, context)
                      : one_eye(args, scene, *method, cell);
}

}  // namespace

void add_pvs(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand("pvs",
                                     "the objects that can be seen from anywhere within reach of "
                                     "an eye, or of each pose of a path");
  auto args = std::make_shared<PvsArgs>();
  args->scene.add_to(*sub);
  args->solve.add_to(*sub, true);
  auto* eye =
      sub->add_option(
             "--eye", args->eyes,
             "the observer's eye; given again, one set that serves all eyes, each within the reach")
          ->type_name("X,Y,Z")
          ->allow_extra_args(false);
  auto* path =
      sub->add_option("--path", args->path, "CSV of poses: columns x,y,z by name")->excludes(eye);
  sub->add_option("--dump", args->dump,
                  "write each pose's ids, one a line, to DIR/00000.txt, DIR/00001.txt, ...")
      ->type_name("DIR")
      ->needs(path);
  sub->add_flag("--json", args->json, "print JSON");
  sub->callback([&action, args] {
    if (args->eyes.empty() && args->path.empty()) throw CLI::RequiredError("--eye or --path");
    action = [args] { return run_pvs(*args); };
  });
}

}  // namespace ivis::tool
