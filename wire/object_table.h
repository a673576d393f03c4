#pragma once
// The table rank -> (id, node, instance) <-> one zstd frame. SPEC.md, "Object table".

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/result.h"
#include "wire/messages.h"

namespace ivis::wire {

/// Bytes a row before compression.
inline constexpr std::size_t kTableRowBytes = 12;

/// Requires: columns of one length; `id` a permutation of 0..N-1.
std::vector<std::uint8_t> pack_table(const ObjectTable& table);

/// Errors: kInput if the frame does not hold exactly `objects` rows or the ids are no permutation.
/// Allocates only what `objects` asks for, and only after the frame's own size agrees with it.
Result<ObjectTable> unpack_table(std::span<const std::uint8_t> frame, std::uint32_t objects);

}  // namespace ivis::wire
