#include "visibility/polar_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "core/assert.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "visibility/polar_map.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ivis::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::uint32_t kW = BoxTree::kWidth;
constexpr std::uint32_t kLayers = PolarMap::kLayers;
constexpr float kInf = std::numeric_limits<float>::infinity();

// Rounding. Positions relative to the eye carry a relative error of 2^-23 or so (absolute errors
// are paid for by the occluders' slack); an azimuth t is wrong by less than 1e-6, which is 0.001 of
// a bin at 8192 bins a circle and 0.004 at 32768. kBinSlack covers that; kRelative covers the few
// operations on slopes and 1/w.
constexpr float kRelative = 1e-6F;
constexpr float bin_slack(std::uint32_t bins) {
  return 1.0e-6F * static_cast<float>(bins) / 8.0F + 0.001F;
}

using D = hn::CappedTag<float, kW>;
using DI = hn::RebindToSigned<D>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

template <class Mask>
HWY_INLINE std::uint32_t bits_of(D d, Mask m) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, m, bytes);
  std::uint32_t bits = 0;
  std::memcpy(&bits, bytes, sizeof bits);
  return bits & ((hn::Lanes(d) == 32) ? ~0U : ((1U << hn::Lanes(d)) - 1U));
}

/// t of a point with max(|x|, |z|) > 0.
HWY_INLINE V azimuth(D d, V x, V z) {
  const M x_major = hn::Ge(hn::Abs(x), hn::Abs(z));
  const V major = hn::IfThenElse(x_major, x, z);
  const V minor = hn::IfThenElse(x_major, z, hn::Neg(x));
  const M negative = hn::Lt(major, hn::Zero(d));
  const V base = hn::Add(hn::IfThenElse(x_major, hn::Set(d, 1.0F), hn::Set(d, 3.0F)),
                         hn::IfThenElseZero(negative, hn::Set(d, 4.0F)));
  return hn::Add(base, hn::Div(minor, major));
}

/// Calls f with the two constants that a solve's functions are made for: undersides, terrain. Over
/// terrain undersides are always minded: one version less to compile.
template <class F>
void choose(bool undersides, const PolarMap& map, const F& f) {
  constexpr std::bool_constant<true> kYes;
  constexpr std::bool_constant<false> kNo;
  if (map.horizon() != nullptr) {
    f(kYes, kYes);
  } else {
    undersides ? f(kYes, kNo) : f(kNo, kNo);
  }
}

/// What the boxes of one node look like from the eye.
struct Seen {
  alignas(64) float high[kW];          ///< largest slope
  alignas(64) float low[kW];           ///< least slope
  alignas(64) float near[kW];          ///< largest 1/w
  alignas(64) std::int32_t first[kW];  ///< first bin, in [0, bins)
  alignas(64) std::int32_t last[kW];   ///< last bin, >= first, may pass `bins`
  alignas(64) std::int32_t row[kW];    ///< of the horizon: none farther than the box
};

struct View {
  float x, y, z;
  float to_bins;  ///< bins a unit of t
  float slack;    ///< in bins
  std::int32_t bins;
  const Horizon* horizon = nullptr;
};

/// Projects the boxes of a node. Returns the mask of children whose plan holds the eye (always
/// visible).
template <bool kUndersides, bool kTerrain>
HWY_INLINE std::uint32_t project(const BoxTree::Node& node, const View& view, Seen& seen) {
  const D d;
  const DI di;
  std::uint32_t around = 0;
  const V ex = hn::Set(d, view.x);
  const V ey = hn::Set(d, view.y);
  const V ez = hn::Set(d, view.z);
  const V zero = hn::Zero(d);
  for (std::uint32_t l = 0; l < kW; l += static_cast<std::uint32_t>(hn::Lanes(d))) {
    const V x0 = hn::Sub(hn::Load(d, node.lo_x.data() + l), ex);
    const V x1 = hn::Sub(hn::Load(d, node.hi_x.data() + l), ex);
    const V z0 = hn::Sub(hn::Load(d, node.lo_z.data() + l), ez);
    const V z1 = hn::Sub(hn::Load(d, node.hi_z.data() + l), ez);
    const V y1 = hn::Sub(hn::Load(d, node.hi_y.data() + l), ey);
    const V nx1 = hn::Neg(x1);
    const V nz1 = hn::Neg(z1);
    const V near = hn::Max(hn::Max(x0, nx1), hn::Max(z0, nz1));
    const V far = hn::Max(hn::Max(hn::Neg(x0), x1), hn::Max(hn::Neg(z0), z1));
    const M holds_eye = hn::Le(near, zero);
    around |= bits_of(d, holds_eye) << l;
    const V safe_near = hn::IfThenElse(holds_eye, hn::Set(d, 1.0F), near);
    const V one = hn::Set(d, 1.0F);
    const V guard = hn::Set(d, 1.0F + kRelative);
    hn::Store(hn::Mul(hn::Div(one, safe_near), guard), d, seen.near + l);
    if constexpr (kTerrain) {
      // Rows are floats of few mantissa bits: the row of a distance is what is left of its own
      // bits.
      const auto bits = hn::BitCast(di, hn::Mul(safe_near, hn::Set(d, 1.0F - kRelative)));
      const auto row =
          hn::Sub(hn::ShiftRight<Horizon::kShift>(bits), hn::Set(di, view.horizon->first_row()));
      hn::Store(hn::Min(hn::Max(row, hn::Zero(di)), hn::Set(di, view.horizon->last_row())), di,
                seen.row + l);
    }
    const V high = hn::Div(y1, hn::IfThenElse(hn::Gt(y1, zero), safe_near, far));
    hn::Store(hn::Add(high, hn::Mul(hn::Abs(high), hn::Set(d, kRelative))), d, seen.high + l);
    if constexpr (kUndersides) {
      const V y0 = hn::Sub(hn::Load(d, node.lo_y.data() + l), ey);
      const V low = hn::Div(y0, hn::IfThenElse(hn::Gt(y0, zero), far, safe_near));
      hn::Store(hn::Sub(low, hn::Mul(hn::Abs(low), hn::Set(d, kRelative))), d, seen.low + l);
    }
    // Silhouette corners by the eye's region around the plan of the box.
    const M px = hn::Gt(x0, zero);
    const M nx = hn::Lt(x1, zero);
    const M pz = hn::Gt(z0, zero);
    const M nz = hn::Lt(z1, zero);
    const V ax = hn::IfThenElse(hn::Or(pz, hn::AndNot(nz, nx)), x1, x0);
    const V az = hn::IfThenElse(hn::Or(px, hn::AndNot(nx, pz)), z0, z1);
    const V bx = hn::IfThenElse(hn::Or(pz, hn::AndNot(nz, px)), x0, x1);
    const V bz = hn::IfThenElse(hn::Or(px, hn::AndNot(px, hn::AndNot(nx, nz))), z1, z0);
    const V slack = hn::Set(d, view.slack);
    const V scale = hn::Set(d, view.to_bins);
    const V bins = hn::Set(d, static_cast<float>(view.bins));
    V a = hn::Sub(hn::Mul(azimuth(d, ax, az), scale), slack);
    V b = hn::Add(hn::Mul(azimuth(d, bx, bz), scale), slack);
    b = hn::IfThenElse(hn::Lt(b, a), hn::Add(b, bins), b);
    const M wrapped = hn::Lt(a, zero);
    a = hn::IfThenElse(wrapped, hn::Add(a, bins), a);
    b = hn::IfThenElse(wrapped, hn::Add(b, bins), b);
    hn::Store(hn::ConvertTo(di, a), di, seen.first + l);  // a, b >= 0: truncation is floor
    hn::Store(hn::ConvertTo(di, b), di, seen.last + l);
  }
  return around;
}

