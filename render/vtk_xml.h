#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>

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

  [[noreturn]] void refuse_file(const std::string& expected, const std::string& seen) const;
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

}  // namespace abbe::render
