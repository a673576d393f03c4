#include "client_lib/lingering.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace ivis::client {
namespace {

TEST(Lingering, ObjectsAreDrawnForSoManyFramesAfterTheyLeft) {
  Lingering lingering(3);
  EXPECT_EQ(lingering.draw({0b0110}, true), IdBits{0b0110});
  EXPECT_EQ(lingering.draw({0b1100}, true), IdBits{0b1110});
  EXPECT_EQ(lingering.count(), 3U);
  EXPECT_EQ(lingering.draw({0b1100}, false), IdBits{0b1110});
  EXPECT_EQ(lingering.draw({0b1100}, false), IdBits{0b1110});
  EXPECT_EQ(lingering.draw({0b1100}, false), IdBits{0b1100});
  EXPECT_EQ(lingering.count(), 2U);
}

TEST(Lingering, DrawsWhatTheLastFramesDrewAndNeverLess) {
  constexpr std::uint32_t kFrames = 4;
  Lingering lingering(kFrames);
  std::mt19937_64 random(4);
  std::vector<IdBits> sets;
  IdBits now(3);
  for (int f = 0; f < 500; ++f) {
    const bool fresh = f == 0 || random() % 2 == 0;
    if (fresh)
      for (auto& w : now)
        w = random() & random();
    sets.push_back(now);
    IdBits expected(3);
    for (std::size_t back = 0; back <= kFrames && back < sets.size(); ++back)
      for (std::size_t w = 0; w < 3; ++w)
        expected[w] |= sets[sets.size() - 1 - back][w];
    ASSERT_EQ(lingering.draw(now, fresh), expected) << f;
  }
}

}  // namespace
}  // namespace ivis::client