/// Children whose plan holds the eye.
HWY_INLINE std::uint32_t holds_eye(const BoxTree::Node& node, const View& view) {
  std::uint32_t mask = 0;
  for (std::uint32_t c = 0; c < node.count; ++c)
    if (node.lo_x[c] <= view.x && node.hi_x[c] >= view.x && node.lo_z[c] <= view.z &&
        node.hi_z[c] >= view.z)
      mask |= 1U << c;
  return mask;
}

/// Does one bin hide every box of the node? Bit i: bin `at[i]` hides box i.
template <bool kUndersides, bool kTerrain>
HWY_INLINE std::uint32_t hidden_in_bin(const PolarMap& map, const Seen& seen,
                                       const std::int32_t* at) {
  const D d;
  const DI di;
  std::uint32_t bits = 0;
  for (std::uint32_t l = 0; l < kW; l += static_cast<std::uint32_t>(hn::Lanes(d))) {
    const auto index = hn::Load(di, at + l);
    const V high = hn::Load(d, seen.high + l);
    const V near = hn::Load(d, seen.near + l);
    M hidden = hn::Lt(high, high);
    V low = high;
    if constexpr (kUndersides) low = hn::Load(d, seen.low + l);
    if constexpr (kTerrain) {
      const Horizon& horizon = *map.horizon();
      const auto stride = hn::Set(di, static_cast<std::int32_t>(horizon.stride()));
      const auto unit = hn::ShiftRightSame(index, horizon.unit_shift());
      const V slope = hn::GatherIndex(d, horizon.slopes(),
                                      hn::Add(hn::Mul(hn::Load(di, seen.row + l), stride), unit));
      hidden = hn::Le(high, slope);
      // Slopes up to the horizon are hidden by it: a wall need reach down to there only.
      if constexpr (kUndersides) low = hn::Max(low, slope);
    }
    for (std::uint32_t k = 0; k < kLayers; ++k) {
      M m = hn::Le(high, hn::GatherIndex(d, map.slope(k), index));
      m = hn::And(m, hn::Le(near, hn::GatherIndex(d, map.near_inverse(k), index)));
      if constexpr (kUndersides) m = hn::And(m, hn::Ge(low, hn::GatherIndex(d, map.low(k), index)));
      hidden = hn::Or(hidden, m);
    }
    bits |= bits_of(d, hidden) << l;
  }
  return bits;
}

struct Box {
  float high, low, near;
  const float* horizon;  ///< slopes of the row no farther than the box; with terrain only
  int shift;             ///< of its units
};

