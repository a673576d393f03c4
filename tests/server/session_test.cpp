#include "server/session.h"

#include <algorithm>
#include <map>
#include <random>

#include <gtest/gtest.h>

#include "tests/server/fake_method.h"
#include "tests/support/scene_builder.h"
#include "wire/object_table.h"

namespace ivis::test {
namespace {

using namespace std::chrono_literals;
using server::SessionTable;
using wire::Refusal;

/// A client's side of the conversation, without a client.
struct Peer {
  std::string name;
  std::uint64_t session = 0;
  std::vector<std::uint32_t> id_of;
  std::map<std::uint32_t, wire::PvsState> states;
};

class Sessions : public ::testing::Test {
 protected:
  Scene scene = grid_scene(12);
  NearMethod method{scene};
  server::ServedScene served = server::served_scene(scene);
  std::unique_ptr<server::Ladder> ladder =
      std::make_unique<server::Ladder>(Reach::disc(2), method, OccluderSet{}.slack_m);
  server::SessionLimits limits;
  SessionTable::Time now{};
  std::unique_ptr<SessionTable> table_;

  SessionTable& table() {
    if (!table_) table_ = std::make_unique<SessionTable>(served, *ladder, limits);
    return *table_;
  }
  std::optional<wire::Message> say(const Peer& peer, const wire::Message& m) {
    auto out = table().receive(peer.name, wire::encode(m), now);
    return out ? std::optional(decoded(*out, peer.name)) : std::nullopt;
  }
  static wire::Message decoded(const server::Outgoing& out, const std::string& peer) {
    EXPECT_EQ(out.peer, peer);
    auto m = wire::decode(out.bytes);
    EXPECT_TRUE(m) << (m ? "" : m.error().message);
    return m ? *m : wire::Message(wire::Bye{});
  }
  Peer greet(const std::string& name) {
    Peer peer{name, 0, {}, {}};
    EXPECT_FALSE(say(peer, wire::Hello{}));
    const auto out = table().work(now);
    EXPECT_TRUE(out);
    const auto welcome = std::get<wire::Welcome>(decoded(*out, name));
    peer.session = welcome.session;
    peer.id_of = welcome.table.id;
    return peer;
  }
  std::optional<wire::Message> pose(const Peer& peer, std::uint32_t sequence, const Vec3& eye,
                                    std::uint32_t have = 0) {
    return say(peer, wire::PoseMessage{peer.session, sequence, have, eye});
  }
  /// The next message of the server, which must be a PVS for `peer`.
  wire::PvsMessage next_pvs(const Peer& peer) {
    const auto out = table().work(now);
    EXPECT_TRUE(out);
    if (!out) return {};
    const auto m = decoded(*out, peer.name);
    EXPECT_TRUE(std::holds_alternative<wire::PvsMessage>(m));
    return std::get<wire::PvsMessage>(m);
  }
  std::vector<ObjectId> ids(Peer& peer, const wire::PvsMessage& m) {
    const wire::PvsState base =
        m.base == 0 ? wire::PvsState(served.objects()) : peer.states.at(m.base);
    auto state = wire::decode_pvs(m.payload, base);
    EXPECT_TRUE(state);
    std::vector<ObjectId> out;
    for (Rank r = 0; r < served.objects(); ++r)
      if (state->set.test(r)) out.push_back(peer.id_of[r]);
    std::sort(out.begin(), out.end());
    peer.states.insert_or_assign(m.sequence, *state);
    return out;
  }
  std::vector<ObjectId> truth(const Vec3& eye) {
    return method.solve({eye, Reach::disc(2)})->objects;
  }
  static Refusal reason(const std::optional<wire::Message>& m) {
    const auto* refused = m ? std::get_if<wire::Refused>(&*m) : nullptr;
    EXPECT_NE(refused, nullptr);
    return refused != nullptr ? refused->reason : Refusal{};
  }
};

TEST_F(Sessions, WelcomeNamesEveryObject) {
  Peer peer{"a", 0, {}, {}};
  say(peer, wire::Hello{});
  const auto w = std::get<wire::Welcome>(decoded(*table().work(now), "a"));
  EXPECT_EQ(w.scene_hash, scene.hash);
  EXPECT_EQ(w.objects, scene.object_count());
  EXPECT_EQ(w.reaches, std::vector<std::string>{"disc:2"});
  EXPECT_NE(w.session, 0U);
  ASSERT_EQ(w.table.id.size(), scene.object_count());
  for (Rank r = 0; r < w.objects; ++r)
    EXPECT_EQ(w.table.node[r], scene.objects[w.table.id[r]].node);
}

TEST_F(Sessions, WelcomeCarriesTheTableThatWasPackedOnce) {
  wire::ObjectTable other;
  for (std::uint32_t i = 0; i < served.objects(); ++i) {
    other.id.push_back(i);
    other.node.push_back(1000 + i);
    other.instance.push_back(0);
  }
  served.packed_table = wire::pack_table(other);
  say({"a", 0, {}, {}}, wire::Hello{});
  EXPECT_EQ(std::get<wire::Welcome>(decoded(*table().work(now), "a")).table, other);
  wire::Hello hello;
  hello.want_table = false;
  say({"b", 0, {}, {}}, hello);
  EXPECT_TRUE(std::get<wire::Welcome>(decoded(*table().work(now), "b")).table.id.empty());
}

TEST_F(Sessions, FirstAnswerIsFullAndLaterOnesDiffer) {
  Peer a = greet("a");
  pose(a, 1, {4, 1, 4});
  const auto first = next_pvs(a);
  EXPECT_EQ(first.base, 0U);
  EXPECT_EQ(ids(a, first), truth({4, 1, 4}));
  pose(a, 2, {5, 1, 4}, 1);
  const auto second = next_pvs(a);
  EXPECT_EQ(second.base, 1U);
  EXPECT_EQ(ids(a, second), truth({5, 1, 4}));
  EXPECT_LT(second.payload.size(), first.payload.size());
}

TEST_F(Sessions, AnswersAgainstTheAcknowledgedSetWhenAnswersAreLost) {
  Peer a = greet("a");
  pose(a, 1, {4, 1, 4});
  ids(a, next_pvs(a));
  for (std::uint32_t s = 2; s < 6; ++s) {  // none of these arrives
    pose(a, s, {4.0 + s, 1, 4}, 1);
    EXPECT_EQ(next_pvs(a).base, 1U);
  }
  pose(a, 6, {12, 1, 4}, 1);
  const auto m = next_pvs(a);
  EXPECT_EQ(m.base, 1U);
  EXPECT_EQ(ids(a, m), truth({12, 1, 4}));
}

TEST_F(Sessions, AcknowledgedSetOutlivesAFullMemory) {
  limits.remembered_sets = 4;
  Peer a = greet("a");
  pose(a, 1, {4, 1, 4});
  ids(a, next_pvs(a));
  for (std::uint32_t s = 2; s < 40; ++s) {
    pose(a, s, {4.0 + s % 9, 1, 4}, 1);
    const auto m = next_pvs(a);
    ASSERT_EQ(m.base, 1U);
  }
  pose(a, 40, {9, 1, 4}, 20);  // long forgotten
  const auto m = next_pvs(a);
  EXPECT_EQ(m.base, 0U);
  EXPECT_EQ(ids(a, m), truth({9, 1, 4}));
}

TEST_F(Sessions, LatestPoseWins) {
  Peer a = greet("a");
  const int solves = method.solves;
  for (std::uint32_t s = 1; s <= 10; ++s)
    pose(a, s, {1.0 * s, 1, 4});
  EXPECT_EQ(next_pvs(a).sequence, 10U);
  EXPECT_EQ(method.solves, solves + 1);
  EXPECT_FALSE(table().work(now));
  EXPECT_EQ(table().counters().superseded, 9U);
}

TEST_F(Sessions, APoseIsNotAnsweredTwice) {
  Peer a = greet("a");
  pose(a, 5, {4, 1, 4});
  next_pvs(a);
  pose(a, 5, {4, 1, 4});
  pose(a, 4, {4, 1, 4});
  EXPECT_FALSE(table().work_waiting());
}

TEST_F(Sessions, ClientsTakeTurns) {
  Peer a = greet("a");
  Peer b = greet("b");
  Peer c = greet("c");
  std::uint32_t s = 0;
  for (const Peer* p : {&a, &b, &c})
    pose(*p, 1, {4, 1, 4});
  for (int round = 0; round < 3; ++round) {
    for (const Peer* p : {&a, &b, &c}) {
      next_pvs(*p);
      pose(*p, 2 + s++, {4, 1, 4});  // asks again at once, and still waits for the others
    }
  }
}

/// Three renderers of 16 ms a frame whose PVS hold for long, as they do where there is a crowd.
class Crowd : public Sessions {
 protected:
  Peer join(const std::string& name) {
    Peer peer{name, 0, {}, {}};
    wire::Hello hello;
    hello.pace = {1, 0, 0.016};
    say(peer, hello);
    const auto w = std::get<wire::Welcome>(decoded(*table().work(now), name));
    peer.session = w.session;
    return peer;
  }
  void says(const Peer& peer, std::chrono::milliseconds at, std::uint32_t hold_ms = 200) {
    now = SessionTable::Time(1s) + at;
    sequence[peer.name] += 1;
    say(peer, wire::PoseMessage{peer.session, sequence[peer.name], 0, {4, 1, 4}, hold_ms * 1000});
  }
  std::string answered() {
    const auto out = table().work(now);
    return out ? out->peer : "";
  }
  void passes_over(const Peer& a, const Peer& b, int times) {
    for (int i = 0; i < times; ++i) {
      says(a, std::chrono::milliseconds(16 * i));
      says(b, std::chrono::milliseconds(16 * i + 1));
      answered();
    }
  }
  std::map<std::string, std::uint32_t> sequence;
};

TEST_F(Crowd, WhoCanWaitYieldsToAFresherPoseAndThenComesFirst) {
  Peer a = join("a");
  Peer b = join("b");
  passes_over(a, b, 20);  // the server learns that there is too much to do
  while (!answered().empty()) {
  }
  says(a, 400ms);
  answered();
  says(b, 401ms);
  answered();
  says(a, 416ms);
  says(b, 417ms);
  EXPECT_EQ(answered(), "b") << "the fresher pose";
  says(b, 433ms);
  says(a, 432ms);
  EXPECT_EQ(answered(), "a") << "passed over once already, as often as the crowd makes one wait";
  EXPECT_EQ(answered(), "b");
}

TEST_F(Crowd, WhoseSetRunsOutComesFirst) {
  Peer a = join("a");
  Peer b = join("b");
  passes_over(a, b, 20);
  while (!answered().empty()) {
  }
  says(a, 400ms, 10);  // needs the next one at 426 ms
  answered();
  says(b, 401ms);
  answered();
  says(a, 416ms, 10);
  says(b, 417ms);
  EXPECT_EQ(answered(), "a") << "its next pose would be too late";
}

TEST_F(Crowd, NobodyIsPassedOverForGood) {
  std::vector<Peer> all;
  for (const char* name : {"a", "b", "c", "d"})
    all.push_back(join(name));
  std::map<std::string, int> gap;
  int longest = 0;
  for (int frame = 0; frame < 400; ++frame) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      says(all[i], std::chrono::milliseconds(16 * frame + 4 * static_cast<int>(i)), 5000);
      if (i % 2 == 0) continue;  // two answers for four poses
      const std::string who = answered();
      for (const Peer& p : all)
        longest = std::max(longest, p.name == who ? (gap[p.name] = 0) : ++gap[p.name]);
    }
  }
  EXPECT_GE(longest, 3);
  EXPECT_LE(longest, 8) << "each is answered at least every fourth frame, two answers a frame";
}

