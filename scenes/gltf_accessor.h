#pragma once
// Checked reading of glTF accessors. Used inside scenes/ only.

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "scenes/gltf_document.h"

namespace ivis {

/// Elements of an accessor where they lie; every element is inside its buffer, checked when made.
/// Ownership: borrows from the document and the reader that made it.
class GltfAccessorView {
 public:
  std::size_t count() const { return count_; }
  int component_type() const { return component_type_; }
  bool normalized() const { return normalized_; }

  /// Component `c` of element `i` as a number, normalised integers as in glTF 2.0 section 3.11.
  double number(std::size_t i, std::size_t c) const;
  /// Element `i` of a SCALAR of unsigned integers.
  std::uint32_t index(std::size_t i) const;

 private:
  friend class GltfAccessors;
  const std::uint8_t* element(std::size_t i) const;

  const std::uint8_t* data_ = nullptr;  ///< null: all zeros
  std::size_t count_ = 0;
  std::size_t stride_ = 0;
  std::size_t element_bytes_ = 0;
  int component_type_ = 0;
  bool normalized_ = false;
  std::vector<std::uint32_t>
      sparse_;  ///< ascending element indices whose values lie in sparse_values_
  const std::uint8_t* sparse_values_ = nullptr;
};

class GltfAccessors {
 public:
  GltfAccessors(const GltfDocument& document, GltfBudget& budget)
      : document_(document), budget_(budget) {}

  /// What an accessor must be to be taken: type is a TINYGLTF_TYPE_*.
  struct Expected {
    int type;
    std::vector<int> component_types;
  };
  /// Errors: kInput naming accessor or buffer view, found and expected.
  /// Cost:   of decoding the buffer view when it is compressed and met for the first time.
  Result<GltfAccessorView> view(int accessor, const Expected& expected);

  /// Bytes of a buffer view; decodes EXT_meshopt_compression and keeps the result.
  Result<std::span<const std::uint8_t>> buffer_view(int index);

 private:
  Status add_sparse(const tinygltf::Accessor& accessor, const std::string& where,
                    GltfAccessorView& view);

  const GltfDocument& document_;
  GltfBudget& budget_;
  std::map<int, std::vector<std::uint8_t>> decoded_;
};

}  // namespace ivis
