#include "occluders/nef_messages.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace ivis {
namespace {

void put(std::string& out, double v) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof text, v, std::chars_format::hex).ptr;
  out.append(text, end) += ' ';
}
void put(std::string& out, std::size_t n) {
  out += std::to_string(n) += ' ';
}
void put(std::string& out, const Vec3& p) {
  for (int i = 0; i < 3; ++i)
    put(out, p[i]);
}

/// Words one after the other. After the first that is not as expected all else yields nothing.
class Words {
 public:
  explicit Words(std::string_view text) : text_(text) {}

  std::string_view next() {
    const std::size_t begin = text_.find_first_not_of(' ');
    if (begin == std::string_view::npos) {
      text_ = {};
      return {};
    }
    const std::size_t end = text_.find(' ', begin);
    if (end == std::string_view::npos) {  // cut short in the middle
      text_ = {};
      return {};
    }
    const std::string_view word = text_.substr(begin, end - begin);
    text_.remove_prefix(end);
    return word;
  }
  bool ended() const { return text_.find_first_not_of(' ') == std::string_view::npos; }
  std::string_view rest() {
    const std::string_view all = text_;
    text_ = {};
    return all;
  }
  double number() {
    if (!good()) return 0;
    const std::string_view word = next();
    double v = 0;
    if (word.empty()) short_ = true;
    const auto [end, wrong] =
        std::from_chars(word.data(), word.data() + word.size(), v, std::chars_format::hex);
    if (!word.empty() && (wrong != std::errc{} || end != word.data() + word.size() || !in_range(v)))
      wrong_ = true;
    return good() ? v : 0;
  }
  Vec3 point() {
    const double x = number();
    const double y = number();
    return {x, y, number()};
  }
  /// A count of things of at least `words` words each.
  std::size_t count(std::size_t words) {
    const std::size_t n = integer();
    if (good() && n > text_.size() / (2 * words) + 1) short_ = true;  // more than can follow
    return good() ? n : 0;
  }
  std::uint32_t index(std::size_t below) {
    const std::size_t n = integer();
    if (good() && n >= below) wrong_ = true;
    return good() ? static_cast<std::uint32_t>(n) : 0;
  }
  bool good() const { return !short_ && !wrong_; }
  bool wrong() const { return wrong_; }

 private:
  std::size_t integer() {
    if (!good()) return 0;
    const std::string_view word = next();
    std::size_t n = 0;
    if (word.empty()) short_ = true;
    const auto [end, trouble] = std::from_chars(word.data(), word.data() + word.size(), n);
    if (!word.empty() && (trouble != std::errc{} || end != word.data() + word.size()))
      wrong_ = true;
    return n;
  }
  std::string_view text_;
  bool short_ = false;  ///< the text ends before it should
  bool wrong_ = false;
};

void put_mesh(std::string& out, const std::vector<Vec3>& points,
              const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  put(out, points.size());
  for (const Vec3& p : points)
    put(out, p);
  put(out, triangles.size());
  for (const auto& t : triangles)
    for (const std::uint32_t c : t)
      put(out, std::size_t{c});
}

Polyhedron take_mesh(Words& in) {
  Polyhedron mesh;
  mesh.points.resize(in.count(3));
  for (Vec3& p : mesh.points)
    p = in.point();
  mesh.triangles.resize(in.count(3));
  for (auto& t : mesh.triangles)
    for (std::uint32_t& c : t)
      c = in.index(mesh.points.size());
  return mesh;
}

}  // namespace

std::string encode(const NefRequest& request) {
  std::string out = "ivis-nef-1 ";
  put(out, request.half);
  put(out, request.margins_m.size());
  for (const double m : request.margins_m)
    put(out, m);
  put_mesh(out, request.solid.points, request.solid.triangles);
  return out;
}

Result<NefRequest> decode_nef_request(std::string_view text) {
  Words in(text);
  if (in.next() != "ivis-nef-1")
    return input_error("a request begins with 'ivis-nef-1'; this program is run by 'ivis shrink'");
  NefRequest request;
  request.half = in.point();
  request.margins_m.resize(in.count(1));
  for (double& m : request.margins_m)
    m = in.number();
  request.solid = take_mesh(in);
  if (!in.good() || !in.ended()) return input_error("the request is not a solid and its margins");
  return request;
}

std::string encode_parts(const std::vector<ConvexSolid>& parts) {
  std::string out = "parts ";
  put(out, parts.size());
  for (const ConvexSolid& part : parts) {
    put(out, part.bounds.lo);
    put(out, part.bounds.hi);
    put(out, part.planes.size());
    for (const ConvexSolid::Plane& p : part.planes) {
      put(out, p.normal);
      put(out, p.offset);
    }
  }
  return out;
}

std::string encode_level(const FaceMesh& mesh) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (const auto& f : mesh.faces) {
    triangles.push_back({f[0], f[1], f[2]});
    if (f[3] != f[2]) triangles.push_back({f[0], f[2], f[3]});
  }
  std::string out = "level ";
  put_mesh(out, mesh.points, triangles);
  return out;
}

std::string encode_trouble(std::string_view why) {
  std::string words(why.substr(0, 160));  // of several lines, with the files of whoever says it
  std::replace(words.begin(), words.end(), '\n', ' ');
  return "trouble " + words;
}

std::string encode_end() {
  return "end ";
}

Result<NefAnswer> decode_nef_answer(std::string_view text) {
  NefAnswer answer;
  Words in(text);
  while (!answer.complete) {
    const std::string_view what = in.next();
    if (what.empty()) break;
    if (what == "end") {
      answer.complete = true;
    } else if (what == "trouble") {
      answer.trouble = std::string(in.rest().substr(0, 200));
      break;
    } else if (what == "parts") {
      std::vector<ConvexSolid> parts(in.count(11));
      for (ConvexSolid& part : parts) {
        part.bounds.lo = in.point();
        part.bounds.hi = in.point();
        part.planes.resize(in.count(4));
        for (ConvexSolid::Plane& p : part.planes) {
          p.normal = in.point();
          p.offset = in.number();
        }
      }
      if (in.good()) answer.parts = std::move(parts);
    } else if (what == "level") {
      const Polyhedron mesh = take_mesh(in);
      FaceMesh level{mesh.points, {}};
      for (const auto& t : mesh.triangles)
        level.faces.push_back({t[0], t[1], t[2], t[2]});
      if (in.good()) answer.levels.push_back(std::move(level));
    } else {
      return input_error("found '" + std::string(what.substr(0, 20)) +
                         "', expected parts, level or end");
    }
    if (in.wrong()) return input_error("a number or corner is out of range");
    if (!in.good()) break;
  }
  return answer;
}

}  // namespace ivis
