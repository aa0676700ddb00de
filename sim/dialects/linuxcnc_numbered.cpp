#include "sim/dialects/linuxcnc_numbered.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/dialects/cursor.h"

namespace abbe::sim::dialects::linuxcnc {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t longest_for_rs274 = 252;             // bytes; longer ones are "too long"
constexpr std::size_t largest_sub = std::size_t(1) << 26;  // bytes
constexpr std::size_t most_subs = 1000;
constexpr std::size_t most_numbered = 1'000'000'000;  // lines

/// The line in capitals without blanks and comments, as RS274 takes it.
std::string compact(std::string_view line) {
  std::string text;
  bool inside = false;
  for (const char c : line) {
    if (c == ';' && !inside) break;
    if (c == '(') inside = true;
    if (!inside && !is_blank(c)) text += upper(c);
    if (c == ')') inside = false;
  }
  return text;
}

/// A number without sign at `at`, which is moved behind it.
std::optional<double> literal(std::string_view text, std::size_t& at) {
  double value = 0.0;
  const char* from = text.data() + at;
  if (from != text.data() + text.size() && *from == '+') ++from;
  const auto [end, failure] =
      std::from_chars(from, text.data() + text.size(), value, std::chars_format::fixed);
  if (failure != std::errc()) return std::nullopt;
  at = std::size_t(end - text.data());
  return value;
}

/// Behind a bracket or a name that begins at `at`.
std::size_t behind(std::string_view text, std::size_t at) {
  const char open = text[at], close = open == '[' ? ']' : '>';
  int depth = 0;
  for (; at < text.size(); ++at) {
    depth += text[at] == open;
    if (text[at] == close && --depth == 0) return at + 1;
  }
  return text.size();
}

struct Words {
  LineCodes codes;
  bool changes = false, changes_by_number = false, calls_number = false;
  bool other_length = false;  ///< G43.1 G43.2
  int p = -1, q = -1;
};

void note_code(Words& words, char letter, double value) {
  const int code =
      int(std::lround(std::clamp(value, 0.0, 1e4) * 10)) + (letter == 'M' ? 100000 : 0);
  LineCodes& codes = words.codes;
  codes.absolute |= code == 530;
  codes.reference |= code == 280 || code == 281 || code == 300 || code == 301;
  codes.length |= code == 430;
  codes.no_length |= code == 490;
  codes.radius |= code == 410 || code == 420;
  codes.data |= code == 100;
  codes.input |= code == 100660;
  words.changes |= code == 100060;
  words.other_length |= code == 431 || code == 432;
  words.changes_by_number |= code == 100610;
  words.calls_number |= code == 100980;
}

Words words_of(std::string_view line) {
  const std::string text = compact(line);
  Words words;
  words.codes.assigns = text.find('=') != std::string::npos;
  for (std::size_t at = 0; at < text.size();) {
    const char letter = text[at];
    if (letter == '[' || letter == '<') {
      at = behind(text, at);
      continue;
    }
    ++at;
    if (letter == '#') {  // the number of a parameter is no word
      const auto number = literal(text, at);
      words.codes.system |= number && *number >= 5221 && *number <= 5390;
      continue;
    }
    if (!is_letter(letter) || at == text.size()) continue;
    const bool is_code = letter == 'G' || letter == 'M';
    words.codes.computed |= is_code && (text[at] == '[' || text[at] == '#');
    const auto value = literal(text, at);
    if (!value && letter == 'H') words.codes.h = not_literal;
    if (!value && letter == 'D') words.codes.d = not_literal;
    if (!value) continue;
    if (is_code) note_code(words, letter, *value);
    const int whole = *value >= 0 && *value <= 1e9 ? int(*value) : -1;
    words.codes.feed |= letter == 'F';
    if (letter == 'H') words.codes.h = whole;
    if (letter == 'D') words.codes.d = whole;
    if (letter == 'L') words.codes.data_kind = whole;
    if (letter == 'T') words.codes.tool = whole;
    if (letter == 'P') words.p = whole;
    if (letter == 'Q') words.q = whole;
  }
  if (words.changes_by_number) words.codes.tool = words.q;
  return words;
}

/// The subprogram that the line calls by a literal name or number, in small letters.
std::string called(std::string_view line, const Words& words) {
  if (words.calls_number && words.p >= 0) return std::to_string(words.p);
  std::string text = compact(line);
  std::size_t at = text.starts_with("N") ? text.find_first_not_of("0123456789.", 1) : 0;
  if (at == std::string::npos || text[at] != 'O') return {};
  ++at;
  const std::size_t end = at < text.size() && text[at] == '<'
                              ? behind(text, at)
                              : text.find_first_not_of("0123456789", at);
  if (end == std::string::npos || text.compare(end, 4, "CALL") != 0) return {};
  std::string name = text.substr(at, end - at);
  if (name.starts_with("<")) name = name.substr(1, name.size() - 2);
  for (char& c : name) c = c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
  return name;
}

/// The words of a block as they stand in it, comments too; blanks between them go with the word
/// before.
std::vector<std::string_view> pieces_of(std::string_view block) {
  std::vector<std::string_view> pieces;
  std::size_t from = 0;
  bool has_number = false;
  const auto cut = [&](std::size_t at) {
    if (at > from) pieces.push_back(block.substr(from, at - from));
    from = at;
    has_number = false;
  };
  for (std::size_t at = 0; at < block.size();) {
    const char c = block[at];
    if (c == '(' || c == ';' || is_letter(c) || (c == '#' && has_number)) cut(at);
    if (c == '(' || c == ';') {
      const std::size_t close = c == '(' ? block.find(')', at) : std::string_view::npos;
      at = close == std::string_view::npos ? block.size() : close + 1;
      cut(at);
    } else if (c == '[' || c == '<') {
      at = behind(block, at);
      has_number = true;
    } else {
      has_number |= is_digit(c);
      ++at;
    }
  }
  cut(block.size());
  return pieces;
}

/// Whether the block changes a tool and the tool length.
bool changes_both(std::string_view block) {
  const Words words = words_of(block);
  return words.changes && !words.codes.assigns &&
         (words.codes.length || words.codes.no_length || words.other_length);
}

/// T and M6 of such a block, and the rest of it: rs274 alone, without the rest of a control, takes
/// the places of the axes again after the block and leaves the new length out of them.
std::pair<std::string, std::string> parted(std::string_view block) {
  std::string change, rest;
  for (const std::string_view piece : pieces_of(block)) {
    const bool goes = upper(piece.front()) == 'T' || words_of(piece).changes;
    (goes ? change : rest) += piece;
  }
  return {change, rest};
}

bool is_plain_name(const std::string& name) {
  return !name.empty() && name.front() != '.' && name.front() != '-' && name.size() < 100 &&
         name.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._"
             "-") == std::string::npos;
}

