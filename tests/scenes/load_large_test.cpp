// The largest scene at hand: all of it loads, within the memory that a small server has.
#include <sys/resource.h>

#include "gltf_file.h"
#include "tests/support/shared_data.h"

namespace ivis::test {
namespace {

// Sanitizers multiply the memory of a process.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

std::size_t peak_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024;
}

TEST(LoadLarge, LinzCityFitsInMemory) {
  IVIS_NEED_DATA(file, "linz/linz_city.glb");
  const auto s = load_scene(file);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->objects.size(), 57800U);
  EXPECT_EQ(s->triangle_count, 2540215U);
  if (!kSanitized) {
    EXPECT_LT(peak_bytes(), std::size_t{1200} << 20U);
  }
}

}  // namespace
}  // namespace ivis::test
