#pragma once
// Boolean operations on polygons of the ground plane, on a fixed integer grid.

#include <cmath>
#include <vector>

#include "occluders/occluder_set.h"

namespace ivis {

/// Step of the grid that every footprint lies on, metres; a power of two, so that the coordinates
/// of most files (float32 a few metres from the origin and farther) lie on it exactly and walls
/// that touch in the file touch here.
inline constexpr double kGridM = 1.0 / (1 << 20);
/// How far an edge may end up from where exact arithmetic puts it: input and intersections are
/// rounded to the grid. What must err to one side adds this.
inline constexpr double kGridSlackM = 3 * kGridM;
/// Farther from the origin a polygon is not taken.
inline constexpr double kMaxCoordinateM = 1e7;

using Ring = std::vector<Vec2>;
enum class Fill { kEvenOdd, kNonZero, kPositive };

inline Vec2 snap(const Vec2& p) {
  return {std::round(p.x / kGridM) * kGridM, std::round(p.y / kGridM) * kGridM};
}

/// The region the rings fill, as connected pieces, each one outer ring and its holes, oriented as
/// Polygon says. Errors: none; comes back empty when the library refuses. Threads: reentrant.
std::vector<Polygon> unite(const std::vector<Ring>& rings, Fill fill);

/// The region that `subject` fills, less the union of `convex` (each a convex ring of any winding).
/// The pieces come back as from unite().
std::vector<Polygon> subtract(const std::vector<Ring>& subject, Fill fill,
                              const std::vector<Ring>& convex);

/// The region that `subject` fills inside one convex ring. The pieces come back as from unite().
std::vector<Polygon> intersect(const std::vector<Ring>& subject, Fill fill, const Ring& convex);

/// Do the convex rings (of any winding) between them cover all of one ring? No when the library
/// refuses, and for a ring that has no area on the grid.
bool covered(const Ring& ring, const std::vector<Ring>& convex);

/// Convex hull, positive area; empty when the points lie on a line.
Ring convex_hull(std::vector<Vec2> points);

/// Rings of all polygons in one list.
std::vector<Ring> rings_of(const std::vector<Polygon>& polygons);
double area(const std::vector<Polygon>& polygons);

}  // namespace ivis
