// Each wrong command ends with the documented exit code and a message that names what is wrong.

#include <csignal>

#include <gtest/gtest.h>

#include "tests/server/process.h"
#include "tests/tools/small_town.h"

namespace ivis::test {
namespace {

using Arguments = std::vector<std::string>;

void expect_refused(const Arguments& arguments, int code, const std::string& named) {
  std::string line;
  for (const auto& a : arguments)
    line += a + ' ';
  const Ran ran = ivis(arguments);
  EXPECT_EQ(ran.code, code) << line << ran.errors;
  EXPECT_NE(ran.errors.find(named), std::string::npos) << line << ran.errors;
  EXPECT_EQ(ran.out, "") << line;
}

TEST(ToolRefuses, UsageErrorsWithCodeTwo) {
  const SmallTown t;
  const std::string& eye = SmallTown::kEye;
  expect_refused({}, 2, "subcommand");
  expect_refused({"frobnicate"}, 2, "frobnicate");
  expect_refused({"info"}, 2, "SCENE");
  expect_refused({"info", t.scene, "--jason"}, 2, "--jason");
  for (const std::string command : {"info", "objects"})
    expect_refused({command, t.scene, "--granularity", "triangle"}, 2, "triangle");
  expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--granularity", "mesh"}, 2,
                 "mesh");
  expect_refused({"pvs", t.scene, "--reach", "disc:1"}, 2, "--eye");
  expect_refused({"pvs", t.scene, "--eye", eye}, 2, "--reach");
  expect_refused({"pvs", t.scene, "--eye", eye, "--path", t.path, "--reach", "disc:1"}, 2,
                 "--path");
  expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--dump", t.folder / "d"}, 2,
                 "--path");
  for (const std::string bad : {"disc", "disc:", "disc:-1", "disc:nan", "disc:inf", "disc:1,2",
                                "disc:1x", "cylinder:1", "box:1,2", "sphere:1", "disc:1e300", ""})
    expect_refused({"pvs", t.scene, "--eye", eye, "--reach=" + bad}, 2, "");
  for (const std::string bad :
       {"1,2", "1,2,3,4", "a,b,c", "1,2,", "nan,0,0", "1;2;3", "1,2,inf", "1e999,0,0", ""})
    expect_refused({"pvs", t.scene, "--eye=" + bad, "--reach", "disc:1"}, 2, "");
  expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--method", "magic"}, 2,
                 "magic");
  expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--map", "cubic"}, 2, "cubic");
  for (const std::string bad : {"0", "-1", "257", "two", "99999999999999999999"})
    expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--threads=" + bad}, 2,
                   "--threads");
  expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--max-occluders=-1"}, 2,
                 "--max-occluders");
  expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--selection", "some"}, 2,
                 "some");
  expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--selection", "temporal"}, 2,
                 "needs --path");
  for (const std::string bad :
       {"90,0,90,60", "0,0,0,60,5", "0,0,90,180,5", "0,95,90,60,5", "a,0,90,60,5"})
    expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--frustum", bad}, 2, bad);
  expect_refused({"verify", t.scene, "--record", t.path, "--frustum", "0,0,90,60,5"}, 2,
                 "--frustum");
  expect_refused({"verify", t.scene}, 2, "--path");
  expect_refused({"verify", t.scene, "--path", t.path}, 2, "--reach");
  expect_refused({"verify", t.scene, "--path", t.path, "--record", t.path, "--reach", "disc:1"}, 2,
                 "--record");
  for (const std::string bad : {"0", "-3", "many"}) {
    expect_refused({"verify", t.scene, "--path", t.path, "--reach", "disc:1", "--rays=" + bad}, 2,
                   "--rays");
    expect_refused({"verify", t.scene, "--path", t.path, "--reach", "disc:1", "--stride=" + bad}, 2,
                   "--stride");
  }
  expect_refused({"shrink", t.scene, "--reach", "disc:1"}, 2, "--output");
  expect_refused(
      {"shrink", t.scene, "--reach", "disc:1", "-o", t.folder / "f", "--builder", "slow"}, 2,
      "slow");
  expect_refused(
      {"shrink", t.scene, "--reach", "disc:1", "-o", t.folder / "f", "--threads", "100000"}, 2,
      "--threads");
  expect_refused({"generate", "city", "-o", t.folder / "f", "--size", "1"}, 2, "1");
  expect_refused({"generate", "city", "-o", t.folder / "f", "--size", "nan"}, 2, "nan");
  expect_refused({"generate", "city", "-o", t.folder / "f", "--relief", "nan"}, 2, "nan");
  expect_refused({"generate", "city", "-o", t.folder / "f", "--step", "nan"}, 2, "--step");
  expect_refused({"generate", "city", "-o", t.folder / "f", "--poses", "1"}, 2, "--poses");
  expect_refused({"generate", "city", "-o", t.folder / "f", "--buildings", "18446744073709551615"},
                 2, "18446744073709551615");
  const std::string out = t.folder / "f";
  expect_refused({"generate", "terrain", "-o", out}, 2, "DEM or --made-up");
  expect_refused({"generate", "terrain", "--made-up", "3", "-o", out}, 2, "--made-up");
  expect_refused({"generate", "terrain", "--made-up", "16", "-o", out, "--tile", "0"}, 2, "--tile");
  expect_refused({"generate", "terrain", "--made-up", "16", "-o", out, "--height", "nan"}, 2,
                 "--height");
  expect_refused({"generate", "terrain", "--made-up", "16", "-o", out, "--crop", "0,0,2,2"}, 2,
                 "--crop");
  for (const std::string bad : {"1,2,3", "1,2,3,4,5", "1,2,3,", "a,b,c,d", "-1,0,2,2"})
    expect_refused({"generate", "terrain", "dem.asc", "-o", out, "--crop=" + bad}, 2, bad);
  for (const std::string bad : {"1", "1,2,3", "nan,1", "-1,5", "1,"})
    expect_refused({"generate", "terrain", "dem.asc", "-o", out, "--crop-m=" + bad}, 2, bad);
  expect_refused({"draw", t.scene, "--eye", eye, "--reach", "disc:1", "-o", t.folder / "f.svg",
                  "--radius", "nan"},
                 2, "--radius");
  expect_refused({"walk", "--connect", "ipc://x", "--path", t.path, "--policy", "wait"}, 2, "wait");
  expect_refused({"walk", "--connect", "carrier-pigeon", "--path", t.path}, 2, "carrier-pigeon");
  const std::vector<std::string> walk{"walk", "--connect", "ipc://x", "--path", t.path};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), walk.begin(), walk.end());
    return more;
  };
  expect_refused(with({"--fps", "60", "--hz", "60"}), 2, "--hz");
  expect_refused(with({"--fps", "0"}), 2, "--fps");
  expect_refused(with({"--seconds", "5"}), 2, "--fps");
  expect_refused(with({"--fps", "60", "--speed-limit", "nan"}), 2, "--speed-limit");
  expect_refused(with({"--fps", "60", "--turning", "-1"}), 2, "--turning");
  expect_refused(with({"--turning", "10"}), 2, "--fps");
  expect_refused(with({"--strategy", "hope"}), 2, "hope");
  expect_refused(with({"--budget-ms", "0"}), 2, "--budget-ms");
  expect_refused({"replay", t.path}, 2, "--connect");
  expect_refused({"replay", "--connect", "ipc://x"}, 2, "record");
  expect_refused({"generate", "city", "-o", t.folder / "f", "--speed", "0"}, 2, "--speed");
}

