#include "cutting/read_mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <numeric>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include "cutting/polygon.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;
using Face = std::array<int, 3>;

/// Triangles as a file has them.
struct Soup {
  std::vector<Vector3d> points;
  std::vector<Face> faces;
  std::vector<int> line;  ///< of every face, empty if the file is binary
};

/// A face of a file: its corners, and the line on which it stands, 0 in a binary file.
struct Polygon {
  std::vector<int> corners;
  int line = 0;
};
constexpr int most_corners = 1000;  // of a face

/// The file as bytes and the limits it is read under.
struct Source {
  std::string name;
  std::string bytes;
  std::int64_t max_triangles;

  [[noreturn]] void refuse(const std::string& expected, const std::string& seen, int line = 0,
                           int column = 0) const {
    throw BadInput(name, line, column, expected, seen);
  }
  void check_triangles(std::int64_t count) const {
    if (count > max_triangles)
      refuse(fmt::format("at most {} triangles", max_triangles), fmt::format("{}", count));
  }
};

std::string printable(std::string_view text) {
  std::string out = "'";
  for (const char c : text.substr(0, 40)) {
    const auto byte = static_cast<unsigned char>(c);
    out += byte >= 0x20 && byte < 0x7f ? std::string(1, c) : fmt::format("\\x{:02x}", byte);
  }
  return out + (text.size() > 40 ? "...'" : "'");
}

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return out;
}

// --- words of a text file -----------------------------------------------------------------------

struct Word {
  std::string_view text;  ///< empty at the end of the file
  int line = 1;
  int column = 1;
};

std::string text(const Vector3d& p) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z());
}

/// The corners of a face without those that stand where the one before stands.
std::vector<int> distinct_corners(const Soup& soup, const std::vector<int>& corners) {
  const auto at = [&](int corner) { return soup.points[static_cast<std::size_t>(corner)]; };
  std::vector<int> distinct;
  for (const int corner : corners)
    if (distinct.empty() || at(corner) != at(distinct.back())) distinct.push_back(corner);
  while (distinct.size() > 1 && at(distinct.back()) == at(distinct.front())) distinct.pop_back();
  return distinct;
}

/// Adds a face to a soup as triangles; a triangle is taken as it is.
Soup with_face(Soup soup, Polygon face, const Source& source) {
  const auto add = [&](int a, int b, int c) {
    soup.faces.push_back({a, b, c});
    if (face.line > 0) soup.line.push_back(face.line);
  };
  const std::size_t written = face.corners.size();
  if (written > 3) face.corners = distinct_corners(soup, face.corners);
  if (face.corners.size() < 3)
    source.refuse("faces with an area",
                  fmt::format("a degenerate one, {} corners at {} places, one of them {}", written,
                              face.corners.size(),
                              text(soup.points[static_cast<std::size_t>(face.corners[0])])),
                  face.line, face.line > 0 ? 1 : 0);
  if (face.corners.size() == 3) {
    add(face.corners[0], face.corners[1], face.corners[2]);
  } else {
    std::vector<Vector3d> points;
    for (const int corner : face.corners)
      points.push_back(soup.points[static_cast<std::size_t>(corner)]);
    const std::vector<Face> parts = triangulated(points);
    if (parts.empty())
      source.refuse("a face whose outline does not cross itself",
                    fmt::format("one of {} corners that no triangles fill", points.size()),
                    face.line, face.line > 0 ? 1 : 0);
    for (const Face& part : parts)
      add(face.corners[std::size_t(part[0])], face.corners[std::size_t(part[1])],
          face.corners[std::size_t(part[2])]);
  }
  source.check_triangles(static_cast<std::int64_t>(soup.faces.size()));
  return soup;
}

class Words {
 public:
  Words(const Source& source, char comment, std::size_t offset = 0, int line = 1)
      : source_(source), text_(source.bytes), at_(offset), line_(line), comment_(comment) {
    if (text_.substr(at_, 3) == "\xef\xbb\xbf") at_ += 3;
    line_start_ = at_;
  }

  /// The next word of the file.
  Word next() {
    skip(true);
    return take();
  }
  /// The next word of this line; empty at its end.
  Word next_in_line() {
    skip(false);
    return take();
  }
  void skip_line() {
    while (at_ < text_.size() && text_[at_] != '\n') ++at_;
  }
  bool at_end() {
    skip(true);
    return at_ >= text_.size();
  }
  std::size_t offset() const { return at_; }
  int line() const { return line_; }
  std::size_t bytes_left() const { return text_.size() - at_; }

  void expect(std::string_view keyword, const Word& seen) const {
    if (lower(seen.text) != keyword) refuse(fmt::format("'{}'", keyword), seen);
  }
  void expect(std::string_view keyword) { expect(keyword, next()); }

