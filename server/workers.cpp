#include "server/workers.h"

#include <cerrno>
#include <cstdint>
#include <system_error>
#include <utility>

#include <sys/eventfd.h>
#include <unistd.h>

namespace ivis::server {

Workers::Workers(unsigned threads) : fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
  try {
    for (unsigned i = 0; i < threads; ++i)
      threads_.emplace_back([this] { run(); });
  } catch (...) {
    end();
    throw;
  }
}

Workers::~Workers() {
  end();
}

void Workers::end() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  given_.notify_all();
  for (std::thread& t : threads_)
    t.join();
  close(fd_);
}

void Workers::give(Job job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(job));
  }
  ++under_way_;  // of which memory was there for
  given_.notify_one();
}

std::vector<JobDone> Workers::take() {
  std::uint64_t count = 0;
  if (read(fd_, &count, sizeof count) < 0) return {};  // nothing since the last time
  const std::lock_guard lock(mutex_);
  under_way_ -= done_.size();
  return std::exchange(done_, {});
}

void Workers::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    given_.wait(lock, [this] { return stop_ || !jobs_.empty(); });
    if (stop_) return;
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    JobDone done = perform(std::move(job));
    lock.lock();
    done_.push_back(std::move(done));
    const std::uint64_t one = 1;
    // Fails only when the counter is full, which is readable all the same.
    static_cast<void>(!write(fd_, &one, sizeof one));
  }
}

}  // namespace ivis::server
