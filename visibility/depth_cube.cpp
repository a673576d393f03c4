#include "visibility/depth_cube.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/assert.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "visibility/depth_cube.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ivis::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::uint32_t kW = BoxTree::kWidth;
constexpr std::uint32_t kBlock = DepthCube::kBlock;
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kMostQ = 65535.0F;

using D = hn::CappedTag<float, kW>;
using DI = hn::RebindToSigned<D>;
using DQ = hn::CappedTag<std::int16_t, kBlock>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

constexpr D d;
constexpr DI di;
constexpr DQ dq;

/// Axes of u and v on the faces that look along each axis.
constexpr int kAxisU[3] = {2, 0, 0};
constexpr int kAxisV[3] = {1, 2, 1};

template <class Mask>
HWY_INLINE std::uint32_t bits_of(Mask m) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, m, bytes);
  std::uint32_t bits = 0;
  std::memcpy(&bits, bytes, sizeof bits);
  return bits & ((1U << hn::Lanes(d)) - 1U);
}

// ---- drawing ----

/// Are all columns of the block at least q?
HWY_INLINE bool block_reaches(const std::int16_t* columns, std::int16_t q) {
  const auto want = hn::Set(dq, q);
  auto low = hn::Lt(want, want);
  for (std::uint32_t l = 0; l < kBlock; l += static_cast<std::uint32_t>(hn::Lanes(dq)))
    low = hn::Or(low, hn::Lt(hn::Load(dq, columns + l), want));
  return hn::AllFalse(dq, low);
}

/// Sixteen faces as seen from the eye: corners, edge planes (inside >= 0) and K / w as a linear
/// function of direction.
struct Setup {
  alignas(64) float p[3][4][kW];
  alignas(64) float edge[3][4][kW];
  alignas(64) float guard[4][kW];  ///< what an edge plane's value may be off by, in any direction
  alignas(64) float g[3][kW];
  std::uint32_t front = 0;
};

HWY_INLINE void set_up(const FaceBatch& batch, const float* eye, float k, Setup& out) {
  out.front = 0;
  for (std::uint32_t l = 0; l < kW; l += static_cast<std::uint32_t>(hn::Lanes(d))) {
    V p[3][4];
    V size = hn::Zero(d);
    for (int c = 0; c < 4; ++c) {
      p[0][c] = hn::Sub(hn::Load(d, batch.x[c] + l), hn::Set(d, eye[0]));
      p[1][c] = hn::Sub(hn::Load(d, batch.y[c] + l), hn::Set(d, eye[1]));
      p[2][c] = hn::Sub(hn::Load(d, batch.z[c] + l), hn::Set(d, eye[2]));
      for (int a = 0; a < 3; ++a) {
        hn::Store(p[a][c], d, out.p[a][c] + l);
        size = hn::Max(size, hn::Abs(p[a][c]));
      }
    }
    const V n[3] = {hn::Load(d, batch.nx + l), hn::Load(d, batch.ny + l),
                    hn::Load(d, batch.nz + l)};
    const V away =
        hn::Add(hn::Add(hn::Mul(n[0], p[0][0]), hn::Mul(n[1], p[1][0])), hn::Mul(n[2], p[2][0]));
    const M front = hn::Lt(away, hn::Mul(size, hn::Set(d, -kEdgeOn)));
    out.front |= bits_of(front) << l;
    const V safe = hn::IfThenElse(front, away, hn::Set(d, -1.0F));
    const V share =
        hn::Add(hn::Set(d, 1.0F), hn::Mul(hn::Set(d, kDepthGuard), hn::Div(size, safe)));
    const V scale = hn::Div(hn::Mul(share, hn::Set(d, k)), safe);
    for (int a = 0; a < 3; ++a)
      hn::Store(hn::Mul(n[a], scale), d, out.g[a] + l);
    for (int c = 0; c < 4; ++c) {
      const int e = (c + 1) & 3;
      V along[3];
      for (int a = 0; a < 3; ++a)
        along[a] = hn::Sub(p[a][e], p[a][c]);
      // Each component is a difference of two rounded products of the edge and a corner's distance.
      const V length = hn::Add(hn::Add(hn::Abs(along[0]), hn::Abs(along[1])), hn::Abs(along[2]));
      hn::Store(hn::Mul(hn::Mul(length, size), hn::Set(d, kEdgeGuard)), d, out.guard[c] + l);
      for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3;
        const int f = (a + 2) % 3;
        hn::Store(hn::Sub(hn::Mul(along[b], p[f][c]), hn::Mul(along[f], p[b][c])), d,
                  out.edge[a][c] + l);
      }
    }
  }
}

struct Span2 {
  float u0, u1, v0, v1;
};

struct Corner {
  float a, b, w;
};