TEST_F(Sessions, AnAnswerUnderWayIsLostWithItsSession) {
  Peer a = greet("a");
  pose(a, 1, {4, 1, 4});
  auto step = table().next(now);
  ASSERT_TRUE(std::holds_alternative<server::Job>(step));
  pose(a, 2, {5, 1, 4});
  EXPECT_FALSE(table().work_waiting()) << "one job of a client at a time";
  auto done = server::perform(std::move(std::get<server::Job>(step)));
  const auto again = server::JobDone(done);
  ASSERT_TRUE(table().finish(std::move(done)));
  EXPECT_TRUE(table().work_waiting());
  say(a, wire::Hello{});
  EXPECT_FALSE(table().finish(server::JobDone(again))) << "of the session before";
  table().forget("a");
  EXPECT_FALSE(table().finish(server::JobDone(again)));
  EXPECT_FALSE(table().work_waiting());
}

TEST_F(Sessions, UnsolvablePoseIsAnsweredWithEverything) {
  Peer a = greet("a");
  pose(a, 1, {4, -60, 4});
  EXPECT_TRUE(next_pvs(a).everything);
  EXPECT_EQ(table().counters().solve_errors, 1U);
  pose(a, 2, {4, 60, 4});
  EXPECT_TRUE(next_pvs(a).everything);
  pose(a, 3, {4, 1, 4}, 0);
  EXPECT_EQ(ids(a, next_pvs(a)), truth({4, 1, 4}));
  pose(a, 4, {4, -600, 4});
  EXPECT_TRUE(next_pvs(a).everything) << "the method throws";
  EXPECT_EQ(table().counters().solve_errors, 2U);
  pose(a, 5, {4, 1, 4}, 0);
  EXPECT_EQ(ids(a, next_pvs(a)), truth({4, 1, 4}));
}

