#pragma once

#include <cstdint>
#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/flood.h"
#include "occluders/voxelize.h"

namespace ivis {

struct LeakOptions {
  /// Components narrower than this along some axis, in voxels, are too thin to matter: not tested.
  IVec3 least_size{1, 1, 1};
  std::size_t max_rays = 16'000'000;
  /// Rays pass a triangle's edge at this distance as if it went on so far, metres: less is
  /// rounding.
  double tolerance_m = 0;
  std::size_t max_bytes = 0;  ///< for the fine flood
};

struct Leak {
  std::uint32_t label = 0;  ///< the component it was found from
  IVec3 where;              ///< the voxel of it, or at its border, where the way out was found
  bool by_ray = false;
};

struct LeakReport {
  enum class State : std::uint8_t {
    kReached,   ///< by the flood
    kProven,    ///< behind a closed surface: no way from the observers' space, for certain
    kEvidence,  ///< no way found by the fine flood nor by rays
    kLeaks,     ///< a way was found
    kThin,      ///< not tested
  };
  std::vector<State> states;  ///< by label
  std::vector<Leak> leaks;    ///< one a component that leaks by itself, ascending by label
  std::size_t rays = 0;
  std::size_t fine_voxels = 0;  ///< marked voxels that were looked into
  std::size_t peak_bytes = 0;
};

/// Is each component that the flood did not reach really shut off from what it reached?
///
/// Three tests, the first exact, the others evidence:
/// 1. *Closed surfaces.* A set of triangles in which every edge lies an even number of times (with
///    bit-equal corners) divides space in two: along any path off it, crossing parity depends on
///    the ends alone. A component whose parity differs from that of every start of the flood, each
///    for some closed surface of its own, cannot be left without crossing a triangle. Parities
///    whose signs rounding could turn are not used.
/// 2. *Fine flood.* Marked voxels are divided in 4 x 4 x 4, and the flood goes on from the
/// component
///    through those parts that no triangle touches. What it joins is joined: such a way is free.
///    An opening whose inscribed ball is wider than sqrt(3)/2 voxels (half a voxel if it lies
///    square to the grid) is always found. Components joined to each other share their fate.
/// 3. *Rays* from the component at and past the marked voxels beside it, exact to
///    LeakOptions::tolerance_m. One that arrives in another component proves a way there.
///
/// What stays evidence: a component that passes 2 and 3 without 1 may have a way out that is
/// narrower than half a voxel and that no ray met. Such are rooms closed by several bodies that
/// touch, the outside of a game map, and meshes with T-junctions or holes. Errors: kInvalidArgument
/// when the fine flood needs more than max_bytes; kCancelled. Threads: uses context.threads; the
/// result does not depend on their number.
Result<LeakReport> test_leaks(const VoxelGrid& grid, const Barriers& barriers,
                              const Flooded& flooded, const LeakOptions& options,
                              const Context& context);

}  // namespace ivis
