#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/assert.h"
#include "core/pace.h"
#include "core/reach.h"
#include "core/result.h"
#include "occluders/touched.h"
#include "visibility/method.h"

namespace ivis::server {

/// Where an observer may get to while a PVS is in use, seen from the centre of its cell.
class Outlook {
 public:
  /// Nothing is known: anywhere.
  Outlook() = default;
  /// Within `hold_us` past its pose, at `pace`: an upright cylinder about the centre, for a walker,
  /// or, where it told how it turns and that it is at `observer`, seen from the centre, what lies
  /// ahead of it (core/way_ahead.h). Speeds not told, or hold_us 0 (not known yet): anywhere.
  Outlook(const Pace& pace, std::uint32_t hold_us, const Vec3& observer = Vec3{0});
  /// Anywhere in a reach.
  explicit Outlook(const Reach& about) : about_(about) {}

 private:
  friend class Ladder;
  bool anywhere() const { return !about_ && ahead_.empty(); }
  std::optional<Reach> about_;
  std::vector<Vec3> ahead_;  ///< seen from the observer; not empty: instead of about_
  Vec3 observer_{0};
  double height_ = 0;  ///< most, up or down from the observer
};

/// Reaches that cells can be solved for, ascending, each with a method on occluders shrunk for it
/// once that is ready: the smaller the cell, the smaller the set. The largest is ready from the
/// start and serves whatever a smaller one would.
/// Threads:   reaches are fixed; a method may be added in one thread while others look.
/// Ownership: borrows the methods and indices.
class Ladder {
 public:
  struct Choice {
    std::uint32_t rung = 0;
    const Method* method = nullptr;
    const OccluderIndex* index = nullptr;  ///< of the method's occluders; null: none was given
    double safe = 1;  ///< the part of the declared speeds that the rung's cells hold
  };

  /// Ascending, each serving the one before, at most wire::kMaxRungs; `largest` is the method of
  /// the last. `slack_m`: of the occluders.
  Ladder(std::vector<Reach> reaches, const Method& largest, double slack_m,
         const OccluderIndex* index = nullptr);
  /// Of one rung.
  Ladder(const Reach& reach, const Method& method, double slack_m,
         const OccluderIndex* index = nullptr)
      : Ladder(std::vector<Reach>{reach}, method, slack_m, index) {}

  const std::vector<Reach>& reaches() const { return reaches_; }
  const Reach& largest() const { return reaches_.back(); }
  double slack_m() const { return slack_m_; }
  const Method& largest_method() const { return *methods_.back(); }
  const OccluderIndex* largest_index() const { return indices_.back(); }
  /// Not for the largest, and once a rung; with an index as the largest has one, or without.
  void add(std::uint32_t rung, const Method& method, const OccluderIndex* index = nullptr) {
    IVIS_ASSERT((index != nullptr) == (indices_.back() != nullptr), "all rungs take edits or none");
    indices_[rung] = index;  // before the method, which tells others that the rung is there
    methods_[rung] = &method;
  }
  std::uint32_t ready() const;

  /// The smallest ready rung whose cells hold what is wanted; if none does, the largest, with the
  /// part of the speeds that it holds, rounded down.
  Choice choose(const Outlook& wanted) const;
  /// Those speeds' part that cells of `reach` hold.
  double safe_part(const Reach& reach, const Outlook& wanted) const;

 private:
  bool holds(const Reach& reach, const Outlook& wanted, double part) const;

  std::vector<Reach> reaches_;
  double slack_m_;
  std::vector<std::atomic<const Method*>> methods_;
  std::vector<const OccluderIndex*> indices_;
};

/// `count` reaches up to `largest`, each kLadderStep of the next in its horizontal extents; the
/// vertical extent stays, as it costs next to nothing, but for balls, which stay balls.
inline constexpr double kLadderStep = 0.625;
std::vector<Reach> ladder_below(const Reach& largest, std::size_t count);

/// A ladder as in a configuration: "auto" (four by ladder_below), "none", or reaches separated by
/// blanks, ascending, to which `largest` is added if it is not the last.
/// Errors: kInvalidArgument naming the reach and what is wrong.
Result<std::vector<Reach>> parse_ladder(std::string_view text, const Reach& largest,
                                        double slack_m);

}  // namespace ivis::server
