#include "occluders/sheets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "core/view_cell.h"
#include "occluders/clip.h"
#include "occluders/fast_erosion.h"
#include "occluders/file.h"
#include "occluders/quads.h"
#include "occluders/shrink.h"
#include "scenes/load.h"
#include "tests/occluders/mesh_shapes.h"
#include "tests/support/scene_builder.h"
#include "tests/support/shared_data.h"

namespace ivis {
namespace {

using test::SceneBuilder;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const std::vector<Reach> kReaches{Reach::ball(0.15), Reach::disc(0.3), Reach::cylinder(0.2, 0.1),
                                  Reach::ellipsoid({0.3, 0.1, 0.2}), Reach::box({0.1, 0.2, 0.3})};

struct Random {
  explicit Random(unsigned seed) : rng(seed) {}
  double between(double a, double b) { return a + (b - a) * u(rng); }
  Vec3 direction() { return glm::normalize(Vec3{g(rng), g(rng), g(rng)}); }
  std::mt19937 rng;
  std::uniform_real_distribution<double> u{0, 1};
  std::normal_distribution<double> g;
};

/// Where the segment from a to b crosses the plane; nothing if it does not.
std::optional<Vec3> crossing(const Vec3& a, const Vec3& b, const Vec3& n, double offset) {
  const double da = glm::dot(n, a) - offset;
  const double db = glm::dot(n, b) - offset;
  if (!(da > 0 && db < 0)) return std::nullopt;
  return a + (b - a) * (da / (da - db));
}

// ---------------------------------------------------------------- the lemma

struct LemmaCase {
  Vec3 n, p, x0, y;
  double offset, a, cos_theta;
};

LemmaCase random_case(Random& r, double least_a, double most_a) {
  LemmaCase c;
  c.n = r.direction();
  c.offset = r.between(-100, 100);
  const Vec3 origin = c.n * c.offset;
  Vec3 along = r.direction();
  along -= c.n * glm::dot(along, c.n);
  c.a = r.between(least_a, most_a);
  c.p = origin + c.n * c.a;
  c.x0 = origin + along * r.between(0, 20);
  // From grazing the plane to far behind it.
  c.y = c.x0 + (c.x0 - c.p) * std::pow(10, r.between(-3, 3));
  c.cos_theta = c.a / glm::length(c.x0 - c.p);
  return c;
}

TEST(SheetLemma, EveryViewpointsSegmentCrossesWithinTheReachOverTheCosine) {
  Random r(1);
  for (const Reach& reach : kReaches) {
    const double r_v = largest_move(reach, 0.001);
    double tightest = 0;
    for (int i = 0; i < 4000; ++i) {
      const LemmaCase c = random_case(r, r_v * 1.0001, 5);
      for (const Vec3& v : reach.extreme_points(24)) {
        const auto x = crossing(c.p + v, c.y, c.n, c.offset);
        ASSERT_TRUE(x) << reach.to_string();
        const double moved = glm::length(*x - c.x0);
        ASSERT_LE(moved, r_v / c.cos_theta * (1 + 1e-9) + 1e-9) << reach.to_string();
        tightest = std::max(tightest, moved * c.cos_theta / r_v);
      }
    }
    EXPECT_GT(tightest, 0.9) << "a radius 10 % too small would do for " << reach.to_string();
  }
}

TEST(SheetLemma, FailsWhereTheCellTouchesThePlane) {
  Random r(2);
  int not_crossing = 0;
  for (int i = 0; i < 500; ++i) {
    const LemmaCase c = random_case(r, 0.05, 0.14);
    for (const Vec3& v : Reach::ball(0.15).extreme_points(24))
      not_crossing += crossing(c.p + v, c.y, c.n, c.offset) ? 0 : 1;
  }
  EXPECT_GT(not_crossing, 0);
}

TEST(SheetLemma, FailsForWhatStandsBeforeThePlane) {
  Random r(3);
  for (int i = 0; i < 100; ++i) {
    LemmaCase c = random_case(r, 0.5, 5);
    c.y = c.x0 + (c.p - c.x0) * 0.01;
    EXPECT_FALSE(crossing(c.p, c.y, c.n, c.offset));
  }
}

TEST(SheetLemma, TheRuleForPixelsHoldsWithItsDisplacement) {
  Random r(4);
  const Reach reach = Reach::ball(0.15);
  const double r_v = largest_move(reach, 0.001);
  for (int i = 0; i < 20000; ++i) {
    const LemmaCase c = random_case(r, r_v * 1.01, 5);  // x0 plays the pixel's centre
    const double e = r.between(0, std::min(0.3, 0.9 * c.a));
    const Vec3 beside = c.x0 + r.direction() * e;
    const Vec3 y = c.p + (beside - c.p) * std::pow(10, r.between(-0.3, 3));
    if (glm::dot(c.n, y) >= c.offset) continue;
    const double allowed = (r_v + e) * glm::length(c.x0 - c.p) / (c.a - e);
    for (const Vec3& v : reach.extreme_points(16)) {
      const auto x = crossing(c.p + v, y, c.n, c.offset);
      ASSERT_TRUE(x);
      ASSERT_LE(glm::length(*x - c.x0), allowed * (1 + 1e-9));
    }
  }
}

// ---------------------------------------------------------------- what is built

std::vector<ConvexPiece> pieces_of(const Scene& scene) {
  std::vector<ConvexPiece> pieces;
  for (const auto* list : {&scene.objects, &scene.hidden_solids})
    for (const Object& o : *list) {
      auto found = extract_convex(scene, o);
      std::move(found.pieces.begin(), found.pieces.end(), std::back_inserter(pieces));
    }
  return pieces;
}

ShrinkOptions shrink_options(const Reach& reach, ViewSpace space = {}) {
  ShrinkOptions options;
  options.reach = reach;
  options.view_space = std::move(space);
  return options;
}

SheetOptions options_for(const Reach& reach) {
  SheetOptions options;
  options.radii_m = sheet_radii(largest_move(reach, 0.001));
  return options;
}

struct Made {
  std::vector<ConvexPiece> pieces;
  std::vector<Sheet> sheets;
  std::vector<double> radii;
  SheetReport report;
};

Made make(SceneBuilder&& b, const Reach& reach = Reach::ball(0.15)) {
  Made m;
  m.pieces = pieces_of(std::move(b).finish());
  const SheetOptions options = options_for(reach);
  m.radii = options.radii_m;
  m.sheets = build_sheets(m.pieces, options, {}, m.report);
  EXPECT_THAT(m.report.left_out, IsEmpty());
  return m;
}

/// Does a face of level k of a sheet that looks along n, in a plane within 5 mm of p, hold p?
bool covers(const Made& m, std::size_t k, const Vec3& n, const Vec3& p) {
  for (const Sheet& s : m.sheets) {
    if (glm::dot(s.normal, n) < 0.999 || std::abs(glm::dot(s.normal, p) - s.offset) > 0.005)
      continue;
    if (k >= s.levels.size()) continue;
    const FaceMesh& mesh = s.levels[k];
    for (const auto& f : mesh.faces) {
      bool in = true;
      for (std::size_t i = 0; i < 4; ++i) {
        const Vec3 a = mesh.points[f[i]];
        const Vec3 d = mesh.points[f[(i + 1) % 4]] - a;
        in = in && glm::dot(glm::cross(d, p - a), s.normal) >= -1e-9;
      }
      if (in) return true;
    }
  }
  return false;
}

/// Is p in a solid, or within `slack` of one?
bool in_matter(const std::vector<ConvexPiece>& pieces, const Vec3& p, double slack) {
  return std::any_of(pieces.begin(), pieces.end(), [&](const ConvexPiece& piece) {
    return std::all_of(
        piece.solid.planes.begin(), piece.solid.planes.end(),
        [&](const auto& plane) { return glm::dot(plane.normal, p) <= plane.offset + slack; });
  });
}

/// A wall along x, 0.3 m thick, of four brushes about a window from (4, 1) to (6, 2.5).
void add_wall_with_window(SceneBuilder& b, const Vec3& at, OccluderTag tag = OccluderTag::kOnly) {
  const auto box = [&](const Vec3& lo, const Vec3& hi) { b.add_box(at + lo, at + hi, tag); };
  box({0, 0, 0}, {4, 4, 0.3});
  box({6, 0, 0}, {10, 4, 0.3});
  box({4, 0, 0}, {6, 1, 0.3});
  box({4, 2.5, 0}, {6, 4, 0.3});
}

TEST(Sheets, BrushesSideBySideAreOneWall) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {5, 6, 0.3}, OccluderTag::kOnly);
  b.add_box({5, 0, 0}, {10, 6, 0.3}, OccluderTag::kOnly);
  const Made m = make(std::move(b));
  const std::size_t last = 6;  // 1.2 m
  EXPECT_TRUE(covers(m, last, {0, 0, 1}, {5, 3, 0.3}));
  EXPECT_TRUE(covers(m, last, {0, 0, -1}, {5, 3, 0}));
  EXPECT_FALSE(covers(m, 0, {0, 0, 1}, {0.1, 3, 0.3}));  // nearer to the end than the reach
  EXPECT_FALSE(covers(m, last, {0, 0, 1}, {0.2, 3, 0.3}));
  EXPECT_TRUE(covers(m, 0, {0, 0, 1}, {0.2, 3, 0.3}));
}

