#include "occluders/ground.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using ::testing::HasSubstr;
using Height = std::function<double(double x, double z)>;

/// Grid of cells x cells squares, two triangles each, over [x0, x1] x [z0, z1], facing up.
Mesh grid(double x0, double z0, double x1, double z1, unsigned cells, const Height& height) {
  Mesh mesh;
  for (unsigned i = 0; i <= cells; ++i)
    for (unsigned j = 0; j <= cells; ++j) {
      const double x = x0 + (x1 - x0) * i / cells;
      const double z = z0 + (z1 - z0) * j / cells;
      mesh.positions.emplace_back(x, height(x, z), z);
    }
  const auto id = [&](unsigned i, unsigned j) { return i * (cells + 1) + j; };
  for (unsigned i = 0; i < cells; ++i)
    for (unsigned j = 0; j < cells; ++j)
      for (const unsigned v :
           {id(i, j), id(i, j + 1), id(i + 1, j), id(i + 1, j), id(i, j + 1), id(i + 1, j + 1)})
        mesh.indices.push_back(v);
  mesh.primitives.push_back({0, static_cast<std::uint32_t>(mesh.triangles())});
  return mesh;
}

double flat(double, double) {
  return 0;
}
double hills(double x, double z) {
  return 10 * std::sin(x / 10) + 5 * std::cos(z / 7);
}

struct Answer {
  std::optional<Ground> ground;
  std::string said;
};

Answer find(const Scene& scene) {
  Answer answer;
  Context context;
  context.log = [&](std::string_view line) { answer.said += std::string(line) + "\n"; };
  answer.ground = find_ground(scene, context);
  return answer;
}

Answer find(std::vector<Mesh> meshes) {
  test::SceneBuilder builder;
  for (Mesh& mesh : meshes)
    builder.add_mesh(std::move(mesh));
  return find(std::move(builder).finish());
}

Polygon rectangle(double x0, double z0, double x1, double z1) {
  return {{{{x0, z0}, {x1, z0}, {x1, z1}, {x0, z1}}}};
}

/// Four tiles of 50 m about the origin, `change` applied to the last.
std::vector<Mesh> tiles(const Height& height, const std::function<void(Mesh&)>& change = {}) {
  std::vector<Mesh> result{grid(-50, -50, 0, 0, 8, height), grid(-50, 0, 0, 50, 8, height),
                           grid(0, -50, 50, 0, 8, height), grid(0, 0, 50, 50, 8, height)};
  if (change) change(result.back());
  return result;
}

TEST(FindGround, TakesATilingThatMatches) {
  for (const Height& height : {Height(flat), Height(hills)}) {
    const Answer a = find(tiles(height));
    ASSERT_TRUE(a.ground) << a.said;
    EXPECT_EQ(a.ground->triangle_count(), 4U * 128);
    EXPECT_EQ(a.ground->objects(), (std::vector<ObjectId>{0, 1, 2, 3}));
    EXPECT_EQ(a.ground->rectangle().lo.x, -50);
    EXPECT_EQ(a.ground->rectangle().hi.z, 50);
  }
}

TEST(FindGround, TakesOneQuadAndATiltedPlane) {
  test::SceneBuilder builder;
  builder.add_ground({-10, -20}, {30, 40}, 3);
  EXPECT_TRUE(find(std::move(builder).finish()).ground);
  EXPECT_TRUE(find({grid(0, 0, 10, 10, 1, [](double x, double z) { return 3 * x - z; })}).ground);
}

TEST(FindGround, JoinsInstancesOfOneTileByTheirWorldPositions) {
  test::SceneBuilder builder;
  for (const double x : {0.0, 64.0})
    for (const double z : {-64.0, 0.0}) {
      Mat4 place{1};
      place[3] = {x, 0, z, 1};
      builder.add_mesh(grid(0, 0, 64, 64, 4, flat), OccluderTag::kAuto, place);
    }
  const Answer a = find(std::move(builder).finish());
  ASSERT_TRUE(a.ground) << a.said;
  EXPECT_EQ(a.ground->rectangle().hi.x, 128);
}

