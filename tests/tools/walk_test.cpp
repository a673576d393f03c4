// `ivis walk` past a live `ivisd`.

#include <csignal>

#include <gtest/gtest.h>

#include "tests/server/process.h"
#include "tests/tools/small_town.h"

namespace ivis::test {
namespace {

const std::vector<std::string> kKeys{"poses",
                                     "stalls",
                                     "uncovered_frames",
                                     "bytes_mean",
                                     "bytes_median",
                                     "round_trip_ms_p50",
                                     "round_trip_ms_p99"};

/// The first keys are those promised; more may follow.
void expect_promised_keys(const Json& j) {
  auto found = keys(j);
  ASSERT_GE(found.size(), kKeys.size());
  found.resize(kKeys.size());
  EXPECT_EQ(found, kKeys);
}

TEST(ToolWalk, WhatAClientWasToldMissesNothing) {
  const SmallTown town;
  const std::string address = "ipc://" + (town.folder / "socket");
  Process daemon({IVIS_DAEMON, "--scene", town.scene, "--reach", "disc:1", "--listen", address});
  ASSERT_TRUE(daemon.says("listening")) << daemon.output();
  for (const std::string policy : {"stall", "incomplete"}) {
    const std::string record = town.folder / policy;
    const Ran ran = ivis({"walk", "--connect", address, "--path", town.path, "--policy", policy,
                          "--record", record, "--json"});
    ASSERT_EQ(ran.code, 0) << ran.errors << daemon.output();
    const Json j = ran.json();
    expect_promised_keys(j);
    EXPECT_EQ(j["poses"], SmallTown::kPoses);
    EXPECT_EQ(j["uncovered_frames"], 0);
    EXPECT_GT(j["bytes_mean"], 0);
    EXPECT_GT(j["round_trip_ms_p50"], 0);
    EXPECT_GE(j["round_trip_ms_p99"], j["round_trip_ms_p50"]);
    const Ran verified = ivis({"verify", town.scene, "--record", record, "--json"});
    EXPECT_EQ(verified.code, 0) << verified.out << verified.errors;
    EXPECT_GT(verified.json()["rays"], 0);
  }
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.finish(), 0) << daemon.output();
}

TEST(ToolWalk, OverTcpOnAPortOfTheSystemsChoice) {
  const SmallTown town;
  Process daemon({IVIS_DAEMON, "--scene", town.scene, "--listen", "tcp://127.0.0.1:*"});
  ASSERT_TRUE(daemon.says("listening")) << daemon.output();
  ASSERT_TRUE(daemon.says("tcp://127.0.0.1:")) << daemon.output();
  ASSERT_TRUE(daemon.says("\n")) << daemon.output();
  const std::string address = word_after(daemon.output(), "address=");
  const Ran ran = ivis({"walk", "--connect", address, "--path", town.path});
  EXPECT_EQ(ran.code, 0) << ran.errors << daemon.output();
  EXPECT_NE(ran.out.find("bytes a pose"), std::string::npos);
}

TEST(ToolWalk, ASilentAddressIsAConnectionErrorAndRecordsNothing) {
  const SmallTown town;
  const std::string record = town.folder / "record";
  const Ran ran = ivis({"walk", "--connect", "ipc://" + (town.folder / "nobody"), "--path",
                        town.path, "--record", record});
  EXPECT_EQ(ran.code, 4) << ran.errors;
  for (const std::string& said :
       {"ipc://" + (town.folder / "nobody"), std::string("no answer within"),
        std::string("Is an ivisd running")})
    EXPECT_NE(ran.errors.find(said), std::string::npos) << ran.errors;
  EXPECT_FALSE(std::filesystem::exists(record));
}

TEST(ToolWalk, InRealTimeWhatWasDrawnMissesNothingAndReplaysTheSame) {
  const SmallTown town;
  const std::string address = "ipc://" + (town.folder / "socket");
  const auto daemon_with = [&](const std::string& reach) {
    return std::vector<std::string>{IVIS_DAEMON, "--scene",  town.scene, "--reach",
                                    reach,       "--listen", address};
  };
  const std::string record = town.folder / "record";
  const std::vector<std::string> again{"replay", record, "--connect", address, "--json"};
  {
    Process daemon(daemon_with("cylinder:1.5,0.1"));
    ASSERT_TRUE(daemon.says("event=ladder rungs=4")) << daemon.output();
    for (const std::vector<std::string>& wish :
         {std::vector<std::string>{},
          {"--strategy", "abort", "--budget-ms", "0.02"},
          {"--strategy", "predictive", "--budget-ms", "0.02"},
          {"--policy", "show-all", "--predict", "--speed-limit", "3"},
          {"--turning", "90"}}) {
      std::vector<std::string> words{"walk", "--connect", address, "--path",   town.path, "--fps",
                                     "60",   "--seconds", "1.5",   "--record", record,    "--json"};
      words.insert(words.end(), wish.begin(), wish.end());
      const Ran ran = ivis(words);
      ASSERT_EQ(ran.code, 0) << ran.errors << daemon.output();
      const Json j = ran.json();
      if (wish.empty() || wish[0] == "--strategy") {
        EXPECT_EQ(j["uncovered_frames"], 0) << "the eye is held";
      }
      for (const char* key : {"t_vis_ms_p50", "t_vis_ms_p99", "reach_median", "held_m",
                              "stall_causes", "pvs_age_ms_p99"})
        EXPECT_TRUE(j.contains(key)) << key;
      EXPECT_GT(j["frames"], 10);
      EXPECT_LE(j["reach_median"], 1.5);
      const Ran verified = ivis({"verify", town.scene, "--record", record, "--stride", "10"});
      EXPECT_EQ(verified.code, 0) << verified.out << verified.errors;
      std::vector<std::string> replayed = again;
      if (!wish.empty() && wish[0] == "--strategy")
        replayed.insert(replayed.end(), wish.begin(), wish.end());
      const Ran same = ivis(replayed);
      EXPECT_EQ(same.code, 0) << same.out << same.errors;
      EXPECT_GT(same.json()["same"], 5);
    }
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.finish(), 0) << daemon.output();
  }
  Process other(daemon_with("cylinder:9,0.1"));
  ASSERT_TRUE(other.says("listening")) << other.output();
  const Ran compared = ivis(again);
  EXPECT_EQ(compared.code, 1) << "cells of another ladder cannot be compared";
  EXPECT_GT(compared.json()["other_cell"], 0);
}

TEST(ToolWalk, RefusesALargerReachThanTheServers) {
  const SmallTown town;
  const std::string address = "ipc://" + (town.folder / "socket");
  Process daemon({IVIS_DAEMON, "--scene", town.scene, "--reach", "disc:1", "--listen", address});
  ASSERT_TRUE(daemon.says("listening")) << daemon.output();
  const Ran ran = ivis({"walk", "--connect", address, "--path", town.path, "--reach", "disc:5"});
  EXPECT_EQ(ran.code, 3) << ran.errors;
}

}  // namespace
}  // namespace ivis::test
