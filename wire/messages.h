#pragma once
// The messages of wire/SPEC.md as values. Envelope: FlatBuffers (wire/ivis.fbs), verified before
// use.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/edit.h"
#include "core/ids.h"
#include "core/math.h"
#include "core/pace.h"
#include "core/reach.h"
#include "core/result.h"
#include "core/strategy.h"

namespace ivis::wire {

inline constexpr std::uint16_t kProtocolVersion = 4;

/// Client -> server, first.
struct Hello {
  std::uint16_t version = kProtocolVersion;
  /// The client's scene, 0: it has none and takes the server's.
  SceneHash scene_hash = 0;
  /// The reach that every cell shall have; empty text: the server chooses, by `pace`.
  std::string reach;
  /// Send the table that maps ranks to ids, nodes and instances.
  bool want_table = true;
  Pace pace;
  /// How solves keep to their time; none: the server's choice. A wish.
  std::optional<Strategy> strategy;
  std::uint32_t budget_us = 0;  ///< of one solve; 0: the server's choice
  bool operator==(const Hello&) const = default;
};

/// rank -> (id, node, instance, cluster), structure of arrays, zstd-compressed inside the message.
/// `id` is a permutation of 0..N-1.
struct ObjectTable {
  std::vector<ObjectId> id;
  std::vector<std::uint32_t> node;
  std::vector<std::uint32_t> instance;
  std::vector<std::uint32_t> cluster{};  ///< empty: all 0, as no mesh was split
  bool operator==(const ObjectTable&) const = default;
};

/// Server -> client, the answer to Hello.
struct Welcome {
  std::uint16_t version = kProtocolVersion;
  std::uint64_t session = 0;  ///< named in every later message; a restarted server does not know it
  SceneHash scene_hash = 0;
  /// Of the rank order, so that two ends with different orders say so.
  std::uint64_t order_hash = 0;
  std::uint32_t objects = 0;
  /// What the session's cells may be, ascending; at least one. An answer names its own.
  std::vector<std::string> reaches;
  std::string method;
  ObjectTable table;  ///< empty unless wanted
  bool operator==(const Welcome&) const = default;
};

/// Client -> server; the latest wins, none is answered twice.
struct PoseMessage {
  std::uint64_t session = 0;
  std::uint32_t sequence = 0;  ///< rises by one a pose
  /// Sequence of the last PVS decoded, 0: none; acknowledges it as a base.
  std::uint32_t have_pvs = 0;
  Vec3 eye{0};  ///< of the cell wanted
  /// How long a PVS is in use past its pose, as the client measures it; 0: unknown. With the speeds
  /// told it decides the cell.
  std::uint32_t hold_us = 0;
  std::uint32_t epoch = 0;  ///< of the scene as the client has it; 0: as in the file
  /// Where the observer is, when the eye is ahead of it on the line that it travels. Costs 26
  /// bytes.
  std::optional<Vec3> observer{};
  bool operator==(const PoseMessage&) const = default;
};

/// The scene that a PVS is of.
struct SceneChanges {
  std::uint32_t epoch = 0;
  std::uint32_t since = 0;           ///< what `objects` are told against; 0: the scene file
  std::uint32_t valid_us = 0;        ///< after the sending of the pose; 0: no end
  std::vector<ObjectState> objects;  ///< that changed, as they are now; each once
  bool operator==(const SceneChanges&) const = default;
};

/// Server -> client, pushed.
struct PvsMessage {
  std::uint64_t session = 0;
  std::uint32_t sequence = 0;  ///< of the pose it answers
  std::uint32_t base = 0;      ///< sequence of the PVS it is a difference to, 0: a full set
  /// Centre of the cell it is valid for. Absent: the eye of the pose `sequence`, which the client
  /// knows as it sent it, to the last bit. Costs 26 bytes when present.
  std::optional<Vec3> eye;
  /// All objects are listed, as nothing better can be said; payload empty.
  bool everything = false;
  std::uint32_t solve_us = 0;  ///< visibility time at the server, for latency accounts
  std::uint16_t rung = 0;      ///< the cell's reach: Welcome::reaches[rung]
  /// The part of the speeds told that the cell holds for the time asked for, of kAllSafe.
  std::uint16_t safe = kAllSafe;
  static constexpr std::uint16_t kAllSafe = 65535;
  std::vector<std::byte> payload;  ///< wire/pvs_codec.h
  SceneChanges changes;            ///< costs some 36 bytes when the scene was changed ever
  bool operator==(const PvsMessage&) const = default;
};

enum class Refusal : std::uint8_t {
  kVersion = 1,
  kScene = 2,
  kReach = 3,
  kSession = 4,
  kMalformed = 5,
  kBusy = 6,
  kClosing = 7
};

/// Server -> client; the session named (0: none) is over unless the refusal is kBusy.
struct Refused {
  std::uint64_t session = 0;
  Refusal reason = Refusal::kMalformed;
  std::string text;
  bool operator==(const Refused&) const = default;
};

/// Client -> server: the observer's speeds from now on.
struct PaceMessage {
  std::uint64_t session = 0;
  Pace pace;
  bool operator==(const PaceMessage&) const = default;
};

/// Client -> server: the session is over.
struct Bye {
  std::uint64_t session = 0;
  bool operator==(const Bye&) const = default;
};

/// Client -> server: all of it or nothing is done, in this order.
struct EditMessage {
  std::uint64_t session = 0;
  std::uint32_t request = 0;  ///< named in the answer
  std::vector<Edit> edits;    ///< 1 to kMaxEdits
  bool operator==(const EditMessage&) const = default;
};

/// Server -> client, the answer to an EditMessage.
struct EditedMessage {
  std::uint64_t session = 0;
  std::uint32_t request = 0;
  std::uint32_t epoch = 0;  ///< the scene as changed; 0: refused
  std::string text;         ///< why
  bool operator==(const EditedMessage&) const = default;
};

/// Server -> client: a pose will be answered for this epoch of the scene, or a later one.
struct NoticeMessage {
  std::uint64_t session = 0;
  std::uint32_t epoch = 0;
  bool operator==(const NoticeMessage&) const = default;
};

using Message = std::variant<Hello, Welcome, PoseMessage, PvsMessage, Refused, Bye, PaceMessage,
                             EditMessage, EditedMessage, NoticeMessage>;

inline constexpr std::size_t kMaxMessageBytes = 64U << 20U;
/// A row of the table is 12 bytes, 16 with clusters.
inline constexpr std::size_t kMaxObjects = kMaxMessageBytes / 12;
inline constexpr std::size_t kMaxClusters = kMaxMessageBytes / 16;  ///< objects in such a table
inline constexpr std::size_t kMaxNameBytes = 256;                   ///< reach, method
inline constexpr std::size_t kMaxRungs = 32;                        ///< Welcome::reaches
inline constexpr std::size_t kMaxTextBytes = 1024;                  ///< of refusals
inline constexpr std::size_t kMaxEdits = 1024;

/// One message as one frame. Strings are cut to their bounds. Requires: finite eyes; a table that
/// is empty or has `objects` rows and whose ids are a permutation, at most kMaxObjects of
/// them, kMaxClusters with clusters.
std::vector<std::byte> encode(const Message& message);

/// A Welcome whose table (empty in `welcome`) is packed already, by pack_table(): for a server that
/// tells many clients of one scene.
std::vector<std::byte> encode(const Welcome& welcome, std::span<const std::uint8_t> packed_table);

/// Errors: kInput naming what is wrong. Bounds: at most kMaxMessageBytes, every count is checked
/// against the bytes left (and the table's decompressed size against `objects`) before anything is
/// allocated. The payload of a PVS is not looked into; a version other than ours is not an error
/// here, so that the server can refuse it by name.
Result<Message> decode(std::span<const std::byte> bytes);

}  // namespace ivis::wire
