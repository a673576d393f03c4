#include "visibility/box_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/assert.h"

namespace ivis {
namespace {

struct Entry {
  Aabb box;
  Vec3 centre;
  std::uint32_t item;
};

double half_area(const Aabb& b) {
  const Vec3 s = b.size();
  return s.x * s.y + s.y * s.z + s.z * s.x;
}

float down(double v) {
  const auto f = static_cast<float>(v);
  return f > v ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}
float up(double v) {
  const auto f = static_cast<float>(v);
  return f < v ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

void set_child(BoxTree::Node& node, std::size_t g, const Aabb& box, const Vec3& origin,
               std::uint32_t child) {
  node.lo_x[g] = down(box.lo.x - origin.x);
  node.hi_x[g] = up(box.hi.x - origin.x);
  node.lo_z[g] = down(box.lo.z - origin.z);
  node.hi_z[g] = up(box.hi.z - origin.z);
  node.lo_y[g] = down(box.lo.y - origin.y);
  node.hi_y[g] = up(box.hi.y - origin.y);
  node.child[g] = child;
}

class Builder {
 public:
  Builder(std::vector<Entry>& entries, BoxTree& tree) : entries_(entries), tree_(tree) {}

  std::uint32_t build(std::size_t first, std::size_t last) {
    // Capacity of a child so that all but the last are full.
    std::size_t capacity = 1;
    while (capacity * BoxTree::kWidth < last - first)
      capacity *= BoxTree::kWidth;
    std::vector<std::pair<std::size_t, std::size_t>> groups;
    split(first, last, capacity, groups);
    IVIS_ASSERT(groups.size() <= BoxTree::kWidth, "a node holds at most kWidth children");
    const auto index = static_cast<std::uint32_t>(tree_.nodes.size());
    tree_.nodes.emplace_back();
    for (std::size_t g = 0; g < BoxTree::kWidth; ++g) {
      std::uint32_t child = 0;
      Aabb box;
      if (g < groups.size()) {
        const auto [a, b] = groups[g];
        for (std::size_t i = a; i < b; ++i)
          box.add(entries_[i].box);
        child = b - a == 1 ? BoxTree::kItem | entries_[a].item : build(a, b);
      } else {
        box = {Vec3{0}, Vec3{0}};
      }
      set_child(tree_.nodes[index], g, box, tree_.origin, child);
    }
    tree_.nodes[index].count = static_cast<std::uint32_t>(groups.size());
    return index;
  }

 private:
  /// Halves by the surface area heuristic at multiples of `capacity`, until a group fits.
  void split(std::size_t first, std::size_t last, std::size_t capacity,
             std::vector<std::pair<std::size_t, std::size_t>>& groups) {
    const std::size_t n = last - first;
    if (n <= capacity) {
      groups.emplace_back(first, last);
      return;
    }
    int best_axis = 0;
    std::size_t best_at = capacity;
    double best_cost = std::numeric_limits<double>::infinity();
    std::vector<double> left(n);
    for (const int axis : {0, 2, 1}) {
      sort(first, last, axis);
      Aabb box;
      for (std::size_t i = 0; i < n; ++i) {
        box.add(entries_[first + i].box);
        left[i] = half_area(box);
      }
      box = {};
      for (std::size_t i = n; i-- > 1;) {
        box.add(entries_[first + i].box);
        if (i % capacity != 0) continue;
        const double cost =
            left[i - 1] * static_cast<double>(i) + half_area(box) * static_cast<double>(n - i);
        if (cost < best_cost) {
          best_cost = cost;
          best_axis = axis;
          best_at = i;
        }
      }
    }
    sort(first, last, best_axis);
    split(first, first + best_at, capacity, groups);
    split(first + best_at, last, capacity, groups);
  }

  void sort(std::size_t first, std::size_t last, int axis) {
    std::sort(entries_.begin() + static_cast<std::ptrdiff_t>(first),
              entries_.begin() + static_cast<std::ptrdiff_t>(last),
              [axis](const Entry& a, const Entry& b) {
                return a.centre[axis] != b.centre[axis] ? a.centre[axis] < b.centre[axis]
                                                        : a.item < b.item;
              });
  }

  std::vector<Entry>& entries_;
  BoxTree& tree_;
};

}  // namespace

BoxTree BoxTree::build(std::span<const Aabb> boxes, std::span<const std::uint32_t> items,
                       const Vec3& tree_origin) {
  IVIS_ASSERT(boxes.size() == items.size() && boxes.size() < kItem, "one name a box");
  BoxTree tree;
  tree.origin = tree_origin;
  if (boxes.empty()) return tree;
  std::vector<Entry> entries;
  entries.reserve(boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i)
    entries.push_back({boxes[i], boxes[i].centre(), items[i]});
  Builder(entries, tree).build(0, entries.size());
  return tree;
}

namespace {

/// Appends nodes over boxes[first, last); returns the index of their root.
std::uint32_t pack_nodes(std::span<const Aabb> boxes, std::span<const std::uint32_t> items,
                         BoxTree& tree, Aabb& all) {
  std::size_t capacity = 1;
  while (capacity * BoxTree::kWidth < boxes.size())
    capacity *= BoxTree::kWidth;
  const auto index = static_cast<std::uint32_t>(tree.nodes.size());
  tree.nodes.emplace_back();
  std::uint32_t count = 0;
  for (std::size_t first = 0; first < boxes.size(); first += capacity, ++count) {
    const std::size_t n = std::min(capacity, boxes.size() - first);
    Aabb box = boxes[first];
    const std::uint32_t child =
        capacity == 1 ? BoxTree::kItem | items[first]
                      : pack_nodes(boxes.subspan(first, n), items.subspan(first, n), tree, box);
    set_child(tree.nodes[index], count, box, tree.origin, child);
    all.add(box);
  }
  for (std::size_t g = count; g < BoxTree::kWidth; ++g)
    set_child(tree.nodes[index], g, {Vec3{0}, Vec3{0}}, tree.origin, 0);
  tree.nodes[index].count = count;
  return index;
}

}  // namespace

BoxTree BoxTree::pack(std::span<const Aabb> boxes, std::span<const std::uint32_t> items,
                      const Vec3& tree_origin) {
  IVIS_ASSERT(boxes.size() == items.size() && boxes.size() < kItem, "one name a box");
  BoxTree tree;
  tree.origin = tree_origin;
  Aabb all;
  if (!boxes.empty()) pack_nodes(boxes, items, tree, all);
  return tree;
}

}  // namespace ivis
