#pragma once

#include <string>
#include <vector>

namespace abbe::sim::study {

/// A table whose empty columns are left out; the first columns are text and stand left, the others
/// are figures and stand right.
struct TextTable {
  std::vector<std::string> heads;
  std::vector<std::vector<std::string>> rows{};
  std::size_t text_columns = 1;
};

/// How a report is set.
enum class TextStyle {
  Markdown,  ///< for files
  Terminal,  ///< for people: no mark-up, columns below each other
};

/// A foreign text, such as a name, on one line and without effect: of Markdown its mark-up is
/// escaped.
std::string plain(TextStyle style, const std::string& text);
/// A text in bold, where there is such a thing.
std::string strong(TextStyle style, const std::string& text);
/// @param level  1 of the whole, 2 of a part
std::string heading(TextStyle style, int level, const std::string& text);
/// What must not be overlooked, as a paragraph.
std::string notice(TextStyle style, const std::string& text);
/// With an empty line after it.
std::string table(TextStyle style, const TextTable& table);

/// Columns that a text takes on a terminal: letters of East Asia take two, accents of their own
/// none.
std::size_t columns_of(const std::string& text);

}  // namespace abbe::sim::study
