#include "sim/dialects/fanuc/flow.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::fanuc {

namespace {

constexpr int last_local = 33;  // #1 to #33 are local to a macro call

// Common variables: #100 to #199 are lost at power off, #500 to #999 are kept; both belong to the
// whole program here.
bool is_common(int number) {
  return (number >= 100 && number <= 199) || (number >= 500 && number <= 999);
}

}  // namespace

Flow::Flow(std::string_view text, ProgramRun& run)
    : run_(run), machine_(run), variables_(run.options().limits.variables) {
  auto main = std::make_unique<Source>();
  main->lines = lines_of_text(text);
  sources_.push_back(std::move(main));
  add_programs(0);
  calls_.push_back({.program = &sources_[0]->programs.front()});
}

void Flow::run() {
  run_.start([&](std::string_view code) { block({code, run_.canon.place()}); });
  while (!ended_ && !run_.is_aborted()) {
    // Running over the end of the main program ends it; of a subprogram it is an error.
    if (at_ >= calls_.back().program->end) {
      if (calls_.size() == 1) break;
      run_.attempt([&] { end_of_program(); });
      continue;
    }
    run_.canon.set_line(int(at_) + 1, source().file);
    const std::size_t before = at_, depth = calls_.size();
    // After an error reading continues at the next line, unless the line itself moved on.
    if (!run_.attempt([&] { ended_ = !line(); }) && at_ == before && calls_.size() == depth) ++at_;
  }
  run_.attempt([&] { machine_.finish(); });
  warn_unread();
}

/// Executes a line. Returns false at the end of the program.
bool Flow::line() {
  run_.count_block();
  const std::string_view text = source().lines[at_];
  Cursor cursor{text, run_.canon.place()};
  cursor.skip_blanks();
  if (cursor.here() == '/') {
    if (run_.skips(skip_level(cursor))) {
      run_.discount_block();
      ++at_;
      return true;
    }
  }
  block_.comments.clear();
  pass_comments(cursor, block_.comments);
  const char first = upper(cursor.here());
  int sequence = -1;
  // O and : begin a program; their number has been read by `add_programs`.
  if ((first == 'O' || first == ':') && is_digit(cursor.next())) {
    ++cursor.at;
    cursor.number(false);
    cursor.skip_blanks();
  }
  if (upper(cursor.here()) == 'N') {
    const std::size_t from = cursor.at++;
    const auto number = cursor.number(false);
    if (!number) cursor.refuse(from, "a sequence number after N");
    sequence = int(std::min(*number, 99'999'999.0));
  }
  machine_.note_numbers(sequence, calls_.back().program->number);
  pass_comments(cursor, block_.comments);
  if (statement(cursor)) return true;
  ++at_;
  return block(cursor);
}

/// Executes a statement of custom macro B. Returns false if none begins there.
bool Flow::statement(Cursor& cursor) {
  const std::size_t from = cursor.at;
  // Outside of words ROUND rounds to whole numbers.
  resolution = 1.0;
  // GOTO, DO and END only count with their operand: letters of words may begin like them.
  const auto word_and = [&](std::string_view word, auto follows) {
    if (cursor.take(word) && (cursor.skip_blanks(), follows(cursor.here()))) return true;
    cursor.at = from;
    return false;
  };
  const auto bracket = [](char c) { return c == '['; };
  const auto number = [](char c) { return is_digit(c) || c == '#' || c == '['; };
  if (cursor.here() == '#') {
    ++at_;
    assign(cursor);
  } else if (word_and("IF", bracket)) {
    branch(cursor);
  } else if (word_and("GOTO", number)) {
    const int target = whole_value(cursor, 99'999'999, "a sequence number");
    ends(cursor);
    jump(target, cursor.cause(from));
  } else if (word_and("WHILE", bracket)) {
    begin_loop(cursor, from, true);
  } else if (word_and("DO", is_digit)) {
    begin_loop(cursor, from, false);
  } else if (word_and("END", is_digit)) {
    end_loop(cursor, from);
  } else if (cursor.take("ELSE") || cursor.take("ENDIF")) {
    cursor.refuse(from, std::string(word_sentence("ELSE")));
  } else if (cursor.take("SETVN")) {
    cursor.refuse(from, std::string(word_sentence("SETVN")));
  } else if (cursor.take("POPEN") || cursor.take("PCLOS") || cursor.take("DPRNT") ||
             cursor.take("BPRNT")) {
    ++at_;
  } else {
    return false;
  }
  return true;
}

