#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/context.h"
#include "core/path.h"
#include "core/result.h"
#include "scenes/street_path.h"

namespace ivis {

struct CityOptions {
  std::uint64_t seed = 1;
  double size_m = 2000;               ///< side of the square, about the origin; 200 to 4000
  std::size_t buildings = 1500;       ///< aimed at, within a few per cent
  std::size_t objects = 100'000;      ///< aimed at, by the distance between windows
  std::size_t triangles = 1'900'000;  ///< aimed at, by the share of detailed windows
  double relief_m = 0;                ///< height of the ground's swells; 0 is flat
  StreetPathOptions path;             ///< its seed is taken from `seed`
};

/// A scene made up or dressed: the bytes of its GLB file, a walk through it, and what is in it.
struct GeneratedScene {
  std::string glb;
  std::vector<Pose> path;
  std::size_t buildings = 0;
  std::size_t objects = 0;
  std::size_t triangles = 0;  ///< each instance counted
};

/// Makes up a city: streets, blocks with courts, houses that share party walls, windows as
/// geometry, roofs, trees, lamps, cars, ground. Nodes: "building_<i>" (closed meshes, occluder
/// auto), "ground_<i>_<k>" (tiles of one height field over the whole square, above every building's
/// base), and a node a kind of small thing, instanced and tagged `never`. Guarantee: the same
/// options give the same bytes on every machine; the walk keeps
///            path.clearance_m from every building.
/// Errors:    kInvalidArgument for options out of range; kCancelled.
/// Threads:   reentrant; uses one.    Cost: a few seconds for the default.
Result<GeneratedScene> generate_city(const CityOptions& options, const Context& context = {});

}  // namespace ivis
