#include "sim/dialects/read_options.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/dialects/cursor.h"
#include "sim/dialects/expression.h"

namespace abbe::sim::dialects {

namespace {

// Signs are at the head of a file; searching millions of further lines would only cost time.
constexpr int max_searched_lines = 2000;
// Bytes; signs are at the start of a line.
constexpr std::size_t max_searched_bytes = 300;

// Texts, separated by |, that occur in programs of one dialect only.
struct Signs {
  Dialect dialect;
  std::string_view texts;
};

// Words with no letter or digit before or after them.
constexpr Signs word_signs[] = {
    {Dialect::Siemens,
     "TRAORI|TRAFOOF|CYCLE832|CYCLE800|SUPA|COMPCAD|COMPCURV|SOFT|FFWON|ORIWKS|ORIAXES|G642|G500|"
     "GOTOF|GOTOB|ENDIF|ENDFOR|PROC|DEF REAL|DEF INT|MCALL|TRANS|ATRANS|AROT|WORKPIECE|M17"},
    {Dialect::Fanuc, "G65|G66|M98|M99|G68.2|G43.5|G05.1|G5.1 Q1|G05 P10000|G08 P1|POPEN|DPRNT"},
    {Dialect::LinuxCnc, "G64 P"},
    {Dialect::Siemens, "DIAMON|DIAM90|DIAMOF"},
    {Dialect::Fanuc, "G50 S"},
    {Dialect::LinuxCnc, "G59.1|G59.2|G59.3"},
};

// Beginnings of lines, after blanks and a block number.
constexpr Signs first_signs[] = {
    {Dialect::Heidenhain, "BEGIN PGM|BLK FORM|TOOL CALL|CYCL DEF"},
    {Dialect::Siemens, "%_N_|;$PATH=|MSG("},
    {Dialect::Cl,
     "PARTNO|GOTO/|GOTO /|FEDRAT/|FEDRAT /|MULTAX|LOADTL|UNITS/|UNITS /|$$|TOOL "
     "PATH/|TLDATA/|SPINDL/|SPINDL /|PPRINT|X,Y,Z|X;Y;Z|X_MM,Y_MM,Z_MM"},
    {Dialect::LinuxCnc, "O<"},
};

struct Sign {
  Dialect dialect;
  std::string_view text;
};

/// Returns the first sign of a table that meets a condition.
template <typename Condition>
std::optional<Sign> find_sign(std::span<const Signs> table, const Condition& is_present) {
  for (const Signs& signs : table)
    for (std::size_t at = 0; at <= signs.texts.size();) {
      const std::size_t end = std::min(signs.texts.find('|', at), signs.texts.size());
      const std::string_view text = signs.texts.substr(at, end - at);
      if (is_present(text)) return Sign{signs.dialect, text};
      at = end + 1;
    }
  return std::nullopt;
}

// The point is included, so that G68.2 is not mistaken for G68.
bool is_word_byte(char c) { return is_letter(c) || is_digit(c) || c == '_' || c == '.'; }

/// Returns the line in upper case without comments, which all dialects but Heidenhain write in ( ).
std::string without_comments(std::string_view line) {
  std::string text;
  bool inside = false;
  for (const char c : line.substr(0, max_searched_bytes)) {
    if (c == '(') inside = true;
    if (!inside) text += upper(c);
    if (c == ')') inside = false;
  }
  // ;$PATH= is a sign of Siemens although it is a comment.
  return text.substr(0, text.find(';', text.starts_with(";$PATH") ? 1 : 0));
}

bool is_whole_word(std::string_view line, std::string_view word) {
  for (std::size_t at = line.find(word); at != std::string_view::npos;
       at = line.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    const bool has_letter_before = at > 0 && is_letter(line[at - 1]);
    const bool has_digit_after = end < line.size() && is_word_byte(line[end]) &&
                                 !is_letter(word.back()) &&
                                 (is_digit(line[end]) || line[end] == '.');
    // A sign such as "G64 P" ends with the address of a number.
    const bool expects_number = word.size() > 1 && is_blank(word[word.size() - 2]);
    const bool is_longer_word =
        end < line.size() && is_letter(word.back()) && !expects_number && is_word_byte(line[end]);
    if (!has_letter_before && !has_digit_after && !is_longer_word) return true;
  }
  return false;
}

/// Returns true for O and a number alone. LinuxCNC's O words have a keyword after the number.
bool is_program_number(std::string_view line) {
  if (line.size() < 2 || line[0] != 'O' || !is_digit(line[1])) return false;
  std::size_t at = 1;
  while (at < line.size() && is_digit(line[at])) ++at;
  while (at < line.size() && is_blank(line[at])) ++at;
  return at == line.size();
}

/// Returns true for an O word of LinuxCNC, for example "O110 endif" or "o<name> call [1]".
bool is_o_word(std::string_view line) {
  if (line.empty() || line[0] != 'O') return false;
  std::size_t at = 1;
  while (at < line.size() && is_blank(line[at])) ++at;
  const std::size_t label = at;
  while (at < line.size() && (is_digit(line[at]) || is_blank(line[at]))) ++at;
  if (at == label && at < line.size() && (line[at] == '#' || line[at] == '[' || line[at] == '<'))
    at = line.find_first_of(">] \t", at);
  if (at == label || at >= line.size()) return false;
  at = line.find_first_not_of(">] \t", at);
  if (at == std::string_view::npos) return false;
  static constexpr std::array<std::string_view, 15> words = {
      "SUB",   "ENDSUB",   "CALL", "RETURN", "IF",        "ELSEIF", "ELSE",    "ENDIF",
      "WHILE", "ENDWHILE", "DO",   "REPEAT", "ENDREPEAT", "BREAK",  "CONTINUE"};
  const std::string_view keyword = line.substr(at);
  return std::ranges::any_of(words,
                             [&](std::string_view word) { return keyword.starts_with(word); });
}

/// Returns an assignment as only Siemens writes it: R1=..., X=..., T="...".
std::optional<std::string> assignment(std::string_view line) {
  for (std::size_t at = line.find('='); at != std::string_view::npos; at = line.find('=', at + 1)) {
    std::size_t from = at;
    while (from > 0 && is_digit(line[from - 1])) --from;
    // One letter with digits before the =; a longer name could belong to another dialect.
    if (from == 0 || !is_letter(line[from - 1])) continue;
    if (from < 2 || is_blank(line[from - 2]))
      return std::string(
          line.substr(from - 1, at + (at + 1 < line.size() && line[at + 1] == '=') + 2 - from));
  }
  return std::nullopt;
}

/// Returns a line without leading blanks and block number.
std::string_view strip_block_number(std::string_view line) {
  static const std::string nowhere;
  Cursor cursor{line, {nowhere, 0}};
  const std::size_t start = skip_blanks(cursor);
  if (cursor.current() == 'N') ++cursor.at;
  const std::size_t digits = cursor.at;
  while (is_digit(cursor.current())) ++cursor.at;
  if (cursor.at == digits) cursor.at = start;
  cursor.skip_blanks();
  return line.substr(std::min(cursor.at, line.size()));
}

// `assignment_text` keeps the text of a sign that is an assignment, which the sign refers to.
std::optional<Sign> find_dialect_sign(std::string_view line, std::string& assignment_text) {
  const std::string_view statement = strip_block_number(line);
  // The most explicit signs come first.
  if (const auto sign = find_sign(
          first_signs, [&](std::string_view text) { return statement.starts_with(text); }))
    return sign;
  if (is_o_word(statement)) return Sign{Dialect::LinuxCnc, "an O word"};
  if (is_program_number(statement)) return Sign{Dialect::Fanuc, "a program number O"};
  if (const auto sign = find_sign(
          word_signs, [&](std::string_view text) { return is_whole_word(statement, text); }))
    return sign;
  if (statement.find("#<") != std::string_view::npos) return Sign{Dialect::LinuxCnc, "#<"};
  // Fanuc, LinuxCNC and Heidenhain assign in lines with #, Q or FN.
  if (statement.find('#') == std::string_view::npos && !statement.empty() && statement[0] != 'Q' &&
      statement.find("FN") == std::string_view::npos)
    if (auto words = assignment(statement)) {
      assignment_text = *words;
      return Sign{Dialect::Siemens, assignment_text};
    }
  return std::nullopt;
}

// Only extensions that a single control uses; .nc, .ngc and .txt are common to several.
std::optional<Dialect> dialect_by_extension(std::string_view file) {
  const std::size_t dot = file.rfind('.');
  if (dot == std::string_view::npos) return std::nullopt;
  std::string extension;
  for (const char c : file.substr(dot + 1)) extension += upper(c);
  static constexpr Signs extensions[] = {{Dialect::Siemens, "MPF|SPF"},
                                         {Dialect::Heidenhain, "H|HH"},
                                         {Dialect::Cl, "CL|CLS|APT|CLD|NCL"},
                                         {Dialect::Fanuc, "EIA|FNC"}};
  if (const auto sign =
          find_sign(extensions, [&](std::string_view text) { return text == extension; }))
    return sign->dialect;
  return std::nullopt;
}

}  // namespace

std::string_view name_of(Dialect dialect) {
  static constexpr std::string_view names[] = {"auto",    "linuxcnc",   "fanuc",
                                               "siemens", "heidenhain", "cl"};
  return names[std::size_t(dialect)];
}

DetectedDialect detect_dialect(std::string_view text, std::string_view file) {
  if (const auto dialect = dialect_by_extension(file))
    return {*dialect, "the file is named " + std::string(file.substr(file.rfind('.')))};
  LineReader lines(text);
  std::string assignment_text;
  for (int n = 0; n < max_searched_lines; ++n) {
    const auto line = lines.next();
    if (!line) break;
    if (const auto sign = find_dialect_sign(without_comments(*line), assignment_text))
      return {sign->dialect, fmt::format("line {} has {}", lines.number(), sign->text),
              lines.number()};
  }
  return {Dialect::LinuxCnc, "no word identifies another dialect"};
}

BadProgram::BadProgram(std::vector<BadInput> list)
    : BadInput(list.at(0)), input_errors(std::move(list)) {
  for (const BadInput& input_error : input_errors)
    text += (text.empty() ? "" : "\n") + std::string(input_error.what());
}

}  // namespace abbe::sim::dialects
