#include "client_lib/walk.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <thread>

#include <ivis/ivis.hpp>

#include "client_lib/record.h"

namespace ivis {
namespace {

using Clock = std::chrono::steady_clock;

/// Nearest-rank quantile; 0 of nothing.
double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const auto rank = std::ceil(q * static_cast<double>(values.size())) - 1;
  const auto i = std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(rank), 0,
                                            static_cast<std::ptrdiff_t>(values.size()) - 1);
  std::nth_element(values.begin(), values.begin() + i, values.end());
  return values[static_cast<std::size_t>(i)];
}

ivis_policy policy_of(WalkOptions::Policy policy) {
  switch (policy) {
    case WalkOptions::Policy::kEverything:
      return IVIS_POLICY_EVERYTHING;
    case WalkOptions::Policy::kStall:
      return IVIS_POLICY_STALL;
    case WalkOptions::Policy::kIncomplete:
      return IVIS_POLICY_INCOMPLETE;
  }
  return IVIS_POLICY_EVERYTHING;
}

Error error_of(ivis_status status, std::string text) {
  switch (status) {
    case IVIS_ERROR_MISMATCH:
      return mismatch(std::move(text));
    case IVIS_ERROR_ARGUMENT:
      return invalid_argument(std::move(text));
    case IVIS_ERROR_INPUT:
      return input_error(std::move(text));
    case IVIS_ERROR_IO:
      return io_error(std::move(text));
    default:
      return connection_error(std::move(text));
  }
}

/// For one who reads that nobody answers: what to look at.
Error no_answer(const std::string& endpoint, const std::string& text) {
  const std::string named = text.starts_with(endpoint) ? text : endpoint + ": " + text;
  return connection_error(
      named + "\n  Is an ivisd running that listens there ('ivisd --scene FILE --listen " +
      endpoint +
      "'; its log says 'event=listening')? Is it still loading? Is the address the same on "
      "both sides, and the way to it open?");
}

bool unanswered(ivis_status status) {
  return status == IVIS_ERROR_CONNECTION || status == IVIS_ERROR_TIMEOUT;
}

Vec3 vec(const double (&p)[3]) {
  return {p[0], p[1], p[2]};
}

std::vector<ObjectState> changes_of(ivis_client* client) {
  const ivis_object_state* states = nullptr;
  std::size_t count = 0;
  ivis_client_changes(client, &states, &count);
  std::vector<ObjectState> out;
  for (std::size_t i = 0; i < count; ++i) {
    const ivis_object_state& s = states[i];
    out.push_back({s.id,
                   s.removed != 0,
                   s.occluder_off != 0,
                   s.moved != 0,
                   {vec(s.position), {s.rotation[3], s.rotation[0], s.rotation[1], s.rotation[2]}},
                   s.speed_m_s});
  }
  return out;
}

void record_frame(client::Recorder& recorder, const PvsView& view, const Vec3& wanted,
                  const Reach& reach, double time_s, std::vector<ObjectState> edits) {
  const ivis_frame& raw = view.raw();
  client::RecordedFrame f;
  f.edits = std::move(edits);
  f.time_s = time_s;
  f.sequence = raw.sequence;
  f.wanted = wanted;
  f.eye = vec(view.eye());
  f.covered = view.covered();
  f.everything = view.everything();
  f.cause = raw.cause;
  const auto told = Reach::parse(raw.cell_reach);
  f.cell = {vec(raw.cell_eye), told ? *told : reach};
  const std::size_t words = (std::size_t{view.object_count()} + 63) / 64;
  recorder.add(std::move(f), {raw.visible_bits, f.everything ? 0 : words});
}

struct Samples {
  std::vector<double> bytes, round_trip_ms, solve_ms, overhead_ms, visible, reach_m, age_ms,
      margin_m;
};

