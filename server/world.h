#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/occluder_set.h"
#include "scenes/clusters.h"
#include "scenes/scene.h"
#include "server/ladder.h"
#include "visibility/method.h"

namespace ivis::server {

/// A scene made ready to be asked about. Not movable: `method` borrows the rest.
struct World {
  Scene scene;
  OccluderSet occluders;
  Reach reach;  ///< of a cell, when nobody wants another
  std::unique_ptr<Method> method;
  std::unique_ptr<OccluderIndex> index;
  /// For smaller reaches, by build_rungs().
  struct Rung {
    OccluderSet occluders;
    std::unique_ptr<Method> method;
    std::unique_ptr<OccluderIndex> index;
  };
  std::vector<std::unique_ptr<Rung>> rungs;

  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
};

struct WorldOptions {
  std::filesystem::path scene;
  std::filesystem::path occluders;  ///< empty: shrink here, with the fast builder
  std::string reach;                ///< empty: the occluder file's, or `default_reach`
  std::string default_reach = "cylinder:1.5,0.1";
  std::string method;    ///< empty: the first of method_list()
  unsigned threads = 1;  ///< inside one solve
  Granularity granularity = Granularity::kObject;
};

/// Errors: those of load_scene, read_occluders, check_occluders, shrink and make_method.
/// Cost: loading, and shrinking when no file is given: about a second for a city of 1,500
/// buildings.
Result<std::unique_ptr<World>> load_world(const WorldOptions& options, const Context& context = {});

/// Shrinks for the ladder's smaller reaches, the largest of them first, and adds a method for each
/// to the ladder when it is ready. Not for two threads at a time; the ladder may be in use.
/// Errors: those of shrink and make_method, kCancelled; what was added stays.
Status build_rungs(World& world, Ladder& ladder, const WorldOptions& options,
                   const Context& context);

}  // namespace ivis::server
