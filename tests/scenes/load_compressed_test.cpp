// EXT_meshopt_compression and KHR_draco_mesh_compression, encoded here with the libraries' own
// encoders.
#include <cmath>
#include <cstring>
#include <functional>
#include <tuple>

#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>

#include "gltf_file.h"

namespace ivis::test {
namespace {

using nlohmann::json;

class LoadCompressed : public GltfFolder {};

constexpr std::size_t kSide = 12;  // quads a side of the test grid

struct Grid {
  std::vector<float> positions;
  std::vector<std::uint32_t> indices;
};

/// A bumpy terrain of kSide x kSide quads.
Grid grid() {
  Grid g;
  for (std::size_t z = 0; z <= kSide; ++z)
    for (std::size_t x = 0; x <= kSide; ++x) {
      g.positions.push_back(static_cast<float>(x));
      g.positions.push_back(0.25F * static_cast<float>((x * 7 + z * 3) % 5));
      g.positions.push_back(static_cast<float>(z));
    }
  const auto at = [](std::size_t x, std::size_t z) {
    return static_cast<std::uint32_t>(z * (kSide + 1) + x);
  };
  for (std::size_t z = 0; z < kSide; ++z)
    for (std::size_t x = 0; x < kSide; ++x)
      for (const std::uint32_t i :
           {at(x, z), at(x, z + 1), at(x + 1, z), at(x + 1, z), at(x, z + 1), at(x + 1, z + 1)})
        g.indices.push_back(i);
  return g;
}

/// Both scenes hold the same triangles, whatever the order of triangles and vertices.
void expect_same_triangles(const Scene& a, const Scene& b, double tolerance) {
  ASSERT_EQ(a.triangle_count, b.triangle_count);
  // By centre: a coarse but order-free match, then corner by corner.
  const auto key = [](const Triangle& t) { return (t.a + t.b + t.c) / 3.0; };
  std::vector<bool> used(b.triangle_count, false);
  for (std::size_t i = 0; i < a.triangle_count; ++i) {
    const Triangle t = world_triangle(a, a.objects[0], i);
    bool found = false;
    for (std::size_t k = 0; k < b.triangle_count && !found; ++k) {
      const Triangle u = world_triangle(b, b.objects[0], k);
      if (used[k] || glm::length(key(t) - key(u)) > tolerance) continue;
      for (const auto& [p, q, r] :
           {std::tuple(u.a, u.b, u.c), std::tuple(u.b, u.c, u.a), std::tuple(u.c, u.a, u.b)})
        found = found || (glm::length(t.a - p) < tolerance && glm::length(t.b - q) < tolerance &&
                          glm::length(t.c - r) < tolerance);
      used[k] = found;
    }
    EXPECT_TRUE(found) << "triangle " << i << " is missing or wound the other way";
  }
}

GltfFile plain_file() {
  const Grid g = grid();
  GltfFile f;
  const int p = f.add_accessor_of(g.positions, kFloat, "VEC3");
  const int i = f.add_accessor_of(g.indices, kUnsignedInt, "SCALAR");
  f.add_node({{"mesh", f.add_mesh(p, i)}});
  return f;
}

int add_meshopt_view(GltfFile& f, const std::vector<unsigned char>& encoded, std::size_t count,
                     std::size_t stride, const char* mode, const char* filter = "NONE") {
  const int raw = f.add_view_of(encoded);
  json view = f.root["bufferViews"][static_cast<std::size_t>(raw)];
  view["byteStride"] = stride;
  view["count"] = count;
  view["mode"] = mode;
  view["filter"] = filter;
  f.root["bufferViews"][static_cast<std::size_t>(raw)] = {
      {"buffer", 1},
      {"byteLength", count * stride},
      {"extensions", {{"EXT_meshopt_compression", view}}}};
  return raw;
}

/// Buffer 1 is the fallback buffer, which has no bytes and no uri.
void finish_meshopt(GltfFile& f) {
  f.root["buffers"] = {{{"byteLength", f.bin.size()}},
                       {{"byteLength", 1 << 20},
                        {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  f.root["extensionsRequired"] = {"EXT_meshopt_compression"};
}

std::vector<unsigned char> encode_vertices(const void* data, std::size_t count,
                                           std::size_t stride) {
  std::vector<unsigned char> out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), data, count, stride));
  return out;
}

std::vector<unsigned char> encode_triangles(const std::vector<std::uint32_t>& indices,
                                            std::size_t vertices) {
  std::vector<unsigned char> out(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  out.resize(meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}

GltfFile meshopt_file() {
  const Grid g = grid();
  const std::size_t vertices = g.positions.size() / 3;
  GltfFile f;
  const int p =
      f.add_accessor(add_meshopt_view(f, encode_vertices(g.positions.data(), vertices, 12),
                                      vertices, 12, "ATTRIBUTES"),
                     kFloat, vertices, "VEC3");
  f.root["bufferViews"][0]["byteStride"] = 12;
  const int i = f.add_accessor(
      add_meshopt_view(f, encode_triangles(g.indices, vertices), g.indices.size(), 4, "TRIANGLES"),
      kUnsignedInt, g.indices.size(), "SCALAR");
  f.add_node({{"mesh", f.add_mesh(p, i)}});
  finish_meshopt(f);
  return f;
}

TEST_F(LoadCompressed, MeshoptGivesTheSameTriangles) {
  const auto plain = load(plain_file());
  const auto packed = load(meshopt_file());
  IVIS_ASSERT_OK(plain);
  IVIS_ASSERT_OK(packed);
  expect_same_triangles(*plain, *packed, 1e-9);
}

TEST_F(LoadCompressed, MeshoptReadsIndexSequences) {
  GltfFile f;
  const int p = f.add_accessor_of<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, kFloat, "VEC3");
  const std::vector<std::uint32_t> indices{0, 1, 2, 3};
  std::vector<unsigned char> encoded(meshopt_encodeIndexSequenceBound(4, 4));
  encoded.resize(meshopt_encodeIndexSequence(encoded.data(), encoded.size(), indices.data(), 4));
  const int i =
      f.add_accessor(add_meshopt_view(f, encoded, 4, 2, "INDICES"), kUnsignedShort, 4, "SCALAR");
  f.add_node({{"mesh", f.add_mesh(p, i, {{"mode", 5}})}});
  finish_meshopt(f);
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->triangle_count, 2U);
  EXPECT_EQ(s->bounds.hi.y, 1 + 1e-12);
}

TEST_F(LoadCompressed, MeshoptUndoesTheExponentialFilter) {
  const Grid g = grid();
  const std::size_t vertices = g.positions.size() / 3;
  std::vector<std::uint32_t> filtered(g.positions.size());
  meshopt_encodeFilterExp(filtered.data(), vertices, 12, 15, g.positions.data());
  GltfFile f;
  const int p = f.add_accessor(add_meshopt_view(f, encode_vertices(filtered.data(), vertices, 12),
                                                vertices, 12, "ATTRIBUTES", "EXPONENTIAL"),
                               kFloat, vertices, "VEC3");
  const int i = f.add_accessor_of(g.indices, kUnsignedInt, "SCALAR");
  f.add_node({{"mesh", f.add_mesh(p, i)}});
  finish_meshopt(f);
  const auto plain = load(plain_file());
  const auto packed = load(f);
  IVIS_ASSERT_OK(packed);
  expect_same_triangles(*plain, *packed, 2e-3);
}

TEST_F(LoadCompressed, MeshoptUndoesTheQuaternionFilterOfInstances) {
  const float h = std::sqrt(0.5F);
  const std::vector<float> rotations{0, 0, 0, 1, 0, h, 0, h};
  std::vector<std::int16_t> filtered(8);
  meshopt_encodeFilterQuat(filtered.data(), 2, 8, 16, rotations.data());
  GltfFile f;
  const int r = f.add_accessor(
      add_meshopt_view(f, encode_vertices(filtered.data(), 2, 8), 2, 8, "ATTRIBUTES", "QUATERNION"),
      kShort, 2, "VEC4", true);
  f.add_triangle(
      {{"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"ROTATION", r}}}}}}}});
  finish_meshopt(f);
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 2U);
  const Triangle t = world_triangle(*s, s->objects[1], 0);
  EXPECT_NEAR(t.b.z, -1, 1e-4);
  EXPECT_NEAR(t.b.x, 0, 1e-4);
}

TEST_F(LoadCompressed, MeshoptRefusesWhatDoesNotFit) {
  struct Case {
    const char* key;
    json value;
    const char* word;
  };
  for (const Case& c :
       {Case{"buffer", 7, "buffer 7"}, Case{"byteOffset", 1 << 30, "do not fit"},
        Case{"byteLength", 3, "do not decode"}, Case{"byteLength", -1, "not a whole number"},
        Case{"byteLength", 4000000000U, "not"}, Case{"byteStride", 13, "byteStride 13"},
        Case{"byteStride", 260, "byteStride 260"}, Case{"byteStride", 0, "byteStride 0"},
        Case{"count", 2000000000, "cannot come out of"}, Case{"count", 1.5, "not a whole number"},
        Case{"mode", "SQUARES", "SQUARES"}, Case{"filter", "BLUR", "BLUR"},
        Case{"filter", "QUATERNION", "byteStride 12"}}) {
    GltfFile f = meshopt_file();
    f.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][c.key] = c.value;
    IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "buffer view 0, EXT_meshopt_compression", c.word);
  }
}

TEST_F(LoadCompressed, MeshoptAsksForNoMoreThanItsBytesCanHold) {
  GltfFile f = meshopt_file();
  auto& view = f.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"];
  view["count"] = 60 * view["byteLength"].get<int>();
  view["byteStride"] = 256;
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "EXT_meshopt_compression");
}

struct DracoMesh {
  std::string bytes;
  std::size_t vertices = 0, triangles = 0;
  std::uint32_t position_id = 0;
};

DracoMesh encode_draco(int method) {
  const Grid g = grid();
  draco::TriangleSoupMeshBuilder builder;
  const auto faces = static_cast<int>(g.indices.size() / 3);
  builder.Start(faces);
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  for (int t = 0; t < faces; ++t) {
    const auto p = [&](int k) {
      return &g.positions[3 * g.indices[static_cast<std::size_t>(3 * t + k)]];
    };
    builder.SetAttributeValuesForFace(id, draco::FaceIndex(static_cast<std::uint32_t>(t)), p(0),
                                      p(1), p(2));
  }
  const auto mesh = builder.Finalize();
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  draco::EncoderBuffer out;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &out).ok());
  return {std::string(out.data(), out.size()), mesh->num_points(), mesh->num_faces(),
          mesh->GetNamedAttribute(draco::GeometryAttribute::POSITION)->unique_id()};
}