  double number(const Word& word) const {
    std::string_view digits = word.text;
    if (digits.size() > 1 && digits[0] == '+') digits.remove_prefix(1);
    double value = 0.0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    const bool whole = !digits.empty() && end == digits.data() + digits.size();
    if (!whole || error != std::errc() || !std::isfinite(value)) refuse("a finite number", word);
    return value;
  }
  double number() { return number(next()); }
  Vector3d point() {
    const double x = number();
    const double y = number();
    const double z = number();
    return {x, y, z};
  }

  std::int64_t integer(const Word& word, std::int64_t least, std::int64_t most,
                       const std::string& what) const {
    std::int64_t value = 0;
    const char* end = word.text.data() + word.text.size();
    const auto parsed = std::from_chars(word.text.data(), end, value);
    if (word.text.empty() || parsed.ec != std::errc() || parsed.ptr != end || value < least ||
        value > most)
      refuse(least == most ? fmt::format("{} {}", what, least)
                           : fmt::format("{} ({} .. {})", what, least, most),
             word);
    return value;
  }

  [[noreturn]] void refuse(const std::string& expected, const Word& seen) const {
    source_.refuse(expected, seen.text.empty() ? "the end" : printable(seen.text), seen.line,
                   seen.column);
  }

 private:
  static bool is_space(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v';
  }

  void skip(bool over_lines) {
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '\n') {
        if (!over_lines) return;
        ++at_;
        ++line_;
        line_start_ = at_;
      } else if (is_space(c)) {
        ++at_;
      } else if (comment_ != '\0' && c == comment_) {
        skip_line();
      } else {
        return;
      }
    }
  }
  Word take() {
    const std::size_t first = at_;
    while (at_ < text_.size() && text_[at_] != '\n' && !is_space(text_[at_])) ++at_;
    return {text_.substr(first, at_ - first), line_, static_cast<int>(first - line_start_) + 1};
  }

  const Source& source_;
  std::string_view text_;
  std::size_t at_;
  std::size_t line_start_ = 0;
  int line_;
  char comment_;
};

// --- STL ----------------------------------------------------------------------------------------

constexpr std::size_t stl_header = 84, stl_facet = 50;

std::uint64_t binary_stl_size(const std::string& bytes) {
  std::uint32_t count = 0;
  if (bytes.size() >= stl_header) std::memcpy(&count, bytes.data() + 80, 4);
  return stl_header + stl_facet * std::uint64_t{count};
}

bool is_binary_stl(const std::string& bytes) {
  return bytes.size() >= stl_header && bytes.size() == binary_stl_size(bytes);
}

void add_triangle(Soup& soup, const std::array<Vector3d, 3>& corners) {
  const int first = static_cast<int>(soup.points.size());
  soup.points.insert(soup.points.end(), corners.begin(), corners.end());
  soup.faces.push_back({first, first + 1, first + 2});
}

Soup read_binary_stl(const Source& source) {
  const std::size_t count = (source.bytes.size() - stl_header) / stl_facet;
  source.check_triangles(static_cast<std::int64_t>(count));
  Soup soup;
  for (std::size_t t = 0; t < count; ++t) {
    std::array<float, 12> values;
    std::memcpy(values.data(), source.bytes.data() + stl_header + stl_facet * t, sizeof values);
    for (const float v : values)
      if (!std::isfinite(v))
        source.refuse("finite numbers", fmt::format("{} in facet {} (counted from 1)", v, t + 1));
    const auto corner = [&](int k) {
      const auto i = static_cast<std::size_t>(3 + 3 * k);
      return Vector3d(values[i], values[i + 1], values[i + 2]);
    };
    add_triangle(soup, {corner(0), corner(1), corner(2)});
  }
  return soup;
}

Soup read_ascii_stl(const Source& source) {
  Words words(source, '\0');
  words.expect("solid");
  words.skip_line();
  Soup soup;
  for (;;) {
    const Word word = words.next();
    if (lower(word.text) == "endsolid") break;
    if (lower(word.text) != "facet") words.refuse("'facet' or 'endsolid'", word);
    words.expect("normal");
    words.point();
    words.expect("outer");
    words.expect("loop");
    std::array<Vector3d, 3> corners;
    for (Vector3d& corner : corners) {
      words.expect("vertex");
      corner = words.point();
    }
    words.expect("endloop");
    words.expect("endfacet");
    soup.line.push_back(word.line);
    add_triangle(soup, corners);
    source.check_triangles(static_cast<std::int64_t>(soup.faces.size()));
  }
  words.skip_line();
  if (!words.at_end()) words.refuse("one solid and then the end of the file", words.next());
  return soup;
}

