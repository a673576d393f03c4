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
    Order order = std::move(*order_);
    order_.reset();
    working_ = true;
    lock.unlock();
    std::optional<Mended> result;
    try {
      result = mended(std::move(order));
    } catch (const std::exception&) {  // out of memory: they stay out of use
    }
    lock.lock();
    working_ = false;
    if (result && !stop_) done_ = std::move(result);
  }
}

Mender::Mended Mender::mended(Order order) const {
  Mended out;
  Context context;
  context.stop = &stop_;
  const FastEroder eroder;
  std::vector<Displaced> displaced;
  for (const auto& [id, object] : order.displaced)
    displaced.push_back({object->bounds, extract_prisms(scene_, *object).prisms});
  for (const OccluderIndex* index : order.rungs) {
    Mended::Rung& rung = out.rungs[index];
    rung.blocks = mend(*index, displaced, eroder, context);
    for (const Moved& m : order.moved)
      rung.objects.push_back(shrink_object(scene_, as_placed(*m.object, m.placement),
                                           index->occluders(), eroder, context));
  }
  out.order = std::move(order);
  return out;
}

}  // namespace ivis::server
