#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/context.h"
#include "core/frustum.h"
#include "core/pvs.h"
#include "core/result.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"
#include "visibility/blockers.h"

namespace ivis {

/// An object that a PVS left out although a ray reaches it.
struct Miss {
  ObjectId id = 0;
  Vec3 eye{0};  ///< the viewpoint, in the cell
  Vec3 hit{0};  ///< the point seen, on a triangle of the object (a mover's: the middle of its box)
};

struct VerifyOptions {
  std::size_t rays_per_culled_object = 64;
  std::uint64_t seed = 1;
  std::size_t max_listed = 20;
  /// Only what can be in this picture counts as seen: for answers that were culled by it.
  std::optional<Frustum> frustum;
};

/// Of one cell.
struct CellReport {
  std::size_t rays = 0;
  std::size_t false_negatives = 0;  ///< objects, not rays
  std::vector<Miss> missing;        ///< the first max_listed, by id
  std::size_t pvs = 0;              ///< objects listed
  std::size_t seen = 0;             ///< objects that some ray saw (a lower bound of the truth)
  std::size_t viewpoints = 0;       ///< that rays left from
  std::size_t discarded = 0;  ///< viewpoints in a solid or under the ground: they do not count
};

/// Rays against a PVS: the proof that travels with the product. Rays are aimed at culled objects
/// from viewpoints of the cell, extreme ones included; a first hit on any culled object is a
/// suspect, and a suspect is confirmed in double precision against every blocker before it counts.
/// A mover (Object::always_visible) that is not listed is a miss without any ray.
/// Guarantee: a reported miss is real; silence is evidence, not proof.
/// Threads:   const and reentrant; check() uses context.threads; same result for any number.
/// Ownership: borrows scene and occluders (may be null: then no solids are known by which to
///            discard viewpoints, parity of closed meshes decides alone).
/// Cost:      building: about 2 us and 130 bytes a triangle; then millions of rays a second.
class Verifier {
 public:
  /// With kOccluding rays pass nodes marked `never`: more is seen, and what a method that takes its
  /// occluders from the other nodes leaves out shows itself sooner; then a miss need not be one by
  /// the definition of "seen", but is one of such a method.
  Verifier(const Scene& scene, const OccluderSet* occluders,
           BlockerChoice blockers = BlockerChoice::kDrawn);
  ~Verifier();
  Verifier(const Verifier&) = delete;
  Verifier& operator=(const Verifier&) = delete;

  /// Errors: kCancelled; kMismatch when the PVS is of another scene.
  Result<CellReport> check(const Pvs& pvs, const VerifyOptions& options,
                           const Context& context = {}) const;

  /// Ids, ascending, of the objects that aimed rays (`rays` an object) see from the cell; the basis
  /// of the sampled reference. Incomplete if the context was stopped.
  std::vector<ObjectId> seen_from(const ViewCell& cell, std::size_t rays, std::uint64_t seed,
                                  const Context& context = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ivis
