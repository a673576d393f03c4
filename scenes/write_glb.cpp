#include "scenes/write_glb.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <nlohmann/json.hpp>

namespace ivis {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kFloat = 5126;
constexpr int kUint16 = 5123;
constexpr int kUint32 = 5125;

template <class T>
void append_raw(std::string& out, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i)
    out.push_back(static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xffU));
}

void append_float(std::string& out, float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  append_raw(out, bits);
}

const char* tag_name(OccluderTag tag) {
  switch (tag) {
    case OccluderTag::kAuto:
      return "auto";
    case OccluderTag::kAlways:
      return "always";
    case OccluderTag::kOnly:
      return "only";
    case OccluderTag::kNever:
      return "never";
  }
  return "auto";
}

/// The binary chunk and the lists that describe it.
class Buffer {
 public:
  /// Ends the run of bytes appended to `bytes` since `begin` as one accessor.
  std::size_t finish(std::size_t begin, int component, std::size_t count, const char* type,
                     int target) {
    Json view{{"buffer", 0}, {"byteOffset", begin}, {"byteLength", bytes.size() - begin}};
    if (target != 0) view["target"] = target;
    views.push_back(std::move(view));
    accessors.push_back({{"bufferView", views.size() - 1},
                         {"componentType", component},
                         {"count", count},
                         {"type", type}});
    while (bytes.size() % 4 != 0)
      bytes.push_back('\0');
    return accessors.size() - 1;
  }

  std::size_t add_positions(const std::vector<glm::vec3>& positions) {
    const std::size_t begin = bytes.size();
    glm::vec3 lo(std::numeric_limits<float>::infinity());
    glm::vec3 hi(-std::numeric_limits<float>::infinity());
    for (const glm::vec3& p : positions) {
      for (int k = 0; k < 3; ++k)
        append_float(bytes, p[k]);
      lo = glm::min(lo, p);
      hi = glm::max(hi, p);
    }
    const std::size_t id = finish(begin, kFloat, positions.size(), "VEC3", 34962);
    accessors[id]["min"] = {lo.x, lo.y, lo.z};
    accessors[id]["max"] = {hi.x, hi.y, hi.z};
    return id;
  }

  std::size_t add_indices(const std::vector<std::uint32_t>& indices, std::size_t vertices) {
    const std::size_t begin = bytes.size();
    // 65535 itself is the restart value, which the format forbids.
    const bool narrow = vertices <= 65535;
    for (const std::uint32_t i : indices) {
      if (narrow)
        append_raw(bytes, static_cast<std::uint16_t>(i));
      else
        append_raw(bytes, i);
    }
    return finish(begin, narrow ? kUint16 : kUint32, indices.size(), "SCALAR", 34963);
  }

  std::string bytes;
  Json views = Json::array();
  Json accessors = Json::array();
};

bool finite(const GlbInstance& i) {
  float sum = 0;
  for (int k = 0; k < 3; ++k)
    sum += std::abs(i.translation[k]) + std::abs(i.scale[k]);
  for (int k = 0; k < 4; ++k)
    sum += std::abs(i.rotation[k]);
  return std::isfinite(sum);
}

Status check(const GlbScene& scene) {
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const std::string where = "mesh " + std::to_string(m) + " '" + scene.meshes[m].name + "': ";
    for (const GlbPrimitive& p : scene.meshes[m].primitives) {
      if (p.material >= scene.materials.size())
        return invalid_argument(where + "material " + std::to_string(p.material) +
                                ", expected below " + std::to_string(scene.materials.size()));
      if (p.indices.size() % 3 != 0)
        return invalid_argument(where + std::to_string(p.indices.size()) +
                                " indices, expected a multiple of 3");
      for (const std::uint32_t i : p.indices)
        if (i >= p.positions.size())
          return invalid_argument(where + "index " + std::to_string(i) + ", expected below " +
                                  std::to_string(p.positions.size()));
      for (const glm::vec3& v : p.positions)
        if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z))
          return invalid_argument(where + "a position is not finite");
    }
  }
  for (std::size_t n = 0; n < scene.nodes.size(); ++n) {
    const GlbNode& node = scene.nodes[n];
    const std::string where = "node " + std::to_string(n) + " '" + node.name + "': ";
    if (node.mesh >= scene.meshes.size())
      return invalid_argument(where + "mesh " + std::to_string(node.mesh) + ", expected below " +
                              std::to_string(scene.meshes.size()));
    if (node.far_mesh != GlbNode::kNoMesh &&
        (node.far_mesh >= scene.meshes.size() || scene.meshes[node.far_mesh].triangles() == 0))
      return invalid_argument(where + "far mesh " + std::to_string(node.far_mesh) +
                              ", expected one with triangles");
    for (int c = 0; c < 4; ++c)
      for (int r = 0; r < 4; ++r)
        if (!std::isfinite(node.to_world[c][r]))
          return invalid_argument(where + "its transform is not finite");
    for (const GlbInstance& i : node.instances)
      if (!finite(i)) return invalid_argument(where + "an instance's transform is not finite");
  }
  return ok();
}

