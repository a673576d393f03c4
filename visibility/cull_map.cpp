#include "visibility/cull_map.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "visibility/answer.h"

namespace ivis {
namespace {

constexpr double kSquareM = 4;  ///< of the orthographic map

/// Boxes are subtracted from the eye in single precision: how far the rounded eye may be from the
/// true one. The occluders' slack pays for it (core/view_cell.h, padded).
bool eye_fits_single_precision(const Vec3& eye, double slack_m) {
  for (int i = 0; i < 3; ++i)
    if (std::abs(eye[i] - static_cast<double>(static_cast<float>(eye[i]))) > 0.5 * slack_m)
      return false;
  return true;
}

/// `of_prism`: receives the solid that each prism became, or kNoSolid.
constexpr std::uint32_t kNoSolid = 0xffffffffU;
WallSet make_walls(const std::vector<Prism>& prisms, double floor, const Vec3& origin,
                   std::vector<std::uint32_t>* of_prism = nullptr) {
  WallSet walls;
  std::vector<Aabb> boxes;
  std::vector<std::uint32_t> items;
  for (const Prism& prism : prisms) {
    if (of_prism != nullptr) of_prism->push_back(kNoSolid);
    WallSet::Solid solid;
    solid.first_ring = static_cast<std::uint32_t>(walls.rings.size());
    for (const auto& ring : prism.footprint.rings) {
      if (ring.size() < 3) continue;
      walls.rings.push_back(
          {static_cast<std::uint32_t>(walls.x.size()), static_cast<std::uint32_t>(ring.size())});
      ++solid.rings;
      for (const Vec2& p : ring) {
        walls.x.push_back(static_cast<float>(p.x - origin.x));
        walls.z.push_back(static_cast<float>(p.y - origin.z));
      }
    }
    if (solid.rings == 0) continue;
    solid.top = static_cast<float>(prism.top - origin.y);
    solid.bottom = static_cast<float>(prism.bottom - origin.y);
    solid.floored = prism.solid_bottom <= floor;
    solid.grounded = prism.grounded;
    boxes.push_back(prism.bounds());
    items.push_back(static_cast<std::uint32_t>(walls.solids.size()));
    if (of_prism != nullptr) of_prism->back() = items.back();
    walls.solids.push_back(solid);
  }
  walls.x.resize(walls.x.size() + BoxTree::kWidth);
  walls.z.resize(walls.z.size() + BoxTree::kWidth);
  walls.tree = BoxTree::build(boxes, items, origin);
  return walls;
}

}  // namespace

/// The cell as the maps want it.
struct CullMap::Eye {
  Vec3 apex;        ///< relative to origin_
  float single[3];  ///< the same, rounded
  Floors floors;
};

struct CullMap::Scratch {
  explicit Scratch(std::uint32_t bins_a_face) : polar(bins_a_face) {}
  PolarMap polar;
  Horizon horizon;
  OrthographicMap::Heights heights;
  std::vector<ShadowChain> chains;
  std::vector<float> worth, ranked;  ///< of solids
  std::vector<std::uint8_t> wanted;  ///< of solids; empty: all
  std::vector<std::uint32_t> visible;
  std::vector<std::uint64_t> bits;
  std::shared_ptr<const WallSet> added;
};

namespace {

bool reaches_down(const WallSet::Solid& s, const Floors& floors) {
  return (s.floored && floors.above_floor) || (s.grounded && floors.on_ground);
}

}  // namespace

CullMap::CullMap(const Scene& scene, const OccluderSet& occluders, const MethodOptions& options,
                 const PolarGuards& guards, std::uint32_t bins_a_face)
    : scene_(scene),
      occluders_(occluders),
      options_(options),
      guards_(guards),
      bins_a_face_(bins_a_face),
      origin_(scene.bounds.empty() ? Vec3{0} : scene.bounds.centre()),
      walls_(make_walls(occluders.shrunk, occluders.floor, origin_, &solid_of_)),
      solids_(occluders) {
  std::vector<Aabb> boxes;
  std::vector<std::uint32_t> ids;
  for (ObjectId id = 0; id < scene.objects.size(); ++id) {
    const Object& o = scene.objects[id];
    if (o.always_visible) {
      always_visible_.push_back(id);
    } else {
      boxes.push_back(o.bounds);
      ids.push_back(id);
    }
  }
  objects_ = BoxTree::build(boxes, ids, origin_);
  if (!scene.bounds.empty()) {
    const Vec3 half = scene.bounds.size() * 0.5;
    extent_m_ = std::max({half.x, half.y, half.z});
  }
  for (const WallSet::Solid& s : walls_.solids) {
    std::uint32_t corners = 0;
    for (std::uint32_t r = 0; r < s.rings; ++r)
      corners += walls_.rings[s.first_ring + r].count;
    corners_.push_back(corners);
  }
  for (const WallSet::Solid& s : walls_.solids) {
    all_floored_ = all_floored_ && s.floored;
    all_grounded_ = all_grounded_ && s.grounded;
    all_held_down_ = all_held_down_ && (s.floored || s.grounded);
  }
  if (options.map == CullMapKind::kPolar && !occluders.height_field.empty())
    terrain_ = std::make_unique<TerrainMap>(occluders.height_field, origin_, bins_a_face);
  if (options.map == CullMapKind::kOrthographic) {
    Aabb bounds{scene.bounds.lo - origin_, scene.bounds.hi - origin_};
    if (scene.bounds.empty()) bounds = {};
    orthographic_ = std::make_unique<OrthographicMap>(bounds, kSquareM);
  }
}

CullMap::~CullMap() = default;

MethodTraits CullMap::make_traits() {
  return {"cull-map", Guarantee::kConservative, true,
          "shadows of shrunk prisms over a 2.5D scene (Wonka, Wimmer, Sillion 2001, section 5.1)"};
}

const MethodTraits& CullMap::traits() const {
  static const MethodTraits traits = make_traits();
  return traits;
}

Backend CullMap::backend() const {
  return shadows_ && !shadows_failed_ ? Backend::kGl : Backend::kCpu;
}

std::unique_ptr<CullMap::Scratch> CullMap::take_scratch() const {
  const std::lock_guard lock(scratch_mutex_);
  if (scratch_.empty()) return std::make_unique<Scratch>(bins_a_face_);
  auto scratch = std::move(scratch_.back());
  scratch_.pop_back();
  return scratch;
}

void CullMap::give_back(std::unique_ptr<Scratch> scratch) const {
  const std::lock_guard lock(scratch_mutex_);
  scratch_.push_back(std::move(scratch));
}

Result<Pvs> CullMap::solve(const ViewCell& cell) const {
  Stats stats;
  return solve(cell, nullptr, {}, nullptr, stats);
}

Result<Pvs> CullMap::solve(const ViewCell& cell, LastShown& last) const {
  Stats stats;
  return solve(cell, &last, {}, nullptr, stats);
}

Result<Pvs> CullMap::solve(const ViewCell& cell, const Effort& effort, Work& done) const {
  Stats stats;
  Effort bounded = effort;
  if (effort.strategy == Strategy::kGuaranteed) bounded.draw = bounded.test = Effort::kUnbounded;
  auto pvs = solve(cell, nullptr, bounded, nullptr, stats);
  done = {stats.polar.draw_work(), stats.polar.nodes_tested, stats.polar.cut};
  return pvs;
}

Result<Pvs> CullMap::solve(const ViewCell& cell, const Effort& effort, const Amendment& amendment,
                           Work& done) const {
  if (orthographic_) return Method::solve(cell, effort, amendment, done);
  Stats stats;
  Effort bounded = effort;
  if (effort.strategy == Strategy::kGuaranteed) bounded.draw = bounded.test = Effort::kUnbounded;
  auto pvs = solve(cell, nullptr, bounded, &amendment, stats);
  // What is left out since it may hide nothing any more was not cut.
  const bool cut = stats.polar.cut && effort.strategy != Strategy::kGuaranteed;
  done = {stats.polar.draw_work(), stats.polar.nodes_tested, cut};
  return pvs;
}

Result<Pvs> CullMap::solve(const ViewCell& cell, Stats& stats) const {
  return solve(cell, nullptr, {}, nullptr, stats);
}

// A solid is painted at most once; each wall faces the eye or away, and is drawn at most once of
// each kind. A chain has at least a wall and writes at most all bins.
Work CullMap::most_work() const {
  std::uint64_t walls = 0;
  for (const std::uint32_t c : corners_)
    walls += c;
  const std::uint64_t bins = std::uint64_t{4} * bins_a_face_ / PolarMap::kBlock;
  return {walls * (1 + bins) + 2 * walls_.tree.nodes.size(), objects_.nodes.size(), false};
}

Result<Pvs> CullMap::solve(const ViewCell& cell, LastShown* last, const Effort& effort,
                           const Amendment* amendment, Stats& stats) const {
  if (auto checked = check_cell(cell, occluders_); !checked) return checked.error();
  Pvs pvs = empty_answer(scene_, cell);
  const Vec3 half = padded(cell.reach, occluders_.slack_m).half_extents();
  Eye eye;
  eye.apex = cell.eye + Vec3{0, half.y, 0} - origin_;
  for (int i = 0; i < 3; ++i)
    eye.single[i] = static_cast<float>(eye.apex[i]);
  const char* why = nullptr;
  const OccluderChange* change =
      amendment != nullptr && amendment->occluders ? amendment->occluders.get() : nullptr;
  const bool in_added =
      change != nullptr && std::ranges::any_of(change->added_solids, [&](const Aabb& box) {
        return box.contains(cell.eye);
      });
  if (in_added || solids_.holds(cell.eye)) {
    why = "eye inside an occluder";
  } else if (!eye_fits_single_precision(eye.apex, occluders_.slack_m)) {
    why = "eye too far from the scene for single precision";
  }
  if (why != nullptr) {
    list_everything(scene_, why, pvs);
    return pvs;
  }
  const Aabb box{cell.eye - half, cell.eye + half};
  eye.floors.above_floor = box.lo.y >= occluders_.floor;
  const Aabb& ground = occluders_.ground;
  eye.floors.on_ground = !ground.empty() && box.lo.x >= ground.lo.x && box.hi.x <= ground.hi.x &&
                         box.lo.z >= ground.lo.z && box.hi.z <= ground.hi.z;
  const bool down = (eye.floors.above_floor && all_floored_) ||
                    (eye.floors.on_ground && all_grounded_) ||
                    (eye.floors.above_floor && eye.floors.on_ground && all_held_down_);
  eye.floors.undersides = !down;
  if (const auto added = added_walls(amendment))
    for (const WallSet::Solid& s : added->solids)
      if (!reaches_down(s, eye.floors)) eye.floors.undersides = true;
  stats.undersides = eye.floors.undersides ? 1 : 0;

  auto scratch = take_scratch();
  scratch->visible.clear();
  if (auto drawn = draw_selected(eye, last, effort, amendment, *scratch, stats); !drawn)
    return drawn.error();
  find_objects(eye, effort, *scratch, stats);
  const std::vector<ObjectId>* always = &always_visible_;
  std::vector<ObjectId> still_there;
  if (amendment != nullptr) {
    std::erase_if(scratch->visible, [&](ObjectId id) { return amendment->is_gone(id); });
    for (const ObjectId id : always_visible_)
      if (!amendment->is_gone(id)) still_there.push_back(id);
    always = &still_there;
    find_placed(eye, *amendment, *scratch, stats);
  }
  // Where much is left untested the list would take longer than what it is worth.
  if (stats.polar.untested > scene_.objects.size() / 4) {
    list_everything(scene_, "the budget allows for no less", pvs);
    give_back(std::move(scratch));
    return pvs;
  }
  list_ascending(scene_.objects.size(), scratch->visible, *always, scratch->bits, pvs);
  give_back(std::move(scratch));
  return pvs;
}

/// What MethodOptions::selection says. Drawing less is always safe.
Status CullMap::draw_selected(const Eye& eye, LastShown* last, const Effort& effort,
                              const Amendment* amendment, Scratch& scratch, Stats& stats) const {
  scratch.wanted.clear();
  scratch.added = added_walls(amendment);
  if (effort.strategy == Strategy::kPredictive && !orthographic_)
    mark_promising(eye, effort, scratch, stats);
  if (amendment != nullptr && amendment->occluders && !amendment->occluders->shrunk_off.empty()) {
    if (scratch.wanted.empty()) scratch.wanted.assign(walls_.solids.size(), 1);
    const std::vector<std::uint8_t>& off = amendment->occluders->shrunk_off;
    for (std::size_t p = 0; p < off.size(); ++p)
      if (off[p] != 0 && solid_of_[p] != kNoSolid) scratch.wanted[solid_of_[p]] = 0;
  }
  if (last == nullptr || options_.selection == Selection::kConservative)
    return draw(eye, largest_solids(eye, nullptr), effort, scratch, stats);
  auto drawn = draw(eye, largest_solids(eye, last->known ? &last->occluders : nullptr), effort,
                    scratch, stats);
  if (!drawn) return drawn;
  last->occluders.clear();
  find(walls_.tree, eye, Effort::kUnbounded, scratch, last->occluders, stats);
  if (last->known && options_.selection == Selection::kTwoPass)
    drawn = draw(eye, largest_solids(eye, &last->occluders), effort, scratch, stats);
  last->known = true;
  return drawn;
}

Status CullMap::draw(const Eye& eye, const Chosen& chosen, const Effort& effort, Scratch& scratch,
                     Stats& stats) const {
  if (orthographic_) return draw_orthographic(eye, chosen, scratch);
  draw_polar(eye, chosen, effort, scratch, stats);
  return ok();
}

/// Marks those that promise to hide most for their work, the more of them the more of a full
/// drawing the budget pays for (after Funkhouser and Séquin 1993). Hiding is worth the projected
/// area; drawing costs corners, and bins by the width. What nearer ones hide is not drawn and costs
/// nothing, so that the share counts, not the sum.
void CullMap::mark_promising(const Eye& eye, const Effort& effort, Scratch& scratch,
                             Stats& stats) const {
  if (effort.draw >= effort.draw_in_full || walls_.solids.empty()) return;
  stats.polar.nodes_searched += static_cast<std::uint32_t>(walls_.tree.nodes.size());
  const auto bins = static_cast<float>(4 * bins_a_face_ / PolarMap::kBlock);
  const float x = eye.single[0];
  const float z = eye.single[2];
  std::vector<float>& worth = scratch.worth;
  worth.assign(walls_.solids.size(), 0);
  for (const BoxTree::Node& node : walls_.tree.nodes)
    for (std::uint32_t c = 0; c < node.count; ++c) {
      if ((node.child[c] & BoxTree::kItem) == 0) continue;
      const std::uint32_t solid = node.child[c] & ~BoxTree::kItem;
      const float dx = std::max({node.lo_x[c] - x, x - node.hi_x[c], 0.0F});
      const float dz = std::max({node.lo_z[c] - z, z - node.hi_z[c], 0.0F});
      const float d2 = std::max(dx * dx + dz * dz, 0.01F);
      const float width = (node.hi_x[c] - node.lo_x[c]) + (node.hi_z[c] - node.lo_z[c]);
      const float turn = std::min(width / (6.0F * std::sqrt(d2)), 1.0F);
      const float cost = static_cast<float>(corners_[solid]) + bins * turn;
      worth[solid] = width * (node.hi_y[c] - node.lo_y[c]) / (d2 * cost);
    }
  const std::uint64_t spent = stats.polar.draw_work();
  const double left = static_cast<double>(effort.draw > spent ? effort.draw - spent : 0);
  const double share = left / static_cast<double>(effort.draw_in_full);
  const auto count = static_cast<std::size_t>(share * static_cast<double>(worth.size()));
  scratch.wanted.assign(worth.size(), 0);
  if (count == 0) return;
  scratch.ranked = worth;
  std::nth_element(scratch.ranked.begin(),
                   scratch.ranked.begin() + static_cast<std::ptrdiff_t>(count - 1),
                   scratch.ranked.end(), std::greater<>());
  const float least = scratch.ranked[count - 1];
  for (std::size_t s = 0; s < worth.size(); ++s)
    scratch.wanted[s] = worth[s] >= least ? 1 : 0;
}

/// The options_.max_occluders solids of largest projected area (width times height over distance
/// squared), near ones first; of `among`, if that is given.
CullMap::Chosen CullMap::largest_solids(const Eye& eye,
                                        const std::vector<std::uint32_t>* among) const {
  const std::size_t given = among != nullptr ? among->size() : walls_.solids.size();
  const std::size_t most = options_.max_occluders > 0 ? options_.max_occluders : given;
  if (among == nullptr && most >= given) return {};
  std::vector<bool> wanted(walls_.solids.size(), among == nullptr);
  if (among != nullptr)
    for (const std::uint32_t s : *among)
      if (s < wanted.size()) wanted[s] = true;  // another method's would only draw others
  std::vector<std::uint32_t> chosen;
  struct Candidate {
    double area;
    double distance;
    std::uint32_t solid;
  };
  std::vector<Candidate> all;
  for (const BoxTree::Node& node : walls_.tree.nodes)
    for (std::uint32_t c = 0; c < node.count; ++c) {
      if ((node.child[c] & BoxTree::kItem) == 0 || !wanted[node.child[c] & ~BoxTree::kItem])
        continue;
      const auto at = [](float v) { return static_cast<double>(v); };
      const double dx =
          std::max({at(node.lo_x[c]) - eye.apex.x, eye.apex.x - at(node.hi_x[c]), 0.0});
      const double dz =
          std::max({at(node.lo_z[c]) - eye.apex.z, eye.apex.z - at(node.hi_z[c]), 0.0});
      const double d = std::max(std::hypot(dx, dz), 0.1);
      const double width =
          std::hypot(at(node.hi_x[c]) - at(node.lo_x[c]), at(node.hi_z[c]) - at(node.lo_z[c]));
      all.push_back({width * (at(node.hi_y[c]) - at(node.lo_y[c])) / (d * d), d,
                     node.child[c] & ~BoxTree::kItem});
    }
  const auto larger = [](const Candidate& a, const Candidate& b) {
    return a.area != b.area ? a.area > b.area : a.solid < b.solid;
  };
  const auto nearer = [](const Candidate& a, const Candidate& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.solid < b.solid;
  };
  const auto end = all.begin() + static_cast<std::ptrdiff_t>(std::min(most, all.size()));
  std::nth_element(all.begin(), end, all.end(), larger);
  std::sort(all.begin(), end, nearer);
  for (auto it = all.begin(); it != end; ++it)
    chosen.push_back(it->solid);
  return chosen;
}

void CullMap::draw_polar(const Eye& eye, const Chosen& chosen, const Effort& effort,
                         Scratch& scratch, Stats& stats) const {
  scratch.polar.clear();
  scratch.polar.set_horizon(nullptr);
  if (terrain_) {
    terrain_->draw(eye.single, scratch.horizon);
    if (!scratch.horizon.empty()) scratch.polar.set_horizon(&scratch.horizon);
  }
  DrawLimits limits;
  limits.wanted = scratch.wanted;
  limits.most = effort.draw;
  if (chosen) limits.only = *chosen;
  if (!chosen || !chosen->empty())
    draw_walls(walls_, eye.single, eye.floors, limits, guards_, scratch.polar, stats.polar);
  if (scratch.added) {
    DrawLimits of_added;
    of_added.most = effort.draw;
    draw_walls(*scratch.added, eye.single, eye.floors, of_added, guards_, scratch.polar,
               stats.polar);
  }
  scratch.polar.finish(eye.floors.undersides);
}

/// Does the orthographic map hide a child of a node?
bool CullMap::hidden_orthographic(const BoxTree::Node& node, std::uint32_t c, const Eye& eye,
                                  const Scratch& scratch, bool finished) const {
  const double top = static_cast<double>(node.hi_y[c]) - eye.apex.y;
  return orthographic_->hides(
      scratch.heights, {static_cast<double>(node.lo_x[c]), static_cast<double>(node.lo_z[c])},
      {static_cast<double>(node.hi_x[c]), static_cast<double>(node.hi_z[c])},
      static_cast<float>(top + 1e-6 * std::abs(top)), finished);
}

Status CullMap::draw_orthographic(const Eye& eye, const Chosen& chosen, Scratch& scratch) const {
  orthographic_->clear(scratch.heights);
  if (shadows_ && !shadows_failed_) {
    if (const auto drawn = draw_elsewhere(eye, chosen, scratch); !drawn) {
      if (options_.backend == Backend::kGl) return drawn;
      if (!shadows_failed_.exchange(true) && options_.log)
        options_.log(drawn.error().message + "; the CPU takes over");
      orthographic_->clear(scratch.heights);
      draw_here(eye, chosen, scratch);
    }
  } else {
    draw_here(eye, chosen, scratch);
  }
  orthographic_->finish(scratch.heights);
  return ok();
}

/// Without a choice: all, hidden or not.
Status CullMap::draw_elsewhere(const Eye& eye, const Chosen& chosen, Scratch& scratch) const {
  scratch.chains.clear();
  if (chosen) {
    for (const std::uint32_t s : *chosen)
      add_chains(s, eye, scratch.chains);
  } else {
    for (std::uint32_t s = 0; s < walls_.solids.size(); ++s)
      add_chains(s, eye, scratch.chains);
  }
  return shadows_->draw(scratch.chains, eye.apex, scratch.heights);
}

/// Without a choice: solids near first, skipping what is in shadow already.
void CullMap::draw_here(const Eye& eye, const Chosen& chosen, Scratch& scratch) const {
  const auto draw_one = [&](std::uint32_t solid) {
    scratch.chains.clear();
    add_chains(solid, eye, scratch.chains);
    orthographic_->draw(scratch.chains, eye.apex, scratch.heights);
  };
  if (chosen) {
    for (const std::uint32_t s : *chosen)
      draw_one(s);
  } else {
    struct Near {
      double distance;
      const BoxTree::Node* node;
      std::uint32_t child;
    };
    std::vector<Near> all;
    for (const BoxTree::Node& node : walls_.tree.nodes)
      for (std::uint32_t c = 0; c < node.count; ++c) {
        if ((node.child[c] & BoxTree::kItem) == 0) continue;
        const double dx = std::max({static_cast<double>(node.lo_x[c]) - eye.apex.x,
                                    eye.apex.x - static_cast<double>(node.hi_x[c]), 0.0});
        const double dz = std::max({static_cast<double>(node.lo_z[c]) - eye.apex.z,
                                    eye.apex.z - static_cast<double>(node.hi_z[c]), 0.0});
        all.push_back({std::max(dx, dz), &node, c});
      }
    std::sort(all.begin(), all.end(), [](const Near& a, const Near& b) {
      return a.distance != b.distance ? a.distance < b.distance
                                      : a.node->child[a.child] < b.node->child[b.child];
    });
    for (const Near& n : all)
      if (!hidden_orthographic(*n.node, n.child, eye, scratch, false))
        draw_one(n.node->child[n.child] & ~BoxTree::kItem);
  }
}

/// Appends the items of the tree that the finished map does not hide.
void CullMap::find(const BoxTree& tree, const Eye& eye, std::uint64_t most, Scratch& scratch,
                   std::vector<std::uint32_t>& found, Stats& stats) const {
  if (tree.nodes.empty()) return;
  if (!orthographic_) {
    find_visible(tree, 0, eye.single, eye.floors.undersides, scratch.polar, most, found,
                 stats.polar);
    return;
  }
  std::vector<std::uint32_t> stack{0};
  while (!stack.empty()) {
    const BoxTree::Node& node = tree.nodes[stack.back()];
    stack.pop_back();
    for (std::uint32_t c = 0; c < node.count; ++c) {
      if (hidden_orthographic(node, c, eye, scratch, true)) continue;
      if ((node.child[c] & BoxTree::kItem) != 0) {
        found.push_back(node.child[c] & ~BoxTree::kItem);
      } else {
        stack.push_back(node.child[c]);
      }
    }
  }
}

bool CullMap::within_extent(const Aabb& box) const {
  const Vec3 far = glm::max(glm::abs(box.lo - origin_), glm::abs(box.hi - origin_));
  return std::max({far.x, far.y, far.z}) <= extent_m_;
}

/// Few changes of occluders come in a while in which many solves do: the last one is kept.
std::shared_ptr<const WallSet> CullMap::added_walls(const Amendment* amendment) const {
  if (amendment == nullptr || !amendment->occluders || amendment->occluders->added.empty())
    return nullptr;
  const std::lock_guard lock(added_mutex_);
  if (added_of_.lock() != amendment->occluders) {
    // Beyond the extent single precision errs by more than the slack pays for.
    std::vector<Prism> prisms;
    for (const Prism& p : amendment->occluders->added)
      if (within_extent(p.bounds())) prisms.push_back(p);
    added_ = std::make_shared<const WallSet>(make_walls(prisms, occluders_.floor, origin_));
    added_of_ = amendment->occluders;
  }
  return added_;
}

/// Appends the placed objects that the finished map does not hide, and those that it cannot judge:
/// beyond the extent that the slack was made for single precision cannot tell them from the eye,
/// and below the floor sight lines pass under what reaches down without end.
void CullMap::find_placed(const Eye& eye, const Amendment& amendment, Scratch& scratch,
                          Stats& stats) const {
  std::vector<Aabb> boxes;
  std::vector<std::uint32_t> ids;
  for (const Amendment::Placed& p : amendment.placed) {
    if (!within_extent(p.bounds) || !(p.bounds.lo.y >= occluders_.floor)) {
      scratch.visible.push_back(p.object);
      continue;
    }
    boxes.push_back(p.bounds);
    ids.push_back(p.object);
  }
  find(BoxTree::pack(boxes, ids, origin_), eye, Effort::kUnbounded, scratch, scratch.visible,
       stats);
}

void CullMap::find_objects(const Eye& eye, const Effort& effort, Scratch& scratch,
                           Stats& stats) const {
  if (options_.threads <= 1 || orthographic_ || objects_.nodes.empty() ||
      effort.test != Effort::kUnbounded) {
    find(objects_, eye, effort.test, scratch, scratch.visible, stats);
    return;
  }
  // The tree's upper levels alone, then each subtree as a task: the same tests as in one thread.
  std::vector<std::uint32_t> roots{0};
  while (!roots.empty() && roots.size() < 8U * options_.threads) {
    std::vector<std::uint32_t> next;
    for (const std::uint32_t r : roots)
      find_visible_children(objects_, r, eye.single, eye.floors.undersides, scratch.polar,
                            scratch.visible, next, stats.polar);
    roots = std::move(next);
  }
  std::vector<std::vector<std::uint32_t>> found(roots.size());
  std::vector<PolarStats> counts(roots.size());
  tbb::task_arena arena(
      std::min(static_cast<int>(options_.threads), tbb::info::default_concurrency()));
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, roots.size(), [&](std::size_t i) {
      find_visible(objects_, roots[i], eye.single, eye.floors.undersides, scratch.polar,
                   Effort::kUnbounded, found[i], counts[i]);
    });
  });
  for (std::size_t i = 0; i < roots.size(); ++i) {
    scratch.visible.insert(scratch.visible.end(), found[i].begin(), found[i].end());
    stats.polar.nodes_tested += counts[i].nodes_tested;
  }
}

void CullMap::add_chains(std::uint32_t solid, const Eye& eye,
                         std::vector<ShadowChain>& chains) const {
  const WallSet::Solid& s = walls_.solids[solid];
  if ((s.floored && eye.floors.above_floor) || (s.grounded && eye.floors.on_ground))
    OrthographicMap::add_chains(walls_, s, eye.apex, chains);
}

}  // namespace ivis
