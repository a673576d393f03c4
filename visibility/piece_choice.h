#pragma once
// Which occluders an occlusion map draws, at which margin: one rule for every backend.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/view_cell.h"
#include "visibility/occluder_pieces.h"

namespace ivis {

/// Guards of the map that tests take out one by one to prove that the verifier has power. All on in
/// use.
struct OcclusionGuards {
  bool pixel_margin =
      true;  ///< draw a piece at the margin that covers a pixel at its far side, not at the least
  bool sheet_obliqueness =
      true;  ///< take a sheet's radius for the worst line of sight, not for a perpendicular one
};

/// The cell as occlusion maps want it, seen from its centre.
struct MapCell {
  Vec3 eye{0};  ///< in map coordinates
  float single[3] = {};
  Vec3 local{0};      ///< relative to the frame's origin, not turned
  Reach reach;        ///< padded
  double radius = 0;  ///< of a ball about the eye that holds the cell
  bool above_floor = false;
  bool on_ground = false;
};
MapCell make_map_cell(const ViewCell& cell, const MapFrame& frame, const OccluderSet& occluders);

/// Where a map's depth should be spent: what is nearer than this counts as visible.
float near_for(const Reach& reach);

/// Pixels a side of a face, where 0 leaves the choice to the map.
std::uint32_t pixels_for(std::uint32_t wanted, const Reach& reach);

/// How far a map's samples are off: a line of sight through a pixel passes within at(w) of the
/// place that decided the pixel, at depth w. A pixel's half diagonal is sqrt(2) w / n: a factor of
/// sqrt(2), more for what the rasteriser and rounding add.
struct SampleMargin {
  double factor;
  double pixels;  ///< a side of a face
  double at(double w) const { return factor * w / pixels; }
};

struct PieceChoice {
  std::uint32_t level = 0;  ///< into OccluderPieces::levels
  std::uint32_t sides = 0;  ///< of the cube to draw on; 0: draw nothing
};

/// The first margin that covers a sample at the piece's far side; nothing where none does. `sides`
/// are those that the caller wants.
PieceChoice choose_level(const OccluderPieces& pieces, const OccluderPieces::Piece& piece,
                         const MapCell& cell, const SampleMargin& margin, std::uint32_t sides,
                         const OcclusionGuards& guards = {});

/// The `most` pieces of largest projected area among `among`, near ones first.
std::vector<std::uint32_t> largest_pieces(const OccluderPieces& pieces, const Vec3& eye,
                                          std::size_t most, std::span<const std::uint32_t> among);

}  // namespace ivis
