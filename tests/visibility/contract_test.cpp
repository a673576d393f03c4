// What every registered method must hold, on analytic scenes shrunk by the real builder for each
// kind of reach; and the proof that the check would notice: with a guard taken out, or a reach too
// small, the verifier finds misses.

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/support/scene_builder.h"
#include "tests/visibility/contract_scenes.h"
#include "visibility/cull_map.h"
#include "visibility/frustum_cull.h"
#include "visibility/method.h"
#include "visibility/verify.h"

namespace ivis {
namespace {

using test::ContractScene;
using test::SceneBuilder;

const std::vector<Reach> kReaches{Reach::ball(1), Reach::disc(1), Reach::cylinder(1, 0.1),
                                  Reach::ellipsoid({1, 0.2, 0.5}), Reach::box({0.8, 0.1, 1})};

OccluderSet shrunk(const Scene& scene, const Reach& reach) {
  ShrinkOptions options;
  options.reach = reach;
  auto result = shrink(scene, options, FastEroder{});
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? std::move(result->set) : OccluderSet{};
}

/// A way to ask: a method, and for the cull map each of its maps.
struct Way {
  MethodTraits traits;
  MethodOptions options;
  std::string name() const {
    if (traits.name != "cull-map") return traits.name;
    return traits.name + (options.map == CullMapKind::kPolar ? ", polar" : ", orthographic");
  }
};

std::vector<Way> ways() {
  std::vector<Way> all;
  for (const MethodTraits& traits : method_list())
    for (const CullMapKind map : {CullMapKind::kPolar, CullMapKind::kOrthographic}) {
      MethodOptions options;
      options.map = map;
      options.rays = 32;
      all.push_back({traits, options});
      if (traits.name != "cull-map") break;
    }
  return all;
}

std::unique_ptr<Method> made(const Way& way, const Scene& scene, const OccluderSet& set) {
  auto method = make_method(way.traits.name, scene, set, way.options);
  EXPECT_TRUE(method) << (method ? "" : method.error().message);
  return std::move(*method);
}

std::size_t misses(const Verifier& verifier, const Pvs& pvs, std::size_t rays = 64) {
  VerifyOptions options;
  options.rays_per_culled_object = rays;
  const auto report = verifier.check(pvs, options);
  EXPECT_TRUE(report) << (report ? "" : report.error().message);
  return report ? report->false_negatives : 1;
}

bool ascending(const std::vector<ObjectId>& ids) {
  return std::adjacent_find(ids.begin(), ids.end(), std::greater_equal<>()) == ids.end();
}
bool lists(const Pvs& pvs, ObjectId id) {
  return std::binary_search(pvs.objects.begin(), pvs.objects.end(), id);
}

/// Every promise about one scene's answers.
void expect_contract(const ContractScene& s, const std::vector<Reach>& reaches) {
  std::size_t culled = 0;
  for (const Reach& reach : reaches) {
    const OccluderSet set = shrunk(s.scene, reach);
    // As seen through what is never an occluder: more is seen, so the check is harder.
    const Verifier verifier(s.scene, &set, BlockerChoice::kOccluding);
    const Verifier drawn(s.scene, &set);
    std::vector<std::vector<ObjectId>> seen;
    for (const Vec3& eye : s.eyes)
      seen.push_back(drawn.seen_from({eye, reach}, 64, 1));
    for (const Way& way : ways()) {
      const auto method = made(way, s.scene, set);
      for (std::size_t i = 0; i < s.eyes.size(); ++i) {
        SCOPED_TRACE(s.name + ", " + reach.to_string() + ", " + way.name() + ", eye " +
                     std::to_string(i));
        const auto pvs = method->solve({s.eyes[i], reach});
        ASSERT_TRUE(pvs) << pvs.error().message;
        EXPECT_EQ(pvs->scene_hash, s.scene.hash);
        EXPECT_EQ(pvs->cell.eye, s.eyes[i]);
        EXPECT_EQ(pvs->cell.reach, reach);
        EXPECT_TRUE(ascending(pvs->objects));
        EXPECT_TRUE(pvs->everything_because.empty()) << pvs->everything_because;
        EXPECT_TRUE(s.mover == ~0U || lists(*pvs, s.mover)) << "moves";
        if (way.traits.guarantee != Guarantee::kConservative) continue;
        EXPECT_TRUE(std::includes(pvs->objects.begin(), pvs->objects.end(), seen[i].begin(),
                                  seen[i].end()));
        EXPECT_EQ(misses(verifier, *pvs), 0U);
        culled += s.scene.objects.size() - pvs->objects.size();
      }
    }
  }
  EXPECT_GT(culled, 100U) << s.name << ": a method that lists everything holds the contract idly";
}

class MethodContract : public ::testing::TestWithParam<std::size_t> {};
constexpr std::size_t kAnalyticScenes = 13;
INSTANTIATE_TEST_SUITE_P(AnalyticScenes, MethodContract,
                         ::testing::Range<std::size_t>(0, kAnalyticScenes));

TEST_P(MethodContract, ListsWhatTheReferenceSeesForEveryKindOfReach) {
  const auto scenes = test::analytic_scenes();
  ASSERT_EQ(scenes.size(), kAnalyticScenes);
  expect_contract(scenes[GetParam()], kReaches);
}

TEST(MethodContractCity, ListsWhatTheReferenceSeesInASmallCity) {
  const ContractScene city = test::small_city();
  ASSERT_FALSE(city.eyes.empty());
  expect_contract(city, {Reach::disc(1), Reach::cylinder(1.5, 0.1)});
}

TEST(MethodContractFrustum, ListsWhatCanBeInThePictureAndNoneOfWhatIsBehind) {
  const ContractScene city = test::small_city();
  const Reach reach = Reach::cylinder(1.5, 0.1);
  const OccluderSet set = shrunk(city.scene, reach);
  const Verifier verifier(city.scene, &set, BlockerChoice::kOccluding);
  VerifyOptions options;
  std::size_t missed_when_too_narrow = 0;
  for (const Way& way : ways()) {
    if (way.traits.guarantee != Guarantee::kConservative) continue;
    for (std::size_t i = 0; i < city.eyes.size(); ++i) {
      const Frustum frustum{73.0 * static_cast<double>(i), i % 2 == 0 ? -5.0 : 10.0, 70, 50, 8};
      options.frustum = frustum;
      const ViewCell cell{city.eyes[i], reach};
      const auto whole = made(way, city.scene, set)->solve(cell);
      const auto pvs =
          cull_by_frustum(made(way, city.scene, set), city.scene, frustum)->solve(cell);
      ASSERT_TRUE(whole && pvs);
      EXPECT_LT(2 * pvs->objects.size(), whole->objects.size()) << "less than a quarter of a turn";
      EXPECT_TRUE(std::includes(whole->objects.begin(), whole->objects.end(), pvs->objects.begin(),
                                pvs->objects.end()));
      const auto report = verifier.check(*pvs, options);
      ASSERT_TRUE(report);
      EXPECT_EQ(report->false_negatives, 0U) << way.name() << ", eye " << i;

      Frustum narrow = frustum;  // as if the view did not turn
      narrow.turn_deg = 0;
      const auto too_few =
          cull_by_frustum(made(way, city.scene, set), city.scene, narrow)->solve(cell);
      ASSERT_TRUE(too_few);
      missed_when_too_narrow += verifier.check(*too_few, options)->false_negatives;
    }
  }
  EXPECT_GT(missed_when_too_narrow, 0U) << "the check has no power";
}

TEST(MethodContractFrustum, AMoverStays) {
  for (const auto& s : test::analytic_scenes()) {
    if (s.mover == ~0U) continue;
    const OccluderSet set = shrunk(s.scene, Reach::disc(1));
    for (const double yaw : {0.0, 180.0}) {
      const auto pvs = cull_by_frustum(made(ways()[0], s.scene, set), s.scene, {yaw, 0, 20, 20, 0})
                           ->solve({s.eyes[0], Reach::disc(1)});
      ASSERT_TRUE(pvs);
      EXPECT_TRUE(lists(*pvs, s.mover)) << s.name;
    }
  }
}

TEST(MethodContractCell, WallsThatTouchHideWhatIsBehindTheirSeam) {
  for (const auto& s : test::analytic_scenes()) {
    if (s.name != "two walls that fuse") continue;
    const OccluderSet set = shrunk(s.scene, Reach::disc(1));
    const auto pvs = CullMap(s.scene, set, {}).solve({{0, 1.7, 0}, Reach::disc(1)});
    ASSERT_TRUE(pvs);
    std::size_t behind = 0;
    for (ObjectId id = 0; id < s.scene.objects.size(); ++id) {
      const Aabb& b = s.scene.objects[id].bounds;
      if (b.lo.x < 17 || std::abs(b.centre().z) > 5 || b.hi.y > 2 ||
          s.scene.objects[id].always_visible)
        continue;
      ++behind;
      EXPECT_FALSE(lists(*pvs, id)) << id;
    }
    EXPECT_GT(behind, 5U);
  }
}

TEST(MethodContractCell, ADrawnFaceIsListedUnlessAllOfTheCellIsBehindIt) {
  SceneBuilder b;
  b.add_mesh(
      [] {
        Mesh face;
        face.positions = {{2, 0, -2}, {2, 3, -2}, {2, 3, 2}, {2, 0, 2}};
        face.indices = {0, 1, 2, 0, 2, 3};
        face.primitives = {{0, 2, true, true}};
        return face;
      }(),
      OccluderTag::kNever);
  b.add_box({0, 0, -2}, {2, 3, 2}, OccluderTag::kOnly);
  b.add_box({-90, 0, -90}, {-89, 1, -89}, OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  const OccluderSet set = shrunk(scene, Reach::ball(0.5));
  for (const Way& way : ways()) {
    if (!way.traits.needs_occluders) continue;
    const auto method = made(way, scene, set);
    const auto listed = [&](double x) {
      const auto pvs = method->solve({{x, 1.5, 6}, Reach::ball(0.5)});
      EXPECT_TRUE(pvs);
      return !pvs || lists(*pvs, 0);
    };
    EXPECT_TRUE(listed(5)) << way.name();
    EXPECT_TRUE(listed(1.6)) << way.name() << ": part of the cell is before it";
    EXPECT_TRUE(listed(1.4999)) << way.name() << ": a pose may be a millimetre outside";
    EXPECT_FALSE(listed(1.4)) << way.name();
    EXPECT_FALSE(listed(-5)) << way.name();
  }
  OccluderSet bent = set;
  bent.backings[0].plane.normal *= 0.5;
  EXPECT_FALSE(make_method("cull-map", scene, bent));
  OccluderSet other = set;
  ASSERT_EQ(other.backings.size(), 1U);
  other.backings[0].object = 2;
  const auto refused = make_method("cull-map", scene, other);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kMismatch);
}

TEST(MethodContractCell, AnEyeInsideASolidSeesEverythingFlagged) {
  for (const ContractScene& s : test::analytic_scenes()) {
    const OccluderSet set = shrunk(s.scene, Reach::disc(1));
    for (const Way& way : ways()) {
      const auto pvs = made(way, s.scene, set)->solve({s.in_solid, Reach::disc(1)});
      ASSERT_TRUE(pvs);
      EXPECT_EQ(pvs->objects.size(), s.scene.objects.size()) << s.name << ", " << way.name();
      EXPECT_TRUE(ascending(pvs->objects));
      EXPECT_EQ(pvs->everything_because, "eye inside an occluder") << s.name << ", " << way.name();
    }
  }
}

TEST(MethodContractCell, ALargerReachOrAnEyeThatIsNotFiniteIsRefused) {
  const ContractScene s = test::analytic_scenes().front();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (const Reach& reach : kReaches) {
    const OccluderSet set = shrunk(s.scene, reach);
    const Vec3 e = reach.half_extents();
    for (const Way& way : ways()) {
      const auto method = made(way, s.scene, set);
      for (const Vec3& eye : {Vec3{kNan, 0, 0}, Vec3{0, kInf, 0}, Vec3{0, 0, -kInf}}) {
        const auto refused = method->solve({eye, reach});
        ASSERT_FALSE(refused) << way.name();
        EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
      }
      if (!way.traits.needs_occluders) continue;
      for (const Reach& larger :
           {Reach::box(1.1 * e + Vec3{0.02}), Reach::ball(std::max(e.x, e.z) + 0.5),
            Reach::box({e.x, e.y + 0.5, e.z})}) {
        const auto refused = method->solve({{0, 1.7, 0}, larger});
        ASSERT_FALSE(refused) << way.name() << ' ' << larger.to_string();
        EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
      }
      EXPECT_TRUE(method->solve({{0, 1.7, 0}, Reach::ball(0)})) << "a point is in every reach";
    }
  }
}

TEST(MethodContractCell, ThreadsDoNotChangeTheAnswer) {
  const ContractScene city = test::small_city();
  const Reach reach = Reach::disc(1);
  const OccluderSet set = shrunk(city.scene, reach);
  for (Way way : ways()) {
    std::vector<std::vector<ObjectId>> answers;
    for (const unsigned threads : {1U, 2U, 5U}) {
      way.options.threads = threads;
      const auto pvs = made(way, city.scene, set)->solve({city.eyes.front(), reach});
      ASSERT_TRUE(pvs);
      answers.push_back(pvs->objects);
    }
    EXPECT_EQ(answers[0], answers[1]) << way.name();
    EXPECT_EQ(answers[0], answers[2]) << way.name();
  }
}

/// Sets along the city's walk, and how many of them list something that rays show was culled.
struct Walked {
  std::vector<std::vector<ObjectId>> sets;
  std::size_t misses = 0;
};

Walked walked(Way way, Selection selection, std::size_t most, const ContractScene& city,
              const OccluderSet& set, const Reach& reach) {
  way.options.selection = selection;
  way.options.max_occluders = most;
  const auto method = made(way, city.scene, set);
  const Verifier verifier(city.scene, &set, BlockerChoice::kOccluding);
  Walked out;
  LastShown last;
  for (const Vec3& eye : city.eyes) {
    const auto pvs = method->solve({eye, reach}, last);
    EXPECT_TRUE(pvs);
    if (!pvs) continue;
    out.sets.push_back(pvs->objects);
    out.misses += misses(verifier, *pvs, 16);
  }
  EXPECT_EQ(last.known, selection != Selection::kConservative);
  return out;
}

TEST(MethodContractSelection, EveryPolicyListsWhatIsSeenAndTwoPassesLoseNothing) {
  const ContractScene city = test::small_city();
  const Reach reach = Reach::cylinder(1, 0.1);
  const OccluderSet set = shrunk(city.scene, reach);
  const auto total = [](const Walked& w) {
    std::size_t n = 0;
    for (const auto& s : w.sets)
      n += s.size();
    return n;
  };
  for (const Way& way : ways()) {
    if (!way.traits.needs_occluders) continue;
    SCOPED_TRACE(way.name());
    const Walked all = walked(way, Selection::kConservative, 0, city, set, reach);
    const Walked temporal = walked(way, Selection::kTemporal, 0, city, set, reach);
    const Walked twice = walked(way, Selection::kTwoPass, 0, city, set, reach);
    const Walked few = walked(way, Selection::kTwoPass, 3, city, set, reach);
    for (const Walked* w : {&all, &temporal, &twice, &few})
      EXPECT_EQ(w->misses, 0U);
    // What the second pass leaves out is hidden by what it draws: next to nothing is lost.
    EXPECT_LE(total(twice), total(all) * 101 / 100);
    EXPECT_GE(total(temporal), total(all));
    EXPECT_GT(total(few), total(all));
    // Poses are 20 apart: what showed there is not what hides here.
    EXPECT_NE(temporal.sets, all.sets);
    EXPECT_EQ(temporal.sets.front(), all.sets.front()) << "nothing is known before the first";
  }
}

TEST(MethodContractSelection, WhatShowedAtTheLastPoseIsAllThatIsDrawn) {
  // Seen from the first eye, one wall hides the other; from the second, the other alone hides.
  SceneBuilder b;
  b.add_box({10, 0, -20}, {12, 10, 20});
  b.add_box({30, 0, -20}, {32, 9, 20});
  b.add_box({39.5, 1, -0.5}, {40.5, 2, 0.5}, OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  const Reach reach = Reach::disc(0.5);
  const OccluderSet set = shrunk(scene, reach);
  for (const char* name : {"cull-map", "occlusion-map"})
    for (const Selection selection : {Selection::kTemporal, Selection::kTwoPass}) {
      MethodOptions options;
      options.selection = selection;
      const auto method = make_method(name, scene, set, options);
      ASSERT_TRUE(method);
      LastShown last;
      const auto listed = [&](double x) {
        const auto pvs = (*method)->solve({{x, 1.7, 0}, reach}, last);
        EXPECT_TRUE(pvs);
        return !pvs || lists(*pvs, 2);
      };
      EXPECT_FALSE(listed(0));
      const std::size_t shown = last.occluders.size();
      EXPECT_EQ(listed(20), selection == Selection::kTemporal)
          << name << ": the far wall did not show before";
      EXPECT_GT(last.occluders.size(), 0U);
      EXPECT_FALSE(listed(21)) << name << ": but it did now";
      EXPECT_GT(shown, 0U);
    }
}

TEST(MethodContractCell, OccludersOfAnotherSceneAreRefusedByWhoeverNeedsThem) {
  const auto scenes = test::analytic_scenes();
  const OccluderSet set = shrunk(scenes[0].scene, Reach::disc(1));
  for (const MethodTraits& traits : method_list()) {
    const auto method = make_method(traits.name, scenes[1].scene, set);
    EXPECT_EQ(method.has_value(), !traits.needs_occluders) << traits.name;
    EXPECT_TRUE(method || method.error().code == ErrorCode::kMismatch) << traits.name;
  }
}

TEST(MethodContractCell, OccludersWithNumbersThatCannotBeComputedWithAreRefused) {
  const ContractScene s = test::analytic_scenes().front();
  const OccluderSet sound = shrunk(s.scene, Reach::disc(1));
  ASSERT_FALSE(sound.shrunk.empty());
  ASSERT_FALSE(sound.solids.empty());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  using Spoil = void (*)(OccluderSet&, double);
  const std::vector<std::pair<const char*, Spoil>> fields{
      {"slack", [](OccluderSet& o, double v) { o.slack_m = v; }},
      {"floor", [](OccluderSet& o, double v) { o.floor = v; }},
      {"reach", [](OccluderSet& o, double v) { o.reach = Reach::ball(v); }},
      {"ground",
       [](OccluderSet& o, double v) {
         o.ground = {{0, 0, 0}, {1, 1, v}};
       }},
      {"bottom", [](OccluderSet& o, double v) { o.shrunk[0].bottom = v; }},
      {"top", [](OccluderSet& o, double v) { o.shrunk[0].top = v; }},
      {"solid bottom", [](OccluderSet& o, double v) { o.shrunk[0].solid_bottom = v; }},
      {"corner x", [](OccluderSet& o, double v) { o.shrunk[0].footprint.rings[0][1].x = v; }},
      {"corner z", [](OccluderSet& o, double v) { o.solids[0].footprint.rings[0][1].y = v; }}};
  const auto refusal = [&](const OccluderSet& set, const std::string& method) {
    const auto made = make_method(method, s.scene, set);
    EXPECT_TRUE(made || made.error().code == ErrorCode::kInvalidArgument);
    return made ? "" : made.error().message;
  };
  for (const MethodTraits& traits : method_list()) {
    EXPECT_EQ(refusal(sound, traits.name), "");
    for (const auto& [field, spoil] : fields)
      for (const double v : {2e9, kNan}) {
        OccluderSet bad = sound;
        spoil(bad, v);
        EXPECT_NE(refusal(bad, traits.name).find(field), std::string::npos) << field << ' ' << v;
      }
    OccluderSet bad = sound;
    bad.solids[0].top = bad.solids[0].bottom - 1;
    EXPECT_NE(refusal(bad, traits.name).find("solid 0: top"), std::string::npos);
    bad = sound;
    bad.slack_m = -0.001;
    EXPECT_NE(refusal(bad, traits.name).find("slack"), std::string::npos);
  }
}

TEST(VerifierPower, FindsThatOccludersWereShrunkForAReachTenPercentTooSmall) {
  // Far behind a wall the bound is tight: what shows above its top from two metres farther back
  // than the eye.
  SceneBuilder b;
  b.add_box({10, 0, -4000}, {20, 20, 4000});
  for (int i = 0; i < 60; ++i) {
    const Vec3 at{3000, 4500 + 4 * i, 0};
    b.add_box(at - 0.25, at + 0.25, OccluderTag::kNever);
  }
  const Scene scene = std::move(b).finish();
  const Reach asked = Reach::disc(2);
  for (const double shrunk_for : {2.0, 1.8}) {
    OccluderSet set = shrunk(scene, Reach::disc(shrunk_for));
    set.reach = asked;  // a lie, the second time
    const auto pvs = CullMap(scene, set, {}).solve({{0, 1.7, 0}, asked});
    ASSERT_TRUE(pvs);
    EXPECT_LT(pvs->objects.size(), 55U);
    EXPECT_EQ(misses(Verifier(scene, &set), *pvs) > 0, shrunk_for < 2);
  }
}

TEST(VerifierPower, FindsThatAGuardOfTheMapIsTakenOut) {
  const auto expect_caught = [](const char* name, auto take_out, bool floating, double height,
                                std::uint32_t bins) {
    PolarGuards guards;
    take_out(guards);
    const Reach reach = Reach::disc(1);
    std::size_t whole = 0;
    std::size_t without = 0;
    for (unsigned seed = 20; seed < 26; ++seed) {
      const Scene scene = test::random_town(seed, floating);
      const OccluderSet set = shrunk(scene, reach);
      const Verifier verifier(scene, &set, BlockerChoice::kOccluding);
      for (const bool on : {true, false}) {
        const auto pvs = CullMap(scene, set, {}, on ? PolarGuards{} : guards, bins)
                             .solve({{0, height, 0}, reach});
        ASSERT_TRUE(pvs);
        ASSERT_TRUE(pvs->everything_because.empty());
        (on ? whole : without) += misses(verifier, *pvs);
      }
    }
    EXPECT_EQ(whole, 0U) << name;
    EXPECT_GT(without, 0U) << name;
  };
  expect_caught(
      "cover_whole_bins", [](PolarGuards& g) { g.cover_whole_bins = false; }, false, 1.7, 64);
  expect_caught(
      "test_distance", [](PolarGuards& g) { g.test_distance = false; }, false, 1.7, 1024);
  expect_caught(
      "respect_undersides", [](PolarGuards& g) { g.respect_undersides = false; }, true, 1.7, 1024);
  expect_caught(
      "far_end_below_eye", [](PolarGuards& g) { g.far_end_below_eye = false; }, false, 30, 64);
}

TEST(VerifierPower, FindsThatThingsOnWallsAreTakenForHiddenAtAGraze) {
  SceneBuilder b;
  for (int i = 0; i < 20; ++i)  // on the far side, near the house's end
    b.add_box({9.4, 1 + i * 0.4, -10.2}, {9.7, 1.3 + i * 0.4, -10}, OccluderTag::kNever);
  b.add_box({0, 0, -10}, {10, 10, 0});
  const Scene scene = std::move(b).finish();
  OccluderSet set = shrunk(scene, Reach::disc(0.5));
  ASSERT_GT(set.backings.size(), 15U);
  const ViewCell along{{60, 5, -9}, Reach::disc(0.5)};
  for (const bool guarded : {true, false}) {
    if (!guarded)
      for (Backing& wall : set.backings)
        wall.per_level = wall.per_height = 0;
    const auto method = make_method("cull-map", scene, set);
    ASSERT_TRUE(method);
    const auto pvs = (*method)->solve(along);
    ASSERT_TRUE(pvs);
    EXPECT_EQ(misses(Verifier(scene, &set), *pvs) > 0, !guarded);
    // From well behind, all of them are hidden.
    const auto behind = (*method)->solve({{9.5, 5, 30}, Reach::disc(0.5)});
    ASSERT_TRUE(behind);
    EXPECT_LE(behind->objects.size(), 3U);
    EXPECT_EQ(misses(Verifier(scene, &set), *behind), 0U);
  }
}

TEST(VerifierPower, FindsThatTheLeastOverABinIsNotTaken) {
  const Reach reach = Reach::disc(0.5);
  SceneBuilder b;
  b.add_prism({{5, -23}, {400, -14}, {400, 6}, {5, -3}}, 0, 20);
  // In front of the wall's line z = -3.114 + 0.0228 x, which recedes from 75 m to 158 m within one
  // bin.
  for (int x = 100; x < 130; x += 2) {
    const Vec3 at{x, 1.5, (-3.114 + 0.0228 * x) / 2};
    b.add_box(at - 0.05, at + 0.05, OccluderTag::kNever);
  }
  const Scene scene = std::move(b).finish();
  const OccluderSet set = shrunk(scene, reach);
  for (const bool on : {true, false}) {
    PolarGuards guards;
    guards.least_over_bin = on;
    const auto pvs = CullMap(scene, set, {}, guards, 64).solve({{0, 1.7, 0}, reach});
    ASSERT_TRUE(pvs);
    EXPECT_EQ(misses(Verifier(scene, &set), *pvs) == 0, on);
  }
}

}  // namespace
}  // namespace ivis
