#include "core/path.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>
#include <system_error>

#include <unistd.h>

namespace ivis {
namespace {

constexpr std::size_t kMaxPathBytes = 256U << 20U;

std::string_view trimmed(std::string_view s) {
  while (!s.empty() && (s.front() == ' ' || s.front() == '\t' || s.front() == '"'))
    s.remove_prefix(1);
  while (!s.empty() && (s.back() == ' ' || s.back() == '\t' || s.back() == '\r' || s.back() == '"'))
    s.remove_suffix(1);
  return s;
}

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> cells;
  while (true) {
    const auto comma = line.find(',');
    cells.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

std::string system_reason() {
  return std::generic_category().message(errno);
}

}  // namespace

Result<std::string> read_file_whole(const std::filesystem::path& file, std::size_t max_bytes) {
  std::error_code ec;
  if (std::filesystem::is_directory(file, ec))
    return io_error("'" + file.string() + "' is a folder, expected a file");
  errno = 0;
  std::ifstream in(file, std::ios::binary);
  if (!in) return io_error("cannot open '" + file.string() + "': " + system_reason());
  in.seekg(0, std::ios::end);
  const auto end = in.tellg();
  if (end < 0) return io_error("cannot read '" + file.string() + "': not a regular file");
  const auto size = static_cast<std::size_t>(end);
  if (size > max_bytes)
    return input_error("'" + file.string() + "' has " + std::to_string(size) + " bytes, at most " +
                       std::to_string(max_bytes) + " are taken");
  std::string bytes(size, '\0');
  in.seekg(0);
  if (!in.read(bytes.data(), static_cast<std::streamsize>(size)))
    return io_error("cannot read '" + file.string() + "': " + system_reason());
  return bytes;
}

Status write_file_whole(const std::filesystem::path& file, std::string_view bytes) {
  std::filesystem::path temporary = file;
  temporary += ".part-" + std::to_string(getpid());
  const auto fail = [&](const char* what) -> Status {
    const std::string reason = system_reason();
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    return io_error(std::string("cannot ") + what + " '" + file.string() + "': " + reason);
  };
  errno = 0;
  {
    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    if (!out) return fail("create");
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.flush();
    if (!out) return fail("write");
  }
  if (std::rename(temporary.c_str(), file.c_str()) != 0) return fail("replace");
  return ok();
}

Result<std::vector<Pose>> read_path(const std::filesystem::path& file) {
  const auto text = read_file_whole(file, kMaxPathBytes);
  if (!text) return text.error();
  std::string_view rest = *text;
  std::size_t line_number = 0;
  const auto next_line = [&]() -> std::optional<std::string_view> {
    while (!rest.empty()) {
      ++line_number;
      const auto eol = rest.find('\n');
      const auto line = trimmed(rest.substr(0, eol));
      rest.remove_prefix(eol == std::string_view::npos ? rest.size() : eol + 1);
      if (!line.empty()) return line;
    }
    return std::nullopt;
  };

  constexpr std::array<std::string_view, 6> kNames{"x", "y", "z", "t", "yaw_deg", "pitch_deg"};
  std::array<std::optional<std::size_t>, kNames.size()> column;
  const auto header = next_line();
  if (!header) return input_error("'" + file.string() + "' is empty, expected a header with x,y,z");
  const auto names = split(*header);
  for (std::size_t k = 0; k < kNames.size(); ++k)
    for (std::size_t c = 0; c < names.size() && !column[k]; ++c)
      if (names[c] == kNames[k]) column[k] = c;
  for (std::size_t k = 0; k < 3; ++k)
    if (!column[k])
      return input_error("'" + file.string() + "' line 1: no column '" + std::string(kNames[k]) +
                         "' in the header '" + std::string(header->substr(0, 120)) + "'");

  std::vector<Pose> poses;
  while (const auto line = next_line()) {
    const auto cells = split(*line);
    std::array<double, kNames.size()> v{};
    for (std::size_t k = 0; k < kNames.size(); ++k) {
      if (!column[k]) continue;
      const std::string where = "'" + file.string() + "' line " + std::to_string(line_number) +
                                ", column '" + std::string(kNames[k]) + "': ";
      if (*column[k] >= cells.size()) return input_error(where + "missing");
      const auto cell = cells[*column[k]];
      const auto parsed = std::from_chars(cell.data(), cell.data() + cell.size(), v[k]);
      if (parsed.ec != std::errc{} || parsed.ptr != cell.data() + cell.size() ||
          !std::isfinite(v[k]))
        return input_error(where + "found '" + std::string(cell.substr(0, 40)) +
                           "', expected a finite number");
    }
    poses.push_back({v[3], {v[0], v[1], v[2]}, v[4], v[5]});
  }
  if (poses.empty()) return input_error("'" + file.string() + "' has a header and no pose");
  return poses;
}

Status write_path(const std::filesystem::path& file, const std::vector<Pose>& poses) {
  std::ostringstream out;
  out << "t,x,y,z,yaw_deg,pitch_deg\n" << std::fixed;
  out.precision(4);
  for (const Pose& p : poses)
    out << p.t << ',' << p.eye.x << ',' << p.eye.y << ',' << p.eye.z << ',' << p.yaw_deg << ','
        << p.pitch_deg << '\n';
  return write_file_whole(file, out.str());
}

}  // namespace ivis