TEST(FindGround, MinusZeroIsZero) {
  EXPECT_TRUE(find(tiles(flat, [](Mesh& m) {
                for (auto& p : m.positions) {
                  if (p.x == 0) p.x = -0.0F;
                  if (p.y == 0) p.y = -0.0F;
                }
              })).ground);
}

TEST(FindGround, RefusesACrackOfAMillimetre) {
  const auto moved = [](glm::vec3 by) {
    return find(tiles(hills, [by](Mesh& m) {
      for (auto& p : m.positions)
        p += by;
    }));
  };
  for (const glm::vec3& by :
       {glm::vec3{0.001F, 0, 0}, glm::vec3{0, 0.001F, 0}, glm::vec3{0, 0, 0.001F}})
    EXPECT_FALSE(moved(by).ground);
  EXPECT_TRUE(moved({0, 0, 0}).ground);
}

TEST(FindGround, RefusesACrackWithinAPieceThatHangsTogetherElsewhere) {
  const Answer a = find({grid(-50, -50, 0, 50, 2, flat), [] {
                           Mesh m = grid(0, -50, 50, 50, 2, flat);
                           m.positions[1].y -= 0.001F;  // the middle of the seam
                           return m;
                         }()});
  EXPECT_FALSE(a.ground);
  // Three squares in an L hang together; the fourth one hangs on one of its two sides only.
  Mesh mesh = grid(-50, -50, 50, 50, 4, flat);
  const auto centre = static_cast<std::uint32_t>(2 * 5 + 2);
  mesh.positions.push_back(mesh.positions[centre] - glm::vec3{0, 0.001F, 0});
  for (std::size_t k = 0; k < mesh.indices.size() && mesh.indices[k] != mesh.positions.size() - 1;
       ++k)
    if (mesh.indices[k] == centre) {
      mesh.indices[k] = static_cast<std::uint32_t>(mesh.positions.size() - 1);
      break;
    }
  const Answer b = find({mesh});
  EXPECT_FALSE(b.ground);
  EXPECT_THAT(b.said, HasSubstr("is open inside"));
}

TEST(FindGround, RefusesATJunction) {
  // The right half's seam has a corner in the middle that the left half's has not.
  EXPECT_FALSE(find({grid(-50, -50, 0, 50, 1, flat), grid(0, -50, 50, 50, 2, flat)}).ground);
  // The same inside one connected piece: the seam's upper half matches, its lower half does not.
  Mesh mesh;
  mesh.positions = {{0, 0, 0},   {10, 0, 0}, {20, 0, 0},  {0, 0, 10},  {10, 0, 10},
                    {20, 0, 10}, {0, 0, 20}, {10, 0, 20}, {20, 0, 20}, {10, 0, 15}};
  mesh.indices = {0, 3, 1, 1, 3, 4, 1, 4, 2, 2, 4, 5,  // the upper row
                  3, 6, 4, 4, 6, 7,                    // lower left: whole edge 4 - 7
                  4, 9, 5, 9, 8, 5, 9, 7, 8};          // lower right: edges 4 - 9 and 9 - 7
  mesh.primitives = {{0, 9}};
  const Answer a = find({mesh});
  EXPECT_FALSE(a.ground);
  EXPECT_THAT(a.said, HasSubstr("is open inside"));
}

TEST(FindGround, RefusesAHole) {
  const Answer a = find({[] {
    Mesh m = grid(0, 0, 100, 100, 10, hills);
    m.indices.erase(m.indices.begin() + 3 * 90, m.indices.begin() + 3 * 91);
    m.primitives[0].triangles -= 1;
    return m;
  }()});
  EXPECT_FALSE(a.ground);
  EXPECT_THAT(a.said, HasSubstr("is open inside"));
}

TEST(FindGround, RefusesAMissingCornerOfTheRectangle) {
  EXPECT_FALSE(find(tiles(flat, [](Mesh& m) {
                 m.indices.clear();
                 m.primitives.clear();
               })).ground);
}

