#pragma once

#include <memory>

#include "client_lib/source.h"
#include "visibility/method.h"

namespace ivis::client {

/// A method and what it borrows, kept alive together.
struct LocalWorld {
  Catalogue catalogue;
  Reach reach;
  std::shared_ptr<const Method> method;  ///< may alias whatever owns scene and occluders
};

Catalogue catalogue_of(const Scene& scene, const Reach& reach, const Method& method);

/// Answers from a worker thread with one slot for the latest pose and one for the latest answer.
/// A pose that the method cannot solve, or that it throws at (out of memory), is answered with
/// every object, and trouble() says why until a later one succeeds. Threads: as PvsSource; the
/// worker is its own. Neither side waits for a solve to put or take a slot.
std::unique_ptr<PvsSource> make_local_source(LocalWorld world);

}  // namespace ivis::client
