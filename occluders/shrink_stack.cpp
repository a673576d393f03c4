#include "occluders/shrink_stack.h"

#include <algorithm>
#include <utility>

#include "core/view_cell.h"
#include "occluders/clip.h"
#include "occluders/gate.h"

namespace ivis {
namespace {

constexpr double kMinAreaM2 = 0.01;

}  // namespace

ShrunkStack shrink_stack(const FusedStack& stack, const OccluderSet& set, const Reach& grown,
                         const Eroder& eroder) {
  ShrunkStack out;
  out.eroded.resize(stack.levels.size());
  const bool reaches_down = stack.grounded || stack.bottom <= set.floor;
  const double raised = stack.bottom + 2 * grown.half_extents().y;
  struct Piece {
    Polygon footprint;
    double area;
  };
  std::vector<Piece> above;  // what stands at the level treated before (the next higher one)
  for (auto level = stack.levels.rbegin(); level != stack.levels.rend(); ++level) {
    const double top = level->top - set.slack_m;
    std::vector<Piece> here;
    if (!reaches_down && raised >= top) {
      ++out.thin;
      continue;
    }
    for (const Polygon& region : level->region) {
      const std::size_t failed = out.failed;
      std::vector<Polygon> eroded = gated_erosion(region, grown, eroder, kMinAreaM2, out.failed);
      if (eroded.empty() && out.failed == failed) ++out.thin;
      for (Polygon& piece : eroded) {
        const double a = area(piece);
        out.eroded[static_cast<std::size_t>(stack.levels.rend() - level) - 1].push_back(piece);
        here.push_back({std::move(piece), a});
      }
    }
    std::vector<Piece> standing;
    for (Piece& p : here) {
      double covered = 0;
      std::vector<const Piece*> higher;
      for (const Piece& q : above)
        if (contains(p.footprint, q.footprint.rings[0][0])) {
          covered += q.area;
          higher.push_back(&q);
        }
      // A level that adds next to nothing to the one above is not worth its walls.
      if (covered >= 0.995 * p.area) {
        for (const Piece* q : higher)
          standing.push_back(*q);
        continue;
      }
      out.prisms.push_back({p.footprint, reaches_down ? std::min(raised, top) : raised, top,
                            stack.bottom, stack.grounded});
      standing.push_back(std::move(p));
    }
    double a = 0;
    for (const Piece& p : standing)
      a += p.area;
    const double below = level + 1 == stack.levels.rend() ? (reaches_down ? stack.bottom : raised)
                                                          : (level + 1)->top - set.slack_m;
    out.volume += a * std::max(0.0, top - std::max(below, reaches_down ? stack.bottom : raised));
    above = std::move(standing);
  }
  std::reverse(out.prisms.begin(), out.prisms.end());
  return out;
}

Reach shrink_reach(const OccluderSet& set) {
  const double vertical = vertical_tolerance(set.reach) + set.slack_m;
  return set.reach.grown(kReachToleranceM + set.slack_m, vertical);
}

}  // namespace ivis
