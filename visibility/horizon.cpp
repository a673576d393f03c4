#include "visibility/horizon.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ivis {
namespace {

constexpr float kNothing = -std::numeric_limits<float>::infinity();
constexpr double kKnown = 0.5 * static_cast<double>(HeightField::kNone);
constexpr double kRelative = 1e-6;   // for the roundings of a slope
constexpr double kSideSlack = 1e-5;  // of u: more than azimuths are rounded by
constexpr std::size_t kFewestUnits = 16;
// More than the lines a strip may span. At this size a double resolves 4e-6 of a line: kEdge is
// more.
constexpr std::int64_t kRaise = std::int64_t{1} << 34;
constexpr double kEdge = 1e-5;
constexpr double kTiny = 1e-9;  // for roundings of a cell's index
// What a file may say of a field's cells and size; a field beyond is not drawn.
constexpr double kLeastStepM = 1e-3;
constexpr double kMostM = 1e7;

float below(double v) {
  return std::nextafter(static_cast<float>(v), kNothing);
}

}  // namespace

/// A quarter of the plane about the eye: `major` away from it, u = side / major from -1 to 1.
struct TerrainMap::Face {
  bool along_x;      ///< major axis
  double direction;  ///< of the major axis: 1 or -1
  double side;       ///< of the minor axis, as u rises
  Vec2 eye;          ///< relative to the field's corner
};

TerrainMap::TerrainMap(const HeightField& field, const Vec3& origin, std::uint32_t bins_a_face)
    : lo_(field.origin - ground(origin)),
      units_a_face_(std::min(Horizon::kMostUnitsAFace, bins_a_face)),
      unit_shift_(std::countr_zero(bins_a_face / units_a_face_)) {
  auto columns = static_cast<std::int32_t>(field.columns);
  auto rows = static_cast<std::int32_t>(field.rows);
  levels_.push_back({0, columns, rows, field.step});
  least_.reserve(field.heights.size() * 4 / 3 + 64);
  for (const float h : field.heights)
    least_.push_back(h == HeightField::kNone ? h : below(static_cast<double>(h) - origin.y));
  while (columns > 1 || rows > 1) {
    const Level fine = levels_.back();
    columns = (columns + 1) / 2;
    rows = (rows + 1) / 2;
    const std::size_t first = least_.size();
    levels_.push_back({first, columns, rows, fine.step * 2.0});
    // A square that sticks out of the grid is not known.
    for (std::int32_t r = 0; r < rows; ++r)
      for (std::int32_t c = 0; c < columns; ++c) {
        float least = std::numeric_limits<float>::infinity();
        for (std::int32_t y = 2 * r; y < 2 * r + 2; ++y)
          for (std::int32_t x = 2 * c; x < 2 * c + 2; ++x)
            least = std::min(
                least,
                y < fine.rows && x < fine.columns
                    ? least_[fine.first +
                             static_cast<std::size_t>(y) * static_cast<std::size_t>(fine.columns) +
                             static_cast<std::size_t>(x)]
                    : HeightField::kNone);
        least_.push_back(least);
      }
  }
  turned_.resize(least_.size());
  for (const Level& l : levels_)
    for (std::int32_t r = 0; r < l.rows; ++r)
      for (std::int32_t c = 0; c < l.columns; ++c)
        turned_[l.first + static_cast<std::size_t>(c) * static_cast<std::size_t>(l.rows) +
                static_cast<std::size_t>(r)] =
            least_[l.first + static_cast<std::size_t>(r) * static_cast<std::size_t>(l.columns) +
                   static_cast<std::size_t>(c)];
  const double nearest = 2 * std::max({field.step.x, field.step.y, 1.0});
  const double farthest = std::max(field.step.x * field.columns, field.step.y * field.rows);
  if (!(std::min(field.step.x, field.step.y) >= kLeastStepM) || !(farthest <= kMostM)) return;
  // Rows begin where a cell takes up a good part of a face, and end at the field's far side.
  base_ =
      std::bit_cast<std::int32_t>(std::exp2(static_cast<float>(std::ceil(std::log2(nearest))))) >>
      Horizon::kShift;
  const std::int32_t end =
      std::bit_cast<std::int32_t>(static_cast<float>(farthest)) >> Horizon::kShift;
  rows_ = std::clamp(end - base_ + 2, 1, 2048);
}