/// Bit i: element `at + i` of the planes (S, W, B a layer, `stride` apart) hides the box; for i in
/// [0, 16).
template <bool kUndersides, bool kTerrain>
HWY_INLINE std::uint32_t hidden_in_16(const float* planes, std::size_t stride, std::size_t at,
                                      const Box& box) {
  const D d;
  std::uint32_t bits = 0;
  const V high = hn::Set(d, box.high);
  const V near = hn::Set(d, box.near);
  for (std::uint32_t l = 0; l < kW; l += static_cast<std::uint32_t>(hn::Lanes(d))) {
    M hidden = hn::Lt(high, high);
    V low = hn::Set(d, box.low);
    if constexpr (kTerrain) {
      const DI di;
      const auto bin = hn::Iota(di, static_cast<std::int32_t>(at) + static_cast<std::int32_t>(l));
      const V slope = hn::GatherIndex(d, box.horizon, hn::ShiftRightSame(bin, box.shift));
      hidden = hn::Le(high, slope);
      low = hn::Max(low, slope);
    }
    const float* p = planes + at + l;
    for (std::uint32_t k = 0; k < kLayers; ++k, p += 3 * stride) {
      M m = hn::Le(high, hn::LoadU(d, p));
      m = hn::And(m, hn::Le(near, hn::LoadU(d, p + stride)));
      if constexpr (kUndersides) m = hn::And(m, hn::Ge(low, hn::LoadU(d, p + 2 * stride)));
      hidden = hn::Or(hidden, m);
    }
    bits |= bits_of(d, hidden) << l;
  }
  return bits;
}

/// Do all bins first..last, none of which wraps, hide the box? `coarse`: the coarse minima are up
/// to date.
template <bool kUndersides, bool kTerrain>
HWY_INLINE bool hidden_in_run(const PolarMap& map, const Box& box, std::int32_t first,
                              std::int32_t last, bool coarse) {
  const float* planes = map.slope(0);
  const std::size_t stride = map.stride();
  std::int32_t at = first;
  while (at + 16 <= last + 1) {
    if (!kTerrain && coarse && at % 16 == 0) {  // the coarse minima know no terrain
      // Sixteen blocks at once by their minima; a block that fails is looked at bin by bin.
      const std::int32_t blocks = std::min(16, (last + 1 - at) / 16);
      const std::uint32_t want = blocks == 16 ? 0xffffU : ((1U << blocks) - 1U);
      std::uint32_t fails =
          want & ~hidden_in_16<kUndersides, kTerrain>(map.coarse(), map.coarse_stride(),
                                                      static_cast<std::size_t>(at / 16), box);
      for (; fails != 0; fails &= fails - 1) {
        const std::int32_t bin = at + 16 * std::countr_zero(fails);
        if (hidden_in_16<kUndersides, kTerrain>(planes, stride, static_cast<std::size_t>(bin),
                                                box) != 0xffffU)
          return false;
      }
      at += 16 * blocks;
      continue;
    }
    if (hidden_in_16<kUndersides, kTerrain>(planes, stride, static_cast<std::size_t>(at), box) !=
        0xffffU)
      return false;
    at += coarse && !kTerrain ? 16 - at % 16 : 16;
  }
  if (at > last) return true;
  const std::uint32_t want = (1U << (last - at + 1)) - 1U;
  return (hidden_in_16<kUndersides, kTerrain>(planes, stride, static_cast<std::size_t>(at), box) &
          want) == want;
}

/// Do all bins first..last hide the box? Up to 16 bins never wrap, thanks to the pad.
template <bool kUndersides, bool kTerrain>
HWY_INLINE bool hidden_in_all(const PolarMap& map, const Box& box, std::int32_t first,
                              std::int32_t last, bool coarse) {
  const auto bins = static_cast<std::int32_t>(map.bins());
  if (last - first < 16) {
    const std::uint32_t want = (2U << (last - first)) - 1U;
    return (hidden_in_16<kUndersides, kTerrain>(map.slope(0), map.stride(),
                                                static_cast<std::size_t>(first), box) &
            want) == want;
  }
  if (last < bins) return hidden_in_run<kUndersides, kTerrain>(map, box, first, last, coarse);
  return hidden_in_run<kUndersides, kTerrain>(map, box, first, bins - 1, coarse) &&
         hidden_in_run<kUndersides, kTerrain>(map, box, 0, std::min(last - bins, bins - 1), coarse);
}

template <bool kUndersides, bool kTerrain>
HWY_INLINE Box box_of(const View& view, const Seen& seen, std::uint32_t c) {
  Box box{seen.high[c], kUndersides ? seen.low[c] : 0.0F, seen.near[c], nullptr, 0};
  if constexpr (kTerrain) {
    box.horizon = view.horizon->row(seen.row[c]);
    box.shift = view.horizon->unit_shift();
  }
  return box;
}

/// Mask of the node's children that the map does not hide.
template <bool kUndersides, bool kTerrain>
HWY_INLINE std::uint32_t visible_children(const BoxTree::Node& node, const View& view,
                                          const PolarMap& map, bool coarse, Seen& seen) {
  const std::uint32_t used = node.count == kW ? 0xffffU : ((1U << node.count) - 1U);
  const std::uint32_t around = project<kUndersides, kTerrain>(node, view, seen);
  // One bin in the middle settles most visible boxes.
  alignas(64) std::int32_t middle[kW];
  const DI di;
  const auto wrap = hn::Set(di, view.bins - 1);
  for (std::uint32_t l = 0; l < kW; l += static_cast<std::uint32_t>(hn::Lanes(di)))
    hn::Store(hn::And(hn::ShiftRight<1>(
                          hn::Add(hn::Load(di, seen.first + l), hn::Load(di, seen.last + l))),
                      wrap),
              di, middle + l);
  std::uint32_t open = used & hidden_in_bin<kUndersides, kTerrain>(map, seen, middle) & ~around;
  std::uint32_t visible = used & ~open;
  for (; open != 0; open &= open - 1) {
    const auto c = static_cast<std::uint32_t>(std::countr_zero(open));
    if (!hidden_in_all<kUndersides, kTerrain>(map, box_of<kUndersides, kTerrain>(view, seen, c),
                                              seen.first[c], seen.last[c], coarse))
      visible |= 1U << c;
  }
  return visible;
}

