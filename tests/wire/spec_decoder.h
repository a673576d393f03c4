#pragma once
// The PVS decoder as SPEC.md words it, with none of the library's code: what another author would
// write.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace ivis::test {

struct SpecAdaptiveBit {
  long P = 1L << 21;
  long n = 0;
};

struct SpecState {
  std::vector<bool> set, before;
  std::vector<SpecAdaptiveBit> superblock{98}, block{42}, rank{32};
  explicit SpecState(std::size_t objects) : set(objects), before(objects) {}
};

enum class SpecCheck { kMind, kIgnore };

/// Nothing if SPEC.md says to refuse it.
std::optional<SpecState> spec_decode(std::span<const std::byte> payload, const SpecState& base,
                                     SpecCheck check = SpecCheck::kMind);

}  // namespace ivis::test
