#pragma once
// What the server knows of its clients. No sockets: messages in, messages out.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <variant>
#include <vector>

#include "core/reach.h"
#include "server/cost_model.h"
#include "server/job.h"
#include "server/ladder.h"
#include "server/scene_state.h"
#include "wire/messages.h"

namespace ivis::server {

struct SessionLimits {
  std::size_t max_sessions = 256;
  /// Of clients that wish for no other.
  Strategy strategy = Strategy::kGuaranteed;
  double budget_ms = 1;                      ///< of one solve
  std::chrono::milliseconds idle{60'000};    ///< silence after which a session is over
  std::chrono::milliseconds least_solve{0};  ///< a solve takes no less: to try out a slow server
  bool edits = true;                         ///< may clients change the scene?
  std::size_t remembered_sets = 32;          ///< PVS a session that may become a base
  std::size_t remembered_bytes = 4U << 20U;  ///< of them; at least two are kept whatever their size
};

struct SessionCounters {
  std::uint64_t welcomed = 0;
  std::uint64_t refused = 0;
  std::uint64_t malformed = 0;
  std::uint64_t expired = 0;
  std::uint64_t poses = 0;
  std::uint64_t superseded = 0;  ///< poses that a later one overtook before their turn
  std::uint64_t answers = 0;
  std::uint64_t full_sets = 0;
  std::uint64_t solve_errors = 0;
  std::uint64_t cut_short = 0;      ///< answers that left something undrawn or untested
  std::uint64_t edits = 0;          ///< done, of how many messages ever
  std::uint64_t edits_refused = 0;  ///< messages
  std::uint64_t beyond_ladder = 0;  ///< answers whose cell holds less than the speeds told
  std::uint64_t bytes_out = 0;      ///< of answers
};

/// A message and the peer it goes to.
struct Outgoing {
  std::string peer;
  std::vector<std::byte> bytes;
};

/// The sessions of one server: takes messages in with receive(), hands out what is to be done with
/// next(), takes back what came of it with finish(). A later pose of a client replaces its earlier
/// one; one job of a client is under way at a time. Each client has a deadline, by when the PVS it
/// has should be replaced; who cannot wait for his next pose comes first, by deadline, then who has
/// said last where he is: his PVS will be the freshest. An answer is coded against the newest PVS
/// the client has acknowledged, so that any message may be lost. The cell is the smallest of the
/// ladder that holds the observer for as long as it says a PVS is in use (docs/theory.md, 6).
/// Threads:   one thread at a time; jobs are done in any. Ownership: borrows scene and ladder.
/// Limits:    max_sessions, and per session remembered_bytes of sets; a full table refuses with
/// kBusy.
class SessionTable {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// The ladder's largest reach is the largest one that may be asked for.
  /// `cost`: what makes budgets of milliseconds ones of work; not asked for kGuaranteed.
  /// `state`: of the scene, for edits; null: there are none.
  SessionTable(const ServedScene& scene, const Ladder& ladder, SessionLimits limits,
               const CostModel& cost = {}, SceneState* state = nullptr);

  /// Takes one message of `peer`; never fails: what is wrong comes back as a Refused to send.
  std::optional<Outgoing> receive(std::string_view peer, std::span<const std::byte> bytes,
                                  Time now);

  /// Is there something for next()?
  bool work_waiting() const { return !waiting_.empty(); }
  /// A message to send, or a job to perform() and bring back to finish(); monostate: nothing waits.
  using Next = std::variant<std::monostate, Outgoing, Job>;
  Next next(Time now);
  /// The answer, unless its session has ended.
  std::optional<Outgoing> finish(JobDone done);
  /// next(), performed here and finished.
  std::optional<Outgoing> work(Time now);

  /// Tells those that ask nothing at present of what has changed since they were told last.
  std::vector<Outgoing> notices(Time now);

