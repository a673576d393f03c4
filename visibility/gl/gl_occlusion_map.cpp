#include "visibility/gl/gl_occlusion_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>

#include <epoxy/gl.h>

#include "core/assert.h"
#include "visibility/answer.h"
#include "visibility/gl/gl_program.h"
#include "visibility/gl/gl_shaders.h"
#include "visibility/sub_boxes.h"

namespace ivis {
namespace {

constexpr GLint kFaceBytes = 64;
/// A face at most is drawn on a side: so its refs, a sixteenth as many bytes, fit in any page, and
/// its vertices into the 31 bits that a draw call counts in.
constexpr GLint kMostPageBytes = 1 << 30;
constexpr double kRoundingPixels = 1.0 / 64;

float down(double v) {
  const auto f = static_cast<float>(v);
  return f > v ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}
float up(double v) {
  const auto f = static_cast<float>(v);
  return f < v ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

GLint limit(GLenum name) {
  GLint value = 0;
  glGetIntegerv(name, &value);
  return value;
}

/// Sides of the cube on which a part of the box lies deeper than near_m.
std::uint32_t sides_of(const OccluderPieces::Piece& piece, const Vec3& eye, double near_m) {
  double lo[3];
  double hi[3];
  double gap[3];
  for (int a = 0; a < 3; ++a) {
    lo[a] = static_cast<double>(piece.lo[a]) - eye[a];
    hi[a] = static_cast<double>(piece.hi[a]) - eye[a];
    gap[a] = std::max(lo[a], -hi[a]);
  }
  std::uint32_t sides = 0;
  for (std::uint32_t side = 0; side < 6; ++side) {
    const auto w = side >> 1U;
    const double deepest = (side & 1U) != 0 ? -lo[w] : hi[w];
    if (std::max({gap[(w + 1) % 3], gap[(w + 2) % 3], 0.0}) <= deepest && deepest >= near_m)
      sides |= 1U << side;
  }
  return sides;
}

}  // namespace

GlOcclusionMap::GlOcclusionMap(std::unique_ptr<GlContext> context, const Scene& scene,
                               const OccluderSet& occluders, const MethodOptions& options,
                               const OcclusionGuards& guards)
    : scene_(scene),
      occluders_(occluders),
      options_(options),
      guards_(guards),
      frame_(choose_frame(scene, occluders.slack_m)),
      near_m_(near_for(occluders.reach)),
      pieces_(make_pieces(scene, occluders, frame_)),
      solids_(occluders),
      context_(std::move(context)) {
  options_.map_pixels = pixels_for(options.map_pixels, occluders.reach);
}

Result<std::unique_ptr<GlOcclusionMap>> GlOcclusionMap::create(
    std::unique_ptr<GlContext> context, const Scene& scene, const OccluderSet& occluders,
    const MethodOptions& options, const OcclusionGuards& guards, std::size_t page_bytes) {
  std::unique_ptr<GlOcclusionMap> map(
      new GlOcclusionMap(std::move(context), scene, occluders, options, guards));
  const std::uint32_t pixels = map->options_.map_pixels;
  IVIS_ASSERT(pixels % 16 == 0 && pixels >= 64 && pixels <= 4096,
              "pixels a face: a multiple of 16 from 64 to 4096");
  if (auto s = map->prepare(page_bytes); !s) return s.error();
  return map;
}

const MethodTraits& GlOcclusionMap::traits() const {
  static const MethodTraits same = [] {
    for (MethodTraits& t : method_list())
      if (t.name == "occlusion-map") return t;
    return MethodTraits{};
  }();
  return same;
}

/// The pieces' faces as the shaders read them, in pages.
Result<std::vector<float>> GlOcclusionMap::take_faces(std::size_t page_bytes) {
  const auto most = static_cast<std::size_t>(
      std::clamp(limit(GL_MAX_SHADER_STORAGE_BLOCK_SIZE), 0, kMostPageBytes));
  const auto step = static_cast<std::size_t>(
      std::max(limit(GL_SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT), kFaceBytes));
  if (!std::has_single_bit(step))
    return unsupported("OpenGL: storage buffers are aligned to " + std::to_string(step) +
                       " bytes (" + context_->renderer() + ")");
  page_bytes_ = (page_bytes > 0 ? std::min(page_bytes, most) : most) / step * step;
  std::vector<float> faces;
  levels_.reserve(pieces_.levels.size());
  std::size_t begin = 0;  // of the page, in bytes
  std::size_t end = 0;
  for (const OccluderPieces::Level& level : pieces_.levels) {
    std::vector<float> values;
    for (const FaceBatch& b : pieces_.faces(level))
      for (std::uint32_t lane = 0; lane < FaceBatch::kWidth; ++lane) {
        if (b.nx[lane] == 0 && b.ny[lane] == 0 && b.nz[lane] == 0) continue;
        const float fourth[4] = {b.nx[lane], b.ny[lane], b.nz[lane], 0};
        for (std::size_t c = 0; c < 4; ++c)
          values.insert(values.end(), {b.x[c][lane], b.y[c][lane], b.z[c][lane], fourth[c]});
      }
    const std::size_t bytes = values.size() * sizeof(float);
    if (bytes > page_bytes_)
      return unsupported("OpenGL: an occluder takes " + std::to_string(bytes) + " bytes, at most " +
                         std::to_string(page_bytes_) + " fit (" + context_->renderer() + ")");
    if (end + bytes - begin > page_bytes_) {
      pages_.push_back(end - begin);
      begin += page_bytes_;
      end = begin;
      faces.resize(begin / sizeof(float));
    }
    levels_.push_back({static_cast<std::uint32_t>(pages_.size()),
                       static_cast<std::uint32_t>((end - begin) / kFaceBytes),
                       static_cast<std::uint32_t>(bytes / kFaceBytes)});
    faces.insert(faces.end(), values.begin(), values.end());
    end += bytes;
  }
  if (end > begin) pages_.push_back(end - begin);
  refs_of_.resize(6 * pages_.size());
  pieces_.batches = {};  // the context has them
  return faces;
}

Status GlOcclusionMap::prepare(std::size_t page_bytes) {
  std::vector<float> boxes;
  const SubBoxes sub_boxes(scene_, frame_);
  for (ObjectId id = 0; id < scene_.objects.size(); ++id) {
    const Object& o = scene_.objects[id];
    if (o.always_visible) {
      always_visible_.push_back(id);
      continue;
    }
    const auto add = [&](const Vec3& lo, const Vec3& hi) {
      ids_.push_back(id);
      boxes.insert(boxes.end(),
                   {down(lo.x), down(lo.y), down(lo.z), 0, up(hi.x), up(hi.y), up(hi.z), 0});
    };
    // Of an object with smaller boxes these alone: one of them shows where the object does.
    if (const std::uint32_t node = sub_boxes.node_of(id); node != SubBoxes::kNone) {
      const BoxTree::Node& parts = sub_boxes.tree().nodes[node];
      for (std::uint32_t c = 0; c < parts.count; ++c)
        add({parts.lo_x[c], parts.lo_y[c], parts.lo_z[c]},
            {parts.hi_x[c], parts.hi_y[c], parts.hi_z[c]});
    } else {
      const Aabb box = bounds_in(frame_, scene_, o);
      add(box.lo, box.hi);
    }
  }

  const auto current = context_->make_current();
  if (!current) return current.error();
  const auto faces = take_faces(page_bytes);
  if (!faces) return faces.error();
  // No more than what the standard promises, whatever the driver says.
  const int bits = std::clamp(limit(GL_SUBPIXEL_BITS), 0, 4);
  snap_ = static_cast<float>(std::exp2(-bits) + kRoundingPixels);
  if (auto s = make_programs(); !s) return s;
  if (auto s = make_map(); !s) return s;
  if (auto s = upload(*faces, boxes); !s) return s;
  return context_->check();
}

Status GlOcclusionMap::make_programs() {
  if (limit(GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS) < 2)
    return unsupported("OpenGL: vertex shaders have no storage buffers (" + context_->renderer() +
                       ")");
  const auto draw =
      link_program({{GL_VERTEX_SHADER, kDrawVertexShader}, {GL_FRAGMENT_SHADER, kDrawFragmentShader}},
           "drawing");
  if (!draw) return draw.error();
  const auto pyramid = link_program({{GL_COMPUTE_SHADER, kPyramidShader}}, "pyramid's");
  if (!pyramid) return pyramid.error();
  const auto test = link_program({{GL_COMPUTE_SHADER, kTestShader}}, "test's");
  if (!test) return test.error();
  draw_program_ = *draw;
  pyramid_program_ = *pyramid;
  test_program_ = *test;

  const auto pixels = static_cast<float>(options_.map_pixels);
  glProgramUniform1f(draw_program_, 2, pixels);
  glProgramUniform1f(draw_program_, 3, near_m_);
  glProgramUniform1f(draw_program_, 4, snap_);
  glProgramUniform1f(draw_program_, 5, kDepthGuard);
  glProgramUniform1f(draw_program_, 6, kEdgeOn);
  glProgramUniform1f(draw_program_, 7, pixels / 32768);
  glProgramUniform1ui(test_program_, 1, static_cast<GLuint>(ids_.size()));
  glProgramUniform1f(test_program_, 2, pixels);
  glProgramUniform1f(test_program_, 3, near_m_);
  glProgramUniform1f(test_program_, 4, kPixelGuard);
  glProgramUniform1f(test_program_, 5, kRelative);
  return ok();
}

Status GlOcclusionMap::make_map() {
  const auto n = static_cast<GLsizei>(options_.map_pixels);
  glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &depth_);
  glTextureStorage3D(depth_, 1, GL_DEPTH_COMPONENT32F, n, n, 6);
  glTextureParameteri(depth_, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTextureParameteri(depth_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  glTextureParameteri(depth_, GL_TEXTURE_COMPARE_MODE, GL_NONE);
  glCreateFramebuffers(6, targets_);
  for (GLint side = 0; side < 6; ++side) {
    glNamedFramebufferTextureLayer(targets_[side], GL_DEPTH_ATTACHMENT, depth_, 0, side);
    glNamedFramebufferDrawBuffer(targets_[side], GL_NONE);
    glNamedFramebufferReadBuffer(targets_[side], GL_NONE);
    if (glCheckNamedFramebufferStatus(targets_[side], GL_DRAW_FRAMEBUFFER) !=
        GL_FRAMEBUFFER_COMPLETE)
      return unsupported("OpenGL: cannot draw into a depth map of " + std::to_string(n) +
                         " pixels a side (" + context_->renderer() + ")");
  }
  std::int32_t values = 0;
  for (std::int32_t width = n; width > 4;) {
    width = (width + 3) / 4;
    begins_.push_back(values);
    values += 6 * width * width;
  }
  IVIS_ASSERT(!begins_.empty() && begins_.size() <= 8, "levels of the pyramid");
  glProgramUniform1i(test_program_, 6, static_cast<GLint>(begins_.size()));
  // By level, so that no compiler sees an index of -1 in the branch that level 0 does not take.
  glProgramUniform1iv(test_program_, 8, static_cast<GLsizei>(begins_.size()), begins_.data());
  glCreateBuffers(1, &pyramid_);
  glNamedBufferStorage(pyramid_, static_cast<GLsizeiptr>(values) * 4, nullptr, 0);
  glCreateVertexArrays(1, &empty_array_);
  return ok();
}

Status GlOcclusionMap::upload(const std::vector<float>& faces, const std::vector<float>& boxes) {
  const auto most = static_cast<std::size_t>(limit(GL_MAX_SHADER_STORAGE_BLOCK_SIZE));
  if (boxes.size() * sizeof(float) > most)
    return unsupported("OpenGL: the objects take " + std::to_string(boxes.size() * sizeof(float)) +
                       " bytes, at most " + std::to_string(most) + " fit (" + context_->renderer() +
                       ")");
  const auto fill = [](GLuint& buffer, const std::vector<float>& values) {
    const float none = 0;
    glCreateBuffers(1, &buffer);
    glNamedBufferStorage(buffer,
                         static_cast<GLsizeiptr>(std::max<std::size_t>(values.size(), 1) * 4),
                         values.empty() ? &none : values.data(), 0);
  };
  fill(faces_, faces);
  fill(boxes_, boxes);
  bits_.resize(std::max<std::size_t>((ids_.size() + 63) / 64 * 2, 2));
  glCreateBuffers(1, &visible_);
  glNamedBufferStorage(visible_, static_cast<GLsizeiptr>(bits_.size() * 4), nullptr, 0);
  glCreateBuffers(1, &refs_);
  return ok();
}

Result<Pvs> GlOcclusionMap::solve(const ViewCell& cell) const {
  Stats stats;
  return solve(cell, stats);
}

Result<Pvs> GlOcclusionMap::solve(const ViewCell& cell, Stats& stats) const {
  if (auto s = check_cell(cell, occluders_); !s) return s.error();
  Pvs pvs = empty_answer(scene_, cell);
  const MapCell c = make_map_cell(cell, frame_, occluders_);
  if (auto why = why_everything(cell.eye, c.eye, solids_, occluders_.slack_m); !why.empty()) {
    list_everything(scene_, std::move(why), pvs);
    return pvs;
  }
  const std::lock_guard lock(mutex_);
  const auto current = context_->make_current();
  if (!current) return current.error();
  choose(c, stats);
  found_.clear();
  if (!ids_.empty()) {
    run(c);
    // A context that was lost may have read back anything: asked before the answer is believed.
    if (auto s = context_->check(); !s) return s.error();
    for (std::size_t k = 0; k < ids_.size(); ++k)
      if ((bits_[k / 32] >> (k % 32) & 1U) != 0) found_.push_back(ids_[k]);
  }
  list_ascending(scene_.objects.size(), found_, always_visible_, scratch_, pvs);
  return pvs;
}

/// References to the faces to draw, a list a side.
void GlOcclusionMap::choose(const MapCell& cell, Stats& stats) const {
  const auto pixels = static_cast<double>(options_.map_pixels);
  const SampleMargin margin{1.01 * std::numbers::sqrt2 * (1 + 2 * static_cast<double>(snap_)),
                            pixels};
  for (auto& refs : refs_of_)
    refs.clear();
  const auto add = [&](const OccluderPieces::Piece& piece) {
    const std::uint32_t touched = sides_of(piece, cell.eye, static_cast<double>(near_m_));
    if (touched == 0) return;
    // Smaller than half a pixel: hides next to nothing.
    const Vec3 size = Vec3(piece.hi) - Vec3(piece.lo);
    Vec3 gap{0};
    for (int i = 0; i < 3; ++i)
      gap[i] = std::max({static_cast<double>(piece.lo[i]) - cell.eye[i],
                         cell.eye[i] - static_cast<double>(piece.hi[i]), 0.0});
    if (glm::dot(size, size) * pixels * pixels < glm::dot(gap, gap)) return;
    const PieceChoice chosen = choose_level(pieces_, piece, cell, margin, touched, guards_);
    if (chosen.sides == 0) return;
    ++stats.pieces_drawn;
    const Level& level = levels_[chosen.level];
    const std::uint32_t sheet = piece.kind == OccluderPieces::Kind::kSheet ? 1 : 0;
    for (std::uint32_t left = chosen.sides; left != 0; left &= left - 1) {
      auto& refs = refs_of_[6 * level.page + static_cast<std::uint32_t>(std::countr_zero(left))];
      for (std::uint32_t f = level.first; f < level.first + level.faces; ++f)
        refs.push_back(2 * f + sheet);
    }
  };
  if (options_.max_occluders > 0 && options_.max_occluders < pieces_.pieces.size()) {
    std::vector<std::uint32_t> all(pieces_.pieces.size());
    std::iota(all.begin(), all.end(), 0U);
    for (const std::uint32_t p : largest_pieces(pieces_, cell.eye, options_.max_occluders, all))
      add(pieces_.pieces[p]);
  } else {
    for (const OccluderPieces::Piece& piece : pieces_.pieces)
      add(piece);
  }
  for (const auto& refs : refs_of_)
    stats.faces_drawn += static_cast<std::uint32_t>(refs.size());
}

void GlOcclusionMap::draw(const MapCell& cell) const {
  const auto n = static_cast<GLsizei>(options_.map_pixels);
  const GLfloat nothing = 0;
  glViewport(0, 0, n, n);
  glDepthMask(GL_TRUE);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_GREATER);
  glBindVertexArray(empty_array_);
  glUseProgram(draw_program_);
  glUniform3f(0, cell.single[0], cell.single[1], cell.single[2]);
  for (std::uint32_t side = 0; side < 6; ++side) {
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, targets_[side]);
    glClearBufferfv(GL_DEPTH, 0, &nothing);
    glUniform1ui(1, side);
    for (std::size_t page = 0; page < pages_.size(); ++page) {
      const auto& refs = refs_of_[6 * page + side];
      if (refs.empty()) continue;
      glNamedBufferData(refs_, static_cast<GLsizeiptr>(refs.size() * 4), refs.data(),
                        GL_STREAM_DRAW);
      glBindBufferRange(GL_SHADER_STORAGE_BUFFER, 0, faces_,
                        static_cast<GLintptr>(page * page_bytes_),
                        static_cast<GLsizeiptr>(pages_[page]));
      glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, refs_);
      glDrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(6 * refs.size()));
    }
  }
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
}

