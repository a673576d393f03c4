#include "occluders/ground.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>
#include <string>
#include <unordered_map>

#include "occluders/ground_soup.h"

namespace ivis {
namespace {

constexpr double kAreaTolerance = 1e-9;
constexpr double kLeastCover = 0.9;     // of the scene's rectangle
constexpr std::size_t kBuriedIn = 100;  // at most one object in so many may lie under the ground
constexpr double kBuriedByM = 1e-3;
constexpr double kHeightTolerance = 1e-9;

std::string place(const Vec3& p) {
  std::ostringstream text;
  text.precision(9);
  text << "(" << p.x << ", " << p.y << ", " << p.z << ")";
  return text.str();
}

// Is the piece one continuous height field over its bounding rectangle? Empty when so, else why
// not.
//
// Let n(p) be the number of triangles over a point p of the rectangle that no edge covers. Along a
// path that avoids corners, n changes only where the path crosses edges; an edge of two triangles
// on opposite sides adds one and takes one, and an edge of one triangle lies on the rectangle's
// border. So n is one constant, and the areas add up to n times the rectangle's: n = 1. The
// triangles tile the rectangle edge to edge - a corner inside another's edge would lie under three
// half discs - and share edges whole, in height too: the height is a function and continuous.
// Single areas' signs are certain (see steep).
std::string flaw(const Soup& soup, const Piece& piece) {
  const auto on_border = [&](const Vec3& a, const Vec3& b) {
    const auto both = [](double u, double v, double side) { return u == side && v == side; };
    return both(a.x, b.x, piece.box.lo.x) || both(a.x, b.x, piece.box.hi.x) ||
           both(a.z, b.z, piece.box.lo.z) || both(a.z, b.z, piece.box.hi.z);
  };
  for (std::size_t i = 0; i < piece.sides.size();) {
    std::size_t end = 0;
    const EdgeFlaw wrong = edge_flaw(piece, i, end);
    const Vec3& a = soup.corners[piece.sides[i].lo];
    const Vec3& b = soup.corners[piece.sides[i].hi];
    const auto edge = [&] { return "the edge " + place(a) + " - " + place(b); };
    if (wrong == EdgeFlaw::kMany)
      return edge() + " belongs to " + std::to_string(end - i) + " triangles";
    if (wrong == EdgeFlaw::kFold) return "it folds over itself at " + edge();
    if (wrong == EdgeFlaw::kOpen && !on_border(a, b))
      return edge() + " is open inside (a hole, a crack or a T-junction)";
    i = end;
  }
  const Vec3 size = piece.box.size();
  const double rectangle = size.x * size.z;
  if (std::abs(piece.area - rectangle) > kAreaTolerance * rectangle)
    return "it does not cover its rectangle once";
  return {};
}

std::string percent(double share) {
  return std::to_string(std::lround(share * 1000) / 10) + " %";
}

Polygon rectangle_polygon(const Aabb& b) {
  return {{{{b.lo.x, b.lo.z}, {b.hi.x, b.lo.z}, {b.hi.x, b.hi.z}, {b.lo.x, b.hi.z}}}};
}

/// Objects that lie wholly under the ground, by more than a millimetre: under a real one next to
/// none.
std::size_t buried(const Scene& scene, const Ground& ground, std::size_t most) {
  std::size_t count = 0;
  for (const Object& o : sources(scene)) {
    if (o.always_visible) continue;
    Aabb box = o.bounds;
    box.lo = glm::max(box.lo, ground.rectangle().lo);
    box.hi = glm::min(box.hi, ground.rectangle().hi);
    if (box.lo.x > box.hi.x || box.lo.z > box.hi.z) continue;
    const double top = o.bounds.hi.y + kBuriedByM;
    if (top < ground.rectangle().hi.y && ground.covers_at_or_above(rectangle_polygon(box), top) &&
        ++count > most)
      return count;
  }
  return count;
}

// A convex piece of the plane and a segment; `apart` only when a line certainly separates them.
class Low {
 public:
  /// The part of triangle abc below y, by clipping; empty when none.
  Low(const Vec3& a, const Vec3& b, const Vec3& c, double y, const Vec2& origin, double rounding)
      : rounding_(rounding) {
    const Vec3* p[3] = {&a, &b, &c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& u = *p[k];
      const Vec3& v = *p[(k + 1) % 3];
      if (u.y < y) add(ivis::ground(u) - origin);
      if ((u.y < y) != (v.y < y)) {
        const double t = std::clamp((y - u.y) / (v.y - u.y), 0.0, 1.0);
        add(glm::mix(ivis::ground(u), ivis::ground(v), t) - origin);
      }
    }
  }
  Box2 box() const {
    Box2 box;
    for (std::size_t i = 0; i < n_; ++i)
      box.add(corner_[i]);
    box.lo -= 2 * rounding_;
    box.hi += 2 * rounding_;
    return box;
  }
  const Vec2& corner() const { return corner_[0]; }
  bool apart(const Vec2& p, const Vec2& q) const {
    if (across({1, 0}, p, q) || across({0, 1}, p, q)) return true;
    if (across({p.y - q.y, q.x - p.x}, p, q)) return true;
    for (std::size_t i = 0; i < n_; ++i) {
      const Vec2 d = corner_[(i + 1) % n_] - corner_[i];
      if (across({-d.y, d.x}, p, q)) return true;
    }
    return false;
  }

