#include "occluders/nef_worker.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "occluders/nef_messages.h"

extern char** environ;

namespace ivis {
namespace {

constexpr double kRoundM = 1e-6;  ///< what exact numbers may lose as doubles, and much more
constexpr std::size_t kMostAnswerBytes = std::size_t{16} << 20U;

/// Closes itself.
struct End {
  int fd = -1;
  End() = default;
  End(const End&) = delete;
  End& operator=(const End&) = delete;
  ~End() { shut(); }
  void shut() {
    if (fd >= 0) close(fd);
    fd = -1;
  }
};

/// Our end does not block; the child's does.
struct Link {
  End ours, childs;
  bool open() {
    int fds[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fds) != 0) return false;
    ours.fd = fds[0];
    childs.fd = fds[1];
    return fcntl(ours.fd, F_SETFL, O_NONBLOCK) == 0;
  }
};

/// A child that is killed and waited for when this goes.
struct Child {
  pid_t pid = -1;
  ~Child() {
    if (pid <= 0) return;
    kill(pid, SIGKILL);
    while (waitpid(pid, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
};

Error io(const std::string& what) {
  return io_error(what + ": " + std::strerror(errno));
}

/// Writes `input` to the worker and reads what it says until it ends, time is up, or it says too
/// much.
Result<std::string> converse(const std::filesystem::path& worker, std::string_view input,
                             double seconds, const Context& context) {
  Link link;
  if (!link.open()) return io("cannot make a pair of sockets");
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  // dup2 clears close-on-exec; the ends themselves close.
  posix_spawn_file_actions_adddup2(&actions, link.childs.fd, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, link.childs.fd, STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  // Signals meant for us are not for it: a Ctrl-C reaches it by way of `context`.
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  std::string path = worker.string();
  std::string limit = std::to_string(static_cast<long>(seconds) + 1);
  char* argv[] = {path.data(), limit.data(), nullptr};
  Child child;
  const int failed = posix_spawn(&child.pid, path.c_str(), &actions, &attributes, argv, environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (failed != 0) {
    child.pid = -1;
    const std::string why = "cannot run " + path + ": " + std::strerror(failed);
    // Want of memory or processes passes; a program that is not there stays away.
    return failed == ENOENT || failed == EACCES ? io_error(why) : unsupported(why);
  }
  link.childs.shut();

  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  std::string answer;
  char block[65536];
  while (answer.size() <= kMostAnswerBytes) {
    if (context.stopped()) return cancelled();
    if (std::chrono::steady_clock::now() >= end) break;
    const bool asking = !input.empty();
    pollfd ready{link.ours.fd, static_cast<short>(asking ? POLLIN | POLLOUT : POLLIN), 0};
    if (poll(&ready, 1, 50) < 0 && errno != EINTR) return io("poll");
    if (asking && (ready.revents & POLLOUT) != 0) {
      const ssize_t n = send(link.ours.fd, input.data(), input.size(), MSG_NOSIGNAL);
      if (n > 0) input.remove_prefix(static_cast<std::size_t>(n));
      if (n < 0 && errno != EAGAIN && errno != EINTR) input = {};
      if (input.empty()) shutdown(link.ours.fd, SHUT_WR);
    }
    if ((ready.revents & ~POLLOUT) != 0) {
      const ssize_t n = recv(link.ours.fd, block, sizeof block, 0);
      if (n == 0) break;
      if (n > 0) answer.append(block, static_cast<std::size_t>(n));
      if (n < 0 && errno != EAGAIN && errno != EINTR) break;
    }
  }
  return answer;
}

}  // namespace

std::filesystem::path nef_worker_beside_this() {
  std::error_code ec;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", ec);
  if (ec) return {};
  auto worker = self.parent_path() / "ivis_nef";
  return std::filesystem::exists(worker, ec) && !ec ? worker : std::filesystem::path{};
}

Result<ShrunkPolyhedron> shrink_polyhedron(const std::filesystem::path& worker,
                                           const Polyhedron& solid, const Vec3& half,
                                           std::span<const double> margins_m, double seconds,
                                           const Context& context) {
  const NefRequest request{solid, half + Vec3{kRoundM}, {margins_m.begin(), margins_m.end()}};
  const auto text = converse(worker, encode(request), seconds, context);
  if (!text) return text.error();
  auto answer = decode_nef_answer(*text);
  if (!answer) return unsupported("the worker's answer: " + answer.error().message);
  // Without the parts nobody would know that an eye is inside.
  if (answer->parts.empty() || (!answer->complete && answer->levels.empty()))
    return unsupported(answer->trouble.empty() ? "the worker ended, or took too long"
                                               : "the worker: " + answer->trouble);
  ShrunkPolyhedron shrunk;
  shrunk.parts = std::move(answer->parts);
  for (std::size_t k = 0; k < std::min(answer->levels.size(), margins_m.size()); ++k) {
    if (answer->levels[k].empty()) break;
    if (!within_box_erosion(answer->levels[k], solid, half + Vec3{margins_m[k]})) {
      shrunk.failed_check = true;
      break;
    }
    shrunk.levels.push_back(std::move(answer->levels[k]));
  }
  return shrunk;
}

}  // namespace ivis
