#include "tools/common.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <sstream>
#include <system_error>
#include <utility>

#include <unistd.h>

#include "occluders/fast_erosion.h"
#include "occluders/file.h"
#include "visibility/frustum_cull.h"
#ifdef IVIS_HAVE_GL
#include "visibility/gl/gl_occlusion_map.h"
#include "visibility/gl/gl_shadow_map.h"
#endif

namespace ivis::tool {
namespace {

std::atomic<bool> interrupted{false};

extern "C" void on_interrupt(int) {
  if (interrupted.exchange(true)) _exit(kInterrupted);  // the second Ctrl-C does not wait
}

}  // namespace

int exit_code(const Error& error) {
  switch (error.code) {
    case ErrorCode::kInvalidArgument:
      return kUsage;
    case ErrorCode::kInput:
    case ErrorCode::kIo:
    case ErrorCode::kMismatch:
    case ErrorCode::kUnsupported:
      return kBadInput;
    case ErrorCode::kConnection:
      return kNoConnection;
    case ErrorCode::kCancelled:
      return kInterrupted;
  }
  return kCheckFailed;
}

Context make_context(bool quiet) {
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  Context context;
  context.stop = &interrupted;
  if (quiet) return context;
  context.log = [](std::string_view line) { std::cerr << line << '\n'; };
  if (isatty(STDERR_FILENO) != 0) {
    context.progress = [](std::string_view stage, std::size_t done, std::size_t total) {
      constexpr std::size_t kWidth = 30;
      const std::size_t filled = total == 0 ? kWidth : std::min(kWidth, done * kWidth / total);
      std::cerr << '\r' << stage << " [" << std::string(filled, '#')
                << std::string(kWidth - filled, '.') << "] " << done << '/' << total << "\x1b[K"
                << (done >= total ? "\n" : "") << std::flush;
    };
  }
  return context;
}

// Names in a scene need not be UTF-8.
CLI::Validator number_within(double least, double most) {
  const auto check = [least, most](const std::string& text) -> std::string {
    double v = 0;
    const auto parsed = std::from_chars(text.data(), text.data() + text.size(), v);
    if (parsed.ec == std::errc{} && parsed.ptr == text.data() + text.size() && v >= least &&
        v <= most)
      return "";
    std::ostringstream wrong;
    wrong << "'" << text << "' is not a number from " << least << " to " << most;
    return wrong.str();
  };
  return CLI::Validator(check, "NUMBER");
}

void print(const Json& json) {
  std::cout << json.dump(-1, ' ', false, Json::error_handler_t::replace) << '\n';
}

Json to_json(const Vec3& v) {
  return Json::array({v.x, v.y, v.z});
}

Result<Vec3> parse_point(const std::string& text) {
  Vec3 p{0};
  const char* at = text.data();
  const char* end = text.data() + text.size();
  for (int i = 0; i < 3; ++i) {
    const auto parsed = std::from_chars(at, end, p[i]);
    const bool last = i == 2;
    if (parsed.ec != std::errc{} || !std::isfinite(p[i]) ||
        (last ? parsed.ptr != end : parsed.ptr == end || *parsed.ptr != ','))
      return invalid_argument("'" + text +
                              "' is not a point; expected X,Y,Z in metres, as in 10,1.7,-4.5");
    at = parsed.ptr + (last ? 0 : 1);
  }
  return p;
}

void SceneArgs::add_to(CLI::App& app, bool splits) {
  app.add_option("SCENE", file, "glTF scene, .glb or .gltf")->required();
  app.add_flag(
      "--honour-sidedness", honour_sidedness,
      "single-sided triangles do not block from behind (default: all block from both sides)");
  if (splits)
    app.add_option("--granularity", granularity,
                   "object: one object a node or instance; cluster: large meshes are split into "
                   "compact clusters of triangles")
        ->capture_default_str()
        ->check(CLI::IsMember({"object", "cluster"}));
}

bool SceneArgs::clustered() const {
  return granularity == granularity_name(Granularity::kCluster);
}

Result<Scene> SceneArgs::load(const Context& context) const {
  SceneOptions options;
  options.honour_sidedness = honour_sidedness;
  if (clustered()) options.granularity = Granularity::kCluster;
  auto scene = load_scene(file, options, context);
  if (scene)
    for (const std::string& w : scene->warnings)
      context.say("warning: " + w);
  return scene;
}

void ViewSpaceArgs::add_to(CLI::App& app) {
  auto* inside_option =
      app.add_option("--inside", inside, "a point X,Y,Z where observers are; may be given again")
          ->type_name("X,Y,Z")
          ->allow_extra_args(false);
  auto* path_option =
      app.add_option("--path", path, "CSV of poses (columns x,y,z) where observers are");
  auto* outside_option =
      app.add_flag("--outside", outside, "observers are outside every solid (default)");
  inside_option->excludes(path_option)->excludes(outside_option);
  path_option->excludes(outside_option);
}

Result<ViewSpace> ViewSpaceArgs::read() const {
  ViewSpace space;
  if (!inside.empty()) {
    space.kind = ViewSpace::Kind::kInside;
    for (const std::string& text : inside) {
      const auto p = parse_point(text);
      if (!p) return p.error();
      space.seeds.push_back(*p);
    }
  } else if (!path.empty()) {
    space.kind = ViewSpace::Kind::kInside;
    const auto poses = read_path(path);
    if (!poses) return poses.error();
    for (const Pose& pose : *poses)
      space.seeds.push_back(pose.eye);
  }
  return space;
}

void SolveArgs::add_to(CLI::App& app, bool reach_required) {
  auto* option = app.add_option("--reach", reach,
                                "how far the observer can get while an answer is in use: ball:r | "
                                "disc:r | cylinder:r,h | "
                                "ellipsoid:a,b,c | box:a,b,c (metres; h, a, b, c are half-extents)")
                     ->type_name("R");
  if (reach_required) option->required();
  std::string methods;
  for (const auto& t : method_list())
    methods += (methods.empty() ? "" : "; ") + t.name + ": " + t.summary;
  std::vector<std::string> names;
  for (const auto& t : method_list())
    names.push_back(t.name);
  app.add_option("--method", method, methods)
      ->capture_default_str()
      ->type_name("M")
      ->check(CLI::IsMember(names));
  app.add_option("--map", map, "sampling of the cull map")
      ->capture_default_str()
      ->check(CLI::IsMember({"polar", "orthographic"}));
  app.add_option("--backend", backend,
                 "what draws the occlusion map, or the orthographic cull map; auto: OpenGL where "
                 "hardware does "
                 "it, else the CPU")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "cpu", "gl"}));
  app.add_option("--occluders", occluders,
                 "shrunk occluders, made by 'ivis shrink' (default: shrink now)")
      ->type_name("F.ivo");
  app.add_option("--threads", threads, "threads of one solve; the result does not depend on it")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  app.add_option("--max-occluders", max_occluders,
                 "draw only the N occluders of largest projected area; 0: all that show")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--selection", selection,
                 "which occluders to draw, along a path: conservative: all that show; temporal: "
                 "those that showed at the last pose; two-pass: those that show past these")
      ->capture_default_str()
      ->check(CLI::IsMember({"conservative", "temporal", "two-pass"}));
  app.add_option("--map-pixels", map_pixels,
                 "pixels a side of the occlusion map's six faces, a multiple of 16 from 64 to "
                 "4096: more hide more and cost more "
                 "(default: 512, or 1024 for reaches below 0.5 m)")
      ->check(
          [](const std::string& text) -> std::string {
            std::string value = text;
            const std::string wrong = number_within(64, 4096)(value);
            if (!wrong.empty()) return wrong;
            return std::stod(text) == 16 * std::floor(std::stod(text) / 16)
                       ? ""
                       : "'" + text + "' is not a multiple of 16";
          },
          "PIXELS");
  app.add_option("--frustum", frustum,
                 "list only what can be in the picture, along a path with the same direction at "
                 "every pose: yaw,pitch,fov_x,fov_y,turn in degrees; yaw "
                 "0 looks along +X, 90 along -Z; full "
                 "angles of view; turn: how far the view may turn while an answer is in use")
      ->type_name("YAW,PITCH,FOV_X,FOV_Y,TURN");
  app.add_option("--reference-rays", rays, "aimed rays an object of the method 'reference'")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
}

