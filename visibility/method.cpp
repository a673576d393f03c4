#include "visibility/method.h"

#include "visibility/backend.h"
#include "visibility/backing_cull.h"
#include "visibility/cull_map.h"
#include "visibility/occlusion_map.h"
#include "visibility/reference.h"

namespace ivis {

const char* to_string(Guarantee g) {
  switch (g) {
    case Guarantee::kConservative:
      return "conservative";
    case Guarantee::kExactAtSamples:
      return "exact at samples";
    case Guarantee::kAggressive:
      return "aggressive";
  }
  return "unknown";
}

const char* to_string(Backend b) {
  switch (b) {
    case Backend::kAuto:
      return "auto";
    case Backend::kCpu:
      return "cpu";
    case Backend::kGl:
      return "gl";
  }
  return "unknown";
}

namespace {

using Made = Result<std::unique_ptr<Method>>;

struct Entry {
  MethodTraits traits;
  Made (*make)(const Scene&, const OccluderSet&, const MethodOptions&);
  bool has_gl = false;
};

const std::vector<Entry>& entries() {
  static const std::vector<Entry> all{
      {CullMap::make_traits(), make_cull_map, true},
      {OcclusionMap::make_traits(), make_occlusion_map, true},
      {reference_traits(),
       [](const Scene& s, const OccluderSet& o, const MethodOptions& m) -> Made {
         return make_reference(s, o, m);
       }},
  };
  return all;
}

}  // namespace

std::vector<MethodTraits> method_list() {
  std::vector<MethodTraits> traits;
  for (const Entry& e : entries())
    traits.push_back(e.traits);
  return traits;
}

Result<std::unique_ptr<Method>> make_method(std::string_view name, const Scene& scene,
                                            const OccluderSet& occluders,
                                            const MethodOptions& options) {
  std::string known;
  for (const Entry& e : entries()) {
    if (e.traits.name == name) {
      if (e.traits.needs_occluders && occluders.scene_hash != scene.hash)
        return mismatch("the occluders belong to another scene than the one loaded");
      if (auto sound = check_numbers(occluders); !sound) return sound.error();
      if (e.traits.needs_occluders && !occluders.backings.empty() &&
          occluders.backings.back().object >= scene.objects.size())
        return mismatch("the occluders speak of object " +
                        std::to_string(occluders.backings.back().object) + ", the scene has " +
                        std::to_string(scene.objects.size()));
      if (options.backend == Backend::kGl && !e.has_gl)
        return invalid_argument("method '" + e.traits.name +
                                "' has no OpenGL backend; 'occlusion-map' has, and 'cull-map' with "
                                "the orthographic map");
      auto made = e.make(scene, occluders, options);
      if (!made || !e.traits.needs_occluders || occluders.backings.empty()) return made;
      return cull_backed(std::move(*made), scene, occluders);
    }
    known += (known.empty() ? "" : ", ") + e.traits.name;
  }
  return invalid_argument("no method '" + std::string(name) + "'; known: " + known);
}

}  // namespace ivis
