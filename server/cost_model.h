#pragma once

#include <atomic>

#include "scenes/scene.h"
#include "visibility/method.h"

namespace ivis::server {

/// What a solve costs on this machine, so that a budget in milliseconds becomes one of work: after
/// that nothing depends on a clock. Threads: a value.
struct CostModel {
  double fixed_ms = 0;
  double draw_ms = 0;       ///< a unit of Work::draw
  double test_ms = 0;       ///< a unit of Work::test
  double draw_share = 0.5;  ///< of what is not fixed, as solves without a budget spend it

  double predict_ms(const Work& work) const;
  /// A solve of this strategy that takes about `budget_ms`; testing has its own part. A budget
  /// below what is fixed leaves no work: everything is listed.
  Effort effort(Strategy strategy, double budget_ms) const;
};

/// Solves at some places of the scene, in full and with less, and fits the model to the least times
/// taken. Cost: some hundred solves. A method that keeps to no effort gets a model without a part.
CostModel calibrate(const Method& method, const Scene& scene, const Reach& reach,
                    const std::atomic<bool>* stop = nullptr);

}  // namespace ivis::server
