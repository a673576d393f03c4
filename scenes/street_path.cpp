#include "scenes/street_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <string>

#include "scenes/distance_steps.h"
#include "scenes/random.h"

namespace ivis {
namespace {

constexpr double kHalfDiagonal = 0.7072;  // of a cell of 1 m
constexpr double kMaxSide = 4096;

/// Cells of 1 m. A free cell lies wholly outside everything that must be kept clear of.
class FreeGrid {
 public:
  explicit FreeGrid(const StreetObstacles& o)
      : lo_(o.lo),
        nx_(static_cast<std::size_t>(o.hi.x - o.lo.x)),
        nz_(static_cast<std::size_t>(o.hi.y - o.lo.y)),
        free_(nx_ * nz_, 1) {}

  std::size_t nx() const { return nx_; }
  std::size_t nz() const { return nz_; }
  std::size_t size() const { return free_.size(); }
  bool free(std::size_t cell) const { return free_[cell] != 0; }
  void close(std::size_t cell) { free_[cell] = 0; }
  Vec2 centre(std::size_t cell) const {
    const std::size_t row = cell / nx_;
    const std::size_t column = cell % nx_;
    return lo_ + Vec2(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
  }
  bool free_at(const Vec2& p) const {
    const Vec2 q = glm::floor(p - lo_);
    if (q.x < 0 || q.y < 0 || q.x >= static_cast<double>(nx_) || q.y >= static_cast<double>(nz_))
      return false;
    return free(static_cast<std::size_t>(q.y) * nx_ + static_cast<std::size_t>(q.x));
  }
  /// Is every cell that the segment passes free?
  bool free_between(const Vec2& a, const Vec2& b) const {
    if (!free_at(a) || !free_at(b)) return false;
    std::vector<double> cuts{0, 1};  // where it passes from cell to cell
    for (int axis = 0; axis < 2; ++axis) {
      const double from = a[axis] - lo_[axis];
      const double to = b[axis] - lo_[axis];
      for (double line = std::ceil(std::min(from, to)); line < std::max(from, to); ++line)
        cuts.push_back((line - from) / (to - from));
    }
    std::sort(cuts.begin(), cuts.end());
    for (std::size_t i = 0; i + 1 < cuts.size(); ++i)
      if (!free_at(glm::mix(a, b, (cuts[i] + cuts[i + 1]) / 2))) return false;
    return true;
  }

  /// Closes the cells whose centre is within `r` of the segment. A cell with a point nearer than
  /// r - kHalfDiagonal has its centre nearer than r: so what stays free is clear by that much.
  void close_near(const Vec2& a, const Vec2& b, double r) {
    const Vec2 d = b - a;
    const double dd = glm::dot(d, d);
    each(glm::min(a, b) - r, glm::max(a, b) + r, [&](std::size_t cell) {
      const Vec2 p = centre(cell) - a;
      const double s = dd > 0 ? std::clamp(glm::dot(p, d) / dd, 0.0, 1.0) : 0.0;
      const Vec2 off = p - d * s;
      if (glm::dot(off, off) < r * r) close(cell);
    });
  }
  /// Closes the cells whose centre lies in the triangle.
  void close_inside(const std::array<Vec2, 3>& t) {
    const auto side = [](const Vec2& a, const Vec2& b, const Vec2& p) {
      return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
    };
    if (side(t[0], t[1], t[2]) == 0) return;
    each(glm::min(glm::min(t[0], t[1]), t[2]), glm::max(glm::max(t[0], t[1]), t[2]),
         [&](std::size_t cell) {
           const Vec2 p = centre(cell);
           const double u = side(t[0], t[1], p);
           const double v = side(t[1], t[2], p);
           const double w = side(t[2], t[0], p);
           if ((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0)) close(cell);
         });
  }

 private:
  template <class F>
  void each(const Vec2& from, const Vec2& to, const F& f) {
    const Vec2 a = glm::max(glm::floor(from - lo_), Vec2(0));
    const Vec2 b = glm::min(glm::floor(to - lo_),
                            Vec2(static_cast<double>(nx_), static_cast<double>(nz_)) - 1.0);
    if (a.x > b.x || a.y > b.y) return;
    for (auto k = static_cast<std::size_t>(a.y); k <= static_cast<std::size_t>(b.y); ++k)
      for (auto i = static_cast<std::size_t>(a.x); i <= static_cast<std::size_t>(b.x); ++i)
        f(k * nx_ + i);
  }

  Vec2 lo_;
  std::size_t nx_, nz_;
  std::vector<std::uint8_t> free_;
};

/// Closes all but the largest connected piece; gives its size.
std::size_t keep_largest(FreeGrid& grid) {
  std::vector<std::uint32_t> label(grid.size(), 0);
  std::vector<std::size_t> stack;
  std::uint32_t labels = 0;
  std::uint32_t best = 0;
  std::size_t best_size = 0;
  const std::size_t nx = grid.nx();
  for (std::size_t seed = 0; seed < grid.size(); ++seed) {
    if (!grid.free(seed) || label[seed] != 0) continue;
    ++labels;
    std::size_t size = 0;
    label[seed] = labels;
    stack.push_back(seed);
    while (!stack.empty()) {
      const std::size_t cell = stack.back();
      stack.pop_back();
      ++size;
      const auto visit = [&](std::size_t next) {
        if (!grid.free(next) || label[next] != 0) return;
        label[next] = labels;
        stack.push_back(next);
      };
      if (cell % nx > 0) visit(cell - 1);
      if (cell % nx + 1 < nx) visit(cell + 1);
      if (cell >= nx) visit(cell - nx);
      if (cell + nx < grid.size()) visit(cell + nx);
    }
    if (size > best_size) {
      best_size = size;
      best = labels;
    }
  }
  for (std::size_t cell = 0; cell < grid.size(); ++cell)
    if (label[cell] != best) grid.close(cell);
  return best_size;
}

/// A* over the eight neighbours, without cutting corners; dear near walls. Keeps its tables between
/// calls.
class Router {
 public:
  Router(const FreeGrid& grid, const std::vector<std::uint8_t>& steps)
      : grid_(grid), steps_(steps), cost_(grid.size(), kFar), from_(grid.size(), 0) {}

