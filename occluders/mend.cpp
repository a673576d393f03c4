#include "occluders/mend.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "occluders/fuse.h"
#include "occluders/prisms.h"
#include "occluders/shrink_stack.h"

namespace ivis {
namespace {

bool same(const Prism& a, const Prism& b) {
  return a.bottom == b.bottom && a.top == b.top && a.footprint.rings == b.footprint.rings;
}

void make_unique(std::vector<std::uint32_t>& indices) {
  std::ranges::sort(indices);
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
}

std::vector<Prism> shrink_solids(const std::vector<Prism>& solids, const OccluderSet& set,
                                 const Eroder& eroder, const Context& context) {
  std::vector<Prism> out;
  const Reach grown = shrink_reach(set);
  for (const FusedStack& stack : fuse(solids, set.floor, {}, context)) {
    if (context.stopped()) break;
    ShrunkStack shrunk = shrink_stack(stack, set, grown, eroder);
    std::ranges::move(shrunk.prisms, std::back_inserter(out));
  }
  return out;
}

}  // namespace

std::vector<Prism> mend(const OccluderIndex& index, std::span<const Displaced> displaced,
                        const Eroder& eroder, const Context& context) {
  const OccluderSet& set = index.occluders();
  struct Near {
    Aabb box;
    std::uint32_t solid;
    bool missing;
  };
  std::vector<std::uint32_t> blocks;  // that are out of use, which all reach down
  for (const Displaced& d : displaced)
    std::ranges::copy(index.touched(d.bounds), std::back_inserter(blocks));
  make_unique(blocks);
  std::vector<std::uint32_t> about;
  for (const std::uint32_t b : blocks)
    std::ranges::copy(index.solids_on(ground_box(index.box(b))), std::back_inserter(about));
  make_unique(about);
  std::vector<Near> near;
  near.reserve(about.size());
  for (const std::uint32_t s : about)
    near.push_back({index.solid_box(s), s, false});
  for (const Displaced& d : displaced) {
    // Each by itself: one that is there twice does not stand for another that is not there.
    const bool all_known = std::ranges::all_of(d.solids, [&](const Prism& p) {
      bool known = false;
      for (Near& n : near)
        if (n.box.overlaps(d.bounds) && same(p, set.solids[n.solid])) n.missing = known = true;
      return known;
    });
    if (all_known) continue;
    for (Near& n : near)
      n.missing = n.missing || n.box.overlaps(d.bounds);
  }
  std::vector<Prism> solids;
  for (const Near& n : near)
    if (!n.missing) solids.push_back(set.solids[n.solid]);
  return shrink_solids(solids, set, eroder, context);
}

ShrunkObject shrink_object(const Scene& scene, const Object& object, const OccluderSet& set,
                           const Eroder& eroder, const Context& context) {
  ShrunkObject out;
  const std::vector<Prism> solids = extract_prisms(scene, object).prisms;
  for (const Prism& p : solids)
    out.solids.push_back(p.bounds());
  out.prisms = shrink_solids(solids, set, eroder, context);
  return out;
}

}  // namespace ivis
