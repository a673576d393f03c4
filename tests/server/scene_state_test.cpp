// The scene as edits leave it, and answers for it, held against rays in the edited scene.

#include "server/scene_state.h"

#include <algorithm>
#include <chrono>
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "scenes/edited.h"
#include "tests/support/scene_builder.h"
#include "tests/visibility/contract_scenes.h"
#include "visibility/method.h"
#include "visibility/verify.h"
#include "wire/messages.h"

namespace ivis::test {
namespace {

using namespace std::chrono_literals;
using server::SceneState;

class EditedScene {
 public:
  explicit EditedScene(Scene s, const Reach& r = Reach::disc(1))
      : scene(std::move(s)), reach(r), set(shrunk()), index(set), state(scene) {
    auto made = make_method("cull-map", scene, set, {});
    EXPECT_TRUE(made);
    method = std::move(*made);
    for (ObjectId id = 0; id < scene.objects.size(); ++id)
      if (is_matter(scene, scene.objects[id]) && !holds_ground(scene, scene.objects[id])) {
        const Aabb& box = scene.objects[id].bounds;
        if (box.size().y > 3) buildings.push_back(id);
      }
  }

  std::uint32_t edit(EditKind kind, ObjectId id, const Placement& p = {}, float speed = 0) {
    const Edit e{kind, id, p, speed};
    const auto outcome = state.apply({&e, 1}, now);
    EXPECT_NE(outcome.epoch, 0U) << outcome.why;
    return outcome.epoch;
  }
  void move_by(ObjectId id, const Vec3& by, double turn = 0, float speed = 0) {
    edit(
        EditKind::kMove, id,
        {Vec3(scene.objects[id].to_world[3]) + by, glm::fquat(glm::angleAxis(turn, Vec3{0, 1, 0}))},
        speed);
  }
  void wait_until_mended() {
    static_cast<void>(amendment());
    for (int i = 0; i < 20'000; ++i) {
      static_cast<void>(amendment());
      if (!state.mending()) return;
      std::this_thread::sleep_for(1ms);
    }
    ADD_FAILURE() << "not mended within 20 s";
  }
  std::shared_ptr<const Amendment> amendment(SceneState::Time::duration valid = 0ms) {
    return state.amendment(index, now, now + valid);
  }
  Pvs solve(const Vec3& eye, const Amendment* a) const {
    Work work;
    auto pvs = a != nullptr ? method->solve({eye, reach}, {}, *a, work)
                            : method->solve({eye, reach}, {}, work);
    EXPECT_TRUE(pvs);
    return pvs ? std::move(*pvs) : Pvs{};
  }
  std::map<ObjectId, ObjectState> states() const {
    std::map<ObjectId, ObjectState> out;
    for (const ObjectState& s : state.since(0).objects)
      out[s.id] = s;
    return out;
  }
  std::size_t misses(const Pvs& pvs, const std::map<ObjectId, ObjectState>& as) const {
    const Scene seen = edited(scene, as);
    // Matter that is not there must not make viewpoints in it count as inside.
    OccluderSet none;
    none.scene_hash = set.scene_hash;
    const Verifier verifier(seen, &none, BlockerChoice::kOccluding);
    VerifyOptions options;
    options.rays_per_culled_object = 32;
    const auto report = verifier.check(pvs, options);
    EXPECT_TRUE(report);
    return report ? report->false_negatives : 1;
  }
  std::size_t misses(const Vec3& eye) {
    const auto a = amendment();
    return misses(solve(eye, a.get()), states());
  }

  OccluderSet shrunk() const {
    ShrinkOptions options;
    options.reach = reach;
    options.margins = false;
    auto result = shrink(scene, options, FastEroder{});
    EXPECT_TRUE(result);
    return result ? std::move(result->set) : OccluderSet{};
  }

