#include "scenes/city_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace ivis {
namespace {

double cross(const Vec2& a, const Vec2& b) {
  return a.x * b.y - a.y * b.x;
}
Vec2 left_of(const Vec2& d) {
  return {-d.y, d.x};
}

struct Box {        // oriented
  Vec2 axis{1, 0};  // unit, the long way
  double lo = 0;    // along axis
  double hi = 0;
  double width = 0;
};

/// Smallest oriented box that has an edge of the ring as a side.
Box box_of(const std::vector<Vec2>& ring) {
  Box best;
  double best_area = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2 d = glm::normalize(ring[(i + 1) % ring.size()] - ring[i]);
    Vec2 lo(std::numeric_limits<double>::infinity());
    Vec2 hi(-lo);
    for (const Vec2& p : ring) {
      const Vec2 q(glm::dot(p, d), glm::dot(p, left_of(d)));
      lo = glm::min(lo, q);
      hi = glm::max(hi, q);
    }
    const Vec2 size = hi - lo;
    if (size.x * size.y >= best_area * (1 - 1e-9)) continue;
    best_area = size.x * size.y;
    best = size.x >= size.y ? Box{d, lo.x, hi.x, size.y} : Box{left_of(d), lo.y, hi.y, size.x};
  }
  return best;
}

struct Hit {
  std::size_t edge;
  Vec2 at;
};

/// Where the line p + s d crosses the ring, or nothing unless it does so twice, away from corners
/// and steeply.
std::optional<std::pair<Hit, Hit>> crossings(const std::vector<Vec2>& ring, const Vec2& p,
                                             const Vec2& d) {
  constexpr double kFromCorner = 22;  // metres: no block gets a side too short to build on
  constexpr double kSteep = 0.6;      // sine of the least angle between streets
  std::vector<Hit> hits;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2 a = ring[i];
    const Vec2 b = ring[(i + 1) % ring.size()];
    const double sa = cross(d, a - p);
    const double sb = cross(d, b - p);
    if ((sa < 0) == (sb < 0)) continue;
    const Vec2 at = a + (b - a) * (sa / (sa - sb));
    const Vec2 edge = b - a;
    if (glm::length(at - a) < kFromCorner || glm::length(at - b) < kFromCorner) return std::nullopt;
    if (std::abs(cross(d, edge)) < kSteep * glm::length(edge)) return std::nullopt;
    hits.push_back({i, at});
  }
  if (hits.size() != 2) return std::nullopt;
  return std::pair{hits[0], hits[1]};
}

/// The part of the ring from hit a on to hit b, closed by the street `middle` (points from b to a).
CityBlock part(const CityBlock& block, const Hit& a, const Hit& b, const std::vector<Vec2>& middle,
               double half_width) {
  CityBlock out;
  out.ring.push_back(a.at);
  out.half_width.push_back(block.half_width[a.edge]);
  for (std::size_t i = a.edge; i != b.edge;) {
    i = (i + 1) % block.ring.size();
    out.ring.push_back(block.ring[i]);
    out.half_width.push_back(block.half_width[i]);
  }
  out.ring.push_back(b.at);
  out.half_width.push_back(half_width);
  for (const Vec2& m : middle) {
    out.ring.push_back(m);
    out.half_width.push_back(half_width);
  }
  return out;
}

double street_half_width(std::size_t depth, Random& random) {
  if (depth < 2) return random.in(13, 17);
  if (depth < 4) return random.in(9, 12);
  if (depth < 6) return random.in(6.5, 9);
  return random.in(5, 7);
}

