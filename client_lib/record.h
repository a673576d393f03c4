#pragma once
// What a walk was told, kept for `ivis verify --record`.
//
// Text, a line each, numbers in the shortest form that reads back to the same bits:
//   ivis-record 1
//   scene <hash, 16 hex digits>
//   reach <reach of every cell, e.g. disc:1>
//   objects <N>
//   frame <cell x> <y> <z> <eye x> <y> <z> covered|uncovered everything
//   frame <cell x> <y> <z> <eye x> <y> <z> covered|uncovered <count> <first id> <gap> <gap> ...
// A gap is the difference to the id before it. `eye` is where the renderer drew from.

#include <filesystem>
#include <string>
#include <vector>

#include "core/pvs.h"
#include "core/result.h"

namespace ivis::client {

/// One frame of a walk.
struct RecordedFrame {
  Vec3 eye{0};  ///< drawn from; in pvs.cell when covered
  bool covered = false;
  bool everything =
      false;  ///< every object was visible; pvs.objects is then empty, unlike elsewhere
  Pvs pvs;    ///< with its cell and the scene's hash
};

struct Record {
  SceneHash scene_hash = 0;
  Reach reach;
  std::uint32_t objects = 0;
  std::vector<RecordedFrame> frames;
};

std::string encode_record(const Record& record);
/// Untrusted text. Errors: kInput naming `name`, line, what was found and expected; a covered frame
/// whose eye is outside its cell is one of them. Memory: a small multiple of the text.
Result<Record> decode_record(std::string_view text, const std::string& name);

/// The file appears whole or not at all. Errors: kIo.
Status write_record(const std::filesystem::path& file, const Record& record);
/// Errors: kIo, and those of decode_record.
Result<Record> read_record(const std::filesystem::path& file);

}  // namespace ivis::client