/// Bounds of a polygon's part with w >= |a|, |b| on the face; false if there is none. Bounds only:
/// the edges decide.
inline bool bounds_on_face(const Corner* corners, Span2& out) {
  Corner poly[12];
  Corner next[12];
  int n = 4;
  bool inside = true;
  for (int c = 0; c < 4; ++c) {
    poly[c] = corners[c];
    inside = inside && corners[c].w > 0 && std::abs(corners[c].a) <= corners[c].w &&
             std::abs(corners[c].b) <= corners[c].w;
  }
  if (!inside) {
    for (int plane = 0; plane < 4 && n > 0; ++plane) {
      const auto side = [&](const Corner& c) {
        return plane == 0 ? c.w - c.a : plane == 1 ? c.w + c.a : plane == 2 ? c.w - c.b : c.w + c.b;
      };
      int m = 0;
      for (int c = 0; c < n; ++c) {
        const Corner& from = poly[c];
        const Corner& to = poly[c + 1 == n ? 0 : c + 1];
        const float sf = side(from);
        const float st = side(to);
        if (sf >= 0) next[m++] = from;
        if ((sf >= 0) != (st >= 0)) {
          const float t = sf / (sf - st);
          next[m++] = {from.a + t * (to.a - from.a), from.b + t * (to.b - from.b),
                       from.w + t * (to.w - from.w)};
        }
      }
      n = m;
      std::copy(next, next + n, poly);
    }
    if (n == 0) return false;
  }
  out = {1, -1, 1, -1};
  for (int c = 0; c < n; ++c) {
    const float w = std::max(poly[c].w, 1e-12F);
    out.u0 = std::min(out.u0, poly[c].a / w);
    out.u1 = std::max(out.u1, poly[c].a / w);
    out.v0 = std::min(out.v0, poly[c].b / w);
    out.v1 = std::max(out.v1, poly[c].b / w);
  }
  return out.u0 <= out.u1 && out.v0 <= out.v1;
}

/// One face of a solid on one face of the cube, in pixels: K/w = at + along_i i + along_j j.
struct Raster {
  float at, along_i, along_j;
  /// Edges that bound rows on the left or right: i >= slope j + offset, i <= slope j + offset.
  float left_slope[4], left_offset[4];
  float right_slope[4], right_offset[4];
  /// Level edges: rows with slope j + offset >= 0 only.
  float row_slope[4], row_offset[4];
  int lefts = 0, rights = 0, rows = 0;
  int i0, i1, j0, j1;
};

/// Columns in the order in which two vectors of 32-bit lanes become one of 16-bit lanes: lane l of
/// the pair's first vector holds column lane[l] of the run, of its second lane[L + l].
struct PairOrder {
  alignas(64) float lane[2 * kW];

  PairOrder() {
#if HWY_TARGET != HWY_SCALAR
    const auto n = static_cast<std::uint32_t>(hn::Lanes(d));
    if (n == kBlock) return;
    const hn::Repartition<std::int16_t, D> dn;
    alignas(64) std::int16_t from[2 * kW];
    hn::Store(hn::ReorderDemote2To(dn, hn::Iota(di, 0), hn::Iota(di, static_cast<std::int32_t>(n))),
              dn, from);
    for (std::uint32_t k = 0; k < 2 * n; ++k)
      lane[from[k]] = static_cast<float>(k);
#endif
  }
};

/// q - 32768 of a run of columns of one row; -32768 outside the row's bounds. Adding 2^23 - 1/2
/// rounds x - 1/2 to the nearest integer, which is at most x, and leaves it in the low bits:
/// cheaper than a conversion that minds overflow.
template <bool kMasked>
HWY_INLINE auto depth_of(V i, V slope, const float* left, const float* right, const float* base,
                         std::uint32_t row) {
  const V raw =
      hn::Max(hn::Min(hn::Add(hn::Set(d, base[row]), slope), hn::Set(d, kMostQ)), hn::Zero(d));
  const auto q = hn::Sub(hn::BitCast(di, hn::Add(raw, hn::Set(d, 8388607.5F))),
                         hn::Set(di, 0x4b000000 + 32768));
  if constexpr (kMasked) {
    const M in = hn::And(hn::Ge(i, hn::Set(d, left[row])), hn::Le(i, hn::Set(d, right[row])));
    return hn::IfThenElse(hn::RebindMask(di, in), q, hn::Set(di, -32768));
  } else {
    return q;
  }
}

/// Rows that nothing is drawn into count for the least values too.
template <bool kFirst, class DN, class VN>
HWY_INLINE VN rest_of_block(DN dn, std::int16_t* q, std::uint32_t from, std::uint32_t to,
                            VN least) {
  const auto nothing = hn::Set(dn, -32768);
  for (std::uint32_t row = from; row < to; ++row) {
    std::int16_t* at = q + row * kBlock;
    if constexpr (kFirst) {
      hn::Store(nothing, dn, at);
      least = nothing;
    } else {
      least = hn::Min(least, hn::Load(dn, at));
    }
  }
  return least;
}