WalkReport summary(const Samples& samples, const ivis_stats& stats, const ivis_info& info) {
  WalkReport r;
  r.poses = stats.poses;
  r.answers = stats.answers;
  r.stalls = stats.stalls;
  r.uncovered_frames = stats.uncovered_frames;
  r.reconnects = stats.reconnects;
  r.bytes_mean = static_cast<double>(stats.bytes) /
                 static_cast<double>(std::max<std::uint64_t>(stats.poses, 1));
  r.bytes_median = quantile(samples.bytes, 0.5);
  r.round_trip_ms_p50 = quantile(samples.round_trip_ms, 0.5);
  r.round_trip_ms_p99 = quantile(samples.round_trip_ms, 0.99);
  r.solve_ms_p50 = quantile(samples.solve_ms, 0.5);
  r.overhead_ms_p50 = quantile(samples.overhead_ms, 0.5);
  r.pvs_median = quantile(samples.visible, 0.5);
  r.reach_median = quantile(samples.reach_m, 0.5);
  r.age_ms_p99 = quantile(samples.age_ms, 0.99);
  r.margin_m_p01 = quantile(samples.margin_m, 0.01);
  r.held_m = stats.held_m;
  r.latency_ms = stats.latency_ms;
  r.interval_ms = stats.interval_ms;
  r.hold_ms = stats.hold_ms;
  r.frames = stats.frames;
  for (int c = 1; c < IVIS_CAUSES; ++c)
    if (stats.causes[c] != 0)
      r.causes.emplace_back(ivis_cause_name(static_cast<ivis_cause>(c)), stats.causes[c]);
  r.objects = info.object_count;
  r.reach = info.reach;
  r.method = info.method;
  return r;
}

/// Plays a path by its times, there and back again.
class Played {
 public:
  explicit Played(const std::vector<Pose>& path) : path_(path) {
    for (std::size_t i = 1; i < path.size(); ++i) {
      const double dt = path[i].t - path[i - 1].t;
      const Vec3 d = path[i].eye - path[i - 1].eye;
      horizontal_ = std::max(horizontal_, std::hypot(d.x, d.z) / dt);
      vertical_ = std::max(vertical_, std::abs(d.y) / dt);
    }
  }
  double seconds() const { return path_.back().t - path_.front().t; }
  double horizontal_m_s() const { return horizontal_; }
  double vertical_m_s() const { return vertical_; }

  Vec3 at(double seconds_in) const {
    const double once = seconds();
    double t = std::fmod(seconds_in, 2 * once);
    if (t > once) t = 2 * once - t;
    t += path_.front().t;
    const auto after = std::upper_bound(path_.begin() + 1, path_.end() - 1, t,
                                        [](double v, const Pose& p) { return v < p.t; });
    const Pose& b = *after;
    const Pose& a = *(after - 1);
    const double part = std::clamp((t - a.t) / (b.t - a.t), 0.0, 1.0);
    return a.eye + (b.eye - a.eye) * part;
  }

 private:
  const std::vector<Pose>& path_;
  double horizontal_ = 0, vertical_ = 0;
};

Status check_times(const std::vector<Pose>& path) {
  if (path.size() < 2) return invalid_argument("a walk in real time along a path of one pose");
  constexpr double kMostSeconds = 1e6;
  for (std::size_t i = 1; i < path.size(); ++i)
    if (!(path[i].t > path[i - 1].t) || !(path[i].t - path[0].t <= kMostSeconds))
      return invalid_argument("a walk in real time needs times that ascend, within 1e6 s: pose " +
                              std::to_string(i) + " has t " + std::to_string(path[i].t) +
                              " after " + std::to_string(path[i - 1].t));
  return ok();
}

/// A walk under way: the client, what is counted, what is recorded.
class Walker {
 public:
  Walker(VisibilityClient client, const ivis_info& info, const WalkOptions& options)
      : client_(std::move(client)), options_(options), recorder_(record_) {
    record_.scene_hash = info.scene_hash;
    record_.objects = info.object_count;
    if (auto reach = Reach::parse(info.reach)) record_.reach = *reach;
  }
  VisibilityClient& client() { return client_; }

  /// Accounts for a frame that was drawn.
  Status drawn(const PvsView& view, const Vec3& wanted, Clock::time_point at) {
    if (!start_) start_ = at;
    if (client_.status() != IVIS_OK) return error_of(client_.status(), client_.error());
    const ivis_stats stats = client_.stats();
    samples_.bytes.push_back(static_cast<double>(stats.bytes - before_.bytes));
    samples_.visible.push_back(view.count());
    if (stats.answers != before_.answers) {
      samples_.round_trip_ms.push_back(stats.last_round_trip_ms);
      samples_.solve_ms.push_back(stats.last_solve_ms);
      samples_.overhead_ms.push_back(stats.last_round_trip_ms - stats.last_solve_ms);
    }
    const ivis_frame& raw = view.raw();
    if (raw.sequence != 0) {
      samples_.age_ms.push_back(1e3 * raw.pvs_age_s);
      if (raw.cause == IVIS_CAUSE_NONE) samples_.margin_m.push_back(raw.margin_m);
      if (const auto reach = Reach::parse(raw.cell_reach))
        samples_.reach_m.push_back(reach->half_extents().x);
    }
    if (stats.reconnects != before_.reconnects && options_.record_file)
      if (const auto now = client_.info(); now && record_.reach.to_string() != now->reach)
        return mismatch("the server came back with the reach " + std::string(now->reach) +
                        ", the record is of " + record_.reach.to_string());
    before_ = stats;
    if (options_.record_file)
      record_frame(recorder_, view, wanted, record_.reach,
                   std::chrono::duration<double>(at - *start_).count(), changes_of(client_.get()));
    epoch_ = raw.epoch;
    return ok();
  }

