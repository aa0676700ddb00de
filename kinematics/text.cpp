#include "kinematics/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <system_error>

#include <fmt/format.h>

#include "kinematics/bad_input.h"

namespace abbe {

namespace {

// 64 KiB suffice for the statistics of an encoding and keep the effort constant for large files.
constexpr std::size_t max_sample_bytes = std::size_t(1) << 16;

bool is_control(unsigned char c) { return (c < 0x20 && (c < 0x09 || c > 0x0d)) || c == 0x7f; }

/// Returns true for a letter, digit, blank, line end or common punctuation mark of EBCDIC.
bool is_ebcdic(unsigned char c) {
  const int low = c & 0x0f;
  const bool is_letter = (c >= 0xc1 && c <= 0xe9 && low >= 1 && low <= 9) ||
                         (c >= 0x81 && c <= 0xa9 && low >= 1 && low <= 9);
  return is_letter || (c >= 0xf0 && c <= 0xf9) || c == 0x40 || c == 0x15 || c == 0x25 ||
         c == 0x0d || c == 0x4b || c == 0x4d || c == 0x5d || c == 0x60 || c == 0x61 || c == 0x6b ||
         c == 0x6c || c == 0x7b || c == 0x7e;
}

/// Numbers of bytes of a text by kind: NUL at even and at odd positions, control characters, EBCDIC
/// characters, and bytes from 0x80 on.
struct ByteCounts {
  std::size_t bytes = 0, even_nul = 0, odd_nul = 0, control = 0, ebcdic = 0, high = 0;
};

/// Returns the numbers of bytes of a text by kind.
ByteCounts count_bytes(std::string_view text) {
  ByteCounts counts;
  counts.bytes = text.size();
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c == 0) ++(i % 2 == 0 ? counts.even_nul : counts.odd_nul);
    counts.control += is_control(c);
    counts.ebcdic += is_ebcdic(c);
    counts.high += c >= 0x80;
  }
  return counts;
}

/// Returns the name of the encoding; empty if the text may be ASCII, UTF-8 or a code page that
/// extends ASCII.
std::optional<std::string> foreign_encoding(std::string_view text) {
  using namespace std::string_view_literals;
  if (text.starts_with("\xff\xfe\0\0"sv) || text.starts_with("\0\0\xfe\xff"sv)) return "UTF-32";
  if (text.starts_with("\xff\xfe"sv)) return "UTF-16, little endian";
  if (text.starts_with("\xfe\xff"sv)) return "UTF-16, big endian";
  // NUL bytes at the beginning are the leader of a paper tape.
  const std::size_t begin = text.find_first_not_of('\0');
  if (begin == std::string_view::npos) return std::nullopt;
  text = text.substr(begin - begin % 2, max_sample_bytes);
  const std::size_t last = text.find_last_not_of("\0\r"sv);
  text = text.substr(0, std::min(text.size(), (last / 2 + 1) * 2));
  const ByteCounts n = count_bytes(text);
  const double half = 0.5 * double(n.bytes);
  // Latin text in UTF-16 has NUL in every other byte. 0.7 leaves room for other letters, 0.1 for a
  // stray NUL; fewer than 8 bytes prove nothing.
  if (n.bytes >= 8 && double(n.odd_nul) > 0.7 * half && double(n.even_nul) < 0.1 * half)
    return "UTF-16, little endian";
  if (n.bytes >= 8 && double(n.even_nul) > 0.7 * half && double(n.odd_nul) < 0.1 * half)
    return "UTF-16, big endian";
  // EBCDIC has its letters above 0x7F; 0.4 and 0.9 are far from text in a code page, of which few
  // bytes are EBCDIC letters.
  if (n.high >= 8 && double(n.high) > 0.4 * double(n.bytes) &&
      double(n.ebcdic) > 0.9 * double(n.bytes))
    return "EBCDIC";
  if (n.control >= 16 && double(n.control) > 0.1 * double(n.bytes)) return "binary data";
  return std::nullopt;
}

