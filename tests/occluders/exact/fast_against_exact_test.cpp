// Holds the fast eroder against the exact one, and both against the distance, on footprints as
// cities have them.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "occluders/clip.h"
#include "occluders/distance_check.h"
#include "occluders/exact/exact_erosion.h"
#include "occluders/fast_erosion.h"

namespace ivis {
namespace {

class Footprints {
 public:
  explicit Footprints(unsigned seed) : random_(seed) {}

  Polygon make(const std::string& family) {
    if (family == "rectangles") return placed({rectangle(0, 0, size(), size())});
    if (family == "ells") return placed({ell()});
    if (family == "us") return placed({u()});
    if (family == "courtyards") return placed(courtyard());
    if (family == "necks") return placed({neck()});
    if (family == "stars") return placed({star()});
    if (family == "dirty") return largest(placed({dirty(ell())}).rings);
    if (family == "blocks") return block();
    return {};
  }

 private:
  double in(double lo, double hi) {
    return std::uniform_real_distribution<double>(lo, hi)(random_);
  }
  double size() { return in(8, 25); }
  static Ring rectangle(double x0, double z0, double x1, double z1) {
    return {{x0, z0}, {x1, z0}, {x1, z1}, {x0, z1}};
  }
  Ring ell() {
    const double a = size();
    const double b = size();
    const double c = in(0.3, 0.7) * a;
    const double d = in(0.3, 0.7) * b;
    return {{0, 0}, {a, 0}, {a, d}, {c, d}, {c, b}, {0, b}};
  }
  Ring u() {
    const double w = in(6, 12);
    const double gap = in(0.5, 12);
    const double b = size() + 8;
    return {{0, 0},       {2 * w + gap, 0}, {2 * w + gap, b}, {w + gap, b},
            {w + gap, 8}, {w, 8},           {w, b},           {0, b}};
  }
  std::vector<Ring> courtyard() {
    const double a = size() + 10;
    const double b = size() + 10;
    const double w = in(3, 6);
    Ring hole = rectangle(w, w, a - w, b - w);
    if (in(0, 1) < 0.5) hole[2] -= Vec2{in(0, 3), in(0, 3)};
    std::reverse(hole.begin(), hole.end());
    return {rectangle(0, 0, a, b), hole};
  }
  /// Two rooms and a passage about as wide as twice some reach.
  Ring neck() {
    const double w = in(0.5, 2) * 2 + in(-0.01, 0.01);
    const double z = in(0, 1) < 0.3 ? 1.5 : in(1, 5);
    return {{0, 0},   {10, 0},  {10, z},     {16, z},     {16, 0},  {28, 0},
            {28, 12}, {16, 12}, {16, z + w}, {10, z + w}, {10, 12}, {0, 12}};
  }
  Ring star() {
    const int n = static_cast<int>(in(5, 24));
    const double r = size();
    Ring ring;
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * i / n;
      ring.push_back(in(0.5, 1) * r * Vec2{std::cos(angle), std::sin(angle)});
    }
    return ring;
  }
  /// Corners doubled, nearly doubled, nearly on a line, and a notch a few millimetres deep.
  Ring dirty(const Ring& clean) {
    Ring ring;
    for (std::size_t i = 0; i < clean.size(); ++i) {
      const Vec2& a = clean[i];
      const Vec2& b = clean[(i + 1) % clean.size()];
      ring.push_back(a);
      const double kind = in(0, 4);
      if (kind < 1)
        ring.push_back(a + Vec2{in(-1e-4, 1e-4), in(-1e-4, 1e-4)});
      else if (kind < 2)
        ring.push_back(glm::mix(a, b, 0.5) + Vec2{in(-1e-3, 1e-3), in(-1e-3, 1e-3)});
      else if (kind < 3) {
        const Vec2 along = glm::normalize(b - a);
        const Vec2 inwards{-along.y, along.x};
        const Vec2 m = glm::mix(a, b, 0.4);
        ring.insert(ring.end(), {m, m + in(1e-3, 0.05) * inwards, m + 0.3 * along + 0.02 * inwards,
                                 m + 0.3 * along});
      } else {
        ring.push_back(a);
      }
    }
    return ring;
  }
  /// Houses that overlap or share party walls, fused; with and without courtyards between them.
  Polygon block() {
    std::vector<Ring> houses;
    const double angle = in(0, 6);
    for (int i = 0; i < 14; ++i) {
      const double x = 9 * (i % 5) + in(-0.5, 0.5);
      const double z = 11 * (i / 5) + in(-2, 2);
      Ring house = rectangle(x, z, x + in(8, 10), z + in(9, 14));
      for (Vec2& p : house)
        p = turned(p, angle + in(-0.02, 0.02) * (i % 3));
      houses.push_back(house);
    }
    return largest(houses);
  }
  /// United, as the shrinker does before it erodes: corners moved by a hair may make rings cross
  /// themselves, and an eroder may rely on simple ones.
  static Polygon largest(const std::vector<Ring>& rings) {
    std::vector<Polygon> pieces = unite(rings, Fill::kNonZero);
    return *std::max_element(pieces.begin(), pieces.end(),
                             [](const Polygon& p, const Polygon& q) { return area(p) < area(q); });
  }
  static Vec2 turned(const Vec2& p, double angle) {
    return {std::cos(angle) * p.x - std::sin(angle) * p.y,
            std::sin(angle) * p.x + std::cos(angle) * p.y};
  }
  /// Anywhere within 10 km, turned; on the grid as the shrinker hands footprints over.
  Polygon placed(std::vector<Ring> rings) {
    const double angle = in(0, 1) < 0.3 ? 0 : in(0, 6.3);
    const Vec2 at{in(-1e4, 1e4), in(-1e4, 1e4)};
    for (Ring& ring : rings)
      for (Vec2& p : ring)
        p = snap(turned(p, angle) + at);
    return {std::move(rings)};
  }

