#include "occluders/closed_mesh.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <unordered_map>

namespace ivis {
namespace {

struct PointHash {
  std::size_t operator()(const Vec3& p) const {
    std::uint64_t h = 0;
    for (int i = 0; i < 3; ++i) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &p[i], sizeof bits);
      h = (h ^ bits) * 0x9e3779b97f4a7c15ULL;
      h ^= h >> 29U;
    }
    return h;
  }
};

/// One side of a triangle: undirected key, and whether it runs from the smaller index to the
/// larger.
struct EdgeUse {
  std::uint32_t lo, hi, triangle;
  bool forward;
  bool same_edge(const EdgeUse& o) const { return lo == o.lo && hi == o.hi; }
};

std::vector<EdgeUse> edge_uses(const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  std::vector<EdgeUse> uses;
  uses.reserve(triangles.size() * 3);
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangles[t][k];
      const std::uint32_t b = triangles[t][(k + 1) % 3];
      uses.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  std::sort(uses.begin(), uses.end(), [](const EdgeUse& a, const EdgeUse& b) {
    return a.lo != b.lo ? a.lo < b.lo : a.hi != b.hi ? a.hi < b.hi : a.triangle < b.triangle;
  });
  return uses;
}

std::uint32_t root(std::vector<std::uint32_t>& parent, std::uint32_t i) {
  while (parent[i] != i)
    i = parent[i] = parent[parent[i]];
  return i;
}

}  // namespace

WeldedMesh weld(const Scene& scene, const Object& object) {
  WeldedMesh welded;
  const Mesh& mesh = scene.mesh_of(object);
  std::unordered_map<Vec3, std::uint32_t, PointHash> ids;
  const auto id_of = [&](Vec3 p) {
    p += 0.0;  // -0 and 0 are one place
    const auto [it, fresh] = ids.try_emplace(p, static_cast<std::uint32_t>(welded.points.size()));
    if (fresh) welded.points.push_back(p);
    return it->second;
  };
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (const Primitive& p : mesh.primitives) {
    if (!p.opaque) continue;
    for (std::size_t t = p.first_triangle; t < std::size_t{p.first_triangle} + p.triangles; ++t) {
      const Triangle w = world_triangle(scene, object, t);
      const std::array<std::uint32_t, 3> c{id_of(w.a), id_of(w.b), id_of(w.c)};
      if (c[0] != c[1] && c[1] != c[2] && c[2] != c[0]) triangles.push_back(c);
    }
  }
  // A mirroring transform turns the winding round.
  const double mirror = glm::determinant(glm::dmat3(object.to_world));
  if (mirror < 0)
    for (auto& t : triangles)
      std::swap(t[1], t[2]);

  const std::vector<EdgeUse> uses = edge_uses(triangles);
  std::vector<std::uint32_t> parent(triangles.size());
  std::iota(parent.begin(), parent.end(), 0U);
  for (std::size_t i = 1; i < uses.size(); ++i)
    if (uses[i].same_edge(uses[i - 1]))
      parent[root(parent, uses[i].triangle)] = root(parent, uses[i - 1].triangle);

  std::vector<std::uint32_t> piece_of(triangles.size(), ~0U);
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    std::uint32_t& piece = piece_of[root(parent, t)];
    if (piece == ~0U) {
      piece = static_cast<std::uint32_t>(welded.pieces.size());
      welded.pieces.push_back({{}, true, true});
    }
    welded.pieces[piece].triangles.push_back(triangles[t]);
  }
  for (std::size_t i = 0; i < uses.size();) {
    std::size_t end = i;
    std::ptrdiff_t balance = 0;
    for (; end < uses.size() && uses[end].same_edge(uses[i]); ++end)
      balance += uses[end].forward ? 1 : -1;
    MeshPiece& piece = welded.pieces[piece_of[root(parent, uses[i].triangle)]];
    if ((end - i) % 2 != 0) piece.closed = false;
    if (balance != 0) piece.oriented = false;
    i = end;
  }
  return welded;
}

double volume(const WeldedMesh& mesh, const MeshPiece& piece) {
  if (piece.triangles.empty()) return 0;
  const Vec3 origin = mesh.points[piece.triangles[0][0]];
  double six = 0;
  for (const auto& t : piece.triangles)
    six += glm::dot(mesh.points[t[0]] - origin,
                    glm::cross(mesh.points[t[1]] - origin, mesh.points[t[2]] - origin));
  return six / 6;
}