/// Returns the position of the first CR between two tokens that has no adjacent LF. A control reads
/// such lines as one line, so a program split at the CR, or without it, would move differently.
std::optional<std::size_t> find_lone_cr(std::string_view text) {
  using namespace std::string_view_literals;
  constexpr std::string_view movement_bytes = "\r\n\0"sv;
  const std::size_t last = text.find_last_not_of(movement_bytes);
  for (std::size_t at = std::min(text.find_first_not_of(movement_bytes), text.size());
       (at = text.find('\r', at)) < last && last != std::string_view::npos;) {
    const std::size_t begin = text.find_last_not_of(movement_bytes, at) + 1;
    const std::size_t end = text.find_first_not_of(movement_bytes, at);
    if (text.substr(begin, end - begin).find('\n') == std::string_view::npos) return at;
    at = end;
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::size_t> find_invalid_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i]);
    // 0xC0 and 0xC1 could only start overlong encodings; 4 stands for an invalid first byte.
    const std::size_t continuation_bytes = c < 0x80    ? 0
                                           : c >= 0xf0 ? 3
                                           : c >= 0xe0 ? 2
                                           : c >= 0xc2 ? 1
                                                       : 4;
    if (continuation_bytes == 4 || c > 0xf4 || i + continuation_bytes >= text.size()) return i;
    for (std::size_t k = 1; k <= continuation_bytes; ++k)
      if ((static_cast<unsigned char>(text[i + k]) & 0xc0) != 0x80) return i;
    i += continuation_bytes + 1;
  }
  return std::nullopt;
}

void check_encoding(std::string_view text, const std::string& file) {
  if (auto seen = foreign_encoding(text))
    throw BadInput(file, 1, 1, "text in ASCII or UTF-8", std::move(*seen));
  if (const auto at = find_lone_cr(text)) {
    const std::string_view text_before = text.substr(0, *at);
    const auto line = 1 + std::count(text_before.begin(), text_before.end(), '\n');
    const std::size_t begin = text_before.rfind('\n');  // npos + 1 is 0
    throw BadInput(file, int(line), int(*at - (begin + 1)) + 1,
                   "lines that end in LF or CR LF, not in CR alone as on old Macintosh computers",
                   "a lone CR");
  }
}

std::string strip_tape_characters(std::string_view text) {
  const auto is_movement_byte = [](char c) { return c == '\r' || c == '\n' || c == '\0'; };
  std::string result;
  result.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    if (!is_movement_byte(text[at])) {
      result += text[at++];
      continue;
    }
    std::size_t end = at;
    while (end < text.size() && is_movement_byte(text[end])) ++end;
    const std::string_view movement_run = text.substr(at, end - at);
    const auto lines = std::count(movement_run.begin(), movement_run.end(), '\n');
    // Within a line, NUL and CR separate tokens and are kept for `check_encoding`; at a line end
    // they are feed characters of the tape.
    if (lines > 0 || at == 0 || end == text.size())
      result.append(std::size_t(lines), '\n');
    else
      result += movement_run;
    at = end;
  }
  return result;
}

std::string read_text(const std::filesystem::path& file, std::size_t max_bytes) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(file, failure))
    throw BadInput(
        file.string(), 0, 0, "a file",
        std::filesystem::exists(file, failure) ? "something that is not a file" : "none");
  const auto bytes = std::filesystem::file_size(file, failure);
  if (failure) throw BadInput(file.string(), 0, 0, "a readable file", failure.message());
  if (bytes > max_bytes)
    throw BadInput(file.string(), 0, 0, fmt::format("at most {} bytes", max_bytes),
                   fmt::format("{}", bytes));
  std::string text(std::size_t(bytes), '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(text.data(), std::streamsize(bytes));
  if (!stream) throw BadInput(file.string(), 0, 0, "a readable file", "an unreadable file");
  return text;
}

LineReader::LineReader(std::string_view text) : rest_(text) {
  if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
}

