#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "scenes/scene.h"
#include "visibility/amendment.h"
#include "visibility/method.h"
#include "wire/messages.h"
#include "wire/pvs_codec.h"

namespace ivis::server {

/// What clients are told of a scene, made once. Threads: a value.
struct ServedScene {
  SceneHash hash = 0;
  std::uint64_t order_hash = 0;
  std::vector<std::uint8_t>
      packed_table;           ///< wire/object_table.h; goes into every Welcome as it is
  std::vector<Rank> rank_of;  ///< by id
  SceneHash whole_hash = 0;  ///< Scene::whole_hash: not `hash` when meshes were split into clusters
  std::uint32_t objects() const { return static_cast<std::uint32_t>(rank_of.size()); }
};

ServedScene served_scene(const Scene& scene);

/// The solving and coding of one answer: all that it takes, so that any thread may do it.
/// Ownership: borrows scene and method.
struct Job {
  std::string peer;
  const ServedScene* scene = nullptr;
  ViewCell cell;
  const Method* method = nullptr;
  Effort effort;
  std::shared_ptr<const Amendment> amendment;  ///< null: the scene is as in the file
  std::chrono::milliseconds least_solve{0};
  bool everything = false;  ///< nothing is solved, every object is listed
  /// The PVS to code against; null: none.
  std::shared_ptr<const wire::PvsState> base;
  /// All of the answer but what perform() finds.
  wire::PvsMessage message;
};

/// What came of it.
struct JobDone {
  std::string peer;
  std::uint64_t session = 0;
  std::uint32_t sequence = 0;
  std::vector<std::byte> bytes;                 ///< of the message
  std::shared_ptr<const wire::PvsState> after;  ///< null: everything is listed
  bool full = false;                            ///< a set against none
  bool failed = false;
  bool cut_short = false;
};

/// Never throws: what cannot be solved is answered with every object, and what there is no memory
/// for not at all (no bytes). Threads: reentrant.
/// Cost: one solve and one encoding.
JobDone perform(Job job);

}  // namespace ivis::server