/// kFirst: nothing has been drawn there yet, and what the block holds is of an earlier solve.
template <bool kMasked, bool kFirst>
HWY_INLINE void draw_block(const Raster& r, const PairOrder& order, const float* left,
                           const float* right, const float* base, std::uint32_t column,
                           std::uint32_t b, std::uint32_t row0, std::uint32_t row1,
                           DepthCube& cube) {
  std::int16_t* q = cube.block(b);
  const auto start = static_cast<float>(column * kBlock);
  const V step = hn::Set(d, r.along_i);
#if HWY_TARGET == HWY_SCALAR
  constexpr bool kPairs = false;
  (void)order;
#else
  constexpr bool kPairs = hn::MaxLanes(d) < kBlock;
#endif
  if constexpr (kPairs) {
#if HWY_TARGET != HWY_SCALAR
    const hn::Repartition<std::int16_t, D> dn;
    const auto n = static_cast<std::uint32_t>(hn::Lanes(d));
    for (std::uint32_t l = 0; l < kBlock; l += 2 * n) {
      const V i0 = hn::Add(hn::Load(d, order.lane), hn::Set(d, start + static_cast<float>(l)));
      const V i1 = hn::Add(hn::Load(d, order.lane + n), hn::Set(d, start + static_cast<float>(l)));
      const V s0 = hn::Mul(i0, step);
      const V s1 = hn::Mul(i1, step);
      auto least = hn::Set(dn, 0x7fff);
      least = rest_of_block<kFirst>(dn, q + l, 0, row0, least);
      for (std::uint32_t row = row0; row <= row1; ++row) {
        auto drawn = hn::ReorderDemote2To(dn, depth_of<kMasked>(i0, s0, left, right, base, row),
                                          depth_of<kMasked>(i1, s1, left, right, base, row));
        std::int16_t* at = q + row * kBlock + l;
        if constexpr (!kFirst) drawn = hn::Max(drawn, hn::Load(dn, at));
        hn::Store(drawn, dn, at);
        least = hn::Min(least, drawn);
      }
      least = rest_of_block<kFirst>(dn, q + l, row1 + 1, kBlock, least);
      hn::Store(least, dn, cube.columns(b) + l);
    }
#endif
  } else {
    const hn::Rebind<std::int16_t, D> dn;
    for (std::uint32_t l = 0; l < kBlock; l += static_cast<std::uint32_t>(hn::Lanes(d))) {
      const V i = hn::Add(hn::Iota(d, 0.0F), hn::Set(d, start + static_cast<float>(l)));
      const V s = hn::Mul(i, step);
      auto least = hn::Set(dn, 0x7fff);
      least = rest_of_block<kFirst>(dn, q + l, 0, row0, least);
      for (std::uint32_t row = row0; row <= row1; ++row) {
        auto drawn = hn::DemoteTo(dn, depth_of<kMasked>(i, s, left, right, base, row));
        std::int16_t* at = q + row * kBlock + l;
        if constexpr (!kFirst) drawn = hn::Max(drawn, hn::Load(dn, at));
        hn::Store(drawn, dn, at);
        least = hn::Min(least, drawn);
      }
      least = rest_of_block<kFirst>(dn, q + l, row1 + 1, kBlock, least);
      hn::Store(least, dn, cube.columns(b) + l);
    }
  }
}

