#include "visibility/orthographic_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ivis {
namespace {

constexpr float kNothing = -std::numeric_limits<float>::infinity();
constexpr double kRelative = 1e-6;

double cross(const Vec2& a, const Vec2& b) {
  return a.x * b.y - a.y * b.x;
}

/// The x at row z within the half-plane cross(a, p) >= 0 (sign +1) or <= 0 (sign -1).
void clip_row(const Vec2& a, double sign, double z, double& x0, double& x1) {
  // cross(a, p) = a.x z - a.y x
  const double slope = -a.y * sign;
  const double rest = a.x * z * sign;
  if (slope > 0) {
    x0 = std::max(x0, -rest / slope);
  } else if (slope < 0) {
    x1 = std::min(x1, -rest / slope);
  } else if (rest < 0) {
    x1 = -std::numeric_limits<double>::infinity();
  }
}

}  // namespace

OrthographicMap::OrthographicMap(const Aabb& bounds, double square_m) {
  if (bounds.empty()) return;
  const Vec3 size = bounds.size();
  square_m_ = std::max({square_m, size.x / 1023, size.z / 1023, 1e-3});
  lo_ = ground(bounds.lo);
  auto columns = static_cast<std::int32_t>(size.x / square_m_) + 1;
  auto rows = static_cast<std::int32_t>(size.z / square_m_) + 1;
  while (true) {
    levels_.push_back({total_, columns, rows});
    total_ += static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
    if (columns == 1 && rows == 1) break;
    columns = (columns + 1) / 2;
    rows = (rows + 1) / 2;
  }
}

void OrthographicMap::clear(Heights& heights) const {
  heights.least.assign(total_, kNothing);
}

OrthographicMap::Grid OrthographicMap::grid() const {
  if (levels_.empty()) return {};
  return {lo_, square_m_, levels_[0].columns, levels_[0].rows};
}

void OrthographicMap::add_chains(const WallSet& walls, const WallSet::Solid& solid, const Vec3& eye,
                                 std::vector<ShadowChain>& chains) {
  ShadowChain chain;
  chain.top = static_cast<double>(solid.top) - eye.y;
  const Vec2 at_eye = ground(eye);
  const auto end = [&] {
    if (!chain.plane.empty()) chains.push_back(chain);
    chain.corners.clear();
    chain.plane.clear();
  };
  // A top above the eye throws its shadow from the near wall, one below it from the far wall.
  const bool away = chain.top < 0;
  for (std::uint32_t r = 0; r < solid.rings; ++r) {
    const WallSet::Ring& ring = walls.rings[solid.first_ring + r];
    const auto corner = [&](std::uint32_t i) {
      const std::uint32_t at = ring.first + i % ring.count;
      return Vec2{static_cast<double>(walls.x[at]), static_cast<double>(walls.z[at])} - at_eye;
    };
    // Once around, beginning at an edge that is not wanted, so that no run is cut at the seam.
    const auto wanted = [&](std::uint32_t e) {
      const double turn = cross(corner(e), corner(e + 1));
      return away ? turn > 0 : turn < 0;
    };
    std::uint32_t start = 0;
    while (start < ring.count && wanted(start))
      ++start;
    if (start == ring.count) start = 0;  // a court about the eye: cut anywhere
    for (std::uint32_t i = 0; i < ring.count; ++i) {
      const std::uint32_t e = away ? start + i : start + ring.count - i;
      const Vec2 a = away ? corner(e) : corner(e + 1);
      const Vec2 b = away ? corner(e + 1) : corner(e);
      const double c = cross(a, b);
      if (!wanted(e) || !(c > 0)) {
        end();
        continue;
      }
      // Less than half a turn in all, or the wedge is no intersection of half-planes.
      if (!chain.corners.empty() && cross(chain.corners.front(), b) <= 0) end();
      if (chain.corners.empty()) chain.corners.push_back(a);
      chain.corners.push_back(b);
      chain.plane.push_back(Vec2{b.y - a.y, a.x - b.x} /
                            c);  // (b-a) turned; dot with a is cross(a,b)/c = 1
    }
    end();
  }
}

void OrthographicMap::draw(const std::vector<ShadowChain>& chains, const Vec3& eye,
                           Heights& heights) const {
  if (levels_.empty()) return;
  for (const ShadowChain& chain : chains)
    draw_chain(chain, ground(eye), heights);
}

