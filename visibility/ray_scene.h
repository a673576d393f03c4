#pragma once

#include <cstdint>
#include <memory>

#include "visibility/blockers.h"

namespace ivis {

/// Sixteen rays from org towards org + dir, and what each meets first.
struct RayPacket {
  static constexpr int kWidth = 16;
  static constexpr std::uint32_t kNothing = 0xffffffffU;

  alignas(64) float org[3][kWidth];  ///< relative to RayScene::origin(), metres
  alignas(64) float dir[3][kWidth];  ///< any length
  float tfar = 1;                    ///< rays end at org + tfar dir
  /// Results: index into Blockers::triangles or kNothing; ray parameter; weights of corners b, c.
  alignas(64) std::uint32_t hit[kWidth];
  alignas(64) float t[kWidth];
  alignas(64) float u[kWidth];
  alignas(64) float v[kWidth];
};

/// The blockers as one scene of the ray tracer, in single precision about a local origin.
/// Guarantee: none: a ray may slip between triangles or meet one that it should pass by; confirm
///            by exact_segment.h.
/// Threads:   const and reentrant. Ownership: keeps nothing of scene and blockers.
/// Cost:      about 100 bytes a triangle.
class RayScene {
 public:
  RayScene(const Scene& scene, const Blockers& blockers);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  const Vec3& origin() const;
  /// First hits of the packet's first `count` rays.
  void first_hits(RayPacket& packet, int count = RayPacket::kWidth) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ivis