Status check_input_file(const std::filesystem::path& file) {
  std::error_code ec;
  if (std::filesystem::is_directory(file, ec))
    return io_error("'" + file.string() + "' is a folder, expected a file");
  if (access(file.c_str(), R_OK) != 0)
    return io_error("cannot open '" + file.string() +
                    "': " + std::generic_category().message(errno));
  return ok();
}

Status check_output_file(const std::filesystem::path& file) {
  std::error_code ec;
  if (std::filesystem::is_directory(file, ec))
    return io_error("'" + file.string() + "' is a folder, expected the name of a file");
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  if (!std::filesystem::is_directory(folder, ec))
    return io_error("cannot write '" + file.string() + "': there is no folder '" + folder.string() +
                    "'");
  if (access(folder.c_str(), W_OK | X_OK) != 0)
    return io_error("cannot write '" + file.string() +
                    "': " + std::generic_category().message(errno));
  return ok();
}

Status check_output_folder(const std::filesystem::path& folder) {
  std::error_code ec;
  std::filesystem::path there = std::filesystem::absolute(folder, ec);
  while (!std::filesystem::exists(there, ec) && there.has_relative_path())
    there = there.parent_path();
  if (!std::filesystem::is_directory(there, ec))
    return io_error("cannot make folder '" + folder.string() + "': '" + there.string() +
                    "' is not a folder");
  if (access(there.c_str(), W_OK | X_OK) != 0)
    return io_error("cannot write into '" + folder.string() +
                    "': " + std::generic_category().message(errno));
  return ok();
}

