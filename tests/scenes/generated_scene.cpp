#include "tests/scenes/generated_scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <tuple>

#include <gtest/gtest.h>
#include <unistd.h>

#include "scenes/load.h"

namespace ivis::test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Corner = std::tuple<double, double, double>;
Corner corner(const Vec3& p) {
  return {p.x, p.y, p.z};
}

/// Directed edges, by exact position, and how often each occurs.
std::map<std::pair<Corner, Corner>, int> edges_of(const std::vector<Triangle>& triangles) {
  std::map<std::pair<Corner, Corner>, int> edges;
  for (const Triangle& t : triangles) {
    ++edges[{corner(t.a), corner(t.b)}];
    ++edges[{corner(t.b), corner(t.c)}];
    ++edges[{corner(t.c), corner(t.a)}];
  }
  return edges;
}

double cross(const Vec2& a, const Vec2& b) {
  return a.x * b.y - a.y * b.x;
}

}  // namespace

Scene load_bytes(const std::string& glb) {
  const auto file = std::filesystem::path(::testing::TempDir()) /
                    ("ivis_generated_" + std::to_string(getpid()) + ".glb");
  const auto written = write_file_whole(file, glb);
  EXPECT_TRUE(written) << written.error().message;
  auto scene = load_scene(file);
  std::filesystem::remove(file);
  if (!scene) {
    ADD_FAILURE() << scene.error().message;
    return {};
  }
  for (const std::string& w : scene->warnings)
    ADD_FAILURE() << "warning: " << w;
  return std::move(*scene);
}

std::vector<Triangle> world_triangles(const Scene& scene, const Object& object) {
  std::vector<Triangle> out;
  for (std::size_t t = 0; t < scene.mesh_of(object).triangles(); ++t)
    out.push_back(world_triangle(scene, object, t));
  return out;
}

std::vector<const Object*> named(const Scene& scene, const std::string& prefix) {
  std::vector<const Object*> out;
  for (const Object& o : scene.objects)
    if (scene.name_of(o).rfind(prefix, 0) == 0) out.push_back(&o);
  return out;
}

std::string why_not_closed(const std::vector<Triangle>& triangles) {
  const auto edges = edges_of(triangles);
  for (const auto& [edge, n] : edges) {
    if (n != 1) return "an edge runs " + std::to_string(n) + " times the same way";
    if (edges.count({edge.second, edge.first}) == 0)
      return "an edge has a triangle on one side only";
  }
  double volume = 0;
  const Vec3 origin = triangles.empty() ? Vec3(0) : triangles[0].a;
  for (const Triangle& t : triangles) {
    if (glm::length(glm::cross(t.b - t.a, t.c - t.a)) < 1e-4) return "a sliver";
    volume += glm::dot(t.a - origin, glm::cross(t.b - origin, t.c - origin)) / 6;
  }
  return volume > 1 ? "" : "volume " + std::to_string(volume);
}

GroundCheck::GroundCheck(const std::vector<Triangle>& triangles)
    : triangles_(triangles), lo_(kInfinity), hi_(-kInfinity) {
  for (const Triangle& t : triangles_)
    for (const Vec3& p : {t.a, t.b, t.c}) {
      lo_ = glm::min(lo_, ground(p));
      hi_ = glm::max(hi_, ground(p));
    }
  cell_ = std::max(1.0, std::sqrt((hi_.x - lo_.x) * (hi_.y - lo_.y) /
                                  std::max<double>(1, static_cast<double>(triangles_.size()))) *
                            2);
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    const Triangle& t = triangles_[i];
    const Vec2 a =
        glm::floor((glm::min(glm::min(ground(t.a), ground(t.b)), ground(t.c)) - lo_) / cell_);
    const Vec2 b =
        glm::floor((glm::max(glm::max(ground(t.a), ground(t.b)), ground(t.c)) - lo_) / cell_);
    for (int k = static_cast<int>(a.y); k <= static_cast<int>(b.y); ++k)
      for (int j = static_cast<int>(a.x); j <= static_cast<int>(b.x); ++j)
        buckets_[{j, k}].push_back(i);
  }
}

