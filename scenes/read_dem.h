#pragma once
// Measured terrain: a grid of heights, from a file or made up.

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "core/context.h"
#include "core/math.h"
#include "core/result.h"

namespace ivis {

/// Heights at the crossings of a regular grid, in metres. Rows run from north to south, so that
/// x is east and z south.
struct Dem {
  std::size_t columns = 0;
  std::size_t rows = 0;
  Vec2 step_m{1};  ///< between columns (x) and rows (z)
  /// heights[row * columns + column]; NaN where nothing was measured.
  std::vector<float> heights;
  float at(std::size_t column, std::size_t row) const { return heights[row * columns + column]; }
};

/// Which part of a file to read; all of it by default. At most one of the two is set.
struct DemCrop {
  std::optional<std::array<std::size_t, 4>> samples;  ///< column, row, columns, rows
  std::optional<Vec2> metres;                         ///< east-west, north-south, about the middle
};

inline constexpr std::size_t kMaxDemSamples = std::size_t{1} << 26U;

/// Can read_dem() read anything, or was GDAL left out of the build?
bool can_read_dem();

/// Reads GeoTIFF, ESRI ASCII grid and SRTM .hgt, first band. Geographic degrees become metres at
/// the latitude of the middle of what is read (WGS84), feet become metres. Errors: kUnsupported
/// without GDAL, or for a rotated grid; kIo; kInput naming the file, what was
///         found and what was expected; kInvalidArgument for a crop outside; kCancelled.
/// Source: GDAL does the reading; only these three drivers are let at the file.
Result<Dem> read_dem(const std::filesystem::path& file, const DemCrop& crop = {},
                     const Context& context = {});

/// Hills and valleys, the same for the same seed on every machine: `cells` x `cells` cells of
/// `step_m`, heights from 0 to a quarter of the side. `ragged`: nothing measured outside a slanted
/// region, and a few holes in it, as real surveys have.
Dem made_up_dem(std::size_t cells, double step_m, std::uint64_t seed, bool ragged = false);

}  // namespace ivis
