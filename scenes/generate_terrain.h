#pragma once

#include <cstdint>
#include <optional>

#include "scenes/generate_city.h"
#include "scenes/read_dem.h"

namespace ivis {

/// A flight over terrain.
struct FlyoverOptions {
  std::size_t poses = 1800;
  double step_m = 200.0 / 60;  ///< between poses, along the ground plane
  double speed_m_s = 200;      ///< sets the column t
  double height_m = 100;  ///< above the highest ground within `smooth_m` ahead and behind, averaged
  double smooth_m = 150;
};

struct TerrainOptions {
  std::uint64_t seed = 1;
  std::size_t tile_cells = 64;
  std::size_t trees = 0;
  /// Aimed at, by the number of trees; `trees` counts when 0.
  std::size_t triangles = 0;
  FlyoverOptions path;
  std::string copyright;  ///< for the file's asset.copyright: who measured the heights
};

/// Terrain as objects to be culled: square tiles of `tile_cells` cells, nodes "terrain_<i>_<k>",
/// two triangles a cell, cells with a corner that was not measured left out; and trees, an instance
/// each, nodes "conifers_<i>_<k>" and "leafy_<i>_<k>" by tile, tagged `never`, each with a far
/// level of detail (MSFT_lod) that lies outside the file's scene, so that it is neither listed nor
/// blocks. The middle of the grid is the origin; x is east, z south, y the height measured.
/// Guarantee: neighbouring tiles share border vertices to the last bit; the same inputs give the
///            same bytes.
/// Errors:    kInvalidArgument for options out of range, or when no cell is whole; kCancelled.
/// Threads:   reentrant; uses one.    Cost: linear in cells and trees; 5 million cells in seconds.
Result<GeneratedScene> generate_terrain(const Dem& dem, const TerrainOptions& options,
                                        const Context& context = {});

/// A flight over the whole cells of a grid, in wide curves, as far from borders and holes as it
/// can. Guarantee: every eye lies over a whole cell, `height_m` or more above the ground under it.
/// Errors:    as above.
Result<std::vector<Pose>> flyover(const Dem& dem, std::uint64_t seed, const FlyoverOptions& options,
                                  const Context& context = {});

}  // namespace ivis
