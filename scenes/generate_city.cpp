#include "scenes/generate_city.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "scenes/city_blocks.h"
#include "scenes/city_buildings.h"
#include "scenes/city_parts.h"
#include "scenes/facades.h"
#include "scenes/height_grid.h"
#include "scenes/random.h"
#include "scenes/street_furniture.h"
#include "scenes/write_glb.h"

namespace ivis {
namespace {

enum Stream : std::uint64_t {
  kStreets = 1,
  kGround = 2,
  kBlocks = 1'000'000,
  kFurniture = 2'000'000,
  kFacades = 10'000'000,
  kOrder = 3
};

constexpr std::size_t kTileCells = 4;

/// Smooth swells: values at the crossings of a 250 m lattice, blended by a cubic.
HeightGrid make_ground(const CityOptions& o) {
  HeightGrid g;
  g.lo = Vec2(-o.size_m / 2);
  g.hi = Vec2(o.size_m / 2);
  const auto tiles = static_cast<std::size_t>(std::max(1.0, std::floor(o.size_m / 64 + 0.5)));
  g.cells_x = g.cells_z = tiles * kTileCells;
  g.y.assign((g.cells_x + 1) * (g.cells_z + 1), 0.0F);
  if (o.relief_m <= 0) return g;
  constexpr double kSwell = 250;
  const auto n = static_cast<std::size_t>(o.size_m / kSwell) + 2;
  Random random(o.seed, kGround);
  std::vector<double> lattice((n + 1) * (n + 1));
  for (double& v : lattice)
    v = random.in(0, o.relief_m);
  for (std::size_t k = 0; k <= g.cells_z; ++k) {
    for (std::size_t i = 0; i <= g.cells_x; ++i) {
      const Vec2 p = Vec2(static_cast<double>(i), static_cast<double>(k)) * g.cell_size() / kSwell;
      const Vec2 c = glm::floor(p);
      Vec2 f = p - c;
      f = f * f * (Vec2(3) - 2.0 * f);
      const std::size_t at =
          static_cast<std::size_t>(c.y) * (n + 1) + static_cast<std::size_t>(c.x);
      const double low = lattice[at] + (lattice[at + 1] - lattice[at]) * f.x;
      const double high = lattice[at + n + 1] + (lattice[at + n + 2] - lattice[at + n + 1]) * f.x;
      g.at(i, k) = static_cast<float>(low + (high - low) * f.y);
    }
  }
  return g;
}

std::vector<BuiltBlock> build(const std::vector<CityBlock>& blocks, const CityOptions& o,
                              double frontage, const HeightGrid& ground) {
  std::vector<BuiltBlock> built;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const double out = std::min(1.0, glm::length(ring_centre(blocks[i].ring)) / (o.size_m * 0.6));
    built.push_back(build_block(blocks[i], out, frontage, ground, Random(o.seed, kBlocks + i)));
  }
  return built;
}

std::size_t count_buildings(const std::vector<BuiltBlock>& built) {
  std::size_t n = 0;
  for (const BuiltBlock& b : built)
    n += b.buildings.size();
  return n;
}

/// Finds x in [lo, hi] where the falling function `count` comes nearest to `target`; a fixed number
/// of bisections, so that the same inputs give the same x.
template <class F>
double solve_falling(double lo, double hi, std::size_t target, const F& count) {
  double best = hi;
  std::size_t best_off = ~std::size_t{0};
  for (int k = 0; k < 14; ++k) {
    const double x = (lo + hi) / 2;
    const std::size_t n = count(x);
    const std::size_t off = n > target ? n - target : target - n;
    if (off < best_off) {
      best_off = off;
      best = x;
    }
    (n > target ? lo : hi) = x;
  }
  return best;
}

Status check(const CityOptions& o) {
  if (!(o.size_m >= 200 && o.size_m <= 4000))
    return invalid_argument("generate city: size " + std::to_string(o.size_m) +
                            " m, expected 200 to 4000");
  if (o.buildings < 1 || o.buildings > 100'000)
    return invalid_argument("generate city: " + std::to_string(o.buildings) +
                            " buildings, expected 1 to 100000");
  if (o.objects > 10'000'000 || o.triangles > 200'000'000)
    return invalid_argument("generate city: more than 10 million objects or 200 million triangles");
  if (!(o.relief_m >= 0 && o.relief_m <= 100))
    return invalid_argument("generate city: relief " + std::to_string(o.relief_m) +
                            " m, expected 0 to 100");
  return ok();
}

GlbMaterial plaster(std::size_t style) {
  static const std::array<std::array<float, 4>, 6> kColours{{{0.72F, 0.62F, 0.45F, 1},
                                                             {0.62F, 0.35F, 0.25F, 1},
                                                             {0.75F, 0.73F, 0.68F, 1},
                                                             {0.55F, 0.57F, 0.58F, 1},
                                                             {0.70F, 0.55F, 0.35F, 1},
                                                             {0.50F, 0.42F, 0.36F, 1}}};
  return {"plaster_" + std::to_string(style), kColours[style]};
}

}  // namespace

Result<GeneratedScene> generate_city(const CityOptions& options, const Context& context) {
  if (auto s = check(options); !s) return s.error();
  constexpr std::size_t kStages = 6;
  const HeightGrid ground = make_ground(options);

  // Block size and house length fit the number of buildings to the area: first at the density of a
  // real quarter, then by bisection.
  context.report("city", 0, kStages);
  const double per_building =
      options.size_m * options.size_m / static_cast<double>(options.buildings);
  Random streets(options.seed, kStreets);
  const auto blocks = plan_blocks(
      options.size_m, std::clamp(std::sqrt(per_building * 4.5), 45.0, options.size_m / 2), streets);
  const double frontage = solve_falling(8, 120, options.buildings, [&](double f) {
    return count_buildings(build(blocks, options, f, ground));
  });
  const auto built = build(blocks, options, frontage, ground);
  if (context.stopped()) return cancelled();
  context.report("city", 1, kStages);

  PartList street_parts;
  StreetObstacles obstacles;
  obstacles.lo = ground.lo;
  obstacles.hi = ground.hi;
  std::vector<const CityBuilding*> buildings;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    furnish_block(blocks[i], built[i], ground, Random(options.seed, kFurniture + i), street_parts,
                  obstacles.discs);
    for (const CityBuilding& b : built[i].buildings)
      buildings.push_back(&b);
  }
  if (context.stopped()) return cancelled();
  context.report("city", 2, kStages);

