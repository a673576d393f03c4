#include "occluders/void_space.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <mutex>

namespace ivis {
namespace {

constexpr double kMostSeamM = 1e-4;

/// What float32 corners of neighbouring solids marked `only` may come apart by: as sheets close it.
double seam_of(const ConvexPiece& piece) {
  if (!piece.only) return 0;
  const Vec3 far = glm::max(glm::abs(piece.solid.bounds.lo), glm::abs(piece.solid.bounds.hi));
  const auto f = static_cast<float>(std::max({far.x, far.y, far.z}));
  const float step = std::nextafter(f, std::numeric_limits<float>::infinity()) - f;
  return std::min(kMostSeamM, 4 * static_cast<double>(step));
}

struct Body {
  const ConvexSolid* solid;
  double seam;
};

/// Convex polyhedron as the rings of its faces, for cutting small boxes.
struct Cell {
  std::vector<std::vector<Vec3>> faces;
};

Cell cell_of(const Aabb& b) {
  const auto p = [&](int i) {
    return Vec3{(i & 1) != 0 ? b.hi.x : b.lo.x, (i & 2) != 0 ? b.hi.y : b.lo.y, (i & 4) != 0 ? b.hi.z : b.lo.z};
  };
  Cell cell;
  for (const auto& f : {std::array<int, 4>{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}})
    cell.faces.push_back({p(f[0]), p(f[1]), p(f[2]), p(f[3])});
  return cell;
}

/// The part with normal.x <= offset, or the other; empty when nothing of more than `thin` is left on that side.
Cell cut(const Cell& cell, const ConvexSolid::Plane& plane, double offset, bool inside, double thin) {
  Cell out;
  std::vector<Vec3> rim;
  double farthest = 0;
  const auto side = [&](const Vec3& p) {
    const double d = glm::dot(plane.normal, p) - offset;
    return inside ? -d : d;
  };
  for (const auto& ring : cell.faces) {
    std::vector<Vec3> kept;
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vec3& a = ring[i];
      const Vec3& b = ring[(i + 1) % ring.size()];
      const double da = side(a);
      const double db = side(b);
      farthest = std::max(farthest, da);
      if (da >= 0) kept.push_back(a);
      if ((da >= 0) != (db >= 0)) {
        kept.push_back(a + (b - a) * (da / (da - db)));
        rim.push_back(kept.back());
      }
    }
    if (kept.size() >= 3) out.faces.push_back(std::move(kept));
  }
  if (farthest <= thin) return {};
  // The order of the new face's corners does not matter: only which points there are is asked later.
  if (rim.size() >= 3) out.faces.push_back(std::move(rim));
  return out;
}

class Grid {
 public:
  Grid(const Aabb& bounds, double cell) : origin_(bounds.lo), cell_(cell) {
    const Vec3 size = bounds.size() / cell;
    for (int i = 0; i < 3; ++i) n_[i] = static_cast<std::int64_t>(std::ceil(size[i])) + 1;
    words_ = static_cast<std::size_t>((n_[0] + 63) / 64);
    open_.assign(words_ * static_cast<std::size_t>(n_[1] * n_[2]), 0);
  }
  std::int64_t n(int axis) const { return n_[axis]; }
  std::size_t words() const { return words_; }
  std::uint64_t* row(std::int64_t y, std::int64_t z) { return open_.data() + static_cast<std::size_t>(z * n_[1] + y) * words_; }
  bool test(std::int64_t x, std::int64_t y, std::int64_t z) { return (row(y, z)[x >> 6] >> (x & 63) & 1U) != 0; }
  void set(std::int64_t x, std::int64_t y, std::int64_t z) { row(y, z)[x >> 6] |= std::uint64_t{1} << (x & 63); }
  void clear(std::int64_t x, std::int64_t y, std::int64_t z) { row(y, z)[x >> 6] &= ~(std::uint64_t{1} << (x & 63)); }
  Aabb box(const std::array<std::int64_t, 3>& lo, const std::array<std::int64_t, 3>& hi) const {
    Aabb b;
    for (int i = 0; i < 3; ++i) {
      b.lo[i] = origin_[i] + static_cast<double>(lo[static_cast<std::size_t>(i)]) * cell_;
      b.hi[i] = origin_[i] + static_cast<double>(hi[static_cast<std::size_t>(i)]) * cell_;
    }
    return b;
  }
  std::int64_t index(double v, int axis) const {
    return std::clamp(static_cast<std::int64_t>(std::floor((v - origin_[axis]) / cell_)), std::int64_t{0}, n_[axis] - 1);
  }

