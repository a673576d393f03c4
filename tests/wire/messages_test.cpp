#include "wire/messages.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "made_up.h"
#include "wire/object_table.h"

namespace ivis::wire {
namespace {

using Bytes = std::vector<std::byte>;

PvsMessage pvs_of(std::size_t payload) {
  PvsMessage m;
  m.session = 0x1234567890abcdefU;
  m.sequence = 7;
  m.base = 6;
  m.solve_us = 90;
  m.payload.assign(payload, std::byte{0xa5});
  return m;
}

PvsMessage changed_pvs() {
  PvsMessage changed = pvs_of(31);
  changed.changes = {6, 4, 50'000, {}};
  changed.changes.objects = {{3, true, false, false, {}, 0},
                             {5, false, true, true, {{1, 2, 1234.5}, {1, 0, 0, 0}}, 30}};
  return changed;
}

std::vector<Message> samples() {
  PvsMessage centred = pvs_of(31);
  centred.eye = Vec3(1, -2, 3.25);
  PvsMessage everything = pvs_of(0);
  everything.everything = true;
  Welcome w{1, 0xfedcba9876543210U, 5, 6, 3, {"disc:0.5", "disc:1"}, "cull_map", {}};
  Welcome with_table = w;
  with_table.table = {{2, 0, 1}, {10, 10, 11}, {1, 0, 0}};
  return {Hello{},
          Hello{9, 77, "cylinder:1.5,0.1", false, {}, Strategy::kAbort, 250},
          Hello{2, 0, "", true, {30, 2.5, 1.0 / 60}, {}, 0},
          PaceMessage{7, {1, 0, 0}},
          w,
          with_table,
          PoseMessage{1, 2, 3, {4, 5, -6}},
          PoseMessage{1, 2, 3, {4, 5, -6}, 16667},
          pvs_of(0),
          pvs_of(1),
          pvs_of(200),
          centred,
          everything,
          Refused{12, Refusal::kScene, "another scene"},
          Refused{},
          PoseMessage{1, 2, 3, {4, 5, -6}, 16667, 5},
          PoseMessage{1, 2, 3, {4, 5, -6}, 16667, 5, Vec3(3, 5, -6)},
          PaceMessage{7, {1, 0, 0, 0.5}},
          EditMessage{7, 1, {{EditKind::kRemove, 4, {}, 0}}},
          EditMessage{7,
                      2,
                      {{EditKind::kMove, 1, {{1, -2, 1e6}, {0, 0, 0, 1}}, 1000},
                       {EditKind::kOccluderOn, 2, {}, 0}}},
          EditedMessage{7, 2, 3, ""},
          EditedMessage{7, 2, 0, "no"},
          NoticeMessage{7, 3},
          changed_pvs(),
          Bye{99}};
}

std::string error_of(const Bytes& bytes) {
  const auto m = decode(bytes);
  return m ? std::string("no error") : m.error().message;
}

// Overwrites the only place where `from` occurs.
template <class T>
Bytes patched(Bytes bytes, T from, T to) {
  std::size_t found = 0, at = 0;
  for (std::size_t i = 0; i + sizeof(T) <= bytes.size(); ++i)
    if (std::memcmp(bytes.data() + i, &from, sizeof(T)) == 0) {
      at = i;
      ++found;
    }
  EXPECT_EQ(found, 1U);
  std::memcpy(bytes.data() + at, &to, sizeof(T));
  return bytes;
}

TEST(WireMessages, ComeBackAsTheyWere) {
  for (const Message& m : samples()) {
    const auto back = decode(encode(m));
    ASSERT_TRUE(back) << m.index() << ": " << back.error().message;
    EXPECT_EQ(*back, m) << m.index();
  }
}

TEST(WireMessages, TellEverythingFromNothingChanged) {
  const auto nothing = decode(encode(pvs_of(0)));
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(std::get<PvsMessage>(*nothing).everything);
}

TEST(WireMessages, PvsEnvelopeIsFiftyTwoBytes) {
  EXPECT_EQ(encode(pvs_of(200)).size(), 252U);
  EXPECT_EQ(encode(pvs_of(197)).size(), 252U);
}

TEST(WireMessages, ReadFromAnyAddress) {
  for (const Message& m : samples()) {
    const Bytes bytes = encode(m);
    for (std::size_t offset = 0; offset < 8; ++offset) {
      Bytes moved(offset);
      moved.insert(moved.end(), bytes.begin(), bytes.end());
      const auto back = decode(std::span(moved).subspan(offset));
      ASSERT_TRUE(back) << offset;
      EXPECT_EQ(*back, m);
    }
  }
}

TEST(WireMessages, CutTheirOwnStringsToTheBound) {
  const auto back = decode(encode(Refused{1, Refusal::kBusy, std::string(5000, 'x')}));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(std::get<Refused>(*back).text.size(), kMaxTextBytes);
}

TEST(WireMessages, AWelcomeIsTheSameWhoeverPacksItsTable) {
  Welcome w{1, 2, 3, 4, 3, {"disc:1"}, "m", {{2, 0, 1}, {10, 10, 11}, {1, 0, 0}}};
  const Bytes whole = encode(w);
  const auto packed = pack_table(w.table);
  w.table = {};
  EXPECT_EQ(encode(w, packed), whole);
}

TEST(WireMessages, LeaveAnotherVersionToTheReceiver) {
  const auto back = decode(encode(Hello{77, 0, "", true, {}, {}, 0}));
  ASSERT_TRUE(back);
  EXPECT_EQ(std::get<Hello>(*back).version, 77);
}

// ---- hostile bytes ----

TEST(WireDecoder, RejectsTruncationAtEveryLength) {
  for (const Message& m : samples()) {
    const Bytes bytes = encode(m);
    for (std::size_t n = 0; n < bytes.size(); ++n)
      EXPECT_FALSE(decode(std::span(bytes).first(n))) << m.index() << " " << n;
  }
}

TEST(WireDecoder, RejectsTrailingBytes) {
  for (const Message& m : samples()) {
    Bytes bytes = encode(m);
    bytes.push_back(std::byte{0});
    EXPECT_NE(error_of(bytes).find("prefix"), std::string::npos);
  }
}

TEST(WireDecoder, RejectsMoreThanItsLimit) {
  const Bytes bytes(kMaxMessageBytes + 1);
  EXPECT_NE(error_of(bytes).find("at most 67108864"), std::string::npos);
}

// So that the server can say which version it speaks.
TEST(WireDecoder, ReadsTheHelloOfAnEarlierVersion) {
  Bytes bytes;
  for (const int b :
       {0x6c, 0x00, 0x00, 0x00, 0x18, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
        0x0e, 0x00, 0x0a, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x04, 0x00,
        0x0e, 0x00, 0x00, 0x00, 0x14, 0x00, 0x00, 0x00, 0x00, 0x00, 0x0e, 0x00, 0x30, 0x00,
        0x06, 0x00, 0x05, 0x00, 0x24, 0x00, 0x08, 0x00, 0x0c, 0x00, 0x0e, 0x00, 0x00, 0x00,
        0x00, 0x01, 0x03, 0x00, 0x28, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
        0x3e, 0x40, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xf0, 0x3f, 0x00, 0x00, 0x00, 0x00,
        0x00, 0x00, 0x90, 0x3f, 0x08, 0x07, 0x06, 0x05, 0x04, 0x03, 0x02, 0x01, 0x00, 0x00,
        0x00, 0x00, 0x06, 0x00, 0x00, 0x00, 0x64, 0x69, 0x73, 0x63, 0x3a, 0x31, 0x00, 0x00})
    bytes.push_back(static_cast<std::byte>(b));
  const auto m = decode(bytes);
  ASSERT_TRUE(m) << m.error().message;
  const auto& hello = std::get<Hello>(*m);
  EXPECT_EQ(hello.version, 3);
  EXPECT_EQ(hello.scene_hash, 0x0102030405060708U);
  EXPECT_EQ(hello.pace, (Pace{30, 1, 0.015625}));
}

TEST(WireDecoder, RejectsNumbersThatAreNotFinite) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity()}) {
    const double x = 1234.5;
    EXPECT_NE(error_of(patched(encode(PoseMessage{1, 2, 3, {0, x, 0}}), x, bad))
                  .find("pose 2: eye or observer is not finite"),
              std::string::npos);
    EXPECT_NE(
        error_of(patched(encode(PoseMessage{1, 2, 3, {0, 1, 0}, 0, 0, Vec3(0, x, 0)}), x, bad))
            .find("pose 2: eye or observer is not finite"),
        std::string::npos);
    PvsMessage m = pvs_of(3);
    m.eye = Vec3(0, 0, x);
    EXPECT_NE(error_of(patched(encode(m), x, bad)).find("pvs 7: centre is not finite"),
              std::string::npos);
  }
}

