#include "server/session.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <thread>
#include <utility>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "core/view_cell.h"
#include "wire/object_table.h"

namespace ivis::server {
namespace {

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

ServedScene served_scene(const Scene& scene) {
  ServedScene served;
  served.hash = scene.hash;
  served.whole_hash = scene.whole_hash;
  wire::ObjectTable table;
  table.id = rank_order(scene);
  served.order_hash = XXH3_64bits(table.id.data(), table.id.size() * sizeof(ObjectId));
  served.rank_of.resize(scene.object_count());
  for (Rank r = 0; r < table.id.size(); ++r) {
    const Object& o = scene.objects[table.id[r]];
    table.node.push_back(o.node);
    table.instance.push_back(o.instance);
    if (!scene.wholes.empty()) table.cluster.push_back(o.cluster);
    served.rank_of[table.id[r]] = r;
  }
  served.packed_table = wire::pack_table(table);
  return served;
}

SessionTable::SessionTable(const ServedScene& scene, const Ladder& ladder, SessionLimits limits,
                           const CostModel& cost)
    : scene_(scene),
      ladder_(ladder),
      limits_(limits),
      cost_(cost),
      ids_(seeded()),
      nothing_(scene.objects()) {}

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
  if (const auto* bye = std::get_if<wire::Bye>(&*message)) return handle(peer, *bye);
  ++counters_.malformed;
  return refuse(peer, 0, wire::Refusal::kMalformed, "a message that only a server sends");
}

std::optional<Outgoing> SessionTable::handle(std::string_view peer, const wire::Hello& hello,
                                             Time now) {
  const auto known = sessions_.find(std::string(peer));
  // A new Hello ends whatever session the peer had, answered well or not.
  const bool queued = known != sessions_.end() && known->second.in_turn;
  const auto turn_away = [&](wire::Refusal reason, std::string text) {
    forget(peer);
    return refuse(peer, 0, reason, std::move(text));
  };
  if (hello.version != wire::kProtocolVersion)
    return turn_away(wire::Refusal::kVersion, "the client speaks version " +
                                                  std::to_string(hello.version) + ", the server " +
                                                  std::to_string(wire::kProtocolVersion));
  if (hello.scene_hash != 0 && hello.scene_hash != scene_.hash)
    return turn_away(wire::Refusal::kScene, "the client's scene has the hash " +
                                                to_hex(hello.scene_hash) + ", the server's " +
                                                to_hex(scene_.hash) +
                                                why_another(scene_, hello.scene_hash));
  Session session;
  session.pace = hello.pace;
  session.effort = cost_.effort(hello.strategy.value_or(limits_.strategy),
                                hello.budget_us > 0 ? hello.budget_us / 1000.0 : limits_.budget_ms);
  if (!hello.reach.empty()) {
    const auto wanted = Reach::parse(hello.reach);
    if (!wanted) return turn_away(wire::Refusal::kReach, wanted.error().message);
    if (!serves(ladder_.largest(), ladder_.slack_m(), *wanted))
      return turn_away(wire::Refusal::kReach, "the client wants " + wanted->to_string() +
                                                  ", the server's occluders serve up to " +
                                                  ladder_.largest().to_string());
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
  session.welcome_due = true;
  session.table_wanted = hello.want_table;
  session.in_turn = queued;
  Session& kept = sessions_[std::string(peer)] = std::move(session);
  enqueue(peer, kept);
  return std::nullopt;
}

std::optional<Outgoing> SessionTable::handle(std::string_view peer, const wire::PoseMessage& pose,
                                             Time now) {
  Session* const found = find(peer, pose.session);
  if (found == nullptr) return refuse_unknown(peer, pose.session);
  Session& session = *found;
  session.heard = now;
  if (!finite(pose.eye) || pose.sequence == 0) {
    ++counters_.malformed;
    forget(peer);
    return refuse(peer, pose.session, wire::Refusal::kMalformed,
                  pose.sequence == 0 ? "a pose with sequence 0" : "an eye that is not finite");
  }
  if (pose.sequence <= session.last_sequence) return std::nullopt;  // none is answered twice
  session.last_sequence = pose.sequence;
  ++counters_.poses;
  if (session.pose) ++counters_.superseded;
  session.pose = pose;
  enqueue(peer, session);
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

void SessionTable::enqueue(std::string_view peer, Session& session) {
  if (session.in_turn) return;
  session.in_turn = true;
  turn_.emplace_back(peer);
}

std::optional<Outgoing> SessionTable::work() {
  while (!turn_.empty()) {
    std::string peer = std::move(turn_.front());
    turn_.pop_front();
    const auto found = sessions_.find(peer);
    if (found == sessions_.end()) continue;
    Session& session = found->second;
    session.in_turn = false;
    if (session.welcome_due) {
      std::vector<std::byte> bytes = welcome(session);
      if (session.pose) enqueue(peer, session);
      return Outgoing{std::move(peer), std::move(bytes)};
    }
    if (session.pose) {
      std::vector<std::byte> bytes = answer(session);
      return Outgoing{std::move(peer), std::move(bytes)};
    }
  }
  return std::nullopt;
}

std::vector<std::byte> SessionTable::welcome(Session& session) {
  session.welcome_due = false;
  ++counters_.welcomed;
  wire::Welcome w;
  w.session = session.id;
  w.scene_hash = scene_.hash;
  w.order_hash = scene_.order_hash;
  w.objects = scene_.objects();
  if (session.reach) {
    w.reaches.push_back(session.reach->to_string());
  } else {
    for (const Reach& r : ladder_.reaches())
      w.reaches.push_back(r.to_string());
  }
  w.method = ladder_.largest_method().traits().name;
  if (!session.table_wanted) return wire::encode(w);
  return wire::encode(w, scene_.packed_table);
}

Ladder::Choice SessionTable::choose(const Session& session, std::uint32_t hold_us) const {
  // A named reach always by the same occluders: equal poses get equal sets.
  if (session.reach)
    return {0, &ladder_.largest_method(),
            session.pace.told() ? ladder_.safe_part(*session.reach, reach_of(session.pace, hold_us))
                                : 1};
  return ladder_.choose(session.pace, hold_us);
}

std::vector<std::byte> SessionTable::answer(Session& session) {
  const wire::PoseMessage pose = *session.pose;
  session.pose.reset();
  ++counters_.answers;

  const Ladder::Choice choice = choose(session, pose.hold_us);
  const Reach& reach = session.reach ? *session.reach : ladder_.reaches()[choice.rung];
  Work done;
  const auto start = std::chrono::steady_clock::now();
  const auto pvs = [&]() -> Result<Pvs> {
    try {
      if (session.effort.strategy == Strategy::kGuaranteed)
        return choice.method->solve({pose.eye, reach});
      return choice.method->solve({pose.eye, reach}, session.effort, done);
    } catch (const std::exception& e) {  // out of memory costs one answer, not the daemon
      return unsupported(e.what());
    }
  }();
  if (limits_.least_solve.count() > 0) std::this_thread::sleep_until(start + limits_.least_solve);
  const auto took = std::chrono::steady_clock::now() - start;

  wire::PvsMessage m;
  m.session = session.id;
  m.sequence = pose.sequence;
  m.rung = static_cast<std::uint16_t>(choice.rung);
  m.safe = static_cast<std::uint16_t>(choice.safe * wire::PvsMessage::kAllSafe);
  if (choice.safe < 1) ++counters_.beyond_ladder;
  if (done.cut) ++counters_.cut_short;
  m.solve_us = static_cast<std::uint32_t>(std::min<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(took).count(), UINT32_MAX));
  if (!pvs) ++counters_.solve_errors;
  if (!pvs || !pvs->everything_because.empty()) {
    // Errs towards visible: what could not be solved is answered with every object.
    m.everything = true;
  } else {
    wire::RankSet set(scene_.objects());
    for (const ObjectId id : pvs->objects)
      set.set(scene_.rank_of[id]);
    const auto base =
        std::find_if(session.sent.begin(), session.sent.end(),
                     [&](const Remembered& r) { return r.sequence == pose.have_pvs; });
    const bool known = pose.have_pvs != 0 && base != session.sent.end();
    if (known) {
      // The client holds this one and will not name an older one again.
      session.acknowledged = pose.have_pvs;
      session.sent.erase(session.sent.begin(), base);
      m.base = pose.have_pvs;
    } else {
      ++counters_.full_sets;
    }
    wire::PvsState after(scene_.objects());
    m.payload = wire::encode_pvs(set, known ? session.sent.front().state : nothing_, after);
    remember(session, pose.sequence, std::move(after));
  }
  std::vector<std::byte> bytes = wire::encode(m);
  counters_.bytes_out += bytes.size();
  return bytes;
}

std::size_t SessionTable::remembered_limit() const {
  // A state holds two sets (wire/pvs_codec.h) and the model.
  const std::size_t each = sizeof(Remembered) + 2 * nothing_.set.words.size() * 8;
  return std::max<std::size_t>(2,
                               std::min(limits_.remembered_sets, limits_.remembered_bytes / each));
}

void SessionTable::remember(Session& session, std::uint32_t sequence, wire::PvsState state) {
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
  // A peer stands in turn_ only while it has a session: so turn_ is as bounded as sessions_.
  if (found->second.in_turn) std::erase(turn_, found->first);
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

std::vector<Outgoing> SessionTable::close() {
  std::vector<Outgoing> farewells;
  for (const auto& [peer, session] : sessions_)
    farewells.push_back(refuse(peer, session.id, wire::Refusal::kClosing, "the server is closing"));
  sessions_.clear();
  turn_.clear();
  return farewells;
}

}  // namespace ivis::server