/// A line without blanks before it, a block delete and a line number.
std::string_view unnumbered_block(std::string_view line) {
  const auto skip = [&](std::string_view what) {
    line.remove_prefix(std::min(line.size(), line.find_first_not_of(what)));
  };
  skip(" \t");
  if (line.starts_with("/")) line.remove_prefix(1);
  skip(" \t");
  if (line.empty() || upper(line.front()) != 'N') return line;
  const std::string_view whole = line;
  line.remove_prefix(1);
  skip(" \t");
  if (line.empty() || !is_digit(line.front())) return whole;
  skip("0123456789");
  if (line.starts_with(".")) {
    line.remove_prefix(1);
    skip("0123456789");
  }
  return line;
}

}  // namespace

LineCodes codes_of(std::string_view line) { return words_of(line).codes; }

NumberedProgram::NumberedProgram(std::string_view text, const std::string& file, std::string before,
                                 ProgramRun& run, const fs::path& folder)
    : run_(run), before_(std::move(before)) {
  name_ = fs::path(file).filename().string();
  if (!is_plain_name(name_)) name_ = "program.ngc";
  add(name_, 0, std::string(text));
  for (std::size_t i = 0; i < files_.size(); ++i) write(files_[i], folder);
}

void NumberedProgram::add(const std::string& name, int of_canon, std::string text) {
  File file{name, of_canon, std::move(text), {}, 1};
  if (!files_.empty()) file.first = files_.back().first + int(files_.back().lines.size());
  files_.push_back(std::move(file));
  File& kept = files_.back();
  kept.lines = lines_of_text(kept.text);
  if (std::size_t(kept.first) + kept.lines.size() > most_numbered)
    throw BadInput(name, 0, 0, fmt::format("at most {} lines", most_numbered), "more");
}

/// What lets a program start something else or read files elsewhere: rs274 runs Python that a line
/// begins with, and goes along paths in the names of subprograms.
void NumberedProgram::refuse_escapes(std::string_view line) const {
  std::string tight;
  for (const char c : line)
    if (!is_blank(c)) tight += upper(c);
  for (const std::string_view python :
       {"(PY,", ";PY,", "(PYRUN", ";PYRUN", "(PYRELOAD", ";PYRELOAD"})
    if (tight.find(python) != std::string::npos)
      run_.canon.refuse({0, line}, "no Python in a comment: a program starts nothing");
  for (std::size_t at = 0; (at = tight.find("O<", at)) != std::string::npos; ++at) {
    const std::string name = tight.substr(at, tight.find('>', at) - at);
    if (name.find('/') != std::string::npos || name.find("..") != std::string::npos)
      run_.canon.refuse({0, line}, "a subprogram beside the program, its name without / and ..");
  }
}

