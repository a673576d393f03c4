#include "occluders/leak_test.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>

#include "occluders/progress.h"
#include "occluders/rect_tree.h"
#include "occluders/triangle_box.h"
#include "occluders/voxel_rays.h"

namespace ivis {
namespace {

using State = LeakReport::State;

// ---- Closed surfaces
// -------------------------------------------------------------------------------

/// Sign of the volume of p, a, b, c seen from p (all relative to it), or 0 when rounding may have
/// turned it. The determinant's error is below 10 * 2^-53 * 6 * m^3 with m the largest coordinate.
int side(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double det = glm::dot(a, glm::cross(b, c));
  double m = 0;
  for (const Vec3* v : {&a, &b, &c})
    m = std::max({m, std::abs(v->x), std::abs(v->y), std::abs(v->z)});
  const double error = 1e-14 * m * m * m;
  return det > error ? 1 : det < -error ? -1 : 0;
}

/// Is p inside the closed surface? Nothing when every direction tried comes too near an edge.
std::optional<bool> inside(const std::vector<GridTriangle>& triangles, std::uint32_t first,
                           const ClosedPiece& piece, const Vec3& p, double length) {
  static const Vec3 kDirections[] = {{0.577, 0.813, 0.079},   {-0.411, 0.887, 0.213},
                                     {0.923, 0.157, -0.351},  {-0.171, -0.613, 0.771},
                                     {0.313, -0.291, -0.904}, {-0.837, -0.119, -0.533}};
  for (const Vec3& d : kDirections) {
    const Vec3 q = d * (2 * length);
    bool odd = false;
    bool sure = true;
    for (const std::uint32_t i : piece) {
      const GridTriangle& t = triangles[first + i];
      const Vec3 a = t.v[0] - p;
      const Vec3 b = t.v[1] - p;
      const Vec3 c = t.v[2] - p;
      const int ab = side(q, a, b);
      const int bc = side(q, b, c);
      const int ca = side(q, c, a);
      // Two opposite signs that are sure mean that the line passes the triangle by.
      if (ab * bc < 0 || bc * ca < 0 || ca * ab < 0) continue;
      const int near = side(a, b, c);
      const int far = side(a - q, b - q, c - q);
      if (near * far > 0) continue;
      if (ab == 0 || bc == 0 || ca == 0 || near == 0 || far == 0) {
        sure = false;
        break;
      }
      odd = !odd;
    }
    if (sure) return odd;
  }
  return std::nullopt;
}

class ClosedSurfaces {
 public:
  ClosedSurfaces(const VoxelGrid& grid, const Barriers& barriers)
      : grid_(grid), barriers_(barriers) {
    std::vector<Box2> boxes;
    for (std::size_t i = 0; i + 1 < barriers.owners.size(); ++i) {
      const auto& o = barriers.owners[i];
      if (barriers.pieces_of(o).empty()) continue;
      owners_.push_back(i);
      boxes.push_back({{o.lo.x, o.lo.z}, {o.hi.x, o.hi.z}});
    }
    tree_ = RectTree(boxes);
  }

  struct Id {
    std::size_t owner, piece;
  };
  std::optional<bool> holds(const Id& id, const Vec3& p) const {
    const Barriers::Owner& o = barriers_.owners[id.owner];
    if (glm::any(glm::lessThan(p, o.lo)) || glm::any(glm::greaterThan(p, o.hi))) return false;
    return inside(grid_.triangles, o.first, barriers_.pieces_of(o)[id.piece], p,
                  glm::length(o.hi - o.lo) + 1);
  }
  /// Those that p is inside of.
  std::vector<Id> around(const Vec3& p) const {
    std::vector<Id> out;
    tree_.all({{p.x, p.z}, {p.x, p.z}}, [&](std::uint32_t k) {
      const Barriers::Owner& o = barriers_.owners[owners_[k]];
      for (std::size_t i = 0; i < barriers_.pieces_of(o).size(); ++i)
        if (holds({owners_[k], i}, p).value_or(false)) out.push_back({owners_[k], i});
      return true;
    });
    return out;
  }

