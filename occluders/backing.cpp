#include "occluders/backing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "occluders/plane_sections.h"
#include "occluders/progress.h"

namespace ivis {
namespace {

// What is larger is no face of a solid, and would take long.
constexpr std::size_t kMostTriangles = 2000;
constexpr std::size_t kMostSolids = 500;
constexpr double kThinM = 1e-5;   ///< triangles lower than this have no normal to speak of
constexpr double kRoundM = 1e-9;  ///< of products of coordinates in double
constexpr double kDeepM = 0.005;  ///< more than faces of one solid may be out by (kSeamM)

/// How far the corners of one plane may be out of it: what corners of this size are rounded by, no
/// less than the grid of clip.h can tell.
double band_of(const Aabb& box) {
  return std::max(rounding_of(box), 4 * kGridM);
}

/// Triangles of one plane.
struct Facet {
  Vec3 normal{0};  ///< of the largest
  std::vector<Triangle> triangles;
};

/// The planes of an object's triangles; nothing if they are too many, or one is not clear.
std::optional<std::vector<Facet>> facets_of(const Scene& scene, const Object& object, double band) {
  std::vector<Triangle> all;
  for (std::size_t t = 0; t < scene.mesh_of(object).triangles(); ++t)
    all.push_back(world_triangle(scene, object, t));
  // Largest first: their normals are the best known.
  const auto twice_area = [](const Triangle& t) {
    return glm::length(glm::cross(t.b - t.a, t.c - t.a));
  };
  std::stable_sort(all.begin(), all.end(), [&](const Triangle& a, const Triangle& b) {
    return twice_area(a) > twice_area(b);
  });
  std::vector<Facet> facets;
  for (const Triangle& t : all) {
    const auto fits = [&](const Facet& f) {
      const double at = glm::dot(f.normal, f.triangles[0].a);
      return std::max({std::abs(glm::dot(f.normal, t.a) - at),
                       std::abs(glm::dot(f.normal, t.b) - at),
                       std::abs(glm::dot(f.normal, t.c) - at)}) <= band;
    };
    const auto known = std::find_if(facets.begin(), facets.end(), fits);
    if (known != facets.end()) {
      known->triangles.push_back(t);
      continue;
    }
    const double longest =
        std::max({glm::length(t.b - t.a), glm::length(t.c - t.b), glm::length(t.a - t.c)});
    if (!(twice_area(t) > kThinM * longest) || facets.size() == kMostPlanesBehind) return {};
    facets.push_back({glm::normalize(glm::cross(t.b - t.a, t.c - t.a)), {t}});
  }
  if (facets.empty()) return {};
  return facets;
}

/// What is matter in the plane, at every height that the facet's corners are at. A solid counts
/// that goes on below: matter on the other side may come over the plane by rounding.
std::vector<Ring> matter_at(const PlaneSections& sections, const PlaneFrame& highest,
                            const PlaneFrame& lowest, const PlaneFrame& below, const Aabb& place,
                            const Box2& box) {
  std::vector<Ring> matter;
  const auto cuts = sections.cuts_at(highest, place);
  const auto deep = sections.cuts_at(below, place);
  if (cuts.size() > kMostSolids || deep.size() > kMostSolids) return {};
  double seam = 0;
  for (const PlaneSections::Cut& cut : cuts) {
    const auto goes_on = std::ranges::lower_bound(deep, cut.solid, {}, &PlaneSections::Cut::solid);
    if (goes_on == deep.end() || goes_on->solid != cut.solid) continue;
    std::vector<Ring> rings;
    sections.collect({*goes_on}, below, box, rings, seam);
    if (rings.empty()) continue;
    rings.clear();
    sections.collect({cut}, highest, box, rings, seam);
    if (rings.empty()) continue;
    // What is in a convex solid at both heights is in it between them.
    std::vector<Ring> low;
    sections.collect({cut}, lowest, box, low, seam);
    if (low.empty()) continue;
    for (const Polygon& both : intersect(rings, Fill::kNonZero, low[0]))
      matter.push_back(both.rings[0]);
  }
  return matter;
}

/// Does all of the facet lie flush against matter on the side that `normal` points away from? The
/// plane's offset if so.
std::optional<double> backed(const Facet& facet, const Vec3& normal,
                             const PlaneSections& sections) {
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  Aabb place;
  for (const Triangle& t : facet.triangles)
    for (const Vec3& p : {t.a, t.b, t.c}) {
      lowest = std::min(lowest, glm::dot(normal, p));
      highest = std::max(highest, glm::dot(normal, p));
      place.add(p);
    }
  const Vec3 centre = place.centre();
  const auto frame_of = [&](double offset) {
    return frame_at(normal, centre + normal * (offset - glm::dot(normal, centre)));
  };
  // Through the highest corner: matter that ended below one would leave a gap to look through.
  const PlaneFrame top = frame_of(highest - kRoundM);
  Box2 box;
  std::vector<Ring> rings;
  for (const Triangle& t : facet.triangles) {
    rings.push_back({top.to_plane(t.a), top.to_plane(t.b), top.to_plane(t.c)});
    box.add(box_of(rings.back()));
  }
  place.lo -= Vec3{2 * kDeepM};
  place.hi += Vec3{2 * kDeepM};
  const std::vector<Ring> matter = matter_at(sections, top, frame_of(lowest - kRoundM),
                                             frame_of(lowest - kDeepM), place, grown(box, 1));
  for (const Ring& ring : rings)
    if (!covered(ring, matter)) return {};
  return lowest;
}

std::vector<Backing> backings_of(const Scene& scene, ObjectId id, const PlaneSections& sections) {
  const Object& object = scene.objects[id];
  const std::size_t triangles = scene.mesh_of(object).triangles();
  if (object.always_visible || triangles == 0 || triangles > kMostTriangles ||
      !sections.any_near(object.bounds))
    return {};
  const double band = band_of(object.bounds);
  const auto facets = facets_of(scene, object, band);
  if (!facets) return {};
  std::vector<Backing> found;
  for (const Facet& facet : *facets) {
    const auto front = backed(facet, facet.normal, sections);
    const auto back = backed(facet, -facet.normal, sections);
    if (front && back) continue;  // between solids: seen from nowhere
    if (!front && !back) return {};
    found.push_back({id, front ? ConvexSolid::Plane{facet.normal, *front}
                               : ConvexSolid::Plane{-facet.normal, *back}});
  }
  return found;
}

}  // namespace

std::vector<Backing> find_backings(const Scene& scene, const std::vector<ConvexPiece>& solids,
                                   const Context& context) {
  std::vector<ConvexPiece> only;
  std::copy_if(solids.begin(), solids.end(), std::back_inserter(only),
               [](const ConvexPiece& p) { return p.only; });
  if (only.empty()) return {};
  const PlaneSections sections(only);
  std::vector<std::vector<Backing>> found(scene.objects.size());
  Progress progress(context, "backed objects", found.size());
  parallel_for(context, found.size(), [&](std::size_t i) {
    found[i] = backings_of(scene, static_cast<ObjectId>(i), sections);
    progress.step();
  });
  std::vector<Backing> all;
  if (context.stopped()) return all;
  for (const auto& list : found)
    all.insert(all.end(), list.begin(), list.end());
  return all;
}

}  // namespace ivis
