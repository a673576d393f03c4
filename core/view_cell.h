#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "core/reach.h"

namespace ivis {

/// Slack of every containment test between a client's pose and the cell its PVS was solved for.
/// Occluders are shrunk by the reach grown by these, so that a pose this far outside is still
/// served. A flat disc stands on streets that are not: its vertical slack is larger.
inline constexpr double kReachToleranceM = 0.001;
inline constexpr double kDiscVerticalToleranceM = 0.01;
inline double vertical_tolerance(const Reach& r) {
  return r.kind() == Reach::Kind::kDisc ? kDiscVerticalToleranceM : kReachToleranceM;
}

/// What occluders are shrunk by, so that one solution serves every pose that ViewCell::contains()
/// accepts and `slack_m` of floating-point error in positions besides.
inline Reach padded(const Reach& r, double slack_m) {
  return r.grown(kReachToleranceM + slack_m, vertical_tolerance(r) + slack_m);
}

/// May a cell have the reach `wanted` where occluders were shrunk for `shrunk_for` with `slack_m`?
/// The one comparison of reaches: of what both are padded to, as that is what an answer promises.
inline bool serves(const Reach& shrunk_for, double slack_m, const Reach& wanted) {
  return padded(shrunk_for, slack_m).contains(padded(wanted, slack_m));
}

/// Largest |v| of any move that a solution serves: those that ViewCell::contains() accepts, and
/// `slack_m` of error besides (an upright cylinder's, as padded() takes it). Less than that of
/// padded(), as a ball stays round here.
inline double largest_move(const Reach& r, double slack_m) {
  const Vec3 e = r.half_extents() + Vec3{kReachToleranceM, vertical_tolerance(r), kReachToleranceM};
  const double slack = std::numbers::sqrt2 * slack_m;
  switch (r.kind()) {
    case Reach::Kind::kBall:
    case Reach::Kind::kEllipsoid:
      return slack + std::max({e.x, e.y, e.z});
    case Reach::Kind::kDisc:
    case Reach::Kind::kCylinder:
      return slack + std::hypot(e.x, e.y);
    case Reach::Kind::kBox:
      break;
  }
  return slack + glm::length(e);
}

/// Every viewpoint that one visibility solution must serve: eye + reach.
struct ViewCell {
  Vec3 eye{0};
  Reach reach;

  /// With the slack above.
  bool contains(const Vec3& p) const {
    return reach.contains(p - eye, kReachToleranceM, vertical_tolerance(reach));
  }
};

/// A cell for an observer of several eyes (stereo, multi-projection), any of which may move by
/// `reach`: one solution for all of them. Its centre is the middle of their box; its reach holds
/// every eye's. At least one eye.
ViewCell cover(std::span<const Vec3> eyes, const Reach& reach);

}  // namespace ivis
