#include "sim/study/study_text.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include <fmt/format.h>

namespace abbe::sim::study {

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + "\"";
}

std::string csv_field(double value) { return std::isfinite(value) ? fmt::format("{}", value) : ""; }

std::string csv_field(const std::optional<double>& value) { return value ? csv_field(*value) : ""; }

namespace {

// File systems allow 255 bytes for a file name, which has several parts.
constexpr std::size_t max_part_bytes = 80;

bool is_file_name_char(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '.';
}

std::string lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  return text;
}

}  // namespace

std::string file_name_part(const std::string& text) {
  std::string part;
  for (const char c : text) {
    if (is_file_name_char(c) && !(part.empty() && c == '.'))
      part += c;
    else if (!part.empty() && part.back() != '-')
      part += '-';
    if (part.size() == max_part_bytes) break;
  }
  while (!part.empty() && (part.back() == '-' || part.back() == '.')) part.pop_back();
  return part.empty() ? "unnamed" : part;
}

std::string PictureNames::unique_name(const std::vector<std::string>& parts) {
  std::string name;
  for (const std::string& part : parts) name += (name.empty() ? "" : "-") + file_name_part(part);
  std::string candidate = name;
  // Windows and macOS ignore case in file names.
  for (int number = 2; !used_names_.insert(lower_case(candidate)).second; ++number)
    candidate = name + "-" + std::to_string(number);
  return candidate;
}

std::string response_title(Response response) {
  switch (response) {
    case Response::Pv:
      return "PV";
    case Response::Rms:
      return "RMS";
    case Response::Mean:
      return "mean";
    case Response::Std:
      return "standard deviation";
    case Response::MaxAbs:
      return "largest deviation";
    case Response::P95Abs:
      return "P95 of the absolute deviation";
    case Response::InTolerance:
      return "area in tolerance";
    case Response::FormPv:
      return "PV of form";
    case Response::FormRms:
      return "RMS of form";
    case Response::TextureSa:
      return "Sa of texture";
    case Response::TextureSq:
      return "Sq of texture";
    case Response::TextureSz:
      return "Sz of texture";
  }
  return "";
}

std::string display_unit(const std::string& unit) {
  if (unit == "um") return "µm";
  if (unit == "urad") return "µrad";
  if (unit == "deg") return "°";
  return unit;
}

std::string display_unit(Response response) { return display_unit(std::string(unit_of(response))); }

std::string unit_of(const Input& input) { return input.unit.empty() ? "1" : input.unit; }

std::string one_line(const std::string& text) {
  std::string line;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte != 0x7f)
      line += c;
    else if (!line.empty() && line.back() != ' ')
      line += ' ';
  }
  return line;
}

std::string shortened_line(const std::string& text, std::size_t max_characters) {
  const std::string line = one_line(text);
  std::vector<std::size_t> starts;  // first bytes of the UTF-8 characters
  for (std::size_t i = 0; i < line.size(); ++i)
    if ((static_cast<unsigned char>(line[i]) & 0xC0u) != 0x80u) starts.push_back(i);
  if (starts.size() <= max_characters || max_characters < 3) return line;
  const std::size_t front = max_characters / 2, back = max_characters - 1 - front;
  return line.substr(0, starts[front]) + "…" + line.substr(starts[starts.size() - back]);
}

namespace {

/// Escapes the characters that are mark-up in Markdown.
std::string escape_markdown(const std::string& line) {
  const auto is_word_char = [&](std::size_t i) {
    return i < line.size() && std::isalnum(static_cast<unsigned char>(line[i])) != 0;
  };
  std::string result;
  for (std::size_t i = 0; i < line.size(); ++i) {
    // In Markdown an underscore inside a word does not mark emphasis.
    const bool is_emphasis =
        line[i] == '_' && !(i > 0 && is_word_char(i - 1) && is_word_char(i + 1));
    if (is_emphasis || std::string_view("\\`*<>[]|&~#$").find(line[i]) != std::string_view::npos)
      result += '\\';
    result += line[i];
  }
  return result;
}

/// Returns the columns that have a value in at least one row.
std::vector<std::size_t> filled_columns(const TextTable& table) {
  std::vector<std::size_t> columns;
  for (std::size_t j = 0; j < table.heads.size(); ++j)
    if (std::ranges::any_of(table.rows, [&](const auto& row) { return !row[j].empty(); }))
      columns.push_back(j);
  return columns;
}

std::string markdown_table(const TextTable& table) {
  const std::vector<std::size_t> columns = filled_columns(table);
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text = "|";
    for (const std::size_t j : columns) text += " " + cells[j] + " |";
    return text + "\n";
  };
  std::string text = line(table.heads) + "|";
  for (const std::size_t j : columns) text += j < table.text_columns ? "---|" : "---:|";
  text += "\n";
  for (const auto& row : table.rows) text += line(row);
  return text + "\n";
}

