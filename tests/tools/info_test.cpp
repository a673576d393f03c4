// `ivis info`, `objects`, `shrink`, `generate` and `draw`.

#include <gtest/gtest.h>

#include "tests/tools/small_town.h"

namespace ivis::test {
namespace {

using Keys = std::vector<std::string>;

TEST(ToolInfo, PrintsTheFixedKeys) {
  const SmallTown town;
  const Ran ran = ivis({"info", town.scene, "--json"});
  ASSERT_EQ(ran.code, 0) << ran.errors;
  const Json j = ran.json();
  EXPECT_EQ(keys(j), (Keys{"objects", "triangles", "bounds", "hash", "extensions", "warnings"}));
  EXPECT_EQ(j["objects"], SmallTown::kObjects);
  EXPECT_EQ(j["triangles"], 12 * (SmallTown::kHouses + SmallTown::kBoxes) + 2);
  EXPECT_EQ(j["extensions"], Json::array({"EXT_mesh_gpu_instancing"}));
  ASSERT_EQ(j["bounds"].size(), 2U);
  EXPECT_NEAR(j["bounds"][0][0].get<double>(), -50, 1e-3);
  EXPECT_NEAR(j["bounds"][1][1].get<double>(), 18, 1e-3);
  EXPECT_EQ(j["hash"].get<std::string>().size(), 16U);
}

TEST(ToolObjects, ListsEveryObjectByIdWithTheFixedKeys) {
  const SmallTown town;
  const Ran ran = ivis({"objects", town.scene, "--json"});
  ASSERT_EQ(ran.code, 0) << ran.errors;
  const Json j = ran.json();
  ASSERT_EQ(j.size(), SmallTown::kObjects);
  for (std::size_t id = 0; id < j.size(); ++id) {
    ASSERT_EQ(keys(j[id]), (Keys{"id", "node", "instance", "name", "aabb", "triangles"}));
    EXPECT_EQ(j[id]["id"], id);
  }
  EXPECT_EQ(j[3]["name"], "house_3");
  EXPECT_EQ(j[SmallTown::kHouses + 7]["instance"], 7);
  EXPECT_EQ(j[0]["triangles"], 12);
}

TEST(ToolObjects, ANameThatIsNotUtf8DoesNotEndInACrash) {
  const SmallTown town;
  std::string bytes = read(town.scene);
  for (auto at = bytes.find("house_1\""); at != std::string::npos; at = bytes.find("house_1\""))
    bytes.replace(at, 5, "\xff\xc3(\xfe\x80");
  write(town.scene, bytes);
  for (const std::string command : {"objects", "info"}) {
    const Ran ran = ivis({command, town.scene, "--json"});
    if (ran.code == 3) continue;  // refusing such a file is as good
    EXPECT_EQ(ran.code, 0) << ran.errors;
    EXPECT_FALSE(ran.json().is_discarded());
  }
  EXPECT_EQ(ivis({"info", town.folder / "\xff\xfe.glb", "--json"}).code, 3);
}

TEST(ToolShrink, ReportsWhatBecameOfEveryObject) {
  const SmallTown town;
  const std::string out = town.folder / "t.ivo";
  const std::string folder = town.folder / "a/b";
  const Ran ran = ivis({"shrink", town.scene, "--reach", "disc:1", "-o", out, "--report", folder});
  ASSERT_EQ(ran.code, 0) << ran.errors;
  const Json j = Json::parse(read(folder + "/report.json"));
  ASSERT_EQ(j["objects"].size(), SmallTown::kObjects);
  std::size_t taken = 0;
  for (const Json& o : j["objects"])
    taken += o["fate"] == "taken" ? 1 : 0;
  EXPECT_GE(taken, SmallTown::kHouses);
  const std::string table = read(folder + "/report.txt");
  EXPECT_NE(table.find(std::to_string(taken) + "  taken"), std::string::npos) << table;
  EXPECT_NE(table.find("disc:1"), std::string::npos);
  const std::string picture = read(folder + "/report.svg");
  EXPECT_EQ(picture.rfind("<svg ", 0), 0U);
  EXPECT_NE(picture.find("</svg>"), std::string::npos);
  EXPECT_NE(ran.out.find("report.txt"), std::string::npos);
  const Ran refused =
      ivis({"shrink", town.scene, "--reach", "disc:1", "-o", out, "--report", out + "/r"});
  EXPECT_EQ(refused.code, 3);
  EXPECT_NE(refused.errors.find("t.ivo"), std::string::npos) << refused.errors;
}

TEST(ToolShrink, WritesAFileAndPrintsTheFixedKeys) {
  const SmallTown town;
#ifdef IVIS_HAVE_CGAL
  const std::vector<std::string> builders{"fast", "exact"};
#else
  const std::vector<std::string> builders{"fast"};
  const Ran refused = ivis({"shrink", town.scene, "--reach", "disc:1", "-o", town.folder / "x.ivo",
                            "--builder", "exact"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.errors.find("IVIS_WITH_CGAL"), std::string::npos) << refused.errors;
#endif
  for (const std::string& builder : builders) {
    const std::string file = town.folder / (builder + ".ivo");
    const Ran ran = ivis({"shrink", town.scene, "--reach", "cylinder:1.5,0.1", "-o", file,
                          "--builder", builder, "--json"});
    ASSERT_EQ(ran.code, 0) << ran.errors;
    const Json j = ran.json();
    EXPECT_EQ(keys(j), (Keys{"occluders_in", "occluders_out", "left_out", "volume_kept", "seconds",
                             "parts"}));
    EXPECT_GE(j["parts"]["prism_pieces"], SmallTown::kHouses) << "for the occlusion map";
    EXPECT_GE(j["occluders_out"], SmallTown::kHouses);
    // 28 x 22 m less 1.5 m all round; a few centimetres of slack.
    EXPECT_NEAR(j["volume_kept"].get<double>(), 25.0 * 19 / (28 * 22), 0.01);
    EXPECT_TRUE(j["left_out"].is_object());
    EXPECT_FALSE(read(file).empty());
  }
}

TEST(ToolShrink, TakesEachViewSpaceAndOnlyOneOfThem) {
  const SmallTown town;
  const std::string file = town.folder / "a.ivo";
  const auto shrink = [&](std::vector<std::string> space) {
    std::vector<std::string> arguments{"shrink", town.scene, "--reach", "disc:1", "-o", file};
    arguments.insert(arguments.end(), space.begin(), space.end());
    return ivis(arguments).code;
  };
  EXPECT_EQ(shrink({"--outside"}), 0);
  EXPECT_EQ(shrink({"--inside", SmallTown::kEye}), 0);
  EXPECT_EQ(shrink({"--path", town.path}), 0);
  EXPECT_EQ(shrink({"--path", town.path, "--outside"}), 2);
  EXPECT_EQ(shrink({"--inside", "1,2"}), 2);
}

TEST(ToolGenerate, ACityThatTheOtherCommandsTake) {
  const Folder folder;
  const std::string glb = folder / "city.glb";
  const std::string csv = folder / "walk.csv";
  const std::vector<std::string> make{
      "generate",    "city",  "-o",          glb,  "--path-out", csv,
      "--size",      "250",   "--buildings", "30", "--objects",  "2000",
      "--triangles", "40000", "--poses",     "20", "--json"};
  ASSERT_EQ(ivis(make).code, 0);
  const std::string once = read(glb);
  ASSERT_EQ(ivis(make).code, 0);
  EXPECT_EQ(read(glb), once);
  const Json info = ivis({"info", glb, "--json"}).json();
  EXPECT_GT(info["objects"], 500);
  const Ran verified = ivis(
      {"verify", glb, "--path", csv, "--reach", "cylinder:1.5,0.1", "--stride", "5", "--json"});
  EXPECT_EQ(verified.code, 0) << verified.out << verified.errors;
  EXPECT_EQ(
      ivis({"generate", "dress", glb, "-o", folder / "dressed.glb", "--max-triangles", "100000"})
          .code,
      0);
  EXPECT_EQ(ivis({"info", folder / "dressed.glb"}).code, 0);
}

TEST(ToolGenerate, TerrainThatIsShrunkAndVerifiedAsItStands) {
  const Folder folder;
  const std::string glb = folder / "hills.glb";
  const std::string csv = folder / "flight.csv";
  const std::string ivo = folder / "hills.ivo";
  const Ran made =
      ivis({"generate", "terrain", "--made-up", "96", "--ragged", "--trees", "200", "--tile", "16",
            "--height", "20", "--poses", "100", "-o", glb, "--path-out", csv, "--json"});
  ASSERT_EQ(made.code, 0) << made.errors;
  EXPECT_GT(made.json()["objects"], 220);
  EXPECT_EQ(made.json()["poses"], 100);
  ASSERT_EQ(ivis({"shrink", glb, "--reach", "ball:3", "-o", ivo}).code, 0);
  const Ran verified = ivis({"verify", glb, "--path", csv, "--reach", "ball:3", "--occluders", ivo,
                             "--stride", "33", "--json"});
  EXPECT_EQ(verified.code, 0) << verified.out;
  EXPECT_LT(verified.json()["pvs_median"], made.json()["objects"]);
}

TEST(ToolDraw, WritesAPicture) {
  const SmallTown town;
  const std::string file = town.folder / "picture.svg";
  const Ran ran =
      ivis({"draw", town.scene, "--eye", SmallTown::kEye, "--reach", "disc:1", "-o", file});
  ASSERT_EQ(ran.code, 0) << ran.errors;
  const std::string picture = read(file);
  EXPECT_EQ(picture.find("<svg "), 0U);
  EXPECT_EQ(picture.substr(picture.size() - 7), "</svg>\n");
}

}  // namespace
}  // namespace ivis::test
