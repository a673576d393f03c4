// Envelopes that FlatBuffers finds in order and the protocol does not: made with the schema
// directly.

#include <cmath>

#include <gtest/gtest.h>

#include "ivis_generated.h"
#include "wire/messages.h"

namespace ivis::wire {
namespace {

using flatbuffers::FlatBufferBuilder;

const fb::Bye kBye(1);
const fb::Pvs kPvs(1, 0, 2, 0, 3, 0, 65535);
const fb::Pose kPose(1, 2, 0, fb::Vec3(1, 2, 3), 0, 0);

std::string error_of(FlatBufferBuilder& b, flatbuffers::Offset<fb::Envelope> envelope) {
  b.FinishSizePrefixed(envelope);
  const auto m = decode({reinterpret_cast<const std::byte*>(b.GetBufferPointer()), b.GetSize()});
  return m ? std::string("no error") : m.error().message;
}

TEST(WireEnvelope, MustHoldOneKind) {
  FlatBufferBuilder none, two;
  EXPECT_EQ(error_of(none, fb::CreateEnvelope(none)),
            "message: 0 known kinds in one envelope, expected 1");
  EXPECT_EQ(error_of(two, fb::CreateEnvelope(two, nullptr, 0, nullptr, &kPose, 0, 0, 0, &kBye)),
            "message: 2 known kinds in one envelope, expected 1");
}

TEST(WireEnvelope, MustHoldPayloadAndCentreOnlyWithAPvs) {
  const std::vector<std::uint8_t> payload(4);
  const fb::Vec3 centre(1, 2, 3);
  FlatBufferBuilder a, b, c;
  const auto in_a = a.CreateVector(payload);
  EXPECT_EQ(error_of(a, fb::CreateEnvelope(a, nullptr, in_a, nullptr, &kPose)),
            "message: a payload, centre or changes without a pvs");
  EXPECT_EQ(error_of(b, fb::CreateEnvelope(b, nullptr, 0, &centre, &kPose)),
            "message: a payload, centre or changes without a pvs");
  FlatBufferBuilder d;
  EXPECT_EQ(error_of(d, fb::CreateEnvelope(d, &kPvs, 0, nullptr, nullptr, 0, 0, 0, nullptr, nullptr,
                                           0, 0, nullptr, 0, &centre)),
            "message: an observer without a pose");
  const auto in_c = c.CreateVector(payload);
  EXPECT_EQ(error_of(c, fb::CreateEnvelope(c, &kPvs, in_c, &centre)), "no error");
}

TEST(WireEnvelope, MustKeepStringsToTheirBounds) {
  FlatBufferBuilder a, b, c, d, e;
  const std::string name(257, 'x'), text(1025, 'x');
  const auto hello = fb::CreateHello(a, 1, true, 0, a.CreateString(name));
  EXPECT_EQ(error_of(a, fb::CreateEnvelope(a, nullptr, 0, nullptr, nullptr, hello)),
            "hello: reach: 257 bytes, at most 256");
  const auto reach = fb::CreateWelcome(
      b, 1, 2, 3, 4, 5,
      b.CreateVector(std::vector{b.CreateString("disc:1"), b.CreateString(name)}));
  EXPECT_EQ(error_of(b, fb::CreateEnvelope(b, nullptr, 0, nullptr, nullptr, 0, reach)),
            "welcome: reach: 257 bytes, at most 256");
  const auto one = c.CreateVector(std::vector{c.CreateString("disc:1")});
  const auto method = fb::CreateWelcome(c, 1, 2, 3, 4, 5, one, c.CreateString(name));
  EXPECT_EQ(error_of(c, fb::CreateEnvelope(c, nullptr, 0, nullptr, nullptr, 0, method)),
            "welcome: method: 257 bytes, at most 256");
  const auto refused = fb::CreateRefused(d, 1, 3, d.CreateString(text));
  EXPECT_EQ(error_of(d, fb::CreateEnvelope(d, nullptr, 0, nullptr, nullptr, 0, 0, refused)),
            "refused: text: 1025 bytes, at most 1024");
  const auto longest = fb::CreateRefused(e, 1, 3, e.CreateString(text.data(), 1024));
  EXPECT_EQ(error_of(e, fb::CreateEnvelope(e, nullptr, 0, nullptr, nullptr, 0, 0, longest)),
            "no error");
}

TEST(WireEnvelope, MustNameOneToThirtyTwoReaches) {
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, kMaxRungs, kMaxRungs + 1}) {
    FlatBufferBuilder b;
    std::vector<flatbuffers::Offset<flatbuffers::String>> reaches(count);
    for (auto& r : reaches)
      r = b.CreateString("disc:1");
    const auto welcome = fb::CreateWelcome(b, 2, 2, 3, 4, 5, b.CreateVector(reaches));
    const std::string found =
        error_of(b, fb::CreateEnvelope(b, nullptr, 0, nullptr, nullptr, 0, welcome));
    EXPECT_EQ(found, count == 1 || count == kMaxRungs
                         ? "no error"
                         : "welcome: " + std::to_string(count) + " reaches, expected 1 to 32");
  }
  FlatBufferBuilder none;
  const auto welcome = fb::CreateWelcome(none, 2, 2, 3, 4, 5);
  EXPECT_EQ(error_of(none, fb::CreateEnvelope(none, nullptr, 0, nullptr, nullptr, 0, welcome)),
            "welcome: 0 reaches, expected 1 to 32");
}

