#pragma once

#include <map>

#include "core/edit.h"
#include "scenes/scene.h"

namespace ivis {

/// Turned and moved as `placement` says; its bounds hold it, with room for rounding.
Object as_placed(const Object& object, const Placement& placement);

/// The scene as edits have left it: to check answers against. Removed objects keep their ids and
/// have no triangles; occluders that are off are tagged `never`. The hash stays: answers name it.
/// Cost: a copy of the scene.
Scene edited(const Scene& scene, const std::map<ObjectId, ObjectState>& states);

}  // namespace ivis
