#pragma once
// Which boxes of a regular block does a triangle touch? Errs towards touching.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "occluders/voxel_grid.h"

namespace ivis {

/// The separating axes of a triangle and axis-parallel boxes: three of the box, the normal, and the
/// nine products of edges with the box's axes, these as three sets of lines in the planes yz, zx,
/// xy. Guarantee: a box that the triangle touches is never called untouched. Any axis along which
/// the two
///            are apart proves them apart, so the axes' own rounding does not matter; what the
///            products with corners lose is below 16 * 2^-52 * |coordinate| * |axis|_1, far less
///            than `slack` for coordinates up to 2^22 voxels, and boxes are tested grown by `slack`
///            on all sides.
class TriangleBox {
 public:
  static constexpr double kSlack = 1e-6;  ///< voxels

  TriangleBox() = default;
  explicit TriangleBox(const GridTriangle& t) {
    lo_ = glm::min(t.v[0], glm::min(t.v[1], t.v[2]));
    hi_ = glm::max(t.v[0], glm::max(t.v[1], t.v[2]));
    const std::array<Vec3, 3> edge{t.v[1] - t.v[0], t.v[2] - t.v[1], t.v[0] - t.v[2]};
    plane_.axis = glm::cross(edge[0], edge[1]);
    set(plane_.lo, plane_.hi, [&](std::size_t k) { return glm::dot(plane_.axis, t.v[k]); });
    for (int a = 0; a < 3; ++a) {
      const int i = (a + 1) % 3;
      const int j = (a + 2) % 3;
      for (std::size_t e = 0; e < 3; ++e) {
        Line& line = lines_[static_cast<std::size_t>(a)][e];
        line.i = -edge[e][j];
        line.j = edge[e][i];
        set(line.lo, line.hi,
            [&](std::size_t k) { return line.i * t.v[k][i] + line.j * t.v[k][j]; });
      }
    }
  }

  const Vec3& lo() const { return lo_; }
  const Vec3& hi() const { return hi_; }

  /// Boxes of side `step` whose least corner is at corner + step * (x, y, z), 0 <= x, y, z < N:
  /// bit x + N y of word z.
  template <int N>
  std::array<std::uint64_t, static_cast<std::size_t>(N)> touched(const Vec3& corner,
                                                                 double step) const {
    std::array<std::uint64_t, static_cast<std::size_t>(N)> out{};
    const double r = step / 2 + kSlack;
    std::array<std::array<double, static_cast<std::size_t>(N)>, 3> c;
    std::array<unsigned, 3> range{};
    for (int a = 0; a < 3; ++a)
      for (int k = 0; k < N; ++k) {
        const double m = corner[a] + step * (k + 0.5);
        c[static_cast<std::size_t>(a)][static_cast<std::size_t>(k)] = m;
        if (m + r >= lo_[a] && m - r <= hi_[a]) range[static_cast<std::size_t>(a)] |= 1U << k;
      }
    if (range[0] == 0 || range[1] == 0 || range[2] == 0) return out;
    // sides[a][j]: the boxes i of row j, in the plane across axis a, that no line keeps away.
    std::array<std::array<unsigned, static_cast<std::size_t>(N)>, 3> sides;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t i = (a + 1) % 3;
      const std::size_t j = (a + 2) % 3;
      sides[a].fill(range[i]);
      for (const Line& line : lines_[a]) {
        const double grow = r * (std::abs(line.i) + std::abs(line.j));
        for (std::size_t q = 0; q < static_cast<std::size_t>(N); ++q) {
          const double part = line.j * c[j][q];
          unsigned row = 0;
          for (std::size_t p = 0; p < static_cast<std::size_t>(N); ++p) {
            const double d = line.i * c[i][p] + part;
            row |= static_cast<unsigned>(d + grow >= line.lo && d - grow <= line.hi) << p;
          }
          sides[a][q] &= row;
        }
      }
    }
    const double grow =
        r * (std::abs(plane_.axis.x) + std::abs(plane_.axis.y) + std::abs(plane_.axis.z));
    for (std::size_t z = 0; z < static_cast<std::size_t>(N); ++z) {
      if (((range[2] >> z) & 1U) == 0) continue;
      for (std::size_t y = 0; y < static_cast<std::size_t>(N); ++y) {
        // across x: rows z hold y; across y: rows x hold z; across z: rows y hold x.
        if (((range[1] >> y) & 1U) == 0 || ((sides[0][z] >> y) & 1U) == 0) continue;
        const double part = plane_.axis.y * c[1][y] + plane_.axis.z * c[2][z];
        unsigned row = 0;
        for (std::size_t x = 0; x < static_cast<std::size_t>(N); ++x) {
          const double d = plane_.axis.x * c[0][x] + part;
          row |= (static_cast<unsigned>(d + grow >= plane_.lo && d - grow <= plane_.hi) &
                  (sides[1][x] >> z))
                 << x;
        }
        out[z] |= static_cast<std::uint64_t>(row & sides[2][y])
                  << (static_cast<std::size_t>(N) * y);
      }
    }
    return out;
  }

 private:
  struct Line {
    double i = 0, j = 0, lo = 0, hi = 0;
  };
  struct Plane {
    Vec3 axis{0};
    double lo = 0, hi = 0;
  };

  template <class F>
  static void set(double& lo, double& hi, const F& at) {
    lo = std::min({at(0), at(1), at(2)});
    hi = std::max({at(0), at(1), at(2)});
  }

  Vec3 lo_{0};
  Vec3 hi_{0};
  Plane plane_;
  std::array<std::array<Line, 3>, 3> lines_;
};

}  // namespace ivis