// A triangle that crosses the plane does so over two of its edges; a crossing edge of a closed
// piece has an even number of triangles. Pairing these up in any way gives closed loops, and any
// way gives the same parity (of an oriented piece: the same winding number, if arrivals are paired
// with departures).
std::vector<Ring> section(const WeldedMesh& mesh, const MeshPiece& piece, double y) {
  struct Crossing {
    std::uint32_t lo, hi;
    std::uint32_t segment;
    bool leaves;  ///< the segment starts here
  };
  std::vector<Crossing> crossings;
  std::uint32_t segments = 0;
  for (const auto& t : piece.triangles) {
    std::array<bool, 3> above{};
    for (std::size_t k = 0; k < 3; ++k)
      above[k] = mesh.points[t[k]].y > y;
    if (above[0] == above[1] && above[1] == above[2]) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t n = (k + 1) % 3;
      if (above[k] == above[n]) continue;
      // Seen from outside, winding is counter-clockwise: the side that climbs is on the right, so
      // the segment that has the solid on its left (x right, z up the page) starts at the climbing
      // side.
      crossings.push_back({std::min(t[k], t[n]), std::max(t[k], t[n]), segments, above[n]});
    }
    ++segments;
  }
  std::vector<std::uint32_t> order(crossings.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto rank = [&](std::uint32_t i) {
    const Crossing& c = crossings[i];
    return std::array<std::uint64_t, 2>{(std::uint64_t{c.lo} << 32U) | c.hi, i};
  };
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return rank(a) < rank(b); });
  // partner[c]: the crossing, at the same edge, of the segment that goes on from there.
  std::vector<std::uint32_t> partner(crossings.size(), ~0U);
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i;
    const auto same = [&](std::size_t j) {
      return crossings[order[j]].lo == crossings[order[i]].lo &&
             crossings[order[j]].hi == crossings[order[i]].hi;
    };
    while (end < order.size() && same(end))
      ++end;
    if ((end - i) % 2 != 0) return {};
    if (piece.oriented)
      std::stable_sort(order.begin() + static_cast<std::ptrdiff_t>(i),
                       order.begin() + static_cast<std::ptrdiff_t>(end),
                       [&](auto a, auto b) { return crossings[a].leaves < crossings[b].leaves; });
    const std::size_t half = (end - i) / 2;
    for (std::size_t j = 0; j < half; ++j) {
      partner[order[i + j]] = order[i + half + j];
      partner[order[i + half + j]] = order[i + j];
    }
    i = end;
  }
  const auto point = [&](const Crossing& c) {
    const Vec3& a = mesh.points[c.lo];
    const Vec3& b = mesh.points[c.hi];
    const double s = (y - a.y) / (b.y - a.y);
    return Vec2{a.x + (b.x - a.x) * s, a.z + (b.z - a.z) * s};
  };
  std::vector<Ring> loops;
  std::vector<bool> done(segments, false);
  for (std::uint32_t start = 0; start < crossings.size(); ++start) {
    if (done[crossings[start].segment] || !crossings[start].leaves) continue;
    Ring loop;
    for (std::uint32_t c = start; !done[crossings[c].segment];) {
      done[crossings[c].segment] = true;
      loop.push_back(point(crossings[c]));
      c = partner[c ^ 1U];  // a segment's two crossings are neighbours in the list
    }
    loops.push_back(std::move(loop));
  }
  // A corner that lies on the line between its neighbours (a wall's diagonal) would be rounded off
  // it: the wall would no longer touch its neighbour's. 1e-9 m is far below the grid.
  constexpr double kOnLineM = 1e-9;
  std::vector<Ring> result;
  for (const Ring& loop : loops) {
    Ring ring;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const Vec2 a = ring.empty() ? loop[(i + loop.size() - 1) % loop.size()] : ring.back();
      const Vec2 d = loop[(i + 1) % loop.size()] - a;
      const Vec2 p = loop[i] - a;
      const double length = glm::length(d);
      const bool between = glm::dot(p, d) >= 0 && glm::dot(p, d) <= length * length;
      if (length > 0 && between && std::abs(d.x * p.y - d.y * p.x) <= kOnLineM * length) continue;
      ring.push_back(loop[i]);
    }
    for (Vec2& p : ring)
      p = snap(p);
    if (ring.size() >= 3) result.push_back(std::move(ring));
  }
  return result;
}

}  // namespace ivis
