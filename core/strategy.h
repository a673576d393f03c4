#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace ivis {

/// How a solve keeps to its time (Wonka, Wimmer, Sillion 2001, section 4.5). The set is complete
/// with each: what is not drawn hides nothing, and what is not tested is listed.
enum class Strategy : std::uint8_t {
  kGuaranteed,  ///< draws and tests all there is, which is bounded by the scene (docs/real-time.md)
  kAbort,       ///< draws near occluders first, and stops when its work is done
  kPredictive,  ///< chooses before drawing the occluders that promise most for their work
};

inline const char* to_string(Strategy s) {
  return s == Strategy::kGuaranteed ? "guaranteed" : s == Strategy::kAbort ? "abort" : "predictive";
}
inline std::optional<Strategy> parse_strategy(std::string_view text) {
  for (const Strategy s : {Strategy::kGuaranteed, Strategy::kAbort, Strategy::kPredictive})
    if (text == to_string(s)) return s;
  return std::nullopt;
}

}  // namespace ivis
