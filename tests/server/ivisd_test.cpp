// The daemon as a program: exit codes, signals, addresses, configuration.

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ivis/ivis.hpp>

#include <unistd.h>

#include "tests/server/process.h"
#include "tests/server/tiny_glb.h"

namespace ivis::test {
namespace {

using ::testing::HasSubstr;

class Daemon : public ::testing::Test {
 protected:
  Daemon() {
    std::filesystem::create_directories(folder);
    write_tiny_glb(scene, 5);
  }
  ~Daemon() override { std::filesystem::remove_all(folder); }

  std::unique_ptr<Process> start(std::vector<std::string> arguments,
                                 const std::vector<std::string>& environment = {}) {
    arguments.insert(arguments.begin(), IVIS_DAEMON);
    return std::make_unique<Process>(arguments, environment);
  }
  /// Runs to the end.
  int run(const std::vector<std::string>& arguments,
          const std::vector<std::string>& environment = {}) {
    const auto p = start(arguments, environment);
    const int code = p->finish();
    output = p->output();
    return code;
  }
  std::unique_ptr<Process> serve(const std::string& address) {
    auto p = start({"--scene", scene.string(), "--listen", address});
    EXPECT_TRUE(p->says("event=listening") && p->says("address=")) << p->output();
    EXPECT_TRUE(p->says("\n"));
    return p;
  }
  static VisibilityClient connect(const std::string& endpoint) {
    ivis_client_options options = ivis_client_options_default();
    options.endpoint = endpoint.c_str();
    options.connect_timeout_ms = 20'000;
    return VisibilityClient::connect(options);
  }
  std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / ("ivisd_test_" + std::to_string(getpid()));
  std::filesystem::path scene = folder / "tiny.glb";
  std::string output;
};

TEST_F(Daemon, ServesASceneAndDrainsOnTermination) {
  for (const int signal : {SIGTERM, SIGINT}) {
    const auto daemon = serve("tcp://127.0.0.1:*");
    auto client = connect(
        word_after(daemon->output().substr(daemon->output().find("event=listening")), "address="));
    ASSERT_TRUE(client) << client.error();
    EXPECT_EQ(client.info()->object_count, 5U);
    EXPECT_STREQ(client.info()->reach, "cylinder:1.5,0.1");
    ASSERT_EQ(client.pose({-5, 0.5, 0.5}), IVIS_OK);
    ASSERT_EQ(client.wait(20'000), IVIS_OK) << client.error();
    EXPECT_TRUE(client.view({-5, 0.5, 0.5}).visible(0)) << "nothing stands before the first box";
    daemon->signal(signal);
    EXPECT_EQ(daemon->finish(), 0) << daemon->output();
    EXPECT_THAT(daemon->output(), HasSubstr("event=closed"));
    client.wait(2'000);
    client.pose({-6, 0.5, 0.5});
    client.wait(1'000);
    EXPECT_THAT(client.error(), HasSubstr("closing"));
  }
}

TEST_F(Daemon, ASecondOneOnTheSameAddressSaysSoAndExits4) {
  const std::string ipc = "ipc://" + (folder / "s").string();
  for (const std::string& address : {std::string("tcp://127.0.0.1:*"), ipc}) {
    const auto first = serve(address);
    const std::string bound =
        word_after(first->output().substr(first->output().find("event=listening")), "address=");
    EXPECT_EQ(run({"--scene", scene.string(), "--listen", bound}), 4);
    EXPECT_THAT(output, HasSubstr("another server already listens on " + bound));
    EXPECT_TRUE(connect(bound)) << "the first one lives on";
    first->signal(SIGTERM);
    EXPECT_EQ(first->finish(), 0);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "s")) << "the ipc socket is removed";
}

TEST_F(Daemon, TakesOverTheSocketOfAKilledOne) {
  const std::string ipc = "ipc://" + (folder / "s").string();
  auto killed = serve(ipc);
  killed->signal(SIGKILL);
  killed->finish();
  ASSERT_TRUE(std::filesystem::exists(folder / "s"));
  const auto second = serve(ipc);
  EXPECT_TRUE(connect(ipc));
}

TEST_F(Daemon, HelpTeachesWithAnExample) {
  EXPECT_EQ(run({"--help"}), 0);
  for (const char* word : {"Example:", "--occluders", "--listen", "--check-config", "IVISD_",
                           "cylinder:r,h", "Exit codes"})
    EXPECT_THAT(output, HasSubstr(word));
}

TEST_F(Daemon, UsageErrorsExit2) {
  EXPECT_EQ(run({}), 2);
  EXPECT_THAT(output, HasSubstr("--scene"));
  EXPECT_EQ(run({"--no-such-flag"}), 2);
  EXPECT_EQ(run({"--scene", scene.string(), "--reach", "disk:1"}), 2);
  EXPECT_THAT(output, HasSubstr("flag --reach"));
  EXPECT_EQ(run({"--scene", scene.string(), "--ladder", "disc:1 disc:0.5"}), 2);
  EXPECT_THAT(output, HasSubstr("ascending"));
  EXPECT_EQ(run({"--scene", scene.string(), "--strategy", "hope"}), 2);
  EXPECT_THAT(output, HasSubstr("expected guaranteed, abort or predictive"));
  EXPECT_EQ(run({"--scene", scene.string(), "--budget-us", "0"}), 2);
  EXPECT_THAT(output, HasSubstr("flag --budget-us"));
}

TEST_F(Daemon, BadInputExits3) {
  EXPECT_EQ(run({"--scene", "/nonexistent.glb"}), 3);
  EXPECT_THAT(output, HasSubstr("/nonexistent.glb"));
  std::ofstream(folder / "bad.glb") << "nonsense";
  EXPECT_EQ(run({"--scene", (folder / "bad.glb").string()}), 3);
  EXPECT_EQ(run({"--scene", scene.string(), "--occluders", (folder / "bad.glb").string()}), 3);
  EXPECT_EQ(run({"--scene", scene.string(), "--method", "guessing"}), 3);
  EXPECT_THAT(output, HasSubstr("guessing"));
  std::ofstream(folder / "bad.toml") << "\nreech = 1\n";
  EXPECT_EQ(run({"--config", (folder / "bad.toml").string()}), 3);
  EXPECT_THAT(output, HasSubstr("bad.toml:2: unknown key 'reech'"));
  EXPECT_EQ(run({"--scene", scene.string()}, {"IVISD_THREADS=none"}), 3);
  EXPECT_THAT(output, HasSubstr("IVISD_THREADS"));
}

TEST_F(Daemon, CheckConfigShowsWhereEachValueComesFrom) {
  std::ofstream(folder / "d.toml") << "scene = \"tiny.glb\"\nthreads = 2\nreach = \"disc:2\"\n";
  const std::string file = (folder / "d.toml").string();
  EXPECT_EQ(
      run({"--config", file, "--check-config", "--log-level", "warn"}, {"IVISD_REACH=disc:1"}), 0);
  EXPECT_THAT(output, HasSubstr("threads = 2"));
  EXPECT_THAT(output, HasSubstr("# " + file + ":2"));
  EXPECT_THAT(output, HasSubstr("# environment IVISD_REACH"));
  EXPECT_THAT(output, HasSubstr("# flag --log-level"));
  EXPECT_THAT(output, HasSubstr("# default"));
  EXPECT_EQ(run({"--check-config"}), 3) << "no scene";
  EXPECT_EQ(run({"--check-config", "--scene", "/nonexistent.glb"}), 3);
}

TEST_F(Daemon, LogsJsonWhenAsked) {
  auto p = start({"--scene", scene.string(), "--listen", "tcp://127.0.0.1:*", "--json-logs"});
  EXPECT_TRUE(p->says("\"event\":\"listening\"")) << p->output();
}

}  // namespace
}  // namespace ivis::test
