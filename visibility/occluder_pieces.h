#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "occluders/occluder_set.h"
#include "scenes/scene.h"
#include "visibility/box_tree.h"
#include "visibility/depth_cube.h"
#include "visibility/map_frame.h"

namespace ivis {

/// An occluder set's pieces and sheets as the depth cube draws them: single precision in map
/// coordinates.
struct OccluderPieces {
  /// When a piece may be drawn as it is.
  enum class Kind : std::uint8_t {
    kSolid,     ///< always
    kFloored,   ///< a prism drawn down to the floor, for cells above the scene's floor
    kGrounded,  ///< likewise, for cells over the ground
    kSheet,     ///< from its front
  };
  struct Level {
    std::uint32_t first_batch = 0;
    std::uint32_t batches = 0;
  };
  struct Piece {
    Kind kind = Kind::kSolid;
    std::uint32_t first_level = 0;  ///< into `levels`
    std::uint32_t levels = 0;  ///< entry k is drawn at margins_m[k], of a sheet at sheet_radii_m[k]
    std::uint32_t first_real_level =
        0;  ///< of a floored or grounded prism: as it stands, where its rule does not hold
    glm::vec3 lo{0}, hi{0};  ///< of all that may be drawn
    std::uint32_t first_floor =
        0;  ///< of a solid: half-spaces that the cell must lie in, or else it is drawn as it stands
    std::uint32_t floors = 0;
    // Of a sheet: it is { x : normal.x = offset } in map coordinates.
    Vec3 normal{0};
    double offset = 0;
  };

  MapFrame frame;
  std::vector<double> margins_m;
  std::vector<double> sheet_radii_m;
  std::vector<FaceBatch> batches;
  std::vector<Level> levels;
  std::vector<ConvexSolid::Plane> floors;  ///< relative to the frame's origin, not turned
  std::vector<Piece> pieces;
  BoxTree tree;  ///< of the pieces; items are indices into `pieces`

  std::span<const FaceBatch> faces(const Level& level) const {
    return {batches.data() + level.first_batch, level.batches};
  }
};

/// Cost: O(faces). Ownership: keeps nothing of its arguments.
OccluderPieces make_pieces(const Scene& scene, const OccluderSet& occluders, const MapFrame& frame);

}  // namespace ivis
