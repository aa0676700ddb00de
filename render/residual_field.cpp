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
  require(field.deviation_um.size() == n, "residual: expected one deviation per vertex");
  require(field.cut_time_s.size() == n, "residual: expected one cut time per vertex");
  require(field.status.size() == count, "residual: expected one status per vertex");
  require(field.design.area.size() == n, "residual: expected one area per vertex");
  require(field.within_um.size() == 0 || field.within_um.size() == field.design.triangles.rows(),
          "residual: expected one value per triangle, or none");
  require(field.form_um.size() == 0 || field.form_um.size() == n,
          "residual: expected one form value per vertex, or none");
  require(field.tolerance_um.rows() == 0 || field.tolerance_um.rows() == n,
          "residual: expected limits for every vertex, or none");
  require(field.cut_line.size() == count, "residual: expected one program line per vertex");
}

/// Returns the surface of a field, for the statistics. The depths of gouges are unknown.
cutting::Surface make_surface(const Field& field) {
  cutting::Surface surface{.residual = field.deviation_um * units::um,
                           .cut_time_s = field.cut_time_s,
                           .cut_line = field.cut_line,
                           .status = {}};
  for (const std::uint8_t status : field.status) {
    const auto vertex = int(surface.status.size());
    surface.status.push_back(cutting::VertexStatus(status));
    if (surface.status.back() == cutting::VertexStatus::Gouged)
      surface.gouges.push_back({vertex, 0.0, true});
  }
  surface.interior_sample = field.interior_sample;
  surface.within = field.within_um * units::um;
  return surface;
}

}  // namespace

Field make_field(const cutting::Design& design, const cutting::Surface& surface) {
  Field result{.design = design,
               .deviation_um = surface.residual / units::um,
               .status = {},
               .cut_time_s = surface.cut_time_s,
               .cut_line = surface.cut_line};
  result.status.reserve(surface.status.size());
  for (const cutting::VertexStatus s : surface.status) {
    result.status.push_back(static_cast<std::uint8_t>(s));
  }
  result.interior_sample = surface.interior_sample;
  result.within_um = surface.within / units::um;
  check_sizes(result);
  return result;
}

cutting::Statistics statistics(const Field& field, const cutting::ToleranceBands& tolerance) {
  return cutting::statistics(make_surface(field), field.design, tolerance);
}

cutting::Weights weights(const Field& field) {
  return cutting::weights(make_surface(field), field.design);
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
  // The texture is derived and for viewing only, so single precision suffices.
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
  // Normals are optional.
  if (normals.rows() == field.design.vertices.rows())
    arrays.push_back(
        {"Normals", std::span<const float>(normals.data(), std::size_t(normals.size())), 3});
  std::vector<PointArray> triangle_arrays;
  if (field.within_um.size() > 0)
    triangle_arrays.push_back(
        {cutting::sample_values_name(field.interior_sample), view(field.within_um)});
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
  write_residual(path, make_field(design, surface));
}

namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view appended_data_tag = "<AppendedData encoding=\"";

/// Encoding of the appended data.
enum class Encoding { Raw, Base64 };

/// The appended data of an array.
struct DataBlock {
  std::string_view type;
  std::size_t offset = 0;  ///< of the data
  std::size_t at = 0;      ///< position of the tag, for input errors
};

std::string_view required_attribute(const VtkFile& source, const VtkTag& tag,
                                    std::string_view name) {
  if (!tag.attributes.contains(name))
    source.throw_error_at(tag.at, fmt::format("attribute {} of {}", name, tag.name), "none");
  return tag.attributes.at(name);
}

void expect_attribute(const VtkFile& source, const VtkTag& tag, std::string_view name,
                      std::string_view value) {
  const std::string_view actual_value = required_attribute(source, tag, name);
  if (actual_value != value) {
    source.throw_error_at(tag.at, fmt::format("{}=\"{}\" in {}", name, value, tag.name),
                          shown(actual_value));
  }
}

/// Returns the attribute that states a number of items. Each item takes at least one bit of the
/// file, even if compressed, so a larger number is an error and no memory is allocated for it.
std::size_t item_count(const VtkFile& source, const VtkTag& tag, std::string_view name) {
  const std::size_t value = whole_number(source, tag, name);
  if (value / 8 > source.text().size()) {
    source.throw_error_at(tag.at, fmt::format("{} that fits into the file", name),
                          fmt::format("{}", value));
  }
  return value;
}

