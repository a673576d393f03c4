#include "occluders/voxel_erosion.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <tuple>

#include "core/assert.h"

namespace ivis {
namespace {

constexpr std::size_t kSide = BitWindow::kCube;
constexpr double kShrink = 1e-9;  // voxels: of a corner towards 0, more than the arithmetic loses

/// Does V + B(margin) hold q >= 0, or can no direction be found that shows the contrary?
bool may_hold(const Reach& reach, double margin, const Vec3& q) {
  const Vec3& e = reach.half_extents();
  switch (reach.kind()) {
    case Reach::Kind::kBox:
      return glm::length(glm::max(q - e, 0.0)) <= margin;
    case Reach::Kind::kDisc:
    case Reach::Kind::kCylinder:
      return std::hypot(std::max(std::hypot(q.x, q.z) - e.x, 0.0), std::max(q.y - e.y, 0.0)) <=
             margin;
    case Reach::Kind::kBall:
    case Reach::Kind::kEllipsoid:
      break;
  }
  if (reach.contains(q)) return true;
  // The nearest point of the ellipsoid is x = e^2 q / (e^2 + t) with x on its surface; any t gives
  // a direction q - x that may separate, the right one surely does.
  double lo = 0;
  double hi = glm::length(q) * std::max({e.x, e.y, e.z}) + 1;
  Vec3 n{0};
  for (int i = 0; i < 100; ++i) {
    const double t = (lo + hi) / 2;
    Vec3 x{0};
    double f = 0;
    for (int a = 0; a < 3; ++a) {
      const double s = e[a] * e[a] + t;
      x[a] = s > 0 ? e[a] * e[a] * q[a] / s : 0;
      f += e[a] > 0 ? x[a] * x[a] / (e[a] * e[a]) : 0;
    }
    n = q - x;
    (f > 1 ? lo : hi) = t;
  }
  return glm::dot(q, n) <= reach.support(n) + margin * glm::length(n);
}

/// Largest d >= 0 for which inside(d), which holds at 0 and is monotonic.
template <class F>
std::int32_t last(const F& inside, std::int32_t limit) {
  std::int32_t lo = 0;
  std::int32_t hi = limit;
  while (lo < hi) {
    const std::int32_t mid = lo + (hi - lo + 1) / 2;
    if (inside(mid)) {
      lo = mid;
    } else {
      hi = mid - 1;
    }
  }
  return lo;
}

/// Least coordinate of the voxels that voxel 0 overlaps while it moves to d: all shifts in
/// (d - 1, d + 1).
double near_corner(std::int32_t d, double cell) {
  return std::max(d - 1 - kShrink, 0.0) * cell;
}

}  // namespace

IVec3 structuring_radius(const Reach& reach, double margin_m, double cell_m) {
  const auto radius = [&](double extent) {
    return static_cast<std::int32_t>(std::min(std::ceil((extent + margin_m) / cell_m + 2), 0x1p30));
  };
  const Vec3& e = reach.half_extents();
  const IVec3 limit{radius(e.x), radius(e.y), radius(e.z)};
  const auto along = [&](int axis, std::int32_t most) {
    return last(
        [&](std::int32_t d) {
          Vec3 q{0};
          q[axis] = near_corner(d, cell_m);
          return may_hold(reach, margin_m, q);
        },
        most);
  };
  return {along(0, limit.x), along(1, limit.y), along(2, limit.z)};
}

StructuringElement structuring_element(const Reach& reach, double margin_m, double cell_m) {
  StructuringElement out;
  out.radius = structuring_radius(reach, margin_m, cell_m);
  for (std::int32_t dz = 0; dz <= out.radius.z; ++dz)
    for (std::int32_t dy = 0; dy <= out.radius.y; ++dy) {
      const auto holds = [&](std::int32_t dx) {
        return may_hold(
            reach, margin_m,
            {near_corner(dx, cell_m), near_corner(dy, cell_m), near_corner(dz, cell_m)});
      };
      if (!holds(0)) break;
      const std::int32_t half = last(holds, out.radius.x);
      for (const std::int32_t sy : {1, -1})
        for (const std::int32_t sz : {1, -1})
          if ((dy > 0 || sy > 0) && (dz > 0 || sz > 0))
            out.runs.push_back({sy * dy, sz * dz, half});
    }
  // Among runs of a length the farthest first: where nothing fits, that shows soonest.
  std::sort(out.runs.begin(), out.runs.end(),
            [](const StructuringElement::Run& a, const StructuringElement::Run& b) {
              const auto far = [](const StructuringElement::Run& r) {
                return -(std::abs(r.dy) + std::abs(r.dz));
              };
              return std::tuple(a.half, far(a), a.dz, a.dy) <
                     std::tuple(b.half, far(b), b.dz, b.dy);
            });
  return out;
}

BitCube erode_cube(const BitWindow& window, const StructuringElement& element,
                   const BitCube& within) {
  const std::int32_t ry = element.radius.y;
  const std::int32_t rz = element.radius.z;
  IVIS_ASSERT(element.radius.x <= window.pad().x && ry <= window.pad().y && rz <= window.pad().z,
              "the window does not hold what the element reaches");
  BitCube out = within;
  std::vector<std::uint32_t> alive;  // rows of the cube in which something is left
  for (std::uint32_t i = 0; i < out.size(); ++i)
    if (out[i] != 0) alive.push_back(i);
  // narrowed: each row's middle word after erosion along x by the current half length.
  const std::int32_t rows_y = BitWindow::kCube + 2 * ry;
  const std::int32_t rows_z = BitWindow::kCube + 2 * rz;
  std::vector<std::uint64_t> narrowed(static_cast<std::size_t>(rows_y) *
                                      static_cast<std::size_t>(rows_z));
  const std::int32_t middle = window.words() / 2;
  const auto at = [&](std::int32_t y, std::int32_t z) {
    return static_cast<std::size_t>(y + ry) +
           static_cast<std::size_t>(rows_y) * static_cast<std::size_t>(z + rz);
  };
  /// 64 bits of a row from x on.
  const auto word = [&](const std::uint64_t* row, std::int32_t x) {
    const std::int32_t bit = x + 64 * middle;
    const std::int32_t w = bit >> 6;
    const auto s = static_cast<unsigned>(bit & 63);
    return s == 0 ? row[w] : (row[w] >> s) | (row[w + 1] << (64 - s));
  };
  for (std::int32_t z = -rz; z < BitWindow::kCube + rz; ++z)
    for (std::int32_t y = -ry; y < BitWindow::kCube + ry; ++y)
      narrowed[at(y, z)] = window.row(y, z)[middle];
  std::int32_t half = 0;
  for (std::size_t r = 0; r < element.runs.size() && !alive.empty();) {
    for (; half < element.runs[r].half;) {
      ++half;
      for (std::int32_t z = -rz; z < BitWindow::kCube + rz; ++z)
        for (std::int32_t y = -ry; y < BitWindow::kCube + ry; ++y) {
          std::uint64_t& n = narrowed[at(y, z)];
          if (n == 0) continue;
          const std::uint64_t* row = window.row(y, z);
          n &= word(row, half) & word(row, -half);
        }
    }
    for (; r < element.runs.size() && element.runs[r].half == half; ++r) {
      const auto& run = element.runs[r];
      bool died = false;
      for (const std::uint32_t i : alive) {
        const auto y = static_cast<std::int32_t>(i % kSide);
        const auto z = static_cast<std::int32_t>(i / kSide);
        out[i] &= narrowed[at(y + run.dy, z + run.dz)];
        died = died || out[i] == 0;
      }
      if (died) std::erase_if(alive, [&](std::uint32_t i) { return out[i] == 0; });
      if (alive.empty()) break;
    }
  }
  return out;
}

std::vector<VoxelBox> greedy_boxes(BitCube bits) {
  std::vector<VoxelBox> boxes;
  for (std::size_t z = 0; z < kSide; ++z)
    for (std::size_t y = 0; y < kSide; ++y)
      while (bits[y + kSide * z] != 0) {
        const std::uint64_t row = bits[y + kSide * z];
        const int x = std::countr_zero(row);
        const int n = std::countr_one(row >> static_cast<unsigned>(x));
        const std::uint64_t mask =
            (n == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << static_cast<unsigned>(n)) - 1)
            << static_cast<unsigned>(x);
        std::size_t y1 = y + 1;
        while (y1 < kSide && (bits[y1 + kSide * z] & mask) == mask)
          ++y1;
        std::size_t z1 = z + 1;
        const auto layer = [&](std::size_t k) {
          for (std::size_t j = y; j < y1; ++j)
            if ((bits[j + kSide * k] & mask) != mask) return false;
          return true;
        };
        while (z1 < kSide && layer(z1))
          ++z1;
        for (std::size_t k = z; k < z1; ++k)
          for (std::size_t j = y; j < y1; ++j)
            bits[j + kSide * k] &= ~mask;
        boxes.push_back({{x, static_cast<std::int32_t>(y), static_cast<std::int32_t>(z)},
                         {x + n, static_cast<std::int32_t>(y1), static_cast<std::int32_t>(z1)}});
      }
  return boxes;
}

