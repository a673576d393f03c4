#include "gltf_file.h"

#include <atomic>
#include <cstring>
#include <fstream>

#include <unistd.h>

namespace ivis::test {

using nlohmann::json;

int GltfFile::add_view(const std::string& bytes, int stride) {
  bin.resize((bin.size() + 3) / 4 * 4);
  json view = {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes.size()}};
  if (stride != 0) view["byteStride"] = stride;
  bin += bytes;
  root["bufferViews"].push_back(view);
  return static_cast<int>(root["bufferViews"].size()) - 1;
}

int GltfFile::add_accessor(int view, int component_type, std::size_t count, const std::string& type,
                           bool normalized) {
  json accessor = {{"componentType", component_type}, {"count", count}, {"type", type}};
  if (view >= 0) accessor["bufferView"] = view;
  if (normalized) accessor["normalized"] = true;
  root["accessors"].push_back(accessor);
  return static_cast<int>(root["accessors"].size()) - 1;
}

int GltfFile::add_mesh(int positions, int indices, const json& extra) {
  json primitive = {{"attributes", {{"POSITION", positions}}}};
  if (indices >= 0) primitive["indices"] = indices;
  primitive.update(extra);
  root["meshes"].push_back({{"primitives", json::array({primitive})}});
  return static_cast<int>(root["meshes"].size()) - 1;
}

int GltfFile::add_node(const json& node, bool in_scene) {
  root["nodes"].push_back(node);
  const int index = static_cast<int>(root["nodes"].size()) - 1;
  if (!root.contains("scenes")) {
    root["scenes"] = json::array({{{"nodes", json::array()}}});
    root["scene"] = 0;
  }
  if (in_scene) root["scenes"][0]["nodes"].push_back(index);
  return index;
}

int GltfFile::add_triangle(const json& extra) {
  const int positions = add_accessor_of<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, kFloat, "VEC3");
  json node = {{"mesh", add_mesh(positions, -1)}};
  node.update(extra);
  return add_node(node);
}

std::string glb_of(std::string text, std::string bytes) {
  text.resize((text.size() + 3) / 4 * 4, ' ');
  bytes.resize((bytes.size() + 3) / 4 * 4, '\0');
  std::string out;
  const auto u32 = [&](std::size_t v) {
    const auto value = static_cast<std::uint32_t>(v);
    char raw[4];
    std::memcpy(raw, &value, 4);
    out.append(raw, 4);
  };
  out += "glTF";
  u32(2);
  u32(12 + 8 + text.size() + (bytes.empty() ? 0 : 8 + bytes.size()));
  u32(text.size());
  out += "JSON";
  out += text;
  if (!bytes.empty()) {
    u32(bytes.size());
    out.append("BIN\0", 4);
    out += bytes;
  }
  return out;
}

std::string GltfFile::glb() const {
  json whole = root;
  if (!bin.empty() && !whole.contains("buffers"))
    whole["buffers"] = json::array({{{"byteLength", bin.size()}}});
  return glb_of(whole.dump(), bin);
}

GltfFolder::GltfFolder() {
  static std::atomic<int> next{0};
  folder_ = std::filesystem::path(::testing::TempDir()) /
            ("ivis_gltf_" + std::to_string(getpid()) + "_" + std::to_string(next++));
  std::filesystem::create_directories(folder_);
}

GltfFolder::~GltfFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::filesystem::path GltfFolder::write(const std::string& name, const std::string& bytes) const {
  const auto file = folder_ / name;
  std::error_code ignored;
  std::filesystem::remove(
      file, ignored);  // some file systems flush a file that is truncated and rewritten
  std::ofstream(file, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return file;
}

Result<Scene> GltfFolder::load(const GltfFile& file, const SceneOptions& options) const {
  return load_scene(write("scene.glb", file.glb()), options);
}

Result<Scene> GltfFolder::load_bytes(const std::string& bytes) const {
  return load_scene(write("scene.glb", bytes));
}

}  // namespace ivis::test