GltfFile draco_file(const DracoMesh& m) {
  GltfFile f;
  const int view = f.add_view(m.bytes);
  const int p = f.add_accessor(-1, kFloat, m.vertices, "VEC3");
  const int i = f.add_accessor(-1, kUnsignedInt, 3 * m.triangles, "SCALAR");
  f.add_node({{"mesh", f.add_mesh(p, i,
                                  {{"extensions",
                                    {{"KHR_draco_mesh_compression",
                                      {{"bufferView", view},
                                       {"attributes", {{"POSITION", m.position_id}}}}}}}})}});
  f.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return f;
}

TEST_F(LoadCompressed, DracoGivesTheSameTriangles) {
  const auto plain = load(plain_file());
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const auto packed = load(draco_file(encode_draco(method)));
    IVIS_ASSERT_OK(packed);
    expect_same_triangles(*plain, *packed, 2e-3);
  }
}

TEST_F(LoadCompressed, DracoRefusesCountsThatAreNotTheAccessors) {
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const DracoMesh good = encode_draco(method);
    DracoMesh m = good;
    m.triangles += 1;
    IVIS_EXPECT_ERROR(load(draco_file(m)), ErrorCode::kInput, "node 0", "mesh 0, primitive 0",
                      "KHR_draco_mesh_compression", "the accessors say");
    m = good;
    m.vertices -= 1;
    IVIS_EXPECT_ERROR(load(draco_file(m)), ErrorCode::kInput, "the accessors say");
    m = good;
    m.position_id = 77;
    IVIS_EXPECT_ERROR(load(draco_file(m)), ErrorCode::kInput, "no attribute of id 77");
    m = good;
    m.triangles = 1000000000;
    IVIS_EXPECT_ERROR(load(draco_file(m)), ErrorCode::kInput, "the accessors say");
  }
}

