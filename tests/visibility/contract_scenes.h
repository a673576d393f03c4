#pragma once

#include <string>
#include <vector>

#include "scenes/scene.h"

namespace ivis::test {

/// A scene and places in it that stand for observers.
struct ContractScene {
  std::string name;
  Scene scene;
  std::vector<Vec3> eyes;
  Vec3 in_solid{0};      ///< deep inside an occluder; not finite when there is none to speak of
  ObjectId mover = ~0U;  ///< an object marked always visible, behind what hides it
};

/// The analytic scenes that every conservative method must answer rightly.
std::vector<ContractScene> analytic_scenes();

/// A generated city of 250 m.
ContractScene small_city();

/// Slanted blocks of 3 to 25 m all over 300 m, some floating if so wanted, with 1,500 small boxes
/// between them.
Scene random_town(unsigned seed, bool floating);

/// The scene after a rotation or other motion of everything in it.
Scene moved(const Scene& scene, const Mat4& motion);

}  // namespace ivis::test
