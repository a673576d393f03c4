#include "scenes/gltf_mesh.h"

#include <cmath>
#include <limits>

#include "scenes/gltf_draco.h"
#include "scenes/gltf_json.h"

namespace ivis {
namespace {

const std::vector<int> kPositionTypes{TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_COMPONENT_TYPE_BYTE,
                                      TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE,
                                      TINYGLTF_COMPONENT_TYPE_SHORT,
                                      TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT};
const std::vector<int> kIndexTypes{TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE,
                                   TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT,
                                   TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT};

std::size_t triangles_in(int mode, std::size_t corners) {
  if (mode == TINYGLTF_MODE_TRIANGLES) return corners / 3;
  return corners < 3 ? 0 : corners - 2;
}

/// Which corner of the primitive is corner `k` of its triangle `t` (glTF 2.0 section 3.7.2.1).
std::size_t corner(int mode, std::size_t t, std::size_t k) {
  if (mode == TINYGLTF_MODE_TRIANGLES) return 3 * t + k;
  if (mode == TINYGLTF_MODE_TRIANGLE_FAN) return k == 2 ? 0 : t + 1 + k;
  const std::size_t odd = t % 2;
  return k == 0 ? t : k == 1 ? t + 1 + odd : t + 2 - odd;
}

Status check_triangle_total(std::size_t triangles) {
  if (triangles <= std::numeric_limits<std::uint32_t>::max() / 3) return ok();
  return input_error(std::to_string(triangles) + " triangles, expected below 2^32 / 3");
}

/// Light goes through, whatever alphaMode says.
bool transmits(const tinygltf::Material& material) {
  const auto found = material.extensions.find("KHR_materials_transmission");
  if (found == material.extensions.end() || !found->second.IsObject()) return false;
  if (found->second.Has("transmissionTexture")) return true;
  const tinygltf::Value& factor = found->second.Get("transmissionFactor");
  return factor.IsNumber() && factor.GetNumberAsDouble() != 0;
}

}  // namespace

Result<Mesh> GltfMeshReader::read(int index) {
  const auto& meshes = document_.model.meshes;
  const std::string where = "mesh " + std::to_string(index);
  if (index < 0 || static_cast<std::size_t>(index) >= meshes.size())
    return input_error(where + ", expected below " + std::to_string(meshes.size()));
  const auto& primitives = meshes[static_cast<std::size_t>(index)].primitives;
  Mesh mesh;
  ++epoch_;
  epoch_accessor_ = -1;
  for (std::size_t p = 0; p < primitives.size(); ++p)
    if (auto s = add_primitive(primitives[p], mesh); !s)
      return Error{s.error().code,
                   where + ", primitive " + std::to_string(p) + ": " + s.error().message};
  return mesh;
}

Result<Primitive> GltfMeshReader::material_of(const tinygltf::Primitive& primitive) const {
  const auto& materials = document_.model.materials;
  Primitive out;
  out.double_sided = false;
  if (primitive.material < 0) return out;
  if (static_cast<std::size_t>(primitive.material) >= materials.size())
    return input_error("material " + std::to_string(primitive.material) + ", expected below " +
                       std::to_string(materials.size()));
  const auto& material = materials[static_cast<std::size_t>(primitive.material)];
  // An unknown alphaMode counts as see-through, too: it then hides nothing.
  out.opaque =
      (material.alphaMode.empty() || material.alphaMode == "OPAQUE") && !transmits(material);
  out.double_sided = material.doubleSided;
  return out;
}

Result<std::uint32_t> GltfMeshReader::vertex(const GltfAccessorView& positions, std::uint32_t i,
                                             Mesh& mesh) {
  if (i >= positions.count())
    return input_error("index " + std::to_string(i) + ", expected below " +
                       std::to_string(positions.count()));
  Placed& placed = placed_[i];
  if (placed.epoch != epoch_) {
    const glm::vec3 p(positions.number(i, 0), positions.number(i, 1), positions.number(i, 2));
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      return input_error("position " + std::to_string(i) + " is not finite");
    placed = {epoch_, static_cast<std::uint32_t>(mesh.positions.size())};
    mesh.positions.push_back(p);
  }
  return placed.vertex;
}

Status GltfMeshReader::add_primitive(const tinygltf::Primitive& primitive, Mesh& mesh) {
  const int mode = primitive.mode;
  if (mode >= TINYGLTF_MODE_POINTS && mode <= TINYGLTF_MODE_LINE_STRIP) {
    ++left_out_;
    return ok();
  }
  if (mode != TINYGLTF_MODE_TRIANGLES && mode != TINYGLTF_MODE_TRIANGLE_STRIP &&
      mode != TINYGLTF_MODE_TRIANGLE_FAN)
    return input_error("mode " + std::to_string(mode) + ", expected 0 to 6");
  if (const auto draco = primitive.extensions.find("KHR_draco_mesh_compression");
      draco != primitive.extensions.end())
    return add_draco(primitive, draco->second, mesh);
  const auto position = primitive.attributes.find("POSITION");
  if (position == primitive.attributes.end()) {
    ++left_out_;
    return ok();
  }
  auto run = material_of(primitive);
  if (!run) return run.error();
  const auto positions = accessors_.view(position->second, {TINYGLTF_TYPE_VEC3, kPositionTypes});
  if (!positions) return input_error("POSITION: " + positions.error().message);
  std::optional<GltfAccessorView> indices;
  if (primitive.indices >= 0) {
    auto view = accessors_.view(primitive.indices, {TINYGLTF_TYPE_SCALAR, kIndexTypes});
    if (!view) return input_error("indices: " + view.error().message);
    indices = *std::move(view);
  }
  const std::size_t corners = indices ? indices->count() : positions->count();
  if (mode == TINYGLTF_MODE_TRIANGLES && corners % 3 != 0)
    return input_error(std::to_string(corners) + (indices ? " indices" : " vertices") +
                       ", expected a multiple of 3");
  const std::size_t triangles = triangles_in(mode, corners);
  if (triangles == 0) return ok();
  if (auto s =
          budget_.charge(triangles, 3 * (sizeof(std::uint32_t) + sizeof(glm::vec3)), "triangles");
      !s)
    return s;
  if (auto s = check_triangle_total(mesh.triangles() + triangles); !s) return s;

  if (position->second != epoch_accessor_) {
    ++epoch_;
    epoch_accessor_ = position->second;
    if (placed_.size() < positions->count()) placed_.resize(positions->count());
  }
  if (mesh.indices.empty()) mesh.indices.reserve(3 * triangles);
  for (std::size_t t = 0; t < triangles; ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t c = corner(mode, t, k);
      const auto v =
          vertex(*positions, indices ? indices->index(c) : static_cast<std::uint32_t>(c), mesh);
      if (!v) return v.error();
      mesh.indices.push_back(*v);
    }
  }
  run->first_triangle = static_cast<std::uint32_t>(mesh.triangles() - triangles);
  run->triangles = static_cast<std::uint32_t>(triangles);
  mesh.primitives.push_back(*run);
  return ok();
}

