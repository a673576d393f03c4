#include "visibility/verify.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>
#include <string>

#include "visibility/aim.h"
#include "visibility/exact_segment.h"
#include "visibility/ray_scene.h"
#include "visibility/viewpoints.h"

namespace ivis {
namespace {

constexpr std::size_t kViewpoints = 64;
/// Directions towards objects, for which the outermost viewpoints are known.
constexpr std::size_t kSectors = 32;
/// Outermost viewpoints a sector: half to either side.
constexpr std::size_t kOutermost = 8;
/// They stop at the first that arrives; four times as many more find about two objects in a hundred
/// more.
constexpr std::size_t kRaysAListedObject = 256;
/// Suspects of one object and chunk that may fail to be confirmed before the rest are let go.
constexpr std::uint8_t kMaxRefuted = 200;
constexpr std::uint8_t kFound = 255;

std::uint64_t seed_of(const ViewCell& cell, std::uint64_t seed) {
  for (int k = 0; k < 3; ++k)
    seed = mix(seed ^ std::bit_cast<std::uint64_t>(cell.eye[k]));
  return seed;
}

/// Viewpoints of a cell, and for each direction those farthest out to its left and right: what
/// hides behind a corner shows itself there first.
struct Viewpoints {
  std::vector<Vec3> points;
  std::array<std::vector<std::uint32_t>, kSectors> outermost;
  Vec3 eye{0};

  Viewpoints(std::vector<Vec3> p, const Vec3& e) : points(std::move(p)), eye(e) {
    std::vector<std::uint32_t> order(points.size());
    for (std::uint32_t i = 0; i < order.size(); ++i)
      order[i] = i;
    for (std::size_t s = 0; s < kSectors; ++s) {
      const double angle = 2 * std::numbers::pi * (static_cast<double>(s) + 0.5) / kSectors;
      const Vec2 left{-std::sin(angle), std::cos(angle)};
      std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return glm::dot(left, ground(points[a] - eye)) > glm::dot(left, ground(points[b] - eye));
      });
      const std::size_t half = std::min(kOutermost / 2, order.size());
      outermost[s].assign(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(half));
      outermost[s].insert(outermost[s].end(), order.end() - static_cast<std::ptrdiff_t>(half),
                          order.end());
    }
  }

  const std::vector<std::uint32_t>& towards(const Vec3& target) const {
    const Vec2 d = ground(target - eye);
    const double turn = std::atan2(d.y, d.x) / (2 * std::numbers::pi);
    const auto sector = static_cast<std::size_t>((turn < 0 ? turn + 1 : turn) * kSectors);
    return outermost[std::min(sector, kSectors - 1)];
  }
};

struct Sightings {
  std::vector<Miss> seen;  // ascending, one an object
  std::size_t rays = 0;
};

}  // namespace

struct Verifier::Impl {
  const Scene& scene;
  Blockers blockers;
  ExactSegments exact;
  RayScene rays;
  AimPoints aims;
  FreeSpace space;
  std::vector<ObjectId> order;  // spatial: neighbours are traced together

  Impl(const Scene& s, const OccluderSet* occluders, BlockerChoice choice)
      : scene(s),
        blockers(find_blockers(s, choice)),
        exact(s, blockers),
        rays(s, blockers),
        aims(s),
        space(s, occluders, exact),
        order(rank_order(s)) {}

  /// Where ray `lane` met blocker `hit`, in double precision on the triangle itself.
  Vec3 point_on(const RayPacket& packet, int lane) const;
  void trace_chunk(const Viewpoints& from, std::span<const ObjectId> targets,
                   const std::vector<bool>& wanted, std::size_t rays_each, std::uint64_t seed,
                   const Frustum* frustum, Sightings& result) const;
  /// Aims rays at every target; what of `wanted` they see, confirmed.
  Sightings sight(const Viewpoints& from, std::span<const ObjectId> targets,
                  const std::vector<bool>& wanted, std::size_t rays_each, std::uint64_t seed,
                  const Frustum* frustum, const Context& context) const;
};

Vec3 Verifier::Impl::point_on(const RayPacket& packet, int lane) const {
  const Triangle t = front_facing_triangle(scene, blockers.triangles[packet.hit[lane]]);
  double u = std::clamp(static_cast<double>(packet.u[lane]), 0.0, 1.0);
  double v = std::clamp(static_cast<double>(packet.v[lane]), 0.0, 1.0);
  if (u + v > 1) {
    u /= u + v;
    v = 1 - u;
  }
  return t.a + u * (t.b - t.a) + v * (t.c - t.a);
}

