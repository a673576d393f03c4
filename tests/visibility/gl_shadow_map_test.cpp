// The orthographic cull map's shadows on OpenGL against the CPU's, the verifier, and a lost
// context.

#include <algorithm>
#include <cmath>
#include <thread>

#include "tests/visibility/contract_scenes.h"
#include "tests/visibility/gl_support.h"
#include "visibility/cull_map.h"
#include "visibility/gl/gl_shadow_map.h"

namespace ivis {
namespace {

using test::misses;
using test::shrunk;
using test::software_context;
using test::solved;

MethodOptions orthographic(Backend backend) {
  MethodOptions options;
  options.map = CullMapKind::kOrthographic;
  options.backend = backend;
  return options;
}

/// A ring of corners as walls, the eye at the origin.
WallSet walls_of(const std::vector<Vec2>& ring, float top) {
  WallSet walls;
  walls.rings.push_back({0, static_cast<std::uint32_t>(ring.size())});
  for (const Vec2& p : ring) {
    walls.x.push_back(static_cast<float>(p.x));
    walls.z.push_back(static_cast<float>(p.y));
  }
  WallSet::Solid solid;
  solid.rings = 1;
  solid.top = top;
  walls.solids.push_back(solid);
  return walls;
}

TEST(GlShadowMap, WritesTheHeightsThatTheCpuWrites) {
  IVIS_NEEDS_GL;
  // Hulls and a star, seen from outside, above, and from within a court.
  std::vector<std::vector<Vec2>> rings{{{5, 3}, {30, 1}, {33, 20}, {12, 24}},
                                       {{-40, -9}, {-12, -30}, {-10, -8}, {-22, -12}, {-25, 4}}};
  std::vector<Vec2> star;
  for (int i = 0; i < 40; ++i) {
    const double a = i * 0.157;
    star.push_back(Vec2{20, -35} + (i % 2 == 0 ? 12.0 : 7.0) * Vec2{std::cos(a), std::sin(a)});
  }
  rings.push_back(star);
  std::vector<Vec2> court;
  for (int i = 0; i < 12; ++i)
    court.push_back(4.0 * Vec2{std::cos(-i * 0.5236), std::sin(-i * 0.5236)});
  rings.push_back(court);
  // Corners of squares lie on no wall and no border between two, where rounding decides.
  const OrthographicMap map(Aabb{{-100.0713, 0, -90.0391}, {110, 30, 95}}, 0.5);
  const auto gl = GlShadowMap::create(software_context(), map);
  ASSERT_TRUE(gl) << gl.error().message;
  const auto squares = static_cast<std::size_t>(map.grid().columns * map.grid().rows);
  for (const Vec3& eye :
       {Vec3{0.137, 1.7, -0.211}, Vec3{0.317, 40, -0.419}, Vec3{-60.1, 6, 50.3}}) {
    std::vector<ShadowChain> chains;
    for (const auto& ring : rings) {
      const WallSet walls = walls_of(ring, 12);
      OrthographicMap::add_chains(walls, walls.solids[0], eye, chains);
    }
    OrthographicMap::Heights by_cpu;
    OrthographicMap::Heights by_gl;
    map.clear(by_cpu);
    map.clear(by_gl);
    map.draw(chains, eye, by_cpu);
    const auto drawn = (*gl)->draw(chains, eye, by_gl);
    ASSERT_TRUE(drawn) << drawn.error().message;
    std::size_t in_shadow = 0;
    std::size_t lost = 0;
    for (std::size_t i = 0; i < squares; ++i) {
      const float cpu = by_cpu.least[i];
      const float there = by_gl.least[i];
      if (cpu < -1e30F) {
        EXPECT_LT(there, -1e30F) << "square " << i << " is in no shadow";
        continue;
      }
      ++in_shadow;
      if (there < -1e30F)
        ++lost;
      else
        EXPECT_NEAR(there, cpu, 5e-7F * std::abs(cpu)) << "square " << i;
    }
    // A few walls at a time; one chain, the court's, is longer than that and hides nothing.
    const auto paged = GlShadowMap::create(software_context(), map, 9);
    ASSERT_TRUE(paged);
    std::vector<ShadowChain> short_ones;
    for (const ShadowChain& c : chains)
      if (c.plane.size() <= 9) short_ones.push_back(c);
    OrthographicMap::Heights in_pages;
    OrthographicMap::Heights of_short;
    map.clear(in_pages);
    map.clear(of_short);
    ASSERT_TRUE((*paged)->draw(chains, eye, in_pages));
    ASSERT_TRUE((*gl)->draw(short_ones, eye, of_short));
    std::size_t differ = 0;
    for (std::size_t i = 0; i < squares; ++i)
      differ += in_pages.least[i] == of_short.least[i] ? 0 : 1;
    EXPECT_EQ(differ, 0U) << "of " << squares;
    EXPECT_GT(in_shadow, squares / 20);
    EXPECT_EQ(lost, 0U) << "of " << in_shadow;
  }
}

TEST(GlShadowMap, NothingIsMissedAndNoMoreIsListedThanByTheCpu) {
  IVIS_NEEDS_GL;
  for (const Reach& reach : {Reach::disc(1), Reach::cylinder(0.8, 0.1), Reach::ball(0.4)}) {
    const Scene scene = test::random_town(31, false);
    const OccluderSet set = shrunk(scene, reach);
    const Verifier verifier(scene, &set, BlockerChoice::kOccluding);
    MethodOptions options = orthographic(Backend::kGl);
    options.make_gl_shadows = make_gl_shadow_map;
    const auto gl = make_method("cull-map", scene, set, options);
    ASSERT_TRUE(gl) << gl.error().message;
    EXPECT_EQ((*gl)->backend(), Backend::kGl);
    const auto cpu = make_method("cull-map", scene, set, orthographic(Backend::kCpu));
    ASSERT_TRUE(cpu);
    for (const Vec3& eye : {Vec3{0, 1.7, 0}, Vec3{12, 6, -9}, Vec3{-5, 30, 5}}) {
      const Pvs by_gl = solved(**gl, {eye, reach});
      const Pvs by_cpu = solved(**cpu, {eye, reach});
      EXPECT_EQ(misses(verifier, by_gl), 0U);
      EXPECT_TRUE(std::includes(by_cpu.objects.begin(), by_cpu.objects.end(), by_gl.objects.begin(),
                                by_gl.objects.end()));
      if (eye.y < 2) {
        EXPECT_LT(by_gl.objects.size(), scene.objects.size());
      }
    }
  }
}

TEST(GlShadowMap, ThreadsTakeTurns) {
  IVIS_NEEDS_GL;
  const Reach reach = Reach::disc(1);
  const Scene scene = test::random_town(34, false);
  const OccluderSet set = shrunk(scene, reach);
  MethodOptions options = orthographic(Backend::kGl);
  options.make_gl_shadows = make_gl_shadow_map;
  const auto method = make_method("cull-map", scene, set, options);
  ASSERT_TRUE(method);
  std::vector<ViewCell> cells;
  for (int i = 0; i < 4; ++i)
    cells.push_back({{5.0 * i, 1.7, -3.0 * i}, reach});
  std::vector<Pvs> alone;
  for (const ViewCell& cell : cells)
    alone.push_back(solved(**method, cell));
  std::vector<std::thread> threads;
  std::vector<int> same(cells.size(), 0);
  for (std::size_t i = 0; i < cells.size(); ++i)
    threads.emplace_back([&, i] {
      for (int r = 0; r < 10; ++r) {
        const auto pvs = (*method)->solve(cells[i]);
        same[i] += pvs && pvs->objects == alone[i].objects ? 1 : 0;
      }
    });
  for (auto& t : threads)
    t.join();
  EXPECT_EQ(same, std::vector<int>(cells.size(), 10));
}

TEST(GlShadowMap, ALostContextIsAnErrorOrTheCpusTurn) {
  IVIS_NEEDS_GL;
  const Reach reach = Reach::disc(1);
  const Scene scene = test::random_town(32, false);
  const OccluderSet set = shrunk(scene, reach);
  const ViewCell cell{{0, 1.7, 0}, reach};
  for (const Backend backend : {Backend::kGl, Backend::kAuto}) {
    GlContext* context = nullptr;
    std::string log;
    MethodOptions options = orthographic(backend);
    options.log = [&](std::string_view text) { log += text; };
    options.make_gl_shadows = [&](const OrthographicMap& map,
                                  Backend) -> Result<std::unique_ptr<ShadowDrawer>> {
      auto shadows = GlShadowMap::create(software_context(), map);
      if (!shadows) return shadows.error();
      context = &(*shadows)->context();
      return std::unique_ptr<ShadowDrawer>(std::move(*shadows));
    };
    const auto method = make_method("cull-map", scene, set, options);
    ASSERT_TRUE(method);
    EXPECT_EQ((*method)->backend(), Backend::kGl);
    ASSERT_TRUE((*method)->solve(cell));
    ASSERT_NE(context, nullptr);
    context->destroy();
    const auto pvs = (*method)->solve(cell);
    if (backend == Backend::kGl) {
      ASSERT_FALSE(pvs);
      EXPECT_EQ(pvs.error().code, ErrorCode::kUnsupported);
    } else {
      ASSERT_TRUE(pvs) << pvs.error().message;
      EXPECT_EQ((*method)->backend(), Backend::kCpu);
      EXPECT_NE(log.find("the CPU takes over"), std::string::npos);
      const auto cpu = make_method("cull-map", scene, set, orthographic(Backend::kCpu));
      EXPECT_EQ(pvs->objects, solved(**cpu, cell).objects);
    }
  }
}

TEST(GlShadowMap, ThePolarMapHasNone) {
  const Scene scene = test::random_town(33, false);
  const OccluderSet set = shrunk(scene, Reach::disc(1));
  MethodOptions options;
  options.backend = Backend::kGl;
  options.make_gl_shadows = make_gl_shadow_map;
  const auto method = make_method("cull-map", scene, set, options);
  ASSERT_FALSE(method);
  EXPECT_EQ(method.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(method.error().message.find("orthographic"), std::string::npos);
}

}  // namespace
}  // namespace ivis
