#include <ivis/ivis.hpp>

#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "tests/server/running_server.h"

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

}  // namespace
}  // namespace ivis::test
