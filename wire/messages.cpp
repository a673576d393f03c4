#include "wire/messages.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>

#include "core/assert.h"
#include "ivis_generated.h"
#include "wire/object_table.h"

namespace ivis::wire {
namespace {

using flatbuffers::FlatBufferBuilder;

constexpr std::size_t kSmallestMessage = 12;

// Generous for our kinds of table, hopeless for a hostile one.
constexpr flatbuffers::uoffset_t kMaxDepth = 4;
constexpr flatbuffers::uoffset_t kMaxTables = 4;

bool finite(const Vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
fb::Vec3 to_fb(const Vec3& v) {
  return {v.x, v.y, v.z};
}
Vec3 from_fb(const fb::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}
fb::Speeds speeds_of(const Pace& p) {
  IVIS_ASSERT(p.valid(), "speeds are finite and within bounds");
  return {p.horizontal_m_s, p.vertical_m_s, p.frame_s};
}
Result<Pace> pace_of(const fb::Speeds& s, double turning) {
  const Pace pace{s.horizontal(), s.vertical(), s.frame(), turning};
  if (!pace.valid())
    return input_error(
        "speeds: not finite, negative, above 1e6 m/s or rad/s, or frames above an hour");
  return pace;
}

fb::Change to_fb(std::uint8_t what, ObjectId id, const Placement& p, float speed) {
  IVIS_ASSERT(p.valid(), "a placement is finite and a rotation");
  return {to_fb(p.position), p.rotation.x, p.rotation.y, p.rotation.z,
          p.rotation.w,      speed,        id,           what};
}

enum : std::uint8_t { kRemoved = 1, kOccluderOff = 2, kMoved = 4, kAllFlags = 7 };

fb::Change to_fb(const ObjectState& s) {
  const int flags =
      (s.removed ? kRemoved : 0) | (s.occluder_off ? kOccluderOff : 0) | (s.moved ? kMoved : 0);
  // Where the scene file has an object may be anywhere; where an edit put one is checked.
  return to_fb(static_cast<std::uint8_t>(flags), s.id, s.moved ? s.placement : Placement{},
               s.speed_m_s);
}

Placement placement_of(const fb::Change& c) {
  return {from_fb(c.position()), {c.rotation_w(), c.rotation_x(), c.rotation_y(), c.rotation_z()}};
}

Status check(const fb::Change& c) {
  if (!placement_of(c).valid())
    return input_error("object " + std::to_string(c.id()) +
                       ": a position not finite or beyond 1e9 m, or a rotation that is none");
  if (!(c.speed() >= 0 && c.speed() <= kFastestMoverMs))
    return input_error("object " + std::to_string(c.id()) + ": a speed not from 0 to 1000 m/s");
  return ok();
}

// ---- encoding: one function a message, children before the envelope ----

flatbuffers::Offset<flatbuffers::String> put_string(FlatBufferBuilder& b, std::string_view s,
                                                    std::size_t limit) {
  if (s.empty()) return 0;
  return b.CreateString(s.data(), std::min(s.size(), limit));
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const Hello& m) {
  const auto reach = put_string(b, m.reach, kMaxNameBytes);
  const fb::Speeds speeds = speeds_of(m.pace);
  const auto hello = fb::CreateHello(
      b, m.version, m.want_table, m.scene_hash, reach, m.pace == Pace{} ? nullptr : &speeds,
      static_cast<std::uint8_t>(m.strategy ? 1 + static_cast<int>(*m.strategy) : 0), m.budget_us,
      m.pace.turning_rad_s);
  fb::EnvelopeBuilder e(b);
  e.add_hello(hello);
  return e.Finish();
}

/// An empty `packed_table` is none.
flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const Welcome& m,
                                      std::span<const std::uint8_t> packed_table) {
  IVIS_ASSERT(m.objects <= kMaxObjects, "the scene has no more objects than the protocol takes");
  flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> table = 0;
  if (!packed_table.empty()) table = b.CreateVector(packed_table.data(), packed_table.size());
  IVIS_ASSERT(!m.reaches.empty() && m.reaches.size() <= kMaxRungs, "1 to kMaxRungs reaches");
  std::vector<flatbuffers::Offset<flatbuffers::String>> strings;
  for (const std::string& r : m.reaches)
    strings.push_back(b.CreateString(r.data(), std::min(r.size(), kMaxNameBytes)));
  const auto reaches = b.CreateVector(strings);
  const auto method = put_string(b, m.method, kMaxNameBytes);
  const auto welcome = fb::CreateWelcome(b, m.version, m.session, m.scene_hash, m.order_hash,
                                         m.objects, reaches, method, table);
  fb::EnvelopeBuilder e(b);
  e.add_welcome(welcome);
  return e.Finish();
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const Welcome& m) {
  if (m.table.id.empty()) return put(b, m, {});
  IVIS_ASSERT(m.table.id.size() == m.objects, "the table has a row an object");
  return put(b, m, pack_table(m.table));
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const PoseMessage& m) {
  IVIS_ASSERT(finite(m.eye) && (!m.observer || finite(*m.observer)), "a pose is finite");
  const fb::Pose pose(m.session, m.sequence, m.have_pvs, to_fb(m.eye), m.hold_us, m.epoch);
  const fb::Vec3 observer = to_fb(m.observer.value_or(Vec3{0}));
  fb::EnvelopeBuilder e(b);
  e.add_pose(&pose);
  if (m.observer) e.add_observer(&observer);
  return e.Finish();
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const PvsMessage& m) {
  IVIS_ASSERT(!m.eye || finite(*m.eye), "a cell's centre is finite");
  flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> payload = 0;
  if (!m.everything)
    payload =
        b.CreateVector(reinterpret_cast<const std::uint8_t*>(m.payload.data()), m.payload.size());
  flatbuffers::Offset<fb::Changes> changes = 0;
  if (m.changes.epoch != 0) {
    flatbuffers::Offset<flatbuffers::Vector<const fb::Change*>> objects = 0;
    std::vector<fb::Change> states;
    for (const ObjectState& o : m.changes.objects)
      states.push_back(to_fb(o));
    if (!states.empty()) objects = b.CreateVectorOfStructs(states);
    changes = fb::CreateChanges(b, m.changes.epoch, m.changes.since, m.changes.valid_us, objects);
  }
  const fb::Pvs pvs(static_cast<std::uint32_t>(m.session),
                    static_cast<std::uint32_t>(m.session >> 32U), m.sequence, m.base, m.solve_us,
                    m.rung, m.safe);
  const fb::Vec3 centre = to_fb(m.eye.value_or(Vec3(0)));
  fb::EnvelopeBuilder e(b);
  if (m.eye) e.add_centre(&centre);
  if (m.changes.epoch != 0) e.add_changes(changes);
  e.add_payload(payload);
  e.add_pvs(&pvs);
  return e.Finish();
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const Refused& m) {
  const auto text = put_string(b, m.text, kMaxTextBytes);
  const auto refused = fb::CreateRefused(b, m.session, static_cast<std::uint8_t>(m.reason), text);
  fb::EnvelopeBuilder e(b);
  e.add_refused(refused);
  return e.Finish();
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const Bye& m) {
  const fb::Bye bye(m.session);
  fb::EnvelopeBuilder e(b);
  e.add_bye(&bye);
  return e.Finish();
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const PaceMessage& m) {
  const fb::Pace pace(m.session, speeds_of(m.pace), m.pace.turning_rad_s);
  fb::EnvelopeBuilder e(b);
  e.add_pace(&pace);
  return e.Finish();
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const EditMessage& m) {
  IVIS_ASSERT(!m.edits.empty() && m.edits.size() <= kMaxEdits, "1 to kMaxEdits edits");
  std::vector<fb::Change> changes;
  for (const Edit& e : m.edits)
    changes.push_back(to_fb(static_cast<std::uint8_t>(e.kind), e.id, e.placement, e.speed_m_s));
  const auto edit = fb::CreateEdit(b, m.session, m.request, b.CreateVectorOfStructs(changes));
  fb::EnvelopeBuilder e(b);
  e.add_edit(edit);
  return e.Finish();
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const EditedMessage& m) {
  const auto text = put_string(b, m.text, kMaxTextBytes);
  const auto edited = fb::CreateEdited(b, m.session, m.request, m.epoch, text);
  fb::EnvelopeBuilder e(b);
  e.add_edited(edited);
  return e.Finish();
}

flatbuffers::Offset<fb::Envelope> put(FlatBufferBuilder& b, const NoticeMessage& m) {
  const fb::Notice notice(m.session, m.epoch);
  fb::EnvelopeBuilder e(b);
  e.add_notice(&notice);
  return e.Finish();
}

// ---- decoding: one function a message, after verification ----

std::string text_of(const flatbuffers::String* s) {
  return s == nullptr ? std::string() : s->str();
}

Status check_string(const flatbuffers::String* s, std::size_t limit, const char* what) {
  if (s == nullptr || s->size() <= limit) return ok();
  return input_error(std::string(what) + ": " + std::to_string(s->size()) + " bytes, at most " +
                     std::to_string(limit));
}

Result<Message> get(const fb::Hello& m) {
  if (const auto s = check_string(m.reach(), kMaxNameBytes, "hello: reach"); !s) return s.error();
  Hello out{m.version(), m.scene_hash(), text_of(m.reach()), m.want_table(), {}, {}, m.budget_us()};
  const auto pace = pace_of(m.speeds() != nullptr ? *m.speeds() : fb::Speeds(0, 0, 0), m.turning());
  if (!pace) return pace.error();
  out.pace = *pace;
  if (m.strategy() > 1 + static_cast<int>(Strategy::kPredictive))
    return input_error("hello: unknown strategy " + std::to_string(m.strategy()));
  if (m.strategy() > 0) out.strategy = static_cast<Strategy>(m.strategy() - 1);
  return Message(std::move(out));
}

Result<Message> get(const fb::Welcome& m) {
  if (m.reaches() == nullptr || m.reaches()->size() == 0 || m.reaches()->size() > kMaxRungs)
    return input_error(
        "welcome: " + std::to_string(m.reaches() == nullptr ? 0 : m.reaches()->size()) +
        " reaches, expected 1 to " + std::to_string(kMaxRungs));
  std::vector<std::string> reaches;
  for (const auto* r : *m.reaches()) {
    if (const auto s = check_string(r, kMaxNameBytes, "welcome: reach"); !s) return s.error();
    reaches.push_back(text_of(r));
  }
  if (const auto s = check_string(m.method(), kMaxNameBytes, "welcome: method"); !s)
    return s.error();
  Welcome out{m.version(), m.session(),        m.scene_hash(),      m.order_hash(),
              m.objects(), std::move(reaches), text_of(m.method()), {}};
  // Also without a table: the client keeps bits an object.
  if (out.objects > kMaxObjects)
    return input_error("welcome: " + std::to_string(out.objects) + " objects, at most " +
                       std::to_string(kMaxObjects));
  if (m.table() != nullptr) {
    auto table = unpack_table({m.table()->data(), m.table()->size()}, out.objects);
    if (!table) return table.error();
    out.table = std::move(*table);
  }
  return Message(std::move(out));
}

Result<Message> get(const fb::Envelope& e, const fb::Pose& m) {
  PoseMessage out{m.session(), m.sequence(), m.have_pvs(), from_fb(m.eye()), m.hold_us(), m.epoch(),
                  {}};
  if (e.observer() != nullptr) out.observer = from_fb(*e.observer());
  if (!finite(out.eye) || (out.observer && !finite(*out.observer)))
    return input_error("pose " + std::to_string(m.sequence()) + ": eye or observer is not finite");
  return Message(out);
}

Result<SceneChanges> get(const fb::Changes& m) {
  SceneChanges out{m.epoch(), m.since(), m.valid_us(), {}};
  if (out.epoch == 0 || out.since > out.epoch)
    return input_error("changes: epoch " + std::to_string(out.epoch) + " told against " +
                       std::to_string(out.since));
  if (m.objects() == nullptr) return out;
  for (const fb::Change* c : *m.objects()) {
    if (const auto s = check(*c); !s) return s.error();
    if (c->what() > kAllFlags)
      return input_error("changes: unknown flags " + std::to_string(c->what()));
    out.objects.push_back({c->id(), (c->what() & kRemoved) != 0, (c->what() & kOccluderOff) != 0,
                           (c->what() & kMoved) != 0, placement_of(*c), c->speed()});
  }
  return out;
}

Result<Message> get(const fb::Edit& m) {
  const std::size_t count = m.changes() == nullptr ? 0 : m.changes()->size();
  if (count == 0 || count > kMaxEdits)
    return input_error("edit: " + std::to_string(count) + " edits, expected 1 to " +
                       std::to_string(kMaxEdits));
  EditMessage out{m.session(), m.request(), {}};
  for (const fb::Change* c : *m.changes()) {
    if (const auto s = check(*c); !s) return s.error();
    if (c->what() < static_cast<int>(EditKind::kMove) ||
        c->what() > static_cast<int>(EditKind::kOccluderOn))
      return input_error("edit: unknown kind " + std::to_string(c->what()));
    out.edits.push_back({static_cast<EditKind>(c->what()), c->id(), placement_of(*c), c->speed()});
  }
  return Message(std::move(out));
}

Result<Message> get(const fb::Edited& m) {
  if (const auto s = check_string(m.text(), kMaxTextBytes, "edited: text"); !s) return s.error();
  return Message(EditedMessage{m.session(), m.request(), m.epoch(), text_of(m.text())});
}

Result<Message> get(const fb::Envelope& e, const fb::Pvs& m) {
  PvsMessage out;
  out.session = std::uint64_t{m.session_low()} | (std::uint64_t{m.session_high()} << 32U);
  out.sequence = m.sequence();
  out.base = m.base();
  out.solve_us = m.solve_us();
  out.rung = m.rung();
  out.safe = m.safe();
  out.everything = e.payload() == nullptr;
  if (e.changes() != nullptr) {
    auto changes = get(*e.changes());
    if (!changes) return changes.error();
    out.changes = std::move(*changes);
  }
  if (e.centre() != nullptr) {
    out.eye = from_fb(*e.centre());
    if (!finite(*out.eye))
      return input_error("pvs " + std::to_string(out.sequence) + ": centre is not finite");
  }
  if (!out.everything) {
    const auto* first = reinterpret_cast<const std::byte*>(e.payload()->data());
    out.payload.assign(first, first + e.payload()->size());
  }
  return Message(std::move(out));
}

Result<Message> get(const fb::Refused& m) {
  if (const auto s = check_string(m.text(), kMaxTextBytes, "refused: text"); !s) return s.error();
  if (m.reason() < static_cast<std::uint8_t>(Refusal::kVersion) ||
      m.reason() > static_cast<std::uint8_t>(Refusal::kClosing))
    return input_error("refused: unknown reason " + std::to_string(m.reason()));
  return Message(Refused{m.session(), static_cast<Refusal>(m.reason()), text_of(m.text())});
}

Result<Message> get(const fb::Envelope& e) {
  const int kinds = (e.pvs() != nullptr) + (e.pose() != nullptr) + (e.hello() != nullptr) +
                    (e.welcome() != nullptr) + (e.refused() != nullptr) + (e.bye() != nullptr) +
                    (e.pace() != nullptr) + (e.edit() != nullptr) + (e.edited() != nullptr) +
                    (e.notice() != nullptr);
  if (kinds != 1)
    return input_error("message: " + std::to_string(kinds) +
                       " known kinds in one envelope, expected 1");
  if (e.pvs() == nullptr &&
      (e.payload() != nullptr || e.centre() != nullptr || e.changes() != nullptr))
    return input_error("message: a payload, centre or changes without a pvs");
  if (e.pose() == nullptr && e.observer() != nullptr)
    return input_error("message: an observer without a pose");
  if (e.pvs() != nullptr) return get(e, *e.pvs());
  if (e.pose() != nullptr) return get(e, *e.pose());
  if (e.hello() != nullptr) return get(*e.hello());
  if (e.welcome() != nullptr) return get(*e.welcome());
  if (e.refused() != nullptr) return get(*e.refused());
  if (e.edit() != nullptr) return get(*e.edit());
  if (e.edited() != nullptr) return get(*e.edited());
  if (e.notice() != nullptr)
    return Message(NoticeMessage{e.notice()->session(), e.notice()->epoch()});
  if (e.pace() != nullptr) {
    const auto pace = pace_of(e.pace()->speeds(), e.pace()->turning());
    if (!pace) return pace.error();
    return Message(PaceMessage{e.pace()->session(), *pace});
  }
  return Message(Bye{e.bye()->session()});
}

std::vector<std::byte> finish(FlatBufferBuilder& b, flatbuffers::Offset<fb::Envelope> envelope) {
  b.FinishSizePrefixed(envelope);
  IVIS_ASSERT(b.GetSize() <= kMaxMessageBytes, "a message keeps to its limit");
  const auto* first = reinterpret_cast<const std::byte*>(b.GetBufferPointer());
  return {first, first + b.GetSize()};
}

}  // namespace

std::vector<std::byte> encode(const Message& message) {
  FlatBufferBuilder b(512);
  return finish(b, std::visit([&](const auto& m) { return put(b, m); }, message));
}

std::vector<std::byte> encode(const Welcome& welcome, std::span<const std::uint8_t> packed_table) {
  IVIS_ASSERT(welcome.table.id.empty(), "one table a Welcome, packed or not");
  FlatBufferBuilder b(512);
  return finish(b, put(b, welcome, packed_table));
}

Result<Message> decode(std::span<const std::byte> bytes) {
  if (bytes.size() > kMaxMessageBytes)
    return input_error("message: " + std::to_string(bytes.size()) + " bytes, at most " +
                       std::to_string(kMaxMessageBytes));
  if (bytes.size() < kSmallestMessage)
    return input_error("message: " + std::to_string(bytes.size()) + " bytes, at least " +
                       std::to_string(kSmallestMessage));
  // The transport hands out bytes at any address; FlatBuffers reads its numbers in place.
  std::vector<std::uint64_t> aligned;
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  if (reinterpret_cast<std::uintptr_t>(data) % alignof(std::uint64_t) != 0) {
    aligned.resize(bytes.size() / sizeof(std::uint64_t) + 1);
    std::memcpy(aligned.data(), bytes.data(), bytes.size());
    data = reinterpret_cast<const std::uint8_t*>(aligned.data());
  }
  const auto stated = flatbuffers::GetPrefixedSize(data);
  if (stated != bytes.size() - sizeof(stated))
    return input_error("message: its prefix says " + std::to_string(stated) + " bytes, found " +
                       std::to_string(bytes.size() - sizeof(stated)));
  flatbuffers::Verifier verifier(data, bytes.size(), kMaxDepth, kMaxTables);
  if (!fb::VerifySizePrefixedEnvelopeBuffer(verifier))
    return input_error("message: not a valid envelope (offsets or sizes out of range)");
  return get(*fb::GetSizePrefixedEnvelope(data));
}

}  // namespace ivis::wire
