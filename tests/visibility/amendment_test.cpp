// Methods asked for a scene that differs from the one they were made for.

#include "visibility/amendment.h"

#include <algorithm>
#include <limits>
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/visibility/contract_scenes.h"
#include "visibility/cull_map.h"
#include "visibility/method.h"

namespace ivis::test {
namespace {

const Reach kReach = Reach::cylinder(0.6, 0.1);

struct Prepared {
  explicit Prepared(Scene s) : scene(std::move(s)) {
    ShrinkOptions options;
    options.reach = kReach;
    auto result = shrink(scene, options, FastEroder{});
    EXPECT_TRUE(result);
    set = std::move(result->set);
  }
  std::unique_ptr<Method> method(std::string_view name = "cull-map",
                                 const MethodOptions& options = {}) const {
    auto made = make_method(name, scene, set, options);
    EXPECT_TRUE(made);
    return std::move(*made);
  }
  Scene scene;
  OccluderSet set;
};

Pvs amended(const Method& m, const Vec3& eye, const Amendment& a, const Effort& effort = {}) {
  Work work;
  auto pvs = m.solve({eye, kReach}, effort, a, work);
  EXPECT_TRUE(pvs) << (pvs ? "" : pvs.error().message);
  return pvs ? std::move(*pvs) : Pvs{};
}
Pvs plain(const Method& m, const Vec3& eye) {
  auto pvs = m.solve({eye, kReach});
  EXPECT_TRUE(pvs);
  return pvs ? std::move(*pvs) : Pvs{};
}
bool lists(const Pvs& pvs, ObjectId id) {
  return std::ranges::binary_search(pvs.objects, id);
}
/// Is all of `part` in `whole`?
bool holds(const Pvs& whole, const Pvs& part) {
  return std::ranges::includes(whole.objects, part.objects);
}
std::shared_ptr<const OccluderChange> off(std::vector<std::uint8_t> mask) {
  auto change = std::make_shared<OccluderChange>();
  change->shrunk_off = std::move(mask);
  return change;
}
std::shared_ptr<std::vector<std::uint64_t>> bits_for(const Scene& scene, std::uint64_t all) {
  return std::make_shared<std::vector<std::uint64_t>>((scene.objects.size() + 63) / 64, all);
}

class AmendmentTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { city_ = new Prepared(small_city().scene); }
  static void TearDownTestSuite() {
    delete city_;
    city_ = nullptr;
  }
  static const Prepared& city() { return *city_; }
  static std::vector<Vec3> eyes() { return small_city().eyes; }

