#include "sim/dialects/flow.h"
#include "sim/dialects/heidenhain/heidenhain.h"

namespace abbe::sim::dialects {
namespace heidenhain {

/// A text and its labels.
struct LabelledSource : Source {
  bool are_labels_collected = false;
  std::unordered_map<std::string, std::vector<std::size_t>> labels;  ///< lines by label
};

/// A running program or label.
struct Call {
  LabelledSource* source = nullptr;
  std::size_t return_line = 0;  ///< line to continue with after the call
  bool is_program = true;
  bool is_caller_inch = false;                        ///< unit of the caller
  bool has_begun = false;                             ///< BEGIN PGM has been read
  std::map<std::size_t, int> remaining_repeats = {};  ///< by the line of CALL LBL
};

/// Flow of a program: executes Q parameters, jumps, labels and calls, and passes all other blocks
/// to the machine.
class Flow : public ProgramFlow<LabelledSource, Call> {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;

 private:
  /// A Q parameter as programmed.
  struct Parameter {
    std::string kind;  ///< "Q", "QL", "QR"
    int number = 0;
    std::size_t from = 0;
    std::string name() const { return kind + std::to_string(number); }
  };

  const Source& source() const override { return *calls_.back().source; }
  bool has_ended() const override { return has_ended_ || machine_.has_ended(); }
  void end_call() override { end_program(); }
  bool execute_line() override;
  bool execute_block(Cursor block) override;
  void execute_block();
  /// Executes a block of program flow. Returns false for any other keyword.
  bool execute_flow_statement(const std::string& keyword, WordReader& words);
  bool is_corner_next(const Call& call, std::size_t line) const;
  void begin_program(WordReader& words);
  void end_program();
  void warn_of_unread_lines();
  void execute_call(WordReader& words);
  void call_label(WordReader& words);
  void call_program(WordReader& words);
  void execute_label(WordReader& words);
  void execute_fn(WordReader& words);
  double fn_result(int number, WordReader& words);
  void execute_if(WordReader& words);
  void execute_assignment(WordReader& words, const Parameter& parameter);
  std::optional<Parameter> parse_parameter(Cursor& cursor) const;
  void set_parameter(const Parameter& parameter, double value, const WordReader& words);
  void set_cycle_parameter(int number, double value);
  double read_parameter(const Parameter& parameter, const Cursor& cursor) const;
  std::size_t line_of_label(const std::string& label, const WordReader& words, std::size_t from);

