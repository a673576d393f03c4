#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace ivis::test {

/// A file of the data that lies beside the checkout (../shared/data, or $IVIS_SHARED_DATA), if it
/// is there. A test that wants one and finds none says IVIS_NEED_DATA and counts as skipped.
std::optional<std::filesystem::path> shared_data(const std::string& relative);

}  // namespace ivis::test

/// scripts/test counts these lines.
#define IVIS_NEED_DATA(var, relative)                                 \
  const auto var##_found = ::ivis::test::shared_data(relative);       \
  if (!var##_found) GTEST_SKIP() << "no shared data: " << (relative); \
  const std::filesystem::path var = *var##_found
