// Splitting large meshes into clusters: nothing is lost, nothing moves, ids stay dense.
#include "scenes/clusters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include <gtest/gtest.h>
#include <glm/gtc/matrix_transform.hpp>

#include "tests/scenes/gltf_file.h"

namespace ivis::test {
namespace {

/// A bumpy square of 2 n n triangles, its rows shuffled, in three primitives of different flags.
Mesh bumps(std::uint32_t n) {
  Mesh m;
  for (std::uint32_t z = 0; z <= n; ++z)
    for (std::uint32_t x = 0; x <= n; ++x)
      m.positions.emplace_back(x, std::sin(0.7F * static_cast<float>(x * z)), z);
  for (std::uint32_t k = 0; k < n; ++k) {
    const std::uint32_t z = k * 7 % n;
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = z * (n + 1) + x;
      const std::uint32_t c = a + n + 1;
      m.indices.insert(m.indices.end(), {a, c + 1, a + 1, a, c, c + 1});
    }
  }
  const auto third = static_cast<std::uint32_t>(m.triangles() / 3);
  m.primitives = {{0, third, true, true},
                  {third, 0, true, false},
                  {third, third, false, true},
                  {2 * third, static_cast<std::uint32_t>(m.triangles()) - 2 * third, true, false}};
  return m;
}

Object placed(std::uint32_t node, std::uint32_t instance, std::uint32_t mesh) {
  Object o;
  o.node = node;
  o.instance = instance;
  o.mesh = mesh;
  o.to_world = glm::rotate(glm::translate(Mat4(1), Vec3(3.3 * node, 0.1, 71.7 * instance)), 0.3,
                           Vec3(0, 1, 0));
  return o;
}

/// Two instances of a large mesh among small ones, a mover and a hidden solid of the large mesh.
Scene mixed() {
  Scene s;
  s.meshes = {bumps(4), bumps(31)};
  s.objects = {placed(0, 0, 0), placed(2, 0, 1), placed(2, 1, 1), placed(3, 0, 0), placed(5, 0, 1)};
  s.objects[4].always_visible = true;
  s.objects[4].tag = OccluderTag::kNever;
  s.hidden_solids = {placed(4, 0, 1)};
  EXPECT_TRUE(finish_scene(s));
  return s;
}

Scene split(Scene scene) {
  auto out = split_into_clusters(std::move(scene));
  EXPECT_TRUE(out) << (out ? "" : out.error().message);
  return out ? *std::move(out) : Scene{};
}

std::vector<std::pair<bool, bool>> flags(const Mesh& mesh) {
  std::vector<std::pair<bool, bool>> out;
  for (const Primitive& p : mesh.primitives)
    out.insert(out.end(), p.triangles, {p.opaque, p.double_sided});
  return out;
}

TEST(Clusters, HoldEveryTriangleOnceAndAreHalfFullOrMore) {
  for (const std::uint32_t n : {1U, 11U, 12U, 31U, 50U}) {
    const Mesh mesh = bumps(n);
    const auto clusters = cluster_triangles(mesh);
    std::vector<std::uint32_t> all;
    for (const auto& c : clusters) {
      EXPECT_TRUE(std::is_sorted(c.begin(), c.end()));
      EXPECT_LE(c.size(), kClusterTriangles);
      EXPECT_GE(c.size(), clusters.size() > 1 ? kClusterTriangles / 2 : 1);
      all.insert(all.end(), c.begin(), c.end());
    }
    std::sort(all.begin(), all.end());
    std::vector<std::uint32_t> expected(mesh.triangles());
    std::iota(expected.begin(), expected.end(), 0U);
    EXPECT_EQ(all, expected) << n;
  }
}

TEST(Clusters, KeepCornersToTheLastBitAndThePrimitivesFlags) {
  const Scene whole = mixed();
  const Scene s = split(whole);
  std::size_t at = 0;
  for (const Object& w : s.wholes) {
    const bool splits = w.mesh == 1 && !w.always_visible;
    const auto clusters = cluster_triangles(s.meshes[w.mesh]);
    const auto whole_flags = flags(s.meshes[w.mesh]);
    for (std::size_t k = 0; k < (splits ? clusters.size() : 1); ++k, ++at) {
      ASSERT_LT(at, s.objects.size());
      const Object& o = s.objects[at];
      const Mesh& mesh = s.mesh_of(o);
      const auto mine = flags(mesh);
      ASSERT_EQ(mesh.triangles(), splits ? clusters[k].size() : flags(s.meshes[w.mesh]).size());
      for (std::size_t t = 0; t < mesh.triangles(); ++t) {
        const std::size_t u = splits ? clusters[k][t] : t;
        const Triangle a = world_triangle(s, o, t);
        const Triangle b = world_triangle(s, w, u);
        ASSERT_TRUE(a.a == b.a && a.b == b.b && a.c == b.c) << at << " " << t;
        ASSERT_EQ(mine[t], whole_flags[u]);
        for (const Vec3& p : {a.a, a.b, a.c})
          ASSERT_TRUE(o.bounds.contains(p));
      }
    }
  }
  EXPECT_EQ(at, s.objects.size());
  EXPECT_EQ(s.triangle_count, whole.triangle_count);
  EXPECT_EQ(s.bounds.lo, whole.bounds.lo);
  EXPECT_EQ(s.bounds.hi, whole.bounds.hi);
}

TEST(Clusters, KeepIdsDenseInTheOrderOfNodeInstanceAndCluster) {
  const Scene s = split(mixed());
  const std::uint32_t k = static_cast<std::uint32_t>(cluster_triangles(bumps(31)).size());
  EXPECT_EQ(k, 8U);
  ASSERT_EQ(s.objects.size(), 2 * k + 3);
  std::vector<std::array<std::uint32_t, 3>> names;
  for (const Object& o : s.objects)
    names.push_back({o.node, o.instance, o.cluster});
  std::vector<std::array<std::uint32_t, 3>> expected{{0, 0, 0}};
  for (const std::uint32_t instance : {0U, 1U})
    for (std::uint32_t c = 0; c < k; ++c)
      expected.push_back({2, instance, c});
  expected.push_back({3, 0, 0});
  expected.push_back({5, 0, 0});
  EXPECT_EQ(names, expected);
  EXPECT_TRUE(s.objects.back().always_visible);
  EXPECT_EQ(s.objects.back().mesh, 1U) << "movers are not split";
  EXPECT_EQ(s.hidden_solids.size(), 1U) << "nor is what is never drawn";
  EXPECT_EQ(rank_order(s).size(), s.objects.size());
}

TEST(Clusters, AreSharedByInstances) {
  const Scene s = split(mixed());
  EXPECT_EQ(s.meshes.size(), 2U + 8);
  for (std::size_t c = 0; c < 8; ++c) {
    EXPECT_EQ(s.objects[1 + c].mesh, s.objects[9 + c].mesh);
    EXPECT_NE(s.objects[1 + c].to_world, s.objects[9 + c].to_world);
  }
}

TEST(Clusters, AreCompact) {
  const Mesh mesh = bumps(64);
  double area = 0;
  for (const auto& cluster : cluster_triangles(mesh)) {
    Aabb box;
    for (const std::uint32_t t : cluster)
      for (std::size_t k = 0; k < 3; ++k)
        box.add(Vec3(mesh.positions[mesh.indices[3 * t + k]]));
    area += box.size().x * box.size().z;
  }
  EXPECT_LT(area, 1.3 * 64 * 64);  // in the file's order: 7 times that
}

TEST(Clusters, AreTheSameEveryTimeAlsoWhenNothingTellsTrianglesApart) {
  EXPECT_EQ(split(mixed()).hash, split(mixed()).hash);
  Mesh same;
  same.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (int i = 0; i < 600; ++i)
    same.indices.insert(same.indices.end(), {0, 1, 2});
  same.primitives = {{0, 600, true, true}};
  const auto clusters = cluster_triangles(same);
  ASSERT_EQ(clusters.size(), 4U);
  EXPECT_EQ(clusters[0].front(), 0U);
  EXPECT_EQ(clusters[0].back(), 149U);
  EXPECT_EQ(clusters[3].back(), 599U);
}

TEST(Clusters, LeaveASceneWithoutALargeMeshAsItIs) {
  Scene s;
  s.meshes = {bumps(11)};
  s.objects = {placed(0, 0, 0), placed(1, 0, 0)};
  ASSERT_TRUE(finish_scene(s));
  const Scene same = split(s);
  EXPECT_EQ(same.hash, s.hash);
  EXPECT_EQ(same.whole_hash, s.hash);
  EXPECT_TRUE(same.wholes.empty());
  EXPECT_EQ(&sources(same), &same.objects);
}

TEST(Clusters, GiveTheSceneAHashOfItsOwnAndKeepTheWholesOne) {
  const Scene whole = mixed();
  const Scene s = split(whole);
  EXPECT_NE(s.hash, whole.hash);
  EXPECT_EQ(s.whole_hash, whole.hash);
  ASSERT_EQ(sources(s).size(), whole.objects.size());
  for (std::size_t i = 0; i < whole.objects.size(); ++i) {
    EXPECT_EQ(sources(s)[i].mesh, whole.objects[i].mesh);
    EXPECT_EQ(sources(s)[i].bounds.lo, whole.objects[i].bounds.lo);
  }
}

TEST(Clusters, RefuseMoreObjectsThanAMessageCanNameBeforeMakingThem) {
  Scene s;
  s.meshes = {bumps(91)};  // 16,562 triangles: 128 clusters
  const std::size_t k = cluster_triangles(s.meshes[0]).size();
  const std::size_t n = kMaxClusteredObjects / k + 1;
  for (std::uint32_t i = 0; i < n; ++i) {
    Object o;
    o.instance = i;
    s.objects.push_back(o);
  }
  ASSERT_TRUE(finish_scene(s));
  const auto out = split_into_clusters(std::move(s));
  ASSERT_FALSE(out);
  EXPECT_EQ(out.error().code, ErrorCode::kInput);
  EXPECT_NE(out.error().message.find(std::to_string(n * k) + " clusters, expected at most 4194304"),
            std::string::npos)
      << out.error().message;
}

TEST(Granularity, IsReadAndRefused) {
  EXPECT_EQ(*parse_granularity("object"), Granularity::kObject);
  EXPECT_EQ(*parse_granularity("cluster"), Granularity::kCluster);
  for (const char* bad : {"", "Cluster", "clusters", "triangle"}) {
    const auto g = parse_granularity(bad);
    ASSERT_FALSE(g) << bad;
    EXPECT_NE(g.error().message.find("expected object or cluster"), std::string::npos);
  }
}

class LoadClusters : public GltfFolder {};

TEST_F(LoadClusters, SplitsWhenAskedTo) {
  GltfFile f;
  const Mesh mesh = bumps(12);  // 288 triangles
  std::vector<float> positions;
  for (const auto& p : mesh.positions)
    positions.insert(positions.end(), {p.x, p.y, p.z});
  f.add_node({{"mesh", f.add_mesh(f.add_accessor_of(positions, kFloat, "VEC3"),
                                  f.add_accessor_of(mesh.indices, kUnsignedInt, "SCALAR"))}});
  const auto whole = load(f);
  IVIS_ASSERT_OK(whole);
  SceneOptions options;
  options.granularity = Granularity::kCluster;
  const auto s = load(f, options);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(whole->objects.size(), 1U);
  EXPECT_EQ(s->objects.size(), 2U);
  EXPECT_EQ(s->whole_hash, whole->hash);
}

}  // namespace
}  // namespace ivis::test
