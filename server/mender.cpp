#include "server/mender.h"

#include <exception>
#include <utility>

#include "occluders/fast_erosion.h"
#include "occluders/mend.h"
#include "occluders/prisms.h"
#include "scenes/edited.h"

namespace ivis::server {
Mender::Mender(const Scene& scene) : scene_(scene), thread_([this] { run(); }) {}

Mender::~Mender() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  ordered_.notify_all();
  thread_.join();
}

void Mender::order(Order order) {
  {
    const std::lock_guard lock(mutex_);
    order_ = std::move(order);
    done_.reset();
  }
  ordered_.notify_one();
}

std::optional<Mender::Mended> Mender::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(done_, std::nullopt);
}

bool Mender::busy() const {
  const std::lock_guard lock(mutex_);
  return working_ || order_ || done_;
}

void Mender::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    ordered_.wait(lock, [this] { return stop_ || order_; });
    if (stop_) return;
    const Order order = std::move(*order_);
    order_.reset();
    working_ = true;
    lock.unlock();
    std::optional<Mended> result;
    try {
      result = mended(order);
    } catch (const std::exception&) {  // out of memory: they stay out of use
    }
    lock.lock();
    working_ = false;
    if (!order_) done_ = std::move(result);
  }
}

Mender::Mended Mender::mended(const Order& order) const {
  Mended out;
  out.version = order.version;
  const FastEroder eroder;
  std::vector<Displaced> displaced;
  for (const Object* o : order.displaced)
    displaced.push_back({o->bounds, extract_prisms(scene_, *o).prisms});
  for (const OccluderIndex* index : order.rungs) {
    const OccluderSet& set = index->occluders();
    Mended::Rung& rung = out.rungs[index];
    rung.added = mend(*index, displaced, eroder);
    for (const Order::Moved& m : order.moved) {
      const Object object = as_placed(*m.object, m.placement);
      ShrunkObject shrunk = shrink_object(scene_, object, set, eroder);
      rung.added.insert(rung.added.end(), shrunk.prisms.begin(), shrunk.prisms.end());
      rung.solids.insert(rung.solids.end(), shrunk.solids.begin(), shrunk.solids.end());
    }
  }
  return out;
}

}  // namespace ivis::server