/// Returns the table with columns aligned for a terminal.
std::string terminal_table(const TextTable& table) {
  const std::vector<std::size_t> columns = filled_columns(table);
  std::vector<std::size_t> widths(table.heads.size(), 0);
  for (const std::size_t j : columns) {
    widths[j] = terminal_width(table.heads[j]);
    for (const auto& row : table.rows) widths[j] = std::max(widths[j], terminal_width(row[j]));
  }
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text;
    for (const std::size_t j : columns) {
      const std::string space(widths[j] - terminal_width(cells[j]), ' ');
      if (!text.empty()) text += "  ";
      text += j < table.text_columns ? cells[j] + space : space + cells[j];
    }
    return text.substr(0, text.find_last_not_of(' ') + 1) + "\n";
  };
  std::string rule;
  for (const std::size_t j : columns)
    rule += (rule.empty() ? "" : "  ") + std::string(widths[j], '-');
  std::string text = line(table.heads) + rule + "\n";
  for (const auto& row : table.rows) text += line(row);
  return text + "\n";
}

/// Returns true for a character of no width, such as a combining accent.
bool is_zero_width(char32_t c) {
  return (c >= 0x300 && c <= 0x36f) || (c >= 0x200b && c <= 0x200f) || (c >= 0xfe00 && c <= 0xfe0f);
}

/// Returns true for a character that takes two columns (Unicode, East Asian width).
bool is_wide(char32_t c) {
  return (c >= 0x1100 && c <= 0x115f) || (c >= 0x2e80 && c <= 0xa4cf) ||
         (c >= 0xac00 && c <= 0xd7a3) || (c >= 0xf900 && c <= 0xfaff) ||
         (c >= 0xfe30 && c <= 0xfe6f) || (c >= 0xff00 && c <= 0xff60) ||
         (c >= 0x1f300 && c <= 0x1faff) || (c >= 0x20000 && c <= 0x3fffd);
}

}  // namespace

std::string user_text(TextStyle style, const std::string& text) {
  const std::string line = one_line(text);
  return style == TextStyle::Markdown ? escape_markdown(line) : line;
}

std::string bold_text(TextStyle style, const std::string& text) {
  return style == TextStyle::Markdown ? "**" + text + "**" : text;
}

std::string heading(TextStyle style, int level, const std::string& text) {
  if (style == TextStyle::Markdown)
    return std::string(std::size_t(level), '#') + " " + text + "\n\n";
  return text + "\n" + std::string(terminal_width(text), level == 1 ? '=' : '-') + "\n\n";
}

std::string warning_paragraph(TextStyle style, const std::string& text) {
  return (style == TextStyle::Markdown ? "> " : "warning: ") + text + "\n\n";
}

std::string table(TextStyle style, const TextTable& table) {
  return style == TextStyle::Markdown ? markdown_table(table) : terminal_table(table);
}

std::size_t terminal_width(const std::string& text) {
  std::size_t columns = 0;
  for (std::size_t i = 0; i < text.size();) {
    // The first byte of a UTF-8 character determines its length.
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead < 0x80 ? 1 : lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
    char32_t c = length == 1 ? lead : lead & (0xffu >> (length + 1));
    for (std::size_t k = 1; k < length && i + k < text.size(); ++k)
      c = (c << 6) | (static_cast<unsigned char>(text[i + k]) & 0x3fu);
    columns += is_zero_width(c) ? 0 : is_wide(c) ? 2 : 1;
    i += length;
  }
  return columns;
}

}  // namespace abbe::sim::study