bool TerrainMap::known_about(const Vec2& eye, double half_m) const {
  const Level& l = levels_[0];
  const Vec2 lo = glm::floor((eye - half_m) / l.step);
  const Vec2 hi = glm::floor((eye + half_m) / l.step);
  if (!(lo.x >= 0 && lo.y >= 0 && hi.x < l.columns && hi.y < l.rows)) return false;
  for (auto r = static_cast<std::size_t>(lo.y); r <= static_cast<std::size_t>(hi.y); ++r)
    for (auto c = static_cast<std::size_t>(lo.x); c <= static_cast<std::size_t>(hi.x); ++c)
      if (static_cast<double>(least_[r * static_cast<std::size_t>(l.columns) + c]) < kKnown)
        return false;
  return true;
}

// Along an azimuth of a unit, every point of the strip lies over one of the cells taken, whose
// least height is h: the azimuth crosses matter of height h all through the strip, so of slope h /
// near if h >= 0 (relative to the eye) and h / far if not. Taking larger cells, or more, only
// lowers h. A cell that is not known ends the unit's run for good: behind it a sight line may have
// passed under the surface through a hole.
bool TerrainMap::draw_strip(const Face& face, double near, double far, double height,
                            std::size_t units, Horizon& horizon, float* row,
                            std::uint8_t* done) const {
  // Squares about half a strip deep.
  std::size_t level = 0;
  const auto depth = [&](const Level& l) { return face.along_x ? l.step.x : l.step.y; };
  while (level + 1 < levels_.size() && depth(levels_[level]) < 0.5 * (far - near))
    ++level;
  const Level& l = levels_[level];
  const auto n_major = face.along_x ? l.columns : l.rows;
  const auto n_minor = face.along_x ? l.rows : l.columns;
  const double step_major = depth(l);
  const double step_minor = face.along_x ? l.step.y : l.step.x;
  const double eye_major = (face.along_x ? face.eye.x : face.eye.y) / step_major;
  const double eye_minor = (face.along_x ? face.eye.y : face.eye.x) / step_minor;
  const double a = eye_major + face.direction * near / step_major;
  const double b = eye_major + face.direction * far / step_major;
  const double from = std::floor(std::min(a, b) * (1 - kTiny) - kTiny);
  const double to = std::floor(std::max(a, b) * (1 + kTiny) + kTiny);
  const double reach = far * (1 + kSideSlack) / step_minor;
  const double first_line = std::max(0.0, std::floor(eye_minor - reach - kEdge));
  const double last_line =
      std::min(static_cast<double>(n_minor) - 1, std::floor(eye_minor + reach + kEdge));
  if (!(from >= 0) || !(to < n_major) || !(last_line >= first_line)) return false;
  // Least over the strip's depth of each line of cells.
  const auto lines = static_cast<std::size_t>(last_line - first_line) + 1;
  std::vector<float>& line = horizon.line_;
  line.assign(lines, std::numeric_limits<float>::infinity());
  const float* cells = (face.along_x ? turned_ : least_).data() + l.first;
  for (auto m = static_cast<std::size_t>(from); m <= static_cast<std::size_t>(to); ++m) {
    const float* from_line =
        cells + m * static_cast<std::size_t>(n_minor) + static_cast<std::size_t>(first_line);
    for (std::size_t i = 0; i < lines; ++i)
      line[i] = std::min(line[i], from_line[i]);
  }
  bool any = false;
  const std::size_t share = units_a_face_ / units;
  const double width = 2.0 / static_cast<double>(units);
  const double by_near = (1 - kRelative) / near;
  const double by_far = (1 + kRelative) / far;
  // In lines from first_line on, raised so that truncation rounds down.
  const double offset = eye_minor - first_line + static_cast<double>(kRaise);
  const double near_lines = near / step_minor;
  const double far_lines = far / step_minor;
  for (std::size_t g = 0; g < units; ++g) {
    if (done[g] != 0) continue;
    const double u0 = -1 + width * static_cast<double>(g) - kSideSlack;
    const double u1 = u0 + width + 2 * kSideSlack;
    const double s0 = u0 < 0 ? u0 * far_lines : u0 * near_lines;
    const double s1 = u1 > 0 ? u1 * far_lines : u1 * near_lines;
    const auto lo = static_cast<std::int64_t>(offset + (face.side > 0 ? s0 : -s1) - kEdge) - kRaise;
    const auto hi = static_cast<std::int64_t>(offset + (face.side > 0 ? s1 : -s0) + kEdge) - kRaise;
    float least = HeightField::kNone;
    if (lo >= 0 && hi < static_cast<std::int64_t>(lines)) {
      least = line[static_cast<std::size_t>(lo)];
      for (auto i = lo + 1; i <= hi; ++i)
        least = std::min(least, line[static_cast<std::size_t>(i)]);
    }
    if (static_cast<double>(least) < kKnown) {
      done[g] = 1;
      continue;
    }
    any = true;
    const double h = static_cast<double>(least) - height;
    // To the nearest float: kRelative is more than that.
    const auto slope = static_cast<float>(h * (h >= 0 ? by_near : by_far));
    if (slope > row[g * share]) std::fill_n(row + g * share, share, slope);
  }
  return any;
}

