#include "server/config.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/log.h"

namespace ivis::server {
namespace {

using ::testing::HasSubstr;

Environment variables(std::map<std::string, std::string> values) {
  return [values = std::move(values)](const std::string& name) -> std::optional<std::string> {
    const auto found = values.find(name);
    return found != values.end() ? std::optional(found->second) : std::nullopt;
  };
}

class ConfigFile : public ::testing::Test {
 protected:
  std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("ivisd_") + ::testing::UnitTest::GetInstance()->current_test_info()->name() +
       ".toml");
  void TearDown() override { std::filesystem::remove(file); }
  void write(const std::string& text) { std::ofstream(file) << text; }
  std::string error_of(const std::string& text) {
    write(text);
    const auto c = configure({}, variables({}), file);
    EXPECT_FALSE(c);
    return c ? "" : c.error().message;
  }
};

TEST_F(ConfigFile, FlagGoesOverEnvironmentOverFileOverDefault) {
  write("reach = \"disc:3\"\nthreads = 3\nlog_level = \"warn\"\n");
  const auto c = configure({{"reach", "disc:1"}},
                           variables({{"IVISD_REACH", "disc:2"}, {"IVISD_THREADS", "2"}}), file);
  ASSERT_TRUE(c) << c.error().message;
  EXPECT_EQ(c->config.reach, "disc:1");
  EXPECT_EQ(c->config.threads, 2U);
  EXPECT_EQ(c->config.log_level, LogLevel::kWarn);
  EXPECT_EQ(c->config.listen, "tcp://127.0.0.1:7447");
  std::map<std::string, std::string> origin;
  for (const Setting& s : c->settings)
    origin[s.key] = s.origin;
  EXPECT_EQ(origin["reach"], "flag --reach");
  EXPECT_EQ(origin["threads"], "environment IVISD_THREADS");
  EXPECT_EQ(origin["log_level"], file.string() + ":3");
  EXPECT_EQ(origin["listen"], "default");
}

TEST_F(ConfigFile, UnknownKeyIsAnErrorThatNamesFileLineAndKey) {
  EXPECT_THAT(error_of("threads = 1\n\nraech = \"disc:1\"\n"),
              HasSubstr(file.string() + ":3: unknown key 'raech'"));
  EXPECT_THAT(error_of("[server]\nthreads = 1\n"), HasSubstr("unknown key 'server'"));
}

TEST_F(ConfigFile, WrongValuesNameLineKeyFoundAndExpected) {
  EXPECT_THAT(
      error_of("\nthreads = \"two\"\n"),
      HasSubstr(":2: key 'threads': found a value of type string, expected a whole number"));
  EXPECT_THAT(error_of("threads = 0"),
              HasSubstr("found '0', expected a whole number from 1 to 256"));
  EXPECT_THAT(error_of("threads = -1"), HasSubstr("found '-1'"));
  EXPECT_THAT(error_of("reach = \"disk:1\""), HasSubstr("disk:1"));
  EXPECT_THAT(error_of("listen = \"http://x\""), HasSubstr("expected tcp://"));
  EXPECT_THAT(error_of("log_level = \"loud\""), HasSubstr("expected debug"));
  EXPECT_THAT(error_of("granularity = \"mesh\""),
              HasSubstr("key 'granularity': found 'mesh', expected object or cluster"));
  EXPECT_THAT(error_of("json_logs = 1"), HasSubstr("expected true or false"));
  EXPECT_THAT(error_of("scene = 5"), HasSubstr("expected a string"));
}

TEST_F(ConfigFile, SyntaxErrorNamesTheLine) {
  EXPECT_THAT(error_of("threads = 1\nreach = \n"), HasSubstr(file.string() + ":2: "));
  EXPECT_THAT(error_of(std::string(5000, '[')), HasSubstr(file.string()));
}

TEST_F(ConfigFile, OverriddenMistakesDoNotHide) {
  write("threads = 0\n");
  EXPECT_FALSE(configure({{"threads", "2"}}, variables({}), file));
}

TEST_F(ConfigFile, RelativePathsAreRelativeToTheFile) {
  write("scene = \"city.glb\"\noccluders = \"/abs/city.ivo\"\n");
  const auto c = configure({}, variables({}), file);
  ASSERT_TRUE(c);
  EXPECT_EQ(c->config.scene, file.parent_path() / "city.glb");
  EXPECT_EQ(c->config.occluders, "/abs/city.ivo");
}

TEST_F(ConfigFile, PrintedConfigurationReadsBackTheSame) {
  const auto c = configure(
      {{"scene", "/s \"quoted\".glb"}, {"threads", "7"}, {"busy_poll", "true"}}, variables({}), {});
  ASSERT_TRUE(c);
  write(to_string(*c));
  const auto again = configure({}, variables({}), file);
  ASSERT_TRUE(again) << again.error().message;
  for (std::size_t i = 0; i < c->settings.size(); ++i)
    EXPECT_EQ(c->settings[i].value, again->settings[i].value);
}

TEST(Config, AMistakeInAFlagIsAnArgumentErrorOneInTheEnvironmentIsInput) {
  EXPECT_EQ(configure({{"reach", "x"}}, variables({}), {}).error().code,
            ErrorCode::kInvalidArgument);
  const auto c = configure({}, variables({{"IVISD_MAX_CLIENTS", "many"}}), {});
  EXPECT_EQ(c.error().code, ErrorCode::kInput);
  EXPECT_THAT(c.error().message, HasSubstr("environment IVISD_MAX_CLIENTS"));
}

TEST_F(ConfigFile, GranularityComesFromFileEnvironmentOrFlag) {
  const auto granularity = [&](const std::map<std::string, std::string>& flags,
                               const std::map<std::string, std::string>& environment) {
    const auto c = configure(flags, variables(environment), file);
    EXPECT_TRUE(c) << (c ? "" : c.error().message);
    return c->config.granularity;
  };
  write("");
  EXPECT_EQ(granularity({}, {}), Granularity::kObject);
  EXPECT_EQ(granularity({}, {{"IVISD_GRANULARITY", "cluster"}}), Granularity::kCluster);
  EXPECT_EQ(granularity({{"granularity", "cluster"}}, {}), Granularity::kCluster);
  write("granularity = \"cluster\"\n");
  const auto c = configure({}, variables({}), file);
  ASSERT_TRUE(c) << c.error().message;
  EXPECT_EQ(c->config.granularity, Granularity::kCluster);
  EXPECT_THAT(to_string(*c), HasSubstr("granularity = 'cluster'"));
}

TEST(Config, AbsentFileIsAnError) {
  EXPECT_EQ(configure({}, variables({}), "/nonexistent/ivisd.toml").error().code, ErrorCode::kIo);
}

TEST(Log, BytesFromOutsideBreakNeitherLineNorJson) {
  EXPECT_EQ(format_event("e", {{"text", "a \"b\"\n\x01"}, {"n", 3}}, false),
            "event=e text=\"a \\\"b\\\"\\u000a\\u0001\" n=3");
  EXPECT_EQ(format_event("e", {{"text", "a\nb"}, {"n", 3}}, true),
            "\"event\":\"e\",\"text\":\"a\\u000ab\",\"n\":3");
}

}  // namespace
}  // namespace ivis::server
