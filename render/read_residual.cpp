#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "render/field.h"

// VTK's own reader takes a file's word for how much there is to allocate, and aborts on noise. This
// one knows a single layout and believes nothing that the bytes present do not bear out.

namespace abbe::render {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view appended = "<AppendedData encoding=\"base64\">";

struct Element {
  std::string_view name;
  std::map<std::string_view, std::string_view> attributes;
  int line = 0;
};

struct Block {
  std::string_view type;
  std::size_t offset = 0;
  int line = 0;
};

class Source {
 public:
  explicit Source(const std::filesystem::path& path) : path_(path.string()) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error))
      refuse(0, "a residual file", "no such file");
    std::ifstream stream(path, std::ios::binary);
    text_.assign(std::istreambuf_iterator<char>(stream), {});
    if (!stream) refuse(0, "a readable file", "an error while reading");
  }

  [[noreturn]] void refuse(int line, const std::string& expected, const std::string& seen) const {
    throw BadInput(path_, line, 0, expected, seen);
  }

  std::string_view text() const { return text_; }

 private:
  std::string path_;
  std::string text_;
};

std::string shown(std::string_view text) {
  std::string printable;
  for (const char c : text.substr(0, 40)) printable += c >= ' ' && c <= '~' ? c : '?';
  return "\"" + printable + (text.size() > 40 ? "...\"" : "\"");
}

/// Attributes of one tag: name="value" pairs parted by white space.
std::map<std::string_view, std::string_view> attributes(const Source& source, std::string_view text,
                                                        int line) {
  constexpr std::string_view blank = " \t\r\n/?";
  std::map<std::string_view, std::string_view> found;
  for (;;) {
    const std::size_t start = text.find_first_not_of(blank);
    if (start == std::string_view::npos) return found;
    text.remove_prefix(start);
    const std::size_t equals = text.find("=\"");
    const std::size_t end = equals == std::string_view::npos ? equals : text.find('"', equals + 2);
    if (end == std::string_view::npos) {
      source.refuse(line, "attributes as name=\"value\"", shown(text));
    }
    const std::string_view name = text.substr(0, equals);
    if (!found.emplace(name, text.substr(equals + 2, end - equals - 2)).second) {
      source.refuse(line, "every attribute once", shown(name));
    }
    text.remove_prefix(end + 1);
  }
}

/// The tags before the data, in their order; closing ones have a name that begins with '/'.
std::vector<Element> elements(const Source& source, std::string_view head) {
  std::vector<Element> found;
  int line = 1;
  std::size_t at = 0;
  while (at < head.size()) {
    const char c = head[at];
    if (c == '\n') ++line;
    if (c != '<') {
      if (c != ' ' && c != '\n' && c != '\r' && c != '\t') {
        source.refuse(line, "a tag of a VTK XML file", shown(head.substr(at)));
      }
      ++at;
      continue;
    }
    const std::size_t end = head.find('>', at);
    if (end == std::string_view::npos) {
      source.refuse(line, "the end of a tag", shown(head.substr(at)));
    }
    const std::string_view tag = head.substr(at + 1, end - at - 1);
    const std::size_t name_end = std::min(tag.find_first_of(" \t\r\n"), tag.size());
    found.push_back(
        {tag.substr(0, name_end), attributes(source, tag.substr(name_end), line), line});
    line += static_cast<int>(std::count(tag.begin(), tag.end(), '\n'));
    at = end + 1;
  }
  return found;
}

std::string_view attribute(const Source& source, const Element& element, std::string_view name) {
  const auto found = element.attributes.find(name);
  if (found == element.attributes.end()) {
    source.refuse(element.line, fmt::format("attribute {} of {}", name, element.name), "none");
  }
  return found->second;
}

void expect(const Source& source, const Element& element, std::string_view name,
            std::string_view value) {
  const std::string_view seen = attribute(source, element, name);
  if (seen != value) {
    source.refuse(element.line, fmt::format("{}=\"{}\" in {}", name, value, element.name),
                  shown(seen));
  }
}

std::size_t count(const Source& source, const Element& element, std::string_view name) {
  const std::string_view text = attribute(source, element, name);
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  // the file has at least one byte for each of them
  if (error != std::errc() || end != text.data() + text.size() || value > source.text().size()) {
    source.refuse(element.line, fmt::format("{} that the file has room for", name), shown(text));
  }
  return value;
}

struct Layout {
  std::size_t points = 0;
  std::size_t triangles = 0;
  int line = 0;
  std::map<std::string, Block> blocks;  ///< "PointData/deviation_um"
};

