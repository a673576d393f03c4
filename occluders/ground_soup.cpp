#include "occluders/ground_soup.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <unordered_map>

namespace ivis {
namespace {

// Below this share of its longest edge squared, a triangle's projection counts as none: far above
// rounding, so the sign of what passes is certain.
constexpr double kLeastAreaRatio = 1e-9;
constexpr double kAreaTolerance = 1e-9;

bool steep(const Vec3& a, const Vec3& b, const Vec3& c, double twice) {
  const auto length2 = [](const Vec2& v) { return glm::dot(v, v); };
  const double longest = std::max({length2(ground(b) - ground(a)), length2(ground(c) - ground(b)),
                                   length2(ground(a) - ground(c))});
  return !(std::abs(twice) > kLeastAreaRatio * longest);
}

struct SameBits {
  bool operator()(const Vec3& a, const Vec3& b) const { return a == b; }
};
struct HashBits {
  std::size_t operator()(const Vec3& p) const {
    std::uint64_t h = 0;
    for (const double v : {p.x, p.y, p.z}) {
      h = (h ^ std::bit_cast<std::uint64_t>(v)) * 0x9e3779b97f4a7c15U;
      h ^= h >> 29U;
    }
    return h;
  }
};

bool all_opaque(const Mesh& mesh) {
  return std::all_of(mesh.primitives.begin(), mesh.primitives.end(),
                     [](const Primitive& p) { return p.opaque || p.triangles == 0; });
}

/// Gives the object's triangles, and twice their signed projected areas, to `take`, if all may be
/// ground so far; returns whether all may.
template <class F>
bool find_flat(const Scene& scene, const Object& object, const F& take) {
  const Mesh& mesh = scene.mesh_of(object);
  if (object.always_visible || mesh.triangles() == 0 || !all_opaque(mesh)) return false;
  // A mirroring transform turns the winding round.
  const double up = glm::determinant(glm::dmat3(object.to_world)) < 0 ? 1 : -1;
  double twice_sum = 0;
  for (const Primitive& p : mesh.primitives) {
    const bool one_side = scene.honour_sidedness && !p.double_sided;
    for (std::size_t t = p.first_triangle; t < std::size_t{p.first_triangle} + p.triangles; ++t) {
      Triangle tri = world_triangle(scene, object, t);
      for (Vec3* c : {&tri.a, &tri.b, &tri.c})
        *c += 0.0;                                                       // -0 becomes 0
      if (tri.a == tri.b || tri.b == tri.c || tri.c == tri.a) continue;  // covers nothing
      const double twice = twice_area(tri.a, tri.b, tri.c);
      if (steep(tri.a, tri.b, tri.c, twice) || (one_side && twice * up <= 0)) return false;
      twice_sum += std::abs(twice);
      take(tri, twice);
    }
  }
  // What covers more than its own rectangle lies over itself: a closed thing, a tree's crown.
  const Vec3 size = object.bounds.size();
  return twice_sum <= 2 * size.x * size.z * (1 + kAreaTolerance);
}

class SoupBuilder {
 public:
  SoupBuilder(const Scene& scene, bool occluders_only) : scene_(scene) {
    for (std::size_t i = 0; i < sources(scene).size(); ++i)
      if (!occluders_only || sources(scene)[i].tag != OccluderTag::kNever)
        add(static_cast<std::uint32_t>(i));
  }
  Soup take() { return std::move(soup_); }

 private:
  void add(std::uint32_t index) {
    found_.clear();
    const auto keep = [&](const Triangle& t, double twice) { found_.push_back({t, twice}); };
    if (!find_flat(scene_, sources(scene_)[index], keep)) return;
    for (const Found& f : found_) {
      soup_.triangles.push_back({corner(f.triangle.a), corner(f.triangle.b), corner(f.triangle.c)});
      soup_.twice.push_back(f.twice);
      soup_.objects.push_back(index);
    }
  }

  std::uint32_t corner(const Vec3& p) {
    const auto [it, fresh] = ids_.try_emplace(p, static_cast<std::uint32_t>(soup_.corners.size()));
    if (fresh) soup_.corners.push_back(p);
    return it->second;
  }

  struct Found {
    Triangle triangle;
    double twice;
  };
  const Scene& scene_;
  Soup soup_;
  std::vector<Found> found_;
  std::unordered_map<Vec3, std::uint32_t, HashBits, SameBits> ids_;
};

std::vector<Side> sorted_sides(const Soup& soup) {
  std::vector<Side> sides;
  sides.reserve(soup.triangles.size() * 3);
  for (std::size_t t = 0; t < soup.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = soup.triangles[t][k];
      const std::uint32_t b = soup.triangles[t][(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), static_cast<std::uint32_t>(t),
                       (a < b) == (soup.twice[t] > 0)});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) {
    return p.lo != q.lo ? p.lo < q.lo : p.hi != q.hi ? p.hi < q.hi : p.triangle < q.triangle;
  });
  return sides;
}

class Pieces {
 public:
  explicit Pieces(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0U); }
  std::uint32_t root(std::uint32_t i) {
    while (parent_[i] != i)
      i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) { parent_[root(a)] = root(b); }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

bool may_be_ground(const Scene& scene, const Object& object) {
  bool any = false;
  return find_flat(scene, object, [&](const Triangle&, double) { any = true; }) && any;
}

Soup ground_soup(const Scene& scene, bool occluders_only) {
  return SoupBuilder(scene, occluders_only).take();
}

std::vector<Piece> split(const Soup& soup) {
  const std::vector<Side> sides = sorted_sides(soup);
  Pieces pieces(soup.triangles.size());
  for (std::size_t i = 1; i < sides.size(); ++i)
    if (sides[i].same_edge(sides[i - 1])) pieces.join(sides[i].triangle, sides[i - 1].triangle);
  std::vector<Piece> result;
  std::unordered_map<std::uint32_t, std::size_t> of_root;
  const auto piece_of = [&](std::size_t t) -> Piece& {
    const auto [it, fresh] =
        of_root.try_emplace(pieces.root(static_cast<std::uint32_t>(t)), result.size());
    if (fresh) result.emplace_back();
    return result[it->second];
  };
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    Piece& piece = piece_of(t);
    piece.triangles.push_back(static_cast<std::uint32_t>(t));
    double height = 0;
    for (const std::uint32_t c : soup.triangles[t]) {
      piece.box.add(soup.corners[c]);
      height += soup.corners[c].y / 3;
    }
    piece.area += std::abs(soup.twice[t]) / 2;
    piece.volume += std::abs(soup.twice[t]) / 2 * height;
  }
  for (const Side& s : sides)
    piece_of(s.triangle).sides.push_back(s);
  return result;
}

EdgeFlaw edge_flaw(const Piece& piece, std::size_t first, std::size_t& end) {
  end = first + 1;
  while (end < piece.sides.size() && piece.sides[end].same_edge(piece.sides[first]))
    ++end;
  if (end - first > 2) return EdgeFlaw::kMany;
  if (end - first == 1) return EdgeFlaw::kOpen;
  return piece.sides[first].left == piece.sides[first + 1].left ? EdgeFlaw::kFold : EdgeFlaw::kNone;
}

}  // namespace ivis
