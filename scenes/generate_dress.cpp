#include "scenes/generate_dress.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "scenes/base_ground.h"
#include "scenes/city_parts.h"
#include "scenes/cover_raster.h"
#include "scenes/distance_steps.h"
#include "scenes/height_grid.h"
#include "scenes/random.h"
#include "scenes/wall_windows.h"
#include "scenes/write_glb.h"

namespace ivis {
namespace {

enum Stream : std::uint64_t { kGreen = 1, kLampPlaces = 2, kWalls = 1'000'000 };

constexpr std::size_t kTileCells = 16;
constexpr double kMaxCell = 40;
constexpr double kWalkSide = 2000;

/// The input, unchanged. Materials: opaque or not, double-sided or not.
void copy_buildings(const Scene& in, GlbScene& scene) {
  for (int m = 0; m < 4; ++m)
    scene.materials.push_back(
        {std::string((m & 1) != 0 ? "clear" : "opaque") + ((m & 2) != 0 ? "" : "_single_sided"),
         {0.70F, 0.62F, 0.52F, (m & 1) != 0 ? 0.5F : 1.0F},
         (m & 1) != 0 ? GlbAlpha::kBlend : GlbAlpha::kOpaque,
         (m & 2) != 0});
  for (const Mesh& mesh : in.meshes) {
    GlbMesh out;
    for (const Primitive& p : mesh.primitives) {
      GlbPrimitive part;
      part.material = (p.opaque ? 0U : 1U) + (p.double_sided ? 2U : 0U);
      const auto first = mesh.indices.begin() + std::ptrdiff_t{3} * p.first_triangle;
      part.indices.assign(first, first + std::ptrdiff_t{3} * p.triangles);
      if (mesh.primitives.size() == 1) {
        part.positions = mesh.positions;
      } else {  // each with its own vertices, in the order of use
        std::map<std::uint32_t, std::uint32_t> own;
        for (std::uint32_t& i : part.indices) {
          const auto [it, added] = own.emplace(i, static_cast<std::uint32_t>(own.size()));
          if (added) part.positions.push_back(mesh.positions[i]);
          i = it->second;
        }
      }
      out.primitives.push_back(std::move(part));
    }
    scene.meshes.push_back(std::move(out));
  }
  for (const auto* list : {&in.objects, &in.hidden_solids}) {
    for (const Object& o : *list) {
      scene.nodes.push_back({in.name_of(o), o.mesh, o.tag, o.to_world, {}});
      std::string& name = scene.meshes[o.mesh].name;
      if (name.empty()) name = in.name_of(o);
    }
  }
}

/// Points at least `spacing` apart.
class Spaced {
 public:
  explicit Spaced(double spacing) : spacing_(spacing) {}
  bool take(const Vec2& p) {
    const auto i = static_cast<std::int64_t>(std::floor(p.x / spacing_));
    const auto k = static_cast<std::int64_t>(std::floor(p.y / spacing_));
    for (std::int64_t b = k - 1; b <= k + 1; ++b)
      for (std::int64_t a = i - 1; a <= i + 1; ++a) {
        const auto [from, to] = cells_.equal_range({a, b});
        for (auto it = from; it != to; ++it)
          if (glm::length(it->second - p) < spacing_) return false;
      }
    cells_.emplace(std::pair{i, k}, p);
    return true;
  }