Soup read_stl(const Source& source) {
  if (is_binary_stl(source.bytes)) return read_binary_stl(source);
  Words words(source, '\0');
  if (lower(words.next().text) == "solid") return read_ascii_stl(source);
  const std::string expected = "an ascii STL ('solid ...') or a binary one of 84 + 50 n bytes";
  if (source.bytes.size() < stl_header)
    source.refuse(expected, fmt::format("{} bytes that begin {}", source.bytes.size(),
                                        printable(source.bytes)));
  const std::uint64_t claimed = binary_stl_size(source.bytes);
  source.refuse(expected + fmt::format(", {} by its header of n = {}", claimed,
                                       (claimed - stl_header) / stl_facet),
                fmt::format("{} bytes", source.bytes.size()));
}

/// Corners at equal points made one vertex, in the order of their first use.
Soup merged(const Soup& soup) {
  std::vector<std::size_t> order(soup.points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto key = [&](std::size_t i) {
    const Vector3d& p = soup.points[i];
    return std::array{p.x(), p.y(), p.z()};
  };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const auto ka = key(a), kb = key(b);
    return ka < kb || (ka == kb && a < b);
  });
  std::vector<std::size_t> first_of(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    first_of[order[i]] =
        i > 0 && key(order[i]) == key(order[i - 1]) ? first_of[order[i - 1]] : order[i];

  Soup out;
  out.line = soup.line;
  std::vector<int> index(order.size(), -1);
  for (std::size_t i = 0; i < order.size(); ++i)
    if (first_of[i] == i) {
      index[i] = static_cast<int>(out.points.size());
      out.points.push_back(soup.points[i]);
    }
  for (const Face& face : soup.faces) {
    Face f;
    for (std::size_t k = 0; k < 3; ++k) f[k] = index[first_of[static_cast<std::size_t>(face[k])]];
    out.faces.push_back(f);
  }
  return out;
}

// --- OBJ ----------------------------------------------------------------------------------------

int obj_index(const Words& words, Word word, std::size_t vertices) {
  const std::string_view whole = word.text;
  word.text = whole.substr(0, whole.find('/'));
  const auto count = static_cast<std::int64_t>(vertices);
  const std::int64_t i =
      words.integer(word, -count, count, "the number of a vertex that stands above, not 0");
  if (i == 0) words.refuse("the number of a vertex that stands above, not 0", word);
  return static_cast<int>(i > 0 ? i - 1 : count + i);
}

Soup read_obj(const Source& source) {
  static constexpr std::array ignored = {"vt", "vn", "g", "o", "s", "usemtl", "mtllib", "l", "p"};
  Words words(source, '#');
  Soup soup;
  while (!words.at_end()) {
    const Word word = words.next();
    if (word.text == "v") {
      soup.points.push_back(words.point());
      words.skip_line();
    } else if (word.text == "f") {
      Polygon face{{}, word.line};
      Word corner = words.next_in_line();
      for (; face.corners.size() < 3 || !corner.text.empty(); corner = words.next_in_line()) {
        if (face.corners.size() == most_corners)
          words.refuse(fmt::format("at most {} corners of a face", most_corners), corner);
        face.corners.push_back(obj_index(words, corner, soup.points.size()));
      }
      soup = with_face(std::move(soup), face, source);
    } else if (std::find(ignored.begin(), ignored.end(), word.text) != ignored.end()) {
      words.skip_line();
    } else {
      words.refuse("an OBJ keyword (v, vt, vn, f, g, o, s, l, p, usemtl, mtllib)", word);
    }
  }
  return soup;
}

// --- OFF ----------------------------------------------------------------------------------------

Soup read_off(const Source& source) {
  Words words(source, '#');
  const Word magic = words.next();
  if (magic.text != "OFF")
    words.refuse("'OFF' (plain text, points without colours or normals)", magic);
  // every vertex and face takes at least six bytes, so the counts are bounded by the file
  const auto most = static_cast<std::int64_t>(words.bytes_left() / 6);
  const std::int64_t vertices =
      words.integer(words.next(), 0, most, "number of vertices that fit the file");
  const std::int64_t faces =
      words.integer(words.next(), 0, most, "number of faces that fit the file");
  words.integer(words.next(), 0, std::int64_t{1} << 40, "number of edges");
  source.check_triangles(faces);
  Soup soup;
  for (std::int64_t i = 0; i < vertices; ++i) soup.points.push_back(words.point());
  for (std::int64_t i = 0; i < faces; ++i) {
    const Word word = words.next();
    Polygon face{{}, word.line};
    face.corners.resize(std::size_t(words.integer(word, 3, most_corners, "number of corners")));
    for (int& corner : face.corners)
      corner = static_cast<int>(words.integer(words.next(), 0, vertices - 1, "number of a vertex"));
    soup = with_face(std::move(soup), face, source);
    words.skip_line();  // a colour may follow
  }
  if (!words.at_end())
    words.refuse("the end of the file after the faces of its header", words.next());
  return soup;
}

// --- PLY ----------------------------------------------------------------------------------------

enum class PlyForm { Ascii, Little, Big };