HWY_INLINE void draw_raster(const Raster& r, const PairOrder& order, std::uint32_t side,
                            DepthCube& cube, DepthStats& stats) {
  alignas(64) float left[kBlock];
  alignas(64) float right[kBlock];
  alignas(64) float base[kBlock];
  const std::uint32_t a_row = cube.blocks_a_row();
  const auto last_row = static_cast<std::uint32_t>(r.j1) / kBlock;
  for (std::uint32_t br = static_cast<std::uint32_t>(r.j0) / kBlock; br <= last_row; ++br) {
    V first = hn::Set(d, kInf);
    V last = hn::Set(d, -kInf);
    V all_first = last;  // of the columns that every row covers
    V all_last = first;
    for (std::uint32_t l = 0; l < kBlock; l += static_cast<std::uint32_t>(hn::Lanes(d))) {
      const V j = hn::Add(hn::Iota(d, 0.0F), hn::Set(d, static_cast<float>(br * kBlock + l)));
      V lo = hn::Set(d, static_cast<float>(r.i0));
      V hi = hn::Set(d, static_cast<float>(r.i1));
      M in = hn::And(hn::Ge(j, hn::Set(d, static_cast<float>(r.j0))),
                     hn::Le(j, hn::Set(d, static_cast<float>(r.j1))));
      for (int e = 0; e < r.lefts; ++e)
        lo = hn::Max(
            lo, hn::Add(hn::Mul(j, hn::Set(d, r.left_slope[e])), hn::Set(d, r.left_offset[e])));
      for (int e = 0; e < r.rights; ++e)
        hi = hn::Min(
            hi, hn::Add(hn::Mul(j, hn::Set(d, r.right_slope[e])), hn::Set(d, r.right_offset[e])));
      for (int e = 0; e < r.rows; ++e)
        in = hn::And(
            in, hn::Ge(hn::Add(hn::Mul(j, hn::Set(d, r.row_slope[e])), hn::Set(d, r.row_offset[e])),
                       hn::Zero(d)));
      in = hn::And(in, hn::Le(lo, hi));
      lo = hn::IfThenElse(in, lo, hn::Set(d, kInf));
      hi = hn::IfThenElse(in, hi, hn::Set(d, -kInf));
      hn::Store(lo, d, left + l);
      hn::Store(hi, d, right + l);
      hn::Store(hn::Add(hn::Mul(j, hn::Set(d, r.along_j)), hn::Set(d, r.at)), d, base + l);
      first = hn::Min(first, lo);
      last = hn::Max(last, hi);
      all_first = hn::Max(all_first, lo);
      all_last = hn::Min(all_last, hi);
    }
    const float lo = hn::GetLane(hn::MinOfLanes(d, first));
    const float hi = hn::GetLane(hn::MaxOfLanes(d, last));
    if (!(lo <= hi)) continue;
    const float full_lo = hn::GetLane(hn::MaxOfLanes(d, all_first));
    const float full_hi = hn::GetLane(hn::MinOfLanes(d, all_last));
    // Largest K/w over this row of blocks, to skip those where nothing nearer would come.
    const float base_most = std::max(base[0], base[kBlock - 1]);
    const auto top = static_cast<std::int32_t>(br * kBlock);
    const auto row0 = static_cast<std::uint32_t>(std::max(r.j0 - top, 0));
    const auto row1 =
        static_cast<std::uint32_t>(std::min(r.j1 - top, static_cast<std::int32_t>(kBlock) - 1));
    const auto c1 = static_cast<std::uint32_t>(hi) / kBlock;
    for (std::uint32_t c = static_cast<std::uint32_t>(lo) / kBlock; c <= c1; ++c) {
      const std::uint32_t b = side * cube.blocks_a_face() + br * a_row + c;
      const auto i = static_cast<float>(c * kBlock);
      const float most =
          base_most + std::max(r.along_i * i, r.along_i * (i + static_cast<float>(kBlock - 1)));
      if (!(most > 0)) continue;
      if (cube.is_touched(b) &&
          block_reaches(
              cube.columns(b),
              static_cast<std::int16_t>(static_cast<std::int32_t>(std::min(most, kMostQ)) - 32768)))
        continue;
      const bool full = i >= full_lo && i + static_cast<float>(kBlock - 1) <= full_hi;
      if (cube.touch(b)) {
        full ? draw_block<false, true>(r, order, left, right, base, c, b, row0, row1, cube)
             : draw_block<true, true>(r, order, left, right, base, c, b, row0, row1, cube);
      } else {
        full ? draw_block<false, false>(r, order, left, right, base, c, b, row0, row1, cube)
             : draw_block<true, false>(r, order, left, right, base, c, b, row0, row1, cube);
      }
      ++stats.blocks_drawn;
    }
  }
}