/// Puts the statement (s, w, b) into the bins from `at` on where `lanes` is set.
template <bool kUndersides>
HWY_INLINE void add_layer(PolarMap& map, std::size_t at, D d, M lanes, V s, V w, V b) {
  V cs = hn::IfThenElse(lanes, s, hn::Set(d, -kInf));
  V cw = hn::IfThenElseZero(lanes, w);
  V cb = b;
  for (std::uint32_t k = 0; k < kLayers; ++k) {
    float* ps = map.slope(k) + at;
    float* pw = map.near_inverse(k) + at;
    float* pb = map.low(k) + at;
    const V os = hn::Load(d, ps);
    const V ow = hn::Load(d, pw);
    const M higher = hn::Gt(cs, os);
    V hs = hn::IfThenElse(higher, cs, os);
    V hw = hn::IfThenElse(higher, cw, ow);
    cs = hn::IfThenElse(higher, os, cs);
    cw = hn::IfThenElse(higher, ow, cw);
    M dominated = hn::Ge(hw, cw);
    if constexpr (kUndersides) {
      const V ob = hn::Load(d, pb);
      V hb = hn::IfThenElse(higher, cb, ob);
      cb = hn::IfThenElse(higher, ob, cb);
      // Two walls whose slopes overlap block their union, for what lies behind both.
      const M overlap = hn::Ge(cs, hb);
      const M lower_is_nearer = hn::Ge(cw, hw);
      const M extend_high = hn::And(overlap, lower_is_nearer);
      const V both = hn::Min(hb, cb);
      const M extend_low = hn::And(overlap, hn::And(hn::Lt(cw, hw), hn::Lt(cb, hb)));
      hb = hn::IfThenElse(extend_high, both, hb);
      cs = hn::IfThenElse(extend_low, hs, cs);
      dominated = hn::And(dominated, hn::Le(hb, cb));
      hn::Store(hb, d, pb);
      cb = hn::IfThenElse(dominated, hn::Set(d, kInf), cb);
    }
    hn::Store(hs, d, ps);
    hn::Store(hw, d, pw);
    cs = hn::IfThenElse(dominated, hn::Set(d, -kInf), cs);
    cw = hn::IfThenElse(dominated, hn::Zero(d), cw);
  }
}

/// One solid's height relative to the eye.
struct Height {
  float top;
  float bottom;  ///< -inf when it reaches down
};

/// Corners of one solid as seen from the eye.
struct Corners {
  std::vector<float> x, z;  ///< relative to the eye
  std::vector<float> t;     ///< azimuth in bins
  std::vector<float> k;     ///< 1/w

  void project(const WallSet& walls, std::uint32_t first, std::uint32_t count, const View& view) {
    const D d;
    const std::size_t padded = count + kW;
    if (x.size() < padded)
      for (auto* v : {&x, &z, &t, &k})
        v->resize(padded);
    for (std::uint32_t i = 0; i < count; i += static_cast<std::uint32_t>(hn::Lanes(d))) {
      const V px = hn::Sub(hn::LoadU(d, walls.x.data() + first + i), hn::Set(d, view.x));
      const V pz = hn::Sub(hn::LoadU(d, walls.z.data() + first + i), hn::Set(d, view.z));
      const V w = hn::Max(hn::Max(hn::Abs(px), hn::Abs(pz)), hn::Set(d, 1e-6F));
      hn::StoreU(px, d, x.data() + i);
      hn::StoreU(pz, d, z.data() + i);
      hn::StoreU(hn::Mul(azimuth(d, px, pz), hn::Set(d, view.to_bins)), d, t.data() + i);
      hn::StoreU(hn::Div(hn::Set(d, 1.0F), w), d, k.data() + i);
    }
  }
};

/// Draws the walls of one solid after another.
///
/// A chain is a run of walls joined at corners whose azimuth rises: a function k(t) = 1/w, linear
/// in t between corners and face borders. A bin [i, i+1] is written when the chain covers it whole,
/// with the least and largest k over [i - slack, i+1 + slack]: so neither an azimuth wrong by
/// `slack` nor a corner next to a bin's border can make a statement too strong.
template <bool kUndersides, bool kTerrain>
class WallPainter {
 public:
  WallPainter(PolarMap& map, const View& view, const PolarGuards& guards, PolarStats& stats)
      : map_(map),
        view_(view),
        guards_(guards),
        stats_(stats),
        face_(static_cast<float>(view.bins) / 4) {}

  void paint(const WallSet& walls, const WallSet::Solid& solid, const Height& height) {
    const WallSet::Ring& first = walls.rings[solid.first_ring];
    const WallSet::Ring& last = walls.rings[solid.first_ring + solid.rings - 1];
    corners_.project(walls, first.first, last.first + last.count - first.first, view_);
    for (std::uint32_t r = 0; r < solid.rings; ++r) {
      const WallSet::Ring& ring = walls.rings[solid.first_ring + r];
      const std::uint32_t offset = ring.first - first.first;
      // A top above the eye is blocked up to the slope of the near wall; one below it, up to that
      // of the far wall, whose slope is larger. With a real bottom the near wall adds the slopes
      // below.
      const bool below = height.top < 0;
      if (!below || kUndersides) chains(offset, ring.count, height, false);
      if (below) chains(offset, ring.count, height, true);
    }
  }