bool Flow::block(Cursor cursor) {
  std::vector<std::string_view> before = std::move(block_.comments);
  read_block(cursor, run_, *this, block_);
  block_.comments.insert(block_.comments.begin(), before.begin(), before.end());
  // Text behind % is outside of the program, which may not have been intended.
  if (block_.percent && has_words(cursor.text))
    run_.warn_once(fmt::format("{}:{}: {} on the line of % is not read", run_.canon.place().file,
                               run_.canon.line(), in_quotes(cursor.text)));
  if (block_.percent || block_.empty()) {
    for (const std::string_view text : block_.comments) run_.canon.comment(text);
    return true;
  }
  const Code& macro = block_[Group::Macro];
  if (macro.tenths == 650 || macro.tenths == 660) {
    call_macro();
    return true;
  }
  // G67 ends the modal call before its block moves.
  if (macro.tenths == 670) modal_.reset();
  if (!machine_.execute(block_)) return false;
  if (block_[Group::Call]) {
    call_subprogram();
    return !ended_;
  }
  // A macro called by G66 does not call itself for its own moves.
  const bool within =
      std::any_of(calls_.begin(), calls_.end(), [](const Call& c) { return c.modal; });
  if (modal_ && machine_.moved() && !within)
    enter(find_program(modal_->program, modal_->cause),
          {.back = at_,
           .left = modal_->repeats - 1,
           .macro = true,
           .modal = true,
           .arguments = modal_->arguments},
          modal_->cause);
  return true;
}

/// Throws BadInput unless only a comment follows.
void Flow::ends(Cursor& cursor) {
  std::vector<std::string_view> comments;
  pass_comments(cursor, comments);
  if (cursor.here() == ';') ++cursor.at;
  pass_comments(cursor, comments);
  if (!cursor.at_end()) cursor.refuse(cursor.at, "nothing more in a block of a macro statement");
}

int Flow::whole_value(Cursor& cursor, int most, std::string_view what) {
  const std::size_t from = cursor.at;
  const double found = value(cursor, grammar(), *this);
  // Expressions carry rounding, so the nearest whole number counts; a vacant value is none.
  const double near = is_vacant(found) ? -1.0 : std::round(found);
  if (near < 0 || near > most) cursor.refuse(from, fmt::format("{} of 0 to {}", what, most));
  return int(near);
}

/// Parses #n or #[...] and returns the number of the variable.
int Flow::variable_number(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  if (cursor.here() == '_' || cursor.here() == '<' ||
      (cursor.here() == '[' && cursor.next() == '#' && cursor.next(2) == '_'))
    cursor.refuse(from, "a variable by its number: names of variables are not read");
  if (cursor.here() != '[' && !is_digit(cursor.here()))
    cursor.refuse(from, "a number, or [ ], after #");
  const double number =
      cursor.here() == '[' ? bracketed(cursor, grammar(), *this) : *cursor.number(false);
  const double near = is_vacant(number) ? 0.0 : std::round(number);
  if (near < 0 || near > 99999) cursor.refuse(from, "a variable of #0 to #99999");
  return int(near);
}

double Flow::read(int number, const Cursor& cursor, std::size_t from) {
  // #0 is always vacant.
  if (number == 0) return vacant;
  if (run_.is_uncertain()) run_.require_certain(fmt::format("#{}", number), cursor.cause(from));
  // An unset variable is vacant and not an error.
  if (number <= last_local) return variables_.number(number, Variables::Of::Call).value_or(vacant);
  if (is_common(number)) return variables_.number(number).value_or(vacant);
  if (const auto system = machine_.variable(number)) return *system;
  cursor.refuse(from,
                "a variable of #1 to #33, #100 to #199, #500 to #999, or of the system that "
                "the table of words names",
                fmt::format("#{}", number));
}

