// A client against a server that is killed and comes back.

#include <ivis/ivis.hpp>

#include <gtest/gtest.h>

#include "tests/server/fake_method.h"
#include "tests/server/process.h"

namespace ivis::test {
namespace {

constexpr int kWait = 20'000;  // ms; only ever waited out by a failure

class ClientAndKilledServer : public ::testing::Test {
 protected:
  void start(int grid, const std::string& address) {
    server = std::make_unique<Process>(
        std::vector<std::string>{IVIS_GRID_SERVER, address, std::to_string(grid)});
    ASSERT_TRUE(server->says("event=listening") && server->says("\n")) << server->output();
    endpoint = word_after(server->output(), "address=");
  }
  void start_and_connect() {
    start(12, "tcp://127.0.0.1:*");
    ivis_client_options options = ivis_client_options_default();
    options.endpoint = endpoint.c_str();
    options.silence_timeout_ms = 200;
    options.connect_timeout_ms = kWait;
    client = VisibilityClient::connect(options);
    ASSERT_TRUE(client) << client.error();
    ASSERT_EQ(client.pose({4, 1, 4}), IVIS_OK);
    ASSERT_EQ(client.wait(kWait), IVIS_OK) << client.error();
  }
  void kill_server() {
    server->signal(SIGKILL);
    EXPECT_EQ(server->finish(), -SIGKILL);
  }
  std::string endpoint;
  std::unique_ptr<Process> server;
  VisibilityClient client;
};

TEST_F(ClientAndKilledServer, KeepsTheOldCellWhileItIsGoneAndGoesOnAfterwards) {
  start_and_connect();
  kill_server();
  // A static scene: the old cell's PVS is still true.
  const PvsView inside = client.frame({4.5, 1, 4});
  EXPECT_TRUE(inside.covered());
  EXPECT_FALSE(inside.everything());
  const std::uint32_t count = inside.count();
  const PvsView outside = client.frame({9, 1, 4});
  EXPECT_FALSE(outside.covered());
  EXPECT_TRUE(outside.everything());
  EXPECT_EQ(client.wait(600), IVIS_ERROR_TIMEOUT);
  EXPECT_FALSE(client.view({9, 1, 4}).raw().connected);
  EXPECT_NE(client.error(), "");

  start(12, endpoint);
  client.pose({4, 1, 4});
  ASSERT_EQ(client.wait(kWait), IVIS_OK) << client.error();
  const PvsView again = client.view({4, 1, 4});
  EXPECT_TRUE(again.covered());
  EXPECT_TRUE(again.raw().connected);
  EXPECT_EQ(again.count(), count);
  EXPECT_GE(client.stats().reconnects, 1U);
}

TEST_F(ClientAndKilledServer, IsAnsweredByARestartedServerWithoutAskingAgain) {
  start_and_connect();
  kill_server();
  client.pose({6, 1, 4});
  start(12, endpoint);
  ASSERT_EQ(client.wait(kWait), IVIS_OK) << client.error();
  EXPECT_TRUE(client.view({6, 1, 4}).covered());
}

TEST_F(ClientAndKilledServer, SaysSoWhenItComesBackWithAnotherScene) {
  start_and_connect();
  const std::uint64_t hash = client.info()->scene_hash;
  kill_server();
  start(13, endpoint);
  client.pose({4, 1, 4});
  EXPECT_EQ(client.wait(kWait), IVIS_ERROR_MISMATCH);
  char own[20];
  std::snprintf(own, sizeof own, "%016llx", static_cast<unsigned long long>(hash));
  EXPECT_NE(client.error().find(own), std::string::npos) << client.error();
  std::snprintf(own, sizeof own, "%016llx", static_cast<unsigned long long>(grid_scene(13).hash));
  EXPECT_NE(client.error().find(own), std::string::npos) << client.error();
  // What was known of the client's own scene is still true there, and nothing elsewhere.
  EXPECT_TRUE(client.frame({4, 1, 4}).covered());
  EXPECT_EQ(client.status(), IVIS_ERROR_MISMATCH);
  EXPECT_TRUE(client.frame({20, 1, 4}).everything());
}

TEST_F(ClientAndKilledServer, SurvivesAServerThatCloses) {
  start_and_connect();
  server->signal(SIGTERM);
  EXPECT_EQ(server->finish(), 0);
  client.pose({6, 1, 4});
  start(12, endpoint);
  ASSERT_EQ(client.wait(kWait), IVIS_OK) << client.error();
}

}  // namespace
}  // namespace ivis::test