Layout layout(const Source& source, const std::vector<Element>& tags) {
  Layout result;
  int pieces = 0;
  bool vtk_file = false;
  std::string section;
  for (const Element& tag : tags) {
    if (tag.name == "VTKFile") {
      vtk_file = true;
      expect(source, tag, "type", "PolyData");
      expect(source, tag, "byte_order", "LittleEndian");
      expect(source, tag, "header_type", "UInt64");
      if (tag.attributes.contains("compressor")) {
        source.refuse(tag.line, "data without compression", shown(tag.attributes.at("compressor")));
      }
    } else if (tag.name == "Piece") {
      ++pieces;
      result.line = tag.line;
      result.points = count(source, tag, "NumberOfPoints");
      result.triangles = count(source, tag, "NumberOfPolys");
      for (const char* other : {"NumberOfVerts", "NumberOfLines", "NumberOfStrips"}) {
        expect(source, tag, other, "0");
      }
    } else if (tag.name == "DataArray") {
      expect(source, tag, "format", "appended");
      const std::string name = section + "/" + std::string(attribute(source, tag, "Name"));
      if (name == "Points/Points") expect(source, tag, "NumberOfComponents", "3");
      const Block block{attribute(source, tag, "type"), count(source, tag, "offset"), tag.line};
      if (!result.blocks.emplace(name, block).second) {
        source.refuse(tag.line, "every array once", shown(name));
      }
    } else if (!tag.name.starts_with('/') && !tag.name.starts_with('?')) {
      section = tag.name;
    }
  }
  if (!vtk_file) source.refuse(1, "a VTK XML PolyData file", "no VTKFile tag");
  if (pieces != 1) source.refuse(1, "one Piece", std::to_string(pieces));
  return result;
}

constexpr std::array<std::int8_t, 256> sextets() {
  constexpr std::string_view letters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<std::int8_t, 256> table{};
  for (auto& entry : table) entry = -1;
  for (std::size_t i = 0; i < letters.size(); ++i) {
    table[static_cast<unsigned char>(letters[i])] = static_cast<std::int8_t>(i);
  }
  return table;
}

/// Exactly `size` bytes from base64 text of just the right length; empty if it is not that.
std::optional<std::string> decoded(std::string_view text, std::size_t size) {
  static constexpr std::array<std::int8_t, 256> table = sextets();
  if (text.size() != (size + 2) / 3 * 4) return std::nullopt;
  std::string bytes;
  bytes.reserve(size + 2);
  const std::size_t padding = (3 - size % 3) % 3;
  for (std::size_t i = 0; i < text.size(); i += 4) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t at = i + k;
      int sextet = table[static_cast<unsigned char>(text[at])];
      if (at + padding >= text.size()) sextet = text[at] == '=' ? 0 : -1;
      if (sextet < 0) return std::nullopt;
      group = (group << 6u) | static_cast<std::uint32_t>(sextet);
    }
    bytes += static_cast<char>(group >> 16u);
    bytes += static_cast<char>(group >> 8u);
    bytes += static_cast<char>(group);
  }
  bytes.resize(size);
  return bytes;
}

class Data {
 public:
  Data(const Source& source, std::string_view text, const Layout& layout)
      : source_(source), text_(text), layout_(layout) {}

  /// The `n` numbers of a named array, which the file must tell to be of VTK type `type`.
  template <class T>
  std::vector<T> array(const std::string& name, std::string_view type, std::size_t n) const {
    const auto found = layout_.blocks.find(name);
    if (found == layout_.blocks.end()) source_.refuse(0, "array " + name, "none");
    const Block& block = found->second;
    if (block.type != type) {
      source_.refuse(block.line, fmt::format("{} of type {}", name, type), shown(block.type));
    }
    const std::uint64_t size = n * sizeof(T);
    const std::size_t length = (sizeof size + size + 2) / 3 * 4;
    const std::string expected = fmt::format("{} with {} bytes of data", name, size);
    if (block.offset > text_.size() || length > text_.size() - block.offset) {
      source_.refuse(block.line, expected, "the end of the data");
    }
    const auto bytes = decoded(text_.substr(block.offset, length), sizeof size + size);
    if (!bytes) source_.refuse(block.line, expected, "data of another length or not base64");
    std::uint64_t told = 0;
    std::memcpy(&told, bytes->data(), sizeof told);
    if (told != size) source_.refuse(block.line, expected, fmt::format("{} bytes", told));
    std::vector<T> values(n);
    if (n > 0) std::memcpy(values.data(), bytes->data() + sizeof told, size);
    return values;
  }

 private:
  const Source& source_;
  std::string_view text_;
  const Layout& layout_;
};

