#pragma once

#include <cstdint>
#include <deque>
#include <utility>

#include "wire/pvs_codec.h"

namespace ivis::client {

/// The decoded sets that the server may still name as a base.
/// A server answers poses in order, each against the set that pose acknowledged, and acknowledged
/// sequences ascend: so once a base has been named, all before it are of no more use.
class PvsHistory {
 public:
  static constexpr std::size_t kMost = 64;

  void clear() { kept_.clear(); }
  /// What the next pose acknowledges; 0: nothing.
  std::uint32_t newest() const { return kept_.empty() ? 0 : kept_.back().first; }
  /// Null if it is not here. Forgets what is older.
  const wire::PvsState* base(std::uint32_t sequence) {
    std::size_t i = 0;
    while (i < kept_.size() && kept_[i].first != sequence)
      ++i;
    if (i == kept_.size()) return nullptr;
    kept_.erase(kept_.begin(), kept_.begin() + static_cast<std::ptrdiff_t>(i));
    return &kept_.front().second;
  }
  void add(std::uint32_t sequence, wire::PvsState state) {
    if (kept_.size() == kMost) kept_.pop_front();
    kept_.emplace_back(sequence, std::move(state));
  }

 private:
  std::deque<std::pair<std::uint32_t, wire::PvsState>> kept_;  ///< ascending sequence
};

}  // namespace ivis::client