namespace {

/// Collects faces, sharing corners.
class Mesher {
 public:
  void face(const IVec3& a, const IVec3& b, const IVec3& c, const IVec3& d) {
    mesh_.faces.push_back({point(a), point(b), point(c), point(d)});
  }
  FaceMesh take() { return std::move(mesh_); }

 private:
  std::uint32_t point(const IVec3& p) {
    const auto [it, fresh] = index_.try_emplace(std::tuple(p.x, p.y, p.z),
                                                static_cast<std::uint32_t>(mesh_.points.size()));
    if (fresh) mesh_.points.emplace_back(p.x, p.y, p.z);
    return it->second;
  }
  FaceMesh mesh_;
  std::map<std::tuple<std::int32_t, std::int32_t, std::int32_t>, std::uint32_t> index_;
};

/// A rectangle across `axis` at `at`, [i0, i1) x [j0, j1) along the two axes that follow.
void rectangle(Mesher& mesher, int axis, bool positive, std::int32_t at, std::int32_t i0,
               std::int32_t i1, std::int32_t j0, std::int32_t j1) {
  const auto corner = [&](std::int32_t i, std::int32_t j) {
    IVec3 p;
    (axis == 0 ? p.x : axis == 1 ? p.y : p.z) = at;
    (axis == 0 ? p.y : axis == 1 ? p.z : p.x) = i;
    (axis == 0 ? p.z : axis == 1 ? p.x : p.y) = j;
    return p;
  };
  // (axis, i, j) is right-handed: i then j turns counter-clockwise seen from +axis.
  if (positive) {
    mesher.face(corner(i0, j0), corner(i1, j0), corner(i1, j1), corner(i0, j1));
  } else {
    mesher.face(corner(i0, j0), corner(i0, j1), corner(i1, j1), corner(i1, j0));
  }
}

}  // namespace

