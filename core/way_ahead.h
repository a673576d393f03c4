#pragma once

#include <optional>
#include <vector>

#include "core/math.h"
#include "core/pace.h"

namespace ivis {

/// Where an observer may get to in a time, if its direction of travel turns no faster than told: a
/// sector of a ball about where it was, of the angle that it may have turned by.
/// Argument:  a displacement is a mean of the directions travelled in, all within the cone, which
/// is
///            convex, times at most the time; by axis it is no longer than the speeds told allow.
///            The sector lies in an ellipsoid turned along the velocity, and is less than that.
/// Guarantee: none rests on it: a PVS serves its cell. An observer that turns faster leaves it.
/// Threads:   a value.
struct WayAhead {
  Vec3 direction{1, 0, 0};  ///< unit, of travel at the start
  double angle = 0;         ///< half the cone's, radians, at most kWidestAngle
  double length = 0;        ///< metres, the furthest
  double height = 0;        ///< metres, up or down, the most

  /// Beyond it a cell ahead saves next to nothing.
  static constexpr double kWidestAngle = 1.0;

  /// From the observer to the centre of the smallest ball about the sector, metres along direction.
  double middle() const;
  /// Seen from the observer, points whose convex hull holds the sector; `height` is not looked at.
  std::vector<Vec3> hull() const;
};

/// None where the pace tells no turning, where `towards` is no direction, or the angle is too wide.
/// `towards`: of travel, of any length, as its last frame shows, which thus may be a frame old.
std::optional<WayAhead> way_ahead(const Pace& pace, const Vec3& towards, double time_s);

}  // namespace ivis