  std::mt19937 random_;
};

double norm(const Vec2& v, const Reach& reach) {
  const Vec3& e = reach.half_extents();
  const Vec2 q{v.x / e.x, v.y / e.z};
  return reach.horizontal_is_box() ? std::max(std::abs(q.x), std::abs(q.y)) : glm::length(q);
}

/// Distance of p to the edge ab in the reach's norm: the norm is convex along the edge.
double distance(const Vec2& p, const Vec2& a, const Vec2& b, const Reach& reach) {
  double lo = 0;
  double hi = 1;
  const auto at = [&](double t) { return norm(glm::mix(a, b, t) - p, reach); };
  for (int k = 0; k < 60; ++k) {
    const double u = lo + (hi - lo) / 3;
    const double v = hi - (hi - lo) / 3;
    (at(u) < at(v) ? hi : lo) = at(u) < at(v) ? v : u;
  }
  return at((lo + hi) / 2);
}

/// Samples along the border of `piece`: the least distance to the footprint's border, in reaches;
/// negative when a sample lies outside.
double sampled_clearance(const Polygon& piece, const Polygon& footprint, const Reach& reach) {
  double least = std::numeric_limits<double>::infinity();
  for (const Ring& ring : piece.rings)
    for (std::size_t i = 0; i < ring.size(); ++i)
      for (const double t : {0.0, 0.37, 0.74}) {
        const Vec2 p = glm::mix(ring[i], ring[(i + 1) % ring.size()], t);
        if (!contains(footprint, p)) return -1;
        for (const Ring& o : footprint.rings)
          for (std::size_t j = 0; j < o.size(); ++j) {
            const Vec2& a = o[j];
            const Vec2& b = o[(j + 1) % o.size()];
            // Beyond twice the reach nothing is at stake: half the time of the test.
            const Vec3 e = 2.0 * reach.half_extents();
            if (p.x < std::min(a.x, b.x) - e.x || p.x > std::max(a.x, b.x) + e.x ||
                p.y < std::min(a.y, b.y) - e.z || p.y > std::max(a.y, b.y) + e.z)
              continue;
            least = std::min(least, distance(p, a, b, reach));
          }
      }
  return least;
}

int reflex_corners(const Polygon& polygon) {
  int count = 0;
  for (const Ring& ring : polygon.rings)
    for (std::size_t i = 0, n = ring.size(); i < n; ++i) {
      const Vec2 a = ring[(i + 1) % n] - ring[i];
      const Vec2 b = ring[(i + 2) % n] - ring[(i + 1) % n];
      count += a.x * b.y - a.y * b.x < 0 ? 1 : 0;
    }
  return count;
}

/// Area by which the k-gon about the reach's ellipse exceeds it.
double overstep(const Reach& reach, int k) {
  if (reach.horizontal_is_box()) return 0;
  const double step = std::numbers::pi / k;
  return std::numbers::pi * reach.half_extents().x * reach.half_extents().z *
         (std::tan(step) / step - 1);
}

class FastAgainstExact : public testing::TestWithParam<const char*> {};

constexpr int kFootprints = 16;

TEST_P(FastAgainstExact, LiesInsideTheTrueErosionAndKeepsItsArea) {
  // A reach of 3 m leaves so little of a house that its reflex corners need the finer polygon.
  const std::pair<Reach, int> cases[] = {
      {Reach::disc(1.5), 16},        {Reach::disc(0.2), 16},
      {Reach::cylinder(1, 0.1), 16}, {Reach::ellipsoid({2, 1, 0.5}), 16},
      {Reach::box({1, 1, 2}), 16},   {Reach::ball(3), 32}};
  const ExactEroder exact;
  for (const auto& [reach, k] : cases) {
    const FastEroder fast(k);
    SCOPED_TRACE(reach.to_string());
    Footprints footprints(11);
    double fast_area = 0;
    double exact_area = 0;
    double whole_area = 0;
    for (int i = 0; i < kFootprints; ++i) {
      SCOPED_TRACE("footprint " + std::to_string(i));
      const Polygon footprint = footprints.make(GetParam());
      const std::vector<Polygon> by_fast = fast.erode(footprint, reach);
      const std::vector<Polygon> by_exact = exact.erode(footprint, reach);
      for (const auto* pieces : {&by_fast, &by_exact})
        for (const Polygon& piece : *pieces) {
          EXPECT_TRUE(within_erosion(piece, footprint, reach));
          EXPECT_GE(sampled_clearance(piece, footprint, reach), 1);
        }
      const double f = area(by_fast);
      const double e = area(by_exact);
      // One by one: a reflex corner may lose what the polygon oversteps the ellipse by.
      EXPECT_GE(f, 0.9999 * e - reflex_corners(footprint) * overstep(reach, k));
      EXPECT_GE(e, 0.9999 * f - 0.001);
      whole_area += area(footprint);
      fast_area += f;
      exact_area += e;
    }
    EXPECT_GT(exact_area, 0);
    // Where next to nothing is left, a thousandth of it would be a matter of single corners.
    EXPECT_GE(fast_area, exact_area - 0.001 * std::max(exact_area, whole_area / 10));
    EXPECT_GE(exact_area, 0.9999 * fast_area);
  }
}

INSTANTIATE_TEST_SUITE_P(Footprints, FastAgainstExact,
                         testing::Values("rectangles", "ells", "us", "courtyards", "necks", "stars",
                                         "dirty", "blocks"),
                         [](const auto& param_info) { return std::string(param_info.param); });

// The gate would notice: the same pieces against a reach a tenth of a millimetre larger.
TEST(FastAgainstExactGate, NoticesATenthOfAMillimetre) {
  Footprints footprints(5);
  int refused = 0;
  for (int i = 0; i < 20; ++i) {
    const Polygon footprint = footprints.make("ells");
    for (const Polygon& piece : FastEroder().erode(footprint, Reach::disc(1)))
      refused += within_erosion(piece, footprint, Reach::disc(1.0001)) ? 0 : 1;
  }
  EXPECT_GE(refused, 20);
}

}  // namespace
}  // namespace ivis