TEST(WireDecoder, RejectsPlacementsThatAreNone) {
  const double x = 1234.5;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(), 1.1e9, -1.1e9}) {
    const EditMessage edit{1, 2, {{EditKind::kMove, 3, {{0, x, 0}, {1, 0, 0, 0}}, 0}}};
    EXPECT_NE(error_of(patched(encode(edit), x, bad)).find("object 3: a position"),
              std::string::npos);
    EXPECT_NE(error_of(patched(encode(changed_pvs()), x, bad)).find("object 5: a position"),
              std::string::npos);
  }
  const float w = 0.6F;
  const EditMessage turned{1, 2, {{EditKind::kMove, 3, {{0, 0, 0}, {w, 0.8F, 0, 0}}, 12.5F}}};
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), 0.0F, 0.7F, 1e30F})
    EXPECT_NE(error_of(patched(encode(turned), w, bad)).find("or a rotation that is none"),
              std::string::npos);
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), -1.0F, 1001.0F})
    EXPECT_NE(error_of(patched(encode(turned), 12.5F, bad)).find("object 3: a speed"),
              std::string::npos);
}

TEST(WireDecoder, RejectsChangesThatContradictThemselves) {
  PvsMessage m = changed_pvs();
  m.changes.epoch = 0x5a6b7c8d;
  EXPECT_NE(error_of(patched(encode(m), m.changes.epoch, 0U)).find("changes: epoch 0"),
            std::string::npos);
  m.changes.since = 0x5a6b7c80;
  EXPECT_NE(error_of(patched(encode(m), m.changes.since, 0x5a6b7c8eU)).find("told against"),
            std::string::npos);
}

