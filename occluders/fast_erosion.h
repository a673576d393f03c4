#pragma once

#include "occluders/shrink.h"

namespace ivis {

/// Erosion by edge capsules: every edge, swept over by a polygon that circumscribes the reach and
/// has a side parallel to that edge, is taken away from the polygon in one boolean difference on an
/// integer grid. Guarantee: the result lies inside the true erosion, by about 3 micrometres at
/// walls. Threads:   const and reentrant. Cost:      near linear in edges for footprints;
/// bench/erosion_bench.cpp. Source:    Wonka, Wimmer, Sillion 2001, section 5.3. Departs: subtracts
/// the enlarged boundary instead of the enlarged, triangulated exterior; the same
///            set for a connected reach that contains 0.
class FastEroder : public Eroder {
 public:
  /// `k`: sides of the polygon that stands for an ellipse, even, at least 4.
  explicit FastEroder(int k = 16);
  const char* name() const override { return "fast"; }
  std::vector<Polygon> erode(const Polygon& polygon, const Reach& reach) const override;

 private:
  int k_;
};

}  // namespace ivis
