#include "occluders/fuse.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "occluders/clip.h"
#include "occluders/progress.h"

namespace ivis {
namespace {

enum class BottomKind { kGrounded, kFloor, kReal };

BottomKind bottom_kind(const Prism& p, double floor) {
  if (p.grounded) return BottomKind::kGrounded;
  return p.solid_bottom <= floor ? BottomKind::kFloor : BottomKind::kReal;
}

double cross(const Vec2& a, const Vec2& b) {
  return a.x * b.y - a.y * b.x;
}

/// May be generous: fusing what does not touch costs time only.
bool segments_meet(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  constexpr double kNear = 2 * kGridM;
  if (std::max(a.x, b.x) < std::min(c.x, d.x) - kNear ||
      std::max(c.x, d.x) < std::min(a.x, b.x) - kNear)
    return false;
  if (std::max(a.y, b.y) < std::min(c.y, d.y) - kNear ||
      std::max(c.y, d.y) < std::min(a.y, b.y) - kNear)
    return false;
  const auto apart = [&](const Vec2& p, const Vec2& q, const Vec2& r, const Vec2& s) {
    const double length = glm::length(q - p);
    const double u = cross(q - p, r - p);
    const double v = cross(q - p, s - p);
    return (u > kNear * length && v > kNear * length) ||
           (u < -kNear * length && v < -kNear * length);
  };
  return !apart(a, b, c, d) && !apart(c, d, a, b);
}

bool touch(const Polygon& p, const Polygon& q) {
  for (const Ring& r : p.rings)
    for (std::size_t i = 0; i < r.size(); ++i)
      for (const Ring& s : q.rings)
        for (std::size_t j = 0; j < s.size(); ++j)
          if (segments_meet(r[i], r[(i + 1) % r.size()], s[j], s[(j + 1) % s.size()])) return true;
  return contains(p, q.rings[0][0]) || contains(q, p.rings[0][0]);
}

/// Groups of indices whose footprints hang together; each ascending, by first member.
std::vector<std::vector<std::size_t>> connected(const std::vector<Prism>& prisms,
                                                const std::vector<std::size_t>& of) {
  struct Item {
    std::size_t index;
    Aabb box;
  };
  std::vector<Item> items;
  for (const std::size_t i : of) {
    Aabb box = prisms[i].bounds();
    box.lo -= 2 * kGridM;
    box.hi += 2 * kGridM;
    items.push_back({i, box});
  }
  std::sort(items.begin(), items.end(), [](const Item& a, const Item& b) {
    return a.box.lo.x != b.box.lo.x ? a.box.lo.x < b.box.lo.x : a.index < b.index;
  });
  std::vector<std::size_t> parent(items.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (parent[i] != i)
      i = parent[i] = parent[parent[i]];
    return i;
  };
  // Sweep along x with the open boxes in strips of z, so that a long building meets only its
  // neighbours.
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < items.size(); ++i) {
    const Item& a = items[i];
    std::erase_if(open, [&](std::size_t o) { return items[o].box.hi.x < a.box.lo.x; });
    for (const std::size_t o : open) {
      const Item& b = items[o];
      if (b.box.lo.z > a.box.hi.z || a.box.lo.z > b.box.hi.z || root(o) == root(i)) continue;
      if (touch(prisms[a.index].footprint, prisms[b.index].footprint)) parent[root(i)] = root(o);
    }
    open.push_back(i);
  }
  std::vector<std::vector<std::size_t>> by_root(items.size());
  for (std::size_t i = 0; i < items.size(); ++i)
    by_root[root(i)].push_back(items[i].index);
  std::erase_if(by_root, [](const auto& g) { return g.empty(); });
  for (auto& g : by_root)
    std::sort(g.begin(), g.end());
  std::sort(by_root.begin(), by_root.end(),
            [](const auto& a, const auto& b) { return a[0] < b[0]; });
  return by_root;
}

/// The few tops, ascending, that lose least volume when every member's top is rounded down to one.
std::vector<double> choose_levels(const std::vector<Prism>& prisms,
                                  const std::vector<std::size_t>& group, double bottom,
                                  const FuseOptions& options) {
  struct Step {
    double top, area;
  };
  std::vector<Step> steps;
  for (const std::size_t i : group)
    if (prisms[i].top > bottom) steps.push_back({prisms[i].top, area(prisms[i].footprint)});
  std::sort(steps.begin(), steps.end(), [](const Step& a, const Step& b) {
    return a.top != b.top ? a.top < b.top : a.area < b.area;
  });
  // Many distinct tops: first together within a fraction of the height (the lowest stands for
  // them).
  constexpr std::size_t kMaxSteps = 128;
  if (steps.empty()) return {};
  const double pitch = steps.size() > kMaxSteps
                           ? (steps.back().top - steps.front().top) / static_cast<double>(kMaxSteps)
                           : 0;
  std::vector<Step> merged;
  for (const Step& s : steps) {
    if (!merged.empty() && s.top - merged.back().top <= pitch)
      merged.back().area += s.area;
    else
      merged.push_back(s);
  }
  const std::size_t n = merged.size();
  // Prefix sums of area and of area x top: loss(i, j) when merged[i..j) stop at top h.
  std::vector<double> a(n + 1, 0);
  std::vector<double> at(n + 1, 0);
  for (std::size_t i = 0; i < n; ++i) {
    a[i + 1] = a[i] + merged[i].area;
    at[i + 1] = at[i] + merged[i].area * (merged[i].top - bottom);
  }
  const auto loss = [&](std::size_t i, std::size_t j, double h) {
    return at[j] - at[i] - (a[j] - a[i]) * h;
  };
  const std::size_t levels = std::min(n, options.max_levels);
  // best[k][i]: least loss among merged[i..n) with k levels, the lowest of them at i.
  std::vector<std::vector<double>> best(
      levels + 1, std::vector<double>(n, std::numeric_limits<double>::infinity()));
  std::vector<std::vector<std::size_t>> next(levels + 1, std::vector<std::size_t>(n, n));
  std::size_t chosen_k = levels;
  std::size_t chosen_i = 0;
  for (std::size_t k = 1; k <= levels; ++k) {
    for (std::size_t i = 0; i < n; ++i) {
      const double h = merged[i].top - bottom;
      if (k == 1) best[k][i] = loss(i, n, h);
      for (std::size_t j = i + 1; k > 1 && j < n; ++j) {
        const double v = loss(i, j, h) + best[k - 1][j];
        if (v < best[k][i]) {
          best[k][i] = v;
          next[k][i] = j;
        }
      }
    }
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i)
      if (const double v = best[k][i] + loss(0, i, 0); v < least) {
        least = v;
        chosen_i = i;
      }
    if (least <= options.level_loss * at[n]) {
      chosen_k = k;
      break;
    }
  }
  std::vector<double> tops;
  for (std::size_t i = chosen_i, k = chosen_k; i < n && k > 0; i = next[k--][i])
    tops.push_back(merged[i].top);
  return tops;
}

