// `--granularity cluster` on a town that is one mesh.

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/tools/small_town.h"

namespace ivis::test {
namespace {

using Arguments = std::vector<std::string>;

struct MergedTown : SmallTown {
  static constexpr std::size_t kTriangles = 12 * (kHouses + kBoxes) + 2;
  std::string merged = write_merged_town(folder);
  /// With the granularity, a scene and a reach in front.
  Ran run(const std::string& command, const std::string& granularity, Arguments more) const {
    Arguments all{command, merged, "--granularity", granularity};
    all.insert(all.end(), more.begin(), more.end());
    return ivis(all);
  }
};

TEST(ToolClusters, SplitTheOneObjectAndGiveTheSceneAnotherHash) {
  const MergedTown town;
  const Json whole = town.run("info", "object", {"--json"}).json();
  const Json split = town.run("info", "cluster", {"--json"}).json();
  EXPECT_EQ(whole["objects"], 1);
  EXPECT_EQ(split["objects"], 32);
  EXPECT_EQ(split["whole_objects"], 1);
  EXPECT_EQ(split["triangles"], MergedTown::kTriangles);
  EXPECT_NE(split["hash"], whole["hash"]);
  EXPECT_EQ(split["bounds"], whole["bounds"]);
  // Where there is nothing to split, nothing changes.
  EXPECT_EQ(ivis({"info", town.scene, "--json"}).json()["hash"],
            ivis({"info", town.scene, "--json", "--granularity", "cluster"}).json()["hash"]);
}

TEST(ToolClusters, AreListedWithTheTrianglesTheyHave) {
  const MergedTown town;
  const Json j = town.run("objects", "cluster", {"--json", "--triangle-numbers"}).json();
  ASSERT_EQ(j.size(), 32U);
  std::vector<std::size_t> all;
  for (std::size_t id = 0; id < j.size(); ++id) {
    ASSERT_EQ(keys(j[id]), (std::vector<std::string>{"id", "node", "instance", "cluster", "name",
                                                     "aabb", "triangles", "triangle_numbers"}));
    EXPECT_EQ(j[id]["id"], id);
    EXPECT_EQ(j[id]["node"], 0);
    EXPECT_EQ(j[id]["cluster"], id);
    EXPECT_EQ(j[id]["triangles"], j[id]["triangle_numbers"].size());
    for (const auto& t : j[id]["triangle_numbers"])
      all.push_back(t);
  }
  std::sort(all.begin(), all.end());
  ASSERT_EQ(all.size(), MergedTown::kTriangles);
  for (std::size_t t = 0; t < all.size(); ++t)
    ASSERT_EQ(all[t], t);
  const Json whole =
      ivis({"objects", town.scene, "--json", "--triangle-numbers", "--granularity", "cluster"})
          .json();
  ASSERT_EQ(whole.size(), MergedTown::kObjects);
  EXPECT_EQ(whole.back()["triangle_numbers"], (Json{0, 1}));
}

TEST(ToolClusters, AreCulledVerifiedAndDrawn) {
  const MergedTown town;
  const std::string ivo = town.folder / "merged.ivo";
  const std::string reach = "cylinder:1.5,0.1";
  ASSERT_EQ(town.run("shrink", "cluster", {"--reach", reach, "-o", ivo}).code, 0);
  for (const std::string method : {"cull-map", "occlusion-map"}) {
    const Arguments with{"--reach", reach, "--occluders", ivo, "--method", method, "--json"};
    Arguments pvs = with;
    pvs.insert(pvs.end(), {"--eye", SmallTown::kEye});
    const Ran solved = town.run("pvs", "cluster", pvs);
    ASSERT_EQ(solved.code, 0) << solved.errors;
    EXPECT_EQ(solved.json()["total"], 32);
    EXPECT_LT(solved.json()["count"], 24) << method;
    const Ran other = town.run("pvs", "object", pvs);
    EXPECT_EQ(other.code, 3);
    EXPECT_NE(other.errors.find("--granularity"), std::string::npos) << other.errors;
    Arguments path = with;
    path.insert(path.end(), {"--path", town.path});
    const Ran verified = town.run("verify", "cluster", path);
    EXPECT_EQ(verified.code, 0) << verified.out << verified.errors;
  }
  const std::string picture = town.folder / "picture.svg";
  EXPECT_EQ(
      town.run("draw", "cluster",
               {"--reach", reach, "--occluders", ivo, "--eye", SmallTown::kEye, "-o", picture})
          .code,
      0);
  EXPECT_NE(read(picture).find(" of 32 objects"), std::string::npos);
}

}  // namespace
}  // namespace ivis::test
