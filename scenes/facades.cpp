#include "scenes/facades.h"

#include <algorithm>
#include <cmath>

namespace ivis {
namespace {

struct Wall {
  Vec2 a, b;  ///< outside is on the right
  bool street = false;
  bool sparse = false;
};

struct Style {
  double bay, width, height, sill;  ///< of a window; shares of bay and storey but for `bay`, metres
};
constexpr Style kStyles[] = {{2.9, 0.42, 0.55, 0.26}, {3.3, 0.45, 0.50, 0.28},
                             {2.7, 0.46, 0.60, 0.22}, {3.8, 0.62, 0.45, 0.30},
                             {3.2, 0.50, 0.58, 0.20}, {4.4, 0.70, 0.48, 0.28}};

void dress_wall(const CityBuilding& b, const Wall& wall, double bay_scale, bool barred, bool door,
                Random& random, PartList& parts) {
  const Vec2 d = wall.b - wall.a;
  const double length = glm::length(d);
  if (length < 2.2) return;
  const Vec2 along = d / length;
  const Vec2 out(along.y, -along.x);
  const Style& style = kStyles[b.style % std::size(kStyles)];
  const double bay = style.bay * bay_scale * (wall.sparse ? 1.7 : 1.0) * (b.hall ? 2.0 : 1.0);
  const auto bays = std::max<std::size_t>(1, static_cast<std::size_t>((length - 0.8) / bay));
  const double pitch = length / static_cast<double>(bays);
  const auto storeys =
      static_cast<std::size_t>(std::max(1.0, (b.eave - b.street - 0.5) / b.storey));
  const double width = std::min(
      {style.width * pitch, 0.75 * (length / static_cast<double>(bays)), b.hall ? 5.0 : 3.0});
  const double height = b.hall ? 1.6 : style.height * b.storey;
  const Part window = barred ? Part::kWindowBarred : Part::kWindowPlain;
  const bool shops = wall.street && !b.hall && random.chance(0.35);
  const bool balconies = !b.hall && !shops && random.chance(0.22);
  const std::size_t door_bay = bays / 2;
  for (std::size_t floor = 0; floor < storeys; ++floor) {
    for (std::size_t i = 0; i < bays; ++i) {
      const Vec2 p = wall.a + along * (pitch * (static_cast<double>(i) + 0.5));
      const double y = b.street + static_cast<double>(floor) * b.storey;
      const Vec3 at(p.x, y, p.y);
      if (floor == 0 && door && i == door_bay) {
        const double w = b.hall ? 4.0 : 1.3;
        parts.add(Part::kDoor, at, out, {std::min(w, 0.8 * pitch), b.hall ? 4.0 : 2.3, 1});
        continue;
      }
      if (floor == 0 && shops) {
        parts.add(Part::kWindowPlain, at + Vec3(0, 0.5, 0), out,
                  {0.82 * pitch, 0.62 * b.storey, 1});
        continue;
      }
      if (random.chance(0.03)) continue;  // walled up
      const double sill =
          b.hall ? b.eave - b.street - 2.6 : style.sill * b.storey + (floor == 0 ? 0.2 : 0.0);
      parts.add(window, at + Vec3(0, sill, 0), out, {width, height, 1});
      if (balconies && floor > 0 && i % 2 == 1)
        parts.add(Part::kBalcony, at + Vec3(0, sill - 0.1, 0), out, {0.9 * pitch, 2.2, 1.1});
    }
  }
}

void dress_roof(const CityBuilding& b, Random& random, PartList& parts) {
  const std::size_t n = 1 + random.below(b.hall ? 6 : 3);
  const Vec2 along = glm::normalize(b.outer[1] - b.outer[0]);
  for (std::size_t k = 0; k < n; ++k) {
    const double t = random.in(0.25, 0.75);
    const double u = b.roof == Roof::kFlat || b.roof == Roof::kShed ? random.in(0.25, 0.75)
                                                                    : random.in(0.42, 0.58);
    const Vec2 p =
        glm::mix(glm::mix(b.outer[0], b.outer[1], t), glm::mix(b.inner[0], b.inner[1], t), u);
    const bool flat = b.roof == Roof::kFlat;
    const double y = b.eave + (flat                    ? 0.0
                               : b.roof == Roof::kShed ? 0.2 * b.roof_height
                                                       : 0.55 * b.roof_height);
    const double up = flat ? random.in(0.6, 2.2) : 0.45 * b.roof_height + random.in(0.6, 1.4);
    parts.add(
        Part::kChimney, {p.x, y, p.y}, along,
        {flat ? random.in(0.8, 3.0) : random.in(0.5, 0.9), up, flat ? random.in(0.8, 2.5) : 0.6});
  }
}

}  // namespace

void dress_building(const CityBuilding& b, double bay_scale, bool barred, Random random,
                    PartList& parts) {
  const std::size_t last = b.outer.size() - 1;
  for (std::size_t j = 0; j < last; ++j) {
    dress_wall(b, {b.outer[j], b.outer[j + 1], true, false}, bay_scale, barred, j == 0, random,
               parts);
    dress_wall(b, {b.inner[j + 1], b.inner[j], false, b.bare_court}, bay_scale, barred, false,
               random, parts);
  }
  if (b.free_ends) {
    dress_wall(b, {b.outer[last], b.inner[last], false, true}, bay_scale, barred, false, random,
               parts);
    dress_wall(b, {b.inner[0], b.outer[0], false, true}, bay_scale, barred, false, random, parts);
  }
  dress_roof(b, random, parts);
}

}  // namespace ivis