FaceMesh boundary_rectangles(const BitCube& bits) {
  Mesher mesher;
  IVec3 lo{64, 64, 64};
  IVec3 hi{-1, -1, -1};
  for (std::size_t i = 0; i < bits.size(); ++i) {
    if (bits[i] == 0) continue;
    const auto y = static_cast<std::int32_t>(i % kSide);
    const auto z = static_cast<std::int32_t>(i / kSide);
    lo = {std::min(lo.x, std::countr_zero(bits[i])), std::min(lo.y, y), std::min(lo.z, z)};
    hi = {std::max(hi.x, 63 - std::countl_zero(bits[i])), std::max(hi.y, y), std::max(hi.z, z)};
  }
  const auto get = [&](std::int32_t x, std::int32_t y, std::int32_t z) {
    return x >= 0 && y >= 0 && z >= 0 && x < 64 && y < 64 && z < 64 &&
           ((bits[static_cast<std::size_t>(y) + kSide * static_cast<std::size_t>(z)] >>
             static_cast<unsigned>(x)) &
            1U) != 0;
  };
  const std::int32_t from[3] = {lo.x, lo.y, lo.z};
  const std::int32_t to[3] = {hi.x, hi.y, hi.z};
  for (int axis = 0; axis < 3; ++axis) {
    const int ai = (axis + 1) % 3;
    const int aj = (axis + 2) % 3;
    for (const bool positive : {false, true})
      for (std::int32_t at = from[axis]; at <= to[axis]; ++at) {
        // rows[j]: the exposed sides along i.
        std::array<std::uint64_t, kSide> rows{};
        for (std::int32_t j = from[aj]; j <= to[aj]; ++j)
          for (std::int32_t i = from[ai]; i <= to[ai]; ++i) {
            std::int32_t p[3];
            p[axis] = at;
            p[ai] = i;
            p[aj] = j;
            if (!get(p[0], p[1], p[2])) continue;
            p[axis] += positive ? 1 : -1;
            if (!get(p[0], p[1], p[2]))
              rows[static_cast<std::size_t>(j)] |= std::uint64_t{1} << static_cast<unsigned>(i);
          }
        for (std::size_t j = 0; j < kSide; ++j)
          while (rows[j] != 0) {
            const int i = std::countr_zero(rows[j]);
            const int n = std::countr_one(rows[j] >> static_cast<unsigned>(i));
            const std::uint64_t mask =
                (n == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << static_cast<unsigned>(n)) - 1)
                << static_cast<unsigned>(i);
            std::size_t j1 = j;
            while (j1 < kSide && (rows[j1] & mask) == mask)
              rows[j1++] &= ~mask;
            rectangle(mesher, axis, positive, at + (positive ? 1 : 0), i, i + n,
                      static_cast<std::int32_t>(j), static_cast<std::int32_t>(j1));
          }
      }
  }
  return mesher.take();
}

FaceMesh box_faces(const std::vector<VoxelBox>& boxes) {
  FaceMesh out;
  for (const VoxelBox& b : boxes) {
    Mesher mesher;
    const std::int32_t lo[3] = {b.lo.x, b.lo.y, b.lo.z};
    const std::int32_t hi[3] = {b.hi.x, b.hi.y, b.hi.z};
    for (int axis = 0; axis < 3; ++axis) {
      const int ai = (axis + 1) % 3;
      const int aj = (axis + 2) % 3;
      rectangle(mesher, axis, false, lo[axis], lo[ai], hi[ai], lo[aj], hi[aj]);
      rectangle(mesher, axis, true, hi[axis], lo[ai], hi[ai], lo[aj], hi[aj]);
    }
    const FaceMesh one = mesher.take();
    const auto base = static_cast<std::uint32_t>(out.points.size());
    out.points.insert(out.points.end(), one.points.begin(), one.points.end());
    for (auto f : one.faces) {
      for (std::uint32_t& c : f)
        c += base;
      out.faces.push_back(f);
    }
  }
  return out;
}

}  // namespace ivis
