#pragma once

#include <cstddef>
#include <string>

#include "tests/tools/tool.h"

namespace ivis::test {

/// A town of 25 houses in rows, 400 small boxes in its streets and ground below, as files in a
/// folder of its own.
struct SmallTown {
  static constexpr std::size_t kHouses = 25;
  static constexpr std::size_t kBoxes = 400;
  static constexpr std::size_t kObjects = kHouses + kBoxes + 1;

  SmallTown();
  Folder folder;
  std::string scene;  ///< GLB
  std::string
      path;  ///< CSV of kPoses rows down a street, two columns that do not matter among them
  static constexpr std::size_t kPoses = 7;
  static const std::string kEye;  ///< the path's first row
};

/// The same town with its last house moved: another scene hash.
std::string write_other_town(const Folder& folder);

/// The small town as one mesh of one node, without a name.
std::string write_merged_town(const Folder& folder);

}  // namespace ivis::test
