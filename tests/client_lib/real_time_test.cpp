// Cells, stalls and their causes on a clock that passes as the tests say.

#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "client_lib/client.h"
#include "tests/server/fake_method.h"
#include "tests/support/simulated_source.h"

namespace ivis::test {
namespace {

using namespace std::chrono_literals;
using Time = std::chrono::steady_clock::time_point;
using Duration = Time::duration;

constexpr Duration kFrame = 16'666'667ns;
constexpr double kSpeed = 30;  // 0.5 m a frame

/// A client, a simulated server, an observer.
struct Observer {
  Scene scene = grid_scene(30);
  NearMethod method{scene, 8};
  server::Ladder ladder;
  Time now{1000s};
  SimulatedSource* source = nullptr;
  std::unique_ptr<ivis_client> client;
  std::vector<double> reaches;
  std::uint64_t missing = 0;

  explicit Observer(std::vector<Reach> reaches_given = rungs())
      : ladder(reaches_given, method, 0.001) {
    for (std::uint32_t i = 0; i + 1 < ladder.reaches().size(); ++i)
      ladder.add(i, method);
  }
  static std::vector<Reach> rungs() {
    std::vector<Reach> out;
    for (int i = 1; i <= 20; ++i)
      out.push_back(Reach::cylinder(0.5 * i + 0.01, 0.1));
    return out;
  }
  void open(SimulatedSource::Delays delays, ivis_client::Options options) {
    auto made = std::make_unique<SimulatedSource>(
        client::catalogue_of(scene, ladder.largest(), method), ladder, std::move(delays), now);
    source = made.get();
    source->set_pace(options.pace);
    options.now = [this] { return now; };
    client = std::make_unique<ivis_client>(std::move(made), std::move(options));
  }
  static ivis_client::Options stalling(double speed = kSpeed) {
    ivis_client::Options o;
    o.policy = IVIS_POLICY_STALL;
    o.pace = {speed, 0.3, 1.0 / 60};
    return o;
  }
  /// Along a curve at `speed`; where it is held back it waits.
  ivis_frame walk(int frames, double speed = kSpeed) {
    ivis_frame f{};
    for (int i = 0; i < frames; ++i) {
      const double ahead = s + speed * std::chrono::duration<double>(kFrame).count();
      f = frame(at(ahead));
      if (f.stalled == 0) s = ahead;
      now += kFrame;
    }
    return f;
  }
  static Vec3 at(double s) { return {30 + 20 * std::cos(s / 20), 1, 30 + 20 * std::sin(s / 20)}; }
  ivis_frame frame(const Vec3& eye) {
    ivis_frame f;
    EXPECT_EQ(client->pose(eye), IVIS_OK);
    EXPECT_EQ(client->view(eye, f), IVIS_OK);
    check(f);
    if (f.sequence != 0) reaches.push_back(Reach::parse(f.cell_reach)->half_extents().x);
    return f;
  }
  /// What is drawn is complete for the eye it is drawn from, whatever the policy but INCOMPLETE.
  void check(const ivis_frame& f) {
    if (f.everything != 0 || f.covered == 0) return;
    const Vec3 eye{f.eye[0], f.eye[1], f.eye[2]};
    const ViewCell cell{{f.cell_eye[0], f.cell_eye[1], f.cell_eye[2]}, *Reach::parse(f.cell_reach)};
    if (!cell.contains(eye)) ++missing;
    for (const ObjectId id : solved(cell))
      if (ivis_frame_visible(&f, id) == 0) ++missing;
  }
  std::vector<ObjectId> solved(const ViewCell& cell) const { return method.solve(cell)->objects; }
  double s = 0;
};

// The paper's Lemma 4.1 and its general form: with what they ask for nothing ever stalls.
TEST(RealTime, CellsAreWhatLatencyAndIntervalAskForAndNothingStalls) {
  for (const Duration solve : {Duration{1ms}, Duration{10ms}, Duration{20ms}, Duration{50ms}})
    for (const Duration network : {Duration{0ms}, Duration{5ms}, Duration{20ms}}) {
      SCOPED_TRACE(std::to_string(solve / 1ms) + " ms, network " + std::to_string(network / 1ms));
      Observer run;
      run.open({network, [&](std::uint64_t) { return solve; }}, Observer::stalling());
      run.walk(2000);
      const ivis_stats stats = run.client->stats();
      EXPECT_EQ(run.missing, 0U);
      EXPECT_EQ(stats.stalls, 0U);
      EXPECT_EQ(stats.causes[IVIS_CAUSE_NO_ANSWER], stats.uncovered_frames) << "at the start only";
      const double frame_ms = std::chrono::duration<double, std::milli>(kFrame).count();
      // The worst latency and the worst interval need not meet.
      EXPECT_LE(stats.hold_ms, stats.latency_ms + stats.interval_ms - frame_ms + 0.001);
      EXPECT_GE(stats.hold_ms, stats.latency_ms - 0.001);
      // In whole frames, a solve may begin up to a solve after a pose has come.
      const double t_vis = std::chrono::duration<double, std::milli>(solve + 2 * network).count();
      EXPECT_GE(stats.latency_ms, std::ceil(t_vis / frame_ms) * frame_ms - 0.001);
      EXPECT_LE(stats.latency_ms,
                (std::ceil((t_vis + std::chrono::duration<double, std::milli>(solve).count()) /
                           frame_ms) +
                 1) *
                    frame_ms);
      const double needed = kSpeed * stats.hold_ms / 1000;
      EXPECT_GE(run.reaches.back() + 0.011, needed);
      EXPECT_LE(run.reaches.back(), needed + 0.52) << "the smallest rung that holds it";
    }
}

TEST(RealTime, TheLargestCellServesUntilTheTimeIsMeasured) {
  Observer run;
  run.open({}, Observer::stalling());
  run.walk(20);
  EXPECT_EQ(run.reaches.back(), run.ladder.largest().half_extents().x);
  run.walk(100);
  EXPECT_EQ(run.reaches.back(), 0.51);
}

TEST(RealTime, ALateAnswerHoldsTheEyeAndIsCalledLate) {
  Observer run;
  run.open({0ms, [](std::uint64_t n) { return n == 1300 ? Duration{200ms} : Duration{1ms}; }},
           Observer::stalling());
  run.walk(2500);
  const ivis_stats stats = run.client->stats();
  EXPECT_GT(stats.stalls, 5U);
  EXPECT_EQ(stats.causes[IVIS_CAUSE_LATE], stats.stalls);
  EXPECT_GT(stats.held_m, 0);
  EXPECT_EQ(run.missing, 0U);
  EXPECT_EQ(run.reaches.back(), 0.51) << "one in a thousand widens no cell";
}

TEST(RealTime, AClientFasterThanItSaysIsHeldAndNothingIsMissed) {
  Observer run;
  run.open({0ms, [](std::uint64_t) { return Duration{1ms}; }}, Observer::stalling(10));
  run.walk(200, 10);
  EXPECT_EQ(run.client->stats().stalls, 0U);
  run.walk(200, 100);
  const ivis_stats stats = run.client->stats();
  EXPECT_GT(stats.stalls, 50U);
  EXPECT_EQ(stats.causes[IVIS_CAUSE_SPEED], stats.stalls);
  EXPECT_EQ(run.missing, 0U);
  // It tells the truth: cells grow, and the stalls end.
  run.client->set_pace({100, 0.3, 1.0 / 60});
  run.walk(100, 100);
  const auto before = run.client->stats().stalls;
  run.walk(200, 100);
  EXPECT_EQ(run.client->stats().stalls, before);
}

TEST(RealTime, ALadderThatIsTooShortSaysWhatSpeedIsSafe) {
  Observer run({Reach::cylinder(0.51, 0.1), Reach::cylinder(1.01, 0.1)});
  run.open({0ms, [](std::uint64_t) { return Duration{50ms}; }}, Observer::stalling());
  const ivis_frame f = run.walk(1500);
  const ivis_stats stats = run.client->stats();
  EXPECT_GT(stats.causes[IVIS_CAUSE_LADDER], 100U);
  EXPECT_EQ(run.missing, 0U);
  EXPECT_GT(f.safe, 0);
  EXPECT_LT(f.safe, 1);
  EXPECT_LE(f.safe * kSpeed * stats.hold_ms / 1000, 1.02);
  // Slower than that nothing stalls.
  run.walk(20, 0.9 * f.safe * kSpeed);
  const auto before = run.client->stats().stalls;
  run.walk(500, 0.9 * f.safe * kSpeed);
  EXPECT_EQ(run.client->stats().stalls, before);
}

TEST(RealTime, WithoutTheServerTheEyeIsHeldOrEverythingIsShown) {
  Observer run;
  run.open({0ms, [](std::uint64_t) { return Duration{1ms}; }}, Observer::stalling());
  run.walk(200);
  run.source->there = false;
  ivis_frame f = run.walk(100);
  EXPECT_EQ(f.cause, IVIS_CAUSE_DISCONNECTED);
  EXPECT_EQ(f.stalled, 1);
  EXPECT_EQ(f.covered, 1);
  run.client->set_policy(IVIS_POLICY_EVERYTHING);
  f = run.walk(1);
  EXPECT_EQ(f.stalled, 0);
  EXPECT_EQ(f.everything, 1);
  EXPECT_EQ(f.covered, 0);
  run.client->set_policy(IVIS_POLICY_INCOMPLETE);
  f = run.walk(1);
  EXPECT_EQ(f.everything, 0);
  EXPECT_EQ(f.covered, 0);
  run.client->set_policy(IVIS_POLICY_STALL);
  run.source->there = true;
  ++run.source->counted.reconnects;
  run.walk(5);
  f = run.walk(50);
  EXPECT_EQ(f.cause, IVIS_CAUSE_NONE);
  EXPECT_EQ(run.missing, 0U);
  EXPECT_LT(run.client->stats().hold_ms, 100) << "an absence is no latency";
}

TEST(RealTime, AClockThatJumpsMakesNoMisses) {
  Observer run;
  run.open({0ms, [](std::uint64_t) { return Duration{1ms}; }}, Observer::stalling());
  run.walk(100);
  run.now += 3600s;
  run.walk(100);
  EXPECT_EQ(run.missing, 0U);
  run.walk(1500);
  EXPECT_EQ(run.reaches.back(), 0.51);
}

TEST(RealTime, PredictedCellsLieAheadAndAreAnsweredForWhereTheyLie) {
  Observer run({Reach::cylinder(2, 0.1)});
  ivis_client::Options options = Observer::stalling();
  options.predict = true;
  run.open({20ms, [](std::uint64_t) { return Duration{10ms}; }}, options);
  const ivis_frame f = run.walk(300);
  const Vec3 eye = Observer::at(run.s);
  const Vec3 ahead = Observer::at(run.s + 1);
  const Vec3 centre{f.cell_eye[0], f.cell_eye[1], f.cell_eye[2]};
  EXPECT_EQ(run.missing, 0U);
  EXPECT_GT(f.margin_m, 1.2) << "the eye is near the middle of its cell";
  Observer plain({Reach::cylinder(2, 0.1)});
  plain.open({20ms, [](std::uint64_t) { return Duration{10ms}; }}, Observer::stalling());
  const ivis_frame behind = plain.walk(300);
  EXPECT_LT(behind.margin_m, f.margin_m - 0.5);
  EXPECT_LT(glm::distance(centre, ahead) - glm::distance(centre, eye), 1);
}

// Round a curve of 20 m, 1.5 rad/s at this speed: nothing stalls, in cells half as large.
TEST(RealTime, WhoTellsHowItTurnsGetsSmallerCellsAheadAndNothingStalls) {
  const auto walk = [](double turning_rad_s, bool predict) {
    auto run = std::make_unique<Observer>();
    ivis_client::Options options = Observer::stalling();
    options.pace.turning_rad_s = turning_rad_s;
    options.predict = predict;
    run->open({20ms, [](std::uint64_t) { return Duration{20ms}; }}, options);
    run->walk(1500);
    return run;
  };
  const auto ahead = walk(1.6, true);
  EXPECT_EQ(ahead->missing, 0U);
  EXPECT_EQ(ahead->client->stats().stalls, 0U);
  const auto around = walk(0, false);
  EXPECT_EQ(around->client->stats().stalls, 0U);
  EXPECT_LT(ahead->reaches.back(), 0.65 * around->reaches.back());
  // Who turns round on the spot is held, told why, and misses nothing.
  ahead->walk(60, -kSpeed);
  const ivis_stats stats = ahead->client->stats();
  EXPECT_GT(stats.stalls, 0U);
  EXPECT_EQ(stats.causes[IVIS_CAUSE_SPEED], stats.stalls);
  EXPECT_EQ(ahead->missing, 0U);
  ahead->walk(100, -kSpeed);
  EXPECT_EQ(ahead->client->stats().stalls, stats.stalls) << "the other way now";
}

// What is no direction, or lies out of every cell, centres nothing.
TEST(RealTime, CellsLieAheadOfWhoMovesAndHoldTheEye) {
  Observer run({Reach::cylinder(1.5, 0.1)});
  ivis_client::Options options = Observer::stalling();
  options.pace = {30, 10, 1.0 / 60, 0.5};
  options.predict = true;
  run.open({0ms, [](std::uint64_t) { return Duration{1ms}; }}, options);
  Vec3 eye{30, 1, 30};
  const auto frames = [&](int n, const Vec3& step) {
    ivis_frame f{};
    for (int i = 0; i < n; ++i) {
      f = run.frame(eye += step);
      run.now += kFrame;
    }
    return f;
  };
  const auto ahead = [&](const ivis_frame& f) { return f.cell_eye[0] - f.eye[0]; };
  // A frame old, 0.25 m ahead of where the eye was then: half the way at the speed told.
  EXPECT_NEAR(ahead(frames(100, {0.4, 0, 0})), 0.25 - 0.4, 0.01);
  frames(10, {0, 0, 0});
  EXPECT_LT(std::abs(ahead(frames(10, {1e-4, 0, 0}))), 1e-3) << "noise";
  eye.x -= 200;
  EXPECT_LT(std::abs(ahead(frames(2, {0, 0, 0}))), 1e-3) << "a leap";
  EXPECT_EQ(run.missing, 0U);
}

// Told that it may climb by 10 m/s, it climbs by 1.8: half the way at the speed told is out of
// reach.
TEST(RealTime, ACellThatLiesAheadHoldsTheEye) {
  Observer run({Reach::cylinder(3, 0.3)});
  ivis_client::Options options = Observer::stalling();
  options.pace = {30, 10, 1.0 / 60, 0.5};
  options.predict = true;
  run.open({0ms, [](std::uint64_t) { return Duration{50ms}; }}, options);
  Vec3 eye{30, 1, 30};
  for (int i = 0; i < 300; ++i) {
    run.frame(eye += Vec3{0, 0.03, 0});
    run.now += kFrame;
  }
  EXPECT_GT(10 * run.client->stats().hold_ms / 2000, 0.4);
  EXPECT_EQ(run.client->stats().stalls, 0U);
  EXPECT_EQ(run.missing, 0U);
}

TEST(RealTime, LingeringObjectsStayForTheirFrames) {
  Observer run;
  ivis_client::Options options = Observer::stalling();
  options.linger_frames = 10;
  run.open({0ms, [](std::uint64_t) { return Duration{1ms}; }}, options);
  const ivis_frame f = run.walk(300);
  EXPECT_EQ(run.missing, 0U);
  const ViewCell cell{{f.cell_eye[0], f.cell_eye[1], f.cell_eye[2]}, *Reach::parse(f.cell_reach)};
  EXPECT_GT(f.visible_count, run.solved(cell).size());
  for (const ObjectId id : run.solved({Observer::at(run.s - 4.5), cell.reach}))
    EXPECT_NE(ivis_frame_visible(&f, id), 0) << "seen within the last 10 frames";
}

TEST(RealTime, WhereThingsMoveByThemselvesASetRunsOutThoughTheObserverStandsStill) {
  for (const ivis_policy policy :
       {IVIS_POLICY_STALL, IVIS_POLICY_INCOMPLETE, IVIS_POLICY_EVERYTHING}) {
    Observer run;
    auto options = Observer::stalling();
    options.policy = policy;
    run.open({5ms, [](std::uint64_t) { return Duration{1ms}; }}, std::move(options));
    run.source->valid_us = 100'000;
    run.walk(60, 0);
    EXPECT_EQ(run.client->stats().causes[IVIS_CAUSE_EXPIRED], 0U) << "there is a new one in time";
    run.source->there = false;
    ivis_frame f{};
    const auto look = [&] { EXPECT_EQ(run.client->view(Observer::at(0), f), IVIS_OK); };
    run.now += 80ms;
    look();
    EXPECT_EQ(f.cause, IVIS_CAUSE_NONE);
    run.source->there = true;  // reachable, yet nothing has come
    run.now += 40ms;
    look();
    EXPECT_EQ(f.cause, IVIS_CAUSE_EXPIRED);
    EXPECT_EQ(f.covered, policy == IVIS_POLICY_STALL ? 1 : 0);
    EXPECT_EQ(f.stalled, policy == IVIS_POLICY_STALL ? 1 : 0) << "time is held";
    EXPECT_EQ(f.everything, policy == IVIS_POLICY_EVERYTHING ? 1 : 0);
    EXPECT_EQ(f.eye[0], Observer::at(0).x);
    // The clock jumps.
    run.now += 1h;
    look();
    EXPECT_EQ(f.cause, IVIS_CAUSE_EXPIRED);
    run.walk(5, 0);
    look();
    EXPECT_EQ(f.cause, IVIS_CAUSE_NONE) << "it asks again by itself and recovers";
    EXPECT_EQ(run.missing, 0U);
  }
}

TEST(RealTime, WhoIsToHoldTimeIsToldSoWhateverElseIsWrong) {
  Observer run;
  run.open({5ms, [](std::uint64_t) { return Duration{1ms}; }}, Observer::stalling());
  run.source->valid_us = 100'000;
  run.walk(60, 0);
  ivis_frame f{};
  run.now += 15ms;
  EXPECT_EQ(run.client->view(Observer::at(0), f), IVIS_OK) << "the last answer is in use";
  run.source->there = false;
  run.now += 150ms;
  EXPECT_EQ(run.client->view(Observer::at(0), f), IVIS_OK);
  EXPECT_EQ(f.covered, 1);
  EXPECT_EQ(f.cause, IVIS_CAUSE_EXPIRED) << "not disconnected alone";
  EXPECT_EQ(run.client->view(Observer::at(300), f), IVIS_OK);
  EXPECT_EQ(f.cause, IVIS_CAUSE_EXPIRED) << "outside as well";
  run.client->set_policy(IVIS_POLICY_EVERYTHING);
  EXPECT_EQ(run.client->view(Observer::at(0), f), IVIS_OK);
  EXPECT_EQ(f.everything, 1);
  run.client->set_policy(IVIS_POLICY_STALL);
  EXPECT_EQ(run.client->view(Observer::at(0), f), IVIS_OK);
  EXPECT_EQ(f.covered, 0) << "time went on in between";
  EXPECT_EQ(f.everything, 1);
}

TEST(RealTime, ASetThatRunsOutOnItsWayIsCompleteForNobody) {
  Observer run;
  run.open({60ms, [](std::uint64_t) { return Duration{1ms}; }}, Observer::stalling());
  run.source->valid_us = 100'000;  // of 121 ms that it takes
  run.walk(60, 0);
  const ivis_stats stats = run.client->stats();
  EXPECT_EQ(stats.stalls, 0U) << "holding time now does not bring back what moved meanwhile";
  EXPECT_EQ(stats.uncovered_frames, 60U);
  EXPECT_GT(stats.causes[IVIS_CAUSE_EXPIRED], 40U);
  EXPECT_EQ(run.missing, 0U);
}

TEST(RealTime, ANoticeOfAChangedSceneIsAskedAboutByLooking) {
  Observer run;
  run.open({5ms, [](std::uint64_t) { return Duration{1ms}; }}, Observer::stalling());
  run.walk(10, 0);
  run.now += 1s;
  ivis_frame f{};
  const auto look = [&] { EXPECT_EQ(run.client->view(Observer::at(0), f), IVIS_OK); };
  look();
  const auto sent = run.source->sent;
  look();
  EXPECT_EQ(run.source->sent, sent) << "nothing to ask for";
  run.source->scene_epoch = 3;
  look();
  look();
  EXPECT_EQ(run.source->sent, sent + 1) << "once";
  EXPECT_EQ(f.epoch, 0U);
  run.now += 20ms;
  look();
  EXPECT_EQ(f.epoch, 3U);
}

}  // namespace
}  // namespace ivis::test
