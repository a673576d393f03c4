#pragma once

#include <cstddef>
#include <cstdint>

namespace ivis {

/// A small generator of numbers that are the same on every machine, unlike those of std::
/// distributions. Source: Steele, Lea, Flood, Fast splittable pseudorandom number generators, 2014
/// (SplitMix64).
class Random {
 public:
  /// A stream of its own for each (seed, stream): adding a draw in one block leaves the others
  /// alone.
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0)
      : state_(mix(seed + 0x632be59bd9b4e019ULL) ^ mix(stream * 0x9e3779b97f4a7c15ULL + 1)) {}

  std::uint64_t next() {
    state_ += 0x9e3779b97f4a7c15ULL;
    return mix(state_);
  }
  double unit() { return static_cast<double>(next() >> 11U) * 0x1.0p-53; }  ///< [0, 1)
  double in(double lo, double hi) { return lo + (hi - lo) * unit(); }
  std::size_t below(std::size_t n) {
    return static_cast<std::size_t>(unit() * static_cast<double>(n));
  }
  bool chance(double p) { return unit() < p; }

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
  }
  std::uint64_t state_;
};

}  // namespace ivis
