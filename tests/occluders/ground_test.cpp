#include "occluders/ground.h"

#include <gtest/gtest.h>
TEST(Ground, Stub) {}
