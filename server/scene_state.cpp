#include "server/scene_state.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "occluders/rect_tree.h"
#include "scenes/edited.h"
#include "wire/messages.h"

namespace ivis::server {
namespace {

std::string describe(const Object& object, ObjectId id) {
  return "object " + std::to_string(id) + " (node " + std::to_string(object.node) + ")";
}

bool same_place(const Object& object, const Placement& p) {
  return p.position == Vec3(object.to_world[3]) && p.rotation == glm::fquat(1, 0, 0, 0);
}

Aabb grown(const Aabb& box, double by) {
  return {box.lo - by, box.hi + by};
}

/// More than this many are not counted down again.
constexpr std::uint8_t kMostBlamed = 255;

/// It is matter that stands where an edit put it.
bool hides_where_it_is(const ObjectState& s) {
  return s.moved && !s.removed && !s.occluder_off && s.speed_m_s == 0;
}

}  // namespace

SceneState::SceneState(const Scene& scene) : scene_(scene), mender_(scene) {
  for (ObjectId id = 0; id < occluder_count(); ++id)
    natures_.push_back(static_cast<std::uint8_t>((is_matter(scene, object(id)) ? kMatter : 0) |
                                                 (holds_ground(scene, object(id)) ? kGround : 0)));
}

std::uint32_t SceneState::occluder_count() const {
  return static_cast<std::uint32_t>(scene_.objects.size() + scene_.hidden_solids.size());
}

const Object& SceneState::object(ObjectId id) const {
  return id < scene_.objects.size() ? scene_.objects[id]
                                    : scene_.hidden_solids[id - scene_.objects.size()];
}

std::string SceneState::why_not(const Edit& edit) const {
  const bool of_occluder =
      edit.kind == EditKind::kOccluderOff || edit.kind == EditKind::kOccluderOn;
  const std::uint32_t known =
      of_occluder ? occluder_count() : static_cast<std::uint32_t>(scene_.objects.size());
  if (edit.id >= known)
    return (of_occluder ? "no occluder " : "no object ") + std::to_string(edit.id) +
           ", expected an id below " + std::to_string(known);
  if (!scene_.wholes.empty())
    return "the scene is split into clusters (granularity cluster), which are not moved singly";
  if ((natures_[edit.id] & kGround) != 0)
    return describe(object(edit.id), edit.id) +
           " is ground that buildings stand on, which cannot be changed";
  if (entry_.size() + wire::kMaxEdits > kMostChanged && !entry_.contains(edit.id))
    return "more than " + std::to_string(kMostChanged) + " objects changed";
  return {};
}

SceneState::Outcome SceneState::apply(std::span<const Edit> edits, Time now) {
  if (torn_) return {0, kTorn};
  for (const Edit& e : edits)
    if (std::string why = why_not(e); !why.empty()) return {0, std::move(why)};
  ++epoch_;
  torn_ = true;  // unless all of it is done
  for (const Edit& e : edits)
    apply_one(e, now);
  // What an object comes to in the end: a door that is switched to and fro costs as much as once.
  for (auto e = changed_.rbegin(); e != changed_.rend() && e->epoch == epoch_; ++e)
    update_displaced(e->state.id);
  torn_ = false;
  return {epoch_, {}};
}

void SceneState::apply_one(const Edit& edit, Time now) {
  const Object& o = object(edit.id);
  auto found = entry_.find(edit.id);
  if (found == entry_.end()) {
    std::list<Entry> one(1);
    found = entry_.emplace(edit.id, one.begin()).first;
    changed_.splice(changed_.end(), one);
    Entry& fresh = changed_.back();
    fresh.state.id = edit.id;
    fresh.state.placement.position = Vec3(o.to_world[3]);
    fresh.bounds = o.bounds;
  } else {
    changed_.splice(changed_.end(), changed_, found->second);
  }
  Entry& entry = *found->second;
  ObjectState& s = entry.state;
  const bool was_gone = s.removed || s.moved;
  const bool moved_itself = s.speed_m_s > 0 && !s.removed;
  entry.epoch = epoch_;
  switch (edit.kind) {
    case EditKind::kMove:
      s.placement = edit.placement;
      s.speed_m_s = edit.speed_m_s;
      s.moved = !same_place(o, edit.placement) || edit.speed_m_s > 0;
      entry.since = now;
      entry.bounds = as_placed(o, edit.placement).bounds;
      break;
    case EditKind::kRemove:
      s.removed = true;
      break;
    case EditKind::kAdd:
      s.removed = false;
      break;
    case EditKind::kOccluderOff:
      s.occluder_off = true;
      break;
    case EditKind::kOccluderOn:
      s.occluder_off = false;
      break;
  }
  movers_ += s.speed_m_s > 0 && !s.removed ? 1 : 0;
  movers_ -= moved_itself ? 1 : 0;
  if (was_gone != (s.removed || s.moved)) gone_.reset();
}

/// What moves by itself hides nothing.
void SceneState::update_displaced(ObjectId id) {
  if ((natures_[id] & kMatter) == 0) return;
  const ObjectState& s = entry_.at(id)->state;
  const bool displaced = s.removed || s.moved || s.occluder_off;
  if (!displaced && !displaced_.contains(id)) return;
  ++matter_version_;  // also where it only moved on: what was shrunk of it is of the past
  mending_due_ = true;
  if (displaced == displaced_.contains(id)) return;
  if (displaced)
    displaced_.emplace(id, object(id).bounds);
  else
    displaced_.erase(id);
  for (auto& [index, rung] : rungs_) {
    if (displaced)
      displace(*index, rung, id);
    else
      replace(rung, id);
  }
}

void SceneState::displace(const OccluderIndex& index, Rung& rung, ObjectId id) const {
  rung.blamed.resize(index.occluders().shrunk.size(), 0);
  auto [found, fresh] = rung.touched.try_emplace(id);
  if (fresh) found->second = index.touched(object(id).bounds);
  for (const std::uint32_t prism : found->second)
    if (rung.blamed[prism] != kMostBlamed) ++rung.blamed[prism];
}

void SceneState::replace(Rung& rung, ObjectId id) {
  for (const std::uint32_t prism : rung.touched.at(id))
    if (rung.blamed[prism] != kMostBlamed) --rung.blamed[prism];
}

SceneState::Rung& SceneState::rung_of(const OccluderIndex& index) {
  if (const auto found = rungs_.find(&index); found != rungs_.end()) return found->second;
  Rung rung;
  for (const auto& [id, box] : displaced_)
    displace(index, rung, id);
  mending_due_ = mending_due_ || !displaced_.empty();
  // Last: it is known only with all that is displaced, though memory runs out.
  return rungs_.emplace(&index, std::move(rung)).first->second;
}

void SceneState::order_mending() {
  Mender::Order order;
  for (const auto& [id, box] : displaced_) {
    order.displaced.emplace_back(id, &object(id));
    if (hides_where_it_is(entry_.at(id)->state))
      order.moved.push_back({id, &object(id), entry_.at(id)->state.placement});
  }
  for (const auto& [index, rung] : rungs_)
    order.rungs.push_back(index);
  mender_.order(std::move(order));
}

SceneState::Told SceneState::since(std::uint32_t epoch) const {
  Told told;
  told.since = epoch > epoch_ ? 0 : epoch;
  auto from = changed_.end();
  while (from != changed_.begin() && std::prev(from)->epoch > told.since)
    --from;
  told.epoch = told.since;
  for (; from != changed_.end(); ++from) {
    if (told.objects.size() >= kMostTold && from->epoch != told.epoch) return told;
    told.epoch = from->epoch;
    if (from->state.id < scene_.objects.size()) told.objects.push_back(from->state);
  }
  told.epoch = epoch_;
  return told;
}

std::shared_ptr<const Amendment> SceneState::amendment(const OccluderIndex& index, Time now,
                                                       Time until) {
  if (epoch_ == 0) return nullptr;
  Rung& rung = rung_of(index);
  if (mending_due_) order_mending();
  mending_due_ = false;
  if (auto mended = mender_.take()) {
    mended_ = std::move(*mended);
    ++mendings_;
  }
  // Where nothing moves by itself an answer's time is no matter.
  if (rung.answer && rung.answer_epoch == epoch_ && rung.answer_mendings == mendings_ &&
      movers_ == 0)
    return rung.answer;
  if (!gone_) {
    auto bits = std::make_shared<std::vector<std::uint64_t>>((scene_.objects.size() + 63) / 64);
    for (const Entry& e : changed_) {
      const ObjectId id = e.state.id;
      if (id >= scene_.objects.size()) continue;
      // A mover of the scene file's own (skinned, animated) is listed wherever it is put.
      const bool gone = e.state.removed || (e.state.moved && !scene_.objects[id].always_visible);
      if (gone) (*bits)[id / 64] |= std::uint64_t{1} << (id % 64);
    }
    gone_ = std::move(bits);
  }
  if (!displaced_.empty() &&
      (!rung.current || rung.version != matter_version_ || rung.mendings != mendings_)) {
    rung.current = change_of(index, rung);
    rung.version = matter_version_;
    rung.mendings = mendings_;
  }
  auto out = std::make_shared<Amendment>();
  out->gone = gone_;
  if (!displaced_.empty()) out->occluders = rung.current;
  const auto seconds = [](Time::duration d) { return std::chrono::duration<double>(d).count(); };
  for (const Entry& e : changed_) {
    const ObjectState& s = e.state;
    if (s.removed || !s.moved || scene_.objects[s.id].always_visible) continue;
    // Wherever it is drawn while the PVS is in use, as the edit that told of it promised.
    const double away =
        s.speed_m_s > 0 ? s.speed_m_s * (seconds(std::max(until, now) - e.since) + kMoverLagS) : 0;
    Aabb box = grown(e.bounds, away);
    // All of the file lies above the floor, so does what was neither lowered nor tilted, to the
    // last bit (as_placed); and nothing that moves sinks below it.
    const Object& o = scene_.objects[s.id];
    const bool above = s.placement.position.y >= o.to_world[3].y && s.placement.rotation.x == 0 &&
                       s.placement.rotation.z == 0;
    const double floor = index.occluders().floor;
    if (above || e.bounds.lo.y >= floor) box.lo.y = std::max(box.lo.y, floor);
    out->placed.push_back({s.id, box});
  }
  rung.answer = out;
  rung.answer_epoch = epoch_;
  rung.answer_mendings = mendings_;
  return out;
}

std::shared_ptr<const OccluderChange> SceneState::change_of(const OccluderIndex& index,
                                                            Rung& rung) const {
  auto change = std::make_shared<OccluderChange>();
  change->shrunk_off = rung.blamed;
  std::vector<Aabb> boxes;
  for (const auto& [id, box] : displaced_)
    boxes.push_back(box);
  change->displaced = DisplacedMatter(std::move(boxes));
  const auto mended = mended_.rungs.find(&index);
  if (mended == mended_.rungs.end()) return change;
  // Some edits may have come since: what rests on matter that is missing by now is left out, and so
  // is an object that has gone on. What came back only adds.
  std::vector<Aabb> missing;
  for (const auto& [id, box] : displaced_)
    if (!std::ranges::binary_search(mended_.order.displaced, id, {},
                                    [](const auto& d) { return d.first; }))
      missing.push_back(box);
  std::vector<Box2> places;
  places.reserve(missing.size());
  for (const Aabb& b : missing)
    places.push_back(ground_box(b));
  const RectTree tree(places);
  for (const Prism& p : mended->second.blocks) {
    const Aabb rests_on = index.box_of(p);
    if (tree.all(ground_box(rests_on),
                 [&](std::uint32_t i) { return !missing[i].overlaps(rests_on); }))
      change->added.push_back(p);
  }
  for (std::size_t k = 0; k < mended_.order.moved.size(); ++k) {
    const Mender::Moved& moved = mended_.order.moved[k];
    const auto now = entry_.find(moved.id);
    if (now == entry_.end() || !hides_where_it_is(now->second->state) ||
        !(now->second->state.placement == moved.placement))
      continue;
    const ShrunkObject& shrunk = mended->second.objects[k];
    change->added.insert(change->added.end(), shrunk.prisms.begin(), shrunk.prisms.end());
    change->added_solids.insert(change->added_solids.end(), shrunk.solids.begin(),
                                shrunk.solids.end());
  }
  return change;
}

}  // namespace ivis::server
