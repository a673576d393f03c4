#include "core/reach.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

namespace ivis {
namespace {

constexpr double kMaxSizeM = 1e6;

struct KindName {
  Reach::Kind kind;
  std::string_view name;
  int numbers;
};
constexpr std::array<KindName, 5> kKinds{{{Reach::Kind::kBall, "ball", 1},
                                          {Reach::Kind::kDisc, "disc", 1},
                                          {Reach::Kind::kCylinder, "cylinder", 2},
                                          {Reach::Kind::kEllipsoid, "ellipsoid", 3},
                                          {Reach::Kind::kBox, "box", 3}}};
constexpr std::string_view kForms = "ball:r, disc:r, cylinder:r,h, ellipsoid:a,b,c or box:a,b,c";

std::string number(double v) {
  std::array<char, 32> buffer{};
  const auto r = std::to_chars(buffer.data(), buffer.data() + buffer.size(), v);
  return {buffer.data(), r.ptr};
}

double ratio(double v, double extent) {
  if (v == 0) return 0;
  return extent > 0 ? v / extent : std::numeric_limits<double>::infinity();
}

}  // namespace

Result<Reach> Reach::parse(std::string_view text) {
  const auto fail = [&](const std::string& why) {
    return invalid_argument("reach '" + std::string(text) + "': " + why + "; expected " +
                            std::string(kForms) + ", in metres");
  };
  const auto colon = text.find(':');
  if (colon == std::string_view::npos) return fail("no ':'");
  const auto kind = std::find_if(kKinds.begin(), kKinds.end(), [&](const KindName& k) {
    return k.name == text.substr(0, colon);
  });
  if (kind == kKinds.end()) return fail("unknown shape");
  std::array<double, 3> v{};
  int count = 0;
  std::string_view rest = text.substr(colon + 1);
  while (true) {
    if (count == kind->numbers) return fail("too many numbers");
    const auto comma = rest.find(',');
    const std::string_view item = rest.substr(0, comma);
    double& value = v[static_cast<std::size_t>(count)];
    const auto parsed = std::from_chars(item.data(), item.data() + item.size(), value);
    if (parsed.ec != std::errc{} || parsed.ptr != item.data() + item.size() || item.empty())
      return fail("'" + std::string(item) + "' is not a number");
    if (!std::isfinite(value) || value < 0 || value > kMaxSizeM)
      return fail("'" + std::string(item) + "' is not between 0 and 1000000");
    ++count;
    if (comma == std::string_view::npos) break;
    rest = rest.substr(comma + 1);
  }
  if (count != kind->numbers) return fail("too few numbers");
  switch (kind->kind) {
    case Kind::kBall:
      return ball(v[0]);
    case Kind::kDisc:
      return disc(v[0]);
    case Kind::kCylinder:
      return cylinder(v[0], v[1]);
    case Kind::kEllipsoid:
      return ellipsoid({v[0], v[1], v[2]});
    case Kind::kBox:
      return box({v[0], v[1], v[2]});
  }
  return fail("unknown shape");
}

std::string Reach::to_string() const {
  switch (kind_) {
    case Kind::kBall:
      return "ball:" + number(e_.x);
    case Kind::kDisc:
      return "disc:" + number(e_.x);
    case Kind::kCylinder:
      return "cylinder:" + number(e_.x) + "," + number(e_.y);
    case Kind::kEllipsoid:
      return "ellipsoid:" + number(e_.x) + "," + number(e_.y) + "," + number(e_.z);
    case Kind::kBox:
      return "box:" + number(e_.x) + "," + number(e_.y) + "," + number(e_.z);
  }
  return "?";
}

double Reach::support(const Vec3& d) const {
  switch (kind_) {
    case Kind::kBall:
    case Kind::kEllipsoid:
      return glm::length(d * e_);
    case Kind::kDisc:
    case Kind::kCylinder:
      return e_.x * std::sqrt(d.x * d.x + d.z * d.z) + e_.y * std::abs(d.y);
    case Kind::kBox:
      return glm::dot(glm::abs(d), e_);
  }
  return 0;
}

bool Reach::contains(const Vec3& v, double horizontal, double vertical) const {
  const Vec3 e = e_ + Vec3{horizontal, vertical, horizontal};
  const Vec3 q{ratio(v.x, e.x), ratio(v.y, e.y), ratio(v.z, e.z)};
  switch (kind_) {
    case Kind::kBall:
    case Kind::kEllipsoid:
      return glm::dot(q, q) <= 1;
    case Kind::kDisc:
    case Kind::kCylinder:
      return q.x * q.x + q.z * q.z <= 1 && std::abs(q.y) <= 1;
    case Kind::kBox:
      return std::abs(q.x) <= 1 && std::abs(q.y) <= 1 && std::abs(q.z) <= 1;
  }
  return false;
}

// Both sets are invariant under each axis' reflection, so only the positive octant counts, and a
// convex set is inside another when its extreme points are. A box's are its corner; a cylinder's
// its rim; an ellipsoid's its surface.
bool Reach::contains(const Reach& other, double tolerance) const {
  const Vec3& o = other.e_;
  const bool other_round = other.kind_ == Kind::kBall || other.kind_ == Kind::kEllipsoid;
  const bool other_upright = other.kind_ == Kind::kDisc || other.kind_ == Kind::kCylinder;
  if (other.kind_ == Kind::kBox) return contains(o, tolerance, tolerance);
  const Vec3 e = e_ + tolerance;
  const Vec3 q{ratio(o.x, e.x), ratio(o.y, e.y), ratio(o.z, e.z)};
  if (kind_ == Kind::kBox || other_round) {
    // Ellipsoid in box, cylinder (a circle) or ellipsoid: by axes. A cylinder's circle holds an
    // ellipse when it holds its longer axis; a scaled ellipsoid lies in the unit ball likewise.
    return q.x <= 1 && q.y <= 1 && q.z <= 1;
  }
  if (other_upright && (kind_ == Kind::kDisc || kind_ == Kind::kCylinder))
    return q.x <= 1 && q.y <= 1;
  // An upright cylinder in an ellipsoid: its rim, worst along the shorter horizontal axis.
  const double horizontal = std::max(q.x, q.z);
  return horizontal * horizontal + q.y * q.y <= 1;
}

Reach Reach::grown(double horizontal, double vertical) const {
  const Vec3 g{e_.x + horizontal, e_.y + vertical, e_.z + horizontal};
  switch (kind_) {
    case Kind::kBall:
    case Kind::kDisc:
    case Kind::kCylinder:
      return {Kind::kCylinder, g};
    case Kind::kBox:
      return {Kind::kBox, g};
    case Kind::kEllipsoid: {
      // With f the largest relative growth of an axis, the cylinder's support is at most
      // f (hypot(ex dx, ez dz) + ey |dy|) <= f sqrt(2) h_V(d): scaling V by 1 + sqrt(2) f holds the
      // sum.
      const double f =
          std::max({ratio(horizontal, e_.x), ratio(vertical, e_.y), ratio(horizontal, e_.z)});
      if (std::isfinite(f)) return {Kind::kEllipsoid, e_ * (1 + std::numbers::sqrt2 * f)};
      return {Kind::kBox, g};
    }
  }
  return *this;
}

std::vector<Vec2> Reach::circumscribed_polygon(int k, const Vec2& toward) const {
  IVIS_ASSERT(k >= 4, "a circumscribed polygon needs at least four sides");
  if (kind_ == Kind::kBox) return {{e_.x, -e_.z}, {e_.x, e_.z}, {-e_.x, e_.z}, {-e_.x, -e_.z}};
  // Tangents of the ellipse with outward normals at equal angles of the circle it is an image of:
  // in circle space p = (x/a, z/b) the normal n maps to (a n.x, b n.z).
  const double a = e_.x;
  const double b = e_.z;
  const double start = std::atan2(toward.y * b, toward.x * a);
  const double step = 2 * std::numbers::pi / k;
  const double r = 1 / std::cos(step / 2);
  std::vector<Vec2> polygon;
  polygon.reserve(static_cast<std::size_t>(k));
  for (int i = 0; i < k; ++i) {
    const double angle = start + step * (i + 0.5);
    polygon.emplace_back(a * r * std::cos(angle), b * r * std::sin(angle));
  }
  return polygon;
}

std::vector<Vec3> Reach::extreme_points(int n) const {
  std::vector<Vec3> points;
  constexpr double kGolden = 2.399963229728653;  // radians
  for (int i = 0; i < n; ++i) {
    const double angle = kGolden * i;
    const Vec3 rim{std::cos(angle), 0, std::sin(angle)};
    switch (kind_) {
      case Kind::kDisc:
      case Kind::kCylinder: {
        points.emplace_back(rim.x * e_.x, (i % 2 == 0 ? 1 : -1) * e_.y, rim.z * e_.x);
        break;
      }
      case Kind::kBall:
      case Kind::kEllipsoid: {
        const double y = i == 0 ? 1 : i == 1 ? -1 : 1 - (2.0 * i + 1) / n;
        const double s = std::sqrt(std::max(0.0, 1 - y * y));
        points.push_back(Vec3{rim.x * s, y, rim.z * s} * e_);
        break;
      }
      case Kind::kBox: {
        const Vec3 corner{(i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1};
        if (i < 8) {
          points.push_back(corner * e_);
        } else {  // along the rims
          const double m = std::max(std::abs(rim.x), std::abs(rim.z));
          points.emplace_back(rim.x / m * e_.x, corner.y * e_.y, rim.z / m * e_.z);
        }
        break;
      }
    }
  }
  return points;
}

}  // namespace ivis
