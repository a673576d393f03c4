// Ten minutes through the default city at 108 km/h and 60 frames a second, on a clock of its own.

#include <filesystem>

#include <gtest/gtest.h>

#include "client_lib/client.h"
#include "core/path.h"
#include "scenes/generate_city.h"
#include "server/world.h"
#include "tests/support/simulated_source.h"
#include "visibility/verify.h"

namespace ivis::test {
namespace {

using namespace std::chrono_literals;

TEST(RealTimeCity, TenMinutesAt108KmAnHourWithoutAStallOrAMiss) {
  CityOptions city;
  city.path.poses = 36'001;
  city.path.speed_m_s = 30;
  const auto made = generate_city(city);
  ASSERT_TRUE(made) << made.error().message;
  const auto file = std::filesystem::path(::testing::TempDir()) /
                    ("ivis_real_time_" + std::to_string(getpid()) + ".glb");
  ASSERT_TRUE(write_file_whole(file, made->glb));
  server::WorldOptions options;
  options.scene = file;
  auto world = server::load_world(options);
  std::filesystem::remove(file);
  ASSERT_TRUE(world) << world.error().message;
  server::World& w = **world;
  const auto reaches = server::parse_ladder("auto", w.reach, w.occluders.slack_m);
  ASSERT_TRUE(reaches);
  server::Ladder ladder(*reaches, *w.method, w.occluders.slack_m, w.index.get());
  ASSERT_TRUE(server::build_rungs(w, ladder, options, {}));
  ASSERT_EQ(ladder.ready(), 4U);

  std::chrono::steady_clock::time_point now{1000s};
  SimulatedSource::Delays delays;
  delays.network = 200us;
  delays.solve = [](std::uint64_t n) { return n % 100 == 99 ? 5ms : 500us; };
  auto made_source = std::make_unique<SimulatedSource>(
      client::catalogue_of(w.scene, w.reach, *w.method), ladder, delays, now);
  ivis_client::Options own;
  own.policy = IVIS_POLICY_STALL;
  own.pace = {30.001, 0.5, 1.0 / 60};
  own.now = [&now] { return now; };
  made_source->set_pace(own.pace);
  ivis_client client(std::move(made_source), own);

  const Verifier verifier(w.scene, &w.occluders);
  std::uint64_t stalled = 0, uncovered = 0, small = 0, misses = 0;
  // The walk begins with a PVS.
  ASSERT_EQ(client.pose(made->path.front().eye), IVIS_OK);
  now += 1ms;
  for (std::size_t i = 0; i < made->path.size(); ++i) {
    const Vec3& eye = made->path[i].eye;
    ivis_frame f;
    ASSERT_EQ(client.pose(eye), IVIS_OK);
    ASSERT_EQ(client.view(eye, f), IVIS_OK);
    stalled += f.stalled;
    uncovered += f.covered == 0 ? 1 : 0;
    const auto reach = Reach::parse(f.cell_reach);
    ASSERT_TRUE(reach);
    small += *reach == w.reach ? 0 : 1;
    if (i % 4000 == 1999) {
      Pvs pvs;
      pvs.cell = {{f.cell_eye[0], f.cell_eye[1], f.cell_eye[2]}, *reach};
      pvs.scene_hash = w.scene.hash;
      for (ObjectId id = 0; id < f.object_count; ++id)
        if (ivis_frame_visible(&f, id) != 0) pvs.objects.push_back(id);
      EXPECT_LT(pvs.objects.size(), w.scene.objects.size() / 10);
      VerifyOptions rays;
      rays.rays_per_culled_object = 16;
      const auto report = verifier.check(pvs, rays);
      ASSERT_TRUE(report);
      misses += report->false_negatives;
    }
    now += 16'666'667ns;
  }
  EXPECT_EQ(stalled, 0U);
  EXPECT_EQ(uncovered, 0U);
  EXPECT_EQ(misses, 0U);
  EXPECT_GT(small, made->path.size() * 99 / 100) << "0.5 m a frame needs no cell of 1.5 m";
  EXPECT_NEAR(client.stats().hold_ms, 16.7, 0.1);
}

}  // namespace
}  // namespace ivis::test
