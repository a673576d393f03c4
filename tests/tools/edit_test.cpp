// `ivis edit` past a live `ivisd`, and what SIGHUP does to both.

#include <csignal>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/process.h"
#include "tests/tools/small_town.h"

namespace ivis::test {
namespace {

using ::testing::HasSubstr;

class ToolEdit : public ::testing::Test {
 protected:
  SmallTown town;
  const std::string address = "ipc://" + (town.folder / "socket");
  Ran edit(std::vector<std::string> what, bool json = false) {
    std::vector<std::string> all{"edit", "--connect", address};
    if (json) all.insert(all.begin() + 1, "--json");
    all.insert(all.end(), what.begin(), what.end());
    return ivis(all);
  }
};

TEST_F(ToolEdit, ChangesWhatAWalkIsToldAndItsRecordVerifies) {
  Process daemon({IVIS_DAEMON, "--scene", town.scene, "--reach", "disc:1", "--listen", address});
  ASSERT_TRUE(daemon.says("listening")) << daemon.output();
  const auto walked = [&](const std::string& name) {
    const std::string record = town.folder / name;
    const Ran ran =
        ivis({"walk", "--connect", address, "--path", town.path, "--record", record, "--json"});
    EXPECT_EQ(ran.code, 0) << ran.errors;
    const Ran verified = ivis({"verify", town.scene, "--record", record, "--json"});
    EXPECT_EQ(verified.code, 0) << verified.out << verified.errors;
    EXPECT_GT(verified.json()["rays"], 0);
    return ran.json();
  };
  const Json before = walked("before");
  EXPECT_EQ(before["epoch"], 0);
  // Houses come first.
  for (const char* id : {"3", "7", "11"}) {
    const Ran ran = edit({"remove", id});
    EXPECT_EQ(ran.code, 0) << ran.errors;
    EXPECT_THAT(ran.out, HasSubstr("done: the scene is at epoch"));
  }
  EXPECT_EQ(edit({"move", "12", "-2,0,3.5", "--turn", "30"}).code, 0);
  EXPECT_EQ(edit({"move", "30", "1,0,1", "--speed", "3"}).code, 0);
  EXPECT_EQ(edit({"occluder", "5", "off"}, true).json()["epoch"], 6);
  const Json after = walked("after");
  EXPECT_EQ(after["epoch"], 6);
  EXPECT_GT(after["pvs_median"], before["pvs_median"]) << "houses are gone";
  // The record holds what was done: without it rays would hit what is not there.
  EXPECT_THAT(read(town.folder / "after"), HasSubstr("\nobject 3 1\n"));
  const Ran replayed = ivis({"replay", town.folder / "after", "--connect", address});
  EXPECT_NE(replayed.code, 0);
  EXPECT_THAT(replayed.errors, HasSubstr("cannot be replayed"));
  for (const char* id : {"3", "7", "11"})
    EXPECT_EQ(edit({"add", id}).code, 0);
  EXPECT_EQ(edit({"occluder", "5", "on"}).code, 0);
  EXPECT_EQ(walked("again")["epoch"], 10);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.finish(), 0) << daemon.output();
}

TEST_F(ToolEdit, SaysWhatIsWrong) {
  EXPECT_EQ(edit({"remove", "1", "--timeout", "0.2"}).code, 4) << "nobody is there";
  Process daemon({IVIS_DAEMON, "--scene", town.scene, "--listen", address});
  ASSERT_TRUE(daemon.says("listening")) << daemon.output();
  const Ran unknown = edit({"remove", "426"});
  EXPECT_EQ(unknown.code, 3);
  EXPECT_THAT(unknown.errors, HasSubstr("refused: no object 426, expected an id below 426"));
  const Ran ground = edit({"remove", "425"});
  EXPECT_EQ(ground.code, 3);
  EXPECT_THAT(ground.errors, HasSubstr("is ground"));
  const Ran json = edit({"remove", "426"}, true);
  EXPECT_EQ(json.code, 3);
  EXPECT_EQ(json.json()["epoch"], 0);
  const std::vector<std::vector<std::string>> wrong{
      {},
      {"remove"},
      {"remove", "x"},
      {"remove", "-1"},
      {"move"},
      {"move", "1"},
      {"move", "1", "2,3"},
      {"move", "1", "1,2,3", "--speed", "2000"},
      {"turn"},
      {"occluder", "1"},
      {"occluder", "1", "?"},
      {"move", "1", "1,2,3", "--turn", "x"},
  };
  for (const auto& w : wrong)
    EXPECT_EQ(edit(w).code, 2) << (w.empty() ? "" : w[0]);
}

TEST_F(ToolEdit, IsRefusedByAServerThatTakesNone) {
  Process daemon({IVIS_DAEMON, "--scene", town.scene, "--listen", address, "--edits", "off"});
  ASSERT_TRUE(daemon.says("listening")) << daemon.output();
  const Ran ran = edit({"remove", "1"});
  EXPECT_EQ(ran.code, 3);
  EXPECT_THAT(ran.errors, HasSubstr("this server takes no edits (ivisd --edits on)"));
  Process another(
      {IVIS_DAEMON, "--scene", town.scene, "--method", "reference", "--listen", address + "2"});
  ASSERT_TRUE(another.says("listening")) << another.output();
  const Ran method = ivis({"edit", "--connect", address + "2", "remove", "1"});
  EXPECT_EQ(method.code, 3);
  EXPECT_THAT(method.errors, HasSubstr("the method reference takes no edits"));
}

TEST_F(ToolEdit, ASceneLoadedAnewForgetsEditsAndOneThatCannotBeReadIsNotTakenUp) {
  Process daemon({IVIS_DAEMON, "--scene", town.scene, "--listen", address});
  ASSERT_TRUE(daemon.says("listening")) << daemon.output();
  EXPECT_EQ(edit({"remove", "1"}).code, 0);
  daemon.signal(SIGHUP);
  ASSERT_TRUE(daemon.says("event=reloaded")) << daemon.output();
  EXPECT_THAT(edit({"remove", "2"}).out, HasSubstr("epoch 1")) << "counted from the start";
  std::filesystem::rename(town.scene, town.scene + ".away");
  daemon.signal(SIGHUP);
  ASSERT_TRUE(daemon.says("event=reload_failed")) << daemon.output();
  EXPECT_THAT(edit({"remove", "3"}).out, HasSubstr("epoch 2")) << "goes on as before";
  std::filesystem::rename(town.scene + ".away", town.scene);
  daemon.signal(SIGHUP);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.finish(), 0) << daemon.output();
}

TEST_F(ToolEdit, UnderNohupAHangupForgetsNothing) {
  Process daemon({"/bin/sh", "-c", "trap '' HUP; exec \"$@\"", "sh", IVIS_DAEMON, "--scene",
                  town.scene, "--listen", address});
  ASSERT_TRUE(daemon.says("listening")) << daemon.output();
  EXPECT_THAT(daemon.output(), HasSubstr("event=no_reload"));
  EXPECT_EQ(edit({"remove", "1"}).code, 0);
  daemon.signal(SIGHUP);
  EXPECT_THAT(edit({"remove", "2"}).out, HasSubstr("epoch 2"));
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.finish(), 0) << daemon.output();
  EXPECT_EQ(daemon.output().find("event=reloading"), std::string::npos);
}

}  // namespace
}  // namespace ivis::test
