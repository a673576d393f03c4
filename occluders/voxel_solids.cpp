#include "occluders/voxel_solids.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <tuple>

#include "core/view_cell.h"
#include "occluders/flood.h"
#include "occluders/leak_test.h"
#include "occluders/progress.h"
#include "occluders/voxel_erosion.h"
#include "occluders/voxel_rays.h"
#include "occluders/voxelize.h"

namespace ivis {
namespace {

using State = LeakReport::State;

constexpr std::int32_t kCube = BitWindow::kCube;
constexpr std::int32_t kPiece = 32;  // voxels along a piece's side
constexpr double kTrim = 0.05;       // share of a piece given up to have fewer faces
constexpr double kBeyondM = 1e6;     // how far closed space is said to go on outside the grid

/// Corners rounded to single precision relative to the scene's centre: a gap below this is
/// rounding.
double rounding_m(const Aabb& bounds) {
  if (bounds.empty()) return 0;
  const Vec3 half = bounds.size() * 0.5;
  const auto extent = static_cast<float>(std::max({half.x, half.y, half.z}));
  return 4 * (static_cast<double>(std::nextafter(extent, std::numeric_limits<float>::infinity())) -
              static_cast<double>(extent));
}

IVec3 voxel_of(const Vec3& p) {
  const auto floor = [](double v) {
    return static_cast<std::int32_t>(std::floor(std::clamp(v, -1e9, 1e9)));
  };
  return {floor(p.x), floor(p.y), floor(p.z)};
}

/// The free voxels where observers are. A seed in a marked voxel stands near a surface: it is taken
/// to the free voxels about it that it sees. If it sees none, to all of them, on whichever side of
/// the surface: that opens too much rather than too little.
Result<std::vector<IVec3>> start_voxels(const VoxelGrid& grid, const ViewSpace& space,
                                        double tolerance, VoxelReport& report) {
  std::vector<IVec3> starts;
  if (space.kind == ViewSpace::Kind::kOutside) starts.push_back({0, 0, 0});
  for (const Vec3& seed : space.seeds) {
    const Vec3 p = grid.to_grid(seed);
    const IVec3 v = voxel_of(p);
    if (!grid.inside(v)) {
      starts.push_back({0, 0, 0});
      continue;
    }
    if (grid.label_at(v) != VoxelGrid::kMarked) {
      starts.push_back(v);
      continue;
    }
    const std::size_t before = starts.size();
    std::vector<IVec3> near;
    for (std::int32_t r = 2; near.empty() && r <= 16; r *= 2)
      for (std::int32_t z = v.z - r; z <= v.z + r; ++z)
        for (std::int32_t y = v.y - r; y <= v.y + r; ++y)
          for (std::int32_t x = v.x - r; x <= v.x + r; ++x)
            if (const IVec3 w{x, y, z}; grid.inside(w) && grid.label_at(w) != VoxelGrid::kMarked)
              near.push_back(w);
    if (near.empty())
      return invalid_argument("voxels of " + std::to_string(grid.cell) + " m: all of them about (" +
                              std::to_string(seed.x) + "," + std::to_string(seed.y) + "," +
                              std::to_string(seed.z) +
                              "), a point of the view space, touch surfaces; expected a free one "
                              "within 16 of it: take smaller voxels");
    for (const IVec3& w : near)
      walk_ray(grid, p, Vec3(w.x + 0.5, w.y + 0.5, w.z + 0.5) - p, tolerance,
               [&](std::uint32_t, const IVec3& at) {
                 if (at == w) starts.push_back(w);
                 return !(at == w);
               });
    if (starts.size() > before) {
      ++report.seeds_moved;
    } else {
      starts.insert(starts.end(), near.begin(), near.end());
      ++report.seeds_unclear;
    }
  }
  return starts;
}

/// Bits of a tile whose label is flagged; of one outside the grid: those of `beyond`.
class TileReader {
 public:
  TileReader(const VoxelGrid& grid, const std::vector<char>& flagged, bool beyond)
      : grid_(grid), flagged_(flagged), beyond_(beyond) {}

  TileBits operator()(const IVec3& t) const {
    if (!grid_.tile_inside(t)) return all(beyond_);
    const std::uint32_t entry = grid_.table[grid_.tile_index(t)];
    if ((entry & VoxelGrid::kAir) != 0) return all(flagged_[entry & ~VoxelGrid::kAir] != 0);
    TileBits out{};
    for (std::uint32_t n = grid_.mixed[entry].first_node; n < grid_.mixed[entry + 1].first_node;
         ++n)
      if (flagged_[grid_.node_label[n]] != 0)
        for (std::size_t z = 0; z < 8; ++z)
          out[z] |= grid_.node_bits[n][z];
    return out;
  }

