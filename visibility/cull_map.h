#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "visibility/box_tree.h"
#include "visibility/horizon.h"
#include "visibility/method.h"
#include "visibility/orthographic_map.h"
#include "visibility/polar_map.h"
#include "visibility/solid_index.h"

namespace ivis {

/// The cull map: shrunk prisms and terrain throw shadows over a 2.5D scene; what lies in them is
/// hidden. The orthographic map draws no terrain: it lists what only terrain hides. Guarantee:
/// conservative: an object seen from anywhere in the cell is never left out. Errors:
/// kInvalidArgument if the cell's reach is larger than the occluders were shrunk for. Threads:
/// solve() is const and reentrant; the result does not depend on options.threads. Cost:      polar:
/// O(visible hierarchy nodes + azimuth bins of the occluders met); bench/cull_map_bench.cpp.
/// Source:    Wonka, Wimmer, Sillion, Instant Visibility, 2001, section 5.1.
/// Departs:   polar map by default; real undersides of prisms; several layers an azimuth.
class CullMap : public Method {
 public:
  /// What a solve did, for reports and tests.
  struct Stats {
    PolarStats polar;
    std::uint32_t undersides = 0;
  };

  static constexpr std::uint32_t kBinsAFace = 1024;

  CullMap(const Scene& scene, const OccluderSet& occluders, const MethodOptions& options,
          const PolarGuards& guards = {}, std::uint32_t bins_a_face = kBinsAFace);
  ~CullMap() override;
  const MethodTraits& traits() const override;
  Backend backend() const override;
  /// Null for the polar map.
  const OrthographicMap* orthographic() const { return orthographic_.get(); }
  /// From now on the orthographic map's shadows are drawn there, until that fails: then the solve
  /// fails if options.backend is kGl, else they are drawn here for good. Not while it solves.
  void draw_shadows_on(std::unique_ptr<ShadowDrawer> shadows) { shadows_ = std::move(shadows); }
  /// An eye inside an occluder gets everything, and the Pvs says so. An eye under the ground,
  /// within OccluderSet::ground, gets a set that promises nothing, and nothing says so: of the
  /// ground only the rectangle is known here, not the heights, and such viewpoints do not count
  /// (docs/theory.md, 1).
  Result<Pvs> solve(const ViewCell& cell) const override;
  Result<Pvs> solve(const ViewCell& cell, LastShown& last) const override;
  /// The polar map keeps to it. Of several threads one tests when testing is bounded.
  Result<Pvs> solve(const ViewCell& cell, const Effort& effort, Work& done) const override;
  bool keeps_to_effort() const override { return !orthographic_; }
  /// On the polar map. Objects that are put beyond the scene's extent, or below its floor, are
  /// listed.
  Result<Pvs> solve(const ViewCell& cell, const Effort& effort, const Amendment& amendment,
                    Work& done) const override;
  bool takes_amendments() const override { return !orthographic_; }
  Result<Pvs> solve(const ViewCell& cell, Stats& stats) const;
  /// No solve draws or tests more, but those by LastShown: all walls, each over all bins; all
  /// nodes.
  Work most_work() const;

  static MethodTraits make_traits();

 private:
  struct Scratch;
  struct Eye;

  /// Solids to draw, in this order; nothing given: all that show.
  using Chosen = std::optional<std::vector<std::uint32_t>>;

  Result<Pvs> solve(const ViewCell& cell, LastShown* last, const Effort& effort,
                    const Amendment* amendment, Stats& stats) const;
  bool within_extent(const Aabb& box) const;
  void find_placed(const Eye& eye, const Amendment& amendment, Scratch& scratch,
                   Stats& stats) const;
  std::shared_ptr<const WallSet> added_walls(const Amendment* amendment) const;
  Chosen largest_solids(const Eye& eye, const std::vector<std::uint32_t>* among) const;
  void mark_promising(const Eye& eye, const Effort& effort, Scratch& scratch, Stats& stats) const;
  Status draw_selected(const Eye& eye, LastShown* last, const Effort& effort,
                       const Amendment* amendment, Scratch& scratch, Stats& stats) const;
  Status draw(const Eye& eye, const Chosen& chosen, const Effort& effort, Scratch& scratch,
              Stats& stats) const;
  void draw_polar(const Eye& eye, const Chosen& chosen, const Effort& effort, Scratch& scratch,
                  Stats& stats) const;
  Status draw_orthographic(const Eye& eye, const Chosen& chosen, Scratch& scratch) const;
  Status draw_elsewhere(const Eye& eye, const Chosen& chosen, Scratch& scratch) const;
  void draw_here(const Eye& eye, const Chosen& chosen, Scratch& scratch) const;
  void add_chains(std::uint32_t solid, const Eye& eye, std::vector<ShadowChain>& chains) const;
  bool hidden_orthographic(const BoxTree::Node& node, std::uint32_t c, const Eye& eye,
                           const Scratch& scratch, bool finished) const;
  void find(const BoxTree& tree, const Eye& eye, std::uint64_t most, Scratch& scratch,
            std::vector<std::uint32_t>& found, Stats& stats) const;
  void find_objects(const Eye& eye, const Effort& effort, Scratch& scratch, Stats& stats) const;
  std::unique_ptr<Scratch> take_scratch() const;
  void give_back(std::unique_ptr<Scratch> scratch) const;

  const Scene& scene_;
  const OccluderSet& occluders_;
  MethodOptions options_;
  PolarGuards guards_;
  std::uint32_t bins_a_face_;
  Vec3 origin_;
  BoxTree objects_;
  std::vector<std::uint32_t> solid_of_;  ///< of walls_, by index into OccluderSet::shrunk
  WallSet walls_;
  std::vector<std::uint32_t> corners_;  ///< of each solid of walls_
  bool all_floored_ = true;
  bool all_grounded_ = true;
  bool all_held_down_ = true;  ///< floored or grounded
  std::vector<ObjectId> always_visible_;
  SolidIndex solids_;
  std::unique_ptr<OrthographicMap> orthographic_;
  std::unique_ptr<ShadowDrawer> shadows_;
  mutable std::atomic<bool> shadows_failed_{false};
  std::unique_ptr<TerrainMap> terrain_;
  double extent_m_ = 0;  ///< of the scene, to each side of origin_
  /// The walls of a change's added prisms, the last that was asked for.
  mutable std::mutex added_mutex_;
  mutable std::weak_ptr<const OccluderChange> added_of_;
  mutable std::shared_ptr<const WallSet> added_;
  mutable std::mutex scratch_mutex_;
  mutable std::vector<std::unique_ptr<Scratch>> scratch_;
};

}  // namespace ivis