// Over the part of a square that wall j's azimuths take, the shadow's height top * dot(plane_j, p)
// is linear, so it is nowhere below the least value at the square's corners; over the whole square
// it is nowhere below the least over the walls its corners' azimuths span. The square is in shadow
// if it lies behind the lines of all those walls.
void OrthographicMap::draw_chain(const ShadowChain& chain, const Vec2& eye,
                                 Heights& heights) const {
  const Level& grid = levels_[0];
  const Vec2& first = chain.corners.front();
  const Vec2& last = chain.corners.back();
  const auto walls = static_cast<std::int32_t>(chain.plane.size());
  struct Corner {
    std::int32_t wall = -1;
    Vec2 p{0};
  };
  std::vector<Corner> above;
  std::vector<Corner> row(static_cast<std::size_t>(grid.columns) + 1);
  above = row;
  bool above_any = false;
  std::int32_t above_c0 = 0;
  std::int32_t above_c1 = -1;
  for (std::int32_t r = 0; r <= grid.rows; ++r) {
    const double z = lo_.y + r * square_m_ - eye.y;
    const double x_lo = lo_.x - eye.x;
    double x0 = x_lo;
    double x1 = x_lo + grid.columns * square_m_;
    clip_row(first, 1, z, x0, x1);
    clip_row(last, -1, z, x0, x1);
    std::int32_t c0 = 0;
    std::int32_t c1 = -1;
    if (x1 >= x0) {
      c0 = std::max(0, static_cast<std::int32_t>(std::ceil((x0 - x_lo) / square_m_)));
      c1 = std::min(grid.columns, static_cast<std::int32_t>(std::floor((x1 - x_lo) / square_m_)));
    }
    std::int32_t wall = 0;
    for (std::int32_t c = c0; c <= c1; ++c) {
      const Vec2 p{x_lo + c * square_m_, z};
      while (wall > 0 && cross(chain.corners[static_cast<std::size_t>(wall)], p) < 0)
        --wall;
      while (wall + 1 < walls && cross(chain.corners[static_cast<std::size_t>(wall) + 1], p) > 0)
        ++wall;
      const bool in_wedge = cross(first, p) > 0 && cross(last, p) < 0;
      row[static_cast<std::size_t>(c)] = {
          in_wedge && glm::dot(chain.plane[static_cast<std::size_t>(wall)], p) > 1 ? wall : -1, p};
    }
    if (above_any) {
      for (std::int32_t c = std::max(c0, above_c0); c < std::min(c1, above_c1); ++c) {
        const auto i = static_cast<std::size_t>(c);
        const Corner* square[4] = {&above[i], &above[i + 1], &row[i], &row[i + 1]};
        std::int32_t j0 = walls;
        std::int32_t j1 = -1;
        bool in = true;
        for (const Corner* k : square) {
          in = in && k->wall >= 0;
          j0 = std::min(j0, k->wall);
          j1 = std::max(j1, k->wall);
        }
        if (!in) continue;
        double least = std::numeric_limits<double>::infinity();
        for (std::int32_t j = j0; j <= j1 && in; ++j)
          for (const Corner* k : square) {
            const double behind = glm::dot(chain.plane[static_cast<std::size_t>(j)], k->p);
            in = in && behind > 1;
            least = std::min(least, chain.top * behind);
          }
        if (!in) continue;
        const auto value = static_cast<float>(least - kRelative * std::abs(least));
        float& height =
            heights.least[static_cast<std::size_t>(r - 1) * static_cast<std::size_t>(grid.columns) +
                          i];
        height = std::max(height, value);
      }
    }
    std::swap(row, above);
    above_c0 = c0;
    above_c1 = c1;
    above_any = c1 > c0;
  }
}

void OrthographicMap::finish(Heights& heights) const {
  for (std::size_t l = 1; l < levels_.size(); ++l) {
    const Level& fine = levels_[l - 1];
    const Level& coarse = levels_[l];
    const float* from = heights.least.data() + fine.first;
    float* to = heights.least.data() + coarse.first;
    for (std::int32_t r = 0; r < coarse.rows; ++r)
      for (std::int32_t c = 0; c < coarse.columns; ++c) {
        float least = std::numeric_limits<float>::infinity();
        for (std::int32_t y = 2 * r; y < std::min(2 * r + 2, fine.rows); ++y)
          for (std::int32_t x = 2 * c; x < std::min(2 * c + 2, fine.columns); ++x)
            least = std::min(
                least, from[static_cast<std::size_t>(y) * static_cast<std::size_t>(fine.columns) +
                            static_cast<std::size_t>(x)]);
        to[static_cast<std::size_t>(r) * static_cast<std::size_t>(coarse.columns) +
           static_cast<std::size_t>(c)] = least;
      }
  }
}

bool OrthographicMap::hides(const Heights& heights, const Vec2& lo, const Vec2& hi, float top,
                            bool finished) const {
  if (levels_.empty()) return false;
  const Level& grid = levels_[0];
  // A square more on each side would cost little; the outward rounding of boxes covers what
  // division rounds.
  const auto c0 = static_cast<std::int32_t>(std::floor((lo.x - lo_.x) / square_m_ - 1e-6));
  const auto c1 = static_cast<std::int32_t>(std::floor((hi.x - lo_.x) / square_m_ + 1e-6));
  const auto r0 = static_cast<std::int32_t>(std::floor((lo.y - lo_.y) / square_m_ - 1e-6));
  const auto r1 = static_cast<std::int32_t>(std::floor((hi.y - lo_.y) / square_m_ + 1e-6));
  if (c0 < 0 || r0 < 0 || c1 >= grid.columns || r1 >= grid.rows) return false;
  std::size_t level = 0;
  if (finished)
    while (level + 1 < levels_.size() && (std::max(c1 - c0, r1 - r0) >> level) > 1)
      ++level;
  return hides_in(heights, level, c0, c1, r0, r1, top);
}

bool OrthographicMap::hides_in(const Heights& heights, std::size_t level, std::int32_t c0,
                               std::int32_t c1, std::int32_t r0, std::int32_t r1, float top) const {
  const Level& grid = levels_[level];
  for (std::int32_t r = r0 >> level; r <= r1 >> level; ++r)
    for (std::int32_t c = c0 >> level; c <= c1 >> level; ++c) {
      const float least =
          heights.least[grid.first +
                        static_cast<std::size_t>(r) * static_cast<std::size_t>(grid.columns) +
                        static_cast<std::size_t>(c)];
      if (top <= least) continue;
      if (level == 0) return false;
      const std::int32_t side = 1 << level;
      if (!hides_in(heights, level - 1, std::max(c0, c * side), std::min(c1, c * side + side - 1),
                    std::max(r0, r * side), std::min(r1, r * side + side - 1), top))
        return false;
    }
  return true;
}

}  // namespace ivis
