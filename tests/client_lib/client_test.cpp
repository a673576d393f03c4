#include <ivis/ivis.hpp>

#include <cmath>
#include <cstdio>
#include <functional>
#include <optional>
#include <set>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/running_server.h"
#include "tests/support/scene_builder.h"

namespace ivis::test {
namespace {

constexpr int kWait = 10'000;  // ms; only ever waited out by a failure

VisibilityClient connect(const std::string& endpoint, ivis_policy policy = IVIS_POLICY_EVERYTHING,
                         std::uint64_t scene_hash = 0) {
  ivis_client_options options = ivis_client_options_default();
  options.endpoint = endpoint.c_str();
  options.policy = policy;
  options.scene_hash = scene_hash;
  options.connect_timeout_ms = kWait;
  options.silence_timeout_ms = 500;
  return VisibilityClient::connect(options);
}

std::set<std::uint32_t> ids(const PvsView& view) {
  std::set<std::uint32_t> out;
  for (std::uint32_t id = 0; id < view.object_count(); ++id)
    if (view.visible(id)) out.insert(id);
  return out;
}

std::set<std::uint32_t> solved(const Method& method, const double (&eye)[3]) {
  const auto pvs = method.solve({{eye[0], eye[1], eye[2]}, Reach::cylinder(1.5, 0.1)});
  return {pvs->objects.begin(), pvs->objects.end()};
}

class ClientOverTcp : public ::testing::Test {
 protected:
  Scene scene = grid_scene(20);
  NearMethod method{scene};
};

TEST_F(ClientOverTcp, GetsTheSetsThatTheMethodGives) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint());
  ASSERT_TRUE(client) << client.error();
  for (int i = 0; i < 40; ++i) {
    const double eye[3]{1.0 * i, 1.7, 20 + 10 * std::sin(i)};
    ASSERT_EQ(client.pose(eye), IVIS_OK);
    ASSERT_EQ(client.wait(kWait), IVIS_OK) << client.error();
    const PvsView view = client.view(eye);
    EXPECT_TRUE(view.covered());
    EXPECT_FALSE(view.everything());
    EXPECT_EQ(ids(view), solved(method, eye));
    EXPECT_EQ(view.count(), ids(view).size());
  }
  const ivis_stats stats = client.stats();
  EXPECT_EQ(stats.poses, 40U);
  EXPECT_EQ(stats.answers, 40U);
  EXPECT_EQ(stats.uncovered_frames, 0U);
  EXPECT_EQ(stats.bad_messages, 0U);
  EXPECT_GT(stats.bytes, 40U);
  server.stop();
  EXPECT_EQ(server.counters().full_sets, 1U);
}

TEST_F(ClientOverTcp, BeforeTheFirstAnswerEverythingIsVisibleAndCounted) {
  ivis_client_options options = ivis_client_options_default();
  options.endpoint = "tcp://127.0.0.1:1";  // nobody
  options.connect_timeout_ms = 0;
  for (const ivis_policy policy :
       {IVIS_POLICY_EVERYTHING, IVIS_POLICY_STALL, IVIS_POLICY_INCOMPLETE}) {
    options.policy = policy;
    auto client = VisibilityClient::connect(options);
    ASSERT_TRUE(client) << client.error();
    const PvsView view = client.frame({1, 2, 3});
    EXPECT_EQ(client.status(), IVIS_OK);
    EXPECT_TRUE(view.everything());
    EXPECT_FALSE(view.covered());
    EXPECT_TRUE(view.visible(0));
    EXPECT_TRUE(view.visible(12345));
    EXPECT_EQ(view.eye()[2], 3);
    EXPECT_EQ(client.stats().uncovered_frames, 1U);
    EXPECT_EQ(client.stats().stalls, 0U);
  }
}