HWY_INLINE bool make_raster(const Setup& s, std::uint32_t lane, std::uint32_t side, bool sheet,
                            const DepthCube& cube, Raster& r) {
  const auto w = static_cast<int>(side >> 1U);
  const int u = kAxisU[w];
  const int v = kAxisV[w];
  const float sign = (side & 1U) != 0 ? -1.0F : 1.0F;
  Corner corners[4];
  for (int c = 0; c < 4; ++c)
    corners[c] = {s.p[u][c][lane], s.p[v][c][lane], sign * s.p[w][c][lane]};
  Span2 bounds;
  if (!bounds_on_face(corners, bounds)) return false;
  const auto n = static_cast<float>(cube.pixels());
  const float half = 0.5F * n;
  const DepthCube::Window& window = cube.window(side);
  const auto index = [&](float x) { return static_cast<int>(std::clamp(x, 0.0F, n - 1)); };
  r.i0 = index(std::ceil((bounds.u0 + 1) * half - 0.5F - kPixelGuard));
  r.i1 = index(std::floor((bounds.u1 + 1) * half - 0.5F + kPixelGuard));
  r.j0 = index(std::ceil((bounds.v0 + 1) * half - 0.5F - kPixelGuard));
  r.j1 = index(std::floor((bounds.v1 + 1) * half - 0.5F + kPixelGuard));
  r.i0 = std::max(r.i0, window.i0);
  r.i1 = std::min(r.i1, window.i1);
  r.j0 = std::max(r.j0, window.j0);
  r.j1 = std::min(r.j1, window.j1);
  if (r.i0 > r.i1 || r.j0 > r.j1) return false;
  const float step = 2 / n;
  const float v0 = 1 / n - 1;
  for (int c = 0; c < 4; ++c) {
    const float eu = s.edge[u][c][lane];
    const float ev = s.edge[v][c][lane];
    // On the face |u|, |v| <= 1: the guard moves the edge inwards by more than its rounding.
    const float ew = sign * s.edge[w][c][lane] - s.guard[c][lane];
    if (std::abs(eu) <= 1e-6F * (std::abs(ev) + std::abs(ew))) {
      if (ev == 0 && ew == 0) continue;  // a repeated corner
      r.row_slope[r.rows] = ev * step;
      r.row_offset[r.rows] = ev * v0 + ew - std::abs(eu);
      ++r.rows;
      continue;
    }
    const float slope = -ev / eu;
    const float offset = (1 - (ev * v0 + ew) / eu) * half - 0.5F;
    if (eu > 0) {
      r.left_slope[r.lefts] = slope;
      r.left_offset[r.lefts++] = offset;
    } else {
      r.right_slope[r.rights] = slope;
      r.right_offset[r.rights++] = offset;
    }
  }
  const float gu = s.g[u][lane];
  const float gv = s.g[v][lane];
  r.along_i = gu * step;
  r.along_j = gv * step;
  r.at = sign * s.g[w][lane] + (gu + gv) * v0;
  if (sheet) r.at -= (std::abs(gu) + std::abs(gv)) / n;
  return true;
}

void draw_faces_target(std::span<const FaceBatch> batches, const float* eye, std::uint32_t sides,
                       bool sheet, DepthCube& cube, DepthStats& stats) {
  Setup s;
  static const PairOrder order;
  const float k = kMostQ * cube.near_m();
  for (const FaceBatch& batch : batches) {
    set_up(batch, eye, k, s);
    for (std::uint32_t front = s.front; front != 0; front &= front - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(front));
      ++stats.faces_drawn;
      for (std::uint32_t left = sides; left != 0; left &= left - 1) {
        const auto side = static_cast<std::uint32_t>(std::countr_zero(left));
        Raster r;
        if (make_raster(s, lane, side, sheet, cube, r)) draw_raster(r, order, side, cube, stats);
      }
    }
  }
}

// ---- testing ----

constexpr std::int16_t kAny = 0x7fff;
alignas(64) constexpr std::int16_t kBefore[32] = {
    kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny,
    kAny,   kAny,   kAny,   kAny,   kAny,   -32768, -32768, -32768, -32768, -32768, -32768,
    -32768, -32768, -32768, -32768, -32768, -32768, -32768, -32768, -32768, -32768};
alignas(64) constexpr std::int16_t kAfter[32] = {
    -32768, -32768, -32768, -32768, -32768, -32768, -32768, -32768, -32768, -32768, -32768,
    -32768, -32768, -32768, -32768, -32768, kAny,   kAny,   kAny,   kAny,   kAny,   kAny,
    kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny,   kAny};

/// Are all of row[first..last] at least q?
HWY_INLINE bool all_reach(const std::int16_t* row, std::int32_t first, std::int32_t last,
                          std::int16_t q) {
  const auto want = hn::Set(dq, q);
  auto low = hn::Lt(want, want);
  for (std::uint32_t l = 0; l < kBlock; l += static_cast<std::uint32_t>(hn::Lanes(dq))) {
    const auto outside =
        hn::Max(hn::LoadU(dq, kBefore + 16 - first + l), hn::LoadU(dq, kAfter + 15 - last + l));
    low = hn::Or(low, hn::Lt(hn::Max(hn::Load(dq, row + l), outside), want));
  }
  return hn::AllFalse(dq, low);
}

/// The boxes of a node relative to the eye.
struct Relative {
  alignas(64) float lo[3][kW];
  alignas(64) float hi[3][kW];
  alignas(64) float gap[3][kW];  ///< least distance from the eye along the axis, negative where the
                                 ///< box spans the eye
  std::uint32_t
      touching[6];  ///< boxes that have a part with w >= |u|, |v| on each side of the cube
};

