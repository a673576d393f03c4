#include "occluders/voxelize.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <string>
#include <tuple>

#include "occluders/progress.h"
#include "occluders/triangle_box.h"

namespace ivis {
namespace {

constexpr double kMaxVoxels = 1 << 20;  // along an axis; see triangle_box.h
constexpr double kPad = 2.5;            // voxels around the scene
constexpr std::size_t kBlock = 256;     // triangles, tiles of one piece of work

std::string megabytes(double bytes) {
  return std::to_string(static_cast<long long>(std::ceil(bytes / 1e6))) + " MB";
}

Error too_big(double bytes, std::size_t max_bytes, double cell_m) {
  return invalid_argument("voxels of " + std::to_string(cell_m) + " m need " + megabytes(bytes) +
                          " or more, the limit is " + megabytes(static_cast<double>(max_bytes)) +
                          ": take larger voxels or raise the limit");
}

/// The mesh's triangles that stop a flood, ascending.
std::vector<std::uint32_t> barrier_triangles(const Mesh& mesh, bool both_sides_only) {
  std::vector<std::uint32_t> out;
  for (const Primitive& p : mesh.primitives)
    if (p.opaque && (p.double_sided || !both_sides_only))
      for (std::uint32_t t = 0; t < p.triangles; ++t)
        out.push_back(p.first_triangle + t);
  return out;
}

/// The parts, joined by edges, of the given triangles in which every edge lies an even number of
/// times. Corners are the same when their coordinates are.
std::vector<ClosedPiece> closed_pieces(const Mesh& mesh, const std::vector<std::uint32_t>& list) {
  const std::size_t n = mesh.positions.size();
  std::vector<std::uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t i) {
    const glm::vec3 p = mesh.positions[i] + 0.0F;  // -0 is 0
    return std::tuple(p.x, p.y, p.z);
  };
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  std::vector<std::uint32_t> weld(n);
  for (std::size_t i = 0; i < n; ++i)
    weld[order[i]] = i > 0 && key(order[i]) == key(order[i - 1]) ? weld[order[i - 1]] : order[i];

  struct Edge {
    std::uint32_t a, b, triangle;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * list.size());
  for (std::uint32_t i = 0; i < list.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t t = 3 * std::size_t{list[i]};
      const std::uint32_t a = weld[mesh.indices[t + k]];
      const std::uint32_t b = weld[mesh.indices[t + (k + 1) % 3]];
      if (a != b) edges.push_back({std::min(a, b), std::max(a, b), i});
    }
  std::sort(edges.begin(), edges.end(), [](const Edge& p, const Edge& q) {
    return std::tie(p.a, p.b, p.triangle) < std::tie(q.a, q.b, q.triangle);
  });
  std::vector<std::uint32_t> parent(list.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t i) {
    while (parent[i] != i)
      i = parent[i] = parent[parent[i]];
    return i;
  };
  std::vector<std::uint32_t> odd;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t j = i;
    for (; j < edges.size() && edges[j].a == edges[i].a && edges[j].b == edges[i].b; ++j)
      parent[root(edges[j].triangle)] = root(edges[i].triangle);
    if ((j - i) % 2 != 0) odd.push_back(edges[i].triangle);
    i = j;
  }
  std::vector<bool> open(list.size(), false);
  for (const std::uint32_t i : odd)
    open[root(i)] = true;
  std::vector<std::uint32_t> piece_of(list.size(), 0xffffffffU);
  std::vector<ClosedPiece> pieces;
  for (std::uint32_t i = 0; i < list.size(); ++i) {
    const std::uint32_t r = root(i);
    if (open[r]) continue;
    if (piece_of[r] == 0xffffffffU) {
      piece_of[r] = static_cast<std::uint32_t>(pieces.size());
      pieces.emplace_back();
    }
    pieces[piece_of[r]].push_back(i);
  }
  std::erase_if(pieces, [](const ClosedPiece& p) { return p.size() < 4; });
  return pieces;
}

struct Pair {
  std::uint32_t tile, triangle;
};

}  // namespace