  GlbScene scene;
  scene.generator = "ivis generate city";
  for (std::size_t s = 0; s < 6; ++s)
    scene.materials.push_back(plaster(s));
  for (std::size_t i = 0; i < buildings.size(); ++i) {
    const CityBuilding& b = *buildings[i];
    GlbNode node;
    node.name = "building_" + std::to_string(i);
    node.mesh = static_cast<std::uint32_t>(scene.meshes.size());
    scene.meshes.push_back({node.name, {building_mesh(b, static_cast<std::uint32_t>(b.style))}});
    scene.nodes.push_back(std::move(node));
    for (std::size_t j = 0; j + 1 < b.outer.size(); ++j) {
      obstacles.footprints.push_back({b.outer[j], b.outer[j + 1], b.inner[j + 1]});
      obstacles.footprints.push_back({b.outer[j], b.inner[j + 1], b.inner[j]});
    }
  }
  const auto asphalt = static_cast<std::uint32_t>(scene.materials.size());
  scene.materials.push_back({"ground", {0.28F, 0.28F, 0.27F, 1}});
  add_ground_tiles(scene, ground, kTileCells, asphalt);

  // What the streets leave of the objects goes to the façades; what they leave of the triangles
  // goes to glazing bars, house by house in an order without pattern.
  const auto facades = [&](double bay_scale, const std::vector<bool>& barred) {
    PartList parts;
    for (std::size_t i = 0; i < buildings.size(); ++i)
      dress_building(*buildings[i], bay_scale, barred[i], Random(options.seed, kFacades + i),
                     parts);
    return parts;
  };
  const std::vector<bool> none(buildings.size(), false);
  const std::size_t others = scene.object_count() + street_parts.count();
  const std::size_t wanted = options.objects > others ? options.objects - others : 0;
  const double bay_scale =
      solve_falling(0.5, 4, wanted, [&](double s) { return facades(s, none).count(); });
  if (context.stopped()) return cancelled();
  context.report("city", 3, kStages);

  std::size_t triangles =
      scene.triangle_count() + street_parts.triangles() + facades(bay_scale, none).triangles();
  std::vector<std::size_t> order(buildings.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  Random shuffle(options.seed, kOrder);
  for (std::size_t i = order.size(); i > 1; --i)
    std::swap(order[i - 1], order[shuffle.below(i)]);
  std::vector<bool> barred(buildings.size(), false);
  const std::size_t extra = triangles_of(Part::kWindowBarred) - triangles_of(Part::kWindowPlain);
  for (const std::size_t i : order) {
    PartList parts;
    dress_building(*buildings[i], bay_scale, true, Random(options.seed, kFacades + i), parts);
    const std::size_t more = parts.count(Part::kWindowBarred) * extra;
    if (triangles + more > options.triangles) continue;
    triangles += more;
    barred[i] = true;
  }
  PartList parts = facades(bay_scale, barred);
  parts.add(street_parts);
  parts.write_to(scene);
  if (context.stopped()) return cancelled();
  context.report("city", 4, kStages);

  GeneratedScene out;
  out.buildings = buildings.size();
  out.objects = scene.object_count();
  out.triangles = scene.triangle_count();
  StreetPathOptions walk = options.path;
  walk.seed = options.seed;
  auto path = street_path(
      obstacles, [&](const Vec2& p) { return ground.height(p); }, walk, context);
  if (!path) return path.error();
  out.path = std::move(*path);
  context.report("city", 5, kStages);
  auto glb = write_glb(scene);
  if (!glb) return glb.error();
  out.glb = std::move(*glb);
  context.report("city", kStages, kStages);
  return out;
}

}  // namespace ivis
