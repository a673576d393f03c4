#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "visibility/gl/gl_context.h"
#include "visibility/method.h"
#include "visibility/piece_choice.h"
#include "visibility/solid_index.h"

namespace ivis {

/// The occlusion map of visibility/occlusion_map.h on OpenGL: the same six faces and the same rule
/// for pieces, levels and sheets; near / w in single precision instead of 16 bits; every piece is
/// drawn and every object tested, as the hardware has more of both than the CPU has of patience.
///
/// Guarantee: conservative. The argument of docs/theory.md, 3 and 9, with what a rasteriser adds:
///
/// *Snapping.* OpenGL moves corners to a grid of at least 4 bits a pixel. A point of the moved
/// triangle is, by its weights, within s pixels in each axis of a point of the true one, s = one
/// step of the grid and 1/64 for the rounding of division, viewport and clipping. So where a
/// pixel's centre counts as covered, there is c', within s of it in each axis, in whose ray the
/// face is really met, at X' of depth w'. Any line of sight through the pixel passes within half a
/// diagonal and s sqrt(2) of X' at that depth: the margin's factor is 1.01 sqrt(2) (1 + 2 s), a
/// pixel being 2 w / n wide. It blocks what is deeper than w', and what is stored is no nearer than
/// that: the plane's near / w at the centre, less s (|d/di| + |d/dj|), which is at most its value
/// at c'. Of a sheet the line of sight meets the plane itself within the pixel: half a pixel's
/// change, no snap, makes the farthest depth; the snap is in the radius by the same margin (X_c of
/// occluders/sheets.h is X').
///
/// *Depth* is not interpolated: each fragment evaluates its face's plane at its pixel's indices,
/// from three numbers that are the same for the whole face, with the guards of the CPU's
/// (kDepthGuard, kEdgeOn). No bias has to guess at an interpolator. The price is the early depth
/// test.
///
/// *Clipping.* Corners have z = 0: neither the near nor the far plane takes anything, what is
/// nearer than near_m saturates (errs to visible). Of the sides of the frustum: a new corner is
/// off by a few 2^-24 of the face's size, so by less than 1/64 of a pixel while no corner's w is
/// less than n / 2^15 of that size. Where one is less, or behind the eye, the fragment asks the
/// face's four edge planes itself, as the CPU's rasteriser does, and is dropped outside; pixels
/// that this loses are lost to visible. (Where the rasteriser leaves pixels out that it should
/// cover, too.)
///
/// *Boxes* are tested as by the CPU: every pixel of an outer rectangle on every face touched, by
/// way of a pyramid of least values. A rectangle that would take long counts as visible.
///
/// Threads:   solve() is const and reentrant; solves take turns, in whichever thread calls, which
///            keeps the EGL context that it had.
/// Errors:    as OcclusionMap; kUnsupported when the context is gone or lost.
/// Cost:      O(pieces + objects), on the CPU for the pieces' choice only; reading back waits.
/// Source:    as OcclusionMap.
class GlOcclusionMap : public Method {
 public:
  struct Stats {
    std::uint32_t pieces_drawn = 0;
    std::uint32_t faces_drawn = 0;  ///< front or back, a side of the cube each
  };

  /// Errors: kUnsupported: the context lacks something, or the scene is too large for it.
  /// `page_bytes`: how much of the faces shaders see at a time; 0: as much as the context lets
  /// them. For tests.
  static Result<std::unique_ptr<GlOcclusionMap>> create(
      std::unique_ptr<GlContext> context, const Scene& scene, const OccluderSet& occluders,
      const MethodOptions& options, const OcclusionGuards& guards = {}, std::size_t page_bytes = 0);
  const MethodTraits& traits() const override;
  Backend backend() const override { return Backend::kGl; }
  Result<Pvs> solve(const ViewCell& cell) const override;
  Result<Pvs> solve(const ViewCell& cell, Stats& stats) const;

  /// For tests of a context that goes away.
  GlContext& context() { return *context_; }

 private:
  /// Of the buffer of faces, which is bound a page at a time; no level goes over a page's end.
  struct Level {
    std::uint32_t page = 0;
    std::uint32_t first = 0;  ///< in the page
    std::uint32_t faces = 0;
  };

  GlOcclusionMap(std::unique_ptr<GlContext> context, const Scene& scene,
                 const OccluderSet& occluders, const MethodOptions& options,
                 const OcclusionGuards& guards);
  Status prepare(std::size_t page_bytes);
  Result<std::vector<float>> take_faces(std::size_t page_bytes);
  Status make_programs();
  Status make_map();
  Status upload(const std::vector<float>& faces, const std::vector<float>& boxes);
  void draw(const MapCell& cell) const;
  void choose(const MapCell& cell, Stats& stats) const;
  void run(const MapCell& cell) const;

  const Scene& scene_;
  const OccluderSet& occluders_;
  MethodOptions options_;
  OcclusionGuards guards_;
  MapFrame frame_;
  float near_m_;
  std::vector<ObjectId> always_visible_;
  std::vector<ObjectId> ids_;  ///< of the boxes; some objects have several
  OccluderPieces pieces_;
  std::vector<Level> levels_;  ///< as pieces_.levels, in the buffer of faces
  SolidIndex solids_;

  // Names in the context, which frees them when it goes.
  std::uint32_t draw_program_ = 0, pyramid_program_ = 0, test_program_ = 0;
  std::uint32_t depth_ = 0, targets_[6] = {}, empty_array_ = 0;
  std::uint32_t faces_ = 0, refs_ = 0, pyramid_ = 0, boxes_ = 0, visible_ = 0;
  std::size_t page_bytes_ = 0;
  std::vector<std::size_t> pages_;    ///< bytes used of each
  std::vector<std::int32_t> begins_;  ///< of the pyramid's levels 1, 2, ...
  float snap_ = 0;

  mutable std::mutex mutex_;
  /// Faces to draw, a list a page and side: refs_of_[6 * page + side].
  mutable std::vector<std::vector<std::uint32_t>> refs_of_;
  mutable std::vector<std::uint32_t> bits_, found_;
  mutable std::vector<std::uint64_t> scratch_;
  std::unique_ptr<GlContext> context_;
};

/// What MethodOptions::make_gl takes: of hardware only if options.backend is Backend::kAuto.
Result<std::unique_ptr<Method>> make_gl_occlusion_map(const Scene& scene,
                                                      const OccluderSet& occluders,
                                                      const MethodOptions& options);

}  // namespace ivis
