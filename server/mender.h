#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "core/edit.h"
#include "occluders/mend.h"
#include "occluders/touched.h"
#include "scenes/scene.h"

namespace ivis::server {

/// Shrinks anew, in a thread of its own, what edits have put out of use: the blocks that an object
/// was part of, without it, and the object where it is now. The latest order is the next; what came
/// of an earlier one is of use still, but for what it rests on: that is up to who takes it.
/// Displaced objects are put into groups that have no solid in common, so that each is mended by
/// itself: what was mended stays while its group does.
/// Guarantee: as shrink(), for the scene as ordered. Threads: one at a time. Ownership: borrows
///            the scene and occluders. The destructor waits for the stack being eroded.
/// Cost:      of an order, the erosion of the groups that it changes.
class Mender {
 public:
  struct Moved {
    ObjectId id = 0;
    const Object* object = nullptr;
    Placement placement;
  };
  struct Order {
    std::vector<std::pair<ObjectId, const Object*>> displaced;  ///< matter that is missing
    std::vector<Moved> moved;
    std::vector<const OccluderIndex*> rungs;
  };
  struct Mended {
    struct Rung {
      std::vector<Prism> blocks;          ///< without what was displaced
      std::vector<ShrunkObject> objects;  ///< by index into Order::moved
    };
    Order order;
    std::map<const OccluderIndex*, Rung> rungs;
    std::size_t eroded = 0;  ///< groups and objects that were shrunk for it, over all rungs
  };

  explicit Mender(const Scene& scene);
  ~Mender();
  Mender(const Mender&) = delete;
  Mender& operator=(const Mender&) = delete;

  void order(Order order);
  std::optional<Mended> take();
  bool busy() const;

 private:
  /// What was shrunk for the last order on one rung.
  struct Kept {
    std::map<std::vector<ObjectId>, std::vector<Prism>> groups;
    std::map<ObjectId, std::pair<Placement, ShrunkObject>> objects;
  };

  void run();
  Mended mended(Order order);

  const Scene& scene_;
  mutable std::mutex mutex_;
  std::condition_variable ordered_;
  std::atomic<bool> stop_{false};
  bool working_ = false;
  std::optional<Order> order_;
  std::optional<Mended> done_;
  std::map<const OccluderIndex*, Kept> kept_;  ///< of the thread
  std::thread thread_;
};

}  // namespace ivis::server
