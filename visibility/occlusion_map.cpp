#include "visibility/occlusion_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "visibility/answer.h"

namespace ivis {
namespace {

/// A pixel's half diagonal at depth w of a map of n pixels a side is sqrt(2) w / n; 1 % more pays
/// for rounding.
constexpr double kMarginFactor = 1.01 * std::numbers::sqrt2;

}  // namespace

struct OcclusionMap::Cell : MapCell {
  std::uint32_t sides = 0;  ///< of the cube that are of use
};

struct OcclusionMap::Scratch {
  Scratch(std::uint32_t pixels, float near_m) : cube(pixels, near_m) {}
  DepthCube cube;
  /// A child of a node of the pieces' tree that may show.
  struct Entry {
    float distance;  ///< squared, of its box
    std::uint32_t node;
    std::uint32_t child;
    bool operator<(const Entry& o) const {
      return distance != o.distance ? distance > o.distance
             : node != o.node       ? node > o.node
                                    : child > o.child;
    }
  };
  std::vector<Entry> queue;
  std::vector<std::uint32_t> visible;
  std::vector<std::uint64_t> bits;
};

OcclusionMap::OcclusionMap(const Scene& scene, const OccluderSet& occluders,
                           const MethodOptions& options, const OcclusionGuards& guards)
    : scene_(scene),
      occluders_(occluders),
      options_(options),
      guards_(guards),
      frame_(choose_frame(scene, occluders.slack_m)),
      bounds_(bounds_in(frame_, scene)),
      pixels_(pixels_for(options.map_pixels, occluders.reach)),
      near_m_(near_for(occluders.reach)),
      sub_boxes_(scene, frame_),
      pieces_(make_pieces(scene, occluders, frame_)),
      solids_(occluders) {
  std::vector<Aabb> boxes;
  std::vector<std::uint32_t> ids;
  for (ObjectId id = 0; id < scene.objects.size(); ++id) {
    const Object& o = scene.objects[id];
    if (o.always_visible) {
      always_visible_.push_back(id);
    } else {
      boxes.push_back(bounds_in(frame_, scene, o));
      ids.push_back(id);
    }
  }
  objects_ = BoxTree::build(boxes, ids, Vec3{0});
}

OcclusionMap::~OcclusionMap() = default;

MethodTraits OcclusionMap::make_traits() {
  return {
      "occlusion-map", Guarantee::kConservative, true,
      "depth maps of shrunk occluders of every kind (Wonka, Wimmer, Sillion 2001, section 5.2)"};
}

const MethodTraits& OcclusionMap::traits() const {
  static const MethodTraits conservative = make_traits();
  return conservative;
}

std::unique_ptr<OcclusionMap::Scratch> OcclusionMap::take_scratch() const {
  const std::lock_guard lock(scratch_mutex_);
  if (scratch_.empty()) return std::make_unique<Scratch>(pixels_, near_m_);
  auto scratch = std::move(scratch_.back());
  scratch_.pop_back();
  return scratch;
}

void OcclusionMap::give_back(std::unique_ptr<Scratch> scratch) const {
  const std::lock_guard lock(scratch_mutex_);
  scratch_.push_back(std::move(scratch));
}

Result<Pvs> OcclusionMap::solve(const ViewCell& cell) const {
  Stats stats;
  return solve(cell, nullptr, stats);
}

Result<Pvs> OcclusionMap::solve(const ViewCell& cell, LastShown& last) const {
  Stats stats;
  return solve(cell, &last, stats);
}

Result<Pvs> OcclusionMap::solve(const ViewCell& cell, Stats& stats) const {
  return solve(cell, nullptr, stats);
}

Result<Pvs> OcclusionMap::solve(const ViewCell& cell, LastShown* last, Stats& stats) const {
  if (auto s = check_cell(cell, occluders_); !s) return s.error();
  Pvs pvs = empty_answer(scene_, cell);
  Cell c{make_map_cell(cell, frame_, occluders_), 0};
  if (auto why = why_everything(cell.eye, c.eye, solids_, occluders_.slack_m); !why.empty()) {
    list_everything(scene_, std::move(why), pvs);
    return pvs;
  }

  auto scratch = take_scratch();
  scratch->cube.clear();
  glm::vec3 lo;
  glm::vec3 hi;
  for (int i = 0; i < 3; ++i) {
    lo[i] = static_cast<float>(bounds_.lo[i] - c.eye[i]) - 1.0F;  // more than rounding
    hi[i] = static_cast<float>(bounds_.hi[i] - c.eye[i]) + 1.0F;
  }
  c.sides = scratch->cube.look_at(lo, hi);
  scratch->visible.clear();
  draw_selected(c, last, *scratch, stats);
  find(c, *scratch, stats);
  list_ascending(scene_.objects.size(), scratch->visible, always_visible_, scratch->bits, pvs);
  give_back(std::move(scratch));
  return pvs;
}

/// What MethodOptions::selection says. Drawing less is always safe.
void OcclusionMap::draw_selected(const Cell& cell, LastShown* last, Scratch& scratch,
                                 Stats& stats) const {
  if (last == nullptr || options_.selection == Selection::kConservative) {
    draw_all(cell, scratch, stats);
    return;
  }
  if (last->known)
    draw_these(last->occluders, cell, scratch, stats);
  else
    draw_all(cell, scratch, stats);
  last->occluders.clear();
  if (!pieces_.tree.nodes.empty())
    find_visible(pieces_.tree, 0, cell.single, scratch.cube, last->occluders, stats);
  if (last->known && options_.selection == Selection::kTwoPass) {
    scratch.cube.clear();
    draw_these(last->occluders, cell, scratch, stats);
  }
  last->known = true;
}

void OcclusionMap::draw_these(std::span<const std::uint32_t> pieces, const Cell& cell,
                              Scratch& scratch, Stats& stats) const {
  const std::size_t most = options_.max_occluders > 0 ? options_.max_occluders : pieces.size();
  for (const std::uint32_t p : largest_pieces(pieces_, cell.eye, most, pieces))
    draw_piece(pieces_.pieces[p], cell.sides, cell, scratch, stats);
}

/// Near pieces first; whole branches that what is drawn hides are passed over, which is always
/// safe.
void OcclusionMap::draw_all(const Cell& cell, Scratch& scratch, Stats& stats) const {
  const BoxTree& tree = pieces_.tree;
  if (tree.nodes.empty()) return;
  if (options_.max_occluders > 0 && options_.max_occluders < pieces_.pieces.size()) {
    std::vector<std::uint32_t> all(pieces_.pieces.size());
    std::iota(all.begin(), all.end(), 0U);
    draw_these(all, cell, scratch, stats);
    return;
  }
  auto& queue = scratch.queue;
  queue.clear();
  std::uint8_t sides[BoxTree::kWidth];
  const auto open = [&](std::uint32_t index) {
    const BoxTree::Node& node = tree.nodes[index];
    find_sides(node, cell.single, scratch.cube, 0xffff, sides);
    ++stats.nodes_tested;
    for (std::uint32_t c = 0; c < node.count; ++c) {
      if ((sides[c] & cell.sides) == 0) continue;
      const float dx =
          std::max({node.lo_x[c] - cell.single[0], cell.single[0] - node.hi_x[c], 0.0F});
      const float dy =
          std::max({node.lo_y[c] - cell.single[1], cell.single[1] - node.hi_y[c], 0.0F});
      const float dz =
          std::max({node.lo_z[c] - cell.single[2], cell.single[2] - node.hi_z[c], 0.0F});
      queue.push_back({dx * dx + dy * dy + dz * dz, index, c});
      std::push_heap(queue.begin(), queue.end());
    }
  };
  open(0);
  while (!queue.empty()) {
    std::pop_heap(queue.begin(), queue.end());
    const Scratch::Entry e = queue.back();
    queue.pop_back();
    const BoxTree::Node& node = tree.nodes[e.node];
    const std::uint32_t child = node.child[e.child];
    if ((child & BoxTree::kItem) == 0) {
      open(child);
      continue;
    }
    ++stats.pieces_tested;
    find_sides(node, cell.single, scratch.cube, 1U << e.child, sides);
    if ((sides[e.child] & cell.sides) != 0)
      draw_piece(pieces_.pieces[child & ~BoxTree::kItem], sides[e.child] & cell.sides, cell,
                 scratch, stats);
  }
}

void OcclusionMap::draw_piece(const OccluderPieces::Piece& piece, std::uint32_t sides,
                              const Cell& cell, Scratch& scratch, Stats& stats) const {
  const SampleMargin margin{kMarginFactor, static_cast<double>(pixels_)};
  const PieceChoice chosen = choose_level(pieces_, piece, cell, margin, sides, guards_);
  if (chosen.sides == 0) return;
  ++stats.pieces_drawn;
  draw_faces(pieces_.faces(pieces_.levels[chosen.level]), cell.single, chosen.sides,
             piece.kind == OccluderPieces::Kind::kSheet, scratch.cube, stats);
}

/// Takes out what all of an object's smaller boxes show to be hidden.
void OcclusionMap::keep_seen(const Cell& cell, const Scratch& scratch,
                             std::vector<std::uint32_t>& found, Stats& stats) const {
  if (sub_boxes_.tree().nodes.empty()) return;
  std::vector<std::uint32_t> seen;
  std::vector<std::uint32_t> none;
  std::erase_if(found, [&](std::uint32_t id) {
    const std::uint32_t node = sub_boxes_.node_of(id);
    if (node == SubBoxes::kNone) return false;
    seen.clear();
    find_visible_children(sub_boxes_.tree(), node, cell.single, scratch.cube, seen, none, stats);
    return seen.empty();
  });
}

void OcclusionMap::find(const Cell& cell, Scratch& scratch, Stats& stats) const {
  if (objects_.nodes.empty()) return;
  if (options_.threads <= 1) {
    find_visible(objects_, 0, cell.single, scratch.cube, scratch.visible, stats);
    keep_seen(cell, scratch, scratch.visible, stats);
    return;
  }
  // The tree's upper levels alone, then each subtree as a task: the same tests as in one thread.
  std::vector<std::uint32_t> roots{0};
  while (!roots.empty() && roots.size() < 8U * options_.threads) {
    std::vector<std::uint32_t> next;
    for (const std::uint32_t r : roots)
      find_visible_children(objects_, r, cell.single, scratch.cube, scratch.visible, next, stats);
    roots = std::move(next);
  }
  keep_seen(cell, scratch, scratch.visible, stats);
  std::vector<std::vector<std::uint32_t>> found(roots.size());
  std::vector<Stats> counts(roots.size());
  tbb::task_arena arena(
      std::min(static_cast<int>(options_.threads), tbb::info::default_concurrency()));
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, roots.size(), [&](std::size_t i) {
      find_visible(objects_, roots[i], cell.single, scratch.cube, found[i], counts[i]);
      keep_seen(cell, scratch, found[i], counts[i]);
    });
  });
  for (std::size_t i = 0; i < roots.size(); ++i) {
    scratch.visible.insert(scratch.visible.end(), found[i].begin(), found[i].end());
    stats.nodes_tested += counts[i].nodes_tested;
  }
}

}  // namespace ivis
