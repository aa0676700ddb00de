#include "kinematics/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <system_error>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/encoding.h"

namespace abbe {

std::string read_text(const std::filesystem::path& file, std::size_t max_bytes) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(file, failure))
    throw BadInput(file.string(), 0, 0, "a file",
                   std::filesystem::exists(file, failure) ? "something else" : "none");
  const auto bytes = std::filesystem::file_size(file, failure);
  if (failure) throw BadInput(file.string(), 0, 0, "a readable file", failure.message());
  if (bytes > max_bytes)
    throw BadInput(file.string(), 0, 0, fmt::format("at most {} bytes", max_bytes),
                   fmt::format("{}", bytes));
  std::string text(std::size_t(bytes), '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(text.data(), std::streamsize(bytes));
  if (!stream) throw BadInput(file.string(), 0, 0, "a readable file", "one that cannot be read");
  return text;
}

Lines::Lines(std::string_view text) : rest_(text) {
  if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
}

std::optional<std::string_view> Lines::next() {
  if (rest_.empty()) return std::nullopt;
  ++number_;
  const std::size_t end = rest_.find('\n');
  std::string_view line = rest_.substr(0, end);
  rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
  // CR LF, and the LF CR CR of a tape
  while (line.ends_with('\r')) line.remove_suffix(1);
  while (line.starts_with('\r')) line.remove_prefix(1);
  return line;
}

std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 40)) {
    if (c >= ' ' && c <= '~')
      out += c;
    else
      out += fmt::format("\\x{:02X}", static_cast<unsigned char>(c));
  }
  return text.size() > 40 ? out + "..." : out;
}

std::string in_quotes(std::string_view text) {
  return text.empty() ? "nothing" : "'" + shown(text) + "'";
}

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }

Cell trimmed(std::string_view text, std::size_t at) {
  while (!text.empty() && is_blank(text.front())) {
    text.remove_prefix(1);
    ++at;
  }
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return {text, int(at) + 1};
}

}  // namespace

char separator_of(std::string_view line) {
  for (const char c : {';', ','})
    if (line.find(c) != std::string_view::npos) return c;
  return ' ';
}

std::vector<Cell> cells_of(std::string_view line, char separator, std::size_t most) {
  std::vector<Cell> cells;
  std::size_t at = 0;
  while (cells.size() <= most) {
    if (separator == ' ') {
      at = std::min(line.find_first_not_of(" \t", at), line.size());
      if (at == line.size()) break;
    }
    const std::size_t end = std::min(
        separator == ' ' ? line.find_first_of(" \t", at) : line.find(separator, at), line.size());
    cells.push_back(trimmed(line.substr(at, end - at), at));
    if (end == line.size()) break;
    at = end + 1;
  }
  return cells;
}

std::optional<double> number_of(std::string_view text) {
  double x = 0.0;
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), x);
  if (fault != std::errc{} || end != text.data() + text.size() || !(std::abs(x) <= 1e9))
    return std::nullopt;
  return x;
}

TableLines::TableLines(std::string_view text, std::string file, std::optional<char> comment)
    : lines_(text), file_(std::move(file)), comment_(comment) {
  check_encoding(text, file_);
}

std::optional<Line> TableLines::next() {
  while (const auto text = lines_.next()) {
    for (std::size_t i = 0; i < text->size(); ++i) {
      const auto c = static_cast<unsigned char>((*text)[i]);
      if ((c < ' ' && c != '\t') || c == 0x7f)
        refuse(int(i) + 1, "plain text", fmt::format("a byte 0x{:02x}", c));
    }
    const std::string_view content = trimmed(*text, 0).text;
    if (!content.empty() && content.front() != comment_) return Line{*text, number()};
  }
  return std::nullopt;
}

void TableLines::refuse(int column, const std::string& expected, const std::string& seen) const {
  throw BadInput(file_, number(), column, expected, seen);
}

void TableLines::refuse(const Cell& cell, const std::string& expected) const {
  refuse(cell.column, expected, in_quotes(cell.text));
}

double TableLines::number_in(const Cell& cell) const {
  const auto x = number_of(cell.text);
  if (!x) refuse(cell, "a number within +-1e9");
  return *x;
}

int TableLines::count_in(const Cell& cell, int least, int most) const {
  const auto x = number_of(cell.text);
  if (!x || *x != std::floor(*x) || *x < least || *x > most)
    refuse(cell, fmt::format("a whole number from {} to {}", least, most));
  return int(*x);
}

}  // namespace abbe
