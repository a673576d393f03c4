#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "client_lib/source.h"
#include "core/strategy.h"

namespace ivis::client {

struct NetworkOptions {
  std::string endpoint;
  SceneHash scene_hash = 0;          ///< 0: whatever the server has; held to from then on, unless:
  bool follow_scene = false;         ///< go on with whatever the server serves later
  std::string reach;                 ///< of every cell; empty: the server chooses
  Pace pace;                         ///< what it chooses by
  std::optional<Strategy> strategy;  ///< none: the server's
  std::uint32_t budget_us = 0;       ///< of one solve; 0: the server's
  std::chrono::milliseconds silence{2000};  ///< unanswered for so long: greet anew
};

/// A session with a server, kept alive: whenever the server is lost, says so, or no longer knows
/// the session, Hello is said again until it answers. Bytes are decoded in the caller's thread.
/// What ends it for good: a server with another scene, version, or too small a reach.
class NetworkSource : public PvsSource {
 public:
  /// Errors: kInvalidArgument for an endpoint that is not one. Does not wait for the server.
  static Result<std::unique_ptr<NetworkSource>> open(const NetworkOptions& options);
  ~NetworkSource() override;

  const Catalogue* catalogue() const override;
  void send(const Request& request) override;
  void set_pace(const Pace& pace) override;
  bool receive(Answer& answer) override;
  void wait(Time deadline) override;
  bool connected() const override;
  const Error* failure() const override;
  std::string trouble() const override;
  SourceStats stats() const override;
  std::uint32_t epoch() const override;
  Result<std::uint32_t> edit(std::span<const Edit> edits) override;
  std::optional<EditResult> edited() override;

 private:
  struct Impl;
  explicit NetworkSource(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace ivis::client
