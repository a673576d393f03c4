// A TCP proxy that is a bad network: delay_proxy LISTEN_PORT SERVER_PORT DELAY_MS [DROP_EVERY_S]
// passes on what comes, each way DELAY_MS later, and cuts every connection DROP_EVERY_S seconds
// after the last cut. On the loopback only. Ends with SIGTERM.

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <list>
#include <vector>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace {

using Clock = std::chrono::steady_clock;
std::atomic<bool> stop{false};

sockaddr_in loopback(int port) {
  sockaddr_in a{};
  a.sin_family = AF_INET;
  a.sin_port = htons(static_cast<std::uint16_t>(port));
  a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return a;
}

void prepare(int fd) {
  const int on = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
}

struct Chunk {
  Clock::time_point due;
  std::vector<char> bytes;
  std::size_t sent = 0;
};

/// What one end said and the other has not been told yet.
struct Way {
  int from, to;
  std::deque<Chunk> waiting;
};

struct Connection {
  int client, server;
  Way out{client, server, {}}, back{server, client, {}};
  bool over = false;
};

/// Reads what is there. False: the end is gone.
bool take(Way& way, std::chrono::milliseconds delay) {
  char buffer[65536];
  while (true) {
    const ssize_t n = recv(way.from, buffer, sizeof buffer, 0);
    if (n > 0) {
      way.waiting.push_back({Clock::now() + delay, {buffer, buffer + n}, 0});
      continue;
    }
    return n < 0 && (errno == EAGAIN || errno == EINTR);
  }
}

/// Sends what is due. False: the end is gone.
bool give(Way& way) {
  while (!way.waiting.empty() && way.waiting.front().due <= Clock::now()) {
    Chunk& c = way.waiting.front();
    const ssize_t n = send(way.to, c.bytes.data() + c.sent, c.bytes.size() - c.sent, MSG_NOSIGNAL);
    if (n < 0) return errno == EAGAIN || errno == EINTR;
    c.sent += static_cast<std::size_t>(n);
    if (c.sent == c.bytes.size()) way.waiting.pop_front();
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "delay_proxy LISTEN_PORT SERVER_PORT DELAY_MS [DROP_EVERY_S]\n");
    return 2;
  }
  const auto delay = std::chrono::milliseconds(std::atoi(argv[3]));
  const auto drop_every = std::chrono::seconds(argc > 4 ? std::atoi(argv[4]) : 0);
  std::signal(SIGTERM, [](int) { stop = true; });
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  const int on = 1;
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  const sockaddr_in here = loopback(std::atoi(argv[1]));
  const sockaddr_in there = loopback(std::atoi(argv[2]));
  if (bind(listener, reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0 ||
      listen(listener, 16) != 0) {
    std::perror("delay_proxy");
    return 4;
  }
  prepare(listener);
  std::list<Connection> connections;
  auto next_drop = Clock::now() + drop_every;
  while (!stop) {
    std::vector<pollfd> waits{{listener, POLLIN, 0}};
    auto until = Clock::now() + std::chrono::milliseconds(100);
    for (Connection& c : connections)
      for (Way* w : {&c.out, &c.back}) {
        waits.push_back({w->from, POLLIN, 0});
        if (!w->waiting.empty()) until = std::min(until, w->waiting.front().due);
      }
    const auto left = std::max(Clock::duration::zero(), until - Clock::now());
    timespec timeout{
        0, static_cast<long>(std::chrono::duration_cast<std::chrono::nanoseconds>(left).count())};
    ppoll(waits.data(), waits.size(), &timeout, nullptr);
    while (true) {
      const int client = accept(listener, nullptr, nullptr);
      if (client < 0) break;
      const int server = socket(AF_INET, SOCK_STREAM, 0);
      if (connect(server, reinterpret_cast<const sockaddr*>(&there), sizeof there) != 0) {
        close(client);
        close(server);
        continue;
      }
      prepare(client);
      prepare(server);
      connections.push_back({client, server, {client, server, {}}, {server, client, {}}, false});
    }
    const bool drop = drop_every.count() > 0 && Clock::now() >= next_drop;
    if (drop) next_drop = Clock::now() + drop_every;
    for (Connection& c : connections)
      c.over = drop || !take(c.out, delay) || !take(c.back, delay) || !give(c.out) || !give(c.back);
    connections.remove_if([](const Connection& c) {
      if (!c.over) return false;
      close(c.client);
      close(c.server);
      return true;
    });
  }
}
