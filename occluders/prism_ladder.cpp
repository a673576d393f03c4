#include "occluders/prism_ladder.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>

#include "occluders/clip.h"
#include "occluders/distance_check.h"
#include "occluders/gate.h"
#include "occluders/inset.h"
#include "occluders/progress.h"
#include "occluders/rect_tree.h"

namespace ivis {
namespace {

constexpr double kMinAreaM2 = 0.01;

Aabb bounds_of(const std::vector<Polygon>& region) {
  Aabb box;
  for (const Polygon& p : region)
    for (const auto& ring : p.rings)
      for (const Vec2& c : ring)
        box.add(Vec3{c.x, 0, c.y});
  return box;
}

/// The polygon's parts within the rectangle.
std::vector<Polygon> within(const Polygon& polygon, const Vec2& lo, const Vec2& hi) {
  const Aabb b = bounds_of({polygon});
  if (b.lo.x >= lo.x && b.hi.x <= hi.x && b.lo.z >= lo.y && b.hi.z <= hi.y) return {polygon};
  return intersect(polygon.rings, Fill::kEvenOdd, {lo, {hi.x, lo.y}, hi, {lo.x, hi.y}});
}

/// Stacks that lie in one convex solid, which is shrunk and drawn itself, add nothing: what is left
/// of them lies in what is left of it. (Unless they reach down: then they are drawn further down.)
/// Leaving an occluder out is always safe, so corners may lie outside by a little.
class ConvexCover {
 public:
  explicit ConvexCover(const std::vector<ConvexSolid>& solids) : solids_(solids) {
    std::vector<Box2> boxes;
    for (const ConvexSolid& s : solids)
      boxes.push_back({ground(s.bounds.lo), ground(s.bounds.hi)});
    tree_ = RectTree(boxes);
  }
  bool holds(const FusedStack& stack) const {
    if (stack.levels.empty() || stack.levels.front().region.empty()) return false;
    const Vec2 place = stack.levels.front().region.front().rings[0][0];
    return !tree_.all({place, place}, [&](std::uint32_t i) { return !holds(solids_[i], stack); });
  }

 private:
  static bool holds(const ConvexSolid& solid, const FusedStack& stack) {
    constexpr double kOutsideM = 1e-3;
    const auto inside = [&](const Vec3& p) {
      return std::all_of(solid.planes.begin(), solid.planes.end(), [&](const auto& plane) {
        return glm::dot(plane.normal, p) <= plane.offset + kOutsideM;
      });
    };
    for (const FusedLevel& level : stack.levels)
      for (const Polygon& polygon : level.region)
        for (const auto& ring : polygon.rings)
          for (const Vec2& c : ring)
            if (!inside({c.x, stack.bottom, c.y}) || !inside({c.x, level.top, c.y})) return false;
    return true;
  }

