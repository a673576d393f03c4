#include "scenes/read_dem.h"

#ifdef IVIS_HAVE_GDAL

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <string>

#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal.h>
#include <ogr_srs_api.h>

namespace ivis {
namespace {

constexpr double kRadiansADegree = 0.017453292519943295;
// Of the ellipsoid WGS84.
constexpr double kSemiMajorM = 6378137.0;
constexpr double kEccentricity2 = 0.00669437999014;
constexpr double kHighestM = 100'000;

struct Close {
  void operator()(void* dataset) const { GDALClose(dataset); }
};

/// Keeps GDAL from printing, and its last message for ours.
class Quiet {
 public:
  Quiet() {
    CPLErrorReset();
    CPLPushErrorHandler(CPLQuietErrorHandler);
  }
  ~Quiet() { CPLPopErrorHandler(); }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;
  static std::string reason() {
    std::string text = CPLGetLastErrorMsg();
    if (text.empty()) return "not a GeoTIFF, ESRI ASCII grid or .hgt";
    return text.substr(0, 200);
  }
};

/// Metres a unit of the file's coordinates at `latitude` (degrees, of geographic ones).
Result<Vec2> metres_a_unit(GDALDatasetH dataset, double latitude, const std::string& name) {
  OGRSpatialReferenceH srs = GDALGetSpatialRef(dataset);
  if (srs == nullptr) return Vec2(1);  // an ASCII grid without a .prj
  if (OSRIsGeographic(srs) == 0) {
    const double unit = OSRGetLinearUnits(srs, nullptr);
    if (!(unit > 0))
      return input_error(name + ": a unit of length of " + std::to_string(unit) + " m");
    return Vec2(unit);
  }
  if (!(std::abs(latitude) < 89))
    return input_error(name + ": latitude " + std::to_string(latitude) +
                       " of the middle, expected -89 to 89");
  const double degree = OSRGetAngularUnits(srs, nullptr);  // radians a unit
  const double phi = latitude * degree;
  const double w2 = 1 - kEccentricity2 * std::sin(phi) * std::sin(phi);
  const double w = std::sqrt(w2);
  return Vec2{kSemiMajorM / w * std::cos(phi), kSemiMajorM * (1 - kEccentricity2) / (w2 * w)} *
         degree;
}

struct Window {
  std::size_t column = 0, row = 0, columns = 0, rows = 0;
};

std::string text(const Window& w) {
  return std::to_string(w.column) + "," + std::to_string(w.row) + "," + std::to_string(w.columns) +
         "," + std::to_string(w.rows);
}

}  // namespace

bool can_read_dem() {
  return true;
}

Result<Dem> read_dem(const std::filesystem::path& file, const DemCrop& crop,
                     const Context& context) {
  static std::once_flag registered;
  std::call_once(registered, [] { GDALAllRegister(); });
  const std::string name = "'" + file.string() + "'";
  std::error_code ec;
  if (!std::filesystem::is_regular_file(file, ec))
    return io_error("cannot open " + name + ": no such file");
  const Quiet quiet;
  constexpr const char* kDrivers[] = {"GTiff", "AAIGrid", "SRTMHGT", nullptr};
  const std::unique_ptr<void, Close> dataset(
      GDALOpenEx(file.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY, kDrivers, nullptr, nullptr));
  if (!dataset) return input_error(name + ": " + Quiet::reason());
  GDALRasterBandH band =
      GDALGetRasterCount(dataset.get()) > 0 ? GDALGetRasterBand(dataset.get(), 1) : nullptr;
  if (band == nullptr) return input_error(name + ": no band, expected one of heights");
  const auto width = static_cast<std::size_t>(GDALGetRasterXSize(dataset.get()));
  const auto height = static_cast<std::size_t>(GDALGetRasterYSize(dataset.get()));

  double to_world[6] = {0, 1, 0, 0, 0, -1};
  if (GDALGetGeoTransform(dataset.get(), to_world) != CE_None)
    return input_error(name + ": no georeference, expected the size of a cell");
  if (to_world[2] != 0 || to_world[4] != 0)
    return unsupported(name + ": the grid is rotated, expected rows from west to east");
  if (!std::isfinite(to_world[1]) || !std::isfinite(to_world[5]) || !(to_world[1] > 0) ||
      to_world[5] == 0)
    return input_error(name + ": cells of " + std::to_string(to_world[1]) + " x " +
                       std::to_string(to_world[5]) + ", expected more than 0");

  Window window{0, 0, width, height};
  if (crop.samples) {
    const auto& s = *crop.samples;
    window = {s[0], s[1], s[2], s[3]};
  }
  const auto step_at = [&](const Window& w) -> Result<Vec2> {
    const double middle =
        to_world[3] + to_world[5] * (static_cast<double>(w.row) + static_cast<double>(w.rows) / 2);
    const auto unit = metres_a_unit(dataset.get(), middle, name);
    if (!unit) return unit.error();
    return *unit * Vec2{to_world[1], std::abs(to_world[5])};
  };
  auto step = step_at(window);
  if (!step) return step.error();
  if (crop.metres) {
    const auto part = [](double metres, double cell, std::size_t all) {
      const double cells = std::floor(metres / cell + 0.5);
      return static_cast<std::size_t>(
                 std::clamp(cells, 1.0, std::max(1.0, static_cast<double>(all) - 1))) +
             1;
    };
    window.columns = part(crop.metres->x, step->x, width);
    window.rows = part(crop.metres->y, step->y, height);
    window.column = (width - window.columns) / 2;
    window.row = (height - window.rows) / 2;
  }
  if (window.columns < 2 || window.rows < 2 || window.column >= width || window.row >= height ||
      window.columns > width - window.column || window.rows > height - window.row)
    return invalid_argument(name + ": crop " + text(window) +
                            " (column, row, columns, rows) of a grid of " + std::to_string(width) +
                            " x " + std::to_string(height) +
                            ", expected a part of it of at least 2 x 2");
  if (window.columns > kMaxDemSamples / window.rows)
    return invalid_argument(name + ": " + std::to_string(window.columns) + " x " +
                            std::to_string(window.rows) + " heights, expected at most " +
                            std::to_string(kMaxDemSamples) + ": crop it");

  Dem dem;
  dem.columns = window.columns;
  dem.rows = window.rows;
  dem.step_m = *step;
  dem.heights.resize(dem.columns * dem.rows);
  for (std::size_t r = 0; r < dem.rows; ++r) {
    if (context.stopped()) return cancelled();
    if (r % 64 == 0) context.report("reading", r, dem.rows);
    // A grid whose rows run from south to north is turned over.
    const std::size_t from = window.row + (to_world[5] < 0 ? r : dem.rows - 1 - r);
    if (GDALRasterIO(band, GF_Read, static_cast<int>(window.column), static_cast<int>(from),
                     static_cast<int>(dem.columns), 1, &dem.heights[r * dem.columns],
                     static_cast<int>(dem.columns), 1, GDT_Float32, 0, 0) != CE_None)
      return input_error(name + ": row " + std::to_string(from) + ": " + Quiet::reason());
  }
  context.report("reading", dem.rows, dem.rows);

  int has_nodata = 0;
  const auto nodata = static_cast<float>(GDALGetRasterNoDataValue(band, &has_nodata));
  int has_scale = 0;
  int has_offset = 0;
  double scale = GDALGetRasterScale(band, &has_scale);
  double offset = GDALGetRasterOffset(band, &has_offset);
  if (has_scale == 0) scale = 1;
  if (has_offset == 0) offset = 0;
  const std::string unit = GDALGetRasterUnitType(band);
  if (unit == "ft" || unit == "foot" || unit == "feet") scale *= 0.3048;
  std::size_t measured = 0;
  for (std::size_t i = 0; i < dem.heights.size(); ++i) {
    float& h = dem.heights[i];
    if (!std::isfinite(h) || (has_nodata != 0 && h == nodata)) {
      h = std::numeric_limits<float>::quiet_NaN();
      continue;
    }
    const double metres = offset + scale * static_cast<double>(h);
    if (!(std::abs(metres) <= kHighestM))
      return input_error(name + ": column " + std::to_string(window.column + i % dem.columns) +
                         ", row " + std::to_string(window.row + i / dem.columns) + ": height " +
                         std::to_string(metres) +
                         " m, expected -100000 to 100000, or the file's value for no data");
    h = static_cast<float>(metres);
    ++measured;
  }
  if (measured == 0) return input_error(name + ": no height in the part read, only holes");
  return dem;
}

}  // namespace ivis

#else

namespace ivis {

bool can_read_dem() {
  return false;
}

Result<Dem> read_dem(const std::filesystem::path& file, const DemCrop&, const Context&) {
  return unsupported("'" + file.string() +
                     "': this ivis was built without GDAL and reads no terrain files; install "
                     "libgdal-dev (scripts/install-deps --with-gdal) and configure with "
                     "-DIVIS_WITH_GDAL=ON, or use --made-up");
}

}  // namespace ivis

#endif
