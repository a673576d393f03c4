#include "scenes/city_buildings.h"

#include <algorithm>
#include <cmath>

namespace ivis {
namespace {

Vec2 left_of(const Vec2& d) {
  return {-d.y, d.x};
}
double cross(const Vec2& a, const Vec2& b) {
  return a.x * b.y - a.y * b.x;
}

/// Points of the roof's cross-section: how far from outer (0) to inner (1), and how high above the
/// eave.
std::vector<Vec2> profile(const CityBuilding& b) {
  switch (b.roof) {
    case Roof::kFlat:
      return {{0, 0}, {1, 0}};
    case Roof::kShed:
      return {{0, 0}, {1, b.roof_height}};
    case Roof::kMansard:
      return {{0, 0},
              {0.12, 0.65 * b.roof_height},
              {0.5, b.roof_height},
              {0.88, 0.65 * b.roof_height},
              {1, 0}};
    case Roof::kGable:
    case Roof::kHip:
      return {{0, 0}, {0.5, b.roof_height}, {1, 0}};
  }
  return {};
}

/// Sets heights and roof of a building whose lines are known.
void raise(CityBuilding& b, std::size_t storeys, const HeightGrid& ground, Random& random) {
  Vec2 lo = b.outer[0];
  Vec2 hi = lo;
  b.street = ground.height(lo);
  for (const auto* line : {&b.outer, &b.inner}) {
    for (const Vec2& p : *line) {
      lo = glm::min(lo, p);
      hi = glm::max(hi, p);
      b.street = std::max(b.street, ground.height(p));
    }
  }
  b.base = ground.lowest(lo, hi) - 0.3;
  b.storey = random.in(2.9, 3.6);
  b.eave = b.street + static_cast<double>(storeys) * b.storey + random.in(0.7, 1.3);
  b.style = random.below(6);
  b.bare_court = random.chance(0.4);
  const double depth = glm::length(b.inner[0] - b.outer[0]);
  const double pick = random.unit();
  if (pick < 0.3) {
    b.roof = Roof::kFlat;
  } else if (pick < 0.72) {
    b.roof = Roof::kGable;
    b.roof_height = depth * random.in(0.28, 0.45);
  } else if (pick < 0.92) {
    b.roof = Roof::kMansard;
    b.roof_height = random.in(3.5, 5.5);
  } else {
    b.roof = Roof::kShed;
    b.roof_height = depth * random.in(0.08, 0.15);
  }
}

std::size_t storeys_for(double out, Random& random) {
  const double mean = 5.6 - 2.6 * out;
  return static_cast<std::size_t>(std::clamp(mean + random.in(-1.6, 1.8), 2.0, 9.0));
}

/// A free-standing rectangular building: centre, unit vector along it, half length, half depth.
CityBuilding box_building(const Vec2& centre, const Vec2& along, double half_length,
                          double half_depth) {
  const Vec2 in = left_of(along) * half_depth;
  const Vec2 side = along * half_length;
  CityBuilding b;
  b.outer = {centre - side - in, centre + side - in};
  b.inner = {centre - side + in, centre + side + in};
  b.free_ends = true;
  return b;
}

/// Is the disc about p, or the whole box, within the ring? Corners and middles of sides suffice for
/// rings that are nearly convex.
bool within(const std::vector<Vec2>& ring, const CityBuilding& b, double margin) {
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2 a = ring[i];
    const Vec2 d = glm::normalize(ring[(i + 1) % ring.size()] - a);
    for (const auto* line : {&b.outer, &b.inner})
      for (const Vec2& p : *line)
        if (cross(d, p - a) < margin) return false;
  }
  return true;
}

/// Houses wall to wall about a court. Corner houses first; what is left of each side is cut into
/// houses.
bool build_perimeter(BuiltBlock& block, double out, double frontage_m, const HeightGrid& ground,
                     Random& random) {
  const auto& line = block.line;
  const std::size_t n = line.size();
  const double depth = random.in(11, 14.5);
  const auto court = inset_ring(line, std::vector<double>(n, depth));
  if (court.empty() || ring_area(court) < 150) return false;

  struct Side {
    Vec2 a, along;
    double length;
    double from, to;  // free of corner houses
  };
  std::vector<Side> sides(n);
  for (std::size_t i = 0; i < n; ++i) {
    Side& s = sides[i];
    s.a = line[i];
    const Vec2 d = line[(i + 1) % n] - s.a;
    s.length = glm::length(d);
    s.along = d / s.length;
    // The court's corners, seen along this side: a corner house must reach past them.
    s.from = std::max(0.0, glm::dot(court[i] - s.a, s.along));
    s.to = std::min(s.length, glm::dot(court[(i + 1) % n] - s.a, s.along));
    const double play = s.to - s.from;
    if (play < 2) return false;
    const double want = std::max(3.0, frontage_m * random.in(0.3, 0.55) - depth);
    const double grow = std::min(play < 2 * want + 10 ? play * 0.5 : want, play * 0.5);
    s.from += grow;
    s.to -= grow;
    if (s.to - s.from < 1e-6) s.from = s.to = (s.from + s.to) / 2;
  }
  const auto point = [&](const Side& s, double t, bool inner) {
    return s.a + s.along * t + (inner ? left_of(s.along) * depth : Vec2(0));
  };
  const std::size_t storeys = storeys_for(out, random);
  const auto house_storeys = [&] {
    const double d = random.in(-1.3, 1.3);
    return static_cast<std::size_t>(std::max(2.0, static_cast<double>(storeys) + d));
  };
  for (std::size_t i = 0; i < n; ++i) {
    const Side& before = sides[(i + n - 1) % n];
    const Side& s = sides[i];
    CityBuilding corner;
    corner.outer = {point(before, before.to, false), line[i], point(s, s.from, false)};
    corner.inner = {point(before, before.to, true), court[i], point(s, s.from, true)};
    raise(corner, house_storeys(), ground, random);
    block.buildings.push_back(std::move(corner));

    const double free = s.to - s.from;
    if (free <= 0) continue;
    const auto houses = static_cast<std::size_t>(std::max(1LL, std::llround(free / frontage_m)));
    std::vector<double> cut{s.from};
    for (std::size_t k = 1; k < houses; ++k)
      cut.push_back(s.from + free * (static_cast<double>(k) + random.in(-0.22, 0.22)) /
                                 static_cast<double>(houses));
    cut.push_back(s.to);
    for (std::size_t k = 0; k < houses; ++k) {
      CityBuilding house;
      for (const std::size_t c : {k, k + 1}) {
        house.outer.push_back(point(s, cut[c], false));
        house.inner.push_back(point(s, cut[c], true));
      }
      raise(house, house_storeys(), ground, random);
      // A gap in the row now and then lets one see into the court.
      if (free > 40 && houses > 1 && random.chance(0.04)) continue;
      block.buildings.push_back(std::move(house));
    }
  }
  // A rear house in a large court.
  const Vec2 middle = ring_centre(court);
  if (ring_area(court) > 2500 && random.chance(0.6)) {
    const double half_length = random.in(9, 16);
    const double half_depth = random.in(5, 6.5);
    CityBuilding rear = box_building(middle, sides[0].along, half_length, half_depth);
    if (within(court, rear, 6)) {
      raise(rear, std::max<std::size_t>(2, storeys - 1), ground, random);
      block.buildings.push_back(std::move(rear));
    }
  }
  return true;
}

/// Direction of the ring's longest side.
Vec2 main_direction(const std::vector<Vec2>& ring) {
  Vec2 best(1, 0);
  double length = 0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2 d = ring[(i + 1) % ring.size()] - ring[i];
    if (glm::length(d) > length) {
      length = glm::length(d);
      best = d / length;
    }
  }
  return best;
}

