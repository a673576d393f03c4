// Files that mean harm or are broken: a clear error or a sound scene, never a crash, a hang or a
// large allocation.
#include <cctype>
#include <cmath>
#include <limits>

#include "gltf_file.h"

namespace ivis::test {
namespace {

using nlohmann::json;

class LoadHostile : public GltfFolder {
 protected:
  /// A triangle whose JSON is then edited.
  template <class Edit>
  Result<Scene> load_edited(Edit edit) const {
    GltfFile f;
    f.add_triangle();
    edit(f);
    return load(f);
  }
};

std::string u32(std::uint32_t v) {
  return {reinterpret_cast<const char*>(&v), 4};
}

/// A small file with something of everything, to be broken.
GltfFile rich_file() {
  GltfFile f;
  const int p = f.add_accessor_of<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, kFloat, "VEC3");
  const int i = f.add_accessor_of<std::uint16_t>({0, 1, 2, 2, 1, 3}, kUnsignedShort, "SCALAR");
  const int t = f.add_accessor_of<float>({0, 0, 0, 2, 0, 0, 4, 0, 0}, kFloat, "VEC3");
  const int at = f.add_view_of<std::uint16_t>({1});
  const int value = f.add_view_of<float>({5, 5, 5});
  f.root["accessors"][static_cast<std::size_t>(p)]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", at}, {"componentType", kUnsignedShort}}},
      {"values", {{"bufferView", value}}}};
  f.root["materials"] = {{{"alphaMode", "MASK"}}};
  const int mesh = f.add_mesh(p, i, {{"material", 0}});
  const int leaf = f.add_node(
      {{"mesh", mesh},
       {"name", "leaf"},
       {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", t}}}}}}},
       {"extras", {{"ivis", {{"occluder", "always"}}}}}},
      false);
  f.add_node({{"children", {leaf}}, {"rotation", {0, 0, 0, 1}}, {"scale", {1, 2, 3}}});
  f.root["animations"] = {
      {{"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "scale"}}}}}},
       {"samplers", {{{"input", 0}, {"output", 0}}}}}};
  f.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  return f;
}

/// What a Scene promises, whatever the file was.
void expect_sound(const Scene& s) {
  for (const auto* list : {&s.objects, &s.hidden_solids})
    for (const Object& o : *list) {
      ASSERT_LT(o.mesh, s.meshes.size());
      ASSERT_LT(o.node, s.node_names.size());
      ASSERT_TRUE(std::isfinite(o.bounds.lo.x + o.bounds.hi.x + o.bounds.lo.y + o.bounds.hi.y +
                                o.bounds.lo.z + o.bounds.hi.z));
      ASSERT_FALSE(o.bounds.empty());
    }
  for (const Mesh& m : s.meshes)
    for (const std::uint32_t i : m.indices)
      ASSERT_LT(i, m.positions.size());
}

TEST_F(LoadHostile, SurvivesEveryLength) {
  const std::string good = rich_file().glb();
  IVIS_ASSERT_OK(load_bytes(good));
  for (std::size_t length = 0; length < good.size(); length += length < 200 ? 1 : 7) {
    const auto s = load_bytes(good.substr(0, length));
    ASSERT_FALSE(s) << "of " << length << " bytes";
    EXPECT_NE(s.error().message.find("scene.glb"), std::string::npos);
  }
}

TEST_F(LoadHostile, SurvivesFlippedBits) {
  const std::string good = rich_file().glb();
  std::uint64_t state = 12345;
  const auto random = [&] {
    return (state = state * 6364136223846793005ULL + 1442695040888963407ULL) >> 33U;
  };
  std::size_t loaded = 0, refused = 0;
  for (int k = 0; k < 4000; ++k) {
    std::string bytes = good;
    for (std::uint64_t flips = 1 + random() % 4; flips > 0; --flips)
      bytes[random() % bytes.size()] ^= static_cast<char>(1U << (random() % 8));
    const auto s = load_bytes(bytes);
    ++(s ? loaded : refused);
    if (s) expect_sound(*s);
  }
  EXPECT_GT(loaded, 100U);
  EXPECT_GT(refused, 100U);
}

TEST_F(LoadHostile, SurvivesEveryNumberReplaced) {
  // Numbers in JSON are where indices, counts and offsets live.
  const GltfFile good = rich_file();
  const std::string text = good.root.dump();
  for (const std::string value : {"-1", "0", "1", "7", "255", "65536", "2147483647", "4294967295",
                                  "4294967296", "9223372036854775807", "18446744073709551615",
                                  "1e308", "1.5", "null", "[]", "{}", "\"x\"", "true"}) {
    for (std::size_t i = 1; i < text.size(); ++i) {
      const bool begins = (std::isdigit(static_cast<unsigned char>(text[i])) || text[i] == '-') &&
                          (text[i - 1] == ':' || text[i - 1] == ',' || text[i - 1] == '[');
      if (!begins) continue;
      std::size_t end = i;
      while (end < text.size() && text[end] != ',' && text[end] != ']' && text[end] != '}')
        ++end;
      GltfFile f = good;
      f.root = json::parse(text.substr(0, i) + value + text.substr(end));
      const auto s = load(f);
      if (s) expect_sound(*s);
    }
  }
}

TEST_F(LoadHostile, SurvivesEveryMemberRemoved) {
  const GltfFile good = rich_file();
  const json flat = good.root.flatten();
  for (const auto& [path, value] : flat.items()) {
    // Each prefix of each path: objects and arrays go as a whole, too.
    for (json::json_pointer at(path); !at.empty(); at = at.parent_pointer()) {
      GltfFile f = good;
      if (!f.root.contains(at)) continue;
      f.root[at] = nullptr;
      const auto s = load(f);
      if (s) expect_sound(*s);
      json& parent = f.root[at.parent_pointer()];
      if (!parent.is_object()) continue;
      parent.erase(at.back());
      const auto r = load(f);
      if (r) expect_sound(*r);
    }
  }
}

TEST_F(LoadHostile, RefusesDeepNesting) {
  for (const auto& [open, close] : {std::pair("[", "]"), std::pair("{\"a\":", "}")}) {
    for (const char* where : {"extras", "nodes", "unknown"}) {
      std::string text = R"({"asset":{"version":"2.0"},")" + std::string(where) + "\":";
      for (int i = 0; i < 200000; ++i)
        text += open;
      text += "1";
      for (int i = 0; i < 200000; ++i)
        text += close;
      IVIS_EXPECT_ERROR(load_bytes(glb_of(text + "}", "")), ErrorCode::kInput,
                        "nested deeper than 64");
    }
  }
}

TEST_F(LoadHostile, TakesBracketsInStringsForText) {
  std::string brackets;
  for (int i = 0; i < 100; ++i)
    brackets += "[{\\\"";
  IVIS_ASSERT_OK(load_edited([&](GltfFile& f) { f.root["nodes"][0]["name"] = "[[[[{{{{\"\\"; }));
  GltfFile f;
  f.add_triangle();
  f.root["buffers"] = {{{"byteLength", f.bin.size()}}};
  std::string text = f.root.dump();
  text.insert(1, "\"extras\":\"" + brackets + "\",");
  IVIS_ASSERT_OK(load_bytes(glb_of(text, f.bin)));
}

TEST_F(LoadHostile, RefusesTwoSectionsOfOneName) {
  GltfFile f;
  f.add_triangle();
  f.root["buffers"] = {{{"byteLength", f.bin.size()}}};
  std::string text = f.root.dump();
  for (const char* insert : {R"("buffers":[],)", R"("im\u0061ges":[1],)"}) {
    std::string twice = text;
    twice.insert(1, insert);
    const auto s = load_bytes(glb_of(twice, f.bin));
    ASSERT_FALSE(s) << insert;
  }
}

TEST_F(LoadHostile, WalksADeepChainOfNodes) {
  GltfFile f;
  f.add_triangle();
  f.root["nodes"][0]["translation"] = {1, 0, 0};
  json nodes = json::array({f.root["nodes"][0]});
  for (int i = 1; i < 30000; ++i)
    nodes.push_back({{"children", {i - 1}}, {"translation", {0, 1, 0}}});
  f.root["nodes"] = nodes;
  f.root["scenes"][0]["nodes"] = {29999};
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  EXPECT_NEAR(s->bounds.hi.y, 30000, 1e-6);
}

TEST_F(LoadHostile, RefusesGraphsThatAreNoTrees) {
  const auto with_nodes = [&](const json& nodes, const json& roots) {
    return load_edited([&](GltfFile& f) {
      f.root["nodes"] = nodes;
      f.root["scenes"][0]["nodes"] = roots;
    });
  };
  IVIS_EXPECT_ERROR(with_nodes({{{"children", {0}}}}, json::array()), ErrorCode::kInput, "node 0",
                    "its own ancestor");
  IVIS_EXPECT_ERROR(with_nodes({{{"children", {1}}}, {{"children", {0}}}}, json::array()),
                    ErrorCode::kInput, "its own ancestor");
  IVIS_EXPECT_ERROR(with_nodes({{{"children", {0}}}}, {0}), ErrorCode::kInput, "node 0");
  IVIS_EXPECT_ERROR(with_nodes({{{"children", {2}}}, {{"children", {2}}}, {{"mesh", 0}}}, {0, 1}),
                    ErrorCode::kInput, "node 2 is a child of node 0 and again of node 1");
  IVIS_EXPECT_ERROR(with_nodes({{{"children", {1, 1}}}, {{"mesh", 0}}}, {0}), ErrorCode::kInput,
                    "node 1 is a child of node 0");
  IVIS_EXPECT_ERROR(with_nodes({{{"children", {1}}}, {{"mesh", 0}}}, {0, 1}), ErrorCode::kInput,
                    "expected a root");
  IVIS_EXPECT_ERROR(with_nodes({{{"mesh", 0}}}, {0, 0}), ErrorCode::kInput, "node 0 twice");
  IVIS_EXPECT_ERROR(with_nodes({{{"children", {5}}}}, {0}), ErrorCode::kInput,
                    "child 5, expected below 1");
  IVIS_EXPECT_ERROR(with_nodes({{{"children", {-1}}}}, {0}), ErrorCode::kInput, "child -1");
  IVIS_EXPECT_ERROR(with_nodes({{{"mesh", 0}}}, {3}), ErrorCode::kInput,
                    "node 3, expected below 1");
  IVIS_EXPECT_ERROR(load_edited([](GltfFile& f) { f.root["scene"] = 4; }), ErrorCode::kInput,
                    "scene 4");
}

TEST_F(LoadHostile, RefusesTransformsThatAreNone) {
  const auto with = [&](const json& node) {
    return load_edited([&](GltfFile& f) { f.root["nodes"][0].update(node); });
  };
  IVIS_EXPECT_ERROR(with({{"translation", {1, 2}}}), ErrorCode::kInput,
                    "node 0: translation of 2 numbers, expected 3");
  IVIS_EXPECT_ERROR(with({{"rotation", {1, 2, 3}}}), ErrorCode::kInput,
                    "rotation of 3 numbers, expected 4");
  IVIS_EXPECT_ERROR(with({{"rotation", {0, 0, 0, 0}}}), ErrorCode::kInput, "rotation");
  IVIS_EXPECT_ERROR(with({{"scale", {1, 2, 3, 4}}}), ErrorCode::kInput, "scale of 4 numbers");
  IVIS_EXPECT_ERROR(with({{"matrix", {1, 2}}}), ErrorCode::kInput, "matrix of 2 numbers");
  IVIS_EXPECT_ERROR(with({{"matrix", {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}}),
                    ErrorCode::kInput, "last row");
  IVIS_EXPECT_ERROR(with({{"scale", {1e200, 1, 1}}}), ErrorCode::kInput, "node 0", "1e30");
}

TEST_F(LoadHostile, RefusesPositionsThatAreNotFinite) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    GltfFile f;
    const int p = f.add_accessor_of<float>({0, 0, 0, 1, bad, 0, 0, 1, 0}, kFloat, "VEC3");
    f.add_node({{"mesh", f.add_mesh(p, -1)}, {"name", "odd"}});
    IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "scene.glb", "node 0 'odd'",
                      "mesh 0, primitive 0", "position 1 is not finite");
  }
}

