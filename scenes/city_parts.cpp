#include "scenes/city_parts.h"

#include <cmath>

namespace ivis {
namespace {

enum Colour : std::uint32_t {
  kFrame,
  kGlass,
  kWood,
  kMetal,
  kLeaf,
  kNeedle,
  kBark,
  kLight,
  kPaint,
  kTyre,
  kBrick,
  kColours
};

/// Crowns are leaves, which one looks through here and there: they block no sight line.
constexpr float kCrown = 0.8F;

GlbMaterial colour(Colour c) {
  switch (c) {
    case kFrame:
      return {"frame", {0.85F, 0.84F, 0.80F, 1}};
    case kGlass:
      return {"glass", {0.10F, 0.16F, 0.22F, 1}};
    case kWood:
      return {"wood", {0.25F, 0.13F, 0.06F, 1}};
    case kMetal:
      return {"metal", {0.15F, 0.16F, 0.17F, 1}};
    case kLeaf:
      return {"leaf", {0.13F, 0.30F, 0.07F, kCrown}, GlbAlpha::kBlend};
    case kNeedle:
      return {"needle", {0.06F, 0.19F, 0.08F, kCrown}, GlbAlpha::kBlend};
    case kBark:
      return {"bark", {0.20F, 0.13F, 0.08F, 1}};
    case kLight:
      return {"light", {0.95F, 0.90F, 0.70F, 1}};
    case kPaint:
      return {"paint", {0.35F, 0.05F, 0.05F, 1}};
    case kTyre:
      return {"tyre", {0.03F, 0.03F, 0.03F, 1}};
    default:
      return {"brick", {0.40F, 0.18F, 0.12F, 1}};
  }
}

/// A mesh in the making; primitives by colour.
class Shape {
 public:
  /// Closed box.
  void box(Colour c, const glm::vec3& lo, const glm::vec3& hi) {
    taper(c, lo, hi, {lo.x, lo.z}, {hi.x, hi.z});
  }
  /// Closed frustum: the rectangle of lo..hi below, top_lo..top_hi (x, z) above.
  void taper(Colour c, const glm::vec3& lo, const glm::vec3& hi, glm::vec2 top_lo,
             glm::vec2 top_hi) {
    GlbPrimitive& p = of(c);
    const auto v = static_cast<std::uint32_t>(p.positions.size());
    p.positions.insert(p.positions.end(), {{lo.x, lo.y, lo.z},
                                           {hi.x, lo.y, lo.z},
                                           {hi.x, lo.y, hi.z},
                                           {lo.x, lo.y, hi.z},
                                           {top_lo.x, hi.y, top_lo.y},
                                           {top_hi.x, hi.y, top_lo.y},
                                           {top_hi.x, hi.y, top_hi.y},
                                           {top_lo.x, hi.y, top_hi.y}});
    for (std::uint32_t i = 0; i < 4; ++i)
      quad(p, v + i, v + 4 + i, v + 4 + (i + 1) % 4, v + (i + 1) % 4);
    quad(p, v, v + 1, v + 2, v + 3);
    quad(p, v + 7, v + 6, v + 5, v + 4);
  }
  /// Rectangle at depth z facing +Z.
  void pane(Colour c, float x0, float y0, float x1, float y1, float z) {
    GlbPrimitive& p = of(c);
    const auto v = static_cast<std::uint32_t>(p.positions.size());
    p.positions.insert(p.positions.end(), {{x0, y0, z}, {x1, y0, z}, {x1, y1, z}, {x0, y1, z}});
    quad(p, v, v + 1, v + 2, v + 3);
  }
  /// Four strips about the rectangle lo..hi, `b` wide, at depth z facing +Z.
  void rim(Colour c, glm::vec2 lo, glm::vec2 hi, float b, float z) {
    GlbPrimitive& p = of(c);
    const auto v = static_cast<std::uint32_t>(p.positions.size());
    for (const float d : {0.0F, b}) {
      p.positions.insert(p.positions.end(), {{lo.x + d, lo.y + d, z},
                                             {hi.x - d, lo.y + d, z},
                                             {hi.x - d, hi.y - d, z},
                                             {lo.x + d, hi.y - d, z}});
    }
    for (std::uint32_t i = 0; i < 4; ++i)
      quad(p, v + i, v + (i + 1) % 4, v + 4 + (i + 1) % 4, v + 4 + i);
  }
  /// Walls from depth z0 (at the wall) out to z1 about the rectangle; `inward` turns them round.
  void sides(Colour c, glm::vec2 lo, glm::vec2 hi, float z0, float z1, bool inward) {
    GlbPrimitive& p = of(c);
    const auto v = static_cast<std::uint32_t>(p.positions.size());
    for (const float z : {z0, z1})
      p.positions.insert(p.positions.end(),
                         {{lo.x, lo.y, z}, {hi.x, lo.y, z}, {hi.x, hi.y, z}, {lo.x, hi.y, z}});
    for (std::uint32_t i = 0; i < 4; ++i) {
      const std::uint32_t n = (i + 1) % 4;
      if (inward)
        quad(p, v + n, v + i, v + 4 + i, v + 4 + n);
      else
        quad(p, v + i, v + n, v + 4 + n, v + 4 + i);
    }
  }
  /// Closed body of revolution with `n` corners through (radius, y), of which first and last have
  /// radius 0.
  void spindle(Colour c, const std::vector<glm::vec2>& profile, bool hexagon) {
    // Corners in units of the radius; six or five, to the nearest thousandth (no trigonometry: same
    // bits everywhere).
    static const std::vector<glm::vec2> kSix{{1, 0},  {0.5F, 0.866F},   {-0.5F, 0.866F},
                                             {-1, 0}, {-0.5F, -0.866F}, {0.5F, -0.866F}};
    static const std::vector<glm::vec2> kFive{
        {1, 0}, {0.309F, 0.951F}, {-0.809F, 0.588F}, {-0.809F, -0.588F}, {0.309F, -0.951F}};
    const auto& ring = hexagon ? kSix : kFive;
    const auto n = static_cast<std::uint32_t>(ring.size());
    GlbPrimitive& p = of(c);
    const auto v = static_cast<std::uint32_t>(p.positions.size());
    const auto rings = static_cast<std::uint32_t>(profile.size() - 2);
    p.positions.emplace_back(0, profile.front().y, 0);
    p.positions.emplace_back(0, profile.back().y, 0);
    for (std::uint32_t k = 1; k <= rings; ++k)
      for (const glm::vec2& q : ring)
        p.positions.emplace_back(q.x * profile[k].x, profile[k].y, q.y * profile[k].x);
    const auto at = [&](std::uint32_t k, std::uint32_t i) { return v + 2 + k * n + i % n; };
    for (std::uint32_t i = 0; i < n; ++i) {
      p.indices.insert(p.indices.end(), {v, at(0, i), at(0, i + 1)});
      for (std::uint32_t k = 0; k + 1 < rings; ++k)
        quad(p, at(k, i), at(k + 1, i), at(k + 1, i + 1), at(k, i + 1));
      p.indices.insert(p.indices.end(), {v + 1, at(rings - 1, i + 1), at(rings - 1, i)});
    }
  }

