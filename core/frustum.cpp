#include "core/frustum.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <string>

#include "core/assert.h"

namespace ivis {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// Right, up and forward, unit vectors.
std::array<Vec3, 3> axes(const Frustum& f) {
  const double y = f.yaw_deg * kDegree;
  const double p = f.pitch_deg * kDegree;
  const Vec3 forward{std::cos(p) * std::cos(y), std::sin(p), -std::cos(p) * std::sin(y)};
  const Vec3 right{std::sin(y), 0, std::cos(y)};
  return {right, glm::cross(right, forward), forward};
}

/// Angle between unit vectors, right for small ones too.
double angle(const Vec3& a, const Vec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

/// Least angle from d to the great arc (below half a circle) from a to b.
double angle_to_arc(const Vec3& d, const Vec3& a, const Vec3& b) {
  const Vec3 n = glm::normalize(glm::cross(a, b));
  if (glm::dot(glm::cross(a, d), n) > 0 && glm::dot(glm::cross(d, b), n) > 0)
    return std::abs(std::asin(std::clamp(glm::dot(n, d), -1.0, 1.0)));
  return std::min(angle(d, a), angle(d, b));
}

}  // namespace

Result<Frustum> Frustum::parse(std::string_view text) {
  const auto fail = [&](const std::string& why) {
    return invalid_argument("frustum '" + std::string(text) + "': " + why +
                            "; expected yaw,pitch,fov_x,fov_y,turn in degrees, as in 90,0,90,60,5");
  };
  Frustum f;
  double* const values[] = {&f.yaw_deg, &f.pitch_deg, &f.fov_x_deg, &f.fov_y_deg, &f.turn_deg};
  std::size_t count = 0;
  for (std::string_view rest = text;;) {
    if (count == std::size(values)) return fail("too many numbers");
    const auto comma = rest.find(',');
    const std::string_view item = rest.substr(0, comma);
    double& v = *values[count++];
    const auto parsed = std::from_chars(item.data(), item.data() + item.size(), v);
    if (parsed.ec != std::errc{} || parsed.ptr != item.data() + item.size() || !std::isfinite(v))
      return fail("'" + std::string(item) + "' is not a number");
    if (comma == std::string_view::npos) break;
    rest = rest.substr(comma + 1);
  }
  if (count < std::size(values)) return fail("too few numbers");
  if (std::abs(f.yaw_deg) > 1e6) return fail("yaw is not between -1000000 and 1000000");
  if (std::abs(f.pitch_deg) > 90) return fail("pitch is not between -90 and 90");
  for (const double fov : {f.fov_x_deg, f.fov_y_deg})
    if (!(fov > 0 && fov < 180)) return fail("a field of view is not above 0 and below 180");
  if (!(f.turn_deg >= 0 && f.turn_deg <= 180)) return fail("turn is not between 0 and 180");
  return f;
}

bool Frustum::can_look_along(const Vec3& direction) const {
  const auto [right, up, forward] = axes(*this);
  const Vec3 d = glm::normalize(direction);
  const double ta = std::tan(fov_x_deg / 2 * kDegree);
  const double tb = std::tan(fov_y_deg / 2 * kDegree);
  const double z = glm::dot(d, forward);
  constexpr double kDoubt = 1e-9;
  if (std::abs(glm::dot(d, right)) <= z * ta - kDoubt &&
      std::abs(glm::dot(d, up)) <= z * tb - kDoubt)
    return true;
  std::array<Vec3, 4> corners;
  for (std::size_t i = 0; i < 4; ++i)  // once around
    corners[i] =
        glm::normalize(forward + right * (i == 0 || i == 3 ? ta : -ta) + up * (i < 2 ? tb : -tb));
  double least = std::numbers::pi;
  for (std::size_t i = 0; i < 4; ++i)
    least = std::min(least, angle_to_arc(d, corners[i], corners[(i + 1) % 4]));
  return least <= turn_deg * kDegree - kDoubt;
}

// A turn by at most t moves a direction by at most t. The widened frustum has half-angles a' >= a,
// b' >= b; a direction d of the frustum stays within the side plane of a' after the turn if its
// angle to that plane is at least t, that is sin(a' - a) / cos a / |(x, y, 1)| >= sin t for all |x|
// <= tan a, |y| <= tan b, the left side being (tan a' - x) cos a' / |(x, y, 1)|. It is least at the
// corner x = tan a, |y| = tan b, and so a' = a + asin(sin t cos a sqrt(1 + tan^2 a + tan^2 b));
// where that is no angle below 90 degrees, the side keeps nothing out. Of the eyes in the cell the
// side n must hold all: n·(p - e) <= 0 for some e = P + v with v in V is n·(p - P) <= max n·v =
// support(n).
FrustumSweep::FrustumSweep(const Frustum& f, const ViewCell& cell, double slack_m) {
  IVIS_ASSERT(std::isfinite(f.yaw_deg) && std::abs(f.pitch_deg) <= 90 && f.fov_x_deg > 0 &&
                  f.fov_x_deg < 180 && f.fov_y_deg > 0 && f.fov_y_deg < 180 && f.turn_deg >= 0 &&
                  f.turn_deg <= 180,
              "a frustum as Frustum::parse() gives");
  if (f.turn_deg >= 90) return;
  const std::array<Vec3, 3> axis = axes(f);
  const Vec3& forward = axis[2];
  const double a = f.fov_x_deg / 2 * kDegree;
  const double b = f.fov_y_deg / 2 * kDegree;
  const double corner = std::sqrt(1 + std::tan(a) * std::tan(a) + std::tan(b) * std::tan(b));
  const Reach reach = padded(cell.reach, slack_m);
  const auto add = [&](double half, const Vec3& side) {
    const double sine = std::sin(f.turn_deg * kDegree) * std::cos(half) * corner;
    if (!(sine < 1)) return;
    const double wide = half + std::asin(sine) + 1e-9;
    if (!(wide < std::numbers::pi / 2)) return;
    for (const double sign : {-1.0, 1.0}) {
      const Vec3 n = side * (sign * std::cos(wide)) - forward * std::sin(wide);
      sides_.push_back({n, glm::dot(n, cell.eye) + reach.support(n)});
    }
  };
  add(a, axis[0]);
  add(b, axis[1]);
}

bool FrustumSweep::may_meet(const Aabb& box) const {
  return std::all_of(sides_.begin(), sides_.end(), [&](const Side& s) {
    const Vec3 near = glm::mix(box.lo, box.hi, glm::lessThan(s.outward, Vec3(0)));
    const double magnitude =
        std::abs(near.x) + std::abs(near.y) + std::abs(near.z) + std::abs(s.offset);
    return !(glm::dot(s.outward, near) > s.offset + 1e-12 * magnitude);
  });
}

}  // namespace ivis