struct PlyType {
  std::size_t size = 0;
  char kind = 'i';  ///< i signed, u unsigned, f floating
};

struct PlyProperty {
  std::string name;
  PlyType type;
  std::optional<PlyType> list_count;
};

struct PlyElement {
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;
  int line = 0;
};

struct PlyHeader {
  PlyForm form = PlyForm::Ascii;
  PlyElement vertex, face;
  std::size_t end = 0;  ///< offset of the data
  int lines = 0;
};

PlyType ply_type(const Words& words, const Word& word) {
  static const std::map<std::string_view, PlyType> types = {
      {"char", {1, 'i'}},  {"int8", {1, 'i'}},    {"uchar", {1, 'u'}},  {"uint8", {1, 'u'}},
      {"short", {2, 'i'}}, {"int16", {2, 'i'}},   {"ushort", {2, 'u'}}, {"uint16", {2, 'u'}},
      {"int", {4, 'i'}},   {"int32", {4, 'i'}},   {"uint", {4, 'u'}},   {"uint32", {4, 'u'}},
      {"float", {4, 'f'}}, {"float32", {4, 'f'}}, {"double", {8, 'f'}}, {"float64", {8, 'f'}}};
  const auto found = types.find(word.text);
  if (found == types.end()) words.refuse("a PLY type (uchar, int, float, double ...)", word);
  return found->second;
}

PlyProperty ply_property(Words& words) {
  PlyProperty property;
  Word word = words.next_in_line();
  if (word.text == "list") {
    property.list_count = ply_type(words, words.next_in_line());
    if (property.list_count->kind == 'f')
      words.refuse("an integer type for the length of a list", word);
    word = words.next_in_line();
  }
  property.type = ply_type(words, word);
  property.name = std::string(words.next_in_line().text);
  return property;
}

PlyForm ply_form(Words& words) {
  words.expect("format");
  const Word form = words.next_in_line();
  words.expect("1.0", words.next_in_line());
  if (form.text == "ascii") return PlyForm::Ascii;
  if (form.text == "binary_little_endian") return PlyForm::Little;
  if (form.text == "binary_big_endian") return PlyForm::Big;
  words.refuse("'ascii', 'binary_little_endian' or 'binary_big_endian'", form);
}

void check_properties(const Source& source, const PlyHeader& header) {
  for (const std::string name : {"x", "y", "z"}) {
    const auto& all = header.vertex.properties;
    if (std::count_if(all.begin(), all.end(), [&](const auto& p) { return p.name == name; }) != 1)
      source.refuse("vertices with one property " + name, "another number of them",
                    header.vertex.line, 1);
  }
  for (const PlyProperty& p : header.vertex.properties)
    if (p.list_count)
      source.refuse("no lists at vertices", printable(p.name), header.vertex.line, 1);
  int lists = 0;
  for (const PlyProperty& p : header.face.properties) {
    const bool corners = p.name == "vertex_indices" || p.name == "vertex_index";
    if (corners != p.list_count.has_value() || (corners && p.type.kind == 'f'))
      source.refuse("faces with one list of integers, vertex_indices", printable(p.name),
                    header.face.line, 1);
    lists += corners;
  }
  if (lists != 1)
    source.refuse("faces with one list vertex_indices", fmt::format("{}", lists), header.face.line,
                  1);
}

PlyHeader ply_header(const Source& source) {
  Words words(source, '\0');
  words.expect("ply");
  PlyHeader header;
  header.form = ply_form(words);
  PlyElement* element = nullptr;
  for (;;) {
    const Word word = words.next();
    if (word.text == "end_header") break;
    if (word.text == "element") {
      const Word name = words.next_in_line();
      if (name.text != "vertex" && name.text != "face")
        words.refuse("element 'vertex' or 'face'", name);
      element = name.text == "vertex" ? &header.vertex : &header.face;
      const bool early = name.text == "face" && header.vertex.line == 0;
      if (element->line != 0 || early) words.refuse("element vertex, then face, once each", name);
      element->line = word.line;
      const Word count = words.next_in_line();
      element->count = words.integer(count, 0, static_cast<std::int64_t>(source.bytes.size()),
                                     "a count that fits the size of the file");
    } else if (word.text == "property") {
      if (element == nullptr) words.refuse("an element before its properties", word);
      element->properties.push_back(ply_property(words));
    } else if (word.text != "comment" && word.text != "obj_info") {
      words.refuse("a line of a PLY header", word);
    }
    words.skip_line();
  }
  words.skip_line();
  header.end = std::min(words.offset() + 1, source.bytes.size());
  header.lines = words.line();
  check_properties(source, header);
  source.check_triangles(header.face.count);
  return header;
}

/// Values of a PLY body one after the other, whatever its form.
class PlyValues {
 public:
  PlyValues(const Source& source, const PlyHeader& header)
      : source_(source),
        form_(header.form),
        words_(source, '\0', header.end, header.lines + 1),
        at_(header.end) {}