Json material_json(const GlbMaterial& m) {
  Json out{{"name", m.name},
           {"pbrMetallicRoughness",
            {{"baseColorFactor", {m.rgba[0], m.rgba[1], m.rgba[2], m.rgba[3]}},
             {"metallicFactor", 0},
             {"roughnessFactor", 1}}}};
  if (m.alpha != GlbAlpha::kOpaque)
    out["alphaMode"] = m.alpha == GlbAlpha::kMask ? "MASK" : "BLEND";
  if (m.double_sided) out["doubleSided"] = true;
  return out;
}

Json mesh_json(const GlbMesh& mesh, Buffer& buffer) {
  Json primitives = Json::array();
  for (const GlbPrimitive& p : mesh.primitives) {
    if (p.indices.empty()) continue;
    const std::size_t positions = buffer.add_positions(p.positions);
    const std::size_t indices = buffer.add_indices(p.indices, p.positions.size());
    primitives.push_back({{"attributes", {{"POSITION", positions}}},
                          {"indices", indices},
                          {"material", p.material}});
  }
  return {{"name", mesh.name}, {"primitives", std::move(primitives)}};
}

Json instancing_json(const std::vector<GlbInstance>& instances, Buffer& buffer) {
  Json attributes;
  std::size_t begin = buffer.bytes.size();
  for (const GlbInstance& i : instances)
    for (int k = 0; k < 3; ++k)
      append_float(buffer.bytes, i.translation[k]);
  attributes["TRANSLATION"] = buffer.finish(begin, kFloat, instances.size(), "VEC3", 0);
  bool turned = false;
  bool scaled = false;
  for (const GlbInstance& i : instances) {
    turned = turned || i.rotation != glm::vec4(0, 0, 0, 1);
    scaled = scaled || i.scale != glm::vec3(1);
  }
  if (turned) {
    begin = buffer.bytes.size();
    for (const GlbInstance& i : instances)
      for (int k = 0; k < 4; ++k)
        append_float(buffer.bytes, i.rotation[k]);
    attributes["ROTATION"] = buffer.finish(begin, kFloat, instances.size(), "VEC4", 0);
  }
  if (scaled) {
    begin = buffer.bytes.size();
    for (const GlbInstance& i : instances)
      for (int k = 0; k < 3; ++k)
        append_float(buffer.bytes, i.scale[k]);
    attributes["SCALE"] = buffer.finish(begin, kFloat, instances.size(), "VEC3", 0);
  }
  return {{"EXT_mesh_gpu_instancing", {{"attributes", std::move(attributes)}}}};
}

}  // namespace

std::size_t GlbMesh::triangles() const {
  std::size_t n = 0;
  for (const GlbPrimitive& p : primitives)
    n += p.indices.size() / 3;
  return n;
}

std::size_t GlbScene::object_count() const {
  std::size_t n = 0;
  for (const GlbNode& node : nodes)
    if (node.tag != OccluderTag::kOnly) n += std::max<std::size_t>(node.instances.size(), 1);
  return n;
}

std::size_t GlbScene::triangle_count() const {
  std::size_t n = 0;
  for (const GlbNode& node : nodes)
    if (node.tag != OccluderTag::kOnly)
      n += std::max<std::size_t>(node.instances.size(), 1) * meshes[node.mesh].triangles();
  return n;
}