void Verifier::Impl::trace_chunk(const Viewpoints& from, std::span<const ObjectId> targets,
                                 const std::vector<bool>& wanted, std::size_t rays_each,
                                 std::uint64_t seed, const Frustum* frustum,
                                 Sightings& result) const {
  constexpr int kWidth = RayPacket::kWidth;
  std::vector<std::uint8_t> state(scene.objects.size());  // refuted suspects, or kFound
  const auto suspect = [&](ObjectId id, const Vec3& viewpoint, const Vec3& point) {
    if (!wanted[id] || state[id] >= kMaxRefuted) return;
    if (frustum != nullptr && !frustum->can_look_along(point - viewpoint)) return;
    if (exact.blocked(viewpoint, point)) {
      ++state[id];
    } else {
      state[id] = kFound;
      result.seen.push_back({id, viewpoint, point});
    }
  };
  const auto n = static_cast<std::uint32_t>(from.points.size());
  RayPacket packet;
  packet.tfar = 1.001F;
  std::array<Vec3, kWidth> viewpoint;
  std::array<AimPoints::Aim, kWidth> aim;
  for (const ObjectId target : targets) {
    const Object& object = scene.objects[target];
    Random random(mix(seed) ^ target);
    const auto& outermost = from.towards(object.bounds.centre());
    const std::uint32_t first = random.below(n);
    for (std::size_t k = 0; k < rays_each && state[target] != kFound; k += kWidth) {
      const int count = static_cast<int>(std::min<std::size_t>(kWidth, rays_each - k));
      for (int i = 0; i < count; ++i) {
        const std::size_t ray = k + static_cast<std::size_t>(i);
        const auto lane = static_cast<std::size_t>(i);
        // Every other four rays (one round of kinds of aim) leave from the outermost viewpoints.
        const bool outer = ray / 4 % 2 == 1;
        viewpoint[lane] =
            from.points[outer
                            ? outermost[random.below(static_cast<std::uint32_t>(outermost.size()))]
                            : (first + ray / 8 * 4 + ray % 4) % n];
        aim[lane] = aims.aim(object, ray, rays_each, random);
        const Vec3 origin = viewpoint[lane] - rays.origin();
        const Vec3 direction = aim[lane].point - viewpoint[lane];
        for (int c = 0; c < 3; ++c) {
          packet.org[c][i] = static_cast<float>(origin[c]);
          packet.dir[c][i] = static_cast<float>(direction[c]);
        }
      }
      for (int i = count; i < kWidth; ++i)
        for (int c = 0; c < 3; ++c) {
          packet.org[c][i] = packet.org[c][0];
          packet.dir[c][i] = packet.dir[c][0];
        }
      rays.first_hits(packet, count);
      result.rays += static_cast<std::size_t>(count);
      for (int i = 0; i < count; ++i) {
        const auto lane = static_cast<std::size_t>(i);
        if (packet.hit[i] != RayPacket::kNothing) {
          const std::uint32_t solid = blockers.triangles[packet.hit[i]].solid;
          if (solid < scene.objects.size() && wanted[solid] && state[solid] < kMaxRefuted)
            suspect(solid, viewpoint[lane], point_on(packet, i));
        }
        // A ray that got as far as its target: it may be one that does not block, or lie in the
        // same plane as what was hit.
        if (packet.hit[i] == RayPacket::kNothing || packet.t[i] >= 0.9999F)
          suspect(target, viewpoint[lane], aim[lane].point);
      }
    }
  }
}

