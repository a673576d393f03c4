#pragma once
// Occluders without volume: parts of planes in which nothing but opaque matter lies.
//
// What the occlusion map has to know. A cell P + V; r_V = largest_move(reach, slack). Of a sheet
// {normal n, offset o} let a = n.P - o; of the face, or tile, to be drawn let D be the largest
// distance of its corners from P, and e the largest displacement, parallel to the image plane, of a
// point of a pixel from the pixel's centre at the depth of any of it (docs/theory.md, 3). Level k
// may be drawn when
//     a > r_V,   a > e,   and   sheet_radii_m[k] * (a - e) >= (r_V + e) * D,
// and then hides, in every pixel whose centre's ray meets a face of it, all that lies strictly on
// the other side (n.Y < o) on any ray through that pixel, from every viewpoint of the cell.
//
// Why. Let Xc be where the centre's ray meets the face, Y behind the plane on another ray of the
// pixel, X0 the point where PY crosses the plane. PY passes Xc within e, and meets the plane at an
// angle with cos = a / |X0 - P|, so |X0 - Xc| <= e |X0 - P| / a; with |X0 - P| <= D + |X0 - Xc|
// this gives |X0 - Xc| <= e D / (a - e) and |X0 - P| / a <= D / (a - e). The segment from P + v to
// Y crosses the plane (a > r_V: the whole cell is before it) at X0 + s pi(v), 0 < s < 1, where pi
// projects along PY (docs/theory.md, 9), and |pi(v)| <= |v| |X0 - P| / a. So it crosses within
// (r_V + e) D / (a - e) of Xc, which the sheet's radius covers: there is matter. |x - P| is convex:
// over a convex face it is greatest at a corner.

#include <map>
#include <string>
#include <vector>

#include "core/context.h"
#include "occluders/convex.h"
#include "occluders/occluder_set.h"

namespace ivis {

/// The ladder of radii for sheets, ascending: r_V times 1.05 and further powers of 1.4, up to 16:
/// walls are used until they are seen under 4 degrees. Steps of 1.3 list 1 % fewer objects in the
/// game maps, for a third more faces.
std::vector<double> sheet_radii(double r_v_m);

struct SheetOptions {
  std::vector<double> radii_m;  ///< ascending, as OccluderSet::sheet_radii_m
  double tile_m = 8;            ///< tiles without an edge of matter near
  double least_tile_m = 4;      ///< tiles with one
  double least_area_m2 = 0.05;  ///< smaller shrunk parts are left out
};

struct SheetReport {
  std::size_t planes = 0;
  std::size_t tiles = 0;
  std::size_t faces = 0;                        ///< of all levels
  std::map<std::string, std::size_t> left_out;  ///< reason -> levels of connected parts
};

/// Sheets in the planes of the solids' faces, a millimetre below the surface. In each plane the
/// sections of all solids are united, so walls of several pieces are one sheet, which goes on into
/// whatever they meet; that is shrunk by discs, cut into tiles near the faces that show, and parted
/// into convex faces. Sheets face outwards as the faces do; those that have an edge near are listed
/// again facing inwards, which stops what slips past the edges of other faces of the same wall.
/// Shapes:    one Sheet a tile and side, levels as options.radii_m, ended early where nothing is
/// left. Guarantee: the disc of radius radii_m[k] round a point of a face of level k, in the plane,
/// lies in
///            the union of the solids, each solid marked `only` counting as four float32 steps of
///            its coordinates larger, but no more than 0.1 mm (corners in files are rounded, so
///            faces of neighbours come apart). Checked for the finished faces by within_erosion().
/// Errors:    none; what fails is left out and counted. Empty when cancelled.
/// Threads:   uses context.threads; the result does not depend on their number.
/// Source:    docs/theory.md, section 9.
std::vector<Sheet> build_sheets(const std::vector<ConvexPiece>& solids, const SheetOptions& options,
                                const Context& context, SheetReport& report);

}  // namespace ivis
