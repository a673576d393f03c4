#pragma once

namespace ivis {

/// How fast an observer moves at most, and how often it draws. Speeds 0: not told.
struct Pace {
  double horizontal_m_s = 0;  ///< in the ground plane, in any direction
  double vertical_m_s = 0;
  double frame_s = 0;  ///< between frames
  /// By which its direction of travel turns, with cells centred ahead; 0: it may turn at once.
  double turning_rad_s = 0;
  bool told() const { return horizontal_m_s > 0 || vertical_m_s > 0; }
  /// Bounded, so that no product with a time overflows.
  bool valid() const {
    const auto in = [](double v, double most) { return v >= 0 && v <= most; };
    return in(horizontal_m_s, 1e6) && in(vertical_m_s, 1e6) && in(frame_s, 3600) &&
           in(turning_rad_s, 1e6);
  }
  bool operator==(const Pace&) const = default;
};

}  // namespace ivis