Result<Voxelized> voxelize(const Scene& scene, double cell_m, std::size_t max_bytes,
                           const Context& context) {
  if (!(cell_m > 0) || !std::isfinite(cell_m))
    return invalid_argument("voxel size " + std::to_string(cell_m) + " m, expected more than 0");
  Voxelized out;
  VoxelGrid& grid = out.grid;
  grid.cell = cell_m;
  const Aabb bounds = scene.bounds.empty() ? Aabb{Vec3{0}, Vec3{0}} : scene.bounds;
  // Snapped to whole voxels of world space: two runs over parts of one scene have the same voxels.
  grid.origin = glm::floor(bounds.lo / cell_m - kPad) * cell_m;
  const Vec3 size = glm::ceil((bounds.hi - grid.origin) / cell_m + kPad);
  if (!(size.x <= kMaxVoxels && size.y <= kMaxVoxels && size.z <= kMaxVoxels))
    return invalid_argument("voxels of " + std::to_string(cell_m) + " m: the scene would be " +
                            std::to_string(std::max({size.x, size.y, size.z})) +
                            " voxels long, the limit is " +
                            std::to_string(static_cast<int>(kMaxVoxels)) + ": take larger voxels");
  const auto tiles = [](double voxels) {
    return static_cast<std::int32_t>(std::ceil(voxels / VoxelGrid::kTile));
  };
  grid.tiles = {tiles(size.x), tiles(size.y), tiles(size.z)};
  const double table_bytes = 4.0 * grid.tiles.x * grid.tiles.y * grid.tiles.z;
  if (table_bytes > static_cast<double>(max_bytes) || table_bytes > 4.0 * 0x7ffffff0)
    return too_big(table_bytes, std::min<std::size_t>(max_bytes, std::size_t{4} * 0x7ffffff0),
                   cell_m);
  const auto tile_count = static_cast<std::size_t>(table_bytes / 4);

  // The triangles, in voxels.
  Barriers& barriers = out.barriers;
  barriers.pieces.resize(scene.meshes.size());
  barriers.hidden_pieces.resize(scene.meshes.size());
  std::vector<std::vector<std::uint32_t>> of_mesh(scene.meshes.size());
  std::vector<std::vector<std::uint32_t>> of_hidden(scene.meshes.size());
  std::vector<char> drawn(scene.meshes.size(), 0);
  std::vector<char> hidden(scene.meshes.size(), 0);
  const auto blocks = [](const Object& o) {
    return o.tag != OccluderTag::kNever && !o.always_visible;
  };
  for (const Object& o : sources(scene))
    if (blocks(o)) drawn[o.mesh] = 1;
  for (const Object& o : scene.hidden_solids)
    if (blocks(o)) hidden[o.mesh] = 1;
  parallel_for(context, scene.meshes.size(), [&](std::size_t m) {
    const Mesh& mesh = scene.meshes[m];
    if (drawn[m] != 0) {
      of_mesh[m] = barrier_triangles(mesh, scene.honour_sidedness);
      barriers.pieces[m] = closed_pieces(mesh, of_mesh[m]);
    }
    if (hidden[m] != 0) {  // these block from both sides, whatever their material says
      of_hidden[m] = barrier_triangles(mesh, false);
      barriers.hidden_pieces[m] = closed_pieces(mesh, of_hidden[m]);
    }
  });
  if (context.stopped()) return cancelled();
  double needed = table_bytes;
  for (int pass = 0; pass < 2; ++pass) {
    const bool solid = pass == 1;
    for (const Object& o : solid ? scene.hidden_solids : sources(scene)) {
      if (!blocks(o)) continue;
      const auto& list = solid ? of_hidden[o.mesh] : of_mesh[o.mesh];
      if (list.empty()) continue;
      needed += static_cast<double>(list.size() * sizeof(GridTriangle));
      if (needed > static_cast<double>(max_bytes)) return too_big(needed, max_bytes, cell_m);
      Barriers::Owner owner{o.mesh, solid, static_cast<std::uint32_t>(grid.triangles.size()),
                            Vec3{std::numeric_limits<double>::infinity()},
                            Vec3{-std::numeric_limits<double>::infinity()}};
      for (const std::uint32_t t : list) {
        const Triangle w = world_triangle(scene, o, t);
        grid.triangles.push_back({{grid.to_grid(w.a), grid.to_grid(w.b), grid.to_grid(w.c)}});
        for (const Vec3& v : grid.triangles.back().v) {
          owner.lo = glm::min(owner.lo, v);
          owner.hi = glm::max(owner.hi, v);
        }
      }
      barriers.owners.push_back(owner);
    }
    if (context.stopped()) return cancelled();
  }
  Barriers::Owner end;
  end.first = static_cast<std::uint32_t>(grid.triangles.size());
  barriers.owners.push_back(end);

  // Which tiles each touches.
  const std::size_t blocks_of_triangles = (grid.triangles.size() + kBlock - 1) / kBlock;
  std::vector<std::vector<Pair>> found(blocks_of_triangles);
  std::atomic<std::size_t> pair_count{0};
  const std::size_t max_pairs =
      (max_bytes - std::min(max_bytes, static_cast<std::size_t>(needed))) / (3 * sizeof(Pair));
  {
    Progress progress(context, "voxels: tiles", blocks_of_triangles);
    parallel_for(context, blocks_of_triangles, [&](std::size_t b) {
      std::vector<Pair>& list = found[b];
      const std::size_t last = std::min(grid.triangles.size(), (b + 1) * kBlock);
      for (std::size_t t = b * kBlock; t < last; ++t) {
        if (pair_count > max_pairs || context.stopped()) return;
        const std::size_t before = list.size();
        const TriangleBox box(grid.triangles[t]);
        constexpr double kSide = VoxelGrid::kTile;
        const auto first = [&](int a) {
          return static_cast<std::int32_t>(
              std::floor((box.lo()[a] - 2 * TriangleBox::kSlack) / (kSide * 8)));
        };
        const auto until = [&](int a) {
          return static_cast<std::int32_t>(
              std::floor((box.hi()[a] + 2 * TriangleBox::kSlack) / (kSide * 8)));
        };
        for (std::int32_t z = first(2); z <= until(2); ++z)
          for (std::int32_t y = first(1); y <= until(1); ++y)
            for (std::int32_t x = first(0); x <= until(0); ++x) {
              const auto bits = box.touched<8>(Vec3(x, y, z) * (kSide * 8), kSide);
              for (std::size_t k = 0; k < 8; ++k)
                for (std::uint64_t w = bits[k]; w != 0; w &= w - 1) {
                  const int bit = std::countr_zero(w);
                  const IVec3 tile{8 * x + bit % 8, 8 * y + bit / 8, 8 * z + static_cast<int>(k)};
                  if (grid.tile_inside(tile))
                    list.push_back({static_cast<std::uint32_t>(grid.tile_index(tile)),
                                    static_cast<std::uint32_t>(t)});
                }
              if (list.size() - before > max_pairs) break;
            }
        pair_count += list.size() - before;
      }
      progress.step();
    });
  }
  if (context.stopped()) return cancelled();
  if (pair_count > max_pairs)
    return too_big(needed + static_cast<double>(pair_count * 3 * sizeof(Pair)), max_bytes, cell_m);
  std::vector<Pair> pairs;
  pairs.reserve(pair_count);
  for (auto& list : found) {
    pairs.insert(pairs.end(), list.begin(), list.end());
    std::vector<Pair>().swap(list);
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.tile, a.triangle) < std::tie(b.tile, b.triangle);
  });
  if (context.stopped()) return cancelled();

  grid.table.assign(tile_count, VoxelGrid::kAir);
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (i == 0 || pairs[i].tile != pairs[i - 1].tile) {
      grid.table[pairs[i].tile] = static_cast<std::uint32_t>(grid.mixed.size());
      VoxelGrid::Tile tile;
      tile.at = pairs[i].tile;
      tile.first_triangle = static_cast<std::uint32_t>(i);
      grid.mixed.push_back(tile);
    }
  if (!grid.mixed.empty()) {
    VoxelGrid::Tile close;
    close.first_triangle = static_cast<std::uint32_t>(pairs.size());
    grid.mixed.push_back(close);
  }
  grid.tile_triangles.resize(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i)
    grid.tile_triangles[i] = pairs[i].triangle;
  const std::size_t pair_bytes = pairs.size() * sizeof(Pair);
  std::vector<Pair>().swap(pairs);

  const std::size_t n = grid.mixed_count();
  needed = static_cast<double>(grid.bytes() + n * 2 * (sizeof(TileBits) + 8));
  if (needed > static_cast<double>(max_bytes)) return too_big(needed, max_bytes, cell_m);
  const std::size_t blocks_of_tiles = (n + kBlock - 1) / kBlock;
  std::vector<std::vector<TileBits>> nodes(blocks_of_tiles);
  std::vector<std::size_t> marked(blocks_of_tiles, 0);
  {
    Progress progress(context, "voxels: marking", blocks_of_tiles);
    parallel_for(context, blocks_of_tiles, [&](std::size_t b) {
      for (std::size_t m = b * kBlock; m < std::min(n, (b + 1) * kBlock); ++m) {
        if (context.stopped()) return;
        VoxelGrid::Tile& tile = grid.mixed[m];
        const IVec3 at = grid.tile_at(tile.at);
        const Vec3 corner = Vec3(at.x, at.y, at.z) * static_cast<double>(VoxelGrid::kTile);
        for (std::uint32_t i = tile.first_triangle; i < grid.mixed[m + 1].first_triangle; ++i) {
          const TileBits bits =
              TriangleBox(grid.triangles[grid.tile_triangles[i]]).touched<8>(corner, 1);
          for (std::size_t z = 0; z < 8; ++z)
            tile.marked[z] |= bits[z];
        }
        TileBits left;
        for (std::size_t z = 0; z < 8; ++z) {
          marked[b] += static_cast<std::size_t>(std::popcount(tile.marked[z]));
          left[z] = ~tile.marked[z];
        }
        // first_node counts within the block until all blocks are known.
        tile.first_node = static_cast<std::uint32_t>(nodes[b].size());
        for (std::size_t z = 0; z < 8;) {
          if (left[z] == 0) {
            ++z;
            continue;
          }
          TileBits seed{};
          seed[z] = left[z] & (~left[z] + 1);
          const TileBits node = fill(seed, left);
          for (std::size_t k = 0; k < 8; ++k)
            left[k] &= ~node[k];
          nodes[b].push_back(node);
        }
      }
      progress.step();
    });
  }
  if (context.stopped()) return cancelled();
  std::size_t total = 0;
  for (const auto& list : nodes)
    total += list.size();
  needed = static_cast<double>(grid.bytes() + total * 2 * (sizeof(TileBits) + 8));
  if (needed > static_cast<double>(max_bytes) || total >= 0x7fffffffU)
    return too_big(needed, max_bytes, cell_m);
  grid.node_bits.reserve(total);
  grid.node_tile.resize(total);
  grid.node_label.assign(total, VoxelGrid::kUnlabelled);
  for (std::size_t b = 0; b < blocks_of_tiles; ++b) {
    out.marked += marked[b];
    const auto base = static_cast<std::uint32_t>(grid.node_bits.size());
    for (std::size_t m = b * kBlock; m < std::min(n, (b + 1) * kBlock); ++m)
      grid.mixed[m].first_node += base;
    grid.node_bits.insert(grid.node_bits.end(), nodes[b].begin(), nodes[b].end());
    std::vector<TileBits>().swap(nodes[b]);
  }
  if (n > 0) grid.mixed[n].first_node = static_cast<std::uint32_t>(total);
  for (std::size_t m = 0; m < n; ++m)
    for (std::uint32_t k = grid.mixed[m].first_node; k < grid.mixed[m + 1].first_node; ++k)
      grid.node_tile[k] = static_cast<std::uint32_t>(m);
  out.peak_bytes = std::max(static_cast<std::size_t>(needed), grid.bytes() + 2 * pair_bytes);
  return out;
}

}  // namespace ivis
