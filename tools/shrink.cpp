#include "occluders/shrink.h"

#include <iostream>
#include <memory>

#ifdef IVIS_HAVE_CGAL
#include "occluders/exact/exact_erosion.h"
#endif
#include "occluders/fast_erosion.h"
#include "occluders/file.h"
#include "occluders/nef_worker.h"
#include "tools/common.h"
#include "tools/shrink_report.h"

namespace ivis::tool {
namespace {

struct ShrinkArgs {
  SceneArgs scene;
  ViewSpaceArgs space;
  std::string reach;
  std::string builder = "fast";
  std::filesystem::path out;
  std::filesystem::path report;
  unsigned threads = 0;
  double voxel_m = 0;
  double polyhedron_s = 0;
  bool json = false;
};

Result<std::unique_ptr<Eroder>> make_eroder(const std::string& builder) {
  if (builder == "fast") return std::unique_ptr<Eroder>(std::make_unique<FastEroder>());
#ifdef IVIS_HAVE_CGAL
  return std::unique_ptr<Eroder>(std::make_unique<ExactEroder>());
#else
  return invalid_argument(
      "--builder exact: this ivis is built without CGAL; build it with "
      "-DIVIS_WITH_CGAL=ON, or use --builder fast");
#endif
}

Outcome run_shrink(const ShrinkArgs& args) {
  const auto reach = Reach::parse(args.reach);
  if (!reach) return reach.error();
  if (auto s = check_output_file(args.out); !s) return s.error();
  if (!args.report.empty())
    if (auto s = check_output_folder(args.report); !s) return s.error();
  Context context = make_context(args.json);
  context.threads = args.threads;
  ShrinkOptions options;
  options.reach = *reach;
  const auto space = args.space.read();
  if (!space) return space.error();
  options.view_space = *space;
  options.voxel_m = args.voxel_m;
  options.fates = !args.report.empty();
  if (args.polyhedron_s > 0) {
    options.polyhedra.worker = nef_worker_beside_this();
    options.polyhedra.seconds = args.polyhedron_s;
    if (options.polyhedra.worker.empty())
      return invalid_argument(
          "--polyhedra: there is no program ivis_nef beside this one; build it "
          "with -DIVIS_WITH_CGAL=ON");
  }
  auto eroder = make_eroder(args.builder);
  if (!eroder) return eroder.error();
  const auto scene = args.scene.load(context);
  if (!scene) return scene.error();
  const auto shrunk = shrink(*scene, options, **eroder, context);
  if (!shrunk) return shrunk.error();
  if (auto s = write_occluders(args.out, shrunk->set); !s) return s.error();
  if (!args.report.empty())
    if (auto s = write_shrink_report(args.report, *scene, *shrunk); !s) return s.error();
  if (shrunk->set.shrunk.empty() && shrunk->set.solid_pieces.empty() &&
      shrunk->set.sheets.empty() && shrunk->set.height_field.empty())
    std::cerr << "warning: no occluder is left for this reach: every PVS will list everything\n";
  const ShrinkReport& r = shrunk->report;
  if (args.json) {
    Json left_out = Json::object();
    for (const auto& [reason, count] : r.left_out)
      left_out[reason] = count;
    Json out{{"occluders_in", r.occluders_in},
             {"occluders_out", r.occluders_out},
             {"left_out", left_out},
             {"volume_kept", r.volume_kept()},
             {"seconds", r.seconds},
             {"parts",
              {{"convex_solids", r.convex_solids},
               {"convex_pieces", r.convex_pieces},
               {"prism_pieces", shrunk->set.prism_pieces.size()},
               {"solid_pieces", shrunk->set.solid_pieces.size()},
               {"polyhedra", r.polyhedra},
               {"polyhedra_shrunk", r.polyhedra_shrunk},
               {"sheet_planes", r.sheet_planes},
               {"sheet_tiles", r.sheet_tiles},
               {"sheet_faces", r.sheet_faces},
               {"sheet_seconds", r.sheet_seconds},
               {"height_field_cells", shrunk->set.height_field.heights.size()}}}};
    if (r.voxels) {
      const VoxelReport& v = *r.voxels;
      Json leaks = Json::array();
      for (const auto& l : v.leaks)
        leaks.push_back(
            {{"where", to_json(l.where)}, {"volume_m3", l.volume_m3}, {"by_ray", l.by_ray}});
      out["voxels"] = {{"cell_m", v.cell_m},
                       {"marked", v.marked},
                       {"reached", v.reached},
                       {"solid_m3", v.solid_m3},
                       {"components", v.components},
                       {"too_thin", v.thin},
                       {"proven", v.proven},
                       {"by_evidence", v.by_evidence},
                       {"leaking", v.leaking},
                       {"leaks", leaks},
                       {"rays", v.rays},
                       {"seeds_moved", v.seeds_moved},
                       {"seeds_unclear", v.seeds_unclear},
                       {"kept_m3", v.kept_m3},
                       {"faces", v.faces},
                       {"pieces", v.pieces},
                       {"closed_boxes", v.closed_boxes},
                       {"peak_bytes", v.peak_bytes},
                       {"seconds", v.seconds}};
    }
    print(out);
    return kOk;
  }
  std::cout << r.occluders_in << " objects -> " << r.occluders_out << " shrunk prisms in "
            << r.seconds << " s (" << (*eroder)->name() << " builder), " << 100 * r.volume_kept()
            << " % of the solids' volume kept\n";
  if (r.convex_solids > 0)
    std::cout << "  " << r.convex_solids << " convex solids that are no prisms, " << r.convex_pieces
              << " of them thicker than the reach\n";
  if (r.polyhedra > 0)
    std::cout << "  " << r.polyhedra << " small polyhedra, " << r.polyhedra_shrunk
              << " of them thicker than the reach\n";
  if (r.sheet_tiles > 0)
    std::cout << "  " << r.sheet_tiles << " sheets in " << r.sheet_planes << " planes, "
              << r.sheet_faces << " faces in all levels, in " << r.sheet_seconds << " s\n";
  for (const auto& [reason, count] : r.left_out)
    std::cout << "  not taken: " << count << "  " << reason << '\n';
  if (r.voxels) std::cout << to_text(*r.voxels);
  std::cout << "written: " << args.out.string() << '\n';
  if (!args.report.empty())
    std::cout << "written: " << (args.report / "report.txt").string()
              << ", report.json, report.svg\n";
  return kOk;
}

}  // namespace

void add_shrink(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand(
      "shrink", "shrink a scene's occluders by a reach and write them to a file");
  auto args = std::make_shared<ShrinkArgs>();
  args->scene.add_to(*sub);
  args->space.add_to(*sub);
  sub->add_option("--reach", args->reach,
                  "ball:r | disc:r | cylinder:r,h | ellipsoid:a,b,c | box:a,b,c, metres")
      ->required()
      ->type_name("R");
  sub->add_option("-o,--output", args->out, "occluder file to write")
      ->required()
      ->type_name("F.ivo");
  sub->add_option("--builder", args->builder,
                  "fast: edge capsules; exact: CGAL Minkowski sums, slow")
      ->capture_default_str()
      ->check(CLI::IsMember({"fast", "exact"}));
  sub->add_option("--voxels", args->voxel_m,
                  "also take as solid whatever observers cannot get to, found with voxels of this "
                  "side, metres; 0: do not")
      ->type_name("SIZE_M")
      ->capture_default_str()
      ->check(number_within(0, 1e6));
  sub->add_option("--polyhedra", args->polyhedron_s,
                  "also shrink small closed solids that are neither prisms nor convex, by the "
                  "program ivis_nef, which may work at each for so many seconds; 0: do not")
      ->type_name("SECONDS")
      ->capture_default_str()
      ->check(number_within(0, 3600));
  sub->add_option("--report", args->report,
                  "also write what became of each part: DIR/report.txt (a table), report.json, "
                  "report.svg (from above)")
      ->type_name("DIR");
  sub->add_option("--threads", args->threads, "0: as many as the machine has")
      ->capture_default_str()
      ->check(CLI::Range(0, 256));
  sub->add_flag("--json", args->json, "print JSON");
  sub->callback([&action, args] { action = [args] { return run_shrink(*args); }; });
}

}  // namespace ivis::tool
