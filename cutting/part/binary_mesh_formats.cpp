#include "cutting/part/binary_mesh_formats.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cutting/part/mesh_file.h"
#include "kinematics/text.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

/// Encoding of the data of a PLY file: text, or binary with either byte order.
enum class PlyForm { Ascii, Little, Big };

/// Type of a number in a PLY file.
struct PlyType {
  std::size_t size = 0;
  char kind = 'i';  ///< i signed, u unsigned, f floating point
};

/// Property of a PLY element: a number, or a list of numbers with the type of its length.
struct PlyProperty {
  std::string name;
  PlyType type;
  std::optional<PlyType> list_count;

  /// Returns 0, 1, 2 for red, green, blue; empty for any other property.
  std::optional<std::size_t> channel() const {
    constexpr std::array<std::string_view, 3> channel_names = {"red", "green", "blue"};
    const auto name_position = std::ranges::find(channel_names, name);
    if (name_position == channel_names.end() || list_count) return std::nullopt;
    return std::size_t(name_position - channel_names.begin());
  }
  /// Returns true for the list of the vertices of a face.
  bool is_vertex_list() const { return name == "vertex_indices" || name == "vertex_index"; }
  bool is_group() const { return !list_count && type.kind != 'f' && !channel() && name != "alpha"; }
};

/// Element of a PLY file: a table of `count` rows.
struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;
  int line = 0;

  bool has_colour() const {
    return std::ranges::any_of(properties,
                               [](const PlyProperty& p) { return p.channel().has_value(); });
  }
};

/// Content of the header of a PLY file.
struct PlyHeader {
  PlyForm form = PlyForm::Ascii;
  std::vector<PlyElement> elements;  ///< in the order of their data
  std::size_t vertex = 0, face = 0;  ///< indices of these two elements
  std::size_t end = 0;               ///< offset of the data, bytes
  int lines = 0;
};

// PLY has two sets of names for the same types: the original one (char, float) and one with sizes.
PlyType ply_type(const TokenReader& tokens, const Token& token) {
  static const std::map<std::string_view, PlyType> types = {
      {"char", {1, 'i'}},  {"int8", {1, 'i'}},    {"uchar", {1, 'u'}},  {"uint8", {1, 'u'}},
      {"short", {2, 'i'}}, {"int16", {2, 'i'}},   {"ushort", {2, 'u'}}, {"uint16", {2, 'u'}},
      {"int", {4, 'i'}},   {"int32", {4, 'i'}},   {"uint", {4, 'u'}},   {"uint32", {4, 'u'}},
      {"float", {4, 'f'}}, {"float32", {4, 'f'}}, {"double", {8, 'f'}}, {"float64", {8, 'f'}}};
  const auto type = types.find(token.text);
  if (type == types.end()) tokens.refuse("a PLY type (uchar, int, float, double ...)", token);
  return type->second;
}

PlyProperty ply_property(TokenReader& tokens) {
  PlyProperty property;
  Token token = tokens.next_in_line();
  if (token.text == "list") {
    property.list_count = ply_type(tokens, tokens.next_in_line());
    if (property.list_count->kind == 'f')
      tokens.refuse("an integer type for the length of a list", token);
    token = tokens.next_in_line();
  }
  property.type = ply_type(tokens, token);
  property.name = std::string(tokens.next_in_line().text);
  return property;
}

PlyForm ply_form(TokenReader& tokens) {
  tokens.expect("format");
  const Token form = tokens.next_in_line();
  tokens.expect("1.0", tokens.next_in_line());
  if (form.text == "ascii") return PlyForm::Ascii;
  if (form.text == "binary_little_endian") return PlyForm::Little;
  if (form.text == "binary_big_endian") return PlyForm::Big;
  tokens.refuse("'ascii', 'binary_little_endian' or 'binary_big_endian'", form);
}

std::size_t index_of(const MeshSource& source, const PlyHeader& header, std::string_view name) {
  const auto element = std::ranges::find(header.elements, name, &PlyElement::name);
  if (element == header.elements.end())
    source.refuse(fmt::format("element '{}'", name), "none", header.lines, 1);
  return std::size_t(element - header.elements.begin());
}

