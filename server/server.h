#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "core/result.h"
#include "server/log.h"
#include "server/session.h"

namespace ivis::server {

struct ServerOptions {
  std::string listen =
      "tcp://127.0.0.1:7447";  ///< tcp://HOST:PORT (port * : any free one) or ipc://PATH
  bool busy_poll = false;      ///< spin instead of sleeping: a core for some tens of microseconds
  unsigned workers = 1;        ///< threads that solve
  SessionLimits limits;
};

/// Could a server be bound there now? Errors: those of Server::bind. Leaves nothing behind.
Status probe_address(const std::string& listen);

/// The socket around a SessionTable: one thread that takes in everything that waits, hands jobs to
/// the workers and sends what they bring back; it never blocks on a client, nor on a solve but
/// where another scene is taken up. Threads: bind() and run() from one thread; `stop` may be set
/// from any, and from a signal handler. Ownership: borrows scene, ladder and log.
class Server {
 public:
  /// What is served; borrowed.
  struct Served {
    const ServedScene* scene = nullptr;
    const Ladder* ladder = nullptr;
    CostModel cost;
    SceneState* state = nullptr;  ///< null: no edits
  };
  /// Errors: kConnection when the address is taken by a live server or cannot be had;
  /// kInvalidArgument for one that is not an address. An ipc path that a dead server left behind is
  /// taken over.
  static Result<std::unique_ptr<Server>> bind(const ServerOptions& options, const Served& served,
                                              Log& log);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// As bound: the port in place of '*'; plain_endpoint().
  const std::string& endpoint() const;
  /// Serves until `stop` is set (looked at ten times a second and after every signal), then bids
  /// every client farewell, sends what is queued, and gives the address back.
  /// `other`: asked as often; what it gives is served from then on, and what was before is not
  /// touched any more.
  void run(
      const std::atomic<bool>& stop,
      const std::function<std::optional<Served>()>& other = [] { return std::optional<Served>(); });
  const SessionCounters& counters() const;

 private:
  struct Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace ivis::server
