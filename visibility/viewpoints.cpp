#include "visibility/viewpoints.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "visibility/sampling.h"

namespace ivis {
namespace {

/// Which side of the line ab in the ground plane p lies on. Always computed from the same end, so
/// that the two triangles at an edge never both claim a point above it, nor both leave it out.
bool left_of(const Vec3& a, const Vec3& b, const Vec3& p) {
  const bool swap = std::pair(b.x, b.z) < std::pair(a.x, a.z);
  const Vec3& s = swap ? b : a;
  const Vec3& t = swap ? a : b;
  return ((t.x - s.x) * (p.z - s.z) - (t.z - s.z) * (p.x - s.x) > 0) != swap;
}

/// Does the vertical ray upwards from p cross the triangle?
bool above(const Triangle& t, const Vec3& p) {
  const bool u = left_of(t.a, t.b, p);
  if (u != left_of(t.b, t.c, p) || u != left_of(t.c, t.a, p)) return false;
  const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
  if (n.y == 0) return false;
  return t.a.y - (n.x * (p.x - t.a.x) + n.z * (p.z - t.a.z)) / n.y > p.y;
}

std::vector<bool> opaque_triangles(const Mesh& mesh) {
  std::vector<bool> opaque(mesh.triangles());
  for (const Primitive& p : mesh.primitives)
    for (std::uint32_t t = 0; t < p.triangles; ++t)
      opaque[p.first_triangle + t] = p.opaque;
  return opaque;
}

}  // namespace

FreeSpace::FreeSpace(const Scene& scene, const OccluderSet* occluders,
                     const ExactSegments& segments)
    : scene_(scene), occluders_(occluders), segments_(segments) {
  if (occluders != nullptr)
    for (const Prism& p : occluders->solids)
      prism_bounds_.push_back(p.bounds());
  find_grounds();
}

std::shared_ptr<const FreeSpace::Pieces> FreeSpace::pieces_of(std::uint32_t index) const {
  const std::lock_guard lock(mutex_);
  auto& slot = pieces_[index];
  if (slot) return slot;

  const Mesh& mesh = scene_.meshes[index];
  const std::size_t n = mesh.triangles();
  const std::vector<bool> opaque = opaque_triangles(mesh);
  struct PositionHash {
    std::size_t operator()(const std::array<float, 3>& p) const {
      std::uint64_t h = 0;
      for (const float x : p)
        h = mix(h ^ std::bit_cast<std::uint32_t>(x));
      return h;
    }
  };
  std::unordered_map<std::array<float, 3>, std::uint32_t, PositionHash> weld;
  std::vector<std::uint32_t> vertex(mesh.positions.size());
  for (std::size_t i = 0; i < vertex.size(); ++i) {
    const auto& p = mesh.positions[i];  // + 0: minus zero is zero
    vertex[i] =
        weld.try_emplace({p.x + 0.0F, p.y + 0.0F, p.z + 0.0F}, static_cast<std::uint32_t>(i))
            .first->second;
  }

  std::vector<std::uint32_t> parent(n);
  std::iota(parent.begin(), parent.end(), 0U);
  const auto find = [&](std::uint32_t t) {
    while (parent[t] != t)
      t = parent[t] = parent[parent[t]];
    return t;
  };
  struct Edge {
    std::uint32_t triangle = 0;
    bool odd = false;
  };
  std::unordered_map<std::uint64_t, Edge> edges;
  for (std::uint32_t t = 0; t < n; ++t) {
    if (!opaque[t]) continue;
    const std::array<std::uint32_t, 3> v{vertex[mesh.indices[3 * std::size_t{t}]],
                                         vertex[mesh.indices[3 * std::size_t{t} + 1]],
                                         vertex[mesh.indices[3 * std::size_t{t} + 2]]};
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;  // a line: bounds nothing
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [lo, hi] = std::minmax(v[k], v[(k + 1) % 3]);
      const auto [it, fresh] = edges.try_emplace((std::uint64_t{lo} << 32U) | hi, Edge{t, false});
      it->second.odd = !it->second.odd;
      if (!fresh) parent[find(t)] = find(it->second.triangle);
    }
  }
  std::vector<bool> open(n);
  for (const auto& [key, edge] : edges)
    if (edge.odd) open[find(edge.triangle)] = true;

