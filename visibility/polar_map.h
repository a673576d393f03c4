#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "visibility/box_tree.h"
#include "visibility/horizon.h"

namespace ivis {

/// The walls of shrunk prisms, as the polar map wants them: single precision relative to the tree's
/// origin, rings with the interior on the left (positive shoelace area in (x, z) of outer rings).
struct WallSet {
  struct Ring {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  struct Solid {
    std::uint32_t first_ring = 0;
    std::uint32_t rings = 0;
    float top = 0;
    float bottom = 0;
    bool floored = false;   ///< reaches down without end for cells above the scene's floor
    bool grounded = false;  ///< likewise for cells over the ground
  };
  std::vector<float> x, z;  ///< ring corners; 16 floats of padding behind the last
  std::vector<Ring> rings;
  std::vector<Solid> solids;
  BoxTree tree;  ///< of the solids; items are indices into `solids`
};

/// Sampled polar occlusion about an eye: what blocks each azimuth, how high and from how far on.
///
/// Azimuth: the ground plane is cut into four faces of a square about the eye, in each of which
/// u = side / depth in [-1, 1]; t = face * 2 + u + 1 runs from 0 to 8 once around, from +X towards
/// +Z. Distance of a point is w = max(|x|, |z|) from the eye; slope is y / w. Along a wall 1/w is
/// linear in u.
///
/// A bin holds up to kLayers statements (S, W, B): every azimuth of the bin crosses a wall of a
/// shrunk solid at 1/w >= W, which there spans at least the slopes B..S. So a point of slope in [B,
/// S] and 1/w <= W is behind the wall: the segment from the eye meets the shrunk solid no farther
/// than the point. Any statement may be dropped; statements are sorted by falling S.
///
/// Terrain speaks beside the bins, by a Horizon: of each azimuth and distance, a slope below which
/// all is hidden. A statement of a bin and the horizon block their union: a wall's low end may lie
/// under the horizon.
///
/// Source:  Wonka, Wimmer, Sillion 2001, section 5.1 (cull map). Departs: polar instead of
///          orthographic, several layers a bin, real undersides.
/// Threads: one writer; readers only after finish().
class PolarMap {
 public:
  static constexpr std::uint32_t kLayers = 2;
  static constexpr std::uint32_t kBlock = 16;  ///< bins that share coarse minima
  static constexpr std::uint32_t kPad =
      64;  ///< bins repeated behind the last, so that short runs do not wrap

  /// bins_a_face: power of two, 64..8192.
  explicit PolarMap(std::uint32_t bins_a_face);

  /// Forgets everything: hides nothing.
  void clear();
  /// After the last wall: fills the coarse minima that readers use.
  void finish(bool undersides);
  /// Repeats the first bins behind the last; the writer calls it when it has changed them.
  void repeat_pad();

  std::uint32_t bins() const { return bins_; }
  std::uint32_t bins_a_face() const { return bins_ / 4; }
  std::uint32_t stride() const { return stride_; }
  float* slope(std::uint32_t layer) { return data_[0].v + layer * std::size_t{3} * stride_; }
  float* near_inverse(std::uint32_t layer) { return slope(layer) + stride_; }
  float* low(std::uint32_t layer) { return slope(layer) + 2 * std::size_t{stride_}; }
  const float* slope(std::uint32_t layer) const {
    return data_[0].v + layer * std::size_t{3} * stride_;
  }
  const float* near_inverse(std::uint32_t layer) const { return slope(layer) + stride_; }
  const float* low(std::uint32_t layer) const { return slope(layer) + 2 * std::size_t{stride_}; }
  /// Terrain for the solve at hand; null for none. Borrowed; set it before anything is drawn or
  /// asked.
  void set_horizon(const Horizon* horizon) { horizon_ = horizon; }
  const Horizon* horizon() const { return horizon_; }
  float* coarse() { return coarse_[0].v; }
  const float* coarse() const { return coarse_[0].v; }
  std::uint32_t coarse_stride() const { return coarse_stride_; }

 private:
  std::uint32_t bins_;
  std::uint32_t stride_;         ///< floats a plane: bins + pad, a multiple of 16 off powers of two
  std::uint32_t coarse_stride_;  ///< floats a coarse plane
  const Horizon* horizon_ = nullptr;
  struct alignas(64) Line {
    float v[16];
  };
  std::vector<Line> data_;    ///< kLayers x (S, W, B) planes, each at a cache line
  std::vector<Line> coarse_;  ///< likewise over blocks of kBlock bins
};

/// Which solids reach down without end for the cell at hand (occluders/occluder_set.h,
/// extends_down).
struct Floors {
  bool above_floor = false;
  bool on_ground = false;
  bool undersides = true;  ///< some solid has a real bottom for this cell
};

/// What a solve did, for reports and tests.
struct PolarStats {
  std::uint32_t solids_tested = 0;
  std::uint32_t solids_drawn = 0;
  std::uint32_t walls_drawn = 0;
  std::uint64_t bins_written = 0;
  std::uint32_t nodes_searched = 0;  ///< of solids, while drawing
  std::uint32_t nodes_tested = 0;
  std::uint32_t untested = 0;  ///< items listed untested, as the limit was met
  bool cut = false;            ///< something was left undrawn or untested
  std::uint64_t draw_work() const {
    return walls_drawn + bins_written / PolarMap::kBlock + std::uint64_t{2} * nodes_searched;
  }
};

/// Guards of the map that tests take out one by one to prove that the verifier has power. All on in
/// use.
struct PolarGuards {
  bool cover_whole_bins = true;  ///< write only bins that walls cover fully
  bool least_over_bin = true;    ///< take the least slope and the farthest point over a bin
  bool test_distance = true;     ///< hide only what is farther than the wall
  bool respect_undersides = true;
  bool far_end_below_eye =
      true;  ///< of tops lower than the eye, take the slope that holds over the bin
};

/// What of a WallSet is drawn; less is always safe.
struct DrawLimits {
  std::span<const std::uint32_t> only{};   ///< if not empty, just these solids, in this order
  std::span<const std::uint8_t> wanted{};  ///< if not empty, a solid with 0 is passed over
  /// Nothing is begun once PolarStats::draw_work() has reached it.
  std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
};

/// Draws the walls that can be seen past those already drawn, near ones first. `eye` is relative to
/// the tree's origin and is the apex of the cell.
void draw_walls(const WallSet& walls, const float eye[3], const Floors& floors,
                const DrawLimits& limits, const PolarGuards& guards, PolarMap& map,
                PolarStats& stats);

/// Appends to `visible` the items of the tree below `root` that the map does not hide; any order.
/// `most`: what is left once so many nodes have been tested is appended untested; the nodes are
/// then tested level by level, so that what is left is small.
void find_visible(const BoxTree& tree, std::uint32_t root, const float eye[3], bool undersides,
                  const PolarMap& map, std::uint64_t most, std::vector<std::uint32_t>& visible,
                  PolarStats& stats);

/// One step of find_visible(): appends the visible items of node `root` to `visible`, its visible
/// children to `nodes`.
void find_visible_children(const BoxTree& tree, std::uint32_t root, const float eye[3],
                           bool undersides, const PolarMap& map,
                           std::vector<std::uint32_t>& visible, std::vector<std::uint32_t>& nodes,
                           PolarStats& stats);

/// Name of the SIMD target in use, for reports.
const char* simd_target();

}  // namespace ivis
