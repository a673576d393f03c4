#pragma once
// Adaptive binary arithmetic coder: whole numbers only, so both ends move alike on every machine.
// Source:  Rissanen, Langdon, Arithmetic Coding, 1979; the form that keeps both ends of the
// interval. Departs: the rate of adaptation falls with the number of bits seen, to a floor.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace ivis::wire {

/// Probability that a bit is 1, and how often it was asked: 22 bits of probability over 10 of
/// count.
class AdaptiveBit {
 public:
  /// In 1..65535 of 65536.
  std::uint32_t p16() const { return (state_ >> 16U) | 1U; }
  void update(bool bit) {
    const std::uint32_t n = state_ & kCountMask;
    const std::uint32_t p = state_ >> kCountBits;
    const std::uint32_t target = bit ? kOne - 1 : 0;
    const std::int64_t step = (static_cast<std::int64_t>(target) - p) * kRate[n] / 65536;
    state_ = static_cast<std::uint32_t>(p + step) << kCountBits | (n < kLimit ? n + 1 : n);
  }
  bool operator==(const AdaptiveBit&) const = default;

 private:
  static constexpr std::uint32_t kCountBits = 10, kCountMask = (1U << kCountBits) - 1,
                                 kOne = 1U << 22U;
  static constexpr std::uint32_t kLimit = 60;
  /// 65536 / (n + 1.5): the mean of what was seen so far, then a window of some sixty bits.
  static constexpr auto kRate = [] {
    std::array<std::int64_t, kLimit + 1> rate{};
    for (std::uint32_t n = 0; n <= kLimit; ++n)
      rate[n] = 131072 / (2 * n + 3);
    return rate;
  }();
  std::uint32_t state_ = 1U << 31U;  // 1/2, nothing seen
};

/// The interval [low, high] of 32-bit numbers still possible; a bit takes its share of it, and
/// leading bytes on which both ends agree are done with.
struct Interval {
  std::uint32_t low = 0, high = 0xffffffffU;

  /// Last number of the lower part, which stands for a 1. low <= split < high as long as low <
  /// high, which settled() keeps: equal ends would agree in all bytes.
  std::uint32_t split(std::uint32_t p16) const {
    return low + static_cast<std::uint32_t>(std::uint64_t{high - low} * p16 >> 16U);
  }
  void take(bool bit, std::uint32_t at) {
    if (bit)
      high = at;
    else
      low = at + 1;
  }
  bool settled() const { return ((low ^ high) >> 24U) == 0; }
  void shift() {
    low <<= 8U;
    high = high << 8U | 255U;
  }
};

class BitEncoder {
 public:
  bool code(AdaptiveBit& p, bool bit) {
    interval_.take(bit, interval_.split(p.p16()));
    p.update(bit);
    for (; interval_.settled(); interval_.shift())
      bytes_.push_back(static_cast<std::byte>(interval_.low >> 24U));
    return bit;
  }
  /// Ends the code and hands it out: as few bytes as name a number in the interval. The decoder
  /// takes zeros for what is not there, so none is left at the end.
  std::vector<std::byte> finish() {
    std::uint32_t spare = 0xffffffffU;  // low bits that may be zero
    while (((std::uint64_t{interval_.low} + spare) & ~std::uint64_t{spare}) > interval_.high)
      spare >>= 8U;
    const std::uint32_t number = (interval_.low + spare) & ~spare;
    for (std::uint32_t shift = 32; shift != 0; shift -= 8)
      bytes_.push_back(static_cast<std::byte>(number >> (shift - 8)));
    while (!bytes_.empty() && bytes_.back() == std::byte{0})
      bytes_.pop_back();
    return std::move(bytes_);
  }

 private:
  Interval interval_;
  std::vector<std::byte> bytes_;
};

class BitDecoder {
 public:
  /// Keeps the span, not its bytes.
  explicit BitDecoder(std::span<const std::byte> bytes) : bytes_(bytes) {
    for (int i = 0; i < 4; ++i)
      number_ = number_ << 8U | next();
  }
  bool code(AdaptiveBit& p) {
    const std::uint32_t at = interval_.split(p.p16());
    const bool bit = number_ <= at;
    interval_.take(bit, at);
    p.update(bit);
    for (; interval_.settled(); interval_.shift())
      number_ = number_ << 8U | next();
    return bit;
  }
  /// Bytes of the code that no bit came from.
  std::size_t unread() const { return bytes_.size() - std::min(read_, bytes_.size()); }

 private:
  std::uint32_t next() {
    const std::size_t i = read_++;
    return i < bytes_.size() ? std::to_integer<std::uint32_t>(bytes_[i]) : 0U;
  }
  std::span<const std::byte> bytes_;
  std::size_t read_ = 0;
  Interval interval_;
  std::uint32_t number_ = 0;
};

}  // namespace ivis::wire
