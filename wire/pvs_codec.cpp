#include "wire/pvs_codec.h"

#include <algorithm>
#include <bit>
#include <string>
#include <utility>

#include "core/assert.h"

namespace ivis::wire {
namespace {

constexpr std::size_t kCheckBytes = 2;
constexpr std::uint32_t kBlock = 32, kSuperblock = 512;
constexpr std::size_t kWordsPerSuperblock = kSuperblock / 64;

/// 16 bits of a hash of the set: a wrong base or a damaged code must not pass for a PVS.
std::uint32_t check_of(const RankSet& set) {
  std::uint64_t h = set.size;
  for (const std::uint64_t w : set.words)
    h = std::rotl((h ^ w) * 0x9e3779b97f4a7c15U, 29);
  return static_cast<std::uint32_t>((h * 0x9e3779b97f4a7c15U) >> 48U);
}

/// 0, 1, 2-3, 4-7, 8-15, 16-31, more.
std::uint32_t size_class(int count) {
  return std::min(6U, static_cast<std::uint32_t>(std::bit_width(static_cast<unsigned>(count))));
}

std::uint32_t block_of(const RankSet& set, std::uint32_t first) {
  return static_cast<std::uint32_t>(set.words[first >> 6U] >> (first & 32U));
}

/// Context of "some rank of this superblock changed".
std::uint32_t superblock_context(const PvsState& base, std::size_t first_word, std::size_t end_word,
                                 bool left_changed) {
  int listed = 0, changed_before = 0;
  for (std::size_t w = first_word; w < end_word; ++w) {
    const std::uint64_t set = base.set.words[w], before = base.before.words[w];
    if ((set | before) == 0) continue;
    listed += std::popcount(set);
    changed_before += std::popcount(set ^ before);
  }
  return (size_class(listed / 4) * 7 + size_class(changed_before / 2)) * 2 +
         (left_changed ? 1U : 0U);
}

/// Context of "some rank of this block changed".
std::uint32_t block_context(std::uint32_t set, std::uint32_t before, bool left_changed) {
  const std::uint32_t fill = set == 0 ? 0U : set == 0xffffffffU ? 1U : 2U;
  return (fill * 7 + size_class(std::popcount(set ^ before))) * 2 + (left_changed ? 1U : 0U);
}

/// The ranks of one changed block: each is likely to go the way of the two before it. `next` is
/// looked at by an encoder only. Returns the block's new bits.
template <class Coder>
std::uint32_t code_block(Coder& coder, PvsModel& model, std::uint32_t set, std::uint32_t before,
                         std::uint32_t next, int ranks, std::uint32_t left_next,
                         std::uint32_t left_before) {
  std::uint32_t out = 0;
  bool any = false;
  for (int k = 0; k < ranks; ++k) {
    const std::uint32_t was = (set >> k) & 1U, earlier = (before >> k) & 1U;
    const std::uint32_t context = was | earlier << 1U | left_before << 2U | left_next << 3U;
    const bool implied = k + 1 == ranks && !any;
    const bool changed =
        implied || coder.code(model.rank[context], [&] { return ((next >> k) & 1U) != was; });
    any |= changed;
    const std::uint32_t now = was ^ (changed ? 1U : 0U);
    out |= now << k;
    left_next = (left_next << 1U | now) & 3U;  // the nearer rank in bit 0
    left_before = earlier;
  }
  return out;
}

/// The one walk that both ends take. `next` holds the base's set for a decoder, which learns from
/// `coder`, or the set to code for an encoder.
template <class Coder>
void code_difference(Coder& coder, const PvsState& base, PvsModel& model, RankSet& next) {
  const std::size_t words = base.set.words.size();
  bool left_superblock = false, left_block = false;
  for (std::size_t first_word = 0; first_word < words; first_word += kWordsPerSuperblock) {
    const std::size_t end_word = std::min(words, first_word + kWordsPerSuperblock);
    const bool superblock_changed = coder.code(
        model.superblock[superblock_context(base, first_word, end_word, left_superblock)], [&] {
          return !std::equal(base.set.words.begin() + static_cast<std::ptrdiff_t>(first_word),
                             base.set.words.begin() + static_cast<std::ptrdiff_t>(end_word),
                             next.words.begin() + static_cast<std::ptrdiff_t>(first_word));
        });
    left_superblock = superblock_changed;
    if (!superblock_changed) {
      left_block = false;
      continue;
    }
    bool any_block = false;
    const auto end =
        static_cast<std::uint32_t>(std::min<std::size_t>(base.set.size, 64 * end_word));
    for (auto first = static_cast<std::uint32_t>(64 * first_word); first < end; first += kBlock) {
      const std::uint32_t set = block_of(base.set, first), before = block_of(base.before, first),
                          coded = block_of(next, first);
      const bool implied = first + kBlock >= end && !any_block;
      left_block = implied || coder.code(model.block[block_context(set, before, left_block)],
                                         [&] { return coded != set; });
      if (!left_block) continue;
      any_block = true;
      const std::uint32_t left_next =
          first == 0 ? 0U : (next.test(first - 1) ? 1U : 0U) | (next.test(first - 2) ? 2U : 0U);
      const std::uint32_t left_before = first != 0 && base.before.test(first - 1) ? 1U : 0U;
      const int ranks = static_cast<int>(std::min(kBlock, end - first));
      const std::uint32_t now =
          code_block(coder, model, set, before, coded, ranks, left_next, left_before);
      next.words[first >> 6U] ^= std::uint64_t{now ^ coded} << (first & 32U);
    }
  }
}

struct Encoding {
  BitEncoder bits;
  template <class Truth>
  bool code(AdaptiveBit& p, const Truth& truth) {
    return bits.code(p, truth());
  }
};

struct Decoding {
  BitDecoder bits;
  template <class Truth>
  bool code(AdaptiveBit& p, const Truth&) {
    return bits.code(p);
  }
};

}  // namespace

std::size_t RankSet::count() const {
  std::size_t n = 0;
  for (const std::uint64_t w : words)
    n += static_cast<std::size_t>(std::popcount(w));
  return n;
}

PvsState::PvsState(std::uint32_t objects) : set(objects), before(objects) {}

std::vector<std::byte> encode_pvs(const RankSet& set, const PvsState& base, PvsState& after) {
  IVIS_ASSERT(set.size == base.set.size, "set and base are of one scene");
  IVIS_ASSERT(set.size % 64 == 0 || set.words.back() >> (set.size % 64) == 0,
              "bits past the last rank are zero");
  Encoding coder;
  PvsState result;
  result.model = base.model;
  result.set = set;
  code_difference(coder, base, result.model, result.set);
  result.before = base.set;
  after = std::move(result);

  const std::vector<std::byte> code = coder.bits.finish();
  const std::uint32_t check = check_of(set);
  std::vector<std::byte> bytes(kCheckBytes + code.size());
  bytes[0] = static_cast<std::byte>(check);
  bytes[1] = static_cast<std::byte>(check >> 8U);
  std::copy(code.begin(), code.end(), bytes.begin() + kCheckBytes);
  return bytes;
}

Result<PvsState> decode_pvs(std::span<const std::byte> bytes, const PvsState& base) {
  if (bytes.size() < kCheckBytes)
    return input_error("pvs: " + std::to_string(bytes.size()) + " bytes, at least " +
                       std::to_string(kCheckBytes));
  const auto code = bytes.subspan(kCheckBytes);
  PvsState after;
  after.set = base.set;
  after.before = base.set;
  after.model = base.model;
  Decoding coder{BitDecoder(code)};
  code_difference(coder, base, after.model, after.set);
  if (!coder.bits.ends_well())
    return input_error("pvs: the code does not end with its last object (" +
                       std::to_string(coder.bits.unread()) +
                       " bytes left over): truncated, damaged, or coded against another base");
  const std::uint32_t stated =
      std::to_integer<std::uint32_t>(bytes[0]) | std::to_integer<std::uint32_t>(bytes[1]) << 8U;
  if (stated != check_of(after.set))
    return input_error("pvs: the check of the set differs: damaged, or coded against another base");
  return after;
}

}  // namespace ivis::wire