TEST_F(LoadHostile, RefusesIndicesOutOfRange) {
  GltfFile f;
  const int p = f.add_accessor_of<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, kFloat, "VEC3");
  const int i = f.add_accessor_of<std::uint32_t>({0, 1, 3}, kUnsignedInt, "SCALAR");
  f.add_node({{"mesh", f.add_mesh(p, i)}});
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "node 0", "index 3, expected below 3");
}

TEST_F(LoadHostile, RefusesReferencesOutOfRange) {
  const auto error = [&](auto edit, const char* word) {
    IVIS_EXPECT_ERROR(load_edited(edit), ErrorCode::kInput, word);
  };
  error([](GltfFile& f) { f.root["nodes"][0]["mesh"] = 9; }, "mesh 9, expected below 1");
  error([](GltfFile& f) { f.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 9; },
        "accessor 9, expected below 1");
  error([](GltfFile& f) { f.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = -3; },
        "accessor -3");
  error([](GltfFile& f) { f.root["meshes"][0]["primitives"][0]["indices"] = 9; }, "out of bounds");
  error([](GltfFile& f) { f.root["meshes"][0]["primitives"][0]["material"] = 2; },
        "material 2, expected below 0");
  error([](GltfFile& f) { f.root["meshes"][0]["primitives"][0]["mode"] = 7; }, "mode 7");
  error([](GltfFile& f) { f.root["accessors"][0]["bufferView"] = 9; },
        "buffer view 9, expected below 1");
  error([](GltfFile& f) { f.root["bufferViews"][0]["buffer"] = 9; }, "buffer 9, expected below 1");
  error([](GltfFile& f) { f.root["bufferViews"][0]["byteOffset"] = 4; }, "do not fit in 36 bytes");
  error([](GltfFile& f) { f.root["bufferViews"][0]["byteLength"] = 37; }, "do not fit");
  error([](GltfFile& f) { f.root["bufferViews"][0]["byteOffset"] = 18446744073709551615U; },
        "do not fit");
  error([](GltfFile& f) { f.root["accessors"][0]["byteOffset"] = 18446744073709551612U; },
        "do not fit");
  error([](GltfFile& f) { f.root["accessors"][0]["count"] = 4; },
        "accessor 0: 4 elements of 12 bytes");
  error([](GltfFile& f) { f.root["accessors"][0]["count"] = 1537228672809129302U; },
        "expected below 2^32");
  error([](GltfFile& f) { f.root["accessors"][0]["count"] = 4294967295U; }, "do not fit");
  error([](GltfFile& f) { f.root["bufferViews"][0]["byteStride"] = 4; },
        "byteStride 4, expected at least 12");
  error([](GltfFile& f) { f.root["bufferViews"][0]["byteStride"] = 252; }, "252 apart");
  error([](GltfFile& f) { f.root["bufferViews"][0]["byteStride"] = 1000; }, "byteStride");
  error([](GltfFile& f) { f.root["accessors"][0]["type"] = "VEC2"; }, "type VEC2, expected VEC3");
  error([](GltfFile& f) { f.root["accessors"][0]["componentType"] = 5130; }, "componentType 5130");
  error([](GltfFile& f) { f.root["accessors"][0]["count"] = 2; },
        "2 vertices, expected a multiple of 3");
  error(
      [](GltfFile& f) {
        f.root["buffers"] = {{{"byteLength", 1000}}};
      },
      "byteLength 1000, found 36");
  error(
      [](GltfFile& f) {
        f.root["buffers"] = {{{"byteLength", 36}}, {{"byteLength", 36}}};
      },
      "buffer 1");
  error([](GltfFile& f) { f.root["buffers"] = 5; }, "'buffers' is not an array");
  error(
      [](GltfFile& f) {
        f.root["animations"] = {{{"channels", {{{"target", {{"node", 77}}}}}}}};
      },
      "node 77");
  error([](GltfFile& f) { f.root["asset"]["version"] = "1.0"; }, "asset.version '1.0'");
}

