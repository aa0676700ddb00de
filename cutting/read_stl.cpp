#include "cutting/read_stl.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cutting/face_marker.h"
#include "cutting/mesh_words.h"
#include "kinematics/text.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

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

/// How a binary STL writes the colour of a facet in the 16 bits of its attribute.
struct StlColours {
  bool of_magics = false;           ///< blue is highest, and a set 16th bit means the whole's
  std::optional<FaceColour> whole;  ///< of the header

  std::optional<FaceColour> of(std::uint16_t attribute) const {
    const bool is_set = (attribute & 0x8000) != 0;
    if (is_set == of_magics) return whole;
    const auto five_bits = [&](int shift) { return int(attribute >> shift) & 31; };
    Rgb channels = {five_bits(10), five_bits(5), five_bits(0)};
    if (of_magics) std::swap(channels[0], channels[2]);
    return FaceColour{channels, FaceColour::Digits::FiveBits};
  }
};

StlColours stl_colours(const MeshSource& source) {
  constexpr std::string_view begin = "COLOR=";
  const std::string_view header = std::string_view(source.bytes).substr(0, stl_header - 4);
  const std::size_t at = header.find(begin);
  if (at == std::string_view::npos) return {};
  const std::string_view rgba = header.substr(at + begin.size()).substr(0, 4);
  if (rgba.size() < 4)
    source.refuse("four bytes of a colour after COLOR= in the header of an STL",
                  fmt::format("its end after {}", rgba.size()));
  StlColours colours{true, FaceColour{}};
  for (std::size_t k = 0; k < 3; ++k)
    colours.whole->channels[k] = static_cast<unsigned char>(rgba[k]);
  return colours;
}

Soup read_binary_stl(const MeshSource& source, const WantedMarks& wanted) {
  const std::size_t count = (source.bytes.size() - stl_header) / stl_facet;
  source.check_triangles(static_cast<std::int64_t>(count));
  const StlColours colours = wanted.colours ? stl_colours(source) : StlColours{};
  FaceMarker marker(source);
  Soup soup;
  for (std::size_t t = 0; t < count; ++t) {
    std::array<float, 12> values;
    std::memcpy(values.data(), source.bytes.data() + stl_header + stl_facet * t, sizeof values);
    // the normal, which comes first, is not needed: exporters write nan there
    for (const float v : std::span(values).subspan(3))
      if (!std::isfinite(v))
        source.refuse("finite numbers", fmt::format("{} in facet {} (counted from 1)", v, t + 1));
    const auto corner = [&](int k) {
      const auto i = static_cast<std::size_t>(3 + 3 * k);
      return Vector3d(values[i], values[i + 1], values[i + 2]);
    };
    add_triangle(soup, {corner(0), corner(1), corner(2)});
    if (!wanted.colours) continue;
    std::array<unsigned char, 2> attribute;  // the lower byte first
    std::memcpy(attribute.data(), source.bytes.data() + stl_header + stl_facet * (t + 1) - 2, 2);
    marker.mark(soup.faces.size(),
                {{}, colours.of(std::uint16_t(attribute[0] | attribute[1] << 8))});
  }
  soup.marks = marker.marks();
  return soup;
}

/// The rest of a facet after its first word.
std::array<Vector3d, 3> ascii_facet(Words& words) {
  words.expect("normal");
  for (int k = 0; k < 3; ++k) words.next();
  words.expect("outer");
  words.expect("loop");
  std::array<Vector3d, 3> corners;
  for (Vector3d& corner : corners) {
    words.expect("vertex");
    corner = words.point();
  }
  words.expect("endloop");
  words.expect("endfacet");
  return corners;
}

Soup read_ascii_stl(const MeshSource& source, const WantedMarks& wanted) {
  Words words(source, '\0');
  FaceMarker marker(source);
  Soup soup;
  do {
    words.expect("solid");
    const std::string name(words.rest_of_line().text);
    FaceMark mark;
    if (wanted.groups && !name.empty()) mark.names = {marker.set_of({name})};
    for (;;) {
      const Word word = words.next();
      if (lower(word.text) == "endsolid") break;
      if (lower(word.text) != "facet") words.refuse("'facet' or 'endsolid'", word);
      add_triangle(soup, ascii_facet(words));
      soup.line.push_back(word.line);
      source.check_triangles(static_cast<std::int64_t>(soup.faces.size()));
      if (wanted.any()) marker.mark(soup.faces.size(), mark);
    }
    words.skip_line();
  } while (!words.at_end());
  soup.marks = marker.marks();
  return soup;
}

}  // namespace

Soup read_stl(const MeshSource& source, const WantedMarks& wanted) {
  if (is_binary_stl(source.bytes)) return read_binary_stl(source, wanted);
  Words words(source, '\0');
  if (lower(words.next().text) == "solid") return read_ascii_stl(source, wanted);
  const std::string expected = "an ascii STL ('solid ...') or a binary one of 84 + 50 n bytes";
  if (source.bytes.size() < stl_header)
    source.refuse(expected, fmt::format("{} bytes that begin {}", source.bytes.size(),
                                        in_quotes(source.bytes)));
  const std::uint64_t claimed = binary_stl_size(source.bytes);
  source.refuse(expected + fmt::format(", {} by its header of n = {}", claimed,
                                       (claimed - stl_header) / stl_facet),
                fmt::format("{} bytes", source.bytes.size()));
}

}  // namespace abbe::cutting
