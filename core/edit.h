#pragma once
// How a scene changes while it is being served.

#include <cmath>
#include <cstdint>

#include "core/ids.h"
#include "core/math.h"

namespace ivis {

/// Where a rigidly moved object is: turned about its origin from how the scene file has it, its
/// origin at `position`.
struct Placement {
  Vec3 position{0};
  /// Unit, to within rounding; whoever uses it normalises it in double precision.
  glm::fquat rotation{1, 0, 0, 0};
  bool operator==(const Placement&) const = default;
  bool valid() const {
    const double length =
        std::sqrt(double{rotation.x} * rotation.x + double{rotation.y} * rotation.y +
                  double{rotation.z} * rotation.z + double{rotation.w} * rotation.w);
    return std::abs(position.x) <= kFarthestM && std::abs(position.y) <= kFarthestM &&
           std::abs(position.z) <= kFarthestM && std::abs(length - 1) <= 2e-6;
  }
  static constexpr double kFarthestM = 1e9;
};

/// An object that was changed, as it is now.
struct ObjectState {
  ObjectId id = 0;
  bool removed = false;
  bool occluder_off = false;  ///< hides nothing, is drawn all the same
  bool moved = false;         ///< `placement` counts: it was put somewhere, or moves by itself
  Placement placement;
  float speed_m_s = 0;  ///< of what moves by itself: at most
  bool operator==(const ObjectState&) const = default;
  bool as_in_the_file() const { return !removed && !occluder_off && !moved && speed_m_s == 0; }
};

inline constexpr float kFastestMoverMs = 1000;

enum class EditKind : std::uint8_t {
  kMove = 1,         ///< to `placement`; what moves by itself tells its speed
  kRemove = 2,       ///< it is neither drawn nor does it hide anything
  kAdd = 3,          ///< a removed one comes back where it was
  kOccluderOff = 4,  ///< it hides nothing any more, as an open door
  kOccluderOn = 5,
};

/// Of `id`: an object, or, for occluders, a node marked `only`: they are numbered on behind the
/// objects, in the order of Scene::hidden_solids.
struct Edit {
  EditKind kind = EditKind::kMove;
  ObjectId id = 0;
  Placement placement;
  float speed_m_s = 0;
  bool operator==(const Edit&) const = default;
};

/// Where a point of an object is once it was placed; `origin`: of the object in the scene file.
inline Vec3 placed(const Placement& p, const Vec3& origin, const Vec3& point) {
  return p.position + glm::normalize(glm::dquat(p.rotation)) * (point - origin);
}

}  // namespace ivis
