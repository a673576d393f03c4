#include "server/address.h"

#include <cerrno>
#include <charconv>
#include <cstring>
#include <string_view>
#include <system_error>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

namespace ivis::server {
namespace {

constexpr std::string_view kIpc = "ipc://";
constexpr std::string_view kTcp = "tcp://";

enum class Listener { kNone, kLive, kUnknown };

Listener who_listens(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return Listener::kUnknown;
  const int connected = connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const int reason = errno;
  close(fd);
  // EAGAIN: somebody listens whose queue is full.
  if (connected == 0 || reason == EAGAIN || reason == EINPROGRESS) return Listener::kLive;
  return reason == ECONNREFUSED || reason == ENOENT ? Listener::kNone : Listener::kUnknown;
}

/// ZeroMQ takes a port modulo 65,536 without a word.
Status check_port(const std::string& endpoint) {
  const std::string port = endpoint.substr(endpoint.rfind(':') + 1);
  if (port == "*") return ok();
  unsigned value = 0;
  const auto parsed = std::from_chars(port.data(), port.data() + port.size(), value);
  if (parsed.ec != std::errc{} || parsed.ptr != port.data() + port.size() || value > 65535)
    return invalid_argument("'" + endpoint + "': found port '" + port +
                            "', expected 0 to 65535 or *");
  return ok();
}

}  // namespace

Status claim_address(const std::string& endpoint) {
  if (endpoint.starts_with(kTcp)) return check_port(endpoint);
  if (!endpoint.starts_with(kIpc))
    return invalid_argument("'" + endpoint +
                            "' is not an address, expected tcp://HOST:PORT or ipc://PATH");
  const std::string path = endpoint.substr(kIpc.size());
  if (path.empty() || path.size() >= sizeof(sockaddr_un::sun_path))
    return invalid_argument("'" + endpoint + "': the path of an ipc address has 1 to " +
                            std::to_string(sizeof(sockaddr_un::sun_path) - 1) + " characters");
  if (path[0] == '@' || path == "*") return ok();  // no file; the system refuses a second one
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) return ok();
  if (!S_ISSOCK(info.st_mode)) return connection_error("'" + path + "' exists and is not a socket");
  switch (who_listens(path)) {
    case Listener::kLive:
      return connection_error("another server already listens on " + endpoint);
    case Listener::kUnknown:
      return connection_error("'" + path + "' cannot be asked whether a server listens there: " +
                              std::generic_category().message(errno));
    case Listener::kNone:
      break;
  }
  if (unlink(path.c_str()) != 0 && errno != ENOENT)
    return connection_error("cannot remove the stale socket '" + path +
                            "': " + std::generic_category().message(errno));
  return ok();
}

std::string plain_endpoint(std::string endpoint) {
  constexpr std::string_view kMapped = "tcp://[::ffff:";
  if (!endpoint.starts_with(kMapped)) return endpoint;
  const auto end = endpoint.find(']');
  if (end == std::string::npos) return endpoint;
  return std::string(kTcp) + endpoint.substr(kMapped.size(), end - kMapped.size()) +
         endpoint.substr(end + 1);
}

bool is_local(const std::string& endpoint) {
  for (const char* local : {"ipc://", "tcp://127.", "tcp://localhost:", "tcp://[::1]:"})
    if (endpoint.starts_with(local)) return true;
  return false;
}

}  // namespace ivis::server