TEST(WireDecoder, RejectsAnUnknownReason) {
  for (const std::uint64_t reason : {0U, 8U, 255U}) {
    // The reason is the byte that differs between two refusals.
    const Bytes one = encode(Refused{1, Refusal::kScene, "x"}),
                two = encode(Refused{1, Refusal::kReach, "x"});
    Bytes bytes = one;
    std::size_t differing = 0;
    for (std::size_t i = 0; i < one.size(); ++i)
      if (one[i] != two[i]) {
        bytes[i] = static_cast<std::byte>(reason);
        ++differing;
      }
    ASSERT_EQ(differing, 1U);
    EXPECT_NE(error_of(bytes).find("unknown reason"), std::string::npos) << reason;
  }
}

TEST(WireDecoder, RejectsMoreObjectsThanTheProtocolTakes) {
  Welcome w{1, 2, 3, 4, 0x00345678, {"disc:1"}, "m", {}};
  EXPECT_NE(error_of(patched(encode(w), w.objects, 0xffffffffU))
                .find("welcome: 4294967295 objects, at most 5592405"),
            std::string::npos);
}

TEST(WireDecoder, RejectsATableOfAnotherLength) {
  Welcome w{1, 2, 3, 4, 0, {"disc:1"}, "m", {}};
  w.objects = 0x1234;
  for (std::uint32_t i = 0; i < w.objects; ++i) {
    w.table.id.push_back(i);
    w.table.node.push_back(0);
    w.table.instance.push_back(i);
  }
  EXPECT_NE(error_of(patched(encode(w), w.objects, 0x00345678U))
                .find("object table: frame holds 55920 bytes, expected 41160096"),
            std::string::npos);
}

// The envelope's directory names its fields by position: blanking an entry makes the field absent.
TEST(WireDecoder, RejectsAnEnvelopeWithoutAKnownKind) {
  Bytes bytes = encode(Bye{5});
  // Prefix, root offset, directory: its size, the table's size, then 2 bytes a field; bye is the
  // 8th.
  ASSERT_GE(bytes.size(), 28U);
  std::uint16_t bye = 0;
  std::uint32_t root = 0;
  std::memcpy(&root, bytes.data() + 4, 4);
  std::int32_t back = 0;
  std::memcpy(&back, bytes.data() + 4 + root, 4);
  std::memcpy(bytes.data() + static_cast<std::ptrdiff_t>(4 + root) - back + 4 + 2 * 7, &bye, 2);
  EXPECT_EQ(error_of(bytes), "message: 0 known kinds in one envelope, expected 1");
}

TEST(WireDecoder, NeverFailsBadlyOnFlippedBits) {
  for (const Message& m : samples()) {
    const Bytes bytes = encode(m);
    for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
      Bytes flipped = bytes;
      flipped[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
      const auto back = decode(flipped);
      if (back) encode(*back);  // what is let in is sound enough to be sent on
    }
  }
}

TEST(WireDecoder, NeverFailsBadlyOnRandomDamage) {
  test::Numbers numbers(1);
  const auto all = samples();
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes = encode(all[static_cast<std::size_t>(i) % all.size()]);
    for (std::uint32_t k = 1 + numbers.below(6); k > 0; --k) {
      // Small and large numbers where offsets and counts are, behind a prefix that stays right.
      const std::size_t at = 4 + numbers.below(static_cast<std::uint32_t>(bytes.size() - 4));
      bytes[at] =
          static_cast<std::byte>(numbers.one_in(2) ? numbers.below(16) : 255 - numbers.below(16));
    }
    const auto back = decode(bytes);
    if (back) encode(*back);
  }
}

TEST(WireDecoder, NeverFailsBadlyOnGarbage) {
  test::Numbers numbers(2);
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes(12 + numbers.below(120));
    for (std::byte& b : bytes)
      b = static_cast<std::byte>(numbers.one_in(2) ? 0 : numbers.below(256));
    const auto prefix = static_cast<std::uint32_t>(bytes.size() - 4);
    std::memcpy(bytes.data(), &prefix, 4);
    const auto back = decode(bytes);
    if (back) encode(*back);
  }
}

}  // namespace
}  // namespace ivis::wire
