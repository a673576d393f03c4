#include "scenes/gltf_draco.h"

#include <array>
#include <cmath>
#include <cstring>

#include <draco/compression/decode.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>

namespace ivis {
namespace {

using Counts = DracoStreamCounts;

/// Triangles a byte of stream. Draco's entropy coders get to about 10 on a flat grid.
constexpr std::size_t kTrianglesAByte = 64;
/// What libdraco holds for a triangle while it decodes, for its corner table and for every further
/// attribute with a corner table of its own.
constexpr std::size_t kBytesATriangle = 128;
constexpr std::size_t kBytesATriangleAndAttribute = 64;

Error broken(const std::string& where, const std::string& what) {
  return input_error(where + ": " + what);
}

}  // namespace

Result<DracoStreamCounts> read_draco_counts(std::span<const std::uint8_t> bytes,
                                            const std::string& where) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  struct {
    std::array<char, 5> magic;
    std::uint8_t major, minor, type, method;
  } head{};
  std::uint16_t flags = 0;
  if (!buffer.Decode(head.magic.data(), head.magic.size()) || !buffer.Decode(&head.major) ||
      !buffer.Decode(&head.minor) || !buffer.Decode(&head.type) || !buffer.Decode(&head.method) ||
      !buffer.Decode(&flags) || std::memcmp(head.magic.data(), "DRACO", 5) != 0)
    return broken(where, "no Draco header");
  if (head.major != 2 || head.minor != 2)
    return broken(where, "Draco stream " + std::to_string(head.major) + "." +
                             std::to_string(head.minor) + ", expected 2.2");
  if (head.type != draco::TRIANGULAR_MESH || head.method > draco::MESH_EDGEBREAKER_ENCODING)
    return broken(where, "not a Draco mesh");
  buffer.set_bitstream_version(DRACO_BITSTREAM_VERSION(2, 2));
  constexpr std::uint16_t kHasMetadata = 0x8000;
  if ((flags & kHasMetadata) != 0) {
    draco::GeometryMetadata metadata;
    if (!draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata))
      return broken(where, "its metadata does not decode");
  }
  Counts counts;
  bool good = true;
  const auto varint = [&](std::uint32_t& v) { good = good && draco::DecodeVarint(&v, &buffer); };
  if (head.method == draco::MESH_SEQUENTIAL_ENCODING) {
    varint(counts.triangles);
    varint(counts.vertices);
  } else {
    std::uint8_t traversal = 0;
    good = buffer.Decode(&traversal);
    varint(counts.vertices);
    varint(counts.triangles);
    good = good && buffer.Decode(&counts.attribute_tables);
    varint(counts.symbols);
    varint(counts.split_symbols);
  }
  if (!good) return broken(where, "the Draco stream ends in its header");
  return counts;
}

Result<DracoTriangles> decode_draco(std::span<const std::uint8_t> bytes, std::uint32_t position_id,
                                    std::size_t vertices, std::size_t triangles, GltfBudget& budget,
                                    const std::string& where) {
  // libdraco allocates by the counts in the stream, so these are looked at first.
  const auto counts = read_draco_counts(bytes, where);
  if (!counts) return counts.error();
  if (counts->triangles != triangles)
    return broken(where, std::to_string(counts->triangles) +
                             " triangles in the stream, the accessors say " +
                             std::to_string(triangles));
  const std::size_t most_vertices = 3 * std::size_t{counts->triangles};
  if (counts->vertices > most_vertices || counts->symbols > counts->triangles ||
      counts->split_symbols > counts->symbols || vertices > most_vertices)
    return broken(where, "more vertices or symbols than " + std::to_string(triangles) +
                             " triangles can have");
  if (triangles / kTrianglesAByte > bytes.size())
    return broken(where, std::to_string(triangles) + " triangles cannot come out of " +
                             std::to_string(bytes.size()) + " bytes");
  if (auto s = budget.charge(
          triangles, kBytesATriangle + counts->attribute_tables * kBytesATriangleAndAttribute,
          where + ": triangles");
      !s)
    return s.error();

  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  draco::Decoder decoder;
  const auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok())
    return broken(where, std::string("does not decode: ") + decoded.status().error_msg());
  const draco::Mesh& mesh = *decoded.value();
  if (mesh.num_faces() != triangles || mesh.num_points() != vertices)
    return broken(where, "decodes to " + std::to_string(mesh.num_faces()) + " triangles of " +
                             std::to_string(mesh.num_points()) + " vertices, the accessors say " +
                             std::to_string(triangles) + " of " + std::to_string(vertices));
  const draco::PointAttribute* position = mesh.GetAttributeByUniqueId(position_id);
  if (position == nullptr)
    return broken(where, "no attribute of id " + std::to_string(position_id));
  if (position->num_components() != 3)
    return broken(where, "POSITION of " + std::to_string(position->num_components()) +
                             " components, expected 3");

  DracoTriangles out;
  out.positions.resize(vertices);
  for (std::uint32_t i = 0; i < vertices; ++i) {
    const auto value = position->mapped_index(draco::PointIndex(i));
    glm::vec3& p = out.positions[i];
    if (value.value() >= position->size() || !position->ConvertValue<float, 3>(value, &p.x))
      return broken(where, "position " + std::to_string(i) + " has no value");
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      return broken(where, "position " + std::to_string(i) + " is not finite");
  }
  out.indices.reserve(3 * triangles);
  for (std::uint32_t t = 0; t < triangles; ++t) {
    for (const draco::PointIndex& corner : mesh.face(draco::FaceIndex(t))) {
      if (corner.value() >= vertices)
        return broken(where, "index " + std::to_string(corner.value()) + ", expected below " +
                                 std::to_string(vertices));
      out.indices.push_back(corner.value());
    }
  }
  return out;
}

}  // namespace ivis
