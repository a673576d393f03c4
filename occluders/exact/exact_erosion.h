#pragma once
// Target ivis::occluders_exact. It links CGAL's Minkowski sums and boolean operations: a binary
// that links it is under GPL-3+, though this source is Apache-2.0. Neither the daemon nor the
// client does.

#include "occluders/shrink.h"

namespace ivis {

/// Erosion in exact rational arithmetic: the Minkowski sum of the polygon's bounded complement with
/// a polygon that circumscribes the reach, taken away from the polygon.
/// Guarantee: the result lies inside the true erosion, by the 1e-6 m that the reach is grown by;
///            rounding to double takes far less. A box reach is taken as it is. An ellipse becomes
///            a polygon with a side along every wall, so walls lose nothing more, and k sides all
///            round, which overstep by a factor of at most 1 / cos(pi / k) at reflex corners.
/// Errors:    none; a polygon that CGAL refuses comes back empty. Any rings do: they fill even-odd.
/// Threads:   const and reentrant.
/// Cost:      about 3 ms a footprint;
/// Source:    the sum is CGAL's minkowski_sum_2 (reduced convolution).
class ExactEroder : public Eroder {
 public:
  /// `k`: sides of the polygon that stands for an ellipse, at least 8.
  explicit ExactEroder(int k = 64);
  const char* name() const override { return "exact"; }
  std::vector<Polygon> erode(const Polygon& polygon, const Reach& reach) const override;

 private:
  int k_;
};

}  // namespace ivis
