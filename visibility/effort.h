#pragma once

#include <cstdint>
#include <limits>

#include "core/strategy.h"

namespace ivis {

/// What one solve may do, in units of work, so that its result does not depend on a clock. Ignored
/// by kGuaranteed.
struct Effort {
  static constexpr std::uint64_t kUnbounded = std::numeric_limits<std::uint64_t>::max();
  Strategy strategy = Strategy::kGuaranteed;
  /// A solve goes over it by less than one occluder and one node of a tree. Terrain, which is drawn
  /// whole and first, and the listing of what shows are not counted.
  std::uint64_t draw = kUnbounded;
  std::uint64_t test = kUnbounded;
  /// For kPredictive: what drawing without a budget takes, by which it judges how much to choose;
  /// 0: not known, all are chosen.
  std::uint64_t draw_in_full = 0;
};

/// What it did.
struct Work {
  std::uint64_t draw = 0;  ///< walls, sixteenths of the bins written, and twice the nodes searched
  std::uint64_t test = 0;  ///< nodes tested
  bool cut = false;        ///< something was left undrawn or untested
};

}  // namespace ivis
