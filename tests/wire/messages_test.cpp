#include "wire/messages.h"

#include <gtest/gtest.h>

namespace ivis::wire {
namespace {

TEST(WireMessages, PvsEnvelopeIsSmall) {
  PvsMessage m{.session = 0x1234567890abcdef, .sequence = 7, .base = 6, .eye = {}, .everything = false, .solve_us = 90, .payload = std::vector<std::byte>(200)};
  EXPECT_EQ(encode(m).size(), 248U);
}

}  // namespace
}  // namespace ivis::wire