TEST(ToolRefuses, InputErrorsWithCodeThree) {
  const SmallTown t;
  const std::string& eye = SmallTown::kEye;
  const std::string nothing = t.folder / "nothing";
  const std::string folder = t.folder.path().string();
  for (const std::string& bad : {nothing, folder}) {
    expect_refused({"info", bad, "--json"}, 3, bad);
    expect_refused({"objects", bad}, 3, bad);
    expect_refused({"shrink", bad, "--reach", "disc:1", "-o", t.folder / "f"}, 3, bad);
    expect_refused({"pvs", t.scene, "--path", bad, "--reach", "disc:1"}, 3, bad);
    expect_refused({"pvs", t.scene, "--eye", eye, "--reach", "disc:1", "--occluders", bad}, 3, bad);
    expect_refused({"verify", t.scene, "--path", bad, "--reach", "disc:1"}, 3, bad);
    expect_refused({"verify", t.scene, "--record", bad}, 3, bad);
    expect_refused({"walk", "--connect", "ipc://" + nothing, "--path", bad}, 3, bad);
    expect_refused({"generate", "terrain", bad, "-o", t.folder / "f"}, 3, bad);
  }
  const std::string csv = t.folder / "bad.csv";
  for (const std::string text :
       {"", "x,y,z\n", "x,y\n1,2\n", "x,y,z\n1,2\n", "x,y,z\n1,2,nan\n", "x,y,z\n1,2,here\n"}) {
    write(csv, text);
    expect_refused({"pvs", t.scene, "--path", csv, "--reach", "disc:1"}, 3, csv);
  }
  const std::string glb = t.folder / "bad.glb";
  for (const std::string& bytes :
       {std::string(), std::string("glTF"), read(t.scene).substr(0, 1000), std::string("{}")}) {
    write(glb, bytes);
    const Ran ran = ivis({"info", glb});
    EXPECT_EQ(ran.code, 3) << bytes.size() << ran.errors << ran.out;
  }
}

