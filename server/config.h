#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "core/strategy.h"
#include "scenes/clusters.h"
#include "server/log.h"

namespace ivis::server {

/// What ivisd runs with. Every field is a key of the TOML file, an environment variable IVISD_<KEY>
/// and a flag --<key> (with '-' for '_').
struct Config {
  std::filesystem::path scene;
  std::filesystem::path occluders;  ///< empty: shrink at start
  Granularity granularity = Granularity::kObject;
  std::string reach;            ///< empty: the occluder file's, or kDefaultReach
  std::string ladder = "auto";  ///< of smaller reaches: parse_ladder()
  std::string listen = "tcp://127.0.0.1:7447";
  Strategy strategy = Strategy::kGuaranteed;  ///< SessionLimits::strategy
  std::string edits = "auto";  ///< may clients change the scene: on, off, or only on this machine
  unsigned budget_us = 1000;   ///< SessionLimits::budget_ms
  std::string method;          ///< empty: the first of method_list()
  unsigned threads = 1;        ///< inside one solve
  unsigned workers = 0;        ///< solves at a time; 0: one a core
  LogLevel log_level = LogLevel::kInfo;
  bool json_logs = false;
  bool busy_poll = false;
  std::size_t max_clients = 256;
  unsigned idle_timeout_s = 60;
  unsigned least_solve_ms = 0;  ///< SessionLimits::least_solve
};
inline constexpr std::string_view kDefaultReach = "cylinder:1.5,0.1";

/// One key: its value as text and where it came from ("flag --reach", "environment IVISD_REACH",
/// "ivisd.toml:3", "default").
struct Setting {
  std::string key;
  std::string value;
  std::string origin;
};

struct Configured {
  Config config;
  std::vector<Setting> settings;  ///< every key, in the order of --help
};

/// A key of the configuration, for --help.
struct ConfigKey {
  std::string key;
  std::string form;  ///< e.g. "FILE"; empty: a switch
  std::string help;
};
const std::vector<ConfigKey>& config_keys();

using Environment = std::function<std::optional<std::string>(const std::string& name)>;
Environment process_environment();

/// Flag over environment over file over default. `flags`: key -> text. Paths in the file are
/// relative to its folder. Errors: kIo; kInput naming file, line and key, or variable;
/// kInvalidArgument naming the flag; each with what was found and what was expected. Unknown keys
/// are errors.
Result<Configured> configure(const std::map<std::string, std::string>& flags,
                             const Environment& environment,
                             const std::optional<std::filesystem::path>& file);

/// As a TOML file that gives the same configuration, each line with its origin.
std::string to_string(const Configured& configured);

}  // namespace ivis::server
