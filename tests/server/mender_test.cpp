// Blocks that edits put out of use, shrunk anew: what an order costs, and that parts are enough.

#include "server/mender.h"

#include <algorithm>
#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/mend.h"
#include "occluders/prisms.h"
#include "occluders/shrink.h"
#include "tests/support/scene_builder.h"

namespace ivis::test {
namespace {

using namespace std::chrono_literals;
using server::Mender;

/// Rows of three houses wall to wall, far from each other, and a post without a solid beside one.
class MenderTest : public ::testing::Test {
 protected:
  static constexpr int kRows = 4;
  MenderTest() {
    SceneBuilder b;
    for (int row = 0; row < kRows; ++row)
      for (int k = 0; k < 3; ++k)
        houses[row][k] =
            b.add_box({100.0 * row, 0, 20.0 * k}, {100.0 * row + 12, 10, 20.0 * k + 20});
    post = b.add_sheet({12.03, 0, 30}, {12.03, 5, 31});
    scene = std::move(b).finish();
    ShrinkOptions options;
    options.reach = Reach::disc(1);
    auto shrunk = shrink(scene, options, FastEroder{});
    EXPECT_TRUE(shrunk);
    set = std::move(shrunk->set);
    index.emplace(set);
  }
  Mender::Order order(std::vector<ObjectId> displaced, std::vector<Mender::Moved> moved = {}) {
    std::ranges::sort(displaced);
    Mender::Order out;
    for (const ObjectId id : displaced)
      out.displaced.emplace_back(id, &scene.objects[id]);
    out.moved = std::move(moved);
    out.rungs = {&*index};
    return out;
  }
  Mender::Moved moved(ObjectId id, double by) {
    return {id,
            &scene.objects[id],
            {Vec3(scene.objects[id].to_world[3]) + Vec3{0, 0, by}, {1, 0, 0, 0}}};
  }
  static Mender::Mended done(Mender& mender, Mender::Order order) {
    mender.order(std::move(order));
    for (int i = 0; i < 20'000; ++i) {
      if (auto mended = mender.take()) return std::move(*mended);
      std::this_thread::sleep_for(1ms);
    }
    ADD_FAILURE() << "not mended within 20 s";
    return {};
  }
  /// Of the prisms that stand in a row.
  double area_in(int row, const std::vector<Prism>& prisms) const {
    double sum = 0;
    for (const Prism& p : prisms)
      if (p.bounds().lo.x >= 100.0 * row - 1 && p.bounds().hi.x <= 100.0 * row + 13)
        sum += area(p.footprint);
    return sum;
  }

  Scene scene;
  OccluderSet set;
  std::optional<OccluderIndex> index;
  ObjectId houses[kRows][3] = {};
  ObjectId post = 0;
};

TEST_F(MenderTest, AnOrderShrinksAnewOnlyWhatItChanges) {
  Mender mender(scene);
  const ObjectId a = houses[0][0];
  const ObjectId b = houses[1][0];
  EXPECT_EQ(done(mender, order({a})).eroded, 1U);
  const auto two = done(mender, order({a, b}));
  EXPECT_EQ(two.eroded, 1U) << "the other row";
  EXPECT_EQ(done(mender, order({a, b, houses[1][2]})).eroded, 1U) << "one group with its neighbour";
  EXPECT_EQ(done(mender, order({a, b, houses[2][1]}, {moved(b, 200)})).eroded, 3U)
      << "the second row again, the third, and the house where it is now";
  EXPECT_EQ(done(mender, order({a, b, houses[2][1]}, {moved(b, 200)})).eroded, 0U);
  EXPECT_EQ(done(mender, order({a, b, houses[2][1]}, {moved(b, 201)})).eroded, 1U);
  EXPECT_EQ(done(mender, order({a})).eroded, 0U);
  EXPECT_EQ(done(mender, order({})).eroded, 0U);
}

// What mends a group leaves out no less than what mends all at once, and erodes no block twice.
TEST_F(MenderTest, GroupsHideWhatOneMendingOfAllWouldLeave) {
  ASSERT_TRUE(is_matter(scene, scene.objects[post]));
  ASSERT_TRUE(extract_prisms(scene, scene.objects[post]).prisms.empty());
  ASSERT_FALSE(index->touched(scene.objects[post].bounds).empty());
  Mender mender(scene);
  const std::vector<ObjectId> ids{houses[0][0], houses[0][2], houses[1][1],
                                  houses[3][0], houses[3][1], post};
  const auto groups = done(mender, order(ids));
  EXPECT_EQ(groups.eroded, 3U) << "the post goes with the row that it stands at";
  std::vector<Displaced> all;
  for (const ObjectId id : ids)
    all.push_back({scene.objects[id].bounds, extract_prisms(scene, scene.objects[id]).prisms});
  const auto whole = mend(*index, all, FastEroder{});
  const auto& blocks = groups.rungs.at(&*index).blocks;
  EXPECT_EQ(blocks.size(), whole.size());
  for (int row = 0; row < kRows; ++row)
    EXPECT_EQ(area_in(row, blocks), area_in(row, whole)) << row;
  for (const Prism& p : blocks)
    for (const ObjectId id : ids)
      EXPECT_FALSE(p.bounds().overlaps(scene.objects[id].bounds));
}

TEST_F(MenderTest, WhatWasKeptIsWhatWouldBeShrunkNow) {
  Mender used(scene);
  done(used, order({houses[0][0]}));
  done(used, order({houses[0][0], houses[1][1]}));
  const auto later =
      order({houses[0][0], houses[1][1], houses[1][2], houses[3][1]}, {moved(houses[3][1], 300)});
  const auto kept = done(used, later);
  Mender fresh(scene);
  const auto made = done(fresh, later);
  EXPECT_EQ(made.eroded, 4U);
  const auto& a = kept.rungs.at(&*index);
  const auto& b = made.rungs.at(&*index);
  ASSERT_EQ(a.objects.size(), 1U);
  EXPECT_FALSE(a.objects[0].prisms.empty());
  EXPECT_EQ(a.objects[0].prisms.size(), b.objects[0].prisms.size());
  EXPECT_EQ(a.blocks.size(), b.blocks.size());
  for (int row = 0; row < kRows; ++row)
    EXPECT_EQ(area_in(row, a.blocks), area_in(row, b.blocks)) << row;
  // Two houses of the first row, one of the second, two with a gap of the last; each less a metre.
  EXPECT_NEAR(area_in(0, a.blocks), 10 * 38, 2);
  EXPECT_NEAR(area_in(1, a.blocks), 10 * 18, 2);
  EXPECT_EQ(area_in(2, a.blocks), 0) << "nothing is missing there";
  EXPECT_NEAR(area_in(3, a.blocks), 2 * 10 * 18, 4);
}

}  // namespace
}  // namespace ivis::test
