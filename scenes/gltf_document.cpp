#include "scenes/gltf_document.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <optional>

#include "core/path.h"
#include "scenes/gltf_json.h"

namespace ivis {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxFileBytes = std::size_t{8} << 30U;
constexpr std::uint32_t kJsonChunk = 0x4E4F534AU;
constexpr std::uint32_t kBinChunk = 0x004E4942U;

std::uint32_t read_u32(std::string_view bytes, std::size_t at) {
  std::uint32_t v = 0;
  std::memcpy(&v, bytes.data() + at, sizeof v);
  return v;
}

struct Chunks {
  std::string_view json;
  std::optional<std::string_view> bin;
};

Result<Chunks> split_glb(std::string_view bytes) {
  const auto number = [](std::uint64_t v) { return std::to_string(v); };
  if (bytes.size() < 20)
    return input_error("GLB of " + number(bytes.size()) +
                       " bytes, expected a header of 12 and a chunk");
  if (read_u32(bytes, 4) != 2)
    return input_error("GLB of version " + number(read_u32(bytes, 4)) + ", expected 2");
  const std::size_t length = read_u32(bytes, 8);
  if (length > bytes.size())
    return input_error("GLB header says " + number(length) + " bytes, found " +
                       number(bytes.size()));
  Chunks chunks;
  std::size_t at = 12;
  for (std::size_t index = 0; at + 8 <= length; ++index) {
    const std::size_t size = read_u32(bytes, at);
    const std::uint32_t type = read_u32(bytes, at + 4);
    at += 8;
    if (size > length - at)
      return input_error("GLB chunk " + number(index) + " says " + number(size) + " bytes, found " +
                         number(length - at));
    if (index == 0) {
      if (type != kJsonChunk) return input_error("GLB: the first chunk is not JSON");
      chunks.json = bytes.substr(at, size);
    } else if (index == 1 && type == kBinChunk) {
      chunks.bin = bytes.substr(at, size);
    }
    at += size;
  }
  if (chunks.json.empty()) return input_error("GLB: no JSON chunk, or an empty one");
  return chunks;
}

int base64_value(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+' || c == '-') return 62;
  if (c == '/' || c == '_') return 63;
  return -1;
}

Result<std::vector<std::uint8_t>> decode_data_uri(std::string_view uri) {
  constexpr std::string_view kMark = ";base64,";
  const auto mark = uri.substr(0, 256).find(kMark);
  if (mark == std::string_view::npos) return input_error("a data URI that is not base64");
  std::string_view text = uri.substr(mark + kMark.size());
  while (!text.empty() && text.back() == '=')
    text.remove_suffix(1);
  std::vector<std::uint8_t> bytes;
  bytes.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    const int value = base64_value(c);
    if (value < 0) return input_error("a data URI with a character that is not base64");
    bits = (bits << 6U) | static_cast<std::uint32_t>(value);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes.push_back(static_cast<std::uint8_t>(bits >> static_cast<unsigned>(held)));
  }
  return bytes;
}

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

Result<std::string> percent_decoded(std::string_view uri) {
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      out += uri[i];
      continue;
    }
    const int high = i + 2 < uri.size() ? hex_value(uri[i + 1]) : -1;
    const int low = i + 2 < uri.size() ? hex_value(uri[i + 2]) : -1;
    if (high < 0 || low < 0) return input_error("a '%' without two hexadecimal digits");
    out += static_cast<char>(16 * high + low);
    i += 2;
  }
  return out;
}

/// The file that `uri` names, inside `folder` also after following links.
Result<fs::path> resolve_uri(const std::string& uri, const fs::path& folder) {
  const std::string shown = "uri '" + uri.substr(0, 120) + "'";
  const auto decoded = percent_decoded(uri);
  if (!decoded) return input_error(shown + ": " + decoded.error().message);
  if (decoded->find_first_of(std::string_view("\\:\0", 3)) != std::string::npos)
    return input_error(shown + ": a scheme, a backslash or a NUL, expected a file beside this one");
  const fs::path relative(*decoded);
  if (relative.is_absolute() || relative.has_root_path())
    return input_error(shown + ": absolute, expected a file beside this one");
  for (const fs::path& part : relative)
    if (part == "..") return input_error(shown + ": '..', expected a file beside this one");
  std::error_code ec;
  const fs::path base = fs::canonical(folder.empty() ? fs::path(".") : folder, ec);
  if (ec) return io_error("cannot open folder '" + folder.string() + "': " + ec.message());
  const fs::path target = fs::canonical(base / relative, ec);
  if (ec) return io_error(shown + ": cannot open: " + ec.message());
  if (std::mismatch(base.begin(), base.end(), target.begin(), target.end()).first != base.end())
    return input_error(shown + ": a link that leads out of this file's folder");
  if (!fs::is_regular_file(target, ec)) return io_error(shown + ": not a regular file");
  return target;
}

