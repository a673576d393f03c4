#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/math.h"
#include "core/result.h"

namespace ivis {

/// The set V of movement vectors an observer may make while a solution is in use: convex, contains
/// 0, symmetric about it. Written as on the command line: ball:r, disc:r, cylinder:r,h,
/// ellipsoid:a,b,c, box:a,b,c (metres; h, a, b, c are half-extents; disc and cylinder stand
/// upright). Threads: a value; all members are const and reentrant. Source:  Wonka, Wimmer, Sillion
/// 2001, section 5.4. Departs: V is star-shaped about 0, which the
///          paper's Lemma 5.1 needs and does not state.
class Reach {
 public:
  enum class Kind { kBall, kDisc, kCylinder, kEllipsoid, kBox };

  Reach() = default;  ///< the single point 0
  static Reach ball(double r) { return {Kind::kBall, {r, r, r}}; }
  static Reach disc(double r) { return {Kind::kDisc, {r, 0, r}}; }
  static Reach cylinder(double r, double half_height) {
    return {Kind::kCylinder, {r, half_height, r}};
  }
  static Reach ellipsoid(const Vec3& semi_axes) { return {Kind::kEllipsoid, semi_axes}; }
  static Reach box(const Vec3& half_extents) { return {Kind::kBox, half_extents}; }

  /// Errors: kInvalidArgument, naming the text and what was expected. Sizes must be finite, >= 0
  /// and at most 1e6 m; a radius of 0 is the single point.
  static Result<Reach> parse(std::string_view text);
  std::string to_string() const;

  Kind kind() const { return kind_; }
  /// Half the size of the bounding box, metres.
  const Vec3& half_extents() const { return e_; }
  /// max over v in V of v·d; d of any length.
  double support(const Vec3& d) const;
  /// Is v in V, its half-extents grown by `horizontal` in x and z and by `vertical` in y, metres?
  bool contains(const Vec3& v, double horizontal = 0, double vertical = 0) const;
  /// Is every v of `other` in V, give or take `tolerance`? Exact for every pair of kinds.
  bool contains(const Reach& other, double tolerance = 0) const;
  /// A reach that contains the Minkowski sum of V with the upright cylinder of radius `horizontal`
  /// and half-height `vertical`, metres. What occluders are shrunk by; a ball becomes the cylinder
  /// that holds the sum, so this is not for containment tests.
  Reach grown(double horizontal, double vertical) const;
  /// Is the section with the ground plane a rectangle (box) rather than an ellipse?
  bool horizontal_is_box() const { return kind_ == Kind::kBox; }
  /// Convex polygon in (x, z), counter-clockwise when x points right and z up the page, that
  /// contains V's shadow on the ground plane: tangent k-gon of the ellipse, or the rectangle
  /// itself. One side has the outward normal `toward` (so an edge parallel to that side loses
  /// nothing). k >= 4.
  std::vector<Vec2> circumscribed_polygon(int k, const Vec2& toward = {1, 0}) const;
  /// `n` vectors on V's boundary that between them come near every extreme position, top and bottom
  /// rims first; deterministic.
  std::vector<Vec3> extreme_points(int n) const;

  bool operator==(const Reach&) const = default;

 private:
  Reach(Kind kind, const Vec3& e) : kind_(kind), e_(e) {}
  Kind kind_ = Kind::kBall;
  Vec3 e_{0};
};

}  // namespace ivis