Result<Reach> SolveArgs::parse_reach() const {
  return Reach::parse(reach);
}

Result<std::optional<Frustum>> SolveArgs::parse_frustum() const {
  if (frustum.empty()) return std::optional<Frustum>();
  const auto parsed = Frustum::parse(frustum);
  if (!parsed) return parsed.error();
  return std::optional<Frustum>(*parsed);
}

Status SolveArgs::check_files() const {
  return occluders.empty() ? ok() : check_input_file(occluders);
}

Result<OccluderSet> SolveArgs::get_occluders(const Scene& scene, const Reach& wanted,
                                             const Context& context) const {
  if (occluders.empty()) {
    ShrinkOptions options;
    options.reach = wanted;
    options.margins = method == "occlusion-map";  // nothing else draws them
    auto shrunk = shrink(scene, options, FastEroder{}, context);
    if (!shrunk) return shrunk.error();
    return std::move(shrunk->set);
  }
  auto set = read_occluders(occluders);
  if (!set) return set.error();
  if (auto s = check_occluders(*set, scene.hash, wanted, occluders.string()); !s) return s.error();
  return std::move(*set);
}

Result<std::unique_ptr<Method>> SolveArgs::make(const Scene& scene, const OccluderSet& set,
                                                const Context& context) const {
  MethodOptions options;
  options.map = map == "polar" ? CullMapKind::kPolar : CullMapKind::kOrthographic;
  options.threads = threads;
  options.max_occluders = max_occluders;
  options.selection = selection == "temporal"   ? Selection::kTemporal
                      : selection == "two-pass" ? Selection::kTwoPass
                                                : Selection::kConservative;
  options.map_pixels = map_pixels;
  options.rays = rays;
  options.backend = backend == "auto"  ? Backend::kAuto
                    : backend == "cpu" ? Backend::kCpu
                                       : Backend::kGl;
  options.log = context.log;
#ifdef IVIS_HAVE_GL
  options.make_gl = make_gl_occlusion_map;
  options.make_gl_shadows = make_gl_shadow_map;
#endif
  return make_method(method, scene, set, options);
}

Result<std::unique_ptr<Prepared>> prepare(const SceneArgs& scene, const SolveArgs& solve,
                                          const Reach& reach, const Context& context) {
  if (auto s = solve.check_files(); !s) return s.error();
  const auto frustum = solve.parse_frustum();
  if (!frustum) return frustum.error();
  auto prepared = std::make_unique<Prepared>();
  auto loaded = scene.load(context);
  if (!loaded) return loaded.error();
  prepared->scene = std::move(*loaded);
  auto set = solve.get_occluders(prepared->scene, reach, context);
  if (!set) return set.error();
  prepared->occluders = std::move(*set);
  auto method = solve.make(prepared->scene, prepared->occluders, context);
  if (!method) return method.error();
  prepared->method = std::move(*method);
  if (*frustum)
    prepared->method = cull_by_frustum(std::move(prepared->method), prepared->scene, **frustum,
                                       prepared->occluders.slack_m);
  return prepared;
}

double percentile(std::vector<double> values, double p) {
  if (values.empty()) return 0;
  const auto at = static_cast<std::size_t>(std::ceil(p * static_cast<double>(values.size())));
  const std::size_t k = std::min(values.size() - 1, at == 0 ? 0 : at - 1);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(k), values.end());
  return values[k];
}

double median(std::vector<double> values) {
  const double low = percentile(values, 0.5);
  if (values.size() % 2 == 1 || values.empty()) return low;
  std::sort(values.begin(), values.end());
  return (low + values[values.size() / 2]) / 2;
}

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec) * 1e-9;
}

}  // namespace ivis::tool