Result<std::string> write_glb(const GlbScene& scene) {
  if (auto s = check(scene); !s) return s.error();

  Buffer buffer;
  Json materials = Json::array();
  for (const GlbMaterial& m : scene.materials)
    materials.push_back(material_json(m));
  Json meshes = Json::array();
  std::vector<std::size_t> written(
      scene.meshes.size());  // the format forbids a mesh without triangles
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    written[m] = meshes.size();
    if (scene.meshes[m].triangles() > 0) meshes.push_back(mesh_json(scene.meshes[m], buffer));
  }

  Json nodes = Json::array();
  Json roots = Json::array();
  bool instanced = false;
  bool levels = false;
  for (const GlbNode& node : scene.nodes) {
    Json out{{"name", node.name}};
    if (scene.meshes[node.mesh].triangles() > 0) out["mesh"] = written[node.mesh];
    if (node.to_world != Mat4(1)) {
      Json matrix = Json::array();
      for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 4; ++r)
          matrix.push_back(node.to_world[c][r]);
      out["matrix"] = std::move(matrix);
    }
    if (node.tag != OccluderTag::kAuto)
      out["extras"] = {{"ivis", {{"occluder", tag_name(node.tag)}}}};
    if (!node.instances.empty()) {
      out["extensions"] = instancing_json(node.instances, buffer);
      instanced = true;
    }
    roots.push_back(nodes.size());
    if (node.far_mesh != GlbNode::kNoMesh) {
      Json far = out;
      far["name"] = node.name + "_far";
      far["mesh"] = written[node.far_mesh];
      out["extensions"]["MSFT_lod"] = {{"ids", {nodes.size() + 1}}};
      out["extras"]["MSFT_screencoverage"] = {0.02, 0.0};
      nodes.push_back(std::move(out));
      nodes.push_back(std::move(far));
      levels = true;
      continue;
    }
    nodes.push_back(std::move(out));
  }

  Json root{{"asset", {{"version", "2.0"}, {"generator", scene.generator}}}};
  if (!scene.copyright.empty()) root["asset"]["copyright"] = scene.copyright;
  if (instanced) {
    root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
    root["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  }
  if (levels) root["extensionsUsed"].push_back("MSFT_lod");
  root["scene"] = 0;
  Json only_scene = Json::object();
  if (!roots.empty()) only_scene["nodes"] = std::move(roots);
  root["scenes"] = Json::array({std::move(only_scene)});
  const auto put = [&](const char* key, Json&& list) {
    if (!list.empty()) root[key] = std::move(list);  // nor may a list be empty
  };
  put("nodes", std::move(nodes));
  put("meshes", std::move(meshes));
  put("materials", std::move(materials));
  put("accessors", std::move(buffer.accessors));
  put("bufferViews", std::move(buffer.views));
  if (!buffer.bytes.empty()) root["buffers"] = Json::array({{{"byteLength", buffer.bytes.size()}}});

  std::string text = root.dump(-1, ' ', false, Json::error_handler_t::replace);
  while (text.size() % 4 != 0)
    text.push_back(' ');
  const std::size_t total = 12 + 8 + text.size() + 8 + buffer.bytes.size();
  if (total > std::numeric_limits<std::uint32_t>::max())
    return invalid_argument("the scene takes " + std::to_string(total) +
                            " bytes, a GLB file holds at most 4 GiB");

  std::string out;
  out.reserve(total);
  append_raw(out, std::uint32_t{0x46546c67});  // "glTF"
  append_raw(out, std::uint32_t{2});
  append_raw(out, static_cast<std::uint32_t>(total));
  append_raw(out, static_cast<std::uint32_t>(text.size()));
  append_raw(out, std::uint32_t{0x4e4f534a});  // "JSON"
  out += text;
  append_raw(out, static_cast<std::uint32_t>(buffer.bytes.size()));
  append_raw(out, std::uint32_t{0x004e4942});  // "BIN"
  out += buffer.bytes;
  return out;
}

}  // namespace ivis