struct ResidualFileLayout {
  std::size_t points = 0;
  std::size_t triangles = 0;
  bool compressed = false;                  ///< by zlib
  std::map<std::string, DataBlock> blocks;  ///< by names such as "PointData/deviation_um"
};

/// Reads the layout of the file.
/// @param head  the text before the appended data
ResidualFileLayout read_residual_layout(const VtkFile& source, std::string_view head) {
  ResidualFileLayout result;
  int pieces = 0;
  bool has_vtk_file_tag = false;
  std::string section;
  // In XML there is no text before the first tag.
  if (head.find_first_not_of(xml_blank) != head.find('<'))
    source.throw_error_at(0, "a tag of a VTK XML file", shown(head));
  VtkTags tags(source, head);
  while (const std::optional<VtkTag> tag = tags.next()) {
    if (tag->inner.find_first_not_of(xml_blank) != std::string_view::npos)
      source.throw_error_at(tag->at, "a tag of a VTK XML file", shown(tag->inner));
    if (tag->name == "VTKFile") {
      has_vtk_file_tag = true;
      // Only the layout written by write_residual() is accepted.
      expect_attribute(source, *tag, "type", "PolyData");
      expect_attribute(source, *tag, "byte_order", "LittleEndian");
      expect_attribute(source, *tag, "header_type", "UInt64");
      if (tag->attributes.contains("compressor")) {
        expect_attribute(source, *tag, "compressor", "vtkZLibDataCompressor");
        result.compressed = true;
      }
    } else if (tag->name == "Piece") {
      ++pieces;
      result.points = item_count(source, *tag, "NumberOfPoints");
      result.triangles = item_count(source, *tag, "NumberOfPolys");
      for (const char* other : {"NumberOfVerts", "NumberOfLines", "NumberOfStrips"}) {
        expect_attribute(source, *tag, other, "0");
      }
    } else if (tag->name == "DataArray") {
      expect_attribute(source, *tag, "format", "appended");
      const std::string name =
          section + "/" + std::string(required_attribute(source, *tag, "Name"));
      if (name == "Points/Points") expect_attribute(source, *tag, "NumberOfComponents", "3");
      const DataBlock block{required_attribute(source, *tag, "type"),
                            item_count(source, *tag, "offset"), tag->at};
      if (!result.blocks.emplace(name, block).second) {
        source.throw_error_at(tag->at, "every array at most once", shown(name));
      }
    } else if (!tag->name.starts_with('/')) {
      section = tag->name;
    }
  }
  if (!has_vtk_file_tag) source.throw_file_error("a VTK XML PolyData file", "no VTKFile tag");
  if (pieces != 1) source.throw_file_error("one Piece", std::to_string(pieces));
  return result;
}

/// Returns the value of each base64 letter; -1 for other bytes.
constexpr std::array<std::int8_t, 256> base64_values() {
  constexpr std::string_view letters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<std::int8_t, 256> table{};
  for (auto& entry : table) entry = -1;
  for (std::size_t i = 0; i < letters.size(); ++i) {
    table[static_cast<unsigned char>(letters[i])] = static_cast<std::int8_t>(i);
  }
  return table;
}

