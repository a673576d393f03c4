#include "scenes/generate_terrain.h"

#include <algorithm>
#include <cmath>

#include "scenes/random.h"
#include "scenes/write_glb.h"

namespace ivis {
namespace {

enum Stream : std::uint64_t { kTrees = 1, kForests = 2 };

float coordinate(std::size_t i, std::size_t n, double step) {
  return static_cast<float>((static_cast<double>(i) - static_cast<double>(n - 1) / 2) * step);
}

/// The grid as drawn: each coordinate from its index in the whole grid, so that tiles share it.
class Grid {
 public:
  explicit Grid(const Dem& dem) : dem_(dem) {}
  std::size_t cells_x() const { return dem_.columns - 1; }
  std::size_t cells_z() const { return dem_.rows - 1; }
  glm::vec3 vertex(std::size_t i, std::size_t k) const {
    return {coordinate(i, dem_.columns, dem_.step_m.x), dem_.at(i, k),
            coordinate(k, dem_.rows, dem_.step_m.y)};
  }
  bool whole(std::size_t i, std::size_t k) const {
    return std::isfinite(dem_.at(i, k)) && std::isfinite(dem_.at(i + 1, k)) &&
           std::isfinite(dem_.at(i, k + 1)) && std::isfinite(dem_.at(i + 1, k + 1));
  }
  /// Height of the drawn triangle at a place in the cell, f in [0, 1]².
  double height(std::size_t i, std::size_t k, const Vec2& f) const {
    const double y00 = dem_.at(i, k);
    const double y11 = dem_.at(i + 1, k + 1);
    if (f.x >= f.y) {
      const double y10 = dem_.at(i + 1, k);
      return y00 + (y10 - y00) * f.x + (y11 - y10) * f.y;
    }
    const double y01 = dem_.at(i, k + 1);
    return y00 + (y11 - y01) * f.x + (y01 - y00) * f.y;
  }
  /// Cell and place in it; none outside.
  struct Place {
    std::size_t i, k;
    Vec2 f;
  };
  std::optional<Place> place(const Vec2& p) const {
    const Vec2 at = p / dem_.step_m +
                    Vec2(static_cast<double>(cells_x()), static_cast<double>(cells_z())) / 2.0;
    if (!(at.x >= 0 && at.y >= 0 && at.x < static_cast<double>(cells_x()) &&
          at.y < static_cast<double>(cells_z())))
      return std::nullopt;
    const auto i = static_cast<std::size_t>(at.x);
    const auto k = static_cast<std::size_t>(at.y);
    return Place{i, k, {at.x - static_cast<double>(i), at.y - static_cast<double>(k)}};
  }
  Vec2 position(std::size_t i, std::size_t k, const Vec2& f) const {
    return (Vec2(static_cast<double>(i), static_cast<double>(k)) + f -
            Vec2(static_cast<double>(cells_x()), static_cast<double>(cells_z())) / 2.0) *
           dem_.step_m;
  }
  const Dem& dem() const { return dem_; }

