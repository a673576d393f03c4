#include <algorithm>
#include <cmath>
#include <limits>

#include "scenes/random.h"
#include "scenes/read_dem.h"

namespace ivis {
namespace {

/// Value noise: random numbers at the crossings of a lattice, blended by a cubic; in [0, 1].
class Noise {
 public:
  Noise(std::size_t lattice, std::uint64_t seed, std::uint64_t stream) : n_(lattice + 2) {
    Random random(seed, stream);
    values_.resize(n_ * n_);
    for (double& v : values_)
      v = random.unit();
  }
  /// p in lattice cells, within [0, lattice].
  double at(const Vec2& p) const {
    const Vec2 c = glm::floor(p);
    Vec2 f = p - c;
    f = f * f * (Vec2(3) - 2.0 * f);
    const std::size_t k = static_cast<std::size_t>(c.y) * n_ + static_cast<std::size_t>(c.x);
    const double low = values_[k] + (values_[k + 1] - values_[k]) * f.x;
    const double high = values_[k + n_] + (values_[k + n_ + 1] - values_[k + n_]) * f.x;
    return low + (high - low) * f.y;
  }

 private:
  std::size_t n_;
  std::vector<double> values_;
};

}  // namespace

Dem made_up_dem(std::size_t cells, double step_m, std::uint64_t seed, bool ragged) {
  Dem dem;
  dem.columns = dem.rows = cells + 1;
  dem.step_m = Vec2(step_m);
  dem.heights.assign(dem.columns * dem.rows, 0.0F);
  const double height = static_cast<double>(cells) * step_m / 4;
  double share = 0.5;
  for (std::size_t lattice = 4; lattice <= 64 && lattice <= cells; lattice *= 2, share /= 2) {
    const Noise noise(lattice, seed, lattice);
    for (std::size_t r = 0; r < dem.rows; ++r)
      for (std::size_t c = 0; c < dem.columns; ++c) {
        const Vec2 p = Vec2(static_cast<double>(c), static_cast<double>(r)) *
                       (static_cast<double>(lattice) / static_cast<double>(cells));
        dem.heights[r * dem.columns + c] += static_cast<float>(share * height * noise.at(p));
      }
  }
  if (!ragged) return dem;
  Random random(seed, 1);
  struct Hole {
    Vec2 at;
    double radius;
  };
  std::vector<Hole> holes;
  for (int i = 0; i < 6; ++i)
    holes.push_back({{random.unit(), random.unit()}, random.in(0.01, 0.04)});
  for (std::size_t r = 0; r < dem.rows; ++r)
    for (std::size_t c = 0; c < dem.columns; ++c) {
      const Vec2 p =
          Vec2(static_cast<double>(c), static_cast<double>(r)) / static_cast<double>(cells);
      const Vec2 q = p - 0.5;
      const bool outside = std::abs(q.x + 0.25 * q.y) > 0.44 || std::abs(q.y - 0.25 * q.x) > 0.44;
      const bool hole = std::any_of(holes.begin(), holes.end(), [&](const Hole& h) {
        return glm::length(p - h.at) < h.radius;
      });
      if (outside || hole)
        dem.heights[r * dem.columns + c] = std::numeric_limits<float>::quiet_NaN();
    }
  return dem;
}

}  // namespace ivis
