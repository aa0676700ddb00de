#pragma once

#include <string>
#include <string_view>

/// Text from outside on its way to a terminal, a table or a JSON file.
namespace abbe {

/// The same text on one line that any terminal can show: letters of UTF-8 stay, and what would act
/// on a terminal or turn the reading order is spelt out. Control characters below U+0020 and bytes
/// that are not UTF-8 read \x1b; DEL, the controls U+0080 to U+009F, line and paragraph separators,
/// bidirectional and other invisible marks of format read \u202e, as JSON spells them. What is
/// escaped stays as it is when it is escaped again.
std::string escaped(std::string_view text);

/// The same, but the ends of its lines and its tabs stay.
std::string escaped_lines(std::string_view text);

}  // namespace abbe
