#include "tests/tools/small_town.h"

#include <random>

#include <gtest/gtest.h>

#include "scenes/write_glb.h"

namespace ivis::test {
namespace {

GlbMesh unit_cube() {
  GlbPrimitive p;
  for (const float y : {0.0F, 1.0F})
    for (const glm::vec2 c : {glm::vec2{0, 0}, {1, 0}, {1, 1}, {0, 1}})
      p.positions.emplace_back(c.x, y, c.y);
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    p.indices.insert(p.indices.end(), {a, b, c, a, c, d});
  };
  quad(0, 1, 2, 3);
  quad(7, 6, 5, 4);
  for (std::uint32_t i = 0; i < 4; ++i)
    quad(i, 4 + i, 4 + (i + 1) % 4, (i + 1) % 4);
  return {"cube", {p}};
}

GlbMesh unit_square() {
  GlbPrimitive p;
  p.positions = {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}};
  p.indices = {0, 2, 1, 0, 3, 2};
  return {"square", {p}};
}

Mat4 placed(const Vec3& lo, const Vec3& size) {
  Mat4 m{1};
  for (int k = 0; k < 3; ++k)
    m[k][k] = size[k];
  m[3] = {lo, 1};
  return m;
}

GlbScene town(double shift_of_last_house) {
  GlbScene scene;
  scene.materials.push_back({});
  scene.meshes = {unit_cube(), unit_square()};
  for (int row = 0; row < 5; ++row)
    for (int column = 0; column < 5; ++column) {
      const bool last = row == 4 && column == 4;
      GlbNode house;
      house.name = "house_" + std::to_string(5 * row + column);
      house.to_world =
          placed({40 * column + (last ? shift_of_last_house : 0), 0, 34 * row}, {28, 14 + row, 22});
      scene.nodes.push_back(house);
    }
  std::mt19937 random(5);
  GlbNode boxes;
  boxes.name = "boxes";
  boxes.tag = OccluderTag::kNever;
  for (std::size_t i = 0; i < SmallTown::kBoxes; ++i) {
    GlbInstance box;
    const auto along = static_cast<float>(random() % 1900) / 10;
    const auto row = static_cast<float>(random() % 5);
    box.translation = {along, 0.02F, 34 * row + 23 + static_cast<float>(random() % 90) / 10};
    box.scale = glm::vec3{0.4F};
    boxes.instances.push_back(box);
  }
  scene.nodes.push_back(boxes);
  GlbNode ground;
  ground.name = "ground";
  ground.mesh = 1;
  ground.to_world = placed({-50, 0, -50}, {300, 1, 270});
  scene.nodes.push_back(ground);
  return scene;
}

/// All instances of all nodes, in place, as one primitive.
GlbScene merged(const GlbScene& town) {
  GlbPrimitive all;
  const auto add = [&](const GlbMesh& mesh, const Mat4& to_world) {
    for (const GlbPrimitive& p : mesh.primitives) {
      const auto base = static_cast<std::uint32_t>(all.positions.size());
      for (const auto& v : p.positions)
        all.positions.emplace_back(Vec3(to_world * glm::dvec4(Vec3(v), 1)));
      for (const std::uint32_t i : p.indices)
        all.indices.push_back(base + i);
    }
  };
  for (const GlbNode& node : town.nodes) {
    const GlbMesh& mesh = town.meshes[node.mesh];
    if (node.instances.empty()) add(mesh, node.to_world);
    for (const GlbInstance& i : node.instances)
      add(mesh, node.to_world * placed(Vec3(i.translation), Vec3(i.scale)));
  }
  GlbScene out;
  out.materials.push_back({});
  out.meshes = {{"town", {all}}};
  out.nodes.emplace_back();
  return out;
}

std::string glb_of(const GlbScene& scene) {
  const auto bytes = write_glb(scene);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message);
  return bytes ? *bytes : "";
}

}  // namespace

const std::string SmallTown::kEye = "10,1.7,28";

SmallTown::SmallTown() : scene(folder / "town.glb"), path(folder / "path.csv") {
  write(scene, glb_of(town(0)));
  std::string rows = "note,z,t,y,x,speed\n";
  for (std::size_t i = 0; i < kPoses; ++i)
    rows += "a,28," + std::to_string(i) + ",1.7," + std::to_string(10 + 25 * i) + ",1\n";
  write(path, rows);
}

std::string write_other_town(const Folder& folder) {
  const std::string file = folder / "other.glb";
  write(file, glb_of(town(0.5)));
  return file;
}

std::string write_merged_town(const Folder& folder) {
  const std::string file = folder / "merged.glb";
  write(file, glb_of(merged(town(0))));
  return file;
}

}  // namespace ivis::test
