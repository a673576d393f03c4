// Encoding and decoding a PVS of a street walk: 100,000 objects, some 1,750 of them listed, a sixth
// of those changing a pose. Reports bytes a pose, their ratio to raw 32-bit ids, and a hash of all
// sets and payloads, so that a fast wrong answer shows.

#include <bit>
#include <cstdint>
#include <cstdio>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include "wire/messages.h"
#include "wire/pvs_codec.h"

namespace ivis::wire {
namespace {

constexpr std::uint32_t kObjects = 100000;
constexpr int kPoses = 300;
constexpr std::size_t kRuns = 150;

/// Runs of neighbours in rank that come, shift and go.
std::vector<RankSet> street_walk() {
  std::uint64_t state = 1;
  const auto below = [&](std::uint32_t n) {
    std::uint64_t z = (state += 0x9e3779b97f4a7c15U);
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    return static_cast<std::uint32_t>(((z ^ (z >> 31U)) >> 32U) * n >> 32U);
  };
  std::vector<std::pair<Rank, std::uint32_t>> runs(kRuns);
  const auto renew = [&](auto& run) { run = {below(kObjects - 64), 2 + below(22)}; };
  for (auto& run : runs)
    renew(run);
  std::vector<RankSet> walk;
  for (int i = 0; i < kPoses; ++i) {
    RankSet set(kObjects);
    for (auto& run : runs) {
      if (below(14) == 0) renew(run);
      if (below(3) == 0) run.first += below(2);
      for (Rank r = run.first; r < run.first + run.second; ++r)
        if (r % 11 != 3) set.set(r);
    }
    walk.push_back(std::move(set));
  }
  return walk;
}

struct Coded {
  std::vector<RankSet> sets;
  std::vector<PvsState> bases;  ///< bases[i] is what sets[i] is coded against
  std::vector<std::vector<std::byte>> payloads;
  double payload_bytes = 0, message_bytes = 0, raw_bytes = 0, changed = 0;
  std::uint64_t hash = 0;
};

const Coded& coded() {
  static const Coded all = [] {
    Coded c;
    c.sets = street_walk();
    const auto n = static_cast<double>(c.sets.size());
    PvsState state(c.sets[0].size);
    for (std::size_t i = 0; i < c.sets.size(); ++i) {
      c.bases.push_back(state);
      for (std::size_t w = 0; w < state.set.words.size(); ++w) {
        c.changed += std::popcount(state.set.words[w] ^ c.sets[i].words[w]) / n;
        c.hash = (c.hash ^ c.sets[i].words[w]) * 0x9e3779b97f4a7c15U;
      }
      PvsMessage m;
      m.session = ~std::uint64_t{0};
      m.payload = encode_pvs(c.sets[i], state, state);
      for (const std::byte b : m.payload)
        c.hash = (c.hash ^ std::to_integer<std::uint64_t>(b)) * 0x9e3779b97f4a7c15U;
      c.payload_bytes += static_cast<double>(m.payload.size()) / n;
      c.message_bytes += static_cast<double>(encode(m).size()) / n;
      c.raw_bytes += 4.0 * static_cast<double>(c.sets[i].count()) / n;
      c.payloads.push_back(std::move(m.payload));
    }
    return c;
  }();
  return all;
}

void report(benchmark::State& state) {
  const Coded& c = coded();
  char hash[32];
  std::snprintf(hash, sizeof hash, "hash %016llx", static_cast<unsigned long long>(c.hash));
  state.SetLabel(hash);
  state.counters["listed"] = c.raw_bytes / 4;
  state.counters["changed"] = c.changed;
  state.counters["payload_B"] = c.payload_bytes;
  state.counters["message_B"] = c.message_bytes;
  state.counters["raw_ratio"] = c.raw_bytes / c.message_bytes;
}

void BM_EncodePvs(benchmark::State& state) {
  const Coded& c = coded();
  std::size_t i = 0;
  for (auto _ : state) {
    PvsState after;
    benchmark::DoNotOptimize(encode_pvs(c.sets[i], c.bases[i], after));
    benchmark::DoNotOptimize(after);
    i = (i + 1) % c.sets.size();
  }
  report(state);
}
BENCHMARK(BM_EncodePvs)->Unit(benchmark::kMicrosecond);

void BM_DecodePvs(benchmark::State& state) {
  const Coded& c = coded();
  std::size_t i = 0;
  for (auto _ : state) {
    auto after = decode_pvs(c.payloads[i], c.bases[i]);
    if (!after || after->set != c.sets[i]) state.SkipWithError("decoded another set");
    i = (i + 1) % c.sets.size();
  }
  report(state);
}
BENCHMARK(BM_DecodePvs)->Unit(benchmark::kMicrosecond);

void BM_EncodeAndDecodePvsMessage(benchmark::State& state) {
  const Coded& c = coded();
  std::size_t i = 0;
  for (auto _ : state) {
    PvsState after;
    PvsMessage m;
    m.payload = encode_pvs(c.sets[i], c.bases[i], after);
    const auto received = decode(encode(m));
    const auto decoded = decode_pvs(std::get<PvsMessage>(*received).payload, c.bases[i]);
    if (!decoded || decoded->set != c.sets[i]) state.SkipWithError("decoded another set");
    i = (i + 1) % c.sets.size();
  }
  report(state);
}
BENCHMARK(BM_EncodeAndDecodePvsMessage)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace ivis::wire

BENCHMARK_MAIN();
