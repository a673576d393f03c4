#include "client_lib/client.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <utility>

#include "client_lib/clamp.h"
#include "core/view_cell.h"

using ivis::Vec3;
using ivis::ViewCell;
using ivis::client::IdBits;

namespace {

bool finite(const Vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

double seconds(std::chrono::steady_clock::duration d) {
  return std::chrono::duration<double>(d).count();
}
double milliseconds(std::chrono::steady_clock::duration d) {
  return 1e3 * seconds(d);
}

void put(const Vec3& v, double (&out)[3]) {
  for (int k = 0; k < 3; ++k)
    out[k] = v[k];
}

ivis_object_state told(const ivis::ObjectState& s) {
  ivis_object_state out{};
  out.id = s.id;
  out.removed = s.removed ? 1 : 0;
  out.occluder_off = s.occluder_off ? 1 : 0;
  out.moved = s.moved ? 1 : 0;
  put(s.placement.position, out.position);
  const glm::fquat& q = s.placement.rotation;
  const float rotation[4] = {q.x, q.y, q.z, q.w};
  std::copy(std::begin(rotation), std::end(rotation), out.rotation);
  out.speed_m_s = s.speed_m_s;
  return out;
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

ivis_client::ivis_client(std::unique_ptr<ivis::client::PvsSource> source, Options options)
    : source_(std::move(source)),
      options_(std::move(options)),
      lingering_(options_.linger_frames) {}

void ivis_client::set_pace(const ivis::Pace& pace) {
  options_.pace = pace;
  source_->set_pace(pace);
}

const ivis_client::Sent* ivis_client::sent(std::uint32_t sequence) const {
  const Sent& s = sent_[sequence % sent_.size()];
  return sequence != 0 && s.sequence == sequence ? &s : nullptr;
}

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
  const bool any = source_->receive(answer_);
  if (const auto scenes = source_->stats().scenes; scenes != scenes_) {
    scenes_ = scenes;
    leave_scene();
  }
  if (!any || answer_.sequence == 0) return;
  session_ = source_->stats().reconnects;
  note_changes();
  stats_.last_solve_ms = answer_.solve_ms;
  cell_reach_ = answer_.cell.reach.to_string();
  if (const Sent* s = sent(answer_.sequence))
    stats_.last_round_trip_ms = milliseconds(options_.now() - s->at);
}

/// Nothing that is known of the one before says anything of another.
void ivis_client::leave_scene() {
  ask_again_ = sequence_ != 0;
  all_.clear();
  answer_ = {};
  states_.clear();
  untold_.clear();
  changes_.clear();
  lingering_ = ivis::client::Lingering(options_.linger_frames);
  in_use_ = 0;
  clock_.interrupt();
}

/// The scene of an answer is drawn as soon as the answer is used: at the next view.
void ivis_client::note_changes() {
  std::map<ivis::ObjectId, ivis::ObjectState> before;
  if (answer_.from_the_file) before.swap(states_);
  for (const ivis::ObjectState& s : answer_.changes) {
    before.erase(s.id);
    states_[s.id] = untold_[s.id] = s;
  }
  for (const auto& [id, state] : before)  // is as in the file again
    untold_[id] = {id, false, false, false, {}, 0};
}

bool ivis_client::expired(Time now) const {
  if (answer_.sequence == 0 || answer_.valid_us == 0 || answer_.everything) return false;
  const Sent* s = sent(answer_.sequence);
  return s == nullptr || now - s->at > std::chrono::microseconds(answer_.valid_us);
}

/// Is nothing under way that would bring the scene as it is now?
bool ivis_client::wants_another(Time now) const {
  if (answer_.sequence == 0 || answer_.sequence != sequence_) return false;
  if (source_->epoch() > answer_.epoch || source_->stats().reconnects != session_) return true;
  const Sent* s = sent(answer_.sequence);
  return answer_.valid_us != 0 &&
         (s == nullptr || now - s->at > std::chrono::microseconds(answer_.valid_us / 2));
}

ivis_status ivis_client::edit(std::span<const ivis::Edit> edits, std::uint32_t& request) {
  const auto asked = source_->edit(edits);
  if (!asked) return fail(ivis::client::status_of(asked.error()), asked.error().message);
  request = *asked;
  return IVIS_OK;
}

const char* ivis_client::keep(std::string text) {
  kept_ = std::move(text);
  return kept_.c_str();
}

std::optional<ivis::client::EditResult> ivis_client::edited() {
  take();
  return source_->edited();
}

ivis_status ivis_client::pose(const Vec3& eye) {
  if (!finite(eye)) return fail(IVIS_ERROR_ARGUMENT, "an eye that is not finite");
  take();  // first: the pose acknowledges what has arrived
  const auto hold = std::chrono::ceil<std::chrono::microseconds>(clock_.hold()).count();
  Sent next{sequence_ + 1, options_.now(), eye,
            static_cast<std::uint32_t>(std::clamp<std::int64_t>(hold, 0, UINT32_MAX))};
  const Vec3 centre = eye + (options_.predict ? ahead_of(next) : Vec3{0});
  ++sequence_;
  ++stats_.poses;
  sent_[sequence_ % sent_.size()] = next;
  ivis::client::Request request{sequence_, centre, next.hold_us};
  if (next.way) request.observer = eye;
  source_->send(request);
  return state();
}

/// From the eye to where its cell is centred, if the observer goes on as it went: to the middle of
/// where it may get to by its turning, or, if it told none, of where it would be while the PVS is
/// in use. A leap is no velocity, and of hardly any movement the direction is noise: then cells lie
/// about the eye.
Vec3 ivis_client::ahead_of(Sent& pose) const {
  constexpr double kLeast = 0.05;  // of the fastest told, to be a direction
  constexpr double kMost = 1.5;    // likewise, and of the frame that a direction may be old
  const Sent* before = sent(sequence_);
  const ivis::client::Catalogue* c = source_->catalogue();
  if (before == nullptr || pose.at <= before->at || c == nullptr) return Vec3{0};
  const double passed = seconds(pose.at - before->at);
  const Vec3 moved = pose.eye - before->eye;
  Vec3 ahead{0};
  if (const ivis::Pace& pace = options_.pace; pace.turning_rad_s > 0) {
    const double fastest = std::hypot(pace.horizontal_m_s, pace.vertical_m_s) * passed;
    const double length = glm::length(moved);
    if (!(passed <= kMost * pace.frame_s && length >= kLeast * fastest &&
          length <= kMost * fastest))
      return Vec3{0};
    pose.way = ivis::way_ahead(pace, moved, pose.hold_us * 1e-6);
    if (!pose.way) return Vec3{0};
    ahead = pose.way->direction * pose.way->middle();
  } else {
    ahead = moved / passed * (seconds(clock_.latency() + clock_.hold()) / 2);
  }
  // The eye is in its cell, at least while that is the largest.
  const ViewCell largest{Vec3{0}, c->reaches.back()};
  double part = finite(ahead) && largest.contains(-ahead) ? 1 : 0;
  for (double step = part == 1 ? 0 : 0.5; step > 1e-3; step /= 2)
    if (largest.contains(-ahead * (part + step))) part += step;
  if (part > 0 && finite(pose.eye + ahead * part)) return ahead * part;
  pose.way.reset();
  return Vec3{0};
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
  if (all_.size() != ivis::client::words_for(n)) all_ = ivis::client::all_of(n);
  return all_;
}

ivis_cause ivis_client::why_outside(const Vec3& eye, Time now) const {
  if (answer_.sequence == 0) return IVIS_CAUSE_NO_ANSWER;
  if (expired(now)) return IVIS_CAUSE_EXPIRED;  // whatever else: time is to be held
  if (!source_->connected()) return IVIS_CAUSE_DISCONNECTED;
  const Sent* s = sent(answer_.sequence);
  if (s == nullptr) return IVIS_CAUSE_LATE;
  const ivis::Pace& pace = options_.pace;
  if (!pace.told() || s->hold_us == 0) return IVIS_CAUSE_OTHER;
  const double age_s = seconds(now - s->at);
  const Vec3 moved = eye - s->eye;
  constexpr double kMore = 1.001;
  if (std::hypot(moved.x, moved.z) > pace.horizontal_m_s * age_s * kMore + 1e-3 ||
      std::abs(moved.y) > pace.vertical_m_s * age_s * kMore + 1e-3)
    return IVIS_CAUSE_SPEED;
  const double turned = pace.turning_rad_s * (age_s + pace.frame_s) * kMore;
  if (s->way && turned < std::numbers::pi &&
      glm::dot(moved, s->way->direction) < std::cos(turned) * glm::length(moved) - 1e-3)
    return IVIS_CAUSE_SPEED;
  if (answer_.safe < 1) return IVIS_CAUSE_LADDER;
  return age_s * 1e6 > s->hold_us ? IVIS_CAUSE_LATE : IVIS_CAUSE_OTHER;
}

ivis_status ivis_client::view(const Vec3& eye, ivis_frame& out) {
  take();
  const Time now = options_.now();
  changes_.clear();
  if (finite(eye) && (wants_another(now) || std::exchange(ask_again_, false)))
    static_cast<void>(pose(eye));
  for (const auto& [id, state] : untold_)
    changes_.push_back(told(state));
  untold_.clear();
  out = {};
  put(eye, out.eye);
  ++stats_.frames;
  const ivis::client::Catalogue* catalogue = source_->catalogue();
  const std::uint32_t objects = catalogue != nullptr ? catalogue->objects() : 0;
  const bool has_pvs = answer_.sequence != 0;
  const bool sound = finite(eye);
  const bool fresh = answer_.sequence != in_use_;
  if (const auto sessions = source_->stats().reconnects; sessions != stats_.reconnects) {
    stats_.reconnects = sessions;
    met_ = now;
    clock_.interrupt();  // how long it was away says nothing of how long answers take
  }
  if (fresh) {
    const Sent* s = sent(answer_.sequence);
    if (s != nullptr && s->at >= met_)
      clock_.begins(s->at, now);
    else
      clock_.interrupt();
  } else if (has_pvs) {
    clock_.used(now);
  }
  in_use_ = answer_.sequence;

  // A PVS that lists everything is complete wherever the eye is.
  const bool inside =
      sound && has_pvs && !expired(now) && (answer_.everything || answer_.cell.contains(eye));
  bool covered = inside;
  bool use_pvs = inside;
  if (sound && !inside) {
    out.cause = static_cast<std::uint8_t>(why_outside(eye, now));
    ++stats_.causes[out.cause];
  }
  // What ran out on its way here was never drawn by: what moves is held where it was under another.
  if (fresh) too_late_ = expired(now);
  if (sound && has_pvs && !inside && !too_late_ && options_.policy == IVIS_POLICY_STALL) {
    const Vec3 held = ivis::client::clamp_to_cell(answer_.cell, eye);
    put(held, out.eye);
    out.stalled = 1;
    ++stats_.stalls;
    stats_.held_m += glm::distance(held, eye);
    covered = use_pvs = true;  // clamp_to_cell() promises it; and in time, that movers are held
  }
  if (sound && has_pvs && !inside && options_.policy == IVIS_POLICY_INCOMPLETE) use_pvs = true;
  if (!covered) ++stats_.uncovered_frames;
  // Time went on while nothing held it: holding it later does not bring it back.
  if (has_pvs && out.stalled == 0 && expired(now)) too_late_ = true;

  out.covered = covered ? 1 : 0;
  out.connected = source_->connected() ? 1 : 0;
  out.object_count = objects;
  out.scene_hash = catalogue != nullptr ? catalogue->scene_hash : 0;
  out.cell_reach = cell_reach_.c_str();
  out.safe = 1;
  if (has_pvs) {
    out.sequence = answer_.sequence;
    out.epoch = answer_.epoch;
    put(answer_.cell.eye, out.cell_eye);
    out.safe = answer_.safe;
    if (const Sent* s = sent(answer_.sequence)) out.pvs_age_s = seconds(now - s->at);
    if (inside) out.margin_m = ivis::client::margin_in_cell(answer_.cell, eye);
  } else {
    put(eye, out.cell_eye);
  }
  const IdBits* bits = &answer_.bits;
  std::uint32_t count = answer_.count;
  if (lingering_.active() && has_pvs) {
    bits = &lingering_.draw(answer_.everything ? all_bits() : answer_.bits, fresh);
    count = lingering_.count();
  }
  out.everything = !use_pvs || answer_.everything ? 1 : 0;
  out.visible_count = out.everything != 0 ? objects : count;
  if (out.everything != 0) bits = &all_bits();
  out.visible_bits = objects != 0 ? bits->data() : nullptr;
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
  out.latency_ms = milliseconds(clock_.latency());
  out.interval_ms = milliseconds(clock_.interval());
  out.hold_ms = milliseconds(clock_.hold());
  return out;
}