  std::vector<std::size_t> route(std::size_t start, std::size_t goal) {
    for (const std::size_t cell : touched_)
      cost_[cell] = kFar;
    touched_.clear();
    using Entry = std::pair<float, std::size_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
    const auto reach = [&](std::size_t cell, std::size_t from, float cost) {
      if (cost >= cost_[cell]) return;
      if (cost_[cell] == kFar) touched_.push_back(cell);
      cost_[cell] = cost;
      from_[cell] = static_cast<std::uint32_t>(from);
      open.emplace(cost + static_cast<float>(glm::length(grid_.centre(goal) - grid_.centre(cell))),
                   cell);
    };
    reach(start, start, 0);
    const std::size_t nx = grid_.nx();
    while (!open.empty()) {
      const float estimate = open.top().first;
      const std::size_t cell = open.top().second;
      open.pop();
      if (cell == goal) break;
      const float left = static_cast<float>(glm::length(grid_.centre(goal) - grid_.centre(cell)));
      if (estimate > cost_[cell] + left) continue;
      const std::size_t i = cell % nx;
      const std::size_t k = cell / nx;
      for (int dk = -1; dk <= 1; ++dk) {
        for (int di = -1; di <= 1; ++di) {
          if ((di == 0 && dk == 0) || (i == 0 && di < 0) || (k == 0 && dk < 0) ||
              (i + 1 == nx && di > 0) || (k + 1 == grid_.nz() && dk > 0))
            continue;
          const auto at = [&](int a, int b) {
            return static_cast<std::size_t>(static_cast<std::ptrdiff_t>(cell) + a +
                                            b * static_cast<std::ptrdiff_t>(nx));
          };
          const std::size_t next = at(di, dk);
          if (!grid_.free(next) || !grid_.free(at(di, 0)) || !grid_.free(at(0, dk))) continue;
          const float length = di != 0 && dk != 0 ? 1.41421356F : 1.0F;
          const float dear =
              1.0F + 0.5F * static_cast<float>(std::max(0, 6 - static_cast<int>(steps_[next])));
          reach(next, cell, cost_[cell] + length * dear);
        }
      }
    }
    std::vector<std::size_t> path;
    if (cost_[goal] == kFar) return path;
    for (std::size_t cell = goal; cell != start; cell = from_[cell])
      path.push_back(cell);
    std::reverse(path.begin(), path.end());
    return path;
  }

