#include "scenes/street_furniture.h"

#include <algorithm>
#include <cmath>

namespace ivis {
namespace {

Vec2 left_of(const Vec2& d) {
  return {-d.y, d.x};
}

bool inside_ring(const std::vector<Vec2>& ring, const Vec2& p) {
  bool in = false;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2 a = ring[i];
    const Vec2 b = ring[(i + 1) % ring.size()];
    if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y)) in = !in;
  }
  return in;
}

/// In the ring of buildings, at least `margin` from all of them?
bool clear_of(const std::vector<CityBuilding>& buildings, const Vec2& p, double margin) {
  for (const CityBuilding& b : buildings) {
    const auto ring = b.footprint();
    if (inside_ring(ring, p)) return false;
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vec2 a = ring[i];
      const Vec2 d = ring[(i + 1) % ring.size()] - a;
      const double s = std::clamp(glm::dot(p - a, d) / glm::dot(d, d), 0.0, 1.0);
      if (glm::length(p - a - d * s) < margin) return false;
    }
  }
  return true;
}

class Furnisher {
 public:
  Furnisher(const HeightGrid& ground, Random& random, PartList& parts,
            std::vector<StreetObstacles::Disc>& discs)
      : ground_(ground), random_(random), parts_(parts), discs_(discs) {}

  void tree(const Vec2& p, double height) {
    const double x = random_.in(-1, 1);
    const double z = random_.in(-1, 1);
    const double length = std::sqrt(x * x + z * z);
    const Vec2 facing = length > 0.1 ? Vec2(x, z) / length : Vec2(0, 1);
    const double h = height * random_.in(0.75, 1.25);
    const bool conical = random_.chance(0.18);
    const double wide = h * random_.in(0.85, 1.15);
    const double deep = h * random_.in(0.85, 1.15);
    parts_.add(conical ? Part::kTreeConical : Part::kTreeRound, at(p), facing, {wide, h, deep});
    discs_.push_back({p, 0.9});
  }
  void lamp(const Vec2& p, const Vec2& to_street, double height) {
    parts_.add(Part::kLamp, at(p), to_street, Vec3(height));
    discs_.push_back({p, 0.7});
  }
  void car(const Vec2& p, const Vec2& along) {
    // The mesh lies along X: +Z turns to the left of its length.
    const Vec2 facing = random_.chance(0.8) ? left_of(along) : -left_of(along);
    parts_.add(Part::kCar, at(p), facing,
               {random_.in(0.88, 1.1), random_.in(0.95, 1.15), random_.in(0.95, 1.05)});
    for (const double s : {-1.6, -0.5, 0.5, 1.6})
      discs_.push_back({p + along * s, 1.5});
  }
  void bench(const Vec2& p, const Vec2& facing) {
    parts_.add(Part::kBench, at(p), facing, Vec3(1));
    discs_.push_back({p, 1.2});
  }

 private:
  Vec3 at(const Vec2& p) const { return {p.x, ground_.height(p) - 0.02, p.y}; }

  const HeightGrid& ground_;
  Random& random_;
  PartList& parts_;
  std::vector<StreetObstacles::Disc>& discs_;
};

/// One side of a block: `a` to `b` is its building line, `half` the distance from there to the
/// middle of the street.
void furnish_street(const Vec2& a, const Vec2& b, double half, Random& random, Furnisher& f) {
  const double length = glm::length(b - a);
  const Vec2 along = (b - a) / length;
  const Vec2 out = -left_of(along);
  const double pavement = std::clamp(0.36 * half, 1.6, 4.5);
  const auto at = [&](double t, double from_wall) { return a + along * t + out * from_wall; };
  if (half > 5.5)
    for (double t = random.in(4, 14); t < length - 3; t += 27)
      f.lamp(at(t, pavement - 0.3), out, half > 10 ? 8 : 5.5);
  if (half > 9)
    for (double t = 5; t < length - 4; t += 10.5)
      if (random.chance(0.92)) f.tree(at(t + random.in(-0.4, 0.4), pavement - 0.9), 8.5);
  if (half > 12)  // a second row between the lanes
    for (double t = 9; t < length - 8; t += 12)
      if (random.chance(0.85)) f.tree(at(t, half - 2), 7);
  // In narrow streets cars stand on one side only, so that a way is left.
  if (half > 6.5 || along.x + along.y * 0.3 > 0) {
    const double share = random.in(0.1, 0.45);
    if (half > 4.5)
      for (double t = 8; t < length - 8; t += 6.1)
        if (random.chance(share)) f.car(at(t, pavement + 1.05), along);
  }
}

/// Trees over the ring, `per` square metres each, clear of the buildings.
void scatter(const BuiltBlock& built, const std::vector<Vec2>& ring, double per, double height,
             Random& random, Furnisher& f) {
  Vec2 lo = ring[0];
  Vec2 hi = ring[0];
  for (const Vec2& p : ring) {
    lo = glm::min(lo, p);
    hi = glm::max(hi, p);
  }
  const Vec2 size = hi - lo;
  const auto n = static_cast<std::size_t>(size.x * size.y / per);
  for (std::size_t k = 0; k < n; ++k) {
    const double x = random.unit();  // in an order of our own, not the compiler's
    const double z = random.unit();
    const Vec2 p = lo + size * Vec2(x, z);
    if (inside_ring(ring, p) && clear_of(built.buildings, p, 2.8)) f.tree(p, height);
  }
}

}  // namespace

void furnish_block(const CityBlock& block, const BuiltBlock& built, const HeightGrid& ground,
                   Random random, PartList& parts, std::vector<StreetObstacles::Disc>& discs) {
  if (built.line.empty()) return;
  Furnisher f(ground, random, parts, discs);
  const auto& line = built.line;
  for (std::size_t i = 0; i < line.size(); ++i)
    if (glm::length(line[(i + 1) % line.size()] - line[i]) > 12)
      furnish_street(line[i], line[(i + 1) % line.size()], block.half_width[i], random, f);

  const Vec2 centre = ring_centre(line);
  switch (built.use) {
    case BlockUse::kPark:
      scatter(built, line, 150, 11, random, f);
      for (std::size_t i = 0; i < line.size(); ++i) {
        const Vec2 p = glm::mix(line[i], centre, 0.25);
        const Vec2 to = glm::normalize(centre - p);
        if (clear_of(built.buildings, p, 2)) f.bench(p, to);
      }
      break;
    case BlockUse::kSquare:
      for (std::size_t i = 0; i < line.size(); ++i) {
        const Vec2 d = line[(i + 1) % line.size()] - line[i];
        const auto n = static_cast<std::size_t>(glm::length(d) / 12);
        for (std::size_t k = 1; k < n; ++k) {
          const Vec2 p = glm::mix(line[i] + d * (static_cast<double>(k) / static_cast<double>(n)),
                                  centre, 0.12);
          if (k % 3 == 0)
            f.bench(p, glm::normalize(centre - p));
          else
            f.tree(p, 7);
        }
      }
      f.lamp(centre, {0, 1}, 9);
      break;
    case BlockUse::kPerimeter: {
      const auto court = inset_ring(line, std::vector<double>(line.size(), 17));
      if (!court.empty() && ring_area(court) > 0) scatter(built, court, 400, 8, random, f);
      break;
    }
    case BlockUse::kSlabs:
      scatter(built, line, 420, 9, random, f);
      break;
    case BlockUse::kVillas:
      scatter(built, line, 330, 7, random, f);
      break;
    case BlockUse::kHall:
      scatter(built, line, 900, 9, random, f);
      break;
  }
}

}  // namespace ivis
