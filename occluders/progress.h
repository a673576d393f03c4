#pragma once

#include <algorithm>
#include <atomic>
#include <mutex>

#include "core/context.h"

namespace ivis {

/// Counts the steps of one stage from many threads and reports about a hundred times, one at a
/// time.
class Progress {
 public:
  Progress(const Context& context, const char* stage, std::size_t total)
      : context_(context),
        stage_(stage),
        total_(total),
        every_(std::max<std::size_t>(1, total / 100)) {}

  void step() {
    const std::size_t done = ++done_;
    if (done % every_ != 0 && done != total_) return;
    const std::lock_guard lock(mutex_);
    context_.report(stage_, done, total_);
  }

 private:
  const Context& context_;
  const char* stage_;
  const std::size_t total_;
  const std::size_t every_;
  std::atomic<std::size_t> done_{0};
  std::mutex mutex_;
};

}  // namespace ivis
