#include "occluders/wall_backing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "occluders/convex.h"
#include "occluders/plane_sections.h"
#include "occluders/progress.h"
#include "occluders/rect_tree.h"

namespace ivis {
namespace {

constexpr double kMostOutM = 1.5;  ///< from the plane to the object's highest point
constexpr double kInsideM = 0.005;
// What is larger hangs on no wall, and would take long.
constexpr std::size_t kMostCorners = 20'000;
constexpr std::size_t kMostWalls = 200;
constexpr double kMostRatio = 0.7;  ///< of per_level: what asks for more is hidden by maps as well

/// A face of a solid: a side of a prism, or of a convex solid.
struct Wall {
  PlaneFrame frame;     ///< n outwards; of a prism's side v is up
  std::uint32_t solid;  ///< prisms first, then convex solids
};

PlaneFrame upright_frame(const Vec3& normal, const Vec3& origin) {
  const Vec3 up{0, 1, 0};
  return {origin, glm::cross(up, normal), up, normal};
}

/// An object's place in a frame whose w is a wall's normal.
struct Extent {
  Vec2 lo{std::numeric_limits<double>::infinity()};
  Vec2 hi{-std::numeric_limits<double>::infinity()};
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
};

/// How far the section of a solid goes beyond an object's place, less what is kept for rounding.
struct Margin {
  double level = -1;
  double height = -1;
};

/// The frame of an upright wall: u level, v up.
Margin margin_in(const Prism& prism, const PlaneFrame& frame, const Vec2& lo, const Vec2& hi) {
  const double base = frame.origin.y;
  const Vec2 n = ground(frame.n);
  const Vec2 u = ground(frame.u);
  const Vec2 at = ground(frame.origin);
  const double middle = (lo.x + hi.x) / 2;
  double level = std::numeric_limits<double>::infinity();
  bool inside = false;
  for (const auto& ring : prism.footprint.rings)
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vec2 a = ring[i] - at;
      const Vec2 b = ring[(i + 1) % ring.size()] - at;
      const double da = glm::dot(n, a);
      const double db = glm::dot(n, b);
      if ((da > 0) == (db > 0)) continue;
      const double x = glm::dot(u, a + (b - a) * (da / (da - db)));
      inside ^= x > middle;
      level = std::min(level, x > middle ? x - hi.x : lo.x - x);
    }
  if (!inside) return {};
  return {level - kInsideM,
          std::min(base + lo.y - prism.bottom, prism.top - base - hi.y) - kInsideM};
}

/// The same in all directions of the plane.
Margin margin_in(const ConvexSolid& solid, const PlaneFrame& frame, const Vec2& lo,
                 const Vec2& hi) {
  double margin = std::numeric_limits<double>::infinity();
  for (const ConvexSolid::Plane& p : solid.planes) {
    const Vec2 across{glm::dot(p.normal, frame.u), glm::dot(p.normal, frame.v)};
    const double offset = p.offset - glm::dot(p.normal, frame.origin);
    const double most =
        std::max(across.x * lo.x, across.x * hi.x) + std::max(across.y * lo.y, across.y * hi.y);
    const double length = glm::length(across);
    if (length > 1e-6)
      margin = std::min(margin, (offset - most) / length);
    else if (offset <= most + 1e-6)
      return {};  // parallel, and before the plane
  }
  // A disc of this radius fits, so a square of half the diagonal does.
  margin = (margin - kInsideM) / std::numbers::sqrt2;
  return {margin, margin};
}

class WallBacker {
 public:
  WallBacker(const Scene& scene, const OccluderSet& set) : scene_(scene), set_(set) {
    std::vector<Box2> boxes;
    const auto add = [&](const Wall& wall, Box2 box) {
      walls_.push_back(wall);
      boxes.push_back(grown(box, kMostOutM));
    };
    for (const Prism& p : set.solids)
      solid_bounds_.push_back(p.bounds());
    for (const ConvexSolid& c : set.convex_solids)
      solid_bounds_.push_back(c.bounds);
    for (std::size_t s = 0; s < set.solids.size(); ++s)
      for (const auto& ring : set.solids[s].footprint.rings)
        for (std::size_t i = 0; i < ring.size(); ++i) {
          const Vec2& a = ring[i];
          const Vec2& b = ring[(i + 1) % ring.size()];
          const double length = glm::length(b - a);
          if (!(length > 0.1)) continue;
          // The interior is on the left (Polygon).
          const Vec3 normal{(b.y - a.y) / length, 0, -(b.x - a.x) / length};
          Box2 box;
          box.add(a);
          box.add(b);
          add({upright_frame(normal, {a.x, 0, a.y}), static_cast<std::uint32_t>(s)}, box);
        }
    for (std::size_t c = 0; c < set.convex_solids.size(); ++c) {
      const ConvexSolid& solid = set.convex_solids[c];
      const auto rings = face_rings(solid);
      for (std::size_t f = 0; f < rings.size(); ++f) {
        Box2 box;
        for (const Vec3& p : rings[f])
          box.add(ground(p));
        if (!rings[f].empty())
          add({frame_at(solid.planes[f].normal, rings[f][0]),
               static_cast<std::uint32_t>(set.solids.size() + c)},
              box);
      }
    }
    tree_ = RectTree(boxes);
  }