std::optional<std::string_view> LineReader::next() {
  if (rest_.empty()) return std::nullopt;
  ++number_;
  const std::size_t end = rest_.find('\n');
  std::string_view line = rest_.substr(0, end);
  rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
  // CR LF, and LF CR CR as punched on tape.
  while (line.ends_with('\r')) line.remove_suffix(1);
  while (line.starts_with('\r')) line.remove_prefix(1);
  return line;
}

std::string shown(std::string_view text) {
  // 40 bytes identify an entry and keep a message on one line.
  std::string excerpt;
  for (const char c : text.substr(0, 40)) {
    if (c >= ' ' && c <= '~')
      excerpt += c;
    else
      excerpt += fmt::format("\\x{:02X}", static_cast<unsigned char>(c));
  }
  return text.size() > 40 ? excerpt + "..." : excerpt;
}

std::string quoted_excerpt(std::string_view text) {
  return text.empty() ? "nothing" : "'" + shown(text) + "'";
}

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }

Cell trim_blanks(std::string_view text, std::size_t at) {
  while (!text.empty() && is_blank(text.front())) {
    text.remove_prefix(1);
    ++at;
  }
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return {text, int(at) + 1};
}

}  // namespace

char cell_separator(std::string_view line) {
  // The semicolon comes first: where it separates, the comma may be the decimal sign.
  for (const char c : {';', ','})
    if (line.find(c) != std::string_view::npos) return c;
  return ' ';
}

std::vector<Cell> split_cells(std::string_view line, char separator, std::size_t max_cells) {
  std::vector<Cell> cells;
  std::size_t at = 0;
  while (cells.size() <= max_cells) {
    if (separator == ' ') {
      at = std::min(line.find_first_not_of(" \t", at), line.size());
      if (at == line.size()) break;
    }
    const std::size_t end = std::min(
        separator == ' ' ? line.find_first_of(" \t", at) : line.find(separator, at), line.size());
    cells.push_back(trim_blanks(line.substr(at, end - at), at));
    if (end == line.size()) break;
    at = end + 1;
  }
  return cells;
}

std::optional<double> number_of(std::string_view text) {
  double x = 0.0;
  // std::from_chars accepts no plus sign.
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
  if (error != std::errc{} || end != text.data() + text.size() || !(std::abs(x) <= 1e9))
    return std::nullopt;
  return x;
}

TableLineReader::TableLineReader(std::string_view text, std::string file,
                                 std::optional<char> comment)
    : lines_(text), file_(std::move(file)), comment_(comment) {
  check_encoding(text, file_);
}

std::optional<Line> TableLineReader::next() {
  while (const auto text = lines_.next()) {
    for (std::size_t i = 0; i < text->size(); ++i) {
      const auto c = static_cast<unsigned char>((*text)[i]);
      if ((c < ' ' && c != '\t') || c == 0x7f)
        refuse(int(i) + 1, "plain text", fmt::format("a byte 0x{:02x}", c));
    }
    const std::string_view content = trim_blanks(*text, 0).text;
    if (!content.empty() && content.front() != comment_) return Line{*text, number()};
  }
  return std::nullopt;
}

void TableLineReader::refuse(int column, const std::string& expected,
                             const std::string& seen) const {
  throw BadInput(file_, number(), column, expected, seen);
}

void TableLineReader::refuse(const Cell& cell, const std::string& expected) const {
  refuse(cell.column, expected, quoted_excerpt(cell.text));
}

double TableLineReader::number_in(const Cell& cell) const {
  const auto x = number_of(cell.text);
  if (!x) refuse(cell, "a number within +-1e9");
  return *x;
}

int TableLineReader::read_whole_number(const Cell& cell, int min, int max) const {
  const auto x = number_of(cell.text);
  if (!x || *x != std::floor(*x) || *x < min || *x > max)
    refuse(cell, fmt::format("an integer from {} to {}", min, max));
  return int(*x);
}

}  // namespace abbe
