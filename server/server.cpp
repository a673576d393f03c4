#include "server/server.h"

#include <algorithm>
#include <cerrno>
#include <new>
#include <string_view>
#include <system_error>
#include <utility>

#include <unistd.h>
#include <zmq.hpp>

#include "server/address.h"
#include "server/workers.h"

namespace ivis::server {
namespace {

// Nothing a client sends is long; ZeroMQ drops a peer that sends more.
constexpr std::int64_t kMaxIncomingBytes = 64 << 10;
// Messages are taken in at once; answers of a client that does not read are dropped beyond it.
constexpr int kReceiveQueue = 256;
constexpr int kSendQueue = 8;
constexpr int kMaxDrained = 4096;
constexpr std::uint64_t kMaxEditsDrained = 2048;  // some milliseconds
constexpr auto kLookAtStop = std::chrono::milliseconds(100);
constexpr auto kHousekeeping = std::chrono::seconds(1);

/// ZeroMQ leaves the file of an ipc socket behind. Removed while still bound: afterwards it could
/// be another server's.
void remove_ipc_file(const std::string& endpoint) {
  constexpr std::string_view kIpc = "ipc://";
  if (endpoint.starts_with(kIpc) && endpoint.size() > kIpc.size() && endpoint[kIpc.size()] != '@')
    unlink(endpoint.c_str() + kIpc.size());
}

Error explain(const zmq::error_t& e, const std::string& listen) {
  if (e.num() == EADDRINUSE) return connection_error("another server already listens on " + listen);
  if (e.num() == EINVAL || e.num() == EPROTONOSUPPORT || e.num() == ENODEV)
    return invalid_argument(
        "'" + listen +
        "' is not an address of this machine, expected tcp://HOST:PORT or ipc://PATH");
  return connection_error("cannot listen on " + listen + ": " + e.what());
}

}  // namespace

struct Server::Impl {
  Impl(const ServerOptions& o, const Served& served, Log& l)
      : options(o),
        log(l),
        sessions(*served.scene, *served.ladder, o.limits, served.cost, served.state),
        workers(std::max(1U, o.workers)),
        context(1),
        socket(context, zmq::socket_type::router) {}

  ~Impl() { give_back(); }

  void give_back() {
    if (held) remove_ipc_file(endpoint);
    held = false;
  }

  void configure() {
    socket.set(zmq::sockopt::router_mandatory, true);
    socket.set(zmq::sockopt::maxmsgsize, kMaxIncomingBytes);
    socket.set(zmq::sockopt::rcvhwm, kReceiveQueue);
    socket.set(zmq::sockopt::sndhwm, kSendQueue);
    socket.set(zmq::sockopt::linger, 500);  // ms, for the farewells
    socket.set(zmq::sockopt::heartbeat_ivl, 2000);
    socket.set(zmq::sockopt::heartbeat_timeout, 10000);
    socket.set(zmq::sockopt::ipv6,
               options.listen.find('[') != std::string::npos);  // tcp://[::1]:7447
  }

  /// Takes in what waits; a bound keeps a flood of messages from starving the answers.
  void drain() {
    zmq::message_t peer;
    zmq::message_t body;
    const auto edits = sessions.counters().edits;
    for (int i = 0; i < kMaxDrained; ++i) {
      if (sessions.counters().edits - edits >= kMaxEditsDrained) return;
      if (!socket.recv(peer, zmq::recv_flags::dontwait)) return;
      bool more = peer.more();
      bool one_body =
          more && static_cast<bool>(socket.recv(body, zmq::recv_flags::none)) && !body.more();
      if (more && !one_body) {
        zmq::message_t rest;
        do
          static_cast<void>(socket.recv(rest, zmq::recv_flags::none));
        while (rest.more());
      }
      const std::span<const std::byte> bytes(static_cast<const std::byte*>(body.data()),
                                             one_body ? body.size() : 0);
      const auto before = sessions.counters().malformed;
      if (auto reply =
              sessions.receive(peer.to_string_view(), bytes, std::chrono::steady_clock::now()))
        send(*reply);
      if (sessions.counters().malformed != before)
        log.warn("malformed_message", {{"bytes", bytes.size()}, {"total", before + 1}});
    }
  }

  /// Never waits: what a full pipe or a vanished peer does not take is dropped, which the
  /// acknowledgements make harmless.
  void send(const Outgoing& out) {
    try {
      if (!socket.send(zmq::buffer(out.peer),
                       zmq::send_flags::sndmore | zmq::send_flags::dontwait)) {
        ++dropped;
        return;
      }
      static_cast<void>(socket.send(zmq::buffer(out.bytes), zmq::send_flags::dontwait));
    } catch (const zmq::error_t& e) {
      if (e.num() != EHOSTUNREACH) throw;
      sessions.forget(out.peer);
      log.info("client_gone", {{"clients", sessions.size()}});
    }
  }

  void replace(const Served& served) {
    while (workers.under_way() > 0) {  // they borrow what was served
      zmq::pollitem_t item{nullptr, workers.fd(), ZMQ_POLLIN, 0};
      try {
        zmq::poll(&item, 1, kLookAtStop);
      } catch (const zmq::error_t& e) {
        if (e.num() != EINTR) throw;  // a signal: the workers still borrow
      }
      for (JobDone& done : workers.take())
        if (const auto out = sessions.finish(std::move(done))) send(*out);
    }
    for (const Outgoing& out :
         sessions.replace(*served.scene, *served.ladder, served.cost, served.state))
      send(out);
  }

