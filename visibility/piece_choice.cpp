#include "visibility/piece_choice.h"

#include <algorithm>
#include <cmath>

namespace ivis {
namespace {

constexpr std::uint32_t kHorizontalSides = 0x33;  ///< that look along x and z

}  // namespace

float near_for(const Reach& reach) {
  const Vec3& e = reach.half_extents();
  return static_cast<float>(std::clamp(4 * std::max({e.x, e.y, e.z}), 0.25, 4.0));
}

std::uint32_t pixels_for(std::uint32_t wanted, const Reach& reach) {
  if (wanted != 0) return wanted;
  const Vec3& e = reach.half_extents();
  return std::max({e.x, e.y, e.z}) < 0.5 ? 1024 : 512;
}

MapCell make_map_cell(const ViewCell& cell, const MapFrame& frame, const OccluderSet& occluders) {
  MapCell c;
  c.local = cell.eye - frame.origin;
  c.eye = frame.direction(c.local);
  for (int i = 0; i < 3; ++i)
    c.single[i] = static_cast<float>(c.eye[i]);
  c.reach = padded(cell.reach, occluders.slack_m);
  const Vec3 half = c.reach.half_extents();
  c.radius = largest_move(cell.reach, occluders.slack_m);
  const Aabb box{cell.eye - half, cell.eye + half};
  c.above_floor = box.lo.y >= occluders.floor;
  const Aabb& ground = occluders.ground;
  c.on_ground = !ground.empty() && box.lo.x >= ground.lo.x && box.hi.x <= ground.hi.x &&
                box.lo.z >= ground.lo.z && box.hi.z <= ground.hi.z;
  return c;
}

PieceChoice choose_level(const OccluderPieces& pieces, const OccluderPieces::Piece& piece,
                         const MapCell& cell, const SampleMargin& margin, std::uint32_t sides,
                         const OcclusionGuards& guards) {
  double far[3];
  double across = 0;  // squared distance of the farthest corner
  for (int i = 0; i < 3; ++i) {
    far[i] = std::max(std::abs(static_cast<double>(piece.lo[i]) - cell.eye[i]),
                      std::abs(static_cast<double>(piece.hi[i]) - cell.eye[i]));
    across += far[i] * far[i];
  }
  std::uint32_t level = 0;
  if (piece.kind == OccluderPieces::Kind::kSheet) {
    // The rule and why it holds: occluders/sheets.h.
    const double a = glm::dot(piece.normal, cell.eye) - piece.offset;
    const double e = margin.at(std::max({far[0], far[1], far[2]}));
    if (a <= 1.001 * cell.radius || a <= 1.001 * e) return {};
    double r = (cell.radius + e) * std::sqrt(across) / (a - e) * (1 + 1e-6);
    if (!guards.sheet_obliqueness) r = cell.radius + e;
    while (level < piece.levels && !(pieces.sheet_radii_m[level] >= r))
      ++level;
  } else {
    // A prism drawn far down may be deep on the faces that look down, where it hides little.
    const bool drawn_down = piece.kind != OccluderPieces::Kind::kSolid;
    const double m = margin.at(
        std::max({far[0], far[2], drawn_down || (sides & ~kHorizontalSides) == 0 ? 0.0 : far[1]}));
    if (guards.pixel_margin)
      while (level < piece.levels && !(pieces.margins_m[level] >= m))
        ++level;
    if (level < piece.levels && guards.pixel_margin && pieces.margins_m[level] < margin.at(far[1]))
      sides &= kHorizontalSides;
  }
  if (level >= piece.levels || sides == 0) return {};
  std::uint32_t first = piece.first_level;
  if ((piece.kind == OccluderPieces::Kind::kFloored && !cell.above_floor) ||
      (piece.kind == OccluderPieces::Kind::kGrounded && !cell.on_ground))
    first = piece.first_real_level;
  for (std::uint32_t f = piece.first_floor; f < piece.first_floor + piece.floors; ++f) {
    const ConvexSolid::Plane& floor = pieces.floors[f];
    if (!(glm::dot(floor.normal, cell.local) + cell.reach.support(floor.normal) <= floor.offset))
      first = piece.first_real_level;
  }
  if (pieces.levels[first + level].batches == 0) return {};
  return {first + level, sides};
}

std::vector<std::uint32_t> largest_pieces(const OccluderPieces& pieces, const Vec3& eye,
                                          std::size_t most, std::span<const std::uint32_t> among) {
  struct Candidate {
    double area;
    double distance;
    std::uint32_t piece;
  };
  std::vector<Candidate> all;
  for (const std::uint32_t p : among) {
    if (p >= pieces.pieces.size()) continue;  // another method's
    const OccluderPieces::Piece& piece = pieces.pieces[p];
    const Vec3 size = Vec3(piece.hi) - Vec3(piece.lo);
    Vec3 gap{0};
    for (int i = 0; i < 3; ++i)
      gap[i] = std::max({static_cast<double>(piece.lo[i]) - eye[i],
                         eye[i] - static_cast<double>(piece.hi[i]), 0.0});
    const double distance = std::max(glm::length(gap), 0.1);
    all.push_back({glm::dot(size, size) / (distance * distance), distance, p});
  }
  const auto larger = [](const Candidate& a, const Candidate& b) {
    return a.area != b.area ? a.area > b.area : a.piece < b.piece;
  };
  const auto nearer = [](const Candidate& a, const Candidate& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.piece < b.piece;
  };
  const auto end = all.begin() + static_cast<std::ptrdiff_t>(std::min(most, all.size()));
  std::nth_element(all.begin(), end, all.end(), larger);
  std::sort(all.begin(), end, nearer);
  std::vector<std::uint32_t> chosen;
  for (auto it = all.begin(); it != end; ++it)
    chosen.push_back(it->piece);
  return chosen;
}

}  // namespace ivis
