#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "visibility/box_tree.h"

namespace ivis {

/// Convex planar polygons of up to four corners, sixteen a batch, as the depth cube wants them.
struct alignas(64) FaceBatch {
  static constexpr std::uint32_t kWidth = 16;
  /// Corners, counter-clockwise seen from the front; metres relative to the set's origin. A
  /// triangle repeats its third; lanes that are not in use hold one point four times.
  float x[4][kWidth], y[4][kWidth], z[4][kWidth];
  float nx[kWidth], ny[kWidth],
      nz[kWidth];  ///< unit normal of the front; zero in lanes that are not in use
};

// A plane's distance c from the eye carries an absolute error of a few 2^-24 of the corners'
// distance, and so does the product of its normal with a direction: 1/w is wrong by less than
// kDepthGuard * distance / c of itself. Planes seen more edge-on than kEdgeOn are not drawn.
inline constexpr float kDepthGuard = 4e-6F;
inline constexpr float kEdgeOn = 4e-5F;
inline constexpr float kEdgeGuard = 6e-7F;   ///< of an edge's length times its corners' distance
inline constexpr float kPixelGuard = 0.01F;  ///< what a box is widened by, pixels
inline constexpr float kRelative = 2e-6F;    ///< what a box is brought nearer by

/// Six square maps of depth about an eye, the faces of a cube whose axes are the world's.
///
/// Face 2a + s looks along axis a (0 x, 1 y, 2 z), s = 0 up, 1 down the axis. Depth w of a point is
/// its distance along that axis; u and v = side / w in [-1, 1], of the axes z, y (faces x), x, z
/// (faces y) and x, y (faces z). Pixel (i, j) covers u in [-1 + 2i/n, -1 + 2(i+1)/n], v likewise by
/// j.
///
/// A pixel holds q = floor(K / w) in 16 bits, K = 65535 near_m: the largest of all faces drawn
/// there, at its centre. What is nearer than near_m counts as being there (errs towards visible); 0
/// is nothing. A box is hidden if in every pixel that it touches q is at least ceil(K / w) of its
/// nearest point, on every face that it touches.
///
/// Why that is right: a face of a solid shrunk by V' + B(m), met at depth w by a centre's ray,
/// hides what is deeper, seen through any place of that pixel from anywhere in the cell, if m >=
/// half a pixel's diagonal at w (docs/theory.md, 3). Whoever draws sees to m. Of a sheet the
/// farthest depth over the pixel is stored.
///
/// Rounding: positions relative to the eye are off by 2^-23 of themselves, edges by less than 1e-6
/// of a radian more: below 1e-3 of a pixel at 1024 pixels, which the margin's factor 1.01 pays for.
/// Depth loses kDepthGuard and a share for faces seen edge-on; boxes are widened by kPixelGuard.
/// Threads: one writer; readers at any time nobody writes.
class DepthCube {
 public:
  static constexpr std::uint32_t kBlock = 16;  ///< pixels a side of a block

  /// `pixels` a side of a face: a multiple of 16, 64..4096.
  DepthCube(std::uint32_t pixels, float near_m);

  void clear();  ///< cost: what was touched
  std::uint32_t pixels() const { return pixels_; }
  float near_m() const { return near_m_; }

  /// Pixels i0..i1, j0..j1 of a face; none if i1 < i0.
  struct Window {
    std::int32_t i0, i1, j0, j1;
  };
  /// Only boxes within lo..hi (relative to the eye) will be tested: what no such box can cover,
  /// because what is nearer than near_m counts as visible anyway, is not drawn from now on. Returns
  /// the sides (a bit each) that are of any use.
  std::uint32_t look_at(const glm::vec3& lo, const glm::vec3& hi);

  // For the kernels. Depth is held as q - 32768; a block that is not touched holds nothing valid.
  const Window& window(std::uint32_t side) const { return windows_[side]; }
  std::uint32_t blocks_a_row() const { return pixels_ / kBlock; }
  std::uint32_t blocks_a_face() const { return blocks_a_row() * blocks_a_row(); }
  /// 256 values of block b (face * blocks_a_face + row * blocks_a_row + column), row by row.
  std::int16_t* block(std::uint32_t b) { return depth_[b].q; }
  const std::int16_t* block(std::uint32_t b) const { return depth_[b].q; }
  /// Least value of each of its sixteen columns.
  std::int16_t* columns(std::uint32_t b) { return columns_[b].q; }
  const std::int16_t* columns(std::uint32_t b) const { return columns_[b].q; }
  bool is_touched(std::uint32_t b) const { return is_touched_[b] != 0; }
  /// Whether this is the first time since clear().
  bool touch(std::uint32_t b) {
    if (is_touched_[b] != 0) return false;
    is_touched_[b] = 1;
    touched_.push_back(b);
    return true;
  }

 private:
  struct alignas(64) Block {
    std::int16_t q[kBlock * kBlock];
  };
  struct alignas(32) Columns {
    std::int16_t q[kBlock];
  };
  std::uint32_t pixels_;
  float near_m_;
  Window windows_[6];
  std::vector<Block> depth_;
  std::vector<Columns> columns_;
  std::vector<std::uint8_t> is_touched_;
  std::vector<std::uint32_t> touched_;
};

/// What a solve did, for reports and tests.
struct DepthStats {
  std::uint32_t pieces_tested = 0;
  std::uint32_t pieces_drawn = 0;
  std::uint32_t faces_drawn = 0;
  std::uint32_t blocks_drawn = 0;
  std::uint32_t nodes_tested = 0;
};

/// Draws the front faces that look at the eye into the cube's faces named by the bits of `sides`.
/// `sheet`: store the farthest depth over each pixel.
void draw_faces(std::span<const FaceBatch> batches, const float eye[3], std::uint32_t sides,
                bool sheet, DepthCube& cube, DepthStats& stats);

/// Which children of a node are not hidden, and on which sides of the cube they show: sides[c] has
/// bit f set where child c shows on face f (0: hidden). Boxes that reach nearer than near_m show.
/// Only the children in `wanted` (a bit each) are looked at.
void find_sides(const BoxTree::Node& node, const float eye[3], const DepthCube& cube,
                std::uint32_t wanted, std::uint8_t sides[BoxTree::kWidth]);

/// Appends to `visible` the items of the tree below `root` that the cube does not hide; any order.
void find_visible(const BoxTree& tree, std::uint32_t root, const float eye[3],
                  const DepthCube& cube, std::vector<std::uint32_t>& visible, DepthStats& stats);

/// One step of find_visible(): appends the visible items of node `root` to `visible`, its visible
/// children to `nodes`.
void find_visible_children(const BoxTree& tree, std::uint32_t root, const float eye[3],
                           const DepthCube& cube, std::vector<std::uint32_t>& visible,
                           std::vector<std::uint32_t>& nodes, DepthStats& stats);

/// SIMD targets that this machine can run, best first, by the library's names.
std::vector<const char*> depth_targets();
/// Makes the whole process use one of them, for tests and benchmarks; an empty name: the best
/// again. False if it is not there. Threads: not while anything solves.
bool use_depth_target(const std::string& name);

}  // namespace ivis