TEST_F(ClientOverTcp, WelcomedWithoutAPvsEveryObjectIsVisible) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint());
  ASSERT_TRUE(client) << client.error();
  const PvsView view = client.view({1, 2, 3});
  EXPECT_EQ(view.object_count(), scene.object_count());
  EXPECT_EQ(view.count(), scene.object_count());
  EXPECT_EQ(ids(view).size(), scene.object_count());
  EXPECT_EQ(client.stats().uncovered_frames, 1U);
}

TEST_F(ClientOverTcp, MapsIdsToNodesAndBack) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint());
  ASSERT_TRUE(client) << client.error();
  EXPECT_EQ(client.info()->scene_hash, scene.hash);
  EXPECT_EQ(client.info()->object_count, scene.object_count());
  EXPECT_STREQ(client.info()->reach, "cylinder:1.5,0.1");
  for (ObjectId id = 0; id < scene.object_count(); ++id) {
    const auto node = client.node_of(id);
    ASSERT_TRUE(node);
    EXPECT_EQ(node->first, scene.objects[id].node);
    EXPECT_EQ(client.id_of(node->first, node->second), id);
  }
  EXPECT_FALSE(client.node_of(static_cast<std::uint32_t>(scene.object_count())));
  EXPECT_FALSE(client.id_of(0, 1));
  EXPECT_FALSE(client.id_of(100000));
}

TEST_F(ClientOverTcp, OutsideTheCellEverythingIsVisibleByDefault) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint());
  ASSERT_TRUE(client);
  client.pose({4, 1, 4});
  ASSERT_EQ(client.wait(kWait), IVIS_OK) << client.error();
  EXPECT_FALSE(client.view({5.4, 1, 4}).everything()) << "within the reach";
  const PvsView outside = client.view({5.6, 1, 4});
  EXPECT_TRUE(outside.everything());
  EXPECT_FALSE(outside.covered());
  EXPECT_EQ(outside.count(), scene.object_count());
  EXPECT_EQ(client.stats().uncovered_frames, 1U);
}

TEST_F(ClientOverTcp, StallNeverLeavesTheCell) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint(), IVIS_POLICY_STALL);
  ASSERT_TRUE(client);
  client.pose({4, 1, 4});
  ASSERT_EQ(client.wait(kWait), IVIS_OK);
  const ViewCell cell{{4, 1, 4}, Reach::cylinder(1.5, 0.1)};
  for (int i = 0; i < 200; ++i) {
    const double eye[3]{4 + 3 * std::sin(i * 1.0), 1 + 2 * std::sin(i * 0.3),
                        4 + 5 * std::cos(i * 0.7)};
    const PvsView view = client.view(eye);
    EXPECT_TRUE(cell.contains({view.eye()[0], view.eye()[1], view.eye()[2]}));
    EXPECT_TRUE(view.covered());
    EXPECT_FALSE(view.everything());
    EXPECT_EQ(view.stalled(), !cell.contains({eye[0], eye[1], eye[2]}));
  }
  EXPECT_EQ(client.stats().uncovered_frames, 0U);
  EXPECT_GT(client.stats().stalls, 100U);
}

TEST_F(ClientOverTcp, IncompleteUsesTheOldSetAndCounts) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint(), IVIS_POLICY_INCOMPLETE);
  ASSERT_TRUE(client);
  client.pose({4, 1, 4});
  ASSERT_EQ(client.wait(kWait), IVIS_OK);
  const PvsView view = client.view({14, 1, 4});
  EXPECT_FALSE(view.covered());
  EXPECT_FALSE(view.everything());
  EXPECT_EQ(ids(view), solved(method, {4, 1, 4}));
  EXPECT_EQ(view.eye()[0], 14);
  EXPECT_EQ(client.stats().uncovered_frames, 1U);
  EXPECT_EQ(client.stats().stalls, 0U);
}

