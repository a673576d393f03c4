#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "core/edit.h"
#include "occluders/touched.h"
#include "scenes/scene.h"

namespace ivis::server {

/// Shrinks anew, in a thread of its own, what edits have put out of use: the blocks that an object
/// was part of, without it, and the object where it is now. The latest order wins.
/// Guarantee: as shrink(), for the scene as ordered. Threads: one at a time. Ownership: borrows
///            the scene and occluders. The destructor waits for what is being mended.
class Mender {
 public:
  struct Order {
    std::uint64_t version = 0;
    std::vector<const Object*> displaced;
    struct Moved {
      const Object* object = nullptr;
      Placement placement;
    };
    std::vector<Moved> moved;
    std::vector<const OccluderIndex*> rungs;
  };
  struct Mended {
    struct Rung {
      std::vector<Prism> added;
      std::vector<Aabb> solids;
    };
    std::uint64_t version = 0;
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
  Mended mended(const Order& order) const;

  const Scene& scene_;
  mutable std::mutex mutex_;
  std::condition_variable ordered_;
  bool stop_ = false;
  bool working_ = false;
  std::optional<Order> order_;
  std::optional<Mended> done_;
  std::thread thread_;
};

}  // namespace ivis::server
