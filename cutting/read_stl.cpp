#include "cutting/read_stl.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

#include <fmt/format.h>

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

Soup read_binary_stl(const MeshSource& source) {
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

Soup read_ascii_stl(const MeshSource& source) {
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

}  // namespace

Soup read_stl(const MeshSource& source) {
  if (is_binary_stl(source.bytes)) return read_binary_stl(source);
  Words words(source, '\0');
  if (lower(words.next().text) == "solid") return read_ascii_stl(source);
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
