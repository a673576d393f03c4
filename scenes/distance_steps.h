#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace ivis {

/// Steps over the eight neighbours from each cell of an nx x nz raster to the nearest one for which
/// closed(index) holds, or to the border; at most 255. Cost: two passes.
template <class Closed>
std::vector<std::uint8_t> distance_steps(std::size_t nx, std::size_t nz, const Closed& closed) {
  std::vector<std::uint8_t> steps(nx * nz, 255);
  const auto relax = [&](std::size_t i, std::size_t k, bool forward) {
    const std::size_t cell = k * nx + i;
    if (i == 0 || k == 0 || i + 1 == nx || k + 1 == nz || closed(cell)) {
      steps[cell] = 0;
      return;
    }
    const std::size_t row = forward ? cell - nx : cell + nx;
    const std::size_t side = forward ? cell - 1 : cell + 1;
    const int near = std::min({steps[row - 1], steps[row], steps[row + 1], steps[side]});
    steps[cell] = static_cast<std::uint8_t>(std::min<int>(steps[cell], std::min(near + 1, 255)));
  };
  for (std::size_t k = 0; k < nz; ++k)
    for (std::size_t i = 0; i < nx; ++i)
      relax(i, k, true);
  for (std::size_t k = nz; k-- > 0;)
    for (std::size_t i = nx; i-- > 0;)
      relax(i, k, false);
  return steps;
}

}  // namespace ivis
