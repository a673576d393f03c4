#include "server/cost_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <vector>

namespace ivis::server {
namespace {

constexpr int kPlaces = 24;
constexpr int kTries = 400;
constexpr int kRepeats = 3;

struct Sample {
  double draw, test, ms;
};

double solve_ms(const Method& method, const ViewCell& cell, const Effort& effort, Work& done) {
  const auto start = std::chrono::steady_clock::now();
  const auto pvs = method.solve(cell, effort, done);
  const auto took = std::chrono::steady_clock::now() - start;
  const bool counts = pvs && pvs->everything_because.empty();
  return counts ? std::chrono::duration<double, std::milli>(took).count() : -1;
}

/// Least squares of ms = a draw + b test + c with none negative: what comes out negative is left
/// out and the rest fitted again.
CostModel fit(const std::vector<Sample>& samples) {
  bool use[3] = {true, true, true};
  double x[3] = {0, 0, 0};
  for (int round = 0; round < 3; ++round) {
    double m[3][4] = {};
    for (const Sample& s : samples) {
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

}  // namespace

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
  e.draw = units(left * draw_share, draw_ms);
  e.test = units(left * (1 - draw_share), test_ms);
  return e;
}

CostModel calibrate(const Method& method, const Scene& scene, const Reach& reach,
                    const std::atomic<bool>* stop) {
  if (!method.keeps_to_effort() || scene.bounds.empty()) return {};
  std::mt19937 random(1);
  const auto within = [&](double lo, double hi) {
    return lo + (hi - lo) * (static_cast<double>(random()) / 4294967296.0);
  };
  std::vector<Sample> samples;
  double draw = 0;
  double test = 0;
  int places = 0;
  for (int i = 0; i < kTries && places < kPlaces; ++i) {
    if (stop != nullptr && stop->load()) break;
    const Aabb& b = scene.bounds;
    // A man's height above the least ground: where most observers are.
    const Vec3 eye{within(b.lo.x, b.hi.x), b.lo.y + std::min(1.7, b.size().y / 2),
                   within(b.lo.z, b.hi.z)};
    const ViewCell cell{eye, reach};
    Work full;
    if (solve_ms(method, cell, {}, full) < 0) continue;
    ++places;
    for (const double part : {1.0, 0.3, 0.05}) {
      Effort effort{Strategy::kAbort,
                    static_cast<std::uint64_t>(part * static_cast<double>(full.draw)),
                    Effort::kUnbounded};
      if (part == 1) effort = {};
      Work work;
      double least = -1;
      for (int r = 0; r < kRepeats; ++r) {
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
  if (samples.size() < 6) return {};
  CostModel model = fit(samples);
  const double spent = model.draw_ms * draw + model.test_ms * test;
  if (spent > 0) model.draw_share = model.draw_ms * draw / spent;
  return model;
}

}  // namespace ivis::server