/// Free-standing buildings on a lattice over the block: rows of slabs, or villas in gardens.
void build_lattice(BuiltBlock& block, bool villas, double frontage_m, const HeightGrid& ground,
                   Random& random) {
  const auto& ring = block.line;
  const Vec2 along = main_direction(ring);
  const Vec2 centre = ring_centre(ring);
  const double length =
      villas ? std::max(11.0, frontage_m * 0.5) : std::max(24.0, frontage_m * 1.6);
  const double depth = villas ? random.in(9, 12) : random.in(10, 13);
  const double step_along = length + (villas ? 9 : 14);
  const double step_in = depth + (villas ? 14 : 22);
  const auto storeys = static_cast<std::size_t>(villas ? 1 + random.below(3) : 4 + random.below(6));
  for (int k = -12; k <= 12; ++k) {
    for (int i = -12; i <= 12; ++i) {
      // One draw a statement: compilers differ in the order in which they take a call's arguments.
      const double off_along = random.in(-0.04, 0.04);
      const double off_in = random.in(-0.05, 0.05);
      const double longer = random.in(0.85, 1.0);
      const double deeper = random.in(0.85, 1.0);
      const Vec2 at = centre + along * (step_along * (i + off_along)) +
                      left_of(along) * (step_in * (k + off_in));
      CityBuilding b = box_building(at, along, length / 2 * longer, depth / 2 * deeper);
      const bool skip = random.chance(villas ? 0.1 : 0.05);
      raise(b, storeys, ground, random);
      if (skip || !within(ring, b, 3)) continue;
      b.bare_court = false;
      b.roof = villas ? (random.chance(0.6) ? Roof::kHip : Roof::kGable) : Roof::kFlat;
      b.roof_height = villas ? depth * random.in(0.3, 0.45) : 0;
      block.buildings.push_back(std::move(b));
    }
  }
}

