#include "core/path.h"

#include <gtest/gtest.h>

namespace ivis {
namespace {

class PathFile : public ::testing::Test {
 protected:
  std::filesystem::path file_ = std::filesystem::path(::testing::TempDir()) / "ivis_path_test.csv";
  void TearDown() override { std::filesystem::remove(file_); }
  Result<std::vector<Pose>> read(const std::string& text) {
    EXPECT_TRUE(write_file_whole(file_, text));
    return read_path(file_);
  }
};

TEST_F(PathFile, TakesColumnsByNameInAnyOrderAndIgnoresOthers) {
  const auto poses = read("note,z,x,y\r\nhello,3,1,2\r\n\r\nworld,6,4,5\n");
  ASSERT_TRUE(poses) << poses.error().message;
  ASSERT_EQ(poses->size(), 2U);
  EXPECT_EQ((*poses)[1].eye, Vec3(4, 5, 6));
}

TEST_F(PathFile, RoundTripsToATenthOfAMillimetre) {
  ASSERT_TRUE(write_path(file_, {{0.5, {1.25, -2.5, 3}, 90, -10}}));
  const auto poses = read_path(file_);
  ASSERT_TRUE(poses);
  EXPECT_EQ((*poses)[0].eye, Vec3(1.25, -2.5, 3));
  EXPECT_EQ((*poses)[0].yaw_deg, 90);
}

TEST_F(PathFile, NamesLineColumnAndValueOfWhatIsWrong) {
  const auto bad = read("x,y,z\n1,2,3\n1,two,3\n");
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message.find("line 3, column 'y': found 'two'"), std::string::npos)
      << bad.error().message;
  for (const char* text :
       {"", "x,y\n1,2\n", "x,y,z\n", "x,y,z\n1,2\n", "x,y,z\n1,2,nan\n", "x,y,z\n1,2,inf\n"})
    EXPECT_FALSE(read(text)) << text;
}

TEST_F(PathFile, AFailedWriteLeavesTheOldFileAlone) {
  ASSERT_TRUE(write_file_whole(file_, "old"));
  EXPECT_FALSE(write_file_whole(file_ / "below-a-file", "new"));
  EXPECT_EQ(*read_file_whole(file_, 10), "old");
  EXPECT_FALSE(read_file_whole(file_, 2));
}

}  // namespace
}  // namespace ivis
