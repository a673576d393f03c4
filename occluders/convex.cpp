#include "occluders/convex.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "occluders/clip.h"
#include "occluders/closed_mesh.h"

namespace ivis {
namespace {

using Plane = ConvexSolid::Plane;
using Triangles = std::vector<std::array<std::uint32_t, 3>>;

constexpr double kConvexShare = 1e-6;  ///< of the size: how far a corner may stand out
constexpr std::size_t kMaxPlanes = 512;
constexpr int kNoPlane = -1;

/// What rounding may do to a corner: clipping is in double, relative to the solid's centre.
double rounding(const Aabb& bounds) {
  const Vec3 far = glm::max(glm::abs(bounds.lo), glm::abs(bounds.hi));
  return 1e-8 * glm::length(bounds.size()) + 1e-14 * std::max({far.x, far.y, far.z});
}

/// A convex polyhedron that half-spaces are cut off from: corners, and faces as rings of them.
class Polytope {
 public:
  struct Face {
    std::vector<std::uint32_t> ring;
    int plane = kNoPlane;
  };

  explicit Polytope(const Vec3& half) : eps_(1e-11 * glm::length(half)) {
    for (const double y : {-half.y, half.y})
      for (const Vec2& c : {Vec2{-half.x, -half.z}, Vec2{half.x, -half.z}, Vec2{half.x, half.z},
                            Vec2{-half.x, half.z}})
        points.emplace_back(c.x, y, c.y);
    for (const auto& ring : std::initializer_list<std::vector<std::uint32_t>>{
             {0, 1, 2, 3}, {7, 6, 5, 4}, {0, 4, 5, 1}, {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}})
      faces.push_back({ring, kNoPlane});
  }

