#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>
#include <thread>

#include <ivis/ivis.hpp>

#include "tools/common.h"

namespace ivis::tool {
namespace {

struct EditArgs {
  std::string endpoint;
  std::uint32_t id = 0;
  std::string position;
  double turn_deg = 0;
  double speed_m_s = 0;
  std::string on_off;
  double timeout_s = 5;
  bool json = false;
};

Outcome run_edit(const EditArgs& args, ivis_edit edit) {
  edit.id = args.id;
  if (edit.kind == IVIS_EDIT_MOVE) {
    const auto at = parse_point(args.position);
    if (!at) return at.error();
    for (int k = 0; k < 3; ++k)
      edit.position[k] = (*at)[k];
    const double half = args.turn_deg * std::acos(-1.0) / 360;
    edit.rotation[1] = static_cast<float>(std::sin(half));
    edit.rotation[3] = static_cast<float>(std::cos(half));
    edit.speed_m_s = static_cast<float>(args.speed_m_s);
  }
  ivis_client_options options = ivis_client_options_default();
  options.endpoint = args.endpoint.c_str();
  options.connect_timeout_ms = static_cast<int>(1000 * args.timeout_s);
  const auto client = VisibilityClient::connect(options);
  if (!client) return connection_error(client.error());
  std::uint32_t request = 0;
  if (const ivis_status s = ivis_client_edit(client.get(), &edit, 1, &request); s != IVIS_OK)
    return s == IVIS_ERROR_ARGUMENT ? invalid_argument(client.error())
                                    : connection_error(client.error());
  const auto until =
      std::chrono::steady_clock::now() + std::chrono::duration<double>(args.timeout_s);
  ivis_edit_result result;
  while (ivis_client_edit_result(client.get(), &result) == 0) {
    if (std::chrono::steady_clock::now() > until)
      return connection_error("no answer from " + args.endpoint + " within " +
                              std::to_string(args.timeout_s) + " s");
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (args.json)
    print({{"epoch", result.epoch}, {"refused", result.refused}});
  else if (result.epoch != 0)
    std::cout << "done: the scene is at epoch " << result.epoch << '\n';
  if (result.epoch == 0 && !args.json)
    return input_error("refused: " + std::string(result.refused));
  return result.epoch != 0 ? kOk : kBadInput;
}

}  // namespace

void add_edit(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand(
      "edit", "change the scene that a running ivisd serves, for all its clients");
  sub->footer(
      "Ids are those of `ivis objects`. Of `occluder`, also the nodes that only occlude: they "
      "are numbered on\nbehind the objects, in the order of the file.\n\n"
      "  ivis edit --connect tcp://127.0.0.1:7447 move 17 10,0,-4 --turn 90\n"
      "  ivis edit --connect tcp://127.0.0.1:7447 occluder 17 off");
  auto args = std::make_shared<EditArgs>();
  sub->add_option("--connect", args->endpoint, "the daemon's address, as in tcp://127.0.0.1:7447")
      ->required()
      ->type_name("E");
  sub->add_option("--timeout", args->timeout_s, "seconds to wait for the daemon")
      ->capture_default_str()
      ->check(number_within(0.001, 1e5));
  sub->add_flag("--json", args->json, "print JSON");
  sub->require_subcommand(1);
  const auto add = [&](const char* name, const char* what, const std::function<ivis_edit()>& edit) {
    CLI::App* kind = sub->add_subcommand(name, what);
    kind->fallthrough();
    kind->add_option("ID", args->id, "of the object")->required();
    kind->callback([&action, args, edit] { action = [=] { return run_edit(*args, edit()); }; });
    return kind;
  };
  const auto of = [](ivis_edit_kind kind) {
    ivis_edit e{};
    e.kind = static_cast<std::uint8_t>(kind);
    e.rotation[3] = 1;
    return e;
  };
  CLI::App* move = add("move", "put an object somewhere else", [=] { return of(IVIS_EDIT_MOVE); });
  move->add_option("position", args->position, "where its node's origin comes to, metres")
      ->type_name("X,Y,Z")
      ->required()
      ->check([](const std::string& text) {
        const auto p = parse_point(text);
        return p ? std::string() : p.error().message;
      });
  move->add_option("--turn", args->turn_deg,
                   "degrees about the vertical, from how the scene file has it, from +X to -Z")
      ->check(number_within(-360, 360));
  move->add_option("--speed", args->speed_m_s,
                   "metres a second: it goes on by itself, at most so fast")
      ->check(number_within(0, 1000));
  add("remove", "take an object out", [=] { return of(IVIS_EDIT_REMOVE); });
  add("add", "bring a removed object back", [=] { return of(IVIS_EDIT_ADD); });
  CLI::App* occluder = add("occluder", "switch what it hides on or off, as of a door", [=] {
    return of(args->on_off == "on" ? IVIS_EDIT_OCCLUDER_ON : IVIS_EDIT_OCCLUDER_OFF);
  });
  occluder->add_option("STATE", args->on_off, "on or off")
      ->required()
      ->check(CLI::IsMember({"on", "off"}));
}

}  // namespace ivis::tool
