#include "occluders/sheets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "occluders/clip.h"
#include "occluders/distance_check.h"
#include "occluders/fast_erosion.h"
#include "occluders/plane_sections.h"
#include "occluders/progress.h"
#include "occluders/quads.h"
#include "occluders/simplify.h"

namespace ivis {
namespace {

constexpr double kInsideM = 0.001;  ///< how far below its faces a sheet cuts the solids
constexpr double kMaxTiles = 4096;  ///< of one part of a plane, before they are divided
constexpr double kMinExposedM2 = 0.01;
constexpr int kTangents = 16;  ///< of a shrunk sheet's round corners, a whole turn

/// Faces of solids that lie in one plane and look the same way.
struct FaceRef {
  std::size_t solid;
  std::vector<Vec3> ring;
};
struct PlaneGroup {
  Vec3 normal{0};
  double area = 0;  ///< of the largest face, whose normal it is
  std::vector<FaceRef> faces;
};

double ring_area(const std::vector<Vec3>& ring) {
  Vec3 sum{0};
  for (std::size_t i = 1; i + 1 < ring.size(); ++i)
    sum += glm::cross(ring[i] - ring[0], ring[i + 1] - ring[0]);
  return glm::length(sum) / 2;
}

/// Any grouping is safe: a group only chooses where to cut. Rounded keys may part what belongs
/// together; that costs a second sheet in nearly the same place.
std::vector<PlaneGroup> group_faces(const std::vector<ConvexPiece>& solids) {
  std::map<std::array<std::int64_t, 4>, PlaneGroup> groups;
  for (std::size_t s = 0; s < solids.size(); ++s) {
    auto rings = face_rings(solids[s].solid);
    for (std::size_t f = 0; f < rings.size(); ++f) {
      if (rings[f].size() < 3) continue;
      const ConvexSolid::Plane& plane = solids[s].solid.planes[f];
      const std::array<std::int64_t, 4> key{
          std::llround(plane.normal.x * 1e4), std::llround(plane.normal.y * 1e4),
          std::llround(plane.normal.z * 1e4), std::llround(plane.offset / (2 * kInsideM))};
      PlaneGroup& group = groups[key];
      const double a = ring_area(rings[f]);
      if (a > group.area) {
        group.area = a;
        group.normal = plane.normal;
      }
      group.faces.push_back({s, std::move(rings[f])});
    }
  }
  std::vector<PlaneGroup> result;
  for (auto& [key, group] : groups)
    result.push_back(std::move(group));
  return result;
}

/// Sets of boxes that hang together.
std::vector<std::vector<std::size_t>> clusters(const std::vector<Box2>& boxes) {
  std::vector<std::size_t> parent(boxes.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (parent[i] != i)
      i = parent[i] = parent[parent[i]];
    return i;
  };
  const RectTree tree(boxes);
  for (std::size_t i = 0; i < boxes.size(); ++i)
    tree.all(boxes[i], [&](std::uint32_t j) {
      if (boxes[j].overlaps(boxes[i])) parent[root(j)] = root(i);
      return true;
    });
  std::map<std::size_t, std::vector<std::size_t>> sets;
  for (std::size_t i = 0; i < boxes.size(); ++i)
    sets[root(i)].push_back(i);
  std::vector<std::vector<std::size_t>> result;
  for (auto& [r, members] : sets)
    result.push_back(std::move(members));
  return result;
}

std::vector<Polygon> inside(const std::vector<Polygon>& polygons, const Box2& box) {
  if (polygons.empty()) return {};
  return intersect(rings_of(polygons), Fill::kNonZero, rectangle(box));
}

struct Built {
  std::vector<Sheet> sheets;
  SheetReport report;
};

class SheetBuilder {
 public:
  SheetBuilder(const std::vector<ConvexPiece>& solids, const SheetOptions& options)
      : sections_(solids), options_(options), eroder_(kTangents) {}

