#pragma once

#include <filesystem>

#include "core/result.h"
#include "occluders/shrink.h"

namespace ivis::tool {

/// Writes what became of a scene's parts into a folder, made if need be: report.txt, a table to
/// read; report.json, every object; report.svg, the scene from above, coloured by what was taken,
/// what vanishes and what was left out. Needs ShrinkOptions::fates.
/// Errors: kIo. Each file appears whole or not at all.
Status write_shrink_report(const std::filesystem::path& folder, const Scene& scene,
                           const Shrunk& shrunk);

}  // namespace ivis::tool
