#pragma once

#include <cstdint>
#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/voxel_grid.h"

namespace ivis {

/// What one label stands for: voxels joined by faces.
struct VoxelComponent {
  std::size_t voxels = 0;
  IVec3 lo{0x7fffffff, 0x7fffffff, 0x7fffffff};  ///< voxels, inclusive
  IVec3 hi{-1, -1, -1};
  IVec3 sample;  ///< a voxel of it
};

struct Flooded {
  static constexpr std::uint32_t kReached = 1;
  /// By label; [0] stands for nothing, [1] for all that the seeds reach.
  std::vector<VoxelComponent> components;
  /// A voxel of each 6-connected part of what is reached.
  std::vector<IVec3> starts;
};

/// Labels every unmarked voxel: 1 where a path of unmarked voxels, from face to face, leads to a
/// seed, other numbers from 2 on for the rest, in the order of their first voxels. Seeds that lie
/// outside the grid or in marked voxels are the caller's to move. Guarantee: voxels of one label
/// are joined through space free of barriers (unmarked voxels are, as
///            closed boxes, and neighbours share a face): one that is reached can be walked to.
/// Errors:    kCancelled.    Threads: one; linear in tiles and nodes.
Result<Flooded> flood(VoxelGrid& grid, const std::vector<IVec3>& seeds, const Context& context);

}  // namespace ivis
