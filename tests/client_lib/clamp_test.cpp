#include "client_lib/clamp.h"

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace ivis::client {
namespace {

const std::vector<std::string> kReaches{
    "ball:1.5", "disc:1", "cylinder:1.5,0.1", "ellipsoid:2,0.3,1", "box:1,2,3",
    "ball:0",   "disc:0", "ellipsoid:1,0,2",  "box:0,0,0",         "cylinder:0,2"};

class Clamp : public ::testing::TestWithParam<std::string> {};

TEST_P(Clamp, AlwaysEndsInTheCellAndLeavesWhatIsInItAlone) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const double far : {0.0, 1e4, 1e9}) {
    const ViewCell cell{{far, far / 3, -far}, *Reach::parse(GetParam())};
    for (int i = 0; i < 2000; ++i) {
      const double scale = std::pow(10.0, i % 8 - 3);
      const Vec3 p = cell.eye + scale * Vec3{unit(random), unit(random), unit(random)};
      const Vec3 held = clamp_to_cell(cell, p);
      EXPECT_TRUE(cell.contains(held));
      if (cell.contains(p)) {
        EXPECT_EQ(held, p);
      }
      // Never further from where the walker wants to be than the centre is.
      EXPECT_LE(glm::distance(held, p), glm::distance(cell.eye, p) * (1 + 1e-9) + 1e-6);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, Clamp, ::testing::ValuesIn(kReaches));

TEST(Clamp, KeepsAWalkerAtTheRimOfADisc) {
  const ViewCell cell{{10, 2, 10}, Reach::disc(1)};
  const Vec3 held = clamp_to_cell(cell, {13, 2, 14});
  EXPECT_NEAR(held.x, 10.6, 1e-12);
  EXPECT_NEAR(held.z, 10.8, 1e-12);
}

TEST(Clamp, LetsAWalkerSlideAlongABox) {
  const ViewCell cell{{0, 0, 0}, Reach::box({1, 1, 1})};
  EXPECT_EQ(clamp_to_cell(cell, {5, 0.5, -0.25}), (Vec3{1, 0.5, -0.25}));
}

}  // namespace
}  // namespace ivis::client
