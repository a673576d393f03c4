#pragma once

#include <cmath>
#include <utility>

#include "tests/support/scene_builder.h"

namespace ivis::test {

/// A room of thin brushes, as a game's map has them, with a doorway, and boxes outside.
inline Scene thin_room() {
  SceneBuilder b;
  const double t = 0.2;
  const auto brush = [&](const Vec3& lo, const Vec3& hi) { b.add_box(lo, hi, OccluderTag::kOnly); };
  brush({-4, 0, -4 - t}, {4, 3, -4});
  brush({-4, 0, 4}, {4, 3, 4 + t});
  brush({-4 - t, 0, -4}, {-4, 3, 4});
  brush({4, 0, -4}, {4 + t, 3, -0.6});
  brush({4, 0, 0.6}, {4 + t, 3, 4});
  brush({4, 2.2, -0.6}, {4 + t, 3, 0.6});
  brush({-4 - t, -t, -4 - t}, {4 + t, 0, 4 + t});
  brush({-4 - t, 3, -4 - t}, {4 + t, 3 + t, 4 + t});
  for (int i = 0; i < 400; ++i) {
    const double angle = i * 0.5;
    const Vec3 at{(8 + 0.05 * i) * std::cos(angle), 0.3 + i % 7 * 0.4,
                  (8 + 0.05 * i) * std::sin(angle)};
    b.add_box(at - 0.2, at + 0.2, OccluderTag::kNever);
  }
  return std::move(b).finish();
}

}  // namespace ivis::test
