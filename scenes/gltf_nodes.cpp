#include "scenes/gltf_nodes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <glm/gtc/quaternion.hpp>

namespace ivis {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Translation * rotation * scale. The quaternion is normalised: files round it.
Result<Mat4> compose(const Vec3& t, const glm::dquat& q, const Vec3& s) {
  const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (!(length > 1e-6) || !std::isfinite(length))
    return input_error("rotation is not a quaternion of length 1");
  const glm::dmat3 r = glm::mat3_cast(q / length);
  Mat4 m(1);
  for (int c = 0; c < 3; ++c)
    m[c] = glm::dvec4(r[c] * s[c], 0.0);
  m[3] = glm::dvec4(t, 1.0);
  return m;
}

Status check_length(const std::vector<double>& v, std::size_t expected, const char* name) {
  if (v.empty() || v.size() == expected) return ok();
  return input_error(std::string(name) + " of " + std::to_string(v.size()) + " numbers, expected " +
                     std::to_string(expected));
}

Result<Mat4> local_transform(const tinygltf::Node& node) {
  if (auto s = check_length(node.matrix, 16, "matrix"); !s) return s.error();
  if (auto s = check_length(node.translation, 3, "translation"); !s) return s.error();
  if (auto s = check_length(node.rotation, 4, "rotation"); !s) return s.error();
  if (auto s = check_length(node.scale, 3, "scale"); !s) return s.error();
  for (const auto* list : {&node.matrix, &node.translation, &node.rotation, &node.scale})
    for (const double v : *list)
      if (!std::isfinite(v)) return input_error("a number of its transform is not finite");
  if (!node.matrix.empty()) {
    Mat4 m(1);
    for (int c = 0; c < 4; ++c)
      for (int r = 0; r < 4; ++r)
        m[c][r] = node.matrix[4 * static_cast<std::size_t>(c) + static_cast<std::size_t>(r)];
    if (m[0][3] != 0 || m[1][3] != 0 || m[2][3] != 0 || m[3][3] != 1)
      return input_error("the last row of its matrix is not 0 0 0 1");
    return m;
  }
  const auto vec3 = [](const std::vector<double>& v, double absent) {
    return v.empty() ? Vec3(absent) : Vec3(v[0], v[1], v[2]);
  };
  const auto& q = node.rotation;
  const glm::dquat rotation =
      q.empty() ? glm::dquat(1, 0, 0, 0) : glm::dquat(q[3], q[0], q[1], q[2]);
  return compose(vec3(node.translation, 0), rotation, vec3(node.scale, 1));
}

std::string named(const tinygltf::Model& model, std::size_t node) {
  const std::string& name = model.nodes[node].name;
  return "node " + std::to_string(node) + (name.empty() ? "" : " '" + name.substr(0, 80) + "'");
}

Result<std::vector<std::uint32_t>> parents_of(const tinygltf::Model& model) {
  const std::size_t n = model.nodes.size();
  std::vector<std::uint32_t> parent(n, kNone);
  for (std::size_t i = 0; i < n; ++i) {
    for (const int child : model.nodes[i].children) {
      if (child < 0 || static_cast<std::size_t>(child) >= n)
        return input_error(named(model, i) + ": child " + std::to_string(child) +
                           ", expected below " + std::to_string(n));
      auto& p = parent[static_cast<std::size_t>(child)];
      if (p != kNone)
        return input_error(named(model, static_cast<std::size_t>(child)) + " is a child of node " +
                           std::to_string(p) + " and again of node " + std::to_string(i));
      p = static_cast<std::uint32_t>(i);
    }
  }
  return parent;
}

/// With at most one parent a node, what cannot be reached from the roots lies on or below a cycle.
Status check_cycles(const tinygltf::Model& model, const std::vector<std::uint32_t>& parent) {
  std::vector<std::uint32_t> queue;
  std::vector<bool> met(parent.size(), false);
  for (std::size_t i = 0; i < parent.size(); ++i)
    if (parent[i] == kNone) queue.push_back(static_cast<std::uint32_t>(i));
  for (std::size_t at = 0; at < queue.size(); ++at) {
    met[queue[at]] = true;
    for (const int child : model.nodes[queue[at]].children)
      queue.push_back(static_cast<std::uint32_t>(child));
  }
  for (std::size_t i = 0; i < parent.size(); ++i)
    if (!met[i])
      return input_error(named(model, i) + " is its own ancestor, or below a node that is");
  return ok();
}

Result<std::vector<std::uint32_t>> roots_of(const tinygltf::Model& model,
                                            const std::vector<std::uint32_t>& parent) {
  std::vector<std::uint32_t> roots;
  if (model.scenes.empty() && model.defaultScene < 0) {
    for (std::size_t i = 0; i < parent.size(); ++i)
      if (parent[i] == kNone) roots.push_back(static_cast<std::uint32_t>(i));
    return roots;
  }
  const int scene = std::max(model.defaultScene, 0);
  if (static_cast<std::size_t>(scene) >= model.scenes.size())
    return input_error("scene " + std::to_string(scene) + ", expected below " +
                       std::to_string(model.scenes.size()));
  for (const int root : model.scenes[static_cast<std::size_t>(scene)].nodes) {
    if (root < 0 || static_cast<std::size_t>(root) >= parent.size())
      return input_error("scene " + std::to_string(scene) + ": node " + std::to_string(root) +
                         ", expected below " + std::to_string(parent.size()));
    const auto r = static_cast<std::size_t>(root);
    if (parent[r] != kNone)
      return input_error("scene " + std::to_string(scene) + ": " + named(model, r) +
                         " is a child of node " + std::to_string(parent[r]) + ", expected a root");
    roots.push_back(static_cast<std::uint32_t>(root));
  }
  std::sort(roots.begin(), roots.end());
  const auto twice = std::adjacent_find(roots.begin(), roots.end());
  if (twice != roots.end())
    return input_error("scene " + std::to_string(scene) + " lists " + named(model, *twice) +
                       " twice");
  return roots;
}

}  // namespace

