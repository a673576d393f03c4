#include "server/session.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include "core/view_cell.h"

namespace ivis::server {
namespace {

/// A PVS is taken to be in use at least for so long, lest a client that claims less be always
/// first.
constexpr auto kLeastHold = std::chrono::milliseconds(2);
/// A client that has said nothing for so long may be waiting.
constexpr auto kIdle = std::chrono::milliseconds(60);
/// A PVS of a scene in which something moves by itself is valid for so much longer than a client
/// says it uses one for, within the bounds that follow.
constexpr int kHolds = 3;
constexpr auto kShortestValid = std::chrono::milliseconds(100);
constexpr auto kLongestValid = std::chrono::milliseconds(1000);
/// Answers that SessionTable::passed_over_ looks back on.
constexpr double kLookBack = 256;
constexpr std::uint32_t kMostPassedOver = 8;

SessionTable::Time::duration frame_of(const Pace& pace) {
  return std::chrono::duration_cast<SessionTable::Time::duration>(
      std::chrono::duration<double>(pace.frame_s));
}

bool finite(const Vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Unpredictable, so that a restarted server does not know the sessions of the one before it.
std::mt19937_64 seeded() {
  std::random_device device;
  std::seed_seq seed{device(), device(), device(), device()};
  return std::mt19937_64(seed);
}

/// What may make a client's scene another one.
std::string why_another(const ServedScene& scene, SceneHash hash) {
  if (scene.whole_hash == scene.hash)
    return ": another file, or one that the client splits into clusters (granularity cluster) and "
           "the server does not";
  if (hash == scene.whole_hash)
    return ": the same file, which the server splits into clusters (granularity cluster) and the "
           "client does not";
  return ": another file than the server's, which is split into clusters (granularity cluster)";
}

}  // namespace

SessionTable::SessionTable(const ServedScene& scene, const Ladder& ladder, SessionLimits limits,
                           const CostModel& cost, SceneState* state)
    : scene_(&scene),
      ladder_(&ladder),
      limits_(limits),
      cost_(cost),
      state_(state),
      ids_(seeded()) {}

std::optional<Outgoing> SessionTable::receive(std::string_view peer,
                                              std::span<const std::byte> bytes, Time now) {
  auto message = wire::decode(bytes);
  if (!message) {
    ++counters_.malformed;
    return refuse(peer, 0, wire::Refusal::kMalformed, message.error().message);
  }
  if (const auto* pose = std::get_if<wire::PoseMessage>(&*message)) return handle(peer, *pose, now);
  if (const auto* hello = std::get_if<wire::Hello>(&*message)) return handle(peer, *hello, now);
  if (const auto* pace = std::get_if<wire::PaceMessage>(&*message)) return handle(peer, *pace, now);
  if (const auto* edit = std::get_if<wire::EditMessage>(&*message)) return handle(peer, *edit, now);
  if (const auto* bye = std::get_if<wire::Bye>(&*message)) return handle(peer, *bye);
  ++counters_.malformed;
  return refuse(peer, 0, wire::Refusal::kMalformed, "a message that only a server sends");
}

std::optional<Outgoing> SessionTable::handle(std::string_view peer, const wire::Hello& hello,
                                             Time now) {
  const auto known = sessions_.find(std::string(peer));
  // A new Hello ends whatever session the peer had, answered well or not.
  const auto turn_away = [&](wire::Refusal reason, std::string text) {
    forget(peer);
    return refuse(peer, 0, reason, std::move(text));
  };
  if (hello.version != wire::kProtocolVersion)
    return turn_away(wire::Refusal::kVersion, "the client speaks version " +
                                                  std::to_string(hello.version) + ", the server " +
                                                  std::to_string(wire::kProtocolVersion));
  if (hello.scene_hash != 0 && hello.scene_hash != scene_->hash)
    return turn_away(wire::Refusal::kScene, "the client's scene has the hash " +
                                                to_hex(hello.scene_hash) + ", the server's " +
                                                to_hex(scene_->hash) +
                                                why_another(*scene_, hello.scene_hash));
  Session session;
  session.pace = hello.pace;
  session.effort = cost_.effort(hello.strategy.value_or(limits_.strategy),
                                hello.budget_us > 0 ? hello.budget_us / 1000.0 : limits_.budget_ms);
  if (!hello.reach.empty()) {
    const auto wanted = Reach::parse(hello.reach);
    if (!wanted) return turn_away(wire::Refusal::kReach, wanted.error().message);
    if (!serves(ladder_->largest(), ladder_->slack_m(), *wanted))
      return turn_away(wire::Refusal::kReach, "the client wants " + wanted->to_string() +
                                                  ", the server's occluders serve up to " +
                                                  ladder_->largest().to_string());
    session.reach = *wanted;
  }
  if (known == sessions_.end() && sessions_.size() >= limits_.max_sessions)
    return refuse(
        peer, 0, wire::Refusal::kBusy,
        std::to_string(limits_.max_sessions) + " clients are connected, no more are taken");
  do
    session.id = ids_();
  while (session.id == 0);
  session.heard = now;
  session.due = now;
  session.welcome_due = true;
  session.table_wanted = hello.want_table;
  noticed_epoch_ = 0;  // nor has it been told
  forget(peer);
  enqueue(*sessions_.emplace(peer, std::move(session)).first);
  return std::nullopt;
}

std::optional<Outgoing> SessionTable::handle(std::string_view peer, const wire::PoseMessage& pose,
                                             Time now) {
  const auto found = sessions_.find(std::string(peer));
  if (found == sessions_.end() || found->second.id != pose.session)
    return refuse_unknown(peer, pose.session);
  Session& session = found->second;
  session.heard = now;
  if (!finite(pose.eye) || !finite(pose.observer.value_or(pose.eye)) || pose.sequence == 0) {
    ++counters_.malformed;
    forget(peer);
    return refuse(
        peer, pose.session, wire::Refusal::kMalformed,
        pose.sequence == 0 ? "a pose with sequence 0" : "an eye or observer that is not finite");
  }
  if (pose.sequence <= session.last_sequence) return std::nullopt;  // none is answered twice
  session.last_sequence = pose.sequence;
  ++counters_.poses;
  if (session.pose) {
    ++counters_.superseded;
    ++session.passed_over;
  }
  session.pose = pose;
  session.posed = now;
  enqueue(*found);
  return std::nullopt;
}

std::optional<Outgoing> SessionTable::handle(std::string_view peer, const wire::PaceMessage& pace,
                                             Time now) {
  Session* const session = find(peer, pace.session);
  if (session == nullptr) return refuse_unknown(peer, pace.session);
  session->heard = now;
  session->pace = pace.pace;
  return std::nullopt;
}

std::optional<Outgoing> SessionTable::handle(std::string_view peer, const wire::EditMessage& edit,
                                             Time now) {
  Session* const session = find(peer, edit.session);
  if (session == nullptr) return refuse_unknown(peer, edit.session);
  session->heard = now;
  SceneState::Outcome outcome;
  if (!limits_.edits)
    outcome.why = "this server takes no edits (ivisd --edits on)";
  else if (state_ == nullptr || ladder_->largest_index() == nullptr ||
           !ladder_->largest_method().takes_amendments())
    outcome.why = "the method " + ladder_->largest_method().traits().name + " takes no edits";
  else
    outcome = apply(edit, now);
  if (outcome.epoch != 0)
    counters_.edits += edit.edits.size();
  else
    ++counters_.edits_refused;
  return Outgoing{std::string(peer), wire::encode(wire::EditedMessage{edit.session, edit.request,
                                                                      outcome.epoch, outcome.why})};
}

SceneState::Outcome SessionTable::apply(const wire::EditMessage& edit, Time now) {
  try {
    return state_->apply(edit.edits, now);
  } catch (const std::bad_alloc&) {
    return {0, state_->torn() ? SceneState::kTorn : "the server is out of memory"};
  }
}

std::vector<Outgoing> SessionTable::notices(Time now) {
  std::vector<Outgoing> out;
  if (state_ == nullptr || noticed_epoch_ == state_->epoch()) return out;
  const std::uint32_t epoch = state_->epoch();
  bool all = true;
  for (auto& [peer, session] : sessions_) {
    if (session.told_epoch == epoch || session.welcome_due) continue;
    // Who asks all the time is told with the next answer.
    if (session.pose || session.under_way || now - session.posed < kIdle) {
      all = false;
      continue;
    }
    session.told_epoch = epoch;
    out.push_back({peer, wire::encode(wire::NoticeMessage{session.id, epoch})});
  }
  if (all) noticed_epoch_ = epoch;
  return out;
}

std::optional<Outgoing> SessionTable::handle(std::string_view peer, const wire::Bye& bye) {
  if (find(peer, bye.session) != nullptr) forget(peer);
  return std::nullopt;
}

SessionTable::Session* SessionTable::find(std::string_view peer, std::uint64_t id) {
  const auto found = sessions_.find(std::string(peer));
  return found != sessions_.end() && found->second.id == id ? &found->second : nullptr;
}

Outgoing SessionTable::refuse_unknown(std::string_view peer, std::uint64_t session) {
  return refuse(peer, session, wire::Refusal::kSession, "no such session here: say Hello again");
}

Outgoing SessionTable::refuse(std::string_view peer, std::uint64_t session, wire::Refusal reason,
                              std::string text) {
  ++counters_.refused;
  return {std::string(peer), wire::encode(wire::Refused{session, reason, std::move(text)})};
}

void SessionTable::enqueue(Peers::value_type& peer) {
  if (peer.second.waiting || peer.second.under_way) return;
  peer.second.waiting = true;
  waiting_.push_back(&peer);
}

// The next pose comes a frame later; half a frame more is left for its answer. Nobody waits longer
// than the crowd makes all wait, else who once had to would be made to for good.
bool SessionTable::can_wait(const Session& session, Time now) const {
  const auto frame = frame_of(session.pace);
  return !session.welcome_due && frame.count() > 0 && session.due > now &&
         session.due > session.posed + frame * 3 / 2 &&
         session.passed_over < std::ceil(passed_over_);
}

bool SessionTable::before(const Session& a, const Session& b, Time now) const {
  const bool a_waits = can_wait(a, now);
  if (a_waits != can_wait(b, now)) return !a_waits;
  return a_waits ? a.posed > b.posed : a.due < b.due;
}

SessionTable::Next SessionTable::next(Time now) {
  if (waiting_.empty()) return {};
  const auto first = std::ranges::min_element(
      waiting_, [&](const auto* a, const auto* b) { return before(a->second, b->second, now); });
  Peers::value_type& peer = **first;
  Session& session = peer.second;
  waiting_.erase(first);
  session.waiting = false;
  if (!session.welcome_due) return answer(peer, now);
  std::vector<std::byte> bytes = welcome(session);
  if (session.pose) enqueue(peer);
  return Outgoing{peer.first, std::move(bytes)};
}

std::optional<Outgoing> SessionTable::finish(JobDone done) {
  const auto found = sessions_.find(done.peer);
  if (found == sessions_.end() || found->second.id != done.session) return std::nullopt;
  Session& session = found->second;
  session.under_way = false;
  ++counters_.answers;
  if (done.failed) ++counters_.solve_errors;
  if (done.cut_short) ++counters_.cut_short;
  if (done.full) ++counters_.full_sets;
  counters_.bytes_out += done.bytes.size();
  if (done.bytes.empty()) {  // no memory for it: the client will ask again
    if (session.pose) enqueue(*found);
    return std::nullopt;
  }
  if (done.after) remember(session, done.sequence, std::move(done.after));
  if (session.pose) enqueue(*found);
  return Outgoing{std::move(done.peer), std::move(done.bytes)};
}

std::optional<Outgoing> SessionTable::work(Time now) {
  Next step = next(now);
  if (auto* out = std::get_if<Outgoing>(&step)) return std::move(*out);
  if (auto* job = std::get_if<Job>(&step)) return finish(perform(std::move(*job)));
  return std::nullopt;
}

std::vector<std::byte> SessionTable::welcome(Session& session) {
  session.welcome_due = false;
  ++counters_.welcomed;
  wire::Welcome w;
  w.session = session.id;
  w.scene_hash = scene_->hash;
  w.order_hash = scene_->order_hash;
  w.objects = scene_->objects();
  if (session.reach) {
    w.reaches.push_back(session.reach->to_string());
  } else {
    for (const Reach& r : ladder_->reaches())
      w.reaches.push_back(r.to_string());
  }
  w.method = ladder_->largest_method().traits().name;
  if (!session.table_wanted) return wire::encode(w);
  return wire::encode(w, scene_->packed_table);
}

Ladder::Choice SessionTable::choose(const Session& session, const wire::PoseMessage& pose) const {
  const Outlook wanted(session.pace, pose.hold_us, pose.observer.value_or(pose.eye) - pose.eye);
  // A named reach always by the same occluders: equal poses get equal sets.
  if (session.reach)
    return {0, &ladder_->largest_method(), ladder_->largest_index(),
            ladder_->safe_part(*session.reach, wanted)};
  return ladder_->choose(wanted);
}

Job SessionTable::answer(Peers::value_type& peer, Time now) {
  Session& session = peer.second;
  const wire::PoseMessage pose = *session.pose;
  // The first frame that needs another PVS.
  session.due = session.posed + frame_of(session.pace) +
                std::max<Time::duration>(kLeastHold, std::chrono::microseconds(pose.hold_us));
  // Of a client that says where it is more often than it draws, no more than of others.
  passed_over_ += (std::min(session.passed_over, kMostPassedOver) - passed_over_) / kLookBack;
  session.passed_over = 0;

  const Ladder::Choice choice = choose(session, pose);
  if (choice.safe < 1) ++counters_.beyond_ladder;
  Job job;
  job.peer = peer.first;
  job.scene = scene_;
  job.cell = {pose.eye, session.reach ? *session.reach : ladder_->reaches()[choice.rung]};
  job.method = choice.method;
  job.effort = session.effort;
  job.least_solve = limits_.least_solve;
  job.message.session = session.id;
  job.message.sequence = pose.sequence;
  job.message.rung = static_cast<std::uint16_t>(choice.rung);
  job.message.safe = static_cast<std::uint16_t>(choice.safe * wire::PvsMessage::kAllSafe);
  if (state_ != nullptr && state_->epoch() != 0) {
    add_changes(choice, pose, now, job);
    session.told_epoch = job.message.changes.epoch;
    if (session.told_epoch != state_->epoch()) noticed_epoch_ = 0;  // it is to ask for the rest
  }
  const auto base = std::find_if(session.sent.begin(), session.sent.end(),
                                 [&](const Remembered& r) { return r.sequence == pose.have_pvs; });
  if (pose.have_pvs != 0 && base != session.sent.end()) {
    // The client holds this one and will not name an older one again.
    session.acknowledged = pose.have_pvs;
    session.sent.erase(session.sent.begin(), base);
    job.message.base = pose.have_pvs;
    job.base = session.sent.front().state;
  }
  // Last: where memory runs out before it, the next pose asks again.
  session.pose.reset();
  session.under_way = true;
  return job;
}

// The pose was sent before `now`, so what is valid until now + valid is so for as long past its
// sending.
void SessionTable::add_changes(const Ladder::Choice& choice, const wire::PoseMessage& pose,
                               Time now, Job& job) const {
  wire::SceneChanges& changes = job.message.changes;
  SceneState::Told told = state_->since(pose.epoch);
  changes.epoch = told.epoch;
  changes.since = told.since;
  changes.objects = std::move(told.objects);
  // A client that is behind by very much is brought on in steps, and sees everything meanwhile.
  job.everything = told.epoch != state_->epoch() || state_->torn();
  Time until = now;
  if (state_->moves()) {
    const auto wanted = pose.hold_us == 0
                            ? std::chrono::microseconds(kLongestValid)
                            : std::chrono::microseconds(std::uint64_t{kHolds} * pose.hold_us);
    const auto valid = std::clamp<std::chrono::microseconds>(wanted, kShortestValid, kLongestValid);
    changes.valid_us = static_cast<std::uint32_t>(valid.count());
    until += valid;
  }
  if (!job.everything) job.amendment = state_->amendment(*choice.index, now, until);
}

std::size_t SessionTable::remembered_limit() const {
  // A state holds two sets (wire/pvs_codec.h) and the model.
  const std::size_t each =
      sizeof(Remembered) + std::size_t{2} * ((scene_->objects() + 63) / 64) * 8;
  return std::max<std::size_t>(2,
                               std::min(limits_.remembered_sets, limits_.remembered_bytes / each));
}

void SessionTable::remember(Session& session, std::uint32_t sequence,
                            std::shared_ptr<const wire::PvsState> state) {
  if (session.sent.size() >= remembered_limit()) {
    // The acknowledged one stays: poses on their way name it.
    const bool keep_first = session.sent.front().sequence == session.acknowledged;
    session.sent.erase(session.sent.begin() + (keep_first ? 1 : 0));
  }
  session.sent.push_back({sequence, std::move(state)});
}

void SessionTable::forget(std::string_view peer) {
  const auto found = sessions_.find(std::string(peer));
  if (found == sessions_.end()) return;
  if (found->second.waiting) std::erase(waiting_, &*found);
  sessions_.erase(found);
}

std::size_t SessionTable::expire(Time now) {
  std::vector<std::string> silent;
  for (const auto& [peer, session] : sessions_)
    if (now - session.heard > limits_.idle) silent.push_back(peer);
  for (const std::string& peer : silent)
    forget(peer);
  counters_.expired += silent.size();
  return silent.size();
}

std::vector<Outgoing> SessionTable::end_all(wire::Refusal reason, const std::string& text) {
  Peers ended;
  ended.swap(sessions_);
  waiting_.clear();
  std::vector<Outgoing> out;
  for (const auto& [peer, session] : ended)
    out.push_back(refuse(peer, session.id, reason, text));
  return out;
}

std::vector<Outgoing> SessionTable::replace(const ServedScene& scene, const Ladder& ladder,
                                            const CostModel& cost, SceneState* state) {
  scene_ = &scene;
  ladder_ = &ladder;
  cost_ = cost;
  state_ = state;
  noticed_epoch_ = 0;
  return end_all(wire::Refusal::kSession, "the scene was loaded anew: say Hello again");
}

std::vector<Outgoing> SessionTable::close() {
  return end_all(wire::Refusal::kClosing, "the server is closing");
}

}  // namespace ivis::server