 private:
  void add(const Vec2& p) { corner_[n_++] = p; }
  bool across(const Vec2& n, const Vec2& p, const Vec2& q) const {
    const double length = glm::length(n);
    if (!(length > 1e-30)) return false;
    double least = std::numeric_limits<double>::infinity();
    double most = -least;
    for (std::size_t i = 0; i < n_; ++i) {
      const double along = glm::dot(n, corner_[i]);
      least = std::min(least, along);
      most = std::max(most, along);
    }
    const double u = glm::dot(n, p);
    const double v = glm::dot(n, q);
    return std::max(u, v) < least - rounding_ * length ||
           std::min(u, v) > most + rounding_ * length;
  }

  std::array<Vec2, 4> corner_{};
  std::size_t n_ = 0;
  double rounding_;
};

/// Footprint about a local origin, its edges in a tree.
class Outline {
 public:
  Outline(const Polygon& polygon, const Vec2& origin) {
    std::vector<Box2> boxes;
    for (const auto& ring : polygon.rings)
      for (std::size_t i = 0; i < ring.size(); ++i) {
        edges_.push_back({ring[i] - origin, ring[(i + 1) % ring.size()] - origin});
        Box2 box;
        for (const Vec2& p : edges_.back())
          box.add(p);
        boxes.push_back(box);
      }
    tree_ = RectTree(boxes);
  }
  bool meets(const Low& low) const {
    const bool apart = tree_.all(
        low.box(), [&](std::uint32_t i) { return low.apart(edges_[i][0], edges_[i][1]); });
    return !apart || contains(low.corner());
  }

 private:
  /// Even-odd; right for points away from the edges.
  bool contains(const Vec2& p) const {
    bool inside = false;
    tree_.all({p, {std::numeric_limits<double>::infinity(), p.y}}, [&](std::uint32_t i) {
      const Vec2& a = edges_[i][0];
      const Vec2& b = edges_[i][1];
      if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x))
        inside = !inside;
      return true;
    });
    return inside;
  }
  std::vector<std::array<Vec2, 2>> edges_;
  RectTree tree_;
};

}  // namespace

Ground::Ground(std::vector<Vec3> corners, std::vector<Corners> triangles,
               std::vector<std::uint32_t> objects)
    : objects_(std::move(objects)), corners_(std::move(corners)), triangles_(std::move(triangles)) {
  std::vector<Box2> boxes;
  boxes.reserve(triangles_.size());
  for (const Corners& t : triangles_) {
    Box2 box;
    for (const std::uint32_t c : t) {
      box.add(ivis::ground(corners_[c]));
      rectangle_.add(corners_[c]);
    }
    boxes.push_back(box);
  }
  tree_ = RectTree(boxes);
}

// The ground dips below y over the footprint only where the low part of some triangle, a convex
// polygon, meets it: then an edge of the footprint meets the low part, or the footprint holds all
// of it. Clipping at y - t/2 misplaces the low part by what equals a few 2^-53 |y| in height, far
// below t/2, and by a few 2^-53 of the coordinates in the plane, which `rounding` (64 of them)
// keeps clear of.
bool Ground::covers_at_or_above(const Polygon& footprint, double y) const {
  Box2 box;
  for (const auto& ring : footprint.rings)
    for (const Vec2& p : ring) {
      if (!(p.x >= rectangle_.lo.x && p.x <= rectangle_.hi.x && p.y >= rectangle_.lo.z &&
            p.y <= rectangle_.hi.z))
        return false;
      box.add(p);
    }
  if (!std::isfinite(y)) return false;
  const double highest =
      std::max({std::abs(rectangle_.lo.y), std::abs(rectangle_.hi.y), std::abs(y)});
  const double level = y - kHeightTolerance / 2 * highest;
  if (level <= rectangle_.lo.y) return true;
  const Vec3 largest = glm::max(glm::abs(rectangle_.lo), glm::abs(rectangle_.hi));
  const double rounding = 64 * 0x1p-53 * std::max(largest.x, largest.z);
  std::optional<Outline> outline;
  return tree_.all(box, [&](std::uint32_t t) {
    const Vec3& a = corners_[triangles_[t][0]];
    const Vec3& b = corners_[triangles_[t][1]];
    const Vec3& c = corners_[triangles_[t][2]];
    if (std::min({a.y, b.y, c.y}) >= level) return true;
    if (!outline) outline.emplace(footprint, box.lo);
    return !outline->meets(Low(a, b, c, level, box.lo, rounding));
  });
}

