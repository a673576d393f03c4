#pragma once

#include <cstdint>
#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/voxel_grid.h"
#include "scenes/scene.h"

namespace ivis {

/// Triangles of a mesh, all of them opaque, that form a closed surface: every edge belongs to an
/// even number of them. Numbers among the mesh's barrier triangles.
using ClosedPiece = std::vector<std::uint32_t>;

/// What stops a flood: the opaque triangles that may be taken as occluders. Nodes marked `never`,
/// movers, MASK and BLEND materials do not, nor, where sidedness is honoured, single-sided
/// triangles of drawn nodes: what lies behind any of these is flooded as if they were not there,
/// which can only make less solid.
struct Barriers {
  struct Owner {
    std::uint32_t mesh = 0;
    bool hidden = false;
    std::uint32_t first = 0;  ///< of its triangles in VoxelGrid::triangles, up to the next owner's
    Vec3 lo{0}, hi{0};        ///< of them, in voxels
  };
  std::vector<Owner> owners;
  std::vector<std::vector<ClosedPiece>> pieces;         ///< by mesh, of drawn nodes
  std::vector<std::vector<ClosedPiece>> hidden_pieces;  ///< by mesh, of nodes marked `only`
  const std::vector<ClosedPiece>& pieces_of(const Owner& o) const {
    return o.hidden ? hidden_pieces[o.mesh] : pieces[o.mesh];
  }
};

struct Voxelized {
  VoxelGrid grid;
  Barriers barriers;
  std::size_t marked = 0;  ///< voxels
  std::size_t peak_bytes = 0;
};

/// Marks every voxel that a barrier triangle touches and finds the nodes of each tile. At least two
/// rows of voxels around the scene's bounds stay unmarked. All labels are kUnlabelled.
/// Guarantee: no barrier triangle meets an unmarked voxel (triangle_box.h).
/// Errors:    kInvalidArgument when the grid has more than 2^20 voxels along an axis or needs more
/// than
///            max_bytes, with what was found; kCancelled.
/// Threads:   uses context.threads; the result does not depend on their number.
/// Cost:      4 bytes a tile, about 200 a tile that triangles come near.
Result<Voxelized> voxelize(const Scene& scene, double cell_m, std::size_t max_bytes,
                           const Context& context);

}  // namespace ivis
