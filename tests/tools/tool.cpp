#include "tests/tools/tool.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tests/server/process.h"

namespace ivis::test {

Ran ivis(const std::vector<std::string>& arguments, int seconds) {
  const Folder folder;
  const std::string errors = folder / "errors";
  // The shell becomes the command, so that the time limit kills the command itself.
  std::vector<std::string> command{"/bin/sh", "-c", "exec \"$@\" 2>\"$0\"", errors, IVIS_TOOL};
  command.insert(command.end(), arguments.begin(), arguments.end());
  Process process(command);
  Ran ran;
  ran.code = process.finish(seconds);
  ran.out = process.output();
  ran.errors = read(errors);
  return ran;
}

std::vector<std::string> keys(const Json& object) {
  std::vector<std::string> names;
  for (const auto& [key, value] : object.items())
    names.push_back(key);
  return names;
}

Folder::Folder() {
  std::string name = (std::filesystem::temp_directory_path() / "ivis_tool_test_XXXXXX").string();
  if (mkdtemp(name.data()) != nullptr) path_ = name;
}

Folder::~Folder() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

std::vector<std::string> Folder::files() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(path_))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

std::string read(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

void write(const std::string& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

}  // namespace ivis::test
