#include <iostream>
#include <memory>
#include <numeric>

#include "tools/common.h"

namespace ivis::tool {
namespace {

struct InfoArgs {
  SceneArgs scene;
  bool json = false;
  bool triangles = false;
};

Outcome info(const InfoArgs& args) {
  const auto scene = args.scene.load(make_context(args.json));
  if (!scene) return scene.error();
  if (args.json) {
    Json j{{"objects", scene->objects.size()},
           {"triangles", scene->triangle_count},
           {"bounds", Json::array({to_json(scene->bounds.lo), to_json(scene->bounds.hi)})},
           {"hash", to_hex(scene->hash)},
           {"extensions", scene->extensions},
           {"warnings", scene->warnings}};
    if (args.scene.clustered()) j["whole_objects"] = sources(*scene).size();
    print(j);
    return kOk;
  }
  const Vec3 size = scene->bounds.size();
  std::cout << "objects     " << scene->objects.size();
  if (args.scene.clustered()) std::cout << "  (clusters of " << sources(*scene).size() << ")";
  std::cout << "\ntriangles   " << scene->triangle_count << "\nonly-occluders "
            << scene->hidden_solids.size() << "\nbounds      " << to_json(scene->bounds.lo).dump()
            << " .. " << to_json(scene->bounds.hi).dump() << "  (" << size.x << " x " << size.y
            << " x " << size.z << " m)\nhash        " << to_hex(scene->hash) << "\nextensions ";
  for (const auto& e : scene->extensions)
    std::cout << ' ' << e;
  std::cout << '\n';
  return kOk;
}

/// The numbers that an object's triangles have in the mesh of its node. To be asked by ascending
/// id.
class WholeTriangles {
 public:
  explicit WholeTriangles(const Scene& scene) : scene_(scene) {}
  const std::vector<std::uint32_t>& of(ObjectId id) {
    const Object& o = scene_.objects[id];
    if (id > 0 && o.cluster == 0) ++whole_;
    const Object& whole = sources(scene_)[whole_];
    if (o.mesh != whole.mesh) {
      if (mesh_ != whole.mesh) clusters_ = cluster_triangles(scene_.meshes[whole.mesh]);
      mesh_ = whole.mesh;
      return clusters_[o.cluster];
    }
    all_.resize(scene_.mesh_of(o).triangles());
    std::iota(all_.begin(), all_.end(), 0U);
    return all_;
  }

 private:
  const Scene& scene_;
  std::size_t whole_ = 0;
  std::uint32_t mesh_ = 0xffffffffU;  ///< that clusters_ are of
  std::vector<std::vector<std::uint32_t>> clusters_;
  std::vector<std::uint32_t> all_;
};

Outcome objects(const InfoArgs& args) {
  const auto scene = args.scene.load(make_context(args.json));
  if (!scene) return scene.error();
  if (!args.json) {
    const bool clustered = args.scene.clustered();
    std::cout << "id\tnode\tinstance\t" << (clustered ? "cluster\t" : "") << "triangles\tname\n";
    for (ObjectId id = 0; id < scene->objects.size(); ++id) {
      const Object& o = scene->objects[id];
      std::cout << id << '\t' << o.node << '\t' << o.instance << '\t';
      if (clustered) std::cout << o.cluster << '\t';
      std::cout << scene->mesh_of(o).triangles() << '\t' << scene->name_of(o) << '\n';
    }
    return kOk;
  }
  // Written piece by piece: a city has a hundred thousand.
  WholeTriangles of_whole(*scene);
  std::cout << '[';
  for (ObjectId id = 0; id < scene->objects.size(); ++id) {
    const Object& o = scene->objects[id];
    Json j{{"id", id}, {"node", o.node}, {"instance", o.instance}};
    if (args.scene.clustered()) j["cluster"] = o.cluster;
    j["name"] = scene->name_of(o);
    j["aabb"] = Json::array({to_json(o.bounds.lo), to_json(o.bounds.hi)});
    j["triangles"] = scene->mesh_of(o).triangles();
    if (args.triangles) j["triangle_numbers"] = of_whole.of(id);
    std::cout << (id == 0 ? "" : ",\n") << j.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  std::cout << "]\n";
  return kOk;
}

std::shared_ptr<InfoArgs> add(CLI::App& app, std::function<Outcome()>& action, const char* name,
                              const char* help, Outcome (*run)(const InfoArgs&)) {
  CLI::App* sub = app.add_subcommand(name, help);
  auto args = std::make_shared<InfoArgs>();
  args->scene.add_to(*sub);
  sub->add_flag("--json", args->json, "print JSON");
  sub->callback([&action, args, run] { action = [args, run] { return run(*args); }; });
  return args;
}

}  // namespace

void add_info(CLI::App& app, std::function<Outcome()>& action) {
  add(app, action, "info", "what a scene file holds", info);
}
void add_objects(CLI::App& app, std::function<Outcome()>& action) {
  const auto args = add(app, action, "objects",
                        "the objects of a scene, by id: one a mesh-bearing node or instance, or a "
                        "cluster of its triangles",
                        objects);
  app.get_subcommand("objects")->add_flag("--triangle-numbers", args->triangles,
                                          "with --json: which triangles of its node's mesh an "
                                          "object has, numbered through all primitives");
}

}  // namespace ivis::tool