TEST_F(Sessions, RefusesUnknownSession) {
  EXPECT_EQ(reason(say({"x", 0, {}, {}}, wire::PoseMessage{77, 1, 0, {}})), Refusal::kSession);
  Peer a = greet("a");
  EXPECT_EQ(reason(say({"b", 0, {}, {}}, wire::PoseMessage{a.session, 1, 0, {}})),
            Refusal::kSession)
      << "a session belongs to the peer that began it";
  EXPECT_EQ(reason(say(a, wire::PoseMessage{a.session + 1, 1, 0, {}})), Refusal::kSession);
  EXPECT_FALSE(table().work_waiting());
}

TEST_F(Sessions, RefusesAnotherSceneNamingBothHashes) {
  wire::Hello hello;
  hello.scene_hash = 0x1234;
  const auto m = say({"a", 0, {}, {}}, hello);
  ASSERT_EQ(reason(m), Refusal::kScene);
  const std::string text = std::get<wire::Refused>(*m).text;
  EXPECT_NE(text.find("0000000000001234"), std::string::npos) << text;
  char own[20];
  std::snprintf(own, sizeof own, "%016llx", static_cast<unsigned long long>(scene.hash));
  EXPECT_NE(text.find(own), std::string::npos) << text;
}

TEST_F(Sessions, RefusesTheSameSceneAtTheOtherGranularityAndSaysSo) {
  const auto text_for = [&](SceneHash hash) {
    wire::Hello hello;
    hello.scene_hash = hash;
    const auto m = say({"a", 0, {}, {}}, hello);
    EXPECT_EQ(reason(m), Refusal::kScene);
    return std::get<wire::Refused>(*m).text;
  };
  EXPECT_NE(text_for(1).find("client splits into clusters (granularity cluster)"),
            std::string::npos);
  served.whole_hash = 0x5678;  // as of a scene that was split
  EXPECT_NE(text_for(0x5678).find("the same file, which the server splits into clusters"),
            std::string::npos);
  EXPECT_NE(text_for(1).find("another file than the server's, which is split into clusters"),
            std::string::npos);
}