  /// Fills the window about the cube `c`.
  void read(const IVec3& c, BitWindow& window) const {
    window.clear();
    const IVec3& pad = window.pad();
    const std::int32_t middle = window.words() / 2;
    const auto down = [](std::int32_t v) { return v >> 3; };
    const IVec3 base{c.x * kCube, c.y * kCube, c.z * kCube};
    for (std::int32_t tz = down(base.z - pad.z); tz <= down(base.z + kCube + pad.z - 1); ++tz)
      for (std::int32_t ty = down(base.y - pad.y); ty <= down(base.y + kCube + pad.y - 1); ++ty)
        for (std::int32_t k = 0; k < 8 * window.words(); ++k) {
          const TileBits bits = (*this)({8 * (c.x - middle) + k, ty, tz});
          if (!any(bits)) continue;
          for (std::int32_t z = 0; z < 8; ++z) {
            const std::int32_t wz = 8 * tz + z - base.z;
            if (wz < -pad.z || wz >= kCube + pad.z) continue;
            for (std::int32_t y = 0; y < 8; ++y) {
              const std::int32_t wy = 8 * ty + y - base.y;
              if (wy < -pad.y || wy >= kCube + pad.y) continue;
              const std::uint64_t row = (bits[static_cast<std::size_t>(z)] >> (8 * y)) & 0xffU;
              window.row(wy, wz)[k / 8] |= row << (8 * (k % 8));
            }
          }
        }
  }

 private:
  static TileBits all(bool set) {
    TileBits bits;
    bits.fill(set ? ~std::uint64_t{0} : 0);
    return bits;
  }
  const VoxelGrid& grid_;
  const std::vector<char>& flagged_;
  bool beyond_;
};

std::size_t count(const BitCube& bits) {
  std::size_t n = 0;
  for (const std::uint64_t w : bits)
    n += static_cast<std::size_t>(std::popcount(w));
  return n;
}

/// Are all bits of the window within [lo, hi) of the cube, grown by g, set?
bool all_set(const BitWindow& window, const IVec3& lo, const IVec3& hi, const IVec3& g) {
  const std::int32_t middle = window.words() / 2;
  for (std::int32_t z = lo.z - g.z; z < hi.z + g.z; ++z)
    for (std::int32_t y = lo.y - g.y; y < hi.y + g.y; ++y) {
      const std::uint64_t* row = window.row(y, z);
      for (std::int32_t x = lo.x - g.x; x < hi.x + g.x;) {
        const std::int32_t bit = x + 64 * middle;
        const std::int32_t n = std::min(64 - (bit & 63), hi.x + g.x - x);
        const std::uint64_t mask = (n == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << n) - 1)
                                   << (bit & 63);
        if ((row[bit >> 6] & mask) != mask) return false;
        x += n;
      }
    }
  return true;
}

BitCube cut(const BitCube& bits, const IVec3& lo, const IVec3& hi) {
  BitCube out(bits.size(), 0);
  const std::int32_t n = hi.x - lo.x;
  const std::uint64_t mask = (n >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << n) - 1) << lo.x;
  for (std::int32_t z = lo.z; z < hi.z; ++z)
    for (std::int32_t y = lo.y; y < hi.y; ++y) {
      const auto i = static_cast<std::size_t>(y + kCube * z);
      out[i] = bits[i] & mask;
    }
  return out;
}

/// The set bits but for small boxes, of kTrim of the volume together: fewer corners, and any subset
/// of an erosion is as safe.
BitCube trimmed(const BitCube& bits) {
  std::vector<VoxelBox> boxes = greedy_boxes(bits);
  const auto volume = [](const VoxelBox& b) {
    return static_cast<std::size_t>(b.hi.x - b.lo.x) * static_cast<std::size_t>(b.hi.y - b.lo.y) *
           static_cast<std::size_t>(b.hi.z - b.lo.z);
  };
  std::stable_sort(boxes.begin(), boxes.end(),
                   [&](const VoxelBox& a, const VoxelBox& b) { return volume(a) > volume(b); });
  const double enough = (1 - kTrim) * static_cast<double>(count(bits));
  BitCube out(bits.size(), 0);
  std::size_t kept = 0;
  for (const VoxelBox& b : boxes) {
    if (static_cast<double>(kept) >= enough) break;
    kept += volume(b);
    const std::int32_t n = b.hi.x - b.lo.x;
    const std::uint64_t mask = (n >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << n) - 1)
                               << b.lo.x;
    for (std::int32_t z = b.lo.z; z < b.hi.z; ++z)
      for (std::int32_t y = b.lo.y; y < b.hi.y; ++y)
        out[static_cast<std::size_t>(y + kCube * z)] |= mask;
  }
  return out;
}

