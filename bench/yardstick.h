#pragma once

#include <cstddef>
#include <memory>

#include "core/math.h"
#include "scenes/scene.h"

namespace ivis::bench {

/// The pinned yardstick of the benchmark: from-point occlusion culling as a game engine does it, by
/// rays to a depth pyramid. Four side faces of 256 x 256 pixels and 90 degrees see the buildings'
/// triangles only (nodes named building_*): one ray a pixel's centre, rtcIntersect16 on 4 x 4
/// pixels, one thread. A pyramid of farthest depths then answers a hierarchical test of every other
/// object's box.
/// Units:     metres.
/// Guarantee: none: one ray a pixel misses slits, and a point eye is not a view cell.
/// Threads:   run() keeps buffers between calls: one thread at a time.
/// Source:    Greene, Kass, Miller, Hierarchical Z-buffer visibility, 1993; Embree 3.
class Yardstick {
 public:
  explicit Yardstick(const Scene& scene);
  ~Yardstick();
  Yardstick(const Yardstick&) = delete;
  Yardstick& operator=(const Yardstick&) = delete;

  /// Number of boxes not hidden from the eye. Boxes wholly above or below all four faces are not
  /// counted.
  std::size_t run(const Vec3& eye);
  /// Triangles traced against, boxes tested.
  std::size_t triangles() const;
  std::size_t boxes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ivis::bench
