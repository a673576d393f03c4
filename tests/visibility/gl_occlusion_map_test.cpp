#include "visibility/gl/gl_occlusion_map.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include "tests/support/scene_builder.h"
#include "tests/visibility/gl_support.h"
#include "visibility/occlusion_map.h"

namespace ivis {
namespace {

using test::gl_map;
using test::SceneBuilder;
using test::shrunk;
using test::software_context;
using test::solved;

bool lists(const Pvs& pvs, ObjectId id) {
  return std::binary_search(pvs.objects.begin(), pvs.objects.end(), id);
}

TEST(GlContext, SaysWhatIsMissing) {
  GlContext::Options none;
  none.surfaceless = none.devices = false;
  auto context = GlContext::create(none);
  ASSERT_FALSE(context);
  EXPECT_EQ(context.error().code, ErrorCode::kUnsupported);
  IVIS_NEEDS_GL;
  GlContext::Options newer;
  newer.major = 9;
  context = GlContext::create(newer);
  ASSERT_FALSE(context);
  EXPECT_NE(context.error().message.find("9.5"), std::string::npos) << context.error().message;
}

TEST(GlContext, SoftwareIsNamedAndRefusedWhereHardwareIsAskedFor) {
  IVIS_NEEDS_GL;
  const auto context = software_context();
  if (!context->is_software()) GTEST_SKIP() << "draws by hardware: " << context->renderer();
  GlContext::Options options;
  options.hardware_only = true;
  const auto hardware = GlContext::create(options);
  if (hardware) GTEST_SKIP() << "a device draws by hardware: " << (*hardware)->renderer();
  EXPECT_NE(hardware.error().message.find("only software"), std::string::npos)
      << hardware.error().message;
}

TEST(GlContext, LeavesTheThreadAsItWas) {
  IVIS_NEEDS_GL;
  const auto one = software_context();
  const auto other = software_context();
  const auto outer = one->make_current();
  ASSERT_TRUE(outer);
  {
    const auto inner = other->make_current();
    ASSERT_TRUE(inner);
    EXPECT_TRUE(other->check());
  }
  EXPECT_TRUE(one->check());
}

/// One wall of 2 m, boxes before and behind it, in front of each side of the cube in turn.
struct Walls {
  Scene scene;
  ObjectId before[6], behind[6], beside[6], through[6];
};
Walls walls(double distance) {
  SceneBuilder b;
  Walls out;
  for (std::uint32_t side = 0; side < 6; ++side) {
    const auto w = static_cast<int>(side >> 1U);
    const double sign = (side & 1U) != 0 ? -1 : 1;
    const auto box = [&](double near, double far, double u, double half, OccluderTag tag) {
      Vec3 lo{-half};
      Vec3 hi{half};
      lo[w] = sign > 0 ? near : -far;
      hi[w] = sign > 0 ? far : -near;
      lo[(w + 1) % 3] += u;
      hi[(w + 1) % 3] += u;
      return b.add_box(lo, hi, tag);
    };
    box(distance, distance + 2, 0, 0.6 * distance, OccluderTag::kOnly);
    out.before[side] = box(distance - 1.5, distance - 1, 0, 0.2, OccluderTag::kNever);
    out.behind[side] = box(distance + 8, distance + 8.5, 0, 0.2, OccluderTag::kNever);
    out.through[side] = box(distance - 1, distance + 4, 1, 0.2, OccluderTag::kNever);
    out.beside[side] =
        box(distance + 8, distance + 8.5, 0.8 * distance + 8, 0.2, OccluderTag::kNever);
  }
  // Ids are of what can be listed: solids marked `only` have none, in the order of adding.
  out.scene = std::move(b).finish();
  return out;
}

TEST(GlOcclusionMap, AWallHidesOnEverySideWhatIsWhollyBehindIt) {
  IVIS_NEEDS_GL;
  const Reach reach = Reach::ball(0.3);
  for (const double distance : {6.0, 10.0}) {
    const Walls w = walls(distance);
    const OccluderSet set = shrunk(w.scene, reach);
    const auto map = gl_map(w.scene, set);
    ASSERT_NE(map, nullptr);
    const Pvs pvs = solved(*map, {{0, 0, 0}, reach});
    ASSERT_TRUE(pvs.everything_because.empty()) << pvs.everything_because;
    const Pvs cpu = solved(OcclusionMap(w.scene, set, {}), {{0, 0, 0}, reach});
    for (int side = 0; side < 6; ++side) {
      EXPECT_TRUE(lists(pvs, w.before[side])) << side;
      // Above and below, both maps leave out prisms whose margin is chosen for the other sides.
      const bool by_cpu = lists(cpu, w.behind[side]);
      EXPECT_TRUE(!by_cpu || side / 2 == 1) << side << ", " << distance << " m";
      EXPECT_EQ(lists(pvs, w.behind[side]), by_cpu) << side << ", " << distance << " m";
      EXPECT_TRUE(lists(pvs, w.through[side])) << side;
      EXPECT_TRUE(lists(pvs, w.beside[side])) << side;
    }
    EXPECT_EQ(test::misses(Verifier(w.scene, &set), pvs), 0U);
  }
}

TEST(GlOcclusionMap, AWallNearerThanTheNearDistanceHides) {
  IVIS_NEEDS_GL;
  SceneBuilder b;
  b.add_box({0.7, -30, -30}, {4, 30, 30});
  const ObjectId behind = b.add_box({9, -0.2, -0.2}, {9.5, 0.2, 0.2}, OccluderTag::kNever);
  const ObjectId other_way = b.add_box({-9, -0.2, -0.2}, {-8.5, 0.2, 0.2}, OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  const Reach reach = Reach::ball(0.5);  // near: 2 m
  const OccluderSet set = shrunk(scene, reach);
  const auto map = gl_map(scene, set);
  ASSERT_NE(map, nullptr);
  const Pvs pvs = solved(*map, {{0, 0, 0}, reach});
  EXPECT_FALSE(lists(pvs, behind));
  EXPECT_TRUE(lists(pvs, other_way));
}

/// A wall through the planes of the eye and along it, so that every side of the cube clips it.
TEST(GlOcclusionMap, AWallThatRunsPastTheEyeHidesWhatIsBehindIt) {
  IVIS_NEEDS_GL;
  SceneBuilder b;
  b.add_box({1.5, -200, -900}, {4, 200, 900});
  std::vector<ObjectId> behind;
  for (int i = -20; i <= 20; ++i) {
    const Vec3 at{12, i % 5, 4 * i};
    behind.push_back(b.add_box(at - 0.2, at + 0.2, OccluderTag::kNever));
  }
  const Scene scene = std::move(b).finish();
  const Reach reach = Reach::ball(0.3);
  const OccluderSet set = shrunk(scene, reach);
  const auto map = gl_map(scene, set);
  ASSERT_NE(map, nullptr);
  const Pvs pvs = solved(*map, {{0, 0, 0}, reach});
  std::size_t shown = 0;
  for (const ObjectId id : behind)
    if (lists(pvs, id)) ++shown;
  EXPECT_LT(shown, behind.size() / 4);
  EXPECT_EQ(test::misses(Verifier(scene, &set), pvs), 0U);
}

TEST(GlOcclusionMap, AnEmptySceneAndASceneWithoutOccludersAreAnswered) {
  IVIS_NEEDS_GL;
  const Reach reach = Reach::ball(0.3);
  const Scene empty = SceneBuilder{}.finish();
  OccluderSet set;
  set.scene_hash = empty.hash;
  set.reach = reach;
  EXPECT_TRUE(solved(*gl_map(empty, set), {{0, 0, 0}, reach}).objects.empty());
  SceneBuilder b;
  for (int i = 0; i < 130; ++i)
    b.add_box({i, 0, 5}, {i + 0.5, 1, 6}, OccluderTag::kNever);
  const Scene open = std::move(b).finish();
  set.scene_hash = open.hash;
  EXPECT_EQ(solved(*gl_map(open, set), {{0, 0, 0}, reach}).objects.size(), 130U);
}

TEST(GlOcclusionMap, AnEyeThatIsWrongOrInsideIsTreatedAsByEveryMethod) {
  IVIS_NEEDS_GL;
  const Reach reach = Reach::ball(0.3);
  const Walls w = walls(6);
  const OccluderSet set = shrunk(w.scene, reach);
  const auto map = gl_map(w.scene, set);
  ASSERT_NE(map, nullptr);
  EXPECT_FALSE(map->solve({{std::nan(""), 0, 0}, reach}));
  EXPECT_FALSE(map->solve({{0, 0, 0}, Reach::ball(1)}));
  const Pvs inside = solved(*map, {{7, 0, 0}, reach});
  EXPECT_EQ(inside.objects.size(), w.scene.objects.size());
  EXPECT_EQ(inside.everything_because, "eye inside an occluder");
}

TEST(GlOcclusionMap, ALostContextIsAnErrorAndUnderAutoTheCpuTakesOver) {
  IVIS_NEEDS_GL;
  const Reach reach = Reach::ball(0.3);
  const Walls w = walls(6);
  const OccluderSet set = shrunk(w.scene, reach);
  const ViewCell cell{{0, 0, 0}, reach};
  auto map = gl_map(w.scene, set);
  ASSERT_NE(map, nullptr);
  GlOcclusionMap* gl = map.get();
  std::vector<std::string> log;
  MethodOptions options;
  options.log = [&](std::string_view line) { log.emplace_back(line); };
  options.make_gl = [&](const Scene&, const OccluderSet&,
                        const MethodOptions&) -> Result<std::unique_ptr<Method>> {
    return std::unique_ptr<Method>(std::move(map));
  };
  const auto method = make_method("occlusion-map", w.scene, set, options);
  ASSERT_TRUE(method);
  EXPECT_TRUE((*method)->solve(cell));
  EXPECT_EQ((*method)->backend(), Backend::kGl);
  gl->context().destroy();
  const auto lost = gl->solve(cell);
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kUnsupported);
  EXPECT_TRUE(log.empty());
  const auto pvs = (*method)->solve(cell);
  ASSERT_TRUE(pvs);
  EXPECT_EQ(pvs->objects, solved(OcclusionMap(w.scene, set, {}), cell).objects);
  EXPECT_EQ((*method)->backend(), Backend::kCpu);
  EXPECT_EQ(log.size(), 1U);
}

TEST(GlOcclusionMap, FacesInSeveralPagesGiveTheSameAnswer) {
  IVIS_NEEDS_GL;
  SceneBuilder b;
  for (int i = 0; i < 60; ++i) {
    const double angle = 0.7 * i;
    const Vec3 at{(10 + i) * std::cos(angle), 0, (10 + i) * std::sin(angle)};
    b.add_box(at - Vec3{2, 0, 2}, at + Vec3{2, 6, 2});
    b.add_box(1.5 * at - 0.2, 1.5 * at + 0.2, OccluderTag::kNever);
  }
  const Scene scene = std::move(b).finish();
  const OccluderSet set = shrunk(scene, Reach::ball(0.3));
  const ViewCell cell{{0, 1.7, 0}, Reach::ball(0.3)};
  GlOcclusionMap::Stats whole_stats;
  const auto whole = gl_map(scene, set)->solve(cell, whole_stats);
  ASSERT_TRUE(whole);
  EXPECT_LT(whole->objects.size(), 110U);
  EXPECT_GT(whole_stats.faces_drawn, 100U);
  for (const std::size_t bytes : {2048U, 8192U}) {
    auto paged = GlOcclusionMap::create(software_context(), scene, set, {}, {}, bytes);
    ASSERT_TRUE(paged) << paged.error().message;
    GlOcclusionMap::Stats stats;
    for (int round = 0; round < 2; ++round) {
      stats = {};
      const auto pvs = (*paged)->solve(cell, stats);
      ASSERT_TRUE(pvs);
      EXPECT_EQ(pvs->objects, whole->objects) << bytes;
      EXPECT_EQ(stats.faces_drawn, whole_stats.faces_drawn) << bytes;
    }
  }
  const auto narrow = GlOcclusionMap::create(software_context(), scene, set, {}, {}, 256);
  ASSERT_FALSE(narrow);
  EXPECT_EQ(narrow.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(narrow.error().message.find("at most 256 fit"), std::string::npos)
      << narrow.error().message;
}

TEST(GlOcclusionMap, ThreadsTakeTurnsAndGetTheSameAnswers) {
  IVIS_NEEDS_GL;
  const Reach reach = Reach::ball(0.3);
  const Walls w = walls(6);
  const OccluderSet set = shrunk(w.scene, reach);
  const auto map = gl_map(w.scene, set);
  ASSERT_NE(map, nullptr);
  const Vec3 eyes[2] = {{0, 0, 0}, {1, 0.5, -1}};
  const std::vector<ObjectId> alone[2] = {solved(*map, {eyes[0], reach}).objects,
                                          solved(*map, {eyes[1], reach}).objects};
  std::vector<std::thread> threads;
  for (int t = 0; t < 2; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 5; ++i)
        EXPECT_EQ(solved(*map, {eyes[t], reach}).objects, alone[t]);
    });
  for (auto& t : threads)
    t.join();
}

}  // namespace
}  // namespace ivis
