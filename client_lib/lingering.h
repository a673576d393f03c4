#pragma once

#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "client_lib/source.h"

namespace ivis::client {

/// Keeps objects drawn for some frames after they left the set, so that one that comes and goes
/// does not flicker or load its data anew. The drawn set only grows by it. Threads: a value. Cost:
/// O(words) a new set, and what leaves; nothing else while none leaves.
class Lingering {
 public:
  explicit Lingering(std::uint32_t frames = 0) : frames_(frames) {}
  bool active() const { return frames_ > 0; }

  /// The set to draw at the next frame, given the PVS in use; `fresh`: it is another than before.
  const IdBits& draw(const IdBits& pvs, bool fresh);
  /// Of what draw() returned last.
  std::uint32_t count() const { return count_; }

 private:
  std::uint32_t frames_;
  std::uint64_t frame_ = 0;
  IdBits pvs_, drawn_;
  std::vector<std::uint64_t> until_;  ///< by id: the first frame without; 0: does not linger
  std::deque<std::pair<std::uint64_t, ObjectId>> leaving_;  ///< ascending frame; may be out of date
  std::uint32_t count_ = 0;
};

}  // namespace ivis::client
