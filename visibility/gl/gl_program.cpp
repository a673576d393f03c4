#include "visibility/gl/gl_program.h"

#include <string>

#include <epoxy/gl.h>

#include "visibility/gl/gl_shaders.h"

namespace ivis {
namespace {

std::string log_of(GLuint name, bool program) {
  char text[1024] = {};
  program ? glGetProgramInfoLog(name, sizeof text, nullptr, text)
          : glGetShaderInfoLog(name, sizeof text, nullptr, text);
  return text;
}

}  // namespace

Result<std::uint32_t> link_program(const std::vector<GlSource>& sources, const char* what) {
  const GLuint program = glCreateProgram();
  for (const GlSource& source : sources) {
    const GLuint shader = glCreateShader(source.stage);
    const char* parts[] = {kCommonShader, source.text};
    glShaderSource(shader, 2, parts, nullptr);
    glCompileShader(shader);
    GLint good = GL_FALSE;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
    if (good != GL_TRUE)
      return unsupported(std::string("OpenGL: the ") + what +
                         " shader is refused: " + log_of(shader, false));
    glAttachShader(program, shader);
    glDeleteShader(shader);
  }
  glLinkProgram(program);
  GLint good = GL_FALSE;
  glGetProgramiv(program, GL_LINK_STATUS, &good);
  if (good != GL_TRUE)
    return unsupported(std::string("OpenGL: the ") + what +
                       " program does not link: " + log_of(program, true));
  return program;
}

}  // namespace ivis
