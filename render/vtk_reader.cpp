#include "render/vtk_reader.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <vtkBase64Utilities.h>
#include <vtkCallbackCommand.h>
#include <vtkCommand.h>
#include <vtkLZ4DataCompressor.h>
#include <vtkNew.h>
#include <vtkZLibDataCompressor.h>

#include "kinematics/bad_input.h"

// Reader of VTK XML files: their tags, and the points and tensors of an unstructured grid (.vtu).

namespace abbe::render {

VtkFile::VtkFile(const std::filesystem::path& path, const std::string& kind,
                 std::uintmax_t max_bytes)
    : path_(path.string()) {
  std::error_code error_code;
  if (!std::filesystem::is_regular_file(path, error_code)) throw_file_error(kind, "no such file");
  const std::uintmax_t size = std::filesystem::file_size(path, error_code);
  if (error_code || size > max_bytes)
    throw_file_error(fmt::format("at most {} MiB", max_bytes >> 20), fmt::format("{} bytes", size));
  std::ifstream stream(path, std::ios::binary);
  text_.assign(std::istreambuf_iterator<char>(stream), {});
  if (!stream) throw_file_error("a readable file", "an error while reading");
}

void VtkFile::throw_file_error(const std::string& expected, const std::string& seen) const {
  throw BadInput(path_, 0, 0, expected, seen);
}

void VtkFile::throw_error_at(std::size_t position, const std::string& expected,
                             const std::string& seen) const {
  const auto end = text_.begin() + std::ptrdiff_t(std::min(position, text_.size()));
  throw BadInput(path_, 1 + int(std::count(text_.begin(), end, '\n')), 0, expected, seen);
}

std::optional<VtkTag> VtkTags::next() {
  for (;;) {
    at_ = text_.find('<', at_);
    if (at_ == std::string_view::npos) return std::nullopt;
    if (text_.substr(at_).starts_with("<!--")) {
      skip_to("-->");
    } else if (text_.substr(at_).starts_with("<?") || text_.substr(at_).starts_with("<!")) {
      skip_to(">");
    } else {
      return tag();
    }
  }
}

void VtkTags::skip_to(std::string_view end) {
  const std::size_t position = text_.find(end, at_);
  if (position == std::string_view::npos)
    source_.throw_error_at(at_, "the end of a comment", shown(text_.substr(at_)));
  at_ = position + end.size();
}

VtkTag VtkTags::tag() {
  VtkTag tag;
  tag.at = at_++;
  const std::size_t name_end = std::min(text_.find_first_of(" \t\r\n>", at_), text_.size());
  tag.name = text_.substr(at_, name_end - at_);
  if (tag.name.size() > 1 && tag.name.ends_with('/')) tag.name.remove_suffix(1);
  at_ = name_end;
  while (read_attribute(tag)) {
  }
  tag.inner = text_.substr(at_, text_.find('<', at_) - at_);
  return tag;
}

bool VtkTags::read_attribute(VtkTag& tag) {
  at_ = text_.find_first_not_of(" \t\r\n/?", at_);
  if (at_ == std::string_view::npos)
    source_.throw_error_at(tag.at, "the end of a tag", "the end of the file");
  if (text_[at_] == '>') {
    ++at_;
    return false;
  }
  const std::size_t equals = text_.find_first_of("=>", at_);
  const bool is_quoted = equals != std::string_view::npos && text_[equals] == '=' &&
                         equals + 1 < text_.size() &&
                         (text_[equals + 1] == '"' || text_[equals + 1] == '\'');
  const std::size_t end =
      is_quoted ? text_.find(text_[equals + 1], equals + 2) : std::string_view::npos;
  if (end == std::string_view::npos)
    source_.throw_error_at(tag.at, "attributes as name=\"value\"", shown(text_.substr(at_)));
  const std::string_view name = text_.substr(at_, equals - at_);
  // Attributes are stored in a map; the limit bounds its size for invalid files.
  if (tag.attributes.size() > 100) source_.throw_error_at(tag.at, "at most 100 attributes", "more");
  if (!tag.attributes.emplace(name, text_.substr(equals + 2, end - equals - 2)).second)
    source_.throw_error_at(tag.at, "every attribute at most once", shown(name));
  at_ = end + 1;
  return true;
}

std::string_view attribute(const VtkTag& tag, std::string_view name, std::string_view fallback) {
  const auto entry = tag.attributes.find(name);
  return entry == tag.attributes.end() ? fallback : entry->second;
}

std::size_t whole_number(const VtkFile& source, const VtkTag& tag, std::string_view name) {
  const std::string_view text = attribute(tag, name, "");
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size())
    source.throw_error_at(tag.at, fmt::format("an integer as {} of {}", name, tag.name),
                          shown(text));
  return value;
}

