// `ivis pvs`.

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/tools/small_town.h"

namespace ivis::test {
namespace {

using Keys = std::vector<std::string>;
using Ids = std::vector<unsigned>;

constexpr const char* kReach = "cylinder:1.5,0.1";

Ids pvs_ids(const SmallTown& town, const std::string& eye,
            const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments{"pvs", town.scene, "--eye", eye, "--reach", kReach, "--json"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Ran ran = ivis(arguments);
  EXPECT_EQ(ran.code, 0) << ran.errors;
  return ran.code == 0 ? ran.json()["objects"].get<Ids>() : Ids{};
}

TEST(ToolPvs, PrintsTheFixedKeys) {
  const SmallTown town;
  const Ran ran = ivis({"pvs", town.scene, "--eye", SmallTown::kEye, "--reach", kReach, "--json"});
  ASSERT_EQ(ran.code, 0) << ran.errors;
  const Json j = ran.json();
  EXPECT_EQ(keys(j), (Keys{"method", "guarantee", "objects", "count", "total", "compute_ms",
                           "wall_ms", "backend"}));
  EXPECT_EQ(j["guarantee"], "conservative");
  EXPECT_EQ(j["total"], SmallTown::kObjects);
  EXPECT_EQ(j["count"], j["objects"].size());
  const Ids ids = j["objects"].get<Ids>();
  EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end()));
  EXPECT_LT(ids.size(), SmallTown::kObjects);
  EXPECT_GT(ids.size(), SmallTown::kBoxes / 10);
}

TEST(ToolPvs, EachMethodAndMapAnswers) {
  const SmallTown town;
  for (const std::vector<std::string>& more : {std::vector<std::string>{"--map", "polar"},
                                               {"--map", "orthographic"},
                                               {"--method", "reference"},
                                               {"--max-occluders", "3"}}) {
    EXPECT_FALSE(pvs_ids(town, SmallTown::kEye, more).empty());
  }
}

TEST(ToolPvs, TheBackendThatIsAskedForAnswersOrSaysWhyNot) {
  setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
  const SmallTown town;
  const auto run = [&](const std::string& method, const std::string& backend) {
    return ivis({"pvs", town.scene, "--eye", SmallTown::kEye, "--reach", kReach, "--json",
                 "--method", method, "--backend", backend});
  };
  const Ran cpu = run("occlusion-map", "cpu");
  ASSERT_EQ(cpu.code, 0) << cpu.errors;
  EXPECT_EQ(cpu.json()["backend"], "cpu");
  const Ran automatic = run("occlusion-map", "auto");
  ASSERT_EQ(automatic.code, 0) << automatic.errors;
  const Ran gl = run("occlusion-map", "gl");
  if (gl.code == 0) {
    EXPECT_EQ(gl.json()["backend"], "gl");
    EXPECT_LT(gl.json()["count"], 2 * cpu.json()["count"].get<int>());
    EXPECT_GT(2 * gl.json()["count"].get<int>(), cpu.json()["count"]);
  } else {
    EXPECT_EQ(gl.code, 3);
    EXPECT_NE(gl.errors.find("OpenGL"), std::string::npos) << gl.errors;
  }
  EXPECT_EQ(run("cull-map", "gl").code, 2);
  EXPECT_EQ(run("occlusion-map", "direct3d").code, 2);
}

TEST(ToolPvs, AFrustumListsPartOfTheSetAndOppositeOnesListItAll) {
  const SmallTown town;
  const Ids all = pvs_ids(town, SmallTown::kEye);
  Ids both = pvs_ids(town, SmallTown::kEye, {"--frustum", "0,0,179.9,179.9,0"});
  EXPECT_LT(both.size(), all.size());
  const Ids back = pvs_ids(town, SmallTown::kEye, {"--frustum", "180,0,179.9,179.9,0"});
  EXPECT_LT(back.size(), all.size());
  both.insert(both.end(), back.begin(), back.end());
  std::sort(both.begin(), both.end());
  both.erase(std::unique(both.begin(), both.end()), both.end());
  EXPECT_EQ(both, all);
  EXPECT_EQ(pvs_ids(town, SmallTown::kEye, {"--frustum", "0,0,90,60,180"}), all) << "free turning";
}

TEST(ToolPvs, SeveralEyesGetOneSetThatHoldsEachOnes) {
  const SmallTown town;
  const std::string left = "10,1.7,27.97";
  const std::string right = "10,1.7,28.03";
  const Ids both = pvs_ids(town, left, {"--eye", right});
  EXPECT_LT(both.size(), SmallTown::kObjects);
  for (const std::string& eye : {left, right}) {
    const Ids one = pvs_ids(town, eye);
    std::size_t held = 0;
    for (const unsigned id : one)
      held += std::binary_search(both.begin(), both.end(), id) ? 1 : 0;
    EXPECT_GT(held, one.size() * 95 / 100) << "sets are no more than conservative, but near";
  }
  // A value of --eye does not swallow the scene that follows it.
  EXPECT_EQ(
      ivis({"pvs", "--eye", left, "--reach", kReach, "--json", "--eye", right, town.scene}).code,
      0);
}

TEST(ToolPvs, ThreadsChangeNothing) {
  const SmallTown town;
  const Ids one = pvs_ids(town, SmallTown::kEye);
  for (const char* n : {"2", "5"})
    EXPECT_EQ(pvs_ids(town, SmallTown::kEye, {"--threads", n}), one);
}

TEST(ToolPvs, AnOccluderFileAnswersAsShrinkingOnTheFly) {
  const SmallTown town;
  const std::string file = town.folder / "town.ivo";
  ASSERT_EQ(ivis({"shrink", town.scene, "--reach", kReach, "-o", file}).code, 0);
  for (const char* eye : {"10,1.7,28", "35,1.7,60", "120,40,28", "-20,1.7,-20"})
    EXPECT_EQ(pvs_ids(town, eye, {"--occluders", file}), pvs_ids(town, eye));
}

TEST(ToolPvs, AnEyeInsideAHouseSeesEverythingAndSaysSo) {
  const SmallTown town;
  const Json j =
      ivis({"pvs", town.scene, "--eye", "10,1.7,10", "--reach", kReach, "--json"}).json();
  EXPECT_EQ(j["count"], SmallTown::kObjects);
  EXPECT_EQ(j["everything_because"], "eye inside an occluder");
}

TEST(ToolPvs, APathDumpsWhatEachEyeGives) {
  const SmallTown town;
  const std::string dump = town.folder / "dump";
  std::filesystem::create_directory(dump);
  write(dump + "/00000.txt", "from an earlier run\n");
  const Ran ran =
      ivis({"pvs", town.scene, "--path", town.path, "--reach", kReach, "--json", "--dump", dump});
  ASSERT_EQ(ran.code, 0) << ran.errors;
  const Json j = ran.json();
  EXPECT_EQ(keys(j), (Keys{"poses", "count_median", "compute_ms_median", "compute_ms_p99",
                           "wall_ms_median", "backend"}));
  ASSERT_EQ(j["poses"].size(), SmallTown::kPoses);
  std::vector<double> counts;
  for (std::size_t row = 0; row < SmallTown::kPoses; ++row) {
    const Json& pose = j["poses"][row];
    EXPECT_EQ(keys(pose), (Keys{"eye", "count", "compute_ms"}));
    EXPECT_EQ(pose["eye"], Json::array({10.0 + 25.0 * static_cast<double>(row), 1.7, 28.0}));
    counts.push_back(pose["count"]);
    std::string expected;
    for (const unsigned id : pvs_ids(town, std::to_string(10 + 25 * row) + ",1.7,28"))
      expected += std::to_string(id) + '\n';
    EXPECT_EQ(read(dump + "/0000" + std::to_string(row) + ".txt"), expected);
  }
  std::sort(counts.begin(), counts.end());
  EXPECT_EQ(j["count_median"], counts[SmallTown::kPoses / 2]);
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(dump))
    files += entry.is_regular_file() ? 1 : 0;
  EXPECT_EQ(files, SmallTown::kPoses) << "nothing half-written is left";
}

}  // namespace
}  // namespace ivis::test