double Flow::variable(Cursor& cursor) {
  const std::size_t from = cursor.at;
  return read(variable_number(cursor), cursor, from);
}

void Flow::set(int number, double value, const Cursor& cursor, std::size_t from) {
  if (number == 3000) alarm(cursor, value);
  const bool local = number >= 1 && number <= last_local;
  if (!local && !is_common(number)) {
    if (number == 0 || !machine_.set_variable(number, is_vacant(value) ? 0.0 : value))
      cursor.refuse(from, "a variable that can be set", fmt::format("#{}", number));
    return;
  }
  const Variables::Of of = local ? Variables::Of::Call : Variables::Of::Program;
  // Assigning a vacant value clears the variable.
  if (is_vacant(value)) return variables_.unset(number, of);
  if (!variables_.set(number, value, of))
    throw ProgramLimitExceeded(cursor.place.file, cursor.place.line, 0,
                               fmt::format("at most {} variables", run_.options().limits.variables),
                               "more");
}

/// #3000 stops the control with an alarm of the program.
void Flow::alarm(const Cursor& cursor, double number) {
  const std::size_t open = cursor.text.find('(', cursor.at);
  const std::size_t close = cursor.text.find(')', cursor.at);
  const std::string text = open != std::string_view::npos && close > open
                               ? " " + shown(cursor.text.substr(open + 1, close - open - 1))
                               : "";
  cursor.refuse(0, "no alarm of the program", fmt::format("#3000 = {:g}{}", number, text));
}

void Flow::assign(Cursor& cursor) {
  const std::size_t from = cursor.at;
  const int number = variable_number(cursor);
  // A variable whose assignment has an error is uncertain: its uses are not reported again.
  run_.define(fmt::format("#{}", number), [&] {
    if (!cursor.take("=")) cursor.refuse(cursor.at, "= after a variable that begins a block");
    const double result = expression(cursor, grammar(), *this);
    set(number, result, cursor, from);
    ends(cursor);
  });
}

std::optional<double> Flow::operand(Cursor& cursor) {
  if (cursor.here() == '#') return variable(cursor);
  const std::size_t from = cursor.at;
  const auto plain = [](double x) { return is_vacant(x) ? 0.0 : x; };
  if (cursor.take("ROUND")) {
    const double step = resolution;
    const double x = plain(bracketed(cursor, grammar(), *this));
    return std::round(x / step) * step;
  }
  // ATAN[y]/[x] has a range of 0 to 360 degrees; ATAN[y] alone that of the arc tangent.
  if (cursor.take("ATAN")) {
    const double y = plain(bracketed(cursor, grammar(), *this));
    if (!cursor.take("/")) return std::atan(y) / units::deg;
    const double x = plain(bracketed(cursor, grammar(), *this));
    const double angle = std::atan2(y, x) / units::deg;
    return angle < 0 ? angle + 360.0 : angle;
  }
  if (cursor.take("POW")) {
    if (!cursor.take("[")) cursor.refuse(cursor.at, "[base, exponent] after POW");
    const double base = plain(expression(cursor, grammar(), *this));
    if (!cursor.take(",")) cursor.refuse(cursor.at, ", between base and exponent");
    const double power = std::pow(base, plain(expression(cursor, grammar(), *this)));
    if (!cursor.take("]")) cursor.refuse(cursor.at, "] after POW");
    if (!std::isfinite(power)) cursor.refuse(from, "a result that is a finite number");
    return power;
  }
  for (const std::string_view word : {"BIN", "BCD", "ADP"})
    if (cursor.take(word)) cursor.refuse(from, std::string(word_sentence(word)));
  return std::nullopt;
}

