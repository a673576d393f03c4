#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/context.h"
#include "core/ids.h"
#include "core/path.h"
#include "core/result.h"

namespace ivis {

struct WalkOptions {
  enum class Policy { kEverything, kStall, kIncomplete };
  Policy policy = Policy::kStall;
  /// Poses a second. 0: as fast as answers come: each row waits for its own PVS before it is drawn.
  double hz = 0;
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
  std::uint32_t objects = 0;
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
