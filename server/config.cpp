#include "server/config.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <exception>
#include <functional>
#include <sstream>
#include <utility>

#include <toml++/toml.h>

#include "core/path.h"
#include "core/reach.h"
#include "server/ladder.h"

namespace ivis::server {
namespace {

constexpr std::size_t kMaxConfigBytes = 1U << 20U;

enum class Kind { kPath, kText, kNumber, kSwitch };

struct Key {
  ConfigKey shown;
  Kind kind;
  std::function<std::string(const Config&)> get;
  std::function<Status(Config&, const std::string&)> set;
};

Result<unsigned> number(const std::string& text, unsigned low, unsigned high) {
  unsigned v = 0;
  const auto r = std::from_chars(text.data(), text.data() + text.size(), v);
  if (r.ec != std::errc{} || r.ptr != text.data() + text.size() || v < low || v > high)
    return invalid_argument("found '" + text + "', expected a whole number from " +
                            std::to_string(low) + " to " + std::to_string(high));
  return v;
}

template <class T>
auto set_number(T Config::*field, unsigned low, unsigned high) {
  return [=](Config& c, const std::string& text) -> Status {
    const auto v = number(text, low, high);
    if (!v) return v.error();
    c.*field = *v;
    return ok();
  };
}
template <class T>
auto get_number(T Config::*field) {
  return [=](const Config& c) { return std::to_string(c.*field); };
}
auto set_path(std::filesystem::path Config::*field) {
  return [=](Config& c, const std::string& text) -> Status {
    c.*field = text;
    return ok();
  };
}
auto get_path(std::filesystem::path Config::*field) {
  return [=](const Config& c) { return (c.*field).string(); };
}
auto set_switch(bool Config::*field) {
  return [=](Config& c, const std::string& text) -> Status {
    if (text != "true" && text != "false")
      return invalid_argument("found '" + text + "', expected true or false");
    c.*field = text == "true";
    return ok();
  };
}
auto get_switch(bool Config::*field) {
  return [=](const Config& c) -> std::string { return c.*field ? "true" : "false"; };
}
auto get_text(std::string Config::*field) {
  return [=](const Config& c) { return c.*field; };
}

const char* level_name(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return "debug";
    case LogLevel::kInfo:
      return "info";
    case LogLevel::kWarn:
      return "warn";
    case LogLevel::kError:
      return "error";
    case LogLevel::kOff:
      return "off";
  }
  return "info";
}

Status set_reach(Config& c, const std::string& text) {
  if (!text.empty())
    if (auto reach = Reach::parse(text); !reach) return reach.error();
  c.reach = text;
  return ok();
}

Status set_listen(Config& c, const std::string& text) {
  if (!text.starts_with("tcp://") && !text.starts_with("ipc://"))
    return invalid_argument("found '" + text + "', expected tcp://HOST:PORT or ipc://PATH");
  c.listen = text;
  return ok();
}

Status set_granularity(Config& c, const std::string& text) {
  const auto granularity = parse_granularity(text);
  if (!granularity) return granularity.error();
  c.granularity = *granularity;
  return ok();
}

Status set_level(Config& c, const std::string& text) {
  const auto level = parse_log_level(text);
  if (!level) return level.error();
  c.log_level = *level;
  return ok();
}

/// Whether it fits the reach is known when that is.
Status set_ladder(Config& c, const std::string& text) {
  if (auto parsed = parse_ladder(text, Reach::box(Vec3{1e6}), 0); !parsed) return parsed.error();
  c.ladder = text;
  return ok();
}
Status set_strategy(Config& c, const std::string& text) {
  const auto strategy = parse_strategy(text);
  if (!strategy)
    return invalid_argument("found '" + text + "', expected guaranteed, abort or predictive");
  c.strategy = *strategy;
  return ok();
}
Status set_edits(Config& c, const std::string& text) {
  if (text != "on" && text != "off" && text != "auto")
    return invalid_argument("found '" + text + "', expected on, off or auto");
  c.edits = text;
  return ok();
}
Status set_method(Config& c, const std::string& text) {
  c.method = text;
  return ok();
}

const std::vector<Key>& keys() {
  static const std::vector<Key> all{
      {{"scene", "FILE", "the scene, .glb or .gltf (required)"},
       Kind::kPath,
       get_path(&Config::scene),
       set_path(&Config::scene)},
      {{"occluders", "FILE",
        "shrunk occluders of the scene, from `ivis shrink`; without: shrunk at start"},
       Kind::kPath,
       get_path(&Config::occluders),
       set_path(&Config::occluders)},
      {{"granularity", "WHAT",
        "object: one object a node or instance; cluster: large meshes are split into clusters"},
       Kind::kText,
       [](const Config& c) -> std::string { return granularity_name(c.granularity); },
       set_granularity},
      {{"reach", "R",
        "how far an observer may get before the next answer; without: that of the occluders, or " +
            std::string(kDefaultReach)},
       Kind::kText,
       get_text(&Config::reach),
       set_reach},
      {{"ladder", "R...",
        "smaller reaches, ascending, for observers that say how fast they move, shrunk here as by "
        "`ivis shrink` without options; 'auto': four of the reach, or, with --occluders, none; "
        "'none'"},
       Kind::kText,
       get_text(&Config::ladder),
       set_ladder},
      {{"listen", "ADDRESS", "tcp://HOST:PORT or ipc://PATH"},
       Kind::kText,
       get_text(&Config::listen),
       set_listen},
      {{"method", "NAME", "visibility method, of `ivis pvs --help`; without: the first there"},
       Kind::kText,
       get_text(&Config::method),
       set_method},
      {{"edits", "WHO",
        "may clients change the scene: on, off, or auto: only where no other machine can connect"},
       Kind::kText,
       get_text(&Config::edits),
       set_edits},
      {{"strategy", "NAME",
        "how solves keep to their time, where a client does not say: guaranteed (all there is), "
        "abort (stop drawing), predictive (choose before drawing); each set is complete"},
       Kind::kText,
       [](const Config& c) -> std::string { return ivis::to_string(c.strategy); },
       set_strategy},
      {{"budget_us", "US", "of one solve, for abort and predictive, 1 to 1000000"},
       Kind::kNumber,
       get_number(&Config::budget_us),
       set_number(&Config::budget_us, 1, 1'000'000)},
      {{"threads", "N", "threads inside one solve, 1 to 256"},
       Kind::kNumber,
       get_number(&Config::threads),
       set_number(&Config::threads, 1, 256)},
      {{"workers", "N", "clients solved for at a time, 1 to 256; 0: one a core"},
       Kind::kNumber,
       get_number(&Config::workers),
       set_number(&Config::workers, 0, 256)},
      {{"log_level", "LEVEL", "debug, info, warn, error or off"},
       Kind::kText,
       [](const Config& c) -> std::string { return level_name(c.log_level); },
       set_level},
      {{"json_logs", "", "log JSON objects instead of key=value"},
       Kind::kSwitch,
       get_switch(&Config::json_logs),
       set_switch(&Config::json_logs)},
      {{"busy_poll", "", "spin for messages: costs a core, saves some tens of microseconds"},
       Kind::kSwitch,
       get_switch(&Config::busy_poll),
       set_switch(&Config::busy_poll)},
      {{"max_clients", "N", "clients at one time, 1 to 100000"},
       Kind::kNumber,
       get_number(&Config::max_clients),
       set_number(&Config::max_clients, 1, 100000)},
      {{"idle_timeout_s", "S", "forget a client that said nothing for so long, 1 to 86400"},
       Kind::kNumber,
       get_number(&Config::idle_timeout_s),
       set_number(&Config::idle_timeout_s, 1, 86400)},
      {{"least_solve_ms", "MS",
        "a solve takes at least so long, 0 to 10000: to try out a server that is slow"},
       Kind::kNumber,
       get_number(&Config::least_solve_ms),
       set_number(&Config::least_solve_ms, 0, 10000)},
  };
  return all;
}

struct Found {
  std::string text;
  std::string origin;
};

/// The value as text; fails when its TOML type does not fit the key.
Result<std::string> toml_text(const toml::node& node, Kind kind) {
  if ((kind == Kind::kPath || kind == Kind::kText) && node.is_string())
    return node.as_string()->get();
  if (kind == Kind::kNumber && node.is_integer()) return std::to_string(node.as_integer()->get());
  if (kind == Kind::kSwitch && node.is_boolean())
    return std::string(node.as_boolean()->get() ? "true" : "false");
  const char* expected = kind == Kind::kNumber   ? "a whole number"
                         : kind == Kind::kSwitch ? "true or false"
                                                 : "a string";
  std::ostringstream type;
  type << node.type();
  return input_error("found a value of type " + type.str() + ", expected " + expected);
}

Result<std::map<std::string, Found>> read_toml(const std::filesystem::path& file) {
  const auto text = read_file_whole(file, kMaxConfigBytes);
  if (!text) return text.error();
  std::map<std::string, Found> out;
  try {
    const toml::table table = toml::parse(*text, file.string());
    for (const auto& [name, node] : table) {
      const std::string key(name.str());
      const std::string where = file.string() + ":" + std::to_string(name.source().begin.line);
      const auto known = std::find_if(keys().begin(), keys().end(),
                                      [&](const Key& k) { return k.shown.key == key; });
      if (known == keys().end()) return input_error(where + ": unknown key '" + key + "'");
      auto value = toml_text(node, known->kind);
      if (!value) return input_error(where + ": key '" + key + "': " + value.error().message);
      if (known->kind == Kind::kPath && !value->empty() &&
          std::filesystem::path(*value).is_relative())
        *value = (file.parent_path() / *value).string();
      out[key] = {*value, where};
    }
  } catch (const toml::parse_error& e) {
    return input_error(file.string() + ":" + std::to_string(e.source().begin.line) + ": " +
                       std::string(e.description()));
  } catch (const std::exception& e) {
    return input_error(file.string() + ": " + e.what());
  }
  return out;
}

std::string upper(std::string text) {
  for (char& c : text)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return text;
}

std::string toml_quoted(const std::string& text) {
  std::ostringstream out;
  out << toml::value<std::string>(text);
  return out.str();
}

}  // namespace

