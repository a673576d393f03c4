#include <iostream>
#include <memory>

#include "scenes/generate_city.h"
#include "scenes/generate_dress.h"
#include "tools/common.h"

namespace ivis::tool {
namespace {

struct Output {
  std::filesystem::path glb;
  std::filesystem::path path;
  bool json = false;
  Status check() const {
    if (auto s = check_output_file(glb); !s) return s;
    return path.empty() ? ok() : check_output_file(path);
  }
  void add_to(CLI::App& app) {
    app.add_option("-o,--output", glb, "scene file to write")->required()->type_name("OUT.glb");
    app.add_option("--path-out", path, "CSV to write a street walk to")->type_name("P.csv");
    app.add_flag("--json", json, "print JSON");
  }
};

Outcome write(const Output& out, const Result<GeneratedScene>& made) {
  if (!made) return made.error();
  if (auto s = write_file_whole(out.glb, made->glb); !s) return s.error();
  if (!out.path.empty())
    if (auto s = write_path(out.path, made->path); !s) return s.error();
  if (out.json) {
    print({{"objects", made->objects}, {"triangles", made->triangles}, {"buildings", made->buildings}, {"poses", made->path.size()}, {"bytes", made->glb.size()}});
  } else {
    std::cout << out.glb.string() << ": " << made->buildings << " buildings, " << made->objects << " objects, " << made->triangles << " triangles\n";
    if (!out.path.empty()) std::cout << out.path.string() << ": " << made->path.size() << " poses\n";
  }
  return kOk;
}

void add_path_options(CLI::App& app, StreetPathOptions& path) {
  app.add_option("--poses", path.poses, "poses of the walk")->capture_default_str()->check(CLI::Range(2, 1000000));
  app.add_option("--step", path.step_m, "metres between poses")->capture_default_str()->check(number_within(0.01, 100));
}

struct CityArgs {
  Output out;
  CityOptions options;
};
struct DressArgs {
  Output out;
  SceneArgs scene;
  DressOptions options;
};

}  // namespace

void add_generate(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand("generate", "make up scenes, the same for the same seed");
  sub->require_subcommand(1);

  auto city = std::make_shared<CityArgs>();
  CLI::App* c = sub->add_subcommand("city", "streets, blocks, courts, houses with windows as geometry, trees, cars, ground");
  city->out.add_to(*c);
  c->add_option("--seed", city->options.seed, "of everything")->capture_default_str()->check(CLI::NonNegativeNumber);
  c->add_option("--size", city->options.size_m, "side of the square, metres")->capture_default_str();
  c->add_option("--buildings", city->options.buildings, "aimed at")->capture_default_str()->check(CLI::NonNegativeNumber);
  c->add_option("--objects", city->options.objects, "aimed at")->capture_default_str()->check(CLI::NonNegativeNumber);
  c->add_option("--triangles", city->options.triangles, "aimed at")->capture_default_str()->check(CLI::NonNegativeNumber);
  c->add_option("--relief", city->options.relief_m, "height of the ground's swells, metres")->capture_default_str();
  add_path_options(*c, city->options.path);
  c->callback([&action, city] {
    action = [city]() -> Outcome {
      if (auto s = city->out.check(); !s) return s.error();
      return write(city->out, generate_city(city->options, make_context(city->out.json)));
    };
  });

  auto dress = std::make_shared<DressArgs>();
  CLI::App* d = sub->add_subcommand("dress", "real buildings -> the same with ground, windows, trees, lamps, and a walk");
  dress->scene.add_to(*d);
  dress->out.add_to(*d);
  d->add_option("--seed", dress->options.seed, "of everything")->capture_default_str()->check(CLI::NonNegativeNumber);
  d->add_option("--max-triangles", dress->options.max_triangles, "budget, the buildings included")->capture_default_str()->check(CLI::NonNegativeNumber);
  add_path_options(*d, dress->options.path);
  d->callback([&action, dress] {
    action = [dress]() -> Outcome {
      if (auto s = dress->out.check(); !s) return s.error();
      const Context context = make_context(dress->out.json);
      const auto scene = dress->scene.load(context);
      if (!scene) return scene.error();
      return write(dress->out, generate_dress(*scene, dress->options, context));
    };
  });
}

}  // namespace ivis::tool
