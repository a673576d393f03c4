#include "wire/object_table.h"

#include <string>

#include <zstd.h>

#include "core/assert.h"

namespace ivis::wire {
namespace {

constexpr int kLevel = 3;
constexpr std::size_t kRowBytes = 12;         // three columns of four bytes
constexpr std::size_t kClusterRowBytes = 16;  // four
static_assert(kMaxObjects == kMaxMessageBytes / kRowBytes);
static_assert(kMaxClusters == kMaxMessageBytes / kClusterRowBytes);

// Each column as differences to its previous entry (modulo 2^32), one plane of bytes after the
// other: the upper planes are runs of equal bytes, which zstd all but removes.
struct Planes {
  std::uint8_t* bytes;
  std::size_t rows;
  void put(std::size_t column, std::size_t row, std::uint32_t value) const {
    for (std::size_t k = 0; k < 4; ++k)
      bytes[(4 * column + k) * rows + row] = static_cast<std::uint8_t>(value >> (8 * k));
  }
  std::uint32_t get(std::size_t column, std::size_t row) const {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < 4; ++k)
      value |= std::uint32_t{bytes[(4 * column + k) * rows + row]} << (8 * k);
    return value;
  }
};

// A small negative difference as a small number.
std::uint32_t zigzag(std::uint32_t d) {
  return (d << 1U) ^ (0U - (d >> 31U));
}
std::uint32_t unzigzag(std::uint32_t z) {
  return (z >> 1U) ^ (0U - (z & 1U));
}

}  // namespace

std::vector<std::uint8_t> pack_table(const ObjectTable& table) {
  const std::size_t n = table.id.size();
  IVIS_ASSERT(table.node.size() == n && table.instance.size() == n,
              "the table's columns have one length");
  const bool clusters = !table.cluster.empty();
  IVIS_ASSERT(!clusters || table.cluster.size() == n, "the table's columns have one length");
  IVIS_ASSERT(n <= (clusters ? kMaxClusters : kMaxObjects), "the table fits into a message");
  // Nodes, instances and clusters go by id, not by rank: ids ascend by them in that order, so all
  // are near-constant steps there, and only the permutation itself costs bytes.
  std::vector<Rank> rank_of(n, static_cast<Rank>(n));
  for (std::size_t r = 0; r < n; ++r) {
    IVIS_ASSERT(table.id[r] < n && rank_of[table.id[r]] == n, "the table's ids are a permutation");
    rank_of[table.id[r]] = static_cast<Rank>(r);
  }
  std::vector<std::uint8_t> raw(n * (clusters ? kClusterRowBytes : kRowBytes));
  const Planes planes{raw.data(), n};
  std::uint32_t id = 0, node = 0, instance = 0, cluster = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Rank r = rank_of[i];
    planes.put(0, i, zigzag(table.id[i] - id));
    planes.put(1, i, zigzag(table.node[r] - node));
    planes.put(2, i, zigzag(table.instance[r] - instance));
    id = table.id[i];
    node = table.node[r];
    instance = table.instance[r];
    if (!clusters) continue;
    planes.put(3, i, zigzag(table.cluster[r] - cluster));
    cluster = table.cluster[r];
  }
  std::vector<std::uint8_t> frame(ZSTD_compressBound(raw.size()));
  const std::size_t size =
      ZSTD_compress(frame.data(), frame.size(), raw.data(), raw.size(), kLevel);
  IVIS_ASSERT(ZSTD_isError(size) == 0, "zstd has room for its frame");
  frame.resize(size);
  return frame;
}

Result<ObjectTable> unpack_table(std::span<const std::uint8_t> frame, std::uint32_t objects) {
  const std::size_t n = objects;
  IVIS_ASSERT(n <= kMaxObjects, "the message's reader has checked the count");
  // Before allocating: the frame must be exactly one, and say that it opens to this size.
  const auto content = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (content == ZSTD_CONTENTSIZE_ERROR || content == ZSTD_CONTENTSIZE_UNKNOWN)
    return input_error("object table: not a zstd frame that states its size");
  const bool clusters = n > 0 && n <= kMaxClusters && content == n * kClusterRowBytes;
  const std::size_t expected = n * (clusters ? kClusterRowBytes : kRowBytes);
  if (content != expected)
    return input_error("object table: frame holds " + std::to_string(content) +
                       " bytes, expected " + std::to_string(expected) +
                       (n <= kMaxClusters ? " or " + std::to_string(n * kClusterRowBytes) : ""));
  if (ZSTD_findFrameCompressedSize(frame.data(), frame.size()) != frame.size())
    return input_error("object table: bytes missing or left over after its zstd frame");
  std::vector<std::uint8_t> raw(expected);
  const std::size_t size = ZSTD_decompress(raw.data(), raw.size(), frame.data(), frame.size());
  if (ZSTD_isError(size) != 0)
    return input_error(std::string("object table: zstd: ") + ZSTD_getErrorName(size));
  if (size != expected)
    return input_error("object table: " + std::to_string(size) + " bytes, expected " +
                       std::to_string(expected));

  ObjectTable table;
  table.id.resize(n);
  table.node.resize(n);
  table.instance.resize(n);
  if (clusters) table.cluster.resize(n);
  std::vector<Rank> rank_of(n, objects);
  const Planes planes{raw.data(), n};
  std::uint32_t id = 0;
  for (std::size_t r = 0; r < n; ++r) {
    id += unzigzag(planes.get(0, r));
    if (id >= n || rank_of[id] != objects)
      return input_error("object table: rank " + std::to_string(r) + " has id " +
                         std::to_string(id) + ", which is " +
                         (id >= n ? "not below " + std::to_string(n) : "taken"));
    rank_of[id] = static_cast<Rank>(r);
    table.id[r] = id;
  }
  std::uint32_t node = 0, instance = 0, cluster = 0;
  for (std::size_t i = 0; i < n; ++i) {
    node += unzigzag(planes.get(1, i));
    instance += unzigzag(planes.get(2, i));
    table.node[rank_of[i]] = node;
    table.instance[rank_of[i]] = instance;
    if (!clusters) continue;
    cluster += unzigzag(planes.get(3, i));
    table.cluster[rank_of[i]] = cluster;
  }
  return table;
}

}  // namespace ivis::wire
