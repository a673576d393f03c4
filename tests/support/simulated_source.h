#pragma once
// A server beside a client on a clock that only the test moves: what it takes for a network and a
// solver's time is told, not spent.

#include <chrono>
#include <deque>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "client_lib/local_source.h"
#include "client_lib/source.h"
#include "server/ladder.h"

namespace ivis::test {

class SimulatedSource : public client::PvsSource {
 public:
  using Duration = Time::duration;
  struct Delays {
    Duration network{};  ///< each way
    /// Of the n-th solve, from 0.
    std::function<Duration(std::uint64_t)> solve = [](std::uint64_t) { return Duration{}; };
  };
  SimulatedSource(client::Catalogue catalogue, const server::Ladder& ladder, Delays delays,
                  const Time& now)
      : catalogue_(std::move(catalogue)), ladder_(ladder), delays_(std::move(delays)), now_(now) {
    catalogue_.reaches = ladder.reaches();
  }

  const client::Catalogue* catalogue() const override { return &catalogue_; }
  void set_pace(const Pace& pace) override { pace_ = pace; }
  void send(const client::Request& request) override {
    ++sent;
    if (there) on_way_.push_back({now_ + delays_.network, request});
  }
  bool receive(client::Answer& answer) override {
    serve();
    bool any = false;
    while (!answers_.empty() && answers_.front().first <= now_) {
      answer = std::move(answers_.front().second);
      answers_.pop_front();
      any = true;
    }
    return any;
  }
  void wait(Time /*deadline*/) override {}
  bool connected() const override { return there; }
  const Error* failure() const override { return nullptr; }
  std::string trouble() const override { return {}; }
  client::SourceStats stats() const override { return counted; }

  std::uint32_t epoch() const override { return scene_epoch; }

  bool there = true;              ///< false: what is sent is lost
  std::uint32_t scene_epoch = 0;  ///< of answers, and what the client has heard of
  std::uint32_t valid_us = 0;     ///< of answers
  std::uint64_t sent = 0;
  std::uint64_t solves = 0;
  client::SourceStats counted;

 private:
  /// What a server with one thread does until now_: of the poses that wait the latest wins.
  void serve() {
    while (!on_way_.empty()) {
      const Time start = std::max(free_, on_way_.front().first);
      if (start > now_) return;
      client::Request request;
      while (!on_way_.empty() && on_way_.front().first <= start) {
        request = on_way_.front().second;
        on_way_.pop_front();
      }
      free_ = start + delays_.solve(solves++);
      answers_.emplace_back(free_ + delays_.network, solve(request));
    }
  }

  client::Answer solve(const client::Request& request) const {
    const auto choice = ladder_.choose(server::Outlook(
        pace_, request.hold_us, request.observer.value_or(request.centre) - request.centre));
    client::Answer a;
    a.sequence = request.sequence;
    a.cell = {request.centre, ladder_.reaches()[choice.rung]};
    a.safe = choice.safe;
    a.epoch = scene_epoch;
    a.valid_us = valid_us;
    const auto pvs = choice.method->solve(a.cell);
    a.everything = !pvs || !pvs->everything_because.empty();
    a.count = catalogue_.objects();
    if (a.everything) return a;
    a.bits.assign(client::words_for(catalogue_.objects()), 0);
    for (const ObjectId id : pvs->objects)
      client::set_bit(a.bits, id);
    a.count = static_cast<std::uint32_t>(pvs->objects.size());
    return a;
  }

  client::Catalogue catalogue_;
  const server::Ladder& ladder_;
  Delays delays_;
  const Time& now_;
  Pace pace_;
  Time free_{};
  std::deque<std::pair<Time, client::Request>> on_way_;
  std::deque<std::pair<Time, client::Answer>> answers_;
};

}  // namespace ivis::test