 private:
  static constexpr float kFar = std::numeric_limits<float>::infinity();
  const FreeGrid& grid_;
  const std::vector<std::uint8_t>& steps_;
  std::vector<float> cost_;
  std::vector<std::uint32_t> from_;
  std::vector<std::size_t> touched_;
};

/// Rounds corners: each point moves to the mean of its neighbourhood where that keeps the line
/// free.
void smooth(std::vector<Vec2>& line, const FreeGrid& grid) {
  constexpr std::ptrdiff_t kHalfWindow = 4;
  const auto n = static_cast<std::ptrdiff_t>(line.size());
  for (int round = 0; round < 6; ++round) {
    for (std::ptrdiff_t i = 1; i + 1 < n; ++i) {
      const std::ptrdiff_t half = std::min({kHalfWindow, i, n - 1 - i});
      Vec2 mean(0);
      for (std::ptrdiff_t k = -half; k <= half; ++k)
        mean += line[static_cast<std::size_t>(i + k)];
      mean /= static_cast<double>(2 * half + 1);
      const auto at = static_cast<std::size_t>(i);
      if (grid.free_between(line[at - 1], mean) && grid.free_between(mean, line[at + 1]))
        line[at] = mean;
    }
  }
}

Status check(const StreetObstacles& o, const StreetPathOptions& options) {
  const Vec2 size = o.hi - o.lo;
  if (!(size.x >= 4 && size.y >= 4 && size.x <= kMaxSide && size.y <= kMaxSide))
    return invalid_argument("street path: the rectangle is " + std::to_string(size.x) + " m x " +
                            std::to_string(size.y) + " m, expected 4 m to 4096 m a side");
  if (options.poses < 2 || options.poses > 1'000'000 ||
      !(options.step_m > 0 && options.step_m < 100) || !(options.speed_m_s > 0) ||
      !(options.clearance_m >= 0 && options.clearance_m < 100))
    return invalid_argument(
        "street path: expected 2 to 1000000 poses, a step and a clearance below 100 m, a speed "
        "above 0");
  return ok();
}

}  // namespace

Result<std::vector<Pose>> street_path(const StreetObstacles& obstacles,
                                      const std::function<double(const Vec2&)>& ground,
                                      const StreetPathOptions& options, const Context& context) {
  if (auto s = check(obstacles, options); !s) return s.error();
  FreeGrid grid(obstacles);
  // Positions are written with four digits: a millimetre more pays for that.
  const double r = options.clearance_m + kHalfDiagonal + 0.001;
  for (const auto& t : obstacles.footprints) {
    grid.close_inside(t);
    for (std::size_t e = 0; e < 3; ++e)
      grid.close_near(t[e], t[(e + 1) % 3], r);
  }
  for (const auto& d : obstacles.discs)
    grid.close_near(d.centre, d.centre, d.radius + kHalfDiagonal);
  if (context.stopped()) return cancelled();

  if (keep_largest(grid) < 100)
    return invalid_argument("street path: no free place of 100 square metres that keeps " +
                            std::to_string(options.clearance_m) + " m from every building");
  const auto steps =
      distance_steps(grid.nx(), grid.nz(), [&](std::size_t c) { return !grid.free(c); });
  // Places in streets: not at a wall, with one in sight. If there are none (no buildings),
  // anywhere.
  std::vector<std::size_t> places;
  for (std::size_t cell = 0; cell < grid.size(); ++cell)
    if (grid.free(cell) && steps[cell] >= 2 && steps[cell] <= 10) places.push_back(cell);
  if (places.size() < 2) {
    places.clear();
    for (std::size_t cell = 0; cell < grid.size(); ++cell)
      if (grid.free(cell)) places.push_back(cell);
  }

  // Start near the middle; then on to places a few hundred metres away, rather ahead than back.
  const Vec2 middle = (obstacles.lo + obstacles.hi) * 0.5;
  const auto nearest =
      std::min_element(places.begin(), places.end(), [&](std::size_t a, std::size_t b) {
        return glm::length(grid.centre(a) - middle) < glm::length(grid.centre(b) - middle);
      });
  Random random(options.seed, 0x57a1);
  Router router(grid, steps);
  std::vector<Vec2> line{grid.centre(*nearest)};
  std::size_t here = *nearest;
  const double wanted = static_cast<double>(options.poses) * options.step_m * 1.15 + 10;
  double length = 0;
  while (length < wanted) {
    if (context.stopped()) return cancelled();
    context.report("street path", static_cast<std::size_t>(std::min(length, wanted)),
                   static_cast<std::size_t>(wanted));
    std::size_t goal = places[random.below(places.size())];
    double best = -std::numeric_limits<double>::infinity();
    for (int k = 0; k < 24; ++k) {
      const std::size_t place = places[random.below(places.size())];
      const Vec2 step = grid.centre(place) - grid.centre(here);
      const Vec2 past = grid.centre(here) - line[line.size() > 60 ? line.size() - 60 : 0];
      const double ahead = glm::length(past) > 0 && glm::length(step) > 0
                               ? glm::dot(step, past) / (glm::length(step) * glm::length(past))
                               : 0;
      const double score = -std::abs(glm::length(step) - 300) + 80 * ahead;
      if (score > best) {
        best = score;
        goal = place;
      }
    }
    if (goal == here) continue;
    const auto route = router.route(here, goal);
    for (const std::size_t cell : route) {
      length += glm::length(grid.centre(cell) - line.back());
      line.push_back(grid.centre(cell));
    }
    here = goal;
  }
  smooth(line, grid);

  // Poses at equal steps along the line.
  std::vector<Pose> poses;
  const auto at = [&](std::size_t& i, double& s, double step) {  // moves on by `step`
    while (i + 1 < line.size()) {
      const double left = glm::length(line[i + 1] - line[i]) - s;
      if (step < left) break;
      step -= left;
      s = 0;
      ++i;
    }
    if (i + 1 >= line.size()) return line.back();
    s += step;
    const Vec2 p = line[i] + (line[i + 1] - line[i]) * (s / glm::length(line[i + 1] - line[i]));
    // Rounding may put a point of a line along a border of cells on its other side.
    return grid.free_at(p) ? p : line[i];
  };
  std::size_t i = 0;
  double s = 0;
  std::vector<Vec2> at_pose{line.front()};
  for (std::size_t n = 1; n < options.poses + 4; ++n)
    at_pose.push_back(at(i, s, options.step_m));
  for (std::size_t n = 0; n < options.poses; ++n) {
    Pose pose;
    pose.t = static_cast<double>(n) * options.step_m / options.speed_m_s;
    pose.eye = {at_pose[n].x, ground(at_pose[n]) + options.eye_height_m, at_pose[n].y};
    const Vec2 d = at_pose[n + 4] - at_pose[n > 4 ? n - 4 : 0];
    constexpr double kDegrees = 57.29577951308232;
    // To a thousandth of a degree: the last bits of atan2 differ between machines.
    pose.yaw_deg = std::round(std::atan2(-d.y, d.x) * kDegrees * 1000) / 1000 + 0.0;
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace ivis
