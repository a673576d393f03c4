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

client::RecordedFrame recorded(const PvsView& view, const Reach& reach, SceneHash hash) {
  client::RecordedFrame f;
  f.eye = vec(view.eye());
  f.covered = view.covered();
  f.everything = view.everything();
  f.pvs.cell = {vec(view.raw().cell_eye), reach};
  f.pvs.scene_hash = hash;
  if (f.everything) return f;
  f.pvs.objects.reserve(view.count());
  for (std::uint32_t w = 0; w * 64 < view.object_count(); ++w)
    for (std::uint64_t left = view.raw().visible_bits[w]; left != 0; left &= left - 1)
      f.pvs.objects.push_back(w * 64 + static_cast<std::uint32_t>(std::countr_zero(left)));
  return f;
}

struct Samples {
  std::vector<double> bytes, round_trip_ms, solve_ms, overhead_ms, visible;
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
  r.objects = info.object_count;
  r.reach = info.reach;
  r.method = info.method;
  return r;
}

}  // namespace

Result<WalkReport> walk(const std::string& endpoint, const std::vector<Pose>& path,
                        const WalkOptions& options, const Context& context,
                        const std::function<void(const WalkProgress&)>& on_frame) {
  if (path.empty()) return invalid_argument("a walk along an empty path");
  if (!(options.hz >= 0 && options.hz <= 1000))
    return invalid_argument("hz " + std::to_string(options.hz) + ", expected 0 to 1000");
  ivis_client_options wanted = ivis_client_options_default();
  wanted.endpoint = endpoint.c_str();
  wanted.scene_hash = options.scene_hash;
  wanted.reach = options.reach.empty() ? nullptr : options.reach.c_str();
  wanted.policy = policy_of(options.policy);
  wanted.connect_timeout_ms = options.connect_timeout_ms;
  ivis_client* raw = nullptr;
  char text[512] = "";
  if (const ivis_status s = ivis_client_connect(&wanted, &raw, text, sizeof text); s != IVIS_OK)
    return unanswered(s) ? no_answer(endpoint, text) : error_of(s, text);
  VisibilityClient client(raw);
  auto info = client.info();
  if (!info) return connection_error("the server at " + endpoint + " has not said what it serves");

  client::Record record;
  record.scene_hash = info->scene_hash;
  record.objects = info->object_count;
  if (auto reach = Reach::parse(info->reach)) record.reach = *reach;
  const auto period = options.hz > 0 ? std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(1 / options.hz))
                                     : Clock::duration::zero();
  Samples samples;
  ivis_stats before{};
  auto next = Clock::now();
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (context.stopped()) return cancelled();
    const double eye[3]{path[i].eye.x, path[i].eye.y, path[i].eye.z};
    std::optional<PvsView> view;
    if (options.hz == 0) {
      static_cast<void>(client.pose(eye));
      if (const ivis_status s = client.wait(options.answer_timeout_ms); s != IVIS_OK)
        return unanswered(s) ? no_answer(endpoint, client.error()) : error_of(s, client.error());
      view = client.view(eye);
    } else {
      std::this_thread::sleep_until(next);
      next += period;
      view = client.frame(eye);
    }
    if (client.status() != IVIS_OK) return error_of(client.status(), client.error());
    const ivis_stats stats = client.stats();
    samples.bytes.push_back(static_cast<double>(stats.bytes - before.bytes));
    samples.visible.push_back(view->count());
    if (stats.answers != before.answers) {
      samples.round_trip_ms.push_back(stats.last_round_trip_ms);
      samples.solve_ms.push_back(stats.last_solve_ms);
      samples.overhead_ms.push_back(stats.last_round_trip_ms - stats.last_solve_ms);
    }
    if (stats.reconnects != before.reconnects && options.record_file)
      if (const auto now = client.info(); now && record.reach.to_string() != now->reach)
        return mismatch("the server came back with the reach " + std::string(now->reach) +
                        ", the record is of " + record.reach.to_string());
    before = stats;
    if (options.record_file)
      record.frames.push_back(recorded(*view, record.reach, record.scene_hash));
    context.report("walking", i + 1, path.size());
    if (on_frame)
      on_frame({i + 1, path.size(), view->count(), stats.last_solve_ms, stats.last_round_trip_ms,
                stats.bytes, stats.stalls, stats.uncovered_frames});
  }
  if (options.record_file)
    if (auto written = client::write_record(*options.record_file, record); !written)
      return written.error();
  info = client.info();
  return summary(samples, client.stats(), *info);
}

}  // namespace ivis