HWY_INLINE void relative_to(const BoxTree::Node& node, const float* eye, Relative& out) {
  const float* lo[3] = {node.lo_x.data(), node.lo_y.data(), node.lo_z.data()};
  const float* hi[3] = {node.hi_x.data(), node.hi_y.data(), node.hi_z.data()};
  std::fill_n(out.touching, 6, 0U);
  for (std::uint32_t l = 0; l < kW; l += static_cast<std::uint32_t>(hn::Lanes(d))) {
    V from[3];
    V to[3];
    V gap[3];
    for (int a = 0; a < 3; ++a) {
      from[a] = hn::Sub(hn::Load(d, lo[a] + l), hn::Set(d, eye[a]));
      to[a] = hn::Sub(hn::Load(d, hi[a] + l), hn::Set(d, eye[a]));
      gap[a] = hn::Max(from[a], hn::Neg(to[a]));
      hn::Store(from[a], d, out.lo[a] + l);
      hn::Store(to[a], d, out.hi[a] + l);
      hn::Store(gap[a], d, out.gap[a] + l);
    }
    for (int a = 0; a < 3; ++a) {
      const V aside = hn::Max(hn::Max(gap[(a + 1) % 3], gap[(a + 2) % 3]), hn::Zero(d));
      out.touching[2 * a] |= bits_of(hn::Le(aside, to[a])) << l;
      out.touching[2 * a + 1] |= bits_of(hn::Le(aside, hn::Neg(from[a]))) << l;
    }
  }
}

/// What sixteen boxes cover on one face: pixels and depth.
struct Covered {
  alignas(64) std::int32_t i0[kW], i1[kW], j0[kW], j1[kW], q[kW];
  std::uint32_t near = 0;
};

HWY_INLINE void project(const Relative& box, std::uint32_t side, float near_m, float pixels,
                        Covered& out) {
  const auto w = side >> 1U;
  const auto u = static_cast<std::uint32_t>(kAxisU[w]);
  const auto v = static_cast<std::uint32_t>(kAxisV[w]);
  const bool down = (side & 1U) != 0;
  out.near = 0;
  const V zero = hn::Zero(d);
  const V half = hn::Set(d, 0.5F * pixels);
  const V most = hn::Set(d, pixels - 1);
  for (std::uint32_t l = 0; l < kW; l += static_cast<std::uint32_t>(hn::Lanes(d))) {
    const V w_lo = down ? hn::Neg(hn::Load(d, box.hi[w] + l)) : hn::Load(d, box.lo[w] + l);
    const V w_hi = down ? hn::Neg(hn::Load(d, box.lo[w] + l)) : hn::Load(d, box.hi[w] + l);
    const V u_lo = hn::Load(d, box.lo[u] + l);
    const V u_hi = hn::Load(d, box.hi[u] + l);
    const V v_lo = hn::Load(d, box.lo[v] + l);
    const V v_hi = hn::Load(d, box.hi[v] + l);
    // Of the box only the part with |u|, |v| <= w is on this face: nearest where w is least there.
    const V nearest =
        hn::Max(w_lo, hn::Max(hn::Load(d, box.gap[u] + l), hn::Load(d, box.gap[v] + l)));
    const M near = hn::Lt(nearest, hn::Set(d, near_m));
    out.near |= bits_of(near) << l;
    const V w0 = hn::IfThenElse(near, hn::Set(d, near_m), nearest);
    const V w1 = hn::Max(w0, w_hi);
    const auto pixel = [&](V side_m, M at_near, float guard) {
      const V x = hn::Div(side_m, hn::IfThenElse(at_near, w0, w1));
      const V at = hn::Add(hn::Mul(hn::Add(x, hn::Set(d, 1.0F)), half), hn::Set(d, guard));
      return hn::ConvertTo(di,
                           hn::Min(hn::Max(at, zero), most));  // not negative: truncation is floor
    };
    hn::Store(pixel(u_lo, hn::Lt(u_lo, zero), -kPixelGuard), di, out.i0 + l);
    hn::Store(pixel(u_hi, hn::Gt(u_hi, zero), kPixelGuard), di, out.i1 + l);
    hn::Store(pixel(v_lo, hn::Lt(v_lo, zero), -kPixelGuard), di, out.j0 + l);
    hn::Store(pixel(v_hi, hn::Gt(v_hi, zero), kPixelGuard), di, out.j1 + l);
    const V q = hn::Mul(hn::Div(hn::Set(d, kMostQ * near_m), w0), hn::Set(d, 1 + kRelative));
    // At least the ceiling, less 32768.
    hn::Store(hn::Sub(hn::ConvertTo(di, hn::Add(q, hn::Set(d, 1.0F))), hn::Set(di, 32768)), di,
              out.q + l);
  }
}

