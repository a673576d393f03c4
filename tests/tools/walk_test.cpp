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
