#include "scenes/gltf_meshopt.h"

#include <cmath>
#include <optional>

#include <meshoptimizer.h>

namespace ivis {
namespace {

/// A whole number that is not negative; tinygltf keeps numbers beyond int as other values.
std::optional<std::size_t> whole(const tinygltf::Value& object, const char* key,
                                 std::optional<std::size_t> absent) {
  if (!object.Has(key)) return absent;
  const tinygltf::Value& v = object.Get(key);
  if (!v.IsInt() || v.GetNumberAsInt() < 0) return std::nullopt;
  return static_cast<std::size_t>(v.GetNumberAsInt());
}

std::string text(const tinygltf::Value& object, const char* key, const char* absent) {
  if (!object.Has(key)) return absent;
  const tinygltf::Value& v = object.Get(key);
  return v.IsString() ? v.Get<std::string>() : std::string("?");
}

}  // namespace

Result<std::vector<std::uint8_t>> decode_meshopt(
    const tinygltf::Value& extension, const std::vector<std::span<const std::uint8_t>>& buffers,
    GltfBudget& budget, const std::string& where_view) {
  const std::string where = where_view + ", EXT_meshopt_compression";
  if (!extension.IsObject()) return input_error(where + ": not an object");
  const auto buffer = whole(extension, "buffer", std::nullopt);
  const auto offset = whole(extension, "byteOffset", 0);
  const auto length = whole(extension, "byteLength", std::nullopt);
  const auto stride = whole(extension, "byteStride", std::nullopt);
  const auto count = whole(extension, "count", std::nullopt);
  if (!buffer || !offset || !length || !stride || !count)
    return input_error(
        where + ": buffer, byteOffset, byteLength, byteStride or count is not a whole number");
  if (*buffer >= buffers.size())
    return input_error(where + ": buffer " + std::to_string(*buffer) + ", expected below " +
                       std::to_string(buffers.size()));
  const auto stored = buffers[*buffer];
  if (*offset > stored.size() || *length > stored.size() - *offset)
    return input_error(where + ": " + std::to_string(*length) + " bytes from " +
                       std::to_string(*offset) + " do not fit in " + std::to_string(stored.size()));
  const auto input = stored.subspan(*offset, *length);

  const std::string mode = text(extension, "mode", "?");
  const std::string filter = text(extension, "filter", "NONE");
  const bool attributes = mode == "ATTRIBUTES";
  if (!attributes && mode != "TRIANGLES" && mode != "INDICES")
    return input_error(where + ": mode '" + mode.substr(0, 40) + "'");
  const std::string stride_shown = where + ": byteStride " + std::to_string(*stride);
  if (attributes ? *stride == 0 || *stride > 256 || *stride % 4 != 0 : *stride != 2 && *stride != 4)
    return input_error(stride_shown + " is not one of mode " + mode);
  if (mode == "TRIANGLES" && *count % 3 != 0)
    return input_error(where + ": count " + std::to_string(*count) + ", expected a multiple of 3");
  const bool octahedral = filter == "OCTAHEDRAL", quaternion = filter == "QUATERNION",
             exponential = filter == "EXPONENTIAL";
  if (filter != "NONE" && !(attributes && (octahedral || quaternion || exponential)))
    return input_error(where + ": filter '" + filter.substr(0, 40) + "' with mode " + mode);
  if ((octahedral && *stride != 4 && *stride != 8) || (quaternion && *stride != 8))
    return input_error(stride_shown + " is not one of filter " + filter);

  // The codecs write an index or a group of 64 equal bytes with one byte at least.
  if (*count > 0 && *count / 64 > input.size())
    return input_error(where + ": count " + std::to_string(*count) + " cannot come out of " +
                       std::to_string(input.size()) + " bytes");
  if (auto s = budget.charge(*count, *stride, where); !s) return s.error();
  std::vector<std::uint8_t> out(*count * *stride);
  if (*count == 0) return out;
  int code = 0;
  if (attributes)
    code = meshopt_decodeVertexBuffer(out.data(), *count, *stride, input.data(), input.size());
  else if (mode == "TRIANGLES")
    code = meshopt_decodeIndexBuffer(out.data(), *count, *stride, input.data(), input.size());
  else
    code = meshopt_decodeIndexSequence(out.data(), *count, *stride, input.data(), input.size());
  if (code != 0)
    return input_error(where + ": " + std::to_string(input.size()) +
                       " bytes do not decode as mode " + mode + " (code " + std::to_string(code) +
                       ")");
  if (octahedral) meshopt_decodeFilterOct(out.data(), *count, *stride);
  if (quaternion) meshopt_decodeFilterQuat(out.data(), *count, *stride);
  if (exponential) meshopt_decodeFilterExp(out.data(), *count, *stride);
  return out;
}

}  // namespace ivis
