// A server of its own process for tests that kill one: grid_server ADDRESS N serves grid_scene(N).

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>

#include "server/server.h"
#include "tests/server/fake_method.h"

namespace {
std::atomic<bool> stop{false};
}

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  std::signal(SIGTERM, [](int) { stop = true; });
  const ivis::Scene scene = ivis::test::grid_scene(std::atoi(argv[2]));
  const ivis::test::NearMethod method(scene);
  const auto served = ivis::server::served_scene(scene);
  const ivis::server::Ladder ladder(ivis::Reach::cylinder(1.5, 0.1), method,
                                    ivis::OccluderSet{}.slack_m);
  ivis::server::Log log(ivis::server::LogLevel::kInfo, false);
  ivis::server::ServerOptions options;
  options.listen = argv[1];
  auto server = ivis::server::Server::bind(options, {&served, &ladder, {}, nullptr}, log);
  if (!server) {
    std::fprintf(stderr, "%s\n", server.error().message.c_str());
    return 4;
  }
  log.info("listening", {{"address", (*server)->endpoint()}});
  (*server)->run(stop);
  return 0;
}
