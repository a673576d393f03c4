#include "bench/yardstick.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include <embree3/rtcore.h>

namespace ivis::bench {
namespace {

constexpr int kSide = 256;  // pixels along a face
constexpr int kLevels = 9;  // 256 .. 1
constexpr int kTile = 4;    // 4 x 4 pixels are one packet
constexpr int kFaces = 4;
constexpr float kNear = 0.01F;  // metres
constexpr int kSpan = 4;  // texels a box may cover along each axis at the level it is tested on
// A box is tested against every ray within a pixel of it: rays go through centres only, and what
// lies between a silhouette and the next ray would pop otherwise.
constexpr float kPadPixels = 1;

/// Depths along the face's axis: the level of 256 x 256 first, each further one the farthest of 2
/// x 2.
struct Pyramid {
  std::array<std::vector<float>, kLevels> level;
  Pyramid() {
    for (int l = 0; l < kLevels; ++l)
      level[static_cast<std::size_t>(l)].resize(std::size_t{1} << (2 * (8 - l)));
  }
  void build() {
    for (int l = 1; l < kLevels; ++l) {
      const int side = kSide >> l;
      const float* from = level[static_cast<std::size_t>(l - 1)].data();
      float* to = level[static_cast<std::size_t>(l)].data();
      for (int y = 0; y < side; ++y) {
        const float* a = from + 2 * y * 2 * side;
        const float* b = a + 2 * side;
        for (int x = 0; x < side; ++x)
          to[y * side + x] =
              std::max(std::max(a[2 * x], a[2 * x + 1]), std::max(b[2 * x], b[2 * x + 1]));
      }
    }
  }
};

/// Face f looks along +x, +z, -x, -z; its side axis is the other horizontal one, its rows go up.
struct Box {
  std::array<float, 3> lo, hi;
};

struct Node {
  Box box;
  std::uint32_t skip = 0;   // next node when this one is hidden; nodes lie in depth-first order
  std::uint32_t first = 0;  // leaf: boxes [first, first + count)
  std::uint32_t count = 0;
};

Box unite(const Box& a, const Box& b) {
  Box r;
  for (std::size_t k = 0; k < 3; ++k) {
    r.lo[k] = std::min(a.lo[k], b.lo[k]);
    r.hi[k] = std::max(a.hi[k], b.hi[k]);
  }
  return r;
}

}  // namespace

struct Yardstick::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Vec3 origin{0};
  std::size_t triangles = 0;
  std::vector<Box> boxes;  // in leaf order
  std::vector<Node> nodes;
  std::array<Pyramid, kFaces> faces;
  std::array<float, kSide> pixel_centre{};

  void add_buildings(const Scene& s);
  void build_boxes(std::vector<Box>& all, std::size_t first, std::size_t last);
  void trace(int face, const std::array<float, 3>& eye);
  bool hidden(const Box& box, const std::array<float, 3>& eye) const;
};

void Yardstick::Impl::add_buildings(const Scene& s) {
  std::vector<std::array<float, 3>> positions;
  std::vector<std::uint32_t> indices;
  std::vector<Box> all;
  for (const Object& o : s.objects) {
    if (!s.name_of(o).starts_with("building_")) {
      const Vec3 lo = o.bounds.lo - origin;
      const Vec3 hi = o.bounds.hi - origin;
      all.push_back(
          {{float(lo.x), float(lo.y), float(lo.z)}, {float(hi.x), float(hi.y), float(hi.z)}});
      continue;
    }
    const Mesh& mesh = s.mesh_of(o);
    const auto base = static_cast<std::uint32_t>(positions.size());
    for (const auto& p : mesh.positions) {
      const Vec3 w = Vec3(o.to_world * glm::dvec4(Vec3(p), 1.0)) - origin;
      positions.push_back({float(w.x), float(w.y), float(w.z)});
    }
    for (const std::uint32_t i : mesh.indices)
      indices.push_back(base + i);
  }
  triangles = indices.size() / 3;

  device = rtcNewDevice("threads=1");
  IVIS_ASSERT(device != nullptr, "Embree gives a device");
  scene = rtcNewScene(device);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  if (triangles > 0) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* v = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12,
                                      positions.size());
    void* t = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12,
                                      triangles);
    std::copy_n(positions.data(), positions.size(), static_cast<std::array<float, 3>*>(v));
    std::copy_n(indices.data(), indices.size(), static_cast<std::uint32_t*>(t));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene);
  if (!all.empty()) build_boxes(all, 0, all.size());
  boxes = std::move(all);
}

/// Median split along the longest side of the centres' bounds.
void Yardstick::Impl::build_boxes(std::vector<Box>& all, std::size_t first, std::size_t last) {
  const std::size_t index = nodes.size();
  nodes.emplace_back();
  Box bounds = all[first];
  std::array<float, 3> lo, hi;
  lo.fill(std::numeric_limits<float>::infinity());
  hi.fill(-std::numeric_limits<float>::infinity());
  for (std::size_t i = first; i < last; ++i) {
    bounds = unite(bounds, all[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], all[i].lo[k] + all[i].hi[k]);
      hi[k] = std::max(hi[k], all[i].lo[k] + all[i].hi[k]);
    }
  }
  constexpr std::size_t kLeaf = 4;
  if (last - first > kLeaf) {
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
    const std::size_t middle = (first + last) / 2;
    const auto at = [&](std::size_t i) { return all.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(first), at(middle), at(last), [axis](const Box& a, const Box& b) {
      return a.lo[axis] + a.hi[axis] < b.lo[axis] + b.hi[axis];
    });
    build_boxes(all, first, middle);
    build_boxes(all, middle, last);
  }
  Node& node = nodes[index];
  node.box = bounds;
  node.skip = static_cast<std::uint32_t>(nodes.size());
  node.first = static_cast<std::uint32_t>(first);
  node.count = last - first > kLeaf ? 0 : static_cast<std::uint32_t>(last - first);
}