TEST(Sheets, AMillimetreBetweenBrushesStaysOpen) {
  for (const OccluderTag tag : {OccluderTag::kOnly, OccluderTag::kAuto}) {
    SceneBuilder b;
    b.add_box({0, 0, 0}, {5, 6, 0.3}, tag);
    b.add_box({5.001, 0, 0}, {10, 6, 0.3}, tag);
    const Made m = make(std::move(b));
    for (const double x : {4.9, 4.99, 5.0005, 5.01, 5.1})
      EXPECT_FALSE(covers(m, 0, {0, 0, 1}, {x, 3, 0.3})) << x;
    EXPECT_TRUE(covers(m, 0, {0, 0, 1}, {4.8, 3, 0.3}));
  }
}

TEST(Sheets, SeamsOfRoundingCloseInMatterOnly) {
  for (const OccluderTag tag : {OccluderTag::kOnly, OccluderTag::kAuto}) {
    SceneBuilder b;
    const double gap = 3.8e-6;  // a float32 step at 50 m
    b.add_box({50, 0, 0}, {55, 6, 0.3}, tag);
    b.add_box({55 + gap, 0, 0}, {60, 6, 0.3}, tag);
    EXPECT_EQ(covers(make(std::move(b)), 4, {0, 0, 1}, {55, 3, 0.3}), tag == OccluderTag::kOnly);
  }
}