/// A line as rs274 gets it, in two where it would go wrong. One that its number would make too long
/// stays without.
std::string NumberedProgram::numbered(std::string_view line, int number, int file, int at) const {
  run_.canon.stand_at(at, file);
  if (const std::size_t nul = line.find('\0'); nul != std::string_view::npos)
    run_.canon.refuse({int(nul) + 1, {}}, "text", "a NUL byte");
  refuse_escapes(line);
  const std::string_view whole = line.substr(std::min(line.size(), line.find_first_not_of(" \t")));
  if (whole.empty() || whole.front() == '%') return std::string(whole);
  if (whole.front() == '/' && run_.skips(0)) return {};
  const std::string_view block = unnumbered_block(line);
  if (block.size() > longest_for_rs274)
    run_.canon.refuse({},
                      fmt::format("at most {} characters in a line for LinuxCNC's own interpreter",
                                  longest_for_rs274),
                      fmt::format("{}", block.size()));
  const auto with_number = [&](std::string_view rest) {
    std::string text = fmt::format("N{} {}", number, rest);
    return text.size() > longest_for_rs274 ? std::string(rest) : text;
  };
  if (!changes_both(block)) return with_number(block);
  const auto [change, rest] = parted(block);
  return with_number(change) + "\n" + with_number(rest);
}

void NumberedProgram::write(const File& file, const fs::path& folder) {
  const std::vector<std::string_view>& lines = file.lines;
  std::string text;
  std::set<std::string> calls;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string line = numbered(lines[i], file.first + int(i), file.of_canon, int(i) + 1);
    const bool mark = line.starts_with("%");
    if (!line.empty() && !mark) text += std::exchange(before_, {});
    text += line + '\n';
    if (mark) text += std::exchange(before_, {});
    const Words words = words_of(lines[i]);
    if (words.codes.tool > 0) tools_.insert(words.codes.tool);
    if (words.codes.input) {
      run_.canon.stand_at(int(i) + 1, file.of_canon);
      run_.canon.refuse({}, "no wait for an input: there is none to read", "M66");
    }
    if (std::string call = called(lines[i], words); !call.empty()) calls.insert(std::move(call));
  }
  std::ofstream out(folder / file.name, std::ios::binary);
  if (!out.write(text.data(), std::streamsize(text.size())).flush())
    throw BadInput((folder / file.name).string(), 0, 0, "a file that can be written", "a failure");
  for (const std::string& call : calls) {
    const fs::path sub = run_.options().folder / (call + ".ngc");
    const bool known = std::any_of(files_.begin(), files_.end(), [&](const File& one) {
      return one.name == sub.filename().string();
    });
    std::error_code failure;
    if (known || run_.options().folder.empty() || !is_plain_name(call) ||
        !fs::is_regular_file(sub, failure))
      continue;
    if (files_.size() > most_subs)
      run_.canon.refuse({}, fmt::format("at most {} files of subprograms", most_subs), "more");
    add(sub.filename().string(), run_.canon.add_file(sub.string()), read_text(sub, largest_sub));
  }
}

const NumberedProgram::File& NumberedProgram::file_of(int number) const {
  const auto after = std::upper_bound(files_.begin(), files_.end(), number,
                                      [](int n, const File& file) { return n < file.first; });
  return after == files_.begin() ? files_.front() : *(after - 1);
}

SourceLine NumberedProgram::place_of(int number) const {
  const File& file = file_of(number);
  const int last = int(file.lines.size());
  return {file.of_canon, std::clamp(number - file.first + 1, 1, std::max(last, 1))};
}

std::string_view NumberedProgram::text_of(int number) const {
  const File& file = file_of(number);
  const std::size_t at = std::size_t(number - file.first);
  return number >= file.first && at < file.lines.size() ? file.lines[at] : std::string_view();
}

int NumberedProgram::number_of(const std::string& name, int line) const {
  for (const File& file : files_)
    if (file.name == fs::path(name).filename().string())
      return file.first + std::clamp(line, 1, std::max(1, int(file.lines.size()))) - 1;
  return line;
}

}  // namespace abbe::sim::dialects::linuxcnc