TEST(FindGround, RefusesAnOverlap) {
  EXPECT_FALSE(find(tiles(flat, [](Mesh& m) {
                 for (auto& p : m.positions)
                   p.x -= 1;
               })).ground);
  // Laid twice, tile upon tile.
  std::vector<Mesh> twice = tiles(hills);
  twice.push_back(twice[0]);
  const Answer a = find(twice);
  EXPECT_FALSE(a.ground);
  EXPECT_THAT(a.said, HasSubstr("folds over itself"));
  // A flap on an edge inside: a third triangle.
  std::vector<Mesh> flap = tiles(flat);
  Mesh extra;
  extra.positions = {{0, 0, 0}, {6.25F, 0, 0}, {3, 2, 1}};
  extra.indices = {0, 1, 2};
  extra.primitives = {{0, 1}};
  flap.push_back(extra);
  const Answer b = find(flap);
  EXPECT_FALSE(b.ground);
  EXPECT_THAT(b.said, HasSubstr("belongs to 3 triangles"));
}

TEST(FindGround, RefusesAFold) {
  // A sheet that hangs together and whose border is the rectangle's, but runs back over itself
  // inside.
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {0, 0, 10}, {6, 1, 0},  {6, 1, 10},
                    {4, 2, 0}, {4, 2, 10}, {10, 3, 0}, {10, 3, 10}};
  mesh.indices = {0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5, 4, 5, 6, 6, 5, 7};
  mesh.primitives = {{0, 6}};
  test::SceneBuilder builder;
  // As three objects, so that none covers more than its own rectangle.
  for (std::uint32_t part = 0; part < 3; ++part) {
    Mesh m = mesh;
    m.indices.assign(mesh.indices.begin() + 6 * part, mesh.indices.begin() + 6 * part + 6);
    m.primitives = {{0, 2}};
    builder.add_mesh(m);
  }
  const Answer a = find(std::move(builder).finish());
  EXPECT_FALSE(a.ground);
  EXPECT_THAT(a.said, HasSubstr("folds over itself"));
}

TEST(FindGround, RefusesATransparentTile) {
  EXPECT_FALSE(find(tiles(flat, [](Mesh& m) { m.primitives[0].opaque = false; })).ground);
}

TEST(FindGround, RefusesWhatIsNotDrawnOrMoves) {
  const auto with = [](const std::function<void(Scene&)>& change) {
    test::SceneBuilder builder;
    for (Mesh& mesh : tiles(flat))
      builder.add_mesh(std::move(mesh));
    builder.add_box({-50, 0, -50}, {50, 1, 50});  // keeps the scene's rectangle
    Scene scene = std::move(builder).finish();
    change(scene);
    return find(scene).ground.has_value();
  };
  EXPECT_TRUE(with([](Scene&) {}));
  EXPECT_FALSE(with([](Scene& s) { s.objects[2].always_visible = true; }));
  EXPECT_FALSE(with([](Scene& s) {
    s.hidden_solids.push_back(s.objects[0]);
    s.objects.erase(s.objects.begin());
  }));
}

TEST(FindGround, HonoursSidednessWhenAsked) {
  const auto with = [](bool honour, bool double_sided, bool facing_up, bool mirrored) {
    Mesh m = grid(0, 0, 10, 10, 2, flat);
    m.primitives[0].double_sided = double_sided;
    if (!facing_up)
      for (std::size_t t = 0; t < m.indices.size(); t += 3)
        std::swap(m.indices[t], m.indices[t + 1]);
    Mat4 place{1};
    if (mirrored) place[0][0] = -1;
    test::SceneBuilder builder;
    builder.add_mesh(m, OccluderTag::kAuto, place);
    Scene scene = std::move(builder).finish();
    scene.honour_sidedness = honour;
    return find(scene).ground.has_value();
  };
  EXPECT_TRUE(with(true, false, true, false));
  EXPECT_FALSE(with(true, false, false, false));
  EXPECT_TRUE(with(true, true, false, false));
  EXPECT_TRUE(with(false, false, false, false));
  EXPECT_TRUE(with(true, false, true, true)) << "a mirrored tile still faces up";
  EXPECT_FALSE(with(true, false, false, true));
}

