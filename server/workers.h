#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <vector>

#include "server/job.h"

namespace ivis::server {

/// Threads that perform jobs, each one at a time, in the order given. The owner waits for fd() to
/// be readable together with its socket. Threads: give() and take() from one thread. The
/// destructor waits for the jobs under way and drops the rest.
class Workers {
 public:
  /// Throws std::system_error when the system gives no thread or descriptor.
  explicit Workers(unsigned threads);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  /// Readable when take() has something.
  int fd() const { return fd_; }
  /// Jobs given and not taken back.
  std::size_t under_way() const { return under_way_; }
  bool free() const { return under_way_ < threads_.size(); }
  void give(Job job);
  std::vector<JobDone> take();

 private:
  void run();
  void end();

  int fd_;
  std::mutex mutex_;
  std::condition_variable given_;
  bool stop_ = false;
  std::deque<Job> jobs_;
  std::vector<JobDone> done_;
  std::size_t under_way_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace ivis::server