namespace {

constexpr std::size_t max_file = std::size_t(1) << 26;  // bytes of a subprogram file
// A directory of generated programs could otherwise use up all memory.
constexpr std::size_t max_sources = 1000;
// Eight digits, as the control accepts.
constexpr int max_repeats = 99'999'999;
constexpr int max_loops = 3;  // DO 1 to DO 3

/// Sequence number of a line, without leading blanks and block skip.
struct Head {
  int sequence = -1;
  std::size_t at = 0;  ///< position behind it
};

// Returns the position behind blanks and comments.
std::size_t skip(std::string_view text, std::size_t at) {
  while (at < text.size() && (is_blank(text[at]) || text[at] == '(')) {
    if (text[at] == '(') at = std::min(text.find(')', at), text.size() - 1);
    ++at;
  }
  return at;
}

// Returns the number at the position, or -1; the limit keeps it within int.
int digits(std::string_view text, std::size_t& at) {
  long long number = -1;
  for (; at < text.size() && is_digit(text[at]); ++at)
    number = std::min(10 * std::max(number, 0LL) + (text[at] - '0'), 100'000'000LL);
  return int(number);
}

Head head_of(std::string_view text) {
  Head head{-1, skip(text, 0)};
  if (head.at < text.size() && text[head.at] == '/') {
    ++head.at;
    if (head.at < text.size() && is_digit(text[head.at])) ++head.at;
    head.at = skip(text, head.at);
  }
  if (head.at >= text.size() || upper(text[head.at]) != 'N') return head;
  const std::size_t from = head.at++;
  head.at = skip(text, head.at);
  head.sequence = digits(text, head.at);
  if (head.sequence < 0) head.at = from;
  head.at = skip(text, head.at);
  return head;
}

/// Returns the number of the program that a line begins, or nothing.
std::optional<int> program_of(std::string_view text) {
  std::size_t at = skip(text, 0);
  if (at >= text.size() || (upper(text[at]) != 'O' && text[at] != ':')) return std::nullopt;
  const int number = digits(text, ++at);
  return number < 0 ? std::nullopt : std::optional(number);
}

/// Returns n for a line with DO n, -n for END n, 0 for neither.
int loop_mark(std::string_view text) {
  static const std::string nowhere;
  Cursor cursor{text, {nowhere, 0}, head_of(text).at};
  const bool ends = cursor.take("END");
  // WHILE [...] DO n: a comment may contain brackets too.
  if (!ends && cursor.take("WHILE")) {
    const std::size_t close = text.substr(0, text.find('(', cursor.at)).rfind(']');
    if (close == std::string_view::npos || close < cursor.at) return 0;
    cursor.at = close + 1;
  }
  if (!ends && !cursor.take("DO")) return 0;
  cursor.skip_blanks();
  const int number = digits(text, cursor.at);
  return number < 1 ? 0 : ends ? -number : number;
}

}  // namespace

/// Splits a file into programs. It ends at the first % behind words; several % before the first
/// word are one beginning.
void Flow::add_programs(std::size_t source) {
  Source& file = *sources_[source];
  std::size_t end = file.lines.size();
  bool words = false;  // before this line
  std::vector<Program> programs{{.source = source}};
  bool numbered = false;
  for (std::size_t i = 0; i < end; ++i) {
    const std::size_t at = skip(file.lines[i], 0);
    const bool percent = at < file.lines[i].size() && file.lines[i][at] == '%';
    if (percent && words) end = i;
    words = words || (!percent && has_words(file.lines[i]));
    const auto number = program_of(file.lines[i]);
    if (!number) continue;
    // Text before the first O number belongs to the first program.
    if (numbered) {
      programs.back().end = i;
      programs.push_back({.source = source, .first = i});
    }
    programs.back().number = *number;
    numbered = true;
  }
  programs.back().end = end;
  file.end = end;
  file.programs = std::move(programs);
}