TEST(Sheets, AWindowStaysAWindow) {
  for (const Vec3& at : {Vec3{0}, Vec3{1e4, 200, -12e3}}) {
    SceneBuilder b;
    add_wall_with_window(b, at);
    const Made m = make(std::move(b));
    ASSERT_FALSE(m.sheets.empty());
    for (std::size_t k = 0; k < m.radii.size(); ++k) {
      int covered = 0;
      for (double x = 0.05; x < 10; x += 0.1)
        for (double y = 0.05; y < 4; y += 0.1) {
          if (!covers(m, k, {0, 0, 1}, at + Vec3{x, y, 0.3})) continue;
          ++covered;
          const double dx = std::max({4 - x, x - 6, 0.0});
          const double dy = std::max({1 - y, y - 2.5, 0.0});
          ASSERT_GE(std::hypot(dx, dy), m.radii[k] - 1e-6) << x << ' ' << y << " level " << k;
        }
      if (m.radii[k] < 1.5) {
        EXPECT_GT(covered, 0) << k;
      }
    }
  }
}

TEST(Sheets, WallsGoOnIntoWhatTheyMeet) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {5, 4, 0.3}, OccluderTag::kOnly);     // a wall
  b.add_box({5, -1, -4}, {5.3, 5, 4}, OccluderTag::kOnly);   // another, across its end
  b.add_box({-5, -1, -4}, {5.3, 0, 4}, OccluderTag::kOnly);  // the floor
  const Made m = make(std::move(b));
  EXPECT_TRUE(covers(m, 0, {0, 0, 1}, {4.999, 0.001, 0.3}));
}