std::string shown(std::string_view text) {
  std::string printable;
  for (const char c : text.substr(0, 40)) printable += c >= ' ' && c <= '~' ? c : '?';
  return "\"" + printable + (text.size() > 40 ? "...\"" : "\"");
}

namespace {

// VTK decodes base64 and compressed data; its decoders are called only after the sizes are checked.

static_assert(std::endian::native == std::endian::little);

constexpr std::uintmax_t max_vtu_bytes = std::uintmax_t(512) << 20;
constexpr std::size_t max_compression_ratio = 1100;  // of zlib and lz4

/// Position and encoding of the points and the tensors.
struct FileLayout {
  std::size_t header_bytes = 4;  ///< size of the numbers in front of binary data
  enum class Packing { None, ZLib, Lz4 } packing = Packing::None;
  std::size_t nodes = 0;
  std::optional<VtkTag> points, tensors;
  std::string_view appended;  ///< appended data after the underscore
  bool appended_raw = false;
};

void read_file_tag(const VtkFile& source, const VtkTag& tag, FileLayout& layout) {
  const auto expect = [&](std::string_view name, std::string_view value) {
    const std::string_view seen = attribute(tag, name, value);
    if (seen != value)
      source.throw_error_at(tag.at, fmt::format("{}=\"{}\"", name, value), shown(seen));
  };
  if (!tag.attributes.contains("type"))
    source.throw_error_at(tag.at, "type=\"UnstructuredGrid\"", "no type");
  expect("type", "UnstructuredGrid");
  expect("byte_order", "LittleEndian");
  const std::string_view header = attribute(tag, "header_type", "UInt32");
  if (header != "UInt32") expect("header_type", "UInt64");
  layout.header_bytes = header == "UInt64" ? 8 : 4;
  const std::string_view packing = attribute(tag, "compressor", "");
  if (packing == "vtkZLibDataCompressor") {
    layout.packing = FileLayout::Packing::ZLib;
  } else if (packing == "vtkLZ4DataCompressor") {
    layout.packing = FileLayout::Packing::Lz4;
  } else if (!packing.empty()) {
    source.throw_error_at(tag.at, "no compressor, vtkZLibDataCompressor or vtkLZ4DataCompressor",
                          shown(packing));
  }
}

void read_appended(const VtkFile& source, const VtkTag& tag, FileLayout& layout) {
  const std::string_view encoding = attribute(tag, "encoding", "");
  if (encoding != "base64" && encoding != "raw")
    source.throw_error_at(tag.at, "appended data as base64 or raw", shown(encoding));
  layout.appended_raw = encoding == "raw";
  const std::size_t start = tag.inner.find_first_not_of(xml_blank);
  if (start == std::string_view::npos || tag.inner[start] != '_')
    source.throw_error_at(tag.at, "an underscore before the appended data", shown(tag.inner));
  // Raw data may contain any byte, so a search for their end tag would be unreliable.
  layout.appended =
      source.text().substr(std::size_t(tag.inner.data() - source.text().data()) + start + 1);
}

/// Finds the points of the grid and the point data `array`. Throws BadInput if the grid has several
/// pieces or an array is missing.
FileLayout read_layout(const VtkFile& source, const std::string& array) {
  FileLayout layout;
  VtkTags tags(source, source.text());
  std::string_view section;
  std::string other_names;
  bool has_file_tag = false;
  int piece_count = 0;
  while (const std::optional<VtkTag> tag = tags.next()) {
    if (tag->name == "VTKFile") {
      has_file_tag = true;
      read_file_tag(source, *tag, layout);
    } else if (tag->name == "Piece") {
      if (++piece_count > 1)
        source.throw_error_at(tag->at, "a grid in one piece", "a second Piece");
      layout.nodes = whole_number(source, *tag, "NumberOfPoints");
    } else if (tag->name == "DataArray") {
      const std::string_view name = attribute(*tag, "Name", "");
      if (section == "Points") layout.points = *tag;
      if (section == "PointData" && name == array) layout.tensors = *tag;
      // If the array is missing, the message lists the names of the others.
      if (section == "PointData" && other_names.size() < 200) other_names += " " + shown(name);
    } else if (tag->name == "AppendedData") {
      read_appended(source, *tag, layout);
      break;
    } else if (tag->name == "Points" || tag->name == "PointData") {
      section = tag->name;
    } else if (tag->name.starts_with('/') && tag->name.substr(1) == section) {
      section = {};
    }
  }
  if (!has_file_tag) source.throw_file_error("a VTK XML file", "no VTKFile tag");
  if (piece_count == 0 || layout.nodes == 0) source.throw_file_error("a grid with points", "none");
  if (!layout.points) source.throw_file_error("an array of Points", "none");
  if (!layout.tensors)
    source.throw_file_error("a point array \"" + array + "\"",
                            other_names.empty() ? "none" : "only" + other_names);
  return layout;
}

std::size_t base64_length(std::size_t bytes) { return (bytes + 2) / 3 * 4; }

/// The binary data of an array, in any encoding, as a stream of bytes.
class ByteStream {
 public:
  ByteStream(const VtkFile& source, const VtkTag& tag, const FileLayout& layout)
      : source_(source), tag_(tag), raw_(false) {
    if (attribute(tag, "format", "") == "binary") {
      // Binary data are inside the tag, after blanks.
      text_ = tag.inner.substr(std::min(tag.inner.find_first_not_of(xml_blank), tag.inner.size()));
      return;
    }
    raw_ = layout.appended_raw;
    const std::size_t offset = whole_number(source, tag, "offset");
    if (offset > layout.appended.size())
      source.throw_error_at(tag.at, "an offset within the appended data",
                            fmt::format("{}", offset));
    text_ = layout.appended.substr(offset);
  }

