#include "client_lib/network_source.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include <zmq.hpp>

#include "client_lib/pvs_history.h"
#include "wire/messages.h"

namespace ivis::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kHelloAgain = std::chrono::milliseconds(1000);
constexpr auto kBusyPause = std::chrono::milliseconds(1000);
// While something waits to be sent, nothing else would wake wait().
constexpr auto kSendAgain = std::chrono::milliseconds(2);
constexpr auto kTimers = std::chrono::milliseconds(50);
constexpr std::size_t kRememberedEyes = 1024;
/// Edits under way, and results that nobody has taken; each.
constexpr std::size_t kMostRequests = 1024;

/// One a process, for as long as somebody uses it: it owns a thread that moves bytes.
std::shared_ptr<zmq::context_t> shared_context() {
  static std::mutex mutex;
  static std::weak_ptr<zmq::context_t> shared;
  const std::lock_guard lock(mutex);
  auto context = shared.lock();
  if (!context) shared = context = std::make_shared<zmq::context_t>(1);
  return context;
}

}  // namespace

struct NetworkSource::Impl {
  explicit Impl(const NetworkOptions& o)
      : options(o),
        scene_hash(o.scene_hash),
        context(shared_context()),
        socket(*context, zmq::socket_type::dealer) {
    socket.set(zmq::sockopt::linger, 100);  // ms, for Bye
    // Not ZMQ_IMMEDIATE: it would drop a farewell that is followed at once by the disconnect. So a
    // few messages may wait for a server that is not there; it answers only the latest.
    socket.set(zmq::sockopt::sndhwm, 8);
    socket.set(zmq::sockopt::rcvhwm, 256);
    socket.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(wire::kMaxMessageBytes));
    socket.set(zmq::sockopt::reconnect_ivl, 50);
    socket.set(zmq::sockopt::reconnect_ivl_max, 1000);
    socket.set(zmq::sockopt::heartbeat_ivl, 2000);
    socket.set(zmq::sockopt::heartbeat_timeout, 6000);
    socket.set(zmq::sockopt::ipv6,
               options.endpoint.find('[') != std::string::npos);  // tcp://[::1]:7447
    socket.connect(options.endpoint);
  }

  ~Impl() {
    if (session == 0) return;
    try {
      static_cast<void>(put(wire::Bye{session}));
    } catch (const std::exception&) {  // the server will see us expire
    }
  }

  bool put(const wire::Message& message) {
    const std::vector<std::byte> bytes = wire::encode(message);
    return socket.send(zmq::buffer(bytes), zmq::send_flags::dontwait).has_value();
  }

  /// Sends what is due and can go.
  void pump() {
    if (failed) return;
    const auto now = Clock::now();
    // Silence: a pose is unanswered and nothing at all has come for too long.
    if (session != 0 && waiting_since && now - *waiting_since > options.silence) {
      begin_again(
          "the server has been silent for " + std::to_string(options.silence.count()) + " ms", now);
    }
    if (session == 0) {
      if (now >= next_hello &&
          put(wire::Hello{wire::kProtocolVersion, scene_hash, options.reach, true, options.pace,
                          options.strategy, options.budget_us})) {
        next_hello = now + kHelloAgain;
        pace_due = false;
      }
      return;
    }
    // Before the pose: it is answered by the new pace.
    if (pace_due) pace_due = !put(wire::PaceMessage{session, options.pace});
    if (!pose_due) return;
    if (!waiting_since) waiting_since = now;  // also while the pose cannot leave
    const Eye& eye = eyes[sequence % kRememberedEyes];
    // What is not known as a base is not acknowledged: the answer then is a full set.
    if (!put(wire::PoseMessage{session, sequence, history.newest(), eye.at, hold_us, have_epoch,
                               observer}))
      return;
    pose_due = false;
  }

  void begin_again(std::string why, Clock::time_point hello_at) {
    lose_edits();
    session = 0;
    next_hello = hello_at;
    waiting_since.reset();
    last_trouble = std::move(why);
  }

  void fail(Error error) {
    lose_edits();
    session = 0;
    failed = std::move(error);
  }

  void lose_edits() {
    for (const std::uint32_t request : asked)
      add_result({request, 0, "the session ended before an answer: it may have been done"});
    asked.clear();
  }

  void add_result(EditResult result) {
    if (results.size() >= kMostRequests) results.pop_front();
    results.push_back(std::move(result));
  }

  void handle(wire::EditedMessage& m) {
    if (m.session != session || std::erase(asked, m.request) == 0) return;
    add_result({m.request, m.epoch, std::move(m.text)});
    known_epoch = std::max(known_epoch, m.epoch);
  }

  /// Takes in all that has arrived. Only the newest PVS is decoded: each names its own base.
  void drain() {
    zmq::message_t message;
    bool any = false;
    while (!failed && socket.recv(message, zmq::recv_flags::dontwait)) {
      any = true;
      if (message.more()) {  // a server sends single frames
        ++counted.bad_messages;
        do
          static_cast<void>(socket.recv(message, zmq::recv_flags::none));
        while (message.more());
        continue;
      }
      auto decoded = wire::decode({static_cast<const std::byte*>(message.data()), message.size()});
      if (!decoded) {
        ++counted.bad_messages;
        last_trouble = decoded.error().message;
        continue;
      }
      if (auto* pvs = std::get_if<wire::PvsMessage>(&*decoded)) {
        if (pvs->session != session || pvs->sequence > sequence || pvs->sequence <= answered)
          continue;
        ++counted.answers;
        counted.bytes += message.size();
        if (!newest || pvs->sequence > newest->sequence) newest = std::move(*pvs);
      } else if (auto* edited = std::get_if<wire::EditedMessage>(&*decoded)) {
        handle(*edited);
      } else if (const auto* notice = std::get_if<wire::NoticeMessage>(&*decoded)) {
        if (notice->session == session) known_epoch = std::max(known_epoch, notice->epoch);
      } else if (auto* welcome = std::get_if<wire::Welcome>(&*decoded)) {
        handle(*welcome);
      } else if (const auto* refused = std::get_if<wire::Refused>(&*decoded)) {
        handle(*refused);
      } else {
        ++counted.bad_messages;
      }
    }
    if (any && waiting_since) waiting_since = Clock::now();
    if (newest && !failed) {
      const wire::PvsMessage pvs = std::move(*newest);
      newest.reset();
      take(pvs);
    }
  }

  void handle(wire::Welcome& w) {
    // A second Welcome answers a Hello that was repeated too soon; the server knows its session
    // only.
    const bool was_lost = session == 0;
    if (w.version != wire::kProtocolVersion)
      return fail(mismatch("the server speaks version " + std::to_string(w.version) +
                           ", the client " + std::to_string(wire::kProtocolVersion)));
    if (scene_hash != 0 && w.scene_hash != scene_hash)
      return fail(mismatch(
          "the client's scene has the hash " + to_hex(scene_hash) + ", the server's " +
          to_hex(w.scene_hash) +
          (w.table.cluster.empty() ? "" : ", which is split into clusters (granularity cluster)")));
    std::vector<Reach> reaches;
    for (const std::string& text : w.reaches)
      if (auto reach = Reach::parse(text);
          reach && (reaches.empty() || reach->contains(reaches.back(), kReachToleranceM)))
        reaches.push_back(*reach);
    if (w.session == 0 || reaches.empty() || reaches.size() != w.reaches.size() ||
        w.table.id.size() != w.objects || w.table.node.size() != w.objects ||
        w.table.instance.size() != w.objects ||
        (!w.table.cluster.empty() && w.table.cluster.size() != w.objects)) {
      ++counted.bad_messages;
      last_trouble = "a Welcome that contradicts itself";
      return;
    }
    Catalogue told;
    told.scene_hash = w.scene_hash;
    told.largest_reach = reaches.back().to_string();
    told.reaches = std::move(reaches);
    told.method = w.method;
    told.node.resize(w.objects);
    told.instance.resize(w.objects);
    told.cluster.resize(w.table.cluster.size());
    for (Rank r = 0; r < w.objects; ++r) {
      told.node[w.table.id[r]] = w.table.node[r];
      told.instance[w.table.id[r]] = w.table.instance[r];
      if (!told.cluster.empty()) told.cluster[w.table.id[r]] = w.table.cluster[r];
    }
    if (auto sound = check_catalogue(told); !sound) {
      ++counted.bad_messages;
      last_trouble = sound.error().message;
      return;
    }
    if (catalogue && told.scene_hash != catalogue->scene_hash) ++counted.scenes;
    if (catalogue && told.scene_hash == catalogue->scene_hash &&
        (told.node != catalogue->node || told.instance != catalogue->instance ||
         told.cluster != catalogue->cluster))
      return fail(mismatch("the server's objects have changed under the scene hash " +
                           to_hex(w.scene_hash)));
    if (catalogue && was_lost) ++counted.reconnects;
    catalogue = std::move(told);
    id_of = std::move(w.table.id);
    if (!options.follow_scene) scene_hash = w.scene_hash;
    lose_edits();
    session = w.session;
    have_epoch = known_epoch = 0;
    history.clear();
    newest.reset();
    last_trouble.clear();
    waiting_since.reset();
    pose_due = sequence > answered;
  }

  void handle(const wire::Refused& r) {
    // Sessions are numbered at random: a refusal of one that is not ours is about the past.
    if (r.session != 0 && r.session != session) return;
    const std::string text = "the server refused: " + r.text;
    switch (r.reason) {
      case wire::Refusal::kVersion:
      case wire::Refusal::kScene:
      case wire::Refusal::kReach:
        return fail(mismatch(text));
      case wire::Refusal::kBusy:
        return begin_again(text, Clock::now() + kBusyPause);
      case wire::Refusal::kClosing:
      case wire::Refusal::kMalformed:
        return begin_again(text, Clock::now() + kHelloAgain);
      case wire::Refusal::kSession:
        return begin_again(text, Clock::now());
    }
  }

  void take(const wire::PvsMessage& m) {
    const Eye& eye = eyes[m.sequence % kRememberedEyes];
    if (!m.eye && eye.sequence != m.sequence) return;  // too old to know where it was
    const auto bad = [&](std::string why) {
      // Acknowledging nothing makes the next answer a full set, so that this cannot last.
      ++counted.bad_messages;
      last_trouble = std::move(why);
      history.clear();
    };
    Answer a;
    a.sequence = m.sequence;
    if (m.rung >= catalogue->reaches.size())
      return bad("a PVS for a reach that the server has not named");
    a.cell = {m.eye.value_or(eye.at), catalogue->reaches[m.rung]};
    a.safe = static_cast<double>(m.safe) / wire::PvsMessage::kAllSafe;
    a.solve_ms = m.solve_us / 1000.0;
    if (m.changes.epoch < have_epoch || m.changes.since > have_epoch)
      return bad("a PVS of a scene that is no more, or told against one that never was");
    for (const ObjectState& o : m.changes.objects)
      if (o.id >= catalogue->objects()) return bad("a change of an object that is not there");
    a.epoch = m.changes.epoch;
    a.valid_us = m.changes.valid_us;
    a.changes = m.changes.objects;
    a.from_the_file = m.changes.since == 0;
    a.everything = m.everything;
    if (m.everything) {
      a.count = catalogue->objects();
    } else {
      const wire::PvsState empty(catalogue->objects());
      const wire::PvsState* base = m.base == 0 ? &empty : history.base(m.base);
      if (base == nullptr) return bad("a PVS against a base that is not here");
      auto state = wire::decode_pvs(m.payload, *base);
      if (!state) return bad(state.error().message);
      a.bits = std::move(spare);
      a.bits.assign(words_for(catalogue->objects()), 0);
      for (std::size_t w = 0; w < state->set.words.size(); ++w) {
        for (std::uint64_t left = state->set.words[w]; left != 0; left &= left - 1) {
          const ObjectId id = id_of[w * 64 + static_cast<std::size_t>(std::countr_zero(left))];
          set_bit(a.bits, id);
          ++a.count;
        }
      }
      history.add(m.sequence, std::move(*state));
    }
    have_epoch = a.epoch;
    known_epoch = std::max(known_epoch, a.epoch);
    answered = m.sequence;
    if (answered == sequence) waiting_since.reset();
    last_trouble.clear();
    ready = std::move(a);
  }

  struct Eye {
    std::uint32_t sequence = 0;
    Vec3 at{0};
  };
  NetworkOptions options;
  SceneHash scene_hash;
  std::optional<Catalogue> catalogue;
  std::vector<ObjectId> id_of;  ///< by rank
  std::uint64_t session = 0;    ///< 0: greeting
  Clock::time_point next_hello{};
  std::optional<Clock::time_point>
      waiting_since;  ///< last sign of life with a pose due or unanswered
  std::array<Eye, kRememberedEyes> eyes{};
  std::uint32_t sequence = 0;     ///< of the latest pose
  std::uint32_t answered = 0;     ///< of the latest pose that was
  std::uint32_t hold_us = 0;      ///< likewise
  std::optional<Vec3> observer;   ///< likewise
  std::uint32_t have_epoch = 0;   ///< of the newest PVS of the session
  std::uint32_t known_epoch = 0;  ///< heard of in the session
  std::uint32_t requests = 0;
  std::vector<std::uint32_t> asked;  ///< edits without an answer
  std::deque<EditResult> results;
  bool pose_due = false;
  bool pace_due = false;
  PvsHistory history;
  std::optional<wire::PvsMessage> newest;
  std::optional<Answer> ready;
  IdBits spare;
  std::optional<Error> failed;
  std::string last_trouble = "connecting";
  SourceStats counted;
  std::shared_ptr<zmq::context_t> context;
  zmq::socket_t socket;
};