void TerrainMap::draw(const float eye[3], Horizon& horizon) const {
  horizon.base_ = base_;
  horizon.unit_shift_ = unit_shift_;
  horizon.rows_ = 0;
  horizon.stride_ = 4 * units_a_face_ + Horizon::kPad;
  const Vec2 foot = Vec2{static_cast<double>(eye[0]), static_cast<double>(eye[2])} - lo_;
  const double start = static_cast<double>(Horizon::distance(0, base_));
  if (rows_ < 2 || !known_about(foot, start * (1 + 2 * kSideSlack))) return;
  horizon.slopes_.resize(static_cast<std::size_t>(rows_) * horizon.stride_);
  const std::size_t units = units_a_face_;
  auto& done = horizon.done_;
  done.assign(4 * units, 0);
  const Face faces[4] = {
      {true, 1, 1, foot}, {false, 1, -1, foot}, {true, -1, -1, foot}, {false, -1, 1, foot}};
  const double finest = std::max(levels_[0].step.x, levels_[0].step.y);
  std::size_t now = std::min(units, kFewestUnits);
  std::fill_n(horizon.slopes_.begin(), horizon.stride_, kNothing);
  bool alive[4] = {true, true, true, true};
  std::int32_t r = 0;
  while (r + 1 < rows_) {
    const auto near = static_cast<double>(Horizon::distance(r, base_));
    const auto far = static_cast<double>(Horizon::distance(r + 1, base_));
    // Units about as wide as a cell: narrower ones would see the same cells. Halves inherit.
    while (now < units && 2 * far / static_cast<double>(now) > finest) {
      for (std::size_t f = 0; f < 4; ++f)
        for (std::size_t g = now; g-- > 0;)
          done[f * units + 2 * g] = done[f * units + 2 * g + 1] = done[f * units + g];
      now *= 2;
    }
    float* row = horizon.slopes_.data() + static_cast<std::size_t>(r) * horizon.stride_;
    std::copy_n(row, 4 * units, row + horizon.stride_);
    row += horizon.stride_;
    ++r;
    bool any = false;
    for (std::size_t f = 0; f < 4; ++f) {
      // Where it leaves the field, what was seen so far stays.
      alive[f] = alive[f] && draw_strip(faces[f], near, far, static_cast<double>(eye[1]), now,
                                        horizon, row + f * units, done.data() + f * units);
      any = any || alive[f];
    }
    std::copy_n(row, Horizon::kPad, row + 4 * units);
    if (!any) break;
  }
  horizon.rows_ = static_cast<std::uint32_t>(r + 1);
}

}  // namespace ivis
