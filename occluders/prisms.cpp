#include "occluders/prisms.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "occluders/closed_mesh.h"

namespace ivis {
namespace {

constexpr double kSameHeightM = 1e-6;  ///< heights nearer than this make no level of their own
constexpr double kThinM = 0.01;        ///< a lower prism is not worth its walls
constexpr double kMinAreaM2 = 0.01;
constexpr std::size_t kMaxCandidates = 10;

/// The part of a triangle with lo < y < hi, as a convex polygon in (x, z); at most five corners.
std::vector<Vec2> shadow_between(const std::array<Vec3, 3>& t, double lo, double hi) {
  std::vector<Vec3> in(t.begin(), t.end());
  const auto cut = [&](double y, bool keep_above) {
    std::vector<Vec3> out;
    for (std::size_t i = 0; i < in.size(); ++i) {
      const Vec3& a = in[i];
      const Vec3& b = in[(i + 1) % in.size()];
      const double da = keep_above ? a.y - y : y - a.y;
      const double db = keep_above ? b.y - y : y - b.y;
      if (da >= 0) out.push_back(a);
      if ((da > 0 && db < 0) || (da < 0 && db > 0)) out.push_back(a + (b - a) * (da / (da - db)));
    }
    in = std::move(out);
  };
  cut(lo, true);
  cut(hi, false);
  std::vector<Vec2> shadow;
  for (const Vec3& p : in)
    shadow.push_back(ground(p));
  return shadow;
}

class PieceBuilder {
 public:
  PieceBuilder(const WeldedMesh& mesh, const MeshPiece& piece, Fill fill)
      : mesh_(mesh), piece_(piece), fill_(fill) {
    for (const auto& t : piece.triangles)
      for (const std::uint32_t i : t)
        heights_.push_back(mesh.points[i].y);
    std::sort(heights_.begin(), heights_.end());
    heights_.erase(std::unique(heights_.begin(), heights_.end()), heights_.end());
    for (const auto& t : piece.triangles) {
      const std::array<Vec3, 3> c{mesh.points[t[0]], mesh.points[t[1]], mesh.points[t[2]]};
      const auto [lo, hi] = std::minmax({c[0].y, c[1].y, c[2].y});
      // Upright: its corners stand on one line of the grid, so it casts no shadow.
      if (hi - lo > 0 &&
          convex_hull({snap(ground(c[0])), snap(ground(c[1])), snap(ground(c[2]))}).empty())
        continue;
      sloped_.push_back({c, lo, hi});
    }
  }

  std::vector<Prism> build() {
    if (heights_.size() < 2) return {};
    std::vector<Prism> best;
    double best_volume = 0;
    // A base that is not level: what lies under its highest corner is given up.
    for (const double base : bases()) {
      auto prisms = levels_above(base);
      double v = 0;
      double below = base;
      for (const Prism& p : prisms) {
        v += area(p.footprint) * (p.top - below);
        below = p.top;
      }
      if (v > 1.02 * best_volume) {
        best_volume = v;
        best = std::move(prisms);
      }
    }
    return best;
  }

 private:
  struct Sloped {
    std::array<Vec3, 3> corners;
    double lo, hi;
  };

  std::vector<double> bases() const {
    std::vector<double> result{heights_.front()};
    // The lowest corners' own triangles, if they are not level, reach up to the next candidate.
    double reach = heights_.front();
    for (const Sloped& s : sloped_)
      if (s.lo - heights_.front() < kSameHeightM) reach = std::max(reach, s.hi);
    if (reach > heights_.front() && reach < heights_.back()) result.push_back(reach);
    return result;
  }

  /// {x : the upright line over x is inside the piece from base to top}: what a section just below
  /// the top fills, less the shadows of all that is not upright between base and top. No triangle
  /// is crossed on such a line, so the section's parity holds along all of it.
  std::vector<Polygon> footprint(double base, double top) const {
    const auto above = std::lower_bound(heights_.begin(), heights_.end(), top);
    const double below = std::max(base, *(above - 1));
    const double y = below + (top - below) / 2;
    if (!(below < y && y < top)) return {};
    const std::vector<Ring> loops = section(mesh_, piece_, y);
    if (loops.empty()) return {};
    std::vector<Ring> shadows;
    for (const Sloped& s : sloped_) {
      // Touching the slab from outside, or lying in its end planes, is no crossing.
      if (s.hi <= base || s.lo >= top) continue;
      std::vector<Vec2> outline;
      for (const Vec2& p : shadow_between(s.corners, base, top))
        for (const double dx : {-kGridSlackM, kGridSlackM})
          for (const double dz : {-kGridSlackM, kGridSlackM})
            outline.push_back(p + Vec2{dx, dz});
      if (Ring hull = convex_hull(std::move(outline)); !hull.empty())
        shadows.push_back(std::move(hull));
    }
    std::vector<Polygon> pieces = subtract(loops, fill_, shadows);
    std::erase_if(pieces, [](const Polygon& p) { return area(p) < kMinAreaM2; });
    return pieces;
  }

