#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace ivis {

/// What a long piece of work is told by its caller: where to report, when to stop, how many
/// threads. Threads: the callbacks may be called from any thread, one at a time for a given work.
/// Ownership: borrowed for the length of the call.
struct Context {
  /// Progress of the named stage: `done` of `total`; null is silent.
  std::function<void(std::string_view stage, std::size_t done, std::size_t total)> progress;
  /// One line for a person; null is silent.
  std::function<void(std::string_view line)> log;
  /// Set by the caller (Ctrl-C); work stops soon after with ErrorCode::kCancelled.
  const std::atomic<bool>* stop = nullptr;
  /// 0: as many as the machine has.
  unsigned threads = 0;

  bool stopped() const { return stop != nullptr && stop->load(std::memory_order_relaxed); }
  void report(std::string_view stage, std::size_t done, std::size_t total) const {
    if (progress) progress(stage, done, total);
  }
  void say(std::string_view line) const {
    if (log) log(line);
  }
  unsigned thread_count() const;
};

/// Calls `body(i)` for i in [0, n) from `threads` threads, in no order; stops early when
/// ctx.stopped(). Cost: one atomic increment an index: make the body large.
void parallel_for(const Context& ctx, std::size_t n, const std::function<void(std::size_t)>& body);

}  // namespace ivis
