#pragma once

#include <vector>

#include "scenes/city_parts.h"
#include "scenes/cover_raster.h"
#include "scenes/height_grid.h"
#include "scenes/random.h"
#include "scenes/scene.h"

namespace ivis {

/// A vertical plane of a real building, with the triangles that lie in it.
struct WallPlane {
  Vec2 origin{0};    ///< a point of it
  Vec2 along{1, 0};  ///< unit; the outside is on its right
  double from = 0;   ///< extent along, metres from origin
  double to = 0;
  double bottom = 0;
  double top = 0;
  std::vector<std::array<Vec2, 3>> triangles;  ///< (along, y)
};

/// The walls of an object that face open air, found by the raster; party walls and slivers are left
/// out.
std::vector<WallPlane> outer_walls(const Scene& scene, const Object& object,
                                   const CoverRaster& cover);

/// Hangs windows where they fit: wholly on the wall, above the ground, nothing standing in front.
/// `bay_m`: distance between windows.
void hang_windows(const std::vector<WallPlane>& walls, double bay_m, const HeightGrid& ground,
                  const CoverRaster& cover, Random random, PartList& parts);

}  // namespace ivis
