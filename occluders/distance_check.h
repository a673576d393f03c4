#pragma once

#include "core/reach.h"
#include "occluders/occluder_set.h"

namespace ivis {

/// The gate of every eroder: is `eroded` inside {x : x + V_xz in original}, V_xz the reach's shadow
/// on the ground plane? Shares nothing with the eroders: distances between edges and parities only.
/// Units:     metres, (x, z).
/// Guarantee: true only when it is so. Says no when unsure: for a result that touches the true
///            erosion to within rounding (1e-14 of the coordinates; eroders stay 1e-6 m inside),
///            for numbers that are not finite. Any rings do, self-crossing ones too: both fill
///            even-odd, and an edge of `original` counts even where it bounds nothing.
/// Threads:   reentrant.
/// Cost:      O(n log n) in edges when few are near each other; a tree of boxes over the edges.
bool within_erosion(const Polygon& eroded, const Polygon& original, const Reach& reach);

}  // namespace ivis
