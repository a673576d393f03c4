#include "scenes/generate_city.h"

#include <atomic>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/scenes/generated_scene.h"

namespace ivis {
namespace {

using test::distance_to;
using test::GroundCheck;
using test::least_cover;
using test::load_bytes;
using test::named;
using test::why_not_closed;
using test::world_triangles;

/// FNV-1a.
std::uint64_t hash_of(const std::string& bytes) {
  std::uint64_t h = 0xcbf29ce484222325ULL;
  for (const char c : bytes)
    h = (h ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return h;
}

CityOptions quarter(std::uint64_t seed, double relief_m) {
  CityOptions o;
  o.seed = seed;
  o.size_m = 500;
  o.buildings = 110;
  o.objects = 7000;
  o.triangles = 140'000;
  o.relief_m = relief_m;
  o.path.poses = 600;
  return o;
}

GroundCheck ground_of(const Scene& scene) {
  std::vector<Triangle> triangles;
  for (const Object* tile : named(scene, "ground_"))
    for (const Triangle& t : world_triangles(scene, *tile))
      triangles.push_back(t);
  return GroundCheck(triangles);
}

void expect_sound(const GeneratedScene& city, const CityOptions& options) {
  const Scene scene = load_bytes(city.glb);
  EXPECT_EQ(scene.object_count(), city.objects);
  EXPECT_EQ(scene.triangle_count, city.triangles);
  const auto buildings = named(scene, "building_");
  EXPECT_EQ(buildings.size(), city.buildings);

  const GroundCheck ground_check = ground_of(scene);
  EXPECT_EQ(ground_check.why_not_whole(), "");
  EXPECT_EQ(ground_check.lo(), Vec2(-options.size_m / 2));
  EXPECT_EQ(ground_check.hi(), Vec2(options.size_m / 2));
  for (const Object* o : buildings) {
    EXPECT_EQ(o->tag, OccluderTag::kAuto);
    EXPECT_EQ(why_not_closed(world_triangles(scene, *o)), "") << scene.name_of(*o);
    EXPECT_GT(least_cover(scene, *o, ground_check), 0.25) << scene.name_of(*o);
  }
  for (const char* part :
       {"window_", "door", "tree_", "lamp", "car", "bench", "roof_object", "balcony"})
    for (const Object* o : named(scene, part))
      ASSERT_EQ(o->tag, OccluderTag::kNever);
  EXPECT_FALSE(named(scene, "window_").empty());
  EXPECT_FALSE(named(scene, "tree_").empty());
  EXPECT_FALSE(named(scene, "lamp").empty());
  EXPECT_FALSE(named(scene, "car").empty());

  EXPECT_EQ(city.path.size(), options.path.poses);
  for (std::size_t i = 0; i < city.path.size(); ++i) {
    const Pose& pose = city.path[i];
    EXPECT_GE(distance_to(scene, buildings, ground(pose.eye)), options.path.clearance_m)
        << "pose " << i;
    EXPECT_NEAR(pose.eye.y - ground_check.height(ground(pose.eye)), options.path.eye_height_m, 1e-3)
        << "pose " << i;
    if (i == 0) continue;
    const double step = glm::length(ground(pose.eye - city.path[i - 1].eye));
    EXPECT_LE(step, options.path.step_m * 1.5) << "pose " << i;
    EXPECT_GT(pose.t, city.path[i - 1].t);
  }
}

TEST(GenerateCity, IsSoundWhateverTheSeedAndTheRelief) {
  for (const auto& [seed, relief] : {std::pair{1, 0.0}, {2, 0.0}, {3, 8.0}, {4, 25.0}}) {
    const CityOptions options = quarter(static_cast<std::uint64_t>(seed), relief);
    const auto city = generate_city(options);
    ASSERT_TRUE(city) << city.error().message;
    SCOPED_TRACE("seed " + std::to_string(seed));
    expect_sound(*city, options);
  }
}

TEST(GenerateCity, GivesTheSameBytesForTheSameSeedAndOthersForAnother) {
  const auto a = generate_city(quarter(7, 5));
  const auto b = generate_city(quarter(7, 5));
  const auto c = generate_city(quarter(8, 5));
  ASSERT_TRUE(a && b && c);
  EXPECT_EQ(hash_of(a->glb), hash_of(b->glb));
  EXPECT_NE(hash_of(a->glb), hash_of(c->glb));
  ASSERT_EQ(a->path.size(), b->path.size());
  for (std::size_t i = 0; i < a->path.size(); ++i)
    EXPECT_EQ(a->path[i].eye, b->path[i].eye);
}

TEST(GenerateCity, DefaultHasTheSizeItPromises) {
  const CityOptions options;
  const auto city = generate_city(options);
  ASSERT_TRUE(city) << city.error().message;
  EXPECT_GE(city->objects, 90'000U);
  EXPECT_LE(city->objects, 110'000U);
  EXPECT_GE(city->triangles, 1'700'000U);
  EXPECT_LE(city->triangles, 2'100'000U);
  EXPECT_GE(city->buildings, 1'400U);
  EXPECT_LE(city->buildings, 1'600U);
  expect_sound(*city, options);
}

TEST(GenerateCity, WindowsHangOnWalls) {
  const auto city = generate_city(quarter(5, 6));
  ASSERT_TRUE(city);
  const Scene scene = load_bytes(city->glb);
  const auto buildings = named(scene, "building_");
  std::size_t n = 0;
  for (const Object* o : named(scene, "window_")) {
    if (n++ % 7 != 0) continue;
    const Vec3 sill(o->to_world[3]);
    EXPECT_LT(distance_to(scene, buildings, ground(sill)), 0.01);
    // Half a metre out there is air: the window faces away from its house.
    const Vec3 out = glm::normalize(Vec3(o->to_world[2]));
    EXPECT_GT(distance_to(scene, buildings, ground(sill + out * 0.5)), 0.2);
  }
}

TEST(GenerateCity, RefusesOptionsOutOfRange) {
  CityOptions o;
  o.size_m = 10;
  const auto small = generate_city(o);
  ASSERT_FALSE(small);
  EXPECT_NE(small.error().message.find("size 10"), std::string::npos) << small.error().message;
  o = {};
  o.size_m = std::nan("");
  EXPECT_FALSE(generate_city(o));
  o = {};
  o.buildings = 0;
  EXPECT_FALSE(generate_city(o));
  o = {};
  o.relief_m = -1;
  EXPECT_FALSE(generate_city(o));
  o = {};
  o.path.poses = 0;
  EXPECT_FALSE(generate_city(o));
}

TEST(GenerateCity, StopsWhenToldTo) {
  const std::atomic<bool> stop{true};
  Context context;
  context.stop = &stop;
  const auto city = generate_city(quarter(1, 0), context);
  ASSERT_FALSE(city);
  EXPECT_EQ(city.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace ivis