/// A stream whose head says what it likes.
DracoMesh forged(std::uint8_t method, std::uint32_t triangles, std::uint32_t vertices) {
  DracoMesh m;
  m.bytes = std::string("DRACO\x02\x02\x01", 8);
  m.bytes += static_cast<char>(method);
  m.bytes += std::string(2, '\0');
  const auto varint = [&](std::uint32_t v) {
    for (; v >= 128; v >>= 7U)
      m.bytes += static_cast<char>((v & 127U) | 128U);
    m.bytes += static_cast<char>(v);
  };
  if (method == 1) {
    m.bytes += '\0';
    varint(vertices);
    varint(triangles);
    m.bytes += '\xff';  // 255 attribute tables
    varint(triangles);
    varint(triangles);
  } else {
    varint(triangles);
    varint(vertices);
  }
  m.bytes += std::string(64, '\x01');
  m.triangles = triangles;
  m.vertices = vertices;
  return m;
}

TEST_F(LoadCompressed, DracoAllocatesNothingByForgedCounts) {
  for (const std::uint8_t method : {std::uint8_t{0}, std::uint8_t{1}}) {
    IVIS_EXPECT_ERROR(load(draco_file(forged(method, 1400000000, 2000000000))), ErrorCode::kInput,
                      "cannot come out of");
    IVIS_EXPECT_ERROR(load(draco_file(forged(method, 1000, 4000000000U))), ErrorCode::kInput,
                      "more vertices or symbols");
    const auto s = load(draco_file(forged(method, 5000, 2502)));
    EXPECT_FALSE(s);
  }
}

