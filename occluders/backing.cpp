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

constexpr std::size_t kMostPlanes = 6;
constexpr double kThinM = 1e-5;      ///< triangles lower than this have no normal to speak of
constexpr double kMostBandM = 1e-4;  ///< and no more than four float32 steps
constexpr double kRoundM = 1e-9;     ///< of products of coordinates in double
constexpr double kDeepM = 0.005;     ///< more than faces of one solid may be out by (kSeamM)

/// How far the corners of one plane may be out of it: what corners of this size are rounded by, no
/// less than the grid of clip.h can tell.
double band_of(const Aabb& box) {
  const Vec3 far = glm::max(glm::abs(box.lo), glm::abs(box.hi));
  const auto f = static_cast<float>(std::max({far.x, far.y, far.z}));
  const float step = std::nextafter(f, std::numeric_limits<float>::infinity()) - f;
  return std::clamp(4 * static_cast<double>(step), 4 * kGridM, kMostBandM);
}

/// Triangles of one plane.
struct Facet {
  Vec3 normal{0};
  double area = 0;  ///< of the largest, whose normal it is
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
    if (!(twice_area(t) > kThinM * longest) || facets.size() == kMostPlanes) return {};
    facets.push_back({glm::normalize(glm::cross(t.b - t.a, t.c - t.a)), twice_area(t) / 2, {t}});
  }
  if (facets.empty()) return {};
  return facets;
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
  const PlaneFrame frame = frame_of(highest - kRoundM);
  const PlaneFrame below = frame_of(lowest - kDeepM);
  place.lo -= Vec3{2 * kDeepM};
  place.hi += Vec3{2 * kDeepM};
  const auto cuts = sections.cuts_at(frame, place);
  if (cuts.empty()) return {};
  std::vector<Ring> rings;
  Box2 box;
  for (const Triangle& t : facet.triangles) {
    Ring ring{frame.to_plane(t.a), frame.to_plane(t.b), frame.to_plane(t.c)};
    const Vec2 ab = ring[1] - ring[0];
    const Vec2 ac = ring[2] - ring[0];
    if (ab.x * ac.y - ab.y * ac.x < 0) std::swap(ring[1], ring[2]);
    box.add(box_of(ring));
    rings.push_back(std::move(ring));
  }
  std::vector<Ring> matter;
  double seam = 0;
  // Matter on the other side may come over the plane by rounding: it has to go on below.
  for (const PlaneSections::Cut& deep : sections.cuts_at(below, place)) {
    const auto cut = std::ranges::find(cuts, deep.solid, &PlaneSections::Cut::solid);
    std::vector<Ring> going_on;
    if (cut == cuts.end()) continue;
    sections.collect({deep}, below, grown(box, 1), going_on, seam);
    if (!going_on.empty()) sections.collect({*cut}, frame, grown(box, 1), matter, seam);
  }
  if (matter.empty() || !subtract(rings, Fill::kNonZero, matter).empty()) return {};
  return lowest;
}

std::vector<Backing> backings_of(const Scene& scene, ObjectId id, const PlaneSections& sections) {
  const Object& object = scene.objects[id];
  if (object.always_visible) return {};
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