 private:
  const VoxelGrid& grid_;
  const Barriers& barriers_;
  std::vector<std::size_t> owners_;
  RectTree tree_;
};

// ---- Fine flood
// ------------------------------------------------------------------------------------

// A voxel in 4 x 4 x 4 parts: bit x + 4 y + 16 z.
constexpr std::uint64_t kFx0 = 0x1111111111111111ULL;
constexpr std::uint64_t kFx3 = kFx0 << 3U;
constexpr std::uint64_t kFy0 = 0x000f000f000f000fULL;
constexpr std::uint64_t kFy3 = kFy0 << 12U;
constexpr std::uint64_t kFz0 = 0xffffULL;
constexpr std::uint64_t kFz3 = kFz0 << 48U;

std::uint64_t fill_fine(std::uint64_t w, std::uint64_t free) {
  while (true) {
    const std::uint64_t next =
        (w | ((w & ~kFx3) << 1U) | ((w & ~kFx0) >> 1U) | ((w & ~kFy3) << 4U) | ((w & ~kFy0) >> 4U) |
         (w << 16U) | (w >> 16U)) &
        free;
    if (next == w) return w;
    w = next;
  }
}

struct Step {
  int axis;
  bool positive;
  std::uint64_t leave;  // the parts at the side that is left
  std::uint64_t enter;  // those at the side that is entered
  unsigned shift;
};
constexpr Step kSteps[6] = {{0, true, kFx3, kFx0, 3},  {0, false, kFx0, kFx3, 3},
                            {1, true, kFy3, kFy0, 12}, {1, false, kFy0, kFy3, 12},
                            {2, true, kFz3, kFz0, 48}, {2, false, kFz0, kFz3, 48}};

IVec3 moved(IVec3 v, const Step& s) {
  (s.axis == 0 ? v.x : s.axis == 1 ? v.y : v.z) += s.positive ? 1 : -1;
  return v;
}

/// The node or air tiles of each label.
struct Items {
  std::vector<std::size_t> first;  // by label
  std::vector<std::uint64_t> list;
  static constexpr std::uint64_t kNode = std::uint64_t{1} << 63U;

  Items(const VoxelGrid& grid, std::size_t labels) : first(labels + 1, 0) {
    const auto each = [&](const auto& f) {
      for (std::size_t i = 0; i < grid.table.size(); ++i)
        if ((grid.table[i] & VoxelGrid::kAir) != 0) f(grid.table[i] & ~VoxelGrid::kAir, i);
      for (std::size_t n = 0; n < grid.node_label.size(); ++n)
        f(grid.node_label[n], kNode | n);
    };
    each([&](std::uint32_t label, std::uint64_t) {
      if (label > Flooded::kReached) ++first[label + 1];
    });
    std::partial_sum(first.begin(), first.end(), first.begin());
    list.resize(first.back());
    std::vector<std::size_t> at(first.begin(), first.end() - 1);
    each([&](std::uint32_t label, std::uint64_t item) {
      if (label > Flooded::kReached) list[at[label]++] = item;
    });
  }
};

/// Calls f(unmarked voxel of the item, step to a marked neighbour, mixed tile of that neighbour).
template <class F>
void each_border(const VoxelGrid& grid, std::uint64_t item, const F& f) {
  static constexpr TileBits kAll{~0ULL, ~0ULL, ~0ULL, ~0ULL, ~0ULL, ~0ULL, ~0ULL, ~0ULL};
  const bool is_node = (item & Items::kNode) != 0;
  const auto node = static_cast<std::uint32_t>(item);
  const TileBits& bits = is_node ? grid.node_bits[node] : kAll;
  const std::size_t at =
      is_node ? grid.mixed[grid.node_tile[node]].at : static_cast<std::size_t>(item);
  const IVec3 t = grid.tile_at(at);
  const auto report = [&](const TileBits& hits, const IVec3& tile, std::uint32_t mixed,
                          const Step& s) {
    for (int z = 0; z < 8; ++z)
      for (std::uint64_t w = hits[static_cast<std::size_t>(z)]; w != 0; w &= w - 1) {
        const int bit = std::countr_zero(w);
        const IVec3 to{8 * tile.x + bit % 8, 8 * tile.y + bit / 8, 8 * tile.z + z};
        Step back = s;
        back.positive = !back.positive;
        f(moved(to, back), s, mixed);
      }
  };
  for (const Step& s : kSteps) {
    if (is_node) {
      const std::uint32_t m = grid.node_tile[node];
      TileBits in{};
      for (std::size_t z = 0; z < 8; ++z) {
        const std::uint64_t w = bits[z];
        constexpr std::uint64_t kX0 = 0x0101010101010101ULL;
        if (s.axis == 0) in[z] = s.positive ? (w & ~(kX0 << 7U)) << 1U : (w & ~kX0) >> 1U;
        if (s.axis == 1) in[z] = s.positive ? w << 8U : w >> 8U;
        if (s.axis == 2 && s.positive && z > 0) in[z] = bits[z - 1];
        if (s.axis == 2 && !s.positive && z < 7) in[z] = bits[z + 1];
        in[z] &= grid.mixed[m].marked[z];
      }
      if (any(in)) report(in, t, m, s);
    }
    const IVec3 next = moved(t, s);
    if (!grid.tile_inside(next)) continue;
    const std::uint32_t entry = grid.table[grid.tile_index(next)];
    if ((entry & VoxelGrid::kAir) != 0) continue;
    TileBits out = across(bits, s.axis, s.positive);
    for (std::size_t z = 0; z < 8; ++z)
      out[z] &= grid.mixed[entry].marked[z];
    if (any(out)) report(out, next, entry, s);
  }
}

class FineFlood {
 public:
  FineFlood(const VoxelGrid& grid, const LeakOptions& options, const Context& context)
      : grid_(grid), options_(options), context_(context), offset_(grid.mixed_count(), kNone) {}