// A scene that is not there stands for one that takes minutes: it must not be asked for first.
TEST(ToolRefuses, WhatNeedsNoSceneBeforeTheSceneIsLoaded) {
  const SmallTown t;
  const std::string& eye = SmallTown::kEye;
  const std::string scene = t.folder / "later.glb";
  const std::string nothing = t.folder / "nothing";
  const std::string out = t.folder / "missing/out.svg";
  const std::string dump = t.path + "/dump";  // in a file
  expect_refused({"pvs", scene, "--eye", eye, "--reach", "disk:1"}, 2, "disk:1");
  expect_refused({"pvs", scene, "--eye", "1;2;3", "--reach", "disc:1"}, 2, "1;2;3");
  expect_refused({"pvs", scene, "--path", nothing, "--reach", "disc:1"}, 3, nothing);
  expect_refused({"pvs", scene, "--path", t.path, "--reach", "disc:1", "--dump", dump}, 3, dump);
  for (const std::string& occluders : {nothing, t.folder.path().string()}) {
    expect_refused({"pvs", scene, "--eye", eye, "--reach", "disc:1", "--occluders", occluders}, 3,
                   "'" + occluders + "'");
    expect_refused(
        {"verify", scene, "--path", t.path, "--reach", "disc:1", "--occluders", occluders}, 3,
        "'" + occluders + "'");
  }
  expect_refused({"verify", scene, "--path", nothing, "--reach", "disc:1"}, 3, nothing);
  expect_refused({"verify", scene, "--path", t.path, "--reach", "disk:1"}, 2, "disk:1");
  expect_refused({"replay", nothing, "--connect", "ipc://x"}, 3, nothing);
  expect_refused({"verify", scene, "--record", nothing}, 3, nothing);
  expect_refused({"draw", scene, "--eye", eye, "--reach", "disc:1", "-o", out}, 3, out);
  expect_refused({"shrink", scene, "--reach", "disc:1", "-o", out}, 3, out);
  expect_refused({"shrink", scene, "--reach", "disk:1", "-o", nothing}, 2, "disk:1");
  expect_refused({"shrink", scene, "--reach", "disc:1", "-o", nothing, "--path", nothing}, 3,
                 "'" + nothing + "'");
  expect_refused({"generate", "dress", scene, "-o", out}, 3, out);
  expect_refused({"generate", "dress", scene, "-o", nothing, "--path-out", out}, 3, out);
  const std::string nobody = "ipc://" + (t.folder / "nobody");
  expect_refused({"walk", "--connect", nobody, "--path", t.path, "--reach", "disk:1"}, 2, "disk:1");
  expect_refused({"walk", "--connect", nobody, "--path", t.path, "--record", out}, 3, out);
}

