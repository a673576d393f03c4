#include "client_lib/visibility_clock.h"

#include <gtest/gtest.h>

namespace ivis::client {
namespace {

using namespace std::chrono_literals;
using Time = VisibilityClock::Time;
using Duration = VisibilityClock::Duration;

/// Answers of poses at every `every`-th frame, each used from `late` frames after its pose on.
void run(VisibilityClock& clock, Time start, int frames, int late, int every, Duration frame) {
  int in_use = -1;
  for (int f = 0; f < frames; ++f) {
    const int newest = f < late ? -1 : (f - late) / every * every;
    if (newest >= 0 && newest != in_use) {
      clock.begins(start + newest * frame, start + f * frame);
      in_use = newest;
    } else if (in_use >= 0) {
      clock.used(start + f * frame);
    }
  }
}

TEST(VisibilityClock, KnowsNothingUntilSomePvsHaveBeenReplaced) {
  VisibilityClock clock;
  constexpr int kFrames = static_cast<int>(VisibilityClock::kLeast);
  run(clock, Time{} + 1s, kFrames + 1, 1, 1, 16ms);
  EXPECT_EQ(clock.hold(), 0ns);
  EXPECT_EQ(clock.latency(), 16ms);
  run(clock, Time{} + 1s + kFrames * 16ms, 2, 1, 1, 16ms);
  EXPECT_EQ(clock.hold(), 16ms);
}

// t_e = L + T - t_frame; Lemma 4.1 is the case T = L.
TEST(VisibilityClock, HoldsForLatencyAndIntervalLessOneFrame) {
  constexpr Duration kFrame = 16ms;
  for (int late = 1; late <= 6; ++late)
    for (int every = 1; every <= 6; ++every) {
      VisibilityClock clock;
      run(clock, Time{} + 5s, 300, late, every, kFrame);
      EXPECT_EQ(clock.latency(), late * kFrame);
      EXPECT_EQ(clock.interval(), every * kFrame);
      EXPECT_EQ(clock.hold(), (late + every - 1) * kFrame) << late << ' ' << every;
    }
}

TEST(VisibilityClock, OneBadFrameInAThousandDoesNotCountAndTwoDo) {
  VisibilityClock clock;
  constexpr Duration kFrame = 16ms;
  run(clock, Time{} + 5s, 1500, 1, 1, kFrame);
  const auto once = [&](Time at) {
    clock.begins(at, at + 400ms);
    clock.begins(at + kFrame, at + 400ms + kFrame);
  };
  once(Time{} + 100s);
  EXPECT_EQ(clock.hold(), kFrame);
  once(Time{} + 101s);
  EXPECT_GT(clock.hold(), 300ms);
  run(clock, Time{} + 200s, 1500, 1, 1, kFrame);
  EXPECT_EQ(clock.hold(), kFrame) << "forgotten when the window has passed";
}

TEST(VisibilityClock, TimesThatGoBackwardsAreDroppedAndPausesDoNotCount) {
  VisibilityClock clock;
  run(clock, Time{} + 100s, 200, 1, 1, 16ms);
  clock.begins(Time{} + 50s, Time{} + 40s);  // the clock was set back
  clock.used(Time{} + 39s);
  run(clock, Time{} + 40s, 20, 1, 1, 16ms);
  EXPECT_EQ(clock.hold(), 16ms);
  EXPECT_EQ(clock.latency(), 16ms);
  clock.interrupt();
  run(clock, Time{} + 4000s, 20, 1, 1, 16ms);
  EXPECT_EQ(clock.hold(), 16ms) << "a pause between sessions is no PVS in use";
}

}  // namespace
}  // namespace ivis::client
