#pragma once

#include <vector>

#include "occluders/fuse.h"
#include "occluders/occluder_set.h"
#include "occluders/shrink.h"

namespace ivis {

/// What is left of one stack.
struct ShrunkStack {
  std::vector<Prism> prisms;
  std::vector<std::vector<Polygon>> eroded;  ///< by level of the stack
  double volume = 0;                         ///< cubic metres, without extensions
  std::size_t failed = 0;                    ///< pieces that did not pass the distance check
  std::size_t thin = 0;                      ///< pieces that the reach leaves nothing of
};

/// E(region x [bottom, top], W) with W the hull of V' - apex: footprints by V's shadow, tops stay
/// (less slack), bottoms rise by all that the cell can move up or down.
/// Of `set` the floor and the slack count; `grown`: shrink_reach() of its reach.
/// Threads: reentrant. Cost: the erosions of the stack's regions.
ShrunkStack shrink_stack(const FusedStack& stack, const OccluderSet& set, const Reach& grown,
                         const Eroder& eroder);

/// The set's reach, larger by all tolerances: what solids are shrunk by.
Reach shrink_reach(const OccluderSet& set);

}  // namespace ivis
