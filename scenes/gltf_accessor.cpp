#include "scenes/gltf_accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "scenes/gltf_meshopt.h"

namespace ivis {
namespace {

std::size_t component_bytes(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

std::size_t component_count(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return 1;
    case TINYGLTF_TYPE_VEC2:
      return 2;
    case TINYGLTF_TYPE_VEC3:
      return 3;
    case TINYGLTF_TYPE_VEC4:
      return 4;
    default:
      return 0;
  }
}

const char* type_name(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return "SCALAR";
    case TINYGLTF_TYPE_VEC2:
      return "VEC2";
    case TINYGLTF_TYPE_VEC3:
      return "VEC3";
    case TINYGLTF_TYPE_VEC4:
      return "VEC4";
    default:
      return "a matrix";
  }
}

template <class T>
T load(const std::uint8_t* p) {
  T v;
  std::memcpy(&v, p, sizeof v);  // buffers promise no alignment
  return v;
}

template <class T>
double integer(const std::uint8_t* p, bool normalized) {
  const double v = static_cast<double>(load<T>(p));
  if (!normalized) return v;
  return std::max(v / static_cast<double>(std::numeric_limits<T>::max()), -1.0);
}

std::uint32_t load_index(const std::uint8_t* p, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<std::uint8_t>(p);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<std::uint16_t>(p);
    default:
      return load<std::uint32_t>(p);
  }
}

bool index_type(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

/// `count` elements of `element` bytes, `stride` apart, from `offset`, lie within `size` bytes.
Status check_range(const std::string& where, std::size_t offset, std::size_t count,
                   std::size_t stride, std::size_t element, std::size_t size) {
  if (count == 0) return ok();
  const bool good = element <= size && offset <= size - element &&
                    (count - 1) <= (size - element - offset) / stride;
  if (good) return ok();
  return input_error(where + ": " + std::to_string(count) + " elements of " +
                     std::to_string(element) + " bytes, " + std::to_string(stride) +
                     " apart, from byte " + std::to_string(offset) + " do not fit in " +
                     std::to_string(size) + " bytes");
}

}  // namespace

const std::uint8_t* GltfAccessorView::element(std::size_t i) const {
  static constexpr std::uint8_t kZeros[16] = {};
  if (!sparse_.empty()) {
    const auto at = std::lower_bound(sparse_.begin(), sparse_.end(), i);
    if (at != sparse_.end() && *at == i)
      return sparse_values_ + static_cast<std::size_t>(at - sparse_.begin()) * element_bytes_;
  }
  return data_ != nullptr ? data_ + i * stride_ : kZeros;
}

double GltfAccessorView::number(std::size_t i, std::size_t c) const {
  const std::uint8_t* p = element(i);
  switch (component_type_) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return integer<std::int8_t>(p + c, normalized_);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return integer<std::uint8_t>(p + c, normalized_);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return integer<std::int16_t>(p + 2 * c, normalized_);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return integer<std::uint16_t>(p + 2 * c, normalized_);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return load<std::uint32_t>(p + 4 * c);
    default:
      return load<float>(p + 4 * c);
  }
}

std::uint32_t GltfAccessorView::index(std::size_t i) const {
  return load_index(element(i), component_type_);
}

Result<std::span<const std::uint8_t>> GltfAccessors::buffer_view(int index) {
  const auto& views = document_.model.bufferViews;
  if (index < 0 || static_cast<std::size_t>(index) >= views.size())
    return input_error("buffer view " + std::to_string(index) + ", expected below " +
                       std::to_string(views.size()));
  const auto& view = views[static_cast<std::size_t>(index)];
  const std::string where = "buffer view " + std::to_string(index);
  if (const auto extension = view.extensions.find("EXT_meshopt_compression");
      extension != view.extensions.end()) {
    auto found = decoded_.find(index);
    if (found == decoded_.end()) {
      auto bytes = decode_meshopt(extension->second, document_.buffers, budget_, where);
      if (!bytes) return bytes.error();
      found = decoded_.emplace(index, *std::move(bytes)).first;
    }
    return std::span<const std::uint8_t>(found->second);
  }
  if (view.buffer < 0 || static_cast<std::size_t>(view.buffer) >= document_.buffers.size())
    return input_error(where + ": buffer " + std::to_string(view.buffer) + ", expected below " +
                       std::to_string(document_.buffers.size()));
  const auto buffer = document_.buffers[static_cast<std::size_t>(view.buffer)];
  if (auto s = check_range(where, view.byteOffset, 1, 1, view.byteLength, buffer.size()); !s)
    return s.error();
  return buffer.subspan(view.byteOffset, view.byteLength);
}