/// Decodes base64 text to `size` bytes. Returns nothing if the text is invalid or has another
/// length.
std::optional<std::string> decode_base64(std::string_view text, std::size_t size) {
  static constexpr std::array<std::int8_t, 256> table = base64_values();
  // Three bytes take four letters; the last group is padded.
  if (text.size() != (size + 2) / 3 * 4) return std::nullopt;
  std::string bytes;
  bytes.reserve(size + 2);
  const std::size_t padding = (3 - size % 3) % 3;
  for (std::size_t i = 0; i < text.size(); i += 4) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t position = i + k;
      int sextet = table[static_cast<unsigned char>(text[position])];
      // The padding consists of equals signs.
      if (position + padding >= text.size()) sextet = text[position] == '=' ? 0 : -1;
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

/// Reads the arrays in the appended data of a file.
class AppendedData {
 public:
  AppendedData(const VtkFile& source, std::string_view text, Encoding encoding,
               const ResidualFileLayout& layout)
      : source_(source), text_(text), encoding_(encoding), layout_(layout) {}

  /// Returns the `n` numbers of an array, whose VTK type must be `type`.
  template <class T>
  std::vector<T> array(const std::string& name, std::string_view type, std::size_t n) const {
    const auto entry = layout_.blocks.find(name);
    if (entry == layout_.blocks.end()) source_.throw_file_error("array " + name, "none");
    const DataBlock& block = entry->second;
    if (block.type != type) {
      source_.throw_error_at(block.at, fmt::format("{} of type {}", name, type), shown(block.type));
    }
    const std::uint64_t size = n * sizeof(T);
    if (layout_.compressed) return values<T>(uncompress_blocks(name, block, size), n);
    const std::string bytes = bytes_at(name, block, block.offset, sizeof size + size);
    // VTK writes the length in front of the data.
    std::uint64_t stated_size = 0;
    std::memcpy(&stated_size, bytes.data(), sizeof stated_size);
    if (stated_size != size)
      source_.throw_error_at(block.at, fmt::format("{} with {} bytes of data", name, size),
                             fmt::format("{} bytes", stated_size));
    return values<T>(bytes.substr(sizeof stated_size), n);
  }

  /// Returns integers of 32 bits, or of 64 bits as in files of earlier versions.
  std::vector<std::int64_t> indices(const std::string& name, std::size_t n) const {
    const auto entry = layout_.blocks.find(name);
    if (entry != layout_.blocks.end() && entry->second.type == "Int64")
      return array<std::int64_t>(name, "Int64", n);
    const auto indices_32 = array<std::int32_t>(name, "Int32", n);
    return {indices_32.begin(), indices_32.end()};
  }

  bool has(const std::string& name) const { return layout_.blocks.contains(name); }

 private:
  template <class T>
  static std::vector<T> values(const std::string& bytes, std::size_t n) {
    std::vector<T> values(n);
    // An empty vector may have a null pointer, with which memcpy() must not be called.
    if (n > 0) std::memcpy(values.data(), bytes.data(), n * sizeof(T));
    return values;
  }

  /// Returns the number of characters that `size` bytes occupy in the file.
  std::size_t encoded_size(std::size_t size) const {
    return encoding_ == Encoding::Raw ? size : (size + 2) / 3 * 4;
  }

  /// Returns `size` bytes at an offset of the data.
  std::string bytes_at(const std::string& name, const DataBlock& block, std::size_t offset,
                       std::size_t size) const {
    const std::size_t length = encoded_size(size);
    const std::string expected = fmt::format("{} with {} bytes of data", name, size);
    // The difference cannot overflow, whereas the sum of offset and length could.
    if (offset > text_.size() || length > text_.size() - offset)
      source_.throw_error_at(block.at, expected, "the end of the data");
    if (encoding_ == Encoding::Raw) return std::string(text_.substr(offset, length));
    std::optional<std::string> bytes = decode_base64(text_.substr(offset, length), size);
    if (!bytes)
      source_.throw_error_at(block.at, expected,
                             "data that has a different length or is not base64");
    return *std::move(bytes);
  }

  /// Returns the bytes of an array that is compressed by zlib in blocks. In front of the blocks are
  /// their number, the size of a full block, that of the last one (0 if it is full), and the
  /// compressed size of each.
  std::string uncompress_blocks(const std::string& name, const DataBlock& block,
                                std::uint64_t size) const {
    const auto throw_block_error = [&](const char* problem) {
      source_.throw_error_at(
          block.at, fmt::format("{} with {} bytes of data in zlib blocks", name, size), problem);
    };
    constexpr std::size_t word = sizeof(std::uint64_t);
    if (size == 0) return {};
    std::array<std::uint64_t, 3> head{};
    // In base64, three words are whole groups without padding, so they can be decoded separately.
    std::memcpy(head.data(), bytes_at(name, block, block.offset, 3 * word).data(), 3 * word);
    const auto [blocks, full_size, partial_size] = head;
    // Every stated size is checked before memory is allocated for it.
    if (blocks == 0 || blocks > text_.size() || full_size == 0 || partial_size >= full_size)
      throw_block_error("an invalid block header");
    if (full_size > size && blocks > 1) throw_block_error("larger blocks");
    const std::uint64_t last_block_size = partial_size == 0 ? full_size : partial_size;
    if ((blocks - 1) > size / full_size || (blocks - 1) * full_size + last_block_size != size)
      throw_block_error("blocks of a different total size");
    const std::size_t head_size = (3 + blocks) * word;
    const std::string sizes = bytes_at(name, block, block.offset, head_size);
    std::vector<std::uint64_t> compressed_sizes(blocks);
    std::memcpy(compressed_sizes.data(), sizes.data() + 3 * word, blocks * word);
    std::uint64_t sum = 0;
    for (const std::uint64_t compressed_size : compressed_sizes) {
      if (compressed_size > text_.size() - sum) throw_block_error("the end of the data");
      sum += compressed_size;
    }
    const std::string data =
        bytes_at(name, block, block.offset + encoded_size(head_size), std::size_t(sum));
    std::string result(size, '\0');
    std::uint64_t source_offset = 0, target_offset = 0;
    for (std::size_t i = 0; i < blocks; ++i) {
      const uLongf expected_size = uLongf(i + 1 < blocks ? full_size : last_block_size);
      uLongf block_size = expected_size;
      const int status = ::uncompress(
          reinterpret_cast<Bytef*>(result.data() + target_offset), &block_size,
          reinterpret_cast<const Bytef*>(data.data() + source_offset), uLong(compressed_sizes[i]));
      if (status != Z_OK || block_size != expected_size) throw_block_error("an invalid block");
      source_offset += compressed_sizes[i];
      target_offset += expected_size;
    }
    return result;
  }

  const VtkFile& source_;
  std::string_view text_;
  Encoding encoding_;
  const ResidualFileLayout& layout_;
};

/// Returns the appended data, between the underscore and the closing tags.
std::string_view data_text(const VtkFile& source, std::string_view remaining_text,
                           Encoding encoding) {
  const std::size_t start = remaining_text.find_first_not_of(xml_blank);
  if (start == std::string_view::npos || remaining_text[start] != '_') {
    source.throw_file_error("an underscore before the data", shown(remaining_text));
  }
  remaining_text.remove_prefix(start + 1);
  // Raw data may contain any byte, so their end is searched for from the end of the file.
  const std::size_t data_end = encoding == Encoding::Raw ? remaining_text.rfind("</AppendedData>")
                                                         : remaining_text.find_first_of(" \t\r\n<");
  const std::size_t end = std::min(data_end, remaining_text.size());
  std::string closing;
  for (const char c : remaining_text.substr(end, 200)) {
    if (xml_blank.find(c) == std::string_view::npos) closing += c;
  }
  if (closing != "</AppendedData></VTKFile>") {
    source.throw_file_error("</AppendedData></VTKFile> after the data", shown(closing));
  }
  return remaining_text.substr(0, end);
}

Eigen::VectorXd to_vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

cutting::Points read_vertices(const VtkFile& source, const AppendedData& data, std::size_t n) {
  const auto xyz = data.array<double>("Points/Points", "Float64", 3 * n);
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    if (!std::isfinite(xyz[i])) {
      source.throw_file_error("finite vertices", fmt::format("{} in vertex {}", xyz[i], i / 3));
    }
  }
  return Eigen::Map<const cutting::Points>(xyz.data(), static_cast<Eigen::Index>(n), 3);
}

