#include "client_lib/record.h"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

#include "core/path.h"

namespace ivis::client {
namespace {

constexpr std::size_t kMaxRecordBytes = std::size_t{2} << 30U;
constexpr std::string_view kMagic = "ivis-record 3";

template <class N>
void put(std::string& out, N v) {
  std::array<char, 32> buffer{};
  const auto r = std::to_chars(buffer.data(), buffer.data() + buffer.size(), v);
  out.append(buffer.data(), r.ptr);
}

/// Takes words off a line.
class Words {
 public:
  explicit Words(std::string_view line) : rest_(line) {}
  std::string_view next() {
    const auto space = rest_.find(' ');
    const std::string_view word = rest_.substr(0, space);
    rest_ = space == std::string_view::npos ? std::string_view() : rest_.substr(space + 1);
    return word;
  }
  bool done() const { return rest_.empty(); }
  std::size_t left() const { return rest_.size(); }
  std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
};

template <class N>
std::optional<N> number(std::string_view word, int base = 10) {
  N v{};
  std::from_chars_result r{};
  if constexpr (std::is_floating_point_v<N>)
    r = std::from_chars(word.data(), word.data() + word.size(), v);
  else
    r = std::from_chars(word.data(), word.data() + word.size(), v, base);
  if (r.ec != std::errc{} || r.ptr != word.data() + word.size()) return std::nullopt;
  return v;
}

std::string shown(std::string_view text) {
  return "'" + std::string(text.substr(0, 60)) + "'";
}

Result<Vec3> point(Words& words, const char* what) {
  Vec3 p{0};
  for (int k = 0; k < 3; ++k) {
    const std::string_view word = words.next();
    const auto v = number<double>(word);
    if (!v || !std::isfinite(*v))
      return input_error(std::string(what) + ": found " + shown(word) +
                         ", expected a finite number");
    p[k] = *v;
  }
  return p;
}

Status ids(Words& words, std::uint32_t objects, std::vector<ObjectId>& out) {
  const std::string_view word = words.next();
  const auto count = number<std::uint32_t>(word);
  // An id takes at least a digit, and a space before the next.
  if (!count || *count > objects || *count > (words.left() + 1) / 2)
    return input_error("found " + shown(word) + " as the number of ids, expected at most " +
                       std::to_string(std::min<std::size_t>(objects, (words.left() + 1) / 2)));
  out.reserve(*count);
  for (std::uint32_t i = 0; i < *count; ++i) {
    const std::string_view text = words.next();
    const auto step = number<std::uint32_t>(text);
    const std::uint64_t id = step ? std::uint64_t{*step} + (i == 0 ? 0 : out.back()) : objects;
    if (!step || (i != 0 && *step == 0) || id >= objects)
      return input_error("found " + shown(text) +
                         " as id or gap, expected ids that ascend and are below " +
                         std::to_string(objects));
    out.push_back(static_cast<ObjectId>(id));
  }
  return ok();
}

enum : unsigned { kRemoved = 1, kOccluderOff = 2, kMoved = 4 };

Result<ObjectState> object(std::string_view line, const Record& record) {
  Words words(line);
  words.next();
  std::string_view word = words.next();
  const auto id = number<std::uint32_t>(word);
  if (!id || *id >= record.objects)
    return input_error("found " + shown(word) + " as the id of an object, expected one below " +
                       std::to_string(record.objects));
  word = words.next();
  const auto flags = number<std::uint8_t>(word);
  if (!flags || *flags > 7)
    return input_error("object: found " + shown(word) + " as flags, expected 0 to 7");
  ObjectState s;
  s.id = *id;
  s.removed = (*flags & kRemoved) != 0;
  s.occluder_off = (*flags & kOccluderOff) != 0;
  s.moved = (*flags & kMoved) != 0;
  if (s.moved) {
    const auto position = point(words, "the object's position");
    if (!position) return position.error();
    s.placement.position = *position;
    float q[4];
    for (float& v : q) {
      word = words.next();
      const auto value = number<float>(word);
      if (!value)
        return input_error("the object's rotation: found " + shown(word) + ", expected a number");
      v = *value;
    }
    s.placement.rotation = {q[3], q[0], q[1], q[2]};
    if (!s.placement.valid())
      return input_error("object " + std::to_string(s.id) + ": a placement that is none");
  }
  if (!words.done())
    return input_error("found " + shown(words.rest()) + " behind the object, expected nothing");
  return s;
}

Result<RecordedFrame> frame(std::string_view line, const Record& record) {
  Words words(line);
  if (words.next() != "frame") return input_error("found " + shown(line) + ", expected 'frame'");
  RecordedFrame f;
  std::string_view word = words.next();
  const auto time = number<double>(word);
  if (!time || !std::isfinite(*time))
    return input_error("the time: found " + shown(word) + ", expected a finite number");
  f.time_s = *time;
  word = words.next();
  const auto sequence = number<std::uint32_t>(word);
  if (!sequence) return input_error("the sequence: found " + shown(word) + ", expected a number");
  f.sequence = *sequence;
  auto centre = point(words, "the cell's eye");
  if (!centre) return centre.error();
  auto reach = Reach::parse(words.next());
  if (!reach) return reach.error();
  if (!record.reach.contains(*reach, kReachToleranceM))
    return input_error("a cell of " + reach->to_string() + ", more than the record's " +
                       record.reach.to_string());
  f.cell = {*centre, *reach};
  auto wanted = point(words, "the wanted eye");
  if (!wanted) return wanted.error();
  f.wanted = *wanted;
  auto eye = point(words, "the eye");
  if (!eye) return eye.error();
  f.eye = *eye;
  word = words.next();
  if (word != "covered" && word != "uncovered")
    return input_error("found " + shown(word) + ", expected 'covered' or 'uncovered'");
  f.covered = word == "covered";
  word = words.next();
  const auto cause = number<std::uint8_t>(word);
  if (!cause) return input_error("the cause: found " + shown(word) + ", expected a small number");
  f.cause = *cause;
  if (words.rest() == "everything") {
    f.everything = true;
    return f;
  }
  if (f.covered && !f.cell.contains(f.eye))
    return input_error("a covered frame whose eye is outside its cell");
  if (auto read = ids(words, record.objects, f.changed); !read) return read.error();
  if (!words.done()) return input_error("found " + shown(words.rest()) + " after the last id");
  return f;
}

}  // namespace

void Recorder::add(RecordedFrame frame, std::span<const std::uint64_t> visible) {
  frame.changed.clear();
  if (!frame.everything) {
    last_.resize(visible.size());
    for (std::size_t w = 0; w < visible.size(); ++w)
      for (std::uint64_t left = last_[w] ^ visible[w]; left != 0; left &= left - 1)
        frame.changed.push_back(
            static_cast<ObjectId>(w * 64 + static_cast<std::size_t>(std::countr_zero(left))));
    last_.assign(visible.begin(), visible.end());
  }
  record_.frames.push_back(std::move(frame));
}

RecordedSets::RecordedSets(const Record& record) : record_(record), visible_(record.objects) {}

Pvs RecordedSets::at(std::size_t frame) {
  for (; next_ <= frame; ++next_)
    for (const ObjectId id : record_.frames[next_].changed)
      visible_[id] = !visible_[id];
  const RecordedFrame& f = record_.frames[frame];
  Pvs pvs;
  pvs.cell = f.cell;
  pvs.scene_hash = record_.scene_hash;
  if (f.everything) pvs.everything_because = "told so";
  for (ObjectId id = 0; id < record_.objects; ++id)
    if (f.everything || visible_[id]) pvs.objects.push_back(id);
  return pvs;
}

std::string encode_record(const Record& record) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string out(kMagic);
  out += "\nscene ";
  for (int shift = 60; shift >= 0; shift -= 4)
    out += kDigits[(record.scene_hash >> static_cast<unsigned>(shift)) & 15U];
  out += "\nreach " + record.reach.to_string() + "\nobjects ";
  put(out, record.objects);
  out += '\n';
  for (const RecordedFrame& f : record.frames) {
    const auto put_point = [&](const Vec3& p) {
      for (int k = 0; k < 3; ++k) {
        out += ' ';
        put(out, p[k]);
      }
    };
    for (const ObjectState& o : f.edits) {
      out += "object ";
      put(out, o.id);
      out += ' ';
      put(out, (o.removed ? kRemoved : 0U) | (o.occluder_off ? kOccluderOff : 0U) |
                   (o.moved ? kMoved : 0U));
      if (o.moved) {
        put_point(o.placement.position);
        const glm::fquat& q = o.placement.rotation;
        for (const float v : {q.x, q.y, q.z, q.w}) {
          out += ' ';
          put(out, v);
        }
      }
      out += '\n';
    }
    out += "frame ";
    put(out, f.time_s);
    out += ' ';
    put(out, f.sequence);
    put_point(f.cell.eye);
    out += ' ' + f.cell.reach.to_string();
    put_point(f.wanted);
    put_point(f.eye);
    out += f.covered ? " covered " : " uncovered ";
    put(out, static_cast<unsigned>(f.cause));
    out += ' ';
    if (f.everything) {
      out += "everything\n";
      continue;
    }
    put(out, f.changed.size());
    ObjectId before = 0;
    for (const ObjectId id : f.changed) {
      out += ' ';
      put(out, id - before);
      before = id;
    }
    out += '\n';
  }
  return out;
}

