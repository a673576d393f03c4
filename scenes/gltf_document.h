#pragma once
// A glTF file taken apart: its JSON as a tinygltf::Model and the bytes of its buffers. Used inside
// scenes/ only.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <tiny_gltf.h>

#include "core/result.h"

namespace ivis {

/// How much a file of untrusted bytes may make the loader produce or walk through, in bytes. Every
/// loop over a count of the file charges here first, so that neither memory nor time can run away.
class GltfBudget {
 public:
  explicit GltfBudget(std::size_t stored_bytes) : limit_(kFree + kRatio * stored_bytes) {}
  /// Errors: kInput naming `what`, the amount and the limit.
  Status charge(std::size_t elements, std::size_t bytes_each, const std::string& what);

 private:
  /// Draco stores a flat grid in about 1/130 of what it decodes to, real meshes in far more.
  static constexpr std::size_t kRatio = 256;
  static constexpr std::size_t kFree = std::size_t{64} << 20U;
  std::size_t limit_;
  std::size_t used_ = 0;
};

struct GltfDocument {
  tinygltf::Model
      model;  ///< its buffers, images, textures, cameras, skins and animations are not read
  std::vector<std::span<const std::uint8_t>>
      buffers;  ///< by glTF buffer index; empty for fallback buffers
  std::vector<std::uint32_t>
      animated_nodes;  ///< targets of animation channels, may be out of range
  std::vector<std::string> warnings;
  std::size_t stored_bytes = 0;  ///< of the file and the files beside it

  std::string file_bytes;                        ///< what `buffers` may point into
  std::vector<std::vector<std::uint8_t>> owned;  ///< likewise: data URIs and external files
};

/// Reads a .glb or .gltf file and the buffers it names. External buffers come only from the file's
/// own folder or below it; images are not read at all. Errors: kIo; kInput naming the thing and the
/// value, without the file's name; kUnsupported.
Result<std::unique_ptr<GltfDocument>> read_gltf_document(const std::filesystem::path& file);

/// Parses glTF's JSON. tinygltf is not safe on hostile text: see prepare_gltf_json.
Result<tinygltf::Model> parse_gltf_json(const std::string& json);

}  // namespace ivis