 private:
  Vec3 origin_;
  double cell_;
  std::array<std::int64_t, 3> n_{};
  std::size_t words_ = 0;
  std::vector<std::uint64_t> open_;
};

enum class Lies { kIn, kOut, kAcross };

Lies lies(const Aabb& b, const Body& body) {
  if (!body.solid->bounds.overlaps({b.lo - body.seam, b.hi + body.seam})) return Lies::kOut;
  const Vec3 c = b.centre();
  const Vec3 half = b.size() * 0.5;
  bool in = true;
  for (const ConvexSolid::Plane& p : body.solid->planes) {
    const double d = glm::dot(p.normal, c) - p.offset - body.seam;
    const double r = glm::dot(glm::abs(p.normal), half);
    if (d >= r) return Lies::kOut;
    in = in && d <= -r;
  }
  return in ? Lies::kIn : Lies::kAcross;
}

/// Does the union of bodies[from..] hold the cell, slivers thinner than a hundredth of a seam aside?
bool covered(const Cell& cell, const std::vector<Body>& bodies, std::size_t from, int budget) {
  if (cell.faces.size() < 4) return true;
  if (from == bodies.size() || budget == 0) return false;
  Cell rest = cell;
  for (const ConvexSolid::Plane& p : bodies[from].solid->planes) {
    const double offset = p.offset + bodies[from].seam;
    const double thin = bodies[from].seam * 0.01;
    const Cell outside = cut(rest, p, offset, false, thin);
    if (!outside.faces.empty() && !covered(outside, bodies, from + 1, budget - 1)) return false;
    rest = cut(rest, p, offset, true, thin);
    if (rest.faces.empty()) break;
  }
  return true;
}

class Finder {
 public:
  Finder(Grid& grid, const Context& context) : grid_(grid), context_(context) {}

  void open(std::array<std::int64_t, 3> lo, std::array<std::int64_t, 3> hi, const std::vector<Body>& around) {
    if (context_.stopped() || lo[0] >= hi[0] || lo[1] >= hi[1] || lo[2] >= hi[2]) return;
    const Aabb b = grid_.box(lo, hi);
    std::vector<Body> here;
    for (const Body& body : around) {
      const Lies where = lies(b, body);
      if (where == Lies::kIn) return;
      if (where == Lies::kAcross) here.push_back(body);
    }
    const std::int64_t longest = std::max({hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]});
    if (here.empty() || longest == 1) {
      if (!here.empty() && holds(b, here)) return;
      for (std::int64_t z = lo[2]; z < hi[2]; ++z)
        for (std::int64_t y = lo[1]; y < hi[1]; ++y)
          for (std::int64_t x = lo[0]; x < hi[0]; ++x) grid_.set(x, y, z);
      return;
    }
    std::array<std::int64_t, 3> middle{};
    for (std::size_t i = 0; i < 3; ++i) middle[i] = hi[i] - lo[i] > 1 ? lo[i] + (hi[i] - lo[i]) / 2 : hi[i];
    for (int part = 0; part < 8; ++part) {
      std::array<std::int64_t, 3> from{};
      std::array<std::int64_t, 3> to{};
      for (std::size_t i = 0; i < 3; ++i) {
        const bool upper = (part >> i & 1) != 0;
        from[i] = upper ? middle[i] : lo[i];
        to[i] = upper ? hi[i] : middle[i];
      }
      open(from, to, here);
    }
  }

 private:
  static bool holds(const Aabb& b, const std::vector<Body>& here) {
    if (here.size() < 2) return false;
    for (int i = 0; i < 8; ++i) {
      const Vec3 p{(i & 1) != 0 ? b.hi.x : b.lo.x, (i & 2) != 0 ? b.hi.y : b.lo.y, (i & 4) != 0 ? b.hi.z : b.lo.z};
      const bool in = std::any_of(here.begin(), here.end(), [&](const Body& body) {
        return std::all_of(body.solid->planes.begin(), body.solid->planes.end(),
                           [&](const ConvexSolid::Plane& q) { return glm::dot(q.normal, p) <= q.offset + body.seam; });
      });
      if (!in) return false;
    }
    return here.size() <= 12 && covered(cell_of(b), here, 0, 12);
  }

  Grid& grid_;
  const Context& context_;
};

/// Clears all open voxels that a path of open voxels joins to the seeds.
void flood(Grid& grid, std::vector<std::array<std::int64_t, 3>> stack) {
  const auto take = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
    if (x < 0 || y < 0 || z < 0 || x >= grid.n(0) || y >= grid.n(1) || z >= grid.n(2) || !grid.test(x, y, z)) return;
    grid.clear(x, y, z);
    stack.push_back({x, y, z});
  };
  auto seeds = std::move(stack);
  stack.clear();
  for (const auto& s : seeds) take(s[0], s[1], s[2]);
  while (!stack.empty()) {
    const auto [x, y, z] = stack.back();
    stack.pop_back();
    take(x - 1, y, z);
    take(x + 1, y, z);
    take(x, y - 1, z);
    take(x, y + 1, z);
    take(x, y, z - 1);
    take(x, y, z + 1);
  }
}

