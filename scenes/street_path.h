#pragma once

#include <array>
#include <functional>
#include <vector>

#include "core/context.h"
#include "core/math.h"
#include "core/path.h"
#include "core/result.h"

namespace ivis {

struct StreetPathOptions {
  std::uint64_t seed = 1;
  std::size_t poses = 1800;
  double step_m = 0.5;   ///< between poses, along the path
  double speed_m_s = 5;  ///< sets the column t
  double eye_height_m = 1.7;
  double clearance_m = 2;  ///< least distance in the ground plane from every footprint
};

/// What a walker in the streets must keep out of, in the ground plane.
struct StreetObstacles {
  Vec2 lo{0}, hi{0};  ///< the rectangle to walk in, at most 4096 m a side
  std::vector<std::array<Vec2, 3>>
      footprints;  ///< triangles of buildings, projected; slivers (walls) count
  struct Disc {
    Vec2 centre;
    double radius;  ///< metres, the walker's width included
  };
  std::vector<Disc> discs;  ///< lamps, trees, cars
};

/// A walk through the streets: between far places chosen at random, at the middle of narrow
/// streets, corners rounded. Guarantee: every eye is at least `clearance_m` from every footprint
/// and outside every disc, and
///            `eye_height_m` above ground(eye).
/// Errors:    kInvalidArgument if the options or the rectangle make no sense, or no free place is
///            large enough to walk in; kCancelled.    Threads: reentrant.
/// Cost:      O(area + footprints), a second for 2 km x 2 km.
Result<std::vector<Pose>> street_path(const StreetObstacles& obstacles,
                                      const std::function<double(const Vec2&)>& ground,
                                      const StreetPathOptions& options, const Context& context);

}  // namespace ivis
