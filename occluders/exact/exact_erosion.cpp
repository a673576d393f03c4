#include "occluders/exact/exact_erosion.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <iterator>
#include <map>
#include <numbers>
#include <vector>

#include <CGAL/Arr_segment_traits_2.h>
#include <CGAL/Arrangement_with_history_2.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Polygon_2.h>
#include <CGAL/Polygon_set_2.h>
#include <CGAL/Polygon_with_holes_2.h>
#include <CGAL/minkowski_sum_2.h>

#include "core/assert.h"

namespace ivis {
namespace {

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using Point = Kernel::Point_2;
using Ring = CGAL::Polygon_2<Kernel>;
using Region = CGAL::Polygon_with_holes_2<Kernel>;
using RegionSet = CGAL::Polygon_set_2<Kernel>;
using Traits = CGAL::Arr_segment_traits_2<Kernel>;
using Arrangement = CGAL::Arrangement_with_history_2<Traits>;

// The reach is grown by this, which pays for rounding its corners and the result's to double.
constexpr double kInwardsM = 1e-6;
// Directions of walls nearer than this (radians) share a side of the reach's polygon. Between sides
// a wall loses its angle to the nearest times half their gap: below 1e-6 of the radius.
constexpr double kSameDirection = 1e-5;
constexpr std::size_t kMostDirections = 256;

/// A part of the input in one piece: outer ring and what is cut out of it, all simple,
/// anticlockwise.
struct Piece {
  Ring outer;
  std::vector<Ring> holes;
};

void add_corner(Ring& ring, const Point& p) {
  // Of corners on a line only the ends are kept.
  while (ring.size() >= 2 && CGAL::collinear(ring[ring.size() - 2], ring[ring.size() - 1], p))
    ring.erase(std::prev(ring.vertices_end()));
  ring.push_back(p);
}

Ring without_flat_corners(const std::vector<Point>& corners) {
  Ring ring;
  for (const Point& p : corners)
    add_corner(ring, p);
  while (ring.size() >= 3 && CGAL::collinear(ring[ring.size() - 2], ring[ring.size() - 1], ring[0]))
    ring.erase(std::prev(ring.vertices_end()));
  while (ring.size() >= 3 && CGAL::collinear(ring[ring.size() - 1], ring[0], ring[1]))
    ring.erase(ring.vertices_begin());
  return ring;
}

/// Cuts a closed walk where it comes back to a corner: simple loops.
std::vector<Ring> simple_loops(const std::vector<Point>& walk) {
  std::vector<Ring> loops;
  std::vector<Point> path;
  std::map<Point, std::size_t> at;
  for (const Point& p : walk) {
    if (const auto seen = at.find(p); seen != at.end()) {
      const std::size_t first = seen->second;
      loops.push_back(
          without_flat_corners({path.begin() + static_cast<std::ptrdiff_t>(first), path.end()}));
      for (std::size_t i = first; i < path.size(); ++i)
        at.erase(path[i]);
      path.resize(first);
    }
    at.emplace(p, path.size());
    path.push_back(p);
  }
  loops.push_back(without_flat_corners(path));
  std::erase_if(loops, [](const Ring& r) { return r.size() < 3; });
  return loops;
}

template <class Circulator>
std::vector<Point> walk_of(Circulator first) {
  std::vector<Point> walk;
  auto c = first;
  do
    walk.push_back(c->source()->point());
  while (++c != first);
  return walk;
}

// Cleans the input once and for all: rings become an arrangement; an edge that an even number of
// them runs along is none (spikes, doubled corners, shared borders), so faces on its two sides
// alternate between out and in, starting outside. Minkowski sums come back empty, without a word,
// for what is not clean.
std::vector<Piece> clean(const Polygon& polygon) {
  std::vector<Kernel::Segment_2> segments;
  for (const auto& ring : polygon.rings)
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vec2& a = ring[i];
      const Vec2& b = ring[(i + 1) % ring.size()];
      if (a != b) segments.emplace_back(Point(a.x, a.y), Point(b.x, b.y));
    }
  Arrangement arrangement;
  CGAL::insert(arrangement, segments.begin(), segments.end());
  std::vector<Arrangement::Halfedge_handle> none;
  for (auto e = arrangement.edges_begin(); e != arrangement.edges_end(); ++e)
    if (arrangement.number_of_originating_curves(e) % 2 == 0) none.push_back(e);
  for (const auto& e : none)
    arrangement.remove_edge(e);

