#pragma once
// Terrain as an occluder: the drawn ground as heights over a grid, shrunk (docs/theory.md, section
// 10).

#include <cstdint>
#include <optional>
#include <vector>

#include "core/context.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

/// Drawn ground that need not fill a rectangle.
struct Terrain {
  /// Of each cell: the least height over it, where exactly one triangle lies over every point of it
  /// and no open edge, fold or crack touches it; HeightField::kNone elsewhere.
  HeightField field;
  std::vector<std::uint32_t>
      objects;  ///< that it is made of, as indices into sources(), ascending: no solids
};

/// Finds the largest edge-connected piece of opaque triangles without steep ones that spans half of
/// the scene both ways and has next to nothing under it. Nodes marked `never` are no part of it.
/// `cell_m`: cells are no larger than this where the triangles are larger, and at most 2048 a side.
/// Guarantee: over every point of a cell that is not kNone there is ground, at the cell's height or
///            above; over neighbouring cells that are not kNone it is one continuous surface.
/// Errors:    nullopt when there is none, or when it is flat (it would hide nothing), with a line
/// to
///            context.log. Modelling: viewpoints under the ground do not count.
/// Threads:   reentrant. Cost: O(t log t) in candidate triangles, O(cells that triangles touch).
std::optional<Terrain> find_terrain(const Scene& scene, double cell_m, const Context& context = {});

/// Grey-scale erosion by W, the hull of 0 and V - apex (V = `grown`): of each cell the least height
/// over all cells that the cell moved by V's shadow on the ground plane touches, less `drop_m`;
/// kNone where one of these is kNone or lies outside the grid.
/// Guarantee: every point under the result, moved by any w of W, lies under `field`: no w rises.
/// Departs:   a ball hangs below its apex, which would let a point on a slope keep more; its
/// tangent
///            cylinder is used for all kinds of reach.
/// Cost:      O(cells x rows of the footprint), by running minima along rows.
/// Source:    Wonka, Wimmer, Sillion 2001, section 5.3; grey-scale morphology.
HeightField erode(const HeightField& field, const Reach& grown, double drop_m);

/// Finds the scene's terrain and puts its shrunk height field into `set`, whose reach and slack say
/// by how much. Returns the objects it is made of; empty without terrain.
std::vector<std::uint32_t> add_height_field(const Scene& scene, OccluderSet& set,
                                            const Context& context = {});

}  // namespace ivis
