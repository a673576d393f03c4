// The three strategies side by side (docs/real-time.md): size of the PVS and time of a solve at
// budgets from 0.05 ms up, along a path, on one thread.
//
//   strategy_bench SCENE.glb PATH.csv REACH [STRIDE] [PLOT.svg]
//
// Every 60th answer is checked with 64 rays a culled object.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "bench/common.h"
#include "core/path.h"
#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "scenes/load.h"
#include "server/cost_model.h"
#include "visibility/method.h"
#include "visibility/verify.h"

namespace {

using namespace ivis;
using bench::cpu_ms;
using bench::get;

double quantile(std::vector<double> v, double q) {
  const auto i = static_cast<std::ptrdiff_t>(q * static_cast<double>(v.size() - 1));
  std::nth_element(v.begin(), v.begin() + i, v.end());
  return v[static_cast<std::size_t>(i)];
}

struct Row {
  Strategy strategy;
  double budget_ms, p50_ms, p99_ms, pvs, cut;
  std::size_t misses;
};

Row run(const Method& method, const Verifier& verifier, const server::CostModel& cost,
        const std::vector<Pose>& path, std::size_t stride, const Reach& reach, Strategy strategy,
        double budget_ms) {
  const Effort effort = cost.effort(strategy, budget_ms);
  std::vector<double> ms;
  std::vector<double> sizes;
  Row row{strategy, budget_ms, 0, 0, 0, 0, 0};
  for (std::size_t i = 0, n = 0; i < path.size(); i += stride, ++n) {
    Work done;
    const double begin = cpu_ms();
    const Pvs pvs = get(method.solve({path[i].eye, reach}, effort, done));
    ms.push_back(cpu_ms() - begin);
    sizes.push_back(static_cast<double>(pvs.objects.size()));
    row.cut += done.cut ? 1 : 0;
    if (n % 60 == 0) row.misses += get(verifier.check(pvs, {})).false_negatives;
  }
  row.p50_ms = quantile(ms, 0.5);
  row.p99_ms = quantile(ms, 0.99);
  row.pvs = quantile(sizes, 0.5);
  row.cut /= static_cast<double>(sizes.size());
  return row;
}

/// PVS over the budget, both logarithmic; the guaranteed strategy is a line across.
void plot(const std::vector<Row>& rows, double objects, const char* file) {
  std::ofstream out(file);
  const double full = rows.front().pvs;
  const double x0 = 70, x1 = 620, y0 = 330, y1 = 30;
  const double low = std::log(0.04), high = std::log(2.0);
  const auto x = [&](double ms) { return x0 + (std::log(ms) - low) / (high - low) * (x1 - x0); };
  const auto y = [&](double pvs) {
    return y0 - std::log(pvs / (full * 0.7)) / std::log(objects * 1.3 / (full * 0.7)) * (y0 - y1);
  };
  out << "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 660 380' font-family='sans-serif' "
         "font-size='13'><rect width='660' height='380' fill='white'/>\n";
  const auto text = [&](double at_x, double at_y, const char* anchor, const std::string& what) {
    out << "<text x='" << at_x << "' y='" << at_y << "' text-anchor='" << anchor << "'>" << what
        << "</text>\n";
  };
  for (const double ms : {0.05, 0.1, 0.2, 0.4, 0.8, 1.6}) {
    out << "<line x1='" << x(ms) << "' x2='" << x(ms) << "' y1='" << y0 << "' y2='" << y1
        << "' stroke='#ddd'/>\n";
    char label[16];
    std::snprintf(label, sizeof label, "%g", ms);
    text(x(ms), y0 + 18, "middle", label);
  }
  for (double pvs = 1000; pvs <= objects; pvs *= std::sqrt(10.0)) {
    if (y(pvs) > y0) continue;
    out << "<line x1='" << x0 << "' x2='" << x1 << "' y1='" << y(pvs) << "' y2='" << y(pvs)
        << "' stroke='#ddd'/>\n";
    text(x0 - 6, y(pvs) + 4, "end", std::to_string(std::lround(pvs)));
  }
  text((x0 + x1) / 2, 372, "middle", "budget of a solve, ms");
  text(x0, 20, "start", "objects listed, median");
  out << "<line x1='" << x0 << "' x2='" << x1 << "' y1='" << y(full) << "' y2='" << y(full)
      << "' stroke='#2a7' stroke-dasharray='6 4' stroke-width='2'/>\n";
  text(x1, y(full) - 8, "end", "guaranteed");
  const char* colours[] = {"#2a7", "#c33", "#24c"};
  for (const Strategy s : {Strategy::kAbort, Strategy::kPredictive}) {
    const char* colour = colours[static_cast<int>(s)];
    std::string points;
    for (const Row& r : rows)
      if (r.strategy == s)
        points += std::to_string(x(r.budget_ms)) + "," + std::to_string(y(r.pvs)) + " ";
    out << "<polyline points='" << points << "' fill='none' stroke='" << colour
        << "' stroke-width='2'/>\n";
    for (const Row& r : rows)
      if (r.strategy == s)
        out << "<circle cx='" << x(r.budget_ms) << "' cy='" << y(r.pvs) << "' r='4' fill='"
            << colour << "'/>\n";
    const double at = 50 + 20 * static_cast<double>(s);
    out << "<circle cx='" << x1 - 96 << "' cy='" << at - 5 << "' r='4' fill='" << colour << "'/>\n";
    text(x1 - 84, at, "start", to_string(s));
  }
  out << "</svg>\n";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "strategy_bench SCENE.glb PATH.csv REACH [STRIDE] [PLOT.svg]\n");
    return 2;
  }
  const Scene scene = get(load_scene(argv[1]));
  const std::vector<Pose> path = get(read_path(argv[2]));
  const Reach reach = get(Reach::parse(argv[3]));
  const std::size_t stride = argc > 4 ? std::max(1, std::atoi(argv[4])) : 5;
  ShrinkOptions options;
  options.reach = reach;
  options.margins = false;
  const OccluderSet set = get(shrink(scene, options, FastEroder{})).set;
  const auto method = get(make_method("cull-map", scene, set));
  const Verifier verifier(scene, &set);
  const server::CostModel cost = server::calibrate(*method, scene, reach);
  std::printf(
      "model: %.3f ms + %.1f ns a unit drawn + %.1f ns a node tested; %.0f %% for drawing\n\n",
      cost.fixed_ms, 1e6 * cost.draw_ms, 1e6 * cost.test_ms, 100 * cost.draw_share);
  std::printf(
      "| strategy | budget, ms | time p50, ms | p99, ms | PVS | cut | missed |\n"
      "|---|---|---|---|---|---|---|\n");
  std::vector<Row> rows;
  const auto add = [&](Strategy s, double budget_ms) {
    rows.push_back(run(*method, verifier, cost, path, stride, reach, s, budget_ms));
    const Row& r = rows.back();
    std::printf("| %s | %s | %.3f | %.3f | %.0f | %.0f %% | %zu |\n", to_string(s),
                s == Strategy::kGuaranteed ? "-" : std::to_string(budget_ms).substr(0, 4).c_str(),
                r.p50_ms, r.p99_ms, r.pvs, 100 * r.cut, r.misses);
    std::fflush(stdout);
  };
  add(Strategy::kGuaranteed, 0);
  for (const double budget_ms : {0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.8, 1.6})
    for (const Strategy s : {Strategy::kAbort, Strategy::kPredictive})
      add(s, budget_ms);
  if (argc > 5) plot(rows, static_cast<double>(scene.objects.size()), argv[5]);
  for (const Row& r : rows)
    if (r.misses > 0) return 1;
}
