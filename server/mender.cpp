#include "server/mender.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "occluders/fast_erosion.h"
#include "occluders/mend.h"
#include "occluders/prisms.h"
#include "occluders/rect_tree.h"
#include "scenes/edited.h"

namespace ivis::server {
namespace {

/// Indices into Order::displaced, by group. mend() looks at the solids that stand on blocks of a
/// group, and leaves out which displaced objects meet: whatever meets one of them is of the group,
/// so it leaves out the same as if it were told of all that is displaced. Who have a block or a
/// solid in common are of one group too, so that nothing is eroded twice.
std::vector<std::vector<std::size_t>> groups_of(const OccluderIndex& index,
                                                const Mender::Order& order,
                                                const std::atomic<bool>& stop) {
  const std::size_t n = order.displaced.size();
  std::vector<Box2> places;
  for (const auto& [id, object] : order.displaced)
    places.push_back(ground_box(object->bounds));
  const RectTree tree(places);
  std::vector<std::size_t> parent(n);
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t k) {
    while (parent[k] != k)
      k = parent[k] = parent[parent[k]];
    return k;
  };
  std::unordered_map<std::uint32_t, std::size_t> block_of;  // who came to it first
  std::unordered_map<std::uint32_t, std::size_t> solid_of;
  for (std::size_t k = 0; k < n && !stop; ++k) {
    for (const std::uint32_t block : index.touched(order.displaced[k].second->bounds)) {
      const auto [first, fresh] = block_of.try_emplace(block, k);
      parent[root(k)] = root(first->second);
      if (!fresh) continue;
      for (const std::uint32_t solid : index.solids_on(ground_box(index.box(block)))) {
        const auto [owner, unseen] = solid_of.try_emplace(solid, k);
        parent[root(k)] = root(owner->second);
        if (!unseen) continue;
        const Aabb& box = index.solid_box(solid);
        tree.all(ground_box(box), [&](std::uint32_t other) {
          if (box.overlaps(order.displaced[other].second->bounds)) parent[root(other)] = root(k);
          return true;
        });
      }
    }
  }
  std::map<std::size_t, std::vector<std::size_t>> groups;
  for (std::size_t k = 0; k < n; ++k)
    groups[root(k)].push_back(k);
  std::vector<std::vector<std::size_t>> out;
  out.reserve(groups.size());
  for (auto& [_, group] : groups)
    out.push_back(std::move(group));
  return out;
}

}  // namespace

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

Mender::Mended Mender::mended(Order order) {
  Mended out;
  Context context;
  context.stop = &stop_;
  const FastEroder eroder;
  std::map<const OccluderIndex*, Kept> kept;
  std::map<ObjectId, std::vector<Prism>> solids_of;
  for (const OccluderIndex* index : order.rungs) {
    Mended::Rung& rung = out.rungs[index];
    Kept& before = kept_[index];
    Kept& now = kept[index];
    for (const std::vector<std::size_t>& group : groups_of(*index, order, stop_)) {
      if (stop_) return out;
      std::vector<ObjectId> ids;
      ids.reserve(group.size());
      for (const std::size_t k : group)
        ids.push_back(order.displaced[k].first);
      auto known = before.groups.extract(ids);
      if (known.empty()) {
        std::vector<Displaced> displaced;
        for (const std::size_t k : group) {
          const auto [id, object] = order.displaced[k];
          const auto [solids, fresh] = solids_of.try_emplace(id);
          if (fresh) solids->second = extract_prisms(scene_, *object).prisms;
          displaced.push_back({object->bounds, solids->second});
        }
        now.groups[ids] = mend(*index, displaced, eroder, context);
        ++out.eroded;
      } else {
        now.groups.insert(std::move(known));
      }
      std::ranges::copy(now.groups[ids], std::back_inserter(rung.blocks));
    }
    for (const Moved& m : order.moved) {
      if (stop_) return out;
      auto known = before.objects.extract(m.id);
      if (known.empty() || !(known.mapped().first == m.placement)) {
        now.objects[m.id] = {m.placement, shrink_object(scene_, as_placed(*m.object, m.placement),
                                                        index->occluders(), eroder, context)};
        ++out.eroded;
      } else {
        now.objects.insert(std::move(known));
      }
      rung.objects.push_back(now.objects[m.id].second);
    }
  }
  kept_ = std::move(kept);
  out.order = std::move(order);
  return out;
}

}  // namespace ivis::server
