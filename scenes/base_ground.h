#pragma once

#include "core/context.h"
#include "core/result.h"
#include "scenes/height_grid.h"
#include "scenes/scene.h"

namespace ivis {

/// Ground under buildings of which nothing but their meshes is known: their lowest points are
/// heights of the ground; between them it is interpolated smoothly. Guarantee: over every cell that
/// a triangle of an object touches, seen from above, the drawn ground
///            lies nowhere below that object's lowest vertex. (All vertices of such a cell are at
///            least that high, rounded up to float, and a drawn triangle lies between its
///            vertices.)
/// `cell_m`:  side of a grid cell, metres. `margin_m`: of the rectangle about the scene's bounds.
/// Errors:    kCancelled.    Cost: O(triangles x cells each touches + 40 x cells).
Result<HeightGrid> base_ground(const Scene& scene, double cell_m, double margin_m,
                               const Context& context);

/// Lowest y of the object's vertices in use, world; 0 when it has none.
double lowest_vertex(const Scene& scene, const Object& object);

}  // namespace ivis
