#include "client_lib/client.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "client_lib/clamp.h"

using ivis::Vec3;
using ivis::client::IdBits;

namespace {

bool finite(const Vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void put(const Vec3& v, double (&out)[3]) {
  for (int k = 0; k < 3; ++k)
    out[k] = v[k];
}

}  // namespace

namespace ivis::client {

ivis_status status_of(const Error& error) {
  switch (error.code) {
    case ErrorCode::kInvalidArgument:
      return IVIS_ERROR_ARGUMENT;
    case ErrorCode::kInput:
    case ErrorCode::kUnsupported:
      return IVIS_ERROR_INPUT;
    case ErrorCode::kIo:
      return IVIS_ERROR_IO;
    case ErrorCode::kMismatch:
      return IVIS_ERROR_MISMATCH;
    case ErrorCode::kConnection:
    case ErrorCode::kCancelled:
      return IVIS_ERROR_CONNECTION;
  }
  return IVIS_ERROR_CONNECTION;
}

void copy_text(const std::string& text, char* buffer, std::size_t size) {
  if (buffer == nullptr || size == 0) return;
  const std::size_t n = std::min(size - 1, text.size());
  std::memcpy(buffer, text.data(), n);
  buffer[n] = '\0';
}

Status check_catalogue(const Catalogue& c) {
  if (c.node.size() != c.instance.size())
    return input_error("object table: " + std::to_string(c.node.size()) + " nodes, " +
                       std::to_string(c.instance.size()) + " instances");
  if (!c.cluster.empty() && c.cluster.size() != c.node.size())
    return input_error("object table: " + std::to_string(c.node.size()) + " nodes, " +
                       std::to_string(c.cluster.size()) + " clusters");
  for (std::uint32_t i = 0; i < c.objects(); ++i) {
    bool sound = c.cluster_of(i) == 0;
    if (i > 0) {
      const std::pair before(c.node[i - 1], c.instance[i - 1]);
      const std::pair here(c.node[i], c.instance[i]);
      sound = before < here ? sound
                            : before == here && c.cluster_of(i) != 0 &&
                                  c.cluster_of(i) - 1 == c.cluster_of(i - 1);
    }
    if (!sound)
      return input_error("object table: object " + std::to_string(i) + " is out of order");
  }
  return ok();
}

}  // namespace ivis::client

ivis_client::ivis_client(std::unique_ptr<ivis::client::PvsSource> source, ivis_policy policy)
    : source_(std::move(source)), policy_(policy) {}

ivis_status ivis_client::fail(ivis_status status, std::string text) {
  error_ = std::move(text);
  return status;
}

ivis_status ivis_client::state() {
  if (const ivis::Error* e = source_->failure())
    return fail(ivis::client::status_of(*e), e->message);
  error_ = source_->trouble();
  return IVIS_OK;
}

void ivis_client::take() {
  if (!source_->receive(answer_)) return;
  stats_.last_solve_ms = answer_.solve_ms;
  const Sent& sent = sent_[answer_.sequence % sent_.size()];
  if (sent.sequence == answer_.sequence)
    stats_.last_round_trip_ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - sent.at)
            .count();
}

ivis_status ivis_client::pose(const Vec3& eye) {
  if (!finite(eye)) return fail(IVIS_ERROR_ARGUMENT, "an eye that is not finite");
  take();  // first: the pose acknowledges what has arrived
  ++sequence_;
  ++stats_.poses;
  sent_[sequence_ % sent_.size()] = {sequence_, std::chrono::steady_clock::now()};
  source_->send(sequence_, eye);
  return state();
}

ivis_status ivis_client::wait(std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (true) {
    take();
    if (source_->failure() != nullptr) return state();
    if (answer_.sequence == sequence_) return state();
    if (std::chrono::steady_clock::now() >= deadline) {
      const std::string why = source_->trouble();
      return fail(IVIS_ERROR_TIMEOUT, "no PVS for pose " + std::to_string(sequence_) + " within " +
                                          std::to_string(timeout.count()) + " ms" +
                                          (why.empty() ? "" : ": " + why));
    }
    source_->wait(deadline);
  }
}

ivis_status ivis_client::meet(std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (true) {
    take();
    if (source_->failure() != nullptr) return state();
    if (source_->catalogue() != nullptr) return state();
    if (std::chrono::steady_clock::now() >= deadline)
      return fail(IVIS_ERROR_CONNECTION, "no answer within " + std::to_string(timeout.count()) +
                                             " ms: " + source_->trouble());
    source_->wait(deadline);
  }
}

const IdBits& ivis_client::all_bits() {
  const std::uint32_t n = source_->catalogue() != nullptr ? source_->catalogue()->objects() : 0;
  if (all_.size() != ivis::client::words_for(n)) {
    all_.assign(ivis::client::words_for(n), ~std::uint64_t{0});
    if (n % 64 != 0) all_.back() = (std::uint64_t{1} << (n % 64)) - 1;
  }
  return all_;
}

ivis_status ivis_client::view(const Vec3& eye, ivis_frame& out) {
  take();
  out = {};
  put(eye, out.eye);
  ++stats_.frames;
  const ivis::client::Catalogue* catalogue = source_->catalogue();
  const std::uint32_t objects = catalogue != nullptr ? catalogue->objects() : 0;
  const bool has_pvs = answer_.sequence != 0;
  const bool sound = finite(eye);

  // A PVS that lists everything is complete wherever the eye is.
  bool covered = sound && has_pvs && (answer_.everything || answer_.cell.contains(eye));
  bool use_pvs = covered;
  if (sound && has_pvs && !covered && policy_ == IVIS_POLICY_STALL) {
    put(ivis::client::clamp_to_cell(answer_.cell, eye), out.eye);
    out.stalled = 1;
    ++stats_.stalls;
    covered = use_pvs = true;  // clamp_to_cell() promises it
  }
  if (sound && has_pvs && !covered && policy_ == IVIS_POLICY_INCOMPLETE) use_pvs = true;
  if (!covered) ++stats_.uncovered_frames;

  out.covered = covered ? 1 : 0;
  out.connected = source_->connected() ? 1 : 0;
  out.object_count = objects;
  if (has_pvs) {
    out.sequence = answer_.sequence;
    put(answer_.cell.eye, out.cell_eye);
  } else {
    put(eye, out.cell_eye);
  }
  out.everything = !use_pvs || answer_.everything ? 1 : 0;
  out.visible_count = out.everything != 0 ? objects : answer_.count;
  const IdBits& bits = out.everything != 0 ? all_bits() : answer_.bits;
  out.visible_bits = objects != 0 ? bits.data() : nullptr;
  if (!sound) return fail(IVIS_ERROR_ARGUMENT, "an eye that is not finite");
  return state();
}

ivis_stats ivis_client::stats() const {
  ivis_stats out = stats_;
  const ivis::client::SourceStats s = source_->stats();
  out.answers = s.answers;
  out.bytes = s.bytes;
  out.reconnects = s.reconnects;
  out.bad_messages = s.bad_messages;
  return out;
}
