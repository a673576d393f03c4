#pragma once

#include <vector>

#include "scenes/city_blocks.h"
#include "scenes/city_buildings.h"
#include "scenes/city_parts.h"
#include "scenes/height_grid.h"
#include "scenes/random.h"
#include "scenes/street_path.h"

namespace ivis {

/// Sets lamps, parked cars and avenue trees along a block's streets, and trees and benches in its
/// parks, courts and gardens; adds what a walker must go round to `discs`.
void furnish_block(const CityBlock& block, const BuiltBlock& built, const HeightGrid& ground,
                   Random random, PartList& parts, std::vector<StreetObstacles::Disc>& discs);

}  // namespace ivis
