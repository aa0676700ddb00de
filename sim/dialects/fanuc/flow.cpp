#include "sim/dialects/flow.h"
#include "sim/dialects/fanuc/fanuc.h"
#include "sim/dialects/read_program.h"

namespace abbe::sim::dialects {
namespace fanuc {

/// A program in a file: the lines from its O number to the next O number.
struct Program {
  int number = 0;                  ///< O number; 0 if there is none
  std::size_t source = 0;          ///< index of its file
  std::size_t first = 0, end = 0;  ///< lines
  /// Sequence numbers with their lines; built at the first jump.
  std::optional<std::vector<std::pair<int, std::size_t>>> sequence = {};
  /// Line of END by line of DO, and vice versa; built at the first loop.
  std::optional<std::unordered_map<std::size_t, std::size_t>> loops = {};
};

/// A text with several programs.
struct ProgramFile : Source {
  std::vector<Program> programs;
  std::size_t end = 0;  ///< line of the % that ends the file
};

/// A running program.
struct Call {
  Program* program = nullptr;
  std::size_t return_line = 0;  ///< line of the caller to continue with
  int remaining_repeats = 0;    ///< repeats still to come
  bool has_locals = false;      ///< a macro call, with local variables of its own
  bool is_modal = false;        ///< called by G66
  std::vector<std::pair<int, double>> arguments = {};
};

/// Flow of a program: executes variables, conditions, loops, jumps and calls, and passes all other
/// blocks to the machine.
class Flow : public ProgramFlow<ProgramFile, Call, MacroOperands> {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;

 private:
  /// A modal call (G66), repeated after every block that moves.
  struct ModalCall {
    int program = 0, repeats = 1;
    std::vector<std::pair<int, double>> arguments;
    Cause cause;
  };

  // Lines, statements and variables.
  bool execute_line() override;
  bool execute_statement(Cursor& cursor);
  bool execute_block(Cursor cursor) override;
  void execute_assignment(Cursor& cursor);
  void set_variable(int number, double value, const Cursor& cursor, std::size_t from);
  void raise_alarm(const Cursor& cursor, double number);
  double parse_variable(Cursor& cursor);
  int parse_variable_number(Cursor& cursor);
  double read_variable(int number, const Cursor& cursor, std::size_t from);
  void expect_end(Cursor& cursor);
  int parse_whole_number(Cursor& cursor, int max, std::string_view what);
  const Source& source() const override { return *sources_[calls_.back().program->source]; }
  bool is_call_at_end() const override { return line_index_ >= calls_.back().program->end; }

  // Programs, loops and calls.
  void add_programs(ProgramFile& file);
  void execute_if(Cursor& cursor);
  void begin_loop(Cursor& cursor, std::size_t from, bool conditional);
  void end_loop(Cursor& cursor, std::size_t from);
  void jump(int number, const Cause& cause);
  const std::unordered_map<std::size_t, std::size_t>& loop_lines();
  Program* find_program(int number, const Cause& cause);
  Program* program_in_file(int number);
  void call_subprogram();
  void call_macro();
  void enter_program(Program* program, Call call, const Cause& cause);
  void leave_program(std::optional<int> to, const Cause& cause);
  void keep_modal_arguments();
  void end_call() override;
  void warn_of_unread_lines();
  std::vector<std::pair<int, double>> macro_arguments(const Block& block);

