#include "occluders/add_convex.h"

#include <algorithm>
#include <chrono>

#include "core/view_cell.h"
#include "occluders/backing.h"
#include "occluders/convex.h"
#include "occluders/progress.h"
#include "occluders/sheets.h"

namespace ivis {
namespace {

bool taken_whole(const ObjectSolids& found) {
  return found.left_out.empty() && !found.prisms.empty() &&
         volume_taken(found) >= found.volume * (1 - 1e-6);
}

// In towns what is convex is mostly a prism and thick, and hides better as a solid. In rooms walls
// are thin and what the file marks as matter is cut at all angles.
bool sheets_promise_gain(const std::vector<ConvexPiece>& pieces, const ViewSpace& space) {
  if (space.kind == ViewSpace::Kind::kInside) return true;
  std::size_t only = 0;
  std::size_t odd = 0;
  for (const ConvexPiece& p : pieces) {
    only += p.only ? 1 : 0;
    odd += p.only && !p.upright_prism ? 1 : 0;
  }
  return only > 0 && only * 2 >= pieces.size() && odd * 4 >= only;
}

}  // namespace

Status add_convex_and_sheets(const Scene& scene, const std::vector<const Object*>& objects,
                             const std::vector<bool>& skip, const ShrinkOptions& options,
                             const Context& context, std::vector<ObjectSolids>& prisms,
                             OccluderSet& set, ShrinkReport& report,
                             std::vector<ObjectFate>& fates) {
  const bool maybe_sheets =
      options.sheets == SheetUse::kOn ||
      (options.sheets == SheetUse::kAuto &&
       (options.view_space.kind == ViewSpace::Kind::kInside || !scene.hidden_solids.empty()));
  std::vector<ObjectConvex> found(objects.size());
  {
    Progress progress(context, "convex solids", objects.size());
    parallel_for(context, objects.size(), [&](std::size_t i) {
      if (!skip[i] && (maybe_sheets || !taken_whole(prisms[i])))
        found[i] = extract_convex(scene, *objects[i]);
      progress.step();
    });
  }
  if (context.stopped()) return cancelled();

  const Reach reach = padded(options.reach, set.slack_m);
  std::vector<ConvexPiece> pieces;
  std::vector<ConvexSolid> odd;
  std::vector<std::size_t> odd_of;  // index into objects
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i].pieces.empty() && found[i].left_out.empty()) {
      prisms[i].left_out.erase("open mesh");
      prisms[i].left_out.erase("inside out");
      prisms[i].left_out.erase("too thin or too sloped for a prism");
    }
    for (ConvexPiece& piece : found[i].pieces) {
      if (!piece.upright_prism || prisms[i].prisms.empty()) {
        for (std::size_t s = 0; s < options.view_space.seeds.size(); ++s)
          if (contains(piece.solid, options.view_space.seeds[s])) {
            const std::string& name = scene.name_of(*objects[i]);
            return invalid_argument(
                "view space seed " + std::to_string(s) + " lies inside the solid of node " +
                std::to_string(objects[i]->node) + (name.empty() ? "" : " '" + name + "'"));
          }
        odd.push_back(piece.solid);
        odd_of.push_back(i);
      }
      pieces.push_back(std::move(piece));
    }
  }
  std::vector<SolidPiece> shrunk(odd.size());
  if (options.margins) {
    const SceneSupport support(scene);
    const auto floor = common_floor(odd, support);
    parallel_for(context, odd.size(), [&](std::size_t k) {
      shrunk[k] = shrink_convex(odd[k], reach, set.margins_m, &support, floor);
    });
  }
  if (!fates.empty())
    for (std::size_t k = 0; k < odd.size(); ++k) {
      ObjectFate& fate = fates[odd_of[k]];
      ++fate.convex;
      // Until a part is seen to be left; what the prisms leave is told later.
      fate.vanished = (fate.convex == 1 || fate.vanished) && shrunk[k].levels.empty() &&
                      shrunk[k].floored_levels.empty();
    }
  for (SolidPiece& piece : shrunk)
    if (!piece.levels.empty() || !piece.floored_levels.empty())
      set.solid_pieces.push_back(std::move(piece));
  report.convex_solids += odd.size();
  report.convex_pieces += set.solid_pieces.size();
  std::move(odd.begin(), odd.end(), std::back_inserter(set.convex_solids));
  if (context.stopped()) return cancelled();

  set.backings = find_backings(scene, pieces, context);
  if (context.stopped()) return cancelled();

  if (!options.margins || options.sheets == SheetUse::kOff ||
      (options.sheets == SheetUse::kAuto && !sheets_promise_gain(pieces, options.view_space)))
    return ok();
  const auto start = std::chrono::steady_clock::now();
  SheetOptions sheet_options;
  sheet_options.radii_m = sheet_radii(largest_move(options.reach, set.slack_m));
  SheetReport sheets;
  set.sheets = build_sheets(pieces, sheet_options, context, sheets);
  if (context.stopped()) return cancelled();
  set.sheet_radii_m = sheet_options.radii_m;
  report.sheet_planes = sheets.planes;
  report.sheet_tiles = set.sheets.size();
  report.sheet_faces = sheets.faces;
  for (const auto& [reason, count] : sheets.left_out)
    report.left_out["sheets: " + reason] += count;
  report.sheet_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return ok();
}

}  // namespace ivis
