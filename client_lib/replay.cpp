#include "client_lib/replay.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

#include "client_lib/network_source.h"

namespace ivis {
namespace {

using Clock = std::chrono::steady_clock;

std::size_t count(const client::IdBits& a, const client::IdBits& without) {
  std::size_t n = 0;
  for (std::size_t w = 0; w < a.size(); ++w)
    n += static_cast<std::size_t>(std::popcount(a[w] & ~(w < without.size() ? without[w] : 0)));
  return n;
}

Error silent(const std::string& endpoint, const client::PvsSource& source,
             const std::string& what) {
  const std::string why = source.trouble();
  return connection_error(endpoint + ": " + what + (why.empty() ? "" : ": " + why));
}

/// Waits until `done` says so.
template <class Done>
Status wait_for(client::PvsSource& source, int timeout_ms, const std::string& endpoint,
                const std::string& what, const Context& context, Done&& done) {
  const auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  while (!done()) {
    if (context.stopped()) return cancelled();
    if (source.failure() != nullptr) return *source.failure();
    if (Clock::now() >= deadline) return silent(endpoint, source, what);
    source.wait(std::min(deadline, Clock::now() + std::chrono::milliseconds(100)));
  }
  return ok();
}

}  // namespace

Result<ReplayReport> replay(const std::string& endpoint, const client::Record& record,
                            const ReplayOptions& options, const Context& context) {
  client::NetworkOptions network;
  network.endpoint = endpoint;
  network.scene_hash = record.scene_hash;
  network.strategy = options.strategy;
  network.budget_us = static_cast<std::uint32_t>(1e3 * std::clamp(options.budget_ms, 0.0, 1e6));
  const auto wanted = [](const client::RecordedFrame& f) {
    return f.sequence != 0 && (f.covered || !f.everything);
  };
  bool one_reach = true;
  bool any = false;
  for (const client::RecordedFrame& f : record.frames) {
    any = any || wanted(f);
    one_reach = one_reach && (!wanted(f) || f.cell.reach == record.reach);
  }
  for (const client::RecordedFrame& f : record.frames)
    if (!f.edits.empty())
      return input_error(
          "the record is of a scene that was changed on the way, which cannot be replayed");
  if (!any) return input_error("the record holds no PVS, so there is nothing to replay");
  // Cells of one reach were asked for by name, or are the largest, which serve that. Of several the
  // server chooses again: a metre a second for as many seconds as the reach has metres.
  if (one_reach)
    network.reach = record.reach.to_string();
  else
    network.pace = {1, 0, 0};
  auto opened = client::NetworkSource::open(network);
  if (!opened) return opened.error();
  client::NetworkSource& source = **opened;
  client::Answer answer;
  auto met = wait_for(source, options.connect_timeout_ms, endpoint, "no answer", context, [&] {
    static_cast<void>(source.receive(answer));
    return source.catalogue() != nullptr;
  });
  if (!met) return met.error();
  if (source.catalogue()->objects() != record.objects)
    return mismatch("the server has " + std::to_string(source.catalogue()->objects()) +
                    " objects, the record is of " + std::to_string(record.objects));

  ReplayReport report;
  client::RecordedSets sets(record);
  std::uint32_t sequence = 0;
  std::uint32_t last = 0;
  for (std::size_t i = 0; i < record.frames.size(); ++i) {
    const client::RecordedFrame& f = record.frames[i];
    if (!wanted(f) || f.sequence == last) continue;
    last = f.sequence;
    const Vec3 e = f.cell.reach.half_extents();
    const double hold_us = std::floor(1e6 * std::min(e.x, e.z));
    source.send(
        {++sequence, f.cell.eye, static_cast<std::uint32_t>(std::clamp(hold_us, 1.0, 4e9))});
    auto answered = wait_for(source, options.answer_timeout_ms, endpoint,
                             "no PVS for frame " + std::to_string(i), context,
                             [&] { return source.receive(answer) && answer.sequence == sequence; });
    if (!answered) return answered.error();
    ++report.poses;
    context.report("replaying", i + 1, record.frames.size());
    if (!(answer.cell.reach == f.cell.reach)) {
      ++report.other_cell;
      continue;
    }
    client::IdBits recorded(client::words_for(record.objects));
    for (const ObjectId id : sets.at(i).objects)
      client::set_bit(recorded, id);
    if (answer.everything) answer.bits = client::all_of(record.objects);
    const ReplayDifference d{i, count(recorded, answer.bits), count(answer.bits, recorded)};
    if (d.missing == 0 && d.extra == 0) {
      ++report.same;
      continue;
    }
    ++report.different;
    if (report.differences.size() < options.most_listed) report.differences.push_back(d);
  }
  context.report("replaying", record.frames.size(), record.frames.size());
  return report;
}

}  // namespace ivis
