#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <numbers>
#include <sstream>

#include "tools/common.h"
#include "tools/picture.h"

namespace ivis::tool {
namespace {

struct DrawArgs {
  SceneArgs scene;
  SolveArgs solve;
  std::string eye;
  std::filesystem::path out;
  double radius = 250;
};

/// What lies before the first shrunk wall that rises above the eye, all round: the lit part of the
/// ground plane.
Polygon lit(const OccluderSet& set, const Vec3& apex, double far) {
  constexpr int kRays = 2880;
  std::vector<double> reach(kRays, far);
  const Vec2 eye = ground(apex);
  for (const Prism& prism : set.shrunk) {
    if (prism.top <= apex.y) continue;
    for (const auto& ring : prism.footprint.rings)
      for (std::size_t i = 0; i < ring.size(); ++i) {
        const Vec2 a = ring[i] - eye;
        const Vec2 b = ring[(i + 1) % ring.size()] - eye;
        if (std::min(glm::length(a), glm::length(b)) > 3 * far) continue;
        double from = std::atan2(a.y, a.x);
        double to = std::atan2(b.y, b.x);
        if (to < from) std::swap(from, to);
        if (to - from > std::numbers::pi) {
          const double old = from;
          from = to;
          to = old + 2 * std::numbers::pi;
        }
        const double step = 2 * std::numbers::pi / kRays;
        for (auto k = static_cast<int>(std::ceil(from / step)); k * step <= to; ++k) {
          const Vec2 d{std::cos(k * step), std::sin(k * step)};
          const double cross = d.x * (b.y - a.y) - d.y * (b.x - a.x);
          if (cross == 0) continue;
          const double t = (a.x * (b.y - a.y) - a.y * (b.x - a.x)) / cross;
          auto& r = reach[static_cast<std::size_t>((k % kRays + kRays) % kRays)];
          if (t > 0) r = std::min(r, t);
        }
      }
  }
  Polygon polygon{{{}}};
  for (int k = 0; k < kRays; ++k) {
    const double angle = 2 * std::numbers::pi * k / kRays;
    polygon.rings[0].push_back(eye + reach[static_cast<std::size_t>(k)] *
                                         Vec2{std::cos(angle), std::sin(angle)});
  }
  return polygon;
}

Outcome draw(const DrawArgs& args) {
  if (args.out.extension() != ".svg")
    return invalid_argument("'" + args.out.string() +
                            "': pictures are SVG, expected a name that ends in .svg");
  const auto reach = args.solve.parse_reach();
  if (!reach) return reach.error();
  if (args.solve.selection != "conservative")
    return invalid_argument("--selection " + args.solve.selection +
                            " goes by the last pose: a picture has one only");
  const auto eye = parse_point(args.eye);
  if (!eye) return eye.error();
  if (auto s = check_output_file(args.out); !s) return s.error();
  const auto prepared = prepare(args.scene, args.solve, *reach, make_context(false));
  if (!prepared) return prepared.error();
  const auto& [scene, occluders, method] = **prepared;
  const auto pvs = method->solve({*eye, *reach});
  if (!pvs) return pvs.error();

  Picture picture(ground(*eye), args.radius);
  std::ostringstream head;
  head << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << kPixels << "\" height=\""
       << kPixels + 60 << "\" viewBox=\"0 0 " << kPixels << ' ' << kPixels + 60
       << "\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n<svg width=\"" << kPixels
       << "\" height=\"" << kPixels
       << "\">\n<rect width=\"100%\" height=\"100%\" fill=\"#8d93a8\"/>\n";
  picture.raw(head.str());
  const Vec3 apex = *eye + Vec3{0, padded(*reach, occluders.slack_m).half_extents().y, 0};
  picture.polygon(lit(occluders, apex, 4 * args.radius), "fill=\"#f4f1e6\"");
  for (const Prism& p : occluders.solids)
    if (picture.sees(p.bounds()))
      picture.polygon(
          p.footprint,
          "fill=\"#c9b79c\" fill-opacity=\"0.8\" stroke=\"#6b5b45\" stroke-width=\"0.6\"");
  for (const Prism& p : occluders.shrunk)
    if (picture.sees(p.bounds()))
      picture.polygon(p.footprint, "fill=\"#4a4238\" fill-opacity=\"0.75\"");
  std::size_t drawn = 0;
  for (const ObjectId id : pvs->objects) {
    const Object& o = scene.objects[id];
    if (!picture.sees(o.bounds)) continue;
    const Vec3 size = o.bounds.size();
    const bool large = std::max(size.x, size.z) > 8;
    picture.box(o.bounds, large ? "fill=\"none\" stroke=\"#1f7a3d\" stroke-width=\"0.8\""
                                : "fill=\"#1f9a4d\"");
    ++drawn;
  }
  std::ostringstream tail;
  const Vec3 half = reach->half_extents();
  const double c = kPixels / 2;
  tail << "<ellipse cx=\"" << c << "\" cy=\"" << c << "\" rx=\""
       << std::max(half.x * picture.scale(), 1.0) << "\" ry=\""
       << std::max(half.z * picture.scale(), 1.0)
       << "\" fill=\"none\" stroke=\"#d62828\" stroke-width=\"1.5\"/>\n<circle cx=\"" << c
       << "\" cy=\"" << c << "\" r=\"2.5\" fill=\"#d62828\"/>\n</svg>\n"
       << "<g font-family=\"sans-serif\" font-size=\"17\" fill=\"#222\"><text x=\"12\" y=\""
       << kPixels + 24 << "\">" << pvs->objects.size() << " of " << scene.objects.size()
       << " objects can be seen from " << reach->to_string() << " about the red dot (" << drawn
       << " of them in this picture, " << 2 * args.radius << " m wide)</text>\n<text x=\"12\" y=\""
       << kPixels + 48
       << "\">tan: occluders; dark: shrunk occluders; grey-blue: shadow at eye height; green: the "
          "PVS (outlines: large objects)</text></g>\n</svg>\n";
  picture.raw(tail.str());
  if (auto s = write_file_whole(args.out, picture.text()); !s) return s.error();
  std::cout << "written: " << args.out.string() << '\n';
  return kOk;
}

}  // namespace

void add_draw(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand(
      "draw", "a picture (SVG) from above of one pose: occluders, shrunk occluders, shadow, PVS");
  auto args = std::make_shared<DrawArgs>();
  args->scene.add_to(*sub);
  args->solve.add_to(*sub, true);
  sub->add_option("--eye", args->eye, "the observer's eye")->required()->type_name("X,Y,Z");
  sub->add_option("-o,--output", args->out, "picture to write")->required()->type_name("OUT.svg");
  sub->add_option("--radius", args->radius, "metres shown each way from the eye")
      ->capture_default_str()
      ->check(number_within(1, 100000));
  sub->callback([&action, args] { action = [args] { return draw(*args); }; });
}

}  // namespace ivis::tool
