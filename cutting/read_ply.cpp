#include "cutting/read_ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cutting/mesh_words.h"
#include "kinematics/text.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

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

void check_properties(const MeshSource& source, const PlyHeader& header) {
  for (const std::string name : {"x", "y", "z"}) {
    const auto& all = header.vertex.properties;
    if (std::count_if(all.begin(), all.end(), [&](const auto& p) { return p.name == name; }) != 1)
      source.refuse("vertices with one property " + name, "another number of them",
                    header.vertex.line, 1);
  }
  for (const PlyProperty& p : header.vertex.properties)
    if (p.list_count)
      source.refuse("no lists at vertices", in_quotes(p.name), header.vertex.line, 1);
  int lists = 0;
  for (const PlyProperty& p : header.face.properties) {
    const bool corners = p.name == "vertex_indices" || p.name == "vertex_index";
    if (corners != p.list_count.has_value() || (corners && p.type.kind == 'f'))
      source.refuse("faces with one list of integers, vertex_indices", in_quotes(p.name),
                    header.face.line, 1);
    lists += corners;
  }
  if (lists != 1)
    source.refuse("faces with one list vertex_indices", fmt::format("{}", lists), header.face.line,
                  1);
}

PlyHeader ply_header(const MeshSource& source) {
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
  PlyValues(const MeshSource& source, const PlyHeader& header)
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

  const MeshSource& source_;
  PlyForm form_;
  Words words_;
  Word word_;
  std::size_t at_;
};

Vector3d ply_vertex(PlyValues& values, const PlyElement& vertex) {
  Vector3d point = Vector3d::Zero();
  for (const PlyProperty& p : vertex.properties) {
    const double value = values.next(p.type);
    const std::size_t axis = p.name.size() == 1 ? std::string_view("xyz").find(p.name) : 3;
    if (axis > 2) continue;  // a quality that is nan is no fault of the mesh
    if (!std::isfinite(value)) values.refuse("finite numbers", fmt::format("{}", value));
    point[Eigen::Index(axis)] = value;
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

}  // namespace

Soup read_ply(const MeshSource& source) {
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

}  // namespace abbe::cutting