Sightings Verifier::Impl::sight(const Viewpoints& from, std::span<const ObjectId> targets,
                                const std::vector<bool>& wanted, std::size_t rays_each,
                                std::uint64_t seed, const Frustum* frustum,
                                const Context& context) const {
  Sightings all;
  if (from.points.empty() || targets.empty()) return all;
  // Chunks do not depend on the number of threads, so neither does what they find.
  const std::size_t chunk = std::clamp<std::size_t>(targets.size() / 64, 16, 1024);
  const std::size_t chunks = (targets.size() + chunk - 1) / chunk;
  std::vector<Sightings> found(chunks);
  parallel_for(context, chunks, [&](std::size_t c) {
    const std::size_t first = c * chunk;
    trace_chunk(from, targets.subspan(first, std::min(chunk, targets.size() - first)), wanted,
                rays_each, seed, frustum, found[c]);
  });
  for (const Sightings& s : found) {
    all.rays += s.rays;
    all.seen.insert(all.seen.end(), s.seen.begin(), s.seen.end());
  }
  // Of several sightings of an object the one of the first chunk stays.
  std::stable_sort(all.seen.begin(), all.seen.end(),
                   [](const Miss& a, const Miss& b) { return a.id < b.id; });
  all.seen.erase(std::unique(all.seen.begin(), all.seen.end(),
                             [](const Miss& a, const Miss& b) { return a.id == b.id; }),
                 all.seen.end());
  return all;
}

Verifier::Verifier(const Scene& scene, const OccluderSet* occluders, BlockerChoice blockers)
    : impl_(std::make_unique<Impl>(scene, occluders, blockers)) {}
Verifier::~Verifier() = default;

Result<CellReport> Verifier::check(const Pvs& pvs, const VerifyOptions& options,
                                   const Context& context) const {
  const Scene& scene = impl_->scene;
  if (pvs.scene_hash != scene.hash)
    return mismatch("PVS: scene hash " + std::to_string(pvs.scene_hash) + ", expected " +
                    std::to_string(scene.hash));
  std::vector<bool> listed(scene.objects.size());
  for (const ObjectId id : pvs.objects) {
    if (id >= listed.size())
      return mismatch("PVS: object " + std::to_string(id) + ", expected below " +
                      std::to_string(listed.size()));
    listed[id] = true;
  }
  const Frustum* frustum = options.frustum ? &*options.frustum : nullptr;
  CellReport report;
  report.pvs = pvs.objects.size();
  std::vector<bool> culled(listed);
  culled.flip();
  std::vector<Miss> misses;
  std::vector<ObjectId> targets;
  std::vector<ObjectId> listed_targets;
  for (const ObjectId id : impl_->order) {
    const Object& o = scene.objects[id];
    if (culled[id] && o.always_visible) misses.push_back({id, pvs.cell.eye, o.bounds.centre()});
    if (o.always_visible) culled[id] = false;
    if (scene.mesh_of(o).triangles() == 0) continue;
    if (culled[id]) targets.push_back(id);
    if (listed[id]) listed_targets.push_back(id);
  }

  const std::uint64_t seed = seed_of(pvs.cell, options.seed);
  const Viewpoints from(impl_->space.viewpoints(pvs.cell, kViewpoints, seed, &report.discarded),
                        pvs.cell.eye);
  report.viewpoints = from.points.size();
  Sightings missed =
      impl_->sight(from, targets, culled, options.rays_per_culled_object, seed, frustum, context);
  if (context.stopped()) return cancelled();
  const std::size_t seen_missed = missed.seen.size();
  misses.insert(misses.end(), missed.seen.begin(), missed.seen.end());
  std::sort(misses.begin(), misses.end(), [](const Miss& a, const Miss& b) { return a.id < b.id; });
  const Sightings seen =
      impl_->sight(from, listed_targets, listed, kRaysAListedObject, mix(seed), frustum, context);
  if (context.stopped()) return cancelled();

  report.rays = missed.rays;
  report.false_negatives = misses.size();
  misses.resize(std::min(misses.size(), options.max_listed));
  report.missing = std::move(misses);
  report.seen = seen.seen.size() + seen_missed;
  return report;
}

std::vector<ObjectId> Verifier::seen_from(const ViewCell& cell, std::size_t rays,
                                          std::uint64_t seed, const Context& context) const {
  const Scene& scene = impl_->scene;
  std::vector<bool> wanted(scene.objects.size(), true);
  std::vector<ObjectId> targets;
  for (const ObjectId id : impl_->order)
    if (scene.mesh_of(scene.objects[id]).triangles() > 0) targets.push_back(id);
  const std::uint64_t cell_seed = seed_of(cell, seed);
  const Viewpoints from(impl_->space.viewpoints(cell, kViewpoints, cell_seed), cell.eye);
  std::vector<ObjectId> ids;
  for (const Miss& s : impl_->sight(from, targets, wanted, rays, cell_seed, nullptr, context).seen)
    ids.push_back(s.id);
  return ids;
}

}  // namespace ivis
