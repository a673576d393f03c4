#pragma once

#include <cstdint>
#include <string>

namespace ivis {

/// Dense, 0..N-1, over the objects of a scene: see docs/glossary.md, "object".
using ObjectId = std::uint32_t;
/// Position of an object in the spatial order that the wire uses.
using Rank = std::uint32_t;
/// Content hash of a scene; rides through every value, so that two ends with different scenes say
/// so.
using SceneHash = std::uint64_t;

/// As hashes are shown to people: sixteen digits, lower case.
inline std::string to_hex(SceneHash hash) {
  std::string text(16, '0');
  for (auto digit = text.rbegin(); digit != text.rend(); ++digit, hash >>= 4U)
    *digit = "0123456789abcdef"[hash & 15U];
  return text;
}

}  // namespace ivis
