#include "visibility/backend.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/scene_builder.h"
#include "visibility/occlusion_map.h"

namespace ivis {
namespace {

/// Answers with what the CPU would, as long as it is let.
class Fragile : public Method {
 public:
  Fragile(const Scene& s, const OccluderSet& o, const bool& works)
      : cpu_(s, o, {}), works_(works) {}
  const MethodTraits& traits() const override { return cpu_.traits(); }
  Backend backend() const override { return Backend::kGl; }
  Result<Pvs> solve(const ViewCell& cell) const override {
    if (!works_) return unsupported("the card fell out");
    return cpu_.solve(cell);
  }

 private:
  OcclusionMap cpu_;
  const bool& works_;
};

class BackendChoice : public ::testing::Test {
 protected:
  BackendChoice() {
    test::SceneBuilder b;
    b.add_box({10, 0, -20}, {12, 10, 20}, OccluderTag::kNever);
    scene_ = std::move(b).finish();
    occluders_.scene_hash = scene_.hash;
    occluders_.reach = Reach::ball(0.5);
    options_.log = [this](std::string_view line) { log_.emplace_back(line); };
    options_.make_gl = [this](const Scene& s, const OccluderSet& o,
                              const MethodOptions&) -> Result<std::unique_ptr<Method>> {
      if (!there_) return unsupported("no card");
      return std::unique_ptr<Method>(std::make_unique<Fragile>(s, o, works_));
    };
  }
  auto made(Backend backend, std::string_view name = "occlusion-map") {
    options_.backend = backend;
    return make_method(name, scene_, occluders_, options_);
  }

  Scene scene_;
  OccluderSet occluders_;
  MethodOptions options_;
  std::vector<std::string> log_;
  bool there_ = true;
  bool works_ = true;
  ViewCell cell_{{0, 1.7, 0}, Reach::ball(0.5)};
};

TEST_F(BackendChoice, TakesWhatIsAskedForAndSaysSo) {
  EXPECT_EQ((*made(Backend::kCpu))->backend(), Backend::kCpu);
  EXPECT_EQ((*made(Backend::kGl))->backend(), Backend::kGl);
  EXPECT_EQ((*made(Backend::kAuto))->backend(), Backend::kGl);
  EXPECT_TRUE(log_.empty());
}

TEST_F(BackendChoice, AutoGoesToTheCpuWhereThereIsNoCardAndLogsItOnce) {
  there_ = false;
  const auto method = made(Backend::kAuto);
  ASSERT_TRUE(method);
  EXPECT_EQ((*method)->backend(), Backend::kCpu);
  EXPECT_TRUE((*method)->solve(cell_));
  ASSERT_EQ(log_.size(), 1U);
  EXPECT_NE(log_[0].find("no card"), std::string::npos);
}

TEST_F(BackendChoice, AutoGoesToTheCpuForGoodWhenTheCardFailsAndLogsItOnce) {
  const auto method = made(Backend::kAuto);
  ASSERT_TRUE(method);
  const auto before = (*method)->solve(cell_);
  works_ = false;
  for (int i = 0; i < 3; ++i) {
    const auto after = (*method)->solve(cell_);
    ASSERT_TRUE(after) << after.error().message;
    EXPECT_EQ(after->objects, before->objects);
    EXPECT_EQ((*method)->backend(), Backend::kCpu);
  }
  works_ = true;
  EXPECT_TRUE((*method)->solve(cell_));
  EXPECT_EQ((*method)->backend(), Backend::kCpu);
  ASSERT_EQ(log_.size(), 1U);
  EXPECT_NE(log_[0].find("the card fell out"), std::string::npos);
}

TEST_F(BackendChoice, AWrongCellIsNoFailureOfTheCard) {
  const auto method = made(Backend::kAuto);
  const auto refused = (*method)->solve({{0, 1.7, 0}, Reach::ball(2)});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ((*method)->backend(), Backend::kGl);
}

TEST_F(BackendChoice, GlIsAnErrorThatNamesTheReason) {
  there_ = false;
  auto method = made(Backend::kGl);
  ASSERT_FALSE(method);
  EXPECT_EQ(method.error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(method.error().message, "no card");
  options_.make_gl = nullptr;
  method = made(Backend::kGl);
  ASSERT_FALSE(method);
  EXPECT_EQ(method.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(method.error().message.find("built without"), std::string::npos);
  EXPECT_TRUE(made(Backend::kAuto));
  EXPECT_TRUE(log_.empty()) << "what is not built in has not failed";
  method = made(Backend::kGl, "cull-map");
  ASSERT_FALSE(method);
  EXPECT_EQ(method.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace ivis
