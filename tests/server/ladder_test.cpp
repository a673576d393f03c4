#include "server/ladder.h"

#include <gtest/gtest.h>

#include "core/view_cell.h"
#include "tests/server/fake_method.h"

namespace ivis::test {
namespace {

using server::Ladder;
using server::ladder_below;
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
  EXPECT_EQ(ladder.choose(small).rung, 2U) << "only the largest is ready";
  EXPECT_EQ(ladder.choose(small).method, &c);
  ladder.add(1, b);
  EXPECT_EQ(ladder.choose(small).rung, 1U);
  ladder.add(0, a);
  EXPECT_EQ(ladder.ready(), 3U);
  EXPECT_EQ(ladder.choose(small).rung, 0U);
  EXPECT_EQ(ladder.choose(small).method, &a);
  EXPECT_EQ(ladder.choose(Reach::cylinder(0.5, 0.1)).rung, 0U);
  EXPECT_EQ(ladder.choose(Reach::cylinder(0.51, 0.1)).rung, 1U);
  EXPECT_EQ(ladder.choose(Reach::cylinder(0.1, 0.2)).method, &c) << "none is so high";
  for (const double r : {0.0, 0.3, 0.7, 1.3, 2.0}) {
    const auto choice = ladder.choose(Reach::cylinder(r, 0.1));
    EXPECT_EQ(choice.safe, 1);
    EXPECT_TRUE(serves(ladder.reaches()[choice.rung], kSlackM, Reach::cylinder(r, 0.1))) << r;
  }
}

TEST_F(LadderTest, SaysWhatPartOfTheSpeedIsSafeWhenNoRungHolds) {
  for (const Reach& wanted : {Reach::cylinder(3, 0.01), Reach::cylinder(1, 0.4),
                              Reach::cylinder(8, 0.1), Reach::cylinder(1e9, 1e9)}) {
    const auto choice = ladder.choose(wanted);
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
  EXPECT_EQ(ladder.choose(Pace{}, 16667).rung, 2U) << "not told";
  EXPECT_EQ(ladder.choose(Pace{30, 0, 0}, 0).rung, 2U) << "not measured";
  EXPECT_EQ(ladder.choose(Pace{30, 0, 0}, 16666).rung, 0U) << "0.5 m";
  EXPECT_EQ(ladder.choose(Pace{30, 0, 0}, 33333).rung, 1U);
  EXPECT_NEAR(ladder.choose(Pace{0, 4, 0}, 33333).safe,
              ladder.choose(Pace{0, 8, 0}, 33333).safe * 2, 1e-6);
  EXPECT_NEAR(ladder.choose(Pace{30, 0, 0}, 200'000).safe, 2.0 / 6, 0.001);
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
