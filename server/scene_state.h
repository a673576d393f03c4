#pragma once

#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/edit.h"
#include "occluders/touched.h"
#include "scenes/scene.h"
#include "server/mender.h"
#include "visibility/amendment.h"

namespace ivis::server {

/// The scene as edits have left it: what each object is now, and what that means for the occluders
/// of each rung. An edit costs what it touches: the tree of objects and the maps' walls stay as
/// they are, answers are computed with an Amendment.
///
/// Guarantee: whatever may rest on matter that is not where the scene file has it hides nothing.
///            A mover is listed wherever it may be seen within its speed from where it was last
///            told, kMoverLagS more included, so that clients may draw it a little late; one that
///            stopped is where it was told. (It does
///            not sink below the scene's lowest point, unless it was told there.)
/// Threads:   one at a time; mending goes on in a thread of its own.
/// Ownership: borrows the scene, and the occluders by the indices given.
class SceneState {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr double kMoverLagS = 0.1;
  /// Objects other than in the file: some 200 bytes each.
  static constexpr std::size_t kMostChanged = 100'000;
  /// Of one answer, but for the rest of an epoch: 64 bytes each.
  static constexpr std::size_t kMostTold = 4096;

  static constexpr const char* kTorn =
      "an edit was torn by a lack of memory: the scene has to be loaded anew (SIGHUP, or a "
      "restart)";

  explicit SceneState(const Scene& scene);

  struct Outcome {
    std::uint32_t epoch = 0;  ///< 0: refused, and nothing was done
    std::string why;
  };
  /// All or nothing; where memory runs out in between, the scene is torn(). Cost: microseconds an
  /// edit, and a few more for each occluder touched.
  Outcome apply(std::span<const Edit> edits, Time now);

  std::uint32_t epoch() const { return epoch_; }
  struct Told {
    std::uint32_t epoch = 0;           ///< that a client comes to by it: epoch(), if that is all
    std::uint32_t since = 0;           ///< told against: as asked, or 0
    std::vector<ObjectState> objects;  ///< as they are now
  };
  /// What has changed since that epoch. Where that is very much it is a part: of the earliest
  /// epochs. Later epochs than epoch() count as 0.
  Told since(std::uint32_t epoch) const;
  /// Is an edit half done? Then any object may be seen, and no more edits are taken.
  bool torn() const { return torn_; }
  /// Is there anything that moves by itself?
  bool moves() const { return movers_ > 0; }
  /// For a PVS that is in use from `now` to `until`, by the occluders behind `index`; null: the
  /// scene is as in the file. Cost: none while nothing changes and nothing moves by itself; else a
  /// look at each object that was changed; after an edit of matter also a copy of the masks.
  std::shared_ptr<const Amendment> amendment(const OccluderIndex& index, Time now, Time until);
  /// Is something being shrunk anew, or waiting to be taken into use?
  bool mending() const { return mender_.busy(); }

 private:
  struct Entry {
    ObjectState state;
    std::uint32_t epoch = 0;  ///< of its last change
    Time since{};             ///< when its placement was told
    Aabb bounds;              ///< as placed
  };
  /// What the edits mean to one rung.
  struct Rung {
    /// Prisms, by what is displaced, or was.
    std::unordered_map<ObjectId, std::vector<std::uint32_t>> touched;
    std::vector<std::uint8_t> blamed;  ///< how many displaced touch a prism
    std::shared_ptr<const OccluderChange> current;
    std::uint64_t version = 0;  ///< matter_version_ and mendings_ that `current` is of
    std::uint64_t mendings = 0;
    std::shared_ptr<const Amendment> answer;  ///< the latest
    std::uint32_t answer_epoch = 0;           ///< that it is of, and
    std::uint64_t answer_mendings = 0;        ///< likewise
  };

  std::uint32_t occluder_count() const;
  const Object& object(ObjectId id) const;
  /// What an object is to occluders.
  enum Nature : std::uint8_t { kMatter = 1, kGround = 2 };
  std::string why_not(const Edit& edit) const;
  void apply_one(const Edit& edit, Time now);
  void update_displaced(ObjectId id);
  void displace(const OccluderIndex& index, Rung& rung, ObjectId id) const;
  static void replace(Rung& rung, ObjectId id);
  std::shared_ptr<const OccluderChange> change_of(const OccluderIndex& index, Rung& rung) const;
  Rung& rung_of(const OccluderIndex& index);
  void order_mending();

  const Scene& scene_;
  std::vector<std::uint8_t> natures_;  ///< of objects, then of nodes that only occlude
  std::uint32_t epoch_ = 0;
  std::list<Entry> changed_;  ///< ascending epochs
  std::unordered_map<ObjectId, std::list<Entry>::iterator> entry_;
  std::shared_ptr<const std::vector<std::uint64_t>> gone_;  ///< null: to be made anew
  std::map<ObjectId, Aabb> displaced_;  ///< matter that is not where the file has it
  std::uint64_t matter_version_ = 0;
  bool mending_due_ = false;  ///< ordered with the next answer: who does not ask needs none
  bool torn_ = false;
  std::size_t movers_ = 0;
  std::map<const OccluderIndex*, Rung> rungs_;
  Mender::Mended mended_;       ///< the newest
  std::uint64_t mendings_ = 0;  ///< taken into use
  Mender mender_;
};

}  // namespace ivis::server
