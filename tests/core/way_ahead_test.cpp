#include "core/way_ahead.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace ivis {
namespace {

TEST(WayAhead, ItsHullHoldsTheSectorAndHardlyMore) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto unit = [&] { return glm::normalize(Vec3{any(rng), any(rng), any(rng)}); };
  for (const double angle : {0.01, 0.2, 0.6, 1.0}) {
    for (int k = 0; k < 20; ++k) {
      const WayAhead way{unit(), angle, 2, 1};
      const auto hull = way.hull();
      double slack = 0;
      for (int i = 0; i < 200; ++i) {
        const Vec3 d = unit();
        double held = -1e9;
        for (const Vec3& p : hull)
          held = std::max(held, glm::dot(p, d));
        // The sector's own: its tip's cap, or its rim, or the apex.
        const double along = std::acos(std::clamp(glm::dot(d, way.direction), -1.0, 1.0));
        const double own =
            std::max(0.0, way.length * (along <= angle ? 1 : std::cos(along - angle)));
        EXPECT_GE(held, own - 1e-12) << angle;
        slack = std::max(slack, held - own);
      }
      EXPECT_LT(slack, 0.2 * way.length) << angle;
    }
  }
}

TEST(WayAhead, ItsMiddleIsTheCentreOfABallThatHoldsIt) {
  for (const double angle : {0.01, 0.3, 0.78, 0.79, 1.0}) {
    const WayAhead way{{1, 0, 0}, angle, 2, 1};
    const double c = way.middle();
    const double rim = std::hypot(2 * std::cos(angle) - c, 2 * std::sin(angle));
    EXPECT_LE(c, rim + 1e-12) << "apex";
    EXPECT_LE(2 - c, rim + 1e-12) << "tip";
    EXPECT_LT(rim, 2);
  }
}

TEST(WayAhead, IsAsLongAsTheSpeedsAllowWithinItsAngle) {
  const Pace pace{30, 10, 0.01, 1};
  EXPECT_NEAR(way_ahead(pace, {3, 0, 4}, 0.1)->length, 3 / std::cos(0.11), 1e-9);
  EXPECT_NEAR(way_ahead(pace, {0, 2, 0}, 0.1)->length, 1 / std::cos(0.11), 1e-9);
  EXPECT_NEAR(way_ahead(pace, {3, 1, 0}, 0.1)->length, std::hypot(3, 1), 1e-9);
  EXPECT_NEAR(way_ahead(pace, {3, 1, 0}, 0.1)->angle, 0.11, 1e-12);
  EXPECT_EQ(way_ahead(pace, {3, 1, 0}, 0.1)->height, 1);
}

TEST(WayAhead, ThereIsNoneWithoutADirectionATimeOrATurningThatIsSlow) {
  const Pace pace{30, 10, 0.01, 1};
  EXPECT_TRUE(way_ahead(pace, {1, 0, 0}, 0.9));
  EXPECT_FALSE(way_ahead(pace, {1, 0, 0}, 1.0)) << "turns by more than an angle of 1";
  EXPECT_FALSE(way_ahead(pace, {0, 0, 0}, 0.1));
  EXPECT_FALSE(way_ahead(pace, {NAN, 0, 0}, 0.1));
  EXPECT_FALSE(way_ahead(pace, {1e200, 1e200, 0}, 0.1)) << "too far to have a length";
  EXPECT_FALSE(way_ahead(pace, {1, 0, 0}, 0));
  EXPECT_FALSE(way_ahead({30, 10, 0.01, 0}, {1, 0, 0}, 0.1));
  EXPECT_FALSE(way_ahead({0, 0, 0.01, 1}, {1, 0, 0}, 0.1));
  EXPECT_FALSE(way_ahead({30, 0, 0.01, 1}, {0, 1, 0}, 0.1)) << "upwards, where it does not go";
}

}  // namespace
}  // namespace ivis
