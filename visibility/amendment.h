#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/aabb.h"
#include "core/ids.h"
#include "occluders/occluder_change.h"

namespace ivis {

/// How a scene differs from the one that a method was made for, while one PVS is in use.
/// Threads: a value, read by many.
struct Amendment {
  /// Objects that are not where the scene has them, a bit each by id; null: none. Where the scene
  /// has them they are passed over.
  std::shared_ptr<const std::vector<std::uint64_t>> gone;
  struct Placed {
    ObjectId object = 0;
    Aabb bounds;  ///< of all places it may be at while the PVS is in use
  };
  /// Of those that are somewhere else: listed if any of the box may be seen.
  std::vector<Placed> placed;
  /// Of the method's occluders; null: they are as they were shrunk.
  std::shared_ptr<const OccluderChange> occluders;

  bool is_gone(ObjectId id) const {
    return gone != nullptr && (((*gone)[id >> 6U] >> (id & 63U)) & 1U) != 0;
  }
};

}  // namespace ivis
