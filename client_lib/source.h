#pragma once
// What a client draws its answers from: a server over the network, or a worker thread in process.

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/edit.h"
#include "core/ids.h"
#include "core/pace.h"
#include "core/result.h"
#include "core/view_cell.h"

namespace ivis::client {

/// Object sets by id, one bit each; bits past the last object are zero.
using IdBits = std::vector<std::uint64_t>;
inline std::size_t words_for(std::size_t objects) {
  return (objects + 63) / 64;
}
inline void set_bit(IdBits& bits, ObjectId id) {
  bits[id >> 6U] |= std::uint64_t{1} << (id & 63U);
}
inline IdBits all_of(std::size_t objects) {
  IdBits bits(words_for(objects), ~std::uint64_t{0});
  if (objects % 64 != 0) bits.back() = (std::uint64_t{1} << (objects % 64)) - 1;
  return bits;
}

/// What is served: the same for as long as a client lives, but for the reach; and all of it for one
/// that follows the server to another scene.
struct Catalogue {
  SceneHash scene_hash = 0;
  std::vector<Reach> reaches;  ///< what cells may be, ascending
  std::string largest_reach;   ///< the last of them
  std::string method;
  std::vector<std::uint32_t> node;      ///< by id
  std::vector<std::uint32_t> instance;  ///< by id
  std::vector<std::uint32_t> cluster;   ///< by id; empty: all 0
  std::uint32_t cluster_of(std::uint32_t id) const { return cluster.empty() ? 0 : cluster[id]; }
  std::uint32_t objects() const { return static_cast<std::uint32_t>(node.size()); }
};

/// Fails unless (node, instance, cluster) ascends strictly and the clusters of an instance count
/// from 0, which finding an id by them relies on.
Status check_catalogue(const Catalogue& catalogue);

/// The PVS of one pose.
struct Answer {
  std::uint32_t sequence = 0;  ///< of the pose; 0: no answer yet
  ViewCell cell;
  bool everything = false;  ///< every object is listed: true wherever the eye is; bits are empty
  IdBits bits;
  std::uint32_t count = 0;  ///< of bits set
  double solve_ms = 0;
  double safe = 1;  ///< the part of the pace told that the cell holds for the time asked for
  std::uint32_t epoch = 0;     ///< of the scene it is of; 0: as in the file
  std::uint32_t valid_us = 0;  ///< past the sending of the pose; 0: no end
  /// What has changed: against the scene file if `from_the_file`, else against the answer before.
  std::vector<ObjectState> changes{};
  bool from_the_file = true;
};

/// What became of an edit.
struct EditResult {
  std::uint32_t request = 0;
  std::uint32_t epoch = 0;  ///< 0: refused or lost
  std::string why;
};

/// A pose to be answered.
struct Request {
  std::uint32_t sequence = 0;
  Vec3 centre{0};             ///< of the cell
  std::uint32_t hold_us = 0;  ///< for how long the PVS should hold; 0: unknown
  /// Where the observer is, when the centre lies ahead of it by its turning; none: no matter.
  std::optional<Vec3> observer{};
};

struct SourceStats {
  std::uint64_t answers = 0;
  std::uint64_t bytes = 0;
  std::uint64_t reconnects = 0;
  std::uint64_t scenes = 0;  ///< other ones than at first that were taken up
  std::uint64_t bad_messages = 0;
};

/// Poses in, answers out. Threads: one caller at a time. No call blocks but wait().
class PvsSource {
 public:
  using Time = std::chrono::steady_clock::time_point;
  virtual ~PvsSource() = default;

  /// Null until the source knows what is served; then valid as long as the source.
  virtual const Catalogue* catalogue() const = 0;
  /// The latest pose replaces one that has not been sent. Sequences ascend from 1.
  virtual void send(const Request& request) = 0;
  /// From now on, also for sessions to come. Valid: Pace::valid().
  virtual void set_pace(const Pace& pace) = 0;
  /// Moves on whatever can be without waiting. Puts the newest answer into `answer` if there is one
  /// that has not been taken (swapping buffers), and returns whether it did.
  virtual bool receive(Answer& answer) = 0;
  /// Blocks until something may have arrived, at most until `deadline`.
  virtual void wait(Time deadline) = 0;
  /// Has the other side been heard of lately?
  virtual bool connected() const = 0;
  /// Why no answer will ever come, or null.
  virtual const Error* failure() const = 0;
  /// Why none is coming at present, "" when all is well.
  virtual std::string trouble() const = 0;
  virtual SourceStats stats() const = 0;

  /// The newest epoch of the scene that was heard of: a pose is answered for it or a later one.
  virtual std::uint32_t epoch() const { return 0; }
  /// Asks for 1 to wire::kMaxEdits valid edits, all or nothing. Returns the number of the request.
  /// Errors: kUnsupported; kConnection, nothing is asked then.
  virtual Result<std::uint32_t> edit(std::span<const Edit> /*edits*/) {
    return unsupported("this client shows a scene that it cannot change");
  }
  /// Takes the oldest answer to an edit(), if there is one; receive() brings them in.
  virtual std::optional<EditResult> edited() { return std::nullopt; }
};

}  // namespace ivis::client
