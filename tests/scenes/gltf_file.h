#pragma once
// Writes glTF files by hand for the tests of the loader.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/result.h"
#include "scenes/load.h"

namespace ivis::test {

inline constexpr int kByte = 5120, kUnsignedByte = 5121, kShort = 5122, kUnsignedShort = 5123,
                     kUnsignedInt = 5125, kFloat = 5126;

/// A glTF file in the making; `root` is free to be edited before it is written.
struct GltfFile {
  nlohmann::json root = {{"asset", {{"version", "2.0"}}}};
  std::string bin;

  /// Index of a new buffer view with these bytes, aligned to 4.
  int add_view(const std::string& bytes, int stride = 0);
  template <class T>
  int add_view_of(const std::vector<T>& values, int stride = 0) {
    return add_view(
        std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)),
        stride);
  }
  int add_accessor(int view, int component_type, std::size_t count, const std::string& type,
                   bool normalized = false);
  template <class T>
  int add_accessor_of(const std::vector<T>& values, int component_type, const std::string& type) {
    const std::size_t width = type == "SCALAR" ? 1 : type == "VEC3" ? 3 : 4;
    return add_accessor(add_view_of(values), component_type, values.size() / width, type);
  }
  /// A mesh of one primitive; `extra` is merged into the primitive. indices < 0: none.
  int add_mesh(int positions, int indices, const nlohmann::json& extra = nlohmann::json::object());
  /// A node of the scene; `extra` is merged into it.
  int add_node(const nlohmann::json& node, bool in_scene = true);
  /// Node `add_node` of a mesh of one triangle (0,0,0) (1,0,0) (0,1,0).
  int add_triangle(const nlohmann::json& extra = nlohmann::json::object());

  std::string glb() const;
};

/// The bytes of a GLB with this JSON text and BIN chunk.
std::string glb_of(std::string json, std::string bin);

/// A folder of its own for a test, removed afterwards.
class GltfFolder : public ::testing::Test {
 protected:
  GltfFolder();
  ~GltfFolder() override;
  std::filesystem::path write(const std::string& name, const std::string& bytes) const;
  Result<Scene> load(const GltfFile& file, const SceneOptions& options = {}) const;
  Result<Scene> load_bytes(const std::string& bytes) const;
  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
};

}  // namespace ivis::test

/// The value of a Result, or the test fails with its message.
#define IVIS_ASSERT_OK(result) ASSERT_TRUE((result).has_value()) << (result).error().message
/// The result is an error of this code whose message holds all of these words.
#define IVIS_EXPECT_ERROR(result, expected_code, ...)                               \
  do {                                                                              \
    const auto& checked_ = (result);                                                \
    ASSERT_FALSE(checked_.has_value()) << "loaded";                                 \
    EXPECT_EQ(checked_.error().code, expected_code) << checked_.error().message;    \
    for (const std::string word_ : std::initializer_list<const char*>{__VA_ARGS__}) \
      EXPECT_NE(checked_.error().message.find(word_), std::string::npos)            \
          << "no '" << word_ << "' in: " << checked_.error().message;               \
  } while (false)