  double next(const PlyType& type) {
    if (form_ == PlyForm::Ascii) return words_.number(word_ = words_.next());
    if (source_.bytes.size() - at_ < type.size)
      source_.refuse("data for all elements of the header",
                     fmt::format("the end of the file at byte {}", source_.bytes.size()));
    std::array<unsigned char, 8> raw{};
    std::memcpy(raw.data(), source_.bytes.data() + at_, type.size);
    at_ += type.size;
    const bool host_is_little = std::endian::native == std::endian::little;
    if ((form_ == PlyForm::Little) != host_is_little)
      std::reverse(raw.begin(), raw.begin() + static_cast<std::ptrdiff_t>(type.size));
    return value_of(raw, type);
  }
  bool at_end() { return form_ == PlyForm::Ascii ? words_.at_end() : at_ == source_.bytes.size(); }

  [[noreturn]] void refuse(const std::string& expected, const std::string& seen) const {
    const bool text = form_ == PlyForm::Ascii;
    source_.refuse(expected, seen + (text ? "" : fmt::format(" before byte {}", at_)),
                   text ? word_.line : 0, text ? word_.column : 0);
  }
  int line() const { return word_.line; }

 private:
  template <class T>
  static double as(const std::array<unsigned char, 8>& raw) {
    T value;
    std::memcpy(&value, raw.data(), sizeof value);
    return static_cast<double>(value);
  }
  static double value_of(const std::array<unsigned char, 8>& raw, const PlyType& type) {
    if (type.kind == 'f') return type.size == 4 ? as<float>(raw) : as<double>(raw);
    const bool is_signed = type.kind == 'i';
    if (type.size == 1) return is_signed ? as<std::int8_t>(raw) : as<std::uint8_t>(raw);
    if (type.size == 2) return is_signed ? as<std::int16_t>(raw) : as<std::uint16_t>(raw);
    return is_signed ? as<std::int32_t>(raw) : as<std::uint32_t>(raw);
  }

  const Source& source_;
  PlyForm form_;
  Words words_;
  Word word_;
  std::size_t at_;
};

Vector3d ply_vertex(PlyValues& values, const PlyElement& vertex) {
  Vector3d point = Vector3d::Zero();
  for (const PlyProperty& p : vertex.properties) {
    const double value = values.next(p.type);
    if (!std::isfinite(value)) values.refuse("finite numbers", fmt::format("{}", value));
    if (p.name == "x") point.x() = value;
    if (p.name == "y") point.y() = value;
    if (p.name == "z") point.z() = value;
  }
  return point;
}

Polygon ply_face(PlyValues& values, const PlyHeader& header) {
  Polygon face;
  for (const PlyProperty& p : header.face.properties) {
    if (!p.list_count) {
      values.next(p.type);
      continue;
    }
    const double corners = values.next(*p.list_count);
    if (!(corners >= 3.0 && corners <= most_corners))
      values.refuse(fmt::format("faces of 3 to {} corners", most_corners),
                    fmt::format("one of {}", corners));
    face.corners.resize(std::size_t(corners));
    for (int& corner : face.corners) {
      const double i = values.next(p.type);
      if (!(i >= 0.0 && i < double(header.vertex.count)) || i != std::floor(i))
        values.refuse(fmt::format("number of a vertex (0 .. {})", header.vertex.count - 1),
                      fmt::format("{}", i));
      corner = static_cast<int>(i);
    }
  }
  return face;
}

Soup read_ply(const Source& source) {
  const PlyHeader header = ply_header(source);
  PlyValues values(source, header);
  Soup soup;
  for (std::int64_t i = 0; i < header.vertex.count; ++i)
    soup.points.push_back(ply_vertex(values, header.vertex));
  for (std::int64_t i = 0; i < header.face.count; ++i) {
    Polygon face = ply_face(values, header);
    if (header.form == PlyForm::Ascii) face.line = values.line();
    soup = with_face(std::move(soup), face, source);
  }
  if (!values.at_end())
    values.refuse("the end of the file after the elements of its header", "more");
  return soup;
}

// --- audit --------------------------------------------------------------------------------------

void check_triangles(const Source& source, const Soup& soup) {
  if (soup.faces.empty()) source.refuse("a mesh of triangles", "none");
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    const Vector3d& a = soup.points[static_cast<std::size_t>(soup.faces[f][0])];
    const Vector3d& b = soup.points[static_cast<std::size_t>(soup.faces[f][1])];
    const Vector3d& c = soup.points[static_cast<std::size_t>(soup.faces[f][2])];
    const double longest =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const double twice_area = (b - a).cross(c - a).norm();
    if (!std::isfinite(longest) || longest > 1e30)
      source.refuse("coordinates below 1e15", text(a), soup.line.empty() ? 0 : soup.line[f], 1);
    if (!(twice_area > 1e-7 * longest))
      source.refuse("triangles with an area (height above 1e-7 of the longest edge)",
                    fmt::format("a degenerate one, number {}, at {}", f + 1, text(a)),
                    soup.line.empty() ? 0 : soup.line[f], 1);
  }
}

