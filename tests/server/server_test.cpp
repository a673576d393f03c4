// The server's socket: hostile peers, addresses, farewell.

#include "server/server.h"

#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <random>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zmq.hpp>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "server/address.h"
#include "tests/server/running_server.h"

namespace ivis::test {
namespace {

using ::testing::HasSubstr;

/// A raw peer of the server.
class RawPeer {
 public:
  explicit RawPeer(const std::string& endpoint, zmq::socket_type type = zmq::socket_type::dealer)
      : socket_(context_, type) {
    socket_.set(zmq::sockopt::linger, 1000);
    socket_.set(zmq::sockopt::rcvtimeo, 10'000);
    socket_.connect(endpoint);
  }
  void send(std::span<const std::byte> bytes, bool more = false) {
    socket_.send(zmq::buffer(bytes.data(), bytes.size()),
                 more ? zmq::send_flags::sndmore : zmq::send_flags::none);
  }
  void send(const wire::Message& m) { send(wire::encode(m)); }
  std::optional<wire::Message> receive() {
    zmq::message_t m;
    if (!socket_.recv(m)) return std::nullopt;
    auto decoded = wire::decode({static_cast<const std::byte*>(m.data()), m.size()});
    return decoded ? std::optional(*decoded) : std::nullopt;
  }
  std::uint64_t greet() {
    send(wire::Hello{});
    const auto m = receive();
    const auto* w = m ? std::get_if<wire::Welcome>(&*m) : nullptr;
    EXPECT_NE(w, nullptr);
    return w != nullptr ? w->session : 0;
  }
  bool answered(std::uint64_t session, std::uint32_t sequence) {
    send(wire::PoseMessage{session, sequence, 0, {4, 1, 4}});
    const auto m = receive();
    const auto* pvs = m ? std::get_if<wire::PvsMessage>(&*m) : nullptr;
    return pvs != nullptr && pvs->sequence == sequence;
  }

 private:
  zmq::context_t context_{1};
  zmq::socket_t socket_;
};

class ServerSocket : public ::testing::Test {
 protected:
  Scene scene = grid_scene(8);
  NearMethod method{scene};
};

TEST_F(ServerSocket, HostilePeersDoNotDisturbAnother) {
  RunningServer server(scene, method);
  RawPeer good(server.endpoint());
  const std::uint64_t session = good.greet();
  RawPeer evil(server.endpoint());
  std::mt19937 random(3);
  std::uint32_t sequence = 0;
  for (int round = 0; round < 20; ++round) {
    std::vector<std::byte> garbage(random() % 5000);
    for (auto& b : garbage)
      b = static_cast<std::byte>(random());
    evil.send(garbage);
    evil.send(garbage, true);  // several frames
    evil.send(garbage, true);
    evil.send(garbage);
    evil.send(wire::PoseMessage{session, 1000, 0, {0, 0, 0}});  // another's session
    evil.send(wire::Bye{session});
    RawPeer huge(server.endpoint());
    huge.send(std::vector<std::byte>(1 << 20));
    ASSERT_TRUE(good.answered(session, ++sequence));
  }
  server.stop();
  EXPECT_GE(server.counters().malformed, 20U);
  EXPECT_EQ(server.counters().welcomed, 1U);
}

TEST_F(ServerSocket, RawBytesOnTheTcpPortDoNotDisturbAClient) {
  RunningServer server(scene, method);
  RawPeer good(server.endpoint());
  const std::uint64_t session = good.greet();
  for (int i = 0; i < 5; ++i) {
    RawPeer stream(server.endpoint(), zmq::socket_type::sub);  // the wrong kind of peer
    ASSERT_TRUE(good.answered(session, static_cast<std::uint32_t>(i + 1)));
  }
}

TEST_F(ServerSocket, AClientThatNeverReadsDoesNotHoldUpAnother) {
  RunningServer server(scene, method);
  RawPeer mute(server.endpoint());
  const std::uint64_t mute_session = mute.greet();
  RawPeer good(server.endpoint());
  const std::uint64_t session = good.greet();
  for (std::uint32_t s = 1; s <= 3000; ++s) {
    mute.send(wire::PoseMessage{mute_session, s, 0, {4, 1, 4}});
    if (s % 100 == 0) {
      ASSERT_TRUE(good.answered(session, s));
    }
  }
}

/// Solves for nobody before so many are being solved for at a time.
class TogetherMethod : public NearMethod {
 public:
  TogetherMethod(const Scene& scene, int together) : NearMethod(scene), wanted_(together) {}
  using NearMethod::solve;
  Result<Pvs> solve(const ViewCell& cell) const override {
    std::unique_lock lock(mutex_);
    ++inside_;
    changed_.notify_all();
    const bool met =
        changed_.wait_for(lock, std::chrono::seconds(10), [this] { return inside_ >= wanted_; });
    lock.unlock();
    return met ? NearMethod::solve(cell) : Result<Pvs>(invalid_argument("alone"));
  }