TEST(Sheets, AreListedFromBehindWhereAnEdgeIsNear) {
  SceneBuilder b;
  add_wall_with_window(b, {0, 0, 0});
  b.add_box({-50, -50, 20}, {50, 50, 20.3}, OccluderTag::kOnly);
  const Made m = make(std::move(b));
  // The wall's face towards +z, and its other face seen from +z through the wall.
  EXPECT_TRUE(covers(m, 0, {0, 0, 1}, {2, 2, 0.3}));
  EXPECT_TRUE(covers(m, 0, {0, 0, 1}, {2, 2, 0}));
  EXPECT_TRUE(covers(m, 0, {0, 0, 1}, {20, 20, 20.3}));
  EXPECT_FALSE(covers(m, 0, {0, 0, 1}, {20, 20, 20}));  // nothing but wall for 16 r_V around
}

TEST(Sheets, FacesThatNobodySeesGiveNone) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {4, 4, 4}, OccluderTag::kOnly);
  b.add_box({0, 4, 0}, {4, 8, 4}, OccluderTag::kOnly);  // stands on it
  const Made m = make(std::move(b));
  EXPECT_FALSE(covers(m, 0, {0, 1, 0}, {2, 4, 2}));
  EXPECT_TRUE(covers(m, 0, {0, 1, 0}, {2, 8, 2}));
}

/// Walls, floors and slanted slabs that meet and cross, with openings.
void add_rooms(SceneBuilder& b, unsigned seed, const Vec3& at, OccluderTag tag) {
  Random r(seed);
  for (int i = 0; i < 14; ++i) {
    const Vec3 half = i % 3 == 0   ? Vec3{r.between(1, 4), 0.15, r.between(1, 4)}
                      : i % 3 == 1 ? Vec3{0.15, r.between(1, 3), r.between(1, 4)}
                                   : Vec3{r.between(1, 4), r.between(1, 3), 0.15};
    const double angle = i % 4 == 3 ? r.between(-0.5, 0.5) : 0;
    Mat4 m{1};
    m[0] = {std::cos(angle), std::sin(angle), 0, 0};
    m[1] = {-std::sin(angle), std::cos(angle), 0, 0};
    m[3] = glm::dvec4(at + Vec3{std::round(r.between(-4, 4)), std::round(r.between(-2, 2)),
                                std::round(r.between(-4, 4))},
                      1);
    b.add_mesh(test::box_mesh(-half, half), tag, m);
  }
  add_wall_with_window(b, at + Vec3{-5, -2, 3}, tag);
}

TEST(Sheets, TheDiscAboutEveryPointLiesInMatter) {
  for (const Vec3& at : {Vec3{0}, Vec3{1e4, 0, 1e4}, Vec3{1e6, 0, -1e6}})
    for (const unsigned seed : {1U, 2U, 3U}) {
      SceneBuilder b;
      add_rooms(b, seed, at, OccluderTag::kAuto);
      const Made m = make(std::move(b));
      ASSERT_FALSE(m.sheets.empty());
      Random r(seed);
      std::size_t points = 0;
      for (const Sheet& s : m.sheets)
        for (std::size_t k = 0; k < s.levels.size(); ++k)
          for (const auto& f : s.levels[k].faces)
            for (int i = 0; i < 6; ++i) {
              const auto& p = s.levels[k].points;
              const double a = i < 4 ? i & 1 : r.between(0, 1);
              const double c = i < 4 ? i >> 1 : r.between(0, 1);
              const Vec3 x = (p[f[0]] * (1 - a) + p[f[1]] * a) * (1 - c) +
                             (p[f[3]] * (1 - a) + p[f[2]] * a) * c;
              ASSERT_NEAR(glm::dot(s.normal, x), s.offset, 1e-9 + 1e-15 * glm::length(at));
              ++points;
              for (int j = 0; j < 12; ++j) {
                Vec3 d = r.direction();
                d = glm::normalize(d - s.normal * glm::dot(d, s.normal));
                const Vec3 q = x + d * (m.radii[k] * (j % 3 == 0 ? r.between(0, 1) : 1));
                ASSERT_TRUE(in_matter(m.pieces, q, 2e-6)) << "level " << k << " seed " << seed;
              }
            }
      EXPECT_GT(points, 1000U);
    }
}

