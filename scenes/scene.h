#pragma once
// A loaded scene: what data travels on from scenes/ to every other folder.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/aabb.h"
#include "core/ids.h"
#include "core/math.h"
#include "core/result.h"

namespace ivis {

/// `extras.ivis.occluder` of a node; not inherited by children.
enum class OccluderTag : std::uint8_t {
  kAuto,    ///< default: an occluder if a builder can use it
  kAlways,  ///< as kAuto, and a warning when no builder can use it
  kOnly,    ///< occludes, is never drawn or listed
  kNever,   ///< drawn and blocks rays, but never taken as an occluder
};

/// One run of triangles of a mesh that share a material.
struct Primitive {
  std::uint32_t first_triangle = 0;
  std::uint32_t triangles = 0;
  bool opaque = true;  ///< false: alpha MASK or BLEND, neither blocks nor occludes
  bool double_sided =
      true;  ///< as in the material; matters only under SceneOptions::honour_sidedness
};

/// Triangles in the node's own space. Instances share it.
struct Mesh {
  std::vector<glm::vec3> positions;    ///< finite
  std::vector<std::uint32_t> indices;  ///< 3 a triangle, each < positions.size()
  std::vector<Primitive> primitives;   ///< in order, covering all triangles
  std::size_t triangles() const { return indices.size() / 3; }
};

/// One instance of a mesh-bearing node, or one cluster of its triangles (scenes/clusters.h).
struct Object {
  std::uint32_t node = 0;      ///< index in the glTF file
  std::uint32_t instance = 0;  ///< 0 unless EXT_mesh_gpu_instancing
  std::uint32_t cluster = 0;   ///< 0..k-1 of an instance that was split into k; else 0
  std::uint32_t mesh = 0;      ///< index into Scene::meshes
  OccluderTag tag = OccluderTag::kAuto;
  bool always_visible =
      false;         ///< skinned, morphed or animated: bounds are not to be trusted, tag is kNever
  Mat4 to_world{1};  ///< finite
  Aabb bounds;  ///< world; of all its triangles, grown by rounding; a point at the node's origin
                ///< when there are none
};

/// World-space triangle of an object, in double.
struct Triangle {
  Vec3 a, b, c;
};

/// Threads: read-only after loading. Ownership: meshes are shared by instances.
struct Scene {
  std::vector<Object> objects;  ///< by ObjectId: ascending node index, then instance, then cluster
  std::vector<Object> hidden_solids;  ///< nodes marked `only`: occlude, have no id
  std::vector<Object>
      wholes;  ///< `objects` before they were split into clusters; empty when none was
  std::vector<Mesh> meshes;
  std::vector<std::string> node_names;  ///< by glTF node index; may be empty strings
  std::vector<std::string> extensions;  ///< used by the file, sorted
  std::vector<std::string> warnings;
  Aabb bounds;                     ///< of objects, hidden solids and wholes
  std::size_t triangle_count = 0;  ///< over objects, each instance counted
  bool honour_sidedness = false;   ///< triangles of single-sided materials do not block from behind
  SceneHash hash = 0;              ///< of everything above that visibility depends on
  SceneHash whole_hash =
      0;  ///< of the same scene before it was split into clusters; `hash` when it was not

  std::size_t object_count() const { return objects.size(); }
  const Mesh& mesh_of(const Object& o) const { return meshes[o.mesh]; }
  const std::string& name_of(const Object& o) const { return node_names[o.node]; }
};

/// The drawn objects with their meshes whole: what solids and ground are looked for in, as a
/// cluster is never closed. Indices into it are ObjectIds only while nothing was split.
inline const std::vector<Object>& sources(const Scene& scene) {
  return scene.wholes.empty() ? scene.objects : scene.wholes;
}

/// Triangle `t` of the object's mesh, in world space, corners in the order of the mesh: under a
/// mirroring to_world (negative determinant) its front is the clockwise side (glTF 2.0
/// section 3.7.4).
inline Triangle world_triangle(const Scene& scene, const Object& object, std::size_t t) {
  const Mesh& mesh = scene.mesh_of(object);
  const auto corner = [&](std::size_t k) {
    return Vec3(object.to_world * glm::dvec4(Vec3(mesh.positions[mesh.indices[3 * t + k]]), 1.0));
  };
  return {corner(0), corner(1), corner(2)};
}

/// Fills bounds, triangle_count and the hashes from the rest, and checks what the struct promises
/// (indices in range, finite numbers). For loaders and for tests that build a scene by hand.
/// Errors: kInput naming the node and the value.
Status finish_scene(Scene& scene);

/// Objects in spatial order: rank -> id. Morton order (30 bits, x z y) of the boxes' centres, ties
/// by id. Both ends of the wire derive it from the same bounds, or the server sends it.
std::vector<ObjectId> rank_order(const Scene& scene);

}  // namespace ivis
