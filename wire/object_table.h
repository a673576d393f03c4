#pragma once
// The table rank -> (id, node, instance, cluster) <-> one zstd frame. SPEC.md, "Object table".

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/result.h"
#include "wire/messages.h"

namespace ivis::wire {

/// Requires: columns of one length, `cluster` that or empty; `id` a permutation of 0..N-1.
std::vector<std::uint8_t> pack_table(const ObjectTable& table);

/// Errors: kInput if the frame does not hold exactly `objects` rows of three columns, or of four
/// (at most kMaxClusters), or the ids are no permutation.
/// Allocates only what `objects` (at most kMaxObjects) asks for, once the frame's own size agrees
/// with it.
Result<ObjectTable> unpack_table(std::span<const std::uint8_t> frame, std::uint32_t objects);

}  // namespace ivis::wire
