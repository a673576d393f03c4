#include "visibility/gl/gl_shadow_map.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <epoxy/gl.h>

#include "visibility/gl/gl_program.h"
#include "visibility/gl/gl_shaders.h"

namespace ivis {
namespace {

/// As the shaders read it (std430).
struct ShadowWall {
  double a[2], b[2], plane[2];  ///< relative to the eye
  double top;
  std::uint32_t first, count;  ///< the walls of its chain
};
static_assert(sizeof(ShadowWall) == 64);

/// A corner of a polygon, in OpenGL's coordinates.
struct Corner {
  float x, y;
  std::uint32_t wall;
};

/// At a time: 60 MB of corners, as a rectangle that three lines cut has at most seven of them, in
/// five triangles.
constexpr std::size_t kMostWalls = 1U << 18;

/// Keeps the part of a convex polygon where dot(n, p) >= least.
void clip(std::vector<Vec2>& polygon, const Vec2& n, double least) {
  std::vector<Vec2> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec2& p = polygon[i];
    const Vec2& q = polygon[(i + 1) % polygon.size()];
    const double at_p = glm::dot(n, p) - least;
    const double at_q = glm::dot(n, q) - least;
    if (at_p >= 0) kept.push_back(p);
    if ((at_p >= 0) != (at_q >= 0)) kept.push_back(p + (q - p) * (at_p / (at_p - at_q)));
  }
  polygon = std::move(kept);
}

/// The part of the grid behind a wall, and `around` it, as triangles.
void add_polygon(const OrthographicMap::Grid& grid, const Vec2& eye, const ShadowWall& wall,
                 double around, std::uint32_t index, std::vector<Corner>& corners) {
  const Vec2 lo = grid.lo - eye;
  const Vec2 size = grid.square_m * Vec2{grid.columns, grid.rows};
  std::vector<Vec2> polygon{lo, lo + Vec2{size.x, 0}, lo + size, lo + Vec2{0, size.y}};
  const Vec2 a{wall.a[0], wall.a[1]};
  const Vec2 b{wall.b[0], wall.b[1]};
  const Vec2 plane{wall.plane[0], wall.plane[1]};
  clip(polygon, {-a.y, a.x}, -around * glm::length(a));
  clip(polygon, {b.y, -b.x}, -around * glm::length(b));
  clip(polygon, plane, 1 - around * glm::length(plane));
  const auto corner = [&](const Vec2& p) {
    const Vec2 at = 2.0 * (p - lo) / size - 1.0;
    corners.push_back({static_cast<float>(at.x), static_cast<float>(at.y), index});
  };
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    corner(polygon[0]);
    corner(polygon[i - 1]);
    corner(polygon[i]);
  }
}

}  // namespace

Result<std::unique_ptr<GlShadowMap>> GlShadowMap::create(std::unique_ptr<GlContext> context,
                                                         const OrthographicMap& map,
                                                         std::size_t most_walls) {
  std::unique_ptr<GlShadowMap> shadows(new GlShadowMap(std::move(context), map.grid()));
  if (auto s = shadows->prepare(most_walls); !s) return s.error();
  return shadows;
}