  Built build(const PlaneGroup& group) const {
    Built out;
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -lowest;
    Aabb box;
    for (const FaceRef& f : group.faces)
      for (const Vec3& p : f.ring) {
        lowest = std::min(lowest, glm::dot(group.normal, p));
        highest = std::max(highest, glm::dot(group.normal, p));
        box.add(p);
      }
    const Vec3 centre = box.centre();
    const auto at = [&](double offset) {
      return frame_at(group.normal,
                      centre + group.normal * (offset - glm::dot(group.normal, centre)));
    };
    const PlaneFrame frame = at(lowest - kInsideM);
    const PlaneFrame before = at(highest + kInsideM);

    std::vector<Box2> boxes;
    std::vector<Ring> faces;
    for (const FaceRef& f : group.faces) {
      Ring ring;
      for (const Vec3& p : f.ring)
        ring.push_back(frame.to_plane(p));
      boxes.push_back(box_of(ring));
      faces.push_back(std::move(ring));
    }
    const double around = options_.radii_m.back() + 0.01;
    for (const auto& members : clusters(boxes)) {
      Box2 roi;
      Aabb place;
      std::vector<Ring> shown;
      for (const std::size_t m : members) {
        roi.add(boxes[m]);
        for (const Vec3& p : group.faces[m].ring)
          place.add(p);
        shown.push_back(faces[m]);
      }
      place.lo -= Vec3{around};
      place.hi += Vec3{around};
      // Faces that other solids stand against cannot be in view.
      std::vector<Ring> hidden;
      double no_seam = 0;
      sections_.collect(sections_.cuts_at(before, place), before, roi, hidden, no_seam);
      std::vector<Polygon> exposed = subtract(shown, Fill::kNonZero, hidden);
      std::erase_if(exposed, [](const Polygon& p) { return area(p) < kMinExposedM2; });
      if (exposed.empty()) continue;
      std::vector<Ring> matter;
      double seam = 0;
      sections_.collect(sections_.cuts_at(frame, place), frame, grown(roi, around), matter, seam);
      shrink_part(frame, unite(matter, Fill::kNonZero), seam, exposed, out);
    }
    out.report.planes = out.sheets.empty() ? 0 : 1;
    out.report.tiles = out.sheets.size();
    return out;
  }

 private:
  /// One tile to be, with what of each level lies in it.
  using Levels = std::vector<std::vector<Polygon>>;

  void shrink_part(const PlaneFrame& frame, const std::vector<Polygon>& matter, double seam,
                   const std::vector<Polygon>& exposed, Built& out) const {
    Box2 roi;
    for (const Polygon& p : exposed)
      roi.add(box_of(p.rings[0]));
    for (const Polygon& piece : matter) {
      Levels levels;
      for (const double radius : options_.radii_m) {
        const Reach disc = Reach::disc(radius + seam + kGridSlackM);
        std::vector<Polygon> level;
        for (const Polygon& p : eroder_.erode(piece, disc)) {
          if (area(p) < options_.least_area_m2) continue;
          std::vector<Polygon> simple = simplify_inwards(p, {1e-4, 1e-3});
          const bool good = std::all_of(simple.begin(), simple.end(), [&](const Polygon& q) {
            return within_erosion(q, piece, disc);
          });
          if (good)
            level.insert(level.end(), simple.begin(), simple.end());
          else
            level.push_back(p);
        }
        if (level.empty()) break;
        levels.push_back(std::move(level));
      }
      if (levels.empty()) continue;
      std::vector<Tile> tiles;
      // A huge plane gets larger tiles rather than more.
      double size = options_.tile_m;
      while ((roi.size().x / size + 1) * (roi.size().y / size + 1) > kMaxTiles)
        size *= 2;
      const auto index = [&](double x) { return static_cast<std::int64_t>(std::floor(x / size)); };
      for (std::int64_t j = index(roi.lo.y); j <= index(roi.hi.y); ++j) {
        const double y = static_cast<double>(j) * size;
        const Box2 row{{roi.lo.x - 1, y}, {roi.hi.x + 1, y + size}};
        const std::vector<Polygon> shown = inside(exposed, row);
        if (area(shown) < kMinExposedM2) continue;
        Levels in_row;
        for (const auto& level : levels)
          in_row.push_back(inside(level, row));
        for (std::int64_t i = index(roi.lo.x); i <= index(roi.hi.x); ++i) {
          const double x = static_cast<double>(i) * size;
          divide({{x, y}, {x + size, y + size}}, in_row, shown,
                 options_.least_tile_m * size / options_.tile_m, tiles);
        }
      }
      finish(frame, piece, seam, tiles, out);
    }
  }

  struct Tile {
    std::vector<std::vector<Quad>> levels;
    bool whole = false;  ///< the largest radius leaves all of it
  };

  void divide(const Box2& box, const Levels& around, const std::vector<Polygon>& shown_around,
              double least, std::vector<Tile>& tiles) const {
    const std::vector<Polygon> shown = inside(shown_around, box);
    if (area(shown) < kMinExposedM2) return;
    Levels levels;
    for (const auto& level : around) {
      std::vector<Polygon> here = inside(level, box);
      if (area(here) < 1e-4) break;
      levels.push_back(std::move(here));
    }
    if (levels.empty()) return;
    const Vec2 size = box.size();
    const bool whole = levels.size() == options_.radii_m.size() &&
                       area(levels.back()) > size.x * size.y * (1 - 1e-6);
    if (!whole && size.x > least * 1.5) {
      const Vec2 middle = (box.lo + box.hi) * 0.5;
      for (const Box2& part :
           {Box2{box.lo, middle}, Box2{{middle.x, box.lo.y}, {box.hi.x, middle.y}},
            Box2{{box.lo.x, middle.y}, {middle.x, box.hi.y}}, Box2{middle, box.hi}})
        divide(part, levels, shown, least, tiles);
      return;
    }
    Tile tile;
    tile.whole = whole;
    for (const auto& level : levels) {
      std::vector<Quad> quads;
      for (const Polygon& p : level) {
        const std::vector<Quad> q = quads_of(p);
        quads.insert(quads.end(), q.begin(), q.end());
      }
      tile.levels.push_back(std::move(quads));
    }
    tiles.push_back(std::move(tile));
  }

