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
/// Guarantee: as shrink(), for the scene as ordered. Threads: one at a time. Ownership: borrows
///            the scene and occluders. The destructor waits for the stack being eroded.
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
  };

  explicit Mender(const Scene& scene);
  ~Mender();
  Mender(const Mender&) = delete;
  Mender& operator=(const Mender&) = delete;

  void order(Order order);
  std::optional<Mended> take();
  bool busy() const;

 private:
  void run();
  Mended mended(Order order) const;

  const Scene& scene_;
  mutable std::mutex mutex_;
  std::condition_variable ordered_;
  std::atomic<bool> stop_{false};
  bool working_ = false;
  std::optional<Order> order_;
  std::optional<Mended> done_;
  std::thread thread_;
};

}  // namespace ivis::server
