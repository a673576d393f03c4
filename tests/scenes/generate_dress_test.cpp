#include "scenes/generate_dress.h"

#include <atomic>

#include <gtest/gtest.h>

#include "scenes/load.h"
#include "scenes/random.h"
#include "tests/scenes/generated_scene.h"
#include "tests/support/scene_builder.h"
#include "tests/support/shared_data.h"

namespace ivis {
namespace {

using test::distance_to;
using test::GroundCheck;
using test::least_cover;
using test::load_bytes;
using test::SceneBuilder;
using test::world_triangles;

/// A house with a gable roof, turned; `flipped`: its winding is inside-out, as in some city data.
Mesh house(const Vec3& at, double length, double depth, double height, double c, double s,
           bool flipped) {
  Mesh m;
  const auto add = [&](double x, double y, double z) {
    m.positions.emplace_back(at.x + c * x - s * z, at.y + y, at.z + s * x + c * z);
  };
  for (const double x : {-length / 2, length / 2}) {
    add(x, 0, -depth / 2);
    add(x, 0, depth / 2);
    add(x, height, depth / 2);
    add(x, height + 3, 0);
    add(x, height, -depth / 2);
  }
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t d, std::uint32_t e) {
    m.indices.insert(m.indices.end(), {a, b, d, a, d, e});
  };
  for (std::uint32_t i = 0; i < 5; ++i)
    quad(i, (i + 1) % 5, 5 + (i + 1) % 5, 5 + i);
  m.indices.insert(m.indices.end(), {0, 4, 3, 0, 3, 2, 0, 2, 1, 5, 6, 7, 5, 7, 8, 5, 8, 9});
  if (!flipped)
    for (std::size_t t = 0; t < m.indices.size(); t += 3)
      std::swap(m.indices[t], m.indices[t + 1]);
  m.primitives = {{0, static_cast<std::uint32_t>(m.triangles()), true, true}};
  return m;
}

/// Gabled houses along two streets up a slope of one in eight, each on a level base.
Scene hill_village() {
  SceneBuilder builder;
  Random random(99);
  std::size_t n = 0;
  for (int row = 0; row < 4; ++row) {
    for (int i = 0; i < 8; ++i) {
      const double x = 26.0 * i + random.in(-2, 2);
      const double z = 30.0 * row + random.in(-1, 1);
      const double y = 300 + x / 8 - z / 20;
      const double length = random.in(10, 17);
      const double depth = random.in(8, 11);
      const double height = random.in(4, 12);
      const bool turned = random.chance(0.5);
      builder.add_mesh(house({x, y, z}, length, depth, height, turned ? 0.96 : 1, turned ? 0.28 : 0,
                             n % 3 == 0));
      builder.name_last("house_" + std::to_string(n++));
    }
  }
  return std::move(builder).finish();
}

void expect_sound(const Scene& in, const GeneratedScene& dressed, const DressOptions& options) {
  const Scene scene = load_bytes(dressed.glb);
  EXPECT_EQ(scene.object_count(), dressed.objects);
  EXPECT_EQ(scene.triangle_count, dressed.triangles);
  EXPECT_EQ(dressed.buildings, in.objects.size());
  ASSERT_GE(scene.object_count(), in.object_count());

  // The buildings come first and are what they were.
  std::vector<const Object*> buildings;
  for (std::size_t i = 0; i < in.objects.size(); ++i) {
    const Object& was = in.objects[i];
    const Object& is = scene.objects[i];
    buildings.push_back(&is);
    ASSERT_EQ(scene.name_of(is), in.name_of(was));
    ASSERT_EQ(is.tag, was.tag);
    ASSERT_EQ(is.to_world, was.to_world);
    const auto triangles_were = world_triangles(in, was);
    const auto triangles_are = world_triangles(scene, is);
    ASSERT_EQ(triangles_are.size(), triangles_were.size());
    for (std::size_t t = 0; t < triangles_are.size(); ++t) {
      ASSERT_EQ(triangles_are[t].a, triangles_were[t].a);
      ASSERT_EQ(triangles_are[t].b, triangles_were[t].b);
      ASSERT_EQ(triangles_are[t].c, triangles_were[t].c);
    }
  }

  std::vector<Triangle> tiles;
  for (const Object* tile : test::named(scene, "ground_"))
    for (const Triangle& t : world_triangles(scene, *tile))
      tiles.push_back(t);
  const GroundCheck ground_check(tiles);
  EXPECT_EQ(ground_check.why_not_whole(), "");
  const std::size_t stride = std::max<std::size_t>(1, buildings.size() / 500);
  for (std::size_t i = 0; i < buildings.size(); i += stride)
    EXPECT_GE(least_cover(scene, *buildings[i], ground_check), -1e-9)
        << scene.name_of(*buildings[i]);

  EXPECT_EQ(dressed.path.size(), options.path.poses);
  for (std::size_t i = 0; i < dressed.path.size(); ++i) {
    const Vec3 eye = dressed.path[i].eye;
    EXPECT_GE(distance_to(scene, buildings, ground(eye)), options.path.clearance_m) << "pose " << i;
    EXPECT_NEAR(eye.y - ground_check.height(ground(eye)), options.path.eye_height_m, 1e-3)
        << "pose " << i;
  }
}

TEST(GenerateDress, DressesAVillageOnASlope) {
  const Scene in = hill_village();
  DressOptions options;
  options.max_triangles = 60'000;
  options.path.poses = 500;
  const auto dressed = generate_dress(in, options);
  ASSERT_TRUE(dressed) << dressed.error().message;
  expect_sound(in, *dressed, options);
  EXPECT_LE(dressed->triangles, options.max_triangles);
  const Scene scene = load_bytes(dressed->glb);
  EXPECT_GT(test::named(scene, "window_").size(), 200U);
  EXPECT_GT(test::named(scene, "tree_").size(), 20U);
  EXPECT_GT(test::named(scene, "lamp").size(), 5U);
}

TEST(GenerateDress, WindowsHangOnWallsAndFaceOutWhateverTheWinding) {
  const Scene in = hill_village();
  const auto dressed = generate_dress(in, {});
  ASSERT_TRUE(dressed) << dressed.error().message;
  const Scene scene = load_bytes(dressed->glb);
  std::vector<const Object*> houses;
  for (std::size_t i = 0; i < in.objects.size(); ++i)
    houses.push_back(&scene.objects[i]);
  for (const Object* o : test::named(scene, "window_")) {
    const Vec3 sill(o->to_world[3]);
    EXPECT_LT(distance_to(scene, houses, ground(sill)), 0.05);
    EXPECT_GT(distance_to(scene, houses, ground(sill + glm::normalize(Vec3(o->to_world[2])) * 0.5)),
              0.2);
  }
}

TEST(GenerateDress, TheGroundFollowsTheBases) {
  // Not above a base by more than the houses nearby ask for: one house alone lies exactly on its
  // ground.
  SceneBuilder builder;
  builder.add_mesh(house({5, 123.25, 7}, 12, 9, 6, 1, 0, false));
  const Scene in = std::move(builder).finish();
  DressOptions options;
  options.path.poses = 50;
  const auto dressed = generate_dress(in, options);
  ASSERT_TRUE(dressed) << dressed.error().message;
  const Scene scene = load_bytes(dressed->glb);
  for (const Object* tile : test::named(scene, "ground_"))
    for (const Triangle& t : world_triangles(scene, *tile))
      for (const Vec3& p : {t.a, t.b, t.c})
        EXPECT_EQ(p.y, 123.25);
}

TEST(GenerateDress, KeepsWithinTheBudgetAndIsReproducible) {
  const Scene in = hill_village();
  for (const std::size_t budget : {6'000U, 20'000U}) {
    DressOptions options;
    options.path.poses = 20;
    options.max_triangles = budget;
    const auto a = generate_dress(in, options);
    const auto b = generate_dress(in, options);
    ASSERT_TRUE(a && b);
    EXPECT_LE(a->triangles, budget);
    EXPECT_EQ(a->glb, b->glb);
    options.seed = 2;
    const auto c = generate_dress(in, options);
    ASSERT_TRUE(c);
    EXPECT_NE(a->glb, c->glb);
  }
}

TEST(GenerateDress, RefusesAnEmptySceneAndOptionsOutOfRange) {
  EXPECT_FALSE(generate_dress(Scene{}, {}));
  DressOptions options;
  options.cell_m = 0;
  const auto bad = generate_dress(hill_village(), options);
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message.find("0.5 to 40"), std::string::npos) << bad.error().message;
}

TEST(GenerateDress, StopsWhenToldTo) {
  const std::atomic<bool> stop{true};
  Context context;
  context.stop = &stop;
  const auto dressed = generate_dress(hill_village(), {}, context);
  ASSERT_FALSE(dressed);
  EXPECT_EQ(dressed.error().code, ErrorCode::kCancelled);
}

TEST(GenerateDress, DressesTheCentreOfLinz) {
  IVIS_NEED_DATA(file, "linz/linz_centre_2km.glb");
  const auto in = load_scene(file);
  ASSERT_TRUE(in) << in.error().message;
  const DressOptions options;
  const auto dressed = generate_dress(*in, options);
  ASSERT_TRUE(dressed) << dressed.error().message;
  expect_sound(*in, *dressed, options);
  EXPECT_LE(dressed->triangles, options.max_triangles);
  EXPECT_GE(dressed->triangles, options.max_triangles * 9 / 10);
}

}  // namespace
}  // namespace ivis