/// Reads the normals; no rows if the file has none.
cutting::Points read_normals(const VtkFile& source, const AppendedData& data, std::size_t n) {
  if (!data.has("PointData/Normals")) return cutting::Points(0, 3);
  const auto xyz = data.array<float>("PointData/Normals", "Float32", 3 * n);
  cutting::Points result(static_cast<Eigen::Index>(n), 3);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::RowVector3d normal(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
    // Normals have single precision, so a deviation of 1e-3 is no rounding error.
    if (!(std::abs(normal.norm() - 1.0) < 1e-3))
      source.throw_file_error("normals of length 1",
                              fmt::format("{} at vertex {}", normal.norm(), i));
    result.row(static_cast<Eigen::Index>(i)) = normal.normalized();
  }
  return result;
}

cutting::Triangles read_triangles(const VtkFile& source, const AppendedData& data,
                                  const ResidualFileLayout& layout) {
  const std::size_t m = layout.triangles;
  const auto corners = data.indices("Polys/connectivity", 3 * m);
  const auto end_offsets = data.indices("Polys/offsets", m);
  cutting::Triangles result(static_cast<Eigen::Index>(m), 3);
  for (std::size_t i = 0; i < 3 * m; ++i) {
    if (corners[i] < 0 || static_cast<std::uint64_t>(corners[i]) >= layout.points) {
      source.throw_file_error(fmt::format("vertex indices below {}", layout.points),
                              fmt::format("{} in triangle {}", corners[i], i / 3));
    }
    result.data()[i] = static_cast<int>(corners[i]);
  }
  for (std::size_t i = 0; i < m; ++i) {
    if (end_offsets[i] != static_cast<std::int64_t>(3 * (i + 1))) {
      source.throw_file_error("triangles only",
                              fmt::format("offset {} at polygon {}", end_offsets[i], i));
    }
  }
  return result;
}