  std::map<Arrangement::Face_const_handle, bool> inside;
  std::vector<Arrangement::Face_const_handle> open{arrangement.unbounded_face()};
  inside[open.front()] = false;
  const auto cross = [&](auto first, bool from) {
    auto c = first;
    do {
      const Arrangement::Face_const_handle other = c->twin()->face();
      if (inside.emplace(other, !from).second) open.push_back(other);
    } while (++c != first);
  };
  std::vector<Piece> pieces;
  while (!open.empty()) {
    const Arrangement::Face_const_handle face = open.back();
    open.pop_back();
    const bool in = inside[face];
    std::vector<Ring> loops;
    const auto take = [&](auto border) {
      cross(border, in);
      if (in) std::ranges::move(simple_loops(walk_of(border)), std::back_inserter(loops));
    };
    for (auto b = face->outer_ccbs_begin(); b != face->outer_ccbs_end(); ++b)
      take(*b);
    for (auto b = face->inner_ccbs_begin(); b != face->inner_ccbs_end(); ++b)
      take(*b);
    if (!in) continue;
    // The one anticlockwise loop is the outer ring; holes that touch it came as loops of the same
    // walk.
    Piece piece;
    for (Ring& loop : loops) {
      if (loop.is_counterclockwise_oriented()) {
        piece.outer = std::move(loop);
      } else {
        loop.reverse_orientation();
        piece.holes.push_back(std::move(loop));
      }
    }
    if (!piece.outer.is_empty()) pieces.push_back(std::move(piece));
  }
  return pieces;
}

/// Angles at which the grown complement pushes the walls in (their inward normals, seen in the
/// space in which the ellipse is a circle), longest walls first.
std::vector<double> wall_angles(const Polygon& polygon, const Vec2& extent) {
  std::map<long, std::pair<double, double>> length_and_angle;
  for (const auto& ring : polygon.rings)
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vec2 d = ring[(i + 1) % ring.size()] - ring[i];
      if (d == Vec2{0}) continue;
      const double angle = std::atan2(d.x * extent.y, -d.y * extent.x);
      auto& [length, kept] = length_and_angle[std::lround(angle / kSameDirection)];
      if (length == 0) kept = angle;
      length += glm::length(d);
    }
  std::vector<std::pair<double, double>> order;
  for (const auto& [bin, entry] : length_and_angle)
    order.push_back(entry);
  std::sort(order.begin(), order.end(), std::greater<>());
  order.resize(std::min(order.size(), kMostDirections));
  std::vector<double> angles;
  for (const auto& [length, angle] : order)
    angles.push_back(angle);
  return angles;
}

// Tangents all round, and one along every wall: a wall then loses nothing, and the rest oversteps
// only round reflex corners. Subtraction wants the reflected reach, which is the reach itself.
Ring circumscribed(const Polygon& polygon, const Reach& reach, int k) {
  const Vec2 extent{reach.half_extents().x + kInwardsM, reach.half_extents().z + kInwardsM};
  Ring ring;
  if (reach.horizontal_is_box()) {
    for (const Vec2& s : {Vec2{-1, -1}, Vec2{1, -1}, Vec2{1, 1}, Vec2{-1, 1}})
      ring.push_back(Point(s.x * extent.x, s.y * extent.y));
    return ring;
  }
  constexpr double kTurn = 2 * std::numbers::pi;
  std::vector<double> angles = wall_angles(polygon, extent);
  for (int i = 0; i < k; ++i)
    angles.push_back(kTurn * i / k - std::numbers::pi);
  std::sort(angles.begin(), angles.end());
  // Of near-equal angles one does; the turn's last and first may be near each other as well.
  angles.erase(std::unique(angles.begin(), angles.end(),
                           [](double a, double b) { return b - a < kSameDirection / 2; }),
               angles.end());
  while (angles.size() > 1 && angles.front() + kTurn - angles.back() < kSameDirection / 2)
    angles.pop_back();
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double a = angles[i];
    const double b = i + 1 < angles.size() ? angles[i + 1] : angles[0] + kTurn;
    const double r = 1 / std::cos((b - a) / 2);
    ring.push_back(
        Point(extent.x * r * std::cos((a + b) / 2), extent.y * r * std::sin((a + b) / 2)));
  }
  return ring;
}

