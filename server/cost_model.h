#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "scenes/scene.h"
#include "visibility/method.h"

namespace ivis::server {

/// What a solve costs on this machine, so that a budget in milliseconds becomes one of work: after
/// that nothing depends on a clock. Threads: a value.
struct CostModel {
  double fixed_ms = 0;
  double draw_ms = 0;       ///< a unit of Work::draw
  double test_ms = 0;       ///< a unit of Work::test
  double draw_share = 0.5;  ///< of what is not fixed: what lists least

  std::uint64_t draw_in_full =
      Effort::kUnbounded;  ///< Work::draw of a solve without a budget, mean

  double predict_ms(const Work& work) const;
  /// A solve of this strategy that takes about `budget_ms`; testing has its own part. A budget
  /// below what is fixed leaves no work: everything is listed.
  Effort effort(Strategy strategy, double budget_ms) const;
};

/// What a solve took.
struct CostSample {
  double draw = 0, test = 0, ms = 0;
};
/// Least squares of relative errors with no cost below 0. Fewer than kLeastSamples, or samples that
/// do not tell drawing from testing, may leave parts at 0. draw_share is left as it is.
CostModel fit(const std::vector<CostSample>& samples);
inline constexpr std::size_t kLeastSamples = 6;

/// Solves beside some objects of the scene, in full and with less, and fits the model to the least
/// times taken. Cost: some hundred solves, or kMostCalibrating. A method that keeps to no effort,
/// or a scene with too few places, gets a model without a part: budgets then bound nothing.
inline constexpr std::chrono::seconds kMostCalibrating{2};
CostModel calibrate(const Method& method, const Scene& scene, const Reach& reach,
                    const std::atomic<bool>* stop = nullptr);

}  // namespace ivis::server