HWY_INLINE bool rectangle_hidden(const DepthCube& cube, std::uint32_t side, std::int32_t i0,
                                 std::int32_t i1, std::int32_t j0, std::int32_t j1,
                                 std::int16_t q) {
  constexpr auto kB = static_cast<std::int32_t>(kBlock);
  const auto a_row = static_cast<std::int32_t>(cube.blocks_a_row());
  const auto face = static_cast<std::int32_t>(side * cube.blocks_a_face());
  for (std::int32_t br = j0 / kB; br <= j1 / kB; ++br)
    for (std::int32_t bc = i0 / kB; bc <= i1 / kB; ++bc) {
      const auto b = static_cast<std::uint32_t>(face + br * a_row + bc);
      if (!cube.is_touched(b)) return false;
      const std::int32_t first = std::max(i0 - bc * kB, 0);
      const std::int32_t last = std::min(i1 - bc * kB, kB - 1);
      if (all_reach(cube.columns(b), first, last, q)) continue;
      const std::int32_t top = std::max(j0 - br * kB, 0);
      const std::int32_t bottom = std::min(j1 - br * kB, kB - 1);
      if (bottom - top == kB - 1) return false;
      const std::int16_t* rows = cube.block(b);
      for (std::int32_t row = top; row <= bottom; ++row)
        if (!all_reach(rows + row * kB, first, last, q)) return false;
    }
  return true;
}

HWY_INLINE bool hidden_at(const DepthCube& cube, std::uint32_t side, std::int32_t i, std::int32_t j,
                          std::int32_t q) {
  const auto b = side * cube.blocks_a_face() +
                 static_cast<std::uint32_t>(j) / kBlock * cube.blocks_a_row() +
                 static_cast<std::uint32_t>(i) / kBlock;
  const std::size_t at =
      (static_cast<std::uint32_t>(j) % kBlock) * kBlock + static_cast<std::uint32_t>(i) % kBlock;
  return cube.is_touched(b) && cube.block(b)[at] >= q;
}

/// kAll: find every side where a child shows; otherwise the first one settles it. Returns the mask
/// of visible children.
template <bool kAll>
HWY_INLINE std::uint32_t visible_children(const BoxTree::Node& node, const float* eye,
                                          const DepthCube& cube, std::uint32_t wanted,
                                          std::uint8_t* sides) {
  Relative box;
  relative_to(node, eye, box);
  const auto pixels = static_cast<float>(cube.pixels());
  std::uint32_t open = wanted;
  std::uint32_t visible = 0;
  Covered c;
  for (std::uint32_t side = 0; side < 6; ++side) {
    const std::uint32_t here = open & box.touching[side];
    if (here == 0) continue;
    project(box, side, cube.near_m(), pixels, c);
    std::uint32_t seen = here & c.near;
    for (std::uint32_t m = here & ~c.near; m != 0; m &= m - 1) {
      const auto k = static_cast<std::uint32_t>(std::countr_zero(m));
      // One pixel in the middle settles most that show.
      if (c.q[k] > 0x7fff ||
          !hidden_at(cube, side, (c.i0[k] + c.i1[k]) / 2, (c.j0[k] + c.j1[k]) / 2, c.q[k]) ||
          !rectangle_hidden(cube, side, c.i0[k], c.i1[k], c.j0[k], c.j1[k],
                            static_cast<std::int16_t>(c.q[k])))
        seen |= 1U << k;
    }
    visible |= seen;
    if constexpr (kAll) {
      for (; seen != 0; seen &= seen - 1)
        sides[std::countr_zero(seen)] |= static_cast<std::uint8_t>(1U << side);
    } else {
      open &= ~seen;
      if (open == 0) break;
    }
  }
  return visible;
}

HWY_INLINE std::uint32_t used(const BoxTree::Node& node) {
  return node.count == kW ? 0xffffU : ((1U << node.count) - 1U);
}

void find_sides_target(const BoxTree::Node& node, const float* eye, const DepthCube& cube,
                       std::uint32_t wanted, std::uint8_t* sides) {
  std::fill_n(sides, kW, std::uint8_t{0});
  visible_children<true>(node, eye, cube, wanted & used(node), sides);
}

void find_shown_children_target(const BoxTree& tree, std::uint32_t root, const float* eye,
                                const DepthCube& cube, std::vector<std::uint32_t>& visible,
                                std::vector<std::uint32_t>& nodes, DepthStats& stats) {
  const BoxTree::Node& node = tree.nodes[root];
  ++stats.nodes_tested;
  for (std::uint32_t m = visible_children<false>(node, eye, cube, used(node), nullptr); m != 0;
       m &= m - 1) {
    const std::uint32_t child = node.child[std::countr_zero(m)];
    if ((child & BoxTree::kItem) != 0) {
      visible.push_back(child & ~BoxTree::kItem);
    } else {
      nodes.push_back(child);
    }
  }
}

void find_shown_target(const BoxTree& tree, std::uint32_t root, const float* eye,
                       const DepthCube& cube, std::vector<std::uint32_t>& visible,
                       DepthStats& stats) {
  std::vector<std::uint32_t> stack{root};
  while (!stack.empty()) {
    const std::uint32_t at = stack.back();
    stack.pop_back();
    find_shown_children_target(tree, at, eye, cube, visible, stack, stats);
  }
}

}  // namespace
}  // namespace ivis::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ivis {