void Flow::branch(Cursor& cursor) {
  const bool holds = [&] {
    const double result = bracketed(cursor, grammar(), *this);
    return !is_vacant(result) && result != 0.0;
  }();
  const std::size_t from = cursor.at;
  if (cursor.take("GOTO")) {
    const int number = whole_value(cursor, 99'999'999, "a sequence number");
    ends(cursor);
    if (holds) return jump(number, cursor.cause(from));
    ++at_;
    return;
  }
  if (!cursor.take("THEN")) cursor.refuse(cursor.at, "GOTO or THEN after a condition");
  cursor.skip_blanks();
  if (cursor.here() != '#') cursor.refuse(cursor.at, "a variable that is set after THEN");
  ++at_;
  if (holds) assign(cursor);
}

/// Returns the line of END for every DO and vice versa, built once for each program.
const std::unordered_map<std::size_t, std::size_t>& Flow::loops() {
  Program& program = *calls_.back().program;
  if (program.loops) return *program.loops;
  program.loops.emplace();
  std::vector<std::pair<int, std::size_t>> open;
  for (std::size_t i = program.first; i < program.end; ++i) {
    const int mark = loop_mark(source().lines[i]);
    if (mark > 0) open.emplace_back(mark, i);
    if (mark >= 0) continue;
    // The innermost open loop of that number matches; loops opened inside it without an END are
    // dropped.
    const auto begin = std::find_if(open.rbegin(), open.rend(),
                                    [&](const auto& one) { return one.first == -mark; });
    if (begin == open.rend()) continue;
    program.loops->emplace(begin->second, i);
    program.loops->emplace(i, begin->second);
    open.erase(std::prev(begin.base()), open.end());
  }
  return *program.loops;
}

void Flow::begin_loop(Cursor& cursor, std::size_t from, bool conditional) {
  bool again = true;
  if (conditional) {
    const double result = bracketed(cursor, grammar(), *this);
    again = !is_vacant(result) && result != 0.0;
    if (!cursor.take("DO")) cursor.refuse(cursor.at, "DO after the condition of a loop");
  }
  const int number = whole_value(cursor, max_loops, "a loop");
  if (number < 1) cursor.refuse(from, "DO1, DO2 or DO3");
  ends(cursor);
  const auto end = loops().find(at_);
  if (end == loops().end())
    run_.canon.refuse(cursor.cause(from), fmt::format("END{} behind it", number), "none");
  at_ = again ? at_ + 1 : end->second + 1;
}

void Flow::end_loop(Cursor& cursor, std::size_t from) {
  const int number = whole_value(cursor, max_loops, "a loop");
  ends(cursor);
  const auto begin = loops().find(at_);
  if (begin == loops().end())
    run_.canon.refuse(cursor.cause(from), fmt::format("DO{} before it", number), "none");
  at_ = begin->second;
}

/// Jumps to a sequence number: its next occurrence in the program, else the first one from the
/// beginning.
void Flow::jump(int number, const Cause& cause) {
  Program& program = *calls_.back().program;
  if (!program.sequence) {
    program.sequence.emplace();
    for (std::size_t i = program.first; i < program.end; ++i)
      if (const Head head = head_of(source().lines[i]); head.sequence >= 0)
        program.sequence->emplace_back(head.sequence, i);
    // Sorted by number, then by line, so that the next occurrence is found by bisection.
    std::sort(program.sequence->begin(), program.sequence->end());
  }
  const auto& all = *program.sequence;
  auto found = std::upper_bound(all.begin(), all.end(), std::pair(number, at_));
  if (found == all.end() || found->first != number)
    found = std::lower_bound(all.begin(), all.end(), std::pair(number, std::size_t(0)));
  if (found == all.end() || found->first != number)
    run_.refuse_once(fmt::format("N{} of O{}", number, program.number), cause,
                     fmt::format("N{} in the program", number), "none");
  at_ = found->second;
}