  /// Returns the next bytes. In base64 the bytes after them start a new group, as VTK writes them
  /// after a header.
  std::string take(std::size_t bytes) {
    // The first comparison keeps base64_length() from overflowing.
    if (bytes > text_.size() || (!raw_ && base64_length(bytes) > text_.size()))
      source_.throw_error_at(tag_.at, fmt::format("{} bytes of data", bytes),
                             "the end of the data");
    if (raw_) {
      std::string result(text_.substr(0, bytes));
      text_.remove_prefix(bytes);
      return result;
    }
    const std::string_view encoded = text_.substr(0, base64_length(bytes));
    std::string result(encoded.size(), '\0');
    const std::size_t decoded = vtkBase64Utilities::DecodeSafely(
        reinterpret_cast<const unsigned char*>(encoded.data()), encoded.size(),
        reinterpret_cast<unsigned char*>(result.data()), result.size());
    if (decoded < bytes)
      source_.throw_error_at(tag_.at, fmt::format("{} bytes of data", bytes),
                             "data that is not base64");
    result.resize(bytes);
    text_.remove_prefix(encoded.size());
    return result;
  }

  /// Returns the next bytes without advancing.
  std::string peek(std::size_t bytes) const { return ByteStream(*this).take(bytes); }

 private:
  const VtkFile& source_;
  const VtkTag& tag_;
  bool raw_;
  std::string_view text_;
};

std::uint64_t header_number(const std::string& bytes, std::size_t index, std::size_t width) {
  std::uint64_t value = 0;
  // File and processor are little-endian, so a narrower number fills the low bytes.
  std::memcpy(&value, bytes.data() + index * width, width);
  return value;
}

/// Reads uncompressed data, which are preceded by their size.
std::string read_plain(const VtkFile& source, const VtkTag& tag, const FileLayout& layout,
                       std::size_t bytes) {
  ByteStream stream(source, tag, layout);
  const std::size_t width = layout.header_bytes;
  const std::uint64_t stated_size = header_number(stream.peek(width), 0, width);
  if (stated_size != bytes)
    source.throw_error_at(tag.at, fmt::format("{} bytes of data", bytes),
                          fmt::format("{} stated", stated_size));
  return stream.take(width + bytes).substr(width);
}

/// Decompresses a block. Returns true if the result has exactly `bytes` bytes.
bool uncompress_block(FileLayout::Packing packing, const std::string& block, char* target,
                      std::size_t bytes) {
  // With an observer, VTK does not print messages about invalid data.
  vtkNew<vtkCallbackCommand> silent_observer;
  const auto uncompress = [&](vtkDataCompressor& compressor) {
    compressor.AddObserver(vtkCommand::ErrorEvent, silent_observer);
    return compressor.Uncompress(reinterpret_cast<const unsigned char*>(block.data()), block.size(),
                                 reinterpret_cast<unsigned char*>(target), bytes);
  };
  if (packing == FileLayout::Packing::ZLib)
    return uncompress(*vtkNew<vtkZLibDataCompressor>()) == bytes;
  return uncompress(*vtkNew<vtkLZ4DataCompressor>()) == bytes;
}

/// Reads compressed data. The blocks are preceded by their number, the size of a full block, the
/// size of the last block (0 if it is full), and the compressed size of each.
std::string read_compressed(const VtkFile& source, const VtkTag& tag, const FileLayout& layout,
                            std::size_t bytes) {
  ByteStream stream(source, tag, layout);
  const std::size_t width = layout.header_bytes;
  const auto throw_number_error = [&](const std::string& expected, std::uint64_t seen) {
    source.throw_error_at(tag.at, expected, fmt::format("{}", seen));
  };
  const std::uint64_t block_count = header_number(stream.peek(width), 0, width);
  if (block_count == 0 || block_count > bytes)
    throw_number_error("a possible number of blocks", block_count);
  const std::string header = stream.take((3 + block_count) * width);
  const std::uint64_t full_size = header_number(header, 1, width);
  const std::uint64_t partial_size = header_number(header, 2, width);
  if (full_size == 0 || (block_count > 1 && full_size > bytes) || partial_size > full_size)
    throw_number_error("a block size that matches the data", full_size);
  const std::uint64_t stated_size =
      (block_count - 1) * full_size + (partial_size > 0 ? partial_size : full_size);
  if (stated_size != bytes) throw_number_error(fmt::format("{} bytes of data", bytes), stated_size);
  std::uint64_t compressed_bytes = 0;
  for (std::size_t i = 0; i < block_count; ++i) {
    const std::uint64_t size = header_number(header, 3 + i, width);
    // Each size is checked before it is added, so that the sum cannot overflow.
    if (size > source.text().size())
      throw_number_error("compressed data that fits into the file", size);
    compressed_bytes += size;
  }
  // Check the claimed size against the best possible compression ratio before allocating memory.
  if (bytes / max_compression_ratio > compressed_bytes)
    throw_number_error("compressed data of a plausible size", compressed_bytes);
  const std::string data = stream.take(compressed_bytes);
  std::string result(bytes, '\0');
  std::size_t source_offset = 0;
  for (std::size_t i = 0; i < block_count; ++i) {
    const std::size_t size = header_number(header, 3 + i, width);
    const std::size_t target_offset = i * full_size;
    if (!uncompress_block(layout.packing, data.substr(source_offset, size),
                          result.data() + target_offset,
                          std::min<std::size_t>(full_size, bytes - target_offset)))
      source.throw_error_at(tag.at, "valid compressed data",
                            fmt::format("a broken block {}", i + 1));
    source_offset += size;
  }
  return result;
}

/// Reads the n numbers of an array in ASCII format.
std::vector<double> ascii_numbers(const VtkFile& source, const VtkTag& tag, std::size_t n) {
  std::vector<double> numbers;
  std::string_view text = tag.inner;
  for (;;) {
    text.remove_prefix(std::min(text.find_first_not_of(xml_blank), text.size()));
    if (text.empty()) break;
    double x = 0.0;
    const std::size_t end = std::min(text.find_first_of(xml_blank), text.size());
    const auto [number_end, error] = std::from_chars(text.data(), text.data() + end, x);
    if (error != std::errc{} || number_end != text.data() + end)
      source.throw_error_at(tag.at, "numbers", shown(text.substr(0, end)));
    numbers.push_back(x);
    text.remove_prefix(end);
  }
  if (numbers.size() != n)
    source.throw_error_at(tag.at, fmt::format("{} numbers", n), fmt::format("{}", numbers.size()));
  return numbers;
}

template <typename T>
std::vector<double> bytes_to_numbers(const std::string& bytes) {
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return {values.begin(), values.end()};
}

/// Reads all numbers of an array, `components` per node.
std::vector<double> read_numbers(const VtkFile& source, const VtkTag& tag, const FileLayout& layout,
                                 std::size_t components) {
  const std::string_view type = attribute(tag, "type", "");
  if (type != "Float32" && type != "Float64")
    source.throw_error_at(tag.at, "numbers of type Float32 or Float64", shown(type));
  // The most compressible data need at least one byte for max_compression_ratio nodes. The limit
  // also keeps the products below from overflowing.
  if (layout.nodes > source.text().size() * max_compression_ratio)
    source.throw_error_at(tag.at, "a number of points that fits into the file",
                          fmt::format("{}", layout.nodes));
  const std::size_t n = layout.nodes * components;
  const std::string_view format = attribute(tag, "format", "");
  if (format == "ascii") return ascii_numbers(source, tag, n);
  if (format != "binary" && format != "appended")
    source.throw_error_at(tag.at, "the format ascii, binary or appended", shown(format));
  const std::size_t bytes = n * (type == "Float32" ? 4 : 8);
  const std::string data = layout.packing == FileLayout::Packing::None
                               ? read_plain(source, tag, layout, bytes)
                               : read_compressed(source, tag, layout, bytes);
  return type == "Float32" ? bytes_to_numbers<float>(data) : bytes_to_numbers<double>(data);
}

void check_finite(const VtkFile& source, const VtkTag& tag, const std::vector<double>& values,
                  std::size_t components) {
  const auto invalid =
      std::find_if(values.begin(), values.end(), [](double x) { return !std::isfinite(x); });
  if (invalid == values.end()) return;
  // Messages count nodes from 1.
  const std::size_t node = std::size_t(invalid - values.begin()) / components + 1;
  source.throw_error_at(tag.at, "finite numbers", fmt::format("{} at node {}", *invalid, node));
}

Eigen::Matrix3d make_tensor(const double* v, std::size_t components) {
  Eigen::Matrix3d T;
  if (components == 9)
    T << v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8];
  else  // six components in the order of VTK: xx yy zz xy yz xz
    T << v[0], v[3], v[5], v[3], v[1], v[4], v[5], v[4], v[2];
  return T;
}

}  // namespace

