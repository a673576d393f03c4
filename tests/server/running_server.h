#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include <gtest/gtest.h>

#include "server/server.h"
#include "tests/server/fake_method.h"

namespace ivis::test {

/// The index of an empty set: methods that need no occluders take edits with it.
inline const OccluderIndex& no_occluders() {
  static const OccluderSet set;
  static const OccluderIndex index(set);
  return index;
}

/// A server on a thread of its own; any free port unless told otherwise.
class RunningServer {
 public:
  RunningServer(const Scene& scene, const Method& method,
                const Reach& reach = Reach::cylinder(1.5, 0.1),
                const std::string& listen = "tcp://127.0.0.1:*", server::SessionLimits limits = {})
      : RunningServer(
            scene,
            std::make_unique<server::Ladder>(reach, method, OccluderSet{}.slack_m, &no_occluders()),
            listen, limits) {}
  RunningServer(const Scene& scene, std::unique_ptr<server::Ladder> ladder,
                const std::string& listen = "tcp://127.0.0.1:*", server::SessionLimits limits = {},
                unsigned workers = 1)
      : served_(server::served_scene(scene)),
        ladder_(std::move(ladder)),
        state_(scene),
        log_(server::LogLevel::kOff, false) {
    server::ServerOptions options;
    options.listen = listen;
    options.limits = limits;
    options.workers = workers;
    auto bound = server::Server::bind(options, {&served_, ladder_.get(), {}, &state_}, log_);
    if (!bound) {
      ADD_FAILURE() << bound.error().message;
      return;
    }
    server_ = std::move(*bound);
    thread_ = std::thread([this] { server_->run(stop_); });
  }
  ~RunningServer() { stop(); }
  void stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  std::string endpoint() const { return server_ ? server_->endpoint() : "tcp://127.0.0.1:1"; }
  /// Only after stop().
  const server::SessionCounters& counters() const { return server_->counters(); }

 private:
  server::ServedScene served_;
  std::unique_ptr<server::Ladder> ladder_;
  server::SceneState state_;
  server::Log log_;
  std::unique_ptr<server::Server> server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace ivis::test