/// Checks that coordinates and vertex lists are present exactly once; all other properties are
/// permitted.
void check_properties(const MeshSource& source, const PlyElement& vertex, const PlyElement& face) {
  for (const std::string name : {"x", "y", "z"}) {
    const auto& vertex_properties = vertex.properties;
    if (std::count_if(vertex_properties.begin(), vertex_properties.end(),
                      [&](const auto& p) { return p.name == name && !p.list_count; }) != 1)
      source.refuse("vertices with exactly one property " + name, "none or several", vertex.line,
                    1);
  }
  int vertex_lists = 0;
  for (const PlyProperty& p : face.properties) {
    if (!p.is_vertex_list()) continue;
    if (!p.list_count || p.type.kind == 'f')
      source.refuse("faces with vertex_indices as a list of integers", quoted_excerpt(p.name),
                    face.line, 1);
    ++vertex_lists;
  }
  if (vertex_lists != 1)
    source.refuse("faces with exactly one list vertex_indices", fmt::format("{}", vertex_lists),
                  face.line, 1);
}

/// Checks that a colour is complete, and that its channels are all integers or all fractions.
void check_colour(const MeshSource& source, const PlyElement& element) {
  std::array<int, 3> count{};
  int fractions = 0;
  for (const PlyProperty& p : element.properties) {
    if (!p.channel()) continue;
    ++count[*p.channel()];
    fractions += p.type.kind == 'f';
  }
  const std::string expected =
      "one property each for red, green and blue, all integers or all floats";
  if (element.has_colour() && count != std::array{1, 1, 1})
    source.refuse(expected, fmt::format("{}, {} and {}", count[0], count[1], count[2]),
                  element.line, 1);
  if (fractions % 3 != 0) source.refuse(expected, "integers mixed with floats", element.line, 1);
}

PlyHeader ply_header(const MeshSource& source) {
  // A PLY header has no comment character: `comment` is a keyword.
  TokenReader tokens(source, '\0');
  tokens.expect("ply");
  PlyHeader header;
  header.form = ply_form(tokens);
  PlyElement* element = nullptr;
  for (;;) {
    const Token token = tokens.next();
    if (token.text == "end_header") break;
    if (token.text == "element") {
      const Token name = tokens.next_in_line();
      const bool is_repeated =
          std::ranges::find(header.elements, name.text, &PlyElement::name) != header.elements.end();
      // The corners of faces are checked against the number of vertices, so vertices must come
      // first.
      const bool is_before_vertices =
          name.text == "face" && std::ranges::find(header.elements, std::string_view("vertex"),
                                                   &PlyElement::name) == header.elements.end();
      if (name.text.empty() || is_repeated || is_before_vertices)
        tokens.refuse("element vertex, then element face, once each", name);
      element = &header.elements.emplace_back();
      element->name = std::string(name.text);
      element->line = token.line;
      // A count cannot exceed the bytes of the file, so a corrupt header cannot request absurd
      // memory.
      const Token count = tokens.next_in_line();
      element->count = tokens.integer(count, 0, static_cast<std::int64_t>(source.bytes.size()),
                                      "a count that fits the size of the file");
    } else if (token.text == "property") {
      if (element == nullptr) tokens.refuse("an element line before its properties", token);
      element->properties.push_back(ply_property(tokens));
    } else if (token.text != "comment" && token.text != "obj_info") {
      tokens.refuse("a line of a PLY header", token);
    }
    tokens.skip_line();
  }
  tokens.skip_line();
  // Binary data begin right after the line break.
  header.end = std::min(tokens.offset() + 1, source.bytes.size());
  header.lines = tokens.line();
  header.vertex = index_of(source, header, "vertex");
  header.face = index_of(source, header, "face");
  const PlyElement& face = header.elements[header.face];
  check_properties(source, header.elements[header.vertex], face);
  source.check_triangles(face.count);
  return header;
}

/// Reader of the values of a PLY body, for all three encodings.
class PlyValues {
 public:
  PlyValues(const MeshSource& source, const PlyHeader& header)
      : source_(source),
        form_(header.form),
        tokens_(source, '\0', header.end, header.lines + 1),
        offset_(header.end) {}

