#include "occluders/height_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "core/view_cell.h"
#include "occluders/ground_soup.h"

namespace ivis {
namespace {

constexpr std::size_t kMostCellsASide = 2048;
constexpr double kLeastCellM = 1;
constexpr double kLeastReliefM = 3;
constexpr std::size_t kBuriedIn = 100;  // as of Ground
// Cells are looked at a little larger than they are, so that a corner or edge that rounding puts on
// the wrong side of a border counts for both.
constexpr double kBorder = 1e-6;  // of a cell

/// A triangle cut by a rectangle: seven corners, or a few more by rounding.
class Cut {
 public:
  Cut(const Vec3& a, const Vec3& b, const Vec3& c) : n_(3) { p_ = {a, b, c}; }
  /// Keeps sign * p[axis] <= sign * bound.
  void keep(int axis, double sign, double bound) {
    std::array<Vec3, 16> kept;
    std::size_t n = 0;
    for (std::size_t i = 0; i < n_; ++i) {
      const Vec3& a = p_[i];
      const Vec3& b = p_[i + 1 == n_ ? 0 : i + 1];
      const double da = sign * (a[axis] - bound);
      const double db = sign * (b[axis] - bound);
      if (da <= 0) kept[n++] = a;
      if ((da <= 0) != (db <= 0)) kept[n++] = a + (b - a) * (da / (da - db));
    }
    p_ = kept;
    n_ = n;
  }
  double area() const {
    double twice = 0;
    for (std::size_t i = 2; i < n_; ++i)
      twice += twice_area(p_[0], p_[i - 1], p_[i]);
    return std::abs(twice) / 2;
  }
  double lowest() const {
    double y = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n_; ++i)
      y = std::min(y, p_[i].y);
    return y;
  }

 private:
  std::array<Vec3, 16> p_;
  std::size_t n_;
};

float rounded_down(double h) {
  const auto f = static_cast<float>(h);
  return static_cast<double>(f) <= h ? f
                                     : std::nextafter(f, -std::numeric_limits<float>::infinity());
}

/// Cells along one axis for ground of `size` whose triangles are `edge` wide.
std::uint32_t cells_along(double size, double edge, double cell_m) {
  const double natural = std::max(1.0, std::round(size / edge));
  double n = natural * std::max(1.0, std::ceil(size / natural / std::max(cell_m, kLeastCellM)));
  if (n > static_cast<double>(kMostCellsASide)) {
    n = natural;  // whole triangles, or several together
    if (n > static_cast<double>(kMostCellsASide))
      n = std::ceil(n / std::ceil(n / static_cast<double>(kMostCellsASide)));
  }
  return static_cast<std::uint32_t>(n);
}

class Raster {
 public:
  Raster(const Soup& soup, const Piece& piece, double cell_m) : soup_(soup), piece_(piece) {
    Vec2 edge{0};
    for (const std::uint32_t t : piece.triangles) {
      const Aabb box = box_of(soup.triangles[t]);
      edge += Vec2{box.size().x, box.size().z};
    }
    edge /= static_cast<double>(piece.triangles.size());
    const Vec3 size = piece.box.size();
    field_.columns = cells_along(size.x, edge.x, cell_m);
    field_.rows = cells_along(size.z, edge.y, cell_m);
    field_.origin = ivis::ground(piece.box.lo);
    field_.step = {size.x / field_.columns, size.z / field_.rows};
    least_.assign(std::size_t{field_.columns} * field_.rows,
                  std::numeric_limits<double>::infinity());
    area_.assign(least_.size(), 0);
  }

