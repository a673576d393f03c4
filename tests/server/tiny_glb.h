#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

namespace ivis::test {

/// A scene file: `boxes` unit boxes in a row along +X, 3 m apart, each a node of its own.
inline std::string tiny_glb(int boxes) {
  std::string bin;
  const auto put = [&](auto v) { bin.append(reinterpret_cast<const char*>(&v), sizeof v); };
  for (int i = 0; i < 8; ++i)
    for (const int bit : {1, 2, 4})
      put((i & bit) != 0 ? 1.0F : 0.0F);
  constexpr std::uint16_t kFaces[12][3]{{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                        {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                        {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  for (const auto& face : kFaces)
    for (const std::uint16_t i : face)
      put(i);
  std::string nodes;
  std::string list;
  for (int i = 0; i < boxes; ++i) {
    const std::string comma = i == 0 ? "" : ",";
    nodes += comma + R"({"mesh":0,"translation":[)" + std::to_string(3 * i) + ",0,0]}";
    list += comma + std::to_string(i);
  }
  std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[)" + list + R"(]}],"nodes":[)" +
      nodes +
      R"(],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],)"
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},)"
      R"({"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":96},{"buffer":0,"byteOffset":96,"byteLength":72}],)"
      R"("buffers":[{"byteLength":168}]})";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string out = "glTF";
  const auto word = [&](std::size_t v) {
    const auto w = static_cast<std::uint32_t>(v);
    out.append(reinterpret_cast<const char*>(&w), sizeof w);
  };
  word(2);
  word(12 + 8 + json.size() + 8 + bin.size());
  word(json.size());
  out += "JSON" + json;
  word(bin.size());
  return out + std::string("BIN\0", 4) + bin;
}

inline void write_tiny_glb(const std::filesystem::path& file, int boxes) {
  std::ofstream(file, std::ios::binary) << tiny_glb(boxes);
}

}  // namespace ivis::test
