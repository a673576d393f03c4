#pragma once

#include <cstdint>

namespace ivis {

/// Dense, 0..N-1, over the objects of a scene: see docs/glossary.md, "object".
using ObjectId = std::uint32_t;
/// Position of an object in the spatial order that the wire uses.
using Rank = std::uint32_t;
/// Content hash of a scene; rides through every value, so that two ends with different scenes say so.
using SceneHash = std::uint64_t;

}  // namespace ivis
