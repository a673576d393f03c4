#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace ivis::client {

/// How long a PVS must hold, measured: a PVS is in use from the first frame that has it to the last
/// one before the next arrives, L + T - t_frame after its pose, where L is the time from a pose to
/// its PVS being usable, T the time between poses that are answered (docs/theory.md, 6; the paper's
/// Lemma 4.1 is T = L). Both are taken at frames as they came, so they are whole frames, hitches
/// and all, whatever the timer's jitter. The answer is a running high quantile: what one bad frame
/// in a thousand asks for does not widen every cell.
/// Guarantee: none rests on it: a PVS serves its cell, and the client looks at each frame whether
///            it is in. Too short a time makes stalls, too long a one larger sets.
/// Threads:   a value. Cost: O(window) an answer. Clock: monotonic; a sample that goes backwards is
///            dropped.
/// Source:    Wonka, Wimmer, Sillion 2001, section 4.3.
class VisibilityClock {
 public:
  using Duration = std::chrono::steady_clock::duration;
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::size_t kWindow = 1024;  ///< samples: 17 s at 60 Hz
  static constexpr double kQuantile = 0.999;
  /// So many PVS must have been replaced before the times are believed: answers of unequal age come
  /// in turn where a solve is no whole number of frames.
  static constexpr std::size_t kLeast = 32;

  /// The PVS of the pose sent at `sent` is used for the first time at frame `now`.
  void begins(Time sent, Time now);
  /// It is used at `now` as well.
  void used(Time now);
  /// Nothing is in use any more: a session ended.
  void interrupt();

  /// What the next PVS must hold for; zero until kLeast have been replaced, never after.
  Duration hold() const { return hold_; }
  Duration latency() const { return latency_.quantile; }    ///< L
  Duration interval() const { return interval_.quantile; }  ///< T

 private:
  struct Window {
    void add(Duration d);
    std::vector<Duration> ring;
    std::size_t next = 0;
    Duration quantile{0};
  };
  Window latency_, interval_, holds_;
  Duration hold_{0};
  bool in_use_ = false;
  Time sent_{}, last_used_{};
};

}  // namespace ivis::client