TEST(ToolRefuses, OccludersOfAnotherSceneOrASmallerReach) {
  const SmallTown t;
  const std::string file = t.folder / "town.ivo";
  ASSERT_EQ(ivis({"shrink", t.scene, "--reach", "disc:1", "-o", file}).code, 0);
  const auto pvs = [&](const std::string& scene, const std::string& reach) {
    return Arguments{"pvs", scene, "--eye", SmallTown::kEye, "--reach", reach, "--occluders", file};
  };
  EXPECT_EQ(ivis(pvs(t.scene, "disc:1")).code, 0);
  EXPECT_EQ(ivis(pvs(t.scene, "disc:0.5")).code, 0);
  expect_refused(pvs(t.scene, "disc:1.1"), 3, "disc:1.1");
  expect_refused(pvs(t.scene, "cylinder:1,0.5"), 3, file);
  expect_refused(pvs(write_other_town(t.folder), "disc:1"), 3, file);
  std::string bytes = read(file);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  write(file, bytes);
  expect_refused(pvs(t.scene, "disc:1"), 3, file);
}

TEST(ToolRefuses, OutputsThatCannotBeWrittenLeavingNothingBehind) {
  const SmallTown t;
  const std::string nowhere = t.folder / "missing/f.svg";
  const std::string taken = t.folder / "taken";
  write(taken, "not a folder");
  std::filesystem::create_directory(t.folder / "full.svg");
  write(t.folder / "full.svg/file", "");
  const auto before = t.folder.files();
  for (const std::string& bad : {nowhere, t.folder / "full.svg"}) {
    expect_refused({"shrink", t.scene, "--reach", "disc:1", "-o", bad}, 3, bad);
    expect_refused({"draw", t.scene, "--eye", SmallTown::kEye, "--reach", "disc:1", "-o", bad}, 3,
                   bad);
    expect_refused({"generate", "city", "-o", bad, "--size", "250", "--buildings", "20",
                    "--objects", "1000", "--triangles", "20000"},
                   3, bad);
  }
  expect_refused({"pvs", t.scene, "--path", t.path, "--reach", "disc:1", "--dump", taken}, 3,
                 taken);
  EXPECT_EQ(t.folder.files(), before);
  EXPECT_EQ(read(taken), "not a folder");
}

TEST(ToolRefuses, AFullStandardOutputIsAnError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  const SmallTown t;
  for (const char* command : {"info", "objects"}) {
    Process process({"/bin/sh", "-c",
                     "exec \"$0\" " + std::string(command) + " \"$1\" --json > /dev/full",
                     IVIS_TOOL, t.scene});
    EXPECT_EQ(process.finish(), 3) << process.output();
  }
}

TEST(ToolInterrupted, LeavesNothingHalfWritten) {
  const Folder folder;
  const std::string file = folder / "city.glb";
  Process process({IVIS_TOOL, "generate", "city", "-o", file, "--path-out", folder / "walk.csv",
                   "--size", "4000", "--buildings", "6000", "--objects", "3000000", "--triangles",
                   "90000000"});
  EXPECT_FALSE(process.says("never said", 1)) << "a second into the work";
  process.signal(SIGINT);
  EXPECT_EQ(process.finish(), 130) << process.output();
  EXPECT_TRUE(folder.files().empty());
}

TEST(ToolHelp, ExitsWithZero) {
  EXPECT_EQ(ivis({"--help"}).code, 0);
  EXPECT_EQ(ivis({"--version"}).code, 0);
  for (const char* command :
       {"info", "objects", "shrink", "pvs", "verify", "draw", "walk", "generate"})
    EXPECT_EQ(ivis({command, "--help"}).code, 0);
}

}  // namespace
}  // namespace ivis::test
