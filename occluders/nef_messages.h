#pragma once
// What shrink_polyhedron() and its worker say to each other: words and hexadecimal numbers.

#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "occluders/polyhedron.h"

namespace ivis {

struct NefRequest {
  Polyhedron solid;
  Vec3 half{0};
  std::vector<double> margins_m;
};

/// What had been said when the worker ended, or was ended.
struct NefAnswer {
  std::vector<ConvexSolid> parts;
  std::vector<FaceMesh> levels;  ///< whole ones only
  bool complete = false;
  std::string trouble;  ///< in the worker's words
};

std::string encode(const NefRequest& request);
/// Errors: kInput, naming what was expected.
Result<NefRequest> decode_nef_request(std::string_view text);

// The answer's pieces, in this order.
std::string encode_parts(const std::vector<ConvexSolid>& parts);
std::string encode_level(const FaceMesh& mesh);
std::string encode_trouble(std::string_view why);
std::string encode_end();
/// Takes what is whole; a text that ends early is no error, one that is wrong is. Numbers are
/// finite and in range, corners exist, counts were checked against the bytes before allocating.
Result<NefAnswer> decode_nef_answer(std::string_view text);

}  // namespace ivis
