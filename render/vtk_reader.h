#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

/// Robust readers of VTK's XML files. The readers of VTK allocate whatever size a file states and
/// abort on invalid data; these check every stated size against the bytes that are present.
namespace abbe::render {

/// The text of a file, with functions that throw input errors for it.
class VtkFile {
 public:
  /// @param kind  expected kind of file, for input errors
  /// @throws BadInput if the file does not exist, is too long or cannot be read
  VtkFile(const std::filesystem::path& path, const std::string& kind,
          std::uintmax_t max_bytes = std::numeric_limits<std::uintmax_t>::max());

  /// Throws BadInput for the file as a whole.
  [[noreturn]] void throw_file_error(const std::string& expected, const std::string& seen) const;
  /// Throws BadInput with the line of a position in the text.
  [[noreturn]] void throw_error_at(std::size_t position, const std::string& expected,
                                   const std::string& seen) const;
  std::string_view text() const { return text_; }

 private:
  std::string path_;
  std::string text_;
};

/// A tag of a VTK XML file.
struct VtkTag {
  std::string_view name;  ///< closing tags begin with '/'
  std::map<std::string_view, std::string_view> attributes;
  std::size_t at = 0;      ///< position in the text, for input errors
  std::string_view inner;  ///< text up to the next tag
};

/// Iterates over the tags of a file. Comments and declarations are skipped.
class VtkTags {
 public:
  /// @param text  text of the file, from its beginning
  VtkTags(const VtkFile& source, std::string_view text) : source_(source), text_(text) {}

  /// Returns the next tag; empty at the end.
  /// @throws BadInput for a tag without end, a repeated attribute or an attribute that is not
  ///         name="value"
  std::optional<VtkTag> next();

 private:
  void skip_to(std::string_view end);
  VtkTag tag();
  bool read_attribute(VtkTag& tag);

  const VtkFile& source_;
  std::string_view text_;
  std::size_t at_ = 0;
};

/// Returns an attribute, or the fallback if the tag does not have it.
std::string_view attribute(const VtkTag& tag, std::string_view name, std::string_view fallback);

/// Returns an attribute that is a non-negative integer.
/// @throws BadInput if it is missing or no such number
std::size_t whole_number(const VtkFile& source, const VtkTag& tag, std::string_view name);

inline constexpr std::string_view xml_blank = " \t\r\n";

/// Returns at most the first 40 bytes of a text in quotes, for input errors.
std::string shown(std::string_view text);

/// Points with a tensor at each.
struct PointTensors {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> points;  ///< (n x 3)
  std::vector<Eigen::Matrix3d> tensors;                              ///< (n)
};

/// Reads the points of a VTK XML unstructured grid and a point array with 9 components (row by row)
/// or 6 (xx yy zz xy yz xz, symmetric). Cells are ignored. The data may be Float32 or Float64,
/// little endian, in one piece, as ascii, base64 or appended data (base64 or raw), plain or
/// compressed by zlib or lz4; these are the formats of VTK, ParaView and meshio. The memory used is
/// at most a few times what the bytes present can hold, whatever sizes the file states.
/// @param array  name of the point array
/// @throws BadInput if the file has another form or more than 512 MiB, or if a number is not finite
PointTensors read_vtu(const std::filesystem::path& path, const std::string& array);

}  // namespace abbe::render