  std::vector<GlbPrimitive> take() { return std::move(primitives_); }

 private:
  GlbPrimitive& of(Colour c) {
    for (GlbPrimitive& p : primitives_)
      if (p.material == c) return p;
    primitives_.push_back({{}, {}, c});
    return primitives_.back();
  }
  static void quad(GlbPrimitive& p, std::uint32_t a, std::uint32_t b, std::uint32_t c,
                   std::uint32_t d) {
    p.indices.insert(p.indices.end(), {a, b, c, a, c, d});
  }
  std::vector<GlbPrimitive> primitives_;
};

/// A frame that stands 6 cm out of the wall, barred with its pane 4 cm behind its face: nothing is
/// cut into the wall.
void window(Shape& s, bool barred) {
  constexpr float kOut = 0.06F;
  constexpr float kPane = 0.02F;
  const glm::vec2 lo(-0.5F, 0);
  const glm::vec2 hi(0.5F, 1);
  s.sides(kFrame, lo, hi, 0, kOut, false);
  if (!barred) {
    s.pane(kGlass, -0.5F, 0, 0.5F, 1, kOut);
    return;
  }
  s.rim(kFrame, lo, hi, 0.07F, kOut);
  s.pane(kGlass, -0.43F, 0.07F, 0.43F, 0.93F, kPane);
  s.sides(kFrame, lo + 0.07F, hi - 0.07F, kPane, kOut, true);
  s.pane(kFrame, -0.02F, 0.07F, 0.02F, 0.93F, kOut - 0.01F);
}

GlbMesh make(Part part) {
  Shape s;
  const char* name = "";
  switch (part) {
    case Part::kWindowPlain:
      name = "window_plain";
      window(s, false);
      break;
    case Part::kWindowBarred:
      name = "window_barred";
      window(s, true);
      s.box(kFrame, {-0.55F, -0.04F, 0}, {0.55F, 0, 0.16F});
      break;
    case Part::kDoor:
      name = "door";
      s.rim(kFrame, {-0.5F, 0}, {0.5F, 1}, 0.08F, 0.08F);
      s.sides(kFrame, {-0.5F, 0}, {0.5F, 1}, 0, 0.08F, false);
      s.pane(kWood, -0.42F, 0, 0.42F, 0.92F, 0.03F);
      break;
    case Part::kBalcony:
      name = "balcony";
      s.box(kFrame, {-0.5F, -0.08F, 0}, {0.5F, 0, 1.0F});
      s.box(kMetal, {-0.5F, 0, 0.96F}, {0.5F, 0.4F, 1.0F});
      s.box(kMetal, {-0.5F, 0, 0}, {-0.48F, 0.4F, 0.96F});
      s.box(kMetal, {0.48F, 0, 0}, {0.5F, 0.4F, 0.96F});
      break;
    case Part::kTreeRound:
      name = "tree_round";
      s.taper(kBark, {-0.025F, 0, -0.025F}, {0.025F, 0.4F, 0.025F}, {-0.018F, -0.018F},
              {0.018F, 0.018F});
      s.spindle(kLeaf, {{0, 0.28F}, {0.2F, 0.36F}, {0.3F, 0.58F}, {0.2F, 0.86F}, {0, 1}}, true);
      break;
    case Part::kTreeConical:
      name = "tree_conical";
      s.taper(kBark, {-0.02F, 0, -0.02F}, {0.02F, 0.2F, 0.02F}, {-0.015F, -0.015F},
              {0.015F, 0.015F});
      s.spindle(kNeedle, {{0, 0.12F}, {0.2F, 0.16F}, {0.09F, 0.55F}, {0, 1}}, false);
      break;
    case Part::kLamp:
      name = "lamp";
      s.taper(kMetal, {-0.015F, 0, -0.015F}, {0.015F, 0.97F, 0.015F}, {-0.008F, -0.008F},
              {0.008F, 0.008F});
      s.box(kMetal, {-0.006F, 0.97F, -0.006F}, {0.006F, 0.985F, 0.2F});
      s.box(kLight, {-0.02F, 0.95F, 0.13F}, {0.02F, 0.97F, 0.23F});
      break;
    case Part::kCar:
      name = "car";
      s.taper(kPaint, {-2.15F, 0.28F, -0.88F}, {2.15F, 0.85F, 0.88F}, {-2.1F, -0.84F},
              {2.05F, 0.84F});
      s.taper(kGlass, {-1.7F, 0.85F, -0.8F}, {1.1F, 1.45F, 0.8F}, {-1.3F, -0.62F}, {0.5F, 0.62F});
      s.box(kTyre, {-1.65F, 0, -0.86F}, {-1.05F, 0.6F, 0.86F});
      s.box(kTyre, {1.05F, 0, -0.86F}, {1.65F, 0.6F, 0.86F});
      break;
    case Part::kBench:
      name = "bench";
      s.box(kWood, {-0.9F, 0.42F, -0.22F}, {0.9F, 0.47F, 0.22F});
      s.box(kWood, {-0.9F, 0.5F, -0.26F}, {0.9F, 0.85F, -0.22F});
      s.box(kMetal, {-0.8F, 0, -0.2F}, {-0.74F, 0.42F, 0.2F});
      s.box(kMetal, {0.74F, 0, -0.2F}, {0.8F, 0.42F, 0.2F});
      break;
    case Part::kChimney:
      name = "roof_object";
      s.box(kBrick, {-0.5F, 0, -0.5F}, {0.5F, 1, 0.5F});
      break;
  }
  return {name, s.take()};
}

/// Rotation about +Y that turns +Z to `facing`, by half angles through square roots, which IEEE
/// rounds the same way everywhere.
glm::vec4 turn_to(const Vec2& facing) {
  const double c = facing.y;
  const double s = facing.x;
  const double half_cos = std::sqrt(std::max(0.0, (1 + c) / 2));
  if (half_cos < 1e-4) return {0, 1, 0, 0};
  const double half_sin = s / (2 * half_cos);
  const double length = std::sqrt(half_cos * half_cos + half_sin * half_sin);
  return {0, half_sin / length, 0, half_cos / length};
}

}  // namespace

std::size_t triangles_of(Part part) {
  static const auto counts = [] {
    std::array<std::size_t, kPartCount> n{};
    for (std::size_t i = 0; i < kPartCount; ++i)
      n[i] = make(static_cast<Part>(i)).triangles();
    return n;
  }();
  return counts[static_cast<std::size_t>(part)];
}

void PartList::add(Part part, const Vec3& at, const Vec2& facing, const Vec3& scale) {
  instances_[static_cast<std::size_t>(part)].push_back(
      {glm::vec3(at), turn_to(facing), glm::vec3(scale)});
}

void PartList::add(const PartList& other) {
  for (std::size_t i = 0; i < kPartCount; ++i)
    instances_[i].insert(instances_[i].end(), other.instances_[i].begin(),
                         other.instances_[i].end());
}

std::size_t PartList::count() const {
  std::size_t n = 0;
  for (const auto& list : instances_)
    n += list.size();
  return n;
}

std::size_t PartList::triangles() const {
  std::size_t n = 0;
  for (std::size_t i = 0; i < kPartCount; ++i)
    n += instances_[i].size() * triangles_of(static_cast<Part>(i));
  return n;
}

void PartList::write_to(GlbScene& scene) const {
  const auto first_material = static_cast<std::uint32_t>(scene.materials.size());
  for (std::uint32_t c = 0; c < kColours; ++c)
    scene.materials.push_back(colour(static_cast<Colour>(c)));
  for (std::size_t i = 0; i < kPartCount; ++i) {
    if (instances_[i].empty()) continue;
    GlbMesh mesh = make(static_cast<Part>(i));
    for (GlbPrimitive& p : mesh.primitives)
      p.material += first_material;
    GlbNode node;
    node.name = mesh.name;
    node.mesh = static_cast<std::uint32_t>(scene.meshes.size());
    node.tag = OccluderTag::kNever;
    node.instances = instances_[i];
    scene.meshes.push_back(std::move(mesh));
    scene.nodes.push_back(std::move(node));
  }
}

}  // namespace ivis