HWY_EXPORT(draw_faces_target);
HWY_EXPORT(find_sides_target);
HWY_EXPORT(find_shown_target);
HWY_EXPORT(find_shown_children_target);

DepthCube::DepthCube(std::uint32_t pixels, float near_m) : pixels_(pixels), near_m_(near_m) {
  IVIS_ASSERT(pixels % kBlock == 0 && pixels >= 64 && pixels <= 4096,
              "pixels a face: a multiple of 16 from 64 to 4096");
  IVIS_ASSERT(near_m > 0 && std::isfinite(near_m), "the near distance is positive");
  const std::size_t blocks = std::size_t{6} * blocks_a_face();
  depth_.resize(blocks);
  columns_.resize(blocks);
  is_touched_.resize(blocks);
  const auto last = static_cast<std::int32_t>(pixels) - 1;
  for (Window& w : windows_)
    w = {0, last, 0, last};
}

void DepthCube::clear() {
  for (const std::uint32_t b : touched_)
    is_touched_[b] = 0;
  touched_.clear();
}

std::uint32_t DepthCube::look_at(const glm::vec3& lo, const glm::vec3& hi) {
  constexpr int kAxisU[3] = {2, 0, 0};
  constexpr int kAxisV[3] = {1, 2, 1};
  std::uint32_t sides = 0;
  const auto n = static_cast<float>(pixels_);
  const auto range = [&](float from, float to, std::int32_t& first, std::int32_t& last) {
    const auto pixel = [&](float x) {
      return static_cast<std::int32_t>(
          std::clamp(std::floor((x / near_m_ + 1) * 0.5F * n), 0.0F, n - 1));
    };
    first = std::max(pixel(from) - 1, 0);
    last = std::min(pixel(to) + 1, static_cast<std::int32_t>(pixels_) - 1);
  };
  for (std::uint32_t side = 0; side < 6; ++side) {
    const int w = static_cast<int>(side >> 1U);
    const float deepest = (side & 1U) != 0 ? -lo[w] : hi[w];
    Window& window = windows_[side];
    window = {0, -1, 0, -1};
    if (deepest < near_m_) continue;
    sides |= 1U << side;
    range(std::min(lo[kAxisU[w]], 0.0F), std::max(hi[kAxisU[w]], 0.0F), window.i0, window.i1);
    range(std::min(lo[kAxisV[w]], 0.0F), std::max(hi[kAxisV[w]], 0.0F), window.j0, window.j1);
  }
  return sides;
}

void draw_faces(std::span<const FaceBatch> batches, const float eye[3], std::uint32_t sides,
                bool sheet, DepthCube& cube, DepthStats& stats) {
  HWY_DYNAMIC_DISPATCH(draw_faces_target)(batches, eye, sides, sheet, cube, stats);
}

void find_sides(const BoxTree::Node& node, const float eye[3], const DepthCube& cube,
                std::uint32_t wanted, std::uint8_t sides[BoxTree::kWidth]) {
  HWY_DYNAMIC_DISPATCH(find_sides_target)(node, eye, cube, wanted, sides);
}

void find_visible(const BoxTree& tree, std::uint32_t root, const float eye[3],
                  const DepthCube& cube, std::vector<std::uint32_t>& visible, DepthStats& stats) {
  if (tree.nodes.empty()) return;
  HWY_DYNAMIC_DISPATCH(find_shown_target)(tree, root, eye, cube, visible, stats);
}

void find_visible_children(const BoxTree& tree, std::uint32_t root, const float eye[3],
                           const DepthCube& cube, std::vector<std::uint32_t>& visible,
                           std::vector<std::uint32_t>& nodes, DepthStats& stats) {
  HWY_DYNAMIC_DISPATCH(find_shown_children_target)(tree, root, eye, cube, visible, nodes, stats);
}

std::vector<const char*> depth_targets() {
  std::vector<const char*> names;
  for (std::int64_t all = hwy::SupportedTargets() & HWY_TARGETS; all != 0; all &= all - 1)
    names.push_back(hwy::TargetName(all & -all));
  return names;
}

bool use_depth_target(const std::string& name) {
  hwy::SetSupportedTargetsForTest(0);
  for (std::int64_t all = hwy::SupportedTargets() & HWY_TARGETS; all != 0; all &= all - 1)
    if (name == hwy::TargetName(all & -all)) {
      hwy::SetSupportedTargetsForTest(all & -all);
      hwy::GetChosenTarget().Update(hwy::SupportedTargets());
      return true;
    }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return name.empty();
}

}  // namespace ivis
#endif  // HWY_ONCE
