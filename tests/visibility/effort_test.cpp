// Solves within a budget: never a miss, never more work than was given.

#include <algorithm>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/visibility/contract_scenes.h"
#include "visibility/cull_map.h"
#include "visibility/verify.h"

namespace ivis {
namespace {

class EffortTest : public ::testing::Test {
 protected:
  Scene scene = test::random_town(41, false);
  Reach reach = Reach::disc(1);
  OccluderSet set = [&] {
    ShrinkOptions options;
    options.reach = reach;
    auto result = shrink(scene, options, FastEroder{});
    EXPECT_TRUE(result);
    return result ? std::move(result->set) : OccluderSet{};
  }();
  CullMap map{scene, set, {}};
  Verifier verifier{scene, &set, BlockerChoice::kOccluding};
  std::vector<Vec3> eyes{{0, 1.7, 0}, {12, 6, -9}, {-20, 1.7, 31}};

  std::size_t misses(const Pvs& pvs) const {
    const auto report = verifier.check(pvs, {});
    EXPECT_TRUE(report);
    return report ? report->false_negatives : 1;
  }
};

TEST_F(EffortTest, NoBudgetAndNoStrategyEverMisses) {
  for (const Vec3& eye : eyes) {
    Work full;
    const auto all = map.solve({eye, reach}, Effort{}, full);
    ASSERT_TRUE(all);
    EXPECT_FALSE(full.cut);
    EXPECT_EQ(all->objects, map.solve({eye, reach})->objects);
    for (const Strategy strategy : {Strategy::kAbort, Strategy::kPredictive})
      for (const double part : {0.0, 0.02, 0.1, 0.3, 0.7, 2.0})
        for (const double test_part : {0.0, 0.1, 2.0}) {
          const auto units = [](double p, std::uint64_t of) {
            return static_cast<std::uint64_t>(p * static_cast<double>(of));
          };
          const Effort effort{strategy, units(part, full.draw), units(test_part, full.test),
                              full.draw};
          Work done;
          const auto pvs = map.solve({eye, reach}, effort, done);
          ASSERT_TRUE(pvs);
          EXPECT_EQ(misses(*pvs), 0U) << part << ' ' << test_part;
          EXPECT_LE(done.test, effort.test);
          if (test_part == 0) {
            EXPECT_EQ(pvs->objects.size(), scene.objects.size());
            EXPECT_TRUE(done.cut);
          }
          if (strategy == Strategy::kAbort && part == 2 && test_part == 2) {
            EXPECT_EQ(pvs->objects, all->objects) << "a budget that is not used up changes nothing";
            EXPECT_FALSE(done.cut);
          }
          Work again;
          EXPECT_EQ(map.solve({eye, reach}, effort, again)->objects, pvs->objects);
          EXPECT_EQ(again.draw, done.draw);
        }
  }
}

// Near first, so the work after each occluder is the same whatever the budget: a solve stops at the
// first of these that reaches it.
TEST_F(EffortTest, DrawingStopsAtTheFirstOccluderThatReachesTheBudget) {
  for (const Vec3& eye : eyes) {
    const auto drawn = [&](std::uint64_t budget) {
      Work done;
      EXPECT_TRUE(
          map.solve({eye, reach}, Effort{Strategy::kAbort, budget, Effort::kUnbounded, 0}, done));
      return done.draw;
    };
    Work full;
    ASSERT_TRUE(map.solve({eye, reach}, Effort{}, full));
    std::size_t stops = 0;
    std::uint64_t at = 0;
    while (at < full.draw) {
      const std::uint64_t next = drawn(at + 1);
      ASSERT_GT(next, at);
      EXPECT_EQ(drawn(next), next);
      if (next > at + 1) {
        EXPECT_EQ(drawn(at + 2), next);
      }
      at = next;
      ++stops;
    }
    EXPECT_EQ(at, full.draw);
    EXPECT_GT(stops, 10U);
    EXPECT_EQ(drawn(0), 0U);
  }
}

TEST_F(EffortTest, ChoosingIsCountedAndSaysWhatItLeftOut) {
  for (const Vec3& eye : eyes) {
    Work full;
    ASSERT_TRUE(map.solve({eye, reach}, Effort{}, full));
    Work done;
    ASSERT_TRUE(map.solve(
        {eye, reach}, Effort{Strategy::kPredictive, full.draw / 2, Effort::kUnbounded, full.draw},
        done));
    EXPECT_TRUE(done.cut);
    EXPECT_GT(done.draw, 0U);
    // All are chosen where a full drawing is paid for, or it is not known what that takes.
    for (const Effort& effort :
         {Effort{Strategy::kPredictive, 2 * full.draw, Effort::kUnbounded, full.draw},
          Effort{Strategy::kPredictive, 2 * full.draw, Effort::kUnbounded, 0}}) {
      const auto pvs = map.solve({eye, reach}, effort, done);
      ASSERT_TRUE(pvs);
      EXPECT_EQ(pvs->objects, map.solve({eye, reach})->objects);
      EXPECT_FALSE(done.cut);
    }
  }
}

TEST_F(EffortTest, MoreWorkListsFewerObjectsInTheMean) {
  for (const Strategy strategy : {Strategy::kAbort, Strategy::kPredictive}) {
    std::vector<std::size_t> listed;
    for (const std::uint64_t budget : {0U, 30U, 100U, 300U, 100'000U}) {
      std::size_t sum = 0;
      for (const Vec3& eye : eyes) {
        Work done;
        sum += map.solve({eye, reach}, Effort{strategy, budget, Effort::kUnbounded, 1000}, done)
                   ->objects.size();
      }
      listed.push_back(sum);
    }
    EXPECT_TRUE(std::is_sorted(listed.rbegin(), listed.rend()));
    EXPECT_LT(listed.back(), listed.front());
  }
}

TEST_F(EffortTest, GuaranteedIsBoundedByTheSceneAndIgnoresBudgets) {
  const Work most = map.most_work();
  for (const Vec3& eye : eyes) {
    Work done;
    const auto pvs = map.solve({eye, reach}, Effort{Strategy::kGuaranteed, 1, 1, 1}, done);
    ASSERT_TRUE(pvs);
    EXPECT_EQ(pvs->objects, map.solve({eye, reach})->objects);
    EXPECT_FALSE(done.cut);
    EXPECT_GT(done.draw, 1U);
    EXPECT_LE(done.draw, most.draw);
    EXPECT_LE(done.test, most.test);
  }
}

TEST_F(EffortTest, TheOrthographicMapSaysThatItKeepsToNone) {
  MethodOptions options;
  options.map = CullMapKind::kOrthographic;
  const CullMap orthographic(scene, set, options);
  EXPECT_FALSE(orthographic.keeps_to_effort());
  EXPECT_TRUE(map.keeps_to_effort());
  Work done;
  const auto pvs = orthographic.solve({eyes[0], reach}, Effort{Strategy::kAbort, 0, 0, 1}, done);
  ASSERT_TRUE(pvs);
  EXPECT_EQ(misses(*pvs), 0U);
}

}  // namespace
}  // namespace ivis