/// A triangle's edge from `from` to `to`; `across` is its third corner.
struct HalfEdge {
  int from, to, across;
};

std::vector<HalfEdge> half_edges(const Soup& soup) {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * soup.faces.size());
  for (const Face& f : soup.faces)
    for (std::size_t k = 0; k < 3; ++k) edges.push_back({f[k], f[(k + 1) % 3], f[(k + 2) % 3]});
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::pair(a.from, a.to) < std::pair(b.from, b.to);
  });
  return edges;
}

auto range(const std::vector<HalfEdge>& edges, int from, int to) {
  const auto before = [](const HalfEdge& a, const HalfEdge& b) {
    return std::pair(a.from, a.to) < std::pair(b.from, b.to);
  };
  return std::equal_range(edges.begin(), edges.end(), HalfEdge{from, to, 0}, before);
}

/// Whether every edge has one triangle on either side.
bool is_closed(const std::vector<HalfEdge>& edges) {
  return std::all_of(edges.begin(), edges.end(), [&](const HalfEdge& edge) {
    const auto same = range(edges, edge.from, edge.to);
    const auto opposite = range(edges, edge.to, edge.from);
    return same.second - same.first == 1 && opposite.second - opposite.first == 1;
  });
}

/// Refuses edges that are no edges of a surface; the rim is allowed if `open`. Returns its length.
std::size_t check_edges(const Source& source, const Soup& soup, const std::vector<HalfEdge>& edges,
                        bool open) {
  std::size_t rim = 0;
  const HalfEdge* first_of_rim = nullptr;
  const auto place = [&](const HalfEdge& e) {
    return text(soup.points[static_cast<std::size_t>(e.from)]) + " - " +
           text(soup.points[static_cast<std::size_t>(e.to)]);
  };
  for (const HalfEdge& edge : edges) {
    const auto same = range(edges, edge.from, edge.to);
    const auto opposite = range(edges, edge.to, edge.from);
    const auto along = same.second - same.first, against = opposite.second - opposite.first;
    if (along + against > 2)
      source.refuse("at most two triangles at an edge",
                    fmt::format("{} at the edge {}: not manifold", along + against, place(edge)));
    if (along == 2)
      source.refuse("all triangles turned the same way",
                    fmt::format("two that disagree at the edge {}", place(edge)));
    if (against == 0 && rim++ == 0) first_of_rim = &edge;
  }
  if (rim > 0 && !open)
    source.refuse("a closed mesh, or `open = true` for a surface with a rim",
                  fmt::format("{} open edges, the first at {}", rim, place(*first_of_rim)));
  return rim;
}

/// Refuses vertices at which two fans of triangles touch.
void check_fans(const Source& source, const Soup& soup, const std::vector<HalfEdge>& edges) {
  for (std::size_t first = 0; first < edges.size();) {
    const int vertex = edges[first].from;
    std::size_t last = first;
    while (last < edges.size() && edges[last].from == vertex) ++last;
    // walk once around: across(v -> a) is the b of the next v -> b; begin where nothing leads to
    const auto next = [&](const HalfEdge& e) {
      const auto found = range(edges, vertex, e.across);
      return found.first == found.second ? nullptr : &*found.first;
    };
    const HalfEdge* start = &edges[first];
    for (std::size_t i = first; i < last; ++i) {
      const auto before = range(edges, edges[i].to, vertex);
      if (before.first == before.second) start = &edges[i];
    }
    std::size_t walked = 1;
    for (const HalfEdge* e = next(*start); e != nullptr && e != start; e = next(*e)) ++walked;
    if (walked != last - first)
      source.refuse("one fan of triangles at a vertex",
                    fmt::format("two that touch at {}: not manifold",
                                text(soup.points[static_cast<std::size_t>(vertex)])));
    first = last;
  }
}

using HalfEdgeMesh = OpenMesh::TriMesh_ArrayKernelT<>;

