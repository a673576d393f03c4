#pragma once

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>

#include "core/result.h"

namespace ivis::server {

enum class LogLevel { kDebug, kInfo, kWarn, kError, kOff };

/// Errors: kInvalidArgument naming the known levels.
Result<LogLevel> parse_log_level(std::string_view text);

/// One `key=value` of a log line.
struct LogField {
  std::string_view key;
  std::string value;
  bool is_number = false;

  LogField(std::string_view k, std::string_view v) : key(k), value(v) {}
  LogField(std::string_view k, const char* v) : key(k), value(v) {}
  LogField(std::string_view k, const std::string& v) : key(k), value(v) {}
  template <class N>
  requires std::integral<N> || std::floating_point<N> LogField(std::string_view k, N v)
      : key(k), value(std::to_string(v)), is_number(true) {}
};

/// Structured log on stderr: a line an event, as `time level event key=value ...` or as a JSON
/// object. Threads: any.
class Log {
 public:
  Log(LogLevel level, bool json);
  ~Log();
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;

  void write(LogLevel level, std::string_view event, std::initializer_list<LogField> fields = {});
  void debug(std::string_view e, std::initializer_list<LogField> f = {}) {
    write(LogLevel::kDebug, e, f);
  }
  void info(std::string_view e, std::initializer_list<LogField> f = {}) {
    write(LogLevel::kInfo, e, f);
  }
  void warn(std::string_view e, std::initializer_list<LogField> f = {}) {
    write(LogLevel::kWarn, e, f);
  }
  void error(std::string_view e, std::initializer_list<LogField> f = {}) {
    write(LogLevel::kError, e, f);
  }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The body of a line, for tests: `event=... key=value`, or the members of the JSON object.
std::string format_event(std::string_view event, std::initializer_list<LogField> fields, bool json);

}  // namespace ivis::server