  /// From the borders of one component; contact(label, voxel) for every unmarked voxel met, also
  /// its own. False when stopped or out of memory.
  template <class F>
  bool from(const Items& items, std::uint32_t label, const F& contact) {
    for (std::size_t i = items.first[label]; i < items.first[label + 1]; ++i) {
      each_border(grid_, items.list[i], [&](const IVec3& v, const Step& s, std::uint32_t mixed) {
        enter(mixed, moved(v, s), s.enter);
      });
      if (!run(contact)) return false;
    }
    return true;
  }

  std::size_t bytes() const {
    return (free_.capacity() + visited_.capacity()) * 8 + offset_.capacity() * 4;
  }
  std::size_t voxels() const { return free_.size(); }
  bool full() const { return full_; }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffU;
  struct Work {
    std::uint32_t mixed;
    IVec3 voxel;
    std::uint64_t parts;
  };

  std::size_t slot(std::uint32_t m, const IVec3& v) const {
    const TileBits& marked = grid_.mixed[m].marked;
    const auto z = static_cast<std::size_t>(v.z & 7);
    int rank = std::popcount(marked[z] & ((std::uint64_t{1} << VoxelGrid::local_bit(v)) - 1));
    for (std::size_t k = 0; k < z; ++k)
      rank += std::popcount(marked[k]);
    return offset_[m] + static_cast<std::size_t>(rank);
  }

  void open(std::uint32_t m) {
    const VoxelGrid::Tile& tile = grid_.mixed[m];
    std::size_t count = 0;
    for (const std::uint64_t w : tile.marked)
      count += static_cast<std::size_t>(std::popcount(w));
    if ((free_.size() + count) * 16 > options_.max_bytes || free_.size() + count >= kNone)
      full_ = true;
    offset_[m] = static_cast<std::uint32_t>(free_.size());
    free_.resize(free_.size() + count, ~std::uint64_t{0});
    visited_.resize(free_.size(), 0);
    const IVec3 at = grid_.tile_at(tile.at);
    for (std::uint32_t i = tile.first_triangle; i < grid_.mixed[m + 1].first_triangle; ++i) {
      const TriangleBox box(grid_.triangles[grid_.tile_triangles[i]]);
      const TileBits bits = box.touched<8>(Vec3(at.x, at.y, at.z) * 8.0, 1);
      for (int z = 0; z < 8; ++z)
        for (std::uint64_t w = bits[static_cast<std::size_t>(z)]; w != 0; w &= w - 1) {
          const int bit = std::countr_zero(w);
          const IVec3 v{8 * at.x + bit % 8, 8 * at.y + bit / 8, 8 * at.z + z};
          const auto fine = box.touched<4>(Vec3(v.x, v.y, v.z), 0.25);
          free_[slot(m, v)] &= ~(fine[0] | fine[1] << 16U | fine[2] << 32U | fine[3] << 48U);
        }
    }
  }

