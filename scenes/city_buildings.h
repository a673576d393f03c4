#pragma once

#include <vector>

#include "core/math.h"
#include "scenes/city_blocks.h"
#include "scenes/height_grid.h"
#include "scenes/random.h"
#include "scenes/write_glb.h"

namespace ivis {

enum class Roof : std::uint8_t { kFlat, kGable, kMansard, kHip, kShed };

/// A building: a strip between an outer line (its street side) and an inner one (its court side),
/// of one piece, or of two about a corner. Both lines run with the block's ring; outer[i] faces
/// inner[i].
struct CityBuilding {
  std::vector<Vec2> outer;
  std::vector<Vec2> inner;
  double base = 0;    ///< below the ground everywhere under it
  double street = 0;  ///< height of the ground at its door: storeys count from here
  double eave = 0;
  Roof roof = Roof::kFlat;
  double roof_height = 0;
  double storey = 3.2;
  bool free_ends = false;   ///< its end walls are no party walls: they have windows
  bool hall = false;        ///< one storey, few windows
  bool bare_court = false;  ///< the court side has half the windows
  std::size_t style = 0;    ///< colour, window size

  std::vector<Vec2> footprint() const;  ///< positive shoelace area
};

/// What a block is used for.
enum class BlockUse : std::uint8_t { kPerimeter, kSlabs, kVillas, kHall, kPark, kSquare };

struct BuiltBlock {
  BlockUse use = BlockUse::kPark;
  std::vector<Vec2>
      line;  ///< the building line: the block less half its streets; empty if nothing is left
  std::vector<CityBuilding> buildings;
};

/// Builds a block over. `frontage_m`: typical length of a house along the street.
/// `out`: 0 in the middle of the city, 1 at its rim.
BuiltBlock build_block(const CityBlock& block, double out, double frontage_m,
                       const HeightGrid& ground, Random random);

/// Closed 2-manifold with outward winding: walls, roof and floor share their vertices, no
/// T-junctions.
GlbPrimitive building_mesh(const CityBuilding& building, std::uint32_t material);

}  // namespace ivis
