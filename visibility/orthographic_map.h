#pragma once

#include <cstdint>
#include <vector>

#include "core/aabb.h"
#include "core/result.h"
#include "visibility/polar_map.h"

namespace ivis {

/// The walls of one solid that throw its shadow, joined at corners whose azimuth rises by less than
/// half a turn; relative to the eye.
struct ShadowChain {
  std::vector<Vec2> corners;  ///< a wall between each and the next
  std::vector<Vec2> plane;    ///< of wall j: dot(plane, p) = 1 on its line, > 1 behind it
  double top = 0;             ///< relative to the eye
};

/// The cull map sampled orthographically from above, as in the paper: a grid over the ground plane
/// that holds, for each square, a height below which everything over the whole square is hidden.
/// Guarantee: conservative: only squares that lie wholly in a shadow are written, with the shadow's
/// least
///            height over the square.
/// Threads:   the geometry is read-only; each solve has a Heights of its own.
/// Cost:      O(squares in the shadows of the solids drawn). Slower than the polar map; kept to
/// compare. Source:    Wonka, Wimmer, Sillion 2001, section 5.1; Wonka and Schmalstieg 1999.
/// Departs:   analytic heights on the CPU instead of a depth buffer; solids with a real underside
/// throw no
///            shadow here, as one height a square cannot tell what passes below.
class OrthographicMap {
 public:
  struct Heights {
    std::vector<float> least;  ///< all levels, finest first; relative to the eye's height
  };
  /// The finest level: squares by rows from the corner of least x and z.
  struct Grid {
    Vec2 lo{0};  ///< relative to the origin
    double square_m = 1;
    std::int32_t columns = 0, rows = 0;
  };

  /// `bounds` relative to the tree's origin. Squares of `square_m`, at most 1024 a side.
  OrthographicMap(const Aabb& bounds, double square_m);

  Grid grid() const;
  void clear(Heights& heights) const;
  /// Appends the chains of a solid. `eye` (the apex) is relative to the same origin.
  static void add_chains(const WallSet& walls, const WallSet::Solid& solid, const Vec3& eye,
                         std::vector<ShadowChain>& chains);
  void draw(const std::vector<ShadowChain>& chains, const Vec3& eye, Heights& heights) const;
  /// After the last solid: fills the coarser levels.
  void finish(Heights& heights) const;
  /// Is a box that spans lo..hi in plan (relative to the origin) and tops at `top` (relative to the
  /// eye) hidden? `finished`: the coarser levels are up to date.
  bool hides(const Heights& heights, const Vec2& lo, const Vec2& hi, float top,
             bool finished) const;

 private:
  void draw_chain(const ShadowChain& chain, const Vec2& eye, Heights& heights) const;
  bool hides_in(const Heights& heights, std::size_t level, std::int32_t c0, std::int32_t c1,
                std::int32_t r0, std::int32_t r1, float top) const;

  struct Level {
    std::size_t first;
    std::int32_t columns, rows;
  };
  Vec2 lo_{0};
  double square_m_ = 1;
  std::vector<Level> levels_;
  std::size_t total_ = 0;
};

/// Draws the shadows of an OrthographicMap elsewhere: visibility/gl/gl_shadow_map.h.
class ShadowDrawer {
 public:
  virtual ~ShadowDrawer() = default;
  /// Writes the finest level of `heights`, cleared before, as OrthographicMap::draw() does.
  /// Threads: reentrant. Errors: kUnsupported: it has stopped working; the heights are worthless.
  virtual Status draw(const std::vector<ShadowChain>& chains, const Vec3& eye,
                      OrthographicMap::Heights& heights) const = 0;
};

}  // namespace ivis