  void enter(std::uint32_t m, const IVec3& v, std::uint64_t parts) {
    if (full_) return;
    if (offset_[m] == kNone) open(m);
    const std::size_t at = slot(m, v);
    const std::uint64_t fresh = parts & free_[at] & ~visited_[at];
    if (fresh == 0) return;
    const std::uint64_t filled = fill_fine(fresh, free_[at] & ~visited_[at]);
    visited_[at] |= filled;
    queue_.push_back({m, v, filled});
  }

  template <class F>
  bool run(const F& contact) {
    while (!queue_.empty()) {
      if (full_ || ((++steps_ & 0xfffU) == 0 && context_.stopped())) return false;
      const Work w = queue_.back();
      queue_.pop_back();
      for (const Step& s : kSteps) {
        const std::uint64_t leaving = w.parts & s.leave;
        if (leaving == 0) continue;
        const IVec3 to = moved(w.voxel, s);
        if (!grid_.inside(to)) continue;
        const std::uint32_t label = grid_.label_at(to);
        if (label != VoxelGrid::kMarked) {
          contact(label, to);
        } else {
          enter(grid_.table[grid_.tile_index({to.x >> 3, to.y >> 3, to.z >> 3})], to,
                s.positive ? leaving >> s.shift : leaving << s.shift);
        }
      }
    }
    return !full_ && !context_.stopped();
  }

