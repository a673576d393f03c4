#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/pvs.h"
#include "core/result.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

enum class Guarantee {
  kConservative,    ///< never leaves out an object seen from the cell
  kExactAtSamples,  ///< right for the viewpoints it sampled, may miss between them
  kAggressive,      ///< may miss
};
const char* to_string(Guarantee g);

struct MethodTraits {
  std::string name;        ///< as on the command line
  Guarantee guarantee = Guarantee::kConservative;
  bool needs_occluders = true;
  std::string summary;     ///< one line for --help
};

/// Which map the cull map is sampled on.
enum class CullMapKind { kPolar, kOrthographic };

struct MethodOptions {
  CullMapKind map = CullMapKind::kPolar;
  /// Threads inside one solve. The result has the same bits whatever the number.
  unsigned threads = 1;
  /// Draw only so many occluders, those of largest projected area first; 0: all that are not hidden.
  std::size_t max_occluders = 0;
  /// Occlusion map: pixels a side of each of its six faces, a multiple of 16 from 64 to 4096. 0: 512, or 1024 for
  /// reaches below half a metre, which a pixel's margin would add much to.
  std::uint32_t map_pixels = 0;
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
  /// Guarantee: traits().guarantee. Errors: kInvalidArgument if the cell's reach is larger than the
  /// occluders were shrunk for, or the eye is not finite.
  virtual Result<Pvs> solve(const ViewCell& cell) const = 0;
};

/// Traits of every registered method.
std::vector<MethodTraits> method_list();

/// Errors: kInvalidArgument naming `name` and the known ones, or what check_numbers() finds;
/// kMismatch if the occluders belong to another scene. Cost: O(objects log objects).
Result<std::unique_ptr<Method>> make_method(std::string_view name, const Scene& scene,
                                            const OccluderSet& occluders,
                                            const MethodOptions& options = {});

}  // namespace ivis