/// Searches a subprogram in a file of its own in the folder of the program.
Program* Flow::program_in_file(int number) {
  const std::filesystem::path& folder = run_.options().folder;
  if (folder.empty()) return nullptr;
  for (const std::string& stem : {fmt::format("O{:04}", number), fmt::format("O{}", number)})
    for (const char* ending : {"", ".nc", ".NC"}) {
      std::error_code failure;
      const std::filesystem::path file = folder / (stem + ending);
      if (!std::filesystem::is_regular_file(file, failure)) continue;
      if (sources_.size() == max_sources)
        run_.canon.refuse({1, {}}, "at most 1000 files of subprograms", "more");
      auto source = std::make_unique<Source>();
      source->text = read_text(file, max_file);
      source->lines = lines_of_text(source->text);
      source->file = run_.canon.add_file(file.string());
      sources_.push_back(std::move(source));
      add_programs(sources_.size() - 1);
      std::vector<Program>& programs = sources_.back()->programs;
      const auto own = std::find_if(programs.begin(), programs.end(),
                                    [&](const Program& p) { return p.number == number; });
      return own != programs.end()          ? &*own
             : programs.front().number == 0 ? &programs.front()
                                            : nullptr;
    }
  return nullptr;
}

/// Searches in the file of the main program, then in a file of the program's name.
Program* Flow::find_program(int number, const Cause& cause) {
  if (const auto known = found_.find(number); known != found_.end()) return known->second;
  Program* program = nullptr;
  for (Program& one : sources_[0]->programs)
    if (one.number == number && number != 0 && program == nullptr) program = &one;
  if (program == nullptr) program = program_in_file(number);
  if (program == nullptr)
    run_.refuse_once(
        fmt::format("O{}", number), cause,
        fmt::format("a program O{:04} in the file, or O{:04}.nc beside it", number, number),
        "none");
  found_.emplace(number, program);
  return program;
}

void Flow::enter(Program* program, Call call, const Cause& cause) {
  run_.check_depth(int(calls_.size()), cause);
  call.program = program;
  if (call.macro) {
    variables_.enter();
    for (const auto& [number, value] : call.arguments)
      if (!variables_.set(number, value, Variables::Of::Call))
        run_.canon.refuse(cause, "fewer variables", "too many");
  }
  calls_.push_back(std::move(call));
  at_ = program->first;
}

/// Executes M98 and M99.
void Flow::call_subprogram() {
  const Code& code = block_[Group::Call];
  const Word &p = block_['P'], &l = block_['L'];
  if (code.tenths == 990) {
    const std::optional<int> to =
        p ? std::optional(whole(run_.canon, p, 99'999'999)) : std::nullopt;
    return leave(to, code.word);
  }
  if (!p) run_.canon.refuse(code.word, "P (program) beside M98", "none");
  int number = whole(run_.canon, p, 99'999'999);
  int repeats = l ? whole(run_.canon, l, max_repeats) : 1;
  // P of up to 8 digits without L: repeats, then the number of the program.
  if (number > 9999 && !l) {
    repeats = number / 10000;
    number %= 10000;
  }
  if (repeats < 1) return;
  enter(find_program(number, p), {.back = at_, .left = repeats - 1}, p);
}

/// Assigns arguments to local variables as the control does (argument assignment I and II): I J K
/// may occur up to ten times.
std::vector<std::pair<int, double>> Flow::macro_arguments(const Block& block) {
  static constexpr int local_variable_of_letter[26] = {
      1, 2, 3, 7, 8, 9, 0, 11, 4, 5, 6, 0, 13, 0, 0, 0, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26};
  std::vector<std::pair<int, double>> values;
  int set = 0, last = -1;
  for (const Word& word : block.arguments) {
    int local = local_variable_of_letter[word.letter - 'A'];
    if (local == 0) run_.canon.refuse(word, "an argument of A to F, H to K, M, Q to Z");
    if (word.letter >= 'I' && word.letter <= 'K') {
      const int index = word.letter - 'I';
      // A letter that does not follow in the order I J K begins the next set.
      if (index <= last) ++set;
      last = index;
      local = 4 + 3 * set + index;
      if (set > 9) run_.canon.refuse(word, "I J K at most ten times");
    }
    // D H M S T are counts; other letters are lengths with their decimal point.
    const bool counts = std::string_view("DHMST").find(word.letter) != std::string_view::npos;
    if ((word.letter == 'E' || word.letter == 'F') && !word.pointed && word.value != 0.0)
      run_.canon.refuse(word, "a decimal point in an argument E or F");
    values.emplace_back(local, counts ? word.value : machine_.argument(word));
  }
  return values;
}