  WalkProgress progress(std::size_t done, std::size_t total) const {
    return {done,
            total,
            samples_.visible.empty() ? 0 : static_cast<std::uint32_t>(samples_.visible.back()),
            before_.last_solve_ms,
            before_.last_round_trip_ms,
            before_.bytes,
            before_.stalls,
            before_.uncovered_frames};
  }

  Result<WalkReport> finish() {
    if (options_.record_file)
      if (auto written = client::write_record(*options_.record_file, record_); !written)
        return written.error();
    WalkReport report = summary(samples_, client_.stats(), *client_.info());
    report.epoch = epoch_;
    return report;
  }

 private:
  VisibilityClient client_;
  const WalkOptions& options_;
  client::Record record_;
  client::Recorder recorder_;
  std::optional<Clock::time_point> start_;  ///< the first frame
  Samples samples_;
  std::uint32_t epoch_ = 0;
  ivis_stats before_{};
};

using OnFrame = std::function<void(const WalkProgress&)>;

Status walk_rows(Walker& walker, const std::string& endpoint, const std::vector<Pose>& path,
                 const WalkOptions& options, const Context& context, const OnFrame& on_frame) {
  VisibilityClient& client = walker.client();
  const auto period = options.hz > 0 ? std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(1 / options.hz))
                                     : Clock::duration::zero();
  auto next = Clock::now();
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (context.stopped()) return cancelled();
    const double eye[3]{path[i].eye.x, path[i].eye.y, path[i].eye.z};
    std::optional<PvsView> view;
    auto drawn_at = Clock::now();
    if (options.hz == 0) {
      static_cast<void>(client.pose(eye));
      if (const ivis_status s = client.wait(options.answer_timeout_ms); s != IVIS_OK)
        return unanswered(s) ? no_answer(endpoint, client.error()) : error_of(s, client.error());
      view = client.view(eye);
    } else {
      std::this_thread::sleep_until(next);
      next += period;
      drawn_at = Clock::now();
      view = client.frame(eye);
    }
    if (auto s = walker.drawn(*view, path[i].eye, drawn_at); !s) return s;
    context.report("walking", i + 1, path.size());
    if (on_frame) on_frame(walker.progress(i + 1, path.size()));
  }
  return ok();
}

/// A frame at a time, as a renderer would: the eye goes on by what the last frame took, no faster
/// than the limit, and waits where it was held back.
Status walk_in_real_time(Walker& walker, const std::string& endpoint, const Played& path,
                         const WalkOptions& options, const ivis_pace& pace, const Context& context,
                         const OnFrame& on_frame) {
  VisibilityClient& client = walker.client();
  Vec3 at = path.at(0);
  // The walk begins with a PVS.
  static_cast<void>(client.pose({at.x, at.y, at.z}));
  if (const ivis_status s = client.wait(options.answer_timeout_ms); s != IVIS_OK)
    return unanswered(s) ? no_answer(endpoint, client.error()) : error_of(s, client.error());
  const double seconds = options.seconds > 0 ? options.seconds : path.seconds();
  const auto frames = static_cast<std::size_t>(std::ceil(seconds * options.fps));
  const std::chrono::duration<double> period(1 / options.fps);
  const auto due = [&, start = Clock::now()](std::size_t f) {
    return start + std::chrono::duration_cast<Clock::duration>(period * static_cast<double>(f));
  };
  double played = 0;  // seconds of the path
  auto last = Clock::now();
  // Once along the path takes longer with a limit, or where the eye is held.
  for (std::size_t frame = 0; options.seconds > 0 ? frame < frames : played < path.seconds();) {
    if (context.stopped()) return cancelled();
    // Between frames the answer is taken in as it comes, so that its time is right.
    while (Clock::now() + std::chrono::milliseconds(1) < due(frame)) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(due(frame) - Clock::now());
      if (client.wait(static_cast<int>(left.count())) == IVIS_OK) break;
    }
    std::this_thread::sleep_until(due(frame));
    const auto now = Clock::now();
    const double step = std::chrono::duration<double>(now - last).count();
    last = now;
    while (due(frame) <= now)
      ++frame;  // late ones are passed over
    double ahead = step;
    for (int i = 0; i < 8 && step > 0; ++i) {
      const Vec3 d = path.at(played + ahead) - at;
      const double over = std::hypot(d.x, d.z) / (pace.horizontal_m_s * step);
      if (!(over > 1)) break;
      ahead /= over;
    }
    const Vec3 wanted = path.at(played + ahead);
    const PvsView view = client.frame({wanted.x, wanted.y, wanted.z});
    if (auto s = walker.drawn(view, wanted, now); !s) return s;
    if (!view.stalled()) {
      played += ahead;
      at = wanted;
    } else {
      at = vec(view.eye());
    }
    const std::size_t done = options.seconds > 0
                                 ? std::min(frame, frames)
                                 : static_cast<std::size_t>(std::min(played / path.seconds(), 1.0) *
                                                            static_cast<double>(frames));
    context.report("walking", done, frames);
    if (on_frame) on_frame(walker.progress(std::max<std::size_t>(done, 1), frames));
  }
  return ok();
}

}  // namespace

