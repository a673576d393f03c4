#pragma once
// What shrinking made of each object: for reports.

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

/// What became of one object's parts (edge-connected pieces of its mesh).
struct ObjectFate {
  const Object* object = nullptr;  ///< of the scene, which must outlive this
  bool ground = false;             ///< drawn ground or terrain
  std::size_t prisms = 0;
  std::size_t convex = 0;  ///< convex solids that are no upright prisms
  bool vanished = false;   ///< solid, and thinner than the reach: nothing of it is left
  double volume = 0;       ///< cubic metres of its closed pieces
  std::map<std::string, std::size_t> left_out;  ///< reason -> pieces
};

/// Sets `vanished` of the objects that gave prisms: an object has vanished when no shrunk prism
/// stands on any of its footprints. set.solids are those of fates[0], then of fates[1], and so on.
/// Cost: near linear in prisms.
void find_vanished(const OccluderSet& set, std::vector<ObjectFate>& fates);

}  // namespace ivis
