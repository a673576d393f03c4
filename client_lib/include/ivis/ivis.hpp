#pragma once
// C++17 over ivis.h, header only. Same threads, units and guarantee.

#include <ivis/ivis.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace ivis {

/// What ivis.h's ivis_frame says, with visible(id). Valid until the next call with its client.
class PvsView {
 public:
  explicit PvsView(const ivis_frame& frame) : frame_(frame) {}
  bool visible(std::uint32_t id) const { return ivis_frame_visible(&frame_, id) != 0; }
  std::uint32_t count() const { return frame_.visible_count; }
  std::uint32_t object_count() const { return frame_.object_count; }
  bool covered() const { return frame_.covered != 0; }
  bool stalled() const { return frame_.stalled != 0; }
  bool everything() const { return frame_.everything != 0; }
  /// Draw from here.
  const double (&eye() const)[3] { return frame_.eye; }
  const ivis_frame& raw() const { return frame_; }

 private:
  ivis_frame frame_;
};

/// Owns an ivis_client. Move-only; an unconnected one is empty.
class VisibilityClient {
 public:
  VisibilityClient() = default;
  explicit VisibilityClient(ivis_client* owned) : client_(owned) {}

  /// On failure the result is empty and error() says why.
  static VisibilityClient connect(const ivis_client_options& options) {
    ivis_client* client = nullptr;
    char text[512] = "";
    const ivis_status status = ivis_client_connect(&options, &client, text, sizeof text);
    VisibilityClient made(client);
    if (status != IVIS_OK) made.error_ = text;
    return made;
  }

  explicit operator bool() const { return client_ != nullptr; }
  PvsView frame(const double (&eye)[3]) {
    ivis_frame out;
    status_ = ivis_client_frame(client_.get(), eye, &out);
    return PvsView(out);
  }
  ivis_status pose(const double (&eye)[3]) {
    return status_ = ivis_client_pose(client_.get(), eye);
  }
  ivis_status wait(int timeout_ms) { return status_ = ivis_client_wait(client_.get(), timeout_ms); }
  PvsView view(const double (&eye)[3]) {
    ivis_frame out;
    status_ = ivis_client_view(client_.get(), eye, &out);
    return PvsView(out);
  }
  ivis_stats stats() const {
    ivis_stats out;
    ivis_client_stats(client_.get(), &out);
    return out;
  }
  std::optional<ivis_info> info() const {
    ivis_info out;
    if (ivis_client_info(client_.get(), &out) != IVIS_OK) return std::nullopt;
    return out;
  }
  std::optional<std::uint32_t> id_of(std::uint32_t node, std::uint32_t instance = 0) const {
    std::uint32_t id = 0;
    if (ivis_object_id(client_.get(), node, instance, &id) != IVIS_OK) return std::nullopt;
    return id;
  }
  /// First id and count: several where meshes are split into clusters.
  std::optional<std::pair<std::uint32_t, std::uint32_t>> ids_of(std::uint32_t node,
                                                                std::uint32_t instance = 0) const {
    std::pair<std::uint32_t, std::uint32_t> out;
    if (ivis_object_ids(client_.get(), node, instance, &out.first, &out.second) != IVIS_OK)
      return std::nullopt;
    return out;
  }
  std::optional<std::uint32_t> cluster_of(std::uint32_t id) const {
    std::uint32_t cluster = 0;
    if (ivis_object_cluster(client_.get(), id, &cluster) != IVIS_OK) return std::nullopt;
    return cluster;
  }
  std::optional<std::pair<std::uint32_t, std::uint32_t>> node_of(std::uint32_t id) const {
    std::pair<std::uint32_t, std::uint32_t> out;
    if (ivis_object_node(client_.get(), id, &out.first, &out.second) != IVIS_OK)
      return std::nullopt;
    return out;
  }
  ivis_status status() const { return status_; }  ///< of the last frame, pose, wait or view
  std::string error() const { return client_ ? ivis_client_error(client_.get()) : error_; }
  ivis_client* get() const { return client_.get(); }

 private:
  struct Close {
    void operator()(ivis_client* c) const { ivis_client_close(c); }
  };
  std::unique_ptr<ivis_client, Close> client_;
  ivis_status status_ = IVIS_OK;
  std::string error_;
};

}  // namespace ivis
