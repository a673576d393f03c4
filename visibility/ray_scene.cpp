#include "visibility/ray_scene.h"

#include <array>
#include <cstring>
#include <utility>
#include <vector>

#include <embree3/rtcore.h>

namespace ivis {
namespace {

constexpr unsigned kTwoSidedGeometry = 0;
constexpr unsigned kOneSidedGeometry = 1;

/// Lets rays through that meet the back.
void reject_back(const RTCFilterFunctionNArguments* args) {
  const unsigned n = args->N;
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] == 0) continue;
    const float along = RTCRayN_dir_x(args->ray, n, i) * RTCHitN_Ng_x(args->hit, n, i) +
                        RTCRayN_dir_y(args->ray, n, i) * RTCHitN_Ng_y(args->hit, n, i) +
                        RTCRayN_dir_z(args->ray, n, i) * RTCHitN_Ng_z(args->hit, n, i);
    if (along >= 0) args->valid[i] = 0;
  }
}

}  // namespace

struct RayScene::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Vec3 origin{0};
  std::uint32_t first_one_sided = 0;
  std::vector<float> vertices;  // three a vertex, and four bytes that Embree reads past the end
  std::vector<std::uint32_t> indices;  // three a blocker, in their order

  void flatten(const Scene& s, const Blockers& blockers);
  void attach(std::size_t first, std::size_t last, unsigned id, bool one_sided);
};

/// Blockers of one solid come in a run (two, where sides count): its vertices are transformed once
/// a run.
void RayScene::Impl::flatten(const Scene& s, const Blockers& blockers) {
  indices.reserve(3 * blockers.triangles.size() + 4);
  std::uint32_t current = ~0U;
  bool shared = false;
  bool mirrored = false;
  std::uint32_t base = 0;
  const auto add = [&](const Object& o, const glm::vec3& p) {
    const Vec3 w = Vec3(o.to_world * glm::dvec4(Vec3(p), 1.0)) - origin;
    for (int k = 0; k < 3; ++k)
      vertices.push_back(static_cast<float>(w[k]));
    return static_cast<std::uint32_t>(vertices.size() / 3 - 1);
  };
  for (std::size_t i = 0; i < blockers.triangles.size(); ++i) {
    const TriangleRef& ref = blockers.triangles[i];
    const Object& o = solid_at(s, ref.solid);
    const Mesh& mesh = s.mesh_of(o);
    if (ref.solid != current || i == blockers.first_one_sided) {
      current = ref.solid;
      mirrored = glm::determinant(glm::dmat3(o.to_world)) < 0;
      // A mesh with more positions than its triangles can use must not be copied once an instance.
      shared = mesh.positions.size() <= mesh.indices.size();
      base = static_cast<std::uint32_t>(vertices.size() / 3);
      if (shared)
        for (const auto& p : mesh.positions)
          add(o, p);
    }
    std::array<std::uint32_t, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.indices[3 * std::size_t{ref.triangle} + k];
      corner[k] = shared ? base + v : add(o, mesh.positions[v]);
    }
    if (mirrored) std::swap(corner[1], corner[2]);
    indices.insert(indices.end(), corner.begin(), corner.end());
  }
  vertices.push_back(0);
}

void RayScene::Impl::attach(std::size_t first, std::size_t last, unsigned id, bool one_sided) {
  if (first == last) return;
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             vertices.data(), 0, 12, vertices.size() / 3);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices.data(),
                             12 * first, 12, last - first);
  if (one_sided) rtcSetGeometryIntersectFilterFunction(geometry, reject_back);
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

RayScene::RayScene(const Scene& scene, const Blockers& blockers) : impl_(std::make_unique<Impl>()) {
  impl_->origin = scene.bounds.empty() ? Vec3{0} : scene.bounds.centre();
  impl_->first_one_sided = static_cast<std::uint32_t>(blockers.first_one_sided);
  impl_->flatten(scene, blockers);
  impl_->device = rtcNewDevice(nullptr);
  IVIS_ASSERT(impl_->device != nullptr, "the ray tracer gives a device");
  impl_->scene = rtcNewScene(impl_->device);
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);
  impl_->attach(0, blockers.first_one_sided, kTwoSidedGeometry, false);
  impl_->attach(blockers.first_one_sided, blockers.triangles.size(), kOneSidedGeometry, true);
  rtcCommitScene(impl_->scene);
  IVIS_ASSERT(rtcGetDeviceError(impl_->device) == RTC_ERROR_NONE,
              "the ray tracer builds its scene");
}

RayScene::~RayScene() {
  rtcReleaseScene(impl_->scene);
  rtcReleaseDevice(impl_->device);
}

const Vec3& RayScene::origin() const {
  return impl_->origin;
}

void RayScene::first_hits(RayPacket& packet, int count) const {
  constexpr int kWidth = RayPacket::kWidth;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  alignas(64) int valid[kWidth];
  RTCRayHit16 rays;
  static_assert(sizeof packet.org[0] == sizeof rays.ray.org_x);
  std::memcpy(rays.ray.org_x, packet.org[0], sizeof packet.org[0]);
  std::memcpy(rays.ray.org_y, packet.org[1], sizeof packet.org[1]);
  std::memcpy(rays.ray.org_z, packet.org[2], sizeof packet.org[2]);
  std::memcpy(rays.ray.dir_x, packet.dir[0], sizeof packet.dir[0]);
  std::memcpy(rays.ray.dir_y, packet.dir[1], sizeof packet.dir[1]);
  std::memcpy(rays.ray.dir_z, packet.dir[2], sizeof packet.dir[2]);
  for (int i = 0; i < kWidth; ++i) {
    valid[i] = i < count ? -1 : 0;
    rays.ray.tnear[i] = 0;
    rays.ray.tfar[i] = packet.tfar;
    rays.ray.time[i] = 0;
    rays.ray.mask[i] = ~0U;
    rays.ray.id[i] = 0;
    rays.ray.flags[i] = 0;
    rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  // Where sixteen lanes are not native, Embree traces the rays one by one.
  rtcIntersect16(valid, impl_->scene, &context, &rays);
  for (int i = 0; i < kWidth; ++i) {
    const bool met = i < count && rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    const std::uint32_t base = rays.hit.geomID[i] == kOneSidedGeometry ? impl_->first_one_sided : 0;
    packet.hit[i] = met ? base + rays.hit.primID[i] : RayPacket::kNothing;
    packet.t[i] = rays.ray.tfar[i];
    packet.u[i] = rays.hit.u[i];
    packet.v[i] = rays.hit.v[i];
  }
}

}  // namespace ivis
