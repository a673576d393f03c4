#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/context.h"
#include "core/ids.h"
#include "core/path.h"
#include "core/result.h"
#include "core/strategy.h"

namespace ivis {

struct WalkOptions {
  enum class Policy { kEverything, kStall, kIncomplete };
  Policy policy = Policy::kStall;
  /// Rows a second, a frame each. 0: as fast as answers come: each row waits for its own PVS.
  double hz = 0;
  /// Frames a second of a walk in real time: the path is played by its times, interpolated, and the
  /// observer's fastest speed is told to the server. Where the eye is held the walk waits. Excludes
  /// hz.
  double fps = 0;
  /// With fps: how long, there and back again; 0: once along the path, however long that takes.
  double seconds = 0;
  /// With fps: the fastest horizontal speed, which is told and kept to; 0: the path's own.
  double speed_limit_m_s = 0;
  std::optional<Strategy> strategy;                  ///< none: the server's
  double budget_ms = 0;                              ///< of one solve; 0: the server's
  bool predict = false;                              ///< centre cells where the observer is going
  double turning_rad_s = 0;                          ///< with fps: told, as ivis_pace; 0: not
  std::optional<std::filesystem::path> record_file;  ///< client_lib/record.h
  SceneHash scene_hash = 0;                          ///< 0: the server's
  std::string reach;                                 ///< empty: the server's
  int connect_timeout_ms = 5000;
  int answer_timeout_ms = 10000;  ///< of one pose, at hz = 0
};

/// What a walk is doing, for a live line.
struct WalkProgress {
  std::size_t done = 0;
  std::size_t total = 0;
  std::uint32_t visible = 0;
  double solve_ms = 0;
  double round_trip_ms = 0;
  std::uint64_t bytes = 0;
  std::uint64_t stalls = 0;
  std::uint64_t uncovered_frames = 0;
};

struct WalkReport {
  std::uint64_t poses = 0;
  std::uint64_t answers = 0;  ///< at 60 Hz a pose may be overtaken by the next
  std::uint64_t stalls = 0;
  std::uint64_t uncovered_frames = 0;
  std::uint64_t reconnects = 0;
  double bytes_mean = 0;  ///< a pose, of whole PVS messages, the first full set included
  double bytes_median = 0;
  double round_trip_ms_p50 = 0;
  double round_trip_ms_p99 = 0;
  double solve_ms_p50 = 0;     ///< visibility time at the server
  double overhead_ms_p50 = 0;  ///< round trip less visibility time, pose by pose
  double pvs_median = 0;       ///< objects
  double reach_median = 0;     ///< metres, horizontally, of the cells in use
  double held_m = 0;           ///< by which eyes were held back, summed over frames
  double age_ms_p99 = 0;       ///< of the PVS in use, since its pose
  double margin_m_p01 =
      0;  ///< from covered eyes to the border of their cell: one in a hundred is nearer
  double latency_ms = 0;  ///< L, T and L + T - frame, as ivis_stats
  double interval_ms = 0;
  double hold_ms = 0;
  std::uint64_t frames = 0;
  /// Frames whose eye was outside the cell, by cause; those that were.
  std::vector<std::pair<std::string, std::uint64_t>> causes;
  std::uint32_t objects = 0;
  std::uint32_t epoch = 0;  ///< of the scene at the end: 0 when nobody ever changed it
  std::string reach;
  std::string method;
};

/// Walks a client along a path, a pose a row.
/// Errors:  kConnection when the server is not there, or stays silent for a pose at hz = 0;
/// kMismatch;
///          kIo of the record; kCancelled (nothing is recorded then); kInvalidArgument for an empty
///          path.
/// Threads: reentrant. `on_frame` is called after each row.
Result<WalkReport> walk(const std::string& endpoint, const std::vector<Pose>& path,
                        const WalkOptions& options, const Context& context = {},
                        const std::function<void(const WalkProgress&)>& on_frame = {});

}  // namespace ivis