  Machine machine_;
  std::map<std::string, LabelledSource*> sources_by_file_;
  Block block_;
};

namespace {

/// Returns the first letters of a line after its number in upper case. Returns "?" for a line that
/// begins with another character, and an empty text for a line without words.
std::string first_word(std::string_view line) {
  std::size_t at = 0;
  while (at < line.size() && (is_blank(line[at]) || is_digit(line[at]) || line[at] == '/')) ++at;
  std::string word;
  while (at < line.size() && is_letter(line[at]) && word.size() < 8) word += upper(line[at++]);
  if (word.empty() && at < line.size() && line[at] != ';' && line[at] != '*') word = "?";
  return word;
}

/// Returns the label after LBL in a line, as in CALL LBL 5 or GOTO LBL "END". Returns an empty
/// text if there is none.
std::string find_label(std::string_view line) {
  std::size_t at = line.find("LBL");
  if (at == std::string_view::npos) return {};
  at += 3;
  while (at < line.size() && is_blank(line[at])) ++at;
  const bool is_quoted = at < line.size() && line[at] == '"';
  const std::size_t end = is_quoted ? line.find('"', at + 1) : line.find_first_of(" \t;~", at);
  return std::string(line.substr(at, end == std::string_view::npos ? end : end - at));
}

}  // namespace

Flow::Flow(std::string_view text, ProgramRun& run) : ProgramFlow(run), machine_(run) {
  calls_.push_back({.source = &add_source(text)});
  machine_.on_parameter = [this](int number, double value) { set_cycle_parameter(number, value); };
}

void Flow::run() {
  run_lines();
  run_.try_block([&] { machine_.finish(); });
  warn_of_unread_lines();
}

bool Flow::execute_block(Cursor block) {
  read_block({block.text}, 0, block_);
  return execute_block(), true;
}

bool Flow::execute_line() {
  read_block(source().lines, line_index_, block_);
  line_index_ += block_.line_count;
  try {
    execute_block();
  } catch (const ProgramLimitExceeded&) {
    // Limits and consequences of other errors have locations in the file already.
    throw;
  } catch (const program::BadGeometry&) {
    throw;
  } catch (const program::FollowingError&) {
    throw;
  } catch (const BadInput& input_error) {
    throw relocate_error(block_, input_error);
  }
  return !has_ended_;
}

/// Warns of unread text: subprograms that no CALL LBL or jump names, and everything after END PGM.
void Flow::warn_of_unread_lines() {
  const std::vector<std::string_view>& lines = sources_.front()->lines;
  std::vector<Section> sections = {{}};
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string word = first_word(lines[i]);
    sections.back().end = i;
    // A label begins a section, LBL 0 ends one.
    if (word == "LBL") {
      const std::size_t first = find_label(lines[i]) == "0" ? i + 1 : i;
      sections.push_back({first, first});
    }
    if (word == "END") sections.push_back({i + 1, i + 1});
  }
  sections.back().end = std::max(sections.back().first, lines.size());
  std::map<std::string, int> label_counts;
  for (const std::string_view line : lines) ++label_counts[find_label(line)];
  // A label that occurs more than once is the target of a call or jump.
  std::erase_if(sections, [&](const Section& section) {
    return section.first < lines.size() && first_word(lines[section.first]) == "LBL" &&
           label_counts[find_label(lines[section.first])] > 1;
  });
  run_.warn_of_unread_lines(lines, sections);
}

/// Returns true if the next block rounds or bevels the corner at the end of this one.
bool Flow::is_corner_next(const Call& call, std::size_t line) const {
  constexpr std::size_t max_searched_lines = 20;  // comments may be between the blocks
  const std::vector<std::string_view>& lines = call.source->lines;
  for (std::size_t i = line; i < lines.size() && i < line + max_searched_lines; ++i) {
    const std::string word = first_word(lines[i]);
    if (word.empty()) continue;
    return word == "RND" || word == "CHF";
  }
  return false;
}

void Flow::execute_block() {
  if (!block_.comment.empty()) run_.canon.comment(block_.comment);
  WordReader words({block_.text, run_.canon.place(),
                    block_.block_lines.empty() ? 0
                    : block_.line_count == 1   ? block_.block_lines[0].offset
                                               : 0},
                   *this);
  if (words.at_end() || block_.block_lines.empty()) return;
  run_.count_block();
  if (block_.is_skipped && run_.skips_block(0)) return run_.discount_block();
  const std::size_t from = words.cursor.at;
  // A block that begins with a parameter is an assignment.
  if (const auto parameter = parse_parameter(words.cursor))
    return execute_assignment(words, *parameter);
  words.cursor.at = from;
  const std::string keyword = words.read_name();
  if (execute_flow_statement(keyword, words)) return;
  machine_.execute(keyword, from, words, is_corner_next(calls_.back(), line_index_));
}

bool Flow::execute_flow_statement(const std::string& keyword, WordReader& words) {
  if (keyword == "LBL") return execute_label(words), true;
  if (keyword == "CALL") return execute_call(words), true;
  if (keyword == "FN") return execute_fn(words), true;
  if (keyword == "IF") return execute_if(words), true;
  if (keyword == "BEGIN") return begin_program(words), true;
  if (keyword == "END") {
    words.require_word("PGM", "PGM after END");
    machine_.end_of_program();
    end_program();
    return true;
  }
  return false;
}

void Flow::begin_program(WordReader& words) {
  words.require_word("PGM", "PGM after BEGIN");
  words.cursor.skip_blanks();
  // The name of the program may contain blanks; MM or INCH is the last word.
  const std::string_view name_and_unit = words.cursor.text.substr(words.cursor.at);
  const std::size_t end = name_and_unit.find_last_not_of(" \t");
  const std::size_t space =
      end == std::string_view::npos ? end : name_and_unit.find_last_of(" \t", end);
  std::string unit;
  if (end != std::string_view::npos)
    for (const char c :
         name_and_unit.substr(space == std::string_view::npos ? 0 : space + 1,
                              space == std::string_view::npos ? end + 1 : end - space))
      unit += upper(c);
  if (unit != "MM" && unit != "INCH")
    words.throw_input_error(words.cursor.at, "the program name and MM or INCH after BEGIN PGM");
  const auto program = std::find_if(calls_.rbegin(), calls_.rend(),
                                    [](const Call& call) { return call.is_program; });
  if (std::exchange(program->has_begun, true))
    words.throw_input_error(words.cursor.at, "END PGM before BEGIN PGM of the next program");
  machine_.set_inch(unit == "INCH");
}

/// Ends a program at the end of its file or at END PGM.
void Flow::end_program() {
  while (!calls_.back().is_program) calls_.pop_back();
  if (calls_.size() == 1) {
    has_ended_ = true;
    return;
  }
  line_index_ = calls_.back().return_line;
  machine_.set_inch(calls_.back().is_caller_inch);
  calls_.pop_back();
  variables_.leave();
}

std::size_t Flow::line_of_label(const std::string& label, const WordReader& words,
                                std::size_t from) {
  // Labels are collected once for each file.
  LabelledSource& source = *calls_.back().source;
  if (!source.are_labels_collected) {
    source.are_labels_collected = true;
    for (std::size_t i = 0; i < source.lines.size(); ++i) {
      if (first_word(source.lines[i]) != "LBL") continue;
      Block block;
      read_block(source.lines, i, block);
      WordReader label_words({block.text, run_.canon.place(), block.block_lines[0].offset}, *this);
      label_words.read_name();
      if (!label_words.has_value() && label_words.cursor.current() != '"')
        label_words.cursor.skip_blanks();
      try {
        source.labels[label_words.read_label()].push_back(i);
      } catch (const BadInput&) {  // the block itself reports a malformed label
      }
    }
  }
  const auto entry = source.labels.find(label);
  const Cause cause = words.cursor.cause(from);
  if (entry == source.labels.end() || label == "0")
    run_.refuse_once("LBL " + label, cause, "a label of this program", "LBL " + label);
  // As on the control, a label must be unique.
  if (entry->second.size() > 1)
    run_.refuse_once("LBL " + label, cause, "a label that occurs only once",
                     fmt::format("LBL {} on lines {} and {}", label, entry->second[0] + 1,
                                 entry->second[1] + 1));
  return entry->second.front();
}

void Flow::execute_label(WordReader& words) {
  const std::string name = words.read_label();
  words.expect_end();
  // LBL 0 ends a subprogram. In a program it has no effect.
  if (name != "0" || calls_.back().is_program) return;
  line_index_ = calls_.back().return_line;
  calls_.pop_back();
}

void Flow::execute_call(WordReader& words) {
  if (words.accept("LBL")) return call_label(words);
  if (words.accept("PGM")) return call_program(words);
  words.throw_input_error(words.cursor.at, "LBL or PGM after CALL");
}

void Flow::call_label(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  const std::string name = words.read_label();
  const std::size_t line = line_of_label(name, words, from);
  if (words.at_end()) {
    run_.check_depth(int(calls_.size()), words.cause(from));
    calls_.push_back(
        {.source = calls_.back().source, .return_line = line_index_, .is_program = false});
    line_index_ = line + 1;
    return;
  }
  if (words.read_name() != "REP")
    words.throw_input_error(words.cursor.at, "REP or nothing after CALL LBL");
  if (words.cursor.current() == '/') ++words.cursor.at;  // REP 2/2 of older controls
  const int repeats = words.read_whole_number(65534);
  if (words.cursor.current() == '/') ++words.cursor.at, words.read_whole_number(65534);
  words.expect_end();
  if (line >= line_index_)
    words.cursor.throw_input_error(from, "a label before CALL LBL REP", "a label after it");
  // Each block has a count of its own, so that repeats may nest.
  auto& remaining_repeats = calls_.back().remaining_repeats;
  const auto count = remaining_repeats.emplace(line_index_, repeats).first;
  if (count->second == 0) {
    remaining_repeats.erase(count);
    return;
  }
  --count->second;
  line_index_ = line + 1;
}

void Flow::call_program(WordReader& words) {
  constexpr std::size_t max_name_bytes = 100;
  const std::size_t from = skip_blanks(words.cursor);
  std::string name(words.cursor.text.substr(from));
  while (!name.empty() && is_blank(name.back())) name.pop_back();
  if (name.size() > 1 && name.front() == '"' && name.back() == '"')
    name = name.substr(1, name.size() - 2);
  // The name becomes a file name: a path could lead out of the folder of the program.
  if (name.empty() || name.size() > max_name_bytes ||
      name.find_first_of("/\\:\"") != std::string::npos || name.starts_with('.'))
    words.throw_input_error(from, "the name of a program next to this one, without a path");
  run_.check_depth(int(calls_.size()), {int(from) + 1, words.cursor.text.substr(from)});
  const std::filesystem::path& folder = run_.options().subprogram_folder;
  for (const char* extension : {"", ".h", ".H"})
    if (!folder.empty() && std::filesystem::is_regular_file(folder / (name + extension))) {
      const std::filesystem::path file = folder / (name + extension);
      LabelledSource*& source = sources_by_file_[file.string()];
      if (source == nullptr)
        source = &add_source_file(file, file.filename().string(), "at most 1000 called programs");
      calls_.push_back(
          {.source = source, .return_line = line_index_, .is_caller_inch = machine_.inch()});
      variables_.enter();
      line_index_ = 0;
      return;
    }
  run_.refuse_once("PGM " + name, words.cursor.cause(from),
                   fmt::format("a program {} or {}.h next to this one", name, name), "none");
}

// Q parameters.

namespace {

constexpr double equality_tolerance = 1e-9;  // rounding of Q parameters

bool is_true(const std::string& comparison, double a, double b) {
  if (comparison == "EQU") return std::abs(a - b) < equality_tolerance;
  if (comparison == "NE") return std::abs(a - b) >= equality_tolerance;
  return comparison == "GT" ? a > b : a < b;
}

}  // namespace

std::optional<Flow::Parameter> Flow::parse_parameter(Cursor& cursor) const {
  cursor.skip_blanks();
  if (upper(cursor.current()) != 'Q') return std::nullopt;
  Parameter parameter;
  parameter.from = cursor.at++;
  parameter.kind = "Q";
  if (const char c = upper(cursor.current()); c == 'L' || c == 'R' || c == 'S') {
    parameter.kind += c;
    ++cursor.at;
  }
  const std::size_t digits = cursor.at;
  while (is_digit(cursor.current()) && cursor.at < digits + 4)
    parameter.number = 10 * parameter.number + (cursor.text[cursor.at++] - '0');
  // The control has Q0 to Q1999, QL0 to QL499 and QR0 to QR499.
  const int max_number = parameter.kind == "Q" ? 1999 : 499;
  if (parameter.kind == "QS")
    cursor.throw_input_error(parameter.from, "a numeric parameter: strings in QS are not stored");
  if (cursor.at == digits || is_digit(cursor.current()) || parameter.number > max_number)
    cursor.throw_input_error(
        parameter.from, fmt::format("a number from 0 to {} after {}", max_number, parameter.kind));
  return parameter;
}

std::optional<double> Flow::parse_operand(Cursor& cursor) {
  if (upper(cursor.current()) == 'Q') {
    const auto parameter = parse_parameter(cursor);
    return read_parameter(*parameter, cursor);
  }
  return parse_function(cursor, *this);
}

double Flow::read_parameter(const Parameter& parameter, const Cursor& cursor) const {
  std::optional<double> value;
  // All programs share Q, QL is local to one program, and QR has the numbers from 10000 on.
  if (parameter.kind == "Q") {
    value = variables_.number(parameter.number);
    if (!value) value = machine_.preset_parameter(parameter.number);
  } else if (parameter.kind == "QR") {
    value = variables_.number(10000 + parameter.number);
  } else {
    value = variables_.number(parameter.number, Variables::Scope::Call);
  }
  if (run_.is_uncertain()) run_.require_certain(parameter.name(), cursor.cause(parameter.from));
  if (!value) cursor.throw_input_error(parameter.from, "a parameter that has been set");
  return *value;
}

void Flow::set_parameter(const Parameter& parameter, double value, const WordReader& words) {
  const bool is_local = parameter.kind == "QL";
  const int number = parameter.kind == "QR" ? 10000 + parameter.number : parameter.number;
  // The control itself sets Q100 to Q199.
  if (parameter.kind == "Q" && number >= 100 && number < 200)
    words.cursor.throw_input_error(parameter.from,
                                   "a parameter that the control does not set itself");
  // Cycles copy their parameters at CYCL DEF, so later assignments have no effect.
  if (parameter.kind == "Q" && number >= 200 && number < 500 && machine_.has_cycle())
    run_.warn_once("Q200 to Q499 are set outside CYCL DEF: a defined cycle keeps its values");
  if (!variables_.set(number, value, is_local ? Variables::Scope::Call : Variables::Scope::Program))
    run_.throw_variable_limit(words.cursor.location, "parameters");
}

/// Sets a parameter of CYCL DEF or of a tilted plane for the machine.
void Flow::set_cycle_parameter(int number, double value) {
  if (!variables_.set(number, value)) run_.throw_variable_limit(run_.canon.place(), "parameters");
}

void Flow::execute_assignment(WordReader& words, const Parameter& parameter) {
  words.require("=", "= after a parameter");
  if (next_char(words.cursor) == '"')
    words.throw_input_error(words.cursor.at, "a number: strings in parameters are not stored");
  // A parameter whose assignment has an error is uncertain: its uses are not reported.
  run_.define(parameter.name(), [&] {
    const double value = parse_expression(words.cursor, grammar(), *this);
    words.expect_end();
    set_parameter(parameter, value, words);
  });
}

void Flow::execute_fn(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  const int number = words.read_whole_number(99);
  words.require(":", ": after FN and its number");
  // FN 9 to FN 12 are the comparisons of IF.
  if (number >= 9 && number <= 12) return execute_if(words);
  const std::string name = fmt::format("FN\u00a0{}", number);
  if (const WordTableEntry* entry = find_word(heidenhain_words(), name);
      entry != nullptr && entry->use == WordTreatment::Refused)
    words.throw_input_error(from, std::string(entry->sentence));
  if (number > 13) words.throw_input_error(from, "FN 0 to FN 13");
  const auto parameter = parse_parameter(words.cursor);
  if (!parameter) words.throw_input_error(words.cursor.at, "a Q parameter");
  run_.define(parameter->name(), [&] {
    words.require("=", "= after a parameter");
    set_parameter(*parameter, fn_result(number, words), words);
  });
}

/// Parses the expression after = of FN 0 to FN 8 and FN 13, and returns its value.
double Flow::fn_result(int number, WordReader& words) {
  const auto expect = [&](std::string_view word) { words.require(word, word); };
  if (number == 0 && words.accept("SET"))
    words.throw_input_error(words.cursor.at, "a number: parameters cannot be made undefined");
  if (number >= 5 && number <= 7) expect(number == 5 ? "SQRT" : number == 6 ? "SIN" : "COS");
  const std::size_t from = skip_blanks(words.cursor);
  const double a = words.read_value();
  if (number == 5 && a < 0) words.throw_input_error(from, "a non-negative number");
  double result = number == 5   ? std::sqrt(a)
                  : number == 6 ? std::sin(a * units::deg)
                  : number == 7 ? std::cos(a * units::deg)
                                : a;
  if (number != 0 && (number < 5 || number > 7)) {
    static constexpr std::string_view operators[] = {"", "+", "-", "*", "DIV"};
    expect(number == 8 ? "LEN" : number == 13 ? "ANG" : operators[number]);
    const std::size_t second = skip_blanks(words.cursor);
    const double b = words.read_value();
    if (number == 4 && b == 0) words.throw_input_error(second, "a nonzero divisor");
    if (number == 13 && a == 0 && b == 0)
      words.throw_input_error(second, "two sides of a right triangle, not both zero");
    double angle = std::atan2(a, b) / units::deg;
    // ANG is within 0 to 360 degrees.
    if (angle < 0) angle += 360;
    const double results[] = {0, a + b, a - b, a * b, number == 4 ? a / b : 0};
    result = number == 8 ? std::hypot(a, b) : number == 13 ? angle : results[number];
  }
  words.expect_end();
  if (!std::isfinite(result)) words.throw_input_error(from, "a finite result");
  return result;
}

/// Executes IF, for example IF +Q1 EQU +Q2 GOTO LBL 5.
void Flow::execute_if(WordReader& words) {
  words.accept("IF");
  const double a = words.read_value();
  const std::size_t from = skip_blanks(words.cursor);
  const std::string comparison = words.read_name();
  if (comparison != "EQU" && comparison != "NE" && comparison != "GT" && comparison != "LT")
    words.throw_input_error(from, "EQU, NE, GT or LT");
  const double b = words.read_value();
  if (!words.accept("GOTO") || !words.accept("LBL"))
    words.throw_input_error(words.cursor.at, "GOTO LBL");
  const std::size_t label_from = skip_blanks(words.cursor);
  const std::string label = words.read_label();
  words.expect_end();
  // The label is checked even if the condition is false, so that errors do not depend on
  // parameters.
  const std::size_t line = line_of_label(label, words, label_from);
  if (is_true(comparison, a, b)) line_index_ = line;
}

}  // namespace heidenhain

void read_heidenhain(std::string_view text, ProgramRun& run) { heidenhain::Flow(text, run).run(); }

}  // namespace abbe::sim::dialects