/// Does the segment meet a solid, grown by `slack`?
bool blocked(const std::vector<ConvexPiece>& pieces, const Vec3& a, const Vec3& b, double slack) {
  for (const ConvexPiece& piece : pieces) {
    double from = 0;
    double to = 1;
    for (const auto& plane : piece.solid.planes) {
      const double da = glm::dot(plane.normal, a) - plane.offset - slack;
      const double db = glm::dot(plane.normal, b) - plane.offset - slack;
      if (da > 0 && db > 0) from = 2;
      if (da <= 0 && db <= 0) continue;
      const double t = da / (da - db);
      if (da > 0)
        from = std::max(from, t);
      else
        to = std::min(to, t);
    }
    if (from <= to) return true;
  }
  return false;
}

/// Segments that the rule of sheets.h promises to be blocked, with radii `share` of what it asks
/// for; returns how many are not.
std::size_t open_segments(const Reach& reach, double share, std::size_t& tried) {
  std::size_t open = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    SceneBuilder b;
    add_rooms(b, seed, {3, 1, 2}, OccluderTag::kOnly);
    const Made m = make(std::move(b), reach);
    const double r_v = largest_move(reach, 0.001);
    Random r(seed);
    for (int e = 0; e < 60; ++e) {
      const Vec3 p = Vec3{3, 1, 2} + Vec3{r.between(-6, 6), r.between(-3, 3), r.between(-6, 6)};
      const std::vector<Vec3> moves = reach.extreme_points(20);
      if (std::any_of(moves.begin(), moves.end(),
                      [&](const Vec3& v) { return in_matter(m.pieces, p + v, 1e-6); }))
        continue;
      for (const Sheet& s : m.sheets) {
        const double a = glm::dot(s.normal, p) - s.offset;
        const double pixel = r.between(0, 0.02);
        if (a <= r_v || a <= pixel) continue;
        double far = 0;
        for (const FaceMesh& level : s.levels)
          for (const Vec3& x : level.points)
            far = std::max(far, glm::length(x - p));
        const double needed = share * (r_v + pixel) * far / (a - pixel);
        const auto k = static_cast<std::size_t>(
            std::lower_bound(m.radii.begin(), m.radii.end(), needed) - m.radii.begin());
        if (k >= s.levels.size() || s.levels[k].empty()) continue;
        const FaceMesh& mesh = s.levels[k];
        for (int i = 0; i < 6; ++i) {
          const auto& f = mesh.faces[static_cast<std::size_t>(
              r.between(0, 0.999) * static_cast<double>(mesh.faces.size()))];
          const double u = i < 4 ? i & 1 : r.between(0, 1);
          const double w = i < 4 ? i >> 1 : r.between(0, 1);
          const auto& q = mesh.points;
          const Vec3 x =
              (q[f[0]] * (1 - u) + q[f[1]] * u) * (1 - w) + (q[f[3]] * (1 - u) + q[f[2]] * u) * w;
          const Vec3 beside = x + r.direction() * pixel;
          const Vec3 y = p + (beside - p) * (1 + std::pow(10, r.between(-3, 2)));
          if (glm::dot(s.normal, y) >= s.offset - 1e-6) continue;
          for (const Vec3& v : moves) {
            ++tried;
            open += blocked(m.pieces, p + v, y, 2e-5) ? 0 : 1;
          }
        }
      }
    }
  }
  return open;
}