  auto pieces = std::make_shared<Pieces>();
  pieces->piece.assign(n, Pieces::kOpen);
  std::vector<std::uint32_t> number(n, Pieces::kOpen);
  for (std::uint32_t t = 0; t < n; ++t) {
    if (!opaque[t]) continue;
    const std::uint32_t root = find(t);
    if (open[root]) {
      pieces->any_open = true;
      continue;
    }
    if (number[root] == Pieces::kOpen) number[root] = pieces->count++;
    pieces->piece[t] = number[root];
  }
  slot = std::move(pieces);
  return slot;
}

bool FreeSpace::inside_prism(const Vec3& p) const {
  if (occluders_ == nullptr) return false;
  for (std::size_t i = 0; i < prism_bounds_.size(); ++i)
    if (prism_bounds_[i].contains(p) && contains(occluders_->solids[i].footprint, ground(p)))
      return true;
  for (const ConvexSolid& c : occluders_->convex_solids)
    if (c.bounds.contains(p) && contains(c, p)) return true;
  // Where no observer gets to, whatever is there.
  for (const Aabb& b : occluders_->closed_boxes)
    if (b.contains(p)) return true;
  return false;
}

/// Pieces are counted apart: where two closed pieces of one object overlap, both are entered.
bool FreeSpace::inside_closed_piece(const Object& o, const Vec3& p) const {
  const auto pieces = pieces_of(o.mesh);
  if (pieces->count == 0) return false;
  std::vector<bool> odd(pieces->count);
  for (std::size_t t = 0; t < pieces->piece.size(); ++t) {
    const std::uint32_t piece = pieces->piece[t];
    if (piece != Pieces::kOpen && above(world_triangle(scene_, o, t), p)) odd[piece] = !odd[piece];
  }
  return std::find(odd.begin(), odd.end(), true) != odd.end();
}

bool FreeSpace::below(const Group& group, const Vec3& p) const {
  for (const Object* o : group) {
    if (p.x < o->bounds.lo.x || p.x > o->bounds.hi.x || p.z < o->bounds.lo.z ||
        p.z > o->bounds.hi.z || p.y > o->bounds.hi.y)
      continue;
    const std::vector<bool> opaque = opaque_triangles(scene_.mesh_of(*o));
    bool odd = false;
    for (std::size_t t = 0; t < opaque.size(); ++t)
      if (opaque[t] && above(world_triangle(scene_, *o, t), p)) odd = !odd;
    if (odd) return true;
  }
  return false;
}

/// Open objects without steep triangles, joined where they share a corner.
std::vector<FreeSpace::Group> FreeSpace::tiles() const {
  constexpr double kSteep = 1e-6;  // of the normal
  struct PositionHash {
    std::size_t operator()(const std::array<double, 3>& p) const {
      std::uint64_t h = 0;
      for (const double x : p)
        h = mix(h ^ std::bit_cast<std::uint64_t>(x));
      return h;
    }
  };
  Group objects;
  std::vector<std::uint32_t> parent;
  const auto find = [&](std::uint32_t i) {
    while (parent[i] != i)
      i = parent[i] = parent[parent[i]];
    return i;
  };
  std::unordered_map<std::array<double, 3>, std::uint32_t, PositionHash> first_at;
  for (const Object& o : sources(scene_)) {
    const std::size_t n = scene_.mesh_of(o).triangles();
    if (o.always_visible || o.tag == OccluderTag::kNever || n == 0) continue;
    bool level = true;
    for (std::size_t t = 0; t < n && level; ++t) {
      const Triangle w = world_triangle(scene_, o, t);
      const Vec3 normal = glm::cross(w.b - w.a, w.c - w.a);
      level = std::abs(normal.y) >= kSteep * glm::length(normal);
    }
    if (!level || !pieces_of(o.mesh)->any_open) continue;
    const auto mine = static_cast<std::uint32_t>(objects.size());
    objects.push_back(&o);
    parent.push_back(mine);
    for (std::size_t t = 0; t < n; ++t) {
      const Triangle w = world_triangle(scene_, o, t);
      for (const Vec3& p : {w.a, w.b, w.c}) {
        const auto [it, fresh] = first_at.try_emplace({p.x + 0.0, p.y + 0.0, p.z + 0.0}, mine);
        if (!fresh) parent[find(mine)] = find(it->second);
      }
    }
  }
  std::map<std::uint32_t, Group> groups;
  for (std::uint32_t i = 0; i < objects.size(); ++i)
    groups[find(i)].push_back(objects[i]);
  std::vector<Group> several;
  for (auto& [root, group] : groups)
    if (group.size() > 1) several.push_back(std::move(group));
  return several;
}

