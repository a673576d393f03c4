// The in-process source. No sockets here, so that ThreadSanitizer can judge it.

#include "client_lib/local_source.h"

#include <new>
#include <stdexcept>

#include <gtest/gtest.h>

#include "client_lib/client.h"
#include "scenes/clusters.h"
#include "tests/server/fake_method.h"

namespace ivis::test {
namespace {

constexpr int kWait = 10'000;  // ms

class LocalClient : public ::testing::Test {
 protected:
  void SetUp() override {
    client::LocalWorld world;
    world.reach = Reach::disc(1);
    world.catalogue = client::catalogue_of(scene, world.reach, *method);
    world.method = method;
    client = ivis_client_adopt_source_(client::make_local_source(world).release(),
                                       IVIS_POLICY_EVERYTHING);
  }
  void TearDown() override { ivis_client_close(client); }

  std::vector<ObjectId> ids(const ivis_frame& frame) const {
    std::vector<ObjectId> out;
    for (std::uint32_t id = 0; id < frame.object_count; ++id)
      if (ivis_frame_visible(&frame, id)) out.push_back(id);
    return out;
  }
  Scene scene = grid_scene(15);
  std::shared_ptr<NearMethod> method = std::make_shared<NearMethod>(scene);
  ivis_client* client = nullptr;
};

TEST_F(LocalClient, GivesTheSetsOfTheMethod) {
  for (int i = 0; i < 200; ++i) {
    const double eye[3]{0.1 * i, 1, 12};
    ivis_frame frame;
    ASSERT_EQ(ivis_client_pose(client, eye), IVIS_OK);
    ASSERT_EQ(ivis_client_wait(client, kWait), IVIS_OK);
    ASSERT_EQ(ivis_client_view(client, eye, &frame), IVIS_OK);
    EXPECT_EQ(frame.covered, 1);
    EXPECT_EQ(ids(frame), method->solve({{eye[0], eye[1], eye[2]}, Reach::disc(1)})->objects);
  }
}

TEST_F(LocalClient, FramesNeverGiveASetThatIsWrongForTheirEye) {
  for (int i = 0; i < 20'000; ++i) {
    const double eye[3]{0.001 * i, 1, 12};
    ivis_frame frame;
    ASSERT_EQ(ivis_client_frame(client, eye, &frame), IVIS_OK);
    if (i % 100 != 0 || frame.everything != 0) continue;
    const Vec3 centre{frame.cell_eye[0], frame.cell_eye[1], frame.cell_eye[2]};
    EXPECT_TRUE((ViewCell{centre, Reach::disc(1)}.contains({eye[0], eye[1], eye[2]})));
    EXPECT_EQ(ids(frame), method->solve({centre, Reach::disc(1)})->objects);
  }
  ivis_stats stats;
  ivis_client_stats(client, &stats);
  EXPECT_EQ(stats.frames, 20'000U);
  EXPECT_LE(stats.answers, stats.poses);
}

TEST_F(LocalClient, LatestPoseWins) {
  for (int i = 0; i < 5'000; ++i) {
    const double eye[3]{0.001 * i, 1, 12};
    ivis_client_pose(client, eye);
  }
  ASSERT_EQ(ivis_client_wait(client, kWait), IVIS_OK);
  const double last[3]{0.001 * 4'999, 1, 12};
  ivis_frame frame;
  ivis_client_view(client, last, &frame);
  EXPECT_EQ(frame.sequence, 5'000U);
  EXPECT_EQ(frame.cell_eye[0], last[0]);
}

TEST_F(LocalClient, WhatCannotBeSolvedIsEverything) {
  const double eye[3]{0, -60, 0};
  ivis_frame frame;
  ivis_client_pose(client, eye);
  ASSERT_EQ(ivis_client_wait(client, kWait), IVIS_OK);
  ivis_client_view(client, eye, &frame);
  EXPECT_EQ(frame.everything, 1);
  EXPECT_EQ(frame.visible_count, scene.object_count());
  EXPECT_STREQ(ivis_client_error(client), "below the world");
}

class ThrowingMethod : public NearMethod {
 public:
  using NearMethod::NearMethod;
  Result<Pvs> solve(const ViewCell& cell) const override {
    if (cell.eye.x > 300) throw 42;
    if (cell.eye.x > 200) throw std::runtime_error("a library's complaint");
    if (cell.eye.x > 100) throw std::bad_alloc();
    return NearMethod::solve(cell);
  }
};

TEST_F(LocalClient, AMethodThatThrowsIsAnsweredWithEverythingAndTheReason) {
  TearDown();
  method = std::make_shared<ThrowingMethod>(scene);
  SetUp();
  const std::pair<double, const char*> cases[]{{101, "out of memory"},
                                               {201, "the method failed: a library's complaint"},
                                               {4, ""},
                                               {301, "unknown error"},
                                               {102, "out of memory"},
                                               {5, ""}};
  for (const auto& [x, error] : cases) {
    const double eye[3]{x, 1, 12};
    ivis_frame frame;
    ivis_client_pose(client, eye);
    ASSERT_EQ(ivis_client_wait(client, kWait), IVIS_OK);
    ASSERT_EQ(ivis_client_view(client, eye, &frame), IVIS_OK);
    EXPECT_STREQ(ivis_client_error(client), error);
    const bool solved = *error == '\0';
    EXPECT_EQ(frame.everything, solved ? 0 : 1);
    EXPECT_EQ(frame.visible_count == scene.object_count(), !solved);
  }
}

TEST_F(LocalClient, ClosesWhileItSolves) {
  for (int i = 0; i < 50; ++i) {
    const double eye[3]{0.001 * i, 1, 12};
    ivis_client_pose(client, eye);
    TearDown();
    SetUp();
  }
}

/// A large mesh between two small ones.
Scene clustered_scene() {
  Mesh large;
  large.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (int i = 0; i < 600; ++i)
    large.indices.insert(large.indices.end(), {0, 1, 2});
  large.primitives = {{0, 600, true, true}};
  SceneBuilder b;
  b.add_box({0, 0, 0}, {1, 1, 1});
  b.add_mesh(large);
  b.add_box({5, 0, 0}, {6, 1, 1});
  return *split_into_clusters(std::move(b).finish());
}

TEST(LocalClusters, OfAnInstanceHaveConsecutiveIdsThatTheClientTells) {
  const Scene scene = clustered_scene();
  ASSERT_EQ(scene.objects.size(), 6U);
  client::LocalWorld world;
  world.reach = Reach::disc(1);
  world.method = std::make_shared<NearMethod>(scene);
  world.catalogue = client::catalogue_of(scene, world.reach, *world.method);
  ASSERT_TRUE(client::check_catalogue(world.catalogue));
  ivis_client* c =
      ivis_client_adopt_source_(client::make_local_source(world).release(), IVIS_POLICY_EVERYTHING);
  std::uint32_t first = 9, count = 9, id = 9, cluster = 9, node = 9;
  ASSERT_EQ(ivis_object_ids(c, 1, 0, &first, &count), IVIS_OK);
  EXPECT_EQ(first, 1U);
  EXPECT_EQ(count, 4U);
  ASSERT_EQ(ivis_object_ids(c, 2, 0, &first, &count), IVIS_OK);
  EXPECT_EQ(first, 5U);
  EXPECT_EQ(count, 1U);
  ASSERT_EQ(ivis_object_id(c, 1, 0, &id), IVIS_OK);
  EXPECT_EQ(id, 1U);
  for (std::uint32_t k = 0; k < 4; ++k) {
    ASSERT_EQ(ivis_object_cluster(c, 1 + k, &cluster), IVIS_OK);
    EXPECT_EQ(cluster, k);
    ASSERT_EQ(ivis_object_node(c, 1 + k, &node, nullptr), IVIS_OK);
    EXPECT_EQ(node, 1U);
  }
  EXPECT_EQ(ivis_object_ids(c, 1, 0, nullptr, nullptr), IVIS_OK);
  EXPECT_EQ(ivis_object_ids(c, 1, 1, &first, &count), IVIS_ERROR_ARGUMENT);
  EXPECT_EQ(ivis_object_ids(c, 3, 0, &first, &count), IVIS_ERROR_ARGUMENT);
  EXPECT_EQ(ivis_object_cluster(c, 6, &cluster), IVIS_ERROR_ARGUMENT);
  EXPECT_EQ(ivis_object_cluster(c, 0, nullptr), IVIS_ERROR_ARGUMENT);
  ivis_client_close(c);
}

TEST(LocalClusters, ATableWithAGapOrOutOfOrderIsRefused) {
  const auto sound = [](std::vector<std::uint32_t> node, std::vector<std::uint32_t> cluster) {
    client::Catalogue c;
    c.instance.resize(node.size());
    c.node = std::move(node);
    c.cluster = std::move(cluster);
    return check_catalogue(c).has_value();
  };
  EXPECT_TRUE(sound({}, {}));
  EXPECT_TRUE(sound({1, 2}, {}));
  EXPECT_TRUE(sound({1, 1, 2}, {0, 1, 0}));
  EXPECT_FALSE(sound({1, 1, 2}, {}));
  EXPECT_FALSE(sound({1, 1, 2}, {0, 2, 0}));
  EXPECT_FALSE(sound({1, 1, 2}, {1, 2, 0}));
  EXPECT_FALSE(sound({1, 1, 2}, {0, 1, 1}));
  EXPECT_FALSE(sound({1, 1, 2}, {0, 0, 0}));
  EXPECT_FALSE(sound({2, 1}, {0, 1}));
  EXPECT_FALSE(sound({2, 1}, {0, 0}));
  EXPECT_FALSE(sound({1, 1}, {0, 1, 2}));
}

}  // namespace
}  // namespace ivis::test
