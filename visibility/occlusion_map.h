#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "visibility/box_tree.h"
#include "visibility/depth_cube.h"
#include "visibility/map_frame.h"
#include "visibility/method.h"
#include "visibility/piece_choice.h"
#include "visibility/solid_index.h"
#include "visibility/sub_boxes.h"

namespace ivis {

/// The perspective occlusion map: shrunk occluders of every kind drawn into six maps of depth about
/// the eye; what lies behind in all of them is hidden. Any scene, any direction of view. Guarantee:
/// conservative: an object seen from anywhere in the cell is never left out. Errors:
/// kInvalidArgument if the cell's reach is larger than the occluders were shrunk for. Threads:
/// solve() is const and reentrant; the result does not depend on options.threads. Cost: O(visible
/// hierarchy nodes + pixels of the occluders that show); bench/occlusion_map_bench.cpp. Source:
/// Wonka, Wimmer, Sillion, Instant Visibility, 2001, section 5.2; pixel margin and sheets:
/// docs/theory.md, 3, 9. Departs:   a cube instead of a widened frustum, so turning is free; turned
/// to the scene's own axes (map_frame.h); each piece at the first margin of a ladder that
///            covers a pixel at its far side; sheets, which the paper's volumetric shrinking has no
///            place for.
class OcclusionMap : public Method {
 public:
  using Stats = DepthStats;

  OcclusionMap(const Scene& scene, const OccluderSet& occluders, const MethodOptions& options,
               const OcclusionGuards& guards = {});
  ~OcclusionMap() override;
  const MethodTraits& traits() const override;
  Result<Pvs> solve(const ViewCell& cell) const override;
  Result<Pvs> solve(const ViewCell& cell, LastShown& last) const override;
  Result<Pvs> solve(const ViewCell& cell, Stats& stats) const;

  static MethodTraits make_traits();

 private:
  struct Scratch;
  struct Cell;

  Result<Pvs> solve(const ViewCell& cell, LastShown* last, Stats& stats) const;
  void draw_all(const Cell& cell, Scratch& scratch, Stats& stats) const;
  void draw_these(std::span<const std::uint32_t> pieces, const Cell& cell, Scratch& scratch,
                  Stats& stats) const;
  void draw_selected(const Cell& cell, LastShown* last, Scratch& scratch, Stats& stats) const;
  void draw_piece(const OccluderPieces::Piece& piece, std::uint32_t sides, const Cell& cell,
                  Scratch& scratch, Stats& stats) const;
  void keep_seen(const Cell& cell, const Scratch& scratch, std::vector<std::uint32_t>& found,
                 Stats& stats) const;
  void find(const Cell& cell, Scratch& scratch, Stats& stats) const;
  std::unique_ptr<Scratch> take_scratch() const;
  void give_back(std::unique_ptr<Scratch> scratch) const;

  const Scene& scene_;
  const OccluderSet& occluders_;
  MethodOptions options_;
  OcclusionGuards guards_;
  MapFrame frame_;
  Aabb bounds_;  ///< of the scene, in map coordinates
  std::uint32_t pixels_;
  float near_m_;
  BoxTree objects_;
  std::vector<ObjectId> always_visible_;
  SubBoxes sub_boxes_;
  OccluderPieces pieces_;
  SolidIndex solids_;
  mutable std::mutex scratch_mutex_;
  mutable std::vector<std::unique_ptr<Scratch>> scratch_;
};

}  // namespace ivis
