#pragma once

#include <array>

#include "core/math.h"
#include "scenes/write_glb.h"

namespace ivis {

/// Small things that generated scenes share, each one mesh drawn many times.
enum class Part : std::uint8_t {
  kWindowPlain,   ///< unit square facing +Z, centred in x, sill at y = 0; scale is (width, height,
                  ///< 1)
  kWindowBarred,  ///< the same with glazing bars and a sill
  kDoor,          ///< as a window
  kBalcony,       ///< as a window; reaches about 1 m out
  kTreeRound,     ///< 1 m high: scale is the height
  kTreeConical,
  kLamp,     ///< 1 m high, arm towards +Z
  kCar,      ///< real size, length along X
  kBench,    ///< real size, length along X
  kChimney,  ///< unit box standing on y = 0
};
constexpr std::size_t kPartCount = 10;

/// Instances of the parts, gathered while a scene is laid out.
class PartList {
 public:
  /// `facing`: unit vector in the ground plane that the part's +Z turns to.
  void add(Part part, const Vec3& at, const Vec2& facing, const Vec3& scale);
  void add(const PartList& other);
  std::size_t count() const;
  std::size_t count(Part part) const { return instances_[static_cast<std::size_t>(part)].size(); }
  std::size_t triangles() const;
  /// Appends the shared meshes, their materials, and a node a part ("window_plain", ...) tagged
  /// `never`.
  void write_to(GlbScene& scene) const;

 private:
  std::array<std::vector<GlbInstance>, kPartCount> instances_;
};

/// Triangles of one instance.
std::size_t triangles_of(Part part);

}  // namespace ivis