/// Greedy boxes over the voxels that are left: a run along x, then as far as it goes along y, then z.
std::vector<Aabb> boxes_of(Grid& grid) {
  std::vector<Aabb> boxes;
  const auto all = [&](std::int64_t x0, std::int64_t x1, std::int64_t y, std::int64_t z) {
    for (std::int64_t x = x0; x < x1; ++x)
      if (!grid.test(x, y, z)) return false;
    return true;
  };
  for (std::int64_t z = 0; z < grid.n(2); ++z)
    for (std::int64_t y = 0; y < grid.n(1); ++y)
      for (std::int64_t x = 0; x < grid.n(0); ++x) {
        if ((x & 63) == 0 && grid.row(y, z)[x >> 6] == 0) {
          x += 63;
          continue;
        }
        if (!grid.test(x, y, z)) continue;
        std::int64_t x1 = x + 1;
        while (x1 < grid.n(0) && grid.test(x1, y, z)) ++x1;
        std::int64_t y1 = y + 1;
        while (y1 < grid.n(1) && all(x, x1, y1, z)) ++y1;
        std::int64_t z1 = z + 1;
        const auto slab = [&](std::int64_t level) {
          for (std::int64_t v = y; v < y1; ++v)
            if (!all(x, x1, v, level)) return false;
          return true;
        };
        while (z1 < grid.n(2) && slab(z1)) ++z1;
        for (std::int64_t w = z; w < z1; ++w)
          for (std::int64_t v = y; v < y1; ++v)
            for (std::int64_t u = x; u < x1; ++u) grid.clear(u, v, w);
        boxes.push_back(grid.box({x, y, z}, {x1, y1, z1}));
      }
  return boxes;
}

}  // namespace

Result<std::vector<Aabb>> find_void(const std::vector<ConvexPiece>& solids, const std::vector<Vec3>& seeds,
                                    const VoidOptions& options, const Context& context) {
  if (solids.empty() || seeds.empty()) return std::vector<Aabb>{};
  Aabb bounds;
  std::vector<Body> bodies;
  for (const ConvexPiece& p : solids) {
    bounds.add(p.solid.bounds);
    bodies.push_back({&p.solid, seam_of(p)});
  }
  double cell = options.cell_m;
  const auto count = [&](double c) {
    const Vec3 n = bounds.size() / c + Vec3{4};
    return n.x * n.y * n.z;
  };
  while (count(cell) > static_cast<double>(options.max_voxels)) cell *= 1.25;
  // A row of voxels around everything, so that all that is outside hangs together.
  bounds.lo -= Vec3{1.5 * cell};
  bounds.hi += Vec3{1.5 * cell};
  Grid grid(bounds, cell);

  // Parts of the grid for progress's sake and so that each looks at few solids.
  constexpr std::int64_t kPart = 64;
  const auto parts = [&](int axis) { return (grid.n(axis) + kPart - 1) / kPart; };
  const auto total = static_cast<std::size_t>(parts(0) * parts(1) * parts(2));
  std::atomic<std::size_t> done{0};
  std::mutex report;
  parallel_for(context, static_cast<std::size_t>(parts(1) * parts(2)), [&](std::size_t i) {
    // Parts along x share words of bits: one thread does a row of parts.
    const auto py = static_cast<std::int64_t>(i) % parts(1);
    const auto pz = static_cast<std::int64_t>(i) / parts(1);
    for (std::int64_t px = 0; px < parts(0); ++px) {
      const std::array<std::int64_t, 3> lo{px * kPart, py * kPart, pz * kPart};
      const std::array<std::int64_t, 3> hi{std::min(lo[0] + kPart, grid.n(0)), std::min(lo[1] + kPart, grid.n(1)),
                                           std::min(lo[2] + kPart, grid.n(2))};
      Finder(grid, context).open(lo, hi, bodies);
      const std::size_t so_far = ++done;
      const std::lock_guard lock(report);
      context.report("void", so_far, total);
    }
  });
  if (context.stopped()) return cancelled();

  std::vector<std::array<std::int64_t, 3>> starts;
  for (const Vec3& s : seeds)
    if (bounds.contains(s)) starts.push_back({grid.index(s.x, 0), grid.index(s.y, 1), grid.index(s.z, 2)});
    else starts.push_back({0, 0, 0});
  // With every seed inside matter nothing is known to be shut off from anybody.
  if (std::none_of(starts.begin(), starts.end(), [&](const auto& v) { return grid.test(v[0], v[1], v[2]); }))
    return std::vector<Aabb>{};
  flood(grid, std::move(starts));
  return boxes_of(grid);
}

}  // namespace ivis