FusedStack stack_of(const std::vector<Prism>& prisms, const std::vector<std::size_t>& group,
                    bool grounded, const FuseOptions& options) {
  FusedStack stack;
  stack.grounded = grounded;
  stack.bottom = prisms[group[0]].bottom;
  for (const std::size_t i : group)
    stack.bottom = std::max(stack.bottom, prisms[i].bottom);
  const std::vector<double> tops = choose_levels(prisms, group, stack.bottom, options);
  std::vector<Polygon> region;
  double above = std::numeric_limits<double>::infinity();
  for (auto top = tops.rbegin(); top != tops.rend(); ++top) {
    std::vector<Ring> rings = rings_of(region);
    double area_in = area(region);
    for (const std::size_t i : group)
      if (prisms[i].top >= *top && prisms[i].top < above) {
        const auto& r = prisms[i].footprint.rings;
        rings.insert(rings.end(), r.begin(), r.end());
        area_in += area(prisms[i].footprint);
      }
    std::vector<Polygon> united = unite(rings, Fill::kNonZero);
    // The library has been seen to fail on dirty input; a union larger than its parts is such a
    // case.
    if (area(united) <= area_in * (1 + 1e-9) + 1e-3) region = std::move(united);
    above = *top;
    stack.levels.push_back({*top, region});
  }
  std::reverse(stack.levels.begin(), stack.levels.end());
  return stack;
}

}  // namespace

std::vector<FusedStack> fuse(const std::vector<Prism>& prisms, double floor,
                             const FuseOptions& options, const Context& context) {
  std::vector<std::vector<std::size_t>> groups;
  for (const BottomKind kind : {BottomKind::kGrounded, BottomKind::kFloor, BottomKind::kReal}) {
    std::vector<std::size_t> of;
    for (std::size_t i = 0; i < prisms.size(); ++i)
      if (bottom_kind(prisms[i], floor) == kind) of.push_back(i);
    for (auto& group : connected(prisms, of)) {
      if (kind != BottomKind::kReal) {
        groups.push_back(std::move(group));
        continue;
      }
      std::stable_sort(group.begin(), group.end(),
                       [&](auto a, auto b) { return prisms[a].bottom < prisms[b].bottom; });
      for (std::size_t i = 0; i < group.size();) {
        std::vector<std::size_t> window;
        const double lowest = prisms[group[i]].bottom;
        for (; i < group.size() && prisms[group[i]].bottom - lowest <= options.base_window_m; ++i)
          window.push_back(group[i]);
        groups.push_back(std::move(window));
      }
    }
  }
  std::vector<FusedStack> stacks(groups.size());
  Progress progress(context, "fusing", groups.size());
  parallel_for(context, groups.size(), [&](std::size_t g) {
    stacks[g] =
        stack_of(prisms, groups[g],
                 bottom_kind(prisms[groups[g][0]], floor) == BottomKind::kGrounded, options);
    progress.step();
  });
  if (context.stopped()) return {};
  return stacks;
}

}  // namespace ivis