Result<Record> decode_record(std::string_view text, const std::string& name) {
  Record record;
  std::size_t line_number = 0;
  const auto next_line = [&] {
    ++line_number;
    const auto end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    return line;
  };
  const auto wrong = [&](const std::string& why) {
    return input_error("'" + name + "' line " + std::to_string(line_number) + ": " + why);
  };
  const auto field = [&](std::string_view key) -> std::optional<std::string_view> {
    Words words(next_line());
    if (words.next() != key) return std::nullopt;
    return words.rest();
  };
  if (const auto magic = next_line(); magic != kMagic)
    return wrong("found " + shown(magic) + ", expected '" + std::string(kMagic) + "'");
  const auto scene = field("scene");
  const auto hash = scene && scene->size() == 16 ? number<std::uint64_t>(*scene, 16) : std::nullopt;
  if (!hash) return wrong("expected 'scene' and 16 hexadecimal digits");
  record.scene_hash = *hash;
  const auto reach = field("reach");
  if (!reach) return wrong("expected 'reach'");
  auto parsed = Reach::parse(*reach);
  if (!parsed) return wrong(parsed.error().message);
  record.reach = *parsed;
  const auto objects = field("objects");
  const auto count = objects ? number<std::uint32_t>(*objects) : std::nullopt;
  if (!count) return wrong("expected 'objects' and their number");
  record.objects = *count;
  std::vector<ObjectState> edits;
  while (!text.empty()) {
    const std::string_view line = next_line();
    if (line.starts_with("object ")) {
      auto o = object(line, record);
      if (!o) return wrong(o.error().message);
      edits.push_back(*o);
      continue;
    }
    auto f = frame(line, record);
    if (!f) return wrong(f.error().message);
    f->edits = std::exchange(edits, {});
    record.frames.push_back(std::move(*f));
  }
  return record;
}

Status write_record(const std::filesystem::path& file, const Record& record) {
  return write_file_whole(file, encode_record(record));
}

Result<Record> read_record(const std::filesystem::path& file) {
  const auto text = read_file_whole(file, kMaxRecordBytes);
  if (!text) return text.error();
  return decode_record(*text, file.string());
}

}  // namespace ivis::client