  Scene scene;
  Reach reach;
  OccluderSet set;
  OccluderIndex index;
  SceneState state;
  std::unique_ptr<Method> method;
  std::vector<ObjectId> buildings;
  SceneState::Time now{1h};
};

std::size_t size_of(const Pvs& pvs) {
  return pvs.objects.size();
}

TEST(SceneStateTest, WithoutEditsThereIsNothingToAmend) {
  EditedScene e(random_town(3, false));
  EXPECT_EQ(e.amendment(), nullptr);
  EXPECT_EQ(e.state.epoch(), 0U);
  EXPECT_TRUE(e.state.since(0).objects.empty());
}

TEST(SceneStateTest, AnObjectPutBackWhereItWasChangesNothing) {
  EditedScene e(random_town(3, false));
  const Vec3 eye{0, 1.7, 0};
  const ObjectId id = e.buildings[5];
  e.move_by(id, {7, 0, 0});
  const auto moved = e.amendment();
  e.edit(EditKind::kRemove, e.buildings[6]);
  e.move_by(id, {0, 0, 0});
  e.edit(EditKind::kAdd, e.buildings[6]);
  const auto back = e.amendment();
  EXPECT_EQ(e.solve(eye, back.get()).objects, e.solve(eye, nullptr).objects);
  EXPECT_FALSE(back->occluders) << "no mask is left";
  ASSERT_TRUE(moved->occluders);
  const auto states = e.state.since(0).objects;
  ASSERT_EQ(states.size(), 2U);
  EXPECT_TRUE(states[0].as_in_the_file() && states[1].as_in_the_file());
}

TEST(SceneStateTest, NoEditsLeaveOutWhatRaysSee) {
  for (const unsigned seed : {11U, 12U}) {
    EditedScene e(random_town(seed, seed == 12), Reach::cylinder(0.8, 0.2));
    const std::vector<Vec3> eyes{{0, 1.7, 0}, {12, 6, -9}, {-20, 1.7, 31}};
    std::mt19937 random(seed);
    const auto any_building = [&] { return e.buildings[random() % e.buildings.size()]; };
    for (int round = 0; round < 6; ++round) {
      for (int k = 0; k < 6; ++k) {
        const ObjectId id = any_building();
        switch (random() % 6) {
          case 0:
            e.edit(EditKind::kRemove, id);
            break;
          case 1:
            e.edit(EditKind::kOccluderOff, id);
            break;
          case 2:
            e.edit(random() % 2 == 0 ? EditKind::kAdd : EditKind::kOccluderOn, id);
            break;
          default:
            e.move_by(id,
                      {static_cast<double>(random() % 41) - 20, static_cast<double>(random() % 3),
                       static_cast<double>(random() % 41) - 20},
                      static_cast<double>(random() % 100) / 50);
        }
      }
      for (const Vec3& eye : eyes)
        EXPECT_EQ(e.misses(eye), 0U) << "seed " << seed << " round " << round << " before mending";
      e.wait_until_mended();
      for (const Vec3& eye : eyes)
        EXPECT_EQ(e.misses(eye), 0U) << "seed " << seed << " round " << round << " after mending";
    }
  }
}

TEST(SceneStateTest, ACityOnGroundStaysCompleteToo) {
  ContractScene city = small_city();
  EditedScene e(city.scene, Reach::cylinder(0.6, 0.1));
  ASSERT_FALSE(e.set.ground.empty());
  std::mt19937 random(5);
  for (int round = 0; round < 3; ++round) {
    for (int k = 0; k < 3; ++k)
      e.edit(EditKind::kRemove, e.buildings[random() % e.buildings.size()]);
    e.move_by(e.buildings[random() % e.buildings.size()], {9, 0, -6}, 0.3);
    e.wait_until_mended();
    for (const Vec3& eye : city.eyes)
      EXPECT_EQ(e.misses(eye), 0U);
  }
}

// The same checks see a missing mask: they have power.
TEST(SceneStateTest, WithoutItsMaskARemovedBuildingHidesWhatRaysSee) {
  EditedScene e(random_town(11, false));
  const Vec3 eye{0, 1.7, 0};
  std::size_t found = 0;
  std::ranges::sort(e.buildings, {}, [&](ObjectId id) {
    return glm::distance(e.scene.objects[id].bounds.centre(), eye);
  });
  for (std::size_t k = 2; k < 8; ++k) {
    e.edit(EditKind::kRemove, e.buildings[k]);
    Amendment unmasked = *e.amendment();
    unmasked.occluders.reset();
    found += e.misses(e.solve(eye, &unmasked), e.states());
    EXPECT_EQ(e.misses(eye), 0U);
  }
  EXPECT_GT(found, 0U);
}

TEST(SceneStateTest, WithoutAMovedPlaceAnObjectIsMissing) {
  EditedScene e(random_town(11, false));
  const Vec3 eye{0, 1.7, 0};
  const auto hidden = [&](ObjectId id) {
    const Pvs pvs = e.solve(eye, nullptr);
    return !std::ranges::binary_search(pvs.objects, id);
  };
  std::vector<ObjectId> small;
  for (ObjectId id = 0; id < e.scene.objects.size(); ++id)
    if (e.scene.objects[id].bounds.size().y < 1 && hidden(id)) small.push_back(id);
  ASSERT_FALSE(small.empty());
  const auto far = small.begin();
  e.move_by(*far, eye + Vec3{5, 0, 0} - e.scene.objects[*far].bounds.centre());
  const Pvs pvs = e.solve(eye, e.amendment().get());
  EXPECT_TRUE(std::ranges::binary_search(pvs.objects, *far)) << "it stands before the observer";
  EXPECT_EQ(e.misses(pvs, e.states()), 0U);
  Amendment unplaced = *e.amendment();
  unplaced.placed.clear();
  EXPECT_GT(e.misses(e.solve(eye, &unplaced), e.states()), 0U);
}

TEST(SceneStateTest, MendingHidesAgainWhatTheRestOfABlockHides) {
  ContractScene city = small_city();
  EditedScene e(city.scene, Reach::cylinder(0.6, 0.1));
  std::size_t before = 0;
  std::size_t off = 0;
  std::size_t mended = 0;
  for (const Vec3& eye : city.eyes)
    before += size_of(e.solve(eye, nullptr));
  for (std::size_t k = 0; k < e.buildings.size(); k += 6)
    e.edit(EditKind::kOccluderOff, e.buildings[k]);
  Amendment unmended = *e.amendment();
  auto bare = std::make_shared<OccluderChange>(*unmended.occluders);
  bare->added.clear();
  unmended.occluders = bare;
  e.wait_until_mended();
  const auto a = e.amendment();
  ASSERT_FALSE(a->occluders->added.empty());
  for (const Vec3& eye : city.eyes) {
    off += size_of(e.solve(eye, &unmended));
    mended += size_of(e.solve(eye, a.get()));
  }
  EXPECT_LT(before, mended);
  EXPECT_LT(mended, off);
}

TEST(SceneStateTest, AMovedBuildingHidesWhereItIsNow) {
  EditedScene e(random_town(11, false));
  const Vec3 eye{0, 1.7, 0};
  // A wide one, put before the observer.
  const ObjectId id = *std::ranges::max_element(
      e.buildings, {}, [&](ObjectId b) { return e.scene.objects[b].bounds.size().x; });
  const Aabb box = e.scene.objects[id].bounds;
  const Vec3 to{0, 0, 6 + box.size().z / 2};
  e.move_by(id, {to.x - box.centre().x, 0, to.z - box.centre().z});
  const auto before = e.amendment();
  Amendment unmended = *before;
  auto bare = std::make_shared<OccluderChange>(*before->occluders);
  bare->added.clear();
  unmended.occluders = bare;
  e.wait_until_mended();
  EXPECT_LT(size_of(e.solve(eye, e.amendment().get())), size_of(e.solve(eye, &unmended)));
  EXPECT_EQ(e.misses(eye), 0U);
  // Edits elsewhere leave it in use, however often they come.
  const auto added = e.amendment()->occluders->added.size();
  const ObjectId other = e.buildings[0] != id ? e.buildings[0] : e.buildings[1];
  e.edit(EditKind::kOccluderOff, other);
  EXPECT_EQ(e.amendment()->occluders->added.size(), added);
  EXPECT_EQ(e.misses(eye), 0U);
  e.edit(EditKind::kOccluderOn, other);
  const Vec3 inside{to.x, 1.7, to.z};
  EXPECT_FALSE(e.solve(inside, e.amendment().get()).everything_because.empty())
      << "the eye is in the building";
}

TEST(SceneStateTest, AMoverIsListedWhereverItMayBe) {
  EditedScene e(random_town(11, false));
  std::mt19937 random(3);
  const auto part = [&] { return static_cast<double>(random() % 2001) / 1000 - 1; };
  std::vector<ObjectId> cars;
  for (ObjectId id = 0; id < e.scene.objects.size() && cars.size() < 30; id += 17)
    if (e.scene.objects[id].bounds.size().y < 3) cars.push_back(id);
  ASSERT_EQ(cars.size(), 30U);
  constexpr float kSpeed = 15;
  const auto valid = 200ms;
  for (int round = 0; round < 4; ++round) {
    for (const ObjectId id : cars)
      e.move_by(id, {4 * part(), 0, 4 * part()}, 0, kSpeed);
    EXPECT_TRUE(e.state.moves());
    e.now += 50ms;
    const auto a = e.amendment(valid);
    for (const Vec3& eye : {Vec3{0, 1.7, 0}, Vec3{-20, 1.7, 31}}) {
      const Pvs pvs = e.solve(eye, a.get());
      for (int k = 0; k < 3; ++k) {
        // Where they may be drawn at the very end.
        auto then = e.states();
        for (auto& [id, s] : then) {
          const double away = kSpeed * (0.05 + 0.2 + SceneState::kMoverLagS) * 0.999;
          const double turn = 3.2 * part();
          s.placement.position += Vec3{away * std::cos(turn), 0, away * std::sin(turn)};
        }
        EXPECT_EQ(e.misses(pvs, then), 0U);
      }
    }
  }
  for (const ObjectId id : cars)
    e.move_by(id, {1, 0, 0});
  EXPECT_FALSE(e.state.moves());
}

TEST(SceneStateTest, AMoverThatIsNotSweptIsMissed) {
  EditedScene e(random_town(11, false));
  std::vector<ObjectId> cars;
  for (ObjectId id = 0; id < e.scene.objects.size() && cars.size() < 1500; ++id)
    if (e.scene.objects[id].bounds.size().y < 3) cars.push_back(id);
  for (const ObjectId id : cars)
    e.move_by(id, {0, 0, 0}, 0, 15);
  Amendment still = *e.amendment();
  for (auto& p : still.placed)
    p.bounds = e.scene.objects[p.object].bounds;
  auto then = e.states();
  for (auto& [id, s] : then) {
    s.placement.position += Vec3{4, 0, 4};
    s.moved = true;
  }
  const Vec3 eye{0, 1.7, 0};
  EXPECT_GT(e.misses(e.solve(eye, &still), then), 0U);
  EXPECT_EQ(e.misses(e.solve(eye, e.amendment(300ms).get()), then), 0U);
}

TEST(SceneStateTest, EditsAreDoneWhollyOrNotAtAll) {
  EditedScene e(random_town(3, false));
  const auto objects = static_cast<ObjectId>(e.scene.objects.size());
  const std::vector<Edit> edits{{EditKind::kRemove, 1, {}, 0}, {EditKind::kRemove, objects, {}, 0}};
  const auto outcome = e.state.apply(edits, e.now);
  EXPECT_EQ(outcome.epoch, 0U);
  EXPECT_EQ(outcome.why, "no object " + std::to_string(objects) + ", expected an id below " +
                             std::to_string(objects));
  EXPECT_EQ(e.state.epoch(), 0U);
  EXPECT_TRUE(e.state.since(0).objects.empty());
  const Edit occluder{EditKind::kOccluderOff, objects, {}, 0};
  EXPECT_EQ(e.state.apply({&occluder, 1}, e.now).why, "no occluder " + std::to_string(objects) +
                                                          ", expected an id below " +
                                                          std::to_string(objects));
}

TEST(SceneStateTest, GroundThatBuildingsStandOnStays) {
  ContractScene city = small_city();
  EditedScene e(city.scene, Reach::cylinder(0.6, 0.1));
  std::size_t refused = 0;
  for (ObjectId id = 0; id < e.scene.objects.size(); ++id) {
    const Edit edit{EditKind::kRemove, id, {}, 0};
    if (!e.scene.name_of(e.scene.objects[id]).starts_with("ground_")) continue;
    const auto outcome = e.state.apply({&edit, 1}, e.now);
    EXPECT_EQ(outcome.epoch, 0U);
    EXPECT_NE(outcome.why.find("is ground"), std::string::npos) << outcome.why;
    ++refused;
  }
  EXPECT_GT(refused, 0U);
  EXPECT_FALSE(e.buildings.empty());
}

TEST(SceneStateTest, TellsOfEachObjectOnceAndOnlyWhatIsNew) {
  EditedScene e(random_town(3, false));
  for (int i = 0; i < 2000; ++i)
    e.move_by(static_cast<ObjectId>(i % 10), {0.01 * i, 0, 0});
  EXPECT_EQ(e.state.epoch(), 2000U);
  EXPECT_EQ(e.state.since(0).objects.size(), 10U);
  EXPECT_EQ(e.state.since(1997).objects.size(), 3U);
  EXPECT_EQ(e.state.since(2000).objects.size(), 0U);
  EXPECT_EQ(e.state.since(3000).objects.size(), 10U) << "an epoch that never was: all of it";
  const auto newest = e.state.since(1999).objects;
  ASSERT_EQ(newest.size(), 1U);
  EXPECT_EQ(newest[0].id, 9U);
  EXPECT_DOUBLE_EQ(newest[0].placement.position.x, 19.99);
}

TEST(SceneStateTest, ALateClientIsToldInStepsOfWholeEpochs) {
  SceneBuilder b;
  for (int i = 0; i < 6000; ++i)
    b.add_box({2.0 * i, 0, 0}, {2.0 * i + 1, 1, 1}, OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  SceneState state(scene);
  for (ObjectId first = 0; first < 6000; first += 1000) {
    std::vector<Edit> edits;
    for (ObjectId id = first; id < first + 1000; ++id)
      edits.push_back({EditKind::kRemove, id, {}, 0});
    ASSERT_NE(state.apply(edits, {}).epoch, 0U);
  }
  const auto part = state.since(0);
  EXPECT_EQ(part.epoch, 5U);
  EXPECT_EQ(part.objects.size(), 5000U);
  const auto rest = state.since(part.epoch);
  EXPECT_EQ(rest.since, 5U);
  EXPECT_EQ(rest.epoch, 6U);
  EXPECT_EQ(rest.objects.size(), 1000U);
}

TEST(SceneStateTest, OfAFileFarFromItsOriginAnUnmovedObjectIsToldWithoutAPlace) {
  SceneBuilder b;
  b.add_box({5.4e9, 0, 0}, {5.4e9 + 1, 1, 1});
  EditedScene e(std::move(b).finish());
  e.edit(EditKind::kRemove, 0);
  wire::PvsMessage m;
  m.everything = true;
  m.changes = {1, 0, 0, e.state.since(0).objects};
  ASSERT_EQ(m.changes.objects.size(), 1U);
  const auto decoded = wire::decode(wire::encode(m));
  ASSERT_TRUE(decoded) << decoded.error().message;
  EXPECT_TRUE(std::get<wire::PvsMessage>(*decoded).changes.objects[0].removed);
}

TEST(SceneStateTest, WhatStandsOnTheFloorIsHiddenWhereItIsPut) {
  // A flat town: everything stands on the floor.
  SceneBuilder b;
  b.add_box({-100, 0, -100}, {-99, 1, -99});
  b.add_box({99, 0, 99}, {100, 1, 100});
  b.add_box({10, 0, -20}, {14, 12, 20});
  const ObjectId thing = b.add_box({-30, 0, -1}, {-29, 1, 0}, OccluderTag::kNever);
  EditedScene e(std::move(b).finish());
  const Vec3 eye{0, 1.7, 0};
  e.move_by(thing, {60, 0, 0}, 1);
  EXPECT_FALSE(std::ranges::binary_search(e.solve(eye, e.amendment().get()).objects, thing));
  e.move_by(thing, {60, -0.5, 0}, 1);
  EXPECT_TRUE(std::ranges::binary_search(e.solve(eye, e.amendment().get()).objects, thing))
      << "below all there was";
  e.move_by(thing, {60, 0, 0}, 0, 5);
  EXPECT_FALSE(std::ranges::binary_search(e.solve(eye, e.amendment(100ms).get()).objects, thing));
  e.move_by(thing, {2000, 0, 0});
  EXPECT_TRUE(std::ranges::binary_search(e.solve(eye, e.amendment().get()).objects, thing))
      << "where single precision cannot tell";
}

TEST(SceneStateTest, AMoverThatStopsIsWhereItWasTold) {
  EditedScene e(random_town(11, false));
  e.move_by(5, {1, 0, 0}, 0, 30);
  e.now += 1s;
  const auto half = [&] { return e.amendment()->placed.at(0).bounds.size().x / 2; };
  const double moving = half();
  e.move_by(5, {2, 0, 0});
  EXPECT_NEAR(moving - half(), 33, 1e-9) << "30 m/s for 1.1 s";
  EXPECT_NE(half(), 0);
  e.move_by(5, {0, 0, 0});
  EXPECT_TRUE(e.amendment()->placed.empty()) << "it is back where the file has it";
}

TEST(SceneStateTest, ARungThatIsReadyLaterIsMendedToo) {
  ContractScene city = small_city();
  EditedScene e(city.scene, Reach::cylinder(0.6, 0.1));
  for (std::size_t k = 0; k < e.buildings.size(); k += 6)
    e.edit(EditKind::kOccluderOff, e.buildings[k]);
  e.wait_until_mended();
  const OccluderSet later_set = e.shrunk();
  const OccluderIndex later(later_set);
  const auto amended = [&] { return e.state.amendment(later, e.now, e.now); };
  EXPECT_FALSE(amended()->occluders->shrunk_off.empty()) << "masked at once";
  for (int i = 0; i < 20'000 && amended()->occluders->added.empty(); ++i)
    std::this_thread::sleep_for(1ms);
  EXPECT_FALSE(amended()->occluders->added.empty());
  EXPECT_EQ(amended()->occluders->added.size(), e.amendment()->occluders->added.size());
}

// A row of three houses, fused into one block, and things behind it.
TEST(SceneStateTest, WhatWasMendedIsLeftOutOnceMoreOfItIsMissing) {
  SceneBuilder b;
  std::vector<ObjectId> row;
  for (int k = 0; k < 3; ++k)
    row.push_back(b.add_box({20, 0, -30.0 + 20 * k}, {32, 12, -10.0 + 20 * k}));
  for (int k = 0; k < 30; ++k)
    b.add_box({40, 0, -29.0 + 2 * k}, {40.5, 1, -28.0 + 2 * k}, OccluderTag::kNever);
  EditedScene e(std::move(b).finish());
  const Vec3 eye{0, 1.7, 0};
  e.edit(EditKind::kOccluderOff, row[0]);
  e.wait_until_mended();
  const auto mended = e.amendment();
  ASSERT_FALSE(mended->occluders->added.empty()) << "the other two hide on";
  const auto rests_on = [&](const Prism& p, ObjectId house) {
    const Aabb& box = e.scene.objects[house].bounds;
    return e.index.box_of(p).overlaps({box.lo + 0.5, box.hi - 0.5});  // not on a neighbour's wall
  };
  EXPECT_TRUE(std::ranges::any_of(mended->occluders->added,
                                  [&](const Prism& p) { return rests_on(p, row[2]); }));
  e.edit(EditKind::kOccluderOff, row[2]);
  const auto after = e.amendment();
  EXPECT_TRUE(std::ranges::none_of(after->occluders->added,
                                   [&](const Prism& p) { return rests_on(p, row[2]); }));
  EXPECT_EQ(e.misses(e.solve(eye, after.get()), e.states()), 0U);
  e.wait_until_mended();
  EXPECT_FALSE(e.amendment()->occluders->added.empty()) << "the middle one hides on";
  EXPECT_EQ(e.misses(eye), 0U);
}

TEST(SceneStateTest, AnAnswerIsMadeOnceWhileNothingChanges) {
  EditedScene e(random_town(3, false));
  e.edit(EditKind::kOccluderOff, e.buildings[0]);
  e.wait_until_mended();
  const auto first = e.amendment();
  EXPECT_EQ(e.amendment(1s), first);
  e.edit(EditKind::kOccluderOn, e.buildings[0]);
  EXPECT_NE(e.amendment(), first);
  e.move_by(e.buildings[1], {1, 0, 0}, 0, 5);
  EXPECT_NE(e.amendment(1s), e.amendment(1s)) << "it moves on";
}

TEST(SceneStateTest, AThingOnAWallShowsOnceTheWallIsGone) {
  // A sign on a wall's far side, which its wall backs; a second wall far away keeps the cell busy.
  SceneBuilder b;
  const ObjectId wall = b.add_box({10, 0, -20}, {14, 12, 20});
  const ObjectId sign = b.add_box({14, 2, -1}, {14.05, 3, 1}, OccluderTag::kNever);
  EditedScene e(std::move(b).finish());
  const auto backing = std::ranges::count(e.set.backings, sign, &Backing::object);
  ASSERT_EQ(backing, 1);
  const Vec3 eye{0, 1.7, 0};
  EXPECT_FALSE(std::ranges::binary_search(e.solve(eye, nullptr).objects, sign));
  e.edit(EditKind::kOccluderOff, wall);
  EXPECT_TRUE(std::ranges::binary_search(e.solve(eye, e.amendment().get()).objects, sign));
  EXPECT_EQ(e.misses(eye), 0U);
}

}  // namespace
}  // namespace ivis::test
