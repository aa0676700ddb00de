#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "sim/study/study.h"

namespace abbe::sim::study {

/// Returns a CSV field by RFC 4180: quoted if the text contains a comma, a quote or a line break.
std::string csv_field(const std::string& text);

/// Returns the shortest text that reads back to the same bits; empty if there is no value.
std::string csv_field(double value);
std::string csv_field(const std::optional<double>& value);

/// Returns a part of a file name that is valid on any system. Letters, digits, "_" and "." of
/// `text` are kept, any sequence of other characters becomes one "-". The part has 1 to 80 bytes
/// and does not start with ".".
std::string file_name_part(const std::string& text);

/// Unique names of the files of one folder.
class PictureNames {
 public:
  /// Returns the parts joined by "-". If that name is used already, whatever its case, a number is
  /// appended.
  std::string unique_name(const std::vector<std::string>& parts);

 private:
  std::set<std::string> used_names_;  ///< in lower case
};

// Labels of tables and pictures. Files for scripts have the names of study.h.

/// Returns the label of a response, such as "PV" or "area in tolerance".
std::string response_title(Response response);
/// Returns the unit of a response for display: "µm" or "%".
std::string display_unit(Response response);
/// Returns a unit for display: "um" becomes "µm", "urad" "µrad" and "deg" "°"; others are
/// unchanged.
std::string display_unit(const std::string& unit);

/// Returns the unit of an input, such as "um" or "W_per_K"; "1" if it is dimensionless.
std::string unit_of(const Input& input);

/// Returns the text on one line: line breaks and control characters become spaces.
std::string one_line(const std::string& text);

/// Returns the text on one line with at most `max_characters` characters. The middle is left out
/// first, because names differ mostly at their ends.
std::string shortened_line(const std::string& text, std::size_t max_characters);

/// A table. Empty columns are not written. The first `text_columns` columns are text, aligned to
/// the left; the others are figures, aligned to the right.
struct TextTable {
  std::vector<std::string> heads;
  std::vector<std::vector<std::string>> rows{};
  std::size_t text_columns = 1;
};

/// Output format of a report.
enum class TextStyle {
  Markdown,
  Terminal,  ///< without mark-up, with aligned columns
};

/// Returns a text of the user, such as a name, on one line; in Markdown its mark-up is escaped.
std::string user_text(TextStyle style, const std::string& text);
/// Returns a text in bold if the style has bold type.
std::string bold_text(TextStyle style, const std::string& text);
/// Returns a heading.
/// @param level  1 for the document, 2 for a section
std::string heading(TextStyle style, int level, const std::string& text);
/// Returns a warning as a paragraph.
std::string warning_paragraph(TextStyle style, const std::string& text);
/// Returns a table followed by an empty line.
std::string table(TextStyle style, const TextTable& table);

/// Returns the number of terminal columns of a text. East Asian characters take two, combining
/// accents none.
std::size_t terminal_width(const std::string& text);

}  // namespace abbe::sim::study