/// What stands between the underscore and the closing tags.
std::string_view data_text(const Source& source, std::string_view tail) {
  constexpr std::string_view blank = " \t\r\n";
  const std::size_t start = tail.find_first_not_of(blank);
  if (start == std::string_view::npos || tail[start] != '_') {
    source.refuse(0, "an underscore before the data", shown(tail));
  }
  tail.remove_prefix(start + 1);
  const std::size_t end = std::min(tail.find_first_of(" \t\r\n<"), tail.size());
  std::string closing;
  for (const char c : tail.substr(end, 200)) {
    if (blank.find(c) == std::string_view::npos) closing += c;
  }
  if (closing != "</AppendedData></VTKFile>") {
    source.refuse(0, "</AppendedData></VTKFile> after the data", shown(closing));
  }
  return tail.substr(0, end);
}

Eigen::VectorXd vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

cutting::Points vertices(const Source& source, const Data& data, std::size_t n) {
  const auto xyz = data.array<double>("Points/Points", "Float64", 3 * n);
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    if (!std::isfinite(xyz[i])) {
      source.refuse(0, "finite vertices", fmt::format("{} in vertex {}", xyz[i], i / 3));
    }
  }
  return Eigen::Map<const cutting::Points>(xyz.data(), static_cast<Eigen::Index>(n), 3);
}

cutting::Triangles triangles(const Source& source, const Data& data, const Layout& layout) {
  const std::size_t m = layout.triangles;
  const auto corner = data.array<std::int64_t>("Polys/connectivity", "Int64", 3 * m);
  const auto end = data.array<std::int64_t>("Polys/offsets", "Int64", m);
  cutting::Triangles result(static_cast<Eigen::Index>(m), 3);
  for (std::size_t i = 0; i < 3 * m; ++i) {
    if (corner[i] < 0 || static_cast<std::uint64_t>(corner[i]) >= layout.points) {
      source.refuse(0, fmt::format("vertex numbers below {}", layout.points),
                    fmt::format("{} in triangle {}", corner[i], i / 3));
    }
    if (i < m && end[i] != static_cast<std::int64_t>(3 * (i + 1))) {
      source.refuse(0, "triangles only", fmt::format("offset {} at polygon {}", end[i], i));
    }
    result.data()[i] = static_cast<int>(corner[i]);
  }
  return result;
}

Eigen::VectorXd vertex_area(const cutting::Points& points, const cutting::Triangles& triangles) {
  Eigen::VectorXd area = Eigen::VectorXd::Zero(points.rows());
  for (const auto& t : triangles.rowwise()) {
    const Eigen::Vector3d a = points.row(t[0]);
    const Eigen::Vector3d b = points.row(t[1]);
    const Eigen::Vector3d c = points.row(t[2]);
    const double third = (b - a).cross(c - a).norm() / 6.0;
    for (const int corner : t) area[corner] += third;
  }
  return area;
}

void check_values(const Source& source, const Field& field) {
  for (std::size_t i = 0; i < field.status.size(); ++i) {
    const double deviation = field.deviation_um[static_cast<Eigen::Index>(i)];
    const int status = field.status[i];
    if (status > 3) {
      source.refuse(0, "a status of 0, 1, 2 or 3", fmt::format("{} at vertex {}", status, i));
    }
    const bool fits = status == 0   ? std::isfinite(deviation)
                      : status == 2 ? !std::isinf(deviation)
                                    : std::isnan(deviation);
    if (!fits) {
      source.refuse(0, "a finite deviation where cut, NaN where uncut or gouged",
                    fmt::format("{} with status {} at vertex {}", deviation, status, i));
    }
  }
}

}  // namespace

Field read_residual(const std::filesystem::path& path) {
  const Source source(path);
  const std::size_t head_end = source.text().find(appended);
  if (head_end == std::string_view::npos) {
    source.refuse(0, "a residual.vtp with appended base64 data", shown(source.text()));
  }
  const Layout parts = layout(source, elements(source, source.text().substr(0, head_end)));
  const Data data(source, data_text(source, source.text().substr(head_end + appended.size())),
                  parts);

  Field field;
  const std::size_t n = parts.points;
  field.design.vertices = vertices(source, data, n);
  field.design.triangles = triangles(source, data, parts);
  field.deviation_um = vector(data.array<double>("PointData/deviation_um", "Float64", n));
  field.status = data.array<std::uint8_t>("PointData/status", "UInt8", n);
  field.cut_time_s = vector(data.array<double>("PointData/cut_time_s", "Float64", n));
  field.cut_line = data.array<int>("PointData/cut_line", "Int32", n);
  check_values(source, field);

  field.design.normals.resize(0, 3);
  field.design.area = vertex_area(field.design.vertices, field.design.triangles);
  field.design.facet_error = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n));
  for (const std::uint8_t status : field.status) field.design.judged.push_back(status != 2);
  return field;
}

}  // namespace abbe::render