TEST_F(ClientOverTcp, APvsOfEverythingCoversEveryEye) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint(), IVIS_POLICY_STALL);
  ASSERT_TRUE(client);
  client.pose({4, 60, 4});  // the method gives up there
  ASSERT_EQ(client.wait(kWait), IVIS_OK);
  const PvsView view = client.view({400, 60, 4});
  EXPECT_TRUE(view.everything());
  EXPECT_TRUE(view.covered());
  EXPECT_FALSE(view.stalled());
  EXPECT_EQ(view.count(), scene.object_count());
  client.pose({4, 1, 4});
  ASSERT_EQ(client.wait(kWait), IVIS_OK);
  EXPECT_EQ(ids(client.view({4, 1, 4})), solved(method, {4, 1, 4}));
}

TEST_F(ClientOverTcp, AnEyeThatIsNotFiniteIsRefusedHereAndShowsEverything) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint(), IVIS_POLICY_STALL);
  ASSERT_TRUE(client);
  client.pose({4, 1, 4});
  ASSERT_EQ(client.wait(kWait), IVIS_OK);
  const PvsView view = client.frame({std::nan(""), 1, 4});
  EXPECT_EQ(client.status(), IVIS_ERROR_ARGUMENT);
  EXPECT_TRUE(view.everything());
  EXPECT_FALSE(view.covered());
  EXPECT_EQ(client.stats().poses, 1U);
}

TEST_F(ClientOverTcp, ManyClientsGetTheirOwnSets) {
  RunningServer server(scene, method);
  constexpr int kClients = 12;
  std::vector<std::thread> threads;
  std::atomic<int> wrong{0};
  for (int c = 0; c < kClients; ++c) {
    threads.emplace_back([&, c] {
      auto client = connect(server.endpoint());
      if (!client) {
        ++wrong;
        return;
      }
      for (int i = 0; i < 25; ++i) {
        const double eye[3]{1.0 * i, 1, 3.0 * c};
        client.pose(eye);
        if (client.wait(kWait) != IVIS_OK || ids(client.view(eye)) != solved(method, eye)) ++wrong;
      }
    });
  }
  for (auto& t : threads)
    t.join();
  EXPECT_EQ(wrong, 0);
}

TEST_F(ClientOverTcp, FramesWithoutWaitingEndInTheRightSet) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint());
  ASSERT_TRUE(client);
  for (int i = 0; i < 5000; ++i)
    client.frame({0.005 * i, 1, 10});
  ASSERT_EQ(client.wait(kWait), IVIS_OK) << client.error();
  const double last[3]{0.005 * 4999, 1, 10};
  EXPECT_EQ(ids(client.view(last)), solved(method, last));
  EXPECT_EQ(client.stats().bad_messages, 0U);
}

TEST_F(ClientOverTcp, AnotherSceneIsAnErrorThatNamesBothHashes) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint(), IVIS_POLICY_EVERYTHING, 0xabcdef);
  EXPECT_FALSE(client);
  EXPECT_NE(client.error().find("0000000000abcdef"), std::string::npos) << client.error();
  char own[20];
  std::snprintf(own, sizeof own, "%016llx", static_cast<unsigned long long>(scene.hash));
  EXPECT_NE(client.error().find(own), std::string::npos) << client.error();
}

TEST_F(ClientOverTcp, AReachBeyondTheServersIsAnError) {
  RunningServer server(scene, method, Reach::disc(1));
  ivis_client_options options = ivis_client_options_default();
  const std::string endpoint = server.endpoint();
  options.endpoint = endpoint.c_str();
  options.reach = "disc:2";
  const auto client = VisibilityClient::connect(options);
  EXPECT_FALSE(client);
  EXPECT_NE(client.error().find("disc:2"), std::string::npos) << client.error();
  options.reach = "disc:0.5";
  EXPECT_STREQ(VisibilityClient::connect(options).info()->reach, "disc:0.5");
}