double Ground::height_at(double x, double z) const {
  constexpr double kOutside = -std::numeric_limits<double>::infinity();
  if (!(x >= rectangle_.lo.x && x <= rectangle_.hi.x && z >= rectangle_.lo.z &&
        z <= rectangle_.hi.z))
    return kOutside;
  double best = kOutside;  // smallest barycentric of the triangle that holds (x, z) best
  double height = kOutside;
  const Vec3 p{x, 0, z};
  tree_.all({{x, z}, {x, z}}, [&](std::uint32_t t) {
    const Vec3& a = corners_[triangles_[t][0]];
    const Vec3& b = corners_[triangles_[t][1]];
    const Vec3& c = corners_[triangles_[t][2]];
    const double whole = twice_area(a, b, c);
    const Vec3 w = Vec3{twice_area(p, b, c), twice_area(a, p, c), twice_area(a, b, p)} / whole;
    const double least = std::min({w.x, w.y, w.z});
    if (least > best) {
      best = least;
      const Vec3 inside = glm::max(w, Vec3{0});
      height = glm::dot(inside, Vec3{a.y, b.y, c.y}) / (inside.x + inside.y + inside.z);
    }
    return true;
  });
  return height;
}

std::optional<Ground> find_ground(const Scene& scene, const Context& context) {
  Aabb all;
  for (const Object& o : sources(scene))
    if (!o.always_visible) all.add(o.bounds);
  const Soup soup = ground_soup(scene, false);
  std::vector<Piece> pieces = split(soup);
  if (pieces.empty()) {
    context.say("no ground: no opaque object without steep triangles");
    return std::nullopt;
  }
  const auto name = [&](const Piece& p) {
    const Object& o = sources(scene)[soup.objects[p.triangles.front()]];
    return "node " + std::to_string(o.node) + " '" + scene.name_of(o) + "'";
  };
  std::sort(pieces.begin(), pieces.end(),
            [](const Piece& p, const Piece& q) { return p.area > q.area; });
  const double least = kLeastCover * all.size().x * all.size().z;
  if (pieces.front().area < least) {
    const std::string why = flaw(soup, pieces.front());
    context.say("no ground: the largest piece, at " + name(pieces.front()) + ", covers " +
                percent(pieces.front().area / least * kLeastCover) +
                " of the scene, expected 90 %" + (why.empty() ? std::string() : "; " + why));
    return std::nullopt;
  }
  std::erase_if(pieces, [&](const Piece& p) { return p.area < least; });
  // The highest first: a floor under the streets would be a ground too, but a useless one.
  std::sort(pieces.begin(), pieces.end(),
            [](const Piece& p, const Piece& q) { return p.volume / p.area > q.volume / q.area; });
  for (const Piece& piece : pieces) {
    if (const std::string why = flaw(soup, piece); !why.empty()) {
      context.say("no ground at " + name(piece) + ": " + why);
      continue;
    }
    std::vector<Vec3> corners;
    std::vector<Corners> triangles;
    std::vector<std::uint32_t> objects;
    std::unordered_map<std::uint32_t, std::uint32_t> renumbered;
    for (const std::uint32_t t : piece.triangles) {
      Corners& triangle = triangles.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t c = soup.triangles[t][k];
        const auto [it, fresh] =
            renumbered.try_emplace(c, static_cast<std::uint32_t>(corners.size()));
        if (fresh) corners.push_back(soup.corners[c]);
        triangle[k] = it->second;
      }
      if (objects.empty() || objects.back() != soup.objects[t]) objects.push_back(soup.objects[t]);
    }
    Ground ground(std::move(corners), std::move(triangles), std::move(objects));
    const std::size_t most = sources(scene).size() / kBuriedIn;
    if (buried(scene, ground, most) > most) {
      context.say("no ground at " + name(piece) +
                  ": objects lie wholly below it, it may be a ceiling");
      continue;
    }
    context.say("ground: " + std::to_string(ground.triangle_count()) + " triangles of " +
                std::to_string(ground.objects().size()) + " objects");
    return ground;
  }
  return std::nullopt;
}

}  // namespace ivis