struct CubeResult {
  std::vector<SolidPiece> pieces;
  std::vector<VoxelBox> closed;  // in voxels of the grid
  std::vector<std::size_t> kept;
  std::size_t deep = 0;
};

/// Joins boxes that share a whole face, along one axis.
void merge(std::vector<VoxelBox>& boxes, int axis) {
  const auto key = [axis](const VoxelBox& b) {
    const std::int32_t lo[3] = {b.lo.x, b.lo.y, b.lo.z};
    const std::int32_t hi[3] = {b.hi.x, b.hi.y, b.hi.z};
    const int i = (axis + 1) % 3;
    const int j = (axis + 2) % 3;
    return std::tuple(lo[i], hi[i], lo[j], hi[j], lo[axis], hi[axis]);
  };
  std::sort(boxes.begin(), boxes.end(),
            [&](const VoxelBox& a, const VoxelBox& b) { return key(a) < key(b); });
  std::size_t n = 0;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (n > 0) {
      const auto a = key(boxes[n - 1]);
      const auto b = key(boxes[i]);
      if (std::get<0>(a) == std::get<0>(b) && std::get<1>(a) == std::get<1>(b) &&
          std::get<2>(a) == std::get<2>(b) && std::get<3>(a) == std::get<3>(b) &&
          std::get<5>(a) == std::get<4>(b)) {
        boxes[n - 1].hi = boxes[i].hi;
        continue;
      }
    }
    boxes[n++] = boxes[i];
  }
  boxes.resize(n);
}

}  // namespace

