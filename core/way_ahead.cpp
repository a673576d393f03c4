#include "core/way_ahead.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace ivis {
namespace {

/// The fastest that a pace allows in a direction that rises by `elevation`, 0 to pi/2.
double speed_at(const Pace& pace, double elevation) {
  const double across = std::cos(elevation) > 0 ? pace.horizontal_m_s / std::cos(elevation)
                                                : std::numeric_limits<double>::infinity();
  const double up = std::sin(elevation) > 0 ? pace.vertical_m_s / std::sin(elevation)
                                            : std::numeric_limits<double>::infinity();
  return std::min(across, up);
}

/// The fastest in any direction within `angle` of one that rises by `elevation`: speed_at() rises
/// up to the corner of the two speeds and falls from there.
double fastest_within(const Pace& pace, double elevation, double angle) {
  const double corner = std::atan2(pace.vertical_m_s, pace.horizontal_m_s);
  const double least = std::max(0.0, elevation - angle);
  const double most = std::min(std::numbers::pi / 2, elevation + angle);
  return speed_at(pace, std::clamp(corner, least, most));
}

}  // namespace

std::optional<WayAhead> way_ahead(const Pace& pace, const Vec3& towards, double time_s) {
  const double norm = glm::length(towards);
  if (!(pace.turning_rad_s > 0) || !pace.told() || !(time_s > 0) || !std::isfinite(norm) ||
      !(norm > 0))
    return std::nullopt;
  WayAhead way;
  way.direction = towards / norm;
  way.angle = pace.turning_rad_s * (time_s + pace.frame_s);
  if (!(way.angle <= WayAhead::kWidestAngle)) return std::nullopt;
  const double elevation = std::asin(std::min(1.0, std::abs(way.direction.y)));
  way.length = fastest_within(pace, elevation, way.angle) * time_s;
  way.height = pace.vertical_m_s * time_s;
  if (!std::isfinite(way.length) || !(way.length > 0)) return std::nullopt;
  return way;
}

// Up to 45 degrees the ball goes through the apex and the rim; a wider sector lies in the ball
// about its rim, whose apex and tip are nearer to its centre.
double WayAhead::middle() const {
  if (angle <= std::numbers::pi / 4) return length / (2 * std::cos(angle));
  return length * std::cos(angle);
}

// In a half-plane through the axis: the apex, the rim, and where the tangents at rim and tip meet,
// at half the angle. About the axis, polygons about the circles of these.
std::vector<Vec3> WayAhead::hull() const {
  constexpr int kSides = 16;
  const Vec3 other = std::abs(direction.y) < 0.9 ? Vec3{0, 1, 0} : Vec3{1, 0, 0};
  const Vec3 u = glm::normalize(glm::cross(direction, other));
  const Vec3 v = glm::cross(direction, u);
  const double widened = 1 / std::cos(std::numbers::pi / kSides);
  struct Ring {
    double along, radius;
  };
  const std::array<Ring, 2> rings{{{length * std::cos(angle), length * std::sin(angle)},
                                   {length, length * std::tan(angle / 2)}}};
  std::vector<Vec3> points{Vec3{0}};
  for (const Ring& ring : rings) {
    for (int i = 0; i < kSides; ++i) {
      const double a = 2 * std::numbers::pi * i / kSides;
      points.push_back(direction * ring.along +
                       (u * std::cos(a) + v * std::sin(a)) * (ring.radius * widened));
    }
  }
  return points;
}

}  // namespace ivis
