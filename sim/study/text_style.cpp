#include "sim/study/text_style.h"

#include <algorithm>
#include <string_view>

#include "sim/study/words.h"

namespace abbe::sim::study {
namespace {

std::string without_mark_up(const std::string& line) {
  const auto is_word = [&](std::size_t i) {
    return i < line.size() && std::isalnum(static_cast<unsigned char>(line[i])) != 0;
  };
  std::string result;
  for (std::size_t i = 0; i < line.size(); ++i) {
    // an underscore within a word is none of Markdown's
    const bool emphasis = line[i] == '_' && !(i > 0 && is_word(i - 1) && is_word(i + 1));
    if (emphasis || std::string_view("\\`*<>[]|&~#$").find(line[i]) != std::string_view::npos)
      result += '\\';
    result += line[i];
  }
  return result;
}

/// Columns in which any row says something.
std::vector<std::size_t> kept_columns(const TextTable& table) {
  std::vector<std::size_t> kept;
  for (std::size_t j = 0; j < table.heads.size(); ++j)
    if (std::ranges::any_of(table.rows, [&](const auto& row) { return !row[j].empty(); }))
      kept.push_back(j);
  return kept;
}

std::string markdown_table(const TextTable& table) {
  const std::vector<std::size_t> kept = kept_columns(table);
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text = "|";
    for (const std::size_t j : kept) text += " " + cells[j] + " |";
    return text + "\n";
  };
  std::string text = line(table.heads) + "|";
  for (const std::size_t j : kept) text += j < table.text_columns ? "---|" : "---:|";
  text += "\n";
  for (const auto& row : table.rows) text += line(row);
  return text + "\n";
}

std::string terminal_table(const TextTable& table) {
  const std::vector<std::size_t> kept = kept_columns(table);
  std::vector<std::size_t> widths(table.heads.size(), 0);
  for (const std::size_t j : kept) {
    widths[j] = columns_of(table.heads[j]);
    for (const auto& row : table.rows) widths[j] = std::max(widths[j], columns_of(row[j]));
  }
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text;
    for (const std::size_t j : kept) {
      const std::string space(widths[j] - columns_of(cells[j]), ' ');
      if (!text.empty()) text += "  ";
      text += j < table.text_columns ? cells[j] + space : space + cells[j];
    }
    return text.substr(0, text.find_last_not_of(' ') + 1) + "\n";
  };
  std::string rule;
  for (const std::size_t j : kept) rule += (rule.empty() ? "" : "  ") + std::string(widths[j], '-');
  std::string text = line(table.heads) + rule + "\n";
  for (const auto& row : table.rows) text += line(row);
  return text + "\n";
}

/// Ranges of letters that are drawn over the one before.
bool is_mark(char32_t c) {
  return (c >= 0x300 && c <= 0x36f) || (c >= 0x200b && c <= 0x200f) || (c >= 0xfe00 && c <= 0xfe0f);
}

/// Ranges of letters that take two columns (Unicode, East Asian width).
bool is_wide(char32_t c) {
  return (c >= 0x1100 && c <= 0x115f) || (c >= 0x2e80 && c <= 0xa4cf) ||
         (c >= 0xac00 && c <= 0xd7a3) || (c >= 0xf900 && c <= 0xfaff) ||
         (c >= 0xfe30 && c <= 0xfe6f) || (c >= 0xff00 && c <= 0xff60) ||
         (c >= 0x1f300 && c <= 0x1faff) || (c >= 0x20000 && c <= 0x3fffd);
}

}  // namespace

std::string plain(TextStyle style, const std::string& text) {
  const std::string line = one_line(text);
  return style == TextStyle::Markdown ? without_mark_up(line) : line;
}

std::string strong(TextStyle style, const std::string& text) {
  return style == TextStyle::Markdown ? "**" + text + "**" : text;
}

std::string heading(TextStyle style, int level, const std::string& text) {
  if (style == TextStyle::Markdown)
    return std::string(std::size_t(level), '#') + " " + text + "\n\n";
  return text + "\n" + std::string(columns_of(text), level == 1 ? '=' : '-') + "\n\n";
}

std::string notice(TextStyle style, const std::string& text) {
  return (style == TextStyle::Markdown ? "> " : "warning: ") + text + "\n\n";
}

std::string table(TextStyle style, const TextTable& table) {
  return style == TextStyle::Markdown ? markdown_table(table) : terminal_table(table);
}

std::size_t columns_of(const std::string& text) {
  std::size_t columns = 0;
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead < 0x80 ? 1 : lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
    char32_t c = length == 1 ? lead : lead & (0xffu >> (length + 1));
    for (std::size_t k = 1; k < length && i + k < text.size(); ++k)
      c = (c << 6) | (static_cast<unsigned char>(text[i + k]) & 0x3fu);
    columns += is_mark(c) ? 0 : is_wide(c) ? 2 : 1;
    i += length;
  }
  return columns;
}

}  // namespace abbe::sim::study