TEST_F(LoadCompressed, DracoRefusesMissingParts) {
  const DracoMesh good = encode_draco(draco::MESH_EDGEBREAKER_ENCODING);
  GltfFile f = draco_file(good);
  auto& primitive = f.root["meshes"][0]["primitives"][0];
  const json whole = primitive;
  primitive.erase("indices");
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "no accessor for indices");
  primitive = whole;
  primitive["extensions"]["KHR_draco_mesh_compression"].erase("attributes");
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "attributes.POSITION");
  primitive = whole;
  primitive["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = 9;
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "buffer view 9");
  primitive = whole;
  primitive["extensions"]["KHR_draco_mesh_compression"] = 5;
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "bufferView");
  primitive["extensions"]["KHR_draco_mesh_compression"] = json::object();
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "'bufferView' is not an index");
}

/// Every length and a few thousand flipped bits: an answer either way, and a sound scene if it is
/// one.
void expect_no_crash(const std::string& bytes,
                     const std::function<Result<Scene>(const std::string&)>& load, unsigned seed) {
  std::size_t refused = 0;
  std::uint64_t state = seed;
  const auto random = [&] {
    return (state = state * 6364136223846793005ULL + 1442695040888963407ULL) >> 33U;
  };
  for (int k = 0; k < 3000; ++k) {
    std::string broken = bytes;
    for (std::uint64_t flips = 1 + random() % 3; flips > 0; --flips)
      broken[random() % broken.size()] ^= static_cast<char>(1U << (random() % 8));
    refused += load(broken) ? 0 : 1;
  }
  for (std::size_t length = 0; length < bytes.size(); length += 1 + bytes.size() / 60)
    refused += load(bytes.substr(0, length)) ? 0 : 1;
  EXPECT_GT(refused, 60U);
}

TEST_F(LoadCompressed, MeshoptSurvivesBrokenBytes) {
  const GltfFile good = meshopt_file();
  expect_no_crash(
      good.bin,
      [&](const std::string& bin) {
        GltfFile f = good;
        f.bin = bin;
        f.bin.resize(good.bin.size());
        return load(f);
      },
      1);
}

TEST_F(LoadCompressed, DracoSurvivesBrokenBytes) {
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const DracoMesh good = encode_draco(method);
    expect_no_crash(
        good.bytes,
        [&](const std::string& bytes) {
          DracoMesh m = good;
          m.bytes = bytes.empty() ? std::string(4, 'D') : bytes;
          return load(draco_file(m));
        },
        2);
  }
}

}  // namespace
}  // namespace ivis::test
