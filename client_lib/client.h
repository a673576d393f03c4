#pragma once
// The part of the client that no network is needed for: policies, the view, what is counted.

#include <array>
#include <chrono>
#include <memory>
#include <string>

#include "client_lib/include/ivis/ivis.h"
#include "client_lib/source.h"

/// Behind the C interface. Threads: one at a time.
struct ivis_client {
 public:
  ivis_client(std::unique_ptr<ivis::client::PvsSource> source, ivis_policy policy);

  ivis_status pose(const ivis::Vec3& eye);
  ivis_status wait(std::chrono::milliseconds timeout);
  ivis_status view(const ivis::Vec3& eye, ivis_frame& out);
  /// Waits for the catalogue.
  ivis_status meet(std::chrono::milliseconds timeout);
  ivis_status fail(ivis_status status, std::string text);

  const ivis::client::PvsSource& source() const { return *source_; }
  const std::string& error() const { return error_; }
  ivis_stats stats() const;

 private:
  void take();
  ivis_status state();
  const ivis::client::IdBits& all_bits();

  struct Sent {
    std::uint32_t sequence = 0;
    std::chrono::steady_clock::time_point at;
  };
  std::unique_ptr<ivis::client::PvsSource> source_;
  ivis_policy policy_;
  ivis::client::Answer answer_;
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