  void cut(const Vec3& n, double offset, int plane) {
    std::vector<double> d(points.size());
    std::vector<int> side(points.size());
    bool any_out = false;
    for (std::size_t i = 0; i < points.size(); ++i) {
      d[i] = glm::dot(n, points[i]) - offset;
      side[i] = d[i] > eps_ ? 1 : d[i] < -eps_ ? -1 : 0;
    }
    for (const Face& f : faces)
      for (const std::uint32_t i : f.ring)
        any_out = any_out || side[i] > 0;
    if (!any_out) return;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> on_edge;
    const auto between = [&](std::uint32_t a, std::uint32_t b) {
      const auto key = std::minmax(a, b);
      const auto [it, fresh] = on_edge.try_emplace(key, static_cast<std::uint32_t>(points.size()));
      if (fresh) {
        const auto [p, q] = key;
        points.push_back(points[p] + (points[q] - points[p]) * (d[p] / (d[p] - d[q])));
      }
      return it->second;
    };
    std::vector<std::uint32_t> cap;
    std::vector<Face> kept;
    for (Face& f : faces) {
      std::vector<std::uint32_t> ring;
      bool any_in = false;
      for (std::size_t i = 0; i < f.ring.size(); ++i) {
        const std::uint32_t a = f.ring[i];
        const std::uint32_t b = f.ring[(i + 1) % f.ring.size()];
        any_in = any_in || side[a] < 0;
        if (side[a] <= 0) ring.push_back(a);
        if (side[a] * side[b] < 0) ring.push_back(between(a, b));
      }
      if (!any_in || ring.size() < 3) continue;
      for (const std::uint32_t i : ring)
        if (i >= side.size() || side[i] == 0) cap.push_back(i);
      kept.push_back({std::move(ring), f.plane});
    }
    faces = std::move(kept);
    std::sort(cap.begin(), cap.end());
    cap.erase(std::unique(cap.begin(), cap.end()), cap.end());
    if (faces.empty() || cap.size() < 3) return;
    // The cut is convex: its corners in their order about its centre.
    Vec3 centre{0};
    for (const std::uint32_t i : cap)
      centre += points[i] / static_cast<double>(cap.size());
    const Vec3 u =
        glm::normalize(glm::cross(n, std::abs(n.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
    const Vec3 v = glm::cross(n, u);
    std::vector<double> angle(points.size());
    for (const std::uint32_t i : cap)
      angle[i] = std::atan2(glm::dot(points[i] - centre, v), glm::dot(points[i] - centre, u));
    std::sort(cap.begin(), cap.end(), [&](auto a, auto b) { return angle[a] < angle[b]; });
    faces.push_back({std::move(cap), plane});
  }

  std::vector<Vec3> points;
  std::vector<Face> faces;

 private:
  double eps_;
};

bool finite(const Vec3& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

/// The solid's faces, whose corners lie `pad` inside every plane; no face when that cannot be had.
/// Corners are in world coordinates.
Polytope polytope(const ConvexSolid& solid, double pad) {
  Polytope nothing(Vec3{1});
  nothing.faces.clear();
  if (solid.bounds.empty() || solid.planes.size() > kMaxPlanes) return nothing;
  const Vec3 centre = solid.bounds.centre();
  const Vec3 half = solid.bounds.size() * 0.5;
  // Farther out than the bounds, so that a solid which the planes leave open is told from one that
  // they close.
  Polytope p(half + Vec3{glm::length(half)});
  for (std::size_t i = 0; i < solid.planes.size() && !p.faces.empty(); ++i) {
    const Plane& plane = solid.planes[i];
    p.cut(plane.normal, plane.offset - pad - glm::dot(plane.normal, centre), static_cast<int>(i));
  }
  if (p.faces.size() < 4) return nothing;
  for (const Polytope::Face& f : p.faces)
    if (f.plane == kNoPlane) return nothing;
  for (Vec3& x : p.points)
    x += centre;
  // The gate: shares nothing with the clipping. Faces of points inside are inside, as it is convex.
  for (const Polytope::Face& f : p.faces)
    for (const std::uint32_t i : f.ring) {
      if (!finite(p.points[i])) return nothing;
      for (const Plane& plane : solid.planes)
        if (!(glm::dot(plane.normal, p.points[i]) <= plane.offset)) return nothing;
    }
  return p;
}

/// How often a ray from `from` along `d` meets the triangles.
std::size_t crossings(const std::vector<Vec3>& points, const Triangles& triangles, const Vec3& from,
                      const Vec3& d) {
  std::size_t n = 0;
  for (const auto& t : triangles) {
    const Vec3 a = points[t[0]] - from;
    const Vec3 b = points[t[1]] - from;
    const Vec3 c = points[t[2]] - from;
    // Signs of the volumes that d spans with the sides: all alike when the line passes through.
    const double ab = glm::dot(d, glm::cross(a, b));
    const double bc = glm::dot(d, glm::cross(b, c));
    const double ca = glm::dot(d, glm::cross(c, a));
    const bool through = (ab > 0 && bc > 0 && ca > 0) || (ab < 0 && bc < 0 && ca < 0);
    if (!through) continue;
    const Vec3 normal = glm::cross(b - a, c - a);
    if (glm::dot(normal, a) / glm::dot(normal, d) > 0) ++n;
  }
  return n;
}

bool upright(const ConvexSolid& solid) {
  return std::all_of(solid.planes.begin(), solid.planes.end(), [](const Plane& p) {
    return std::abs(p.normal.y) < 1e-6 || std::abs(p.normal.y) > 1 - 1e-12;
  });
}

}  // namespace

// Every triangle either lies on a plane found before, or makes one that all corners lie behind
// (within the tolerance); the solid is what lies behind the lowest corner of every plane, so no
// triangle enters it: parity is one for all of it, and is asked once. Seams (seam_m > 0): the
// planes are the faces' mean planes; that the faces close the solid is seen from their areas.
std::optional<ConvexSolid> recognise_convex(const std::vector<Vec3>& points,
                                            const Triangles& triangles, double seam_m) {
  struct Found {
    Vec3 rough;  ///< unit
    double rough_offset;
    Vec3 normal_sum{0};
    std::vector<std::uint32_t> members;
    double area = 0;
  };
  Aabb bounds;
  Vec3 centre{0};
  for (const auto& t : triangles)
    for (const std::uint32_t i : t)
      bounds.add(points[i]);
  if (bounds.empty() || triangles.size() < 4) return std::nullopt;
  const Vec3 origin = bounds.centre();
  std::vector<std::uint32_t> used;
  for (const auto& t : triangles)
    used.insert(used.end(), t.begin(), t.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (const std::uint32_t i : used)
    centre += (points[i] - origin) / static_cast<double>(used.size());
  const double size = glm::length(bounds.size());
  const double tolerance = std::max(seam_m, kConvexShare * size);

  std::vector<Vec3> doubled(triangles.size());  // twice the area along the normal, outwards
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& c = triangles[t];
    Vec3 n = glm::cross(points[c[1]] - points[c[0]], points[c[2]] - points[c[0]]);
    if (glm::dot(n, points[c[0]] - origin - centre) < 0) n = -n;
    doubled[t] = n;
  }
  std::vector<std::uint32_t> order(triangles.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) {
    return glm::dot(doubled[a], doubled[a]) > glm::dot(doubled[b], doubled[b]);
  });
  std::vector<Found> found;
  for (const std::uint32_t t : order) {
    const auto& c = triangles[t];
    const double twice = glm::length(doubled[t]);
    const auto on = [&](const Found& f) {
      return std::all_of(c.begin(), c.end(), [&](std::uint32_t i) {
        return std::abs(glm::dot(f.rough, points[i] - origin) - f.rough_offset) <= tolerance;
      });
    };
    const auto same = std::find_if(found.begin(), found.end(), on);
    if (same != found.end()) {
      same->members.push_back(t);
      same->area += twice / 2;
      // A sliver's normal is mostly rounding.
      if (glm::dot(same->rough, doubled[t]) > 0.999 * twice) same->normal_sum += doubled[t];
      continue;
    }
    // No area and on no face: a seam between faces not met yet cannot be, they are larger.
    if (!(twice > 1e-13 * size * size)) continue;
    Found f{doubled[t] / twice, 0, doubled[t], {t}, twice / 2};
    f.rough_offset = glm::dot(f.rough, points[c[0]] - origin);
    for (const std::uint32_t i : used)
      if (glm::dot(f.rough, points[i] - origin) > f.rough_offset + tolerance) return std::nullopt;
    found.push_back(std::move(f));
    if (found.size() > kMaxPlanes) return std::nullopt;
  }

  ConvexSolid solid;
  for (const Found& f : found) {
    const Vec3 n = glm::normalize(f.normal_sum);
    double lowest = std::numeric_limits<double>::infinity();
    double mean = 0;
    double weight = 0;
    for (const std::uint32_t t : f.members) {
      const auto& c = triangles[t];
      const double w = glm::length(doubled[t]);
      for (const std::uint32_t i : c) {
        const double h = glm::dot(n, points[i]);
        lowest = std::min(lowest, h);
        mean += h * w;
        weight += w;
      }
    }
    solid.planes.push_back({n, seam_m > 0 ? mean / weight : lowest});
  }
  if (solid.planes.size() < 4) return std::nullopt;
  solid.bounds = bounds;
  solid.bounds.lo -= Vec3{tolerance};
  solid.bounds.hi += Vec3{tolerance};

  const Polytope whole = polytope(solid, rounding(bounds));
  if (whole.faces.empty()) return std::nullopt;
  std::vector<double> areas(found.size(), 0);
  std::vector<double> edges(found.size(), 0);
  Aabb real;
  Vec3 middle{0};
  double corners = 0;
  for (const Polytope::Face& f : whole.faces) {
    Vec3 sum{0};
    const Vec3 first = whole.points[f.ring[0]];
    for (std::size_t i = 0; i < f.ring.size(); ++i) {
      const Vec3 a = whole.points[f.ring[i]];
      const Vec3 b = whole.points[f.ring[(i + 1) % f.ring.size()]];
      sum += glm::cross(a - first, b - first);
      edges[static_cast<std::size_t>(f.plane)] += glm::length(b - a);
      real.add(a);
      middle += a - origin;
      ++corners;
    }
    areas[static_cast<std::size_t>(f.plane)] = glm::length(sum) / 2;
  }
  const Vec3 grown{4 * tolerance};
  if (!(real.lo.x >= bounds.lo.x - grown.x && real.lo.y >= bounds.lo.y - grown.y &&
        real.lo.z >= bounds.lo.z - grown.z && real.hi.x <= bounds.hi.x + grown.x &&
        real.hi.y <= bounds.hi.y + grown.y && real.hi.z <= bounds.hi.z + grown.z))
    return std::nullopt;
  // Each face covered once: no hole, no face twice.
  for (std::size_t i = 0; i < found.size(); ++i)
    if (std::abs(found[i].area - areas[i]) > 4 * tolerance * (edges[i] + size) + 1e-5 * areas[i])
      return std::nullopt;
  const Vec3 inside = origin + middle / corners;
  if (seam_m <= 0)
    for (const Vec3& d : {Vec3{0.31, 0.83, 0.47}, Vec3{-0.71, 0.29, 0.63}, Vec3{0.17, -0.53, -0.9}})
      if (crossings(points, triangles, inside, d) % 2 == 0) return std::nullopt;
  solid.bounds = real;
  const double pad = rounding(bounds);
  solid.bounds.lo -= Vec3{2 * pad};
  solid.bounds.hi += Vec3{2 * pad};
  return solid;
}

std::vector<std::vector<Vec3>> face_rings(const ConvexSolid& solid) {
  std::vector<std::vector<Vec3>> rings(solid.planes.size());
  const Polytope p = polytope(solid, rounding(solid.bounds));
  for (const Polytope::Face& f : p.faces)
    for (const std::uint32_t i : f.ring)
      rings[static_cast<std::size_t>(f.plane)].push_back(p.points[i]);
  return rings;
}

FaceMesh face_mesh(const ConvexSolid& solid) {
  FaceMesh mesh;
  const Polytope p = polytope(solid, rounding(solid.bounds));
  std::vector<std::uint32_t> number(p.points.size(), ~0U);
  for (const Polytope::Face& f : p.faces) {
    for (const std::uint32_t i : f.ring)
      if (number[i] == ~0U) {
        number[i] = static_cast<std::uint32_t>(mesh.points.size());
        mesh.points.push_back(p.points[i]);
      }
    for (std::size_t i = 1; i + 1 < f.ring.size(); i += 2) {
      const std::uint32_t c = number[f.ring[i + 1]];
      mesh.faces.push_back({number[f.ring[0]], number[f.ring[i]], c,
                            i + 2 < f.ring.size() ? number[f.ring[i + 2]] : c});
    }
  }
  return mesh;
}

ConvexSolid shrunk(const ConvexSolid& solid, const Reach& reach, double margin_m) {
  ConvexSolid result = solid;
  for (Plane& p : result.planes)
    p.offset -= reach.support(p.normal) + margin_m;
  return result;
}

SceneSupport::SceneSupport(const Scene& scene) : scene_(scene) {
  constexpr std::size_t kSamples = 256;
  const std::size_t step = scene.objects.size() / kSamples + 1;
  for (std::size_t i = 0; i < scene.objects.size(); i += step)
    if (scene.mesh_of(scene.objects[i]).triangles() > 0)
      samples_.push_back(world_triangle(scene, scene.objects[i], 0).a);
}

bool SceneSupport::within(const Vec3& normal, double offset) const {
  for (const Vec3& p : samples_)
    if (glm::dot(normal, p) > offset) return false;
  const std::array<double, 3> key{normal.x, normal.y, normal.z};
  {
    const std::lock_guard lock(mutex_);
    if (const auto known = support_.find(key); known != support_.end())
      return known->second <= offset;
  }
  double most = -std::numeric_limits<double>::infinity();
  for (const auto* list : {&scene_.objects, &scene_.hidden_solids})
    for (const Object& o : *list) {
      if (o.always_visible) continue;  // listed whatever hides it
      const Vec3 far = glm::mix(o.bounds.lo, o.bounds.hi, glm::greaterThan(normal, Vec3(0)));
      if (glm::dot(normal, far) <= most) continue;  // no corner of its box is farther
      const Mesh& mesh = scene_.mesh_of(o);
      for (const auto& p : mesh.positions)
        most = std::max(most, glm::dot(normal, Vec3(o.to_world * glm::dvec4(Vec3(p), 1.0))));
      if (mesh.positions.empty()) most = std::max(most, glm::dot(normal, Vec3(o.to_world[3])));
    }
  const std::lock_guard lock(mutex_);
  support_[key] = most;
  return most <= offset;
}

namespace {

/// Below the slack that occluders are shrunk by.
constexpr double kMostFloorSlackM = 2e-4;

/// A solid's planes lie a little inside its faces, and corners are rounded.
double floor_slack(const ConvexSolid& solid) {
  const Vec3 size = solid.bounds.size();
  return std::min(2e-6 * std::max({size.x, size.y, size.z}) + 1e-6, kMostFloorSlackM);
}

bool same_plane(const Plane& a, const Plane& b, double slack) {
  return glm::length(a.normal - b.normal) < 1e-9 && std::abs(a.offset - b.offset) <= slack;
}

}  // namespace

std::optional<ConvexSolid::Plane> common_floor(const std::vector<ConvexSolid>& solids,
                                               const SceneSupport& scene) {
  std::map<std::array<std::int64_t, 4>, std::pair<std::size_t, Plane>> count;
  std::pair<std::size_t, Plane> best{1, {}};
  for (const ConvexSolid& solid : solids)
    for (const Plane& p : solid.planes) {
      if (!scene.within(p.normal, p.offset + floor_slack(solid))) continue;
      const std::array<std::int64_t, 4> key{
          std::llround(p.normal.x * 1e6), std::llround(p.normal.y * 1e6),
          std::llround(p.normal.z * 1e6), std::llround(p.offset * 1e3)};
      auto& entry = count.try_emplace(key, 0, p).first->second;
      if (++entry.first > best.first) best = entry;
    }
  return best.first > 1 ? std::optional<Plane>(best.second) : std::nullopt;
}

SolidPiece shrink_convex(const ConvexSolid& solid, const Reach& reach,
                         const std::vector<double>& margins_m, const SceneSupport* scene,
                         const std::optional<ConvexSolid::Plane>& floor) {
  SolidPiece piece;
  std::size_t base = solid.planes.size();
  if (floor && scene != nullptr)
    for (std::size_t i = 0; i < solid.planes.size(); ++i)
      if (const Plane& p = solid.planes[i];
          same_plane(p, *floor, 1e-3) && scene->within(p.normal, p.offset + floor_slack(solid)))
        base = i;
  for (const double margin : margins_m) {
    FaceMesh mesh = face_mesh(shrunk(solid, reach, margin));
    if (mesh.empty()) break;
    piece.levels.push_back(std::move(mesh));
  }
  if (base == solid.planes.size()) return piece;
  for (const double margin : margins_m) {
    ConvexSolid level = shrunk(solid, reach, margin);
    level.planes[base].offset = solid.planes[base].offset;
    FaceMesh mesh = face_mesh(level);
    if (mesh.empty()) break;
    piece.floored_levels.push_back(std::move(mesh));
  }
  if (!piece.floored_levels.empty()) piece.floors.push_back(solid.planes[base]);
  return piece;
}

ObjectConvex extract_convex(const Scene& scene, const Object& object) {
  ObjectConvex out;
  if (object.tag == OccluderTag::kNever || object.always_visible ||
      scene.mesh_of(object).triangles() == 0)
    return out;
  const Vec3 far = glm::max(glm::abs(object.bounds.lo), glm::abs(object.bounds.hi));
  if (std::max({far.x, far.y, far.z}) > kMaxCoordinateM) return out;
  const WeldedMesh mesh = weld(scene, object);
  const auto& primitives = scene.mesh_of(object).primitives;
  const bool one_sided =
      scene.honour_sidedness && std::any_of(primitives.begin(), primitives.end(),
                                            [](const Primitive& p) { return !p.double_sided; });
  const bool only = object.tag == OccluderTag::kOnly;
  bool all_closed = true;
  for (const MeshPiece& piece : mesh.pieces) {
    if (!piece.closed) {
      all_closed = false;
      continue;
    }
    if (one_sided && !(piece.oriented && volume(mesh, piece) > 0)) {
      ++out.left_out["winding not consistent"];
      continue;
    }
    if (auto solid = recognise_convex(mesh.points, piece.triangles)) {
      const bool prism = upright(*solid) && piece.oriented && volume(mesh, piece) > 0;
      out.pieces.push_back({std::move(*solid), prism, only});
    } else {
      ++out.left_out["not convex"];
    }
  }
  if (all_closed || !only || one_sided) return out;
  // Declared matter whose faces do not meet to the last bit: all of it, or nothing.
  out = {};
  Triangles all;
  for (const MeshPiece& piece : mesh.pieces)
    all.insert(all.end(), piece.triangles.begin(), piece.triangles.end());
  if (auto solid = recognise_convex(mesh.points, all, kSeamM)) {
    out.pieces.push_back({std::move(*solid), false, true});
  } else {
    ++out.left_out["not convex"];
  }
  return out;
}

}  // namespace ivis
