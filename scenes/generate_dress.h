#pragma once

#include "scenes/generate_city.h"
#include "scenes/scene.h"

namespace ivis {

struct DressOptions {
  std::uint64_t seed = 1;
  /// Of everything, the buildings included. The ground is always made; windows, lamps and trees
  /// fill what it leaves.
  std::size_t max_triangles = 1'900'000;
  double cell_m =
      5;  ///< of the ground; larger where the ground would take over a third of what is left
  double margin_m = 30;    ///< of the ground about the buildings
  StreetPathOptions path;  ///< its seed is taken from `seed`
  std::string copyright;   ///< for the file's asset.copyright: who made the buildings
};

/// Dresses real buildings: adds ground through their bases, windows on their walls, lamps and
/// trees, and a walk through their streets (within 2 km about their middle). Guarantee: objects of
/// `in` come first, in their order, with their meshes, transforms, tags and names
///            (each as a node of its own, mesh shared); the ground is one height field over a full
///            rectangle, nowhere below an object's lowest vertex under that object; the walk keeps
///            path.clearance_m from every triangle of `in`. The same inputs give the same bytes.
/// Errors:    kInvalidArgument when `in` has no triangles, or options are out of range; kCancelled.
/// Threads:   reentrant; uses one.    Cost: seconds for 400,000 triangles over 2 km x 2 km.
Result<GeneratedScene> generate_dress(const Scene& in, const DressOptions& options,
                                      const Context& context = {});

}  // namespace ivis
