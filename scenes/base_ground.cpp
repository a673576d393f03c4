#include "scenes/base_ground.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace ivis {
namespace {

constexpr float kUnknown = -std::numeric_limits<float>::infinity();

/// Do the triangle (may be a sliver) and the box touch? Separating axes; exact up to rounding,
/// which the caller pays for with a wider box.
bool touches(const std::array<Vec2, 3>& t, const Vec2& lo, const Vec2& hi) {
  for (int axis = 0; axis < 2; ++axis) {
    const auto [least, most] = std::minmax({t[0][axis], t[1][axis], t[2][axis]});
    if (most < lo[axis] || least > hi[axis]) return false;
  }
  const Vec2 centre = (lo + hi) * 0.5;
  const Vec2 half = (hi - lo) * 0.5;
  for (int e = 0; e < 3; ++e) {
    const Vec2 d = t[static_cast<std::size_t>((e + 1) % 3)] - t[static_cast<std::size_t>(e)];
    const Vec2 n(-d.y, d.x);
    const double s0 = glm::dot(n, t[0] - centre);
    const double s1 = glm::dot(n, t[1] - centre);
    const double s2 = glm::dot(n, t[2] - centre);
    const double r = std::abs(n.x) * half.x + std::abs(n.y) * half.y;
    if (std::min({s0, s1, s2}) > r || std::max({s0, s1, s2}) < -r) return false;
  }
  return true;
}

/// Fills what is kUnknown by interpolation: coarse levels first, then relaxation towards the mean
/// of the neighbours. Known values stay.
void fill(std::vector<float>& y, std::size_t nx, std::size_t nz) {
  if (std::none_of(y.begin(), y.end(), [](float v) { return v == kUnknown; })) return;
  if (nx <= 2 && nz <= 2) {
    double sum = 0;
    int n = 0;
    for (const float v : y)
      if (v != kUnknown) {
        sum += v;
        ++n;
      }
    for (float& v : y)
      if (v == kUnknown) v = n > 0 ? static_cast<float>(sum / n) : 0.0F;
    return;
  }
  const std::size_t cx = (nx + 1) / 2;
  const std::size_t cz = (nz + 1) / 2;
  std::vector<float> coarse(cx * cz);
  for (std::size_t k = 0; k < cz; ++k) {
    for (std::size_t i = 0; i < cx; ++i) {
      double sum = 0;
      int n = 0;
      for (std::size_t b = 2 * k; b < std::min(2 * k + 2, nz); ++b)
        for (std::size_t a = 2 * i; a < std::min(2 * i + 2, nx); ++a)
          if (y[b * nx + a] != kUnknown) {
            sum += y[b * nx + a];
            ++n;
          }
      coarse[k * cx + i] = n > 0 ? static_cast<float>(sum / n) : kUnknown;
    }
  }
  fill(coarse, cx, cz);
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < nz; ++k)
    for (std::size_t i = 0; i < nx; ++i)
      if (y[k * nx + i] == kUnknown) {
        y[k * nx + i] = coarse[(k / 2) * cx + i / 2];
        open.push_back(k * nx + i);
      }
  for (int round = 0; round < 24; ++round) {
    for (const std::size_t at : open) {
      const std::size_t i = at % nx;
      const std::size_t k = at / nx;
      double sum = 0;
      int n = 0;
      const auto take = [&](bool there, std::size_t from) {
        if (!there) return;
        sum += y[from];
        ++n;
      };
      take(i > 0, at - 1);
      take(i + 1 < nx, at + 1);
      take(k > 0, at - nx);
      take(k + 1 < nz, at + nx);
      y[at] = static_cast<float>(sum / n);
    }
  }
}

float rounded_up(double v) {
  const auto f = static_cast<float>(v);
  return static_cast<double>(f) < v ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

}  // namespace

double lowest_vertex(const Scene& scene, const Object& object) {
  double low = std::numeric_limits<double>::infinity();
  const Mesh& mesh = scene.mesh_of(object);
  for (std::size_t t = 0; t < mesh.triangles(); ++t) {
    const Triangle w = world_triangle(scene, object, t);
    low = std::min({low, w.a.y, w.b.y, w.c.y});
  }
  return std::isfinite(low) ? low : 0.0;
}

Result<HeightGrid> base_ground(const Scene& scene, double cell_m, double margin_m,
                               const Context& context) {
  HeightGrid g;
  const Vec2 cells = glm::ceil((ground(scene.bounds.size()) + 2 * margin_m) / cell_m);
  g.cells_x = static_cast<std::size_t>(cells.x);
  g.cells_z = static_cast<std::size_t>(cells.y);
  // Whole metres: exact in float, so the drawn rectangle is this one.
  g.lo = glm::floor(ground(scene.bounds.lo) - margin_m);
  g.hi = g.lo + glm::ceil(cells * cell_m);
  g.y.assign((g.cells_x + 1) * (g.cells_z + 1), kUnknown);

  // Pays for the rounding of the drawn vertices to float.
  const double slack = 0.01 + 1e-6 * glm::length(glm::max(glm::abs(g.lo), glm::abs(g.hi)));
  const Vec2 size = g.cell_size();
  for (std::size_t o = 0; o < scene.objects.size(); ++o) {
    if (o % 1024 == 0) {
      if (context.stopped()) return cancelled();
      context.report("ground", o, scene.objects.size());
    }
    const Object& object = scene.objects[o];
    const float base = rounded_up(lowest_vertex(scene, object));
    for (std::size_t t = 0; t < scene.mesh_of(object).triangles(); ++t) {
      const Triangle w = world_triangle(scene, object, t);
      const std::array<Vec2, 3> flat{ground(w.a), ground(w.b), ground(w.c)};
      const auto [i0, k0] = g.cell_of(glm::min(glm::min(flat[0], flat[1]), flat[2]) - slack);
      const auto [i1, k1] = g.cell_of(glm::max(glm::max(flat[0], flat[1]), flat[2]) + slack);
      for (std::size_t k = k0; k <= k1; ++k) {
        for (std::size_t i = i0; i <= i1; ++i) {
          const Vec2 corner = g.lo + Vec2(static_cast<double>(i), static_cast<double>(k)) * size;
          if (!touches(flat, corner - slack, corner + size + slack)) continue;
          for (const std::size_t v :
               {g.index(i, k), g.index(i + 1, k), g.index(i, k + 1), g.index(i + 1, k + 1)})
            g.y[v] = std::max(g.y[v], base);
        }
      }
    }
  }
  fill(g.y, g.cells_x + 1, g.cells_z + 1);
  return g;
}

}  // namespace ivis