TEST_F(Sessions, RefusesAnotherVersion) {
  wire::Hello hello;
  hello.version = 99;
  EXPECT_EQ(reason(say({"a", 0, {}, {}}, hello)), Refusal::kVersion);
}

TEST_F(Sessions, ServesASmallerReachAndRefusesALargerOne) {
  wire::Hello hello;
  hello.reach = "disc:1";
  EXPECT_FALSE(say({"a", 0, {}, {}}, hello));
  EXPECT_EQ(std::get<wire::Welcome>(decoded(*table().work(now), "a")).reaches,
            std::vector<std::string>{"disc:1"});
  hello.reach = "disc:2.1";
  EXPECT_EQ(reason(say({"a", 0, {}, {}}, hello)), Refusal::kReach);
  hello.reach = "ball:1";  // reaches up, where the disc does not
  EXPECT_EQ(reason(say({"a", 0, {}, {}}, hello)), Refusal::kReach);
  hello.reach = "nonsense";
  EXPECT_EQ(reason(say({"a", 0, {}, {}}, hello)), Refusal::kReach);
}

TEST_F(Sessions, CompareReachesWithTheSlackOfTheOccludersAsASolveDoes) {
  // Padding scales an ellipsoid up as a whole: with much slack it outgrows the cylinder.
  OccluderSet occluders;
  occluders.reach = Reach::cylinder(1, 0.5);
  wire::Hello hello;
  hello.reach = "ellipsoid:0.95,0.4,0.95";
  for (const double slack_m : {0.001, 0.05}) {
    occluders.slack_m = slack_m;
    ladder = std::make_unique<server::Ladder>(occluders.reach, method, slack_m);
    table_ = std::make_unique<SessionTable>(served, *ladder, limits);
    const auto refused = say({"a", 0, {}, {}}, hello);
    EXPECT_EQ(!refused, serves(occluders, *Reach::parse(hello.reach))) << slack_m;
    EXPECT_EQ(!refused, slack_m < 0.01);
  }
}

class SessionsOnALadder : public Sessions {
 protected:
  NearMethod small{scene, 4}, middle{scene, 6};
  SessionsOnALadder() {
    ladder = std::make_unique<server::Ladder>(
        std::vector<Reach>{Reach::disc(0.5), Reach::disc(1), Reach::disc(2)}, method, 0.001);
    ladder->add(0, small);
    ladder->add(1, middle);
  }
  Peer greet_with(const wire::Hello& hello, std::vector<std::string> reaches) {
    Peer peer{"a", 0, {}, {}};
    EXPECT_FALSE(say(peer, hello));
    const auto w = std::get<wire::Welcome>(decoded(*table().work(now), "a"));
    EXPECT_EQ(w.reaches, reaches);
    peer.session = w.session;
    peer.id_of = w.table.id;
    return peer;
  }
  wire::PvsMessage answered(const Peer& peer, std::uint32_t sequence, std::uint32_t hold_us) {
    EXPECT_FALSE(say(peer, wire::PoseMessage{peer.session, sequence, 0, {11, 1, 11}, hold_us}));
    return next_pvs(peer);
  }
};

