#pragma once

#include <cstdint>
#include <vector>

#include "occluders/occluder_set.h"

namespace ivis {

/// Finds whether an unshrunk solid or a closed box holds a point. A uniform grid over the ground
/// plane. Threads: read-only after construction. Ownership: borrows the occluders. Cost: O(solids)
/// to build; a query looks at the solids over one grid cell.
class SolidIndex {
 public:
  explicit SolidIndex(const OccluderSet& occluders);
  bool holds(const Vec3& p) const;

 private:
  bool holds(std::size_t solid, const Vec3& p) const;
  std::size_t cell_of(double v, double lo) const;

  const OccluderSet* occluders_;
  Aabb bounds_;
  double cell_m_ = 1;
  std::size_t columns_ = 0;
  std::size_t rows_ = 0;
  std::vector<std::uint32_t> start_;  ///< of each grid cell in solids_
  std::vector<std::uint32_t> solids_;
};

}  // namespace ivis
