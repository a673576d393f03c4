#include "occluders/gate.h"

#include <algorithm>

#include "occluders/distance_check.h"
#include "occluders/simplify.h"

namespace ivis {

std::vector<Polygon> gated_erosion(const Polygon& region, const Reach& reach, const Eroder& eroder,
                                   double min_area_m2, std::size_t& failed) {
  std::vector<Polygon> out;
  for (Polygon& piece : eroder.erode(region, reach)) {
    if (area(piece) < min_area_m2) continue;
    std::vector<Polygon> simple = simplify_inwards(piece);
    const auto passes = [&](const Polygon& p) { return within_erosion(p, region, reach); };
    if (std::all_of(simple.begin(), simple.end(), passes)) {
      for (Polygon& p : simple)
        if (area(p) >= min_area_m2) out.push_back(std::move(p));
    } else if (passes(piece)) {
      out.push_back(std::move(piece));
    } else {
      ++failed;
    }
  }
  return out;
}

}  // namespace ivis
