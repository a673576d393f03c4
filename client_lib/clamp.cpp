#include "client_lib/clamp.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ivis::client {

Vec3 clamp_to_cell(const ViewCell& cell, const Vec3& p) {
  if (cell.contains(p)) return p;
  const Vec3& e = cell.reach.half_extents();
  Vec3 v = p - cell.eye;
  switch (cell.reach.kind()) {
    case Reach::Kind::kBox:
      v = glm::clamp(v, -e, e);
      break;
    case Reach::Kind::kDisc:
    case Reach::Kind::kCylinder: {
      const double r = std::hypot(v.x, v.z);
      if (r > e.x) {
        v.x *= e.x / r;
        v.z *= e.x / r;
      }
      v.y = std::clamp(v.y, -e.y, e.y);
      break;
    }
    case Reach::Kind::kBall:
    case Reach::Kind::kEllipsoid: {
      // A flat axis leaves nothing along it.
      Vec3 q{0};
      for (int k = 0; k < 3; ++k) {
        if (e[k] > 0)
          q[k] = v[k] / e[k];
        else
          v[k] = 0;
      }
      const double length = std::hypot(q.x, q.y, q.z);
      if (length > 1) v /= length;
      break;
    }
  }
  // Rounding is paid by the cell's tolerance unless the numbers are astronomic.
  const Vec3 held = cell.eye + v;
  return cell.contains(held) ? held : cell.eye;
}

double margin_in_cell(const ViewCell& cell, const Vec3& p) {
  const Vec3& e = cell.reach.half_extents();
  const Vec3 v = p - cell.eye;
  double margin = std::numeric_limits<double>::infinity();
  const auto take = [&](double size, double at) {
    if (size > 0) margin = std::min(margin, size - at);
  };
  switch (cell.reach.kind()) {
    case Reach::Kind::kBox:
      for (int k = 0; k < 3; ++k)
        take(e[k], std::abs(v[k]));
      break;
    case Reach::Kind::kDisc:
    case Reach::Kind::kCylinder:
      take(e.x, std::hypot(v.x, v.z));
      break;
    case Reach::Kind::kBall:
    case Reach::Kind::kEllipsoid: {
      // Of p's scaled length the rest, along the shortest axis.
      double squared = 0;
      double shortest = std::numeric_limits<double>::infinity();
      for (int k = 0; k < 3; ++k) {
        if (!(e[k] > 0)) continue;
        squared += v[k] / e[k] * (v[k] / e[k]);
        shortest = std::min(shortest, e[k]);
      }
      if (shortest < std::numeric_limits<double>::infinity())
        margin = (1 - std::sqrt(squared)) * shortest;
      break;
    }
  }
  return std::isfinite(margin) ? std::max(margin, 0.0) : 0;
}

}  // namespace ivis::client
