#include "kinematics/bad_input.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace abbe {

namespace {

/// The first character of a text: its code point and its length; 0 bytes if it is not valid UTF-8.
struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;
};

/// Returns the first character of a text that is not empty.
Character decode_first_character(std::string_view text) {
  // Smallest code point for each length: a longer encoding than needed is invalid UTF-8.
  constexpr std::array<std::uint32_t, 5> min_code{0, 0, 0x80, 0x800, 0x10000};
  const auto lead = static_cast<unsigned char>(text.front());
  if (lead < 0x80) return {lead, 1};
  const std::size_t bytes = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : lead >= 0xC0 ? 2 : 0;
  if (bytes == 0 || lead > 0xF4 || text.size() < bytes) return {};
  std::uint32_t code = lead & (0xFFu >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    const auto continuation = static_cast<unsigned char>(text[i]);
    if ((continuation & 0xC0) != 0x80) return {};
    code = (code << 6) | (continuation & 0x3Fu);
  }
  // UTF-8 excludes the halves of a UTF-16 pair and code points beyond U+10FFFF (RFC 3629).
  const bool is_surrogate = code >= 0xD800 && code <= 0xDFFF;
  if (code < min_code[bytes] || code > 0x10FFFF || is_surrogate) return {};
  return {code, bytes};
}

/// Returns true for code points from U+007F on that are invisible: control characters, and format
/// characters that reorder or hide the text around them.
bool is_invisible(std::uint32_t code) {
  constexpr std::array<std::pair<std::uint32_t, std::uint32_t>, 12> invisible_ranges{{
      {0x7F, 0x9F},      // DEL and C1
      {0xAD, 0xAD},      // soft hyphen
      {0x61C, 0x61C},    // Arabic letter mark
      {0x180E, 0x180E},  // Mongolian vowel separator
      {0x200B, 0x200B},  // zero width space; the joiners U+200C and U+200D are part of words in
                         // several scripts
      {0x200E, 0x200F},  // left-to-right and right-to-left marks
      {0x2028, 0x202E},  // separators, embeddings and overrides
      {0x2060, 0x206F},  // word joiner, isolates and the like
      {0xFEFF, 0xFEFF},  // byte order mark
      {0xFFF9, 0xFFFB},  // interlinear annotation
      {0x1D173, 0x1D17A},
      {0xE0000, 0xE007F},  // tags
  }};
  return std::ranges::any_of(invisible_ranges, [&](const auto& range) {
    return code >= range.first && code <= range.second;
  });
}

void append_escape(std::string& result, std::uint32_t code) {
  if (code < 0x20) {
    result += fmt::format("\\x{:02x}", code);
  } else if (code < 0x10000) {
    result += fmt::format("\\u{:04x}", code);
  } else {  // as a UTF-16 surrogate pair, because \u takes four digits in JSON too
    const std::uint32_t offset = code - 0x10000;
    result += fmt::format("\\u{:04x}\\u{:04x}", 0xD800 + (offset >> 10), 0xDC00 + (offset & 0x3FF));
  }
}

/// Returns the escaped text; line ends and tabs are kept if `keep_lines`.
std::string escape(std::string_view text, bool keep_lines) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const Character c = decode_first_character(text);
    const bool is_kept = keep_lines && (c.code == '\n' || c.code == '\t');
    // An invalid byte is escaped alone, so that the character after it stays readable.
    if (c.bytes == 0)
      result += fmt::format("\\x{:02x}", static_cast<unsigned char>(text.front()));
    else if ((c.code < 0x20 && !is_kept) || is_invisible(c.code))
      append_escape(result, c.code);
    else
      result += text.substr(0, c.bytes);
    text.remove_prefix(std::max<std::size_t>(1, c.bytes));
  }
  return result;
}

}  // namespace

std::string escaped(std::string_view text) { return escape(text, false); }
std::string escape_keeping_lines(std::string_view text) { return escape(text, true); }

namespace {

std::string input_error_message(const std::string& file, int line, int column,
                                const std::string& expected, const std::string& seen) {
  std::string location = escaped(file);
  if (line > 0) location.append(":").append(std::to_string(line));
  if (line > 0 && column > 0) location.append(":").append(std::to_string(column));
  return location + ": expected " + escaped(expected) + ", seen " + escaped(seen);
}

}  // namespace

BadInput::BadInput(std::string file_, int line_, int column_, std::string expected_,
                   std::string seen_)
    : std::runtime_error(input_error_message(file_, line_, column_, expected_, seen_)),
      file(std::move(file_)),
      line(line_),
      column(column_),
      expected(std::move(expected_)),
      seen(std::move(seen_)) {}

void InputErrorList::add(const BadInput& error) {
  const auto is_duplicate = [&](const BadInput& other) {
    return std::string_view(other.what()) == std::string_view(error.what());
  };
  if (full() || std::any_of(list_.begin(), list_.end(), is_duplicate)) return;
  // One entry is added beyond the limit, to say that there are more errors.
  if (list_.size() == max_errors) {
    list_.emplace_back(error.file, 0, 0, "at most 200 input errors", "more, not listed");
    return;
  }
  list_.push_back(error);
}

}  // namespace abbe
