#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

/// Texts from outside that are no text, or one of another encoding than ASCII and UTF-8.
namespace abbe {

/// Returns the first byte that is not UTF-8; none if all are.
std::optional<std::size_t> first_not_utf8(std::string_view text);

/// One input error for a file that no reader of text understands, instead of one a line.
/// @throws BadInput with the encoding: UTF-16, UTF-32, EBCDIC, or none, and for a CR between words
///         without a LF beside it, as in texts whose lines end in CR alone
void check_encoding(std::string_view text, const std::string& file);

/// The text without what only moves a paper tape or a print head: NUL bytes at either end of a line
/// or of the text, and CR beside LF. Lines keep their numbers.
std::string without_tape_marks(std::string_view text);

}  // namespace abbe
