#include "occluders/shrink.h"

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using test::SceneBuilder;

TEST(Shrink, BoxLosesTheReachAtItsSidesAndTheSlackAtItsTop) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {10, 8, 20});
  const Scene scene = std::move(b).finish();
  const auto shrunk = shrink(scene, {Reach::disc(1), {}}, FastEroder{});
  ASSERT_TRUE(shrunk);
  ASSERT_EQ(shrunk->set.shrunk.size(), 1U);
  const Prism& p = shrunk->set.shrunk[0];
  EXPECT_NEAR(area(p.footprint), (8 - 0.004) * (18 - 0.004), 1e-3);
  EXPECT_NEAR(p.top, 8 - shrunk->set.slack_m, 1e-12);
  EXPECT_NEAR(p.bottom, 2 * (0.01 + shrunk->set.slack_m), 1e-12);
  EXPECT_EQ(p.solid_bottom, 0);
  EXPECT_EQ(shrunk->set.floor, 0);
  EXPECT_NEAR(shrunk->report.solid_volume, 1600, 1e-9);
  EXPECT_NEAR(shrunk->report.kept_volume, 8 * 18 * 8, 2);
}

}  // namespace
}  // namespace ivis
