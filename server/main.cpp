// ivisd: loads a scene, then serves what can be seen.

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <functional>
#include <iostream>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <unistd.h>

#include <CLI/CLI.hpp>

#include "server/address.h"
#include "server/config.h"
#include "server/server.h"
#include "server/world.h"

namespace {

using namespace ivis;
using namespace ivis::server;

enum Exit { kOk = 0, kUsage = 2, kInput = 3, kConnection = 4 };

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "set from a signal handler");

std::atomic<bool> reload_requested{false};

void request_stop(int) {
  stop_requested.store(true);
}

void request_reload(int) {
  reload_requested.store(true);
}

constexpr const char* kAbout =
    "Serves visibility: tells each connected renderer which objects of a scene can be seen from "
    "anywhere\n"
    "its observer can get to before the next answer.\n";
constexpr const char* kMore =
    "Example:\n"
    "  ivis shrink city.glb --reach cylinder:1.5,0.1 -o city.ivo\n"
    "  ivisd --scene city.glb --occluders city.ivo --listen tcp://127.0.0.1:7447 &\n"
    "  ivis walk --connect tcp://127.0.0.1:7447 --path walk.csv\n"
    "  kill %1        (bids its clients farewell and exits 0)\n"
    "  kill -HUP %1   (loads the scene anew and goes on with its clients; edits are forgotten;\n"
    "                   not when it was started by nohup)\n"
    "\n"
    "Every option may also be a key of the --config file (log_level = \"debug\") or a variable of "
    "the\n"
    "environment (IVISD_LOG_LEVEL=debug). A flag goes over the environment, that over the file.\n"
    "Reach R, in metres: ball:r, disc:r, cylinder:r,h, ellipsoid:a,b,c or box:a,b,c; h, a, b, c "
    "are\n"
    "half-extents.\n"
    "Exit codes: 0 done, 2 usage, 3 bad scene, occluders or configuration, 4 address taken or "
    "unusable.\n";

struct CommandLine {
  std::map<std::string, std::string> given;
  std::optional<std::filesystem::path> config;
  bool check = false;
};

/// Exit code when the command line ends the program.
std::optional<int> parse(int argc, char** argv, CommandLine& line) {
  CLI::App app(kAbout, "ivisd");
  app.footer(kMore);
  app.get_formatter()->column_width(34);
  std::map<std::string, std::string> values;
  std::map<std::string, bool> switches;
  std::map<std::string, CLI::Option*> options;
  for (const ConfigKey& k : config_keys()) {
    std::string flag = "--" + k.key;
    std::replace(flag.begin(), flag.end(), '_', '-');
    options[k.key] = k.form.empty()
                         ? app.add_flag(flag, switches[k.key], k.help)
                         : app.add_option(flag, values[k.key], k.help)->type_name(k.form);
  }
  std::string config;
  CLI::Option* config_option =
      app.add_option("--config", config, "TOML file of these options")->type_name("FILE");
  app.add_flag("--check-config", line.check,
               "print the configuration and where each value comes from, and exit");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kUsage;
  }
  for (const auto& [key, option] : options) {
    if (option->count() == 0) continue;
    const auto value = values.find(key);
    line.given[key] = value != values.end() ? value->second : switches[key] ? "true" : "false";
  }
  if (config_option->count() != 0) line.config = config;
  return std::nullopt;
}

int report(const Error& error) {
  std::fprintf(stderr, "ivisd: %s\n", error.message.c_str());
  return error.code == ErrorCode::kConnection ? kConnection : kInput;
}

/// A line that is redrawn on a terminal, and nothing elsewhere.
Context shown_progress(Log& log) {
  Context context;
  context.stop = &stop_requested;
  context.log = [&log](std::string_view text) { log.info("progress", {{"doing", text}}); };
  if (isatty(STDERR_FILENO) != 0) {
    context.progress = [](std::string_view stage, std::size_t done, std::size_t total) {
      std::fprintf(stderr, "\r\x1b[K%.*s %zu/%zu%s", static_cast<int>(stage.size()), stage.data(),
                   done, total, done >= total ? "\r\x1b[K" : "");
    };
  }
  return context;
}

int check(const Configured& configured) {
  std::cout << to_string(configured);
  const Config& c = configured.config;
  if (c.scene.empty()) return report(input_error("no scene: give --scene FILE"));
  for (const auto& file : {c.scene, c.occluders}) {
    std::error_code ec;
    if (!file.empty() && !std::filesystem::is_regular_file(file, ec))
      return report(input_error("'" + file.string() + "' is not a file"));
  }
  return kOk;
}

