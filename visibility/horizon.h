#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "occluders/occluder_set.h"

namespace ivis {

/// What terrain hides about an eye: for each azimuth, the slope below which everything beyond a
/// distance is hidden. Azimuth, distance w and slope are those of PolarMap.
///
/// Row r, unit g hold S: every azimuth of the unit crosses, at a distance of at most distance(r), a
/// point under the shrunk height field of slope S or more, and from the eye's foot to there never
/// leaves the cells where the shrunk field is known. Rows rise with r. So a point of slope <= S no
/// nearer than distance(r) is hidden from the whole cell (docs/theory.md, section 10).
/// Threads: one writer; readers after it.
class Horizon {
 public:
  static constexpr std::uint32_t kMostUnitsAFace = 128;
  static constexpr int kMantissaBits = 5;    ///< of a row's distance: 32 rows an octave
  static constexpr std::uint32_t kPad = 80;  ///< units repeated behind the last
  static constexpr int kShift = 23 - kMantissaBits;

  /// Some row may hide something.
  bool empty() const { return rows_ <= 1; }
  std::uint32_t stride() const { return stride_; }
  const float* slopes() const { return slopes_.data(); }
  /// Log2 of the bins of the polar map that share a unit.
  int unit_shift() const { return unit_shift_; }
  /// Index of the last row whose distance is at most `w`, w > 0: row 0 hides nothing.
  std::int32_t first_row() const { return base_; }
  std::int32_t last_row() const { return static_cast<std::int32_t>(rows_) - 1; }
  std::int32_t row_at(float w) const {
    const std::int32_t r = (std::bit_cast<std::int32_t>(w) >> kShift) - base_;
    return r < 0 ? 0 : r > last_row() ? last_row() : r;
  }
  const float* row(std::int32_t r) const {
    return slopes_.data() + static_cast<std::size_t>(r) * stride_;
  }
  static float distance(std::int32_t row, std::int32_t base) {
    return std::bit_cast<float>((row + base) << kShift);
  }

 private:
  friend class TerrainMap;
  std::vector<float> slopes_;
  std::uint32_t rows_ = 0;
  std::uint32_t stride_ = 0;
  std::int32_t base_ = 0;
  int unit_shift_ = 0;
  // Of the face being drawn.
  std::vector<float> line_;
  std::vector<std::uint8_t> done_;  ///< of each unit: its run has ended
};

/// The shrunk height field with its minima over squares of 2, 4, ... cells, relative to an origin.
/// Plain scalar code, compiled once: the same bits from every machine.
/// Threads: const members are reentrant. Cost: 2.7 floats a cell.
class TerrainMap {
 public:
  TerrainMap(const HeightField& field, const Vec3& origin, std::uint32_t bins_a_face);
  /// What the field hides from the cell whose apex is `eye` (relative to the origin); an empty
  /// horizon unless all the field close about the eye is known.
  void draw(const float eye[3], Horizon& horizon) const;

 private:
  struct Level {
    std::size_t first;  ///< in least_ and in turned_
    std::int32_t columns, rows;
    Vec2 step;
  };
  struct Face;
  bool known_about(const Vec2& eye, double half_m) const;
  /// Raises the slopes of one face's units by one strip; false when no run goes on.
  bool draw_strip(const Face& face, double near, double far, double height, std::size_t units,
                  Horizon& horizon, float* row, std::uint8_t* done) const;

  Vec2 lo_{0};
  std::vector<Level> levels_;
  std::vector<float> least_;   ///< by rows
  std::vector<float> turned_;  ///< the same by columns
  std::uint32_t units_a_face_;
  int unit_shift_;
  std::int32_t base_ = 0;
  std::int32_t rows_ = 0;
};

}  // namespace ivis