  const VoxelGrid& grid_;
  const LeakOptions& options_;
  const Context& context_;
  std::vector<std::uint32_t> offset_;  // by mixed tile, into the two below
  std::vector<std::uint64_t> free_;    // by marked voxel of an opened tile: parts without triangles
  std::vector<std::uint64_t> visited_;
  std::vector<Work> queue_;
  std::size_t steps_ = 0;
  bool full_ = false;
};

// ---- Rays
// ------------------------------------------------------------------------------------------

std::uint64_t mix(std::uint64_t x) {  // splitmix64
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  double operator()() {
    state_ = mix(state_);
    return static_cast<double>(state_ >> 11U) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

class Groups {
 public:
  explicit Groups(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0U); }
  std::uint32_t root(std::uint32_t i) {
    while (parent_[i] != i)
      i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// The part of the segment a..b within the box grown by a hair; false if there is none.
bool clip(const Vec3& lo, const Vec3& hi, Vec3& a, Vec3& b) {
  const Vec3 d = b - a;
  double from = 0;
  double to = 1;
  for (int k = 0; k < 3; ++k) {
    if (d[k] == 0) {
      if (a[k] < lo[k] || a[k] > hi[k]) return false;
      continue;
    }
    const double p = (lo[k] - a[k]) / d[k];
    const double q = (hi[k] - a[k]) / d[k];
    from = std::max(from, std::min(p, q));
    to = std::min(to, std::max(p, q));
  }
  if (!(from < to)) return false;
  b = a + to * d;
  a += from * d;
  return true;
}

/// Looks through the openings that the edges of a tile's triangles may bound: rays that pass an
/// edge closely, in both directions from there. Half run along the triangle (through a slit between
/// two bodies), half anyhow (through a slit in a sheet). Distances from the edge are spread evenly
/// by their logarithm, so that narrow slits are looked for as hard as wide ones. Calls join(label,
/// label, voxel) for two ends in different components.
template <class F>
void look_past_edges(const VoxelGrid& grid, std::uint32_t m, std::size_t each, double tolerance,
                     const F& join) {
  const IVec3 t = grid.tile_at(grid.mixed[m].at);
  const Vec3 lo = Vec3(t.x, t.y, t.z) * 8.0;
  const double least = std::max(4 * tolerance, 1e-4);
  for (std::uint32_t i = grid.mixed[m].first_triangle; i < grid.mixed[m + 1].first_triangle; ++i) {
    const GridTriangle& tri = grid.triangles[grid.tile_triangles[i]];
    const Vec3 cross = glm::cross(tri.v[1] - tri.v[0], tri.v[2] - tri.v[0]);
    const double area = glm::length(cross);
    if (!(area > 0)) continue;
    const Vec3 normal = cross / area;
    for (std::size_t e = 0; e < 3; ++e) {
      Vec3 a = tri.v[e];
      Vec3 b = tri.v[(e + 1) % 3];
      const Vec3 along = (b - a) / std::max(1e-300, glm::length(b - a));
      const Vec3 outward = glm::cross(along, normal);
      if (!clip(lo, lo + 8.0, a, b)) continue;
      Random random(mix((std::uint64_t{m} << 32U) + 4 * std::uint64_t{grid.tile_triangles[i]} + e));
      for (std::size_t k = 0; k < each; ++k) {
        const double off = least * std::pow(0.5 / least, random());
        Vec3 q = a + random() * (b - a);
        Vec3 d{0};
        if (k % 2 == 0) {
          q += (random() < 0.5 ? off : -off) * normal + (random() < 0.5 ? off : -off) * outward;
          d = outward + (1.4 * random() - 0.7) * along;
        } else {
          q += off * outward + (2 * random() - 1) * off * normal;
          d = 2.0 * Vec3(random(), random(), random()) - 1.0;
        }
        const double length = glm::length(d);
        if (!(length > 1e-6) || glm::any(glm::lessThan(q, Vec3{0}))) continue;
        d *= 64 / length;
        std::uint32_t ends[2] = {0, 0};
        IVec3 where;
        for (std::size_t end = 0; end < 2; ++end) {
          walk_ray(grid, q, end == 0 ? d : -d, tolerance, [&](std::uint32_t label, const IVec3& v) {
            ends[end] = label;
            where = v;
            return false;
          });
          if (ends[end] == 0) break;
        }
        if (ends[0] != 0 && ends[1] != 0 && ends[0] != ends[1]) join(ends[0], ends[1], where);
      }
    }
  }
}

struct Contact {
  std::uint32_t label, other;
  IVec3 where;
};

}  // namespace

Result<LeakReport> test_leaks(const VoxelGrid& grid, const Barriers& barriers,
                              const Flooded& flooded, const LeakOptions& options,
                              const Context& context) {
  LeakReport report;
  const std::size_t labels = flooded.components.size();
  report.states.assign(labels, State::kThin);
  report.states[0] = State::kReached;
  report.states[Flooded::kReached] = State::kReached;
  std::vector<std::uint32_t> thick;
  for (std::uint32_t c = 2; c < labels; ++c) {
    const VoxelComponent& k = flooded.components[c];
    if (k.hi.x - k.lo.x + 1 >= options.least_size.x &&
        k.hi.y - k.lo.y + 1 >= options.least_size.y && k.hi.z - k.lo.z + 1 >= options.least_size.z)
      thick.push_back(c);
  }

  // 1. Closed surfaces.
  {
    const ClosedSurfaces surfaces(grid, barriers);
    const auto centre = [](const IVec3& v) { return Vec3(v.x + 0.5, v.y + 0.5, v.z + 0.5); };
    std::vector<Vec3> starts;
    std::vector<std::vector<ClosedSurfaces::Id>> around_start;
    for (const IVec3& s : flooded.starts) {
      starts.push_back(centre(s));
      around_start.push_back(surfaces.around(starts.back()));
    }
    Progress progress(context, "voxels: closed surfaces", thick.size());
    parallel_for(context, thick.size(), [&](std::size_t i) {
      const Vec3 p = centre(flooded.components[thick[i]].sample);
      const auto around = surfaces.around(p);
      bool proven = true;
      for (std::size_t s = 0; s < starts.size() && proven; ++s) {
        const auto apart = [&](const std::vector<ClosedSurfaces::Id>& ids, const Vec3& other) {
          return std::any_of(ids.begin(), ids.end(), [&](const ClosedSurfaces::Id& id) {
            const auto holds = surfaces.holds(id, other);
            return holds.has_value() && !*holds;
          });
        };
        proven = apart(around, starts[s]) || apart(around_start[s], p);
      }
      report.states[thick[i]] = proven ? State::kProven : State::kEvidence;
      progress.step();
    });
    if (context.stopped()) return cancelled();
  }

  // 2 and 3. What is joined by fine flood or rays is tested together; components too thin to test
  // by themselves are when one that matters is joined to them.
  Groups groups(labels);
  std::vector<std::uint32_t> todo;
  for (const std::uint32_t c : thick)
    if (report.states[c] == State::kEvidence) todo.push_back(c);
  if (!todo.empty()) {
    const Items items(grid, labels);
    FineFlood fine(grid, options, context);
    std::vector<char> queued(labels, 0);
    queued[0] = queued[Flooded::kReached] = 1;
    for (const std::uint32_t c : todo)
      queued[c] = 1;
    std::vector<char> leaked(labels, 0);
    const double tolerance = options.tolerance_m / grid.cell;
    std::vector<std::uint32_t> more;
    const auto contact = [&](std::uint32_t from, std::uint32_t to, const IVec3& where,
                             bool by_ray) {
      if (from == to) return;
      groups.join(from, to);
      if (to == Flooded::kReached) {
        if (leaked[from] == 0) report.leaks.push_back({from, where, by_ray});
        leaked[from] = 1;
      } else if (queued[to] == 0) {
        queued[to] = 1;
        if (report.states[to] != State::kProven) more.push_back(to);
      }
    };
    while (!todo.empty()) {
      for (std::size_t i = 0; i < todo.size(); ++i) {
        if (i % 16 == 0) context.report("voxels: fine flood", i, todo.size());
        const std::uint32_t c = todo[i];
        if (!fine.from(items, c,
                       [&](std::uint32_t label, const IVec3& v) { contact(c, label, v, false); })) {
          if (context.stopped()) return cancelled();
          return invalid_argument("the leak test of " + std::to_string(grid.cell) +
                                  " m voxels needs more than its limit of " +
                                  std::to_string(options.max_bytes / 1000000) +
                                  " MB: take larger voxels or raise the limit");
        }
      }
      // Rays from every component not yet known to leak.
      struct Border {
        std::uint32_t label;
        std::uint64_t item;
      };
      std::vector<Border> borders;
      for (const std::uint32_t c : todo)
        if (groups.root(c) != groups.root(Flooded::kReached))
          for (std::size_t i = items.first[c]; i < items.first[c + 1]; ++i)
            borders.push_back({c, items.list[i]});
      constexpr std::size_t kBlock = 64;
      const std::size_t blocks = (borders.size() + kBlock - 1) / kBlock;
      std::vector<std::size_t> faces(blocks, 0);
      std::vector<std::vector<std::uint32_t>> tiles(blocks);
      parallel_for(context, blocks, [&](std::size_t b) {
        for (std::size_t i = b * kBlock; i < std::min(borders.size(), (b + 1) * kBlock); ++i)
          each_border(grid, borders[i].item, [&](const IVec3&, const Step&, std::uint32_t mixed) {
            ++faces[b];
            if (tiles[b].empty() || tiles[b].back() != mixed) tiles[b].push_back(mixed);
          });
        std::sort(tiles[b].begin(), tiles[b].end());
        tiles[b].erase(std::unique(tiles[b].begin(), tiles[b].end()), tiles[b].end());
      });
      if (context.stopped()) return cancelled();
      const std::size_t all_faces = std::accumulate(faces.begin(), faces.end(), std::size_t{0});
      const std::size_t each =
          std::clamp<std::size_t>(options.max_rays / std::max<std::size_t>(1, all_faces), 2, 64);
      report.rays += options.max_rays == 0 ? 0 : each * all_faces;
      std::vector<std::vector<Contact>> found(blocks);
      Progress progress(context, "voxels: leak rays", blocks);
      parallel_for(context, options.max_rays == 0 ? 0 : blocks, [&](std::size_t b) {
        for (std::size_t i = b * kBlock; i < std::min(borders.size(), (b + 1) * kBlock); ++i) {
          if (context.stopped()) return;
          const std::uint32_t label = borders[i].label;
          each_border(grid, borders[i].item, [&](const IVec3& v, const Step& s, std::uint32_t) {
            Random random(mix(grid.tile_index({v.x >> 3, v.y >> 3, v.z >> 3}) * 4096 +
                              VoxelGrid::local_bit(v) * 64 + static_cast<std::size_t>(v.z & 7) * 8 +
                              static_cast<std::size_t>(2 * s.axis + (s.positive ? 1 : 0))));
            for (std::size_t k = 0; k < each; ++k) {
              const Vec3 from{v.x + random(), v.y + random(), v.z + random()};
              // Half of them at the marked voxel beside, half anywhere near it.
              const IVec3 m = moved(v, s);
              const double wide = k % 2 == 0 ? 1 : 3;
              const Vec3 at = Vec3(m.x + 0.5, m.y + 0.5, m.z + 0.5) +
                              wide * (Vec3(random(), random(), random()) - 0.5);
              const Vec3 dir = at - from;
              if (!(glm::dot(dir, dir) > 1e-12)) continue;
              const double reach = 64 / glm::length(dir);
              walk_ray(grid, from, dir * reach, tolerance,
                       [&](std::uint32_t other, const IVec3& w) {
                         if (other == label) return true;
                         const auto same = [&](const Contact& c) {
                           return c.label == label && c.other == other;
                         };
                         if (std::none_of(found[b].begin(), found[b].end(), same))
                           found[b].push_back({label, other, w});
                         return other != Flooded::kReached;
                       });
            }
          });
        }
        progress.step();
      });
      if (context.stopped()) return cancelled();
      for (const auto& list : found)
        for (const Contact& c : list)
          contact(c.label, c.other, c.where, true);

      // Rays past the edges in the tiles that the components border on.
      std::vector<std::uint32_t> beside;
      for (auto& list : tiles) {
        beside.insert(beside.end(), list.begin(), list.end());
        std::vector<std::uint32_t>().swap(list);
      }
      std::sort(beside.begin(), beside.end());
      beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
      std::size_t edges = 0;
      for (const std::uint32_t m : beside)
        edges += 3 * (grid.mixed[m + 1].first_triangle - grid.mixed[m].first_triangle);
      const std::size_t each_edge =
          std::clamp<std::size_t>(options.max_rays / std::max<std::size_t>(1, edges), 4, 64);
      report.rays += options.max_rays == 0 ? 0 : each_edge * edges;
      std::vector<std::vector<Contact>> joined((beside.size() + kBlock - 1) / kBlock);
      Progress edge_progress(context, "voxels: rays past edges", joined.size());
      parallel_for(context, options.max_rays == 0 ? 0 : joined.size(), [&](std::size_t b) {
        for (std::size_t i = b * kBlock; i < std::min(beside.size(), (b + 1) * kBlock); ++i) {
          if (context.stopped()) return;
          look_past_edges(grid, beside[i], each_edge, tolerance,
                          [&](std::uint32_t p, std::uint32_t q, const IVec3& w) {
                            const Contact c{std::max(p, q), std::min(p, q), w};
                            const auto same = [&](const Contact& d) {
                              return d.label == c.label && d.other == c.other;
                            };
                            if (std::none_of(joined[b].begin(), joined[b].end(), same))
                              joined[b].push_back(c);
                          });
        }
        edge_progress.step();
      });
      if (context.stopped()) return cancelled();
      for (const auto& list : joined)
        for (const Contact& c : list) {
          if (queued[c.label] == 0 && queued[c.other] == 0) continue;  // neither matters
          if (queued[c.label] == 0 && c.other == Flooded::kReached) {
            groups.join(c.label, c.other);
            continue;
          }
          contact(c.label, c.other, c.where, true);
          if (c.other != Flooded::kReached) contact(c.other, c.label, c.where, true);
        }
      todo = std::move(more);
      more.clear();
    }
    report.fine_voxels = fine.voxels();
    report.peak_bytes = fine.bytes() + items.list.capacity() * 8 + items.first.capacity() * 8;
  }
  for (std::uint32_t c = 2; c < labels; ++c)
    if (groups.root(c) == groups.root(Flooded::kReached)) report.states[c] = State::kLeaks;
  std::sort(report.leaks.begin(), report.leaks.end(),
            [](const Leak& a, const Leak& b) { return a.label < b.label; });
  return report;
}

}  // namespace ivis
