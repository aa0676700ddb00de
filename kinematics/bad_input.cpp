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

Character first_of(std::string_view text) {
  // smallest code point by length: a longer encoding than needed is invalid UTF-8
  constexpr std::array<std::uint32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
  const auto lead = static_cast<unsigned char>(text.front());
  if (lead < 0x80) return {lead, 1};
  const std::size_t bytes = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : lead >= 0xC0 ? 2 : 0;
  if (bytes == 0 || lead > 0xF4 || text.size() < bytes) return {};
  std::uint32_t code = lead & (0xFFu >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    const auto next = static_cast<unsigned char>(text[i]);
    if ((next & 0xC0) != 0x80) return {};
    code = (code << 6) | (next & 0x3Fu);
  }
  // UTF-8 excludes the halves of a UTF-16 pair and code points beyond U+10FFFF (RFC 3629).
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  if (code < least[bytes] || code > 0x10FFFF || surrogate) return {};
  return {code, bytes};
}

/// Returns true for code points from U+007F on that are invisible: control characters, and format
/// characters that reorder or hide the text around them.
bool is_mark(std::uint32_t code) {
  constexpr std::array<std::pair<std::uint32_t, std::uint32_t>, 12> marks{{
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
  return std::ranges::any_of(
      marks, [&](const auto& range) { return code >= range.first && code <= range.second; });
}

void append_escape(std::string& out, std::uint32_t code) {
  if (code < 0x20) {
    out += fmt::format("\\x{:02x}", code);
  } else if (code < 0x10000) {
    out += fmt::format("\\u{:04x}", code);
  } else {  // surrogate pair of UTF-16, which JSON uses as well
    const std::uint32_t rest = code - 0x10000;
    out += fmt::format("\\u{:04x}\\u{:04x}", 0xD800 + (rest >> 10), 0xDC00 + (rest & 0x3FF));
  }
}

std::string with_escapes(std::string_view text, bool lines) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const Character c = first_of(text);
    const bool kept = lines && (c.code == '\n' || c.code == '\t');
    // An invalid byte is escaped alone, so that the character after it stays readable.
    if (c.bytes == 0)
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text.front()));
    else if ((c.code < 0x20 && !kept) || is_mark(c.code))
      append_escape(out, c.code);
    else
      out += text.substr(0, c.bytes);
    text.remove_prefix(std::max<std::size_t>(1, c.bytes));
  }
  return out;
}

}  // namespace

std::string escaped(std::string_view text) { return with_escapes(text, false); }
std::string escaped_lines(std::string_view text) { return with_escapes(text, true); }

namespace {

std::string text(const std::string& file, int line, int column, const std::string& expected,
                 const std::string& seen) {
  std::string place = escaped(file);
  if (line > 0) place.append(":").append(std::to_string(line));
  if (line > 0 && column > 0) place.append(":").append(std::to_string(column));
  return place + ": expected " + escaped(expected) + ", seen " + escaped(seen);
}

}  // namespace

BadInput::BadInput(std::string file_, int line_, int column_, std::string expected_,
                   std::string seen_)
    : std::runtime_error(text(file_, line_, column_, expected_, seen_)),
      file(std::move(file_)),
      line(line_),
      column(column_),
      expected(std::move(expected_)),
      seen(std::move(seen_)) {}

void InputErrorList::add(const BadInput& fault) {
  const auto same = [&](const BadInput& other) {
    return std::string_view(other.what()) == std::string_view(fault.what());
  };
  if (full() || std::any_of(list_.begin(), list_.end(), same)) return;
  // One entry beyond the limit: it says that there are more.
  if (list_.size() == most) {
    list_.emplace_back(fault.file, 0, 0, "fewer than 200 faults", "more, which are not listed");
    return;
  }
  list_.push_back(fault);
}

}  // namespace abbe