  Machine machine_;
  std::optional<ModalCall> modal_call_;
  std::map<int, Program*> programs_by_number_;
  Block block_;
};

namespace {

constexpr int last_local_variable = 33;  // #1 to #33 are local to a macro call

// Common variables: #100 to #199 are lost at power off, #500 to #999 are kept; both belong to the
// whole program here.
bool is_common(int number) {
  return (number >= 100 && number <= 199) || (number >= 500 && number <= 999);
}

}  // namespace

Flow::Flow(std::string_view text, ProgramRun& run) : ProgramFlow(run), machine_(run) {
  add_programs(add_source(text));
  calls_.push_back({.program = &sources_[0]->programs.front()});
}

void Flow::run() {
  run_lines();
  run_.try_block([&] { machine_.finish(); });
  warn_of_unread_lines();
}

/// Executes a line. Returns false at the end of the program.
bool Flow::execute_line() {
  run_.count_block();
  const std::string_view text = source().lines[line_index_];
  Cursor cursor{text, run_.canon.place()};
  if (next_char(cursor) == '/') {
    if (run_.skips_block(read_skip_level(cursor))) {
      run_.discount_block();
      ++line_index_;
      return true;
    }
  }
  block_.comments.clear();
  collect_comments(cursor, block_.comments);
  const char first = upper(cursor.current());
  int sequence = -1;
  // O and : begin a program; their number has been read by `add_programs`.
  if ((first == 'O' || first == ':') && is_digit(cursor.peek())) {
    ++cursor.at;
    cursor.number(false);
    cursor.skip_blanks();
  }
  if (upper(cursor.current()) == 'N') {
    const std::size_t from = cursor.at++;
    const auto number = cursor.number(false);
    if (!number) cursor.throw_input_error(from, "a sequence number after N");
    sequence = int(std::min(*number, 99'999'999.0));
  }
  machine_.note_numbers(sequence, calls_.back().program->number);
  collect_comments(cursor, block_.comments);
  if (execute_statement(cursor)) return true;
  ++line_index_;
  return execute_block(cursor);
}

/// Executes a statement of custom macro B. Returns false if none begins there.
bool Flow::execute_statement(Cursor& cursor) {
  const std::size_t from = cursor.at;
  // Outside of words ROUND rounds to whole numbers.
  resolution = 1.0;
  // GOTO, DO and END count only with their operand, because words may begin with the same letters.
  const auto accept_statement = [&](std::string_view word, auto is_operand_start) {
    if (cursor.accept(word) && (cursor.skip_blanks(), is_operand_start(cursor.current())))
      return true;
    cursor.at = from;
    return false;
  };
  const auto is_open_bracket = [](char c) { return c == '['; };
  const auto number = [](char c) { return is_digit(c) || c == '#' || c == '['; };
  if (cursor.current() == '#') {
    ++line_index_;
    execute_assignment(cursor);
  } else if (accept_statement("IF", is_open_bracket)) {
    execute_if(cursor);
  } else if (accept_statement("GOTO", number)) {
    const int target = parse_whole_number(cursor, 99'999'999, "a sequence number");
    expect_end(cursor);
    jump(target, cursor.cause(from));
  } else if (accept_statement("WHILE", is_open_bracket)) {
    begin_loop(cursor, from, true);
  } else if (accept_statement("DO", is_digit)) {
    begin_loop(cursor, from, false);
  } else if (accept_statement("END", is_digit)) {
    end_loop(cursor, from);
  } else if (cursor.accept("ELSE") || cursor.accept("ENDIF")) {
    cursor.throw_input_error(from, std::string(word_sentence("ELSE")));
  } else if (cursor.accept("SETVN")) {
    cursor.throw_input_error(from, std::string(word_sentence("SETVN")));
  } else if (cursor.accept("POPEN") || cursor.accept("PCLOS") || cursor.accept("DPRNT") ||
             cursor.accept("BPRNT")) {
    ++line_index_;
  } else {
    return false;
  }
  return true;
}

bool Flow::execute_block(Cursor cursor) {
  std::vector<std::string_view> leading_comments = std::move(block_.comments);
  read_block(cursor, run_, *this, block_);
  block_.comments.insert(block_.comments.begin(), leading_comments.begin(), leading_comments.end());
  // The user may have expected text after % to be read.
  if (block_.is_percent_line && has_words(cursor.text))
    run_.warn_once(fmt::format("{}:{}: {} on the line of % is ignored", run_.canon.place().file,
                               run_.canon.line(), quoted_excerpt(cursor.text)));
  if (block_.is_percent_line || block_.empty()) {
    for (const std::string_view text : block_.comments) run_.canon.comment(text);
    return true;
  }
  const Code& macro = block_[Group::Macro];
  if (macro.tenths == 650 || macro.tenths == 660) {
    call_macro();
    return true;
  }
  // G67 ends the modal call before its block moves.
  if (macro.tenths == 670) modal_call_.reset();
  if (!machine_.execute(block_)) return false;
  if (block_[Group::Call]) {
    call_subprogram();
    return !has_ended_;
  }
  // A macro called by G66 does not call itself for its own moves.
  const bool is_inside_modal_call =
      std::any_of(calls_.begin(), calls_.end(), [](const Call& c) { return c.is_modal; });
  if (modal_call_ && machine_.has_moved() && !is_inside_modal_call)
    enter_program(find_program(modal_call_->program, modal_call_->cause),
                  {.return_line = line_index_,
                   .remaining_repeats = modal_call_->repeats - 1,
                   .has_locals = true,
                   .is_modal = true,
                   .arguments = modal_call_->arguments},
                  modal_call_->cause);
  return true;
}

/// Throws BadInput unless only a comment follows.
void Flow::expect_end(Cursor& cursor) {
  std::vector<std::string_view> comments;
  collect_comments(cursor, comments);
  if (cursor.current() == ';') ++cursor.at;
  collect_comments(cursor, comments);
  if (!cursor.at_end())
    cursor.throw_input_error(cursor.at, "nothing more in a block with a macro statement");
}

int Flow::parse_whole_number(Cursor& cursor, int max, std::string_view name) {
  const std::size_t from = cursor.at;
  const double value = parse_value(cursor, grammar(), *this);
  // The result of an expression carries rounding errors, so it is rounded; a vacant value is an
  // error.
  const double rounded = is_vacant(value) ? -1.0 : std::round(value);
  if (rounded < 0 || rounded > max)
    cursor.throw_input_error(from, fmt::format("{} from 0 to {}", name, max));
  return int(rounded);
}

/// Parses #n or #[...] and returns the number of the variable.
int Flow::parse_variable_number(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  if (cursor.current() == '_' || cursor.current() == '<' ||
      (cursor.current() == '[' && cursor.peek() == '#' && cursor.peek(2) == '_'))
    cursor.throw_input_error(from, "a variable number: variable names are not supported");
  if (cursor.current() != '[' && !is_digit(cursor.current()))
    cursor.throw_input_error(from, "a number or [ ] after #");
  const double number =
      cursor.current() == '[' ? parse_bracketed(cursor, grammar(), *this) : *cursor.number(false);
  const double rounded = is_vacant(number) ? 0.0 : std::round(number);
  if (rounded < 0 || rounded > 99999)
    cursor.throw_input_error(from, "a variable from #0 to #99999");
  return int(rounded);
}

double Flow::read_variable(int number, const Cursor& cursor, std::size_t from) {
  // #0 is always vacant.
  if (number == 0) return vacant;
  if (run_.is_uncertain()) run_.require_certain(fmt::format("#{}", number), cursor.cause(from));
  if (number <= last_local_variable)
    return variables_.number(number, Variables::Scope::Call).value_or(vacant);
  if (is_common(number)) return variables_.number(number).value_or(vacant);
  if (const auto system = machine_.variable(number)) return *system;
  cursor.throw_input_error(from,
                           "a variable from #1 to #33, #100 to #199, #500 to #999, or a system "
                           "variable listed in the table of words",
                           fmt::format("#{}", number));
}

double Flow::parse_variable(Cursor& cursor) {
  const std::size_t from = cursor.at;
  return read_variable(parse_variable_number(cursor), cursor, from);
}

void Flow::set_variable(int number, double value, const Cursor& cursor, std::size_t from) {
  if (number == 3000) raise_alarm(cursor, value);
  const bool is_local = number >= 1 && number <= last_local_variable;
  if (!is_local && !is_common(number)) {
    if (number == 0 || !machine_.set_variable(number, is_vacant(value) ? 0.0 : value))
      cursor.throw_input_error(from, "a variable that can be set", fmt::format("#{}", number));
    return;
  }
  const Variables::Scope scope = is_local ? Variables::Scope::Call : Variables::Scope::Program;
  // Assigning a vacant value clears the variable.
  if (is_vacant(value)) return variables_.unset(number, scope);
  if (!variables_.set(number, value, scope))
    run_.throw_variable_limit(cursor.location, "variables");
}

/// #3000 stops the control with an alarm of the program.
void Flow::raise_alarm(const Cursor& cursor, double number) {
  const std::size_t open = cursor.text.find('(', cursor.at);
  const std::size_t close = cursor.text.find(')', cursor.at);
  const std::string text = open != std::string_view::npos && close > open
                               ? " " + shown(cursor.text.substr(open + 1, close - open - 1))
                               : "";
  cursor.throw_input_error(0, "no alarm from the program",
                           fmt::format("#3000 = {:g}{}", number, text));
}

void Flow::execute_assignment(Cursor& cursor) {
  const std::size_t from = cursor.at;
  const int number = parse_variable_number(cursor);
  // A variable whose assignment has an error is uncertain: its uses are not reported again.
  run_.define(fmt::format("#{}", number), [&] {
    expect_text(cursor, "=", "= after a variable at the start of a block");
    const double result = parse_expression(cursor, grammar(), *this);
    set_variable(number, result, cursor, from);
    expect_end(cursor);
  });
}

std::optional<double> Flow::parse_operand(Cursor& cursor) {
  if (cursor.current() == '#') return parse_variable(cursor);
  const std::size_t from = cursor.at;
  if (cursor.accept("ROUND")) {
    const double step = resolution;
    const double x = zero_if_vacant(parse_bracketed(cursor, grammar(), *this));
    return std::round(x / step) * step;
  }
  // ATAN[y]/[x] is within 0 to 360 degrees, ATAN[y] alone within -90 to 90 degrees.
  if (cursor.accept("ATAN")) {
    const double y = zero_if_vacant(parse_bracketed(cursor, grammar(), *this));
    if (!cursor.accept("/")) return std::atan(y) / units::deg;
    const double x = zero_if_vacant(parse_bracketed(cursor, grammar(), *this));
    const double angle = std::atan2(y, x) / units::deg;
    return angle < 0 ? angle + 360.0 : angle;
  }
  if (cursor.accept("POW")) {
    expect_text(cursor, "[", "[base, exponent] after POW");
    const double base = zero_if_vacant(parse_expression(cursor, grammar(), *this));
    expect_text(cursor, ",", ", between base and exponent");
    const double power = std::pow(base, zero_if_vacant(parse_expression(cursor, grammar(), *this)));
    expect_text(cursor, "]", "] after POW");
    if (!std::isfinite(power)) cursor.throw_input_error(from, "a finite result");
    return power;
  }
  for (const std::string_view word : {"BIN", "BCD", "ADP"})
    if (cursor.accept(word)) cursor.throw_input_error(from, std::string(word_sentence(word)));
  return std::nullopt;
}

namespace {

// The control accepts eight digits.
constexpr int max_repeats = 99'999'999;
constexpr int max_loops = 3;  // DO 1 to DO 3

/// Beginning of a line: block skip and sequence number.
struct LineHead {
  int sequence = -1;
  std::size_t at = 0;  ///< position of the first byte after it
};

// Returns the position after blanks and comments from `at` on.
std::size_t skip_blanks_and_comments(std::string_view text, std::size_t at) {
  while (at < text.size() && (is_blank(text[at]) || text[at] == '(')) {
    if (text[at] == '(') at = std::min(text.find(')', at), text.size() - 1);
    ++at;
  }
  return at;
}

// Parses the digits at the position. Returns -1 if there are none; the limit keeps the number
// within int.
int parse_digits(std::string_view text, std::size_t& at) {
  long long number = -1;
  for (; at < text.size() && is_digit(text[at]); ++at)
    number = std::min(10 * std::max(number, 0LL) + (text[at] - '0'), 100'000'000LL);
  return int(number);
}

LineHead parse_line_head(std::string_view text) {
  LineHead head{-1, skip_blanks_and_comments(text, 0)};
  if (head.at < text.size() && text[head.at] == '/') {
    ++head.at;
    if (head.at < text.size() && is_digit(text[head.at])) ++head.at;
    head.at = skip_blanks_and_comments(text, head.at);
  }
  if (head.at >= text.size() || upper(text[head.at]) != 'N') return head;
  const std::size_t from = head.at++;
  head.at = skip_blanks_and_comments(text, head.at);
  head.sequence = parse_digits(text, head.at);
  if (head.sequence < 0) head.at = from;
  head.at = skip_blanks_and_comments(text, head.at);
  return head;
}

/// Returns the number of the program that begins with a line, or nothing for any other line.
std::optional<int> parse_program_number(std::string_view text) {
  std::size_t at = skip_blanks_and_comments(text, 0);
  if (at >= text.size() || (upper(text[at]) != 'O' && text[at] != ':')) return std::nullopt;
  const int number = parse_digits(text, ++at);
  return number < 0 ? std::nullopt : std::optional(number);
}

/// Returns n for a line with DO n, -n for END n, 0 for neither.
int loop_number(std::string_view text) {
  static const std::string nowhere;
  Cursor cursor{text, {nowhere, 0}, parse_line_head(text).at};
  const bool is_end = cursor.accept("END");
  // WHILE [...] DO n: a comment may contain brackets too.
  if (!is_end && cursor.accept("WHILE")) {
    const std::size_t close = text.substr(0, text.find('(', cursor.at)).rfind(']');
    if (close == std::string_view::npos || close < cursor.at) return 0;
    cursor.at = close + 1;
  }
  if (!is_end && !cursor.accept("DO")) return 0;
  cursor.skip_blanks();
  const int number = parse_digits(text, cursor.at);
  return number < 1 ? 0 : is_end ? -number : number;
}

}  // namespace

/// Splits a file into programs. The file ends at the first % after words; several % before the
/// first word count as one beginning.
void Flow::add_programs(ProgramFile& file) {
  const std::size_t source = sources_.size() - 1;
  std::size_t end = file.lines.size();
  bool has_words_before = false;
  std::vector<Program> programs{{.source = source}};
  bool has_number = false;
  for (std::size_t i = 0; i < end; ++i) {
    const std::size_t at = skip_blanks_and_comments(file.lines[i], 0);
    const bool is_percent_line = at < file.lines[i].size() && file.lines[i][at] == '%';
    if (is_percent_line && has_words_before) end = i;
    has_words_before = has_words_before || (!is_percent_line && has_words(file.lines[i]));
    const auto number = parse_program_number(file.lines[i]);
    if (!number) continue;
    // Text before the first O number belongs to the first program.
    if (has_number) {
      programs.back().end = i;
      programs.push_back({.source = source, .first = i});
    }
    programs.back().number = *number;
    has_number = true;
  }
  programs.back().end = end;
  file.end = end;
  file.programs = std::move(programs);
}

void Flow::execute_if(Cursor& cursor) {
  const double condition = parse_bracketed(cursor, grammar(), *this);
  const bool is_true = !is_vacant(condition) && condition != 0.0;
  const std::size_t from = cursor.at;
  if (cursor.accept("GOTO")) {
    const int number = parse_whole_number(cursor, 99'999'999, "a sequence number");
    expect_end(cursor);
    if (is_true) return jump(number, cursor.cause(from));
    ++line_index_;
    return;
  }
  expect_text(cursor, "THEN", "GOTO or THEN after a condition");
  if (next_char(cursor) != '#')
    cursor.throw_input_error(cursor.at, "an assignment to a variable after THEN");
  ++line_index_;
  if (is_true) execute_assignment(cursor);
}

/// Returns the line of END by the line of DO and vice versa, in the running program.
const std::unordered_map<std::size_t, std::size_t>& Flow::loop_lines() {
  Program& program = *calls_.back().program;
  if (program.loops) return *program.loops;
  program.loops.emplace();
  std::vector<std::pair<int, std::size_t>> open;
  for (std::size_t i = program.first; i < program.end; ++i) {
    const int number = loop_number(source().lines[i]);
    if (number > 0) open.emplace_back(number, i);
    if (number >= 0) continue;
    // END closes the innermost open loop of its number; open loops inside that one have no END.
    const auto begin = std::find_if(open.rbegin(), open.rend(),
                                    [&](const auto& loop) { return loop.first == -number; });
    if (begin == open.rend()) continue;
    program.loops->emplace(begin->second, i);
    program.loops->emplace(i, begin->second);
    open.erase(std::prev(begin.base()), open.end());
  }
  return *program.loops;
}

void Flow::begin_loop(Cursor& cursor, std::size_t from, bool conditional) {
  bool is_repeated = true;
  if (conditional) {
    const double result = parse_bracketed(cursor, grammar(), *this);
    is_repeated = !is_vacant(result) && result != 0.0;
    expect_text(cursor, "DO", "DO after the loop condition");
  }
  const int number = parse_whole_number(cursor, max_loops, "a loop");
  if (number < 1) cursor.throw_input_error(from, "DO1, DO2 or DO3");
  expect_end(cursor);
  const auto end = loop_lines().find(line_index_);
  if (end == loop_lines().end())
    throw_input_error(cursor.cause(from), fmt::format("END{} after it", number), "none");
  line_index_ = is_repeated ? line_index_ + 1 : end->second + 1;
}

void Flow::end_loop(Cursor& cursor, std::size_t from) {
  const int number = parse_whole_number(cursor, max_loops, "a loop");
  expect_end(cursor);
  const auto begin = loop_lines().find(line_index_);
  if (begin == loop_lines().end())
    throw_input_error(cursor.cause(from), fmt::format("DO{} before it", number), "none");
  line_index_ = begin->second;
}

/// Jumps to the next line with a sequence number, or else to the first one in the program.
void Flow::jump(int number, const Cause& cause) {
  Program& program = *calls_.back().program;
  if (!program.sequence) {
    program.sequence.emplace();
    for (std::size_t i = program.first; i < program.end; ++i)
      if (const LineHead head = parse_line_head(source().lines[i]); head.sequence >= 0)
        program.sequence->emplace_back(head.sequence, i);
    // Sorted by number, then by line, so that the next occurrence is found by bisection.
    std::sort(program.sequence->begin(), program.sequence->end());
  }
  const auto& sequence = *program.sequence;
  auto target = std::upper_bound(sequence.begin(), sequence.end(), std::pair(number, line_index_));
  if (target == sequence.end() || target->first != number)
    target = std::lower_bound(sequence.begin(), sequence.end(), std::pair(number, std::size_t(0)));
  if (target == sequence.end() || target->first != number)
    run_.refuse_once(fmt::format("N{} of O{}", number, program.number), cause,
                     fmt::format("N{} in the program", number), "none");
  line_index_ = target->second;
}

/// Returns a subprogram from a file of its own in the folder of the program, or null.
Program* Flow::program_in_file(int number) {
  const std::filesystem::path& folder = run_.options().subprogram_folder;
  if (folder.empty()) return nullptr;
  for (const std::string& stem : {fmt::format("O{:04}", number), fmt::format("O{}", number)})
    for (const char* extension : {"", ".nc", ".NC"}) {
      std::error_code error;
      const std::filesystem::path file = folder / (stem + extension);
      if (!std::filesystem::is_regular_file(file, error)) continue;
      add_programs(add_source_file(file, file.string()));
      std::vector<Program>& programs = sources_.back()->programs;
      const auto program = std::ranges::find(programs, number, &Program::number);
      return program != programs.end()      ? &*program
             : programs.front().number == 0 ? &programs.front()
                                            : nullptr;
    }
  return nullptr;
}

/// Returns a program of the main file, or else of a file named by its number. Throws BadInput.
Program* Flow::find_program(int number, const Cause& cause) {
  if (const auto entry = programs_by_number_.find(number); entry != programs_by_number_.end())
    return entry->second;
  Program* program = nullptr;
  for (Program& candidate : sources_[0]->programs)
    if (candidate.number == number && number != 0 && program == nullptr) program = &candidate;
  if (program == nullptr) program = program_in_file(number);
  if (program == nullptr)
    run_.refuse_once(
        fmt::format("O{}", number), cause,
        fmt::format("a program O{:04} in the file, or O{:04}.nc next to it", number, number),
        "none");
  programs_by_number_.emplace(number, program);
  return program;
}

void Flow::enter_program(Program* program, Call call, const Cause& cause) {
  run_.check_depth(int(calls_.size()), cause);
  call.program = program;
  if (call.has_locals) {
    variables_.enter();
    for (const auto& [number, value] : call.arguments)
      if (!variables_.set(number, value, Variables::Scope::Call))
        throw_input_error(cause, "fewer variables", "too many");
  }
  calls_.push_back(std::move(call));
  line_index_ = program->first;
}

/// Executes M98 and M99.
void Flow::call_subprogram() {
  const Code& code = block_[Group::Call];
  const Word &p = block_['P'], &l = block_['L'];
  if (code.tenths == 990) {
    const std::optional<int> to =
        p ? std::optional(whole_number(run_.canon, p, 99'999'999)) : std::nullopt;
    return leave_program(to, code.word);
  }
  if (!p) throw_input_error(code.word, "P (program) with M98", "none");
  int number = whole_number(run_.canon, p, 99'999'999);
  int repeats = l ? whole_number(run_.canon, l, max_repeats) : 1;
  // Without L the digits before the last four are the number of repeats.
  if (number > 9999 && !l) {
    repeats = number / 10000;
    number %= 10000;
  }
  if (repeats < 1) return;
  enter_program(find_program(number, p),
                {.return_line = line_index_, .remaining_repeats = repeats - 1}, p);
}

/// Assigns arguments to local variables as the control does (argument assignment I and II): I J K
/// may occur up to ten times.
std::vector<std::pair<int, double>> Flow::macro_arguments(const Block& block) {
  static constexpr int local_variable_of_letter[26] = {
      1, 2, 3, 7, 8, 9, 0, 11, 4, 5, 6, 0, 13, 0, 0, 0, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26};
  std::vector<std::pair<int, double>> values;
  int set_index = 0, last_index = -1;
  for (const Word& word : block.arguments) {
    int variable = local_variable_of_letter[word.letter - 'A'];
    if (variable == 0) throw_input_error(word, "an argument A to F, H to K, M, Q to Z");
    if (word.letter >= 'I' && word.letter <= 'K') {
      const int index = word.letter - 'I';
      // A letter that does not follow in the order I J K begins the next set.
      if (index <= last_index) ++set_index;
      last_index = index;
      variable = 4 + 3 * set_index + index;
      if (set_index > 9) throw_input_error(word, "I J K at most ten times");
    }
    // The numbers of D H M S T are taken as written; others count increments without a point.
    const bool is_plain_number =
        std::string_view("DHMST").find(word.letter) != std::string_view::npos;
    if ((word.letter == 'E' || word.letter == 'F') && !word.is_in_full_units && word.value != 0.0)
      throw_input_error(word, "a decimal point in argument E or F");
    values.emplace_back(variable, is_plain_number ? word.value : machine_.word_value(word));
  }
  return values;
}

/// Executes G65 and G66.
void Flow::call_macro() {
  const Code& code = block_[Group::Macro];
  const Word &p = block_['P'], &l = block_['L'];
  if (!p) throw_input_error(code.word, "P (program) with " + shown(code.word.text), "none");
  // It would be open if other codes of the block are executed before or after the call.
  for (const Code& other : block_.codes)
    if (other && &other != &code)
      throw_input_error(other.word, "a separate block for " + shown(code.word.text));
  const int number = whole_number(run_.canon, p, 99'999'999);
  const int repeats = l ? whole_number(run_.canon, l, max_repeats) : 1;
  Program* program = find_program(number, p);
  auto arguments = macro_arguments(block_);
  if (code.tenths == 660) {
    if (modal_call_) throw_input_error(code.word, "G67 before another G66");
    modal_call_ = ModalCall{number, repeats, std::move(arguments), p};
    return;
  }
  if (repeats < 1) return;
  enter_program(program,
                {.return_line = line_index_,
                 .remaining_repeats = repeats - 1,
                 .has_locals = true,
                 .arguments = std::move(arguments)},
                p);
}

/// Keeps the local variables for the next call of G66: its arguments are set only once, and each
/// call begins with the variables that the previous one left.
void Flow::keep_modal_arguments() {
  modal_call_->arguments.clear();
  for (int number = 1; number <= 33; ++number)
    if (const auto value = variables_.number(number, Variables::Scope::Call))
      modal_call_->arguments.emplace_back(number, *value);
}

/// Executes M99. The caller continues at the sequence number `to`, or else after its call.
void Flow::leave_program(std::optional<int> to, const Cause& cause) {
  if (calls_.size() == 1) {
    if (to) return jump(*to, cause);
    // A control would repeat the main program forever.
    run_.warn_once("M99 ends the main program; a control would restart it");
    has_ended_ = true;
    return;
  }
  Call& call = calls_.back();
  if (call.remaining_repeats > 0 && !to) {
    --call.remaining_repeats;
    line_index_ = call.program->first;
    // M98 has no local variables, so its repeats need no new call.
    if (!call.has_locals) return;
    Call next_call = std::move(call);
    if (next_call.is_modal && modal_call_) {
      keep_modal_arguments();
      next_call.arguments = modal_call_->arguments;
    }
    calls_.pop_back();
    variables_.leave();
    Program* program = next_call.program;
    return enter_program(program, std::move(next_call), cause);
  }
  line_index_ = call.return_line;
  if (call.is_modal && modal_call_) keep_modal_arguments();
  if (call.has_locals) variables_.leave();
  calls_.pop_back();
  if (to) jump(*to, cause);
}

/// Warns of programs that nothing calls, and of text after the end of the main program. In a
/// program with jumps, blocks from a sequence number on are not reported: a jump whose condition
/// did not hold may lead to them.
void Flow::warn_of_unread_lines() {
  const ProgramFile& main = *sources_.front();
  const bool has_jumps = std::ranges::any_of(main.lines, [](std::string_view line) {
    const auto jump = std::ranges::search(line, std::string_view("GOTO"), {}, upper);
    return !jump.empty();
  });
  std::vector<Section> sections;
  for (const Program& program : main.programs) {
    Section section{program.first, program.end};
    if (has_jumps && run_.canon.file() == 0)
      for (std::size_t i = std::size_t(run_.canon.line()); i < program.end; ++i)
        if (i >= program.first && parse_line_head(main.lines[i]).sequence >= 0) {
          section.end = i;
          break;
        }
    sections.push_back(section);
  }
  sections.push_back({std::min(main.end + 1, main.lines.size()), main.lines.size()});
  run_.warn_of_unread_lines(main.lines, sections);
}

void Flow::end_call() {
  const Call call = calls_.back();
  line_index_ = call.return_line;
  calls_.pop_back();
  if (call.has_locals) variables_.leave();
  // Without M99 the control does not know where to return.
  const program::NcLocation location = run_.canon.place();
  throw BadInput(location.file, location.line, 0,
                 fmt::format("M99 of O{:04}", call.program->number), "its end");
}

}  // namespace fanuc

void read_fanuc(std::string_view text, ProgramRun& run) {
  if (!run.is_turning())
    if (const auto evidence = fanuc::find_turning_evidence(text, run.canon)) {
      // The only error that is reported: all others would be consequences of the wrong control.
      throw BadProgram(
          {BadInput(run.canon.place().file, evidence->line, evidence->column,
                    "a program for a milling control; control = \"turning\" (--control turning) or "
                    "a machine whose spindle turns the workpiece reads those for turning controls",
                    evidence->words)});
    }
  fanuc::Flow(text, run).run();
}

}  // namespace abbe::sim::dialects