 private:
  int wanted_;
  mutable int inside_ = 0;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
};

TEST(Workers, SolveForSeveralClientsAtATime) {
  const Scene scene = grid_scene(6);
  const TogetherMethod method(scene, 3);
  RunningServer server(scene,
                       std::make_unique<server::Ladder>(Reach::cylinder(1.5, 0.1), method, 0.001),
                       "tcp://127.0.0.1:*", {}, 3);
  std::vector<std::unique_ptr<RawPeer>> peers;
  for (int i = 0; i < 3; ++i) {
    peers.push_back(std::make_unique<RawPeer>(server.endpoint()));
    const std::uint64_t session = peers.back()->greet();
    peers.back()->send(wire::PoseMessage{session, 1, 0, {4, 1, 4}});
  }
  for (auto& p : peers) {
    const auto m = p->receive();
    ASSERT_TRUE(m);
    EXPECT_FALSE(std::get<wire::PvsMessage>(*m).everything) << "none was solved for alone";
  }
}

TEST(Workers, AServerCanBeClosedWhileTheySolve) {
  const Scene scene = grid_scene(6);
  const NearMethod method(scene);
  server::SessionLimits limits;
  limits.least_solve = std::chrono::milliseconds(300);
  RunningServer server(scene, method, Reach::cylinder(1.5, 0.1), "tcp://127.0.0.1:*", limits);
  RawPeer peer(server.endpoint());
  const std::uint64_t session = peer.greet();
  peer.send(wire::PoseMessage{session, 1, 0, {4, 1, 4}});
  while (method.solves == 0)
    std::this_thread::yield();
  server.stop();
  const auto m = peer.receive();
  ASSERT_TRUE(m);
  EXPECT_TRUE(std::holds_alternative<wire::Refused>(*m)) << "farewell";
}

TEST_F(ServerSocket, BidsItsClientsFarewell) {
  auto server = std::make_unique<RunningServer>(scene, method);
  RawPeer peer(server->endpoint());
  const std::uint64_t session = peer.greet();
  server->stop();
  const auto m = peer.receive();
  ASSERT_TRUE(m);
  ASSERT_TRUE(std::holds_alternative<wire::Refused>(*m));
  EXPECT_EQ(std::get<wire::Refused>(*m).reason, wire::Refusal::kClosing);
  EXPECT_EQ(std::get<wire::Refused>(*m).session, session);
}

class Address : public ServerSocket {
 protected:
  std::string path = ::testing::TempDir() + "ivis_address_" + std::to_string(getpid()) + ".sock";
  std::string ipc = "ipc://" + path;
  server::ServedScene served = server::served_scene(scene);
  server::Ladder ladder{Reach::disc(1), method, OccluderSet{}.slack_m};
  server::Log log{server::LogLevel::kOff, false};
  void TearDown() override { std::filesystem::remove(path); }

