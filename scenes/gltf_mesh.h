#pragma once
// glTF meshes -> Mesh. Used inside scenes/ only.

#include <cstdint>
#include <vector>

#include "scenes/gltf_accessor.h"
#include "scenes/scene.h"

namespace ivis {

class GltfMeshReader {
 public:
  GltfMeshReader(const GltfDocument& document, GltfAccessors& accessors, GltfBudget& budget)
      : document_(document), accessors_(accessors), budget_(budget) {}

  /// Triangle lists, strips and fans of a mesh; only vertices that triangles use. Points and lines
  /// are left out and counted. Errors: kInput naming mesh, primitive and accessor.
  Result<Mesh> read(int mesh);

  std::size_t primitives_left_out() const { return left_out_; }

 private:
  Status add_primitive(const tinygltf::Primitive& primitive, Mesh& mesh);
  Status add_draco(const tinygltf::Primitive& primitive, const tinygltf::Value& extension,
                   Mesh& mesh);
  Result<Primitive> material_of(const tinygltf::Primitive& primitive) const;
  /// The mesh's vertex for vertex `i` of the primitive's POSITION.
  Result<std::uint32_t> vertex(const GltfAccessorView& positions, std::uint32_t i, Mesh& mesh);

  struct Placed {
    std::uint64_t epoch = 0;
    std::uint32_t vertex = 0;
  };
  const GltfDocument& document_;
  GltfAccessors& accessors_;
  GltfBudget& budget_;
  std::vector<Placed> placed_;  ///< by index in POSITION; valid where its epoch is the current one
  std::uint64_t epoch_ = 0;
  int epoch_accessor_ = -1;
  std::size_t left_out_ = 0;
};

}  // namespace ivis