 private:
  static Prepared* city_;
};
Prepared* AmendmentTest::city_ = nullptr;

TEST_F(AmendmentTest, ThatChangesNothingGivesThePlainSet) {
  const auto m = city().method();
  Amendment nothing;
  Amendment zeros;
  zeros.gone = bits_for(city().scene, 0);
  zeros.occluders = off(std::vector<std::uint8_t>(city().set.shrunk.size(), 0));
  for (const Vec3& eye : eyes()) {
    EXPECT_EQ(amended(*m, eye, nothing).objects, plain(*m, eye).objects);
    EXPECT_EQ(amended(*m, eye, zeros).objects, plain(*m, eye).objects);
  }
}

// Everything taken out of the tree and put back where it was, in no order: packed boxes are judged
// as the tree's are, whatever the number of levels.
TEST_F(AmendmentTest, ObjectsPutBackWhereTheyWereAreJudgedAsBefore) {
  const auto made = CullMap(city().scene, city().set, {});
  std::mt19937 random(4);
  for (const std::size_t count : {1U, 16U, 17U, 256U, 257U, 100'000U}) {
    Amendment back;
    const auto gone = bits_for(city().scene, 0);
    std::vector<ObjectId> ids(city().scene.objects.size());
    for (ObjectId id = 0; id < ids.size(); ++id)
      ids[id] = id;
    std::ranges::shuffle(ids, random);
    ids.resize(std::min(ids.size(), count));
    for (const ObjectId id : ids) {
      if (city().scene.objects[id].always_visible) continue;
      (*gone)[id / 64] |= std::uint64_t{1} << (id % 64);
      back.placed.push_back({id, city().scene.objects[id].bounds});
    }
    back.gone = gone;
    for (const Vec3& eye : eyes()) {
      const Pvs before = plain(made, eye);
      const Pvs after = amended(made, eye, back);
      EXPECT_TRUE(holds(after, before)) << count;
      // Bounds are rounded outwards, and may be so below the floor: such are listed.
      std::size_t more = 0;
      for (const ObjectId id : after.objects)
        more += !lists(before, id) && city().scene.objects[id].bounds.lo.y >= city().set.floor;
      EXPECT_EQ(more, 0U) << count;
    }
  }
}

TEST_F(AmendmentTest, WhatIsGoneIsNotListedUnlessItIsPlaced) {
  const auto m = city().method();
  Amendment none;
  none.gone = bits_for(city().scene, ~std::uint64_t{0});
  for (const Vec3& eye : eyes())
    EXPECT_TRUE(amended(*m, eye, none).objects.empty());
  Amendment one = none;
  const Vec3 eye = eyes()[0];
  one.placed.push_back({3, {eye + Vec3{1, 0, 0}, eye + Vec3{2, 1, 1}}});
  EXPECT_EQ(amended(*m, eye, one).objects, std::vector<ObjectId>{3});
}

TEST_F(AmendmentTest, WithAllOccludersOffTheSetIsThatOfNone) {
  OccluderSet bare = city().set;
  bare.shrunk.clear();
  const CullMap without(city().scene, bare, {});
  Amendment all;
  all.occluders = off(std::vector<std::uint8_t>(city().set.shrunk.size(), 1));
  MethodOptions few;
  few.max_occluders = 20;
  const CullMap full(city().scene, city().set, {});
  const CullMap limited(city().scene, city().set, few);
  for (const Vec3& eye : eyes()) {
    EXPECT_LT(plain(full, eye).objects.size(), plain(without, eye).objects.size());
    EXPECT_EQ(amended(full, eye, all).objects, plain(without, eye).objects);
    EXPECT_EQ(amended(limited, eye, all).objects, plain(without, eye).objects)
        << "the largest are off too";
  }
}

// The predictive strategy writes the mask that the occluders which are off are in.
TEST_F(AmendmentTest, NoStrategyDrawsWhatIsOff) {
  OccluderSet bare = city().set;
  bare.shrunk.clear();
  const CullMap without(city().scene, bare, {});
  const CullMap m(city().scene, city().set, {});
  Amendment all;
  all.occluders = off(std::vector<std::uint8_t>(city().set.shrunk.size(), 1));
  for (const Vec3& eye : eyes()) {
    const Pvs expected = plain(without, eye);
    Work full;
    ASSERT_TRUE(m.solve({eye, kReach}, {}, full));
    for (const Strategy strategy : {Strategy::kGuaranteed, Strategy::kPredictive, Strategy::kAbort})
      for (const double share : {0.1, 0.5, 0.9}) {
        Effort effort;
        effort.strategy = strategy;
        effort.draw_in_full = full.draw;
        effort.draw = static_cast<std::uint64_t>(share * static_cast<double>(full.draw));
        Work work;
        const auto limited = m.solve({eye, kReach}, effort, work);
        ASSERT_TRUE(limited);
        EXPECT_LT(limited->objects.size(), expected.objects.size()) << "something is drawn";
        EXPECT_EQ(amended(m, eye, all, effort).objects, expected.objects) << share;
      }
  }
}

TEST_F(AmendmentTest, WhatCannotBeJudgedWhereItIsPutIsListed) {
  const auto m = city().method();
  const Aabb& all = city().scene.bounds;
  const double far = 3 * all.size().x;
  const Vec3 low{0, city().set.floor - 0.1, 0};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Amendment a;
  a.gone = bits_for(city().scene, ~std::uint64_t{0});
  a.placed.push_back({1, {{far, 1, 0}, {far + 1, 2, 1}}});
  a.placed.push_back({2, {low, low + Vec3{1, 1, 1}}});
  a.placed.push_back({3, {Vec3{nan}, Vec3{nan}}});
  for (const Vec3& eye : eyes())
    EXPECT_EQ(amended(*m, eye, a).objects, (std::vector<ObjectId>{1, 2, 3}));
}

TEST_F(AmendmentTest, AddedPrismsHideAndTheirSolidsHoldTheEye) {
  // All prisms off, and added as they were.
  const CullMap m(city().scene, city().set, {});
  auto change = std::make_shared<OccluderChange>();
  change->shrunk_off.assign(city().set.shrunk.size(), 1);
  Amendment bare;
  bare.occluders = std::make_shared<OccluderChange>(*change);
  change->added = city().set.shrunk;
  change->added_solids.push_back({{500, 0, 500}, {501, 1, 501}});
  Amendment again;
  again.occluders = change;
  for (const Vec3& eye : eyes()) {
    EXPECT_EQ(amended(m, eye, again).objects, plain(m, eye).objects);
    EXPECT_LT(amended(m, eye, again).objects.size(), amended(m, eye, bare).objects.size());
  }
  EXPECT_EQ(amended(m, {500.5, 0.5, 500.5}, again).everything_because, "eye inside an occluder");
}

TEST_F(AmendmentTest, ThreadsThatSolveForDifferentChangesDoNotMixThem) {
  const CullMap m(city().scene, city().set, {});
  std::vector<Amendment> as(3);
  std::vector<Pvs> expected;
  const Vec3 eye = eyes()[0];
  for (std::size_t k = 0; k < as.size(); ++k) {
    auto change = std::make_shared<OccluderChange>();
    change->shrunk_off.assign(city().set.shrunk.size(), 1);
    for (std::size_t p = k; p < city().set.shrunk.size(); p += 3)
      change->added.push_back(city().set.shrunk[p]);
    as[k].occluders = change;
    expected.push_back(amended(CullMap(city().scene, city().set, {}), eye, as[k]));
  }
  EXPECT_NE(expected[0].objects, expected[1].objects);
  std::vector<std::jthread> threads;
  for (std::size_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (std::size_t i = 0; i < 60; ++i) {
        const std::size_t k = (t + i) % as.size();
        EXPECT_EQ(amended(m, eye, as[k]).objects, expected[k].objects);
      }
    });
}

TEST_F(AmendmentTest, MethodsThatTakeNoneSaySo) {
  MethodOptions orthographic;
  orthographic.map = CullMapKind::kOrthographic;
  EXPECT_TRUE(city().method()->takes_amendments());
  const auto refuses = [](const Method& m) {
    Work work;
    const auto pvs = m.solve({{0, 1.7, 0}, kReach}, {}, Amendment{}, work);
    return !m.takes_amendments() && !pvs && pvs.error().code == ErrorCode::kUnsupported &&
           pvs.error().message.find(m.traits().name) != std::string::npos;
  };
  EXPECT_TRUE(refuses(*city().method("cull-map", orthographic)));
  EXPECT_TRUE(refuses(*city().method("occlusion-map")));
}

}  // namespace
}  // namespace ivis::test