 private:
  /// Runs of consecutive edges that face the eye (azimuth falls along the ring), or face away.
  void chains(std::uint32_t offset, std::uint32_t n, const Height& height, bool away) {
    const float* x = corners_.x.data() + offset;
    const float* z = corners_.z.data() + offset;
    const auto wanted = [&](std::uint32_t e) {
      const std::uint32_t f = e + 1 == n ? 0 : e + 1;
      const float turn = x[e] * z[f] - z[e] * x[f];
      return away ? turn > 0 : turn < 0;
    };
    // Walked so that azimuth rises: along the ring for `away`, against it otherwise. Edge e joins e
    // and e+1.
    const auto next = [&](std::uint32_t e) {
      return away ? (e + 1 == n ? 0 : e + 1) : (e == 0 ? n - 1 : e - 1);
    };
    std::uint32_t e = 0;
    while (e < n && wanted(e))
      ++e;
    if (e == n) e = 0;  // all of them, as of a court about the eye: one turn, cut anywhere
    for (std::uint32_t done = 0; done < n; ++done, e = next(e)) {
      if (!wanted(e)) {
        finish_chain(height);
        continue;
      }
      const std::uint32_t f = e + 1 == n ? 0 : e + 1;
      add_wall(offset + (away ? e : f), offset + (away ? f : e), height);
    }
    finish_chain(height);
  }

  void add_wall(std::uint32_t a, std::uint32_t b, const Height& height) {
    const auto bins = static_cast<float>(view_.bins);
    float ta = corners_.t[a];
    float tb = corners_.t[b];
    if (tb < ta) tb += bins;
    if (tb - ta > 0.5F * bins) {  // seen end-on: rounding turned it round
      finish_chain(height);
      return;
    }
    ++stats_.walls_drawn;
    if (chain_t_.empty()) {
      chain_t_.push_back(ta);
      chain_k_.push_back(corners_.k[a]);
    } else {  // the corner shared with the wall before may have passed the wrap
      const float shift = std::round((chain_t_.back() - ta) / bins) * bins;
      ta += shift;
      tb += shift;
    }
    // Linear only within a face: add the points where the wall crosses the diagonals.
    for (float cut = (std::floor(ta / face_) + 1) * face_; cut < tb; cut += face_) {
      chain_t_.push_back(cut);
      chain_k_.push_back(
          inverse_on_diagonal(a, b, static_cast<std::uint32_t>(std::lround(cut / face_)) & 3U));
    }
    chain_t_.push_back(tb);
    chain_k_.push_back(corners_.k[b]);
  }

  /// 1/w where the wall between two corners crosses the diagonal at t = 2 f.
  float inverse_on_diagonal(std::uint32_t a, std::uint32_t b, std::uint32_t f) const {
    const double dx = f <= 1 ? 1 : -1;
    const double dz = f == 1 || f == 2 ? 1 : -1;
    const double xa = static_cast<double>(corners_.x[a]);
    const double za = static_cast<double>(corners_.z[a]);
    const double xb = static_cast<double>(corners_.x[b]);
    const double zb = static_cast<double>(corners_.z[b]);
    const double ca = dx * za - dz * xa;
    const double cb = dx * zb - dz * xb;
    const double s = ca == cb ? 0.5 : std::clamp(ca / (ca - cb), 0.0, 1.0);
    const double w = std::max(std::abs(xa + s * (xb - xa)), std::abs(za + s * (zb - za)));
    return static_cast<float>(1.0 / std::max(w, 1e-6));
  }

  void finish_chain(const Height& height) {
    if (chain_t_.size() >= 2) draw_chain(height);
    chain_t_.clear();
    chain_k_.clear();
  }

  /// Is the whole chain behind what was drawn before? So are, mostly, the far walls of a court
  /// behind its front.
  bool chain_hidden(const Height& height) const {
    float largest = 0;
    for (const float k : chain_k_)
      largest = std::max(largest, k);
    float least = kInf;
    for (const float k : chain_k_)
      least = std::min(least, k);
    Box box{height.top * (height.top > 0 ? largest : least),
            height.bottom * (height.bottom > 0 ? least : largest), largest, nullptr, 0};
    if constexpr (kTerrain) {
      box.horizon = view_.horizon->row(view_.horizon->row_at((1.0F - kRelative) / largest));
      box.shift = view_.horizon->unit_shift();
    }
    auto first = static_cast<std::int32_t>(chain_t_.front());
    auto last = static_cast<std::int32_t>(chain_t_.back());
    if (last - first >= view_.bins) return false;
    if (first >= view_.bins) {
      first -= view_.bins;
      last -= view_.bins;
    }
    return hidden_in_all<kUndersides, kTerrain>(map_, box, first, last, false);
  }

  void draw_chain(const Height& height) {
    if (chain_hidden(height)) return;
    const float slack = view_.slack;
    const float from = chain_t_.front();
    const float to = chain_t_.back();
    const float reach_in = guards_.cover_whole_bins ? slack : -1.0F;
    const auto first = static_cast<std::int32_t>(std::ceil(from + reach_in));
    const auto last = static_cast<std::int32_t>(std::floor(to - reach_in)) - 1;
    if (last < first || last - first >= view_.bins) return;
    pieces_.clear();
    for (std::size_t p = 0; p + 1 < chain_t_.size(); ++p) {
      const float ta = chain_t_[p];
      const float tb = chain_t_[p + 1];
      const float ka = chain_k_[p];
      const float kb = chain_k_[p + 1];
      pieces_.push_back({ta, tb, ka, tb > ta ? (kb - ka) / (tb - ta) : 0.0F, std::min(ka, kb),
                         std::max(ka, kb), static_cast<std::int32_t>(std::floor(ta - slack)),
                         static_cast<std::int32_t>(std::floor(tb + slack))});
    }
    write(first, last, height);
  }

