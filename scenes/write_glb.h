#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/math.h"
#include "core/result.h"
#include "scenes/scene.h"

namespace ivis {

enum class GlbAlpha : std::uint8_t { kOpaque, kMask, kBlend };

struct GlbMaterial {
  std::string name;
  std::array<float, 4> rgba{0.8F, 0.8F, 0.8F, 1.0F};  ///< linear base colour
  GlbAlpha alpha = GlbAlpha::kOpaque;
  bool double_sided = true;
};

/// Triangles of one material.
struct GlbPrimitive {
  std::vector<glm::vec3> positions;    ///< metres, in the node's space
  std::vector<std::uint32_t> indices;  ///< 3 a triangle
  std::uint32_t material = 0;          ///< index into GlbScene::materials
};

struct GlbMesh {
  std::string name;
  std::vector<GlbPrimitive> primitives;
  std::size_t triangles() const;
};

/// One instance: scale, then rotate, then translate.
struct GlbInstance {
  glm::vec3 translation{0};
  glm::vec4 rotation{0, 0, 0, 1};  ///< unit quaternion x, y, z, w
  glm::vec3 scale{1};
};

struct GlbNode {
  std::string name;
  std::uint32_t mesh = 0;  ///< index into GlbScene::meshes
  OccluderTag tag = OccluderTag::kAuto;
  Mat4 to_world{1};
  std::vector<GlbInstance>
      instances;  ///< none: one object; else EXT_mesh_gpu_instancing, one object each
  /// Coarser mesh for far away, by MSFT_lod: a node of its own that no scene holds, so that it is
  /// no object; kNoMesh for none.
  std::uint32_t far_mesh = kNoMesh;
  static constexpr std::uint32_t kNoMesh = 0xffffffffU;
};

/// What a GLB file is to hold: a flat list of nodes that share meshes.
struct GlbScene {
  std::vector<GlbMaterial> materials;
  std::vector<GlbMesh> meshes;
  std::vector<GlbNode> nodes;
  std::string generator = "ivis";
  std::string copyright;  ///< of the input, passed on

  std::size_t object_count() const;
  std::size_t triangle_count() const;  ///< each instance counted
};

/// The bytes of a GLB (glTF 2.0) file. The same scene gives the same bytes on every machine.
/// Errors: kInvalidArgument naming the node or mesh whose index is out of range, whose numbers are
/// not
///         finite, or when the file would pass the format's 4 GiB.
Result<std::string> write_glb(const GlbScene& scene);

}  // namespace ivis
