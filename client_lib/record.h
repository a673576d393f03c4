#pragma once
// What a walk was told and drew, kept for `ivis verify --record` and `ivis replay`.
//
// Text, a line each, numbers in the shortest form that reads back to the same bits:
//   ivis-record 3
//   scene <hash, 16 hex digits>
//   reach <the largest reach that cells may have, e.g. disc:1>
//   objects <N>
//   frame <time> <sequence> <cell x> <y> <z> <cell's reach> <wanted x> <y> <z> <eye x> <y> <z>
//         covered|uncovered <cause> everything
//   frame ... covered|uncovered <cause> <count> <first id> <gap> <gap> ...
//   object <id> <flags: 1 removed, 2 occluder off, 4 moved> [<x> <y> <z> <qx> <qy> <qz> <qw>]
// (a frame is one line; the placement of an object is there when it was moved). Objects that
// changed come before the frame that first shows them so. The ids are those whose visibility
// differs from the last frame that listed any, at first from nothing; a gap is the difference to
// the id before it.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/edit.h"
#include "core/pvs.h"
#include "core/result.h"

namespace ivis::client {

/// One frame of a walk.
struct RecordedFrame {
  double time_s = 0;           ///< since the first frame
  std::uint32_t sequence = 0;  ///< of the pose whose PVS was in use; 0: none
  ViewCell cell;               ///< of that PVS
  Vec3 wanted{0};              ///< where the observer meant to be
  Vec3 eye{0};                 ///< drawn from; in `cell` when covered, but for an everything
  bool covered = false;
  bool everything = false;           ///< every object was visible
  std::uint8_t cause = 0;            ///< ivis_cause: why `wanted` was outside the cell
  std::vector<ObjectId> changed;     ///< ascending; empty when everything
  std::vector<ObjectState> edits{};  ///< of the scene since the frame before; speeds are not kept
};

/// `frames[i].changed` is against the frames before: a Recorder writes and RecordedSets reads them.
struct Record {
  SceneHash scene_hash = 0;
  Reach reach;
  std::uint32_t objects = 0;
  std::vector<RecordedFrame> frames;
};

/// Fills a record frame by frame. Ownership: borrows it.
class Recorder {
 public:
  explicit Recorder(Record& record) : record_(record) {}
  /// `visible`: bits by id, as many words as the objects take; ignored when everything is.
  void add(RecordedFrame frame, std::span<const std::uint64_t> visible);

 private:
  Record& record_;
  std::vector<std::uint64_t> last_;
};

/// The sets of a record, first to last. Ownership: borrows it.
class RecordedSets {
 public:
  explicit RecordedSets(const Record& record);
  /// The PVS in use at a frame, not before the one asked for last: of an everything all objects.
  Pvs at(std::size_t frame);

 private:
  const Record& record_;
  std::size_t next_ = 0;
  std::vector<bool> visible_;
};

std::string encode_record(const Record& record);
/// Untrusted text. Errors: kInput naming `name`, line, what was found and expected; a covered frame
/// whose eye is outside its cell is one of them, and a cell larger than the record's reach.
/// Memory: a small multiple of the text.
Result<Record> decode_record(std::string_view text, const std::string& name);

/// The file appears whole or not at all. Errors: kIo.
Status write_record(const std::filesystem::path& file, const Record& record);
/// Errors: kIo, and those of decode_record.
Result<Record> read_record(const std::filesystem::path& file);

}  // namespace ivis::client