  /// A stretch of chain on which k is linear; it touches the bins first..last.
  struct Piece {
    float ta, tb;
    float ka;
    float rate;  ///< of k, a bin
    float low_k, high_k;
    std::int32_t first, last;
  };

  /// Least and largest k of a piece over the bins from `at` on, which it touches where `in` is set.
  HWY_INLINE void range_over(const Piece& piece, std::int32_t at, V& least, V& largest) const {
    const D d;
    const DI di;
    const float before = guards_.least_over_bin ? -view_.slack : 0.5F;
    const float after = guards_.least_over_bin ? 1 + view_.slack : 0.5F;
    const auto bin = hn::Add(hn::Iota(di, 0), hn::Set(di, at));
    const V t = hn::ConvertTo(d, bin);
    const V ta = hn::Set(d, piece.ta);
    const V tb = hn::Set(d, piece.tb);
    const V rate = hn::Set(d, piece.rate);
    const V ka = hn::Set(d, piece.ka);
    const V doubt = hn::Set(d, kRelative * piece.high_k);
    const V t0 = hn::Min(hn::Max(hn::Add(t, hn::Set(d, before)), ta), tb);
    const V t1 = hn::Min(hn::Max(hn::Add(t, hn::Set(d, after)), ta), tb);
    const V k0 = hn::Add(ka, hn::Mul(hn::Sub(t0, ta), rate));
    const V k1 = hn::Add(ka, hn::Mul(hn::Sub(t1, ta), rate));
    const V low = hn::Max(hn::Sub(hn::Min(k0, k1), doubt), hn::Set(d, piece.low_k));
    const V high = hn::Min(hn::Add(hn::Max(k0, k1), doubt), hn::Set(d, piece.high_k));
    const auto in = hn::RebindMask(d, hn::And(hn::Gt(bin, hn::Set(di, piece.first - 1)),
                                              hn::Lt(bin, hn::Set(di, piece.last + 1))));
    least = hn::IfThenElse(in, hn::Min(least, low), least);
    largest = hn::IfThenElse(in, hn::Max(largest, high), largest);
  }

  /// Writes the bins first..last, vector by vector at aligned places; bins past the end wrap.
  void write(std::int32_t first, std::int32_t last, const Height& height) {
    const D d;
    const DI di;
    const auto lanes = static_cast<std::int32_t>(hn::Lanes(d));
    const V top = hn::Set(d, height.top);
    const V bottom = hn::Set(d, height.bottom);
    const V guard = hn::Set(d, kRelative);
    const bool top_by_least = height.top >= 0 || !guards_.far_end_below_eye;
    std::size_t p0 = 0;
    bool pad = false;
    for (std::int32_t at = first & ~(lanes - 1); at <= last; at += lanes) {
      V least = hn::Set(d, kInf);
      V largest = hn::Zero(d);
      while (p0 < pieces_.size() && pieces_[p0].last < at)
        ++p0;
      for (std::size_t p = p0; p < pieces_.size() && pieces_[p].first < at + lanes; ++p)
        range_over(pieces_[p], at, least, largest);
      V s = hn::Mul(top, top_by_least ? least : largest);
      s = hn::Sub(s, hn::Mul(hn::Abs(s), guard));
      V w = hn::Sub(least, hn::Mul(least, guard));
      if (!guards_.test_distance) w = hn::Set(d, kInf);
      const auto bin = hn::Add(hn::Iota(di, 0), hn::Set(di, at));
      auto mine = hn::RebindMask(
          d, hn::And(hn::Gt(bin, hn::Set(di, first - 1)), hn::Lt(bin, hn::Set(di, last + 1))));
      V b = hn::Set(d, -kInf);
      if constexpr (kUndersides) {
        if (height.bottom > -kInf && guards_.respect_undersides) {
          b = hn::Mul(bottom, height.bottom < 0 ? least : largest);
          b = hn::Add(b, hn::Mul(hn::Abs(b), guard));
          mine = hn::And(mine, hn::Lt(b, s));
        }
      }
      const std::int32_t to = at & (view_.bins - 1);
      add_layer<kUndersides>(map_, static_cast<std::size_t>(to), d, mine, s, w, b);
      pad = pad || to < static_cast<std::int32_t>(PolarMap::kPad);
    }
    stats_.bins_written += static_cast<std::uint64_t>(last - first + 1);
    if (pad) map_.repeat_pad();
  }

  PolarMap& map_;
  const View& view_;
  const PolarGuards& guards_;
  PolarStats& stats_;
  float face_;
  Corners corners_;
  std::vector<float> chain_t_, chain_k_;
  std::vector<Piece> pieces_;
};

View make_view(const float eye[3], const PolarMap& map) {
  return {eye[0],
          eye[1],
          eye[2],
          static_cast<float>(map.bins()) / 8.0F,
          bin_slack(map.bins()),
          static_cast<std::int32_t>(map.bins()),
          map.horizon()};
}

