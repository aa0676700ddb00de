#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "render/field.h"
#include "render/vtk_xml.h"

namespace abbe::render {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view appended = "<AppendedData encoding=\"base64\">";

struct Block {
  std::string_view type;
  std::size_t offset = 0;  ///< of its data
  std::size_t at = 0;      ///< of its tag
};

std::string_view required(const VtkFile& source, const VtkTag& tag, std::string_view name) {
  if (!tag.attributes.contains(name))
    source.refuse(tag.at, fmt::format("attribute {} of {}", name, tag.name), "none");
  return tag.attributes.at(name);
}

void expect(const VtkFile& source, const VtkTag& tag, std::string_view name,
            std::string_view value) {
  const std::string_view seen = required(source, tag, name);
  if (seen != value) {
    source.refuse(tag.at, fmt::format("{}=\"{}\" in {}", name, value, tag.name), shown(seen));
  }
}

/// A number of things of which each has at least one byte in the file.
std::size_t count(const VtkFile& source, const VtkTag& tag, std::string_view name) {
  const std::size_t value = whole_number(source, tag, name);
  if (value > source.text().size()) {
    source.refuse(tag.at, fmt::format("{} that the file has room for", name),
                  fmt::format("{}", value));
  }
  return value;
}

struct FileParts {
  std::size_t points = 0;
  std::size_t triangles = 0;
  std::map<std::string, Block> blocks;  ///< "PointData/deviation_um"
};

/// @param head  the text up to the data
FileParts file_parts(const VtkFile& source, std::string_view head) {
  FileParts result;
  int pieces = 0;
  bool vtk_file = false;
  std::string section;
  if (head.find_first_not_of(xml_blank) != head.find('<'))
    source.refuse(0, "a tag of a VTK XML file", shown(head));
  VtkTags tags(source, head);
  while (const std::optional<VtkTag> tag = tags.next()) {
    if (tag->inner.find_first_not_of(xml_blank) != std::string_view::npos)
      source.refuse(tag->at, "a tag of a VTK XML file", shown(tag->inner));
    if (tag->name == "VTKFile") {
      vtk_file = true;
      expect(source, *tag, "type", "PolyData");
      expect(source, *tag, "byte_order", "LittleEndian");
      expect(source, *tag, "header_type", "UInt64");
      if (tag->attributes.contains("compressor")) {
        source.refuse(tag->at, "data without compression", shown(tag->attributes.at("compressor")));
      }
    } else if (tag->name == "Piece") {
      ++pieces;
      result.points = count(source, *tag, "NumberOfPoints");
      result.triangles = count(source, *tag, "NumberOfPolys");
      for (const char* other : {"NumberOfVerts", "NumberOfLines", "NumberOfStrips"}) {
        expect(source, *tag, other, "0");
      }
    } else if (tag->name == "DataArray") {
      expect(source, *tag, "format", "appended");
      const std::string name = section + "/" + std::string(required(source, *tag, "Name"));
      if (name == "Points/Points") expect(source, *tag, "NumberOfComponents", "3");
      const Block block{required(source, *tag, "type"), count(source, *tag, "offset"), tag->at};
      if (!result.blocks.emplace(name, block).second) {
        source.refuse(tag->at, "every array once", shown(name));
      }
    } else if (!tag->name.starts_with('/')) {
      section = tag->name;
    }
  }
  if (!vtk_file) source.refuse_file("a VTK XML PolyData file", "no VTKFile tag");
  if (pieces != 1) source.refuse_file("one Piece", std::to_string(pieces));
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
  Data(const VtkFile& source, std::string_view text, const FileParts& parts)
      : source_(source), text_(text), parts_(parts) {}

  /// The `n` numbers of a named array, which the file must state to be of VTK type `type`.
  template <class T>
  std::vector<T> array(const std::string& name, std::string_view type, std::size_t n) const {
    const auto found = parts_.blocks.find(name);
    if (found == parts_.blocks.end()) source_.refuse_file("array " + name, "none");
    const Block& block = found->second;
    if (block.type != type) {
      source_.refuse(block.at, fmt::format("{} of type {}", name, type), shown(block.type));
    }
    const std::uint64_t size = n * sizeof(T);
    const std::size_t length = (sizeof size + size + 2) / 3 * 4;
    const std::string expected = fmt::format("{} with {} bytes of data", name, size);
    if (block.offset > text_.size() || length > text_.size() - block.offset) {
      source_.refuse(block.at, expected, "the end of the data");
    }
    const auto bytes = decoded(text_.substr(block.offset, length), sizeof size + size);
    if (!bytes) source_.refuse(block.at, expected, "data of another length or not base64");
    std::uint64_t stated = 0;
    std::memcpy(&stated, bytes->data(), sizeof stated);
    if (stated != size) source_.refuse(block.at, expected, fmt::format("{} bytes", stated));
    std::vector<T> values(n);
    if (n > 0) std::memcpy(values.data(), bytes->data() + sizeof stated, size);
    return values;
  }

 private:
  const VtkFile& source_;
  std::string_view text_;
  const FileParts& parts_;
};

/// What stands between the underscore and the closing tags.
std::string_view data_text(const VtkFile& source, std::string_view tail) {
  const std::size_t start = tail.find_first_not_of(xml_blank);
  if (start == std::string_view::npos || tail[start] != '_') {
    source.refuse_file("an underscore before the data", shown(tail));
  }
  tail.remove_prefix(start + 1);
  const std::size_t end = std::min(tail.find_first_of(" \t\r\n<"), tail.size());
  std::string closing;
  for (const char c : tail.substr(end, 200)) {
    if (xml_blank.find(c) == std::string_view::npos) closing += c;
  }
  if (closing != "</AppendedData></VTKFile>") {
    source.refuse_file("</AppendedData></VTKFile> after the data", shown(closing));
  }
  return tail.substr(0, end);
}

Eigen::VectorXd vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

cutting::Points vertices(const VtkFile& source, const Data& data, std::size_t n) {
  const auto xyz = data.array<double>("Points/Points", "Float64", 3 * n);
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    if (!std::isfinite(xyz[i])) {
      source.refuse_file("finite vertices", fmt::format("{} in vertex {}", xyz[i], i / 3));
    }
  }
  return Eigen::Map<const cutting::Points>(xyz.data(), static_cast<Eigen::Index>(n), 3);
}

