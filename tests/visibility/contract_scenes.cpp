#include "tests/visibility/contract_scenes.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <unistd.h>
#include <glm/gtc/matrix_transform.hpp>

#include "core/assert.h"
#include "core/path.h"
#include "scenes/generate_city.h"
#include "scenes/load.h"
#include "tests/support/scene_builder.h"

namespace ivis::test {
namespace {

const Vec3 kNowhere{std::numeric_limits<double>::quiet_NaN()};

void add_block(SceneBuilder& b, const Vec3& lo, const Vec3& hi, const Vec3& origin = Vec3{0}) {
  b.add_box(origin + lo, origin + hi);
}

/// Small boxes in a grid about the origin, in three heights; those low down stand on `floor`.
void add_clutter(SceneBuilder& b, const Vec3& origin = Vec3{0}, double floor = 0) {
  for (int x = -90; x <= 90; x += 9)
    for (int z = -90; z <= 90; z += 9)
      for (const double y : {floor, floor + 6, floor + 21})
        if (y < floor + 7 || (x + z) % 4 == 0) {
          const Vec3 lo = origin + Vec3{x + 0.1 * (z % 7), y + 0.01, z + 0.1 * (x % 5)};
          b.add_box(lo, lo + Vec3{0.5}, OccluderTag::kNever);
        }
}

Mesh gabled_house(const Vec3& lo, const Vec3& hi, double ridge) {
  Mesh m;
  const double middle = (lo.z + hi.z) / 2;
  for (const double x : {lo.x, hi.x})
    for (const Vec2& p :
         {Vec2{lo.y, lo.z}, {hi.y, lo.z}, {ridge, middle}, {hi.y, hi.z}, {lo.y, hi.z}})
      m.positions.emplace_back(x, p.x, p.y);
  for (std::uint32_t i = 0; i < 5; ++i) {
    const std::uint32_t j = (i + 1) % 5;
    m.indices.insert(m.indices.end(), {i, 5 + j, 5 + i, i, j, 5 + j});
  }
  for (std::uint32_t i = 1; i < 4; ++i)
    m.indices.insert(m.indices.end(), {0, i + 1, i, 5, 5 + i, 5 + i + 1});
  m.primitives = {{0, static_cast<std::uint32_t>(m.triangles()), true, true}};
  return m;
}

/// A height field that falls along x, over 200 m about the origin.
Mesh slope(double fall) {
  constexpr std::uint32_t kCells = 20;
  Mesh m;
  for (std::uint32_t i = 0; i <= kCells; ++i)
    for (std::uint32_t k = 0; k <= kCells; ++k) {
      const double x = -100 + 10.0 * i;
      m.positions.emplace_back(x, -fall * x, -100 + 10.0 * k);
    }
  for (std::uint32_t i = 0; i < kCells; ++i)
    for (std::uint32_t k = 0; k < kCells; ++k) {
      const std::uint32_t a = i * (kCells + 1) + k;
      const std::uint32_t c = a + kCells + 1;
      m.indices.insert(m.indices.end(), {a, a + 1, c + 1, a, c + 1, c});
    }
  m.primitives = {{0, static_cast<std::uint32_t>(m.triangles()), true, true}};
  return m;
}

/// A game map's crates: matter that is not drawn, and six drawn faces over it, each an object.
void add_crate(SceneBuilder& b, const Vec3& lo, const Vec3& hi, const Mat4& turn) {
  Mesh crate;
  for (int i = 0; i < 8; ++i)
    crate.positions.emplace_back((i & 1) != 0 ? hi.x : lo.x, (i & 2) != 0 ? hi.y : lo.y,
                                 (i & 4) != 0 ? hi.z : lo.z);
  for (glm::vec3& p : crate.positions)
    p = glm::vec3(turn * glm::dvec4(Vec3(p), 1.0));
  constexpr std::uint32_t kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                          {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& f : kFaces) {
    Mesh face;
    for (const std::uint32_t corner : f)
      face.positions.push_back(crate.positions[corner]);
    face.indices = {0, 1, 2, 0, 2, 3};
    face.primitives = {{0, 2, true, true}};
    b.add_mesh(std::move(face), OccluderTag::kNever);
    crate.indices.insert(crate.indices.end(), {f[0], f[1], f[2], f[0], f[2], f[3]});
  }
  crate.primitives = {{0, 12, true, true}};
  b.add_mesh(std::move(crate), OccluderTag::kOnly);
}

double hills(double x, double z) {
  return 14 * std::sin(x / 22) * std::cos(z / 27 + 0.4);
}

/// Part of a grid of 5 m cells over the hills, `i`, `k` from -30 to 30; cells in `hole` left out.
template <class Hole>
Mesh hills_tile(int i0, int k0, int i1, int k1, const Hole& hole) {
  Mesh m;
  for (int k = k0; k <= k1; ++k)
    for (int i = i0; i <= i1; ++i)
      m.positions.emplace_back(5 * i, hills(5 * i, 5 * k), 5 * k);
  const int row = i1 - i0 + 1;
  for (int k = k0; k < k1; ++k)
    for (int i = i0; i < i1; ++i) {
      if (hole(i, k)) continue;
      const auto a = static_cast<std::uint32_t>((k - k0) * row + i - i0);
      const auto c = a + static_cast<std::uint32_t>(row);
      m.indices.insert(m.indices.end(), {a, c + 1, a + 1, a, c, c + 1});
    }
  m.primitives = {{0, static_cast<std::uint32_t>(m.triangles()), true, true}};
  return m;
}

/// Buildings on hills. `ragged`: in four tiles, with a slanted border and a hole, through which one
/// sees what lies under the ground.
ContractScene hilly(bool ragged);

ContractScene finished(std::string name, SceneBuilder builder, std::vector<Vec3> eyes,
                       const Vec3& in_solid) {
  ContractScene out{std::move(name), std::move(builder).finish(), std::move(eyes), in_solid, 0};
  // The clutter is added last: its last box is in a far corner.
  out.mover = static_cast<ObjectId>(out.scene.objects.size() - 1);
  out.scene.objects[out.mover].always_visible = true;
  out.scene.objects[out.mover].tag = OccluderTag::kNever;
  EXPECT_TRUE(finish_scene(out.scene));
  return out;
}

ContractScene hilly(bool ragged) {
  SceneBuilder b;
  const auto hole = [&](int i, int k) {
    return ragged && (i + k > 44 || i - k > 48 || (i >= 6 && i < 9 && k >= -3 && k < 2));
  };
  if (ragged) {
    for (const int i : {-30, 0})
      for (const int k : {-30, 0})
        b.add_mesh(hills_tile(i, k, i + 30, k + 30, hole));
    b.add_box({48, -30, -6}, {52, -26, -2}, OccluderTag::kNever);
    b.add_box({60, -40, -10}, {70, -30, 10}, OccluderTag::kNever);
  } else {
    b.add_mesh(hills_tile(-30, -30, 30, 30, hole));
  }
  for (const Vec2& p : {Vec2{-40, -30}, {-10, 40}, {60, 50}, {-80, 20}}) {
    const double y = hills(p.x, p.y);
    b.add_box({p.x, y - 8, p.y}, {p.x + 18, y + 12, p.y + 14});
  }
  for (int x = -145; x <= 145; x += 10)
    for (int z = -145; z <= 145; z += 10) {
      const double y = hills(x, z) + ((x + z) % 40 == 0 ? 9 : 0.3);
      const Vec3 lo{x + 0.1 * (z % 7), y, z + 0.1 * (x % 5)};
      b.add_box(lo, lo + Vec3{0.5}, OccluderTag::kNever);
    }
  const auto above = [](double x, double z, double y) { return Vec3{x, hills(x, z) + y, z}; };
  return finished(
      ragged ? "ragged hills in tiles" : "buildings on hills", std::move(b),
      {above(0, 0, 1.7), above(33, 3, 1.2), above(-60, -70, 25), above(141, 100, 2), {180, 30, 20}},
      {-31, hills(-40, -30) + 2, -23});
}

}  // namespace

std::vector<ContractScene> analytic_scenes() {
  std::vector<ContractScene> all;
  const Vec3 street{0, 1.7, 0};
  {
    SceneBuilder b;
    add_block(b, {10, 0, -60}, {16, 20, 60});
    add_clutter(b);
    all.push_back(finished("one wall", std::move(b),
                           {street, {6, 1.7, 30}, {0, 40, 0}, {-60, 19, -50}}, {13, 5, 0}));
  }
  for (const Vec3& origin : {Vec3{0}, Vec3{10000, 50, -10000}}) {
    SceneBuilder b;
    add_block(b, {10, 0, -60}, {16, 20, 0}, origin);
    add_block(b, {10, 0, 0}, {16, 18, 60}, origin);
    add_clutter(b, origin);
    all.push_back(finished(origin.x > 0 ? "10 km from the origin" : "two walls that fuse",
                           std::move(b), {origin + street, origin + Vec3{7, 1.7, 0}},
                           origin + Vec3{13, 5, 20}));
  }
  for (const double gap : {0.6, 3.0}) {
    SceneBuilder b;
    add_block(b, {10, 0, -60}, {16, 20, -gap / 2});
    add_block(b, {10, 0, gap / 2}, {16, 20, 60});
    add_clutter(b);
    all.push_back(
        finished(gap < 1 ? "slit narrower than twice the reach" : "slit wider than twice the reach",
                 std::move(b), {street, {5, 1.7, 0.2}}, {13, 5, 20}));
  }
  {
    SceneBuilder b;
    add_block(b, {10, 3, -60}, {16, 20, 60});
    add_clutter(b);
    all.push_back(
        finished("floating slab", std::move(b), {street, {0, 10, 0}, {0, 30, 0}}, {13, 12, 0}));
  }
  for (const bool ground : {false, true}) {
    SceneBuilder b;
    add_block(b, {10, -2, -40}, {22, 14, 40});
    add_block(b, {-40, 2, -40}, {-28, 16, 40});
    if (ground) b.add_mesh(slope(0.1));
    add_clutter(b, Vec3{0}, ground ? 0 : -9);
    all.push_back(
        finished(ground ? "building on a slope with ground" : "building on a slope without ground",
                 std::move(b), {{0, 1.8, 0}, {60, -3, 10}}, {16, 5, 0}));
  }
  {
    SceneBuilder b;
    add_block(b, {-30, 0, -30}, {30, 15, -20});
    add_block(b, {-30, 0, 20}, {30, 15, 30});
    add_block(b, {-30, 0, -20}, {-20, 15, 20});
    add_block(b, {20, 0, -20}, {30, 12, 20});
    add_clutter(b);
    all.push_back(finished("courtyard", std::move(b),
                           {street, {15, 1.7, 15}, {0, 1.7, 50}, {0, 30, 0}}, {25, 5, 0}));
  }
  {
    SceneBuilder b;
    for (int i = 0; i < 4; ++i) {
      const double x = -50 + 26 * i;
      b.add_mesh(gabled_house({x, 0, 8}, {x + 20, 7, 20}, 12));
      b.add_mesh(gabled_house({x, 0, -20}, {x + 20, 6, -8}, 10));
    }
    add_clutter(b);
    all.push_back(
        finished("gabled houses", std::move(b), {street, {-27, 1.7, 0}, {0, 9, 0}}, {-20, 3, 14}));
  }
  {
    SceneBuilder b;
    for (int i = 0; i < 40; ++i) {
      const Vec3 lo{-50 + i * 37 % 100, i % 3 * 0.5, -50 + i * 53 % 100};
      const Mat4 turn = i % 4 == 3 ? glm::rotate(Mat4{1}, 0.3 * i, Vec3{0, 1, 0}) : Mat4{1};
      add_crate(b, lo, lo + Vec3{2 + i % 5, 2 + i % 2, 3}, turn);
    }
    all.push_back(finished("crates with drawn faces", std::move(b),
                           {{0.5, 1.7, 0.5}, {0.5, 12, 40}, {-60, 0.2, 3}}, {-49, 1, -48.5}));
  }
  all.push_back(hilly(false));
  all.push_back(hilly(true));
  return all;
}

ContractScene small_city() {
  CityOptions options;
  options.size_m = 250;
  options.buildings = 40;
  options.objects = 3000;
  options.triangles = 60'000;
  options.path.poses = 60;
  ContractScene out;
  out.name = "generated city";
  out.in_solid = kNowhere;
  const auto city = generate_city(options);
  EXPECT_TRUE(city) << (city ? "" : city.error().message);
  if (!city) return out;
  const auto file = std::filesystem::temp_directory_path() /
                    ("ivis_contract_" + std::to_string(getpid()) + ".glb");
  EXPECT_TRUE(write_file_whole(file, city->glb));
  auto scene = load_scene(file);
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  EXPECT_TRUE(scene) << (scene ? "" : scene.error().message);
  if (!scene) return out;
  out.scene = std::move(*scene);
  for (std::size_t i = 0; i < city->path.size(); i += 20)
    out.eyes.push_back(city->path[i].eye);
  out.eyes.push_back(city->path[0].eye + Vec3{0, 60, 0});
  return out;
}

Scene random_town(unsigned seed, bool floating) {
  std::mt19937 rng(seed);
  const auto uniform = [&](double a, double b) {
    return a + (b - a) * static_cast<double>(rng()) / 4294967296.0;
  };
  SceneBuilder builder;
  for (int i = 0; i < 60; ++i) {
    const Vec2 at{uniform(-150, 150), uniform(-150, 150)};
    const double angle = uniform(0, 7);
    const double a = uniform(4, 25);
    const double b = uniform(4, 12);
    const double bottom = floating ? uniform(-6, 4) : 0;
    const double top = bottom + uniform(3, 25);
    if (glm::length(at) < 32) continue;
    std::vector<Vec2> ring;
    for (const Vec2 c : {Vec2{-a, -b}, Vec2{a, -b}, Vec2{a, b}, Vec2{-a, b}})
      ring.push_back(at + Vec2{std::cos(angle) * c.x - std::sin(angle) * c.y,
                               std::sin(angle) * c.x + std::cos(angle) * c.y});
    builder.add_prism(ring, bottom, top);
  }
  for (int i = 0; i < 1500; ++i) {
    const Vec3 at{uniform(-200, 200), uniform(floating ? -6 : 0.3, 12), uniform(-200, 200)};
    const double half = uniform(0.1, 0.3);
    builder.add_box(at - half, at + half, OccluderTag::kNever);
  }
  return std::move(builder).finish();
}

Scene moved(const Scene& scene, const Mat4& motion) {
  Scene out;
  out.meshes = scene.meshes;
  out.node_names = scene.node_names;
  for (Object o : scene.objects) {
    o.to_world = motion * o.to_world;
    out.objects.push_back(o);
  }
  const auto finished = finish_scene(out);
  IVIS_ASSERT(finished, "a moved scene is sound");
  return out;
}

}  // namespace ivis::test