/// Builds the smaller rungs beside the server; ends, at the latest, when it goes.
class Builder {
 public:
  Builder(World& world, Ladder& ladder, const WorldOptions& options, Log& log)
      : thread_([this, &world, &ladder, &options, &log] {
          Context quiet;
          quiet.stop = &stop_;
          const Status built = [&]() -> Status {
            try {
              return build_rungs(world, ladder, options, quiet);
            } catch (const std::exception& e) {  // out of memory costs rungs, not the daemon
              return unsupported(e.what());
            }
          }();
          if (built && ladder.reaches().size() > 1)
            log.info("ladder", {{"rungs", ladder.ready()}});
          else if (!built && built.error().code != ErrorCode::kCancelled)
            log.warn("ladder", {{"rungs", ladder.ready()}, {"reason", built.error().message}});
        }) {}
  ~Builder() {
    stop_ = true;
    thread_.join();
  }
  Builder(const Builder&) = delete;
  Builder& operator=(const Builder&) = delete;

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// A scene as loaded once, with all that serving it takes.
struct Generation {
  std::unique_ptr<World> world;
  std::unique_ptr<Ladder> ladder;
  ServedScene served;
  std::unique_ptr<SceneState> state;
  CostModel cost;
  std::unique_ptr<Builder> builder;  ///< last: it uses the others

  Server::Served view() const { return {&served, ladder.get(), cost, state.get()}; }
};

WorldOptions world_options(const Config& config) {
  WorldOptions wanted;
  wanted.scene = config.scene;
  wanted.occluders = config.occluders;
  wanted.reach = config.reach;
  wanted.default_reach = kDefaultReach;
  wanted.method = config.method;
  wanted.threads = config.threads;
  wanted.granularity = config.granularity;
  return wanted;
}

/// `wanted`: borrowed by the generation's builder.
Result<std::unique_ptr<Generation>> load(const Config& config, const WorldOptions& wanted,
                                         const Context& context, Log& log) {
  auto made = std::make_unique<Generation>();
  auto world = load_world(wanted, context);
  if (!world) return world.error();
  made->world = std::move(*world);
  World& w = *made->world;
  for (const std::string& warning : w.scene.warnings)
    log.warn("scene", {{"warning", warning}});
  log.info("loaded", {{"scene", config.scene.string()},
                      {"objects", w.scene.object_count()},
                      {"triangles", w.scene.triangle_count},
                      {"occluders", w.occluders.shrunk.size()},
                      {"reach", w.reach.to_string()},
                      {"method", w.method->traits().name}});
  if (w.scene.object_count() > wire::kMaxObjects)
    return input_error("'" + config.scene.string() + "' has " +
                       std::to_string(w.scene.object_count()) +
                       " objects, more than a message can name");
  // An occluder file may know more than what is shrunk here (voxels, polyhedra): its ladder has to
  // be asked for.
  const bool given = !config.occluders.empty() && config.ladder == "auto";
  auto reaches = parse_ladder(given ? "none" : config.ladder, w.reach, w.occluders.slack_m);
  if (!reaches) return reaches.error();
  made->ladder =
      std::make_unique<Ladder>(std::move(*reaches), *w.method, w.occluders.slack_m, w.index.get());
  made->state = std::make_unique<SceneState>(w.scene);
  made->served = served_scene(w.scene);
  if (!w.method->keeps_to_effort() && config.strategy != Strategy::kGuaranteed)
    log.warn("strategy", {{"strategy", to_string(config.strategy)},
                          {"reason", w.method->traits().name + " keeps to no budget"}});
  made->cost = calibrate(*w.method, w.scene, w.reach, context.stop);
  if (w.method->keeps_to_effort() && !(made->cost.draw_ms > 0 && made->cost.test_ms > 0))
    log.warn("calibrated", {{"reason", "too few places in the scene: budgets may bound nothing"}});
  else if (w.method->keeps_to_effort())
    log.info("calibrated", {{"fixed_ms", made->cost.fixed_ms},
                            {"draw_us", 1e3 * made->cost.draw_ms},
                            {"test_us", 1e3 * made->cost.test_ms}});
  return made;
}

/// Loads the scene anew, beside the server, whenever a signal asks for it, and frees the old one
/// there: both take long.
class Reloader {
 public:
  Reloader(const Config& config, const WorldOptions& wanted, Log& log)
      : config_(config), wanted_(wanted), log_(log) {}
  ~Reloader() {
    if (thread_.joinable()) thread_.join();  // stopped by stop_requested
  }
  Reloader(const Reloader&) = delete;
  Reloader& operator=(const Reloader&) = delete;

  /// What was loaded, once it is; called often, by one thread.
  std::unique_ptr<Generation> take() {
    if (thread_.joinable() && !done_) return nullptr;
    if (thread_.joinable()) {
      thread_.join();
      if (loaded_) return std::move(loaded_);
    }
    if (!reload_requested.exchange(false)) return nullptr;
    log_.info("reloading", {{"scene", config_.scene.string()}});
    if (!start([this] { run(); })) {
      reload_requested = true;  // once more, later
      log_.error("reload_failed", {{"reason", "no thread can be made"}});
    }
    return nullptr;
  }

