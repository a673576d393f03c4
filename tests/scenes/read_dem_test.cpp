#include "scenes/read_dem.h"

#include <cmath>

#include <gtest/gtest.h>
#include <unistd.h>

#include "core/path.h"
#include "tests/support/shared_data.h"

namespace ivis {
namespace {

namespace fs = std::filesystem;

class ReadDem : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("ivis_dem_" + std::to_string(getpid()));
    fs::create_directory(folder_);
  }
  void TearDown() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  fs::path file(const std::string& name, const std::string& bytes) {
    EXPECT_TRUE(write_file_whole(folder_ / name, bytes));
    return folder_ / name;
  }
  fs::path folder_;
};

const std::string kGrid =
    "ncols 4\nnrows 3\nxllcorner 100\nyllcorner 200\ncellsize 2.5\nNODATA_value -9999\n"
    "1 2 3 4\n5 -9999 7 8\n9 10 11 12.5\n";

TEST_F(ReadDem, SaysClearlyThatGdalIsMissingWhenItIs) {
  if (can_read_dem()) GTEST_SKIP() << "built with GDAL";
  const auto dem = read_dem(file("a.asc", kGrid));
  ASSERT_FALSE(dem);
  EXPECT_EQ(dem.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(dem.error().message.find("GDAL"), std::string::npos);
}

class ReadDemByGdal : public ReadDem {
 protected:
  void SetUp() override {
    ReadDem::SetUp();
    if (!can_read_dem()) GTEST_SKIP() << "built without GDAL";
  }
  void expect_error(const fs::path& f, const DemCrop& crop, ErrorCode code,
                    const std::string& named) {
    const auto dem = read_dem(f, crop);
    ASSERT_FALSE(dem) << f;
    EXPECT_EQ(dem.error().code, code) << dem.error().message;
    EXPECT_NE(dem.error().message.find(named), std::string::npos) << dem.error().message;
    EXPECT_NE(dem.error().message.find(f.string()), std::string::npos) << dem.error().message;
  }
};

TEST_F(ReadDemByGdal, ReadsAnAsciiGridFromTheNorthWestCornerWithNotANumberForHoles) {
  const auto dem = read_dem(file("a.asc", kGrid));
  ASSERT_TRUE(dem) << dem.error().message;
  EXPECT_EQ(dem->columns, 4U);
  EXPECT_EQ(dem->rows, 3U);
  EXPECT_EQ(dem->step_m, Vec2(2.5));
  EXPECT_EQ(dem->at(0, 0), 1);
  EXPECT_EQ(dem->at(3, 2), 12.5F);
  EXPECT_TRUE(std::isnan(dem->at(1, 1)));
}

TEST_F(ReadDemByGdal, CropsBySamplesAndByMetresAboutTheMiddle) {
  const auto f = file("a.asc", kGrid);
  DemCrop crop;
  crop.samples = {2, 1, 2, 2};
  auto dem = read_dem(f, crop);
  ASSERT_TRUE(dem) << dem.error().message;
  EXPECT_EQ(dem->heights, (std::vector<float>{7, 8, 11, 12.5F}));
  crop.samples.reset();
  crop.metres = Vec2{2.6, 100};
  dem = read_dem(f, crop);
  ASSERT_TRUE(dem) << dem.error().message;
  EXPECT_EQ(dem->columns, 2U);
  EXPECT_EQ(dem->rows, 3U);
  EXPECT_EQ(dem->at(0, 0), 2);
  crop.metres.reset();
  for (const auto& bad : {std::array<std::size_t, 4>{3, 0, 2, 2},
                          {0, 0, 1, 3},
                          {0, 0, 4, 4},
                          {9, 9, 2, 2},
                          {1, 1, ~std::size_t{0}, 2}}) {
    crop.samples = bad;
    expect_error(f, crop, ErrorCode::kInvalidArgument, "crop");
  }
}

TEST_F(ReadDemByGdal, DegreesBecomeMetresByLatitude) {
  // Big-endian 16-bit heights, 1201 x 1201: the tile's name is its south-west corner.
  std::string bytes(std::size_t{2} * 1201 * 1201, '\0');
  bytes[1] = 77;
  const auto dem = read_dem(file("N60E010.hgt", bytes));
  ASSERT_TRUE(dem) << dem.error().message;
  EXPECT_EQ(dem->columns, 1201U);
  EXPECT_EQ(dem->at(0, 0), 77);
  // A degree at 60.5 north is 54.95 km wide and 111.42 km high on WGS84.
  EXPECT_NEAR(dem->step_m.x * 1200, 54'950, 30);
  EXPECT_NEAR(dem->step_m.y * 1200, 111'420, 30);
}

TEST_F(ReadDemByGdal, NamesWhatIsWrongWithAFile) {
  expect_error(folder_ / "absent.tif", {}, ErrorCode::kIo, "no such file");
  expect_error(folder_, {}, ErrorCode::kIo, "no such file");
  expect_error(file("text.tif", "this is no terrain"), {}, ErrorCode::kInput, "");
  expect_error(file("empty.asc", ""), {}, ErrorCode::kInput, "");
  expect_error(file("short.asc", kGrid.substr(0, kGrid.size() - 12)), {}, ErrorCode::kInput,
               "row 2");
  expect_error(file("high.asc", std::string(kGrid).replace(kGrid.find("12.5"), 4, "1e30")), {},
               ErrorCode::kInput, "row 2");
  std::string holes =
      "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value 7\n7 7\n7 7\n";
  expect_error(file("holes.asc", holes), {}, ErrorCode::kInput, "only holes");
  // Other formats that GDAL knows are not let in: a virtual one may point anywhere.
  expect_error(file("a.vrt", "<VRTDataset rasterXSize=\"2\" rasterYSize=\"2\"/>"), {},
               ErrorCode::kInput, "");
}

TEST_F(ReadDemByGdal, ReadsTheRealFiles) {
  IVIS_NEED_DATA(tyrol, "terrain/tyrol_mal_5m.tif");
  const auto tiff = read_dem(tyrol);
  ASSERT_TRUE(tiff) << tiff.error().message;
  EXPECT_EQ(tiff->step_m, Vec2(5));
  std::size_t holes = 0;
  for (const float h : tiff->heights) {
    if (std::isnan(h)) {
      ++holes;
    } else {
      ASSERT_TRUE(h > 1300 && h < 2900) << h;
    }
  }
  EXPECT_GT(holes, 1000U);
  // A damaged copy: the middle of the file is gone.
  auto bytes = read_file_whole(tyrol, std::size_t{1} << 30U);
  ASSERT_TRUE(bytes);
  bytes->resize(bytes->size() / 2);
  const auto broken = read_dem(file("broken.tif", *bytes));
  ASSERT_FALSE(broken);
  EXPECT_EQ(broken.error().code, ErrorCode::kInput);

  IVIS_NEED_DATA(srtm, "terrain/N44W072.hgt");
  DemCrop crop;
  crop.metres = Vec2{4000, 4000};
  const auto hgt = read_dem(srtm, crop);
  ASSERT_TRUE(hgt) << hgt.error().message;
  EXPECT_NEAR(static_cast<double>(hgt->columns - 1) * hgt->step_m.x, 4000, 70);
  EXPECT_NEAR(static_cast<double>(hgt->rows - 1) * hgt->step_m.y, 4000, 95);
}

}  // namespace
}  // namespace ivis
