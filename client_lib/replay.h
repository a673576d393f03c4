#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client_lib/record.h"
#include "core/context.h"
#include "core/strategy.h"

namespace ivis {

struct ReplayOptions {
  int connect_timeout_ms = 5000;
  int answer_timeout_ms = 10000;  ///< of one pose
  std::size_t most_listed = 20;
  std::optional<Strategy> strategy;  ///< as the walk wished; none: the server's
  double budget_ms = 0;
};

/// An answer that is not the recorded one.
struct ReplayDifference {
  std::size_t frame = 0;    ///< of the record, from 0
  std::size_t missing = 0;  ///< objects recorded and not answered
  std::size_t extra = 0;    ///< answered and not recorded
};

struct ReplayReport {
  std::size_t poses = 0;       ///< asked again
  std::size_t same = 0;        ///< answered as recorded
  std::size_t other_cell = 0;  ///< answered for a cell of another reach: not compared
  std::size_t different = 0;
  std::vector<ReplayDifference> differences;  ///< the first
};

/// Asks a server again for every PVS of a record, for the same cell each, and compares the sets.
/// Frames that showed everything for want of a PVS are passed over.
/// Errors:  kConnection when the server is not there or stays silent; kMismatch if its scene is
///          another; kInput for a record without a PVS; kCancelled.
/// Threads: reentrant.
Result<ReplayReport> replay(const std::string& endpoint, const client::Record& record,
                            const ReplayOptions& options = {}, const Context& context = {});

}  // namespace ivis
