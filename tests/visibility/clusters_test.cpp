// What clusters are for: a scene that is one merged mesh is culled, and nothing seen is left out.

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "scenes/clusters.h"
#include "tests/visibility/contract_scenes.h"
#include "visibility/method.h"
#include "visibility/verify.h"

namespace ivis {
namespace {

OccluderSet shrunk(const Scene& scene, const Reach& reach) {
  ShrinkOptions options;
  options.reach = reach;
  auto result = shrink(scene, options, FastEroder{});
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? std::move(result->set) : OccluderSet{};
}

Scene split(Scene scene) {
  auto out = split_into_clusters(std::move(scene));
  EXPECT_TRUE(out) << (out ? "" : out.error().message);
  return out ? *std::move(out) : Scene{};
}

/// All drawn triangles as one mesh of one node, as exporters of whole levels write them.
Scene merged(const Scene& scene) {
  Mesh mesh;
  for (const Object& o : scene.objects) {
    const Mesh& from = scene.mesh_of(o);
    const auto base = static_cast<std::uint32_t>(mesh.positions.size());
    const auto first = static_cast<std::uint32_t>(mesh.triangles());
    for (const auto& p : from.positions)
      mesh.positions.emplace_back(Vec3(o.to_world * glm::dvec4(Vec3(p), 1)));
    for (const std::uint32_t i : from.indices)
      mesh.indices.push_back(base + i);
    for (Primitive p : from.primitives) {
      p.first_triangle += first;
      mesh.primitives.push_back(p);
    }
  }
  Scene out;
  out.meshes.push_back(std::move(mesh));
  out.objects.resize(1);
  EXPECT_TRUE(finish_scene(out));
  return out;
}

/// The methods that promise to leave nothing out, the cull map with each of its maps.
std::vector<std::pair<std::string, MethodOptions>> conservative_ways() {
  std::vector<std::pair<std::string, MethodOptions>> ways;
  for (const MethodTraits& traits : method_list()) {
    if (traits.guarantee != Guarantee::kConservative) continue;
    ways.emplace_back(traits.name, MethodOptions{});
    if (traits.name != "cull-map") continue;
    ways.emplace_back(traits.name, MethodOptions{});
    ways.back().second.map = CullMapKind::kOrthographic;
  }
  return ways;
}

std::size_t misses(const Verifier& verifier, const Pvs& pvs) {
  const auto report = verifier.check(pvs, {});
  EXPECT_TRUE(report) << (report ? "" : report.error().message);
  return report ? report->false_negatives : 1;
}

TEST(ClustersContract, AMergedCityIsCulledAndNothingSeenIsLeftOut) {
  const test::ContractScene city = test::small_city();
  ASSERT_FALSE(city.eyes.empty());
  const Scene scene = split(merged(city.scene));
  ASSERT_EQ(scene.wholes.size(), 1U);
  ASSERT_GT(scene.objects.size(), 100U);
  for (const Reach& reach : {Reach::disc(1), Reach::cylinder(1.5, 0.1)}) {
    const OccluderSet set = shrunk(scene, reach);
    ASSERT_GT(set.shrunk.size(), 10U);
    const Verifier verifier(scene, &set);
    for (const Vec3& eye : city.eyes) {
      Pvs nothing;
      nothing.scene_hash = scene.hash;
      nothing.cell = {eye, reach};
      EXPECT_GT(misses(verifier, nothing), 10U) << "viewpoints count, and clusters are seen";
    }
    for (const auto& [name, options] : conservative_ways()) {
      const auto method = make_method(name, scene, set, options);
      ASSERT_TRUE(method) << method.error().message;
      std::vector<std::size_t> listed;
      for (const Vec3& eye : city.eyes) {
        SCOPED_TRACE(name + (options.map == CullMapKind::kPolar ? "" : ", orthographic") + ", " +
                     reach.to_string());
        const auto pvs = (*method)->solve({eye, reach});
        ASSERT_TRUE(pvs) << pvs.error().message;
        EXPECT_TRUE(pvs->everything_because.empty()) << pvs->everything_because;
        EXPECT_EQ(misses(verifier, *pvs), 0U);
        listed.push_back(pvs->objects.size());
      }
      std::sort(listed.begin(), listed.end());
      EXPECT_LT(2 * listed[listed.size() / 2], scene.objects.size());
    }
  }
}

// Closed meshes and grounds are looked for in what was there before the split.
TEST(ClustersContract, OccludersAreThoseOfTheWholeObjectsAndNothingSeenIsLeftOut) {
  const Reach reach = Reach::cylinder(1, 0.1);
  std::size_t scenes = 0;
  for (const test::ContractScene& s : test::analytic_scenes()) {
    const Scene scene = split(s.scene);
    if (scene.wholes.empty()) continue;
    ++scenes;
    SCOPED_TRACE(s.name);
    const OccluderSet before = shrunk(s.scene, reach);
    const OccluderSet set = shrunk(scene, reach);
    EXPECT_NE(set.scene_hash, before.scene_hash);
    EXPECT_EQ(set.solids.size(), before.solids.size());
    EXPECT_EQ(set.shrunk.size(), before.shrunk.size());
    EXPECT_EQ(set.solid_pieces.size(), before.solid_pieces.size());
    EXPECT_EQ(set.height_field.heights, before.height_field.heights);
    EXPECT_EQ(set.ground.empty(), before.ground.empty());
    EXPECT_EQ(set.floor, before.floor);
    EXPECT_EQ(set.slack_m, before.slack_m);
    const Verifier verifier(scene, &set, BlockerChoice::kOccluding);
    for (const auto& [name, options] : conservative_ways()) {
      const auto method = make_method(name, scene, set, options);
      ASSERT_TRUE(method) << method.error().message;
      for (const Vec3& eye : s.eyes) {
        const auto pvs = (*method)->solve({eye, reach});
        ASSERT_TRUE(pvs) << pvs.error().message;
        EXPECT_EQ(misses(verifier, *pvs), 0U) << name;
      }
    }
  }
  EXPECT_GE(scenes, 2U) << "hills of 1,800 triangles and more";
}

TEST(ClustersContract, OccludersOfTheOtherGranularityAreRefused) {
  const Scene whole = merged(test::random_town(1, false));
  const Scene scene = split(whole);
  const OccluderSet set = shrunk(whole, Reach::disc(1));
  const auto method = make_method("cull-map", scene, set, {});
  ASSERT_FALSE(method);
  EXPECT_EQ(method.error().code, ErrorCode::kMismatch);
}

}  // namespace
}  // namespace ivis
