#include "scenes/gltf_json.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include <nlohmann/json.hpp>

namespace ivis {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxDepth = 64;

/// A member of the root object: its key and where its value lies in the text.
struct Section {
  std::string_view key;
  std::size_t begin = 0;
  std::size_t end = 0;
};

/// Purely lexical, so that it needs no stack; what is not JSON is found by the parser later.
Result<std::vector<Section>> find_sections(std::string_view text) {
  std::vector<Section> sections;
  std::size_t depth = 0;
  std::string_view key;
  constexpr std::size_t kNoValue = std::string_view::npos;
  std::size_t value = kNoValue;
  const auto close = [&](std::size_t end) {
    if (value != kNoValue) sections.push_back({key, value, end});
    value = kNoValue;
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    switch (text[i]) {
      case '"': {
        const std::size_t begin = ++i;
        while (i < text.size() && text[i] != '"')
          i += text[i] == '\\' ? 2 : 1;
        if (i >= text.size()) return input_error("JSON: a string does not end");
        if (depth == 1 && value == kNoValue) key = text.substr(begin, i - begin);
        break;
      }
      case '{':
      case '[':
        if (++depth > kMaxDepth)
          return input_error("JSON: nested deeper than " + std::to_string(kMaxDepth) + " at byte " +
                             std::to_string(i));
        break;
      case '}':
      case ']':
        if (depth == 0)
          return input_error("JSON: a bracket too many closes at byte " + std::to_string(i));
        if (depth-- == 1) close(i);
        break;
      case ':':
        if (depth == 1 && value == kNoValue) value = i + 1;
        break;
      case ',':
        if (depth == 1) close(i);
        break;
      default:
        break;
    }
  }
  if (depth != 0) return input_error("JSON: ends inside " + std::to_string(depth) + " brackets");
  // A key spelt twice or with escapes could hide a section from what is done below.
  std::vector<std::string_view> keys;
  for (const Section& s : sections) {
    if (s.key.find('\\') != std::string_view::npos)
      return input_error("JSON: key '" + std::string(s.key.substr(0, 40)) +
                         "' of the root has escapes");
    keys.push_back(s.key);
  }
  std::sort(keys.begin(), keys.end());
  const auto twice = std::adjacent_find(keys.begin(), keys.end());
  if (twice != keys.end())
    return input_error("JSON: '" + std::string(twice->substr(0, 40)) + "' is there twice");
  return sections;
}

void blank(std::string& text, const Section& s) {
  const std::size_t length = s.end - s.begin;
  if (length == 0) return;
  text.replace(s.begin, length, length, ' ');
  if (length == 1)
    text[s.begin] = '0';
  else
    text.replace(s.begin, 2, "[]");
}

Result<json> parse(std::string_view text, std::string_view what) {
  json j = json::parse(text.begin(), text.end(), nullptr, false);
  if (j.is_discarded()) return input_error("JSON: '" + std::string(what) + "' is not valid JSON");
  return j;
}

const json* member(const json& o, const char* key) {
  if (!o.is_object()) return nullptr;
  const auto it = o.find(key);
  return it == o.end() ? nullptr : &*it;
}

Result<std::vector<GltfBufferEntry>> read_buffers(const json& list) {
  if (!list.is_array()) return input_error("'buffers' is not an array");
  std::vector<GltfBufferEntry> out;
  for (const json& b : list) {
    const std::string where = "buffer " + std::to_string(out.size());
    GltfBufferEntry entry;
    const json* length = member(b, "byteLength");
    if (length == nullptr || !length->is_number_unsigned())
      return input_error(where + ": 'byteLength' is not a positive whole number");
    entry.byte_length = length->get<std::size_t>();
    if (const json* uri = member(b, "uri")) {
      if (!uri->is_string()) return input_error(where + ": 'uri' is not a string");
      entry.uri = uri->get<std::string>();
      if (entry.uri.empty()) return input_error(where + ": 'uri' is empty");
    }
    if (const json* extensions = member(b, "extensions"))
      if (const json* meshopt = member(*extensions, "EXT_meshopt_compression"))
        if (const json* fallback = member(*meshopt, "fallback"))
          entry.fallback = fallback->is_boolean() && fallback->get<bool>() && entry.uri.empty();
    out.push_back(std::move(entry));
  }
  return out;
}

/// Node of KHR_animation_pointer's "/nodes/12/translation".
std::optional<std::uint32_t> pointed_node(const json& target) {
  const json* extensions = member(target, "extensions");
  const json* extension = extensions ? member(*extensions, "KHR_animation_pointer") : nullptr;
  const json* pointer = extension ? member(*extension, "pointer") : nullptr;
  if (pointer == nullptr || !pointer->is_string()) return std::nullopt;
  const auto text = pointer->get<std::string>();
  constexpr std::string_view kNodes = "/nodes/";
  if (!text.starts_with(kNodes)) return std::nullopt;
  std::uint64_t node = 0;
  std::size_t i = kNodes.size();
  for (; i < text.size() && text[i] >= '0' && text[i] <= '9' && node < (1ULL << 32U); ++i)
    node = node * 10 + static_cast<std::uint64_t>(text[i] - '0');
  return i == kNodes.size() || node >= (1ULL << 32U)
             ? std::nullopt
             : std::optional(static_cast<std::uint32_t>(node));
}

Result<std::vector<std::uint32_t>> read_animated_nodes(const json& list) {
  if (!list.is_array()) return input_error("'animations' is not an array");
  std::vector<std::uint32_t> nodes;
  for (std::size_t a = 0; a < list.size(); ++a) {
    const json* channels = member(list[a], "channels");
    if (channels == nullptr || !channels->is_array()) continue;
    for (const json& channel : *channels) {
      const json* target = member(channel, "target");
      if (target == nullptr) continue;
      if (const auto pointed = pointed_node(*target)) nodes.push_back(*pointed);
      const json* node = member(*target, "node");
      if (node == nullptr) continue;
      if (!node->is_number_unsigned() ||
          node->get<std::uint64_t>() > std::numeric_limits<std::uint32_t>::max())
        return input_error("animation " + std::to_string(a) +
                           ": a channel's 'node' is not a node index");
      nodes.push_back(node->get<std::uint32_t>());
    }
  }
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

Result<std::string> move_draco_indices(const std::string& text) {
  auto parsed = parse(text, "root");
  if (!parsed) return parsed.error();
  json& root = *parsed;
  const auto meshes = root.is_object() ? root.find("meshes") : root.end();
  if (meshes == root.end() || !meshes->is_array()) return text;
  for (json& mesh : *meshes) {
    if (!mesh.is_object() || !mesh.contains("primitives") || !mesh["primitives"].is_array())
      continue;
    for (json& primitive : mesh["primitives"]) {
      const json* extensions = member(primitive, "extensions");
      const json* draco = extensions ? member(*extensions, "KHR_draco_mesh_compression") : nullptr;
      if (draco == nullptr || !draco->is_object()) continue;
      const json* attributes = member(primitive, "attributes");
      if (attributes == nullptr || !attributes->is_object() || !primitive.contains("indices"))
        continue;
      json indices = std::move(primitive["indices"]);
      primitive["attributes"][kDracoIndices] = std::move(indices);
      primitive.erase("indices");
    }
  }
  return root.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

Result<GltfJson> prepare_gltf_json(std::string_view text) {
  const auto sections = find_sections(text);
  if (!sections) return sections.error();
  GltfJson out;
  out.text = text;
  constexpr std::array<std::string_view, 9> kRemoved{"buffers",  "animations", "images",
                                                     "textures", "samplers",   "cameras",
                                                     "skins",    "extensions", "extras"};
  for (const Section& s : *sections) {
    const auto value = text.substr(s.begin, s.end - s.begin);
    if (s.key == "buffers" || s.key == "animations") {
      const auto parsed = parse(value, s.key);
      if (!parsed) return parsed.error();
      if (s.key == "buffers") {
        auto buffers = read_buffers(*parsed);
        if (!buffers) return buffers.error();
        out.buffers = *std::move(buffers);
      } else {
        auto nodes = read_animated_nodes(*parsed);
        if (!nodes) return nodes.error();
        out.animated_nodes = *std::move(nodes);
      }
    }
    if (std::find(kRemoved.begin(), kRemoved.end(), s.key) != kRemoved.end()) blank(out.text, s);
  }
  if (out.text.find("KHR_draco_mesh_compression") != std::string::npos) {
    auto moved = move_draco_indices(out.text);
    if (!moved) return moved.error();
    out.text = *std::move(moved);
  }
  return out;
}

}  // namespace ivis