  const std::vector<ConvexSolid>& solids_;
  RectTree tree_;
};

/// E(polygon, B(step)) or a little less: its mitred outline where that will do, in a tenth of the
/// time.
std::vector<Polygon> next_margin(const Polygon& polygon, double step, const Eroder& eroder,
                                 std::size_t& failed) {
  const Reach disc = Reach::disc(step);
  auto mitred = inset(polygon, step);
  if (!mitred || !within_erosion(*mitred, polygon, disc))
    return gated_erosion(polygon, disc, eroder, kMinAreaM2, failed);
  std::vector<Polygon> out;
  if (!mitred->empty() && area(*mitred) >= kMinAreaM2) out.push_back(std::move(*mitred));
  return out;
}

/// One stack's parts by grid cell.
std::vector<PrismPiece> pieces_of(const FusedStack& stack,
                                  const std::vector<std::vector<Polygon>>& eroded_by_reach,
                                  const Reach& padded_reach, const Eroder& eroder, double part_m,
                                  const OccluderSet& set, std::size_t& failed) {
  Aabb whole;
  for (const FusedLevel& level : stack.levels)
    whole.add(bounds_of(level.region));
  if (whole.empty()) return {};
  const Vec3 size = whole.size();
  const bool cut = std::max(size.x, size.z) > 1.5 * part_m;
  const auto columns = cut ? std::max(1.0, std::round(size.x / part_m)) : 1;
  const auto rows = cut ? std::max(1.0, std::round(size.z / part_m)) : 1;
  const Vec2 part{size.x / columns, size.z / rows};
  const double vertical = padded_reach.half_extents().y;
  std::map<std::pair<int, int>, PrismPiece> pieces;
  const bool reaches_down = stack.grounded || stack.bottom <= set.floor;
  const auto add = [&](std::size_t k, int column, int row, Prism prism) {
    auto& levels = pieces[{row, column}].levels;
    if (levels.size() <= k) levels.resize(k + 1);
    levels[k].push_back(std::move(prism));
  };
  const auto cell = [](double v, double lo, double s, double n) {
    return static_cast<int>(std::clamp(std::floor((v - lo) / s), 0.0, n - 1));
  };
  for (std::size_t l = 0; l < stack.levels.size(); ++l) {
    std::vector<Polygon> left = eroded_by_reach[l];
    for (std::size_t k = 0; k < set.margins_m.size() && !left.empty(); ++k) {
      const double margin = set.margins_m[k];
      const double top = stack.levels[l].top - vertical - margin;
      const double raised = stack.bottom + vertical + margin;
      if (!reaches_down && raised >= top) break;
      // E(E(F, V'), B(m)) = E(F, V' + B(m)): each margin goes on from the one before, whose
      // outline is simpler.
      const double step = k == 0 ? margin : margin - set.margins_m[k - 1];
      std::vector<Polygon> eroded;
      if (step == 0) eroded = left;
      for (const Polygon& polygon : step == 0 ? std::vector<Polygon>{} : left)
        for (Polygon& piece : next_margin(polygon, step, eroder, failed))
          eroded.push_back(std::move(piece));
      for (const Polygon& polygon : eroded) {
        const Prism whole_prism{{}, std::min(raised, top), top, stack.bottom, stack.grounded};
        const auto part_of = [&](Polygon footprint) {
          Prism prism = whole_prism;
          prism.footprint = std::move(footprint);
          return prism;
        };
        if (!cut) {
          add(k, 0, 0, part_of(polygon));
          continue;
        }
        const Aabb b = bounds_of({polygon});
        for (int r = cell(b.lo.z, whole.lo.z, part.y, rows);
             r <= cell(b.hi.z, whole.lo.z, part.y, rows); ++r)
          for (int c = cell(b.lo.x, whole.lo.x, part.x, columns);
               c <= cell(b.hi.x, whole.lo.x, part.x, columns); ++c) {
            const Vec2 lo{whole.lo.x + c * part.x, whole.lo.z + r * part.y};
            for (Polygon& within_cell : within(polygon, lo, lo + part))
              if (area(within_cell) >= kMinAreaM2) add(k, c, r, part_of(std::move(within_cell)));
          }
      }
      left = std::move(eroded);
    }
  }
  std::vector<PrismPiece> out;
  for (auto& [place, piece] : pieces)
    out.push_back(std::move(piece));
  return out;
}

}  // namespace

std::vector<double> default_margins(double radius_m) {
  if (radius_m < 0.5) return {0.025, 0.05, 0.1, 0.25, 0.5, 1, 2};
  return {0.1, 0.25, 0.5, 1, 2, 4};
}

std::size_t add_prism_ladder(const std::vector<FusedStack>& stacks,
                             const std::vector<std::vector<std::vector<Polygon>>>& eroded,
                             const Reach& padded_reach, const Eroder& eroder,
                             const PrismLadderOptions& options, OccluderSet& set,
                             const Context& context) {
  std::vector<std::vector<PrismPiece>> found(stacks.size());
  std::atomic<std::size_t> failed{0};
  const ConvexCover cover(set.convex_solids);
  Progress progress(context, "margins", stacks.size());
  parallel_for(context, stacks.size(), [&](std::size_t i) {
    std::size_t missed = 0;
    const bool reaches_down = stacks[i].grounded || stacks[i].bottom <= set.floor;
    if (reaches_down || !cover.holds(stacks[i]))
      found[i] = pieces_of(stacks[i], eroded[i], padded_reach, eroder, options.part_m, set, missed);
    failed += missed;
    progress.step();
  });
  for (auto& list : found)
    for (PrismPiece& piece : list)
      set.prism_pieces.push_back(std::move(piece));
  return failed;
}

}  // namespace ivis
