#include "occluders/file.h"

#include <bit>
#include <cmath>
#include <cstring>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "core/path.h"

namespace ivis {
namespace {

// The layout is documented in FORMAT.md.
constexpr std::string_view kMagic = "ivis.ivo";
constexpr std::uint32_t kVersion = 3;
constexpr std::size_t kHeaderBytes = 32;
constexpr std::size_t kChecksumAt = 24;
constexpr std::size_t kMaxFileBytes = std::size_t{4} << 30U;
constexpr std::size_t kCornerBytes = 16;
constexpr std::size_t kMinRingBytes = 4 + 3 * kCornerBytes;
constexpr std::size_t kMinPrismBytes = 3 * 8 + 1 + 4 + kMinRingBytes;
constexpr double kMaxReachM = 1e6;
constexpr std::size_t kPointBytes = 24;
constexpr std::size_t kFaceBytes = 16;
constexpr std::size_t kMaxLevels = 64;

/// Of everything but the checksum's own eight bytes.
std::uint64_t checksum(const char* file, std::size_t size) {
  XXH3_state_t state;
  XXH3_64bits_reset(&state);
  XXH3_64bits_update(&state, file, kChecksumAt);
  XXH3_64bits_update(&state, file + kHeaderBytes, size - kHeaderBytes);
  return XXH3_64bits_digest(&state);
}

class Writer {
 public:
  void u8(std::uint8_t v) { bytes_.push_back(static_cast<char>(v)); }
  void u32(std::uint64_t v) { integer(v, 4); }
  void u64(std::uint64_t v) { integer(v, 8); }
  void f64(double v) { u64(std::bit_cast<std::uint64_t>(v)); }
  void vec(const Vec3& v) {
    f64(v.x);
    f64(v.y);
    f64(v.z);
  }
  void prisms(const std::vector<Prism>& list) {
    u64(list.size());
    for (const Prism& p : list) {
      f64(p.bottom);
      f64(p.top);
      f64(p.solid_bottom);
      u8(p.grounded ? 1 : 0);
      u32(p.footprint.rings.size());
      for (const auto& ring : p.footprint.rings) {
        u32(ring.size());
        for (const Vec2& c : ring) {
          f64(c.x);
          f64(c.y);
        }
      }
    }
  }
  void mesh(const FaceMesh& m) {
    u32(m.points.size());
    for (const Vec3& p : m.points)
      vec(p);
    u32(m.faces.size());
    for (const auto& face : m.faces)
      for (const std::uint32_t c : face)
        u32(c);
  }
  void numbers(const std::vector<double>& list) {
    u32(list.size());
    for (const double v : list)
      f64(v);
  }
  void planes(const std::vector<ConvexSolid::Plane>& list) {
    u32(list.size());
    for (const ConvexSolid::Plane& plane : list) {
      vec(plane.normal);
      f64(plane.offset);
    }
  }
  void box(const Aabb& b) {
    vec(b.lo);
    vec(b.hi);
  }
  void height_field(const HeightField& field) {
    u32(field.columns);
    u32(field.rows);
    f64(field.origin.x);
    f64(field.origin.y);
    f64(field.step.x);
    f64(field.step.y);
    for (const float h : field.heights)
      u32(std::bit_cast<std::uint32_t>(h));
  }
  std::string take() { return std::move(bytes_); }

 private:
  void integer(std::uint64_t v, int count) {
    for (int i = 0; i < count; ++i)
      bytes_.push_back(static_cast<char>((v >> (8 * i)) & 0xffU));
  }
  std::string bytes_;
};

/// Reads until the first thing that is not as it should be; everything after that yields zeros.
class Reader {
 public:
  Reader(const char* bytes, std::size_t size, const std::string& name)
      : bytes_(bytes), size_(size), name_(name) {}

