#pragma once

#include <vector>

#include "core/math.h"
#include "scenes/random.h"

namespace ivis {

/// A block of a city: the land between the middles of the streets about it.
struct CityBlock {
  /// Ring in (x, z), positive shoelace area, along the middles of the streets; mildly concave where
  /// a street curves.
  std::vector<Vec2> ring;
  std::vector<double>
      half_width;  ///< of the street along edge i -> i+1, building line to middle, metres
};

/// Cuts a square of `size` metres about the origin into blocks by streets, wide ones first: slanted
/// lines and arcs. Blocks are small in the middle and large at the rim.
/// `block_m`: typical side of a block in the middle, metres.
std::vector<CityBlock> plan_blocks(double size, double block_m, Random& random);

double ring_area(const std::vector<Vec2>& ring);  ///< shoelace, positive for our rings
Vec2 ring_centre(const std::vector<Vec2>& ring);  ///< of area

/// Moves each edge i inwards by inset[i]; empty when the ring is too small for it (an edge would
/// turn round).
std::vector<Vec2> inset_ring(const std::vector<Vec2>& ring, const std::vector<double>& inset);

}  // namespace ivis
