// ivis_nef: the worker of occluders/nef_worker.h. It links CGAL's Nef polyhedra and Minkowski sums:
// this binary is under GPL-3+, though this source is Apache-2.0.
//
// E(N, box) = N less ((B less N) + box), B a box about N that the sum cannot reach past: handed an
// unbounded complement, minkowski_sum_3 gives it back unchanged. In exact numbers; what comes out
// is rounded to double, which the slack of the reach pays for.

#include <csignal>
#include <cstdlib>
#include <iostream>
#include <iterator>
#include <list>

#include <sys/prctl.h>
#include <sys/resource.h>

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Nef_polyhedron_3.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polyhedron_3.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/convert_nef_polyhedron_to_polygon_mesh.h>
#include <CGAL/boost/graph/generators.h>
#include <CGAL/convex_decomposition_3.h>
#include <CGAL/minkowski_sum_3.h>

#include "occluders/nef_messages.h"

namespace {

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using Point = Kernel::Point_3;
using Poly = CGAL::Polyhedron_3<Kernel>;
using Nef = CGAL::Nef_polyhedron_3<Kernel>;
using ivis::Vec3;

void say(const std::string& words) {
  std::cout << words << std::flush;
}

[[noreturn]] void give_up(const std::string& why) {
  say(ivis::encode_trouble(why));
  std::_Exit(1);
}

void limit(int what, rlim_t most) {
  const rlimit both{most, most};
  setrlimit(what, &both);
}

Nef box(const Vec3& lo, const Vec3& hi) {
  const auto p = [&](bool x, bool y, bool z) {
    return Point(x ? hi.x : lo.x, y ? hi.y : lo.y, z ? hi.z : lo.z);
  };
  Poly poly;
  CGAL::make_hexahedron(p(0, 0, 0), p(1, 0, 0), p(1, 1, 0), p(0, 1, 0), p(0, 1, 1), p(0, 0, 1),
                        p(1, 0, 1), p(1, 1, 1), poly);
  return Nef(poly);
}

Nef solid_of(const ivis::Polyhedron& mesh) {
  std::vector<Point> points;
  for (const Vec3& p : mesh.points)
    points.emplace_back(p.x, p.y, p.z);
  std::vector<std::vector<std::size_t>> faces;
  for (const auto& t : mesh.triangles)
    faces.push_back({t[0], t[1], t[2]});
  namespace pmp = CGAL::Polygon_mesh_processing;
  if (!pmp::is_polygon_soup_a_polygon_mesh(faces)) give_up("the surface is not a manifold");
  Poly poly;
  pmp::polygon_soup_to_polygon_mesh(points, faces, poly);
  if (!poly.is_closed()) give_up("the surface is not closed");
  return Nef(poly);
}

/// To the nearest: of a number that is not worked out yet to_double() promises much less.
double rounded(const Kernel::FT& v) {
  return CGAL::to_double(CGAL::exact(v));
}
Vec3 rounded(const Point& p) {
  return {rounded(p.x()), rounded(p.y()), rounded(p.z())};
}

ivis::FaceMesh mesh_of(const Nef& nef) {
  std::vector<Point> points;
  std::vector<std::vector<std::size_t>> faces;
  CGAL::convert_nef_polyhedron_to_polygon_soup(nef, points, faces, true);
  ivis::FaceMesh mesh;
  for (const Point& p : points)
    mesh.points.push_back(rounded(p));
  for (const auto& f : faces) {
    const auto at = [&](std::size_t i) { return static_cast<std::uint32_t>(f[i]); };
    mesh.faces.push_back({at(0), at(1), at(2), at(2)});
  }
  return mesh;
}

/// Convex parts that fill the solid, each of planes moved out by what rounding may have taken.
std::vector<ivis::ConvexSolid> parts_of(const Nef& nef) {
  Nef cut = nef;
  CGAL::convex_decomposition_3(cut);
  std::vector<ivis::ConvexSolid> parts;
  auto volume = ++cut.volumes_begin();  // the first is all that is outside
  for (; volume != cut.volumes_end(); ++volume) {
    if (!volume->mark()) continue;
    Poly poly;
    cut.convert_inner_shell_to_polyhedron(volume->shells_begin(), poly);
    ivis::ConvexSolid part;
    for (auto v = poly.vertices_begin(); v != poly.vertices_end(); ++v)
      part.bounds.add(rounded(v->point()));
    part.bounds.lo -= Vec3{1e-6};
    part.bounds.hi += Vec3{1e-6};
    for (auto f = poly.facets_begin(); f != poly.facets_end(); ++f) {
      // Corners may lie on edges, where a neighbour's wall ends: three that do not are needed.
      auto h = f->halfedge();
      const auto first = h;
      const auto straight = [&] {
        return CGAL::collinear(h->vertex()->point(), h->next()->vertex()->point(),
                               h->next()->next()->vertex()->point());
      };
      while (straight()) {
        h = h->next();
        if (h == first) give_up("a face without area");
      }
      const auto n = CGAL::normal(h->vertex()->point(), h->next()->vertex()->point(),
                                  h->next()->next()->vertex()->point());
      const Vec3 exact{rounded(n.x()), rounded(n.y()), rounded(n.z())};
      const Vec3 normal = exact / glm::length(exact);
      part.planes.push_back({normal, glm::dot(normal, rounded(h->vertex()->point())) + 1e-6});
    }
    if (part.planes.size() < 4) give_up("a part without inside");
    parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace

int main(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  limit(RLIMIT_AS, rlim_t{1} << 30U);
  limit(RLIMIT_CORE, 0);
  if (argc > 1) limit(RLIMIT_CPU, static_cast<rlim_t>(std::max(1, std::atoi(argv[1]))));
  const std::string text{std::istreambuf_iterator<char>(std::cin), {}};
  const auto request = ivis::decode_nef_request(text);
  if (!request) give_up(request.error().message);
  CGAL::set_error_behaviour(CGAL::THROW_EXCEPTION);
  CGAL::set_error_handler(nullptr);  // what is thrown says it
  CGAL::set_warning_handler(nullptr);
  try {
    const Nef solid = solid_of(request->solid);
    say(ivis::encode_parts(parts_of(solid)));
    Vec3 lo = request->solid.points[0];
    Vec3 hi = lo;
    for (const Vec3& p : request->solid.points) {
      lo = glm::min(lo, p);
      hi = glm::max(hi, p);
    }
    for (const double margin : request->margins_m) {
      const Vec3 half = request->half + Vec3{margin};
      // As far as the sum comes from outside, and farther: all that the solid can lose to.
      Nef outside = box(lo - 2.0 * half - 1.0, hi + 2.0 * half + 1.0) - solid;
      Nef mover = box(-half, half);
      const Nef left = solid - CGAL::minkowski_sum_3(outside, mover);
      const ivis::FaceMesh mesh = mesh_of(left);
      say(ivis::encode_level(mesh));
      if (mesh.empty()) break;
    }
    say(ivis::encode_end());
  } catch (const CGAL::Failure_exception& e) {
    give_up("CGAL: " + e.library() + ": " + e.expression() + " " + e.message());
  } catch (const std::exception& e) {
    give_up(e.what());
  }
  // Nef polyhedra of some real solids fail in their destructors.
  std::cout.flush();
  std::_Exit(0);
}