Result<std::vector<PlacedNode>> reachable_nodes(const GltfDocument& document) {
  const auto& model = document.model;
  if (model.nodes.size() >= kNone)
    return input_error(std::to_string(model.nodes.size()) + " nodes, expected below 2^32");
  const auto parent = parents_of(model);
  if (!parent) return parent.error();
  if (auto s = check_cycles(model, *parent); !s) return s.error();
  const auto roots = roots_of(model, *parent);
  if (!roots) return roots.error();

  std::vector<bool> target(model.nodes.size(), false);
  for (const std::uint32_t node : document.animated_nodes) {
    if (node >= target.size())
      return input_error("animations: target node " + std::to_string(node) + ", expected below " +
                         std::to_string(target.size()));
    target[node] = true;
  }

  std::vector<PlacedNode> placed;  // breadth first: a parent lies before its children
  placed.reserve(model.nodes.size());
  for (const std::uint32_t root : *roots)
    placed.push_back({root, Mat4(1), false});
  for (std::size_t at = 0; at < placed.size(); ++at) {
    PlacedNode& here = placed[at];
    const auto& node = model.nodes[here.node];
    const auto local = local_transform(node);
    if (!local) return input_error(named(model, here.node) + ": " + local.error().message);
    here.to_world = here.to_world * *local;
    here.animated = here.animated || target[here.node];
    const PlacedNode parent_of_next = here;
    for (const int child : node.children)
      placed.push_back(
          {static_cast<std::uint32_t>(child), parent_of_next.to_world, parent_of_next.animated});
  }
  std::sort(placed.begin(), placed.end(),
            [](const PlacedNode& a, const PlacedNode& b) { return a.node < b.node; });
  return placed;
}