TEST_F(SessionsOnALadder, TheCellIsTheSmallestThatHoldsTheSpeedForTheTime) {
  wire::Hello hello;
  hello.pace = {10, 0, 0.02};
  Peer a = greet_with(hello, {"disc:0.5", "disc:1", "disc:2"});
  EXPECT_EQ(answered(a, 1, 0).rung, 2) << "no time is known";
  wire::PvsMessage m = answered(a, 2, 50'000);
  EXPECT_EQ(m.rung, 0);
  EXPECT_EQ(m.safe, wire::PvsMessage::kAllSafe);
  EXPECT_EQ(ids(a, m), small.solve({{11, 1, 11}, Reach::disc(0.5)})->objects);
  m = answered(a, 3, 51'000);
  EXPECT_EQ(m.rung, 1);
  EXPECT_EQ(ids(a, m), middle.solve({{11, 1, 11}, Reach::disc(1)})->objects);
  m = answered(a, 4, 400'000);  // 4 m
  EXPECT_EQ(m.rung, 2);
  EXPECT_NEAR(m.safe, wire::PvsMessage::kAllSafe / 2, 60);
  EXPECT_LE(m.safe * 4.0 / wire::PvsMessage::kAllSafe, 2.003);
  EXPECT_EQ(table().counters().beyond_ladder, 1U);
  // Faster from now on.
  EXPECT_FALSE(say(a, wire::PaceMessage{a.session, {20, 0, 0.02}}));
  EXPECT_EQ(answered(a, 5, 50'000).rung, 1);
  EXPECT_FALSE(say(a, wire::PaceMessage{a.session, {}}));
  EXPECT_EQ(answered(a, 6, 50'000).rung, 2) << "nothing is told any more";
  EXPECT_EQ(reason(say(a, wire::PaceMessage{a.session + 1, {}})), Refusal::kSession);
  EXPECT_EQ(reason(say({"nobody", 0, {}, {}}, wire::PaceMessage{1, {}})), Refusal::kSession);
}

TEST_F(SessionsOnALadder, ACellAheadOfWhoTurnsSlowlyIsSmallerAndLiesWhereItWasWished) {
  wire::Hello hello;
  hello.pace = {10, 0, 0.02, 0.5};
  Peer a = greet_with(hello, {"disc:0.5", "disc:1", "disc:2"});
  EXPECT_EQ(answered(a, 1, 90'000).rung, 1) << "0.9 m, all around";
  wire::PoseMessage pose{a.session, 2, 0, {11, 1, 11}, 90'000};
  pose.observer = Vec3(10.55, 1, 11);
  EXPECT_FALSE(say(a, pose));
  const wire::PvsMessage m = next_pvs(a);
  EXPECT_EQ(m.rung, 0);
  EXPECT_EQ(m.safe, wire::PvsMessage::kAllSafe);
  EXPECT_FALSE(m.eye);
  EXPECT_EQ(ids(a, m), small.solve({{11, 1, 11}, Reach::disc(0.5)})->objects);
  // It turns at once from now on.
  EXPECT_FALSE(say(a, wire::PaceMessage{a.session, {10, 0, 0.02}}));
  pose.sequence = 3;
  EXPECT_FALSE(say(a, pose));
  EXPECT_EQ(next_pvs(a).rung, 1);
}

TEST_F(SessionsOnALadder, AWishForAStrategyReachesTheMethodAsWork) {
  struct Recording : NearMethod {
    using NearMethod::NearMethod;
    using NearMethod::solve;
    Result<Pvs> solve(const ViewCell& cell, const Effort& effort, Work& done) const override {
      seen.push_back(effort);
      done.cut = true;
      return NearMethod::solve(cell);
    }
    bool keeps_to_effort() const override { return true; }
    mutable std::vector<Effort> seen;
  };
  const Recording recording(scene);
  const server::Ladder one(Reach::disc(2), recording, 0.001);
  server::CostModel cost;
  cost.fixed_ms = 0.1;
  cost.draw_ms = 0.001;
  cost.test_ms = 0.002;
  cost.draw_share = 0.25;
  limits.strategy = Strategy::kPredictive;
  limits.budget_ms = 0.5;
  table_ = std::make_unique<SessionTable>(served, one, limits, cost);
  wire::Hello hello;
  const auto asked = [&](std::uint32_t sequence) {
    Peer a = greet_with(hello, {"disc:2"});
    EXPECT_FALSE(say(a, wire::PoseMessage{a.session, sequence, 0, {11, 1, 11}, 0}));
    static_cast<void>(next_pvs(a));
  };
  asked(1);  // the server's own
  hello.strategy = Strategy::kAbort;
  hello.budget_us = 1100;
  asked(2);
  hello.budget_us = 50;  // less than what is fixed
  asked(3);
  EXPECT_EQ(table().counters().cut_short, 3U);
  hello.strategy = Strategy::kGuaranteed;
  asked(4);
  ASSERT_EQ(recording.seen.size(), 3U) << "guaranteed needs no budget";
  EXPECT_EQ(recording.seen[0].strategy, Strategy::kPredictive);
  EXPECT_EQ(recording.seen[0].draw, 100U);
  EXPECT_EQ(recording.seen[0].test, 150U);
  EXPECT_EQ(recording.seen[1].strategy, Strategy::kAbort);
  EXPECT_EQ(recording.seen[1].draw, 250U);
  EXPECT_EQ(recording.seen[1].test, 375U);
  EXPECT_EQ(recording.seen[2].draw, 0U);
  EXPECT_EQ(recording.seen[2].test, 0U);
}

TEST_F(SessionsOnALadder, AClientThatNamesItsReachGetsThatOnly) {
  wire::Hello hello;
  hello.pace = {10, 0, 0.02};
  hello.reach = "disc:0.8";
  Peer a = greet_with(hello, {"disc:0.8"});
  for (const std::uint32_t hold_us : {0U, 10'000U, 900'000U}) {
    const wire::PvsMessage m = answered(a, 1 + hold_us, hold_us);
    EXPECT_EQ(m.rung, 0);
    EXPECT_EQ(m.safe == wire::PvsMessage::kAllSafe, hold_us < 80'000) << "10 m/s";
    EXPECT_EQ(ids(a, m), method.solve({{11, 1, 11}, Reach::disc(0.8)})->objects)
        << "always by the largest rung's occluders";
  }
}

class Edits : public Sessions {
 protected:
  const OccluderSet set;
  const OccluderIndex index{set};
  server::SceneState state{scene};
  Edits() { open(); }
  void open() {
    ladder = std::make_unique<server::Ladder>(Reach::disc(2), method, set.slack_m, &index);
    table_ = std::make_unique<SessionTable>(served, *ladder, limits, server::CostModel{}, &state);
  }
  wire::EditedMessage edit(const Peer& peer, const std::vector<Edit>& edits) {
    const auto m = say(peer, wire::EditMessage{peer.session, ++request, edits});
    EXPECT_TRUE(m && std::holds_alternative<wire::EditedMessage>(*m));
    const auto edited = std::get<wire::EditedMessage>(*m);
    EXPECT_EQ(edited.request, request);
    return edited;
  }
  wire::PvsMessage ask(const Peer& peer, std::uint32_t sequence, std::uint32_t epoch,
                       std::uint32_t hold_us = 0) {
    say(peer, wire::PoseMessage{peer.session, sequence, 0, {4, 1, 4}, hold_us, epoch});
    return next_pvs(peer);
  }
  std::uint32_t request = 0;
};

TEST_F(Edits, ComeWithTheNextSetUntilTheyAreAcknowledged) {
  Peer a = greet("a");
  Peer b = greet("b");
  EXPECT_EQ(ask(a, 1, 0).changes, wire::SceneChanges{}) << "nothing was ever changed";
  EXPECT_EQ(edit(a, {{EditKind::kRemove, 27, {}, 0}}).epoch, 1U);
  EXPECT_EQ(edit(b, {{EditKind::kMove, 28, {{1, 0, 0}, {1, 0, 0, 0}}, 0}}).epoch, 2U);
  for (const Peer* p : {&a, &b}) {
    for (std::uint32_t s = 2; s < 4; ++s) {  // the first is lost
      const auto m = ask(*p, s, 0);
      EXPECT_EQ(m.changes.epoch, 2U);
      EXPECT_EQ(m.changes.since, 0U);
      EXPECT_EQ(m.changes.valid_us, 0U) << "nothing moves by itself";
      ASSERT_EQ(m.changes.objects.size(), 2U);
    }
    const auto m = ask(*p, 4, 1);
    EXPECT_EQ(m.changes.since, 1U);
    ASSERT_EQ(m.changes.objects.size(), 1U);
    EXPECT_EQ(m.changes.objects[0].id, 28U);
    EXPECT_TRUE(m.changes.objects[0].moved);
    EXPECT_TRUE(ask(*p, 5, 2).changes.objects.empty());
    EXPECT_EQ(ask(*p, 6, 99).changes.since, 0U) << "an epoch that never was";
  }
  const auto m = ask(a, 7, 2);
  EXPECT_EQ(std::ranges::count(ids(a, m), 27U), 0) << "a removed object is not listed";
}

TEST_F(Edits, AreRefusedWithTheReasonAndEndNothing) {
  Peer a = greet("a");
  const auto refused = edit(a, {{EditKind::kRemove, 5, {}, 0}, {EditKind::kRemove, 144, {}, 0}});
  EXPECT_EQ(refused.epoch, 0U);
  EXPECT_EQ(refused.text, "no object 144, expected an id below 144");
  EXPECT_EQ(ask(a, 1, 0).changes.epoch, 0U) << "nor was the first of the two done";
  EXPECT_EQ(table().counters().edits_refused, 1U);
  EXPECT_EQ(reason(say(a, wire::EditMessage{a.session + 1, 1, {{EditKind::kRemove, 5, {}, 0}}})),
            Refusal::kSession);
  limits.edits = false;
  open();
  Peer b = greet("b");
  EXPECT_EQ(edit(b, {{EditKind::kRemove, 5, {}, 0}}).text,
            "this server takes no edits (ivisd --edits on)");
  table_ = std::make_unique<SessionTable>(served, *ladder, server::SessionLimits{});
  Peer c = greet("c");
  EXPECT_EQ(edit(c, {{EditKind::kRemove, 5, {}, 0}}).text, "the method near takes no edits");
}

TEST_F(Edits, AnAnswerUnderWayIsOfTheSceneItWasBegunFor) {
  Peer a = greet("a");
  edit(a, {{EditKind::kOccluderOff, 3, {}, 0}});
  pose(a, 1, {4, 1, 4});
  auto step = table().next(now);
  edit(a, {{EditKind::kRemove, 27, {}, 0}});
  const auto out = table().finish(server::perform(std::move(std::get<server::Job>(step))));
  ASSERT_TRUE(out);
  const auto m = std::get<wire::PvsMessage>(decoded(*out, "a"));
  EXPECT_EQ(m.changes.epoch, 1U);
  EXPECT_EQ(std::ranges::count(ids(a, m), 27U), 1);
  EXPECT_EQ(ask(a, 2, 1).changes.epoch, 2U);
}

TEST_F(Edits, WhoAsksNothingIsToldOnce) {
  Peer a = greet("a");
  Peer b = greet("b");
  now = SessionTable::Time(1s);
  ask(a, 1, 0);
  ask(b, 1, 0);
  EXPECT_TRUE(table().notices(now).empty());
  edit(a, {{EditKind::kRemove, 5, {}, 0}});
  EXPECT_TRUE(table().notices(now + 10ms).empty()) << "both will ask again soon";
  now += 20ms;
  ask(a, 2, 0);
  const auto told = table().notices(now + 55ms);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(std::get<wire::NoticeMessage>(decoded(told[0], "b")).epoch, 1U);
  EXPECT_TRUE(table().notices(now + 10s).empty());
  edit(a, {{EditKind::kRemove, 6, {}, 0}});
  EXPECT_EQ(table().notices(now + 10s).size(), 2U);
}

TEST_F(Edits, ASceneWithMoversIsValidForATime) {
  Peer a = greet("a");
  edit(a, {{EditKind::kMove, 5, {{0, 0, 0}, {1, 0, 0, 0}}, 10}});
  EXPECT_EQ(ask(a, 1, 0, 0).changes.valid_us, 1'000'000U) << "it is not known for how long";
  EXPECT_EQ(ask(a, 5, 0, 20'000).changes.valid_us, 100'000U);
  EXPECT_EQ(ask(a, 6, 0, 50'000).changes.valid_us, 150'000U);
  EXPECT_EQ(ask(a, 7, 0, 4'000'000'000).changes.valid_us, 1'000'000U);
  edit(a, {{EditKind::kMove, 5, {{0, 0, 0}, {1, 0, 0, 0}}, 0}});
  EXPECT_EQ(ask(a, 8, 0, 0).changes.valid_us, 0U);
}

TEST(EditsOfMuch, ComeInStepsInWhichEverythingIsListed) {
  SceneBuilder b;
  for (int i = 0; i < 6000; ++i)
    b.add_box({2.0 * i, 0, 0}, {2.0 * i + 1, 1, 1}, OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  const NearMethod method(scene);
  const server::ServedScene served = server::served_scene(scene);
  const OccluderSet set;
  const OccluderIndex index(set);
  const server::Ladder ladder(Reach::disc(2), method, set.slack_m, &index);
  server::SceneState state(scene);
  SessionTable table(served, ladder, {}, {}, &state);
  SessionTable::Time now(1s);
  std::uint64_t session = 0;
  const auto say = [&](const wire::Message& m) {
    const auto reply = table.receive("a", wire::encode(m), now);
    const auto out = reply ? reply : table.work(now);
    EXPECT_TRUE(out);
    auto decoded = wire::decode(out->bytes);
    EXPECT_TRUE(decoded);
    return *decoded;
  };
  session = std::get<wire::Welcome>(say(wire::Hello{})).session;
  for (ObjectId first = 0; first < 6000; first += 1000) {
    wire::EditMessage edit{session, 1, {}};
    for (ObjectId id = first; id < first + 1000; ++id)
      edit.edits.push_back({EditKind::kRemove, id, {}, 0});
    EXPECT_NE(std::get<wire::EditedMessage>(say(edit)).epoch, 0U);
  }
  auto m = std::get<wire::PvsMessage>(say(wire::PoseMessage{session, 1, 0, {4, 1, 4}, 0, 0}));
  EXPECT_TRUE(m.everything);
  EXPECT_EQ(m.changes.epoch, 5U);
  EXPECT_EQ(m.changes.objects.size(), 5000U);
  const auto told = table.notices(now + 1s);
  ASSERT_EQ(told.size(), 1U) << "the client has to ask for the rest";
  m = std::get<wire::PvsMessage>(say(wire::PoseMessage{session, 2, 0, {4, 1, 4}, 0, 5}));
  EXPECT_FALSE(m.everything);
  EXPECT_EQ(m.changes.epoch, 6U);
  EXPECT_EQ(m.changes.since, 5U);
  EXPECT_EQ(m.changes.objects.size(), 1000U);
  EXPECT_TRUE(table.notices(now + 2s).empty());
}

TEST_F(Edits, OfTheSameObjectTheLastCounts) {
  Peer a = greet("a");
  Peer b = greet("b");
  for (int i = 0; i < 50; ++i) {
    edit(a, {{EditKind::kMove, 5, {{1.0 * i, 0, 0}, {1, 0, 0, 0}}, 0}});
    edit(b, {{i % 2 == 0 ? EditKind::kRemove : EditKind::kAdd, 5, {}, 0}});
  }
  for (const Peer* p : {&a, &b}) {
    const auto m = ask(*p, 1, 0);
    ASSERT_EQ(m.changes.objects.size(), 1U);
    EXPECT_FALSE(m.changes.objects[0].removed);
    EXPECT_EQ(m.changes.objects[0].placement.position.x, 49);
    EXPECT_EQ(m.changes.epoch, 100U);
  }
}

TEST_F(Edits, AStormOfThemKeepsNobodyFromBeingAnswered) {
  Peer a = greet("a");
  Peer b = greet("b");
  std::mt19937 random(9);
  for (std::uint32_t round = 1; round < 40; ++round) {
    std::vector<Edit> edits;
    for (int k = 0; k < 500; ++k)
      edits.push_back({static_cast<EditKind>(1 + random() % 5),
                       static_cast<ObjectId>(random() % 144),
                       {{static_cast<double>(random() % 20), 0, 0}, {1, 0, 0, 0}},
                       static_cast<float>(random() % 3)});
    EXPECT_EQ(edit(a, edits).epoch, round);
    const auto m = ask(b, round, round - 1);
    EXPECT_EQ(m.changes.epoch, round);
    EXPECT_LE(m.changes.objects.size(), 144U);
  }
}

TEST_F(Sessions, GarbageIsRefusedAndCountedAndEndsNothing) {
  Peer a = greet("a");
  std::mt19937 random(7);
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::byte> bytes(random() % 200);
    for (auto& b : bytes)
      b = static_cast<std::byte>(random());
    table().receive(i % 2 == 0 ? "a" : "evil", bytes, now);
  }
  EXPECT_EQ(table().counters().malformed, 2000U);
  EXPECT_EQ(table().size(), 1U);
  pose(a, 1, {4, 1, 4});
  EXPECT_EQ(ids(a, next_pvs(a)), truth({4, 1, 4}));
}

TEST_F(Sessions, DamagedMessagesNeverCrash) {
  const Peer a = greet("a");
  std::mt19937 random(11);
  wire::Hello hello;
  hello.reach = "disc:1";
  for (const wire::Message& m :
       {wire::Message(hello), wire::Message(wire::PoseMessage{a.session, 1, 0, {4, 1, 4}}),
        wire::Message(wire::Bye{a.session})}) {
    const auto sound = wire::encode(m);
    for (int i = 0; i < 3000; ++i) {
      auto bytes = sound;
      bytes[random() % bytes.size()] ^= static_cast<std::byte>(1U << (random() % 8));
      if (i % 3 == 0) bytes.resize(random() % bytes.size());
      table().receive("evil" + std::to_string(i % 5), bytes, now);
      table().work(now);
    }
  }
  EXPECT_LE(table().size(), 6U);
}

TEST_F(Sessions, RefusesMessagesThatOnlyAServerSends) {
  EXPECT_EQ(reason(say({"a", 0, {}, {}}, wire::PvsMessage{})), Refusal::kMalformed);
  EXPECT_EQ(reason(say({"a", 0, {}, {}}, wire::Refused{})), Refusal::kMalformed);
}

TEST_F(Sessions, RefusesAPoseWithoutSequence) {
  const Peer a = greet("a");
  EXPECT_EQ(reason(pose(a, 0, {4, 1, 4})), Refusal::kMalformed);
  EXPECT_EQ(table().size(), 0U);
}

TEST_F(Sessions, TakesNoMoreThanItsLimit) {
  limits.max_sessions = 3;
  for (const char* name : {"a", "b", "c"})
    greet(name);
  EXPECT_EQ(reason(say({"d", 0, {}, {}}, wire::Hello{})), Refusal::kBusy);
  greet("b");  // a known peer may greet again
  EXPECT_EQ(table().size(), 3U);
}

TEST_F(Sessions, ExpireWhenSilentOnly) {
  limits.idle = 10s;
  const Peer a = greet("a");
  greet("b");
  now += 6s;
  pose(a, 1, {4, 1, 4});
  now += 6s;
  EXPECT_EQ(table().expire(now), 1U);
  EXPECT_EQ(table().size(), 1U);
  EXPECT_EQ(next_pvs(a).sequence, 1U);
  EXPECT_EQ(reason(say({"b", 0, {}, {}}, wire::PoseMessage{1, 1, 0, {}})), Refusal::kSession);
}

TEST_F(Sessions, HelloAgainBeginsANewSession) {
  const Peer a = greet("a");
  pose(a, 1, {4, 1, 4});
  const Peer again = greet("a");
  EXPECT_NE(a.session, again.session);
  EXPECT_FALSE(table().work(now)) << "the pose was of the old session";
  EXPECT_EQ(reason(pose(a, 2, {4, 1, 4})), Refusal::kSession);
  pose(again, 1, {4, 1, 4}, 1);
  EXPECT_EQ(next_pvs(again).base, 0U) << "a new session remembers no sets";
}

TEST_F(Sessions, ByeAndCloseEndSessions) {
  const Peer a = greet("a");
  greet("b");
  say({"b", 0, {}, {}}, wire::Bye{a.session});
  EXPECT_EQ(table().size(), 2U) << "another's session";
  say(a, wire::Bye{a.session});
  EXPECT_EQ(table().size(), 1U);
  const auto farewells = table().close();
  ASSERT_EQ(farewells.size(), 1U);
  EXPECT_EQ(reason(decoded(farewells[0], "b")), Refusal::kClosing);
  EXPECT_EQ(table().size(), 0U);
}

TEST_F(Sessions, AFloodOfGreetingsStaysWithinBounds) {
  limits.max_sessions = 4;
  for (int i = 0; i < 1000; ++i)
    say({std::to_string(i), 0, {}, {}}, wire::Hello{});
  for (int i = 0; i < 1000; ++i)
    say({"0", 0, {}, {}}, wire::Hello{});
  int answered = 0;
  while (table().work(now))
    ++answered;
  EXPECT_EQ(answered, 4);
}

}  // namespace
}  // namespace ivis::test