  void turn() {
    const bool spin = options.busy_poll || (sessions.work_waiting() && workers.free());
    zmq::pollitem_t items[] = {{socket.handle(), 0, ZMQ_POLLIN, 0},
                               {nullptr, workers.fd(), ZMQ_POLLIN, 0}};
    if (!spin) zmq::poll(items, 2, kLookAtStop);
    drain();
    for (JobDone& done : workers.take())
      if (const auto out = sessions.finish(std::move(done))) send(*out);
    while (workers.free()) {
      SessionTable::Next next = sessions.next(std::chrono::steady_clock::now());
      if (auto* job = std::get_if<Job>(&next)) {
        workers.give(std::move(*job));
      } else if (const auto* out = std::get_if<Outgoing>(&next)) {
        send(*out);
        log.info("client_welcome", {{"clients", sessions.size()}, {"bytes", out->bytes.size()}});
      } else {
        break;
      }
    }
    const auto now = std::chrono::steady_clock::now();
    for (const Outgoing& notice : sessions.notices(now))
      send(notice);
    if (sessions.scene_torn() != torn) {
      torn = !torn;
      if (torn) log.error("scene_torn", {{"reason", SceneState::kTorn}});
    }
    if (now >= next_housekeeping) {
      next_housekeeping = now + kHousekeeping;
      if (const auto gone = sessions.expire(now); gone != 0)
        log.info("clients_expired", {{"expired", gone}, {"clients", sessions.size()}});
    }
  }

  ServerOptions options;
  Log& log;
  SessionTable sessions;
  Workers workers;
  std::string endpoint;
  bool held = false;  ///< the address is ours
  bool torn = false;  ///< was said
  std::uint64_t dropped = 0;
  SessionTable::Time next_housekeeping{};
  zmq::context_t context;
  zmq::socket_t socket;
};

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;
const std::string& Server::endpoint() const {
  return impl_->endpoint;
}
const SessionCounters& Server::counters() const {
  return impl_->sessions.counters();
}

Result<std::unique_ptr<Server>> Server::bind(const ServerOptions& options, const Served& served,
                                             Log& log) {
  if (auto claimed = claim_address(options.listen); !claimed) return claimed.error();
  try {
    auto impl = std::make_unique<Impl>(options, served, log);
    impl->configure();
    impl->socket.bind(options.listen);
    impl->endpoint = plain_endpoint(impl->socket.get(zmq::sockopt::last_endpoint));
    impl->held = true;
    return std::unique_ptr<Server>(new Server(std::move(impl)));
  } catch (const zmq::error_t& e) {
    return explain(e, options.listen);
  } catch (const std::system_error& e) {
    return connection_error("no threads to solve with: " + std::string(e.what()));
  }
}

Status probe_address(const std::string& listen) {
  if (auto claimed = claim_address(listen); !claimed) return claimed;
  try {
    zmq::context_t context(1);
    zmq::socket_t socket(context, zmq::socket_type::router);
    socket.set(zmq::sockopt::linger, 0);
    socket.set(zmq::sockopt::ipv6, listen.find('[') != std::string::npos);
    socket.bind(listen);
    remove_ipc_file(socket.get(zmq::sockopt::last_endpoint));
    return ok();
  } catch (const zmq::error_t& e) {
    return explain(e, listen);
  }
}

void Server::run(const std::atomic<bool>& stop,
                 const std::function<std::optional<Served>()>& other) {
  Impl& s = *impl_;
  std::optional<Served> next;
  while (!stop.load(std::memory_order_relaxed)) {
    try {
      if (!next) next = other();
      if (next) s.replace(*next);  // until it is done: what is served now may be gone afterwards
      next.reset();
      s.turn();
    } catch (const zmq::error_t& e) {
      if (e.num() == EINTR) continue;  // a signal: look at `stop`
      s.log.error("socket_failed", {{"reason", e.what()}});
      break;
    } catch (const std::bad_alloc&) {  // costs what was at hand, not the daemon
      s.log.error("out_of_memory", {{"clients", s.sessions.size()}});
    }
  }
  try {
    for (const Outgoing& farewell : s.sessions.close())
      s.send(farewell);
    s.give_back();
    s.socket.close();
  } catch (const zmq::error_t& e) {
    s.log.warn("farewell_failed", {{"reason", e.what()}});
  }
  const SessionCounters& c = s.sessions.counters();
  s.log.info("closed", {{"welcomed", c.welcomed},
                        {"poses", c.poses},
                        {"answers", c.answers},
                        {"superseded", c.superseded},
                        {"beyond_ladder", c.beyond_ladder},
                        {"cut_short", c.cut_short},
                        {"edits", c.edits},
                        {"edits_refused", c.edits_refused},
                        {"refused", c.refused},
                        {"malformed", c.malformed},
                        {"dropped", s.dropped},
                        {"bytes_out", c.bytes_out}});
}

}  // namespace ivis::server