  /// Heights worth trying as tops: corners' heights, thinned; wide gaps in which roofs slope,
  /// divided.
  std::vector<double> candidates(double base) const {
    std::vector<double> tops;
    for (const double y : heights_)
      if (y > base + kSameHeightM && (tops.empty() || y - tops.back() > kSameHeightM))
        tops.push_back(y);
    if (tops.empty()) return tops;
    const auto sloped_in = [&](double lo, double hi) {
      return std::any_of(sloped_.begin(), sloped_.end(), [&](const Sloped& s) {
        return s.lo < hi - kSameHeightM && s.hi > lo + kSameHeightM;
      });
    };
    while (tops.size() > kMaxCandidates) {
      std::size_t drop = 0;
      double gap = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < tops.size(); ++i) {
        const double g = tops[i] - (i > 0 ? tops[i - 1] : base);
        if (g < gap) {
          gap = g;
          drop = i;
        }
      }
      tops.erase(tops.begin() + static_cast<std::ptrdiff_t>(drop));
    }
    for (std::size_t i = 1; i < tops.size() && tops.size() < kMaxCandidates; ++i)
      if (tops[i] - tops[i - 1] > 0.5 && sloped_in(tops[i - 1], tops[i])) {
        const double lo = tops[i - 1];
        const double gap = tops[i] - lo;
        tops.insert(tops.begin() + static_cast<std::ptrdiff_t>(i),
                    {lo + gap / 3, lo + gap * 2 / 3});
        i += 2;
      }
    return tops;
  }

  /// The at most kMaxLevelsPerPiece tops that keep the most volume.
  std::vector<Prism> levels_above(double base) const {
    struct Level {
      double top, area;
      std::vector<Polygon> pieces;
    };
    std::vector<Level> levels;
    for (const double top : candidates(base)) {
      std::vector<Polygon> pieces = footprint(base, top);
      if (pieces.empty()) break;  // footprints shrink with the top
      const double a = area(pieces);
      levels.push_back({top, a, std::move(pieces)});
    }
    // Best volume of k levels with the highest at i; footprints are nested, so it is a staircase.
    const std::size_t n = levels.size();
    if (n == 0) return {};
    std::vector<std::array<double, kMaxLevelsPerPiece>> best(n);
    std::vector<std::array<std::size_t, kMaxLevelsPerPiece>> previous(n);
    std::size_t best_i = 0;
    std::size_t best_k = 0;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < kMaxLevelsPerPiece; ++k) {
        best[i][k] = k == 0 ? levels[i].area * (levels[i].top - base) : 0;
        if (k > 0)
          for (std::size_t j = 0; j < i; ++j) {
            const double v = best[j][k - 1] + levels[i].area * (levels[i].top - levels[j].top);
            if (v > best[i][k]) {
              best[i][k] = v;
              previous[i][k] = j;
            }
          }
        // One level more has to pay for its walls.
        if (best[i][k] > best[best_i][best_k] * (k > best_k ? 1.01 : 1.0)) {
          best_i = i;
          best_k = k;
        }
      }
    std::vector<Prism> prisms;
    for (std::size_t i = best_i, k = best_k;; i = previous[i][k--]) {
      for (Polygon& p : levels[i].pieces)
        if (levels[i].top - base >= kThinM)
          prisms.push_back({std::move(p), base, levels[i].top, base, false});
      if (k == 0) break;
    }
    std::reverse(prisms.begin(), prisms.end());
    return prisms;
  }

  const WeldedMesh& mesh_;
  const MeshPiece& piece_;
  const Fill fill_;
  std::vector<double> heights_;
  std::vector<Sloped> sloped_;  ///< all that is not upright, level faces included
};

}  // namespace

ObjectSolids extract_prisms(const Scene& scene, const Object& object) {
  ObjectSolids out;
  const auto leave_out = [&](const char* reason) { ++out.left_out[reason]; };
  if (object.tag == OccluderTag::kNever) {
    leave_out("marked never");
    return out;
  }
  if (object.always_visible) {
    leave_out("moves");
    return out;
  }
  if (scene.mesh_of(object).triangles() == 0) {
    leave_out("no triangles");
    return out;
  }
  const Vec3 far = glm::max(glm::abs(object.bounds.lo), glm::abs(object.bounds.hi));
  if (std::max({far.x, far.y, far.z}) > kMaxCoordinateM) {
    leave_out("too far from the origin");
    return out;
  }
  const WeldedMesh mesh = weld(scene, object);
  if (mesh.pieces.empty()) leave_out("not opaque");
  const auto& primitives = scene.mesh_of(object).primitives;
  const bool one_sided =
      scene.honour_sidedness && std::any_of(primitives.begin(), primitives.end(),
                                            [](const Primitive& p) { return !p.double_sided; });
  for (const MeshPiece& piece : mesh.pieces) {
    if (!piece.closed) {
      leave_out("open mesh");
      continue;
    }
    const double v = volume(mesh, piece);
    if (one_sided && !piece.oriented) {
      leave_out("winding not consistent");
      continue;
    }
    if (!(v > 0)) {
      leave_out(v < 0 ? "inside out" : "no volume");
      continue;
    }
    out.volume += v;
    // Where backs of triangles do not block, only winding number > 0 is entered through a front.
    auto prisms = PieceBuilder(mesh, piece, one_sided ? Fill::kPositive : Fill::kEvenOdd).build();
    if (prisms.empty()) leave_out("too thin or too sloped for a prism");
    for (Prism& p : prisms)
      out.prisms.push_back(std::move(p));
  }
  return out;
}

double volume_taken(const ObjectSolids& found) {
  double volume = 0;
  double below = 0;
  for (std::size_t i = 0; i < found.prisms.size(); ++i) {
    const Prism& p = found.prisms[i];
    // Nested prisms of one piece stand on one base.
    const bool nested = i > 0 && p.bottom == found.prisms[i - 1].bottom && p.top > below;
    volume += area(p.footprint) * (p.top - (nested ? below : p.bottom));
    below = p.top;
  }
  return volume;
}

}  // namespace ivis