  double next(const PlyType& type) {
    if (form_ == PlyForm::Ascii) return tokens_.number(token_ = tokens_.next());
    require_bytes(type.size);
    std::array<unsigned char, 8> raw{};
    std::memcpy(raw.data(), source_.bytes.data() + offset_, type.size);
    offset_ += type.size;
    const bool host_is_little = std::endian::native == std::endian::little;
    if ((form_ == PlyForm::Little) != host_is_little)
      std::reverse(raw.begin(), raw.begin() + static_cast<std::ptrdiff_t>(type.size));
    return value_of(raw, type);
  }
  /// Skips a property; only the length of a list is checked.
  void skip(const PlyProperty& p) {
    double count = 1.0;
    if (p.list_count) {
      count = next(*p.list_count);
      if (!(count >= 0.0) || count != std::floor(count))
        refuse("a list length that is an integer of at least 0", fmt::format("{}", count));
    }
    if (form_ != PlyForm::Ascii) {
      // Tested as a double first, because a huge count would overflow the multiplication below.
      if (count > double(source_.bytes.size())) require_bytes(source_.bytes.size());
      require_bytes(std::size_t(count) * p.type.size);
      offset_ += std::size_t(count) * p.type.size;
      return;
    }
    for (; count > 0.0; --count)
      if ((token_ = tokens_.next()).text.empty()) tokens_.refuse("data for all elements", token_);
  }
  bool at_end() {
    return form_ == PlyForm::Ascii ? tokens_.at_end() : offset_ == source_.bytes.size();
  }

  [[noreturn]] void refuse(const std::string& expected, const std::string& seen) const {
    const bool is_text = form_ == PlyForm::Ascii;
    source_.refuse(expected, seen + (is_text ? "" : fmt::format(" before byte {}", offset_)),
                   is_text ? token_.line : 0, is_text ? token_.column : 0);
  }
  int line() const { return token_.line; }

 private:
  void require_bytes(std::size_t bytes) const {
    if (source_.bytes.size() - offset_ < bytes)
      source_.refuse("data for all elements listed in the header",
                     fmt::format("the end of the file at byte {}", source_.bytes.size()));
  }
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
  TokenReader tokens_;
  Token token_;
  std::size_t offset_;
};

/// Collector of the channels of a colour, in any order.
struct PlyColour {
  std::optional<FaceColour> colour;

  void add(const PlyValues& values, const PlyProperty& p, double value) {
    if (!colour) colour = FaceColour{};
    const bool is_fraction = p.type.kind == 'f';
    if (!(value >= 0.0 && value <= (is_fraction ? 1.0 : 255.0)) ||
        (!is_fraction && value != std::floor(value)))
      values.refuse(is_fraction ? "a channel from 0 to 1" : "an integer channel from 0 to 255",
                    fmt::format("{} for {}", value, p.name));
    colour->channel_format =
        is_fraction ? FaceColour::ChannelFormat::Fraction : FaceColour::ChannelFormat::EightBits;
    colour->channels[*p.channel()] = int(std::lround(is_fraction ? 255.0 * value : value));
  }
};

/// Reader of a PLY file with the requested marks.
class PlyReader {
 public:
  PlyReader(const MeshSource& source, const MarkSelection& requested_marks)
      : source_(source),
        requested_marks_(requested_marks),
        header_(ply_header(source)),
        values_(source, header_),
        mark_collector_(source) {
    if (!requested_marks_.colours) return;
    check_colour(source, face_);
    if (!face_.has_colour()) check_colour(source, vertex_);
  }

  TriangleSoup read() {
    for (const PlyElement& element : header_.elements)
      for (std::int64_t i = 0; i < element.count; ++i) {
        if (&element == &vertex_)
          add_vertex();
        else if (&element == &face_)
          add_face();
        else
          for (const PlyProperty& p : element.properties) values_.skip(p);
      }
    if (!values_.at_end())
      values_.refuse("the end of the file after the elements listed in its header", "more data");
    soup_.marks = mark_collector_.marks();
    return std::move(soup_);
  }

 private:
  void add_vertex() {
    const bool wants_colour =
        requested_marks_.colours && !face_.has_colour() && vertex_.has_colour();
    Vector3d point = Vector3d::Zero();
    PlyColour colour;
    for (const PlyProperty& p : vertex_.properties) {
      const std::size_t axis = p.name.size() == 1 ? std::string_view("xyz").find(p.name) : 3;
      const bool is_colour = wants_colour && p.channel();
      if (p.list_count || (axis > 2 && !is_colour)) {
        values_.skip(p);
        continue;
      }
      const double value = values_.next(p.type);
      if (is_colour) colour.add(values_, p, value);
      if (axis > 2) continue;
      if (!std::isfinite(value)) values_.refuse("finite numbers", fmt::format("{}", value));
      point[Eigen::Index(axis)] = value;
    }
    soup_.points.push_back(point);
    if (wants_colour) colours_.push_back(colour.colour);
  }

