// Golden bytes of the wire: read out of SPEC.md, so that document and code cannot part.

#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <zstd.h>

#include "wire/messages.h"
#include "wire/object_table.h"
#include "wire/pvs_codec.h"

namespace ivis::wire {
namespace {

using Bytes = std::vector<std::byte>;

/// The blocks ```hex NAME ... ``` of SPEC.md.
std::map<std::string, Bytes> golden() {
  std::map<std::string, Bytes> blocks;
  std::ifstream file(IVIS_WIRE_SPEC);
  std::string line, name;
  while (std::getline(file, line)) {
    if (line.starts_with("```hex ")) {
      name = line.substr(7);
      blocks[name];
    } else if (line.starts_with("```")) {
      name.clear();
    } else if (!name.empty()) {
      std::istringstream words(line);
      for (unsigned byte = 0; words >> std::hex >> byte;)
        blocks[name].push_back(static_cast<std::byte>(byte));
    }
  }
  return blocks;
}

std::string hex(const Bytes& bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    char two[4];
    std::snprintf(two, sizeof two, "%02x", std::to_integer<unsigned>(bytes[i]));
    text += two;
    text += i % 16 == 15 || i + 1 == bytes.size() ? '\n' : ' ';
  }
  return text;
}

constexpr std::uint64_t kSession = 0x1122334455667788U;

RankSet set_of(std::initializer_list<Rank> ranks) {
  RankSet set(70);
  for (const Rank r : ranks)
    set.set(r);
  return set;
}

/// The messages of the example, made with the library.
std::map<std::string, Message> example(Bytes& full, Bytes& difference) {
  PvsState one(70), two(70);
  full = encode_pvs(set_of({3, 4, 5, 6, 40, 69}), PvsState(70), one);
  difference = encode_pvs(set_of({4, 5, 6, 7, 40, 69}), one, two);
  std::map<std::string, Message> m;
  m["hello"] = Hello{4, 0x0102030405060708U, "disc:1", true, {30, 1, 0.015625, 0.5}, {}, 0};
  m["welcome"] =
      Welcome{4, kSession, 0x0102030405060708U, 42, 70, {"disc:0.5", "disc:1"}, "cull_map", {}};
  m["pose"] = PoseMessage{kSession, 1, 0, {1.5, 1.7, -2}, 16667, 0};
  m["pose_ahead"] = PoseMessage{kSession, 2, 1, {1.5, 1.7, -3}, 16667, 0, Vec3(1.5, 1.7, -2)};
  m["pvs_full"] = PvsMessage{kSession, 1, 0, {}, false, 85, 1, 65535, full, {}};
  m["pvs_difference"] =
      PvsMessage{kSession, 2, 1, Vec3(1, 2, 3), false, 90, 0, 32767, difference, {}};
  m["pvs_everything"] = PvsMessage{kSession, 3, 0, {}, true, 4, 1, 65535, {}, {}};
  m["pace"] = PaceMessage{kSession, {60, 2, 0.015625, 0.25}};
  m["refused"] = Refused{kSession, Refusal::kClosing, "bye"};
  m["bye"] = Bye{kSession};
  const Placement turned{{10, 0.5, -3}, {0.70710677F, 0, 0.70710677F, 0}};
  m["edit"] = EditMessage{
      kSession, 5, {{EditKind::kMove, 7, turned, 12.5F}, {EditKind::kOccluderOff, 69, {}, 0}}};
  m["edited"] = EditedMessage{kSession, 6, 0, "no"};
  m["notice"] = NoticeMessage{kSession, 9};
  PvsMessage changed{kSession, 4, 0, {}, true, 4, 1, 65535, {}, {}};
  changed.changes = {9, 8, 100'000, {{7, false, false, true, turned, 12.5F}}};
  m["pvs_changed"] = changed;
  return m;
}

TEST(WireSpec, ExampleIsWhatTheLibraryWrites) {
  const auto blocks = golden();
  Bytes full, difference;
  auto messages = example(full, difference);
  ASSERT_EQ(blocks.size(), messages.size() + 3) << "blocks in SPEC.md";
  for (const auto& [name, bytes] : blocks) {
    if (name == "table") continue;  // below
    if (name == "payload_full")
      EXPECT_EQ(hex(bytes), hex(full));
    else if (name == "payload_difference")
      EXPECT_EQ(hex(bytes), hex(difference));
    else
      EXPECT_EQ(hex(bytes), hex(encode(messages.at(name)))) << name;
  }
}

TEST(WireSpec, ExampleIsReadAsWhatItSays) {
  auto blocks = golden();
  Bytes full, difference;
  for (const auto& [name, message] : example(full, difference)) {
    const auto decoded = decode(blocks[name]);
    ASSERT_TRUE(decoded) << name << ": " << decoded.error().message;
    EXPECT_EQ(*decoded, message) << name;
  }
  const auto one = decode_pvs(blocks["payload_full"], PvsState(70));
  ASSERT_TRUE(one) << one.error().message;
  EXPECT_EQ(one->set, set_of({3, 4, 5, 6, 40, 69}));
  const auto two = decode_pvs(blocks["payload_difference"], *one);
  ASSERT_TRUE(two) << two.error().message;
  EXPECT_EQ(two->set, set_of({4, 5, 6, 7, 40, 69}));
}

TEST(WireSpec, TableWithClustersIsWhatTheLibraryWritesAndReads) {
  const Bytes golden_table = golden()["table"];
  // By rank.
  const ObjectTable table{{2, 0, 3, 1, 4}, {3, 3, 5, 3, 5}, {0, 0, 0, 0, 1}, {2, 0, 0, 1, 0}};
  const auto frame = pack_table(table);
  Bytes raw(1000);
  raw.resize(ZSTD_decompress(raw.data(), raw.size(), frame.data(), frame.size()));
  EXPECT_EQ(hex(raw), hex(golden_table));
  std::vector<std::uint8_t> packed(ZSTD_compressBound(golden_table.size()));
  packed.resize(
      ZSTD_compress(packed.data(), packed.size(), golden_table.data(), golden_table.size(), 1));
  const auto read = unpack_table(packed, 5);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, table);
}

}  // namespace
}  // namespace ivis::wire
