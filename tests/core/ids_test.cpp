#include "core/ids.h"

#include <gtest/gtest.h>

namespace ivis {
namespace {

TEST(SceneHashText, HasSixteenDigitsWhateverTheValue) {
  EXPECT_EQ(to_hex(0), "0000000000000000");
  EXPECT_EQ(to_hex(0x1234), "0000000000001234");
  EXPECT_EQ(to_hex(0x0123456789abcdefULL), "0123456789abcdef");
  EXPECT_EQ(to_hex(~SceneHash{0}), "ffffffffffffffff");
}

}  // namespace
}  // namespace ivis
