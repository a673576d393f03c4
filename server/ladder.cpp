#include "server/ladder.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/assert.h"
#include "core/view_cell.h"
#include "core/way_ahead.h"
#include "wire/messages.h"

namespace ivis::server {
namespace {

/// `factor` times the vectors of a cylinder, box or ellipsoid of the given horizontal extents.
Reach scaled(const Reach& reach, double factor) {
  const Vec3 e = reach.half_extents();
  const Vec3 s{e.x * factor, e.y, e.z * factor};
  switch (reach.kind()) {
    case Reach::Kind::kBall:
      return Reach::ball(s.x);
    case Reach::Kind::kDisc:
      return Reach::disc(s.x);
    case Reach::Kind::kCylinder:
      return Reach::cylinder(s.x, s.y);
    case Reach::Kind::kEllipsoid:
      return Reach::ellipsoid(s);
    case Reach::Kind::kBox:
      break;
  }
  return Reach::box(s);
}

}  // namespace

Ladder::Ladder(std::vector<Reach> reaches, const Method& largest, double slack_m,
               const OccluderIndex* index)
    : reaches_(std::move(reaches)),
      slack_m_(slack_m),
      methods_(reaches_.size()),
      indices_(reaches_.size(), nullptr) {
  IVIS_ASSERT(!reaches_.empty() && reaches_.size() <= wire::kMaxRungs, "rungs of a ladder");
  methods_.back() = &largest;
  indices_.back() = index;
}

std::uint32_t Ladder::ready() const {
  return static_cast<std::uint32_t>(
      std::count_if(methods_.begin(), methods_.end(), [](const auto& m) { return m != nullptr; }));
}

Outlook::Outlook(const Pace& pace, std::uint32_t hold_us, const Vec3& observer) {
  if (!pace.told() || hold_us == 0) return;
  const double hold_s = hold_us * 1e-6;
  if (const auto way = way_ahead(pace, -observer, hold_s)) {
    ahead_ = way->hull();
    observer_ = observer;
    height_ = way->height;
  } else {
    about_ = Reach::cylinder(pace.horizontal_m_s * hold_s, pace.vertical_m_s * hold_s);
  }
}

// A convex reach holds the hull of points that it holds. An upright one holds what it holds from
// above and from the side, so that heights may be cut to the vertical speed.
bool Ladder::holds(const Reach& reach, const Outlook& wanted, double part) const {
  if (wanted.ahead_.empty()) {
    const Vec3 e = wanted.about_->half_extents() * part;
    return serves(reach, slack_m_, part == 1 ? *wanted.about_ : Reach::cylinder(e.x, e.y));
  }
  const bool upright =
      reach.kind() != Reach::Kind::kBall && reach.kind() != Reach::Kind::kEllipsoid;
  const ViewCell cell{Vec3{0}, reach};
  return std::ranges::all_of(wanted.ahead_, [&](Vec3 p) {
    if (upright) p.y = std::clamp(p.y, -wanted.height_, wanted.height_);
    return cell.contains(wanted.observer_ + p * part);
  });
}

Ladder::Choice Ladder::choose(const Outlook& wanted) const {
  const auto last = static_cast<std::uint32_t>(reaches_.size() - 1);
  if (!wanted.anywhere()) {
    for (std::uint32_t i = 0; i < reaches_.size(); ++i)
      if (const Method* m = methods_[i]; m != nullptr && holds(reaches_[i], wanted, 1))
        return {i, m, indices_[i], 1};
  }
  return {last, methods_[last], indices_[last], safe_part(reaches_[last], wanted)};
}

double Ladder::safe_part(const Reach& reach, const Outlook& wanted) const {
  if (wanted.anywhere() || holds(reach, wanted, 1)) return 1;
  double safe = 0;
  double not_safe = 1;
  for (int i = 0; i < 24; ++i) {
    const double middle = (safe + not_safe) / 2;
    (holds(reach, wanted, middle) ? safe : not_safe) = middle;
  }
  return safe;
}

std::vector<Reach> ladder_below(const Reach& largest, std::size_t count) {
  std::vector<Reach> reaches;
  double factor = 1;
  for (std::size_t i = 0; i < count; ++i) {
    reaches.push_back(scaled(largest, factor));
    factor *= kLadderStep;
  }
  std::reverse(reaches.begin(), reaches.end());
  reaches.erase(std::unique(reaches.begin(), reaches.end()), reaches.end());  // of size 0
  return reaches;
}

Result<std::vector<Reach>> parse_ladder(std::string_view text, const Reach& largest,
                                        double slack_m) {
  constexpr std::size_t kAuto = 4;
  if (text == "none") return std::vector<Reach>{largest};
  if (text == "auto") return ladder_below(largest, kAuto);
  std::vector<Reach> reaches;
  while (true) {
    const auto from = text.find_first_not_of(' ');
    if (from == std::string_view::npos) break;
    text.remove_prefix(from);
    const auto end = std::min(text.find(' '), text.size());
    auto reach = Reach::parse(text.substr(0, end));
    if (!reach) return Error{ErrorCode::kInvalidArgument, "ladder: " + reach.error().message};
    if (!reaches.empty() && !serves(*reach, slack_m, reaches.back()))
      return invalid_argument("ladder: " + reach->to_string() + " does not hold " +
                              reaches.back().to_string() + " before it, expected them ascending");
    reaches.push_back(*reach);
    text.remove_prefix(end);
  }
  if (reaches.empty())
    return invalid_argument("ladder: no reaches, expected 'auto', 'none' or reaches, ascending");
  if (!serves(largest, slack_m, reaches.back()))
    return invalid_argument("ladder: " + reaches.back().to_string() + " is larger than the reach " +
                            largest.to_string());
  if (!(reaches.back() == largest)) reaches.push_back(largest);
  if (reaches.size() > wire::kMaxRungs)
    return invalid_argument("ladder: " + std::to_string(reaches.size()) + " rungs, at most " +
                            std::to_string(wire::kMaxRungs));
  return reaches;
}

}  // namespace ivis::server