Status GltfMeshReader::add_draco(const tinygltf::Primitive& primitive,
                                 const tinygltf::Value& extension, Mesh& mesh) {
  const std::string where = "KHR_draco_mesh_compression";
  const auto whole = [](const tinygltf::Value& v) { return v.IsInt() && v.GetNumberAsInt() >= 0; };
  if (!extension.IsObject() || !whole(extension.Get("bufferView")))
    return input_error(where + ": 'bufferView' is not an index");
  const tinygltf::Value& ids = extension.Get("attributes");
  if (!ids.IsObject() || !whole(ids.Get("POSITION")))
    return input_error(where + ": attributes.POSITION is not an id");
  // The accessors hold no bytes; they say what the stream must decode to.
  const auto& all = document_.model.accessors;
  const auto count_of = [&](const char* name) -> Result<std::size_t> {
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end() || found->second < 0 ||
        static_cast<std::size_t>(found->second) >= all.size())
      return input_error(where + ": the primitive has no accessor for " +
                         (std::string(name) == kDracoIndices ? "indices" : name));
    return all[static_cast<std::size_t>(found->second)].count;
  };
  const auto vertices = count_of("POSITION");
  if (!vertices) return vertices.error();
  const auto corners = count_of(kDracoIndices);
  if (!corners) return corners.error();
  const std::size_t triangles = triangles_in(primitive.mode, *corners);
  auto run = material_of(primitive);
  if (!run) return run.error();
  const auto bytes = accessors_.buffer_view(extension.Get("bufferView").GetNumberAsInt());
  if (!bytes) return input_error(where + ": " + bytes.error().message);
  const auto decoded =
      decode_draco(*bytes, static_cast<std::uint32_t>(ids.Get("POSITION").GetNumberAsInt()),
                   *vertices, triangles, budget_, where);
  if (!decoded) return decoded.error();
  if (decoded->indices.empty()) return ok();
  if (auto s = check_triangle_total(mesh.triangles() + triangles); !s) return s;
  const std::size_t base = mesh.positions.size();
  if (base + decoded->positions.size() > std::numeric_limits<std::uint32_t>::max())
    return input_error("more than 2^32 vertices");
  run->first_triangle = static_cast<std::uint32_t>(mesh.triangles());
  run->triangles = static_cast<std::uint32_t>(decoded->indices.size() / 3);
  mesh.positions.insert(mesh.positions.end(), decoded->positions.begin(), decoded->positions.end());
  for (const std::uint32_t i : decoded->indices)
    mesh.indices.push_back(static_cast<std::uint32_t>(base + i));
  mesh.primitives.push_back(*run);
  return ok();
}

}  // namespace ivis