bool split(const CityBlock& block, std::size_t depth, Random& random, CityBlock& first,
           CityBlock& second) {
  const Box box = box_of(block.ring);
  const Vec2 centre = ring_centre(block.ring);
  for (int attempt = 0; attempt < 10; ++attempt) {
    const double at = box.lo + (box.hi - box.lo) * random.in(0.38, 0.62);
    const double slant = random.chance(0.5) ? random.in(-0.06, 0.06) : random.in(-0.25, 0.25);
    const Vec2 direction = glm::normalize(left_of(box.axis) + box.axis * slant);
    const Vec2 p = centre + box.axis * (at - glm::dot(centre, box.axis));
    const double half_width = street_half_width(depth, random);
    const bool curved = random.chance(0.35);
    const double bend = random.in(-0.09, 0.09);
    const auto hits = crossings(block.ring, p, direction);
    if (!hits) continue;
    const auto& [a, b] = *hits;
    std::vector<Vec2> middle;  // from b to a
    const Vec2 chord = a.at - b.at;
    const double length = glm::length(chord);
    if (curved && length > 160) {
      const auto pieces = static_cast<std::size_t>(std::clamp(length / 70, 3.0, 9.0));
      for (std::size_t k = 1; k < pieces; ++k) {
        const double s = static_cast<double>(k) / static_cast<double>(pieces);
        middle.push_back(b.at + chord * s + left_of(chord) * (bend * 4 * s * (1 - s)));
      }
    }
    first = part(block, a, b, middle, half_width);
    std::reverse(middle.begin(), middle.end());
    second = part(block, b, a, middle, half_width);
    const double least = 0.25 * ring_area(block.ring);
    if (ring_area(first.ring) < least || ring_area(second.ring) < least) continue;
    return true;
  }
  return false;
}

}  // namespace

double ring_area(const std::vector<Vec2>& ring) {
  double twice = 0;
  for (std::size_t i = 0; i < ring.size(); ++i)
    twice += cross(ring[i] - ring[0], ring[(i + 1) % ring.size()] - ring[0]);
  return twice / 2;
}

Vec2 ring_centre(const std::vector<Vec2>& ring) {
  Vec2 sum(0);
  double twice = 0;
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
    const double w = cross(ring[i] - ring[0], ring[i + 1] - ring[0]);
    sum += (ring[0] + ring[i] + ring[i + 1]) * (w / 3);
    twice += w;
  }
  return sum / twice;
}

std::vector<Vec2> inset_ring(const std::vector<Vec2>& ring, const std::vector<double>& inset) {
  const std::size_t n = ring.size();
  std::vector<Vec2> out(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t before = (i + n - 1) % n;
    const Vec2 u = glm::normalize(ring[i] - ring[before]);
    const Vec2 v = glm::normalize(ring[(i + 1) % n] - ring[i]);
    const Vec2 a = ring[i] + left_of(u) * inset[before];
    const Vec2 b = ring[i] + left_of(v) * inset[i];
    const double c = cross(u, v);
    if (std::abs(c) < 1e-3)
      out[i] = (a + b) * 0.5;
    else
      out[i] = a + u * (cross(b - a, v) / c);
  }
  for (std::size_t i = 0; i < n; ++i)
    if (glm::dot(out[(i + 1) % n] - out[i], ring[(i + 1) % n] - ring[i]) <= 0) return {};
  return out;
}

std::vector<CityBlock> plan_blocks(double size, double block_m, Random& random) {
  const double h = size / 2;
  constexpr double kRim = 14;  // open strip about the city
  struct Piece {
    CityBlock block;
    std::size_t depth;
  };
  std::vector<Piece> stack{{{{{-h, -h}, {h, -h}, {h, h}, {-h, h}}, {kRim, kRim, kRim, kRim}}, 0}};
  std::vector<CityBlock> done;
  while (!stack.empty()) {
    Piece piece = std::move(stack.back());
    stack.pop_back();
    const double out = std::min(1.0, glm::length(ring_centre(piece.block.ring)) / h);
    const double side = block_m * (0.7 + 0.8 * out) * random.in(0.85, 1.25);
    CityBlock first;
    CityBlock second;
    if (ring_area(piece.block.ring) < 1.6 * side * side ||
        !split(piece.block, piece.depth, random, first, second)) {
      done.push_back(std::move(piece.block));
      continue;
    }
    stack.push_back({std::move(second), piece.depth + 1});
    stack.push_back({std::move(first), piece.depth + 1});
  }
  return done;
}

}  // namespace ivis