  std::uint8_t u8(const char* field, std::uint8_t max) {
    const auto v = static_cast<std::uint8_t>(integer(1, field));
    if (v > max) fail(field, std::to_string(v), "at most " + std::to_string(max));
    return failed() ? std::uint8_t{0} : v;
  }
  std::uint32_t u32(const char* field) { return static_cast<std::uint32_t>(integer(4, field)); }
  std::uint64_t u64(const char* field) { return integer(8, field); }
  double f64(const char* field) {
    const double v = std::bit_cast<double>(integer(8, field));
    if (!std::isfinite(v)) fail(field, "a number that is not finite", "a finite one");
    if (!in_range(v)) fail(field, std::to_string(v), "at most 1e9");
    return failed() ? 0 : v;
  }
  Vec3 vec(const char* field) {
    const double x = f64(field);
    const double y = f64(field);
    return {x, y, f64(field)};
  }
  /// A count of things of at least `each` bytes, which must fit in the bytes left.
  std::size_t count(const char* field, int width, std::size_t least, std::size_t each) {
    const std::uint64_t v = integer(width, field);
    if (v < least) fail(field, std::to_string(v), "at least " + std::to_string(least));
    if (v > (size_ - at_) / each)
      fail(field, std::to_string(v),
           "at most " + std::to_string((size_ - at_) / each) + " in the bytes left");
    return failed() ? 0 : static_cast<std::size_t>(v);
  }
  std::vector<Prism> prisms(const char* field) {
    std::vector<Prism> list(count(field, 8, 0, kMinPrismBytes));
    for (Prism& p : list) {
      p.bottom = f64("prism bottom");
      p.top = f64("prism top");
      p.solid_bottom = f64("prism solid bottom");
      p.grounded = u8("prism grounded", 1) != 0;
      p.footprint.rings.resize(count("rings of a prism", 4, 1, kMinRingBytes));
      for (auto& ring : p.footprint.rings) {
        ring.resize(count("corners of a ring", 4, 3, kCornerBytes));
        for (Vec2& c : ring) {
          c.x = f64("corner x");
          c.y = f64("corner z");
        }
        if (failed()) return {};
      }
      if (failed()) return {};
    }
    return list;
  }
  FaceMesh mesh() {
    FaceMesh m;
    m.points.resize(count("points of a mesh", 4, 0, kPointBytes));
    for (Vec3& p : m.points)
      p = vec("point of a mesh");
    m.faces.resize(count("faces of a mesh", 4, 0, kFaceBytes));
    for (auto& face : m.faces)
      for (std::uint32_t& c : face) {
        c = static_cast<std::uint32_t>(integer(4, "corner of a face"));
        if (c >= m.points.size() && !failed())
          fail("corner of a face", std::to_string(c),
               "less than " + std::to_string(m.points.size()));
      }
    if (failed()) return {};
    return m;
  }
  std::vector<FaceMesh> meshes(std::size_t most) {
    std::vector<FaceMesh> list(levels(most));
    for (FaceMesh& m : list) {
      m = mesh();
      if (failed()) return {};
    }
    return list;
  }
  /// A number of levels, at most `most`.
  std::size_t levels(std::size_t most) {
    const std::size_t n = count("levels", 4, 0, 8);
    if (n > most) fail("levels", std::to_string(n), "at most " + std::to_string(most));
    return failed() ? 0 : n;
  }
  /// Ascending, at least 0.
  std::vector<double> ladder(const char* field) {
    std::vector<double> list(count(field, 4, 0, 8));
    if (list.size() > kMaxLevels)
      fail(field, std::to_string(list.size()) + " numbers",
           "at most " + std::to_string(kMaxLevels));
    double last = 0;
    for (double& v : list) {
      v = f64(field);
      if (v < last) fail(field, std::to_string(v), "at least " + std::to_string(last));
      last = v;
      if (failed()) return {};
    }
    return list;
  }
  Aabb box(const char* field) {
    const Vec3 lo = vec(field);
    const Aabb b{lo, vec(field)};
    if (b.empty()) fail(field, "an empty box", "lo at most hi");
    return b;
  }
  /// Unit to within rounding.
  Vec3 normal(const char* field) {
    const Vec3 n = vec(field);
    const double length = glm::length(n);
    if (!(std::abs(length - 1) < 1e-9)) fail(field, "length " + std::to_string(length), "1");
    return n;
  }
  std::vector<ConvexSolid::Plane> planes(const char* field, std::size_t least) {
    std::vector<ConvexSolid::Plane> list(count(field, 4, least, kPointBytes + 8));
    for (ConvexSolid::Plane& plane : list) {
      plane.normal = normal("normal of a plane");
      plane.offset = f64("offset of a plane");
      if (failed()) return {};
    }
    return list;
  }
  HeightField height_field() {
    HeightField field;
    field.columns = static_cast<std::uint32_t>(integer(4, "columns"));
    field.rows = static_cast<std::uint32_t>(integer(4, "rows"));
    field.origin.x = f64("origin x");
    field.origin.y = f64("origin z");
    field.step.x = f64("step x");
    field.step.y = f64("step z");
    const std::uint64_t cells = std::uint64_t{field.columns} * field.rows;
    if (cells > (size_ - at_) / 4)
      fail("cells of the height field", std::to_string(cells),
           "at most " + std::to_string((size_ - at_) / 4) + " in the bytes left");
    if (cells > 0 && !(field.step.x > 0 && field.step.y > 0))
      fail("step of the height field", std::to_string(std::min(field.step.x, field.step.y)),
           "more than 0");
    if (failed()) return {};
    field.heights.resize(static_cast<std::size_t>(cells));
    for (float& h : field.heights) {
      h = std::bit_cast<float>(static_cast<std::uint32_t>(integer(4, "height")));
      if (!std::isfinite(h) || std::abs(h) > 1e9F) {
        fail("height", std::to_string(h), "finite, at most 1e9");
        return {};
      }
    }
    return field;
  }
  void end() {
    if (at_ != size_) fail("end", std::to_string(size_ - at_) + " bytes more", "none");
  }
  void fail(const std::string& field, const std::string& found, const std::string& expected) {
    if (error_.empty())
      error_ = name_ + ": " + field + " at byte " + std::to_string(kHeaderBytes + at_) +
               ": found " + found + ", expected " + expected;
  }
  bool failed() const { return !error_.empty(); }
  const std::string& error() const { return error_; }