  std::optional<Backing> of(ObjectId id) const {
    const Object& object = scene_.objects[id];
    const Mesh& mesh = scene_.mesh_of(object);
    if (object.always_visible || mesh.triangles() == 0 || mesh.positions.size() > kMostCorners)
      return {};
    std::optional<Backing> best;
    std::vector<std::uint32_t> near;
    const Vec3 centre = object.bounds.centre();
    tree_.all(ground_box(object.bounds), [&](std::uint32_t w) {
      // The middle of what stands out this little is this near.
      const PlaneFrame& f = walls_[w].frame;
      if (std::abs(glm::dot(f.n, centre - f.origin)) <= kMostOutM &&
          within(object.bounds, walls_[w].solid))
        near.push_back(w);
      return true;
    });
    if (near.size() > kMostWalls) return {};
    std::ranges::sort(near);
    for (const std::uint32_t w : near) {
      const auto backing = on(object, walls_[w]);
      if (backing && (!best || backing->per_level < best->per_level)) best = backing;
    }
    if (best) best->object = id;
    return best;
  }

 private:
  /// The object's place is held by the solid's, all that stands out excepted.
  bool within(const Aabb& box, std::uint32_t solid) const {
    Aabb held = solid_bounds_[solid];
    held.lo -= Vec3{kMostOutM};
    held.hi += Vec3{kMostOutM};
    return held.contains(box.lo) && held.contains(box.hi);
  }

  std::optional<Backing> on(const Object& object, const Wall& wall) const {
    const Mesh& mesh = scene_.mesh_of(object);
    const PlaneFrame& face = wall.frame;
    Extent e;
    for (const glm::vec3& position : mesh.positions) {
      const Vec3 p(object.to_world * glm::dvec4(Vec3(position), 1.0));
      const double out = glm::dot(face.n, p - face.origin);
      e.low = std::min(e.low, out);
      e.high = std::max(e.high, out);
      if (e.high - e.low > kMostOutM) return {};
      const Vec2 q = face.to_plane(p);
      e.lo = glm::min(e.lo, q);
      e.hi = glm::max(e.hi, q);
    }
    const double plane = std::min(e.low, 0.0) - kInsideM;
    const double h = e.high - plane;
    if (h > kMostOutM) return {};
    const PlaneFrame frame{face.origin + face.n * plane, face.u, face.v, face.n};
    const Margin m =
        wall.solid < set_.solids.size()
            ? margin_in(set_.solids[wall.solid], frame, e.lo, e.hi)
            : margin_in(set_.convex_solids[wall.solid - set_.solids.size()], frame, e.lo, e.hi);
    if (!(h < kMostRatio * m.level && m.height > kInsideM)) return {};
    return Backing{0, {frame.n, glm::dot(frame.n, frame.origin)}, h / m.level, h / m.height};
  }

  const Scene& scene_;
  const OccluderSet& set_;
  std::vector<Wall> walls_;
  std::vector<Aabb> solid_bounds_;
  RectTree tree_;
};

}  // namespace

std::vector<Backing> find_wall_backings(const Scene& scene, const OccluderSet& set,
                                        const Context& context) {
  if (set.solids.empty() && set.convex_solids.empty()) return {};
  const WallBacker backer(scene, set);
  std::vector<bool> has(scene.objects.size(), false);
  for (const Backing& b : set.backings)
    has[b.object] = true;
  std::vector<std::optional<Backing>> found(scene.objects.size());
  Progress progress(context, "walls behind objects", found.size());
  parallel_for(context, found.size(), [&](std::size_t i) {
    if (!has[i]) found[i] = backer.of(static_cast<ObjectId>(i));
    progress.step();
  });
  std::vector<Backing> all;
  if (context.stopped()) return all;
  for (const auto& b : found)
    if (b) all.push_back(*b);
  return all;
}

}  // namespace ivis
