#include "server/ladder.h"

#include <random>

#include <gtest/gtest.h>

#include "core/view_cell.h"
#include "core/way_ahead.h"
#include "tests/server/fake_method.h"

namespace ivis::test {
namespace {

using server::Ladder;
using server::ladder_below;
using server::Outlook;
using server::parse_ladder;

constexpr double kSlackM = 0.001;

class LadderTest : public ::testing::Test {
 protected:
  Scene scene = grid_scene(2);
  NearMethod a{scene}, b{scene}, c{scene};
  Ladder ladder{
      {Reach::cylinder(0.5, 0.1), Reach::cylinder(1, 0.1), Reach::cylinder(2, 0.1)}, c, kSlackM};
};

TEST_F(LadderTest, TakesTheSmallestRungThatIsReadyAndHoldsWhatIsWanted) {
  const Reach small = Reach::cylinder(0.4, 0.05);
  EXPECT_EQ(ladder.choose(Outlook(small)).rung, 2U) << "only the largest is ready";
  EXPECT_EQ(ladder.choose(Outlook(small)).method, &c);
  ladder.add(1, b);
  EXPECT_EQ(ladder.choose(Outlook(small)).rung, 1U);
  ladder.add(0, a);
  EXPECT_EQ(ladder.ready(), 3U);
  EXPECT_EQ(ladder.choose(Outlook(small)).rung, 0U);
  EXPECT_EQ(ladder.choose(Outlook(small)).method, &a);
  EXPECT_EQ(ladder.choose(Outlook(Reach::cylinder(0.5, 0.1))).rung, 0U);
  EXPECT_EQ(ladder.choose(Outlook(Reach::cylinder(0.51, 0.1))).rung, 1U);
  EXPECT_EQ(ladder.choose(Outlook(Reach::cylinder(0.1, 0.2))).method, &c) << "none is so high";
  for (const double r : {0.0, 0.3, 0.7, 1.3, 2.0}) {
    const auto choice = ladder.choose(Outlook(Reach::cylinder(r, 0.1)));
    EXPECT_EQ(choice.safe, 1);
    EXPECT_TRUE(serves(ladder.reaches()[choice.rung], kSlackM, Reach::cylinder(r, 0.1))) << r;
  }
}

TEST_F(LadderTest, SaysWhatPartOfTheSpeedIsSafeWhenNoRungHolds) {
  for (const Reach& wanted : {Reach::cylinder(3, 0.01), Reach::cylinder(1, 0.4),
                              Reach::cylinder(8, 0.1), Reach::cylinder(1e9, 1e9)}) {
    const auto choice = ladder.choose(Outlook(wanted));
    EXPECT_EQ(choice.rung, 2U);
    const Vec3 e = wanted.half_extents();
    const auto part = [&](double f) { return Reach::cylinder(e.x * f, e.y * f); };
    EXPECT_LT(choice.safe, 1);
    EXPECT_TRUE(serves(ladder.largest(), kSlackM, part(choice.safe))) << wanted.to_string();
    EXPECT_FALSE(serves(ladder.largest(), kSlackM, part(choice.safe + 1e-6))) << wanted.to_string();
  }
}

TEST_F(LadderTest, TurnsSpeedAndTimeIntoAReach) {
  ladder.add(0, a);
  ladder.add(1, b);
  EXPECT_EQ(ladder.choose(Outlook(Pace{}, 16667)).rung, 2U) << "not told";
  EXPECT_EQ(ladder.choose(Outlook(Pace{30, 0, 0}, 0)).rung, 2U) << "not measured";
  EXPECT_EQ(ladder.choose(Outlook(Pace{30, 0, 0}, 16666)).rung, 0U) << "0.5 m";
  EXPECT_EQ(ladder.choose(Outlook(Pace{30, 0, 0}, 33333)).rung, 1U);
  EXPECT_NEAR(ladder.choose(Outlook(Pace{0, 4, 0}, 33333)).safe,
              ladder.choose(Outlook(Pace{0, 8, 0}, 33333)).safe * 2, 1e-6);
  EXPECT_NEAR(ladder.choose(Outlook(Pace{30, 0, 0}, 200'000)).safe, 2.0 / 6, 0.001);
}

/// Where an observer is after `hold_s`, who goes at random speeds and turns at random, as fast as
/// told.
Vec3 travelled(std::mt19937& rng, const Pace& pace, Vec3 direction, double hold_s) {
  std::uniform_real_distribution<double> any(-1, 1);
  constexpr int kSteps = 50;
  const double dt = hold_s / kSteps;
  Vec3 at{0};
  Vec3 axis{0};
  double share = 1;
  for (int i = 0; i < kSteps; ++i) {
    if (i % 10 == 0) {  // turns one way for a while, and is fast or slow
      axis = {any(rng), any(rng), any(rng)};
      share = any(rng) < 0 ? 1 : (any(rng) + 1) / 2;
    }
    const Vec3 across = glm::normalize(glm::cross(axis, direction));
    const double turn = pace.turning_rad_s * dt;
    direction = glm::normalize(direction * std::cos(turn) + across * std::sin(turn));
    const double flat = std::hypot(direction.x, direction.z);
    const double fastest =
        std::min(flat > 0 ? pace.horizontal_m_s / flat : 1e9,
                 std::abs(direction.y) > 0 ? pace.vertical_m_s / std::abs(direction.y) : 1e9);
    at += direction * (fastest * share * dt);
  }
  return at;
}

// The rungs taken hold whatever the turning told allows, as a client would look at it.
TEST(LadderAhead, HoldsWhereverAnObserverThatTurnsAsToldMayGetTo) {
  const Scene scene = grid_scene(2);
  const NearMethod method(scene);
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> any(-1, 1);
  for (const char* kind : {"cylinder", "box", "ball", "ellipsoid"}) {
    std::vector<Reach> rungs;
    for (int i = 1; i <= 30; ++i) {
      const double r = 0.1 * i;
      rungs.push_back(std::string(kind) == "cylinder" ? Reach::cylinder(r, r / 3)
                      : std::string(kind) == "box"    ? Reach::box({r, r / 2, r * 1.2})
                      : std::string(kind) == "ball"   ? Reach::ball(r)
                                                      : Reach::ellipsoid({r, r / 2, r * 1.1}));
    }
    Ladder ladder(rungs, method, kSlackM);
    for (std::uint32_t i = 0; i + 1 < rungs.size(); ++i)
      ladder.add(i, method);
    int looked_at = 0;
    for (int i = 0; i < 300; ++i) {
      const Pace pace{30 + 10 * any(rng), 10 + 10 * any(rng), 1.0 / 60, 2 + 2 * any(rng)};
      const std::uint32_t hold_us = 50'000 + static_cast<std::uint32_t>(20'000 * any(rng));
      const Vec3 direction = glm::normalize(Vec3{any(rng), 0.3 * any(rng), any(rng)});
      const auto way = way_ahead(pace, direction, hold_us * 1e-6);
      if (!way) continue;
      const Vec3 observer = -direction * way->middle();
      const auto choice = ladder.choose(Outlook(pace, hold_us, observer));
      const ViewCell cell{Vec3{0}, rungs[choice.rung]};
      if (choice.safe < 1) continue;
      ++looked_at;
      for (int k = 0; k < 100; ++k) {
        // The direction told may be a frame old.
        const Vec3 now = glm::normalize(
            direction + glm::normalize(glm::cross(direction, Vec3{any(rng), 1, any(rng)})) *
                            std::tan(pace.turning_rad_s * pace.frame_s));
        const Vec3 at = observer + travelled(rng, pace, now, hold_us * 1e-6);
        ASSERT_TRUE(cell.contains(at))
            << cell.reach.to_string() << " way " << glm::length(at - observer);
      }
      // It is worth it: of balls, no larger than about a sixth more than the smallest.
      if (std::string(kind) == "ball") {
        EXPECT_LE(rungs[choice.rung].half_extents().x,
                  1.17 * std::max(way->middle(), way->length * std::sin(way->angle)) + 0.1);
      }
      EXPECT_LE(choice.rung, ladder.choose(Outlook(pace, hold_us)).rung);
    }
    EXPECT_GT(looked_at, 100) << kind;
  }
}

TEST(LadderAhead, IsHalfTheWayForWhoGoesStraightOn) {
  const Scene scene = grid_scene(2);
  const NearMethod method(scene);
  std::vector<Reach> rungs;
  for (int i = 1; i <= 30; ++i)
    rungs.push_back(Reach::cylinder(0.1 * i, 0.05));
  Ladder ladder(rungs, method, kSlackM);
  for (std::uint32_t i = 0; i + 1 < rungs.size(); ++i)
    ladder.add(i, method);
  const auto extent = [&](const Outlook& o) {
    return ladder.reaches()[ladder.choose(o).rung].half_extents().x;
  };
  // A walker's bounds are cut to its vertical speed: 3 m in 0.1 s, 0.02 m up.
  const Pace pace{30, 0.2, 1.0 / 60, 0.5};
  const auto way = way_ahead(pace, {0, 0.01, 5}, 0.1);
  ASSERT_TRUE(way);
  EXPECT_NEAR(way->length, 3, 1e-3);
  EXPECT_NEAR(way->angle, 0.5 * (0.1 + 1.0 / 60), 1e-9);
  const Vec3 observer = way->direction * -way->middle();
  EXPECT_EQ(extent(Outlook(pace, 100'000)), 3);
  EXPECT_NEAR(extent(Outlook(pace, 100'000, observer)), 1.55, 0.06);
  // Standing where the cell is, or without turning told: all around.
  Pace at_once = pace;
  at_once.turning_rad_s = 0;
  EXPECT_EQ(extent(Outlook(at_once, 100'000, observer)), 3);
  EXPECT_EQ(extent(Outlook(pace, 100'000, Vec3{0})), 3);
  Pace sharp = pace;
  sharp.turning_rad_s = 20;
  EXPECT_EQ(extent(Outlook(sharp, 100'000, observer)), 3);
  // What no rung holds says what part of the speeds is safe, in the sector too.
  const Pace fast{90, 0.2, 1.0 / 60, 0.1};
  const auto far = way_ahead(fast, {1, 0, 0}, 0.1);
  const auto choice = ladder.choose(Outlook(fast, 100'000, Vec3{-3, 0, 0}));
  ASSERT_TRUE(far);
  EXPECT_NEAR(choice.safe, 6.0 / 9, 0.02) << "6 m of 9: to the other side of the cell";
}

TEST(LadderBelow, ShrinksHorizontallyAndEndsInTheReach) {
  const auto reaches = ladder_below(Reach::cylinder(1.6, 0.1), 3);
  ASSERT_EQ(reaches.size(), 3U);
  EXPECT_EQ(reaches[2], Reach::cylinder(1.6, 0.1));
  EXPECT_EQ(reaches[1], Reach::cylinder(1, 0.1));
  EXPECT_EQ(reaches[0], Reach::cylinder(0.625, 0.1));
  for (const Reach& r :
       {Reach::ball(0.3), Reach::disc(1), Reach::box({1, 2, 3}), Reach::ellipsoid({1, 0.1, 1})}) {
    const auto below = ladder_below(r, 4);
    EXPECT_EQ(below.back(), r);
    for (std::size_t i = 1; i < below.size(); ++i)
      EXPECT_TRUE(serves(below[i], kSlackM, below[i - 1])) << below[i].to_string();
  }
  EXPECT_EQ(ladder_below(Reach::ball(0), 4).size(), 1U);
}

TEST(ParseLadder, SaysWhatIsWrong) {
  const Reach largest = Reach::cylinder(1.5, 0.1);
  const auto parsed = [&](const char* text) { return parse_ladder(text, largest, kSlackM); };
  EXPECT_EQ(parsed("none")->size(), 1U);
  EXPECT_EQ(parsed("auto")->size(), 4U);
  const auto two = parsed(" disc:0.5  cylinder:1,0.1 ");
  ASSERT_TRUE(two);
  ASSERT_EQ(two->size(), 3U);
  EXPECT_EQ(two->back(), largest);
  EXPECT_EQ(parsed("cylinder:1.5,0.1")->size(), 1U);
  EXPECT_NE(parsed("").error().message.find("no reaches"), std::string::npos);
  EXPECT_NE(parsed("disk:1").error().message.find("disk:1"), std::string::npos);
  EXPECT_NE(parsed("disc:1 disc:0.5").error().message.find("ascending"), std::string::npos);
  EXPECT_NE(parsed("disc:2").error().message.find("larger than the reach"), std::string::npos);
  std::string many;
  for (int i = 1; i <= 40; ++i)
    many += "disc:" + std::to_string(0.01 * i) + " ";
  EXPECT_NE(parsed(many.c_str()).error().message.find("at most 32"), std::string::npos);
}

}  // namespace
}  // namespace ivis::test
