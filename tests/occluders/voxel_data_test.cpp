#include <gtest/gtest.h>

#include "core/path.h"
#include "occluders/voxel_solids.h"
#include "scenes/load.h"
#include "tests/occluders/voxel_scenes.h"
#include "tests/support/shared_data.h"

namespace ivis {
namespace {

void expect_unseen(const Scene& scene, OccluderSet set, double cell_m, std::size_t looks) {
  VoxelOptions options;
  options.cell_m = cell_m;
  const auto report = add_voxel_solids(scene, options, set);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_GT(report->pieces, 100U);
  EXPECT_FALSE(set.sealed);
  const auto census = test::look_at_solids(scene, set, 5, looks);
  EXPECT_EQ(census.targets, looks);
  EXPECT_EQ(census.seen, 0U) << census.from.x << ',' << census.from.y << ',' << census.from.z
                             << " to " << census.to.x << ',' << census.to.y << ',' << census.to.z;
}

TEST(VoxelData, NoRaySeesASolidOfAGameMap) {
  IVIS_NEED_DATA(map, "q3map/oa_shouse.glb");
  IVIS_NEED_DATA(eyes, "q3map/oa_shouse.eyes.csv");
  const auto scene = load_scene(map);
  ASSERT_TRUE(scene) << scene.error().message;
  const auto poses = read_path(eyes);
  ASSERT_TRUE(poses) << poses.error().message;
  ViewSpace space{ViewSpace::Kind::kInside, {}};
  for (const Pose& p : *poses)
    space.seeds.push_back(p.eye);
  expect_unseen(*scene, test::set_for(Reach::ball(0.15), space), 0.2, 2000);
}

TEST(VoxelData, NoRaySeesASolidOfARealCity) {
  IVIS_NEED_DATA(city, "linz/linz_centre_2km.glb");
  const auto scene = load_scene(city);
  ASSERT_TRUE(scene) << scene.error().message;
  expect_unseen(*scene, test::set_for(Reach::cylinder(1.5, 0.1)), 1, 500);
}

}  // namespace
}  // namespace ivis
