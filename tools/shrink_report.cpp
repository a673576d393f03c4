#include "tools/shrink_report.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <vector>

#include "tools/common.h"
#include "tools/picture.h"

namespace ivis::tool {
namespace {

/// Rows of the table's lists of objects.
constexpr std::size_t kListed = 40;

const char* fate_of(const ObjectFate& f) {
  if (f.ground) return "ground";
  if (f.prisms + f.convex == 0) return "left out";
  if (f.vanished) return "thinner than the reach";
  return f.left_out.empty() ? "taken" : "taken in part";
}

std::string described(const Scene& scene, const Object& o) {
  const std::string& name = scene.name_of(o);
  return "node " + std::to_string(o.node) +
         (o.instance > 0 ? " instance " + std::to_string(o.instance) : "") +
         (name.empty() ? "" : " '" + name + "'");
}

bool marked_never(const ObjectFate& f) {
  return f.left_out.contains("marked never");
}

double size_of(const ObjectFate& f) {
  const Vec3 s = f.object->bounds.size();
  return s.x * s.y * s.z;
}

std::string table(const Scene& scene, const Shrunk& shrunk) {
  const ShrinkReport& r = shrunk.report;
  const OccluderSet& set = shrunk.set;
  std::ostringstream out;
  std::map<std::string, std::size_t> fates;
  for (const ObjectFate& f : r.objects)
    ++fates[fate_of(f)];
  out << "Occluders shrunk by " << set.reach.to_string() << "\n\nobjects, by what became of them\n";
  for (const auto& [fate, count] : fates)
    out << std::setw(10) << count << "  " << fate << '\n';
  out << "\nwhat was made\n"
      << std::setw(10) << set.solids.size() << "  prisms found, fused and shrunk to "
      << set.shrunk.size() << ", " << std::round(1000 * r.volume_kept()) / 10
      << " % of the volume\n"
      << std::setw(10) << r.convex_solids << "  convex solids that are no prisms, "
      << r.convex_pieces << " of them thicker than the reach\n"
      << std::setw(10) << set.sheets.size() << "  sheets, in " << r.sheet_planes << " planes\n"
      << std::setw(10) << set.height_field.heights.size() << "  cells of a height field\n";
  out << "\nparts left out, by reason\n";
  if (r.left_out.empty()) out << "      none\n";
  for (const auto& [reason, count] : r.left_out)
    out << std::setw(10) << count << "  " << reason << '\n';
  if (r.voxels) out << '\n' << to_text(*r.voxels);

  const auto list = [&](const char* title, const auto& wanted) {
    std::vector<const ObjectFate*> found;
    for (const ObjectFate& f : r.objects)
      if (wanted(f)) found.push_back(&f);
    if (found.empty()) return;
    std::stable_sort(found.begin(), found.end(), [](const ObjectFate* a, const ObjectFate* b) {
      return size_of(*a) > size_of(*b);
    });
    out << '\n'
        << title << ": " << found.size()
        << (found.size() > kListed ? ", the largest first:\n" : ":\n");
    for (std::size_t i = 0; i < std::min(kListed, found.size()); ++i) {
      const ObjectFate& f = *found[i];
      const Vec3 size = f.object->bounds.size();
      const Vec3 at = f.object->bounds.centre();
      out << "  " << described(scene, *f.object) << std::fixed << std::setprecision(1) << ", "
          << size.x << " x " << size.y << " x " << size.z << " m at " << at.x << ',' << at.y << ','
          << at.z << std::defaultfloat;
      const char* between = ": ";
      for (const auto& [reason, count] : f.left_out) {
        out << between << count << ' ' << reason;
        between = ", ";
      }
      out << '\n';
    }
  };
  list("solid, but thinner than the reach",
       [](const ObjectFate& f) { return !f.ground && f.vanished; });
  list("left out, at least in part",
       [](const ObjectFate& f) { return !f.ground && !marked_never(f) && !f.left_out.empty(); });
  return out.str();
}

Json as_json(const Scene& scene, const Shrunk& shrunk) {
  const ShrinkReport& r = shrunk.report;
  Json objects = Json::array();
  for (const ObjectFate& f : r.objects) {
    const Object& o = *f.object;
    objects.push_back({{"node", o.node},
                       {"instance", o.instance},
                       {"name", scene.name_of(o)},
                       {"fate", fate_of(f)},
                       {"aabb", Json::array({to_json(o.bounds.lo), to_json(o.bounds.hi)})},
                       {"prisms", f.prisms},
                       {"convex_solids", f.convex},
                       {"volume_m3", f.volume},
                       {"left_out", f.left_out}});
  }
  Json j{{"reach", shrunk.set.reach.to_string()},
         {"volume_kept", r.volume_kept()},
         {"left_out", r.left_out},
         {"objects", objects}};
  if (r.voxels) {
    Json leaks = Json::array();
    for (const auto& l : r.voxels->leaks)
      leaks.push_back(
          {{"where", to_json(l.where)}, {"volume_m3", l.volume_m3}, {"by_ray", l.by_ray}});
    j["leaks"] = leaks;
  }
  return j;
}

std::string picture(const Scene& scene, const Shrunk& shrunk) {
  const ShrinkReport& r = shrunk.report;
  Aabb all;
  for (const ObjectFate& f : r.objects)
    all.add(f.object->bounds);
  if (all.empty()) all.add(Vec3{0});
  const Vec3 size = all.size();
  Picture p(ground(all.centre()), std::max({size.x, size.z, 1.0}) * 0.51);
  std::ostringstream head;
  head << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << kPixels << "\" height=\""
       << kPixels + 60 << "\" viewBox=\"0 0 " << kPixels << ' ' << kPixels + 60
       << "\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n";
  p.raw(head.str());
  for (const ObjectFate& f : r.objects)
    if (f.ground) p.box(f.object->bounds, "fill=\"#eef0e6\"");
  std::size_t next = 0;
  for (const ObjectFate& f : r.objects) {
    if (f.prisms + f.convex == 0) {
      if (!f.ground && !marked_never(f))
        p.box(f.object->bounds, "fill=\"#e8a33d\" fill-opacity=\"0.8\"");
    } else if (f.prisms == 0) {
      p.box(f.object->bounds, f.vanished ? "fill=\"#d62828\" fill-opacity=\"0.7\""
                                         : "fill=\"#4a6a8a\" fill-opacity=\"0.7\"");
    }
    for (std::size_t k = 0; k < f.prisms; ++k)
      p.polygon(shrunk.set.solids[next++].footprint,
                f.vanished ? "fill=\"#d62828\" fill-opacity=\"0.7\""
                           : "fill=\"#c9b79c\" stroke=\"#6b5b45\" stroke-width=\"0.3\"");
  }
  for (const Prism& s : shrunk.set.shrunk)
    p.polygon(s.footprint, "fill=\"#4a4238\" fill-opacity=\"0.75\"");
  std::ostringstream tail;
  tail << "<g font-family=\"sans-serif\" font-size=\"17\" fill=\"#222\"><text x=\"12\" y=\""
       << kPixels + 24 << "\">" << scene.objects.size() << " objects from above, "
       << std::round(size.x) << " x " << std::round(size.z) << " m, shrunk by "
       << shrunk.set.reach.to_string() << "</text>\n<text x=\"12\" y=\"" << kPixels + 48
       << "\">tan: solids; dark: what is left; blue: convex, no prism; red: thinner than "
          "the reach; orange: boxes of what was left out (save 'never')</text></g>\n</svg>\n";
  p.raw(tail.str());
  return p.text();
}

}  // namespace

Status write_shrink_report(const std::filesystem::path& folder, const Scene& scene,
                           const Shrunk& shrunk) {
  std::error_code ec;
  std::filesystem::create_directories(folder, ec);
  if (ec) return io_error("cannot make folder '" + folder.string() + "': " + ec.message());
  if (auto s = write_file_whole(folder / "report.txt", table(scene, shrunk)); !s) return s;
  if (auto s = write_file_whole(
          folder / "report.json",
          as_json(scene, shrunk).dump(-1, ' ', false, Json::error_handler_t::replace) + '\n');
      !s)
    return s;
  return write_file_whole(folder / "report.svg", picture(scene, shrunk));
}

}  // namespace ivis::tool