void FreeSpace::find_grounds() {
  constexpr std::size_t kProbes = 32;
  const Vec3 half = scene_.bounds.empty() ? Vec3{0} : scene_.bounds.size() * 0.5;
  std::vector<Group> candidates = tiles();
  for (const Object& o : sources(scene_)) {
    const Vec3 size = o.bounds.size();
    if (o.always_visible || scene_.mesh_of(o).triangles() == 0 || size.x < half.x ||
        size.z < half.z)
      continue;
    if (pieces_of(o.mesh)->any_open) candidates.push_back({&o});
  }
  for (Group& group : candidates) {
    Aabb box;
    for (const Object* o : group)
      box.add(o->bounds);
    if (box.size().x < half.x || box.size().z < half.z) continue;
    std::size_t probes = 0;
    std::size_t under = 0;
    const std::size_t step = std::max<std::size_t>(1, sources(scene_).size() / kProbes);
    for (std::size_t i = 0; i < sources(scene_).size(); i += step) {
      const Object& other = sources(scene_)[i];
      if (std::find(group.begin(), group.end(), &other) != group.end()) continue;
      ++probes;
      if (below(group, {other.bounds.centre().x, other.bounds.hi.y, other.bounds.centre().z}))
        ++under;
    }
    if (2 * under < std::max<std::size_t>(probes, 1)) grounds_.push_back(std::move(group));
  }
}

bool FreeSpace::inside_solid(const Vec3& p) const {
  if (inside_prism(p)) return true;
  for (const auto* list : {&sources(scene_), &scene_.hidden_solids})
    for (const Object& o : *list)
      if (!o.always_visible && o.tag != OccluderTag::kNever && o.bounds.contains(p) &&
          inside_closed_piece(o, p))
        return true;
  return false;
}

bool FreeSpace::is_free(const Vec3& p) const {
  if (inside_solid(p)) return false;
  return std::none_of(grounds_.begin(), grounds_.end(),
                      [&](const Group& g) { return below(g, p); });
}

std::vector<Vec3> FreeSpace::viewpoints(const ViewCell& cell, std::size_t n, std::uint64_t seed,
                                        std::size_t* discarded) const {
  std::vector<Vec3> all{cell.eye};
  const auto add = [&](const Vec3& v) {
    if (std::find(all.begin(), all.end(), cell.eye + v) == all.end()) all.push_back(cell.eye + v);
  };
  const std::size_t extreme = n > 1 ? (n - 1) * 3 / 4 : 0;
  for (const Vec3& v : cell.reach.extreme_points(static_cast<int>(extreme)))
    add(v);
  Random random(seed);
  for (std::size_t i = 1 + extreme; i < n; ++i) {
    Vec3 v{0};
    for (int tries = 0; tries < 64; ++tries) {
      v = cell.reach.half_extents() *
          Vec3{2 * random.unit() - 1, 2 * random.unit() - 1, 2 * random.unit() - 1};
      if (cell.reach.contains(v)) break;
      v = Vec3{0};
    }
    add(v);
  }

  // Flood from the eye, if it counts, over clear straight lines; then from each further one that is
  // free.
  enum class State { kUnknown, kCounts, kNot };
  std::vector<State> state(all.size(), State::kUnknown);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (inside_prism(all[i])) state[i] = State::kNot;
  std::vector<std::size_t> frontier;
  const auto flood = [&] {
    while (!frontier.empty()) {
      const std::size_t from = frontier.back();
      frontier.pop_back();
      for (std::size_t i = 0; i < all.size(); ++i)
        if (state[i] == State::kUnknown && !segments_.blocked(all[from], all[i])) {
          state[i] = State::kCounts;
          frontier.push_back(i);
        }
    }
  };
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (state[i] != State::kUnknown) continue;
    state[i] = is_free(all[i]) ? State::kCounts : State::kNot;
    if (state[i] == State::kCounts) {
      frontier.push_back(i);
      flood();
    }
  }
  std::vector<Vec3> counted;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (state[i] == State::kCounts) counted.push_back(all[i]);
  if (discarded != nullptr) *discarded = all.size() - counted.size();
  return counted;
}

}  // namespace ivis
