#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "sim/study/study.h"

namespace abbe::sim::study {

/// Returns a CSV field by RFC 4180: quoted if it holds a comma, a quote or an end of line.
std::string csv_field(const std::string& text);

/// Returns the shortest text that reads back to the same bits; empty if there is no value.
std::string csv_field(double value);
std::string csv_field(const std::optional<double>& value);

/// Returns a part of a file name that is valid on any system: letters, digits, "_" and "." of
/// `text`, one "-" for any sequence of other characters; at most 80 bytes, never empty, never
/// starting with ".".
std::string file_part(const std::string& text);

/// Unique names of the files of one folder.
class PictureNames {
 public:
  /// Returns the parts joined by "-", with a number appended if the name is taken; the comparison
  /// ignores case.
  std::string unused(const std::vector<std::string>& parts);

 private:
  std::set<std::string> taken_;
};

// Labels of tables and pictures; scripts get the names of study.h.

/// Returns the label of a response: "PV", "area in tolerance".
std::string title_of(Response response);
/// Returns the unit of a response as shown: "µm", "%".
std::string shown_unit(Response response);
/// Returns a unit as shown: "um" as "µm", "urad" as "µrad", "deg" as "°"; others unchanged.
std::string shown_unit(const std::string& unit);

/// Returns the unit of an input: "um", "W_per_K"; "1" for a dimensionless number, such as a factor.
std::string unit_of(const Input& input);

/// Returns the text on one line: every end of line and every invisible character becomes a space.
std::string one_line(const std::string& text);

/// Returns the text on one line with at most `most` characters; the middle is cut first, because
/// names differ at their ends.
std::string short_line(const std::string& text, std::size_t most);

/// A table whose empty columns are left out; the first `text_columns` columns are text, aligned
/// left, the others are figures, aligned right.
struct TextTable {
  std::vector<std::string> heads;
  std::vector<std::vector<std::string>> rows{};
  std::size_t text_columns = 1;
};

/// Output format of a report.
enum class TextStyle {
  Markdown,  ///< files
  Terminal,  ///< terminal: no mark-up, aligned columns
};

/// Returns a foreign text, such as a name, on one line and without effect: mark-up is escaped in
/// Markdown.
std::string plain(TextStyle style, const std::string& text);
/// Returns a text in bold if the style has bold.
std::string strong(TextStyle style, const std::string& text);
/// @param level  1 for the whole document, 2 for a section
std::string heading(TextStyle style, int level, const std::string& text);
/// Returns a warning that must not be overlooked, as a paragraph.
std::string notice(TextStyle style, const std::string& text);
/// Returns a table followed by an empty line.
std::string table(TextStyle style, const TextTable& table);

/// Returns the number of terminal columns of a text: East Asian letters take two, combining accents
/// none.
std::size_t columns_of(const std::string& text);

}  // namespace abbe::sim::study
