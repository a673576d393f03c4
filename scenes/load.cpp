#include "scenes/load.h"

#include <algorithm>
#include <exception>
#include <new>

#include "scenes/gltf_mesh.h"
#include "scenes/gltf_nodes.h"

namespace ivis {
namespace {

/// Gathers what many nodes share into one warning that names the first few.
class NodeList {
 public:
  void add(std::uint32_t node) {
    if (++count_ <= 5) shown_ += (count_ == 1 ? "" : ", ") + std::to_string(node);
  }
  void warn(const std::string& what, std::vector<std::string>& warnings) const {
    if (count_ != 0)
      warnings.push_back(std::to_string(count_) + (count_ == 1 ? " node " : " nodes ") + what +
                         ": " + shown_ + (count_ > 5 ? ", ..." : ""));
  }

 private:
  std::size_t count_ = 0;
  std::string shown_;
};

bool has_morph_targets(const tinygltf::Mesh& mesh) {
  return std::any_of(mesh.primitives.begin(), mesh.primitives.end(),
                     [](const tinygltf::Primitive& p) { return !p.targets.empty(); });
}

Result<Scene> build(const GltfDocument& document, const Context& context) {
  const auto& model = document.model;
  GltfBudget budget(document.stored_bytes);
  GltfAccessors accessors(document, budget);
  GltfMeshReader mesh_reader(document, accessors, budget);
  const auto nodes = reachable_nodes(document);
  if (!nodes) return nodes.error();

  Scene scene;
  scene.warnings = document.warnings;
  scene.extensions = model.extensionsUsed;
  std::sort(scene.extensions.begin(), scene.extensions.end());
  scene.extensions.erase(std::unique(scene.extensions.begin(), scene.extensions.end()),
                         scene.extensions.end());
  scene.node_names.reserve(model.nodes.size());
  for (const auto& node : model.nodes)
    scene.node_names.push_back(node.name);

  constexpr std::int64_t kNotRead = -1;
  std::vector<std::int64_t> scene_mesh(model.meshes.size(), kNotRead);  // by glTF mesh
  NodeList moving, moving_solids, empty_solids;
  for (std::size_t n = 0; n < nodes->size(); ++n) {
    if (context.stopped()) return cancelled();
    if (n % 1024 == 0) context.report("load", n, nodes->size());
    const PlacedNode& placed = (*nodes)[n];
    const auto& node = model.nodes[placed.node];
    if (node.mesh < 0) continue;
    const auto fail = [&](const Error& e) {
      return Error{e.code, "node " + std::to_string(placed.node) +
                               (node.name.empty() ? "" : " '" + node.name.substr(0, 80) + "'") +
                               ": " + e.message};
    };
    const auto tag = occluder_tag(node);
    if (!tag) return fail(tag.error());
    const auto m = static_cast<std::size_t>(node.mesh);
    if (m >= model.meshes.size() || scene_mesh[m] == kNotRead) {
      auto mesh = mesh_reader.read(node.mesh);
      if (!mesh) return fail(mesh.error());
      scene_mesh[m] = static_cast<std::int64_t>(scene.meshes.size());
      scene.meshes.push_back(*std::move(mesh));
    }
    const auto instances = node_instances(node, accessors, budget);
    if (!instances) return fail(instances.error());

    Object object;
    object.node = placed.node;
    object.mesh = static_cast<std::uint32_t>(scene_mesh[m]);
    object.tag = *tag;
    object.always_visible = placed.animated || node.skin >= 0 || has_morph_targets(model.meshes[m]);
    if (object.always_visible) {
      (*tag == OccluderTag::kOnly ? moving_solids : moving).add(placed.node);
      if (*tag == OccluderTag::kOnly) continue;  // where it will be is not known: it hides nothing
      object.tag = OccluderTag::kNever;
    }
    if (*tag == OccluderTag::kOnly && scene.meshes[object.mesh].triangles() == 0)
      empty_solids.add(placed.node);
    auto& list = *tag == OccluderTag::kOnly ? scene.hidden_solids : scene.objects;
    for (std::size_t i = 0; i < instances->size(); ++i) {
      object.instance = static_cast<std::uint32_t>(i);
      object.to_world = placed.to_world * (*instances)[i];
      list.push_back(object);
    }
  }
  context.report("load", nodes->size(), nodes->size());
  moving.warn("skinned, morphed or animated, always listed as visible", scene.warnings);
  moving_solids.warn("marked 'only' but skinned, morphed or animated, left out", scene.warnings);
  empty_solids.warn("marked 'only' without triangles", scene.warnings);
  if (const std::size_t left_out = mesh_reader.primitives_left_out(); left_out != 0)
    scene.warnings.push_back(std::to_string(left_out) +
                             " primitives left out: points, lines or without POSITION");
  return scene;
}

}  // namespace

Result<Scene> load_scene(const std::filesystem::path& file, const SceneOptions& options,
                         const Context& context) {
  const auto named = [&](const Error& e) {
    if (e.code == ErrorCode::kCancelled ||
        e.message.find("'" + file.string() + "'") != std::string::npos)
      return e;
    return Error{e.code, "'" + file.string() + "': " + e.message};
  };
  try {
    auto document = read_gltf_document(file);
    if (!document) return named(document.error());
    if (context.stopped()) return cancelled();
    auto scene = build(**document, context);
    if (!scene) return named(scene.error());
    document->reset();  // before the bounds: the file's bytes and tables are the larger half
    scene->honour_sidedness = options.honour_sidedness;
    if (auto s = finish_scene(*scene); !s) return named(s.error());
    if (options.granularity == Granularity::kCluster) {
      auto split = split_into_clusters(*std::move(scene));
      if (!split) return named(split.error());
      return split;
    }
    return scene;
  } catch (const std::bad_alloc&) {
    return named(input_error("asks for more memory than there is"));
  } catch (const std::exception& e) {
    return named(input_error(std::string("cannot be read: ") + e.what()));
  }
}

}  // namespace ivis
