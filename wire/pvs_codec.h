#pragma once
// PVS <-> bytes. No sockets, no ids: objects are named by rank (scenes/scene.h, rank_order).

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/ids.h"
#include "core/result.h"
#include "wire/range_coder.h"

namespace ivis::wire {

/// A set of ranks 0..size-1, one bit each; bits past `size` are zero.
struct RankSet {
  std::uint32_t size = 0;
  std::vector<std::uint64_t> words;

  explicit RankSet(std::uint32_t n = 0) : size(n), words((std::size_t{n} + 63) / 64) {}
  bool test(Rank r) const { return ((words[r >> 6U] >> (r & 63U)) & 1U) != 0; }
  void set(Rank r) { words[r >> 6U] |= std::uint64_t{1} << (r & 63U); }
  std::size_t count() const;
  bool operator==(const RankSet&) const = default;
};

/// The adaptive probabilities, SPEC.md "Contexts": of a superblock, a block, and a rank having
/// changed.
struct PvsModel {
  std::array<AdaptiveBit, 98> superblock;
  std::array<AdaptiveBit, 42> block;
  std::array<AdaptiveBit, 32> rank;
  bool operator==(const PvsModel&) const = default;
};

/// What both ends remember of one PVS to code the next against it: the set, the one it was coded
/// against (what changed just now is what changes next), and the probabilities as they stood after
/// it. A default-made base of the right size stands for "nothing known": the coded set is then a
/// full one. Cost: a copy is 2 bits an object and 700 bytes.
struct PvsState {
  RankSet set;
  RankSet before;
  PvsModel model;

  explicit PvsState(std::uint32_t objects = 0);
  bool operator==(const PvsState&) const = default;
};

/// Codes `set` as its difference to `base` and moves the model on: `after` is what the decoder will
/// hold, and may be `base` itself. Requires set.size == base.set.size.
/// Cost:    a few bits a change; O(words of the set + 32 a changed block),
/// bench/pvs_codec_bench.cpp Threads: reentrant.
std::vector<std::byte> encode_pvs(const RankSet& set, const PvsState& base, PvsState& after);

/// Errors: kInput for bytes that encode_pvs does not write against this base: truncated, trailing,
///         damaged, or of another base. What looks right by chance passes a 16-bit check of the set
///         once in 65,536 times, and is then some set of the right size.
/// Bounds: never reads outside `bytes`; time and memory are O(base.set.size).
Result<PvsState> decode_pvs(std::span<const std::byte> bytes, const PvsState& base);

}  // namespace ivis::wire
