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

/// Robust reading of VTK's XML files. VTK's own readers allocate whatever a file claims and abort
/// on noise; here no claim is trusted that the bytes present do not support.
namespace abbe::render {

/// The text of a file. Input errors name the file and the line of a position.
class VtkFile {
 public:
  /// @param kind  name of such a file in input errors
  /// @throws BadInput if there is no such regular file, or if it is too long or cannot be read
  VtkFile(const std::filesystem::path& path, const std::string& kind,
          std::uintmax_t max_bytes = std::numeric_limits<std::uintmax_t>::max());

  [[noreturn]] void throw_file_error(const std::string& expected, const std::string& seen) const;
  [[noreturn]] void refuse(std::size_t at, const std::string& expected,
                           const std::string& seen) const;
  std::string_view text() const { return text_; }

 private:
  std::string path_;
  std::string text_;
};

struct VtkTag {
  std::string_view name;  ///< closing tags begin with '/'
  std::map<std::string_view, std::string_view> attributes;
  std::size_t at = 0;      ///< position in the text, for input errors
  std::string_view inner;  ///< text up to the next tag
};

/// Iterator over tags; comments and declarations are skipped.
class VtkTags {
 public:
  /// @param text  of the file, from its beginning
  VtkTags(const VtkFile& source, std::string_view text) : source_(source), text_(text) {}

  /// Returns the next tag; empty at the end.
  /// @throws BadInput for a tag without end, or attributes other than name="value", each once
  std::optional<VtkTag> next();

 private:
  void skip_to(std::string_view end);
  VtkTag tag();
  bool read_attribute(VtkTag& tag);

  const VtkFile& source_;
  std::string_view text_;
  std::size_t at_ = 0;
};

std::string_view attribute(const VtkTag& tag, std::string_view name, std::string_view otherwise);

/// Returns the attribute as a whole number. @throws BadInput unless it is one
std::size_t whole_number(const VtkFile& source, const VtkTag& tag, std::string_view name);

inline constexpr std::string_view xml_blank = " \t\r\n";

/// Returns at most the first 40 bytes of a text, in quotes.
std::string shown(std::string_view text);

/// A tensor at each of several points.
struct PointTensors {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> points;  ///< (n x 3)
  std::vector<Eigen::Matrix3d> tensors;                              ///< (n)
};

inline constexpr std::uintmax_t max_vtu_bytes = std::uintmax_t(512) << 20;

/// Reads the points of a VTK XML unstructured grid and the point array of that name, with 9
/// components (row by row) or 6 (xx yy zz xy yz xz, symmetric); cells are ignored. Float32 or
/// Float64, little endian, in one piece; ascii, base64 or appended (base64 or raw), plain or
/// compressed by zlib or lz4: the formats of VTK, ParaView and meshio. Memory stays within a few
/// times what the bytes present can hold, whatever the file claims.
/// @throws BadInput naming the file and what was expected for anything else, a number that is not
///         finite, or more than 512 MiB
PointTensors read_vtu(const std::filesystem::path& path, const std::string& array);

}  // namespace abbe::render