cutting::Triangles triangles(const VtkFile& source, const Data& data, const FileParts& parts) {
  const std::size_t m = parts.triangles;
  const auto corner = data.array<std::int64_t>("Polys/connectivity", "Int64", 3 * m);
  const auto end = data.array<std::int64_t>("Polys/offsets", "Int64", m);
  cutting::Triangles result(static_cast<Eigen::Index>(m), 3);
  for (std::size_t i = 0; i < 3 * m; ++i) {
    if (corner[i] < 0 || static_cast<std::uint64_t>(corner[i]) >= parts.points) {
      source.refuse_file(fmt::format("vertex numbers below {}", parts.points),
                         fmt::format("{} in triangle {}", corner[i], i / 3));
    }
    if (i < m && end[i] != static_cast<std::int64_t>(3 * (i + 1))) {
      source.refuse_file("triangles only", fmt::format("offset {} at polygon {}", end[i], i));
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

void check_values(const VtkFile& source, const Field& field) {
  for (std::size_t i = 0; i < field.status.size(); ++i) {
    const double deviation = field.deviation_um[static_cast<Eigen::Index>(i)];
    const int status = field.status[i];
    if (status > 3) {
      source.refuse_file("a status of 0, 1, 2 or 3", fmt::format("{} at vertex {}", status, i));
    }
    const bool fits = status == 0   ? std::isfinite(deviation)
                      : status == 2 ? !std::isinf(deviation)
                                    : std::isnan(deviation);
    if (!fits) {
      source.refuse_file("a finite deviation where cut, NaN where uncut or gouged",
                         fmt::format("{} with status {} at vertex {}", deviation, status, i));
    }
  }
}

}  // namespace

Field read_residual(const std::filesystem::path& path) {
  const VtkFile source(path, "a residual file");
  const std::size_t head_end = source.text().find(appended);
  if (head_end == std::string_view::npos) {
    source.refuse_file("a residual.vtp with appended base64 data", shown(source.text()));
  }
  const FileParts parts = file_parts(source, source.text().substr(0, head_end));
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