 private:
  std::uint64_t integer(int count, const char* field) {
    if (failed()) return 0;
    if (size_ - at_ < static_cast<std::size_t>(count)) {
      fail(field, std::to_string(size_ - at_) + " bytes", std::to_string(count));
      return 0;
    }
    std::uint64_t v = 0;
    for (int i = 0; i < count; ++i)
      v |= std::uint64_t{static_cast<unsigned char>(bytes_[at_ + static_cast<std::size_t>(i)])}
           << (8 * i);
    at_ += static_cast<std::size_t>(count);
    return v;
  }

  const char* bytes_;
  std::size_t size_;
  std::size_t at_ = 0;
  const std::string& name_;
  std::string error_;
};

Reach read_reach(Reader& in) {
  const auto kind =
      static_cast<Reach::Kind>(in.u8("reach kind", static_cast<std::uint8_t>(Reach::Kind::kBox)));
  const Vec3 e = in.vec("reach half-extents");
  for (int i = 0; i < 3; ++i)
    if (!(e[i] >= 0 && e[i] <= kMaxReachM))
      in.fail("reach half-extent", std::to_string(e[i]), "0 to 1000000");
  Reach reach;
  switch (kind) {
    case Reach::Kind::kBall:
      reach = Reach::ball(e.x);
      break;
    case Reach::Kind::kDisc:
      reach = Reach::disc(e.x);
      break;
    case Reach::Kind::kCylinder:
      reach = Reach::cylinder(e.x, e.y);
      break;
    case Reach::Kind::kEllipsoid:
      reach = Reach::ellipsoid(e);
      break;
    case Reach::Kind::kBox:
      reach = Reach::box(e);
      break;
  }
  if (!(reach.half_extents() == e))
    in.fail("reach half-extents",
            std::to_string(e.x) + "," + std::to_string(e.y) + "," + std::to_string(e.z),
            "those of " + reach.to_string());
  return reach;
}

}  // namespace

std::string encode_occluders(const OccluderSet& set) {
  Writer out;
  out.u64(set.scene_hash);
  out.u8(static_cast<std::uint8_t>(set.reach.kind()));
  out.vec(set.reach.half_extents());
  out.f64(set.slack_m);
  out.f64(set.floor);
  out.u8(set.ground.empty() ? 0 : 1);
  out.vec(set.ground.empty() ? Vec3{0} : set.ground.lo);
  out.vec(set.ground.empty() ? Vec3{0} : set.ground.hi);
  out.u8(static_cast<std::uint8_t>(set.view_space.kind));
  out.u64(set.view_space.seeds.size());
  for (const Vec3& s : set.view_space.seeds)
    out.vec(s);
  out.prisms(set.shrunk);
  out.prisms(set.solids);
  out.numbers(set.margins_m);
  out.u64(set.prism_pieces.size());
  for (const PrismPiece& piece : set.prism_pieces) {
    out.u32(piece.levels.size());
    for (const auto& level : piece.levels)
      out.prisms(level);
  }
  out.u64(set.solid_pieces.size());
  for (const SolidPiece& piece : set.solid_pieces) {
    out.u32(piece.levels.size());
    for (const FaceMesh& level : piece.levels)
      out.mesh(level);
    out.planes(piece.floors);
    out.u32(piece.floored_levels.size());
    for (const FaceMesh& level : piece.floored_levels)
      out.mesh(level);
  }
  out.numbers(set.sheet_radii_m);
  out.u64(set.sheets.size());
  for (const Sheet& sheet : set.sheets) {
    out.vec(sheet.normal);
    out.f64(sheet.offset);
    out.u32(sheet.levels.size());
    for (const FaceMesh& level : sheet.levels)
      out.mesh(level);
  }
  out.u64(set.backings.size());
  for (const Backing& b : set.backings) {
    out.u32(b.object);
    out.vec(b.plane.normal);
    out.f64(b.plane.offset);
    out.f64(b.per_level);
    out.f64(b.per_height);
  }
  out.height_field(set.height_field);
  out.u64(set.convex_solids.size());
  for (const ConvexSolid& solid : set.convex_solids) {
    out.box(solid.bounds);
    out.planes(solid.planes);
  }
  out.u64(set.closed_boxes.size());
  for (const Aabb& b : set.closed_boxes)
    out.box(b);
  out.u8(set.sealed ? 1 : 0);
  const std::string body = out.take();

  Writer header;
  header.u32(kVersion);
  header.u32(0);
  header.u64(body.size());
  std::string file = std::string(kMagic) + header.take() + std::string(8, '\0') + body;
  Writer sum;
  sum.u64(checksum(file.data(), file.size()));
  file.replace(kChecksumAt, 8, sum.take());
  return file;
}

Result<OccluderSet> decode_occluders(std::span<const std::byte> bytes, const std::string& name) {
  const char* data = reinterpret_cast<const char*>(bytes.data());
  if (bytes.size() < kHeaderBytes)
    return input_error(name + ": " + std::to_string(bytes.size()) +
                       " bytes, expected a header of " + std::to_string(kHeaderBytes));
  if (std::string_view(data, kMagic.size()) != kMagic)
    return input_error(name + ": not an occluder file: its first bytes are not '" +
                       std::string(kMagic) + "'");
  Reader header(data + kMagic.size(), kHeaderBytes - kMagic.size(), name);
  const std::uint64_t version = header.u64("version");
  if (version != kVersion)
    return mismatch(name + ": version " + std::to_string(version) + ", expected " +
                    std::to_string(kVersion));
  const std::uint64_t size = header.u64("size");
  if (size != bytes.size() - kHeaderBytes)
    return input_error(name + ": size of the body: found " +
                       std::to_string(bytes.size() - kHeaderBytes) + " bytes, expected " +
                       std::to_string(size));
  const std::uint64_t expected = header.u64("checksum");
  if (const std::uint64_t found = checksum(data, bytes.size()); found != expected)
    return input_error(name + ": checksum: found " + to_hex(found) + ", expected " +
                       to_hex(expected) + ": the file is damaged");

  Reader in(data + kHeaderBytes, bytes.size() - kHeaderBytes, name);
  OccluderSet set;
  set.scene_hash = in.u64("scene hash");
  set.reach = read_reach(in);
  set.slack_m = in.f64("slack");
  set.floor = in.f64("floor");
  const bool has_ground = in.u8("ground", 1) != 0;
  const Vec3 lo = in.vec("ground");
  const Vec3 hi = in.vec("ground");
  if (has_ground) {
    set.ground = {lo, hi};
    if (set.ground.empty()) in.fail("ground", "an empty box", "lo at most hi");
  }
  set.view_space.kind = static_cast<ViewSpace::Kind>(in.u8("view space kind", 1));
  set.view_space.seeds.resize(in.count("view space seeds", 8, 0, 3 * 8));
  for (Vec3& s : set.view_space.seeds)
    s = in.vec("view space seed");
  set.shrunk = in.prisms("shrunk prisms");
  set.solids = in.prisms("solids");
  set.margins_m = in.ladder("margins");
  set.prism_pieces.resize(in.count("prism pieces", 8, 0, 4));
  for (PrismPiece& piece : set.prism_pieces) {
    piece.levels.resize(in.levels(set.margins_m.size()));
    for (auto& level : piece.levels)
      level = in.prisms("prisms of a piece");
    if (in.failed()) break;
  }
  set.solid_pieces.resize(in.count("solid pieces", 8, 0, 12));
  for (SolidPiece& piece : set.solid_pieces) {
    piece.levels = in.meshes(set.margins_m.size());
    piece.floors = in.planes("floors of a piece", 0);
    piece.floored_levels = in.meshes(set.margins_m.size());
    if (in.failed()) break;
  }
  set.sheet_radii_m = in.ladder("sheet radii");
  set.sheets.resize(in.count("sheets", 8, 0, kPointBytes + 8 + 4));
  for (Sheet& sheet : set.sheets) {
    sheet.normal = in.normal("normal of a sheet");
    sheet.offset = in.f64("offset of a sheet");
    sheet.levels = in.meshes(set.sheet_radii_m.size());
    if (in.failed()) break;
  }
  set.backings.resize(in.count("backings", 8, 0, 4 + kPointBytes + 24));
  for (Backing& b : set.backings) {
    b.object = in.u32("object of a backing");
    b.plane.normal = in.normal("normal of a backing");
    b.plane.offset = in.f64("offset of a backing");
    b.per_level = in.f64("ratio of a backing");
    b.per_height = in.f64("ratio of a backing");
    if (in.failed()) break;
  }
  set.height_field = in.height_field();
  set.convex_solids.resize(in.count("convex solids", 8, 0, 2 * kPointBytes + 4));
  for (ConvexSolid& solid : set.convex_solids) {
    solid.bounds = in.box("box of a convex solid");
    solid.planes = in.planes("planes of a convex solid", 4);
    if (in.failed()) break;
  }
  set.closed_boxes.resize(in.count("closed boxes", 8, 0, 2 * kPointBytes));
  for (Aabb& b : set.closed_boxes) {
    b = in.box("closed box");
    if (in.failed()) break;
  }
  set.sealed = in.u8("sealed", 1) != 0;
  if (!in.failed()) in.end();
  if (in.failed()) return input_error(in.error());
  if (auto sound = check_numbers(set); !sound)
    return input_error(name + ": " + sound.error().message);
  return set;
}

Status write_occluders(const std::filesystem::path& file, const OccluderSet& set) {
  return write_file_whole(file, encode_occluders(set));
}

Result<OccluderSet> read_occluders(const std::filesystem::path& file) {
  const auto bytes = read_file_whole(file, kMaxFileBytes);
  if (!bytes) return bytes.error();
  return decode_occluders(std::as_bytes(std::span(*bytes)), file.string());
}

Status check_occluders(const OccluderSet& set, SceneHash scene_hash, const Reach& reach,
                       const std::string& name) {
  if (set.scene_hash != scene_hash)
    return mismatch(name + ": made for the scene with hash " + to_hex(set.scene_hash) +
                    ", this scene's is " + to_hex(scene_hash) +
                    " (another file, or the same with another --granularity)");
  if (!serves(set, reach))
    return mismatch(name + ": shrunk for the reach " + set.reach.to_string() +
                    ", which does not contain " + reach.to_string());
  return ok();
}

}  // namespace ivis
