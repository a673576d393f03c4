#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "core/view_cell.h"
#include "occluders/occluder_set.h"
#include "visibility/exact_segment.h"

namespace ivis {

/// Decides which viewpoints count (docs/theory.md, section 1): none inside a solid or under the
/// ground. Solids are the occluder set's, and every closed piece of opaque triangles of a node that
/// is not marked `never` (one may stand in a tree's crown). Ground is an open mesh, or several
/// without steep triangles that share corners to the last bit (tiles), that spans half of the scene
/// or more both ways and has most of the scene above it. Guarantee: in doubt a viewpoint does not
/// count: a miss seen from one that does is real. Threads:   const and reentrant. Ownership:
/// borrows all three; `occluders` may be null.
class FreeSpace {
 public:
  FreeSpace(const Scene& scene, const OccluderSet* occluders, const ExactSegments& segments);

  /// Is p outside every solid and not under the ground?
  /// Cost: O(objects + triangles of those whose boxes hold p, and of the ground).
  bool is_free(const Vec3& p) const;

  /// Viewpoints of the cell that count: the eye, extreme points of the reach, points of its inside;
  /// at most `n`, the eye first if it counts. One that sees another that counts by a straight line
  /// is in the same free region; only those that see none are looked at by is_free().
  /// `discarded`, if not null, is set to how many did not count.
  std::vector<Vec3> viewpoints(const ViewCell& cell, std::size_t n, std::uint64_t seed,
                               std::size_t* discarded = nullptr) const;

 private:
  /// Piece of a mesh for each triangle; two that share an edge (by position) are of one piece.
  struct Pieces {
    static constexpr std::uint32_t kOpen = 0xffffffffU;
    /// kOpen: of a piece with an edge that an odd number of triangles share.
    std::vector<std::uint32_t> piece;
    std::uint32_t count = 0;
    bool any_open = false;
  };
  std::shared_ptr<const Pieces> pieces_of(std::uint32_t mesh) const;
  bool inside_prism(const Vec3& p) const;
  bool inside_solid(const Vec3& p) const;
  bool inside_closed_piece(const Object& o, const Vec3& p) const;
  using Group = std::vector<const Object*>;  ///< that are one ground together
  bool below(const Group& ground, const Vec3& p) const;
  std::vector<Group> tiles() const;
  void find_grounds();

  const Scene& scene_;
  const OccluderSet* occluders_;
  const ExactSegments& segments_;
  std::vector<Aabb> prism_bounds_;
  std::vector<Group> grounds_;
  mutable std::mutex mutex_;
  /// By mesh, made when first asked for; guarded by mutex_.
  mutable std::map<std::uint32_t, std::shared_ptr<const Pieces>> pieces_;
};

}  // namespace ivis