template <bool kUndersides, bool kTerrain>
void draw(const WallSet& walls, const float eye[3], const Floors& floors, const DrawLimits& limits,
          const PolarGuards& guards, PolarMap& map, PolarStats& stats) {
  const View view = make_view(eye, map);
  WallPainter<kUndersides, kTerrain> painter(map, view, guards, stats);
  const auto paint = [&](std::uint32_t s) {
    const WallSet::Solid& solid = walls.solids[s];
    const bool down = (solid.floored && floors.above_floor) || (solid.grounded && floors.on_ground);
    painter.paint(walls, solid, {solid.top - view.y, down ? -kInf : solid.bottom - view.y});
    ++stats.solids_drawn;
  };
  // Drawing less is always safe.
  const auto at_limit = [&] { return stats.draw_work() >= limits.most && (stats.cut = true); };
  const auto wanted = [&](std::uint32_t s) {
    const bool yes = limits.wanted.empty() || limits.wanted[s] != 0;
    stats.cut = stats.cut || !yes;
    return yes;
  };
  if (!limits.only.empty()) {
    for (const std::uint32_t s : limits.only) {
      if (at_limit()) return;
      if (wanted(s)) paint(s);
    }
    return;
  }
  if (walls.tree.nodes.empty()) return;
  struct Pending {
    float near;  ///< 1/w
    std::uint32_t child;
    Box box;
    std::int32_t first, last;
  };
  std::vector<Pending> stack;
  stack.push_back({kInf, 0, {}, 0, -1});
  Seen seen;
  while (!stack.empty()) {
    if (at_limit()) return;
    const Pending p = stack.back();
    stack.pop_back();
    // What was drawn since it was pushed may hide it now.
    if (p.last >= p.first &&
        hidden_in_all<kUndersides, kTerrain>(map, p.box, p.first, p.last, false))
      continue;
    if ((p.child & BoxTree::kItem) != 0) {
      const std::uint32_t solid = p.child & ~BoxTree::kItem;
      if (wanted(solid)) paint(solid);
      continue;
    }
    const BoxTree::Node& node = walls.tree.nodes[p.child];
    ++stats.nodes_searched;
    stats.solids_tested += node.count;
    std::uint32_t visible = visible_children<kUndersides, kTerrain>(node, view, map, false, seen);
    const std::uint32_t around = holds_eye(node, view);
    const std::size_t begin = stack.size();
    for (; visible != 0; visible &= visible - 1) {
      const auto c = static_cast<std::uint32_t>(std::countr_zero(visible));
      const bool open = ((around >> c) & 1U) != 0;
      stack.push_back({open ? kInf : seen.near[c], node.child[c],
                       box_of<kUndersides, kTerrain>(view, seen, c), open ? 0 : seen.first[c],
                       open ? -1 : seen.last[c]});
    }
    std::sort(stack.begin() + static_cast<std::ptrdiff_t>(begin), stack.end(),
              [](const Pending& a, const Pending& b) {
                return a.near != b.near ? a.near < b.near : a.child < b.child;
              });
  }
}

/// Tests the children of one node; hands visible items and nodes on.
template <bool kUndersides, bool kTerrain, class OnItem, class OnNode>
HWY_INLINE void step(const BoxTree::Node& node, const View& view, const PolarMap& map, Seen& seen,
                     PolarStats& stats, const OnItem& on_item, const OnNode& on_node) {
  ++stats.nodes_tested;
  for (std::uint32_t m = visible_children<kUndersides, kTerrain>(node, view, map, true, seen);
       m != 0; m &= m - 1) {
    const std::uint32_t child = node.child[static_cast<std::uint32_t>(std::countr_zero(m))];
    if ((child & BoxTree::kItem) != 0) {
      on_item(child & ~BoxTree::kItem);
    } else {
      on_node(child);
    }
  }
}

template <bool kUndersides, bool kTerrain>
void find_children(const BoxTree& tree, std::uint32_t root, const float eye[3], const PolarMap& map,
                   std::vector<std::uint32_t>& visible, std::vector<std::uint32_t>& nodes,
                   PolarStats& stats) {
  Seen seen;
  step<kUndersides, kTerrain>(
      tree.nodes[root], make_view(eye, map), map, seen, stats,
      [&](std::uint32_t i) { visible.push_back(i); }, [&](std::uint32_t n) { nodes.push_back(n); });
}

/// Level by level: what is left untested lies deep in the tree.
template <bool kUndersides, bool kTerrain>
void find_within(const BoxTree& tree, std::uint32_t root, const View& view, const PolarMap& map,
                 std::uint64_t most, std::vector<std::uint32_t>& visible, PolarStats& stats) {
  std::vector<std::uint32_t> queue{root};
  Seen seen;
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const BoxTree::Node& node = tree.nodes[queue[i]];
    if (stats.nodes_tested < most) {
      step<kUndersides, kTerrain>(
          node, view, map, seen, stats, [&](std::uint32_t v) { visible.push_back(v); },
          [&](std::uint32_t n) { queue.push_back(n); });
      continue;
    }
    stats.cut = true;
    for (std::uint32_t c = 0; c < node.count; ++c) {
      if ((node.child[c] & BoxTree::kItem) != 0) {
        visible.push_back(node.child[c] & ~BoxTree::kItem);
        ++stats.untested;
      } else {
        queue.push_back(node.child[c]);
      }
    }
  }
}

template <bool kUndersides, bool kTerrain>
void find(const BoxTree& tree, std::uint32_t root, const float eye[3], const PolarMap& map,
          std::uint64_t most, std::vector<std::uint32_t>& visible, PolarStats& stats) {
  const View view = make_view(eye, map);
  if (most != std::numeric_limits<std::uint64_t>::max()) {
    find_within<kUndersides, kTerrain>(tree, root, view, map, most, visible, stats);
    return;
  }
  std::uint32_t stack[BoxTree::kWidth * 12];
  std::uint32_t size = 0;
  stack[size++] = root;
  Seen seen;
  while (size != 0) {
    const BoxTree::Node& node = tree.nodes[stack[--size]];
    step<kUndersides, kTerrain>(
        node, view, map, seen, stats, [&](std::uint32_t i) { visible.push_back(i); },
        [&](std::uint32_t n) { stack[size++] = n; });
  }
}

