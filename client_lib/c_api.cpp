// The C interface: arguments are checked here, exceptions end here.

#include <algorithm>
#include <exception>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client_lib/client.h"
#include "client_lib/network_source.h"

using ivis::client::Catalogue;
using ivis::client::copy_text;

namespace {

ivis::Vec3 vec(const double p[3]) {
  return {p[0], p[1], p[2]};
}

constexpr const char* kBadPace =
    "a pace out of bounds, expected speeds of 0 to 1e6 m/s and frames of 0 to 3600 s, "
    "turning of 0 to 1e6 rad/s";

constexpr std::uint32_t kMostLingerFrames = 3600;
constexpr std::size_t kMostEdits = 1024;  // a message takes no more

ivis::Pace pace_of(const ivis_pace& p) {
  return {p.horizontal_m_s, p.vertical_m_s, p.frame_s, p.turning_rad_s};
}

/// Out of memory is all that may be thrown inside; the caller is C.
template <class F>
ivis_status guarded(ivis_client* client, F&& body) {
  try {
    return body();
  } catch (const std::exception& e) {
    try {
      return client->fail(IVIS_ERROR_IO, e.what());
    } catch (...) {
      return IVIS_ERROR_IO;
    }
  }
}

}  // namespace

extern "C" {

ivis_client_options ivis_client_options_default(void) {
  ivis_client_options o{};
  o.size = sizeof o;
  o.endpoint = "tcp://127.0.0.1:7447";
  o.policy = IVIS_POLICY_EVERYTHING;
  o.connect_timeout_ms = 5000;
  o.silence_timeout_ms = 2000;
  return o;
}

ivis_status ivis_client_connect(const ivis_client_options* options, ivis_client** client,
                                char* error, size_t error_size) {
  if (client == nullptr) return IVIS_ERROR_ARGUMENT;
  *client = nullptr;
  const auto refuse = [&](ivis_status status, const std::string& text) {
    copy_text(text, error, error_size);
    return status;
  };
  try {
    if (options == nullptr || options->size != sizeof(ivis_client_options))
      return refuse(IVIS_ERROR_ARGUMENT, "options were not made by ivis_client_options_default()");
    if (options->endpoint == nullptr) return refuse(IVIS_ERROR_ARGUMENT, "no endpoint");
    if (options->policy < IVIS_POLICY_EVERYTHING || options->policy > IVIS_POLICY_INCOMPLETE)
      return refuse(IVIS_ERROR_ARGUMENT,
                    "unknown policy " + std::to_string(static_cast<int>(options->policy)));
    if (options->linger_frames > kMostLingerFrames)
      return refuse(IVIS_ERROR_ARGUMENT, std::to_string(options->linger_frames) +
                                             " frames to linger, at most " +
                                             std::to_string(kMostLingerFrames));
    if (options->connect_timeout_ms < 0 || options->silence_timeout_ms <= 0)
      return refuse(IVIS_ERROR_ARGUMENT, "a timeout is negative or zero");
    ivis::client::NetworkOptions network;
    network.endpoint = options->endpoint;
    network.scene_hash = options->scene_hash;
    network.reach = options->reach != nullptr ? options->reach : "";
    network.follow_scene = options->follow_scene != 0;
    if (network.follow_scene && network.scene_hash != 0)
      return refuse(IVIS_ERROR_ARGUMENT, "follow_scene with a scene_hash");
    network.pace = pace_of(options->pace);
    if (!network.pace.valid()) return refuse(IVIS_ERROR_ARGUMENT, kBadPace);
    if (options->strategy < IVIS_STRATEGY_SERVER || options->strategy > IVIS_STRATEGY_PREDICTIVE)
      return refuse(IVIS_ERROR_ARGUMENT,
                    "unknown strategy " + std::to_string(static_cast<int>(options->strategy)));
    if (options->strategy != IVIS_STRATEGY_SERVER)
      network.strategy = static_cast<ivis::Strategy>(options->strategy - IVIS_STRATEGY_GUARANTEED);
    network.budget_us = options->budget_us;
    network.silence = std::chrono::milliseconds(options->silence_timeout_ms);
    auto source = ivis::client::NetworkSource::open(network);
    if (!source) return refuse(ivis::client::status_of(source.error()), source.error().message);
    ivis_client::Options own;
    own.policy = options->policy;
    own.pace = network.pace;
    own.predict = options->predict != 0;
    own.linger_frames = options->linger_frames;
    auto made = std::make_unique<ivis_client>(std::move(*source), std::move(own));
    if (options->connect_timeout_ms > 0)
      if (const ivis_status met =
              made->meet(std::chrono::milliseconds(options->connect_timeout_ms));
          met != IVIS_OK)
        return refuse(met, network.endpoint + ": " + made->error());
    *client = made.release();
    return IVIS_OK;
  } catch (const std::exception& e) {
    return refuse(IVIS_ERROR_IO, e.what());
  }
}

ivis_client* ivis_client_adopt_source_(void* pvs_source, ivis_policy policy) {
  std::unique_ptr<ivis::client::PvsSource> source(
      static_cast<ivis::client::PvsSource*>(pvs_source));
  ivis_client::Options own;
  own.policy = policy;
  try {
    return new ivis_client(std::move(source), std::move(own));
  } catch (const std::exception&) {
    return nullptr;
  }
}

void ivis_client_close(ivis_client* client) {
  delete client;
}

ivis_status ivis_client_set_policy(ivis_client* client, ivis_policy policy) {
  if (client == nullptr) return IVIS_ERROR_ARGUMENT;
  return guarded(client, [&] {
    if (policy < IVIS_POLICY_EVERYTHING || policy > IVIS_POLICY_INCOMPLETE)
      return client->fail(IVIS_ERROR_ARGUMENT,
                          "unknown policy " + std::to_string(static_cast<int>(policy)));
    client->set_policy(policy);
    return IVIS_OK;
  });
}

ivis_status ivis_client_set_pace(ivis_client* client, const ivis_pace* pace) {
  if (client == nullptr || pace == nullptr) return IVIS_ERROR_ARGUMENT;
  return guarded(client, [&] {
    const ivis::Pace wanted = pace_of(*pace);
    if (!wanted.valid()) return client->fail(IVIS_ERROR_ARGUMENT, kBadPace);
    client->set_pace(wanted);
    return IVIS_OK;
  });
}

ivis_status ivis_client_pose(ivis_client* client, const double eye[3]) {
  if (client == nullptr || eye == nullptr) return IVIS_ERROR_ARGUMENT;
  return guarded(client, [&] { return client->pose(vec(eye)); });
}

ivis_status ivis_client_view(ivis_client* client, const double eye[3], ivis_frame* out) {
  if (out == nullptr) return IVIS_ERROR_ARGUMENT;
  *out = ivis_frame{};
  out->everything = 1;
  out->cell_reach = "";
  if (client == nullptr || eye == nullptr) return IVIS_ERROR_ARGUMENT;
  const ivis_status status = guarded(client, [&] { return client->view(vec(eye), *out); });
  if (out->object_count != 0 && out->visible_bits == nullptr) {  // out of memory half way
    *out = ivis_frame{};
    out->everything = 1;
    out->cell_reach = "";
  }
  return status;
}

ivis_status ivis_client_frame(ivis_client* client, const double eye[3], ivis_frame* out) {
  const ivis_status sent = ivis_client_pose(client, eye);
  const ivis_status seen = ivis_client_view(client, eye, out);
  return sent != IVIS_OK ? sent : seen;
}

ivis_status ivis_client_wait(ivis_client* client, int32_t timeout_ms) {
  if (client == nullptr || timeout_ms < 0) return IVIS_ERROR_ARGUMENT;
  return guarded(client, [&] { return client->wait(std::chrono::milliseconds(timeout_ms)); });
}

ivis_status ivis_client_edit(ivis_client* client, const ivis_edit* edits, size_t count,
                             uint32_t* request) {
  if (client == nullptr || edits == nullptr) return IVIS_ERROR_ARGUMENT;
  return guarded(client, [&] {
    if (count == 0 || count > kMostEdits)
      return client->fail(IVIS_ERROR_ARGUMENT, std::to_string(count) + " edits, expected 1 to " +
                                                   std::to_string(kMostEdits));
    std::vector<ivis::Edit> wanted;
    for (const ivis_edit& e : std::span(edits, count)) {
      ivis::Edit edit{static_cast<ivis::EditKind>(e.kind), e.id, {}, 0};
      if (e.kind < IVIS_EDIT_MOVE || e.kind > IVIS_EDIT_OCCLUDER_ON)
        return client->fail(IVIS_ERROR_ARGUMENT, "unknown kind of edit " + std::to_string(e.kind));
      if (e.kind == IVIS_EDIT_MOVE) {
        edit.placement = {vec(e.position),
                          {e.rotation[3], e.rotation[0], e.rotation[1], e.rotation[2]}};
        edit.speed_m_s = e.speed_m_s;
        if (!edit.placement.valid() || !(e.speed_m_s >= 0 && e.speed_m_s <= ivis::kFastestMoverMs))
          return client->fail(IVIS_ERROR_ARGUMENT,
                              "object " + std::to_string(e.id) +
                                  ": a position beyond 1e9 m, a rotation that is no unit "
                                  "quaternion, or a speed not from 0 to 1000 m/s");
      }
      wanted.push_back(edit);
    }
    std::uint32_t number = 0;
    const ivis_status asked = client->edit(wanted, number);
    if (request != nullptr) *request = number;
    return asked;
  });
}

int ivis_client_edit_result(ivis_client* client, ivis_edit_result* out) {
  if (client == nullptr || out == nullptr) return 0;
  *out = ivis_edit_result{0, 0, ""};
  int found = 0;
  guarded(client, [&] {
    if (auto result = client->edited()) {
      found = 1;
      out->request = result->request;
      out->epoch = result->epoch;
      out->refused = client->keep(std::move(result->why));
    }
    return IVIS_OK;
  });
  return found;
}

ivis_status ivis_client_changes(ivis_client* client, const ivis_object_state** states,
                                size_t* count) {
  if (client == nullptr || states == nullptr || count == nullptr) return IVIS_ERROR_ARGUMENT;
  *states = nullptr;
  *count = 0;
  return guarded(client, [&] {
    *states = client->changes().data();
    *count = client->changes().size();
    return IVIS_OK;
  });
}

void ivis_client_stats(const ivis_client* client, ivis_stats* out) {
  if (out == nullptr) return;
  *out = client != nullptr ? client->stats() : ivis_stats{};
}

ivis_status ivis_client_info(const ivis_client* client, ivis_info* out) {
  if (client == nullptr || out == nullptr) return IVIS_ERROR_ARGUMENT;
  *out = ivis_info{0, 0, "", ""};
  const Catalogue* c = client->source().catalogue();
  if (c == nullptr) return IVIS_ERROR_CONNECTION;
  *out = {c->scene_hash, c->objects(), c->largest_reach.c_str(), c->method.c_str()};
  return IVIS_OK;
}

ivis_status ivis_object_node(const ivis_client* client, uint32_t id, uint32_t* node,
                             uint32_t* instance) {
  if (client == nullptr) return IVIS_ERROR_ARGUMENT;
  const Catalogue* c = client->source().catalogue();
  if (c == nullptr) return IVIS_ERROR_CONNECTION;
  if (id >= c->objects()) return IVIS_ERROR_ARGUMENT;
  if (node != nullptr) *node = c->node[id];
  if (instance != nullptr) *instance = c->instance[id];
  return IVIS_OK;
}

ivis_status ivis_object_cluster(const ivis_client* client, uint32_t id, uint32_t* cluster) {
  if (client == nullptr || cluster == nullptr) return IVIS_ERROR_ARGUMENT;
  const Catalogue* c = client->source().catalogue();
  if (c == nullptr) return IVIS_ERROR_CONNECTION;
  if (id >= c->objects()) return IVIS_ERROR_ARGUMENT;
  *cluster = c->cluster_of(id);
  return IVIS_OK;
}

ivis_status ivis_object_id(const ivis_client* client, uint32_t node, uint32_t instance,
                           uint32_t* id) {
  return id != nullptr ? ivis_object_ids(client, node, instance, id, nullptr) : IVIS_ERROR_ARGUMENT;
}

ivis_status ivis_object_ids(const ivis_client* client, uint32_t node, uint32_t instance,
                            uint32_t* first_id, uint32_t* count) {
  if (client == nullptr) return IVIS_ERROR_ARGUMENT;
  const Catalogue* c = client->source().catalogue();
  if (c == nullptr) return IVIS_ERROR_CONNECTION;
  const auto [first, last] = std::equal_range(c->node.begin(), c->node.end(), node);
  const auto from = c->instance.begin() + (first - c->node.begin());
  const auto to = c->instance.begin() + (last - c->node.begin());
  const auto [low, high] = std::equal_range(from, to, instance);
  if (low == high) return IVIS_ERROR_ARGUMENT;
  if (first_id != nullptr) *first_id = static_cast<std::uint32_t>(low - c->instance.begin());
  if (count != nullptr) *count = static_cast<std::uint32_t>(high - low);
  return IVIS_OK;
}

const char* ivis_client_error(const ivis_client* client) {
  return client != nullptr ? client->error().c_str() : "no client";
}

const char* ivis_cause_name(ivis_cause cause) {
  switch (cause) {
    case IVIS_CAUSE_NONE:
      return "none";
    case IVIS_CAUSE_NO_ANSWER:
      return "no answer yet";
    case IVIS_CAUSE_DISCONNECTED:
      return "disconnected";
    case IVIS_CAUSE_SPEED:
      return "faster than told";
    case IVIS_CAUSE_LADDER:
      return "no cell so large";
    case IVIS_CAUSE_LATE:
      return "late";
    case IVIS_CAUSE_OTHER:
      return "other";
    case IVIS_CAUSE_EXPIRED:
      return "expired";
  }
  return "unknown";
}

const char* ivis_status_name(ivis_status status) {
  switch (status) {
    case IVIS_OK:
      return "ok";
    case IVIS_ERROR_ARGUMENT:
      return "invalid argument";
    case IVIS_ERROR_INPUT:
      return "bad input";
    case IVIS_ERROR_IO:
      return "input/output";
    case IVIS_ERROR_MISMATCH:
      return "mismatch";
    case IVIS_ERROR_CONNECTION:
      return "connection";
    case IVIS_ERROR_TIMEOUT:
      return "timeout";
  }
  return "unknown";
}

}  // extern "C"
