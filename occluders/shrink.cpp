#include "occluders/shrink.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "core/view_cell.h"
#include "occluders/add_convex.h"
#include "occluders/add_polyhedra.h"
#include "occluders/clip.h"
#include "occluders/fuse.h"
#include "occluders/ground.h"
#include "occluders/height_field.h"
#include "occluders/prism_ladder.h"
#include "occluders/prisms.h"
#include "occluders/progress.h"
#include "occluders/shrink_stack.h"
#include "occluders/wall_backing.h"

namespace ivis {
namespace {

std::string describe(const Scene& scene, const Object& o) {
  const std::string& name = scene.name_of(o);
  return "node " + std::to_string(o.node) + (name.empty() ? "" : " '" + name + "'");
}

std::string text(const Vec3& p) {
  return std::to_string(p.x) + "," + std::to_string(p.y) + "," + std::to_string(p.z);
}

/// What renderers' and maps' float positions, relative to the scene's centre, may be off by.
double slack_for(const Aabb& bounds) {
  if (bounds.empty()) return 0.001;
  const Vec3 half = bounds.size() * 0.5;
  const auto extent = static_cast<float>(std::max({half.x, half.y, half.z}));
  const double ulp =
      static_cast<double>(std::nextafter(extent, std::numeric_limits<float>::infinity())) -
      static_cast<double>(extent);
  return std::max(0.001, 4 * ulp);
}

/// Lowest y of all triangles, from the same products as the prisms' bases: those compare equal.
double lowest_y(const Scene& scene) {
  double floor = std::numeric_limits<double>::infinity();
  for (const auto* list : {&sources(scene), &scene.hidden_solids})
    for (const Object& o : *list) {
      if (o.bounds.lo.y > floor) continue;
      if (scene.mesh_of(o).triangles() == 0) floor = std::min(floor, o.bounds.lo.y);
      for (std::size_t t = 0; t < scene.mesh_of(o).triangles(); ++t) {
        const Triangle w = world_triangle(scene, o, t);
        floor = std::min({floor, w.a.y, w.b.y, w.c.y});
      }
    }
  return std::isfinite(floor) ? floor : 0;
}

}  // namespace

Result<Shrunk> shrink(const Scene& scene, const ShrinkOptions& options, const Eroder& eroder,
                      const Context& context) {
  const auto start = std::chrono::steady_clock::now();
  Shrunk result;
  OccluderSet& set = result.set;
  ShrinkReport& report = result.report;
  set.scene_hash = scene.hash;
  set.reach = options.reach;
  set.view_space = options.view_space;
  set.slack_m = slack_for(scene.bounds);
  set.floor = lowest_y(scene);
  if (options.margins)
    set.margins_m = options.margins_m.empty() ? default_margins(options.reach.half_extents().x)
                                              : options.margins_m;

  std::vector<const Object*> objects;
  for (const Object& o : sources(scene))
    objects.push_back(&o);
  for (const Object& o : scene.hidden_solids)
    objects.push_back(&o);
  report.occluders_in = objects.size();

  const std::optional<Ground> terrain = find_ground(scene, context);
  std::vector<bool> is_ground(objects.size(), false);  // by index into sources()
  if (terrain) {
    set.ground = terrain->rectangle();
    for (const std::uint32_t i : terrain->objects())
      is_ground[i] = true;
  }
  for (const std::uint32_t i : add_height_field(scene, set, context))
    is_ground[i] = true;

  std::vector<ObjectSolids> found(objects.size());
  {
    Progress progress(context, "prisms", objects.size());
    parallel_for(context, objects.size(), [&](std::size_t i) {
      if (is_ground[i]) {
        ++found[i].left_out["ground"];
      } else {
        found[i] = extract_prisms(scene, *objects[i]);
        for (Prism& p : found[i].prisms)
          p.grounded = terrain && terrain->covers_at_or_above(p.footprint, p.solid_bottom);
      }
      progress.step();
    });
  }
  if (context.stopped()) return cancelled();
  std::vector<ObjectFate>& fates = report.objects;
  if (options.fates) fates.resize(objects.size());
  if (Status s = add_convex_and_sheets(scene, objects, is_ground, options, context, found, set,
                                       report, fates);
      !s)
    return s.error();

  for (std::size_t i = 0; i < found.size(); ++i) {
    report.solid_volume += found[i].volume;
    for (const auto& [reason, count] : found[i].left_out)
      report.left_out[reason] += count;
    for (Prism& p : found[i].prisms) {
      const Aabb box = p.bounds();
      for (std::size_t s = 0; s < options.view_space.seeds.size(); ++s) {
        const Vec3& seed = options.view_space.seeds[s];
        if (box.contains(seed) && seed.y > p.bottom && seed.y < p.top &&
            contains(p.footprint, ground(seed)))
          return invalid_argument("view space seed " + std::to_string(s) + " (" + text(seed) +
                                  ") lies inside the solid of " + describe(scene, *objects[i]));
      }
      if (options.fates) ++fates[i].prisms;
      set.solids.push_back(std::move(p));
    }
    if (!options.fates) continue;
    fates[i].object = objects[i];
    fates[i].ground = is_ground[i];
    fates[i].volume = found[i].volume;
    fates[i].left_out = std::move(found[i].left_out);
  }

  for (const Backing& b : find_wall_backings(scene, set, context))
    set.backings.push_back(b);
  std::ranges::stable_sort(set.backings, {}, &Backing::object);
  if (context.stopped()) return cancelled();

  // After the walls: the convex parts that come of it are checked by nobody, and only tell of eyes.
  if (Status s = add_polyhedra(scene, objects, is_ground, found, options, set, report, context); !s)
    return s.error();

  const std::vector<FusedStack> stacks = fuse(set.solids, set.floor, {}, context);
  if (context.stopped()) return cancelled();

  const Reach grown = shrink_reach(set);
  std::vector<ShrunkStack> shrunk(stacks.size());
  {
    Progress progress(context, "eroding", stacks.size());
    parallel_for(context, stacks.size(), [&](std::size_t i) {
      shrunk[i] = shrink_stack(stacks[i], set, grown, eroder);
      progress.step();
    });
  }
  if (context.stopped()) return cancelled();
  std::vector<std::vector<std::vector<Polygon>>> eroded;
  for (ShrunkStack& s : shrunk) {
    report.kept_volume += s.volume;
    if (s.failed > 0) report.left_out["failed distance check"] += s.failed;
    if (s.thin > 0) report.left_out["too thin for the reach"] += s.thin;
    for (Prism& p : s.prisms)
      set.shrunk.push_back(std::move(p));
    eroded.push_back(std::move(s.eroded));
  }
  report.occluders_out = set.shrunk.size();
  if (options.fates) find_vanished(set, fates);

  if (options.margins) {
    const std::size_t failed = add_prism_ladder(stacks, eroded, grown, eroder, {}, set, context);
    if (failed > 0) report.left_out["failed distance check"] += failed;
    if (context.stopped()) return cancelled();
  }
  if (options.voxel_m > 0) {
    VoxelOptions voxel_options;
    voxel_options.cell_m = options.voxel_m;
    auto voxels = add_voxel_solids(scene, voxel_options, set, context);
    if (!voxels) return voxels.error();
    report.voxels = std::move(*voxels);
  }
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace ivis