  // Let n(p) be the number of triangles over p. Within a cell that no flawed edge touches n is one
  // constant (see flaw() in ground.cpp), and the areas over the cell add up to n times the cell's:
  // n = 1 is told from 0 and 2 by an integer, not by a tolerance. Where n is 1 the triangles meet
  // edge to edge, heights included, so the surface is a function and continuous - and remains so
  // across the border to a neighbour of the same kind, as cells are looked at with their borders.
  // Nothing when the context was stopped or the triangles lie over so many cells that they cannot
  // be a surface seen from above: those of one touch each cell a few times, and themselves.
  std::optional<HeightField> field(const Context& context) {
    std::size_t budget = 64 * least_.size() + 64 * piece_.triangles.size();
    const auto spend = [&](const Aabb& box) {
      const Range r = cells(box);
      const std::size_t work = std::size_t{r.c1 - r.c0 + 1} * (r.r1 - r.r0 + 1);
      if (work > budget || context.stopped()) return false;
      budget -= work;
      return true;
    };
    for (const std::uint32_t t : piece_.triangles) {
      if (!spend(box_of(soup_.triangles[t]))) return std::nullopt;
      add(soup_.triangles[t]);
    }
    for (std::size_t i = 0, end = 0; i < piece_.sides.size(); i = end)
      if (edge_flaw(piece_, i, end) != EdgeFlaw::kNone) {
        Aabb box;
        box.add(soup_.corners[piece_.sides[i].lo]);
        box.add(soup_.corners[piece_.sides[i].hi]);
        if (!spend(box)) return std::nullopt;
        spoil(soup_.corners[piece_.sides[i].lo], soup_.corners[piece_.sides[i].hi]);
      }
    const double whole = field_.step.x * field_.step.y * (1 + 2 * kBorder) * (1 + 2 * kBorder);
    field_.heights.resize(least_.size());
    for (std::size_t i = 0; i < least_.size(); ++i) {
      const bool once = std::abs(area_[i] / whole - 1) < 0.25;
      const double rounding = 1e-9 * std::max(1.0, std::abs(least_[i]));
      field_.heights[i] = once ? rounded_down(least_[i] - rounding) : HeightField::kNone;
    }
    return std::move(field_);
  }

 private:
  Aabb box_of(const Corners& t) const {
    Aabb box;
    for (const std::uint32_t c : t)
      box.add(soup_.corners[c]);
    return box;
  }
  struct Range {
    std::uint32_t c0, c1, r0, r1;
  };
  static std::uint32_t clamped(double cell, std::uint32_t n) {
    return static_cast<std::uint32_t>(
        std::clamp(std::floor(cell), 0.0, static_cast<double>(n) - 1));
  }
  Range cells(const Aabb& b) const {
    const Vec2 lo = (ivis::ground(b.lo) - field_.origin) / field_.step - 2 * kBorder;
    const Vec2 hi = (ivis::ground(b.hi) - field_.origin) / field_.step + 2 * kBorder;
    return {clamped(lo.x, field_.columns), clamped(hi.x, field_.columns),
            clamped(lo.y, field_.rows), clamped(hi.y, field_.rows)};
  }
  struct Rectangle {
    Vec2 lo, hi;
  };
  Rectangle cell(std::uint32_t c, std::uint32_t r) const {
    const Vec2 at{c, r};
    return {field_.origin + (at - kBorder) * field_.step,
            field_.origin + (at + 1.0 + kBorder) * field_.step};
  }

  void add(const Corners& t) {
    const Vec3& a = soup_.corners[t[0]];
    const Vec3& b = soup_.corners[t[1]];
    const Vec3& c = soup_.corners[t[2]];
    const Range range = cells(box_of(t));
    for (std::uint32_t r = range.r0; r <= range.r1; ++r)
      for (std::uint32_t col = range.c0; col <= range.c1; ++col) {
        const Rectangle rect = cell(col, r);
        Cut cut(a, b, c);
        cut.keep(0, -1, rect.lo.x);
        cut.keep(0, 1, rect.hi.x);
        cut.keep(2, -1, rect.lo.y);
        cut.keep(2, 1, rect.hi.y);
        const std::size_t i = std::size_t{r} * field_.columns + col;
        area_[i] += cut.area();
        least_[i] = std::min(least_[i], cut.lowest());
      }
  }

  /// A flawed edge: none of the cells it touches is covered.
  void spoil(const Vec3& a, const Vec3& b) {
    Aabb box;
    box.add(a);
    box.add(b);
    const Range range = cells(box);
    const Vec2 along = ivis::ground(b) - ivis::ground(a);
    const Vec2 normal{-along.y, along.x};
    for (std::uint32_t r = range.r0; r <= range.r1; ++r)
      for (std::uint32_t c = range.c0; c <= range.c1; ++c) {
        const Rectangle rect = cell(c, r);
        const Vec2 half = (rect.hi - rect.lo) * 0.5;
        const double off = std::abs(glm::dot(normal, (rect.lo + rect.hi) * 0.5 - ivis::ground(a)));
        const double reach = std::abs(normal.x) * half.x + std::abs(normal.y) * half.y;
        if (off <= reach * (1 + kBorder)) area_[std::size_t{r} * field_.columns + c] = -1e300;
      }
  }

