#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/math.h"
#include "core/result.h"

namespace ivis {

/// One observer pose. Yaw 0 looks along +X, 90 along -Z; pitch is up. Degrees.
struct Pose {
  double t = 0;  ///< seconds
  Vec3 eye{0};
  double yaw_deg = 0;
  double pitch_deg = 0;
};

/// Reads a path CSV: a header line, then a pose a row. Columns go by name (x, y, z needed; t,
/// yaw_deg, pitch_deg optional; others ignored). Errors: kIo; kInput naming file, line, column and
/// value.
Result<std::vector<Pose>> read_path(const std::filesystem::path& file);

/// Writes the columns t,x,y,z,yaw_deg,pitch_deg. The file appears whole or not at all.
Status write_path(const std::filesystem::path& file, const std::vector<Pose>& poses);

/// Writes `bytes` to a temporary file beside `file`, then renames it: an interrupted or failed
/// write leaves what was there before. Errors: kIo naming the file and the system's reason.
Status write_file_whole(const std::filesystem::path& file, std::string_view bytes);

/// Reads a whole file of at most `max_bytes`. Errors: kIo, kInput when larger.
Result<std::string> read_file_whole(const std::filesystem::path& file, std::size_t max_bytes);

}  // namespace ivis
