#pragma once
// The part of the client that no network is needed for: policies, the view, what is counted.

#include <array>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client_lib/include/ivis/ivis.h"
#include "client_lib/lingering.h"
#include "client_lib/source.h"
#include "client_lib/visibility_clock.h"
#include "core/way_ahead.h"

/// Behind the C interface. Threads: one at a time.
struct ivis_client {
 public:
  using Time = std::chrono::steady_clock::time_point;
  struct Options {
    ivis_policy policy = IVIS_POLICY_EVERYTHING;
    ivis::Pace pace;  ///< told to the source by who made it
    bool predict = false;
    std::uint32_t linger_frames = 0;
    /// For tests, of time that passes as they say. Monotonic.
    std::function<Time()> now = std::chrono::steady_clock::now;
  };
  ivis_client(std::unique_ptr<ivis::client::PvsSource> source, Options options);

  ivis_status pose(const ivis::Vec3& eye);
  ivis_status wait(std::chrono::milliseconds timeout);
  ivis_status view(const ivis::Vec3& eye, ivis_frame& out);
  /// Waits for the catalogue.
  ivis_status meet(std::chrono::milliseconds timeout);
  ivis_status fail(ivis_status status, std::string text);
  void set_policy(ivis_policy policy) { options_.policy = policy; }
  void set_pace(const ivis::Pace& pace);

  ivis_status edit(std::span<const ivis::Edit> edits, std::uint32_t& request);
  std::optional<ivis::client::EditResult> edited();
  /// What changed with the last view.
  const std::vector<ivis_object_state>& changes() const { return changes_; }
  /// A text for the caller, until the next.
  const char* keep(std::string text);

  const ivis::client::PvsSource& source() const { return *source_; }
  const std::string& error() const { return error_; }
  ivis_stats stats() const;

 private:
  void take();
  ivis_status state();
  const ivis::client::IdBits& all_bits();
  ivis_cause why_outside(const ivis::Vec3& eye, Time now) const;
  void note_changes();
  void leave_scene();
  bool expired(Time now) const;
  bool wants_another(Time now) const;

  struct Sent {
    std::uint32_t sequence = 0;
    Time at;
    ivis::Vec3 eye{0};
    std::uint32_t hold_us = 0;
    std::optional<ivis::WayAhead> way{};  ///< that its cell was centred by
  };
  const Sent* sent(std::uint32_t sequence) const;
  ivis::Vec3 ahead_of(Sent& pose) const;

  std::unique_ptr<ivis::client::PvsSource> source_;
  Options options_;
  ivis::client::VisibilityClock clock_;
  ivis::client::Lingering lingering_;
  std::uint32_t in_use_ = 0;  ///< sequence of the answer that the last view took
  std::string cell_reach_;
  Time met_{};  ///< when the present session was first noticed
  ivis::client::Answer answer_;
  std::uint64_t session_ = 0;  ///< SourceStats::reconnects when answer_ came
  bool ask_again_ = false;     ///< the next view poses, as what was answered is of another scene
  bool too_late_ = false;      ///< answer_ had expired when it was first looked at
  std::uint64_t scenes_ = 0;   ///< SourceStats::scenes when last looked at
  std::map<ivis::ObjectId, ivis::ObjectState> states_;  ///< of objects not as in the file
  std::map<ivis::ObjectId, ivis::ObjectState> untold_;  ///< changes since the last view
  std::vector<ivis_object_state> changes_;
  std::string kept_;
  ivis::client::IdBits all_;
  std::uint32_t sequence_ = 0;
  std::array<Sent, 256> sent_{};  ///< by sequence, to time round trips
  ivis_stats stats_{};
  std::string error_;
};

namespace ivis::client {

ivis_status status_of(const Error& error);
/// Puts `text` into a caller's buffer, cut to fit; either may be null or 0.
void copy_text(const std::string& text, char* buffer, std::size_t size);

}  // namespace ivis::client

/// For ivis_local only, which brings its own source: takes ownership of an ivis::client::PvsSource.
/// Not part of the ABI: both libraries must be of the same build.
extern "C" IVIS_API ivis_client* ivis_client_adopt_source_(void* pvs_source, ivis_policy policy);
