#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace abbe::sim::program {

/// Whole text of a file.
/// @throws BadInput if it cannot be read or is larger than `max_bytes`
std::string read_text(const std::filesystem::path& file, std::size_t max_bytes);

/// Walks through the lines of a text; a byte order mark and the CR of a CRLF are left out.
class Lines {
 public:
  explicit Lines(std::string_view text);
  std::optional<std::string_view> next();
  int number() const { return number_; }  ///< of the line last given, from 1

 private:
  std::string_view rest_;
  int number_ = 0;
};

/// At most 40 bytes of something seen, unprintable ones as \xNN.
std::string shown(std::string_view text);

}  // namespace abbe::sim::program