Status GlShadowMap::prepare(std::size_t most_walls) {
  const auto current = context_->make_current();
  if (!current) return current.error();
  if (grid_.columns == 0) return ok();
  GLint blocks = 0;
  glGetIntegerv(GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS, &blocks);
  if (blocks < 1)
    return unsupported("OpenGL: fragment shaders have no storage buffers (" + context_->renderer() +
                       ")");
  GLint64 bytes = 0;
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &bytes);
  most_walls_ = std::min(static_cast<std::size_t>(std::max<GLint64>(bytes, 0)) / sizeof(ShadowWall),
                         most_walls > 0 ? most_walls : kMostWalls);
  const auto program = link_program(
      {{GL_VERTEX_SHADER, kShadowVertexShader}, {GL_FRAGMENT_SHADER, kShadowFragmentShader}},
      "shadows'");
  if (!program) return program.error();
  program_ = *program;
  glProgramUniform1d(program_, 1, grid_.square_m);
  glCreateTextures(GL_TEXTURE_2D, 1, &heights_);
  glTextureStorage2D(heights_, 1, GL_R32F, grid_.columns, grid_.rows);
  glCreateFramebuffers(1, &target_);
  glNamedFramebufferTexture(target_, GL_COLOR_ATTACHMENT0, heights_, 0);
  if (glCheckNamedFramebufferStatus(target_, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return unsupported("OpenGL: cannot draw into " + std::to_string(grid_.columns) + " x " +
                       std::to_string(grid_.rows) + " floating-point heights (" +
                       context_->renderer() + ")");
  glCreateBuffers(1, &walls_);
  glCreateBuffers(1, &corners_);
  glCreateVertexArrays(1, &array_);
  glVertexArrayVertexBuffer(array_, 0, corners_, 0, sizeof(Corner));
  glEnableVertexArrayAttrib(array_, 0);
  glVertexArrayAttribFormat(array_, 0, 2, GL_FLOAT, GL_FALSE, offsetof(Corner, x));
  glVertexArrayAttribBinding(array_, 0, 0);
  glEnableVertexArrayAttrib(array_, 1);
  glVertexArrayAttribIFormat(array_, 1, 1, GL_UNSIGNED_INT, offsetof(Corner, wall));
  glVertexArrayAttribBinding(array_, 1, 0);
  return context_->check();
}

Status GlShadowMap::draw(const std::vector<ShadowChain>& chains, const Vec3& eye,
                         OrthographicMap::Heights& heights) const {
  if (grid_.columns == 0) return ok();
  const std::lock_guard lock(mutex_);
  const auto current = context_->make_current();
  if (!current) return current.error();
  const GLfloat nothing[4] = {std::numeric_limits<float>::lowest(), 0, 0, 0};
  glViewport(0, 0, grid_.columns, grid_.rows);
  glBindFramebuffer(GL_FRAMEBUFFER, target_);
  glClearBufferfv(GL_COLOR, 0, nothing);
  glEnable(GL_BLEND);
  glBlendEquation(GL_MAX);
  glBindVertexArray(array_);
  glUseProgram(program_);
  glUniform2d(0, grid_.lo.x - eye.x, grid_.lo.y - eye.z);
  std::vector<ShadowWall> walls;
  std::vector<Corner> corners;
  bool begun = false;
  const auto flush = [&] {
    if (walls.empty()) return;
    // Some drivers overwrite a buffer that fragments yet to be drawn still read.
    if (begun) glFinish();
    begun = true;
    glNamedBufferData(corners_, static_cast<GLsizeiptr>(corners.size() * sizeof(Corner)),
                      corners.data(), GL_STREAM_DRAW);
    glNamedBufferData(walls_, static_cast<GLsizeiptr>(walls.size() * sizeof(ShadowWall)),
                      walls.data(), GL_STREAM_DRAW);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, walls_);
    glDrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(corners.size()));
    walls.clear();
    corners.clear();
  };
  for (const ShadowChain& chain : chains) {
    const std::size_t count = chain.plane.size();
    if (count > most_walls_) continue;  // hides nothing
    if (walls.size() + count > most_walls_) flush();
    const auto first = static_cast<std::uint32_t>(walls.size());
    for (std::size_t j = 0; j < count; ++j) {
      const Vec2& a = chain.corners[j];
      const Vec2& b = chain.corners[j + 1];
      const Vec2& plane = chain.plane[j];
      walls.push_back({{a.x, a.y},
                       {b.x, b.y},
                       {plane.x, plane.y},
                       chain.top,
                       first,
                       static_cast<std::uint32_t>(count)});
      add_polygon(grid_, ground(eye), walls.back(), std::numbers::sqrt2 * grid_.square_m,
                  static_cast<std::uint32_t>(walls.size() - 1), corners);
    }
  }
  flush();
  glReadBuffer(GL_COLOR_ATTACHMENT0);
  glReadPixels(0, 0, grid_.columns, grid_.rows, GL_RED, GL_FLOAT, heights.least.data());
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glDisable(GL_BLEND);
  // A context that was lost may have read back anything: asked before the answer is believed.
  return context_->check();
}

Result<std::unique_ptr<ShadowDrawer>> make_gl_shadow_map(const OrthographicMap& map,
                                                         Backend backend) {
  GlContext::Options wanted;
  wanted.hardware_only = backend == Backend::kAuto;
  auto context = GlContext::create(wanted);
  if (!context) return context.error();
  auto shadows = GlShadowMap::create(std::move(*context), map);
  if (!shadows) return shadows.error();
  return std::unique_ptr<ShadowDrawer>(std::move(*shadows));
}

}  // namespace ivis