/// The same surface as OpenMesh's half-edges, which must take every triangle and count the same
/// rim: a second opinion on the edges and fans above. Its own readers are not used: they keep float
/// only, drop or double what is not manifold in silence, and ask for absurd memory on sound files
/// (an OFF with a comment under its first line).
void check_half_edge_mesh(const Source& source, const Soup& soup, std::size_t rim) {
  omerr().disable();  // what it has to say is reported below, with the place
  HalfEdgeMesh mesh;
  mesh.reserve(soup.points.size(), soup.points.size() + soup.faces.size(), soup.faces.size());
  for (std::size_t i = 0; i < soup.points.size(); ++i) mesh.add_vertex({});
  const auto handle = [](int i) { return OpenMesh::VertexHandle(i); };
  for (const Face& f : soup.faces)
    if (!mesh.add_face(handle(f[0]), handle(f[1]), handle(f[2])).is_valid())
      source.refuse("triangles that join to a surface",
                    fmt::format("one at {} that does not: not manifold",
                                text(soup.points[static_cast<std::size_t>(f[0])])));
  for (const auto v : mesh.vertices())
    if (!mesh.is_manifold(v))
      source.refuse("one fan of triangles at a vertex",
                    fmt::format("more at {}: not manifold",
                                text(soup.points[static_cast<std::size_t>(v.idx())])));
  const auto open_edges = std::count_if(mesh.edges_begin(), mesh.edges_end(),
                                        [&](const auto& e) { return mesh.is_boundary(e); });
  if (static_cast<std::size_t>(open_edges) != rim)
    source.refuse(fmt::format("{} open edges", rim), fmt::format("{} in OpenMesh", open_edges));
}

struct Shell {
  double volume = 0.0;  ///< signed
  Eigen::AlignedBox3d box;
};

std::vector<Shell> shells(const Soup& soup) {
  std::vector<int> parent(soup.points.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int i) {
    while (parent[static_cast<std::size_t>(i)] != i) {
      int& up = parent[static_cast<std::size_t>(i)];
      up = parent[static_cast<std::size_t>(up)];
      i = up;
    }
    return i;
  };
  for (const Face& f : soup.faces)
    for (std::size_t k = 1; k < 3; ++k) parent[static_cast<std::size_t>(root(f[k]))] = root(f[0]);

  const Vector3d origin = soup.points[static_cast<std::size_t>(soup.faces[0][0])];
  std::vector<int> number(soup.points.size(), -1);
  std::vector<Shell> result;
  for (const Face& f : soup.faces) {
    int& id = number[static_cast<std::size_t>(root(f[0]))];
    if (id < 0) {
      id = static_cast<int>(result.size());
      result.emplace_back();
    }
    Shell& shell = result[static_cast<std::size_t>(id)];
    std::array<Vector3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      shell.box.extend(soup.points[static_cast<std::size_t>(f[k])]);
      p[k] = soup.points[static_cast<std::size_t>(f[k])] - origin;
    }
    shell.volume += p[0].cross(p[1]).dot(p[2]) / 6.0;
  }
  return result;
}

void check_outward(const Source& source, const Soup& soup) {
  const std::vector<Shell> all = shells(soup);
  double volume = 0.0;
  for (const Shell& shell : all) volume += shell.volume;
  const std::string expected =
      "triangles that are counter-clockwise seen from outside (volume above 0)";
  if (!(volume > 0.0))
    source.refuse(expected,
                  fmt::format("a flipped mesh, volume {:.6g} in units of the file", volume));
  for (const Shell& cavity : all) {
    if (cavity.volume > 0.0) continue;
    const bool inside = std::any_of(all.begin(), all.end(), [&](const Shell& body) {
      return body.volume > 0.0 && body.box.contains(cavity.box);
    });
    if (!inside)
      source.refuse(expected, fmt::format("a flipped shell between {} and {}",
                                          text(cavity.box.min()), text(cavity.box.max())));
  }
}

void check_size(const Source& source, const Eigen::AlignedBox3d& box,
                const ReadMeshOptions& options) {
  if (!options.travel) return;
  const double part = box.sizes().maxCoeff();
  const double travel = options.travel->maxCoeff();
  const double ratio = part / travel;
  if (ratio <= options.travel_ratio && ratio >= 1.0 / options.travel_ratio) return;

  static const std::array<std::pair<double, const char*>, 4> units = {
      {{25.4, "inch"}, {1000.0, "metre"}, {1.0 / 25.4, "25.4 too much"}, {1e-3, "micrometre"}}};
  std::string guess = "no usual unit explains it";
  for (const auto& [factor, name] : units)
    if (ratio * factor <= 1.0 && ratio * factor >= 1.0 / options.travel_ratio) {
      guess = fmt::format("x {:.6g} ({}) would make it {:.4g} mm", factor, name, part * factor);
      break;
    }
  source.refuse(fmt::format("a part of {:.4g} to {:.4g} mm on a travel of {:.4g} mm (set its unit)",
                            travel / options.travel_ratio, travel * options.travel_ratio, travel),
                fmt::format("{:.4g} x {:.4g} x {:.4g} mm, {:.4g} times too {}: {}", box.sizes().x(),
                            box.sizes().y(), box.sizes().z(), ratio < 1.0 ? 1.0 / ratio : ratio,
                            ratio < 1.0 ? "small" : "large", guess));
}

// --- all of it ----------------------------------------------------------------------------------

