#include "visibility/solid_index.h"

#include <algorithm>
#include <cmath>

namespace ivis {

std::size_t SolidIndex::cell_of(double v, double lo) const {
  return static_cast<std::size_t>(std::max(0.0, (v - lo) / cell_m_));
}

SolidIndex::SolidIndex(const OccluderSet& occluders) : occluders_(&occluders) {
  std::vector<Aabb> boxes;
  boxes.reserve(occluders.solids.size() + occluders.convex_solids.size() +
                occluders.closed_boxes.size());
  for (const Prism& s : occluders.solids)
    boxes.push_back(s.bounds());
  for (const ConvexSolid& s : occluders.convex_solids)
    boxes.push_back(s.bounds);
  boxes.insert(boxes.end(), occluders.closed_boxes.begin(), occluders.closed_boxes.end());
  for (const Aabb& b : boxes)
    bounds_.add(b);
  if (boxes.empty() || bounds_.empty()) return;
  // About one solid a cell; at most a million cells.
  const Vec3 size = bounds_.size();
  const double cells = std::clamp(static_cast<double>(boxes.size()), 1.0, 1e6);
  cell_m_ = std::max({std::sqrt(size.x * size.z / cells), size.x / 4096, size.z / 4096, 1e-3});
  // Coarser while large boxes would be entered in too many cells: a file may hold many that cover
  // everything.
  while (true) {
    columns_ = static_cast<std::size_t>(size.x / cell_m_) + 1;
    rows_ = static_cast<std::size_t>(size.z / cell_m_) + 1;
    double entries = 0;
    for (const Aabb& b : boxes)
      entries += b.empty() ? 0 : (b.size().x / cell_m_ + 2) * (b.size().z / cell_m_ + 2);
    if ((columns_ == 1 && rows_ == 1) || entries <= 16.0 * static_cast<double>(boxes.size()) + 4096)
      break;
    cell_m_ *= 2;
  }
  const auto each_cell = [&](const Aabb& b, const auto& visit) {
    if (b.empty()) return;
    for (std::size_t r = cell_of(b.lo.z, bounds_.lo.z); r <= cell_of(b.hi.z, bounds_.lo.z); ++r)
      for (std::size_t c = cell_of(b.lo.x, bounds_.lo.x); c <= cell_of(b.hi.x, bounds_.lo.x); ++c)
        visit(r * columns_ + c);
  };
  start_.assign(columns_ * rows_ + 1, 0);
  for (const Aabb& b : boxes)
    each_cell(b, [&](std::size_t cell) { ++start_[cell + 1]; });
  for (std::size_t i = 1; i < start_.size(); ++i)
    start_[i] += start_[i - 1];
  solids_.resize(start_.back());
  std::vector<std::uint32_t> next(start_.begin(), start_.end() - 1);
  for (std::uint32_t s = 0; s < boxes.size(); ++s)
    each_cell(boxes[s], [&](std::size_t cell) { solids_[next[cell]++] = s; });
}

bool SolidIndex::holds(const Vec3& p) const {
  if (start_.empty() || !bounds_.contains(p)) return false;
  const std::size_t cell = cell_of(p.z, bounds_.lo.z) * columns_ + cell_of(p.x, bounds_.lo.x);
  for (std::uint32_t i = start_[cell]; i < start_[cell + 1]; ++i) {
    if (holds(solids_[i], p)) return true;
  }
  return false;
}

/// Prisms come first, then convex solids, then boxes.
bool SolidIndex::holds(std::size_t solid, const Vec3& p) const {
  const std::size_t prisms = occluders_->solids.size();
  const std::size_t convex = occluders_->convex_solids.size();
  if (solid < prisms) {
    const Prism& s = occluders_->solids[solid];
    return p.y > s.bottom && p.y < s.top && contains(s.footprint, ground(p));
  }
  if (solid < prisms + convex) {
    const ConvexSolid& s = occluders_->convex_solids[solid - prisms];
    return s.bounds.contains(p) && contains(s, p);
  }
  return occluders_->closed_boxes[solid - prisms - convex].contains(p);
}

}  // namespace ivis