 private:
  const Dem& dem_;
};

/// Closed body of revolution with six corners through (radius, y); first and last radius are 0.
void revolve(GlbPrimitive& p, std::initializer_list<glm::vec2> profile) {
  constexpr std::uint32_t kCorners = 6;
  constexpr float kHalf = 0.5F;
  constexpr float kSine = 0.8660254F;
  constexpr glm::vec2 kRing[kCorners] = {{1, 0},  {kHalf, kSine},   {-kHalf, kSine},
                                         {-1, 0}, {-kHalf, -kSine}, {kHalf, -kSine}};
  std::vector<std::uint32_t> first;  // of each ring
  for (const glm::vec2& q : profile) {
    first.push_back(static_cast<std::uint32_t>(p.positions.size()));
    for (std::uint32_t c = 0; c < (q.x == 0 ? 1 : kCorners); ++c)
      p.positions.emplace_back(q.x * kRing[c].x, q.y, q.x * kRing[c].y);
  }
  const auto* q = profile.begin();
  for (std::size_t r = 0; r + 1 < first.size(); ++r)
    for (std::uint32_t c = 0; c < kCorners; ++c) {
      const std::uint32_t d = (c + 1) % kCorners;
      const std::uint32_t a = first[r];
      const std::uint32_t b = first[r + 1];
      if (q[r].x == 0) {
        p.indices.insert(p.indices.end(), {a, b + c, b + d});
      } else if (q[r + 1].x == 0) {
        p.indices.insert(p.indices.end(), {a + c, b, a + d});
      } else {
        p.indices.insert(p.indices.end(), {a + c, b + c, b + d, a + c, b + d, a + d});
      }
    }
}

enum Material : std::uint32_t { kGround, kBark, kNeedle, kLeaf };

/// Crowns are leaves, which one looks through here and there: they block no sight line.
constexpr float kCrown = 0.8F;

/// One metre high, roots a little below the ground.
GlbMesh conifer(bool far) {
  GlbMesh mesh{far ? "conifer_far" : "conifer", {}};
  if (far) {
    mesh.primitives.resize(1);
    mesh.primitives[0].material = kNeedle;
    revolve(mesh.primitives[0], {{0, 0}, {0.17F, 0.12F}, {0, 1}});
    return mesh;
  }
  mesh.primitives.resize(2);
  mesh.primitives[0].material = kBark;
  revolve(mesh.primitives[0], {{0, -0.05F}, {0.025F, -0.05F}, {0, 0.5F}});
  mesh.primitives[1].material = kNeedle;
  revolve(mesh.primitives[1], {{0, 0.12F}, {0.18F, 0.12F}, {0.06F, 0.45F}, {0.14F, 0.42F}, {0, 1}});
  return mesh;
}

GlbMesh leafy(bool far) {
  GlbMesh mesh{far ? "leafy_far" : "leafy", {}};
  if (far) {
    mesh.primitives.resize(1);
    mesh.primitives[0].material = kLeaf;
    revolve(mesh.primitives[0], {{0, 0}, {0.28F, 0.6F}, {0, 1}});
    return mesh;
  }
  mesh.primitives.resize(2);
  mesh.primitives[0].material = kBark;
  revolve(mesh.primitives[0], {{0, -0.05F}, {0.035F, -0.05F}, {0, 0.6F}});
  mesh.primitives[1].material = kLeaf;
  revolve(mesh.primitives[1], {{0, 0.25F}, {0.22F, 0.35F}, {0.3F, 0.6F}, {0.2F, 0.88F}, {0, 1}});
  return mesh;
}

Status check(const Dem& dem, const TerrainOptions& o) {
  if (dem.columns < 2 || dem.rows < 2 || dem.heights.size() != dem.columns * dem.rows)
    return invalid_argument("generate terrain: " + std::to_string(dem.columns) + " x " +
                            std::to_string(dem.rows) + " heights, expected at least 2 x 2");
  if (!(dem.step_m.x >= 1e-3 && dem.step_m.y >= 1e-3 && dem.step_m.x <= 1e5 && dem.step_m.y <= 1e5))
    return invalid_argument("generate terrain: cells of " + std::to_string(dem.step_m.x) + " x " +
                            std::to_string(dem.step_m.y) + " m, expected 0.001 to 100000");
  if (o.tile_cells < 1 || o.tile_cells > 1024)
    return invalid_argument("generate terrain: tiles of " + std::to_string(o.tile_cells) +
                            " cells a side, expected 1 to 1024");
  if (o.trees > 10'000'000 || o.triangles > 200'000'000)
    return invalid_argument(
        "generate terrain: more than 10 million trees or 200 million triangles");
  return ok();
}

Status check(const FlyoverOptions& o) {
  if (o.poses < 2 || o.poses > 1'000'000 || !(o.step_m >= 0.01 && o.step_m <= 1000) ||
      !(o.speed_m_s > 0) || !(o.height_m >= 1 && o.height_m <= 10'000) ||
      !(o.smooth_m >= 0 && o.smooth_m <= 10'000))
    return invalid_argument("flyover: poses, step, speed or height out of range");
  return ok();
}

/// Cells from each cell to the nearest one that is not whole, or past the border; by steps to the
/// eight neighbours.
std::vector<float> clearance(const Grid& grid) {
  const std::size_t nx = grid.cells_x();
  const std::size_t nz = grid.cells_z();
  std::vector<float> steps(nx * nz, 0);
  const auto at = [&](std::size_t i, std::size_t k) { return steps[k * nx + i]; };
  for (std::size_t k = 0; k < nz; ++k)
    for (std::size_t i = 0; i < nx; ++i) {
      if (!grid.whole(i, k) || i == 0 || k == 0 || i + 1 == nx) continue;
      steps[k * nx + i] =
          1 + std::min({at(i - 1, k), at(i - 1, k - 1), at(i, k - 1), at(i + 1, k - 1)});
    }
  for (std::size_t k = nz; k-- > 0;)
    for (std::size_t i = nx; i-- > 0;) {
      float& s = steps[k * nx + i];
      const float beyond =
          i + 1 == nx || i == 0 || k + 1 == nz
              ? 0.0F
              : std::min({at(i + 1, k), at(i - 1, k + 1), at(i, k + 1), at(i + 1, k + 1)});
      s = std::min(s, 1 + beyond);
      if (!grid.whole(i, k)) s = 0;
    }
  return steps;
}

/// Trees grow in patches, on slopes that are not too steep.
std::vector<Grid::Place> plant(const Grid& grid, std::size_t count, std::uint64_t seed) {
  std::vector<Grid::Place> trees;
  if (count == 0) return trees;
  Random forests(seed, kForests);
  const double side = std::max(1.0, 150 / std::min(grid.dem().step_m.x, grid.dem().step_m.y));
  const auto nx = static_cast<std::size_t>(static_cast<double>(grid.cells_x()) / side) + 1;
  const auto nz = static_cast<std::size_t>(static_cast<double>(grid.cells_z()) / side) + 1;
  std::vector<double> density(nx * nz);
  for (double& d : density)
    d = forests.unit() < 0.4 ? 0.1 : 1;
  Random random(seed, kTrees);
  trees.reserve(count);
  for (std::size_t tries = 0; trees.size() < count && tries < 100 * count + 1000; ++tries) {
    const std::size_t i = random.below(grid.cells_x());
    const std::size_t k = random.below(grid.cells_z());
    const Vec2 f{random.unit(), random.unit()};
    const double luck = random.unit();
    if (!grid.whole(i, k)) continue;
    const auto patch = static_cast<std::size_t>(static_cast<double>(k) / side) * nx +
                       static_cast<std::size_t>(static_cast<double>(i) / side);
    if (luck > density[patch]) continue;
    const double rise_x =
        (grid.height(i, k, {1, f.y}) - grid.height(i, k, {0, f.y})) / grid.dem().step_m.x;
    const double rise_z =
        (grid.height(i, k, {f.x, 1}) - grid.height(i, k, {f.x, 0})) / grid.dem().step_m.y;
    if (rise_x * rise_x + rise_z * rise_z > 1) continue;
    trees.push_back({i, k, f});
  }
  return trees;
}

}  // namespace

Result<GeneratedScene> generate_terrain(const Dem& dem, const TerrainOptions& options,
                                        const Context& context) {
  if (auto s = check(dem, options); !s) return s.error();
  if (auto s = check(options.path); !s) return s.error();
  constexpr std::size_t kStages = 4;
  context.report("terrain", 0, kStages);
  const Grid grid(dem);
  GlbScene scene;
  scene.generator = "ivis generate terrain";
  scene.copyright = options.copyright;
  scene.materials = {{"ground", {0.30F, 0.28F, 0.20F, 1}},
                     {"bark", {0.20F, 0.13F, 0.08F, 1}},
                     {"needle", {0.06F, 0.19F, 0.08F, kCrown}, GlbAlpha::kBlend},
                     {"leaf", {0.13F, 0.30F, 0.07F, kCrown}, GlbAlpha::kBlend}};
  const std::size_t side = options.tile_cells;
  const std::size_t tiles_x = (grid.cells_x() + side - 1) / side;
  const std::size_t tiles_z = (grid.cells_z() + side - 1) / side;
  constexpr std::uint32_t kUnused = 0xffffffffU;
  std::vector<std::uint32_t> number((side + 1) * (side + 1));
  for (std::size_t tk = 0; tk < tiles_z; ++tk) {
    if (context.stopped()) return cancelled();
    for (std::size_t ti = 0; ti < tiles_x; ++ti) {
      const std::size_t i0 = ti * side;
      const std::size_t k0 = tk * side;
      std::fill(number.begin(), number.end(), kUnused);
      GlbPrimitive p;
      p.material = kGround;
      const auto vertex = [&](std::size_t i, std::size_t k) {
        std::uint32_t& n = number[(k - k0) * (side + 1) + (i - i0)];
        if (n == kUnused) {
          n = static_cast<std::uint32_t>(p.positions.size());
          p.positions.push_back(grid.vertex(i, k));
        }
        return n;
      };
      for (std::size_t k = k0; k < std::min(k0 + side, grid.cells_z()); ++k)
        for (std::size_t i = i0; i < std::min(i0 + side, grid.cells_x()); ++i) {
          if (!grid.whole(i, k)) continue;
          const std::uint32_t a = vertex(i, k);
          const std::uint32_t b = vertex(i + 1, k);
          const std::uint32_t c = vertex(i, k + 1);
          const std::uint32_t d = vertex(i + 1, k + 1);
          p.indices.insert(p.indices.end(), {a, d, b, a, c, d});  // winding: up
        }
      if (p.indices.empty()) continue;
      GlbNode node;
      node.name = "terrain_" + std::to_string(ti) + "_" + std::to_string(tk);
      node.mesh = static_cast<std::uint32_t>(scene.meshes.size());
      scene.meshes.push_back({node.name, {std::move(p)}});
      scene.nodes.push_back(std::move(node));
    }
  }
  if (scene.nodes.empty())
    return invalid_argument("generate terrain: no cell of " + std::to_string(grid.cells_x()) +
                            " x " + std::to_string(grid.cells_z()) +
                            " has heights at all four corners");
  context.report("terrain", 1, kStages);

  const std::size_t ground_triangles = scene.triangle_count();
  const GlbMesh shapes[2] = {conifer(false), leafy(false)};
  std::size_t wanted = options.trees;
  if (wanted == 0 && options.triangles > ground_triangles)
    wanted = (options.triangles - ground_triangles) /
             ((shapes[0].triangles() + shapes[1].triangles()) / 2);
  const auto first_mesh = static_cast<std::uint32_t>(scene.meshes.size());
  const std::vector<Grid::Place> trees = plant(grid, wanted, options.seed);
  if (context.stopped()) return cancelled();
  if (!trees.empty()) {
    for (const bool far : {false, true}) {
      scene.meshes.push_back(conifer(far));
      scene.meshes.push_back(leafy(far));
    }
    std::vector<std::vector<GlbInstance>> by_tile(2 * tiles_x * tiles_z);
    Random random(options.seed, kTrees + 100);
    for (const Grid::Place& t : trees) {
      const Vec2 p = grid.position(t.i, t.k, t.f);
      GlbInstance instance;
      instance.translation = {p.x, grid.height(t.i, t.k, t.f), p.y};
      // A turn about the vertical by square roots alone: the same bits everywhere.
      const double a = random.in(-1, 1);
      instance.rotation = {0, a, 0, std::sqrt(1 - a * a)};
      const double size = random.in(6, 22);
      instance.scale = {size, size, size};
      const std::size_t tile = (t.k / side) * tiles_x + t.i / side;
      by_tile[2 * tile + (random.chance(0.6) ? 0 : 1)].push_back(instance);
    }
    for (std::size_t b = 0; b < by_tile.size(); ++b) {
      if (by_tile[b].empty()) continue;
      GlbNode node;
      node.name = std::string(b % 2 == 0 ? "conifers_" : "leafy_") +
                  std::to_string(b / 2 % tiles_x) + "_" + std::to_string(b / 2 / tiles_x);
      node.mesh = first_mesh + static_cast<std::uint32_t>(b % 2);
      node.far_mesh = node.mesh + 2;
      node.tag = OccluderTag::kNever;
      node.instances = std::move(by_tile[b]);
      scene.nodes.push_back(std::move(node));
    }
  }
  context.report("terrain", 2, kStages);

  GeneratedScene out;
  out.objects = scene.object_count();
  out.triangles = scene.triangle_count();
  auto path = flyover(dem, options.seed, options.path, context);
  if (!path) return path.error();
  out.path = std::move(*path);
  context.report("terrain", 3, kStages);
  auto glb = write_glb(scene);
  if (!glb) return glb.error();
  out.glb = std::move(*glb);
  context.report("terrain", kStages, kStages);
  return out;
}

Result<std::vector<Pose>> flyover(const Dem& dem, std::uint64_t seed, const FlyoverOptions& options,
                                  const Context& context) {
  if (auto s = check(dem, {}); !s) return s.error();
  if (auto s = check(options); !s) return s.error();
  const Grid grid(dem);
  const std::vector<float> free = clearance(grid);
  const double cell = std::min(dem.step_m.x, dem.step_m.y);
  const auto room = [&](const Vec2& p) {
    const auto at = grid.place(p);
    return at ? static_cast<double>(free[at->k * grid.cells_x() + at->i]) * cell : -1.0;
  };
  const auto widest =
      static_cast<std::size_t>(std::max_element(free.begin(), free.end()) - free.begin());
  if (free[widest] <= 0) return invalid_argument("flyover: no whole cell to fly over");
  const double most = static_cast<double>(free[widest]) * cell;
  Vec2 p = grid.position(widest % grid.cells_x(), widest / grid.cells_x(), {0.5, 0.5});

  // Of three curves ahead the one is flown that keeps most room, straight on where there is plenty;
  // a random liking for left or right, changed now and then, keeps the flight from repeating
  // itself.
  Random random(seed, 0xf17);
  const double radius = std::clamp(most, 4 * options.step_m, 1500.0);
  const double look = 2 * radius;
  const double plenty = std::min(most / 3, 400.0);
  constexpr int kProbes = 12;
  const auto turned = [](const Vec2& h, double by) {  // by << 1; without a sine
    return glm::normalize(h + by * Vec2{-h.y, h.x});
  };
  Vec2 heading = glm::normalize(Vec2{random.in(-1, 1) + 1e-3, random.in(-1, 1)});
  double liking = 0;
  double until = 0;
  std::vector<Vec2> places;
  std::vector<Vec2> headings;
  for (std::size_t n = 0; n < options.poses; ++n) {
    if (n % 1024 == 0 && context.stopped()) return cancelled();
    places.push_back(p);
    headings.push_back(heading);
    const double walked = static_cast<double>(n) * options.step_m;
    if (walked >= until) {
      liking = static_cast<double>(random.below(3)) - 1;
      until = walked + random.in(1, 4) * radius;
    }
    double best = -1e300;
    double best_turn = 0;
    for (const double turn : {0.0, 1.0, -1.0}) {
      double least = plenty;
      Vec2 q = p;
      Vec2 h = heading;
      for (int s = 0; s < kProbes; ++s) {
        const double d = look / kProbes;
        h = turned(h, turn * d / radius);
        q += h * d;
        least = std::min(least, room(q) + (room(q) < 0 ? -1e3 * (kProbes - s) : 0));
      }
      const double score = least + (turn == liking ? 0.1 * plenty : 0);
      if (score > best) {
        best = score;
        best_turn = turn;
      }
    }
    heading = turned(heading, best_turn * options.step_m / radius);
    Vec2 next = p + heading * options.step_m;
    for (int tries = 0; room(next) <= 0 && tries < 64; ++tries) {  // cornered: turn on the spot
      heading = turned(heading, 0.3);
      next = p + heading * options.step_m;
    }
    if (room(next) > 0) p = next;
  }

  // Highest ground within reach of each pose, then the mean of that.
  const std::size_t n = places.size();
  std::vector<double> under(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = grid.place(places[i]);
    under[i] = grid.height(at->i, at->k, at->f);
  }
  const auto span = static_cast<std::size_t>(options.smooth_m / options.step_m);
  std::vector<double> highest(n);
  std::vector<double> sum(n + 1, 0);
  const auto first = [&](std::size_t i) { return i > span ? i - span : 0; };
  const auto last = [&](std::size_t i) { return std::min(i + span, n - 1); };
  for (std::size_t i = 0; i < n; ++i) {
    if (i % 1024 == 0 && context.stopped()) return cancelled();
    highest[i] = *std::max_element(under.begin() + static_cast<std::ptrdiff_t>(first(i)),
                                   under.begin() + static_cast<std::ptrdiff_t>(last(i)) + 1);
  }
  for (std::size_t i = 0; i < n; ++i)
    sum[i + 1] = sum[i] + highest[i];
  std::vector<Pose> poses(n);
  for (std::size_t i = 0; i < n; ++i) {
    Pose& pose = poses[i];
    pose.t = static_cast<double>(i) * options.step_m / options.speed_m_s;
    const double mean =
        (sum[last(i) + 1] - sum[first(i)]) / static_cast<double>(last(i) + 1 - first(i));
    // Each of the maxima averaged reaches as far as pose i, so none lies below its ground.
    pose.eye = {places[i].x, std::max(mean, under[i]) + options.height_m, places[i].y};
    pose.yaw_deg = std::atan2(-headings[i].y, headings[i].x) * 57.29577951308232;
  }
  return poses;
}

}  // namespace ivis