std::string contents(const std::filesystem::path& file, std::uintmax_t max_bytes) {
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(file.string(), 0, 0, expected, seen);
  };
  std::error_code problem;
  const auto status = std::filesystem::status(file, problem);
  if (!std::filesystem::exists(status)) refuse("a mesh file", "no such file");
  if (!std::filesystem::is_regular_file(status)) refuse("a mesh file", "something that is no file");
  const std::uintmax_t size = std::filesystem::file_size(file, problem);
  if (problem) refuse("a mesh file", problem.message());
  if (size == 0) refuse("a mesh", "an empty file");
  if (size > max_bytes) refuse(fmt::format("at most {} bytes", max_bytes), fmt::format("{}", size));
  std::string bytes(size, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(stream.gcount()) != size)
    refuse("a file that can be read", fmt::format("{} of {} bytes", stream.gcount(), size));
  return bytes;
}

Soup read_soup(const Source& source, const std::string& kind) {
  if (kind == "stl") return read_stl(source);
  if (kind == "obj") return read_obj(source);
  if (kind == "ply") return read_ply(source);
  if (kind == "off") return read_off(source);
  source.refuse("a mesh file ending in .stl, .obj, .ply or .off", printable("." + kind));
}

Soup without_unused(const Soup& soup) {
  std::vector<int> index(soup.points.size(), -1);
  for (const Face& f : soup.faces)
    for (const int i : f) index[static_cast<std::size_t>(i)] = 0;
  Soup out;
  out.line = soup.line;
  for (std::size_t i = 0; i < index.size(); ++i)
    if (index[i] == 0) {
      index[i] = static_cast<int>(out.points.size());
      out.points.push_back(soup.points[i]);
    }
  for (Face f : soup.faces) {
    for (int& i : f) i = index[static_cast<std::size_t>(i)];
    out.faces.push_back(f);
  }
  return out;
}

Design design_of(const Source& source, const Soup& soup, double unit_mm) {
  Design design;
  design.vertices.resize(static_cast<Eigen::Index>(soup.points.size()), 3);
  design.triangles.resize(static_cast<Eigen::Index>(soup.faces.size()), 3);
  for (std::size_t i = 0; i < soup.points.size(); ++i)
    design.vertices.row(static_cast<Eigen::Index>(i)) = unit_mm * soup.points[i].transpose();
  for (std::size_t f = 0; f < soup.faces.size(); ++f)
    for (int k = 0; k < 3; ++k)
      design.triangles(static_cast<Eigen::Index>(f), k) =
          soup.faces[f][static_cast<std::size_t>(k)];
  design.normals = vertex_normals(design.vertices, design.triangles);
  design.area = vertex_area(design.vertices, design.triangles);
  design.facet_error = facet_error(design.vertices, design.normals, design.triangles);
  design.judged.assign(soup.points.size(), 1);
  for (Eigen::Index i = 0; i < design.normals.rows(); ++i)
    if (!(design.normals.row(i).norm() > 0.5))
      source.refuse("a normal at every vertex",
                    "triangles that cancel at " + text(design.vertices.row(i).transpose()));
  return design;
}

void check_options(const ReadMeshOptions& options) {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (!positive(options.unit_mm))
    throw std::invalid_argument("read_mesh: unit_mm must be positive");
  if (!positive(options.travel_ratio) || options.travel_ratio < 1.0)
    throw std::invalid_argument("read_mesh: travel_ratio must be at least 1");
  if (options.travel && !(options.travel->allFinite() && options.travel->maxCoeff() > 0.0))
    throw std::invalid_argument("read_mesh: travel must be positive and finite");
}

}  // namespace

Design read_mesh(const std::filesystem::path& file, const ReadMeshOptions& options) {
  check_options(options);
  const std::string ending = lower(file.extension().string());
  const std::string kind = ending.empty() ? ending : ending.substr(1);
  // corners are counted in int
  const Source source{file.string(), contents(file, options.max_bytes),
                      std::min<std::int64_t>(options.max_triangles, 700'000'000)};
  const Soup as_written = read_soup(source, kind);
  // bodies that touch share points and are closed without each other
  const bool whole = kind != "stl" && is_closed(half_edges(as_written));
  const Soup soup = without_unused(whole ? as_written : merged(as_written));
  check_triangles(source, soup);
  const std::vector<HalfEdge> edges = half_edges(soup);
  const std::size_t rim = check_edges(source, soup, edges, options.open);
  check_fans(source, soup, edges);
  check_half_edge_mesh(source, soup, rim);
  if (rim == 0) check_outward(source, soup);
  Design design = design_of(source, soup, options.unit_mm);
  Eigen::AlignedBox3d box;
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i)
    box.extend(design.vertices.row(i).transpose());
  check_size(source, box, options);
  return design;
}

}  // namespace abbe::cutting