 private:
  double spacing_;
  std::multimap<std::pair<std::int64_t, std::int64_t>, Vec2> cells_;
};

/// Lamps a few metres from walls and trees in the open, each up to a budget of triangles.
void plant(const DressOptions& o, const HeightGrid& ground, const CoverRaster& cover,
           std::size_t lamp_budget, std::size_t tree_budget, PartList& parts,
           std::vector<StreetObstacles::Disc>& discs) {
  const auto steps =
      distance_steps(cover.nx(), cover.nz(), [&](std::size_t c) { return cover.covered(c); });
  const auto room = [&](const Vec2& p) {
    return static_cast<double>(steps[cover.index(p)]) * cover.cell_m();
  };
  const Vec2 lo = ground.lo + 1.0;
  const Vec2 size = ground.hi - ground.lo - 2.0;
  const auto facing = [](Random& r) {
    const double x = r.in(-1, 1);
    const double z = r.in(-1, 1);
    const double length = std::sqrt(x * x + z * z);
    return length > 0.1 ? Vec2(x, z) / length : Vec2(0, 1);
  };
  const auto tries = static_cast<std::size_t>(std::min(size.x * size.y / 20, 2e6));

  Random lamps(o.seed, kLampPlaces);
  Spaced lamp_places(24);
  std::size_t left = lamp_budget / triangles_of(Part::kLamp);
  for (std::size_t n = 0; n < tries && left > 0; ++n) {
    const double x = lamps.unit();
    const double z = lamps.unit();
    const Vec2 p = lo + size * Vec2(x, z);
    if (room(p) < 3 || room(p) > 3 + 1.5 * cover.cell_m() || !lamp_places.take(p)) continue;
    const double height = lamps.in(5, 7);
    parts.add(Part::kLamp, {p.x, ground.height(p) - 0.02, p.y}, facing(lamps), Vec3(height));
    discs.push_back({p, 0.7});
    --left;
  }

  Random green(o.seed, kGreen);
  Spaced tree_places(5.5);
  left = tree_budget / triangles_of(Part::kTreeRound);
  // Groves: a lattice of 60 m says how green it is where.
  std::map<std::pair<std::int64_t, std::int64_t>, double> groves;
  for (std::size_t n = 0; n < tries && left > 0; ++n) {
    const double x = green.unit();
    const double z = green.unit();
    const Vec2 p = lo + size * Vec2(x, z);
    const double wish = green.unit();
    const Vec2 lattice = glm::floor(p / 60.0);
    const auto [grove, fresh] = groves.emplace(
        std::pair{static_cast<std::int64_t>(lattice.x), static_cast<std::int64_t>(lattice.y)}, 0.0);
    if (fresh) grove->second = green.chance(0.35) ? green.in(0.5, 1) : green.in(0.02, 0.2);
    if (wish > grove->second || room(p) < 5 || !tree_places.take(p)) continue;
    const double height = green.in(6, 13);
    const Part part = green.chance(0.2) ? Part::kTreeConical : Part::kTreeRound;
    parts.add(part, {p.x, ground.height(p) - 0.05, p.y}, facing(green), Vec3(height));
    discs.push_back({p, 0.9});
    --left;
  }
}

/// At most 2 km a side about the median of the objects' middles, within the ground.
void walk_window(const Scene& in, const HeightGrid& ground, Vec2& lo, Vec2& hi) {
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> middles;
    for (const Object& o : in.objects)
      middles.push_back(ivis::ground(o.bounds.centre())[axis]);
    std::nth_element(middles.begin(),
                     middles.begin() + static_cast<std::ptrdiff_t>(middles.size() / 2),
                     middles.end());
    const double side = std::min(kWalkSide, std::floor(ground.hi[axis] - ground.lo[axis]));
    lo[axis] = std::clamp(std::floor(middles[middles.size() / 2] - side / 2), ground.lo[axis],
                          ground.hi[axis] - side);
    hi[axis] = lo[axis] + side;
  }
}

Status check(const Scene& in, const DressOptions& o) {
  if (in.objects.empty() || in.triangle_count == 0)
    return invalid_argument("generate dress: the scene has no triangles to dress");
  if (!(o.cell_m >= 0.5 && o.cell_m <= kMaxCell))
    return invalid_argument("generate dress: ground cells of " + std::to_string(o.cell_m) +
                            " m, expected 0.5 to 40");
  if (!(o.margin_m >= 5 && o.margin_m <= 1000))
    return invalid_argument("generate dress: a margin of " + std::to_string(o.margin_m) +
                            " m, expected 5 to 1000");
  const Vec3 size = in.bounds.size();
  if (size.x > 100'000 || size.z > 100'000)
    return invalid_argument("generate dress: the scene is " + std::to_string(size.x) + " m x " +
                            std::to_string(size.z) + " m, expected at most 100 km a side");
  return ok();
}

}  // namespace