  const Soup& soup_;
  const Piece& piece_;
  HeightField field_;
  std::vector<double> least_;
  std::vector<double> area_;
};

/// Objects that lie wholly under the ground: under a real one next to none.
std::size_t buried(const Scene& scene, const HeightField& field) {
  std::size_t count = 0;
  for (const Object& o : sources(scene)) {
    if (o.always_visible) continue;
    const Vec2 lo = (ground(o.bounds.lo) - field.origin) / field.step;
    const Vec2 hi = (ground(o.bounds.hi) - field.origin) / field.step;
    if (!(lo.x >= 0 && lo.y >= 0 && hi.x < field.columns && hi.y < field.rows)) continue;
    bool under = true;
    for (auto r = static_cast<std::size_t>(lo.y); under && r <= static_cast<std::size_t>(hi.y); ++r)
      for (auto c = static_cast<std::size_t>(lo.x); under && c <= static_cast<std::size_t>(hi.x);
           ++c)
        under = static_cast<double>(field.heights[r * field.columns + c]) > o.bounds.hi.y;
    if (under) ++count;
  }
  return count;
}

/// out[i] = min of in[i - half .. i + half], kNone where that leaves the row.
/// Running minima by blocks: van Herk 1992, Gil and Werman 1993.
void running_minimum(const std::vector<float>& in, std::size_t half, std::vector<float>& out) {
  const std::size_t n = in.size();
  const std::size_t window = 2 * half + 1;
  std::fill(out.begin(), out.end(), HeightField::kNone);
  if (n < window) return;
  std::vector<float> from_left(in);
  std::vector<float> from_right(in);
  for (std::size_t i = 1; i < n; ++i)
    if (i % window != 0) from_left[i] = std::min(from_left[i], from_left[i - 1]);
  for (std::size_t i = n - 1; i-- > 0;)
    if ((i + 1) % window != 0) from_right[i] = std::min(from_right[i], from_right[i + 1]);
  for (std::size_t i = half; i + half < n; ++i)
    out[i] = std::min(from_right[i - half], from_left[i + half]);
}

}  // namespace

std::optional<Terrain> find_terrain(const Scene& scene, double cell_m, const Context& context) {
  const Soup soup = ground_soup(scene, true);
  std::vector<Piece> pieces = split(soup);
  Aabb all;
  for (const Object& o : sources(scene))
    if (!o.always_visible) all.add(o.bounds);
  std::erase_if(pieces, [&](const Piece& p) {
    return 2 * p.box.size().x < all.size().x || 2 * p.box.size().z < all.size().z ||
           !(p.box.size().x > 0) || !(p.box.size().z > 0);
  });
  std::sort(pieces.begin(), pieces.end(),
            [](const Piece& p, const Piece& q) { return p.area > q.area; });
  for (const Piece& piece : pieces) {
    if (context.stopped()) return std::nullopt;
    const auto name = [&] {
      const Object& o = sources(scene)[soup.objects[piece.triangles.front()]];
      return "node " + std::to_string(o.node) + " '" + scene.name_of(o) + "'";
    };
    if (piece.box.size().y < kLeastReliefM) {
      context.say("no terrain at " + name() + ": it is flat and would hide nothing");
      continue;
    }
    auto field = Raster(soup, piece, cell_m).field(context);
    if (!field) {
      context.say("no terrain at " + name() + ": its triangles lie over each other many times");
      continue;
    }
    Terrain terrain{std::move(*field), {}};
    if (buried(scene, terrain.field) > sources(scene).size() / kBuriedIn) {
      context.say("no terrain at " + name() + ": objects lie wholly below it, it may be a ceiling");
      continue;
    }
    for (const std::uint32_t t : piece.triangles)
      terrain.objects.push_back(soup.objects[t]);
    std::sort(terrain.objects.begin(), terrain.objects.end());
    terrain.objects.erase(std::unique(terrain.objects.begin(), terrain.objects.end()),
                          terrain.objects.end());
    return terrain;
  }
  return std::nullopt;
}

