#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "core/aabb.h"
#include "core/math.h"
#include "core/result.h"
#include "core/view_cell.h"

namespace ivis {

/// Where an observer looks: a pyramid without near or far plane, and how far it may be turned while
/// an answer is in use. Degrees; yaw and pitch as of a Pose; fields of view are full angles, x to
/// the sides, y up and down.
struct Frustum {
  double yaw_deg = 0;
  double pitch_deg = 0;
  double fov_x_deg = 90;
  double fov_y_deg = 90;
  double turn_deg = 0;  ///< about any axis, rolling included

  /// "yaw,pitch,fov_x,fov_y,turn". Errors: kInvalidArgument, naming the text and what was expected:
  /// fields of view above 0 and below 180, turn from 0 to 180.
  static Result<Frustum> parse(std::string_view text);

  /// Can a point in this direction from the eye (any length but 0) be in the picture, after some
  /// turn of at most turn_deg? Exact but for rounding, which decides for "no".
  bool can_look_along(const Vec3& direction) const;
};

/// All that can be in the picture from anywhere in a view cell: an intersection of half-spaces.
/// Guarantee: contains every point that Frustum::can_look_along() a direction to from an eye that
///            the cell contains (ViewCell::contains, with its slack).
/// Source:    theory.md, section 5. Departs from the paper: each side plane of the widened frustum
///            moves back by what the reach extends across it, instead of the apex by the reach's
///            radius; the result is smaller, and knows flat reaches.
/// Threads:   const and reentrant. Cost: four dot products a box.
class FrustumSweep {
 public:
  /// `slack_m`: error of positions that is served besides, as OccluderSet::slack_m. Asserts what
  /// Frustum::parse() checks.
  FrustumSweep(const Frustum& frustum, const ViewCell& cell, double slack_m = 0.001);
  /// Does the box meet it? Errs towards yes.
  bool may_meet(const Aabb& box) const;

 private:
  struct Side {
    Vec3 outward;   ///< unit length
    double offset;  ///< outside where outward·p > offset
  };
  std::vector<Side> sides_;
};

}  // namespace ivis
