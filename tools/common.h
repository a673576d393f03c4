#pragma once
// What the subcommands of `ivis` share: options, exit codes, progress, JSON.

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/context.h"
#include "core/frustum.h"
#include "core/path.h"
#include "core/reach.h"
#include "core/result.h"
#include "occluders/shrink.h"
#include "scenes/load.h"
#include "visibility/method.h"

namespace ivis::tool {

using Json = nlohmann::ordered_json;

enum Exit {
  kOk = 0,
  kCheckFailed = 1,
  kUsage = 2,
  kBadInput = 3,
  kNoConnection = 4,
  kInterrupted = 130
};

/// Accepts numbers from `least` to `most`; CLI::Range lets what is not a number pass.
CLI::Validator number_within(double least, double most);

/// What a subcommand's action ends with: an exit code, or an error that is printed and mapped to
/// one.
using Outcome = Result<int>;

int exit_code(const Error& error);

/// Progress bar on a terminal's standard error, Ctrl-C as Context::stop, log lines to standard
/// error.
Context make_context(bool quiet);

void print(const Json& json);
Json to_json(const Vec3& v);

/// "X,Y,Z" -> Vec3; CLI11 validator and converter.
Result<Vec3> parse_point(const std::string& text);

/// SCENE and how to read it.
struct SceneArgs {
  std::filesystem::path file;
  bool honour_sidedness = false;
  std::string granularity = "object";
  /// `splits`: with --granularity.
  void add_to(CLI::App& app, bool splits = true);
  bool clustered() const;
  Result<Scene> load(const Context& context) const;
};

/// What a file or folder to be read or written can be refused for before the work that leads up to
/// it. Nothing is opened for writing: the write itself may still fail. Errors: kIo, naming the
/// path.
Status check_input_file(const std::filesystem::path& file);
Status check_output_file(const std::filesystem::path& file);
Status check_output_folder(const std::filesystem::path& folder);  ///< that need not be there yet

/// Where observers may be: --inside, --path, --outside.
struct ViewSpaceArgs {
  std::vector<std::string> inside;
  std::filesystem::path path;
  bool outside = false;
  void add_to(CLI::App& app);
  Result<ViewSpace> read() const;
};

/// --reach, --method, --map, --occluders, --threads ...: everything a solve needs.
struct SolveArgs {
  std::string reach;
  std::string method = "cull-map";
  std::string map = "polar";
  std::string backend = "auto";
  std::filesystem::path occluders;
  unsigned threads = 1;
  std::size_t max_occluders = 0;
  std::string selection = "conservative";
  std::uint32_t map_pixels = MethodOptions{}.map_pixels;
  std::size_t rays = 256;
  std::string frustum;
  void add_to(CLI::App& app, bool reach_required);
  Result<Reach> parse_reach() const;
  /// None when not asked for.
  Result<std::optional<Frustum>> parse_frustum() const;
  /// Of what needs no scene. Errors: kIo.
  Status check_files() const;
  /// The occluder file, or the scene shrunk here and now by the fast builder.
  Result<OccluderSet> get_occluders(const Scene& scene, const Reach& reach,
                                    const Context& context) const;
  Result<std::unique_ptr<Method>> make(const Scene& scene, const OccluderSet& set,
                                       const Context& context) const;
};

/// What most subcommands work on. Not movable: `method` borrows the rest.
struct Prepared {
  Scene scene;
  OccluderSet occluders;
  std::unique_ptr<Method> method;

  Prepared() = default;
  Prepared(const Prepared&) = delete;
  Prepared& operator=(const Prepared&) = delete;
};
/// Scene, then occluders for it, then a method over both.
Result<std::unique_ptr<Prepared>> prepare(const SceneArgs& scene, const SolveArgs& solve,
                                          const Reach& reach, const Context& context);

double median(std::vector<double> values);
double percentile(std::vector<double> values, double p);

/// CPU seconds of this process.
double cpu_seconds();

void add_info(CLI::App& app, std::function<Outcome()>& action);
void add_objects(CLI::App& app, std::function<Outcome()>& action);
void add_shrink(CLI::App& app, std::function<Outcome()>& action);
void add_pvs(CLI::App& app, std::function<Outcome()>& action);
void add_verify(CLI::App& app, std::function<Outcome()>& action);
void add_draw(CLI::App& app, std::function<Outcome()>& action);
void add_walk(CLI::App& app, std::function<Outcome()>& action);
void add_edit(CLI::App& app, std::function<Outcome()>& action);
void add_replay(CLI::App& app, std::function<Outcome()>& action);
void add_generate(CLI::App& app, std::function<Outcome()>& action);

}  // namespace ivis::tool
