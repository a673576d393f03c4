#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include "tests/server/process.h"
#include "tests/server/tiny_glb.h"

namespace ivis::test {
namespace {

TEST(CConsumer, WalksInProcessThroughThePublicHeaders) {
  const auto scene = std::filesystem::path(::testing::TempDir()) /
                     ("ivis_consumer_" + std::to_string(getpid()) + ".glb");
  write_tiny_glb(scene, 5);
  Process p({IVIS_CONSUMER, scene.string()});
  EXPECT_EQ(p.finish(), 0) << p.output();
  EXPECT_THAT(p.output(), ::testing::HasSubstr("/nonexistent.glb"));
  std::filesystem::remove(scene);
}

}  // namespace
}  // namespace ivis::test
