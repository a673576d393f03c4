#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/pvs.h"
#include "core/result.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"
#include "visibility/amendment.h"
#include "visibility/effort.h"

namespace ivis {

enum class Guarantee {
  kConservative,    ///< never leaves out an object seen from the cell
  kExactAtSamples,  ///< right for the viewpoints it sampled, may miss between them
  kAggressive,      ///< may miss
};
const char* to_string(Guarantee g);

struct MethodTraits {
  std::string name;  ///< as on the command line
  Guarantee guarantee = Guarantee::kConservative;
  bool needs_occluders = true;
  std::string summary;  ///< one line for --help
};

/// Which map the cull map is sampled on.
enum class CullMapKind { kPolar, kOrthographic };

/// What the occlusion map and the orthographic cull map are drawn on.
enum class Backend {
  kAuto,  ///< OpenGL where it is built in and drawn by hardware, else and on any failure the CPU
  kCpu,
  kGl,  ///< OpenGL, by software if need be; an error where that fails
};

const char* to_string(Backend b);  ///< "auto", "cpu", "gl"

/// Which occluders the maps draw (Wonka, Wimmer, Sillion 2001, section 5.2). All err to visible.
enum class Selection {
  kConservative,  ///< all; those that nearer ones hide are passed over
  kTemporal,      ///< those that showed at the observer's last solve: a new one hides only the next
                  ///< time
  kTwoPass,       ///< those that show past the ones that showed at the last solve: as kConservative
};

/// The occluders that showed at an observer's last solve, as a method numbers them. A value of the
/// caller's, one an observer and method.
struct LastShown {
  bool known = false;
  std::vector<std::uint32_t> occluders;
};

class Method;
struct MethodOptions;
/// Makes the OpenGL occlusion map: hardware only for Backend::kAuto. Errors: kUnsupported, saying
/// what is missing.
using GlFactory = std::function<Result<std::unique_ptr<Method>>(const Scene&, const OccluderSet&,
                                                                const MethodOptions&)>;

class OrthographicMap;
class ShadowDrawer;
/// Makes what draws the orthographic cull map's shadows with OpenGL; likewise.
using GlShadows =
    std::function<Result<std::unique_ptr<ShadowDrawer>>(const OrthographicMap&, Backend)>;

struct MethodOptions {
  CullMapKind map = CullMapKind::kPolar;
  /// Threads inside one solve. The result has the same bits whatever the number.
  unsigned threads = 1;
  /// Draw only so many occluders, those of largest projected area first; 0: all that are not
  /// hidden.
  std::size_t max_occluders = 0;
  /// Needs solves that are told of the observer's last one; others draw all. On the CPU only.
  Selection selection = Selection::kConservative;
  /// Occlusion map: pixels a side of each of its six faces, a multiple of 16 from 64 to 4096. 0:
  /// 512, or 1024 for reaches below half a metre, which a pixel's margin would add much to.
  std::uint32_t map_pixels = 0;
  Backend backend = Backend::kAuto;
  /// make_gl_occlusion_map of visibility/gl, from programs that link it; null: there is no OpenGL.
  GlFactory make_gl;
  /// make_gl_shadow_map of visibility/gl, likewise.
  GlShadows make_gl_shadows;
  /// Told once when Backend::kAuto does without OpenGL though it is built in; from any thread.
  std::function<void(std::string_view)> log;
  /// Reference method: aimed rays an object.
  std::size_t rays = 256;
  std::uint64_t seed = 1;
};

/// One visibility algorithm prepared for one scene and occluder set.
/// Threads:   solve() is const and reentrant.
/// Ownership: borrows scene and occluders, which must outlive it.
class Method {
 public:
  virtual ~Method() = default;
  virtual const MethodTraits& traits() const = 0;
  /// What the last answer was computed on.
  virtual Backend backend() const { return Backend::kCpu; }
  /// Guarantee: traits().guarantee. Errors: kInvalidArgument if the cell's reach is larger than the
  /// occluders were shrunk for, or the eye is not finite.
  virtual Result<Pvs> solve(const ViewCell& cell) const = 0;
  /// The same for an observer whose last solve left `last`, which is brought up to date: what
  /// MethodOptions::selection goes by. Threads: reentrant, but not with one `last`.
  virtual Result<Pvs> solve(const ViewCell& cell, LastShown& /*last*/) const { return solve(cell); }
  /// The same within a budget. A method that has none does all there is: keeps_to_effort().
  virtual Result<Pvs> solve(const ViewCell& cell, const Effort& /*effort*/, Work& /*done*/) const {
    return solve(cell);
  }
  virtual bool keeps_to_effort() const { return false; }
  /// The same for a scene that has changed. Guarantee: traits().guarantee, for that scene.
  /// Errors: kUnsupported unless takes_amendments().
  virtual Result<Pvs> solve(const ViewCell& /*cell*/, const Effort& /*effort*/,
                            const Amendment& /*amendment*/, Work& /*done*/) const {
    return unsupported("the method " + traits().name + " takes no changes of the scene");
  }
  virtual bool takes_amendments() const { return false; }
};

/// Traits of every registered method.
std::vector<MethodTraits> method_list();

/// Errors: kInvalidArgument naming `name` and the known ones, what check_numbers() finds, or that
/// the method has no OpenGL backend; kMismatch if the occluders belong to another scene;
/// kUnsupported if Backend::kGl is asked for and does not work. Cost: O(objects log objects).
Result<std::unique_ptr<Method>> make_method(std::string_view name, const Scene& scene,
                                            const OccluderSet& occluders,
                                            const MethodOptions& options = {});

}  // namespace ivis
