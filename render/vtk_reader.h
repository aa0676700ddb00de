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

/// VTK's XML files as they stand. VTK's own readers take a file's word for how much there is to
/// allocate, and abort on noise; here nothing is believed that the bytes present do not bear out.
namespace abbe::render {

/// The whole of a file. Refusals name it, and the line of a place in its text.
class VtkFile {
 public:
  /// @param kind  what a refusal calls such a file
  /// @throws BadInput if there is no such regular file, it is too long or cannot be read
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
  std::string_view name;  ///< closing ones begin with '/'
  std::map<std::string_view, std::string_view> attributes;
  std::size_t at = 0;      ///< in the text, for refusals
  std::string_view inner;  ///< text up to the next tag
};

/// Tags one after another; comments and declarations are passed over.
class VtkTags {
 public:
  /// @param text  of the file, from its beginning
  VtkTags(const VtkFile& source, std::string_view text) : source_(source), text_(text) {}

  /// @throws BadInput for a tag that has no end, or attributes other than name="value", each once
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

/// @throws BadInput unless the attribute is a whole number
std::size_t whole_number(const VtkFile& source, const VtkTag& tag, std::string_view name);

inline constexpr std::string_view xml_blank = " \t\r\n";

/// At most 40 bytes of something seen, between quotes.
std::string shown(std::string_view text);

/// A tensor at each of a number of points.
struct PointTensors {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> points;  ///< (n x 3)
  std::vector<Eigen::Matrix3d> tensors;                              ///< (n)
};

inline constexpr std::uintmax_t max_vtu_bytes = std::uintmax_t(512) << 20;

/// Reads the points of a VTK XML unstructured grid and the point array of that name, with 9
/// components (row by row) or 6 (xx yy zz xy yz xz, symmetric); its cells are passed over. Float32
/// or Float64, little endian, in one piece; ascii, base64 or appended (base64 or raw), plain or
/// compressed by zlib or lz4: what VTK, ParaView and meshio write. Memory stays within a few times
/// what the bytes that are there can hold, whatever the file claims.
/// @throws BadInput naming the file and what was expected for anything else, a number that is not
///         finite, more than 512 MiB
PointTensors read_vtu(const std::filesystem::path& path, const std::string& array);

}  // namespace abbe::render
