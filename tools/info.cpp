#include <iostream>
#include <memory>

#include "tools/common.h"

namespace ivis::tool {
namespace {

struct Args {
  SceneArgs scene;
  bool json = false;
};

Outcome info(const Args& args) {
  const auto scene = args.scene.load(make_context(args.json));
  if (!scene) return scene.error();
  if (args.json) {
    print({{"objects", scene->objects.size()},
           {"triangles", scene->triangle_count},
           {"bounds", Json::array({to_json(scene->bounds.lo), to_json(scene->bounds.hi)})},
           {"hash", to_hex(scene->hash)},
           {"extensions", scene->extensions},
           {"warnings", scene->warnings}});
    return kOk;
  }
  const Vec3 size = scene->bounds.size();
  std::cout << "objects     " << scene->objects.size() << "\ntriangles   " << scene->triangle_count
            << "\nonly-occluders " << scene->hidden_solids.size() << "\nbounds      "
            << to_json(scene->bounds.lo).dump() << " .. " << to_json(scene->bounds.hi).dump()
            << "  (" << size.x << " x " << size.y << " x " << size.z << " m)\nhash        "
            << to_hex(scene->hash) << "\nextensions ";
  for (const auto& e : scene->extensions) std::cout << ' ' << e;
  std::cout << '\n';
  return kOk;
}

Outcome objects(const Args& args) {
  const auto scene = args.scene.load(make_context(args.json));
  if (!scene) return scene.error();
  if (!args.json) {
    std::cout << "id\tnode\tinstance\ttriangles\tname\n";
    for (ObjectId id = 0; id < scene->objects.size(); ++id) {
      const Object& o = scene->objects[id];
      std::cout << id << '\t' << o.node << '\t' << o.instance << '\t' << scene->mesh_of(o).triangles() << '\t' << scene->name_of(o) << '\n';
    }
    return kOk;
  }
  // Written piece by piece: a city has a hundred thousand.
  std::cout << '[';
  for (ObjectId id = 0; id < scene->objects.size(); ++id) {
    const Object& o = scene->objects[id];
    const Json j{{"id", id},
                 {"node", o.node},
                 {"instance", o.instance},
                 {"name", scene->name_of(o)},
                 {"aabb", Json::array({to_json(o.bounds.lo), to_json(o.bounds.hi)})},
                 {"triangles", scene->mesh_of(o).triangles()}};
    std::cout << (id == 0 ? "" : ",\n") << j.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  std::cout << "]\n";
  return kOk;
}

void add(CLI::App& app, std::function<Outcome()>& action, const char* name, const char* help, Outcome (*run)(const Args&)) {
  CLI::App* sub = app.add_subcommand(name, help);
  auto args = std::make_shared<Args>();
  args->scene.add_to(*sub);
  sub->add_flag("--json", args->json, "print JSON");
  sub->callback([&action, args, run] { action = [args, run] { return run(*args); }; });
}

}  // namespace

void add_info(CLI::App& app, std::function<Outcome()>& action) { add(app, action, "info", "what a scene file holds", info); }
void add_objects(CLI::App& app, std::function<Outcome()>& action) {
  add(app, action, "objects", "the objects of a scene, by id: one a mesh-bearing node or instance", objects);
}

}  // namespace ivis::tool
