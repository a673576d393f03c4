#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "client_lib/source.h"

namespace ivis::client {

/// Keeps objects drawn for some frames after they left the set, so that one that comes and goes
/// does not flicker or load its data anew. The drawn set only grows by it. Threads: a value. Cost:
/// O(words) a new set, nothing else while none leaves.
class Lingering {
 public:
  explicit Lingering(std::uint32_t frames = 0) : frames_(frames) {}
  bool active() const { return frames_ > 0; }

  /// The set to draw at the next frame, given the PVS in use; `fresh`: it is another than before.
  const IdBits& draw(const IdBits& pvs, bool fresh);
  /// Of what draw() returned last.
  std::uint32_t count() const { return count_; }

 private:
  struct Leaving {
    std::uint64_t until;  ///< the first frame without
    IdBits bits;
  };
  std::uint32_t frames_;
  std::uint64_t frame_ = 0;
  IdBits pvs_, drawn_;
  std::deque<Leaving> leaving_;  ///< ascending until
  std::uint32_t count_ = 0;
};

}  // namespace ivis::client