void find_children_target(const BoxTree& tree, std::uint32_t root, const float* eye,
                          bool undersides, const PolarMap& map, std::vector<std::uint32_t>& visible,
                          std::vector<std::uint32_t>& nodes, PolarStats& stats) {
  choose(undersides, map,
         [&](auto u, auto t) { find_children<u, t>(tree, root, eye, map, visible, nodes, stats); });
}

void draw_walls_target(const WallSet& walls, const float* eye, const Floors& floors,
                       const DrawLimits& limits, const PolarGuards& guards, PolarMap& map,
                       PolarStats& stats) {
  choose(floors.undersides, map,
         [&](auto u, auto t) { draw<u, t>(walls, eye, floors, limits, guards, map, stats); });
}

void find_visible_target(const BoxTree& tree, std::uint32_t root, const float* eye, bool undersides,
                         const PolarMap& map, std::uint64_t most,
                         std::vector<std::uint32_t>& visible, PolarStats& stats) {
  choose(undersides, map,
         [&](auto u, auto t) { find<u, t>(tree, root, eye, map, most, visible, stats); });
}

// A block's statement in layer k is the weakest of its bins' statements in layer k: it holds for
// all of them.
void finish_target(PolarMap& map, bool undersides) {
  const D d;
  const std::uint32_t blocks = map.bins() / PolarMap::kBlock;
  for (std::uint32_t k = 0; k < kLayers; ++k)
    for (std::uint32_t plane = 0; plane < (undersides ? 3U : 2U); ++plane) {
      const float* from = map.slope(k) + plane * std::size_t{map.stride()};
      float* to = map.coarse() + (3 * k + plane) * std::size_t{map.coarse_stride()};
      for (std::uint32_t b = 0; b < blocks; ++b, from += PolarMap::kBlock) {
        V m = hn::LoadU(d, from);
        for (std::uint32_t l = static_cast<std::uint32_t>(hn::Lanes(d)); l < PolarMap::kBlock;
             l += static_cast<std::uint32_t>(hn::Lanes(d)))
          m = plane == 2 ? hn::Max(m, hn::LoadU(d, from + l)) : hn::Min(m, hn::LoadU(d, from + l));
        to[b] = hn::GetLane(plane == 2 ? hn::MaxOfLanes(d, m) : hn::MinOfLanes(d, m));
      }
    }
}

const char* target_name() {
  return hwy::TargetName(HWY_TARGET);
}

}  // namespace
}  // namespace ivis::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ivis {

HWY_EXPORT(draw_walls_target);
HWY_EXPORT(find_visible_target);
HWY_EXPORT(find_children_target);
HWY_EXPORT(finish_target);
HWY_EXPORT(target_name);

PolarMap::PolarMap(std::uint32_t bins_a_face)
    : bins_(4 * bins_a_face),
      stride_(bins_ + kPad + kBlock +
              16),  // off powers of two, so that planes do not share cache sets
      coarse_stride_(bins_ / kBlock + kBlock + 16) {
  IVIS_ASSERT(std::has_single_bit(bins_a_face) && bins_a_face >= 64 && bins_a_face <= 8192,
              "bins a face: a power of two from 64 to 8192");
  data_.resize(std::size_t{3} * kLayers * stride_ / 16);
  coarse_.resize(std::size_t{3} * kLayers * coarse_stride_ / 16 + 1);
}

void PolarMap::clear() {
  for (std::uint32_t k = 0; k < kLayers; ++k) {
    std::fill_n(slope(k), stride_, -std::numeric_limits<float>::infinity());
    std::fill_n(near_inverse(k), stride_, 0.0F);
    std::fill_n(low(k), stride_, std::numeric_limits<float>::infinity());
  }
}

void PolarMap::repeat_pad() {
  for (std::uint32_t p = 0; p < 3 * kLayers; ++p) {
    float* plane = slope(0) + p * std::size_t{stride_};
    std::copy_n(plane, kPad, plane + bins_);
  }
}

void PolarMap::finish(bool undersides) {
  HWY_DYNAMIC_DISPATCH(finish_target)(*this, undersides);
}

void draw_walls(const WallSet& walls, const float eye[3], const Floors& floors,
                const DrawLimits& limits, const PolarGuards& guards, PolarMap& map,
                PolarStats& stats) {
  HWY_DYNAMIC_DISPATCH(draw_walls_target)(walls, eye, floors, limits, guards, map, stats);
}

void find_visible(const BoxTree& tree, std::uint32_t root, const float eye[3], bool undersides,
                  const PolarMap& map, std::uint64_t most, std::vector<std::uint32_t>& visible,
                  PolarStats& stats) {
  if (tree.nodes.empty()) return;
  HWY_DYNAMIC_DISPATCH(find_visible_target)(tree, root, eye, undersides, map, most, visible, stats);
}

void find_visible_children(const BoxTree& tree, std::uint32_t root, const float eye[3],
                           bool undersides, const PolarMap& map,
                           std::vector<std::uint32_t>& visible, std::vector<std::uint32_t>& nodes,
                           PolarStats& stats) {
  HWY_DYNAMIC_DISPATCH(find_children_target)
  (tree, root, eye, undersides, map, visible, nodes, stats);
}

const char* simd_target() {
  return HWY_DYNAMIC_DISPATCH(target_name)();
}

}  // namespace ivis
#endif  // HWY_ONCE
