// What load_scene makes of sound files, one feature a test.
#include <algorithm>
#include <atomic>
#include <cmath>

#include "gltf_file.h"

namespace ivis::test {
namespace {

using nlohmann::json;

class Load : public GltfFolder {};

void expect_near(const Vec3& a, const Vec3& b, double tolerance = 1e-9) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

json occluder(const char* tag) {
  return {{"extras", {{"ivis", {{"occluder", tag}}}}}};
}

/// Four corners of the unit square in x, y: 0 (0,0), 1 (1,0), 2 (0,1), 3 (1,1).
int square(GltfFile& f) {
  return f.add_accessor_of<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, kFloat, "VEC3");
}

TEST_F(Load, ListsATriangleAsOneObject) {
  GltfFile f;
  f.add_triangle({{"name", "alone"}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 1U);
  EXPECT_EQ(s->triangle_count, 1U);
  EXPECT_EQ(s->name_of(s->objects[0]), "alone");
  EXPECT_TRUE(s->hidden_solids.empty());
  EXPECT_TRUE(s->warnings.empty());
  expect_near(s->bounds.lo, {0, 0, 0});
  expect_near(s->bounds.hi, {1, 1, 0});
  const Triangle t = world_triangle(*s, s->objects[0], 0);
  expect_near(t.b, {1, 0, 0});
}

TEST_F(Load, ReadsIndicesOfEveryWidth) {
  for (const int type : {kUnsignedByte, kUnsignedShort, kUnsignedInt}) {
    GltfFile f;
    const int p = square(f);
    const int i = type == kUnsignedByte ? f.add_accessor_of<std::uint8_t>({3, 2, 1}, type, "SCALAR")
                  : type == kUnsignedShort
                      ? f.add_accessor_of<std::uint16_t>({3, 2, 1}, type, "SCALAR")
                      : f.add_accessor_of<std::uint32_t>({3, 2, 1}, type, "SCALAR");
    f.add_node({{"mesh", f.add_mesh(p, i)}});
    const auto s = load(f);
    IVIS_ASSERT_OK(s);
    const Triangle t = world_triangle(*s, s->objects[0], 0);
    expect_near(t.a, {1, 1, 0});
    expect_near(t.b, {0, 1, 0});
    expect_near(t.c, {1, 0, 0});
    EXPECT_EQ(s->meshes[0].positions.size(), 3U) << "vertices that no triangle uses stay behind";
  }
}

TEST_F(Load, TurnsStripsAndFansIntoTrianglesOfOneWinding) {
  for (const int mode : {5, 6}) {
    GltfFile f;
    const int p = square(f);
    const int i = mode == 5
                      ? f.add_accessor_of<std::uint16_t>({0, 1, 2, 3}, kUnsignedShort, "SCALAR")
                      : f.add_accessor_of<std::uint16_t>({0, 1, 3, 2}, kUnsignedShort, "SCALAR");
    f.add_node({{"mesh", f.add_mesh(p, i, {{"mode", mode}})}});
    const auto s = load(f);
    IVIS_ASSERT_OK(s);
    ASSERT_EQ(s->triangle_count, 2U);
    double area = 0;
    for (std::size_t t = 0; t < 2; ++t) {
      const Triangle w = world_triangle(*s, s->objects[0], t);
      const double twice = glm::cross(w.b - w.a, w.c - w.a).z;
      EXPECT_GT(twice, 0) << "mode " << mode << ", triangle " << t;
      area += twice / 2;
    }
    EXPECT_NEAR(area, 1, 1e-12);
  }
}

TEST_F(Load, LeavesPointsAndLinesOutWithAWarning) {
  GltfFile f;
  f.add_node({{"mesh", f.add_mesh(square(f), -1, {{"mode", 1}})}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 1U) << "the node is listed all the same";
  EXPECT_EQ(s->triangle_count, 0U);
  ASSERT_EQ(s->warnings.size(), 1U);
  EXPECT_NE(s->warnings[0].find("1 primitives left out"), std::string::npos);
}

TEST_F(Load, PutsAnObjectWithoutTrianglesAtItsOrigin) {
  GltfFile f;
  f.add_node({{"mesh", f.add_mesh(square(f), -1, {{"mode", 0}})}, {"translation", {7, 8, 9}}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  expect_near(s->objects[0].bounds.lo, {7, 8, 9});
  expect_near(s->objects[0].bounds.hi, {7, 8, 9});
}

TEST_F(Load, ComposesTransformsDownTheHierarchy) {
  GltfFile f;
  const double h = std::sqrt(0.5);
  const int leaf = f.add_triangle({{"translation", {10, 0, 0}}, {"scale", {2, 2, 2}}});
  f.root["scenes"][0]["nodes"] = json::array();
  const int middle =
      f.add_node({{"rotation", {0, h, 0, h}}, {"children", {leaf}}}, false);  // 90 degrees about +Y
  f.add_node(
      {{"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 100, 200, 300, 1}}, {"children", {middle}}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  const Triangle t = world_triangle(*s, s->objects[0], 0);
  expect_near(t.a, {100, 200, 290});  // +X goes to -Z
  expect_near(t.b, {100, 200, 288});
  expect_near(t.c, {100, 202, 290});
}

TEST_F(Load, NumbersObjectsByAscendingNodeNotByVisit) {
  GltfFile f;
  f.add_triangle({{"name", "zero"}});
  f.add_triangle({{"name", "one"}});
  f.add_triangle({{"name", "two"}});
  f.root["scenes"][0]["nodes"] = {2, 0, 1};
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 3U);
  for (std::uint32_t i = 0; i < 3; ++i)
    EXPECT_EQ(s->objects[i].node, i);
}

TEST_F(Load, TakesOnlyWhatTheDefaultSceneReaches) {
  GltfFile f;
  f.add_triangle();
  const int other = f.add_triangle({{"name", "other"}});
  f.root["scenes"] = {{{"nodes", {0}}}, {{"nodes", {other}}}};
  f.root["scene"] = 1;
  auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 1U);
  EXPECT_EQ(s->name_of(s->objects[0]), "other");
  f.root.erase("scene");
  s = load(f);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->objects[0].node, 0U) << "without a default the first scene";
  f.root.erase("scenes");
  s = load(f);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->objects.size(), 2U) << "without scenes every root";
}

TEST_F(Load, SharesOneMeshAmongItsNodes) {
  GltfFile f;
  f.add_triangle();
  f.add_node({{"mesh", 0}, {"translation", {5, 0, 0}}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->meshes.size(), 1U);
  EXPECT_EQ(s->triangle_count, 2U);
}

TEST_F(Load, MakesAnObjectOfEachInstance) {
  GltfFile f;
  const double h = std::sqrt(0.5);
  const int t = f.add_accessor_of<float>({10, 0, 0, 20, 0, 0}, kFloat, "VEC3");
  const int s_ = f.add_accessor_of<float>({1, 1, 1, 3, 1, 1}, kFloat, "VEC3");
  const int r =
      f.add_accessor(f.add_view_of<std::int16_t>(
                         {0, 0, 0, 32767, 0, static_cast<std::int16_t>(std::lround(32767 * h)), 0,
                          static_cast<std::int16_t>(std::lround(32767 * h))}),
                     kShort, 2, "VEC4", true);
  f.add_triangle({{"translation", {0, 100, 0}},
                  {"extensions",
                   {{"EXT_mesh_gpu_instancing",
                     {{"attributes", {{"TRANSLATION", t}, {"ROTATION", r}, {"SCALE", s_}}}}}}}});
  f.root["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  f.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 2U);
  EXPECT_EQ(s->objects[1].instance, 1U);
  EXPECT_EQ(s->objects[1].node, 0U);
  EXPECT_EQ(s->meshes.size(), 1U);
  EXPECT_EQ(s->extensions, std::vector<std::string>{"EXT_mesh_gpu_instancing"});
  expect_near(world_triangle(*s, s->objects[0], 0).b, {11, 100, 0});
  expect_near(world_triangle(*s, s->objects[1], 0).b, {20, 100, -3}, 1e-4);
}

TEST_F(Load, ReadsQuantizedPositions) {
  struct Case {
    int type;
    bool normalized;
    double one;  // what the stored 100 means
  };
  for (const Case c :
       {Case{kByte, false, 100}, Case{kByte, true, 100.0 / 127}, Case{kUnsignedByte, false, 100},
        Case{kUnsignedByte, true, 100.0 / 255}, Case{kShort, false, 100},
        Case{kShort, true, 100.0 / 32767}, Case{kUnsignedShort, false, 100},
        Case{kUnsignedShort, true, 100.0 / 65535}}) {
    GltfFile f;
    const bool bytes = c.type == kByte || c.type == kUnsignedByte;
    // Elements of 3 are padded to 4, as the extension asks for.
    const int view = bytes
                         ? f.add_view_of<std::int8_t>({0, 0, 0, 0, 100, 0, 0, 0, 0, 100, 0, 0}, 4)
                         : f.add_view_of<std::int16_t>({0, 0, 0, 0, 100, 0, 0, 0, 0, 100, 0, 0}, 8);
    f.add_node({{"mesh", f.add_mesh(f.add_accessor(view, c.type, 3, "VEC3", c.normalized), -1)}});
    f.root["extensionsRequired"] = {"KHR_mesh_quantization"};
    const auto s = load(f);
    IVIS_ASSERT_OK(s);
    EXPECT_NEAR(world_triangle(*s, s->objects[0], 0).b.x, c.one, 1e-7)
        << c.type << ' ' << c.normalized;
  }
}

TEST_F(Load, ClampsTheLowestNormalizedIntegerToMinusOne) {
  GltfFile f;
  const int view = f.add_view_of<std::int8_t>({0, 0, 0, 0, -128, 0, 0, 0, 0, 127, 0, 0}, 4);
  f.add_node({{"mesh", f.add_mesh(f.add_accessor(view, kByte, 3, "VEC3", true), -1)}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(world_triangle(*s, s->objects[0], 0).b.x, -1);
}

TEST_F(Load, ReadsInterleavedPositions) {
  GltfFile f;
  const int view = f.add_view_of<float>({9, 0, 0, 0, 9, 1, 0, 0, 9, 0, 1, 0}, 16);
  const int a = f.add_accessor(view, kFloat, 3, "VEC3");
  f.root["accessors"][0]["byteOffset"] = 4;
  f.add_node({{"mesh", f.add_mesh(a, -1)}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  expect_near(world_triangle(*s, s->objects[0], 0).b, {1, 0, 0});
}

TEST_F(Load, ReadsSparseAccessors) {
  for (const bool with_base : {true, false}) {
    GltfFile f;
    const int base = f.add_view_of<float>({5, 5, 5, 5, 5, 5, 5, 5, 5});
    const int at = f.add_view_of<std::uint16_t>({0, 2});
    const int values = f.add_view_of<float>({1, 2, 3, 4, 5, 6});
    const int a = f.add_accessor(with_base ? base : -1, kFloat, 3, "VEC3");
    f.root["accessors"][0]["sparse"] = {
        {"count", 2},
        {"indices", {{"bufferView", at}, {"componentType", kUnsignedShort}}},
        {"values", {{"bufferView", values}}}};
    f.add_node({{"mesh", f.add_mesh(a, -1)}});
    const auto s = load(f);
    IVIS_ASSERT_OK(s);
    const Triangle t = world_triangle(*s, s->objects[0], 0);
    expect_near(t.a, {1, 2, 3});
    expect_near(t.b, with_base ? Vec3(5) : Vec3(0));
    expect_near(t.c, {4, 5, 6});
  }
}

TEST_F(Load, KeepsEachPrimitivesMaterial) {
  GltfFile f;
  const int p = square(f);
  f.root["materials"] = {
      {{"doubleSided", true}},
      {{"alphaMode", "MASK"}},
      {{"alphaMode", "BLEND"}},
      {{"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 0.9}}}}}}};
  const int i = f.add_accessor_of<std::uint16_t>({0, 1, 2}, kUnsignedShort, "SCALAR");
  json primitives = json::array();
  for (int m = 0; m < 5; ++m) {
    primitives.push_back({{"attributes", {{"POSITION", p}}}, {"indices", i}});
    if (m < 4) primitives.back()["material"] = m;
  }
  f.root["meshes"] = {{{"primitives", primitives}}};
  f.add_node({{"mesh", 0}});
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  const auto& runs = s->meshes[0].primitives;
  ASSERT_EQ(runs.size(), 5U);
  EXPECT_TRUE(runs[0].opaque);
  EXPECT_TRUE(runs[0].double_sided);
  EXPECT_FALSE(runs[1].opaque);
  EXPECT_FALSE(runs[2].opaque);
  EXPECT_FALSE(runs[3].opaque) << "glass lets sight through";
  EXPECT_TRUE(runs[4].opaque) << "the default material";
  EXPECT_FALSE(runs[4].double_sided);
  EXPECT_EQ(runs[4].first_triangle, 4U);
  EXPECT_EQ(s->meshes[0].positions.size(), 3U) << "primitives share their vertices";
}

TEST_F(Load, SortsNodesByTheirTag) {
  GltfFile f;
  f.add_triangle();
  f.add_triangle(occluder("auto"));
  f.add_triangle(occluder("always"));
  f.add_triangle(occluder("only"));
  f.add_triangle(occluder("never"));
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 4U);
  EXPECT_EQ(s->objects[0].tag, OccluderTag::kAuto);
  EXPECT_EQ(s->objects[1].tag, OccluderTag::kAuto);
  EXPECT_EQ(s->objects[2].tag, OccluderTag::kAlways);
  EXPECT_EQ(s->objects[3].tag, OccluderTag::kNever);
  EXPECT_EQ(s->objects[3].node, 4U);
  ASSERT_EQ(s->hidden_solids.size(), 1U);
  EXPECT_EQ(s->hidden_solids[0].node, 3U);
  EXPECT_EQ(s->triangle_count, 4U);
}

TEST_F(Load, DoesNotInheritTags) {
  GltfFile f;
  const int child = f.add_triangle();
  f.root["scenes"][0]["nodes"] = json::array();
  json parent = occluder("only");
  parent["children"] = {child};
  f.add_node(parent);
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 1U);
  EXPECT_EQ(s->objects[0].tag, OccluderTag::kAuto);
}

TEST_F(Load, RefusesAnUnknownTagByNameAndNode) {
  GltfFile f;
  json node = occluder("sometimes");
  node["name"] = "wall";
  f.add_triangle(node);
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kInput, "scene.glb", "node 0 'wall'", "'sometimes'",
                    "auto, always, only or never");
}

TEST_F(Load, ListsWhatMovesAsAlwaysVisibleAndNeverAsOccluder) {
  GltfFile f;
  f.add_triangle({{"skin", 0}});
  const int morphed = f.add_triangle();
  f.root["meshes"][1]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
  const int below = f.add_triangle();
  f.root["scenes"][0]["nodes"] = {0, morphed};
  const int animated = f.add_node({{"children", {below}}});
  const int still = f.add_triangle();
  const int solid = f.add_triangle(occluder("only"));
  f.root["skins"] = {{{"joints", {0}}}};
  f.root["animations"] = {
      {{"channels",
        {{{"sampler", 0}, {"target", {{"node", animated}, {"path", "translation"}}}},
         {{"sampler", 0}, {"target", {{"node", solid}, {"path", "translation"}}}}}},
       {"samplers", {{{"input", 0}, {"output", 0}}}}}};
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  ASSERT_EQ(s->objects.size(), 4U);
  for (const Object& o : s->objects) {
    const bool moves = o.node != static_cast<std::uint32_t>(still);
    EXPECT_EQ(o.always_visible, moves) << o.node;
    EXPECT_EQ(o.tag, moves ? OccluderTag::kNever : OccluderTag::kAuto) << o.node;
  }
  EXPECT_TRUE(s->hidden_solids.empty()) << "a solid that moves must not occlude";
  EXPECT_EQ(s->warnings.size(), 2U);
}

TEST_F(Load, MarksTheTargetOfAnAnimationPointer) {
  GltfFile f;
  f.add_triangle();
  f.add_triangle();
  f.root["animations"] = {
      {{"channels",
        {{{"sampler", 0},
          {"target",
           {{"path", "pointer"},
            {"extensions", {{"KHR_animation_pointer", {{"pointer", "/nodes/1/translation"}}}}}}}}}},
       {"samplers", json::array()}}};
  const auto s = load(f);
  IVIS_ASSERT_OK(s);
  EXPECT_FALSE(s->objects[0].always_visible);
  EXPECT_TRUE(s->objects[1].always_visible);
}

TEST_F(Load, RefusesAnUnknownRequiredExtensionByName) {
  GltfFile f;
  f.add_triangle();
  f.root["extensionsUsed"] = {"EXT_made_up"};
  IVIS_ASSERT_OK(load(f));
  f.root["extensionsRequired"] = {"KHR_materials_unlit", "EXT_made_up"};
  IVIS_EXPECT_ERROR(load(f), ErrorCode::kUnsupported, "scene.glb", "EXT_made_up");
  f.root["extensionsRequired"] = {"KHR_materials_unlit", "KHR_texture_basisu",
                                  "KHR_lights_punctual"};
  IVIS_ASSERT_OK(load(f));
}

TEST_F(Load, NeverReadsImages) {
  GltfFile f;
  f.add_triangle();
  f.root["images"] = {
      {{"uri", "/etc/passwd"}}, {{"bufferView", 4000000000U}, {"mimeType", "image/png"}}, 7};
  f.root["textures"] = {{{"source", 99}}};
  IVIS_ASSERT_OK(load(f));
}

TEST_F(Load, ReadsABufferBesideTheFileAndADataUri) {
  GltfFile f;
  f.add_triangle();
  const std::string bin = f.bin;
  std::filesystem::create_directories(folder() / "parts");
  write("parts/a b.bin", bin + "more than asked for");
  f.root["buffers"] = {{{"byteLength", bin.size()}, {"uri", "parts/a%20b.bin"}}};
  auto s = load_scene(write("scene.gltf", f.root.dump()));
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->triangle_count, 1U);
  const auto hash = s->hash;
  EXPECT_EQ(load(f)->hash, hash) << "a .glb may name buffers, too";
  // 36 bytes: (0,0,0) (1,0,0) (0,1,0)
  f.root["buffers"] = {
      {{"byteLength", 36},
       {"uri",
        "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}};
  s = load_scene(write("scene.gltf", f.root.dump()));
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->hash, hash);
}

TEST_F(Load, RecordsWhetherSidesAreHonoured) {
  GltfFile f;
  f.add_triangle();
  const auto both = load(f);
  const auto one = load(f, {.honour_sidedness = true});
  IVIS_ASSERT_OK(one);
  EXPECT_FALSE(both->honour_sidedness);
  EXPECT_TRUE(one->honour_sidedness);
  EXPECT_NE(both->hash, one->hash);
}

TEST_F(Load, HashesGeometryAndNotItsStorage) {
  const auto hash_of = [&](auto edit) {
    GltfFile f;
    const int p = square(f);
    const int i = f.add_accessor_of<std::uint16_t>({0, 1, 2}, kUnsignedShort, "SCALAR");
    f.add_node({{"mesh", f.add_mesh(p, i)}, {"translation", {1, 2, 3}}});
    edit(f);
    const auto s = load(f);
    EXPECT_TRUE(s) << (s ? "" : s.error().message);
    return s ? s->hash : 0;
  };
  const SceneHash plain = hash_of([](GltfFile&) {});
  EXPECT_EQ(plain, hash_of([](GltfFile& f) {
              f.root["accessors"][1] = {{"bufferView", f.add_view_of<std::uint32_t>({0, 1, 2})},
                                        {"componentType", kUnsignedInt},
                                        {"count", 3},
                                        {"type", "SCALAR"}};
              f.root["nodes"][0]["name"] = "named";
              f.root["asset"]["generator"] = "another";
            }));
  EXPECT_NE(plain, hash_of([](GltfFile& f) { f.bin[3 * 4 + 2] = 1; })) << "a position";
  EXPECT_NE(plain, hash_of([](GltfFile& f) { f.bin[48] = 3; })) << "an index";
  EXPECT_NE(plain, hash_of([](GltfFile& f) { f.root["nodes"][0]["translation"][1] = 2.0000001; }));
  EXPECT_NE(plain, hash_of([](GltfFile& f) { f.root["nodes"][0].update(occluder("never")); }));
  EXPECT_NE(plain, hash_of([](GltfFile& f) { f.root["nodes"][0].update(occluder("only")); }));
  EXPECT_NE(plain, hash_of([](GltfFile& f) {
              f.root["materials"] = {{{"alphaMode", "BLEND"}}};
              f.root["meshes"][0]["primitives"][0]["material"] = 0;
            }));
  EXPECT_NE(plain, hash_of([](GltfFile& f) { f.add_node({{"mesh", 0}}); }));
}

TEST_F(Load, StopsWhenAsked) {
  GltfFile f;
  f.add_triangle();
  const std::atomic<bool> stop{true};
  Context context;
  context.stop = &stop;
  const auto s = load_scene(write("scene.glb", f.glb()), {}, context);
  ASSERT_FALSE(s);
  EXPECT_EQ(s.error().code, ErrorCode::kCancelled);
}

TEST_F(Load, ReportsProgressUpToItsTotal) {
  GltfFile f;
  f.add_triangle();
  std::size_t done = 0, total = 0;
  Context context;
  context.progress = [&](std::string_view, std::size_t d, std::size_t t) { done = d, total = t; };
  IVIS_ASSERT_OK(load_scene(write("scene.glb", f.glb()), {}, context));
  EXPECT_EQ(done, 1U);
  EXPECT_EQ(total, 1U);
}

TEST_F(Load, SaysThatAFileIsMissing) {
  IVIS_EXPECT_ERROR(load_scene(folder() / "none.glb"), ErrorCode::kIo, "none.glb");
}

}  // namespace
}  // namespace ivis::test