Result<std::vector<Mat4>> node_instances(const tinygltf::Node& node, GltfAccessors& accessors,
                                         GltfBudget& budget) {
  const auto found = node.extensions.find("EXT_mesh_gpu_instancing");
  if (found == node.extensions.end()) return std::vector<Mat4>{Mat4(1)};
  const std::string where = "EXT_mesh_gpu_instancing";
  if (!found->second.IsObject() || !found->second.Get("attributes").IsObject())
    return input_error(where + ": 'attributes' is not an object");
  const tinygltf::Value& attributes = found->second.Get("attributes");
  static const std::vector<int> kTypes{TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_COMPONENT_TYPE_BYTE,
                                       TINYGLTF_COMPONENT_TYPE_SHORT};
  std::optional<std::size_t> count;
  const auto read = [&](const char* name, int type) -> Result<std::optional<GltfAccessorView>> {
    if (!attributes.Has(name)) return std::optional<GltfAccessorView>();
    const tinygltf::Value& index = attributes.Get(name);
    if (!index.IsInt()) return input_error(where + ": " + name + " is not an accessor index");
    auto view = accessors.view(index.GetNumberAsInt(), {type, kTypes});
    if (!view) return input_error(where + ", " + name + ": " + view.error().message);
    if (count && *count != view->count())
      return input_error(where + ", " + name + ": count " + std::to_string(view->count()) +
                         ", the other attributes have " + std::to_string(*count));
    count = view->count();
    return std::optional<GltfAccessorView>(*std::move(view));
  };
  const auto translation = read("TRANSLATION", TINYGLTF_TYPE_VEC3);
  if (!translation) return translation.error();
  const auto rotation = read("ROTATION", TINYGLTF_TYPE_VEC4);
  if (!rotation) return rotation.error();
  const auto scale = read("SCALE", TINYGLTF_TYPE_VEC3);
  if (!scale) return scale.error();
  if (!count) return input_error(where + ": none of TRANSLATION, ROTATION and SCALE");
  if (auto s = budget.charge(*count, sizeof(Mat4) + sizeof(Object), where + " instances"); !s)
    return s.error();

  std::vector<Mat4> instances;
  instances.reserve(*count);
  for (std::size_t i = 0; i < *count; ++i) {
    const auto vec3 = [&](const std::optional<GltfAccessorView>& v, double absent) {
      return v ? Vec3(v->number(i, 0), v->number(i, 1), v->number(i, 2)) : Vec3(absent);
    };
    const auto& r = *rotation;
    const glm::dquat q =
        r ? glm::dquat(r->number(i, 3), r->number(i, 0), r->number(i, 1), r->number(i, 2))
          : glm::dquat(1, 0, 0, 0);
    const auto m = compose(vec3(*translation, 0), q, vec3(*scale, 1));
    if (!m)
      return input_error(where + ", instance " + std::to_string(i) + ": " + m.error().message);
    instances.push_back(*m);
  }
  return instances;
}

Result<OccluderTag> occluder_tag(const tinygltf::Node& node) {
  if (!node.extras.IsObject() || !node.extras.Has("ivis")) return OccluderTag::kAuto;
  const tinygltf::Value& ivis = node.extras.Get("ivis");
  if (!ivis.IsObject()) return input_error("extras.ivis is not an object");
  if (!ivis.Has("occluder")) return OccluderTag::kAuto;
  const tinygltf::Value& value = ivis.Get("occluder");
  const std::string text = value.IsString() ? value.Get<std::string>() : std::string();
  if (text == "auto") return OccluderTag::kAuto;
  if (text == "always") return OccluderTag::kAlways;
  if (text == "only") return OccluderTag::kOnly;
  if (text == "never") return OccluderTag::kNever;
  return input_error("extras.ivis.occluder is " +
                     (value.IsString() ? "'" + text.substr(0, 40) + "'" : "not a string") +
                     ", expected auto, always, only or never");
}

}  // namespace ivis
