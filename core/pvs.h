#pragma once

#include <string>
#include <vector>

#include "core/ids.h"
#include "core/view_cell.h"

namespace ivis {

/// The answer of a visibility method: the objects that can be seen from somewhere in a view cell.
struct Pvs {
  std::vector<ObjectId> objects;  ///< ascending, each once
  ViewCell cell;
  SceneHash scene_hash = 0;
  /// Non-empty when every object is listed because nothing better can be said: "eye inside an
  /// occluder", "eye outside the view space". The list is complete then too.
  std::string everything_because;
};

}  // namespace ivis
