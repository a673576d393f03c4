#pragma once
// Touching prisms are fused before eroding, per height level: what erosion would open between them
// stays shut.

#include <vector>

#include "core/context.h"
#include "occluders/occluder_set.h"

namespace ivis {

/// Sections of one fused solid: the solid holds region x [bottom, top] for each level.
struct FusedLevel {
  double top = 0;
  std::vector<Polygon> region;  ///< connected pieces
};

struct FusedStack {
  double bottom = 0;               ///< the highest base among the members
  bool grounded = false;           ///< every member is
  std::vector<FusedLevel> levels;  ///< ascending tops, shrinking regions
};

struct FuseOptions {
  std::size_t max_levels = 12;
  double level_loss = 0.01;  ///< share of volume that fewer levels may cost
  /// Members whose bases are real and differ by at most this are fused, from the highest base up.
  double base_window_m = 1;
};

/// Guarantee: every stack lies inside the union of the prisms (to kGridSlackM at edges): a level
/// takes
///            only members at least as high, from the highest base among those fused.
/// `floor`:   members that reach down to it, or are grounded, are fused whatever their bases: their
///            bottoms do not matter (docs/theory.md, 4). Stacks are never of mixed kinds.
/// Result:    in an order that depends on the prisms only; empty when cancelled.
/// Cost:      near linear in prisms; unions as of their edges.
/// Source:    docs/theory.md, section 4, "fused heights".
std::vector<FusedStack> fuse(const std::vector<Prism>& prisms, double floor,
                             const FuseOptions& options, const Context& context);

}  // namespace ivis