TEST_F(LoadHostile, RefusesHugeCountsWithoutBytes) {
  IVIS_EXPECT_ERROR(load_edited([](GltfFile& f) {
                      f.root["accessors"][0] = {
                          {"componentType", kFloat}, {"count", 4000000000U}, {"type", "VEC3"}};
                    }),
                    ErrorCode::kInput, "accessor 0: 4000000000 elements without a buffer view");
  IVIS_EXPECT_ERROR(
      load_edited([](GltfFile& f) {
        f.root["accessors"].push_back(
            {{"componentType", kFloat}, {"count", 4000000000U}, {"type", "VEC3"}});
        f.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
            1;
      }),
      ErrorCode::kInput, "EXT_mesh_gpu_instancing, TRANSLATION: accessor 1");
}

TEST_F(LoadHostile, BoundsWhatSharingCanMultiply) {
  // 20,000 primitives that all use the same 60,000 indices would be 400 million triangles.
  GltfFile f;
  const int p = f.add_accessor_of<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, kFloat, "VEC3");
  const int i = f.add_accessor(f.add_view_of(std::vector<std::uint8_t>(60000)), kUnsignedByte,
                               60000, "SCALAR");
  json primitives = json::array();
  for (int k = 0; k < 20000; ++k)
    primitives.push_back({{"attributes", {{"POSITION", p}}}, {"indices", i}});
  f.root["meshes"] = {{{"primitives", primitives}}};
  f.add_node({{"mesh", 0}});
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "more than a file of this size may ask for");

  // 3,000 nodes with the same 20,000 instances would be 60 million objects.
  GltfFile g;
  const int t = g.add_accessor_of(std::vector<float>(60000), kFloat, "VEC3");
  for (int k = 0; k < 3000; ++k) {
    if (k == 0) g.add_triangle();
    if (k > 0) g.add_node({{"mesh", 0}});
    g.root["nodes"].back()["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
        t;
  }
  IVIS_EXPECT_ERROR(load(g), ErrorCode::kInput, "EXT_mesh_gpu_instancing instances",
                    "more than a file of this size may ask for");
}

