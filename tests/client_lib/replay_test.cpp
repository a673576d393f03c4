#include "client_lib/replay.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "client_lib/walk.h"
#include "tests/server/running_server.h"

namespace ivis::test {
namespace {

class Replay : public ::testing::Test {
 protected:
  Scene scene = grid_scene(20);
  NearMethod method{scene}, other{scene, 9};
  std::vector<Pose> path;
  std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / ("ivis_replay_" + std::to_string(getpid()));
  Replay() {
    for (int i = 0; i < 40; ++i)
      path.push_back({0.05 * i, {2.0 + 0.5 * i, 1, 10}, 0, 0});
  }
  void TearDown() override { std::filesystem::remove(file); }
  std::unique_ptr<server::Ladder> ladder(const Method& of) const {
    auto made = std::make_unique<server::Ladder>(
        std::vector<Reach>{Reach::cylinder(0.7, 0.1), Reach::cylinder(2, 0.1)}, of, 0.001);
    made->add(0, of);
    return made;
  }
  client::Record recorded(double fps) {
    RunningServer server(scene, ladder(method));
    WalkOptions options;
    options.fps = fps;
    options.record_file = file;
    const auto walked = walk(server.endpoint(), path, options);
    EXPECT_TRUE(walked) << walked.error().message;
    const auto record = client::read_record(file);
    EXPECT_TRUE(record);
    return record ? *record : client::Record{};
  }
};

TEST_F(Replay, TheSameServerAnswersTheSame) {
  for (const double fps : {0.0, 100.0}) {
    const client::Record record = recorded(fps);
    RunningServer server(scene, ladder(method));
    const auto r = replay(server.endpoint(), record);
    ASSERT_TRUE(r) << r.error().message;
    EXPECT_GT(r->poses, 10U);
    EXPECT_EQ(r->same, r->poses);
    EXPECT_EQ(r->different, 0U);
    EXPECT_EQ(r->other_cell, 0U);
  }
}

TEST_F(Replay, AnotherMethodsAnswersAreToldApart) {
  const client::Record record = recorded(0);
  RunningServer server(scene, ladder(other));
  const auto r = replay(server.endpoint(), record);
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_GT(r->different, 30U);
  ASSERT_FALSE(r->differences.empty());
  EXPECT_LE(r->differences.size(), 20U);
  const auto& d = r->differences.front();
  EXPECT_EQ(d.extra, 0U) << "it lists less";
  const auto size = [&](const Method& m) {
    return m.solve(record.frames[d.frame].cell)->objects.size();
  };
  EXPECT_EQ(d.missing, size(method) - size(other));
}

TEST_F(Replay, ALadderWithoutTheCellComparesNothing) {
  client::Record record = recorded(0);
  record.frames.resize(10);
  record.frames[3].cell.reach = Reach::cylinder(0.1, 0.1);
  RunningServer server(scene, ladder(method));
  const auto r = replay(server.endpoint(), record);
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_EQ(r->other_cell, 1U);
  EXPECT_EQ(r->same, 9U);
}

TEST_F(Replay, FailsWithoutAServerASceneOrAPvs) {
  client::Record record = recorded(0);
  ReplayOptions options;
  options.connect_timeout_ms = 100;
  EXPECT_EQ(replay("tcp://127.0.0.1:1", record, options).error().code, ErrorCode::kConnection);
  const Scene another = grid_scene(5);
  const NearMethod near(another);
  RunningServer server(another, near);
  EXPECT_EQ(replay(server.endpoint(), record).error().code, ErrorCode::kMismatch);
  record.frames.clear();
  EXPECT_EQ(replay(server.endpoint(), record).error().code, ErrorCode::kInput);
}

}  // namespace
}  // namespace ivis::test
