#include "occluders/add_polyhedra.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>

#include "core/view_cell.h"
#include "occluders/closed_mesh.h"
#include "occluders/convex.h"
#include "occluders/nef_worker.h"
#include "occluders/progress.h"

namespace ivis {
namespace {

constexpr double kMostTaken = 0.5;  ///< a stack of prisms hides nearly as much, and takes no time

struct Candidate {
  const Object* object = nullptr;
  Polyhedron solid;
  std::optional<Result<ShrunkPolyhedron>> made;
};

std::vector<Polyhedron> candidates(const Scene& scene, const Object& object, std::size_t most) {
  std::vector<Polyhedron> found;
  if (object.tag == OccluderTag::kNever || object.always_visible) return found;
  // Parity is not winding: what self-crossing one-sided surfaces enclose may be entered unseen.
  const auto& primitives = scene.mesh_of(object).primitives;
  if (scene.honour_sidedness && std::any_of(primitives.begin(), primitives.end(),
                                            [](const Primitive& p) { return !p.double_sided; }))
    return found;
  const WeldedMesh mesh = weld(scene, object);
  for (const MeshPiece& piece : mesh.pieces) {
    if (!piece.closed || !piece.oriented || piece.triangles.size() > most ||
        !(volume(mesh, piece) > 0) || recognise_convex(mesh.points, piece.triangles))
      continue;
    Polyhedron solid;
    std::map<std::uint32_t, std::uint32_t> number;
    for (const auto& t : piece.triangles) {
      std::array<std::uint32_t, 3> own{};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [it, fresh] =
            number.try_emplace(t[k], static_cast<std::uint32_t>(solid.points.size()));
        if (fresh) solid.points.push_back(mesh.points[t[k]]);
        own[k] = it->second;
      }
      solid.triangles.push_back(own);
    }
    found.push_back(std::move(solid));
  }
  return found;
}

}  // namespace

Status add_polyhedra(const Scene& scene, const std::vector<const Object*>& objects,
                     const std::vector<bool>& skip, const std::vector<ObjectSolids>& prisms,
                     const ShrinkOptions& options, OccluderSet& set, ShrinkReport& report,
                     const Context& context) {
  const PolyhedronOptions& how = options.polyhedra;
  if (how.worker.empty() || !options.margins) return ok();
  std::vector<Candidate> all;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    if (context.stopped()) return cancelled();
    if (skip[i] || volume_taken(prisms[i]) > kMostTaken * prisms[i].volume) continue;
    for (Polyhedron& solid : candidates(scene, *objects[i], how.most_triangles))
      all.push_back({objects[i], std::move(solid), {}});
  }
  const Vec3 half = padded(options.reach, set.slack_m).half_extents();
  {
    Progress progress(context, "polyhedra", all.size());
    parallel_for(context, all.size(), [&](std::size_t i) {
      all[i].made =
          shrink_polyhedron(how.worker, all[i].solid, half, set.margins_m, how.seconds, context);
      progress.step();
    });
  }
  if (context.stopped()) return cancelled();
  report.polyhedra = all.size();
  for (Candidate& c : all) {
    Result<ShrunkPolyhedron>& made = *c.made;
    if (!made && made.error().code == ErrorCode::kIo) return made.error();
    if (!made) {
      ++report.left_out["polyhedron: " + made.error().message];
      continue;
    }
    if (made->failed_check) ++report.left_out["polyhedron: failed distance check"];
    if (made->levels.empty() && !made->failed_check)
      ++report.left_out["polyhedron: too thin for the reach"];
    if (made->levels.empty()) continue;  // nothing is drawn, so nobody need know of eyes in it
    for (const ConvexSolid& part : made->parts)
      for (std::size_t s = 0; s < options.view_space.seeds.size(); ++s)
        if (part.bounds.contains(options.view_space.seeds[s]) &&
            contains(part, options.view_space.seeds[s]))
          return invalid_argument("view space seed " + std::to_string(s) +
                                  " lies inside the solid of node " +
                                  std::to_string(c.object->node));
    set.convex_solids.insert(set.convex_solids.end(), made->parts.begin(), made->parts.end());
    ++report.polyhedra_shrunk;
    SolidPiece piece;
    piece.levels = std::move(made->levels);
    set.solid_pieces.push_back(std::move(piece));
  }
  return ok();
}

}  // namespace ivis
