#pragma once
// Runs the built commands, as a script outside the project would.

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace ivis::test {

using Json = nlohmann::ordered_json;

/// What a run of `ivis` left.
struct Ran {
  int code = -1;       ///< exit code, or minus the signal that ended it
  std::string out;     ///< standard output
  std::string errors;  ///< standard error
  /// Standard output as JSON; `discarded` when it is not.
  Json json() const { return Json::parse(out, nullptr, false); }
};

/// Runs `ivis` with these arguments; kills it after `seconds`.
Ran ivis(const std::vector<std::string>& arguments, int seconds = 60);

/// Names of an object's members, in order.
std::vector<std::string> keys(const Json& object);

/// A folder of this test alone, removed with its content when it goes out of scope.
class Folder {
 public:
  Folder();
  ~Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  const std::filesystem::path& path() const { return path_; }
  std::vector<std::string> files() const;  ///< names, sorted

 private:
  std::filesystem::path path_;
};

std::string read(const std::string& file);
void write(const std::string& file, const std::string& text);

}  // namespace ivis::test