TEST_F(LoadHostile, BoundsTheBoxesOfManyInstancesOfALargeMesh) {
  // 20,000 rotated instances of 900,000 vertices: their product is 18 billion.
  GltfFile f;
  std::vector<std::uint8_t> positions(std::size_t{4} * 900000);
  std::uint32_t random = 1;
  for (auto& p : positions)
    p = static_cast<std::uint8_t>((random = random * 1664525U + 1013904223U) >> 24U);
  const int p = f.add_accessor(f.add_view_of(positions, 4), kUnsignedByte, 900000, "VEC3");
  const int t = f.add_accessor_of(std::vector<float>(60000, 1.0F), kFloat, "VEC3");
  f.add_node(
      {{"mesh", f.add_mesh(p, -1)},
       {"rotation", {0.1, 0.2, 0.3, 0.9}},
       {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", t}}}}}}}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  const Aabb exact = s->objects.front().bounds, corners = s->objects.back().bounds;
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_LE(corners.lo[axis], exact.lo[axis] + 1e-9);
    EXPECT_GE(corners.hi[axis], exact.hi[axis] - 1e-9);
  }
}

TEST_F(LoadHostile, RefusesBrokenSparseAccessors) {
  const auto with = [&](const json& sparse) {
    GltfFile f;
    f.add_triangle();
    f.add_view_of<std::uint16_t>({2, 1});
    f.add_view_of<float>({1, 1, 1, 2, 2, 2});
    json whole = {{"count", 2},
                  {"indices", {{"bufferView", 1}, {"componentType", kUnsignedShort}}},
                  {"values", {{"bufferView", 2}}}};
    whole.merge_patch(sparse);
    f.root["accessors"][0]["sparse"] = whole;
    return load(f);
  };
  IVIS_EXPECT_ERROR(with(json::object()), ErrorCode::kInput,
                    "accessor 0, sparse: index 1 at 1, expected ascending");
  IVIS_EXPECT_ERROR(with({{"count", 4}}), ErrorCode::kInput, "count 4, expected at most 3");
  IVIS_EXPECT_ERROR(with({{"count", 3}}), ErrorCode::kInput, "do not fit");
  IVIS_EXPECT_ERROR(with({{"count", -1}}), ErrorCode::kInput, "count -1");
  IVIS_EXPECT_ERROR(with({{"indices", {{"bufferView", 8}}}}), ErrorCode::kInput, "buffer view 8");
  IVIS_EXPECT_ERROR(with({{"indices", {{"componentType", kFloat}}}}), ErrorCode::kInput,
                    "componentType 5126");
  IVIS_EXPECT_ERROR(with({{"indices", {{"byteOffset", -2}}}}), ErrorCode::kInput,
                    "negative byteOffset");
  IVIS_EXPECT_ERROR(with({{"values", {{"byteOffset", 4}}}}), ErrorCode::kInput, "do not fit");
}

TEST_F(LoadHostile, RefusesBrokenInstances) {
  const auto with = [&](const json& attributes) {
    return load_edited([&](GltfFile& f) {
      f.add_accessor_of<float>({0, 0, 0, 1, 1, 1}, kFloat, "VEC3");
      f.add_accessor_of<float>({0, 0, 0, 0}, kFloat, "VEC4");
      f.add_accessor_of<std::uint32_t>({1, 2, 3}, kUnsignedInt, "VEC3");
      f.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = attributes;
    });
  };
  IVIS_EXPECT_ERROR(with({{"TRANSLATION", 0}, {"SCALE", 1}}), ErrorCode::kInput,
                    "SCALE: count 2, the other attributes have 3");
  IVIS_EXPECT_ERROR(with({{"TRANSLATION", 8}}), ErrorCode::kInput, "accessor 8");
  IVIS_EXPECT_ERROR(with({{"TRANSLATION", "x"}}), ErrorCode::kInput,
                    "TRANSLATION is not an accessor index");
  IVIS_EXPECT_ERROR(with({{"ROTATION", 0}}), ErrorCode::kInput, "expected VEC4");
  IVIS_EXPECT_ERROR(with({{"ROTATION", 2}}), ErrorCode::kInput, "instance 0: rotation");
  IVIS_EXPECT_ERROR(with({{"SCALE", 3}}), ErrorCode::kInput, "componentType 5125");
  IVIS_EXPECT_ERROR(with({{"_COLOUR", 0}}), ErrorCode::kInput, "none of TRANSLATION");
  IVIS_EXPECT_ERROR(with(5), ErrorCode::kInput, "'attributes' is not an object");
}

TEST_F(LoadHostile, StaysInItsFolder) {
  namespace fs = std::filesystem;
  const auto inner = folder() / "inner";
  fs::create_directories(inner / "sub");
  const std::string bytes(36, '\0');
  write("secret.bin", bytes);
  write("inner/fine.bin", bytes);
  fs::create_symlink("../secret.bin", inner / "link.bin");
  fs::create_directory_symlink("..", inner / "up");
  fs::create_symlink("fine.bin", inner / "good_link.bin");
  GltfFile f;
  f.add_triangle();
  const auto with = [&](const std::string& uri) {
    f.root["buffers"] = {{{"byteLength", 36}, {"uri", uri}}};
    return load_scene(write("inner/scene.gltf", f.root.dump()));
  };
  IVIS_ASSERT_OK(with("fine.bin"));
  IVIS_ASSERT_OK(with("./fine.bin"));
  IVIS_ASSERT_OK(with("good_link.bin"));
  for (const std::string& uri :
       {std::string("../secret.bin"), std::string("sub/../../secret.bin"),
        std::string("%2e%2e/secret.bin"), std::string("..%2Fsecret.bin"),
        std::string("%2E%2E%2Fsecret.bin"), (folder() / "secret.bin").string(),
        "file://" + (folder() / "secret.bin").string(), "%2F" + (folder() / "secret.bin").string(),
        std::string("http://example.org/a.bin"), std::string("link.bin"),
        std::string("up/secret.bin"), std::string("..\\secret.bin"), std::string("fine.bin%00.txt"),
        std::string("%zz"), std::string("%"), std::string("/dev/zero")}) {
    IVIS_EXPECT_ERROR(with(uri), ErrorCode::kInput, "scene.gltf", "buffer 0: uri '");
  }
  for (const char* uri : {"sub/../fine.bin", "%2e%2e/inner/fine.bin"})
    IVIS_EXPECT_ERROR(with(uri), ErrorCode::kInput, "'..', expected a file beside this one");
  IVIS_EXPECT_ERROR(with("sub"), ErrorCode::kIo, "not a regular file");
  IVIS_EXPECT_ERROR(with("absent.bin"), ErrorCode::kIo, "absent.bin");
  f.root["buffers"] = {{{"byteLength", 37}, {"uri", "fine.bin"}}};
  IVIS_EXPECT_ERROR(load_scene(write("inner/scene.gltf", f.root.dump())), ErrorCode::kInput,
                    "byteLength 37, found 36");
  for (const char* uri :
       {"data:,abc", "data:application/octet-stream;base64,AA*A", "data:;base64,AAAA"})
    IVIS_EXPECT_ERROR(with(uri), ErrorCode::kInput, "buffer 0");
}

TEST_F(LoadHostile, RefusesBrokenContainers) {
  const GltfFile f = rich_file();
  const std::string good = f.glb();
  const auto with = [&](std::size_t at, const std::string& bytes) {
    std::string b = good;
    b.replace(at, bytes.size(), bytes);
    return load_bytes(b);
  };
  IVIS_EXPECT_ERROR(with(0, "glTX"), ErrorCode::kInput, "scene.glb");
  IVIS_EXPECT_ERROR(with(4, u32(1)), ErrorCode::kInput, "version 1, expected 2");
  IVIS_EXPECT_ERROR(with(8, u32(0xffffffffU)), ErrorCode::kInput, "4294967295 bytes, found");
  IVIS_EXPECT_ERROR(with(12, u32(0xfffffff0U)), ErrorCode::kInput, "chunk 0 says");
  IVIS_EXPECT_ERROR(with(12, u32(0)), ErrorCode::kInput, "GLB");
  IVIS_EXPECT_ERROR(with(16, "BIN "), ErrorCode::kInput, "first chunk is not JSON");
  IVIS_EXPECT_ERROR(load_bytes(""), ErrorCode::kInput, "scene.glb");
  IVIS_EXPECT_ERROR(load_bytes("{}"), ErrorCode::kInput, "scene.glb");
  IVIS_EXPECT_ERROR(load_bytes("[[[]]]"), ErrorCode::kInput, "scene.glb");
  IVIS_EXPECT_ERROR(load_bytes("]]]]"), ErrorCode::kInput, "bracket");
  IVIS_EXPECT_ERROR(load_bytes("{\"a"), ErrorCode::kInput, "does not end");
  IVIS_EXPECT_ERROR(load_bytes("{\"asset\":{\"version\":\"2.0\"}"), ErrorCode::kInput,
                    "ends inside");
  IVIS_EXPECT_ERROR(load_bytes(glb_of(f.root.dump(), "")), ErrorCode::kInput, "buffer");
}

}  // namespace
}  // namespace ivis::test