/// Executes G65 and G66.
void Flow::call_macro() {
  const Code& code = block_[Group::Macro];
  const Word &p = block_['P'], &l = block_['L'];
  if (!p) run_.canon.refuse(code.word, "P (program) beside " + shown(code.word.text), "none");
  // Other codes of the block could be executed before or after the call.
  for (const Code& other : block_.codes)
    if (other && &other != &code)
      run_.canon.refuse(other.word, "a block of its own for " + shown(code.word.text));
  const int number = whole(run_.canon, p, 99'999'999);
  const int repeats = l ? whole(run_.canon, l, max_repeats) : 1;
  Program* program = find_program(number, p);
  auto arguments = macro_arguments(block_);
  if (code.tenths == 660) {
    if (modal_) run_.canon.refuse(code.word, "G67 before another G66");
    modal_ = Modal{number, repeats, std::move(arguments), p};
    return;
  }
  if (repeats < 1) return;
  enter(program,
        {.back = at_, .left = repeats - 1, .macro = true, .arguments = std::move(arguments)}, p);
}

/// The arguments of G66 are set once: each call finds the local variables as the previous one left
/// them.
void Flow::store_locals() {
  modal_->arguments.clear();
  for (int number = 1; number <= 33; ++number)
    if (const auto value = variables_.number(number, Variables::Of::Call))
      modal_->arguments.emplace_back(number, *value);
}

/// Executes M99, with or without the sequence number at which the caller continues.
void Flow::leave(std::optional<int> to, const Cause& cause) {
  if (calls_.size() == 1) {
    if (to) return jump(*to, cause);
    // A control would repeat the main program forever.
    run_.warn_once("M99 ends the main program, which a control would begin once more");
    ended_ = true;
    return;
  }
  Call& call = calls_.back();
  if (call.left > 0 && !to) {
    --call.left;
    at_ = call.program->first;
    // M98 has no local variables, so its repeats need no new call.
    if (!call.macro) return;
    Call again = std::move(call);
    if (again.modal && modal_) {
      store_locals();
      again.arguments = modal_->arguments;
    }
    calls_.pop_back();
    variables_.leave();
    Program* program = again.program;
    return enter(program, std::move(again), cause);
  }
  at_ = call.back;
  if (call.modal && modal_) store_locals();
  if (call.macro) variables_.leave();
  calls_.pop_back();
  if (to) jump(*to, cause);
}

/// Warns of programs that nothing calls, and of text behind the end of the main program. Blocks
/// with a sequence number may be targets of a jump whose condition did not hold, so they are not
/// reported.
void Flow::warn_unread() {
  const Source& main = *sources_.front();
  const bool jumps = std::ranges::any_of(main.lines, [](std::string_view line) {
    const auto goto_at = std::ranges::search(line, std::string_view("GOTO"), {}, upper);
    return !goto_at.empty();
  });
  std::vector<Section> sections;
  for (const Program& program : main.programs) {
    Section section{program.first, program.end};
    if (jumps && run_.canon.file() == 0)
      for (std::size_t i = std::size_t(run_.canon.line()); i < program.end; ++i)
        if (i >= program.first && head_of(main.lines[i]).sequence >= 0) {
          section.end = i;
          break;
        }
    sections.push_back(section);
  }
  sections.push_back({std::min(main.end + 1, main.lines.size()), main.lines.size()});
  run_.warn_unread(main.lines, sections);
}

void Flow::end_of_program() {
  const Call ended = calls_.back();
  at_ = ended.back;
  calls_.pop_back();
  if (ended.macro) variables_.leave();
  // Without M99 the control does not know where to return.
  const program::NcLocation place = run_.canon.place();
  throw BadInput(place.file, place.line, 0, fmt::format("M99 of O{:04}", ended.program->number),
                 "its end");
}

}  // namespace abbe::sim::dialects::fanuc
