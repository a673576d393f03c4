#include "wire/pvs_codec.h"

#include <bit>
#include <string>

#include "core/assert.h"

namespace ivis::wire {

std::size_t RankSet::count() const {
  std::size_t n = 0;
  for (const std::uint64_t w : words)
    n += static_cast<std::size_t>(std::popcount(w));
  return n;
}

PvsState::PvsState(std::uint32_t objects) : set(objects) {}

std::vector<std::byte> encode_pvs(const RankSet& set, const PvsState& base, PvsState& after) {
  IVIS_ASSERT(set.size == base.set.size, "set and base are of one scene");
  std::vector<std::byte> out;
  std::uint64_t next = 0;
  for (std::size_t w = 0; w < set.words.size(); ++w)
    for (std::uint64_t d = set.words[w] ^ base.set.words[w]; d != 0; d &= d - 1) {
      const std::uint64_t r = 64 * w + static_cast<unsigned>(std::countr_zero(d));
      std::uint64_t gap = r - next;
      for (; gap >= 128; gap >>= 7U)
        out.push_back(static_cast<std::byte>((gap & 127U) | 128U));
      out.push_back(static_cast<std::byte>(gap));
      next = r + 1;
    }
  PvsState result = base;
  result.set = set;
  after = std::move(result);
  return out;
}

Result<PvsState> decode_pvs(std::span<const std::byte> bytes, const PvsState& base) {
  PvsState state = base;
  std::uint64_t next = 0, gap = 0;
  unsigned shift = 0;
  for (const std::byte b : bytes) {
    gap |= (std::to_integer<std::uint64_t>(b) & 127U) << shift;
    shift += 7;
    if (shift > 35) return input_error("pvs: a gap is longer than five bytes");
    if (std::to_integer<unsigned>(b) >= 128) continue;
    next += gap;
    if (next >= state.set.size)
      return input_error("pvs: rank " + std::to_string(next) + " of " +
                         std::to_string(state.set.size));
    state.set.words[next / 64] ^= std::uint64_t{1} << (next % 64);
    ++next;
    gap = 0;
    shift = 0;
  }
  if (shift != 0) return input_error("pvs: ends within a gap");
  return state;
}

}  // namespace ivis::wire
