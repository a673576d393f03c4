#include "client_lib/visibility_clock.h"

#include <algorithm>
#include <cmath>

namespace ivis::client {

void VisibilityClock::Window::add(Duration d) {
  if (d < Duration::zero()) return;
  if (ring.size() < kWindow) {
    ring.push_back(d);
  } else {
    ring[next] = d;
    next = (next + 1) % kWindow;
  }
  std::vector<Duration> sorted = ring;
  const auto rank =
      static_cast<std::ptrdiff_t>(std::ceil(kQuantile * static_cast<double>(sorted.size())) - 1);
  std::nth_element(sorted.begin(), sorted.begin() + rank, sorted.end());
  quantile = sorted[static_cast<std::size_t>(rank)];
}

void VisibilityClock::begins(Time sent, Time now) {
  latency_.add(now - sent);
  if (in_use_) {
    interval_.add(sent - sent_);
    holds_.add(last_used_ - sent_);
    if (holds_.ring.size() >= kLeast) hold_ = std::max(holds_.quantile, Duration{1});
  }
  in_use_ = true;
  sent_ = sent;
  last_used_ = now;
}

void VisibilityClock::used(Time now) {
  last_used_ = std::max(last_used_, now);
}

void VisibilityClock::interrupt() {
  in_use_ = false;
}

}  // namespace ivis::client
