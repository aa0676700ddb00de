#include "render/residual_field.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <zlib.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "render/vtk_reader.h"

namespace abbe::render {

namespace {

void check_sizes(const Field& field) {
  const Eigen::Index n = field.design.vertices.rows();
  const auto count = static_cast<std::size_t>(n);
  require(field.deviation_um.size() == n, "residual: one deviation a vertex is needed");
  require(field.cut_time_s.size() == n, "residual: one cut time a vertex is needed");
  require(field.status.size() == count, "residual: one status a vertex is needed");
  require(field.design.area.size() == n, "residual: one area a vertex is needed");
  require(field.within_um.size() == 0 || field.within_um.size() == field.design.triangles.rows(),
          "residual: one value within a triangle is needed, or none");
  require(field.form_um.size() == 0 || field.form_um.size() == n,
          "residual: one form a vertex is needed, or none");
  require(field.tolerance_um.rows() == 0 || field.tolerance_um.rows() == n,
          "residual: limits of every vertex are needed, or of none");
  require(field.cut_line.size() == count, "residual: one program line a vertex is needed");
}

cutting::Surface surface_of(const Field& field) {
  cutting::Surface surface{field.deviation_um * units::um, field.cut_time_s, field.cut_line, {}};
  for (const std::uint8_t status : field.status) {
    const auto vertex = int(surface.status.size());
    surface.status.push_back(cutting::VertexStatus(status));
    if (surface.status.back() == cutting::VertexStatus::Gouged)
      surface.gouges.push_back({vertex, 0.0, true});  // its depth is not in the file
  }
  surface.sampled_within = field.sampled_within;
  surface.within = field.within_um * units::um;
  return surface;
}

}  // namespace

Field field(const cutting::Design& design, const cutting::Surface& surface) {
  Field result{design, surface.residual / units::um, {}, surface.cut_time_s, surface.cut_line};
  result.status.reserve(surface.status.size());
  for (const cutting::VertexStatus s : surface.status) {
    result.status.push_back(static_cast<std::uint8_t>(s));
  }
  result.sampled_within = surface.sampled_within;
  result.within_um = surface.within / units::um;
  check_sizes(result);
  return result;
}

cutting::Statistics statistics(const Field& field, const cutting::ToleranceBands& tolerance) {
  return cutting::statistics(surface_of(field), field.design, tolerance);
}

cutting::Weights weights(const Field& field) {
  return cutting::weights(surface_of(field), field.design);
}

void write_residual(const std::filesystem::path& path, const Field& field, const Facts& facts) {
  check_sizes(field);
  const auto view = [](const auto& values) {
    return std::span<const double>(values.data(), std::size_t(values.size()));
  };
  std::vector<PointArray> arrays = {{"deviation_um", view(field.deviation_um)},
                                    {"status", std::span(field.status)},
                                    {"cut_time_s", view(field.cut_time_s)},
                                    {"cut_line", std::span(field.cut_line)},
                                    {"area_mm2", view(field.design.area)}};
  // Derived values are for viewing only: seven digits suffice.
  Eigen::VectorXf texture_um;
  if (field.form_um.size() > 0) {
    texture_um = (field.deviation_um - field.form_um).cast<float>();
    arrays.push_back({"form_um", view(field.form_um)});
    arrays.push_back(
        {"texture_um", std::span<const float>(texture_um.data(), std::size_t(texture_um.size()))});
  }
  Eigen::VectorXd lower_um, upper_um;
  if (field.tolerance_um.rows() > 0) {
    lower_um = field.tolerance_um.col(0);
    upper_um = field.tolerance_um.col(1);
    arrays.push_back({"lower_um", view(lower_um)});
    arrays.push_back({"upper_um", view(upper_um)});
  }
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> normals =
      field.design.normals.cast<float>();
  // Normals are optional, and viewers shade without them.
  if (normals.rows() == field.design.vertices.rows())
    arrays.push_back(
        {"Normals", std::span<const float>(normals.data(), std::size_t(normals.size())), 3});
  std::vector<PointArray> triangle_arrays;
  if (field.within_um.size() > 0)
    triangle_arrays.push_back(
        {cutting::within_values_name(field.sampled_within), view(field.within_um)});
  write_point_data(path, field.design.vertices, field.design.triangles, arrays, facts,
                   triangle_arrays);
}

void write_stock(const std::filesystem::path& path, const StockField& stock, const Facts& facts) {
  std::vector<std::uint8_t> status;
  std::vector<int> line;
  for (const std::int32_t cut : stock.mesh.line) {
    status.push_back(cut > 0 ? 0 : (cut == 0 ? 1 : 2));
    line.push_back(std::abs(cut));
  }
  const auto view = [](const Eigen::VectorXd& values) {
    return std::span<const double>(values.data(), std::size_t(values.size()));
  };
  write_point_data(path, stock.mesh.vertices_w, stock.mesh.triangles,
                   {{"deviation_um", view(stock.deviation_um)},
                    {"largest_um", view(stock.largest_um)},
                    {"compared", std::span<const std::uint8_t>(stock.compared)},
                    {"finding", std::span<const int>(stock.finding)},
                    {"undercut", std::span<const int>(stock.undercut)},
                    {"kind", std::span<const std::uint8_t>(stock.kind)},
                    {"status", std::span<const std::uint8_t>(status)},
                    {"cut_line", std::span<const int>(line)}},
                   facts);
}

void write_residual(const std::filesystem::path& path, const cutting::Design& design,
                    const cutting::Surface& surface) {
  write_residual(path, field(design, surface));
}

namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view appended = "<AppendedData encoding=\"";

/// Encoding of the appended data: raw bytes, or base64.
enum class Encoding { Raw, Base64 };

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

/// Returns a number of items, each of which takes at least a bit of the file, even if compressed: a
/// larger claim is rejected before memory is allocated.
std::size_t count(const VtkFile& source, const VtkTag& tag, std::string_view name) {
  const std::size_t value = whole_number(source, tag, name);
  if (value / 8 > source.text().size()) {
    source.refuse(tag.at, fmt::format("{} that the file has room for", name),
                  fmt::format("{}", value));
  }
  return value;
}

struct FileParts {
  std::size_t points = 0;
  std::size_t triangles = 0;
  bool compressed = false;              ///< by zlib
  std::map<std::string, Block> blocks;  ///< "PointData/deviation_um"
};

/// Returns the layout of the file. @param head  the text up to the data
FileParts file_parts(const VtkFile& source, std::string_view head) {
  FileParts result;
  int pieces = 0;
  bool vtk_file = false;
  std::string section;
  // Text before the first tag means that the file is not XML.
  if (head.find_first_not_of(xml_blank) != head.find('<'))
    source.refuse(0, "a tag of a VTK XML file", shown(head));
  VtkTags tags(source, head);
  while (const std::optional<VtkTag> tag = tags.next()) {
    if (tag->inner.find_first_not_of(xml_blank) != std::string_view::npos)
      source.refuse(tag->at, "a tag of a VTK XML file", shown(tag->inner));
    if (tag->name == "VTKFile") {
      vtk_file = true;
      // Only the form that this program writes is read, and every other is rejected by its first
      // difference.
      expect(source, *tag, "type", "PolyData");
      expect(source, *tag, "byte_order", "LittleEndian");
      expect(source, *tag, "header_type", "UInt64");
      if (tag->attributes.contains("compressor")) {
        expect(source, *tag, "compressor", "vtkZLibDataCompressor");
        result.compressed = true;
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
  if (!vtk_file) source.throw_file_error("a VTK XML PolyData file", "no VTKFile tag");
  if (pieces != 1) source.throw_file_error("one Piece", std::to_string(pieces));
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

/// Returns exactly `size` bytes from base64 text of matching length; empty if it is invalid.
std::optional<std::string> decoded(std::string_view text, std::size_t size) {
  static constexpr std::array<std::int8_t, 256> table = sextets();
  // Three bytes take four letters, with padding at the end.
  if (text.size() != (size + 2) / 3 * 4) return std::nullopt;
  std::string bytes;
  bytes.reserve(size + 2);
  const std::size_t padding = (3 - size % 3) % 3;
  for (std::size_t i = 0; i < text.size(); i += 4) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t at = i + k;
      int sextet = table[static_cast<unsigned char>(text[at])];
      // The padding must consist of exactly the expected equals signs.
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
  Data(const VtkFile& source, std::string_view text, Encoding encoding, const FileParts& parts)
      : source_(source), text_(text), encoding_(encoding), parts_(parts) {}

  /// Returns the `n` numbers of a named array, whose stated VTK type must be `type`.
  template <class T>
  std::vector<T> array(const std::string& name, std::string_view type, std::size_t n) const {
    const auto found = parts_.blocks.find(name);
    if (found == parts_.blocks.end()) source_.throw_file_error("array " + name, "none");
    const Block& block = found->second;
    if (block.type != type) {
      source_.refuse(block.at, fmt::format("{} of type {}", name, type), shown(block.type));
    }
    const std::uint64_t size = n * sizeof(T);
    if (parts_.compressed) return values<T>(inflated(name, block, size), n);
    const std::string bytes = bytes_at(name, block, block.offset, sizeof size + size);
    // VTK writes the length in front of the data.
    std::uint64_t stated = 0;
    std::memcpy(&stated, bytes.data(), sizeof stated);
    if (stated != size)
      source_.refuse(block.at, fmt::format("{} with {} bytes of data", name, size),
                     fmt::format("{} bytes", stated));
    return values<T>(bytes.substr(sizeof stated), n);
  }

  /// Returns whole numbers of 32 bits, or of 64 bits as in earlier files.
  std::vector<std::int64_t> indices(const std::string& name, std::size_t n) const {
    const auto found = parts_.blocks.find(name);
    if (found != parts_.blocks.end() && found->second.type == "Int64")
      return array<std::int64_t>(name, "Int64", n);
    const auto narrow = array<std::int32_t>(name, "Int32", n);
    return {narrow.begin(), narrow.end()};
  }

  bool has(const std::string& name) const { return parts_.blocks.contains(name); }

 private:
  template <class T>
  static std::vector<T> values(const std::string& bytes, std::size_t n) {
    std::vector<T> values(n);
    // memcpy() must not be called with null pointers, even for no bytes.
    if (n > 0) std::memcpy(values.data(), bytes.data(), n * sizeof(T));
    return values;
  }

  /// Returns the length of so many bytes in the file.
  std::size_t decoded_size(std::size_t size) const {
    return encoding_ == Encoding::Raw ? size : (size + 2) / 3 * 4;
  }

  /// Returns the bytes at a position of the data.
  std::string bytes_at(const std::string& name, const Block& block, std::size_t at,
                       std::size_t size) const {
    const std::size_t length = decoded_size(size);
    const std::string expected = fmt::format("{} with {} bytes of data", name, size);
    // The subtraction in this order cannot overflow.
    if (at > text_.size() || length > text_.size() - at)
      source_.refuse(block.at, expected, "the end of the data");
    if (encoding_ == Encoding::Raw) return std::string(text_.substr(at, length));
    std::optional<std::string> bytes = decoded(text_.substr(at, length), size);
    if (!bytes) source_.refuse(block.at, expected, "data of another length or not base64");
    return *std::move(bytes);
  }

  /// Returns an array compressed by zlib in blocks: the number of blocks, the size of one and of
  /// the last (0 if it is full), the compressed size of each; then the blocks.
  std::string inflated(const std::string& name, const Block& block, std::uint64_t size) const {
    const auto refuse = [&](const char* seen) {
      source_.refuse(block.at,
                     fmt::format("{} with {} bytes of data in blocks of zlib", name, size), seen);
    };
    constexpr std::size_t word = sizeof(std::uint64_t);
    if (size == 0) return {};
    std::array<std::uint64_t, 3> head{};
    // Three words are sixteen groups of base64 without padding, however many follow.
    std::memcpy(head.data(), bytes_at(name, block, block.offset, 3 * word).data(), 3 * word);
    const auto [blocks, whole, last] = head;
    // Every claim is checked against the text present before memory is allocated for it.
    if (blocks == 0 || blocks > text_.size() || whole == 0 || last >= whole)
      refuse("another head of them");
    if (whole > size && blocks > 1) refuse("blocks larger than that");
    const std::uint64_t last_block_size = last == 0 ? whole : last;
    if ((blocks - 1) > size / whole || (blocks - 1) * whole + last_block_size != size)
      refuse("blocks of another size together");
    const std::size_t head_size = (3 + blocks) * word;
    const std::string sizes = bytes_at(name, block, block.offset, head_size);
    std::vector<std::uint64_t> packed(blocks);
    std::memcpy(packed.data(), sizes.data() + 3 * word, blocks * word);
    std::uint64_t sum = 0;
    for (const std::uint64_t one : packed) {
      if (one > text_.size() - sum) refuse("the end of the data");
      sum += one;
    }
    const std::string data =
        bytes_at(name, block, block.offset + decoded_size(head_size), std::size_t(sum));
    std::string all(size, '\0');
    std::uint64_t from = 0, to = 0;
    for (std::size_t i = 0; i < blocks; ++i) {
      uLongf room = uLongf(i + 1 < blocks ? whole : last_block_size);
      const uLongf wanted = room;
      const int failed =
          ::uncompress(reinterpret_cast<Bytef*>(all.data() + to), &room,
                       reinterpret_cast<const Bytef*>(data.data() + from), uLong(packed[i]));
      if (failed != Z_OK || room != wanted) refuse("a block that is none");
      from += packed[i];
      to += wanted;
    }
    return all;
  }

  const VtkFile& source_;
  std::string_view text_;
  Encoding encoding_;
  const FileParts& parts_;
};

/// Returns the text between the underscore and the closing tags.
std::string_view data_text(const VtkFile& source, std::string_view tail, Encoding encoding) {
  const std::size_t start = tail.find_first_not_of(xml_blank);
  if (start == std::string_view::npos || tail[start] != '_') {
    source.throw_file_error("an underscore before the data", shown(tail));
  }
  tail.remove_prefix(start + 1);
  // Raw data may contain any byte, so their end is found from the end of the file.
  const std::size_t found =
      encoding == Encoding::Raw ? tail.rfind("</AppendedData>") : tail.find_first_of(" \t\r\n<");
  const std::size_t end = std::min(found, tail.size());
  std::string closing;
  for (const char c : tail.substr(end, 200)) {
    if (xml_blank.find(c) == std::string_view::npos) closing += c;
  }
  if (closing != "</AppendedData></VTKFile>") {
    source.throw_file_error("</AppendedData></VTKFile> after the data", shown(closing));
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
      source.throw_file_error("finite vertices", fmt::format("{} in vertex {}", xyz[i], i / 3));
    }
  }
  return Eigen::Map<const cutting::Points>(xyz.data(), static_cast<Eigen::Index>(n), 3);
}

/// Returns no rows if the file has no normals.
cutting::Points normals(const VtkFile& source, const Data& data, std::size_t n) {
  if (!data.has("PointData/Normals")) return cutting::Points(0, 3);
  const auto xyz = data.array<float>("PointData/Normals", "Float32", 3 * n);
  cutting::Points result(static_cast<Eigen::Index>(n), 3);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::RowVector3d normal(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
    // 1e-3: normals are stored in single precision; a larger error is no normal.
    if (!(std::abs(normal.norm() - 1.0) < 1e-3))
      source.throw_file_error("normals of length 1",
                              fmt::format("{} at vertex {}", normal.norm(), i));
    result.row(static_cast<Eigen::Index>(i)) = normal.normalized();
  }
  return result;
}

cutting::Triangles triangles(const VtkFile& source, const Data& data, const FileParts& parts) {
  const std::size_t m = parts.triangles;
  const auto corner = data.indices("Polys/connectivity", 3 * m);
  const auto end = data.indices("Polys/offsets", m);
  cutting::Triangles result(static_cast<Eigen::Index>(m), 3);
  for (std::size_t i = 0; i < 3 * m; ++i) {
    if (corner[i] < 0 || static_cast<std::uint64_t>(corner[i]) >= parts.points) {
      source.throw_file_error(fmt::format("vertex numbers below {}", parts.points),
                              fmt::format("{} in triangle {}", corner[i], i / 3));
    }
    if (i < m && end[i] != static_cast<std::int64_t>(3 * (i + 1))) {
      source.throw_file_error("triangles only", fmt::format("offset {} at polygon {}", end[i], i));
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
    // Each corner gets a third of its triangle, as in the statistics.
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
      source.throw_file_error("a status of 0, 1, 2 or 3",
                              fmt::format("{} at vertex {}", status, i));
    }
    // A vertex outside the judged region may or may not have been cut.
    const bool fits = status == 0   ? std::isfinite(deviation)
                      : status == 2 ? !std::isinf(deviation)
                                    : std::isnan(deviation);
    if (!fits) {
      source.throw_file_error("a finite deviation where cut, NaN where uncut or gouged",
                              fmt::format("{} with status {} at vertex {}", deviation, status, i));
    }
  }
}

}  // namespace

Field read_residual(const std::filesystem::path& path) {
  const VtkFile source(path, "a residual file");
  const std::size_t head_end = source.text().find(appended);
  if (head_end == std::string_view::npos) {
    source.throw_file_error("a residual.vtp with appended data", shown(source.text()));
  }
  const FileParts parts = file_parts(source, source.text().substr(0, head_end));
  std::string_view tail = source.text().substr(head_end + appended.size());
  const Encoding encoding = tail.starts_with("raw\">") ? Encoding::Raw : Encoding::Base64;
  const std::string_view named = encoding == Encoding::Raw ? "raw\">" : "base64\">";
  if (!tail.starts_with(named))
    source.refuse(head_end, "data encoded as raw or base64", shown(tail));
  tail.remove_prefix(named.size());
  const Data data(source, data_text(source, tail, encoding), encoding, parts);

  Field field;
  const std::size_t n = parts.points;
  field.design.vertices = vertices(source, data, n);
  field.design.triangles = triangles(source, data, parts);
  field.deviation_um = vector(data.array<double>("PointData/deviation_um", "Float64", n));
  field.status = data.array<std::uint8_t>("PointData/status", "UInt8", n);
  field.cut_time_s = vector(data.array<double>("PointData/cut_time_s", "Float64", n));
  field.cut_line = data.array<int>("PointData/cut_line", "Int32", n);
  check_values(source, field);
  if (data.has("PointData/form_um"))
    field.form_um = vector(data.array<double>("PointData/form_um", "Float64", n));
  if (data.has("PointData/lower_um")) {
    field.tolerance_um.resize(Eigen::Index(n), 2);
    field.tolerance_um.col(0) = vector(data.array<double>("PointData/lower_um", "Float64", n));
    field.tolerance_um.col(1) = vector(data.array<double>("PointData/upper_um", "Float64", n));
  }
  for (const auto within : {cutting::Surface::Within::Middle, cutting::Surface::Within::Random}) {
    const std::string name = std::string("CellData/") + cutting::within_values_name(within);
    if (!data.has(name)) continue;
    field.sampled_within = within;
    field.within_um = vector(data.array<double>(name, "Float64", parts.triangles));
  }

  field.design.normals = normals(source, data, n);
  field.design.area = vertex_area(field.design.vertices, field.design.triangles);
  field.design.facet_error = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n));
  for (const std::uint8_t status : field.status) field.design.judged.push_back(status != 2);
  return field;
}

}  // namespace abbe::render
