#include "client_lib/record.h"

#include <filesystem>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace ivis::client {
namespace {

using ::testing::HasSubstr;

std::vector<std::uint64_t> bits(std::initializer_list<std::uint32_t> ids) {
  std::vector<std::uint64_t> out(4);
  for (const std::uint32_t id : ids)
    out[id / 64] |= std::uint64_t{1} << (id % 64);
  return out;
}

Record sample() {
  Record r;
  r.scene_hash = 0x0123456789abcdefULL;
  r.reach = Reach::disc(1);
  r.objects = 200;
  Recorder recorder(r);
  RecordedFrame f;
  f.cell = {{1.1, 1.7, -2.3}, Reach::disc(0.6)};
  f.eye = f.wanted = {1.6, 1.7, -2.3};
  f.time_s = 1.0 / 60;
  f.sequence = 7;
  f.covered = true;
  recorder.add(f, bits({0, 5, 6, 199}));
  recorder.add(f, bits({}));
  f.covered = false;
  f.eye = {1e9, 0.1, 1.0 / 3};
  f.wanted = {2e9, 0.1, 0};
  f.cause = 5;
  f.everything = true;
  recorder.add(f, {});
  f.everything = false;
  recorder.add(f, bits({5, 64}));
  return r;
}

void expect_same(const Record& a, const Record& b) {
  EXPECT_EQ(a.scene_hash, b.scene_hash);
  EXPECT_EQ(a.reach, b.reach);
  EXPECT_EQ(a.objects, b.objects);
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    EXPECT_EQ(a.frames[i].time_s, b.frames[i].time_s);
    EXPECT_EQ(a.frames[i].sequence, b.frames[i].sequence);
    EXPECT_EQ(a.frames[i].eye, b.frames[i].eye);
    EXPECT_EQ(a.frames[i].wanted, b.frames[i].wanted);
    EXPECT_EQ(a.frames[i].covered, b.frames[i].covered);
    EXPECT_EQ(a.frames[i].everything, b.frames[i].everything);
    EXPECT_EQ(a.frames[i].cause, b.frames[i].cause);
    EXPECT_EQ(a.frames[i].changed, b.frames[i].changed);
    EXPECT_EQ(a.frames[i].cell.eye, b.frames[i].cell.eye);
    EXPECT_EQ(a.frames[i].cell.reach, b.frames[i].cell.reach);
  }
}

TEST(Record, SetsAreThoseThatWereAdded) {
  const Record r = sample();
  RecordedSets sets(r);
  EXPECT_EQ(sets.at(0).objects, (std::vector<ObjectId>{0, 5, 6, 199}));
  EXPECT_EQ(sets.at(1).objects, std::vector<ObjectId>{});
  EXPECT_EQ(sets.at(2).objects.size(), 200U);
  EXPECT_FALSE(sets.at(2).everything_because.empty());
  EXPECT_EQ(sets.at(3).objects, (std::vector<ObjectId>{5, 64}));
  RecordedSets skipping(r);
  EXPECT_EQ(skipping.at(3).objects, (std::vector<ObjectId>{5, 64}));
}

TEST(Record, ReadsBackToTheLastBit) {
  const auto back = decode_record(encode_record(sample()), "r");
  ASSERT_TRUE(back) << back.error().message;
  expect_same(sample(), *back);
  const auto file = std::filesystem::path(::testing::TempDir()) / "ivis_record_test.txt";
  ASSERT_TRUE(write_record(file, sample()));
  const auto read = read_record(file);
  ASSERT_TRUE(read) << read.error().message;
  expect_same(sample(), *read);
  std::filesystem::remove(file);
}

TEST(Record, ErrorsNameFileLineFoundAndExpected) {
  const std::string head = "ivis-record 3\nscene 0123456789abcdef\nreach disc:1\nobjects 20\n";
  const auto error_of = [](const std::string& text) {
    const auto r = decode_record(text, "walk.rec");
    EXPECT_FALSE(r) << text;
    return r ? "" : r.error().message;
  };
  EXPECT_THAT(error_of("nonsense"),
              HasSubstr("'walk.rec' line 1: found 'nonsense', expected 'ivis-record 3'"));
  EXPECT_THAT(error_of("ivis-record 3\nscene 12\n"), HasSubstr("line 2"));
  EXPECT_THAT(error_of("ivis-record 3\nscene 0123456789abcdef\nreach disk:1\n"),
              HasSubstr("disk:1"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 nan covered 0 0"),
              HasSubstr("line 5: the eye: found 'nan'"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0"), HasSubstr("line 5"));
  EXPECT_THAT(error_of(head + "frame soon"), HasSubstr("the time: found 'soon'"));
  EXPECT_THAT(error_of(head + "frame 0 -1"), HasSubstr("the sequence: found '-1'"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:2"),
              HasSubstr("more than the record's disc:1"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 0 covered 300 0"),
              HasSubstr("the cause: found '300'"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 0 perhaps 0 0"),
              HasSubstr("found 'perhaps'"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 2 0 0 2 0 0 covered 0 1 3"),
              HasSubstr("outside its cell"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 0 covered 0 2 3 0"),
              HasSubstr("found '0' as id or gap"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 0 covered 0 2 3 17"),
              HasSubstr("found '17' as id or gap"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 0 covered 0 2 3 4294967295"),
              HasSubstr("as id or gap"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 0 covered 0 3 3 1"),
              HasSubstr("number of ids"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 0 covered 0 4000000000 3 1"),
              HasSubstr("number of ids"));
  EXPECT_THAT(error_of(head + "frame 0 1 0 0 0 disc:1 0 0 0 0 0 0 covered 0 1 3 1"),
              HasSubstr("after the last id"));
}

TEST(Record, DamagedTextNeverCrashes) {
  const std::string sound = encode_record(sample());
  std::mt19937 random(2);
  for (int i = 0; i < 20'000; ++i) {
    std::string text = sound;
    text[random() % text.size()] = static_cast<char>(random());
    if (i % 2 == 0) text.resize(random() % text.size());
    const auto r = decode_record(text, "r");
    if (!r) continue;
    for (const RecordedFrame& f : r->frames)
      for (const ObjectId id : f.changed)
        ASSERT_LT(id, r->objects);
  }
}

}  // namespace
}  // namespace ivis::client