const std::vector<ConfigKey>& config_keys() {
  static const std::vector<ConfigKey> shown = [] {
    std::vector<ConfigKey> out;
    for (const Key& k : keys())
      out.push_back(k.shown);
    return out;
  }();
  return shown;
}

Environment process_environment() {
  return [](const std::string& name) -> std::optional<std::string> {
    const char* value = std::getenv(name.c_str());
    return value != nullptr ? std::optional<std::string>(value) : std::nullopt;
  };
}

Result<Configured> configure(const std::map<std::string, std::string>& flags,
                             const Environment& environment,
                             const std::optional<std::filesystem::path>& file) {
  std::map<std::string, Found> from_file;
  if (file) {
    auto read = read_toml(*file);
    if (!read) return read.error();
    from_file = std::move(*read);
  }
  Configured out;
  for (const Key& k : keys()) {
    const std::string& key = k.shown.key;
    // Every source is checked, also one that a stronger one overrides: a mistake does not hide.
    std::vector<Found> sources;
    if (const auto f = from_file.find(key); f != from_file.end()) sources.push_back(f->second);
    const std::string variable = "IVISD_" + upper(key);
    if (const auto v = environment(variable)) sources.push_back({*v, "environment " + variable});
    std::string flag = key;
    std::replace(flag.begin(), flag.end(), '_', '-');
    if (const auto f = flags.find(key); f != flags.end())
      sources.push_back({f->second, "flag --" + flag});
    std::string origin = "default";
    for (const Found& s : sources) {
      if (auto set = k.set(out.config, s.text); !set)
        return Error{s.origin.starts_with("flag") ? ErrorCode::kInvalidArgument : ErrorCode::kInput,
                     s.origin + ": key '" + key + "': " + set.error().message};
      origin = s.origin;
    }
    out.settings.push_back({key, k.get(out.config), origin});
  }
  return out;
}

std::string to_string(const Configured& configured) {
  std::string out;
  for (std::size_t i = 0; i < keys().size(); ++i) {
    const Setting& s = configured.settings[i];
    const Kind kind = keys()[i].kind;
    const bool bare = kind == Kind::kNumber || kind == Kind::kSwitch;
    std::string line = s.key + " = " + (bare ? s.value : toml_quoted(s.value));
    if (line.size() < 48) line.resize(48, ' ');
    out += line + "  # " + s.origin + "\n";
  }
  return out;
}

}  // namespace ivis::server