TEST(Sheets, HideFromTheWholeCellWhatTheRuleSays) {
  for (const Reach& reach : kReaches) {
    std::size_t tried = 0;
    EXPECT_EQ(open_segments(reach, 1, tried), 0U) << reach.to_string();
    EXPECT_GT(tried, 10000U);
  }
}

TEST(Sheets, HideTooMuchWhenTheRuleAsksForTooLittle) {
  std::size_t tried = 0;
  EXPECT_GT(open_segments(Reach::ball(0.15), 0.5, tried), 0U);
}

TEST(Sheets, EveryLevelLiesInTheOneBefore) {
  SceneBuilder b;
  add_rooms(b, 5, {0, 0, 0}, OccluderTag::kOnly);
  const Made m = make(std::move(b));
  for (const Sheet& s : m.sheets) {
    double before = 1e9;
    for (const FaceMesh& level : s.levels) {
      double sum = 0;
      for (const auto& f : level.faces)
        sum += glm::length(glm::cross(level.points[f[2]] - level.points[f[0]],
                                      level.points[f[3]] - level.points[f[1]])) /
                   2 +
               (f[2] == f[3] ? 0 : 0);
      EXPECT_LE(sum, before * 1.05 + 1e-3);
      before = sum;
    }
  }
}

TEST(Sheets, DoNotDependOnTheNumberOfThreads) {
  SceneBuilder b;
  add_rooms(b, 6, {0, 0, 0}, OccluderTag::kOnly);
  const Scene scene = std::move(b).finish();
  ShrinkOptions options = shrink_options(Reach::ball(0.15));
  options.sheets = SheetUse::kOn;
  Context one;
  one.threads = 1;
  Context many;
  many.threads = 5;
  const auto a = shrink(scene, options, FastEroder{}, one);
  const auto c = shrink(scene, options, FastEroder{}, many);
  ASSERT_TRUE(a && c);
  EXPECT_GT(a->set.sheets.size(), 10U);
  EXPECT_EQ(encode_occluders(a->set), encode_occluders(c->set));
}

TEST(Sheets, AreMadeWhereTheyPromiseGain) {
  SceneBuilder town;
  for (int i = 0; i < 10; ++i)
    town.add_box({20.0 * i, 0, 0}, {20.0 * i + 10, 9, 10});
  const Scene scene = std::move(town).finish();
  const auto with = [&](SheetUse use, ViewSpace space) {
    ShrinkOptions options = shrink_options(Reach::ball(0.15), std::move(space));
    options.sheets = use;
    const auto s = shrink(scene, options, FastEroder{});
    EXPECT_TRUE(s);
    return s && !s->set.sheets.empty();
  };
  const ViewSpace indoors{ViewSpace::Kind::kInside, {{-5, 1, 1}}};
  EXPECT_FALSE(with(SheetUse::kAuto, {}));
  EXPECT_TRUE(with(SheetUse::kOn, {}));
  EXPECT_TRUE(with(SheetUse::kAuto, indoors));
  EXPECT_FALSE(with(SheetUse::kOff, indoors));
  SceneBuilder level;
  add_rooms(level, 7, {0, 0, 0}, OccluderTag::kOnly);
  const auto s = shrink(std::move(level).finish(), shrink_options(Reach::ball(0.15)), FastEroder{});
  ASSERT_TRUE(s);
  EXPECT_GT(s->report.convex_solids, 0U);
  EXPECT_EQ(s->report.convex_solids, s->set.convex_solids.size());
}

TEST(Sheets, ASeedInsideAConvexSolidIsRefused) {
  SceneBuilder b;
  b.add_mesh(test::gabled_house());
  const auto s =
      shrink(std::move(b).finish(),
             shrink_options(Reach::disc(1), {ViewSpace::Kind::kInside, {{5, 7, 4}}}), FastEroder{});
  ASSERT_FALSE(s);
  EXPECT_EQ(s.error().code, ErrorCode::kInvalidArgument);
}

