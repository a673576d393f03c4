#include "server/log.h"

#include <array>
#include <cstdio>
#include <utility>

#include <spdlog/logger.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>

namespace ivis::server {
namespace {

constexpr std::array<std::pair<std::string_view, LogLevel>, 5> kLevels{{{"debug", LogLevel::kDebug},
                                                                        {"info", LogLevel::kInfo},
                                                                        {"warn", LogLevel::kWarn},
                                                                        {"error", LogLevel::kError},
                                                                        {"off", LogLevel::kOff}}};

spdlog::level::level_enum native(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarn:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
    case LogLevel::kOff:
      return spdlog::level::off;
  }
  return spdlog::level::info;
}

/// Text from the network ends up here: no byte of it may break a line or the JSON.
std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) >= 0x7f) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\u%04x",
                    static_cast<unsigned>(static_cast<unsigned char>(c)));
      out += escape.data();
    } else {
      out += c;
    }
  }
  return out + '"';
}

bool plain(std::string_view text) {
  if (text.empty()) return false;
  for (const char c : text)
    if (c <= ' ' || c == '"' || c == '=' || c == '\\' || static_cast<unsigned char>(c) >= 0x7f)
      return false;
  return true;
}

}  // namespace

Result<LogLevel> parse_log_level(std::string_view text) {
  for (const auto& [name, level] : kLevels)
    if (name == text) return level;
  return invalid_argument("log level '" + std::string(text) +
                          "', expected debug, info, warn, error or off");
}

std::string format_event(std::string_view event, std::initializer_list<LogField> fields,
                         bool json) {
  std::string out = json ? "\"event\":" + quoted(event) : "event=" + std::string(event);
  for (const LogField& f : fields) {
    if (json) {
      out += "," + quoted(f.key) + ":" + (f.is_number ? f.value : quoted(f.value));
    } else {
      out += " " + std::string(f.key) + "=" +
             (f.is_number || plain(f.value) ? f.value : quoted(f.value));
    }
  }
  return out;
}

struct Log::Impl {
  spdlog::logger logger;
  bool json;
};

Log::Log(LogLevel level, bool json)
    : impl_(new Impl{{"ivisd", std::make_shared<spdlog::sinks::stderr_sink_mt>()}, json}) {
  impl_->logger.set_level(native(level));
  impl_->logger.flush_on(spdlog::level::debug);
  impl_->logger.set_formatter(std::make_unique<spdlog::pattern_formatter>(
      json ? R"({"time":"%Y-%m-%dT%H:%M:%S.%eZ","level":"%l",%v})"
           : "time=%Y-%m-%dT%H:%M:%S.%eZ level=%l %v",
      spdlog::pattern_time_type::utc));
}

Log::~Log() = default;

void Log::write(LogLevel level, std::string_view event, std::initializer_list<LogField> fields) {
  if (impl_->logger.should_log(native(level)))
    impl_->logger.log(native(level),
                      spdlog::string_view_t(format_event(event, fields, impl_->json)));
}

}  // namespace ivis::server
