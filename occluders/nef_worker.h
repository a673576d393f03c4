#pragma once
// Small closed solids that are neither prisms nor convex -> shrunk, by a process of their own.

#include <filesystem>
#include <span>
#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/polyhedron.h"

namespace ivis {

struct ShrunkPolyhedron {
  /// The whole solid as convex parts that fill it: to know whether an eye is inside.
  std::vector<ConvexSolid> parts;
  /// The solid less the box of half-extents half + margin, one a margin; ends early where nothing
  /// is left, time is up, or a level fails the check.
  std::vector<FaceMesh> levels;
  bool failed_check = false;  ///< that was why
};

/// `ivis_nef` in the folder of the program that runs; empty if there is none.
std::filesystem::path nef_worker_beside_this();

/// Runs `worker` (occluders/exact/nef_main.cpp) on one solid: Minkowski sums of Nef polyhedra,
/// which take milliseconds or minutes, and abort on some real solids. So they have a process of
/// their own, with limits on time, memory and output, and what goes wrong there costs one occluder.
/// Units:     `half`: half-extents of a box that holds the reach, metres; the sum is with the box.
/// Guarantee: each level lies inside the erosion by the reach (within_box_erosion).
/// Errors:    kIo when there is no such program to run; kUnsupported when it fails, or takes longer
/// than
///            `seconds` for the first level, with its words; kCancelled when stopped.
/// Threads:   reentrant.
/// Source:    in place of the tetrahedra of Wonka, Wimmer, Sillion 2001, section 5.3: the solid
/// less
///            the Minkowski sum of its bounded complement with the reach (docs/erosion.md).
Result<ShrunkPolyhedron> shrink_polyhedron(const std::filesystem::path& worker,
                                           const Polyhedron& solid, const Vec3& half,
                                           std::span<const double> margins_m, double seconds,
                                           const Context& context = {});

}  // namespace ivis