  /// The transport says that this peer is gone.
  void forget(std::string_view peer);
  /// Ends sessions that said nothing for limits.idle. Returns how many.
  std::size_t expire(Time now);
  /// Serves another scene from now on; its sessions end, and the clients are told to begin new
  /// ones. No job may be under way. Borrows as the constructor.
  std::vector<Outgoing> replace(const ServedScene& scene, const Ladder& ladder,
                                const CostModel& cost, SceneState* state);
  /// A farewell to every client; no session is left.
  std::vector<Outgoing> close();

  /// Is everything listed, as an edit is half done? (SceneState::torn())
  bool scene_torn() const { return state_ != nullptr && state_->torn(); }
  std::size_t size() const { return sessions_.size(); }
  const SessionCounters& counters() const { return counters_; }

 private:
  struct Remembered {
    std::uint32_t sequence;
    std::shared_ptr<const wire::PvsState> state;
  };

  struct Session {
    std::uint64_t id = 0;
    std::optional<Reach> reach;  ///< of every cell; none: the ladder's
    Pace pace;
    Effort effort;
    Time heard{};
    Time due{};  ///< by when its PVS should be replaced
    bool welcome_due = false;
    bool table_wanted = false;
    bool under_way = false;           ///< a job of it
    bool waiting = false;             ///< is in waiting_
    std::uint32_t passed_over = 0;    ///< poses since the last that was answered
    std::uint32_t last_sequence = 0;  ///< of poses received
    std::uint32_t told_epoch = 0;     ///< of the newest job or notice
    std::uint32_t acknowledged = 0;   ///< sequence of the PVS the client holds
    std::optional<wire::PoseMessage> pose;
    Time posed{};                 ///< when that pose came
    std::deque<Remembered> sent;  ///< ascending sequence
  };

  using Peers = std::unordered_map<std::string, Session>;

  std::optional<Outgoing> handle(std::string_view peer, const wire::Hello& hello, Time now);
  std::optional<Outgoing> handle(std::string_view peer, const wire::PoseMessage& pose, Time now);
  std::optional<Outgoing> handle(std::string_view peer, const wire::PaceMessage& pace, Time now);
  std::optional<Outgoing> handle(std::string_view peer, const wire::EditMessage& edit, Time now);
  std::optional<Outgoing> handle(std::string_view peer, const wire::Bye& bye);
  SceneState::Outcome apply(const wire::EditMessage& edit, Time now);
  std::vector<Outgoing> end_all(wire::Refusal reason, const std::string& text);
  /// The peer's session if it is the one named, else null.
  Session* find(std::string_view peer, std::uint64_t id);
  Outgoing refuse_unknown(std::string_view peer, std::uint64_t session);
  Outgoing refuse(std::string_view peer, std::uint64_t session, wire::Refusal reason,
                  std::string text);
  std::vector<std::byte> welcome(Session& session);
  Job answer(Peers::value_type& peer, Time now);
  void add_changes(const Ladder::Choice& choice, const wire::PoseMessage& pose, Time now,
                   Job& job) const;
  Ladder::Choice choose(const Session& session, const wire::PoseMessage& pose) const;
  void remember(Session& session, std::uint32_t sequence,
                std::shared_ptr<const wire::PvsState> state);
  /// May its latest pose be passed over for the next one, which is a frame later?
  bool can_wait(const Session& session, Time now) const;
  bool before(const Session& a, const Session& b, Time now) const;
  void enqueue(Peers::value_type& peer);
  std::size_t remembered_limit() const;

  const ServedScene* scene_;
  const Ladder* ladder_;
  SessionLimits limits_;
  CostModel cost_;
  SceneState* state_;
  std::uint32_t noticed_epoch_ = 0;  ///< all have been told of
  SessionCounters counters_;
  Peers sessions_;
  std::vector<Peers::value_type*> waiting_;  ///< with something to be done, in any order
  double passed_over_ = 0;                   ///< poses an answer, lately
  std::mt19937_64 ids_;
};

}  // namespace ivis::server