Result<WalkReport> walk(const std::string& endpoint, const std::vector<Pose>& path,
                        const WalkOptions& options, const Context& context,
                        const std::function<void(const WalkProgress&)>& on_frame) {
  if (path.empty()) return invalid_argument("a walk along an empty path");
  const auto within = [](double v, double most) { return v >= 0 && v <= most; };
  if (!within(options.hz, 1000) || !within(options.fps, 1000) ||
      (options.hz > 0 && options.fps > 0))
    return invalid_argument("hz " + std::to_string(options.hz) + " and fps " +
                            std::to_string(options.fps) + ", expected one of them, 0 to 1000");
  if (!within(options.seconds, 1e6) || !within(options.speed_limit_m_s, 1e6))
    return invalid_argument("seconds " + std::to_string(options.seconds) + ", speed limit " +
                            std::to_string(options.speed_limit_m_s) + ", expected 0 to 1e6");
  if (!within(options.turning_rad_s, 1e6))
    return invalid_argument("turning " + std::to_string(options.turning_rad_s) +
                            " rad/s, expected 0 to 1e6");
  if (!within(options.budget_ms, 1e6))
    return invalid_argument("budget " + std::to_string(options.budget_ms) +
                            " ms, expected 0 to 1e6");
  if (options.fps > 0)
    if (auto s = check_times(path); !s) return s.error();
  std::optional<Played> played;
  if (options.fps > 0) played.emplace(path);
  ivis_client_options wanted = ivis_client_options_default();
  wanted.endpoint = endpoint.c_str();
  wanted.scene_hash = options.scene_hash;
  wanted.reach = options.reach.empty() ? nullptr : options.reach.c_str();
  wanted.policy = policy_of(options.policy);
  wanted.connect_timeout_ms = options.connect_timeout_ms;
  wanted.predict = options.predict ? 1 : 0;
  if (options.strategy)
    wanted.strategy =
        static_cast<ivis_strategy>(IVIS_STRATEGY_GUARANTEED + static_cast<int>(*options.strategy));
  wanted.budget_us = static_cast<std::uint32_t>(1e3 * options.budget_ms);
  if (played) {
    const double own = played->horizontal_m_s();
    wanted.pace.horizontal_m_s =
        options.speed_limit_m_s > 0 ? std::min(options.speed_limit_m_s, own) : own;
    wanted.pace.vertical_m_s = played->vertical_m_s();
    wanted.pace.frame_s = 1 / options.fps;
    wanted.pace.turning_rad_s = options.turning_rad_s;
  }
  ivis_client* raw = nullptr;
  char text[512] = "";
  if (const ivis_status s = ivis_client_connect(&wanted, &raw, text, sizeof text); s != IVIS_OK)
    return unanswered(s) ? no_answer(endpoint, text) : error_of(s, text);
  VisibilityClient client(raw);
  const auto info = client.info();
  if (!info) return connection_error("the server at " + endpoint + " has not said what it serves");
  Walker walker(std::move(client), *info, options);
  const Status walked =
      played ? walk_in_real_time(walker, endpoint, *played, options, wanted.pace, context, on_frame)
             : walk_rows(walker, endpoint, path, options, context, on_frame);
  if (!walked) return walked.error();
  return walker.finish();
}

}  // namespace ivis
