// Edits for which memory runs out: all is done, or nothing, or the scene says that it is torn.

#include <algorithm>
#include <memory>
#include <new>
#include <vector>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "server/scene_state.h"
#include "tests/server/failing_new.h"
#include "tests/support/scene_builder.h"

namespace ivis::test {
namespace {

using server::SceneState;

TEST(SceneStateMemory, AnEditIsDoneOrNotOrTheSceneIsTorn) {
  SceneBuilder b;
  std::vector<ObjectId> houses;
  for (int k = 0; k < 4; ++k)
    houses.push_back(b.add_box({20, 0, 30.0 * k}, {32, 12, 30.0 * k + 12}));
  const Scene scene = std::move(b).finish();
  ShrinkOptions options;
  options.reach = Reach::disc(1);
  const auto shrunk = shrink(scene, options, FastEroder{});
  ASSERT_TRUE(shrunk);
  const OccluderIndex index(shrunk->set);
  const std::vector<Edit> edits{{EditKind::kOccluderOff, houses[0], {}, 0},
                                {EditKind::kRemove, houses[1], {}, 0},
                                {EditKind::kMove, houses[2], {{5, 0, 5}, {1, 0, 0, 0}}, 0}};
  int torn = 0;
  bool done = false;
  for (int most = 0; !done; ++most) {
    ASSERT_LT(most, 1000);
    SceneState state(scene);
    const Edit before{EditKind::kOccluderOff, houses[3], {}, 0};
    ASSERT_NE(state.apply({&before, 1}, {}).epoch, 0U);
    static_cast<void>(state.amendment(index, {}, {}));  // the rung's counts are there
    bool thrown = false;
    allocations_left = most;
    try {
      done = state.apply(edits, {}).epoch == 2;
    } catch (const std::bad_alloc&) {
      thrown = true;
    }
    allocations_left = -1;
    EXPECT_NE(thrown, done);
    if (!thrown) continue;
    if (state.torn()) {
      ++torn;
      EXPECT_EQ(state.apply(edits, {}).epoch, 0U);
      const auto told = state.since(0).objects;
      EXPECT_TRUE(std::ranges::any_of(told, [&](const ObjectState& s) {
        return s.id == houses[3] && s.occluder_off;
      })) << "what was edited before stays so";
    } else {
      EXPECT_EQ(state.epoch(), 1U) << "after " << most << " allocations";
    }
  }
  EXPECT_GT(torn, 3);
}

// A rung is known with all that is displaced, or asked for again.
TEST(SceneStateMemory, ARungIsMaskedWhollyOrNotYetThere) {
  SceneBuilder b;
  std::vector<ObjectId> houses;
  for (int k = 0; k < 4; ++k)
    houses.push_back(b.add_box({20, 0, 30.0 * k}, {32, 12, 30.0 * k + 12}));
  const Scene scene = std::move(b).finish();
  ShrinkOptions options;
  options.reach = Reach::disc(1);
  const auto shrunk = shrink(scene, options, FastEroder{});
  ASSERT_TRUE(shrunk);
  const OccluderIndex index(shrunk->set);
  int thrown = 0;
  bool done = false;
  for (int most = 0; !done; ++most) {
    ASSERT_LT(most, 1000);
    SceneState state(scene);
    for (const ObjectId id : houses) {
      const Edit off{EditKind::kOccluderOff, id, {}, 0};
      ASSERT_NE(state.apply({&off, 1}, {}).epoch, 0U);
    }
    std::shared_ptr<const Amendment> amendment;
    allocations_left = most;
    try {
      amendment = state.amendment(index, {}, {});
      done = true;
    } catch (const std::bad_alloc&) {
      ++thrown;
    }
    allocations_left = -1;
    if (!amendment) amendment = state.amendment(index, {}, {});
    ASSERT_TRUE(amendment->occluders);
    ASSERT_EQ(amendment->occluders->shrunk_off.size(), shrunk->set.shrunk.size()) << most;
    EXPECT_EQ(std::ranges::count(amendment->occluders->shrunk_off, 0), 0) << most;
  }
  EXPECT_GT(thrown, 5);
}

}  // namespace
}  // namespace ivis::test
