#include <exception>
#include <memory>
#include <string>
#include <utility>

#include "client_lib/client.h"
#include "client_lib/include/ivis/ivis_local.h"
#include "client_lib/local_source.h"
#include "server/world.h"

namespace {

using namespace ivis;

Result<std::unique_ptr<client::PvsSource>> open(const ivis_local_options& options) {
  server::WorldOptions wanted;
  wanted.scene = options.scene_file;
  if (options.occluder_file != nullptr) wanted.occluders = options.occluder_file;
  if (options.reach != nullptr) wanted.reach = options.reach;
  if (options.method != nullptr) wanted.method = options.method;
  wanted.threads = options.threads;
  if (options.granularity != nullptr) {
    const auto granularity = parse_granularity(options.granularity);
    if (!granularity)
      return Error{granularity.error().code, "granularity: " + granularity.error().message};
    wanted.granularity = *granularity;
  }
  auto loaded = server::load_world(wanted);
  if (!loaded) return loaded.error();
  const std::shared_ptr<server::World> world = std::move(*loaded);
  client::LocalWorld local;
  local.catalogue = client::catalogue_of(world->scene, world->reach, *world->method);
  local.reach = world->reach;
  local.method = std::shared_ptr<const Method>(world, world->method.get());
  return client::make_local_source(std::move(local));
}

}  // namespace

extern "C" {

ivis_local_options ivis_local_options_default(void) {
  ivis_local_options o{};
  o.size = sizeof o;
  o.policy = IVIS_POLICY_EVERYTHING;
  o.threads = 1;
  return o;
}

ivis_status ivis_local_open(const ivis_local_options* options, ivis_client** client, char* error,
                            size_t error_size) {
  if (client == nullptr) return IVIS_ERROR_ARGUMENT;
  *client = nullptr;
  const auto refuse = [&](ivis_status status, const std::string& text) {
    client::copy_text(text, error, error_size);
    return status;
  };
  if (options == nullptr || options->size != sizeof(ivis_local_options))
    return refuse(IVIS_ERROR_ARGUMENT, "options were not made by ivis_local_options_default()");
  if (options->scene_file == nullptr) return refuse(IVIS_ERROR_ARGUMENT, "no scene file");
  if (options->policy < IVIS_POLICY_EVERYTHING || options->policy > IVIS_POLICY_INCOMPLETE)
    return refuse(IVIS_ERROR_ARGUMENT,
                  "unknown policy " + std::to_string(static_cast<int>(options->policy)));
  if (options->threads < 1 || options->threads > 256)
    return refuse(IVIS_ERROR_ARGUMENT,
                  std::to_string(options->threads) + " threads, expected 1 to 256");
  try {
    auto source = open(*options);
    if (!source) return refuse(client::status_of(source.error()), source.error().message);
    *client = ivis_client_adopt_source_(source->release(), options->policy);
    return *client != nullptr ? IVIS_OK : refuse(IVIS_ERROR_IO, "out of memory");
  } catch (const std::exception& e) {
    return refuse(IVIS_ERROR_IO, e.what());
  }
}

}  // extern "C"
