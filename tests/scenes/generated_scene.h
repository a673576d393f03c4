#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/path.h"
#include "scenes/scene.h"

namespace ivis::test {

/// Loads the bytes through a file; fails the test when that fails.
Scene load_bytes(const std::string& glb);

std::vector<Triangle> world_triangles(const Scene& scene, const Object& object);

/// Objects whose node's name begins with `prefix`.
std::vector<const Object*> named(const Scene& scene, const std::string& prefix);

/// Why the triangles are no closed 2-manifold with outward winding and no slivers; empty if they
/// are.
std::string why_not_closed(const std::vector<Triangle>& triangles);

/// Ground taken apart by means of its own, to judge the generators by.
class GroundCheck {
 public:
  explicit GroundCheck(const std::vector<Triangle>& triangles);
  /// Why it is not one height field over exactly one rectangle, edge to edge; empty if it is.
  std::string why_not_whole() const;
  double height(const Vec2& p) const;  ///< -infinity outside
  Vec2 lo() const { return lo_; }
  Vec2 hi() const { return hi_; }

 private:
  std::vector<Triangle> triangles_;
  Vec2 lo_{0}, hi_{0};
  double cell_ = 1;
  std::map<std::pair<int, int>, std::vector<std::size_t>> buckets_;
};

/// Least distance in the ground plane from p to the triangles of the objects.
double distance_to(const Scene& scene, const std::vector<const Object*>& objects, const Vec2& p);

/// How far the ground lies above the object's lowest vertex where it is least, sampled over the
/// object's triangles.
double least_cover(const Scene& scene, const Object& object, const GroundCheck& ground);

}  // namespace ivis::test