void Yardstick::Impl::trace(int face, const std::array<float, 3>& eye) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  alignas(64) std::array<int, 16> valid;
  valid.fill(-1);
  RTCRayHit16 packet;
  for (int i = 0; i < 16; ++i) {
    packet.ray.org_x[i] = eye[0];
    packet.ray.org_y[i] = eye[1];
    packet.ray.org_z[i] = eye[2];
    packet.ray.time[i] = 0;
    packet.ray.mask[i] = ~0U;
    packet.ray.id[i] = 0;
    packet.ray.flags[i] = 0;
  }
  const float forward = face < 2 ? 1.0F : -1.0F;
  const bool along_x = face % 2 == 0;
  float* dir_forward = along_x ? packet.ray.dir_x : packet.ray.dir_z;
  float* dir_side = along_x ? packet.ray.dir_z : packet.ray.dir_x;
  float* dir_up = packet.ray.dir_y;
  float* depth = faces[static_cast<std::size_t>(face)].level[0].data();
  for (int y = 0; y < kSide; y += kTile) {
    for (int x = 0; x < kSide; x += kTile) {
      for (int i = 0; i < 16; ++i) {
        // The direction's part along the face's axis is 1, so a ray's parameter is the depth.
        dir_forward[i] = forward;
        dir_side[i] = pixel_centre[static_cast<std::size_t>(x + i % kTile)];
        dir_up[i] = pixel_centre[static_cast<std::size_t>(y + i / kTile)];
        packet.ray.tnear[i] = kNear;
        packet.ray.tfar[i] = std::numeric_limits<float>::infinity();
        packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      }
      rtcIntersect16(valid.data(), scene, &context, &packet);
      for (int i = 0; i < 16; ++i)
        depth[(y + i / kTile) * kSide + x + i % kTile] = packet.ray.tfar[i];
    }
  }
}

bool Yardstick::Impl::hidden(const Box& box, const std::array<float, 3>& eye) const {
  const float y0 = box.lo[1] - eye[1];
  const float y1 = box.hi[1] - eye[1];
  for (int face = 0; face < kFaces; ++face) {
    const std::size_t a = face % 2 == 0 ? 0 : 2;
    const std::size_t b = 2 - a;
    const float w_lo = box.lo[a] - eye[a];
    const float w_hi = box.hi[a] - eye[a];
    const float far = face < 2 ? w_hi : -w_lo;
    if (far <= kNear) continue;
    const float near = std::max(face < 2 ? w_lo : -w_hi, kNear);
    const float s0 = box.lo[b] - eye[b];
    const float s1 = box.hi[b] - eye[b];
    // Outside the face's pyramid?
    if (s0 >= far || s1 <= -far || y0 >= far || y1 <= -far) continue;
    const float inv_near = 1 / near;
    const float inv_far = 1 / far;
    constexpr float kHalf = kSide / 2;
    const auto pixel = [](float u, float pad) {
      return static_cast<int>(std::clamp(u * kHalf + (kHalf + pad), 0.0F, float(kSide - 1)));
    };
    const int px0 = pixel(s0 * (s0 >= 0 ? inv_far : inv_near), -kPadPixels);
    const int px1 = pixel(s1 * (s1 >= 0 ? inv_near : inv_far), kPadPixels);
    const int py0 = pixel(y0 * (y0 >= 0 ? inv_far : inv_near), -kPadPixels);
    const int py1 = pixel(y1 * (y1 >= 0 ? inv_near : inv_far), kPadPixels);
    int level = 0;
    while (((px1 >> level) - (px0 >> level)) >= kSpan || ((py1 >> level) - (py0 >> level)) >= kSpan)
      ++level;
    const float* depth =
        faces[static_cast<std::size_t>(face)].level[static_cast<std::size_t>(level)].data();
    const int side = kSide >> level;
    for (int y = py0 >> level; y <= py1 >> level; ++y)
      for (int x = px0 >> level; x <= px1 >> level; ++x)
        if (near <= depth[y * side + x]) return false;
  }
  return true;
}

Yardstick::Yardstick(const Scene& scene) : impl_(std::make_unique<Impl>()) {
  impl_->origin = scene.bounds.empty() ? Vec3{0} : scene.bounds.centre();
  for (int i = 0; i < kSide; ++i)
    impl_->pixel_centre[static_cast<std::size_t>(i)] =
        (static_cast<float>(i) + 0.5F) / (kSide / 2) - 1;
  impl_->add_buildings(scene);
}

Yardstick::~Yardstick() {
  rtcReleaseScene(impl_->scene);
  rtcReleaseDevice(impl_->device);
}

std::size_t Yardstick::run(const Vec3& eye_world) {
  const Vec3 local = eye_world - impl_->origin;
  const std::array<float, 3> eye{float(local.x), float(local.y), float(local.z)};
  for (int face = 0; face < kFaces; ++face) {
    impl_->trace(face, eye);
    impl_->faces[static_cast<std::size_t>(face)].build();
  }
  std::size_t seen = 0;
  for (std::size_t n = 0; n < impl_->nodes.size();) {
    const Node& node = impl_->nodes[n];
    if (impl_->hidden(node.box, eye)) {
      n = node.skip;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i)
      if (!impl_->hidden(impl_->boxes[i], eye)) ++seen;
    ++n;
  }
  return seen;
}

std::size_t Yardstick::triangles() const {
  return impl_->triangles;
}
std::size_t Yardstick::boxes() const {
  return impl_->boxes.size();
}

}  // namespace ivis::bench