  void add_face() {
    Polygon face;
    PlyColour colour;
    FaceMark mark;
    const auto& properties = face_.properties;
    for (std::size_t k = 0; k < properties.size(); ++k) {
      const PlyProperty& p = properties[k];
      if (p.is_vertex_list()) {
        face.corners = corners(p);
        continue;
      }
      const bool is_colour = requested_marks_.colours && p.channel();
      if (!is_colour && !(requested_marks_.groups && p.is_group())) {
        values_.skip(p);
        continue;
      }
      const double value = values_.next(p.type);
      if (is_colour) colour.add(values_, p, value);
      if (requested_marks_.groups && p.is_group()) mark.name_set_indices.push_back(group(k, value));
    }
    if (header_.form == PlyForm::Ascii) face.line = values_.line();
    soup_ = append_face(std::move(soup_), face, source_);
    if (!requested_marks_.any()) return;
    mark.colour = colour.colour ? colour.colour : common_corner_colour(colours_, face.corners);
    mark_collector_.mark(soup_.faces.size(), mark);
  }

  std::vector<int> corners(const PlyProperty& p) {
    const double count = values_.next(*p.list_count);
    if (!(count >= 3.0 && count <= max_corners))
      values_.refuse(fmt::format("a face of 3 to {} corners", max_corners),
                     fmt::format("{} corners", count));
    std::vector<int> corners(static_cast<std::size_t>(count));
    for (int& corner : corners) {
      const double i = values_.next(p.type);
      if (!(i >= 0.0 && i < double(vertex_.count)) || i != std::floor(i))
        values_.refuse(fmt::format("a vertex index (0 to {})", vertex_.count - 1),
                       fmt::format("{}", i));
      corner = static_cast<int>(i);
    }
    return corners;
  }

  /// Returns the index of the set of names for a value of a property.
  int group(std::size_t property, double value) {
    const auto [entry, is_new] = groups_.emplace(std::pair(property, value), -1);
    const std::string& name = face_.properties[property].name;
    if (is_new) entry->second = mark_collector_.name_set_index({fmt::format("{} {}", name, value)});
    return entry->second;
  }

  const MeshSource& source_;
  MarkSelection requested_marks_;
  PlyHeader header_;
  const PlyElement &vertex_ = header_.elements[header_.vertex],
                   &face_ = header_.elements[header_.face];
  PlyValues values_;
  FaceMarkCollector mark_collector_;
  TriangleSoup soup_;
  std::vector<std::optional<FaceColour>> colours_;  // of the vertices, if faces have none
  std::map<std::pair<std::size_t, double>, int> groups_;
};

}  // namespace

TriangleSoup read_ply(const MeshSource& source, const MarkSelection& requested_marks) {
  return PlyReader(source, requested_marks).read();
}

namespace {

// Sizes in bytes: the header has 80 bytes of text and a count, a facet 12 floats and an attribute
// of 16 bits.
constexpr std::size_t stl_header = 84, stl_facet = 50;

std::uint64_t binary_stl_size(const std::string& bytes) {
  std::uint32_t count = 0;
  if (bytes.size() >= stl_header) std::memcpy(&count, bytes.data() + 80, 4);
  return stl_header + stl_facet * std::uint64_t{count};
}

// The size of the file decides, because many binary files begin with "solid" like ascii ones.
bool is_binary_stl(const std::string& bytes) {
  return bytes.size() >= stl_header && bytes.size() == binary_stl_size(bytes);
}

void add_triangle(TriangleSoup& soup, const std::array<Vector3d, 3>& corners) {
  const int first_point = static_cast<int>(soup.points.size());
  soup.points.insert(soup.points.end(), corners.begin(), corners.end());
  soup.faces.push_back({first_point, first_point + 1, first_point + 2});
}

/// The encoding of the colour of a facet in the 16 bits of its attribute.
struct StlColours {
  bool is_magics = false;  ///< blue is highest, and a set 16th bit means the colour of the header
  std::optional<FaceColour> header_colour;

