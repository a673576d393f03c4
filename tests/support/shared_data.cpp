#include "tests/support/shared_data.h"

#include <cstdlib>

namespace ivis::test {

std::optional<std::filesystem::path> shared_data(const std::string& relative) {
  const char* given = std::getenv("IVIS_SHARED_DATA");
  const std::filesystem::path root =
      given != nullptr ? std::filesystem::path(given)
                       : std::filesystem::path(IVIS_SOURCE_DIR) / ".." / "shared" / "data";
  auto file = root / relative;
  std::error_code ec;
  if (!std::filesystem::is_regular_file(file, ec)) return std::nullopt;
  return file;
}

}  // namespace ivis::test