Eigen::VectorXd vertex_areas(const cutting::Points& points, const cutting::Triangles& triangles) {
  Eigen::VectorXd area = Eigen::VectorXd::Zero(points.rows());
  for (const auto& t : triangles.rowwise()) {
    const Eigen::Vector3d a = points.row(t[0]);
    const Eigen::Vector3d b = points.row(t[1]);
    const Eigen::Vector3d c = points.row(t[2]);
    // As in the statistics, each corner has a third of the area of its triangle.
    const double third = (b - a).cross(c - a).norm() / 6.0;
    for (const int corner : t) area[corner] += third;
  }
  return area;
}

void check_values(const VtkFile& source, const Field& field) {
  using cutting::VertexStatus;
  for (std::size_t i = 0; i < field.status.size(); ++i) {
    const double deviation = field.deviation_um[static_cast<Eigen::Index>(i)];
    const int status_code = field.status[i];
    if (status_code > int(VertexStatus::Gouged)) {
      source.throw_file_error("a status of 0, 1, 2 or 3",
                              fmt::format("{} at vertex {}", status_code, i));
    }
    const auto status = VertexStatus(status_code);
    // A vertex outside the judged region may be cut or uncut.
    const bool is_consistent = status == VertexStatus::Cut       ? std::isfinite(deviation)
                               : status == VertexStatus::Outside ? !std::isinf(deviation)
                                                                 : std::isnan(deviation);
    if (!is_consistent) {
      source.throw_file_error(
          "a finite deviation where cut, NaN where uncut or gouged",
          fmt::format("{} with status {} at vertex {}", deviation, status_code, i));
    }
  }
}

}  // namespace

Field read_residual(const std::filesystem::path& path) {
  const VtkFile source(path, "a residual file");
  const std::size_t head_end = source.text().find(appended_data_tag);
  if (head_end == std::string_view::npos) {
    source.throw_file_error("a residual.vtp with appended data", shown(source.text()));
  }
  const ResidualFileLayout layout = read_residual_layout(source, source.text().substr(0, head_end));
  std::string_view remaining_text = source.text().substr(head_end + appended_data_tag.size());
  const Encoding encoding = remaining_text.starts_with("raw\">") ? Encoding::Raw : Encoding::Base64;
  const std::string_view encoding_name = encoding == Encoding::Raw ? "raw\">" : "base64\">";
  if (!remaining_text.starts_with(encoding_name))
    source.throw_error_at(head_end, "data encoded as raw or base64", shown(remaining_text));
  remaining_text.remove_prefix(encoding_name.size());
  const AppendedData data(source, data_text(source, remaining_text, encoding), encoding, layout);

  Field field;
  const std::size_t n = layout.points;
  field.design.vertices = read_vertices(source, data, n);
  field.design.triangles = read_triangles(source, data, layout);
  field.deviation_um = to_vector(data.array<double>("PointData/deviation_um", "Float64", n));
  field.status = data.array<std::uint8_t>("PointData/status", "UInt8", n);
  field.cut_time_s = to_vector(data.array<double>("PointData/cut_time_s", "Float64", n));
  field.cut_line = data.array<int>("PointData/cut_line", "Int32", n);
  check_values(source, field);
  if (data.has("PointData/form_um"))
    field.form_um = to_vector(data.array<double>("PointData/form_um", "Float64", n));
  if (data.has("PointData/lower_um")) {
    field.tolerance_um.resize(Eigen::Index(n), 2);
    field.tolerance_um.col(0) = to_vector(data.array<double>("PointData/lower_um", "Float64", n));
    field.tolerance_um.col(1) = to_vector(data.array<double>("PointData/upper_um", "Float64", n));
  }
  for (const auto within :
       {cutting::Surface::InteriorSample::Middle, cutting::Surface::InteriorSample::Random}) {
    const std::string name = std::string("CellData/") + cutting::sample_values_name(within);
    if (!data.has(name)) continue;
    field.interior_sample = within;
    field.within_um = to_vector(data.array<double>(name, "Float64", layout.triangles));
  }

  field.design.normals = read_normals(source, data, n);
  field.design.area = vertex_areas(field.design.vertices, field.design.triangles);
  field.design.facet_error = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n));
  for (const std::uint8_t status : field.status)
    field.design.judged.push_back(cutting::VertexStatus(status) != cutting::VertexStatus::Outside);
  return field;
}

}  // namespace abbe::render
