#pragma once
// Fused footprints shrunk at every margin of a ladder, in parts of small extent: what the occlusion
// map draws.

#include <vector>

#include "core/context.h"
#include "occluders/fuse.h"
#include "occluders/shrink.h"

namespace ivis {

/// Margins beyond the reach, metres, ascending: close together where parts are near, for a reach of
/// `radius_m`.
std::vector<double> default_margins(double radius_m);

struct PrismLadderOptions {
  /// Stacks larger than this are cut into parts of about this size after eroding, so that each part
  /// can be drawn at the margin that its own distance asks for.
  double part_m = 48;
};

/// Fills set.prism_pieces from the stacks for set.margins_m.
/// Guarantee: every prism of level k, extended down where its rule allows, lies inside E(O, V' +
/// B(margins_m[k])) with
///            V' = set.reach padded, seen from the cell's centre: V' + B(m) lies in V' grown by m
///            both ways, so footprints lose its shadow, tops and bottoms its half-height. Parts of
///            an erosion lie inside it.
/// Errors:    none; what fails the distance check is left out and counted. Threads: uses
/// context.threads. Cost:      about one erosion of the footprints a margin. Returns:   pieces that
/// failed the distance check.
/// `eroded`: of each stack and level, what the padded reach leaves of the footprints: E(E(F, V'),
/// B(m)) = E(F, V' + B(m)).
std::size_t add_prism_ladder(const std::vector<FusedStack>& stacks,
                             const std::vector<std::vector<std::vector<Polygon>>>& eroded,
                             const Reach& padded_reach, const Eroder& eroder,
                             const PrismLadderOptions& options, OccluderSet& set,
                             const Context& context);

}  // namespace ivis
