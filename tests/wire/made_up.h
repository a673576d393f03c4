#pragma once
// Sets that behave like a walk down a street, from numbers that are the same everywhere.

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "wire/pvs_codec.h"

namespace ivis::test {

/// SplitMix64.
class Numbers {
 public:
  explicit Numbers(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15U);
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31U);
  }
  /// 0..n-1.
  std::uint32_t below(std::uint32_t n) {
    return static_cast<std::uint32_t>((next() >> 32U) * n >> 32U);
  }
  bool one_in(std::uint32_t n) { return below(n) == 0; }

 private:
  std::uint64_t state_;
};

inline wire::RankSet random_set(std::uint32_t size, std::uint32_t one_in, Numbers& numbers) {
  wire::RankSet set(size);
  for (Rank r = 0; r < size; ++r)
    if (numbers.one_in(one_in)) set.set(r);
  return set;
}

inline wire::RankSet full_set(std::uint32_t size) {
  wire::RankSet set(size);
  for (Rank r = 0; r < size; ++r)
    set.set(r);
  return set;
}

/// Runs of neighbours that come, stay a while and go: about `runs` at a time.
class Walk {
 public:
  Walk(std::uint32_t size, std::uint32_t runs, std::uint64_t seed) : size_(size), numbers_(seed) {
    for (std::uint32_t i = 0; i < runs; ++i)
      runs_.push_back(run());
  }
  wire::RankSet step() {
    wire::RankSet set(size_);
    for (auto& [first, length] : runs_) {
      if (numbers_.one_in(8)) std::tie(first, length) = run();
      if (numbers_.one_in(4)) length += numbers_.below(4);
      for (Rank r = first; r < std::min(size_, first + length); ++r)
        if (r % 7 != first % 5) set.set(r);
    }
    return set;
  }

 private:
  std::pair<Rank, std::uint32_t> run() { return {numbers_.below(size_), 1 + numbers_.below(24)}; }
  std::uint32_t size_;
  Numbers numbers_;
  std::vector<std::pair<Rank, std::uint32_t>> runs_;
};

}  // namespace ivis::test
