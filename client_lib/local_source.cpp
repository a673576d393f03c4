#include "client_lib/local_source.h"

#include <condition_variable>
#include <exception>
#include <mutex>
#include <new>
#include <optional>
#include <thread>
#include <utility>

namespace ivis::client {
namespace {

class LocalSource : public PvsSource {
 public:
  explicit LocalSource(LocalWorld world) : world_(std::move(world)), worker_([this] { work(); }) {}
  ~LocalSource() override {
    {
      const std::lock_guard lock(mutex_);
      closing_ = true;
    }
    changed_.notify_all();
    worker_.join();
  }
  LocalSource(const LocalSource&) = delete;
  LocalSource& operator=(const LocalSource&) = delete;

  const Catalogue* catalogue() const override { return &world_.catalogue; }
  void send(const Request& request) override {
    {
      const std::lock_guard lock(mutex_);
      pose_ = request;
    }
    changed_.notify_all();
  }
  void set_pace(const Pace& /*pace*/) override {}  // one reach, whatever the pace
  bool receive(Answer& answer) override {
    const std::lock_guard lock(mutex_);
    if (!fresh_) return false;
    fresh_ = false;
    std::swap(answer, slot_);
    return true;
  }
  void wait(Time deadline) override {
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, deadline, [this] { return fresh_; });
  }
  bool connected() const override { return true; }
  const Error* failure() const override { return nullptr; }
  std::string trouble() const override {
    const std::lock_guard lock(mutex_);
    return trouble_;
  }
  SourceStats stats() const override {
    const std::lock_guard lock(mutex_);
    return counted_;
  }

 private:
  void work() {
    Answer next;
    while (true) {
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return closing_ || pose_.has_value(); });
        if (closing_) return;
        next.sequence = pose_->sequence;
        next.cell = {pose_->centre, world_.reach};
        pose_.reset();
      }
      std::string trouble = solve(next);
      {
        const std::lock_guard lock(mutex_);
        std::swap(slot_, next);
        fresh_ = true;
        ++counted_.answers;
        trouble_ = std::move(trouble);
      }
      changed_.notify_all();
    }
  }

  /// Fills `answer` for its cell. What cannot be solved is answered with every object; returns why.
  /// An exception would end the host's process: nobody stands above this thread to catch it.
  std::string solve(Answer& answer) const noexcept {
    std::string why = "out of memory";
    try {
      return solve_or_throw(answer);
    } catch (const std::bad_alloc&) {
    } catch (const std::exception& e) {
      try {
        why = std::string("the method failed: ") + e.what();
      } catch (const std::bad_alloc&) {  // then that is the trouble
      }
    } catch (...) {
      why = "unknown error";
    }
    answer.everything = true;
    answer.bits.clear();
    answer.count = world_.catalogue.objects();
    answer.solve_ms = 0;
    return why;
  }

  std::string solve_or_throw(Answer& answer) const {
    const auto start = std::chrono::steady_clock::now();
    const auto pvs = world_.method->solve(answer.cell);
    const auto took = std::chrono::steady_clock::now() - start;
    answer.solve_ms = std::chrono::duration<double, std::milli>(took).count();
    answer.everything = !pvs || !pvs->everything_because.empty();
    answer.bits.assign(answer.everything ? 0 : words_for(world_.catalogue.objects()), 0);
    answer.count = answer.everything ? world_.catalogue.objects()
                                     : static_cast<std::uint32_t>(pvs->objects.size());
    if (!answer.everything)
      for (const ObjectId id : pvs->objects)
        set_bit(answer.bits, id);
    return pvs ? "" : pvs.error().message;
  }

  const LocalWorld world_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool closing_ = false;
  bool fresh_ = false;
  std::optional<Request> pose_;
  Answer slot_;
  SourceStats counted_;
  std::string trouble_;
  std::thread worker_;  ///< last: starts when all else is there
};

}  // namespace

Catalogue catalogue_of(const Scene& scene, const Reach& reach, const Method& method) {
  Catalogue c;
  c.scene_hash = scene.hash;
  c.reaches = {reach};
  c.largest_reach = reach.to_string();
  c.method = method.traits().name;
  for (const Object& o : scene.objects) {
    c.node.push_back(o.node);
    c.instance.push_back(o.instance);
    if (!scene.wholes.empty()) c.cluster.push_back(o.cluster);
  }
  return c;
}

std::unique_ptr<PvsSource> make_local_source(LocalWorld world) {
  return std::make_unique<LocalSource>(std::move(world));
}

}  // namespace ivis::client