TEST(WireEnvelope, MustTellSpeedsThatAreSpeeds) {
  for (const double bad : {-1.0, 1e7, std::nan(""), HUGE_VAL}) {
    for (int which = 0; which < 4; ++which) {
      const auto at = [&](int i) { return i == which ? bad : 0.0; };
      const fb::Speeds speeds(at(0), at(1), at(2));
      FlatBufferBuilder a, b;
      const auto hello = fb::CreateHello(a, 2, true, 0, 0, &speeds, 0, 0, at(3));
      EXPECT_NE(
          error_of(a, fb::CreateEnvelope(a, nullptr, 0, nullptr, nullptr, hello)).find("speeds"),
          std::string::npos);
      const fb::Pace pace(1, speeds, at(3));
      EXPECT_NE(
          error_of(b, fb::CreateEnvelope(b, nullptr, 0, nullptr, nullptr, 0, 0, 0, nullptr, &pace))
              .find("speeds"),
          std::string::npos);
    }
  }
}

// A writer in another language may put tables and vectors in any order.
TEST(WireEnvelope, MustBringKnownEditsAndNotTooMany) {
  const auto edit_of = [](std::size_t count, std::uint8_t kind) {
    FlatBufferBuilder b;
    const std::vector<fb::Change> changes(count,
                                          fb::Change(fb::Vec3(0, 0, 0), 0, 0, 0, 1, 0, 0, kind));
    const auto edit = fb::CreateEdit(b, 1, 2, b.CreateVectorOfStructs(changes));
    fb::EnvelopeBuilder e(b);
    e.add_edit(edit);
    return error_of(b, e.Finish());
  };
  EXPECT_EQ(edit_of(1, 1), "no error");
  EXPECT_EQ(edit_of(kMaxEdits, 5), "no error");
  EXPECT_EQ(edit_of(0, 1), "edit: 0 edits, expected 1 to 1024");
  EXPECT_EQ(edit_of(kMaxEdits + 1, 1), "edit: 1025 edits, expected 1 to 1024");
  EXPECT_EQ(edit_of(1, 0), "edit: unknown kind 0");
  EXPECT_EQ(edit_of(1, 6), "edit: unknown kind 6");
}

TEST(WireEnvelope, MustHoldChangesOnlyWithAPvsAndKnownFlags) {
  const auto changes_with = [](bool pvs, std::uint8_t flags) {
    FlatBufferBuilder b;
    const std::vector<fb::Change> objects(1,
                                          fb::Change(fb::Vec3(0, 0, 0), 0, 0, 0, 1, 0, 0, flags));
    const auto changes = fb::CreateChanges(b, 1, 0, 0, b.CreateVectorOfStructs(objects));
    fb::EnvelopeBuilder e(b);
    e.add_changes(changes);
    if (pvs)
      e.add_pvs(&kPvs);
    else
      e.add_pose(&kPose);
    return error_of(b, e.Finish());
  };
  EXPECT_EQ(changes_with(true, 7), "no error");
  EXPECT_EQ(changes_with(true, 8), "changes: unknown flags 8");
  EXPECT_EQ(changes_with(false, 0), "message: a payload, centre or changes without a pvs");
}

TEST(WireEnvelope, MayBeLaidOutInAnotherOrder) {
  FlatBufferBuilder b;
  b.ForceDefaults(true);
  const auto method = b.CreateString("m");
  const auto reaches =
      b.CreateVector(std::vector{b.CreateString("ball:1"), b.CreateString("ball:2")});
  fb::WelcomeBuilder w(b);
  w.add_method(method);
  w.add_objects(0);
  w.add_session(9);
  w.add_reaches(reaches);
  w.add_version(1);
  const auto welcome = w.Finish();
  b.FinishSizePrefixed(fb::CreateEnvelope(b, nullptr, 0, nullptr, nullptr, 0, welcome));
  const auto m = decode({reinterpret_cast<const std::byte*>(b.GetBufferPointer()), b.GetSize()});
  ASSERT_TRUE(m) << m.error().message;
  EXPECT_EQ(std::get<Welcome>(*m), (Welcome{1, 9, 0, 0, 0, {"ball:1", "ball:2"}, "m", {}}));
}

}  // namespace
}  // namespace ivis::wire
