#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/reach.h"
#include "occluders/occluder_set.h"
#include "occluders/voxel_grid.h"

namespace ivis {

/// The voxels that voxel 0, moved by every vector of V + B(margin), comes to overlap: what must be
/// solid for voxel 0 to lie in the erosion. Runs along x, symmetric about 0.
/// Guarantee: never too few. V and the ball are symmetric about the three planes of the axes and
///            convex, so a box meets their sum when its corner nearest to 0 lies in it; that corner
///            is taken out only if some direction shows it apart by the sum's support function.
struct StructuringElement {
  struct Run {
    std::int32_t dy = 0, dz = 0;
    std::int32_t half = 0;  ///< voxels -half..half along x
  };
  std::vector<Run> runs;  ///< ascending half
  IVec3 radius;           ///< largest |dx|, |dy|, |dz|
};
StructuringElement structuring_element(const Reach& reach, double margin_m, double cell_m);
/// Of the same, without the runs; cheap however wide it is. Metres over cells may exceed an int's
/// range: it is held at 2^30.
IVec3 structuring_radius(const Reach& reach, double margin_m, double cell_m);

/// A cube of 64^3 voxels: word y + 64 z holds x = 0..63.
using BitCube = std::vector<std::uint64_t>;

/// Voxels in and about a cube, `pad` more on each side of y and z; along x one word on either side
/// of the middle one for each 64 of pad.x.
class BitWindow {
 public:
  static constexpr std::int32_t kCube = 64;
  explicit BitWindow(const IVec3& pad)
      : pad_(pad),
        words_(1 + 2 * ((pad.x + 63) / 64)),
        rows_y_(kCube + 2 * pad.y),
        bits_(static_cast<std::size_t>(words_) * static_cast<std::size_t>(rows_y_) *
                  static_cast<std::size_t>(kCube + 2 * pad.z),
              0) {}
  /// Row (y, z) relative to the cube; word 0 holds x = -64 * (words() / 2) on.
  std::uint64_t* row(std::int32_t y, std::int32_t z) {
    return &bits_[static_cast<std::size_t>(words_) *
                  (static_cast<std::size_t>(y + pad_.y) +
                   static_cast<std::size_t>(rows_y_) * static_cast<std::size_t>(z + pad_.z))];
  }
  const std::uint64_t* row(std::int32_t y, std::int32_t z) const {
    return const_cast<BitWindow*>(this)->row(y, z);
  }
  std::int32_t words() const { return words_; }
  const IVec3& pad() const { return pad_; }
  void clear() { std::fill(bits_.begin(), bits_.end(), 0); }

 private:
  IVec3 pad_;
  std::int32_t words_;
  std::int32_t rows_y_;
  std::vector<std::uint64_t> bits_;
};

/// Voxels of the cube of which all that `element` says is set in the window. Only bits of `within`
/// are looked at. The element's radius must fit the window's pad.
/// Cost: a word operation for each row of the cube and run, less where nothing is left.
BitCube erode_cube(const BitWindow& window, const StructuringElement& element,
                   const BitCube& within);

/// Boxes of whole voxels, [lo, hi), that together are the set bits, without overlap: from the first
/// bit on as long as it goes along x, then y, then z.
struct VoxelBox {
  IVec3 lo, hi;
};
std::vector<VoxelBox> greedy_boxes(BitCube bits);

/// The boundary of the set bits as rectangles, counter-clockwise from outside, in the cube's
/// voxels: exposed sides merged greedily within their plane. A closed surface with T-junctions;
/// bits that touch across the border of the cube are cut there by faces on both sides.
FaceMesh boundary_rectangles(const BitCube& bits);
/// Six faces a box; those between boxes that touch are kept.
FaceMesh box_faces(const std::vector<VoxelBox>& boxes);

}  // namespace ivis
