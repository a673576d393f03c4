#pragma once

#include <cstdint>
#include <vector>

#include "core/result.h"

namespace ivis {

struct GlSource {
  std::uint32_t stage;  ///< GL_VERTEX_SHADER, ...
  const char* text;     ///< behind kCommonShader of gl_shaders.h
};

/// The name of a program in the current context, which frees it when it goes. `what` is for errors:
/// "drawing". Errors: kUnsupported with the driver's words.
Result<std::uint32_t> link_program(const std::vector<GlSource>& sources, const char* what);

}  // namespace ivis
