#include "server/cost_model.h"

#include <gtest/gtest.h>

#include "tests/server/fake_method.h"

namespace ivis::test {
namespace {

using server::CostModel;
using server::CostSample;
using server::fit;

std::vector<CostSample> linear(double draw_ms, double test_ms, double fixed_ms) {
  std::vector<CostSample> samples;
  for (const double draw : {10.0, 100.0, 400.0, 2000.0})
    for (const double test : {5.0, 300.0, 40.0})
      samples.push_back({draw, test, draw * draw_ms + test * test_ms + fixed_ms});
  return samples;
}

TEST(CostModelFit, RecoversWhatTheCostsAre) {
  const CostModel m = fit(linear(0.0004, 0.001, 0.02));
  EXPECT_NEAR(m.draw_ms, 0.0004, 1e-8);
  EXPECT_NEAR(m.test_ms, 0.001, 1e-8);
  EXPECT_NEAR(m.fixed_ms, 0.02, 1e-6);
  EXPECT_NEAR(m.predict_ms({100, 50, false}), 0.04 + 0.05 + 0.02, 1e-6);
}

TEST(CostModelFit, NoCostIsNegative) {
  const CostModel m = fit(linear(0.0004, 0.001, -0.003));
  EXPECT_EQ(m.fixed_ms, 0);
  EXPECT_GT(m.draw_ms, 0);
  EXPECT_GT(m.test_ms, 0);
  // Drawing and testing in a fixed proportion cannot be told apart.
  std::vector<CostSample> one_line;
  for (const double n : {1.0, 2.0, 5.0, 9.0, 20.0, 50.0})
    one_line.push_back({10 * n, n, 0.01 * n});
  const CostModel c = fit(one_line);
  EXPECT_GE(c.draw_ms, 0);
  EXPECT_GE(c.test_ms, 0);
  EXPECT_NEAR(c.predict_ms({100, 10, false}), 0.1, 0.001);
}

TEST(CostModelEffort, DividesWhatIsLeftOfTheBudget) {
  CostModel m;
  m.fixed_ms = 0.1;
  m.draw_ms = 0.001;
  m.test_ms = 0.002;
  m.draw_share = 0.4;
  m.draw_in_full = 700;
  const Effort e = m.effort(Strategy::kPredictive, 0.6);
  EXPECT_EQ(e.strategy, Strategy::kPredictive);
  EXPECT_EQ(e.draw, 200U);
  EXPECT_EQ(e.test, 150U);
  EXPECT_EQ(e.draw_in_full, 700U);
  EXPECT_EQ(m.effort(Strategy::kAbort, 0.05).draw, 0U);
  EXPECT_EQ(m.effort(Strategy::kAbort, 0.05).test, 0U);
  EXPECT_EQ(m.effort(Strategy::kGuaranteed, 0.05).test, Effort::kUnbounded);
  EXPECT_EQ(CostModel{}.effort(Strategy::kAbort, 1).draw, Effort::kUnbounded);
}

TEST(CostModelCalibrate, TakesMethodsWithBudgetsOnlyAndEndsWhenTold) {
  struct Budgeted : NearMethod {
    using NearMethod::NearMethod;
    using NearMethod::solve;
    Result<Pvs> solve(const ViewCell& cell, const Effort& effort, Work& done) const override {
      ++asked;
      if (stop_after > 0 && asked >= stop_after) stop = true;
      done = {std::min<std::uint64_t>(effort.draw, 100 + static_cast<std::uint64_t>(asked)), 50,
              false};
      return NearMethod::solve(cell);
    }
    bool keeps_to_effort() const override { return true; }
    mutable int asked = 0;
    int stop_after = 0;
    mutable std::atomic<bool> stop{false};
  };
  const Scene scene = grid_scene(6);
  const NearMethod plain(scene);
  EXPECT_EQ(server::calibrate(plain, scene, Reach::disc(1)).draw_in_full, Effort::kUnbounded);
  EXPECT_EQ(plain.solves, 0);
  Budgeted method(scene);
  const CostModel model = server::calibrate(method, scene, Reach::disc(1));
  EXPECT_GT(method.asked, 100);
  EXPECT_GE(model.draw_in_full, 100U);
  EXPECT_LT(model.draw_in_full, 2000U);
  Budgeted stopped(scene);
  stopped.stop_after = 5;
  static_cast<void>(server::calibrate(stopped, scene, Reach::disc(1), &stopped.stop));
  EXPECT_LE(stopped.asked, 5);
}

}  // namespace
}  // namespace ivis::test
