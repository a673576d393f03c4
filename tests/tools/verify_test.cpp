// `ivis verify`: silent when all is well, exit code 1 when a visible object was left out.

#include <sstream>

#include <gtest/gtest.h>

#include "tests/tools/small_town.h"

namespace ivis::test {
namespace {

const std::vector<std::string> kKeys{"rays",       "false_negatives", "missing",
                                     "pvs_median", "seen_median",     "overestimate"};
constexpr const char* kReach = "cylinder:1.5,0.1";

/// A record of one frame at the town's first pose, that lists `ids`.
std::string record_of(const std::string& hash, const std::vector<unsigned>& ids,
                      const std::string& how = "covered", const std::string& eye = "10 1.7 28") {
  std::ostringstream text;
  text << "ivis-record 3\nscene " << hash << "\nreach " << kReach << "\nobjects "
       << SmallTown::kObjects << "\nframe 0 1 10 1.7 28 " << kReach << ' ' << eye << ' ' << eye
       << ' ' << how << " 0 " << ids.size();
  unsigned before = 0;
  for (const unsigned id : ids) {
    text << ' ' << id - before;
    before = id;
  }
  text << '\n';
  return text.str();
}

struct Recorded {
  SmallTown town;
  std::string hash = ivis({"info", town.scene, "--json"}).json()["hash"];
  std::string file = town.folder / "walk.record";
  std::vector<unsigned> pvs(const std::string& method) const {
    return ivis({"pvs", town.scene, "--eye", SmallTown::kEye, "--reach", kReach, "--method", method,
                 "--json"})
        .json()["objects"];
  }
  Ran verify(std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments{"verify", town.scene, "--record", file, "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return ivis(arguments);
  }
};

TEST(ToolVerify, FindsNothingMissingAlongAPath) {
  const SmallTown town;
  for (const char* map : {"polar", "orthographic"}) {
    const Ran ran = ivis({"verify", town.scene, "--path", town.path, "--reach", kReach, "--stride",
                          "3", "--map", map, "--json"});
    ASSERT_EQ(ran.code, 0) << ran.out << ran.errors;
    const Json j = ran.json();
    EXPECT_EQ(keys(j), kKeys);
    EXPECT_EQ(j["false_negatives"], 0);
    EXPECT_EQ(j["missing"], Json::array());
    EXPECT_GE(j["overestimate"], 1);
    EXPECT_GE(j["pvs_median"], j["seen_median"]);
  }
}

TEST(ToolVerify, FindsNothingMissingInAFrustum) {
  const SmallTown town;
  const auto run = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"verify", town.scene, "--path", town.path, "--reach",
                                       kReach,   "--stride", "3",      "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Ran ran = ivis(arguments);
    EXPECT_EQ(ran.code, 0) << ran.out << ran.errors;
    return ran.json();
  };
  const Json whole = run({});
  const Json part = run({"--frustum", "90,0,60,40,5"});
  EXPECT_EQ(part["false_negatives"], 0);
  EXPECT_LT(part["pvs_median"], whole["pvs_median"]);
  EXPECT_LT(part["seen_median"], whole["seen_median"]);
}

TEST(ToolVerify, MoreRaysAndASmallerStrideShootMore) {
  const SmallTown town;
  const auto rays = [&](const char* n, const char* stride) {
    return ivis({"verify", town.scene, "--path", town.path, "--reach", kReach, "--rays", n,
                 "--stride", stride, "--json"})
        .json()["rays"]
        .get<std::size_t>();
  };
  const std::size_t few = rays("16", "7");
  EXPECT_EQ(rays("64", "7"), 4 * few) << "one pose, so many culled objects";
  EXPECT_GT(rays("16", "1"), 4 * few);
}

TEST(ToolVerify, StrictRaysSeeMoreAndStillFindNothingMissing) {
  const SmallTown town;
  std::vector<std::string> arguments{"verify",  town.scene, "--path", town.path,
                                     "--reach", kReach,     "--json"};
  const Json usual = ivis(arguments).json();
  arguments.emplace_back("--strict");
  const Ran strict = ivis(arguments);
  EXPECT_EQ(strict.code, 0) << strict.out << strict.errors;
  EXPECT_GE(strict.json()["seen_median"], usual["seen_median"]);
}

TEST(ToolVerify, AnAggressiveListFailsTheCheck) {
  Recorded r;
  std::vector<unsigned> ids = r.pvs("cull-map");
  write(r.file, record_of(r.hash, ids));
  const Ran whole = r.verify();
  EXPECT_EQ(whole.code, 0) << whole.out << whole.errors;

  const std::vector<unsigned> seen = r.pvs("reference");
  ASSERT_GT(seen.size(), 2U);
  const unsigned dropped = seen[seen.size() / 2];
  std::erase(ids, dropped);
  write(r.file, record_of(r.hash, ids));
  const Ran ran = r.verify();
  EXPECT_EQ(ran.code, 1) << ran.errors;
  const Json j = ran.json();
  EXPECT_EQ(keys(j), kKeys);
  EXPECT_EQ(j["false_negatives"], 1);
  ASSERT_EQ(j["missing"].size(), 1U);
  EXPECT_EQ(keys(j["missing"][0]), (std::vector<std::string>{"id", "eye", "hit"}));
  EXPECT_EQ(j["missing"][0]["id"], dropped);
}

TEST(ToolVerify, ListsAtMostTwentyMisses) {
  Recorded r;
  write(r.file, record_of(r.hash, {}));
  const Ran ran = r.verify();
  EXPECT_EQ(ran.code, 1);
  EXPECT_GT(ran.json()["false_negatives"], 20);
  EXPECT_EQ(ran.json()["missing"].size(), 20U);
}

TEST(ToolVerify, AnUncoveredFrameIsCheckedFromItsEyeAlone) {
  Recorded r;
  const std::vector<unsigned> ids = r.pvs("cull-map");
  write(r.file, record_of(r.hash, ids, "uncovered"));
  EXPECT_EQ(r.verify().code, 0);
  write(r.file, record_of(r.hash, ids, "uncovered", "10 1.7 130"));
  EXPECT_EQ(r.verify().code, 1) << "another street";
}

TEST(ToolVerify, AFrameThatShowedEverythingMissesNothing) {
  Recorded r;
  std::string text = record_of(r.hash, {}, "uncovered");
  text.replace(text.rfind(" 0\n"), 3, " everything\n");
  write(r.file, text);
  const Ran ran = r.verify();
  EXPECT_EQ(ran.code, 0) << ran.out << ran.errors;
  EXPECT_EQ(ran.json()["pvs_median"], SmallTown::kObjects);
}

TEST(ToolVerify, ARecordOfAnotherSceneIsRefusedNamingBoth) {
  Recorded r;
  const std::string other = write_other_town(r.town.folder);
  write(r.file, record_of(r.hash, {}));
  const Ran ran = ivis({"verify", other, "--record", r.file});
  EXPECT_EQ(ran.code, 3);
  EXPECT_NE(ran.errors.find(r.hash), std::string::npos) << ran.errors;
  EXPECT_NE(ran.errors.find(ivis({"info", other, "--json"}).json()["hash"].get<std::string>()),
            std::string::npos)
      << ran.errors;
}

TEST(ToolVerify, RefusesARecordThatProvesNothing) {
  Recorded r;
  const std::string text = record_of(r.hash, {});
  write(r.file, text.substr(0, text.find("frame")));
  EXPECT_EQ(r.verify().code, 3) << "no frame";
  write(r.file, text.substr(0, text.size() / 2));
  EXPECT_EQ(r.verify().code, 3) << "cut off";
  write(r.file, "");
  EXPECT_EQ(r.verify().code, 3);
  std::string lie = text;
  lie.replace(lie.find("objects "), lie.find("\nframe") - lie.find("objects "), "objects 7");
  write(r.file, lie);
  EXPECT_EQ(r.verify().code, 3) << "another number of objects";
}

}  // namespace
}  // namespace ivis::test