Status read_buffers(const fs::path& file, const std::vector<GltfBufferEntry>& entries,
                    const std::optional<std::string_view>& bin, GltfDocument& doc) {
  std::map<fs::path, std::size_t> opened;  // buffers may share a file; it is read once
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const GltfBufferEntry& entry = entries[i];
    const std::string where = "buffer " + std::to_string(i) + ": ";
    std::span<const std::uint8_t> bytes;
    if (entry.fallback) {
      doc.buffers.emplace_back();
      continue;
    }
    if (entry.uri.empty()) {
      if (!bin || i != 0)
        return input_error(
            where + "no 'uri', and " +
            (i == 0 ? "the file has no BIN chunk" : "only buffer 0 is the BIN chunk"));
      bytes = {reinterpret_cast<const std::uint8_t*>(bin->data()), bin->size()};
    } else if (entry.uri.starts_with("data:")) {
      auto decoded = decode_data_uri(entry.uri);
      if (!decoded) return input_error(where + decoded.error().message);
      doc.owned.push_back(*std::move(decoded));
      bytes = doc.owned.back();
    } else {
      const auto target = resolve_uri(entry.uri, file.parent_path());
      if (!target) return Error{target.error().code, where + target.error().message};
      auto known = opened.find(*target);
      if (known == opened.end()) {
        const auto content = read_file_whole(*target, kMaxFileBytes);
        if (!content) return Error{content.error().code, where + content.error().message};
        known = opened.emplace(*target, doc.owned.size()).first;
        doc.owned.emplace_back(content->begin(), content->end());
        doc.stored_bytes += content->size();
      }
      bytes = doc.owned[known->second];
    }
    if (entry.byte_length > bytes.size())
      return input_error(where + "byteLength " + std::to_string(entry.byte_length) + ", found " +
                         std::to_string(bytes.size()) + " bytes");
    doc.buffers.push_back(bytes.first(entry.byte_length));
  }
  return ok();
}

Status check_extensions(const tinygltf::Model& model) {
  constexpr std::array<std::string_view, 10> kKnown{
      "EXT_mesh_gpu_instancing", "KHR_mesh_quantization",
      "EXT_meshopt_compression", "KHR_draco_mesh_compression",
      "KHR_lights_punctual",     "EXT_lights_image_based",
      "EXT_lights_ies",          "KHR_xmp",
      "KHR_xmp_json_ld",         "MSFT_texture_dds"};
  constexpr std::array<std::string_view, 4> kKnownPrefixes{"KHR_materials_", "KHR_texture_",
                                                           "EXT_texture_", "EXT_materials_"};
  for (const std::string& name : model.extensionsRequired) {
    const bool known = std::find(kKnown.begin(), kKnown.end(), name) != kKnown.end() ||
                       std::any_of(kKnownPrefixes.begin(), kKnownPrefixes.end(),
                                   [&](std::string_view p) { return name.starts_with(p); });
    if (!known)
      return unsupported("extensionsRequired: '" + name.substr(0, 120) + "' is not known");
  }
  return ok();
}

}  // namespace

Status GltfBudget::charge(std::size_t elements, std::size_t bytes_each, const std::string& what) {
  const std::size_t left = limit_ - used_;
  if (bytes_each != 0 && elements > left / bytes_each)
    return input_error(what + ": " + std::to_string(elements) + " elements of " +
                       std::to_string(bytes_each) +
                       " bytes are more than a file of this size may ask for (" +
                       std::to_string(limit_) + " bytes in all)");
  used_ += elements * bytes_each;
  return ok();
}

Result<std::unique_ptr<GltfDocument>> read_gltf_document(const fs::path& file) {
  auto doc = std::make_unique<GltfDocument>();
  auto content = read_file_whole(file, kMaxFileBytes);
  if (!content) return content.error();
  doc->file_bytes = *std::move(content);
  doc->stored_bytes = doc->file_bytes.size();
  Chunks chunks{doc->file_bytes, std::nullopt};
  if (doc->file_bytes.starts_with("glTF")) {
    const auto split = split_glb(doc->file_bytes);
    if (!split) return split.error();
    chunks = *split;
  }
  auto json = prepare_gltf_json(chunks.json);
  if (!json) return json.error();
  doc->animated_nodes = std::move(json->animated_nodes);
  auto model = parse_gltf_json(json->text);
  if (!model) return model.error();
  doc->model = *std::move(model);
  if (!doc->model.asset.version.starts_with("2."))
    return input_error("asset.version '" + doc->model.asset.version.substr(0, 40) +
                       "', expected 2.x");
  if (auto s = check_extensions(doc->model); !s) return s.error();
  if (auto s = read_buffers(file, json->buffers, chunks.bin, *doc); !s) return s.error();
  return doc;
}

}  // namespace ivis
