#include "spec_decoder.h"

#include <algorithm>
#include <cmath>

namespace ivis::test {
namespace {

class Code {
 public:
  explicit Code(std::span<const std::byte> bytes) : bytes_(bytes) {
    for (int i = 0; i < 4; ++i)
      number_ = number_ * 256 + next();
  }
  bool bit(SpecAdaptiveBit& a) {
    const std::uint64_t p = static_cast<std::uint64_t>(a.P / 64) | 1U;
    const std::uint64_t split = low_ + (high_ - low_) * p / 65536;
    const bool b = number_ <= split;
    if (b)
      high_ = split;
    else
      low_ = split + 1;
    const long rate = 131072 / (2 * a.n + 3);
    a.P = a.P + ((b ? (1L << 22) - 1 : 0L) - a.P) * rate / 65536;
    a.n = std::min(a.n + 1, 60L);
    while (low_ >> 24U == high_ >> 24U) {
      constexpr std::uint64_t kModulus = std::uint64_t{1} << 32U;
      low_ = low_ * 256 % kModulus;
      high_ = (high_ * 256 + 255) % kModulus;
      number_ = (number_ * 256 + next()) % kModulus;
    }
    return b;
  }
  bool ends_well() const {
    if (read_ < bytes_.size() || (!bytes_.empty() && bytes_.back() == std::byte{0})) return false;
    for (std::uint64_t unit = std::uint64_t{1} << 32U;; unit /= 256) {
      const std::uint64_t smallest = (low_ + unit - 1) / unit * unit;
      if (smallest <= high_) return number_ == smallest;
    }
  }

 private:
  std::uint64_t next() {
    const std::size_t i = read_++;
    return i < bytes_.size() ? std::to_integer<std::uint64_t>(bytes_[i]) : 0U;
  }
  std::span<const std::byte> bytes_;
  std::size_t read_ = 0;
  std::uint64_t low_ = 0, high_ = 0xffffffffU, number_ = 0;
};

std::size_t size_of(std::size_t n) {
  return n == 0 ? 0
                : std::min<std::size_t>(
                      6, static_cast<std::size_t>(std::log2(static_cast<double>(n))) + 1);
}

std::uint64_t check_of(const std::vector<bool>& set) {
  constexpr std::uint64_t K = 0x9e3779b97f4a7c15U;
  std::uint64_t h = set.size();
  for (std::size_t first = 0; first < set.size(); first += 64) {
    std::uint64_t word = 0;
    for (std::size_t k = 0; k < 64 && first + k < set.size(); ++k)
      if (set[first + k]) word |= std::uint64_t{1} << k;
    h = (h ^ word) * K;
    h = h << 29U | h >> 35U;
  }
  return (h * K) >> 48U;
}

}  // namespace

std::optional<SpecState> spec_decode(std::span<const std::byte> payload, const SpecState& base,
                                     SpecCheck mode) {
  if (payload.size() < 2) return std::nullopt;
  const std::size_t n = base.set.size();
  SpecState next = base;
  next.before = base.set;
  Code code(payload.subspan(2));
  const auto count = [&](std::size_t first, std::size_t end, auto&& what) {
    std::size_t c = 0;
    for (std::size_t r = first; r < end; ++r)
      c += what(r) ? 1U : 0U;
    return c;
  };
  const auto listed = [&](std::size_t r) -> bool { return base.set[r]; };
  const auto changed_before = [&](std::size_t r) -> bool { return base.set[r] != base.before[r]; };
  std::size_t left_superblock = 0, left_block = 0;
  for (std::size_t s = 0; s < n; s += 512) {
    const std::size_t s_end = std::min(n, s + 512);
    const std::size_t a = size_of(count(s, s_end, listed) / 4),
                      b = size_of(count(s, s_end, changed_before) / 2);
    left_superblock = code.bit(next.superblock[(7 * a + b) * 2 + left_superblock]) ? 1 : 0;
    if (left_superblock == 0) {
      left_block = 0;
      continue;
    }
    bool any_block = false;
    for (std::size_t t = s; t < s_end; t += 32) {
      const std::size_t t_end = std::min(n, t + 32);
      const std::size_t in_set = count(t, t_end, listed);
      const std::size_t fill = in_set == 0 ? 0 : in_set == 32 ? 1 : 2;
      const std::size_t v = (7 * fill + size_of(count(t, t_end, changed_before))) * 2 + left_block;
      left_block = (t_end == s_end && !any_block) || code.bit(next.block[v]) ? 1 : 0;
      if (left_block == 0) continue;
      any_block = true;
      bool any_rank = false;
      for (std::size_t r = t; r < t_end; ++r) {
        std::size_t u = 0;
        if (base.set[r]) u += 1;
        if (base.before[r]) u += 2;
        if (r >= 1 && base.before[r - 1]) u += 4;
        if (r >= 1 && next.set[r - 1]) u += 8;
        if (r >= 2 && next.set[r - 2]) u += 16;
        if (!(r + 1 == t_end && !any_rank) && !code.bit(next.rank[u])) continue;
        any_rank = true;
        next.set[r] = !next.set[r];
      }
    }
  }
  const auto check =
      std::to_integer<std::uint64_t>(payload[0]) + std::to_integer<std::uint64_t>(payload[1]) * 256;
  if (!code.ends_well()) return std::nullopt;
  if (mode == SpecCheck::kMind && check != check_of(next.set)) return std::nullopt;
  return next;
}

}  // namespace ivis::test
