#pragma once
// Random numbers that depend on a seed alone: the same on every machine and for any number of
// threads.

#include <cstdint>

namespace ivis {

/// Scrambles 64 bits. Source: Steele, Lea, Flood, Fast splittable pseudorandom number generators,
/// 2014.
inline std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(mix(seed)) {}
  std::uint64_t bits() { return mix(state_ += 0x9e3779b97f4a7c15U); }
  /// In [0, 1).
  double unit() { return static_cast<double>(bits() >> 11U) * 0x1p-53; }
  /// In [0, n), n > 0.
  std::uint32_t below(std::uint32_t n) {
    return static_cast<std::uint32_t>(((bits() >> 32U) * std::uint64_t{n}) >> 32U);
  }

 private:
  std::uint64_t state_;
};

}  // namespace ivis