/// Double that differs from the exact number by a rounding; the lazy number's own is good to 1e-5
/// only.
double to_double(const Kernel::FT& v) {
  return CGAL::to_double(CGAL::exact(v));
}

std::vector<Vec2> to_ring(const Ring& ring) {
  std::vector<Vec2> result;
  for (auto v = ring.vertices_begin(); v != ring.vertices_end(); ++v) {
    const Vec2 p{to_double(v->x()), to_double(v->y())};
    if (result.empty() || result.back() != p) result.push_back(p);
  }
  while (result.size() > 1 && result.front() == result.back())
    result.pop_back();
  return result;
}

// E(piece) = outer \ ((box \ outer) + V) \ (holes + V). The box's complement sum is one connected
// piece, so what is left of the outer ring are its holes.
void erode_piece(const Piece& piece, const Ring& reach, std::vector<Polygon>& result) {
  const CGAL::Bbox_2 box = piece.outer.bbox();
  const CGAL::Bbox_2 v = reach.bbox();
  const double margin = 2 * std::max(v.xmax() - v.xmin(), v.ymax() - v.ymin()) + 1;
  Ring frame;
  frame.push_back(Point(box.xmin() - margin, box.ymin() - margin));
  frame.push_back(Point(box.xmax() + margin, box.ymin() - margin));
  frame.push_back(Point(box.xmax() + margin, box.ymax() + margin));
  frame.push_back(Point(box.xmin() - margin, box.ymax() + margin));
  Region complement(frame);
  Ring hole = piece.outer;
  hole.reverse_orientation();
  complement.add_hole(hole);

  const Region grown = CGAL::minkowski_sum_2(complement, reach);
  std::vector<Region> left;
  for (auto h = grown.holes_begin(); h != grown.holes_end(); ++h) {
    Ring ring = *h;
    if (ring.is_clockwise_oriented()) ring.reverse_orientation();
    left.emplace_back(ring);
  }
  if (!piece.holes.empty() && !left.empty()) {
    RegionSet kept;
    for (const Region& r : left)
      kept.insert(r);  // they do not overlap
    std::vector<Region> cut;
    for (const Ring& h : piece.holes)
      cut.push_back(CGAL::minkowski_sum_2(h, reach));
    RegionSet cuts;
    cuts.join(cut.begin(), cut.end());
    kept.difference(cuts);
    left.clear();
    kept.polygons_with_holes(std::back_inserter(left));
  }
  for (const Region& r : left) {
    Polygon polygon;
    polygon.rings.push_back(to_ring(r.outer_boundary()));
    for (auto h = r.holes_begin(); h != r.holes_end(); ++h)
      polygon.rings.push_back(to_ring(*h));
    if (polygon.rings.front().size() < 3) continue;
    std::erase_if(polygon.rings, [](const auto& ring) { return ring.size() < 3; });
    result.push_back(std::move(polygon));
  }
}

bool finite(const Polygon& polygon) {
  for (const auto& ring : polygon.rings)
    for (const Vec2& p : ring)
      if (!std::isfinite(p.x) || !std::isfinite(p.y)) return false;
  return true;
}

}  // namespace

ExactEroder::ExactEroder(int k) : k_(k) {
  IVIS_ASSERT(k >= 8, "the reach's polygon needs at least eight sides");
}

std::vector<Polygon> ExactEroder::erode(const Polygon& polygon, const Reach& reach) const {
  std::vector<Polygon> result;
  if (!finite(polygon)) return result;
  try {
    const Ring v = circumscribed(polygon, reach, k_);
    for (const Piece& piece : clean(polygon))
      erode_piece(piece, v, result);
  } catch (const std::exception&) {
    result.clear();  // dropping an occluder is always safe
  }
  return result;
}

}  // namespace ivis