Result<VoxelReport> add_voxel_solids(const Scene& scene, const VoxelOptions& options,
                                     OccluderSet& occluders, const Context& context) {
  const auto start = std::chrono::steady_clock::now();
  const ViewSpace& space = occluders.view_space;
  if (space.kind == ViewSpace::Kind::kInside && space.seeds.empty())
    return invalid_argument("voxels: no point of the view space is given, expected at least one");
  auto voxelized = voxelize(scene, options.cell_m, options.max_bytes, context);
  if (!voxelized) return voxelized.error();
  VoxelGrid& grid = voxelized->grid;
  const double cell = grid.cell;
  const double cell_m3 = cell * cell * cell;
  VoxelReport report;
  report.cell_m = cell;
  report.triangles = grid.triangles.size();
  report.marked = voxelized->marked;
  report.voxels = grid.table.size() * 512;

  std::vector<double> margins = occluders.margins_m;
  if (margins.empty()) margins = {0.1, 0.25, 0.5, 1, 2, 4};
  const Reach reach = padded(occluders.reach, occluders.slack_m);
  std::vector<StructuringElement> elements;
  for (const double m : margins) {
    const IVec3 r = structuring_radius(reach, m, cell);
    if (std::max({r.x, r.y, r.z}) > VoxelReport::kMaxRadius) break;
    elements.push_back(structuring_element(reach, m, cell));
  }
  report.levels_too_wide = margins.size() - elements.size();

  LeakOptions leak_options;
  leak_options.max_rays = options.max_rays;
  leak_options.tolerance_m = rounding_m(scene.bounds);
  const IVec3 least =
      elements.empty() ? structuring_radius(reach, margins.front(), cell) : elements.front().radius;
  const auto width = [](std::int32_t r) { return 2 * std::min(r, 1 << 29) + 1; };
  leak_options.least_size = {width(least.x), width(least.y), width(least.z)};
  const auto seeds = start_voxels(grid, space, leak_options.tolerance_m / cell, report);
  if (!seeds) return seeds.error();
  const auto flooded = flood(grid, *seeds, context);
  if (!flooded) return flooded.error();
  const std::size_t held = grid.bytes() + flooded->components.capacity() * sizeof(VoxelComponent);
  if (held > options.max_bytes)
    return invalid_argument("voxels of " + std::to_string(cell) + " m: found " +
                            std::to_string(held / 1000000) + " MB, the limit is " +
                            std::to_string(options.max_bytes / 1000000) + " MB");
  leak_options.max_bytes = options.max_bytes - held;
  const auto leaks = test_leaks(grid, voxelized->barriers, *flooded, leak_options, context);
  if (!leaks) return leaks.error();
  report.rays = leaks->rays;
  report.peak_bytes = std::max(voxelized->peak_bytes, held + leaks->peak_bytes);

  // What each label is.
  const std::size_t labels = flooded->components.size();
  std::vector<char> solid(labels, 0);
  std::vector<char> open(labels, 0);
  for (std::uint32_t c = 1; c < labels; ++c) {
    const std::size_t n = flooded->components[c].voxels;
    switch (leaks->states[c]) {
      case State::kReached:
        open[c] = 1;
        break;
      case State::kLeaks:
        (options.seal ? solid : open)[c] = 1;
        ++report.leaking;
        break;
      case State::kProven:
        solid[c] = 1;
        ++report.proven;
        break;
      case State::kEvidence:
        solid[c] = options.proven_only ? 0 : 1;
        ++(options.proven_only ? report.dropped : report.by_evidence);
        break;
      case State::kThin:
        ++report.thin;
        break;
    }
    if (c != Flooded::kReached) ++report.components;
    if (open[c] != 0) report.reached += n;
    if (solid[c] != 0) report.solid += n;
  }
  report.solid_m3 = static_cast<double>(report.solid) * cell_m3;
  for (const Leak& l : leaks->leaks)
    report.leaks.push_back({grid.centre(l.where),
                            static_cast<double>(flooded->components[l.label].voxels) * cell_m3,
                            l.by_ray});
  std::stable_sort(report.leaks.begin(), report.leaks.end(),
                   [](const auto& a, const auto& b) { return a.volume_m3 > b.volume_m3; });
  if (report.leaks.size() > VoxelReport::kMaxLeaks) report.leaks.resize(VoxelReport::kMaxLeaks);

  // Beyond the grid lies what is about its border.
  const std::uint32_t outside = grid.label_at({0, 0, 0});
  const TileReader solids(grid, solid, solid[outside] != 0);
  const TileReader opens(grid, open, open[outside] != 0);

  const IVec3 size = grid.voxels();
  const auto cubes = [](std::int32_t n) { return (n + kCube - 1) / kCube; };
  const IVec3 n{cubes(size.x), cubes(size.y), cubes(size.z)};
  const std::size_t cube_count =
      static_cast<std::size_t>(n.x) * static_cast<std::size_t>(n.y) * static_cast<std::size_t>(n.z);
  std::vector<CubeResult> results(cube_count);
  const IVec3 widest = elements.empty() ? IVec3{} : elements.back().radius;
  const IVec3 pad{widest.x + 1, widest.y + 1, widest.z + 1};
  {
    Progress progress(context, "voxels: eroding", cube_count);
    parallel_for(context, cube_count, [&](std::size_t i) {
      CubeResult& out = results[i];
      out.kept.assign(elements.size(), 0);
      const auto nx = static_cast<std::size_t>(n.x);
      const auto ny = static_cast<std::size_t>(n.y);
      const IVec3 c{static_cast<std::int32_t>(i % nx), static_cast<std::int32_t>(i / nx % ny),
                    static_cast<std::int32_t>(i / nx / ny)};
      const IVec3 base{c.x * kCube, c.y * kCube, c.z * kCube};
      // Whatever is neither solid nor shut off is settled by the tiles alone.
      bool some_solid = false;
      bool some_shut = false;
      for (std::int32_t z = 0; z < 8; ++z)
        for (std::int32_t y = 0; y < 8; ++y)
          for (std::int32_t x = 0; x < 8; ++x) {
            const IVec3 t{8 * c.x + x, 8 * c.y + y, 8 * c.z + z};
            if (!grid.tile_inside(t)) continue;
            const std::uint32_t entry = grid.table[grid.tile_index(t)];
            if ((entry & VoxelGrid::kAir) != 0) {
              some_solid = some_solid || solid[entry & ~VoxelGrid::kAir] != 0;
              some_shut = some_shut || open[entry & ~VoxelGrid::kAir] == 0;
            } else {
              some_shut = true;
              some_solid = some_solid || any(solids(t));
            }
          }
      BitCube in_grid(static_cast<std::size_t>(kCube * kCube), 0);
      for (std::int32_t z = 0; z < std::min(kCube, size.z - base.z); ++z)
        for (std::int32_t y = 0; y < std::min(kCube, size.y - base.y); ++y)
          in_grid[static_cast<std::size_t>(y + kCube * z)] =
              size.x - base.x >= kCube ? ~std::uint64_t{0}
                                       : (std::uint64_t{1} << (size.x - base.x)) - 1;

      if (some_solid && !elements.empty()) {
        BitWindow window(pad);
        solids.read(c, window);
        // A piece about which everything is solid, even for the largest margin, lies behind the
        // layer of its neighbours that is drawn at whatever margin theirs is: it hides nothing
        // more.
        const IVec3 around{pad.x, pad.y, pad.z};
        std::vector<std::pair<IVec3, IVec3>> cells;
        BitCube wanted(in_grid.size(), 0);
        BitCube deep(in_grid.size(), 0);
        for (std::int32_t z = 0; z < kCube; z += kPiece)
          for (std::int32_t y = 0; y < kCube; y += kPiece)
            for (std::int32_t x = 0; x < kCube; x += kPiece) {
              const IVec3 lo{x, y, z};
              const IVec3 hi{x + kPiece, y + kPiece, z + kPiece};
              const BitCube here = cut(in_grid, lo, hi);
              const bool is_deep = all_set(window, lo, hi, around);
              if (is_deep) ++out.deep;
              if (!is_deep) cells.emplace_back(lo, hi);
              BitCube& to = is_deep ? deep : wanted;
              for (std::size_t k = 0; k < here.size(); ++k)
                to[k] |= here[k];
            }
        const std::size_t deep_count = count(deep);
        std::vector<SolidPiece> pieces(cells.size());
        BitCube left = std::move(wanted);
        for (std::size_t k = 0; k < elements.size(); ++k) {
          if (context.stopped()) return;
          left = erode_cube(window, elements[k], left);
          out.kept[k] = deep_count;
          if (count(left) == 0) {
            for (std::size_t rest = k + 1; rest < elements.size(); ++rest)
              out.kept[rest] = deep_count;
            break;
          }
          for (std::size_t p = 0; p < cells.size(); ++p) {
            const BitCube bits = trimmed(cut(left, cells[p].first, cells[p].second));
            const std::size_t kept = count(bits);
            if (kept == 0) continue;
            out.kept[k] += kept;
            FaceMesh mesh = boundary_rectangles(bits);
            if (FaceMesh boxes = box_faces(greedy_boxes(bits));
                boxes.faces.size() < mesh.faces.size())
              mesh = std::move(boxes);
            for (Vec3& q : mesh.points)
              q = grid.to_world(q + Vec3(base.x, base.y, base.z));
            pieces[p].levels.resize(k + 1);
            pieces[p].levels[k] = std::move(mesh);
          }
        }
        for (SolidPiece& p : pieces)
          if (!p.levels.empty()) out.pieces.push_back(std::move(p));
      }

      if (some_shut) {
        // Where no observer gets to: voxels that are not open, but of the marked ones only those
        // with no open voxel among their 26 neighbours.
        BitWindow reached({1, 1, 1});
        opens.read(c, reached);
        const auto row = [&](std::int32_t y, std::int32_t z) {  // widened along x
          const std::uint64_t* w = reached.row(y, z);
          return w[1] | (w[1] << 1U) | (w[1] >> 1U) | (w[0] >> 63U) | (w[2] << 63U);
        };
        BitCube shut(in_grid.size(), 0);
        for (std::int32_t z = 0; z < kCube; ++z)
          for (std::int32_t y = 0; y < kCube; ++y) {
            std::uint64_t near = 0;
            for (std::int32_t dz = -1; dz <= 1; ++dz)
              for (std::int32_t dy = -1; dy <= 1; ++dy)
                near |= row(y + dy, z + dz);
            std::uint64_t marked = 0;
            for (std::int32_t x = 0; x < 8; ++x) {
              const IVec3 t{8 * c.x + x, 8 * c.y + (y >> 3), 8 * c.z + (z >> 3)};
              if (!grid.tile_inside(t)) continue;
              const std::uint32_t entry = grid.table[grid.tile_index(t)];
              if ((entry & VoxelGrid::kAir) != 0) continue;
              const std::uint64_t byte =
                  (grid.mixed[entry].marked[static_cast<std::size_t>(z & 7)] >> (8 * (y & 7))) &
                  0xffU;
              marked |= byte << (8 * x);
            }
            const auto k = static_cast<std::size_t>(y + kCube * z);
            shut[k] = ((~marked & ~reached.row(y, z)[1]) | (marked & ~near)) & in_grid[k];
          }
        out.closed = greedy_boxes(std::move(shut));
        for (VoxelBox& b : out.closed) {
          b.lo = {b.lo.x + base.x, b.lo.y + base.y, b.lo.z + base.z};
          b.hi = {b.hi.x + base.x, b.hi.y + base.y, b.hi.z + base.z};
        }
      }
      progress.step();
    });
  }
  if (context.stopped()) return cancelled();

  std::vector<VoxelBox> closed;
  std::vector<SolidPiece> pieces;
  report.faces.assign(elements.size(), 0);
  report.kept_m3.assign(elements.size(), 0);
  for (CubeResult& r : results) {
    for (std::size_t k = 0; k < r.kept.size(); ++k)
      report.kept_m3[k] += static_cast<double>(r.kept[k]) * cell_m3;
    report.deep_pieces += r.deep;
    closed.insert(closed.end(), r.closed.begin(), r.closed.end());
    for (SolidPiece& p : r.pieces) {
      for (std::size_t k = 0; k < p.levels.size(); ++k)
        report.faces[k] += p.levels[k].faces.size();
      pieces.push_back(std::move(p));
    }
    r = {};
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (context.stopped()) return cancelled();
    merge(closed, axis);
  }
  std::vector<Aabb> boxes;
  for (const VoxelBox& b : closed)
    boxes.push_back(
        {grid.to_world({b.lo.x, b.lo.y, b.lo.z}), grid.to_world({b.hi.x, b.hi.y, b.hi.z})});
  if (open[outside] == 0) {
    // Six slabs about the grid.
    const Aabb in{grid.to_world(Vec3{0}), grid.to_world({size.x, size.y, size.z})};
    const Aabb all{in.lo - kBeyondM, in.hi + kBeyondM};
    Aabb rest = all;
    for (const int a : {1, 0, 2}) {
      Aabb low = rest;
      Aabb high = rest;
      low.hi[a] = in.lo[a];
      high.lo[a] = in.hi[a];
      boxes.push_back(low);
      boxes.push_back(high);
      rest.lo[a] = in.lo[a];
      rest.hi[a] = in.hi[a];
    }
  }
  report.pieces = pieces.size();
  report.closed_boxes = boxes.size();

  // Nothing can fail from here on.
  occluders.margins_m = std::move(margins);
  occluders.solid_pieces.insert(occluders.solid_pieces.end(),
                                std::make_move_iterator(pieces.begin()),
                                std::make_move_iterator(pieces.end()));
  occluders.closed_boxes.insert(occluders.closed_boxes.end(), boxes.begin(), boxes.end());
  if (options.seal && report.leaking > 0) occluders.sealed = true;
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

std::string to_text(const VoxelReport& r) {
  std::ostringstream out;
  out << "voxels of " << r.cell_m << " m: " << r.voxels << ", " << r.marked << " marked by "
      << r.triangles << " triangles, " << r.reached << " reached, " << r.solid << " solid ("
      << r.solid_m3 << " m3), " << r.seconds << " s, " << static_cast<double>(r.peak_bytes) / 1e6
      << " MB\n"
      << "  shut off: " << r.components << " parts: " << r.thin << " too thin, " << r.proven
      << " proven by closed surfaces, " << r.by_evidence << " by flood and " << r.rays << " rays, "
      << r.leaking << " leak";
  if (r.dropped > 0) out << ", " << r.dropped << " not proven";
  out << '\n';
  for (const auto& l : r.leaks)
    out << "    leak of " << l.volume_m3 << " m3 at " << l.where.x << ',' << l.where.y << ','
        << l.where.z << (l.by_ray ? " (ray)" : "") << '\n';
  if (r.seeds_moved + r.seeds_unclear > 0)
    out << "  seeds beside surfaces: " << r.seeds_moved << " moved, " << r.seeds_unclear
        << " unclear\n";
  out << "  " << r.pieces << " pieces, " << r.closed_boxes << " closed boxes";
  if (r.levels_too_wide > 0) out << ", " << r.levels_too_wide << " margins too wide";
  out << "; kept by margin:";
  for (std::size_t k = 0; k < r.kept_m3.size(); ++k)
    out << ' ' << r.kept_m3[k] << " m3 in " << r.faces[k] << " faces"
        << (k + 1 < r.kept_m3.size() ? "," : "");
  out << '\n';
  return out.str();
}

}  // namespace ivis
