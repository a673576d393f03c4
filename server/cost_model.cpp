#include "server/cost_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace ivis::server {
namespace {

constexpr std::size_t kPlaces = 24;
constexpr int kTries = 400;
constexpr int kRepeats = 3;

double solve_ms(const Method& method, const ViewCell& cell, const Effort& effort, Work& done) {
  const auto start = std::chrono::steady_clock::now();
  const auto pvs = method.solve(cell, effort, done);
  const auto took = std::chrono::steady_clock::now() - start;
  const bool counts = pvs && pvs->everything_because.empty();
  return counts ? std::chrono::duration<double, std::milli>(took).count() : -1;
}

/// The part for drawing with which a tight budget lists least: the less is drawn, the more is left
/// to test.
double best_share(const Method& method, const std::vector<ViewCell>& cells, CostModel model,
                  double budget_ms) {
  double best = model.draw_share;
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (const double share : {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7}) {
    model.draw_share = share;
    const Effort effort = model.effort(Strategy::kAbort, model.fixed_ms + budget_ms);
    std::size_t listed = 0;
    for (const ViewCell& cell : cells) {
      Work done;
      const auto pvs = method.solve(cell, effort, done);
      if (pvs) listed += pvs->objects.size();
    }
    if (listed < least) {
      least = listed;
      best = share;
    }
  }
  return best;
}

}  // namespace

/// Least squares of ms = a draw + b test + c with none negative: what comes out negative is left
/// out and the rest fitted again.
CostModel fit(const std::vector<CostSample>& samples) {
  bool use[3] = {true, true, true};
  double x[3] = {0, 0, 0};
  for (int round = 0; round < 3; ++round) {
    double m[3][4] = {};
    for (const CostSample& s : samples) {
      const double row[3] = {s.draw, s.test, 1};
      // Relative errors: a long solve does not outweigh the short ones that budgets are for.
      const double weight = 1 / std::max(s.ms * s.ms, 1e-6);
      for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k)
          m[i][k] += use[i] && use[k] ? weight * row[i] * row[k] : 0;
        m[i][3] += use[i] ? weight * row[i] * s.ms : 0;
        if (!use[i]) m[i][i] = 1;
      }
    }
    for (int i = 0; i < 3; ++i) {  // Gauss; the matrix is symmetric and not negative
      if (std::abs(m[i][i]) < 1e-12) m[i][i] = 1e-12;
      for (int r = 0; r < 3; ++r) {
        if (r == i) continue;
        const double f = m[r][i] / m[i][i];
        for (int k = i; k < 4; ++k)
          m[r][k] -= f * m[i][k];
      }
    }
    bool good = true;
    for (int i = 0; i < 3; ++i) {
      x[i] = use[i] ? m[i][3] / m[i][i] : 0;
      if (x[i] < 0) {
        use[i] = false;
        x[i] = 0;
        good = false;
      }
    }
    if (good) break;
  }
  CostModel model;
  model.draw_ms = x[0];
  model.test_ms = x[1];
  model.fixed_ms = x[2];
  return model;
}

double CostModel::predict_ms(const Work& work) const {
  return fixed_ms + draw_ms * static_cast<double>(work.draw) +
         test_ms * static_cast<double>(work.test);
}

Effort CostModel::effort(Strategy strategy, double budget_ms) const {
  Effort e;
  e.strategy = strategy;
  if (strategy == Strategy::kGuaranteed) return e;
  const double left = std::max(budget_ms - fixed_ms, 0.0);
  const auto units = [](double ms, double each) {
    return each > 0 ? static_cast<std::uint64_t>(std::min(ms / each, 1e15)) : Effort::kUnbounded;
  };
  e.draw_in_full = draw_in_full;
  e.draw = units(left * draw_share, draw_ms);
  e.test = units(left * (1 - draw_share), test_ms);
  return e;
}

CostModel calibrate(const Method& method, const Scene& scene, const Reach& reach,
                    const std::atomic<bool>* stop) {
  if (!method.keeps_to_effort() || scene.objects.empty()) return {};
  std::mt19937 random(1);
  const auto end = std::chrono::steady_clock::now() + kMostCalibrating;
  const auto over = [&] {
    return (stop != nullptr && stop->load()) || std::chrono::steady_clock::now() >= end;
  };
  std::vector<CostSample> samples;
  double draw = 0;
  double test = 0;
  std::vector<ViewCell> cells;
  for (int i = 0; i < kTries && cells.size() < kPlaces && !over(); ++i) {
    // Beside an object and a man's height above its foot: where observers may well be.
    const Aabb& box = scene.objects[random() % scene.objects.size()].bounds;
    if (box.empty()) continue;
    const double side = random() % 2 == 0 ? -2 : 2;
    const bool along_x = random() % 2 == 0;
    const Vec3 middle = box.centre();
    const Vec3 eye{along_x ? (side < 0 ? box.lo.x : box.hi.x) + side : middle.x, box.lo.y + 1.7,
                   along_x ? middle.z : (side < 0 ? box.lo.z : box.hi.z) + side};
    const ViewCell cell{eye, reach};
    Work full;
    // Bounded, if far away: as budgets are spent, on one thread.
    const Effort in_full{Strategy::kAbort, Effort::kUnbounded, Effort::kUnbounded - 1};
    if (solve_ms(method, cell, in_full, full) < 0) continue;
    cells.push_back(cell);
    for (const double part : {1.0, 0.3, 0.05}) {
      Effort effort = in_full;
      if (part < 1) effort.draw = static_cast<std::uint64_t>(part * static_cast<double>(full.draw));
      Work work;
      double least = -1;
      for (int r = 0; r < kRepeats && !over(); ++r) {
        const double ms = solve_ms(method, cell, effort, work);
        if (ms >= 0 && (least < 0 || ms < least)) least = ms;
      }
      if (least < 0) continue;
      samples.push_back({static_cast<double>(work.draw), static_cast<double>(work.test), least});
      if (part == 1) {
        draw += static_cast<double>(work.draw);
        test += static_cast<double>(work.test);
      }
    }
  }
  if (samples.size() < kLeastSamples) return {};
  const auto places = static_cast<double>(cells.size());
  CostModel model = fit(samples);
  const double spent = model.draw_ms * draw + model.test_ms * test;
  model.draw_in_full = static_cast<std::uint64_t>(draw / places);
  if (spent > 0) model.draw_share = best_share(method, cells, model, 0.6 * spent / places);
  return model;
}

}  // namespace ivis::server
