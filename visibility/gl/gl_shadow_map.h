#pragma once

#include <cstdint>
#include <memory>
#include <mutex>

#include "visibility/gl/gl_context.h"
#include "visibility/method.h"
#include "visibility/orthographic_map.h"

namespace ivis {

/// The shadows of the orthographic cull map as polygons on OpenGL, with a maximum as the blending.
///
/// Guarantee: a fragment asks of its square, in double precision, all that
/// OrthographicMap::draw_chain() asks, and writes the same height or nothing. The rasteriser only
/// proposes squares, those with their centre in the area behind a wall and a square's diagonal
/// around it; one that it leaves out stays without shadow. A square that lies wholly in a chain's
/// shadow has its centre behind one of the chain's walls, so none is lost.
///
/// Threads:   draw() is const and reentrant; draws take turns, in whichever thread calls, which
///            keeps the EGL context that it had.
/// Cost:      O(squares in the shadows of all solids) on the graphics card; reads the grid back,
///            4 bytes a square.
/// Source:    Wonka and Schmalstieg 1999; Wonka, Wimmer, Sillion 2001, section 5.1.
/// Departs:   the fragment works the height out, nothing is interpolated; squares are written that
///            lie in the shadow whole, so that no polygon needs to be moved by half a pixel.
class GlShadowMap : public ShadowDrawer {
 public:
  /// Errors: kUnsupported: the context lacks something. `most_walls`: drawn at a time; 0: as many
  /// as the context lets shaders see. For tests.
  static Result<std::unique_ptr<GlShadowMap>> create(std::unique_ptr<GlContext> context,
                                                     const OrthographicMap& map,
                                                     std::size_t most_walls = 0);
  Status draw(const std::vector<ShadowChain>& chains, const Vec3& eye,
              OrthographicMap::Heights& heights) const override;

  /// For tests of a context that goes away.
  GlContext& context() { return *context_; }

 private:
  GlShadowMap(std::unique_ptr<GlContext> context, const OrthographicMap::Grid& grid)
      : grid_(grid), context_(std::move(context)) {}
  Status prepare(std::size_t most_walls);

  OrthographicMap::Grid grid_;
  std::size_t most_walls_ = 0;  ///< that shaders see at a time; a longer chain hides nothing
  // Names in the context, which frees them when it goes.
  std::uint32_t program_ = 0, heights_ = 0, target_ = 0, walls_ = 0, corners_ = 0, array_ = 0;
  mutable std::mutex mutex_;
  std::unique_ptr<GlContext> context_;
};

/// What MethodOptions::make_gl_shadows takes: of hardware only for Backend::kAuto.
Result<std::unique_ptr<ShadowDrawer>> make_gl_shadow_map(const OrthographicMap& map,
                                                         Backend backend);

}  // namespace ivis