// X in cell x, X + u in cell x', u in V's shadow: then the closed rectangles of the cells moved
// apart by (|columns| - 1, |rows| - 1) steps are joined by u, so these gaps lie in the shadow,
// which is symmetric in each axis and convex. The minimum takes every such x', so what lies under
// it stays under the field when moved by u - and by anything that does not rise, which is all of W.
HeightField erode(const HeightField& field, const Reach& grown, double drop_m) {
  HeightField out = field;
  if (field.empty()) return out;
  const Vec3 e = grown.half_extents();
  const auto touches = [&](std::size_t columns, std::size_t rows) {
    const double x = static_cast<double>(columns > 0 ? columns - 1 : 0) * field.step.x * (1 - 1e-9);
    const double z = static_cast<double>(rows > 0 ? rows - 1 : 0) * field.step.y * (1 - 1e-9);
    if (x > e.x || z > e.z) return false;
    if (grown.horizontal_is_box()) return true;
    const double qx = x > 0 ? x / e.x : 0;
    const double qz = z > 0 ? z / e.z : 0;
    return qx * qx + qz * qz <= 1;
  };
  const std::size_t columns = field.columns;
  const std::size_t rows = field.rows;
  std::fill(out.heights.begin(), out.heights.end(), std::numeric_limits<float>::infinity());
  std::vector<float> row(columns);
  std::vector<float> least(columns);
  std::size_t half = columns;
  for (std::size_t dr = 0; dr < rows && touches(0, dr); ++dr) {
    while (half > 0 && !touches(half, dr))
      --half;
    for (std::size_t r = 0; r < rows; ++r) {
      std::copy_n(field.heights.begin() + static_cast<std::ptrdiff_t>(r * columns), columns,
                  row.begin());
      running_minimum(row, half, least);
      const auto merge = [&](std::size_t to) {
        for (std::size_t c = 0; c < columns; ++c)
          out.heights[to * columns + c] = std::min(out.heights[to * columns + c], least[c]);
      };
      if (r >= dr) merge(r - dr);
      if (dr > 0 && r + dr < rows) merge(r + dr);
      if (r < dr || r + dr >= rows) {  // looks past the grid
        float* here = &out.heights[r * columns];
        std::fill(here, here + columns, HeightField::kNone);
      }
    }
  }
  for (float& h : out.heights)
    h = h > 0.5F * HeightField::kNone ? rounded_down(static_cast<double>(h) - drop_m)
                                      : HeightField::kNone;
  return out;
}

std::vector<std::uint32_t> add_height_field(const Scene& scene, OccluderSet& set,
                                            const Context& context) {
  const Reach grown = padded(set.reach, set.slack_m);
  const Vec3 e = grown.half_extents();
  auto terrain = find_terrain(scene, std::min(e.x, e.z), context);
  if (!terrain) return {};
  // Under the ground no viewpoint counts: where somebody says that observers are, there is none.
  for (const Vec3& seed : set.view_space.seeds) {
    const Vec2 at = (ground(seed) - terrain->field.origin) / terrain->field.step;
    if (!(at.x >= 0 && at.y >= 0 && at.x < terrain->field.columns && at.y < terrain->field.rows))
      continue;
    const std::size_t cell =
        static_cast<std::size_t>(at.y) * terrain->field.columns + static_cast<std::size_t>(at.x);
    if (static_cast<double>(terrain->field.heights[cell]) > seed.y) {
      context.say("no terrain: observers are below it, at " + std::to_string(seed.x) + "," +
                  std::to_string(seed.y) + "," + std::to_string(seed.z));
      return {};
    }
  }
  set.height_field = erode(terrain->field, grown, set.slack_m);
  const auto left = std::count_if(set.height_field.heights.begin(), set.height_field.heights.end(),
                                  [](float h) { return h != HeightField::kNone; });
  context.say("terrain: " + std::to_string(terrain->objects.size()) + " objects, " +
              std::to_string(left) + " cells of " + std::to_string(set.height_field.step.x) +
              " x " + std::to_string(set.height_field.step.y) + " m left after shrinking");
  if (left == 0) set.height_field = {};
  return std::move(terrain->objects);
}

}  // namespace ivis