  std::optional<FaceColour> of(std::uint16_t attribute) const {
    const bool is_set = (attribute & 0x8000) != 0;
    // VisCAM: a clear bit means no colour; Magics: a set bit means that of the header.
    if (is_set == is_magics) return header_colour;
    const auto five_bits = [&](int shift) { return int(attribute >> shift) & 31; };
    Rgb channels = {five_bits(10), five_bits(5), five_bits(0)};
    if (is_magics) std::swap(channels[0], channels[2]);
    return FaceColour{channels, FaceColour::ChannelFormat::FiveBits};
  }
};

/// Returns the encoding of the colours of a binary STL file from its header.
StlColours stl_colours(const MeshSource& source) {
  constexpr std::string_view begin = "COLOR=";
  const std::string_view header = std::string_view(source.bytes).substr(0, stl_header - 4);
  const std::size_t at = header.find(begin);
  if (at == std::string_view::npos) return {};
  const std::string_view rgba = header.substr(at + begin.size()).substr(0, 4);
  if (rgba.size() < 4)
    source.refuse("four colour bytes after COLOR= in the header of the STL file",
                  fmt::format("the end of the header after {}", rgba.size()));
  StlColours colours{true, FaceColour{}};
  for (std::size_t k = 0; k < 3; ++k)
    colours.header_colour->channels[k] = static_cast<unsigned char>(rgba[k]);
  return colours;
}

TriangleSoup read_binary_stl(const MeshSource& source, const MarkSelection& requested_marks) {
  const std::size_t count = (source.bytes.size() - stl_header) / stl_facet;
  source.check_triangles(static_cast<std::int64_t>(count));
  const StlColours colours = requested_marks.colours ? stl_colours(source) : StlColours{};
  FaceMarkCollector collector(source);
  TriangleSoup soup;
  for (std::size_t t = 0; t < count; ++t) {
    std::array<float, 12> values;
    std::memcpy(values.data(), source.bytes.data() + stl_header + stl_facet * t, sizeof values);
    // The normal at the beginning is ignored; some exporters write nan there.
    for (const float v : std::span(values).subspan(3))
      if (!std::isfinite(v))
        source.refuse("finite numbers", fmt::format("{} in facet {} (counted from 1)", v, t + 1));
    const auto corner = [&](int k) {
      const auto i = static_cast<std::size_t>(3 + 3 * k);
      return Vector3d(values[i], values[i + 1], values[i + 2]);
    };
    add_triangle(soup, {corner(0), corner(1), corner(2)});
    if (!requested_marks.colours) continue;
    std::array<unsigned char, 2> attribute;  // lower byte first
    std::memcpy(attribute.data(), source.bytes.data() + stl_header + stl_facet * (t + 1) - 2, 2);
    collector.mark(soup.faces.size(),
                   {{}, colours.of(std::uint16_t(attribute[0] | attribute[1] << 8))});
  }
  soup.marks = collector.marks();
  return soup;
}

/// Reads a facet after its first keyword.
std::array<Vector3d, 3> ascii_facet(TokenReader& tokens) {
  tokens.expect("normal");
  for (int k = 0; k < 3; ++k) tokens.next();
  tokens.expect("outer");
  tokens.expect("loop");
  std::array<Vector3d, 3> corners;
  for (Vector3d& corner : corners) {
    tokens.expect("vertex");
    corner = tokens.point();
  }
  tokens.expect("endloop");
  tokens.expect("endfacet");
  return corners;
}

TriangleSoup read_ascii_stl(const MeshSource& source, const MarkSelection& requested_marks) {
  TokenReader tokens(source, '\0');
  FaceMarkCollector collector(source);
  TriangleSoup soup;
  do {
    tokens.expect("solid");
    const std::string name(tokens.remaining_line().text);
    FaceMark mark;
    if (requested_marks.groups && !name.empty())
      mark.name_set_indices = {collector.name_set_index({name})};
    for (;;) {
      const Token token = tokens.next();
      if (lower(token.text) == "endsolid") break;
      if (lower(token.text) != "facet") tokens.refuse("'facet' or 'endsolid'", token);
      add_triangle(soup, ascii_facet(tokens));
      soup.line.push_back(token.line);
      source.check_triangles(static_cast<std::int64_t>(soup.faces.size()));
      if (requested_marks.any()) collector.mark(soup.faces.size(), mark);
    }
    tokens.skip_line();
  } while (!tokens.at_end());
  soup.marks = collector.marks();
  return soup;
}

}  // namespace

TriangleSoup read_stl(const MeshSource& source, const MarkSelection& requested_marks) {
  if (is_binary_stl(source.bytes)) return read_binary_stl(source, requested_marks);
  TokenReader tokens(source, '\0');
  if (lower(tokens.next().text) == "solid") return read_ascii_stl(source, requested_marks);
  const std::string expected =
      "an ASCII STL file ('solid ...') or a binary STL file of 84 + 50 n bytes";
  if (source.bytes.size() < stl_header)
    source.refuse(expected, fmt::format("{} bytes that begin with {}", source.bytes.size(),
                                        quoted_excerpt(source.bytes)));
  const std::uint64_t expected_size = binary_stl_size(source.bytes);
  source.refuse(expected + fmt::format(" ({} bytes for n = {} in its header)", expected_size,
                                       (expected_size - stl_header) / stl_facet),
                fmt::format("{} bytes", source.bytes.size()));
}

}  // namespace abbe::cutting
