#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "core/result.h"
#include "occluders/occluder_set.h"

namespace ivis {

/// The .ivo file, documented in occluders/FORMAT.md: versioned, little-endian, checksummed.
/// Writing is atomic: the file appears whole or not at all. Errors: kIo.
Status write_occluders(const std::filesystem::path& file, const OccluderSet& set);

/// Errors: kIo; kInput for damaged bytes, naming file, field, found and expected; kMismatch for a
/// version that is not known. Untrusted bytes: counts are bounded by the bytes left before
/// allocating, numbers are checked finite, the checksum comes first.
Result<OccluderSet> read_occluders(const std::filesystem::path& file);

std::string encode_occluders(const OccluderSet& set);
Result<OccluderSet> decode_occluders(std::span<const std::byte> bytes, const std::string& name);

/// Errors: kMismatch when `set` belongs to another scene or was shrunk for a smaller reach than
/// `reach`.
Status check_occluders(const OccluderSet& set, SceneHash scene_hash, const Reach& reach,
                       const std::string& name);

}  // namespace ivis
