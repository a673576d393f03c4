#include "core/frustum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include <glm/gtc/quaternion.hpp>

namespace ivis {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

class Draw {
 public:
  explicit Draw(unsigned seed) : rng_(seed) {}
  double of(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(rng_); }
  Vec3 direction() {
    while (true) {
      const Vec3 v{of(-1, 1), of(-1, 1), of(-1, 1)};
      if (glm::length(v) > 0.01 && glm::length(v) <= 1) return glm::normalize(v);
    }
  }
  Frustum frustum(double most_turn) {
    return {of(-180, 180), of(-90, 90), of(1, 150), of(1, 150), of(0, most_turn)};
  }

 private:
  std::mt19937 rng_;
};

Vec3 turned(const Vec3& v, const Vec3& axis, double radians) {
  return glm::angleAxis(radians, axis) * v;
}

/// A direction in the picture, without any turn.
Vec3 in_picture(const Frustum& f, Draw& draw) {
  const double y = f.yaw_deg * kDegree;
  const double p = f.pitch_deg * kDegree;
  const Vec3 forward{std::cos(p) * std::cos(y), std::sin(p), -std::cos(p) * std::sin(y)};
  const Vec3 right{std::sin(y), 0, std::cos(y)};
  return forward + right * (draw.of(-1, 1) * std::tan(f.fov_x_deg / 2 * kDegree)) +
         glm::cross(right, forward) * (draw.of(-1, 1) * std::tan(f.fov_y_deg / 2 * kDegree));
}

TEST(Frustum, YawAndPitchAreThoseOfAPose) {
  const auto looks = [](double yaw, double pitch, const Vec3& d) {
    return Frustum{yaw, pitch, 20, 20, 0}.can_look_along(d);
  };
  EXPECT_TRUE(looks(0, 0, {1, 0, 0}));
  EXPECT_TRUE(looks(90, 0, {0, 0, -1}));
  EXPECT_TRUE(looks(-90, 0, {0, 0, 1}));
  EXPECT_TRUE(looks(180, 0, {-1, 0, 0}));
  EXPECT_TRUE(looks(30, 90, {0, 1, 0}));
  EXPECT_FALSE(looks(0, 0, {-1, 0, 0}));
  EXPECT_FALSE(looks(90, 0, {1, 0, 0}));
}

TEST(Frustum, FieldsOfViewAreFullAngles) {
  const Frustum f{0, 0, 60, 40, 0};
  const auto at = [](double side, double up) {
    return Vec3{1, std::tan(up * kDegree), std::tan(side * kDegree)};
  };
  EXPECT_TRUE(f.can_look_along(at(29.9, 0)));
  EXPECT_FALSE(f.can_look_along(at(30.1, 0)));
  EXPECT_TRUE(f.can_look_along(at(0, 19.9)));
  EXPECT_FALSE(f.can_look_along(at(0, 20.1)));
  EXPECT_TRUE((Frustum{0, 0, 60, 40, 5}.can_look_along(at(34.9, 0))));
  EXPECT_FALSE((Frustum{0, 0, 60, 40, 5}.can_look_along(at(35.1, 0))));
}

TEST(Frustum, EveryTurnWithinTheLimitIsAllowed) {
  Draw draw(1);
  for (int i = 0; i < 20000; ++i) {
    const Frustum f = draw.frustum(179);
    const Vec3 d =
        turned(in_picture(f, draw), draw.direction(), draw.of(-1, 1) * (f.turn_deg * kDegree));
    // Less the doubt that can_look_along() takes out at the rim.
    Frustum a_little_more = f;
    a_little_more.turn_deg += 1e-5;
    ASSERT_TRUE(a_little_more.can_look_along(d)) << i;
  }
}

TEST(FrustumSweep, HoldsAllThatCanBeInThePictureFromTheCell) {
  Draw draw(2);
  std::size_t in_sight = 0;
  for (int i = 0; i < 3000; ++i) {
    const Frustum f = draw.frustum(60);
    const Reach reach = i % 3 == 0   ? Reach::ball(draw.of(0, 3))
                        : i % 3 == 1 ? Reach::cylinder(draw.of(0, 3), 0.1)
                                     : Reach::box({0.2, 0.1, draw.of(0, 3)});
    const ViewCell cell{{draw.of(-1e3, 1e3), draw.of(-10, 10), draw.of(-1e3, 1e3)}, reach};
    const FrustumSweep sweep(f, cell);
    const auto rim = reach.extreme_points(16);
    for (int k = 0; k < 50; ++k) {
      const Vec3 eye = cell.eye + rim[static_cast<std::size_t>(k) % rim.size()];
      // Near the rim of what can be seen, where a side that is too narrow would show.
      const Vec3 d = turned(in_picture(f, draw), draw.direction(), f.turn_deg * kDegree);
      if (!f.can_look_along(d)) continue;
      ++in_sight;
      Aabb point;
      point.add(eye + d * draw.of(0.01, 50));
      ASSERT_TRUE(sweep.may_meet(point)) << i << ' ' << k;
    }
  }
  EXPECT_GT(in_sight, 100000U);
}

TEST(FrustumSweep, WideningHalfAnglesByTheTurnAloneWouldNotDo) {
  // theory.md, section 5: at the corners it takes more.
  const Frustum f{0, 0, 90, 90, 10};
  const Vec3 corner{1, 1, 1};
  const double wide = std::tan(55 * kDegree);
  bool found = false;
  Draw draw(3);
  for (int i = 0; i < 20000 && !found; ++i) {
    const Vec3 d = turned(corner, draw.direction(), 10 * kDegree - 1e-6);
    if (!f.can_look_along(d) || d.x <= 0) continue;
    found = std::abs(d.z) > wide * d.x || std::abs(d.y) > wide * d.x;
    Aabb point;
    point.add(d);
    EXPECT_TRUE(FrustumSweep(f, ViewCell{}).may_meet(point));
  }
  EXPECT_TRUE(found);
}

TEST(FrustumSweep, KeepsOutWhatIsBehindAndBeside) {
  const FrustumSweep sweep({0, 0, 90, 60, 5}, {{0, 0, 0}, Reach::disc(1)});
  const auto box = [](const Vec3& at) {
    Aabb b;
    b.add(at - Vec3{1});
    b.add(at + Vec3{1});
    return b;
  };
  EXPECT_TRUE(sweep.may_meet(box({50, 0, 0})));
  EXPECT_TRUE(sweep.may_meet(box({50, 0, 50})));
  EXPECT_FALSE(sweep.may_meet(box({-50, 0, 0})));
  EXPECT_FALSE(sweep.may_meet(box({10, 0, 50})));
  EXPECT_FALSE(sweep.may_meet(box({10, 50, 0})));
  EXPECT_TRUE(sweep.may_meet(box({0, 0, 0}))) << "the observer's own place";
}

TEST(FrustumSweep, FreeTurningKeepsNothingOut) {
  Draw draw(4);
  for (const double turn : {90.0, 180.0}) {
    const FrustumSweep sweep({0, 0, 60, 60, turn}, ViewCell{});
    for (int i = 0; i < 100; ++i) {
      Aabb point;
      point.add(draw.direction() * 10.0);
      EXPECT_TRUE(sweep.may_meet(point));
    }
  }
}

TEST(Frustum, ParseNamesWhatIsWrong) {
  const auto good = Frustum::parse("90,-10,80,60.5,5");
  ASSERT_TRUE(good);
  EXPECT_EQ(good->yaw_deg, 90);
  EXPECT_EQ(good->pitch_deg, -10);
  EXPECT_EQ(good->fov_x_deg, 80);
  EXPECT_EQ(good->fov_y_deg, 60.5);
  EXPECT_EQ(good->turn_deg, 5);
  for (const char* text : {"", "1", "1,2,3,4", "1,2,3,4,5,6", "a,0,90,60,5", "0,0,90,60,",
                           "0,0,0,60,5", "0,0,90,180,5", "0,91,90,60,5", "0,0,90,60,-1",
                           "0,0,90,60,181", "nan,0,90,60,5", "inf,0,90,60,5", "1e9,0,90,60,5"}) {
    const auto f = Frustum::parse(text);
    ASSERT_FALSE(f) << text;
    EXPECT_EQ(f.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(f.error().message.find("'" + std::string(text) + "'"), std::string::npos)
        << f.error().message;
  }
}

TEST(Cover, OneEyeKeepsItsReach) {
  const Vec3 eye{3, 1.7, -4};
  const ViewCell cell = cover(std::vector<Vec3>{eye}, Reach::ball(0.3));
  EXPECT_EQ(cell.eye, eye);
  EXPECT_EQ(cell.reach, Reach::ball(0.3));
}

TEST(Cover, HoldsEveryMoveOfEveryEye) {
  Draw draw(5);
  for (int i = 0; i < 200; ++i) {
    std::vector<Vec3> eyes;
    for (int k = 0; k <= i % 3; ++k)
      eyes.emplace_back(draw.of(-1, 1), draw.of(-0.1, 0.1), draw.of(-1, 1));
    const Reach reach = i % 3 == 0   ? Reach::cylinder(0.5, 0.1)
                        : i % 3 == 1 ? Reach::disc(0.5)
                                     : Reach::ellipsoid({0.5, 0.2, 0.7});
    const ViewCell cell = cover(eyes, reach);
    for (const Vec3& eye : eyes)
      for (const Vec3& v : reach.extreme_points(24)) {
        ASSERT_TRUE(cell.contains(eye + v));
        // What one eye's own cell would accept beside its reach.
        ASSERT_TRUE(cell.contains(eye + v + Vec3{0, 0.9 * vertical_tolerance(reach), 0}));
      }
  }
}

}  // namespace
}  // namespace ivis