PointTensors read_vtu(const std::filesystem::path& path, const std::string& array) {
  const VtkFile source(path, "a .vtu file", max_vtu_bytes);
  const FileLayout layout = read_layout(source, array);
  const VtkTag& points = *layout.points;
  const VtkTag& tensors = *layout.tensors;
  if (whole_number(source, points, "NumberOfComponents") != 3)
    source.throw_error_at(points.at, "three coordinates per point", "a different number");
  const std::size_t components = whole_number(source, tensors, "NumberOfComponents");
  if (components != 9 && components != 6)
    source.throw_error_at(tensors.at, fmt::format("9 or 6 components of \"{}\"", array),
                          fmt::format("{}", components));
  const std::vector<double> xyz = read_numbers(source, points, layout, 3);
  const std::vector<double> values = read_numbers(source, tensors, layout, components);
  check_finite(source, points, xyz, 3);
  check_finite(source, tensors, values, components);
  PointTensors result;
  result.points =
      Eigen::Map<const decltype(result.points)>(xyz.data(), Eigen::Index(layout.nodes), 3);
  result.tensors.reserve(layout.nodes);
  for (std::size_t i = 0; i < layout.nodes; ++i)
    result.tensors.push_back(make_tensor(values.data() + i * components, components));
  return result;
}

}  // namespace abbe::render
