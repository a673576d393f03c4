#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

struct VoxelOptions {
  double cell_m = 0.5;
  std::size_t max_bytes = 4'000'000'000;
  /// Keep as solid what leaks (docs/theory.md, 8). Sets OccluderSet::sealed when anything did: the
  /// guarantee is then gone.
  bool seal = false;
  /// Take only components that a closed surface proves shut (leak_test.h).
  bool proven_only = false;
  std::size_t max_rays = 16'000'000;  ///< of the leak test
};

struct VoxelReport {
  struct Leak {
    Vec3 where{0};
    double volume_m3 = 0;  ///< of the component it was found from
    bool by_ray = false;   ///< else by the fine flood
  };
  double cell_m = 0;
  std::size_t triangles = 0;  ///< that stop the flood
  std::size_t voxels = 0;     ///< of the grid
  std::size_t marked = 0;
  std::size_t reached = 0;      ///< and opened
  std::size_t solid = 0;        ///< unmarked, shut off, and thick enough to matter
  std::size_t components = 0;   ///< that the flood did not reach
  std::size_t thin = 0;         ///< of these: too thin for the reach, not tested
  std::size_t proven = 0;       ///< shut off by a closed surface
  std::size_t by_evidence = 0;  ///< found shut by the fine flood and by rays
  std::size_t leaking = 0;      ///< opened, or kept when `seal` was asked for
  std::size_t dropped = 0;      ///< not proven, where only that was asked for
  std::vector<Leak> leaks;      ///< the largest, at most kMaxLeaks
  static constexpr std::size_t kMaxLeaks = 16;
  std::size_t seeds_moved = 0;    ///< in marked voxels; taken to free ones they see
  std::size_t seeds_unclear = 0;  ///< saw none: all free voxels about them were taken
  std::size_t rays = 0;
  double solid_m3 = 0;
  std::vector<double> kept_m3;      ///< by margin
  std::vector<std::size_t> faces;   ///< by margin
  std::size_t levels_too_wide = 0;  ///< margins left out: beyond kMaxRadius voxels
  static constexpr std::int32_t kMaxRadius = 128;
  std::size_t pieces = 0;
  std::size_t deep_pieces = 0;  ///< left out: wholly behind others
  std::size_t closed_boxes = 0;
  std::size_t peak_bytes = 0;
  double seconds = 0;
};

/// Everything the observers cannot be in, as occluders: marks the voxels that opaque triangles
/// touch, floods from where the observers are (occluders.view_space), and takes what is neither
/// marked nor reached for solid, if the leak test finds it shut (leak_test.h says what of that is
/// proof and what evidence). Adds to occluders.solid_pieces the solid eroded by padded(reach,
/// slack_m) plus each of margins_m (0.1, 0.25, 0.5, 1, 2 and 4 m if there are none), and to
/// closed_boxes where no observer gets to. Nothing is changed on an error. Guarantee: a point moved
/// by any vector of V' + B(margin) from a piece of that level stays in solid
///            voxels: a voxel stays only if all voxels it would come to overlap are solid. A sight
///            line from the flooded space that reaches a solid voxel has crossed an opaque
///            triangle, if no component was taken that leaks after all. Positions are rounded by
///            less than slack_m.
/// Errors:    kInvalidArgument: cell size, too many voxels or bytes, no seed, a seed without a free
///            voxel near it; kCancelled.
/// Threads:   uses context.threads; the result does not depend on their number.
/// Cost:      docs/erosion.md.
Result<VoxelReport> add_voxel_solids(const Scene& scene, const VoxelOptions& options,
                                     OccluderSet& occluders, const Context& context = {});

/// For people.
std::string to_text(const VoxelReport& report);

}  // namespace ivis
