// Edits for which memory runs out: all is done, or nothing, or the scene says that it is torn.

#include <algorithm>
#include <memory>
#include <new>
#include <optional>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "server/ladder.h"
#include "server/scene_state.h"
#include "server/session.h"
#include "tests/server/failing_new.h"
#include "tests/support/scene_builder.h"
#include "visibility/method.h"
#include "wire/messages.h"

namespace ivis::test {
namespace {

using server::SceneState;

/// Four houses in a row, apart from each other, and what hides things of them.
class SceneStateMemory : public ::testing::Test {
 protected:
  SceneStateMemory() {
    SceneBuilder b;
    for (int k = 0; k < 4; ++k)
      houses.push_back(b.add_box({20, 0, 30.0 * k}, {32, 12, 30.0 * k + 12}));
    scene = std::move(b).finish();
    ShrinkOptions options;
    options.reach = Reach::disc(1);
    auto shrunk = shrink(scene, options, FastEroder{});
    EXPECT_TRUE(shrunk);
    if (shrunk) set = std::move(shrunk->set);
    index.emplace(set);
  }

  std::vector<ObjectId> houses;
  Scene scene;
  OccluderSet set;
  std::optional<OccluderIndex> index;
};

TEST_F(SceneStateMemory, AnEditIsDoneOrNotOrTheSceneIsTorn) {
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
    static_cast<void>(state.amendment(*index, {}, {}));  // the rung's counts are there
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
TEST_F(SceneStateMemory, ARungIsMaskedWhollyOrNotYetThere) {
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
      amendment = state.amendment(*index, {}, {});
      done = true;
    } catch (const std::bad_alloc&) {
      ++thrown;
    }
    allocations_left = -1;
    if (!amendment) amendment = state.amendment(*index, {}, {});
    ASSERT_TRUE(amendment->occluders);
    ASSERT_EQ(amendment->occluders->shrunk_off.size(), set.shrunk.size()) << most;
    EXPECT_EQ(std::ranges::count(amendment->occluders->shrunk_off, 0), 0) << most;
  }
  EXPECT_GT(thrown, 5);
}

// Past a session: whose edit tears the scene is told so, and everything is listed from then on.
TEST_F(SceneStateMemory, ATornSceneListsEverything) {
  const auto method = make_method("cull-map", scene, set, {});
  ASSERT_TRUE(method);
  const server::ServedScene served = server::served_scene(scene);
  const server::Ladder ladder(set.reach, **method, set.slack_m, &*index);
  bool torn = false;
  for (int most = 0; !torn; ++most) {
    ASSERT_LT(most, 1000);
    SceneState state(scene);
    server::SessionTable table(served, ladder, {}, {}, &state);
    const auto say = [&](const wire::Message& m) {
      return table.receive("a", std::visit([](const auto& x) { return wire::encode(x); }, m), {});
    };
    EXPECT_FALSE(say(wire::Hello{}));
    const auto welcomed = wire::decode(table.work({})->bytes);
    const std::uint64_t session = std::get<wire::Welcome>(*welcomed).session;
    std::uint32_t sequence = 0;
    const auto asked = [&] {
      EXPECT_FALSE(say(wire::PoseMessage{session, ++sequence, 0, {0, 1.7, 0}}));
      return std::get<wire::PvsMessage>(*wire::decode(table.work({})->bytes));
    };
    EXPECT_FALSE(asked().everything);
    const auto edit = wire::encode(wire::EditMessage{
        session, 1, {{EditKind::kMove, houses[0], {{1, 0, 0}, {1, 0, 0, 0}}, 0}}});
    std::optional<server::Outgoing> out;
    allocations_left = most;
    try {
      out = table.receive("a", edit, {});
    } catch (const std::bad_alloc&) {
    }
    allocations_left = -1;
    torn = table.scene_torn();
    EXPECT_EQ(asked().everything, torn);
    EXPECT_EQ(state.apply({}, {}).epoch == 0, torn);
  }
}

}  // namespace
}  // namespace ivis::test
