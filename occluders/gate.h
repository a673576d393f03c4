#pragma once

#include <vector>

#include "core/reach.h"
#include "occluders/shrink.h"

namespace ivis {

/// The pieces of the region's erosion by the reach's shadow that are at least `min_area_m2`:
/// simplified where that passes the distance check, as the eroder gave them where only that does;
/// what passes neither way adds to `failed`.
std::vector<Polygon> gated_erosion(const Polygon& region, const Reach& reach, const Eroder& eroder,
                                   double min_area_m2, std::size_t& failed);

}  // namespace ivis