TEST(FindGround, StrayPlatesAndBuildingsDoNotSpoilIt) {
  test::SceneBuilder builder;
  builder.add_ground({5, 5}, {15, 15}, 30);  // a plate on the roof
  builder.add_box({5, -1, 5}, {15, 29, 15});
  for (Mesh& mesh : tiles(hills))
    builder.add_mesh(std::move(mesh));
  builder.add_ground({-20, -20}, {-19, -19}, 40);
  Mesh cone;  // open below: no steep triangle, and one layer
  cone.positions = {{0, 40, 0}, {-1, 38, -1}, {-1, 38, 1}, {1, 38, 1}, {1, 38, -1}};
  cone.indices = {0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1};
  cone.primitives = {{0, 4}};
  builder.add_mesh(cone);
  const Answer a = find(std::move(builder).finish());
  ASSERT_TRUE(a.ground) << a.said;
  EXPECT_EQ(a.ground->objects(), (std::vector<ObjectId>{2, 3, 4, 5}));
}

TEST(FindGround, ACanopyOrACeilingIsNoGround) {
  test::SceneBuilder canopy;
  canopy.add_ground({0, 0}, {20, 20}, 5);
  canopy.add_box({-50, 0, -50}, {50, 1, -40});
  const Answer a = find(std::move(canopy).finish());
  EXPECT_FALSE(a.ground);
  EXPECT_THAT(a.said, HasSubstr("covers"));

  test::SceneBuilder room;
  room.add_box({1, 0, 1}, {2, 1, 2});
  room.add_ground({0, 0}, {20, 20}, 5);
  const Answer b = find(std::move(room).finish());
  EXPECT_FALSE(b.ground);
  EXPECT_THAT(b.said, HasSubstr("ceiling"));

  test::SceneBuilder floor;
  floor.add_box({1, 0, 1}, {2, 1, 2});
  floor.add_ground({0, 0}, {20, 20}, 5);
  floor.add_ground({0, 0}, {20, 20}, 0);
  const Answer c = find(std::move(floor).finish());
  ASSERT_TRUE(c.ground) << c.said;
  EXPECT_EQ(c.ground->rectangle().lo.y, 0);
}

TEST(FindGround, AnEmptySceneHasNone) {
  EXPECT_FALSE(find(std::vector<Mesh>{}).ground);
  test::SceneBuilder builder;
  builder.add_box({0, 0, 0}, {1, 1, 1});
  EXPECT_FALSE(find(std::move(builder).finish()).ground);
}

TEST(Ground, GivesTheHeightOfItsTriangles) {
  const Answer a = find(tiles([](double x, double z) { return 0.5 * x - 0.25 * z; }));
  ASSERT_TRUE(a.ground);
  for (const Vec2& p : {Vec2{0, 0}, Vec2{-50, -50}, Vec2{50, 50}, Vec2{13.7, -48.1}, Vec2{0, 21.3}})
    EXPECT_NEAR(a.ground->height_at(p.x, p.y), 0.5 * p.x - 0.25 * p.y, 1e-9);
  for (const Vec2& p :
       {Vec2{50.001, 0}, Vec2{0, -50.001}, Vec2{std::numeric_limits<double>::quiet_NaN(), 0}})
    EXPECT_EQ(a.ground->height_at(p.x, p.y), -std::numeric_limits<double>::infinity());
}

TEST(GroundCovers, FlatGroundAtTheFootprintsBaseExactly) {
  const Answer a = find(tiles(flat));
  ASSERT_TRUE(a.ground);
  EXPECT_TRUE(a.ground->covers_at_or_above(rectangle(-5, -5, 5, 5), 0));
  EXPECT_TRUE(a.ground->covers_at_or_above(rectangle(-5, -5, 5, 5), -1));
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(-5, -5, 5, 5), 1e-6));
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(-5, -5, 5, 5),
                                            std::numeric_limits<double>::quiet_NaN()));
}

TEST(GroundCovers, TheFootprintMustLieWithinTheRectangle) {
  const Answer a = find(tiles(flat));
  ASSERT_TRUE(a.ground);
  EXPECT_TRUE(a.ground->covers_at_or_above(rectangle(40, 40, 50, 50), -1));
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(40, 40, 50.001, 50), -1));
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(-51, -51, 51, 51), -1));
}