std::uint32_t NetworkSource::epoch() const {
  return impl_->known_epoch;
}

Result<std::uint32_t> NetworkSource::edit(std::span<const Edit> edits) {
  Impl& s = *impl_;
  if (s.failed) return *s.failed;
  if (s.session == 0) return connection_error("there is no session with the server at present");
  if (s.asked.size() >= kMostRequests)
    return connection_error(std::to_string(kMostRequests) + " edits are without an answer");
  const std::uint32_t request = s.requests + 1;
  if (!s.put(wire::EditMessage{s.session, request, {edits.begin(), edits.end()}}))
    return connection_error("the server takes nothing at present");
  s.requests = request;
  s.asked.push_back(request);
  return request;
}

std::optional<EditResult> NetworkSource::edited() {
  if (impl_->results.empty()) return std::nullopt;
  EditResult result = std::move(impl_->results.front());
  impl_->results.pop_front();
  return result;
}

NetworkSource::NetworkSource(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
NetworkSource::~NetworkSource() = default;

Result<std::unique_ptr<NetworkSource>> NetworkSource::open(const NetworkOptions& options) {
  if (!options.endpoint.starts_with("tcp://") && !options.endpoint.starts_with("ipc://"))
    return invalid_argument("'" + options.endpoint +
                            "' is not an address, expected tcp://HOST:PORT or ipc://PATH");
  if (!options.reach.empty())
    if (auto reach = Reach::parse(options.reach); !reach) return reach.error();
  try {
    return std::unique_ptr<NetworkSource>(new NetworkSource(std::make_unique<Impl>(options)));
  } catch (const zmq::error_t& e) {
    return invalid_argument("cannot connect to '" + options.endpoint + "': " + e.what());
  }
}

const Catalogue* NetworkSource::catalogue() const {
  return impl_->catalogue ? &*impl_->catalogue : nullptr;
}

void NetworkSource::send(const Request& request) {
  impl_->sequence = request.sequence;
  impl_->hold_us = request.hold_us;
  impl_->observer = request.observer;
  impl_->eyes[request.sequence % kRememberedEyes] = {request.sequence, request.centre};
  impl_->pose_due = true;
  impl_->pump();
}

void NetworkSource::set_pace(const Pace& pace) {
  if (pace == impl_->options.pace) return;
  impl_->options.pace = pace;
  impl_->pace_due = true;
}

bool NetworkSource::receive(Answer& answer) {
  impl_->drain();
  impl_->pump();
  if (!impl_->ready) return false;
  impl_->spare = std::move(answer.bits);
  answer = std::move(*impl_->ready);
  impl_->ready.reset();
  return true;
}

void NetworkSource::wait(Time deadline) {
  const bool unsent = impl_->session == 0 ? Clock::now() >= impl_->next_hello : impl_->pose_due;
  const auto longest = unsent ? kSendAgain : kTimers;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
  if (left.count() <= 0) return;
  zmq::pollitem_t item{impl_->socket.handle(), 0, ZMQ_POLLIN, 0};
  try {
    zmq::poll(&item, 1, std::min<std::chrono::milliseconds>(left, longest));
  } catch (const zmq::error_t& e) {
    if (e.num() != EINTR) throw;
  }
}

bool NetworkSource::connected() const {
  return impl_->session != 0;
}
const Error* NetworkSource::failure() const {
  return impl_->failed ? &*impl_->failed : nullptr;
}
std::string NetworkSource::trouble() const {
  return impl_->last_trouble;
}
SourceStats NetworkSource::stats() const {
  return impl_->counted;
}

}  // namespace ivis::client