ivis_edit an_edit(ivis_edit_kind kind, std::uint32_t id, double x = 0, float speed = 0) {
  ivis_edit e{};
  e.kind = static_cast<std::uint8_t>(kind);
  e.id = id;
  e.position[0] = x;
  e.rotation[3] = 1;
  e.speed_m_s = speed;
  return e;
}

ivis_edit_result result_of(VisibilityClient& client) {
  ivis_edit_result result;
  for (int i = 0; i < kWait; ++i) {
    if (ivis_client_edit_result(client.get(), &result) != 0) return result;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ADD_FAILURE() << "no result";
  return {};
}

std::vector<ivis_object_state> changes(VisibilityClient& client) {
  const ivis_object_state* states = nullptr;
  std::size_t count = 0;
  EXPECT_EQ(ivis_client_changes(client.get(), &states, &count), IVIS_OK);
  return {states, states + count};
}

/// Looks, without a pose, until the scene is at that epoch; the changes that came with it.
std::vector<ivis_object_state> look_until(VisibilityClient& client, const double (&eye)[3],
                                          std::uint32_t epoch) {
  std::vector<ivis_object_state> all;
  for (int i = 0; i < kWait; ++i) {
    const PvsView view = client.view(eye);
    for (const auto& c : changes(client))
      all.push_back(c);
    if (view.raw().epoch == epoch && view.raw().sequence != 0) return all;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ADD_FAILURE() << "no PVS of epoch " << epoch;
  return all;
}

TEST_F(ClientOverTcp, AnEditReachesAClientThatOnlyLooksTogetherWithItsSet) {
  RunningServer server(scene, method);
  auto editor = connect(server.endpoint());
  auto looker = connect(server.endpoint());
  const double eye[3]{10, 1.7, 10};
  looker.pose(eye);
  ASSERT_EQ(looker.wait(kWait), IVIS_OK);
  const auto before = ids(looker.view(eye));
  const std::uint32_t near = *before.begin();
  std::uint32_t request = 0;
  const ivis_edit edits[]{an_edit(IVIS_EDIT_REMOVE, near), an_edit(IVIS_EDIT_MOVE, 399, 8.5)};
  ASSERT_EQ(ivis_client_edit(editor.get(), edits, 2, &request), IVIS_OK);
  const auto result = result_of(editor);
  EXPECT_EQ(result.request, request);
  EXPECT_EQ(result.epoch, 1U);
  EXPECT_STREQ(result.refused, "");
  const auto changed = look_until(looker, eye, 1);
  ASSERT_EQ(changed.size(), 2U);
  EXPECT_EQ(changed[0].id, near);
  EXPECT_EQ(changed[0].removed, 1);
  EXPECT_EQ(changed[1].id, 399U);
  EXPECT_EQ(changed[1].moved, 1);
  EXPECT_EQ(changed[1].position[0], 8.5);
  const PvsView after = looker.view(eye);
  EXPECT_FALSE(after.visible(near));
  EXPECT_TRUE(changes(looker).empty()) << "each change is told once";
}

TEST_F(ClientOverTcp, EditsThatAreNoneAreRefusedHereAndUnknownIdsThere) {
  RunningServer server(scene, method);
  auto client = connect(server.endpoint());
  const auto error_of = [&](const ivis_edit& e) {
    EXPECT_EQ(ivis_client_edit(client.get(), &e, 1, nullptr), IVIS_ERROR_ARGUMENT);
    return client.error();
  };
  ivis_edit e = an_edit(IVIS_EDIT_MOVE, 1);
  e.kind = 6;
  EXPECT_EQ(error_of(e), "unknown kind of edit 6");
  e = an_edit(IVIS_EDIT_MOVE, 1, NAN);
  EXPECT_NE(error_of(e).find("object 1: a position"), std::string::npos);
  e = an_edit(IVIS_EDIT_MOVE, 1, 0, -1);
  EXPECT_NE(error_of(e).find("speed"), std::string::npos);
  e = an_edit(IVIS_EDIT_MOVE, 1);
  e.rotation[3] = 0;
  EXPECT_NE(error_of(e).find("unit quaternion"), std::string::npos);
  const std::vector<ivis_edit> many(1025, an_edit(IVIS_EDIT_REMOVE, 1));
  EXPECT_EQ(ivis_client_edit(client.get(), many.data(), many.size(), nullptr), IVIS_ERROR_ARGUMENT);
  EXPECT_EQ(ivis_client_edit(client.get(), many.data(), 0, nullptr), IVIS_ERROR_ARGUMENT);
  e = an_edit(IVIS_EDIT_REMOVE, 400);
  ASSERT_EQ(ivis_client_edit(client.get(), &e, 1, nullptr), IVIS_OK);
  const auto result = result_of(client);
  EXPECT_EQ(result.epoch, 0U);
  EXPECT_STREQ(result.refused, "no object 400, expected an id below 400");
}

TEST_F(ClientOverTcp, AfterARestartWhatWasEditedIsToldToBeAsInTheFile) {
  auto first = std::make_unique<RunningServer>(scene, method);
  const std::string endpoint = first->endpoint();
  auto client = connect(endpoint);
  const double eye[3]{10, 1.7, 10};
  const ivis_edit e = an_edit(IVIS_EDIT_REMOVE, 5);
  ASSERT_EQ(ivis_client_edit(client.get(), &e, 1, nullptr), IVIS_OK);
  EXPECT_EQ(result_of(client).epoch, 1U);
  client.pose(eye);
  ASSERT_EQ(look_until(client, eye, 1).size(), 1U);
  first.reset();
  RunningServer second(scene, method, Reach::cylinder(1.5, 0.1), endpoint);
  client.pose(eye);
  ASSERT_EQ(client.wait(kWait), IVIS_OK);
  const PvsView view = client.view(eye);
  EXPECT_EQ(view.raw().epoch, 0U);
  const auto back = changes(client);
  ASSERT_EQ(back.size(), 1U);
  EXPECT_EQ(back[0].id, 5U);
  EXPECT_EQ(back[0].removed, 0);
}

TEST_F(ClientOverTcp, AnEditWithoutAnAnswerIsToldToBeLost) {
  auto server = std::make_unique<RunningServer>(scene, method);
  auto client = connect(server->endpoint());
  server.reset();
  const ivis_edit e = an_edit(IVIS_EDIT_REMOVE, 5);
  const ivis_status asked = ivis_client_edit(client.get(), &e, 1, nullptr);
  if (asked == IVIS_OK) {  // the farewell had not been read
    const auto result = result_of(client);
    EXPECT_EQ(result.epoch, 0U);
    EXPECT_NE(std::string(result.refused).find("the session ended"), std::string::npos);
  }
  EXPECT_EQ(ivis_client_edit(client.get(), &e, 1, nullptr), IVIS_ERROR_CONNECTION);
}

/// A server that is made to serve another scene while it runs.
class Replaced {
 public:
  Replaced(const Scene& first, const Scene& second)
      : methods_{NearMethod(first), NearMethod(second)}, log_(server::LogLevel::kOff, false) {
    const Scene* scenes[]{&first, &second};
    for (int i = 0; i < 2; ++i) {
      served_[i] = server::served_scene(*scenes[i]);
      ladders_[i] = std::make_unique<server::Ladder>(Reach::cylinder(1.5, 0.1), methods_[i], 0.001,
                                                     &no_occluders());
      states_[i] = std::make_unique<server::SceneState>(*scenes[i]);
    }
    server::ServerOptions options;
    options.listen = "tcp://127.0.0.1:*";
    auto bound = server::Server::bind(options, view(0), log_);
    EXPECT_TRUE(bound);
    server_ = std::move(*bound);
    thread_ = std::thread([this] {
      server_->run(stop_, [this]() -> std::optional<server::Server::Served> {
        if (!replace_.exchange(false)) return std::nullopt;
        return view(1);
      });
    });
  }
  ~Replaced() {
    stop_ = true;
    thread_.join();
  }
  void replace() { replace_ = true; }
  std::string endpoint() const { return server_->endpoint(); }

 private:
  server::Server::Served view(int i) const {
    return {&served_[i], ladders_[i].get(), {}, states_[i].get()};
  }
  NearMethod methods_[2];
  server::ServedScene served_[2];
  std::unique_ptr<server::Ladder> ladders_[2];
  std::unique_ptr<server::SceneState> states_[2];
  server::Log log_;
  std::unique_ptr<server::Server> server_;
  std::atomic<bool> stop_{false}, replace_{false};
  std::thread thread_;
};

/// Poses until a PVS of a session begun after the first is in use; false if there is none.
bool goes_on(VisibilityClient& client, const double (&eye)[3]) {
  for (int i = 0; i < kWait; ++i) {
    const PvsView view = client.frame(eye);
    if (client.status() != IVIS_OK) return false;
    const ivis_stats stats = client.stats();
    if (stats.reconnects > 0 && view.covered() && !view.everything() &&
        client.wait(kWait) == IVIS_OK)
      return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

TEST_F(ClientOverTcp, TheSameSceneLoadedAnewGoesOnWithoutTheEdits) {
  Replaced server(scene, scene);
  auto client = connect(server.endpoint());
  const double eye[3]{10, 1.7, 10};
  const ivis_edit e = an_edit(IVIS_EDIT_REMOVE, 105);
  ASSERT_EQ(ivis_client_edit(client.get(), &e, 1, nullptr), IVIS_OK);
  EXPECT_EQ(result_of(client).epoch, 1U);
  client.pose(eye);
  look_until(client, eye, 1);
  server.replace();
  ASSERT_TRUE(goes_on(client, eye)) << client.error();
  EXPECT_EQ(ids(client.view(eye)), solved(method, eye));
  EXPECT_EQ(client.view(eye).raw().epoch, 0U);
}

TEST_F(ClientOverTcp, AnotherSceneIsFollowedByThoseThatSaidSo) {
  // Of as many words of bits as the first, but more objects.
  SceneBuilder more;
  for (int i = 0; i < 410; ++i)
    more.add_box({2.0 * (i % 20), 0, 2.0 * (i / 20)}, {2.0 * (i % 20) + 1, 1, 2.0 * (i / 20) + 1});
  const Scene other = std::move(more).finish();
  const NearMethod other_method(other);
  Replaced server(scene, other);
  auto holding = connect(server.endpoint());
  ivis_client_options options = ivis_client_options_default();
  const std::string endpoint = server.endpoint();
  options.endpoint = endpoint.c_str();
  options.follow_scene = 1;
  auto following = VisibilityClient::connect(options);
  ASSERT_TRUE(following);
  const double eye[3]{10, 1.7, 10};
  for (VisibilityClient* c : {&holding, &following}) {
    c->pose(eye);
    ASSERT_EQ(c->wait(kWait), IVIS_OK);
    EXPECT_EQ(c->view(eye).raw().scene_hash, scene.hash);
  }
  server.replace();
  for (int i = 0; i < kWait && following.view(eye).raw().scene_hash == scene.hash; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  bool covered = false;
  for (int i = 0; i < kWait && !covered; ++i) {
    const PvsView now = following.view(eye);
    covered = now.covered();
    if (now.everything()) {
      EXPECT_EQ(ids(now).size(), now.object_count());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_TRUE(covered) << "by looking alone";
  ASSERT_TRUE(goes_on(following, eye)) << following.error();
  const PvsView view = following.view(eye);
  EXPECT_EQ(view.raw().scene_hash, other.hash);
  EXPECT_EQ(view.object_count(), 410U);
  const double above[3]{10, 60, 10};
  following.pose(above);
  ASSERT_EQ(following.wait(kWait), IVIS_OK);
  EXPECT_EQ(ids(following.view(above)).size(), 410U) << "everything is all of the other scene";
  following.pose(eye);
  ASSERT_EQ(following.wait(kWait), IVIS_OK);
  EXPECT_EQ(ids(following.view(eye)), solved(other_method, eye));
  EXPECT_FALSE(goes_on(holding, eye));
  EXPECT_EQ(holding.status(), IVIS_ERROR_MISMATCH);
  options.scene_hash = scene.hash;
  EXPECT_FALSE(VisibilityClient::connect(options)) << "follow_scene with a scene_hash";
}

TEST(Client, AnAbsentServerIsAConnectionErrorThatNamesTheEndpoint) {
  ivis_client_options options = ivis_client_options_default();
  options.endpoint = "tcp://127.0.0.1:1";
  options.connect_timeout_ms = 150;
  ivis_client* client = nullptr;
  char text[256];
  EXPECT_EQ(ivis_client_connect(&options, &client, text, sizeof text), IVIS_ERROR_CONNECTION);
  EXPECT_EQ(client, nullptr);
  EXPECT_NE(std::string(text).find("tcp://127.0.0.1:1"), std::string::npos) << text;
}

TEST(Client, BadArgumentsAreNamed) {
  const auto error_of = [](auto&& change) {
    ivis_client_options options = ivis_client_options_default();
    change(options);
    ivis_client* client = nullptr;
    char text[256] = "";
    EXPECT_EQ(ivis_client_connect(&options, &client, text, sizeof text), IVIS_ERROR_ARGUMENT);
    return std::string(text);
  };
  EXPECT_NE(error_of([](auto& o) { o.size = 3; }), "");
  EXPECT_NE(error_of([](auto& o) { o.endpoint = "http://x"; }).find("http://x"), std::string::npos);
  EXPECT_NE(error_of([](auto& o) { o.endpoint = nullptr; }), "");
  EXPECT_NE(error_of([](auto& o) { o.reach = "disk:1"; }).find("disk:1"), std::string::npos);
  EXPECT_NE(error_of([](auto& o) { o.silence_timeout_ms = 0; }), "");
  EXPECT_NE(error_of([](auto& o) { o.policy = static_cast<ivis_policy>(3); }), "");
  EXPECT_EQ(ivis_client_connect(nullptr, nullptr, nullptr, 0), IVIS_ERROR_ARGUMENT);
  ivis_client_close(nullptr);
}

/// The set is the one of the cell that the frame names: NearMethod's depends on the reach.
void expect_set_of_its_cell(const PvsView& view, const Method& method) {
  const ivis_frame& f = view.raw();
  if (f.sequence == 0 || view.everything()) return;
  const auto reach = Reach::parse(f.cell_reach);
  ASSERT_TRUE(reach);
  const auto pvs = method.solve({{f.cell_eye[0], f.cell_eye[1], f.cell_eye[2]}, *reach});
  ASSERT_TRUE(pvs);
  EXPECT_EQ(ids(view), std::set<std::uint32_t>(pvs->objects.begin(), pvs->objects.end()))
      << f.cell_reach;
}

TEST_F(ClientOverTcp, AfterARestartCellsAreOfTheNewServersLadder) {
  const std::string address =
      "ipc://" + ::testing::TempDir() + "ivis_ladders_" + std::to_string(getpid()) + ".sock";
  const auto ladder = [&](std::vector<double> radii) {
    std::vector<Reach> reaches;
    for (const double r : radii)
      reaches.push_back(Reach::cylinder(r, 0.1));
    auto made = std::make_unique<server::Ladder>(reaches, method, 0.001);
    for (std::uint32_t i = 0; i + 1 < reaches.size(); ++i)
      made->add(i, method);
    return made;
  };
  ivis_client_options options = ivis_client_options_default();
  options.endpoint = address.c_str();
  options.connect_timeout_ms = kWait;
  options.silence_timeout_ms = 200;
  options.pace = {1, 0, 0.01, 0};
  std::optional<RunningServer> server;
  server.emplace(scene, ladder({0.5, 1, 3}), address);
  auto client = VisibilityClient::connect(options);
  ASSERT_TRUE(client) << client.error();
  std::set<std::string> reaches;
  double x = 2;
  const auto walk = [&](int poses) {
    for (int i = 0; i < poses; ++i) {
      x += 0.001;
      const double eye[3]{x, 1, 10};
      static_cast<void>(client.pose(eye));
      ASSERT_EQ(client.wait(kWait), IVIS_OK) << client.error();
      const PvsView view = client.view(eye);
      expect_set_of_its_cell(view, method);
      reaches.insert(view.raw().cell_reach);
    }
  };
  walk(60);
  EXPECT_EQ(reaches, (std::set<std::string>{"cylinder:0.5,0.1", "cylinder:3,0.1"}))
      << "the largest until the time is known, then the smallest";
  server.reset();
  server.emplace(scene, ladder({2, 3.5}), address);
  reaches.clear();
  walk(60);
  EXPECT_EQ(reaches, (std::set<std::string>{"cylinder:2,0.1"}));
  EXPECT_EQ(client.stats().reconnects, 1U);
}

TEST(ClientOptions, OfRealTimeAreChecked) {
  const auto error_of = [](const std::function<void(ivis_client_options&)>& change) {
    ivis_client_options options = ivis_client_options_default();
    options.connect_timeout_ms = 0;
    options.endpoint = "tcp://127.0.0.1:1";
    change(options);
    const auto client = VisibilityClient::connect(options);
    return client ? std::string("no error") : client.error();
  };
  EXPECT_EQ(error_of([](auto&) {}), "no error");
  EXPECT_NE(error_of([](auto& o) { o.pace.horizontal_m_s = -1; }).find("pace"), std::string::npos);
  EXPECT_NE(error_of([](auto& o) { o.pace.vertical_m_s = NAN; }).find("pace"), std::string::npos);
  EXPECT_NE(error_of([](auto& o) { o.pace.frame_s = 1e9; }).find("pace"), std::string::npos);
  EXPECT_NE(error_of([](auto& o) { o.linger_frames = 4000; }).find("at most 3600"),
            std::string::npos);
  ivis_client_options options = ivis_client_options_default();
  options.connect_timeout_ms = 0;
  options.endpoint = "tcp://127.0.0.1:1";
  const auto client = VisibilityClient::connect(options);
  ASSERT_TRUE(client);
  EXPECT_EQ(ivis_client_set_policy(client.get(), IVIS_POLICY_STALL), IVIS_OK);
  EXPECT_EQ(ivis_client_set_policy(client.get(), static_cast<ivis_policy>(3)), IVIS_ERROR_ARGUMENT);
  EXPECT_EQ(ivis_client_set_policy(nullptr, IVIS_POLICY_STALL), IVIS_ERROR_ARGUMENT);
  ivis_pace pace{1, 1, 0, 0};
  EXPECT_EQ(ivis_client_set_pace(client.get(), &pace), IVIS_OK);
  pace.vertical_m_s = HUGE_VAL;
  EXPECT_EQ(ivis_client_set_pace(client.get(), &pace), IVIS_ERROR_ARGUMENT);
  EXPECT_EQ(ivis_client_set_pace(client.get(), nullptr), IVIS_ERROR_ARGUMENT);
  ivis_frame frame;
  const double eye[3]{};
  EXPECT_EQ(ivis_client_view(nullptr, eye, &frame), IVIS_ERROR_ARGUMENT);
  EXPECT_STREQ(frame.cell_reach, "");
  for (int c = 0; c < IVIS_CAUSES; ++c)
    EXPECT_STRNE(ivis_cause_name(static_cast<ivis_cause>(c)), "unknown");
}

}  // namespace
}  // namespace ivis::test