  Error bind_error(const std::string& listen) {
    server::ServerOptions options;
    options.listen = listen;
    const auto s = server::Server::bind(options, {&served, &ladder, {}, nullptr}, log);
    const auto probed = server::probe_address(listen);
    EXPECT_FALSE(s) << listen;
    EXPECT_FALSE(probed) << listen;
    return s ? Error{} : s.error();
  }
  /// A socket file that nobody listens at, as a killed server leaves it.
  void leave_stale_socket() {
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ASSERT_EQ(listen(fd, 1), 0);
    close(fd);
  }
};

TEST_F(Address, ASecondServerOnATcpPortIsRefused) {
  RunningServer first(scene, method);
  const Error e = bind_error(first.endpoint());
  EXPECT_EQ(e.code, ErrorCode::kConnection);
  EXPECT_THAT(e.message, HasSubstr("another server already listens on " + first.endpoint()));
}

TEST_F(Address, ASecondServerOnAnIpcPathIsRefusedAndTheFirstLivesOn) {
  RunningServer first(scene, method, Reach::disc(1), ipc);
  const Error e = bind_error(ipc);
  EXPECT_EQ(e.code, ErrorCode::kConnection);
  EXPECT_THAT(e.message, HasSubstr("another server already listens on " + ipc));
  RawPeer peer(ipc);
  EXPECT_TRUE(peer.answered(peer.greet(), 1));
}

TEST_F(Address, AStaleIpcSocketIsTakenOverAndRemovedAtTheEnd) {
  leave_stale_socket();
  ASSERT_TRUE(std::filesystem::exists(path));
  {
    RunningServer server(scene, method, Reach::disc(1), ipc);
    RawPeer peer(ipc);
    EXPECT_TRUE(peer.answered(peer.greet(), 1));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(Address, ProbingLeavesNothingBehind) {
  EXPECT_TRUE(server::probe_address(ipc));
  EXPECT_FALSE(std::filesystem::exists(path));
  std::string endpoint;
  {
    RunningServer server(scene, method);
    endpoint = server.endpoint();
  }
  EXPECT_TRUE(server::probe_address(endpoint));
  RunningServer server(scene, method, Reach::disc(1), endpoint);
}

TEST_F(Address, AnIpv4AddressOnASocketOfIpv6IsSaidInPlain) {
  using server::plain_endpoint;
  EXPECT_EQ(plain_endpoint("tcp://[::ffff:127.0.0.1]:7447"), "tcp://127.0.0.1:7447");
  for (const std::string kept : {"tcp://127.0.0.1:7447", "tcp://[::1]:7447", "tcp://[::ffff:1.2",
                                 "ipc:///tmp/[::ffff:1.2.3.4]"})
    EXPECT_EQ(plain_endpoint(kept), kept);
  const std::string mapped = "tcp://[::ffff:127.0.0.1]:*";
  if (!server::probe_address(mapped)) GTEST_SKIP() << "no IPv6 here";
  RunningServer server(scene, method, Reach::disc(1), mapped);
  EXPECT_THAT(server.endpoint(), ::testing::StartsWith("tcp://127.0.0.1:"));
  RawPeer peer(server.endpoint());
  EXPECT_TRUE(peer.answered(peer.greet(), 1));
}

TEST_F(Address, AFileThatIsNoSocketIsLeftAlone) {
  std::ofstream(path) << "precious";
  EXPECT_EQ(bind_error(ipc).code, ErrorCode::kConnection);
  std::string text;
  std::ifstream(path) >> text;
  EXPECT_EQ(text, "precious");
}

TEST_F(Address, NonsenseIsNamed) {
  EXPECT_EQ(bind_error("http://x").code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(bind_error("tcp://nonsense").code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(bind_error("ipc://").code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(bind_error("ipc://" + std::string(300, 'x')).code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(bind_error("ipc:///nonexistent/folder/s").message,
              HasSubstr("/nonexistent/folder/s"));
}

}  // namespace
}  // namespace ivis::test