Result<GltfAccessorView> GltfAccessors::view(int index, const Expected& expected) {
  const auto& model = document_.model;
  const std::string where = "accessor " + std::to_string(index);
  if (index < 0 || static_cast<std::size_t>(index) >= model.accessors.size())
    return input_error(where + ", expected below " + std::to_string(model.accessors.size()));
  const tinygltf::Accessor& accessor = model.accessors[static_cast<std::size_t>(index)];
  if (accessor.type != expected.type)
    return input_error(where + ": type " + type_name(accessor.type) + ", expected " +
                       type_name(expected.type));
  if (std::find(expected.component_types.begin(), expected.component_types.end(),
                accessor.componentType) == expected.component_types.end())
    return input_error(where + ": componentType " + std::to_string(accessor.componentType) +
                       " is not taken here");
  if (accessor.count > std::numeric_limits<std::uint32_t>::max())
    return input_error(where + ": count " + std::to_string(accessor.count) +
                       ", expected below 2^32");

  GltfAccessorView v;
  v.count_ = accessor.count;
  v.component_type_ = accessor.componentType;
  v.normalized_ = accessor.normalized;
  v.element_bytes_ = component_bytes(accessor.componentType) * component_count(accessor.type);
  v.stride_ = v.element_bytes_;
  if (accessor.bufferView >= 0) {
    const auto bytes = buffer_view(accessor.bufferView);
    if (!bytes) return input_error(where + ": " + bytes.error().message);
    const auto& view = model.bufferViews[static_cast<std::size_t>(accessor.bufferView)];
    if (view.byteStride != 0) v.stride_ = view.byteStride;
    if (v.stride_ < v.element_bytes_)
      return input_error(where + ": byteStride " + std::to_string(v.stride_) +
                         ", expected at least " + std::to_string(v.element_bytes_));
    if (auto s = check_range(where, accessor.byteOffset, v.count_, v.stride_, v.element_bytes_,
                             bytes->size());
        !s)
      return s.error();
    v.data_ = v.count_ == 0 ? nullptr : bytes->data() + accessor.byteOffset;
  } else if (accessor.count > document_.stored_bytes) {
    return input_error(
        where + ": " + std::to_string(accessor.count) +
        " elements without a buffer view, expected at most as many as the file has bytes (" +
        std::to_string(document_.stored_bytes) + ")");
  }
  if (accessor.sparse.isSparse)
    if (auto s = add_sparse(accessor, where + ", sparse", v); !s) return s.error();
  return v;
}

Status GltfAccessors::add_sparse(const tinygltf::Accessor& accessor, const std::string& where,
                                 GltfAccessorView& v) {
  const auto& sparse = accessor.sparse;
  if (sparse.count < 0 || static_cast<std::size_t>(sparse.count) > v.count_)
    return input_error(where + ": count " + std::to_string(sparse.count) + ", expected at most " +
                       std::to_string(v.count_));
  if (!index_type(sparse.indices.componentType))
    return input_error(where + ": indices of componentType " +
                       std::to_string(sparse.indices.componentType));
  if (sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0)
    return input_error(where + ": a negative byteOffset");
  const auto count = static_cast<std::size_t>(sparse.count);
  const std::size_t index_bytes = component_bytes(sparse.indices.componentType);
  const auto indices = buffer_view(sparse.indices.bufferView);
  if (!indices) return input_error(where + " indices: " + indices.error().message);
  const auto values = buffer_view(sparse.values.bufferView);
  if (!values) return input_error(where + " values: " + values.error().message);
  const auto indices_at = static_cast<std::size_t>(sparse.indices.byteOffset);
  const auto values_at = static_cast<std::size_t>(sparse.values.byteOffset);
  if (auto s = check_range(where + " indices", indices_at, count, index_bytes, index_bytes,
                           indices->size());
      !s)
    return s;
  if (auto s = check_range(where + " values", values_at, count, v.element_bytes_, v.element_bytes_,
                           values->size());
      !s)
    return s;
  if (auto s = budget_.charge(count, sizeof(std::uint32_t), where); !s) return s;
  v.sparse_.resize(count);
  for (std::size_t k = 0; k < count; ++k) {
    v.sparse_[k] =
        load_index(indices->data() + indices_at + k * index_bytes, sparse.indices.componentType);
    if (v.sparse_[k] >= v.count_ || (k > 0 && v.sparse_[k] <= v.sparse_[k - 1]))
      return input_error(where + ": index " + std::to_string(v.sparse_[k]) + " at " +
                         std::to_string(k) + ", expected ascending and below " +
                         std::to_string(v.count_));
  }
  v.sparse_values_ = count == 0 ? nullptr : values->data() + values_at;
  return ok();
}

}  // namespace ivis