/// One large low building.
void build_hall(BuiltBlock& block, const HeightGrid& ground, Random& random) {
  const Vec2 along = main_direction(block.line);
  const Vec2 centre = ring_centre(block.line);
  for (double half = 60; half > 14; half *= 0.9) {
    CityBuilding b = box_building(centre, along, half, half * 0.62);
    if (!within(block.line, b, 8)) continue;
    raise(b, 2, ground, random);
    b.hall = true;
    b.roof = random.chance(0.6) ? Roof::kFlat : Roof::kShed;
    b.roof_height = 2.5;
    b.eave = b.street + random.in(8, 15);
    b.storey = b.eave - b.street - 1;
    block.buildings.push_back(std::move(b));
    return;
  }
}

}  // namespace

std::vector<Vec2> CityBuilding::footprint() const {
  std::vector<Vec2> ring = outer;
  ring.insert(ring.end(), inner.rbegin(), inner.rend());
  return ring;
}

BuiltBlock build_block(const CityBlock& block, double out, double frontage_m,
                       const HeightGrid& ground, Random random) {
  BuiltBlock built;
  built.line = inset_ring(block.ring, block.half_width);
  if (built.line.empty() || ring_area(built.line) < 400) {
    built.line.clear();
    return built;
  }
  const double pick = random.unit();
  const double dense = 1 - 0.7 * out;  // share of blocks with houses wall to wall
  if (pick < 0.08) {
    built.use = BlockUse::kPark;
    return built;
  }
  if (pick < 0.12) {
    built.use = BlockUse::kSquare;
    return built;
  }
  if (pick < 0.12 + 0.88 * dense) {
    built.use = BlockUse::kPerimeter;
    if (build_perimeter(built, out, frontage_m, ground, random)) return built;
    built.buildings.clear();
  }
  const double kind = random.unit();
  if (kind < 0.45) {
    built.use = BlockUse::kSlabs;
    build_lattice(built, false, frontage_m, ground, random);
  } else if (kind < 0.8) {
    built.use = BlockUse::kVillas;
    build_lattice(built, true, frontage_m, ground, random);
  } else {
    built.use = BlockUse::kHall;
    build_hall(built, ground, random);
  }
  if (built.buildings.empty()) built.use = BlockUse::kPark;
  return built;
}

GlbPrimitive building_mesh(const CityBuilding& b, std::uint32_t material) {
  const auto shape = profile(b);
  const auto columns = static_cast<std::uint32_t>(b.outer.size());
  const auto points = static_cast<std::uint32_t>(shape.size());
  GlbPrimitive mesh;
  mesh.material = material;
  const auto add = [&](const Vec2& p, double y) { mesh.positions.emplace_back(p.x, y, p.y); };
  for (std::uint32_t j = 0; j < columns; ++j) {
    add(b.outer[j], b.base);
    add(b.inner[j], b.base);
    for (const Vec2& s : shape) {
      // Exactly the corner at both ends: neighbours' party walls then share it to the bit.
      Vec2 p = s.x == 0   ? b.outer[j]
               : s.x == 1 ? b.inner[j]
                          : glm::mix(b.outer[j], b.inner[j], s.x);
      const bool ridge = s.x == 0.5;
      if (b.roof == Roof::kHip && ridge && columns == 2) {
        const Vec2 along = b.outer[1] - b.outer[0];
        const double depth = glm::length(b.inner[0] - b.outer[0]);
        const double pull = std::min(depth * 0.5, glm::length(along) * 0.4);
        p += glm::normalize(along) * (j == 0 ? pull : -pull);
      }
      add(p, b.eave + s.y);
    }
  }
  const std::uint32_t stride = points + 2;
  const auto outer = [&](std::uint32_t j) { return j * stride; };
  const auto inner = [&](std::uint32_t j) { return j * stride + 1; };
  const auto top = [&](std::uint32_t j, std::uint32_t p) { return j * stride + 2 + p; };
  const auto quad = [&](std::uint32_t a, std::uint32_t c, std::uint32_t d, std::uint32_t e) {
    mesh.indices.insert(mesh.indices.end(), {a, c, d, a, d, e});
  };
  for (std::uint32_t j = 0; j + 1 < columns; ++j) {
    quad(outer(j), top(j, 0), top(j + 1, 0), outer(j + 1));
    quad(inner(j + 1), top(j + 1, points - 1), top(j, points - 1), inner(j));
    quad(outer(j), outer(j + 1), inner(j + 1), inner(j));
    for (std::uint32_t p = 0; p + 1 < points; ++p)
      quad(top(j, p), top(j, p + 1), top(j + 1, p + 1), top(j + 1, p));
  }
  const std::uint32_t last = columns - 1;
  quad(outer(last), top(last, 0), top(last, points - 1), inner(last));
  quad(inner(0), top(0, points - 1), top(0, 0), outer(0));
  for (std::uint32_t p = 1; p + 1 < points; ++p) {
    mesh.indices.insert(mesh.indices.end(), {top(last, 0), top(last, p), top(last, p + 1)});
    mesh.indices.insert(mesh.indices.end(), {top(0, 0), top(0, p + 1), top(0, p)});
  }
  return mesh;
}

}  // namespace ivis