  /// The gate: whatever simplifying, cutting and parting did, the faces of a level keep their
  /// distance from the outline of the matter, or none of them is used.
  void finish(const PlaneFrame& frame, const Polygon& matter, double seam,
              const std::vector<Tile>& tiles, Built& out) const {
    std::size_t good_levels = 0;
    for (const Tile& t : tiles)
      good_levels = std::max(good_levels, t.levels.size());
    std::vector<bool> good(good_levels, true);
    for (std::size_t k = 0; k < good_levels; ++k) {
      Polygon all;
      for (const Tile& t : tiles)
        if (k < t.levels.size())
          for (const Quad& q : t.levels[k])
            all.rings.push_back(q[2] == q[3] ? Ring{q[0], q[1], q[2]} : Ring{q.begin(), q.end()});
      good[k] = within_erosion(all, matter, Reach::disc(options_.radii_m[k] + seam));
      if (!good[k]) ++out.report.left_out["failed distance check"];
    }
    const double offset = glm::dot(frame.n, frame.origin);
    for (const Tile& t : tiles) {
      Sheet sheet{frame.n, offset, {}};
      for (std::size_t k = 0; k < t.levels.size(); ++k) {
        FaceMesh mesh;
        std::map<std::pair<double, double>, std::uint32_t> number;
        if (good[k])
          for (const Quad& q : t.levels[k]) {
            std::array<std::uint32_t, 4> face{};
            for (std::size_t i = 0; i < 4; ++i) {
              const auto [it, fresh] = number.try_emplace(
                  {q[i].x, q[i].y}, static_cast<std::uint32_t>(mesh.points.size()));
              if (fresh) mesh.points.push_back(frame.to_world(q[i]));
              face[i] = it->second;
            }
            mesh.faces.push_back(face);
          }
        out.report.faces += mesh.faces.size();
        sheet.levels.push_back(std::move(mesh));
      }
      while (!sheet.levels.empty() && sheet.levels.back().empty())
        sheet.levels.pop_back();
      if (sheet.levels.empty()) continue;
      out.sheets.push_back(sheet);
      // From behind: what passes the edges of the solid's other faces still meets this one. Where
      // no edge is near, the faces on that side hide as much.
      if (t.whole) continue;
      sheet.normal = -sheet.normal;
      sheet.offset = -sheet.offset;
      for (FaceMesh& mesh : sheet.levels) {
        for (auto& f : mesh.faces)
          f = f[2] == f[3] ? std::array{f[2], f[1], f[0], f[0]}
                           : std::array{f[3], f[2], f[1], f[0]};
        out.report.faces += mesh.faces.size();
      }
      out.sheets.push_back(std::move(sheet));
    }
  }

  PlaneSections sections_;
  const SheetOptions& options_;
  FastEroder eroder_;
};

}  // namespace

std::vector<double> sheet_radii(double r_v_m) {
  std::vector<double> radii;
  for (double r = 1.05; r < 20; r *= 1.4)
    radii.push_back(r * r_v_m);
  return radii;
}

std::vector<Sheet> build_sheets(const std::vector<ConvexPiece>& solids, const SheetOptions& options,
                                const Context& context, SheetReport& report) {
  if (solids.empty() || options.radii_m.empty()) return {};
  const SheetBuilder builder(solids, options);
  const std::vector<PlaneGroup> groups = group_faces(solids);
  std::vector<Built> built(groups.size());
  {
    Progress progress(context, "sheets", groups.size());
    parallel_for(context, groups.size(), [&](std::size_t i) {
      built[i] = builder.build(groups[i]);
      progress.step();
    });
  }
  std::vector<Sheet> sheets;
  if (context.stopped()) return sheets;
  for (Built& b : built) {
    report.planes += b.report.planes;
    report.tiles += b.report.tiles;
    report.faces += b.report.faces;
    for (const auto& [reason, count] : b.report.left_out)
      report.left_out[reason] += count;
    std::move(b.sheets.begin(), b.sheets.end(), std::back_inserter(sheets));
  }
  return sheets;
}

}  // namespace ivis