TEST(GroundCovers, OnATiltedPlaneTheLowestCornerDecides) {
  const Answer a =
      find({grid(0, 0, 100, 100, 1, [](double x, double z) { return 0.1 * x + 0.2 * z; })});
  ASSERT_TRUE(a.ground);
  // The plane's floats are exact to 1e-6; its lowest place under the footprint is the corner (20,
  // 30).
  EXPECT_TRUE(a.ground->covers_at_or_above(rectangle(20, 30, 40, 60), 8 - 1e-5));
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(20, 30, 40, 60), 8 + 1e-5));
}

TEST(GroundCovers, SeesADipInsideTheFootprintOnly) {
  // One pit, a cell wide, at (0, 0) of a grid of 10 m cells.
  const Answer a = find(
      {grid(-50, -50, 50, 50, 10, [](double x, double z) { return x == 0 && z == 0 ? -3 : 0; })});
  ASSERT_TRUE(a.ground);
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(-20, -20, 20, 20), 0));
  EXPECT_TRUE(a.ground->covers_at_or_above(rectangle(-20, -20, 20, 20), -3));
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(-1, 4, 1, 30), 0));
  EXPECT_TRUE(a.ground->covers_at_or_above(rectangle(11, 11, 30, 30), 0));
  // Footprints beside the pit, over triangles that reach into it.
  EXPECT_TRUE(a.ground->covers_at_or_above(rectangle(-30, 10.01, 30, 30), 0));
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(-30, 9.9, 30, 30), 0));
  EXPECT_TRUE(a.ground->covers_at_or_above(rectangle(4, -1, 6, 1), -2));
  // All of the pit lies in this one's courtyard; with the courtyard filled it does not.
  Polygon court = rectangle(-40, -40, 40, 40);
  court.rings.push_back({{-12, -12}, {-12, 12}, {12, 12}, {12, -12}});
  EXPECT_TRUE(a.ground->covers_at_or_above(court, 0));
  court.rings.pop_back();
  EXPECT_FALSE(a.ground->covers_at_or_above(court, 0));
}

TEST(GroundCovers, SeesAPitBetweenTheFootprintsEdges) {
  // No edge of the footprint comes near the pit: only its corners' parity tells.
  const Answer a = find({grid(-500, -500, 500, 500, 100,
                              [](double x, double z) { return x == 0 && z == 0 ? -1 : 0; })});
  ASSERT_TRUE(a.ground);
  EXPECT_FALSE(a.ground->covers_at_or_above(rectangle(-400, -400, 400, 400), 0));
}

TEST(GroundCovers, AgreesWithDenseSampling) {
  const Answer a = find(tiles(hills));
  ASSERT_TRUE(a.ground);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> at(-45, 30);
  std::uniform_real_distribution<double> wide(1, 15);
  int above = 0;
  for (int i = 0; i < 400; ++i) {
    const double x = at(random);
    const double z = at(random);
    const double w = wide(random);
    const double d = wide(random);
    double lowest = 1e9;
    for (int u = 0; u <= 200; ++u)
      for (int v = 0; v <= 20; ++v) {
        lowest = std::min(lowest, a.ground->height_at(x + w * u / 200, z + d * v / 20));
        lowest = std::min(lowest, a.ground->height_at(x + w * v / 20, z + d * u / 200));
      }
    const Polygon footprint = rectangle(x, z, x + w, z + d);
    EXPECT_FALSE(a.ground->covers_at_or_above(footprint, lowest + 1e-6));
    above += a.ground->covers_at_or_above(footprint, lowest - 0.25) ? 1 : 0;
  }
  EXPECT_EQ(above, 400);
}

// 320,000 triangles, 60,000 footprints: all pairs would take hours and trip the test's time-out.
TEST(GroundCovers, TakesACitysWorthOfFootprints) {
  const Answer a = find({grid(-4096, -4096, 4096, 4096, 400, [](double x, double z) {
    return 50 + 20 * std::sin(x / 300) + 20 * std::cos(z / 200);
  })});
  ASSERT_TRUE(a.ground) << a.said;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> at(-4000, 4000);
  int above = 0;
  for (int i = 0; i < 60000; ++i) {
    const double x = at(random);
    const double z = at(random);
    const double y = a.ground->height_at(x, z);
    above += a.ground->covers_at_or_above(rectangle(x, z, x + 20, z + 12), y - 4) ? 1 : 0;
  }
  EXPECT_EQ(above, 60000);
}

}  // namespace
}  // namespace ivis
