#include <cstdio>
#include <exception>
#include <functional>
#include <iostream>

#include "tools/common.h"

// The command `ivis`. Exit codes: 0, 1 a check failed, 2 usage, 3 input, 4 connection.
int main(int argc, char** argv) {
  using namespace ivis::tool;
  CLI::App app{
      "ivis: what can be seen from anywhere the observer can get to.\n\n"
      "  ivis generate city -o city.glb --path-out walk.csv      a city to try things on\n"
      "  ivis shrink city.glb --reach cylinder:1.5,0.1 -o city.ivo\n"
      "  ivis pvs city.glb --eye 10,1.7,4 --reach cylinder:1.5,0.1 --occluders city.ivo\n"
      "  ivis verify city.glb --path walk.csv --reach cylinder:1.5,0.1\n"
      "  ivisd --scene city.glb --occluders city.ivo &\n"
      "  ivis walk --connect tcp://127.0.0.1:7447 --path walk.csv\n\n"
      "Exit codes: 0 done, 1 a check failed, 2 usage, 3 input, 4 connection.",
      "ivis"};
  app.set_version_flag("--version", IVIS_VERSION);
  app.require_subcommand(0, 1);  // none is refused below, where a misspelt one has been named
  std::function<Outcome()> action;
  add_info(app, action);
  add_objects(app, action);
  add_shrink(app, action);
  add_pvs(app, action);
  add_verify(app, action);
  add_draw(app, action);
  add_walk(app, action);
  add_replay(app, action);
  add_edit(app, action);
  add_generate(app, action);
  try {
    app.parse(argc, argv);
    if (!action) throw CLI::RequiredError("A subcommand");
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kUsage;
  }
  try {
    const Outcome outcome = action();
    // A script that reads half an answer must know.
    const bool written = (std::cout << std::flush).good() && std::fflush(stdout) == 0;
    if (outcome && written) return *outcome;
    if (outcome) {
      std::cerr << "ivis: cannot write to standard output\n";
      return kBadInput;
    }
    std::cerr << "ivis: " << outcome.error().message << '\n';
    return exit_code(outcome.error());
  } catch (const std::bad_alloc&) {
    std::cerr << "ivis: out of memory\n";
  } catch (const std::exception& e) {
    std::cerr << "ivis: " << e.what() << '\n';
  }
  return kBadInput;
}
