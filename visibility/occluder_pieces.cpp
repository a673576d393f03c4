#include "visibility/occluder_pieces.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "occluders/convex_parts.h"

namespace ivis {
namespace {

/// How far below all that is listed a prism without underside is drawn, metres.
constexpr double kBelowFloorM = 1;

class Maker {
 public:
  Maker(const OccluderSet& occluders, OccluderPieces& out) : occluders_(occluders), out_(out) {}

  void add_prisms(const PrismPiece& piece, double deep) {
    OccluderPieces::Piece p;
    bool floored = true;
    bool grounded = true;
    bool any = false;
    for (const auto& level : piece.levels)
      for (const Prism& prism : level) {
        floored = floored && prism.solid_bottom <= occluders_.floor;
        grounded = grounded && prism.grounded;
        any = true;
      }
    if (!any) return;
    begin(p);
    p.first_real_level = p.first_level;
    for (const auto& level : piece.levels)
      add_level(level, false, deep);
    if (floored || grounded) {
      p.kind = floored ? OccluderPieces::Kind::kFloored : OccluderPieces::Kind::kGrounded;
      p.first_level = static_cast<std::uint32_t>(out_.levels.size());
      for (const auto& level : piece.levels)
        add_level(level, true, deep);
    }
    p.levels = static_cast<std::uint32_t>(piece.levels.size());
    end(p);
  }

  void add_solid(const SolidPiece& piece) {
    OccluderPieces::Piece p;
    begin(p);
    const std::size_t count = std::max(piece.levels.size(), piece.floored_levels.size());
    p.first_floor = static_cast<std::uint32_t>(out_.floors.size());
    p.floors = static_cast<std::uint32_t>(piece.floors.size());
    for (ConvexSolid::Plane plane : piece.floors) {
      plane.offset -= glm::dot(plane.normal, out_.frame.origin);
      out_.floors.push_back(plane);
    }
    const auto add = [&](const std::vector<FaceMesh>& levels) {
      const auto first = static_cast<std::uint32_t>(out_.levels.size());
      for (std::size_t k = 0; k < count; ++k) {
        open_level();
        if (k < levels.size()) add_mesh(levels[k]);
      }
      return first;
    };
    p.first_real_level = add(piece.levels);
    p.first_level = piece.floors.empty() ? p.first_real_level : add(piece.floored_levels);
    p.levels = static_cast<std::uint32_t>(count);
    end(p);
  }

  void add_sheet(const Sheet& sheet) {
    OccluderPieces::Piece p;
    begin(p);
    p.kind = OccluderPieces::Kind::kSheet;
    p.normal = out_.frame.direction(sheet.normal);
    p.offset = sheet.offset - glm::dot(sheet.normal, out_.frame.origin);
    for (const FaceMesh& mesh : sheet.levels) {
      open_level();
      add_mesh(mesh, &p.normal);
    }
    p.levels = static_cast<std::uint32_t>(sheet.levels.size());
    p.first_real_level = p.first_level;
    end(p);
  }

  void finish() {
    std::vector<std::uint32_t> items(boxes_.size());
    for (std::uint32_t i = 0; i < items.size(); ++i)
      items[i] = i;
    out_.tree = BoxTree::build(boxes_, items, Vec3{0});
  }

 private:
  void begin(OccluderPieces::Piece& p) {
    p.first_level = static_cast<std::uint32_t>(out_.levels.size());
    box_ = {};
    drawn_ = {};
  }
  void end(OccluderPieces::Piece p) {
    if (drawn_.empty()) return;
    for (int i = 0; i < 3; ++i) {
      p.lo[i] = static_cast<float>(drawn_.lo[i]);
      p.hi[i] = static_cast<float>(drawn_.hi[i]);
    }
    // What stands below a prism's real bottom is not worth drawing it for.
    boxes_.push_back(box_.empty() ? drawn_ : box_);
    out_.pieces.push_back(p);
  }
  void open_level() {
    out_.levels.push_back({static_cast<std::uint32_t>(out_.batches.size()), 0});
    lane_ = FaceBatch::kWidth;
  }

  void add_level(const std::vector<Prism>& prisms, bool down, double deep) {
    open_level();
    for (Prism prism : prisms) {
      if (down) {
        for (const Vec3& c : mesh_of(prism).points)
          box_.add(out_.frame.to_map(c));
        prism.bottom = std::min(prism.bottom, deep);
      }
      add_mesh(mesh_of(prism));
    }
  }

  void add_mesh(const FaceMesh& mesh, const Vec3* normal = nullptr) {
    for (const auto& face : mesh.faces) {
      Vec3 p[4];
      for (std::size_t k = 0; k < 4; ++k)
        p[k] = out_.frame.to_map(mesh.points[face[k]]);
      // Of two diagonals: right for a triangle too.
      Vec3 n = glm::cross(p[2] - p[0], p[3] - p[1]);
      const double length = glm::length(n);
      if (!(length > 1e-12)) continue;
      n = normal != nullptr ? *normal : n / length;
      if (lane_ == FaceBatch::kWidth) open_batch();
      FaceBatch& b = out_.batches.back();
      for (std::size_t k = 0; k < 4; ++k) {
        b.x[k][lane_] = static_cast<float>(p[k].x);
        b.y[k][lane_] = static_cast<float>(p[k].y);
        b.z[k][lane_] = static_cast<float>(p[k].z);
        drawn_.add(p[k]);
      }
      b.nx[lane_] = static_cast<float>(n.x);
      b.ny[lane_] = static_cast<float>(n.y);
      b.nz[lane_] = static_cast<float>(n.z);
      ++lane_;
    }
  }
  void open_batch() {
    out_.batches.push_back({});
    ++out_.levels.back().batches;
    lane_ = 0;
  }

  const OccluderSet& occluders_;
  OccluderPieces& out_;
  std::vector<Aabb> boxes_;
  Aabb box_;    ///< of what stands
  Aabb drawn_;  ///< of all corners
  std::uint32_t lane_ = FaceBatch::kWidth;
};

}  // namespace

OccluderPieces make_pieces(const Scene& scene, const OccluderSet& occluders,
                           const MapFrame& frame) {
  OccluderPieces out;
  out.frame = frame;
  out.margins_m = occluders.margins_m;
  out.sheet_radii_m = occluders.sheet_radii_m;
  Maker maker(occluders, out);
  const double deep =
      std::min(occluders.floor, scene.bounds.empty() ? 0 : scene.bounds.lo.y) - kBelowFloorM;
  for (const PrismPiece& piece : occluders.prism_pieces)
    maker.add_prisms(piece, deep);
  for (const SolidPiece& piece : occluders.solid_pieces)
    maker.add_solid(piece);
  for (const Sheet& sheet : occluders.sheets)
    maker.add_sheet(sheet);
  maker.finish();
  return out;
}

}  // namespace ivis
