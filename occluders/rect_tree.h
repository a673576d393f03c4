#pragma once
// Balanced tree of rectangles in the plane: which of many edges or triangles lie near a place?

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "core/aabb.h"
#include "core/math.h"

namespace ivis {

/// Closed box in (x, z); empty when default-made.
struct Box2 {
  Vec2 lo{std::numeric_limits<double>::infinity()};
  Vec2 hi{-std::numeric_limits<double>::infinity()};

  void add(const Vec2& p) {
    lo = glm::min(lo, p);
    hi = glm::max(hi, p);
  }
  void add(const Box2& b) {
    lo = glm::min(lo, b.lo);
    hi = glm::max(hi, b.hi);
  }
  bool contains(const Vec2& p) const {
    return p.x >= lo.x && p.x <= hi.x && p.y >= lo.y && p.y <= hi.y;
  }
  bool overlaps(const Box2& b) const {
    return lo.x <= b.hi.x && hi.x >= b.lo.x && lo.y <= b.hi.y && hi.y >= b.lo.y;
  }
  Vec2 size() const { return hi - lo; }
};

/// What the box covers of the ground plane.
inline Box2 ground_box(const Aabb& box) {
  return {ground(box.lo), ground(box.hi)};
}

/// Items by their boxes, split at the median: linear memory whatever the boxes are.
/// Threads: a value; `all` is reentrant.
class RectTree {
 public:
  RectTree() = default;
  explicit RectTree(const std::vector<Box2>& boxes) : items_(boxes.size()) {
    while (leaves_ * kLeafItems < items_.size())
      leaves_ *= 2;
    nodes_.resize(2 * leaves_);
    first_.resize(leaves_ + 1);
    first_[leaves_] = items_.size();
    std::iota(items_.begin(), items_.end(), 0U);
    build(boxes, 1, 0, items_.size());
    boxes_.reserve(items_.size());
    for (const std::uint32_t i : items_)
      boxes_.push_back(boxes[i]);
  }

  /// Does `accept(item)` hold for every item whose box overlaps `box`? Stops at the first for
  /// which it does not.
  template <class F>
  bool all(const Box2& box, const F& accept) const {
    return nodes_.empty() || all(1, box, accept);
  }

 private:
  static constexpr std::size_t kLeafItems = 4;

  void build(const std::vector<Box2>& boxes, std::size_t node, std::size_t begin, std::size_t end) {
    Box2 box;
    for (std::size_t i = begin; i < end; ++i)
      box.add(boxes[items_[i]]);
    nodes_[node] = box;
    if (node >= leaves_) {
      first_[node - leaves_] = begin;
      return;
    }
    const bool wide = box.size().x >= box.size().y;
    const std::size_t middle = begin + (end - begin) / 2;
    const auto at = [&](std::size_t i) { return items_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end), [&](std::uint32_t i, std::uint32_t j) {
      const Box2& p = boxes[i];
      const Box2& q = boxes[j];
      return wide ? p.lo.x + p.hi.x < q.lo.x + q.hi.x : p.lo.y + p.hi.y < q.lo.y + q.hi.y;
    });
    build(boxes, 2 * node, begin, middle);
    build(boxes, 2 * node + 1, middle, end);
  }

  template <class F>
  bool all(std::size_t node, const Box2& box, const F& accept) const {
    if (!nodes_[node].overlaps(box)) return true;
    if (node < leaves_) return all(2 * node, box, accept) && all(2 * node + 1, box, accept);
    for (std::size_t i = first_[node - leaves_]; i < first_[node - leaves_ + 1]; ++i)
      if (boxes_[i].overlaps(box) && !accept(items_[i])) return false;
    return true;
  }

  std::vector<std::uint32_t> items_;  // in leaf order
  std::vector<Box2> boxes_;           // of the items, likewise
  std::vector<Box2> nodes_;           // children of node i: 2i, 2i + 1; root 1
  std::vector<std::size_t> first_;    // of each leaf's run in items_
  std::size_t leaves_ = 1;
};

}  // namespace ivis