  /// Follows a take() that gave something.
  void free(std::unique_ptr<Generation> old) {
    old_ = std::move(old);
    if (!start([this] {
          old_.reset();
          done_ = true;
        }))
      old_.reset();
  }

 private:
  bool start(std::function<void()> body) {
    done_ = false;
    try {
      thread_ = std::thread(std::move(body));
    } catch (const std::exception&) {
      return false;
    }
    return true;
  }

  void run() {
    Context quiet;
    quiet.stop = &stop_requested;
    try {
      auto made = load(config_, wanted_, quiet, log_);
      if (made)
        loaded_ = std::move(*made);
      else if (made.error().code != ErrorCode::kCancelled)
        log_.error("reload_failed", {{"reason", made.error().message}});
    } catch (const std::exception& e) {  // out of memory: the old one goes on
      log_.error("reload_failed", {{"reason", e.what()}});
    }
    done_ = true;
  }

  const Config& config_;
  const WorldOptions& wanted_;
  Log& log_;
  std::unique_ptr<Generation> loaded_;
  std::unique_ptr<Generation> old_;
  std::atomic<bool> done_{false};
  std::thread thread_;
};

int serve(const Config& config, bool hangups_ignored) {
  Log log(config.log_level, config.json_logs);
  if (hangups_ignored)
    log.warn("no_reload", {{"reason", "started with SIGHUP ignored, as by nohup"}});
  // Asked before the loading, which can take long, and again by the bind below.
  if (auto free = probe_address(config.listen); !free) {
    report(free.error());
    return kConnection;
  }
  const WorldOptions wanted = world_options(config);
  auto loaded = load(config, wanted, shown_progress(log), log);
  if (!loaded) {
    if (loaded.error().code == ErrorCode::kCancelled) return kOk;
    return report(loaded.error());
  }
  std::unique_ptr<Generation> before;  // outlives the server, as the present one does
  std::unique_ptr<Generation> generation = std::move(*loaded);
  ServerOptions options;
  options.listen = config.listen;
  options.busy_poll = config.busy_poll;
  options.workers =
      config.workers > 0 ? config.workers : std::max(1U, std::thread::hardware_concurrency());
  options.limits.max_sessions = config.max_clients;
  options.limits.edits =
      config.edits == "on" || (config.edits == "auto" && is_local(config.listen));
  options.limits.idle = std::chrono::seconds(config.idle_timeout_s);
  options.limits.least_solve = std::chrono::milliseconds(config.least_solve_ms);
  options.limits.strategy = config.strategy;
  options.limits.budget_ms = config.budget_us / 1000.0;
  auto server = Server::bind(options, generation->view(), log);
  if (!server) {
    report(server.error());
    return kConnection;
  }
  log.info("listening", {{"address", (*server)->endpoint()}});
  const auto build = [&](Generation& g) {
    try {
      g.builder = std::make_unique<Builder>(*g.world, *g.ladder, wanted, log);
    } catch (const std::exception& e) {  // no thread can be made: the largest rung serves
      log.warn("ladder", {{"rungs", g.ladder->ready()}, {"reason", e.what()}});
    }
  };
  build(*generation);
  Reloader reloader(config, wanted, log);
  (*server)->run(stop_requested, [&]() -> std::optional<Server::Served> {
    if (before) reloader.free(std::move(before));  // the server has let go of it
    auto next = reloader.take();
    if (!next) return std::nullopt;
    build(*next);
    log.info("reloaded", {{"objects", next->served.objects()}});
    // Nothing may fail from here on: the server would go on with what is freed.
    before = std::exchange(generation, std::move(next));
    return generation->view();
  });
  return kOk;
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line;
  if (const auto code = parse(argc, argv, line)) return *code;
  const auto configured = configure(line.given, process_environment(), line.config);
  if (!configured) {
    const int code = report(configured.error());
    return configured.error().code == ErrorCode::kInvalidArgument ? kUsage : code;
  }
  if (line.check) return check(*configured);
  if (configured->config.scene.empty()) {
    std::fprintf(stderr, "ivisd: no scene: give --scene FILE (ivisd --help tells more)\n");
    return kUsage;
  }
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  // Started with nohup a hangup means nothing; a reload would forget the edits.
  struct sigaction inherited {};
  sigaction(SIGHUP, nullptr, &inherited);
  action.sa_handler = request_reload;
  const bool hangups_ignored = inherited.sa_handler == SIG_IGN;
  if (!hangups_ignored) sigaction(SIGHUP, &action, nullptr);
  return serve(configured->config, hangups_ignored);
}
