#pragma once

#include "core/math.h"
#include "scenes/city_buildings.h"
#include "scenes/city_parts.h"
#include "scenes/random.h"

namespace ivis {

/// Hangs windows, a door and balconies on a building's walls and sets chimneys on its roof.
/// `bay_scale`: stretches the distance between windows. `barred`: windows with glazing bars.
void dress_building(const CityBuilding& building, double bay_scale, bool barred, Random random,
                    PartList& parts);

}  // namespace ivis