std::string GroundCheck::why_not_whole() const {
  const auto edges = edges_of(triangles_);
  for (const auto& [edge, n] : edges) {
    if (n != 1) return "an edge runs " + std::to_string(n) + " times the same way";
    if (edges.count({edge.second, edge.first}) != 0) continue;
    const Vec2 a(std::get<0>(edge.first), std::get<2>(edge.first));
    const Vec2 b(std::get<0>(edge.second), std::get<2>(edge.second));
    bool border = false;
    for (int axis = 0; axis < 2; ++axis)
      border = border || (a[axis] == b[axis] && (a[axis] == lo_[axis] || a[axis] == hi_[axis]));
    if (!border)
      return "an open edge inside, at " + std::to_string(a.x) + ", " + std::to_string(a.y);
  }
  double area = 0;
  for (const Triangle& t : triangles_) {
    const double up = glm::cross(t.b - t.a, t.c - t.a).y / 2;
    if (up <= 0) return "a triangle does not face up";
    area += up;
  }
  const double whole = (hi_.x - lo_.x) * (hi_.y - lo_.y);
  if (std::abs(area - whole) > 1e-9 * whole)
    return "area " + std::to_string(area) + " of " + std::to_string(whole);
  return "";
}

double GroundCheck::height(const Vec2& p) const {
  const Vec2 q = glm::floor((p - lo_) / cell_);
  const auto found = buckets_.find({static_cast<int>(q.x), static_cast<int>(q.y)});
  double best = -kInfinity;
  if (found == buckets_.end()) return best;
  for (const std::size_t i : found->second) {
    const Triangle& t = triangles_[i];
    const double area = cross(ground(t.b) - ground(t.a), ground(t.c) - ground(t.a));
    const double u = cross(ground(t.b) - p, ground(t.c) - p) / area;
    const double v = cross(ground(t.c) - p, ground(t.a) - p) / area;
    const double w = 1 - u - v;
    if (u < -1e-9 || v < -1e-9 || w < -1e-9) continue;
    best = std::max(best, u * t.a.y + v * t.b.y + w * t.c.y);
  }
  return best;
}

double distance_to(const Scene& scene, const std::vector<const Object*>& objects, const Vec2& p) {
  double best = kInfinity;
  for (const Object* o : objects) {
    const Vec2 off =
        glm::max(glm::max(ground(o->bounds.lo) - p, p - ground(o->bounds.hi)), Vec2(0));
    if (glm::length(off) >= std::min(best, 50.0)) continue;
    for (const Triangle& t : world_triangles(scene, *o)) {
      const std::array<Vec2, 3> v{ground(t.a), ground(t.b), ground(t.c)};
      int left = 0;
      int right = 0;
      for (std::size_t e = 0; e < 3; ++e) {
        const Vec2 d = v[(e + 1) % 3] - v[e];
        const double side = cross(d, p - v[e]);
        left += side > 0 ? 1 : 0;
        right += side < 0 ? 1 : 0;
        const double dd = glm::dot(d, d);
        const double s = dd > 0 ? std::clamp(glm::dot(p - v[e], d) / dd, 0.0, 1.0) : 0.0;
        best = std::min(best, glm::length(p - v[e] - d * s));
      }
      if (left == 3 || right == 3) return 0;
    }
  }
  return best;
}

double least_cover(const Scene& scene, const Object& object, const GroundCheck& ground_check) {
  const auto triangles = world_triangles(scene, object);
  double base = kInfinity;
  for (const Triangle& t : triangles)
    base = std::min({base, t.a.y, t.b.y, t.c.y});
  double least = kInfinity;
  for (const Triangle& t : triangles) {
    const double size =
        std::max({glm::length(t.b - t.a), glm::length(t.c - t.a), glm::length(t.c - t.b)});
    const int n = static_cast<int>(std::min(size / 0.7, 60.0)) + 2;
    for (int i = 0; i <= n; ++i)
      for (int k = 0; i + k <= n; ++k) {
        const Vec3 p = t.a + (t.b - t.a) * (static_cast<double>(i) / n) +
                       (t.c - t.a) * (static_cast<double>(k) / n);
        least = std::min(least, ground_check.height(ground(p)) - base);
      }
  }
  return least;
}

}  // namespace ivis::test