Result<GeneratedScene> generate_dress(const Scene& in, const DressOptions& options,
                                      const Context& context) {
  if (auto s = check(in, options); !s) return s.error();
  constexpr std::size_t kStages = 5;
  context.report("dress", 0, kStages);
  GlbScene scene;
  scene.generator = "ivis generate dress";
  scene.copyright = options.copyright;
  copy_buildings(in, scene);

  const std::size_t given = in.triangle_count;
  const std::size_t left = options.max_triangles > given ? options.max_triangles - given : 0;
  const Vec2 rectangle = ground(in.bounds.size()) + 2 * options.margin_m;
  const double for_ground = std::max(static_cast<double>(left) / 3, 2.0);
  const double fitting = std::sqrt(2 * rectangle.x * rectangle.y / for_ground);
  const double cell = std::clamp(fitting, options.cell_m, kMaxCell);
  auto heights = base_ground(in, cell, options.margin_m, context);
  if (!heights) return heights.error();
  const auto earth = static_cast<std::uint32_t>(scene.materials.size());
  scene.materials.push_back({"ground", {0.28F, 0.28F, 0.25F, 1}});
  add_ground_tiles(scene, *heights, kTileCells, earth);
  if (context.stopped()) return cancelled();
  context.report("dress", 1, kStages);

  const Vec2 size = heights->hi - heights->lo;
  const CoverRaster cover(in, heights->lo, heights->hi,
                          std::max(1.0, std::sqrt(size.x * size.y / 32e6)));
  if (context.stopped()) return cancelled();
  context.report("dress", 2, kStages);

  const std::size_t used = scene.triangle_count();
  const std::size_t free = options.max_triangles > used ? options.max_triangles - used : 0;
  PartList street_parts;
  StreetObstacles obstacles;
  plant(options, *heights, cover, free / 20, free / 4, street_parts, obstacles.discs);
  if (context.stopped()) return cancelled();
  context.report("dress", 3, kStages);

  // Windows: as near to each other as the budget allows, but no nearer than on a real house.
  const std::size_t for_windows = free - std::min(free, street_parts.triangles());
  PartList windows;
  if (for_windows >= triangles_of(Part::kWindowPlain)) {
    std::vector<std::vector<WallPlane>> walls;
    for (const Object& o : in.objects) {
      walls.push_back(outer_walls(in, o, cover));
      if (context.stopped()) return cancelled();
    }
    double bay = 2.8;
    for (int attempt = 0; attempt < 8; ++attempt) {
      PartList hung;
      for (std::size_t i = 0; i < walls.size(); ++i)
        hang_windows(walls[i], bay, *heights, cover, Random(options.seed, kWalls + i), hung);
      if (context.stopped()) return cancelled();
      const double ratio = static_cast<double>(hung.triangles()) / static_cast<double>(for_windows);
      if (ratio <= 1 && hung.triangles() >= windows.triangles()) windows = std::move(hung);
      if (ratio <= 1 && (ratio > 0.97 || bay <= 2.8)) break;
      bay = std::max(2.8, bay * (ratio * 1.01));
    }
  }
  windows.add(street_parts);
  windows.write_to(scene);
  context.report("dress", 4, kStages);

  GeneratedScene out;
  out.buildings = in.objects.size();
  out.objects = scene.object_count();
  out.triangles = scene.triangle_count();
  walk_window(in, *heights, obstacles.lo, obstacles.hi);
  const double reach = options.path.clearance_m + 2;
  for (const auto* list : {&in.objects, &in.hidden_solids})
    for (const Object& o : *list) {
      if (o.bounds.hi.x < obstacles.lo.x - reach || o.bounds.lo.x > obstacles.hi.x + reach ||
          o.bounds.hi.z < obstacles.lo.y - reach || o.bounds.lo.z > obstacles.hi.y + reach)
        continue;
      for (std::size_t t = 0; t < in.mesh_of(o).triangles(); ++t) {
        const Triangle w = world_triangle(in, o, t);
        obstacles.footprints.push_back({ground(w.a), ground(w.b), ground(w.c)});
      }
    }
  StreetPathOptions walk = options.path;
  walk.seed = options.seed;
  auto path = street_path(
      obstacles, [&](const Vec2& p) { return heights->height(p); }, walk, context);
  if (!path) return path.error();
  out.path = std::move(*path);
  auto glb = write_glb(scene);
  if (!glb) return glb.error();
  out.glb = std::move(*glb);
  context.report("dress", kStages, kStages);
  return out;
}

}  // namespace ivis
