#pragma once

#include <csignal>
#include <string>
#include <vector>

#include <sys/types.h>

namespace ivis::test {

/// A program run by a test: its output (both streams) is read as it comes. Killed when it goes out
/// of scope.
class Process {
 public:
  explicit Process(const std::vector<std::string>& command,
                   const std::vector<std::string>& environment = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Reads on until the output holds `text`; false when it ends before, or after `seconds`.
  bool says(const std::string& text, int seconds = 20);
  void signal(int number);
  /// Waits for the end; the exit code, or minus the signal that ended it. Kills it after `seconds`.
  int finish(int seconds = 20);
  const std::string& output() const { return output_; }

 private:
  bool read_some(int timeout_ms);
  pid_t pid_ = -1;
  int out_ = -1;
  std::string output_;
};

/// What follows `key` in the text, up to a space or line end.
std::string word_after(const std::string& text, const std::string& key);

}  // namespace ivis::test
