#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "sim/study/study.h"

namespace abbe::sim::study {

/// A field as RFC 4180 has it: quoted where it holds a comma, a quote or an end of line.
std::string csv_field(const std::string& text);

/// Shortest text that reads back the same bits; empty where there is no value.
std::string csv_field(double value);
std::string csv_field(const std::optional<double>& value);

/// Part of a file name on any system: letters, digits, "_" and "." of `text`, one "-" for whatever
/// else stands between them; at most 80 bytes, never empty, no "." first.
std::string file_part(const std::string& text);

/// Names of the files of one folder.
class PictureNames {
 public:
  /// The parts with "-" between them, and a number behind if the name is taken, in whatever case.
  std::string unused(const std::vector<std::string>& parts);

 private:
  std::set<std::string> taken_;
};

// How tables and pictures call things; scripts get the names of study.h.

/// "PV", "area in tolerance"
std::string title_of(Response response);
/// "µm", "%"
std::string shown_unit(Response response);
/// "um" as "µm", "urad" as "µrad", "deg" as "°"; others as they are.
std::string shown_unit(const std::string& unit);

/// "um", "W_per_K"; "1" of an input that is a pure number, such as a factor.
std::string unit_of(const Input& input);

/// The text in one line: whatever ends a line or cannot be seen becomes a space.
std::string one_line(const std::string& text);

/// The same, at most so many characters: the middle goes first, as names differ at their ends.
std::string short_line(const std::string& text, std::size_t most);

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
