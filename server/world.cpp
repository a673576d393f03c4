#include "server/world.h"

#include <utility>

#include "occluders/fast_erosion.h"
#include "occluders/file.h"
#include "occluders/shrink.h"
#include "scenes/load.h"

namespace ivis::server {
namespace {

Result<OccluderSet> shrink_here(const Scene& scene, const Reach& reach, const std::string& method,
                                const Context& context) {
  ShrinkOptions options;
  options.reach = reach;
  options.margins = method == "occlusion-map";  // nothing else draws them
  const FastEroder eroder;
  auto shrunk = shrink(scene, options, eroder, context);
  if (!shrunk) return shrunk.error();
  return std::move(shrunk->set);
}

Result<std::unique_ptr<Method>> make(const std::string& method, const Scene& scene,
                                     const OccluderSet& occluders, const WorldOptions& options) {
  MethodOptions method_options;
  method_options.threads = options.threads;
  return make_method(method, scene, occluders, method_options);
}

}  // namespace

Result<std::unique_ptr<World>> load_world(const WorldOptions& options, const Context& context) {
  auto world = std::make_unique<World>();
  context.say("loading " + options.scene.string());
  SceneOptions scene_options;
  scene_options.granularity = options.granularity;
  auto scene = load_scene(options.scene, scene_options, context);
  if (!scene) return scene.error();
  world->scene = std::move(*scene);

  if (!options.occluders.empty()) {
    auto set = read_occluders(options.occluders);
    if (!set) return set.error();
    world->occluders = std::move(*set);
  }
  std::string text = options.reach;
  if (text.empty())
    text = options.occluders.empty() ? options.default_reach : world->occluders.reach.to_string();
  auto reach = Reach::parse(text);
  if (!reach) return reach.error();
  world->reach = *reach;

  std::string method = options.method;
  if (method.empty()) {
    const auto list = method_list();
    IVIS_ASSERT(!list.empty(), "at least one method is registered");
    method = list.front().name;
  }
  if (options.occluders.empty()) {
    context.say("shrinking occluders by " + text);
    auto set = shrink_here(world->scene, world->reach, method, context);
    if (!set) return set.error();
    world->occluders = std::move(*set);
  } else if (auto fits = check_occluders(world->occluders, world->scene.hash, world->reach,
                                         options.occluders.string());
             !fits) {
    return fits.error();
  }

  auto made = make(method, world->scene, world->occluders, options);
  if (!made) return made.error();
  world->method = std::move(*made);
  world->index = std::make_unique<OccluderIndex>(world->occluders);
  return world;
}

Status build_rungs(World& world, Ladder& ladder, const WorldOptions& options,
                   const Context& context) {
  const std::string method = world.method->traits().name;
  for (std::size_t i = ladder.reaches().size() - 1; i-- > 0;) {
    auto rung = std::make_unique<World::Rung>();
    auto set = shrink_here(world.scene, ladder.reaches()[i], method, context);
    if (!set) return set.error();
    rung->occluders = std::move(*set);
    auto made = make(method, world.scene, rung->occluders, options);
    if (!made) return made.error();
    rung->method = std::move(*made);
    rung->index = std::make_unique<OccluderIndex>(rung->occluders);
    world.rungs.push_back(std::move(rung));
    ladder.add(static_cast<std::uint32_t>(i), *world.rungs.back()->method,
               world.rungs.back()->index.get());
  }
  return ok();
}

}  // namespace ivis::server
