#include <algorithm>
#include <charconv>
#include <iostream>
#include <memory>

#include "scenes/generate_city.h"
#include "scenes/generate_dress.h"
#include "scenes/generate_terrain.h"
#include "tools/common.h"

namespace ivis::tool {
namespace {

struct Output {
  std::filesystem::path glb;
  std::filesystem::path path;
  bool json = false;
  bool terrain = false;
  Status check() const {
    if (auto s = check_output_file(glb); !s) return s;
    return path.empty() ? ok() : check_output_file(path);
  }
  void add_to(CLI::App& app) {
    app.add_option("-o,--output", glb, "scene file to write")->required()->type_name("OUT.glb");
    app.add_option("--path-out", path,
                   terrain ? "CSV to write a flight to" : "CSV to write a street walk to")
        ->type_name("P.csv");
    app.add_flag("--json", json, "print JSON");
  }
};

Outcome write(const Output& out, const Result<GeneratedScene>& made) {
  if (!made) return made.error();
  if (auto s = write_file_whole(out.glb, made->glb); !s) return s.error();
  if (!out.path.empty())
    if (auto s = write_path(out.path, made->path); !s) return s.error();
  if (out.json) {
    print({{"objects", made->objects},
           {"triangles", made->triangles},
           {"buildings", made->buildings},
           {"poses", made->path.size()},
           {"bytes", made->glb.size()}});
  } else {
    std::cout << out.glb.string() << ": ";
    if (!out.terrain) std::cout << made->buildings << " buildings, ";
    std::cout << made->objects << " objects, " << made->triangles << " triangles\n";
    if (!out.path.empty())
      std::cout << out.path.string() << ": " << made->path.size() << " poses\n";
  }
  return kOk;
}

void add_path_options(CLI::App& app, StreetPathOptions& path) {
  app.add_option("--poses", path.poses, "poses of the walk")
      ->capture_default_str()
      ->check(CLI::Range(2, 1000000));
  app.add_option("--step", path.step_m, "metres between poses")
      ->capture_default_str()
      ->check(number_within(0.01, 100));
  app.add_option("--speed", path.speed_m_s, "metres a second, for the column t")
      ->capture_default_str()
      ->check(number_within(0.01, 1000));
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
struct TerrainArgs {
  Output out;
  std::filesystem::path dem;
  std::string crop;
  std::string crop_m;
  std::size_t made_up = 0;
  bool ragged = false;
  double made_up_step = 10;
  TerrainOptions options;
};

/// "A,B,...": exactly `n` numbers, none negative.
template <class T>
Result<std::vector<T>> numbers(const std::string& text, std::size_t n, const char* expected) {
  std::vector<T> list;
  const char* at = text.data();
  const char* end = at + text.size();
  while (at != end) {
    T value{};
    const auto parsed = std::from_chars(at, end, value);
    if (parsed.ec != std::errc{} || !(value >= T{0}) || (parsed.ptr != end && *parsed.ptr != ','))
      break;
    list.push_back(value);
    at = parsed.ptr == end ? end : parsed.ptr + 1;
    if (at == end && *(end - 1) == ',') break;
    if (at == end && list.size() == n) return list;
  }
  return invalid_argument("'" + text + "': expected " + expected);
}

Result<Dem> get_dem(const TerrainArgs& args, const Context& context) {
  if (args.made_up > 0)
    return made_up_dem(args.made_up, args.made_up_step, args.options.seed, args.ragged);
  DemCrop crop;
  if (!args.crop.empty()) {
    const auto v = numbers<std::size_t>(args.crop, 4, "COLUMN,ROW,COLUMNS,ROWS");
    if (!v) return v.error();
    crop.samples.emplace();
    std::copy(v->begin(), v->end(), crop.samples->begin());
  }
  if (!args.crop_m.empty()) {
    const auto v = numbers<double>(args.crop_m, 2, "EAST-WEST,NORTH-SOUTH in metres");
    if (!v) return v.error();
    crop.metres = Vec2{(*v)[0], (*v)[1]};
  }
  return read_dem(args.dem, crop, context);
}

}  // namespace

void add_generate(CLI::App& app, std::function<Outcome()>& action) {
  CLI::App* sub = app.add_subcommand("generate", "make up scenes, the same for the same seed");
  sub->require_subcommand(1);

  auto city = std::make_shared<CityArgs>();
  CLI::App* c = sub->add_subcommand(
      "city", "streets, blocks, courts, houses with windows as geometry, trees, cars, ground");
  city->out.add_to(*c);
  c->add_option("--seed", city->options.seed, "of everything")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  c->add_option("--size", city->options.size_m, "side of the square, metres")
      ->capture_default_str();
  c->add_option("--buildings", city->options.buildings, "aimed at")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  c->add_option("--objects", city->options.objects, "aimed at")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  c->add_option("--triangles", city->options.triangles, "aimed at")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  c->add_option("--relief", city->options.relief_m, "height of the ground's swells, metres")
      ->capture_default_str();
  add_path_options(*c, city->options.path);
  c->callback([&action, city] {
    action = [city]() -> Outcome {
      if (auto s = city->out.check(); !s) return s.error();
      return write(city->out, generate_city(city->options, make_context(city->out.json)));
    };
  });

  auto dress = std::make_shared<DressArgs>();
  CLI::App* d = sub->add_subcommand(
      "dress", "real buildings -> the same with ground, windows, trees, lamps, and a walk");
  dress->scene.add_to(*d, false);
  dress->out.add_to(*d);
  d->add_option("--seed", dress->options.seed, "of everything")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  d->add_option("--max-triangles", dress->options.max_triangles, "budget, the buildings included")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
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

  auto terrain = std::make_shared<TerrainArgs>();
  terrain->out.terrain = true;
  CLI::App* t = sub->add_subcommand(
      "terrain", "measured heights -> terrain in tiles, trees, and a flight over it");
  auto* dem = t->add_option(
      "DEM", terrain->dem, "GeoTIFF, ESRI ASCII grid (.asc) or SRTM .hgt; needs a build with GDAL");
  terrain->out.add_to(*t);
  auto* crop = t->add_option("--crop", terrain->crop,
                             "part of the grid, counted in heights from the north-west corner")
                   ->type_name("COL,ROW,COLUMNS,ROWS");
  auto* crop_m =
      t->add_option("--crop-m", terrain->crop_m,
                    "metres east-west and north-south about the grid's middle, to whole cells")
          ->type_name("W,H")
          ->excludes(crop);
  t->add_option("--made-up", terrain->made_up,
                "no file: SIZE x SIZE cells of hills made up from the seed")
      ->type_name("SIZE")
      ->excludes(dem)
      ->excludes(crop)
      ->excludes(crop_m)
      ->check(CLI::Range(4, 4096));
  t->add_option("--made-up-step", terrain->made_up_step, "metres a cell of made-up hills")
      ->capture_default_str()
      ->check(number_within(0.1, 1000));
  t->add_flag("--ragged", terrain->ragged, "made-up hills with a slanted border and holes");
  t->add_option("--seed", terrain->options.seed, "of trees, flight and made-up hills")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  t->add_option("--tile", terrain->options.tile_cells, "cells a side of a tile")
      ->capture_default_str()
      ->check(CLI::Range(1, 1024));
  auto* trees = t->add_option("--trees", terrain->options.trees, "trees, one object each")
                    ->capture_default_str()
                    ->check(CLI::NonNegativeNumber);
  t->add_option("--triangles", terrain->options.triangles,
                "aimed at in all, by the number of trees")
      ->check(CLI::NonNegativeNumber)
      ->excludes(trees);
  t->add_option("--copyright", terrain->options.copyright,
                "for asset.copyright: who measured the heights");
  FlyoverOptions& flight = terrain->options.path;
  t->add_option("--poses", flight.poses, "poses of the flight")
      ->capture_default_str()
      ->check(CLI::Range(2, 1000000));
  t->add_option("--step", flight.step_m, "metres between poses; the default is 200 m/s at 60 Hz")
      ->capture_default_str()
      ->check(number_within(0.01, 1000));
  t->add_option("--speed", flight.speed_m_s, "metres a second, for the column t")
      ->capture_default_str()
      ->check(number_within(0.01, 10000));
  t->add_option("--height", flight.height_m, "metres above the highest ground near by")
      ->capture_default_str()
      ->check(number_within(1, 10000));
  t->callback([&action, terrain] {
    if (terrain->dem.empty() && terrain->made_up == 0) throw CLI::RequiredError("DEM or --made-up");
    action = [terrain]() -> Outcome {
      const Context context = make_context(terrain->out.json);
      const auto heights = get_dem(*terrain, context);
      if (!heights) return heights.error();
      return write(terrain->out, generate_terrain(*heights, terrain->options, context));
    };
  });
}

}  // namespace ivis::tool
