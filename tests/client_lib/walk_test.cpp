#include "client_lib/walk.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "client_lib/record.h"
#include "tests/server/running_server.h"

namespace ivis::test {
namespace {

class Walk : public ::testing::Test {
 protected:
  Walk() {
    for (int i = 0; i < 60; ++i)
      path.push_back({0.1 * i, {2.0 + 0.5 * i, 1, 10}, 0, 0});
  }
  void TearDown() override { std::filesystem::remove(file); }
  Scene scene = grid_scene(20);
  NearMethod method{scene};
  std::vector<Pose> path;
  std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("ivis_walk_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(Walk, WithoutPaceEveryPoseIsCoveredByItsOwnAnswer) {
  RunningServer server(scene, method);
  WalkOptions options;
  options.record_file = file;
  std::size_t rows = 0;
  const auto r =
      walk(server.endpoint(), path, options, {}, [&](const WalkProgress& p) { rows = p.done; });
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_EQ(rows, path.size());
  EXPECT_EQ(r->poses, path.size());
  EXPECT_EQ(r->answers, path.size());
  EXPECT_EQ(r->stalls, 0U);
  EXPECT_EQ(r->uncovered_frames, 0U);
  EXPECT_EQ(r->objects, scene.object_count());
  EXPECT_EQ(r->method, "near");
  server.stop();
  EXPECT_DOUBLE_EQ(r->bytes_mean * static_cast<double>(path.size()),
                   static_cast<double>(server.counters().bytes_out));

  const auto record = client::read_record(file);
  ASSERT_TRUE(record) << record.error().message;
  EXPECT_EQ(record->scene_hash, scene.hash);
  ASSERT_EQ(record->frames.size(), path.size());
  client::RecordedSets sets(*record);
  for (std::size_t i = 0; i < path.size(); ++i) {
    EXPECT_TRUE(record->frames[i].covered);
    EXPECT_EQ(record->frames[i].eye, path[i].eye);
    EXPECT_EQ(sets.at(i).objects, method.solve({path[i].eye, record->reach})->objects);
  }
}

TEST_F(Walk, PacedStallingWalkDrawsFromWithinItsCellsOnly) {
  RunningServer server(scene, method);
  WalkOptions options;
  options.hz = 500;
  options.record_file = file;
  for (Pose& p : path)
    p.eye.x *= 5;  // further a row than the reach
  const auto r = walk(server.endpoint(), path, options);
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_GT(r->stalls, 0U);
  const auto record = client::read_record(file);
  ASSERT_TRUE(record) << record.error().message;
  std::size_t uncovered = 0;
  client::RecordedSets sets(*record);
  for (std::size_t i = 0; i < record->frames.size(); ++i) {
    const auto& f = record->frames[i];
    const Pvs pvs = sets.at(i);
    if (!f.covered) {
      EXPECT_TRUE(f.everything) << "only before the first PVS";
      ++uncovered;
    } else {
      EXPECT_EQ(pvs.objects, method.solve(f.cell)->objects);
    }
  }
  EXPECT_EQ(uncovered, r->uncovered_frames);
}

TEST_F(Walk, PacedIncompleteWalkCountsItsUncoveredFrames) {
  RunningServer server(scene, method);
  WalkOptions options;
  options.hz = 500;
  options.policy = WalkOptions::Policy::kIncomplete;
  for (Pose& p : path)
    p.eye.x *= 5;
  const auto r = walk(server.endpoint(), path, options);
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_GT(r->uncovered_frames, 0U);
  EXPECT_EQ(r->stalls, 0U);
}

TEST_F(Walk, InRealTimeTellsItsSpeedAndStaysInCells) {
  NearMethod small(scene), large(scene);
  auto ladder = std::make_unique<server::Ladder>(
      std::vector<Reach>{Reach::cylinder(1.5, 0.1), Reach::cylinder(50, 0.1)}, large, 0.001);
  ladder->add(0, small);
  RunningServer server(scene, std::move(ladder));
  WalkOptions options;
  options.fps = 100;  // 5 m/s: 5 cm a frame
  options.seconds = 2;
  options.record_file = file;
  const auto r = walk(server.endpoint(), path, options);
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_GT(r->frames, 20U);
  EXPECT_EQ(r->uncovered_frames, 0U);
  EXPECT_GT(small.solves, 0) << "the small cell serves once the time is measured";
  EXPECT_GT(r->hold_ms, 0);
  const auto record = client::read_record(file);
  ASSERT_TRUE(record) << record.error().message;
  Vec3 before = record->frames.front().wanted;
  double time = 0;
  for (const auto& f : record->frames) {
    EXPECT_TRUE(f.covered);
    if (!f.everything) {
      EXPECT_TRUE(f.cell.contains(f.eye));
    }
    // Two frames' worth of jitter: late frames are passed over, and their way is made up for.
    EXPECT_LT(glm::distance(f.wanted, before), 5 * (f.time_s - time) + 0.11) << f.time_s;
    before = f.wanted;
    time = f.time_s;
  }
}

TEST_F(Walk, InRealTimeKeepsToTheSpeedLimit) {
  RunningServer server(scene, method, Reach::cylinder(5, 0.1));
  WalkOptions options;
  options.fps = 100;
  options.seconds = 1;
  options.speed_limit_m_s = 1;
  options.record_file = file;
  const auto r = walk(server.endpoint(), path, options);
  ASSERT_TRUE(r) << r.error().message;
  const auto record = client::read_record(file);
  ASSERT_TRUE(record) << record.error().message;
  EXPECT_LT(glm::distance(record->frames.back().wanted, path.front().eye), 1.05);
  EXPECT_GT(glm::distance(record->frames.back().wanted, path.front().eye), 0.2);
}

TEST_F(Walk, InRealTimeNeedsTimesThatAscend) {
  WalkOptions options;
  options.fps = 60;
  path[3].t = path[2].t;
  const auto r = walk("tcp://127.0.0.1:1", path, options);
  ASSERT_FALSE(r);
  EXPECT_EQ(r.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(r.error().message.find("pose 3"), std::string::npos);
  options.hz = 60;
  EXPECT_EQ(walk("tcp://127.0.0.1:1", path, options).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(Walk, FailsWithoutAServerPathOrLeave) {
  WalkOptions options;
  options.connect_timeout_ms = 100;
  options.record_file = file;
  EXPECT_EQ(walk("tcp://127.0.0.1:1", path, options).error().code, ErrorCode::kConnection);
  EXPECT_EQ(walk("tcp://127.0.0.1:1", {}, options).error().code, ErrorCode::kInvalidArgument);
  RunningServer server(scene, method);
  options.connect_timeout_ms = 10'000;
  options.scene_hash = 1;
  EXPECT_EQ(walk(server.endpoint(), path, options).error().code, ErrorCode::kMismatch);
  options.scene_hash = 0;
  const std::atomic<bool> stop{true};
  Context context;
  context.stop = &stop;
  EXPECT_EQ(walk(server.endpoint(), path, options, context).error().code, ErrorCode::kCancelled);
  EXPECT_FALSE(std::filesystem::exists(file)) << "a walk that failed leaves no record";
}

}  // namespace
}  // namespace ivis::test