// ---------------------------------------------------------------- parting polygons

double area_of(const Quad& q) {
  return area(Polygon{{{q[0], q[1], q[2], q[3]}}});
}

TEST(Quads, PartPolygonsWithHolesExactly) {
  Random r(8);
  int holes = 0;
  for (int i = 0; i < 300; ++i) {
    std::vector<Ring> cut;
    const int n = static_cast<int>(r.between(0, 7));
    for (int j = 0; j < n; ++j) {
      Ring ring;
      const Vec2 c{r.between(0, 8), r.between(0, 8)};
      const int k = static_cast<int>(r.between(3, 9));
      for (int t = 0; t < k; ++t) {
        const double angle = 2 * std::numbers::pi * t / k;
        ring.push_back(snap(c + Vec2{std::cos(angle), std::sin(angle)} * r.between(0.2, 1.5)));
      }
      cut.push_back(convex_hull(ring));
    }
    for (const Polygon& p : subtract({{{0, 0}, {8, 0}, {8, 8}, {0, 8}}}, Fill::kNonZero, cut)) {
      holes += p.rings.size() > 1 ? 1 : 0;
      double sum = 0;
      for (const Quad& q : quads_of(p)) {
        const double a = area_of(q);
        EXPECT_GT(a, 0);
        sum += a;
        for (std::size_t c = 0; c < 4; ++c) {  // convex
          const Vec2 d = q[(c + 1) % 4] - q[c];
          const Vec2 e = q[(c + 2) % 4] - q[(c + 1) % 4];
          EXPECT_GE(d.x * e.y - d.y * e.x, -1e-12);
        }
        for (int s = 0; s < 3; ++s) {
          const double u = r.between(0.01, 0.99);
          const double v = r.between(0.01, 0.99);
          const Vec2 x = (q[0] * (1 - u) + q[1] * u) * (1 - v) + (q[3] * (1 - u) + q[2] * u) * v;
          EXPECT_TRUE(a < 1e-6 || contains(p, x));
        }
      }
      EXPECT_NEAR(sum, area(p), 1e-9);
    }
  }
  EXPECT_GT(holes, 50);
}

TEST(Quads, AnEmptyOrFlatPolygonHasNone) {
  EXPECT_THAT(quads_of({}), IsEmpty());
  EXPECT_THAT(quads_of({{{{0, 0}, {1, 0}, {2, 0}}}}), IsEmpty());
}

// ---------------------------------------------------------------- real maps

TEST(SheetsReal, AGameMapsSheetsKeepTheirDistance) {
  IVIS_NEED_DATA(file, "q3map/oa_shouse.glb");
  const auto scene = load_scene(file);
  ASSERT_TRUE(scene);
  const std::vector<ConvexPiece> pieces = pieces_of(*scene);
  SheetReport report;
  const SheetOptions options = options_for(Reach::ball(0.15));
  const std::vector<Sheet> sheets = build_sheets(pieces, options, {}, report);
  EXPECT_GT(sheets.size(), 1000U);
  EXPECT_THAT(report.left_out, IsEmpty());
  Random r(9);
  for (int i = 0; i < 3000; ++i) {
    const Sheet& s = sheets[static_cast<std::size_t>(r.between(0, 0.999999) *
                                                     static_cast<double>(sheets.size()))];
    const auto k =
        static_cast<std::size_t>(r.between(0, 0.999) * static_cast<double>(s.levels.size()));
    if (s.levels[k].empty()) continue;
    const Vec3 x = s.levels[k].points[0];
    for (int j = 0; j < 8; ++j) {
      Vec3 d = r.direction();
      d = glm::normalize(d - s.normal * glm::dot(d, s.normal));
      ASSERT_TRUE(in_matter(pieces, x + d * options.radii_m[k], 5e-5));
    }
  }
}

}  // namespace
}  // namespace ivis
