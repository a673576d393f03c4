#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/fates.h"
#include "occluders/occluder_set.h"
#include "occluders/voxel_solids.h"
#include "scenes/scene.h"

namespace ivis {

/// Erodes one polygon of the ground plane by the shadow of a reach: {x : x + V_xz in P}.
/// The result errs inwards. Implementations: fast_erosion.h (no GPL), exact/exact_erosion.h (CGAL).
class Eroder {
 public:
  virtual ~Eroder() = default;
  virtual const char* name() const = 0;
  /// Guarantee: the result lies inside the true erosion. Errors: none; what fails comes back empty.
  /// Threads: const and reentrant.
  virtual std::vector<Polygon> erode(const Polygon& polygon, const Reach& reach) const = 0;
};

struct ShrinkReport {
  std::vector<ObjectFate>
      objects;                   ///< when ShrinkOptions::fates asked for them; in the scene's order
  std::size_t occluders_in = 0;  ///< objects considered
  std::size_t occluders_out = 0;                ///< shrunk prisms
  std::map<std::string, std::size_t> left_out;  ///< reason -> objects (or pieces)
  std::size_t convex_solids = 0;                ///< that are no upright prisms
  std::size_t convex_pieces = 0;                ///< of these, what the reach leaves
  std::size_t polyhedra = 0;                    ///< solids that the worker was asked about
  std::size_t polyhedra_shrunk = 0;             ///< of these, what is left
  std::size_t sheet_planes = 0;
  std::size_t sheet_tiles = 0;
  std::size_t sheet_faces = 0;  ///< of all levels
  double sheet_seconds = 0;
  double solid_volume = 0;  ///< cubic metres, real solids, without extensions
  double kept_volume = 0;   ///< of the shrunk prisms, without extensions
  double seconds = 0;
  std::optional<VoxelReport> voxels;  ///< when ShrinkOptions::voxel_m asked for them
  double volume_kept() const { return solid_volume > 0 ? kept_volume / solid_volume : 0; }
};

/// kAuto: where they promise gain: observers are inside, or most convex solids are marked `only`
/// and many of them are no upright prisms.
enum class SheetUse : std::uint8_t { kAuto, kOff, kOn };

/// Small closed solids that are neither prisms nor convex (nef_worker.h).
struct PolyhedronOptions {
  std::filesystem::path worker;  ///< the program ivis_nef; empty: such solids are left out
  double seconds = 10;           ///< for each; how far a solid gets may depend on the machine
  std::size_t most_triangles = 200;
};

struct ShrinkOptions {
  Reach reach;
  ViewSpace view_space;
  /// Also make what the occlusion map draws.
  bool margins = true;
  std::vector<double> margins_m{};  ///< empty: default_margins() of the reach
  SheetUse sheets = SheetUse::kAuto;
  bool fates = false;  ///< also tell what became of each object
  PolyhedronOptions polyhedra{};
  double voxel_m = 0;  ///< side of the voxels of general solids (voxel_solids.h); 0: none
};

struct Shrunk {
  OccluderSet set;
  ShrinkReport report;
};

/// Scene -> solids (prisms.h) -> fused per height level (fuse.h) -> eroded -> gated by an
/// independent distance check. Errors: kInvalidArgument when a seed of the view space lies in a
/// solid; kCancelled. Threads: reentrant; uses context.threads; the result does not depend on their
/// number.
Result<Shrunk> shrink(const Scene& scene, const ShrinkOptions& options, const Eroder& eroder,
                      const Context& context = {});

}  // namespace ivis