/// Draws, builds the pyramid, tests, and reads `bits_` back.
void GlOcclusionMap::run(const MapCell& cell) const {
  const auto n = static_cast<GLsizei>(options_.map_pixels);
  draw(cell);
  glBindTextureUnit(0, depth_);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, pyramid_);
  glUseProgram(pyramid_program_);
  GLint width = n;
  GLint below = -1;
  for (const std::int32_t here : begins_) {
    const GLint half = (width + 3) / 4;
    glUniform1i(0, below);
    glUniform1i(1, width);
    glUniform1i(2, here);
    glUniform1i(3, half);
    glDispatchCompute(static_cast<GLuint>(half + 7) / 8, static_cast<GLuint>(half + 7) / 8, 6);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    below = here;
    width = half;
  }

  glUseProgram(test_program_);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 3, boxes_);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 4, visible_);
  glUniform3f(0, cell.single[0], cell.single[1], cell.single[2]);
  const auto groups = static_cast<GLuint>((ids_.size() + 63) / 64);
  const GLuint columns = std::min(groups, 32768U);
  // What is not written shows.
  const GLuint shown = 0xffffffffU;
  glClearNamedBufferData(visible_, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &shown);
  std::fill(bits_.begin(), bits_.end(), shown);
  glDispatchCompute(columns, (groups + columns - 1) / columns, 1);
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glGetNamedBufferSubData(visible_, 0, static_cast<GLsizeiptr>(bits_.size() * 4), bits_.data());
}

Result<std::unique_ptr<Method>> make_gl_occlusion_map(const Scene& scene,
                                                      const OccluderSet& occluders,
                                                      const MethodOptions& options) {
  GlContext::Options wanted;
  wanted.hardware_only = options.backend == Backend::kAuto;
  auto context = GlContext::create(wanted);
  if (!context) return context.error();
  auto map = GlOcclusionMap::create(std::move(*context), scene, occluders, options);
  if (!map) return map.error();
  return std::unique_ptr<Method>(std::move(*map));
}

}  // namespace ivis
