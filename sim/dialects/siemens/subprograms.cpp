#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens/flow.h"

namespace abbe::sim::dialects::siemens {

namespace {

namespace fs = std::filesystem;

// Names are compared in upper case.
std::string to_capitals(std::string_view text) {
  std::string all;
  for (const char c : text) all += upper(c);
  return all;
}

/// Returns NAME of a header %_N_NAME_MPF or %_N_NAME_SPF; nothing if the line is no header.
std::optional<std::string> program_name_in_head(std::string_view line) {
  const std::string text = to_capitals(line.substr(0, line.find_first_of(" \t;")));
  if (!text.starts_with("%_N_")) return std::nullopt;
  const std::string name = text.substr(4);
  const bool ends = name.ends_with("_MPF") || name.ends_with("_SPF");
  return ends ? name.substr(0, name.size() - 4) : name;
}

bool is_not_blank(std::string_view line) {
  return split_comment(line).block.find_first_not_of(" \t") != std::string_view::npos;
}

/// Splits a text into programs: each header begins another one. There is at least one.
std::vector<std::unique_ptr<Program>> split(std::string_view text) {
  std::vector<std::unique_ptr<Program>> all;
  all.push_back(std::make_unique<Program>());
  Lines lines(text);
  while (const auto line = lines.next()) {
    if (const auto name = program_name_in_head(*line)) {
      Program& before = *all.back();
      // Only blank lines before the first header: they belong to no program.
      if (all.size() > 1 || std::any_of(before.lines.begin(), before.lines.end(), is_not_blank))
        all.push_back(std::make_unique<Program>());
      else
        before.lines.clear();
      all.back()->name = *name;
      all.back()->first_line = lines.number() + 1;
      continue;
    }
    all.back()->lines.push_back(*line);
  }
  return all;
}

/// Returns true if the line contains M6 or M06 as a word.
bool has_m6(std::string_view line) {
  for (std::size_t at = 0; at + 1 < line.size(); ++at) {
    if (upper(line[at]) != 'M' || (at > 0 && is_letter(line[at - 1]))) continue;
    std::size_t digit = at + 1;
    while (digit < line.size() && line[digit] == '0') ++digit;
    const bool is_six = digit < line.size() && line[digit] == '6';
    if (is_six && (digit + 1 == line.size() || !is_digit(line[digit + 1]))) return true;
  }
  return false;
}

}  // namespace

void Flow::take_programs(std::string_view text) { programs_ = split(text); }

// Without any M6 in the text T changes the tool at once, as machine data may set it.
bool Flow::uses_m6() const {
  return std::any_of(programs_.begin(), programs_.end(), [](const auto& program) {
    return std::any_of(program->lines.begin(), program->lines.end(),
                       [](std::string_view line) { return has_m6(split_comment(line).block); });
  });
}

Program* Flow::load_program_file(const fs::path& file, const std::string& name) {
  std::string text = read_text(file, run_.options().control.max_bytes);
  auto program = std::make_unique<Program>();
  program->text = std::move(text);
  auto parts = split(program->text);
  program->lines = std::move(parts.front()->lines);
  program->first_line = parts.front()->first_line;
  program->name = name;
  program->file = run_.canon.add_file(file.string());
  // A file named after a subprogram contains that one only.
  if (parts.size() > 1)
    run_.warn_once(
        fmt::format("{}:{}: a second program, {}, is not read: a subprogram has a file of its own",
                    file.string(), parts[1]->first_line, parts[1]->name));
  programs_.push_back(std::move(program));
  return programs_.back().get();
}

/// Searches a subprogram in the text, then in a file of its name. Returns null if there is none.
Program* Flow::find_program(const std::string& name) {
  if (const auto known = found_.find(name); known != found_.end()) return known->second;
  Program* found = nullptr;
  for (const auto& program : programs_)
    if (!name.empty() && program->name == name) found = program.get();
  const fs::path& folder = run_.options().folder;
  if (found == nullptr && !folder.empty()) {
    std::string small = name;
    std::transform(small.begin(), small.end(), small.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
    // Linux distinguishes case in file names, the control does not.
    for (const std::string& file : {name + ".SPF", name + ".spf", small + ".spf", small + ".SPF"}) {
      std::error_code none;
      if (!fs::is_regular_file(folder / file, none)) continue;
      found = load_program_file(folder / file, name);
      break;
    }
  }
  found_[name] = found;
  return found;
}

void Flow::call(const ProgramCall& called, long long times) {
  Program* program = find_program(called.name);
  // A call of a name whose definition has an error is not reported again.
  run_.require_certain(called.name, called.cause);
  if (program == nullptr)
    return run_.handle_unknown_word(called.cause,
                        fmt::format("a word of Siemens, or a subprogram {} in the program or in "
                                    "{}.SPF beside it",
                                    called.name, called.name));
  enter(*program, called, times);
}

void Flow::enter(Program& program, const ProgramCall& called, long long times) {
  run_.check_depth(int(calls_.size()), called.cause);
  calls_.push_back(
      {.program = &program, .back = at_, .left = times - 1, .arguments = called.arguments});
  variables_.enter();
  at_ = 0;
  // On an error in the parameters the call is undone, so that reading continues behind it.
  try {
    bind(program, called.arguments, called.cause);
  } catch (const BadInput&) {
    at_ = calls_.back().back;
    calls_.pop_back();
    variables_.leave();
    throw;
  }
}

/// Assigns the arguments to the parameters of PROC.
void Flow::bind(Program& program, const std::vector<Argument>& arguments, const Cause& cause) {
  std::size_t first = 0;
  // PROC must be the first line with content.
  while (first < program.lines.size() && !is_not_blank(program.lines[first])) ++first;
  const bool has_lines = first < program.lines.size();
  const std::string_view text = has_lines ? split_comment(program.lines[first]).block : "";
  const LineHead head = head_of(text);
  const int line = run_.canon.line();
  if (head.keyword != "PROC") {
    if (!arguments.empty()) run_.canon.refuse(cause, "no parameters of a subprogram without PROC");
    return;
  }
  Cursor cursor{text, run_.canon.place(), head.rest};
  cursor.skip_blanks();
  name_at(cursor);
  std::size_t n = 0;
  if (cursor.accept("(")) {
    for (; !cursor.accept(")"); ++n) {
      cursor.skip_blanks();
      const std::size_t from = cursor.at;
      const std::string type = name_at(cursor);
      static constexpr std::array<std::pair<std::string_view, Kind>, 4> kinds = {
          {{"REAL", Kind::Real},
           {"INT", Kind::Integer},
           {"BOOL", Kind::Truth},
           {"CHAR", Kind::Integer}}};
      const auto kind = std::find_if(kinds.begin(), kinds.end(),
                                     [&](const auto& one) { return one.first == type; });
      if (kind == kinds.end())
        cursor.refuse(from, "parameters of REAL, INT, BOOL or CHAR by value in PROC");
      cursor.skip_blanks();
      const std::size_t at_name = cursor.at;
      const std::string name = name_at(cursor);
      if (name.size() < 2) cursor.refuse(at_name, "a name of two letters or more");
      calls_.back().variables[name] = {kind->second, {}};
      // A parameter that is not passed has its default, or zero.
      double value = 0.0;
      if (cursor.accept("=")) value = number_at(cursor, *this);
      if (n < arguments.size() && arguments[n].text)
        run_.canon.refuse(arguments[n].cause, "a number for " + name);
      if (n < arguments.size() && arguments[n].number) value = *arguments[n].number;
      store(name, kind->second, value, cursor, at_name);
      cursor.accept(",");
    }
  }
  if (arguments.size() > n)
    run_.canon.refuse(cause, fmt::format("at most {} parameters of {}", n, program.name),
                      fmt::format("{}", arguments.size()));
  // Words behind PROC that affect only the display are accepted; SAVE would restore modes.
  for (cursor.skip_blanks(); !cursor.at_end(); cursor.skip_blanks()) {
    const std::size_t from = cursor.at;
    const std::string word = name_at(cursor);
    if (word != "DISPLOF" && word != "DISPLON" && word != "SBLOF" && word != "ACTBLOCNO")
      cursor.refuse(from, "modes set again by the caller: no SAVE and the like behind PROC");
  }
  at_ = first + 1;
  // Messages about the parameters point at the line of the call again.
  run_.canon.set_line(line, calls_[calls_.size() - 2].program->file);
}

long long Flow::times_at(Cursor& cursor) {
  cursor.skip_blanks();
  if (cursor.at_end()) return 1;
  const std::size_t from = cursor.at;
  if (!cursor.accept("P")) cursor.refuse(from, "P, the number of repeats");
  cursor.accept("=");
  const double times = number_at(cursor, *this);
  if (!(times >= 1 && times <= 9999) || times != double((long long)(times)))
    cursor.refuse(from, "whole repeats P of 1 to 9999");
  ends(cursor);
  return (long long)(times);
}

/// REPEAT A, REPEAT A B, REPEATB A, each with P: executes lines of this program again.
void Flow::repeat(Cursor& cursor, bool one_block) {
  const std::size_t here = at_;
  std::vector<std::size_t> lines;
  cursor.skip_blanks();
  const std::size_t start = cursor.at;
  while (lines.size() < 2) {
    cursor.skip_blanks();
    const std::size_t from = cursor.at;
    const std::string label = name_at(cursor);
    // P or P5 behind the labels is the number of repeats, not a label.
    const bool is_times = label.empty() || label == "P" ||
                          (label[0] == 'P' && label.size() > 1 &&
                           std::all_of(label.begin() + 1, label.end(), is_digit));
    if (is_times) {
      cursor.at = from;
      break;
    }
    const Cause cause = cursor.cause(from);
    std::size_t line = 0;
    // A label may stand before or behind the REPEAT.
    try {
      line = line_of(label, "GOTOB", cause);
    } catch (const BadInput&) {
      line = line_of(label, "GOTO", cause);
    }
    lines.push_back(line);
  }
  const Cause cause = cursor.cause(start);
  if (lines.empty() || (one_block && lines.size() > 1))
    cursor.refuse(start, "a label behind REPEATB");
  const long long times = times_at(cursor);
  std::size_t end = here;
  if (one_block) {
    end = lines[0] + 1;
  } else if (lines.size() == 2) {
    end = lines[1] + 1;
  } else {
    // With one label the part ends at ENDLABEL, or at the REPEAT itself if the label stands before
    // it.
    const std::vector<std::string_view>& all = calls_.back().program->lines;
    const std::size_t last = lines[0] < here ? here : all.size();
    for (std::size_t at = lines[0]; at < last; ++at)
      if (head_of(split_comment(all[at]).block).label == "ENDLABEL") {
        end = at + 1;
        break;
      }
  }
  if (end <= lines[0])
    run_.canon.refuse(cause, "ENDLABEL: behind a label that stands below REPEAT");
  // A repeated part counts as a call, since parts may nest.
  run_.check_depth(int(calls_.size()), cause);
  calls_.push_back({.program = calls_.back().program,
                    .back = here + 1,
                    .part = true,
                    .begin = lines[0],
                    .end = end,
                    .left = times - 1});
  at_ = lines[0];
}

/// Warns of programs in the text that nothing calls, and of text behind the end of the main
/// program. A block with a label may be the target of a jump whose condition did not hold, so it is
/// not reported.
void Flow::warn_unread() {
  std::vector<std::string_view> lines;
  std::vector<Section> sections;
  for (const auto& program : programs_) {
    if (program->file != 0) continue;
    const std::size_t first = std::size_t(program->first_line) - 1;
    Section section{first, first + program->lines.size()};
    lines.resize(std::max(lines.size(), section.end));
    std::copy(program->lines.begin(), program->lines.end(), lines.begin() + std::ptrdiff_t(first));
    for (std::size_t i = std::size_t(std::max(run_.canon.line(), 1)); i < section.end; ++i)
      if (i >= first && !head_of(split_comment(lines[i]).block).label.empty()) {
        section.end = i;
        break;
      }
    sections.push_back(section);
  }
  run_.warn_of_unread_lines(lines, sections);
}

// The number of repeats is counted down at the end of each pass.
void Flow::finish_part() {
  Call& now = calls_.back();
  if (now.left-- > 0) {
    at_ = now.begin;
    return;
  }
  at_ = now.back;
  calls_.pop_back();
}

/// Ends a subprogram; at the end of the main program everything ends.
void Flow::leave() {
  // Repeated parts of the subprogram end with it.
  while (calls_.back().part) calls_.pop_back();
  if (calls_.size() == 1) {
    ended_ = true;
    return;
  }
  Call& now = calls_.back();
  const std::size_t back = now.back;
  // A repeat starts with new local variables.
  if (now.left-- > 0) {
    variables_.leave();
    variables_.enter();
    now.variables.clear();
    now.texts.clear();
    const std::vector<Argument> arguments = now.arguments;
    at_ = 0;
    return bind(*now.program, arguments, {1, {}});
  }
  at_ = back;
  calls_.pop_back();
  variables_.leave();
  // The modal subprogram has ended, so later moves call it again.
  if (calls_.size() < modal_depth_) modal_depth_ = 0;
}

/// Example: CALL "NAME".
void Flow::call_by_name(Cursor& cursor) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  std::optional<std::string> name;
  if (cursor.current() == '"')
    name = quoted_at(cursor);
  else
    name = text_variable(cursor);
  if (!name) cursor.refuse(from, "the name of a subprogram in quotes behind CALL");
  // The name becomes a file name: a path could lead out of the folder of the program.
  const bool plain = std::all_of(name->begin(), name->end(),
                                 [](char c) { return is_letter(c) || is_digit(c) || c == '_'; });
  if (!plain || name->empty() || name->size() > 100)
    cursor.refuse(from, "a name of letters, digits and _, without folders", in_quotes(*name));
  ProgramCall called{to_capitals(*name), {}, false, cursor.cause(from)};
  ends(cursor);
  ++at_;
  call(called, 1);
}

namespace {

// R parameters of the control; the number is usually limited by machine data.
constexpr int max_r = 32767;
// INT of the control has 32 bits.
constexpr double max_integer = 2147483647.0;

bool begins_assignment(const Cursor& cursor) {
  Cursor ahead = cursor;
  ahead.skip_blanks();
  return ahead.current() == '=' && ahead.peek() != '=';
}

}  // namespace

// Repeated parts use the variables of the program around them.
Flow::Call& Flow::scope() {
  std::size_t at = calls_.size() - 1;
  while (calls_[at].part) --at;
  return calls_[at];
}

/// Parses R1 or R[...] and returns its number.
double Flow::r_parameter(Cursor& cursor, std::size_t from) {
  ++cursor.at;
  double number = 0.0;
  if (cursor.current() == '[') {
    ++cursor.at;
    number = number_at(cursor, *this);
    if (!cursor.accept("]")) cursor.refuse(cursor.at, "] behind the number of a parameter");
  } else {
    // The limit keeps a hostile number of digits from growing without end.
    while (is_digit(cursor.current()) && number < 1e9)
      number = 10 * number + (cursor.text[cursor.at++] - '0');
  }
  if (!(number >= 0 && number <= max_r) || number != std::floor(number))
    cursor.refuse(from, fmt::format("a parameter of R0 to R{}", max_r));
  return number;
}

/// Returns the name of one element of an array, "FIELD[2,0]", or the name itself for a simple
/// variable.
std::string Flow::element(Cursor& cursor, const std::string& name, const Variable& variable) {
  if (variable.sizes.empty()) return name;
  const std::size_t from = cursor.at;
  if (cursor.current() != '[') cursor.refuse(from, "[ behind the name of a field");
  ++cursor.at;
  std::string all = name + "[";
  for (std::size_t k = 0; k < variable.sizes.size(); ++k) {
    if (k > 0 && !cursor.accept(",")) cursor.refuse(cursor.at, ", before the next index");
    const double index = number_at(cursor, *this);
    if (!(index >= 0 && index < variable.sizes[k]) || index != std::floor(index))
      cursor.refuse(from, fmt::format("a whole index of 0 to {}", variable.sizes[k] - 1),
                    fmt::format("{}", index));
    all += fmt::format("{}{}", k > 0 ? "," : "", int(index));
  }
  if (!cursor.accept("]")) cursor.refuse(cursor.at, "] behind an index");
  return all + "]";
}

// Values are converted to the type of the variable, as the control does.
void Flow::store(const std::string& name, Kind kind, double value, const Cursor& cursor,
                 std::size_t from) {
  if (kind == Kind::Integer) value = std::round(value);
  if (kind == Kind::Truth) value = value != 0 ? 1.0 : 0.0;
  if (kind == Kind::Integer && !(std::abs(value) <= max_integer))
    cursor.refuse(from, "a whole number of 32 bits", fmt::format("{}", value));
  if (!variables_.set(name, value, Variables::Scope::Call))
    throw ProgramLimitExceeded(cursor.location.file, cursor.location.line, 0,
                               fmt::format("at most {} variables", run_.options().limits.variables),
                               "more");
}

bool Flow::set_variable(Cursor& cursor) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const char first = upper(cursor.current());
  Cursor ahead = cursor;
  if (first == 'R' && (is_digit(cursor.peek()) || cursor.peek() == '[')) {
    const int number = int(r_parameter(ahead, from));
    if (!begins_assignment(ahead)) return false;
    ahead.accept("=");
    // A variable whose assignment has an error is uncertain: its uses are not reported again.
    run_.define(fmt::format("R{}", number), [&] {
      const double value = number_at(ahead, *this);
      if (!variables_.set(number, value))
        throw ProgramLimitExceeded(
            cursor.location.file, cursor.location.line, 0,
            fmt::format("at most {} variables", run_.options().limits.variables), "more");
    });
    cursor.at = ahead.at;
    return true;
  }
  const Call& now = scope();
  if (now.variables.empty()) return false;
  const std::string name = name_at(ahead);
  const auto found = now.variables.find(name);
  if (found == now.variables.end()) return false;
  const Variable variable = found->second;
  const std::string place = element(ahead, name, variable);
  if (!begins_assignment(ahead)) return false;
  ahead.accept("=");
  if (variable.kind == Kind::Text) {
    ahead.skip_blanks();
    std::optional<std::string> text;
    if (ahead.current() == '"')
      text = quoted_at(ahead);
    else
      text = text_variable(ahead);
    if (!text) ahead.refuse(ahead.at, "a text in quotes");
    scope().texts[name] = *text;
  } else {
    run_.define(place, [&] { store(place, variable.kind, number_at(ahead, *this), ahead, from); });
  }
  cursor.at = ahead.at;
  return true;
}

std::optional<std::string> Flow::text_variable(Cursor& cursor) {
  const Call& now = scope();
  if (now.variables.empty()) return std::nullopt;
  Cursor ahead = cursor;
  ahead.skip_blanks();
  const std::string name = name_at(ahead);
  const auto found = now.variables.find(name);
  if (found == now.variables.end() || found->second.kind != Kind::Text) return std::nullopt;
  cursor.at = ahead.at;
  const auto text = now.texts.find(name);
  return text == now.texts.end() ? std::string() : text->second;
}

/// Example: DEF REAL A1, A2=5, FIELD[10].
void Flow::define(Cursor& cursor) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const std::string type = name_at(cursor);
  static constexpr std::array<std::pair<std::string_view, Kind>, 5> kinds = {
      {{"REAL", Kind::Real},
       {"INT", Kind::Integer},
       {"BOOL", Kind::Truth},
       {"CHAR", Kind::Integer},
       {"STRING", Kind::Text}}};
  const auto kind =
      std::find_if(kinds.begin(), kinds.end(), [&](const auto& one) { return one.first == type; });
  if (kind == kinds.end()) cursor.refuse(from, "REAL, INT, BOOL, CHAR or STRING behind DEF");
  // The length of a string does not matter here.
  if (kind->second == Kind::Text && cursor.current() == '[') {
    ++cursor.at;
    number_at(cursor, *this);
    if (!cursor.accept("]")) cursor.refuse(cursor.at, "] behind the length of a text");
  }
  Cursor names = cursor;
  try {
    do define_one(cursor, kind->second);
    while (cursor.accept(","));
    ends(cursor);
    // All names of a definition with an error are uncertain, or each use would be reported.
  } catch (const BadInput&) {
    for (; !names.at_end(); ++names.at)
      if (const std::string name = name_at(names); !name.empty()) run_.mark_uncertain(name);
    throw;
  }
}

void Flow::define_one(Cursor& cursor, Kind kind) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const std::string name = name_at(cursor);
  // A letter followed by a digit would be an address (X1).
  if (name.size() < 2 || (is_letter(name[0]) && is_digit(name[1])) || find_entry(name) != nullptr ||
      Machine::is_cycle(name))
    cursor.refuse(from, "a name of two letters or more that is no word of the control");
  Variable variable{kind, {}};
  if (cursor.current() == '[') {
    if (kind == Kind::Text) cursor.refuse(cursor.at, "no fields of texts");
    // The number of elements is limited before any is stored.
    ++cursor.at;
    double all = 1.0;
    do {
      const std::size_t at_size = cursor.at;
      const double size = number_at(cursor, *this);
      all *= size;
      if (!(size >= 1 && all <= 1e6) || size != std::floor(size) || variable.sizes.size() == 3)
        cursor.refuse(at_size, "at most three sizes and 1e6 elements of a field");
      variable.sizes.push_back(int(size));
    } while (cursor.accept(","));
    if (!cursor.accept("]")) cursor.refuse(cursor.at, "] behind the size of a field");
  }
  auto& variables = scope().variables;
  if (variables.size() >= run_.options().limits.variables)
    throw ProgramLimitExceeded(cursor.location.file, cursor.location.line, 0,
                               fmt::format("at most {} variables", run_.options().limits.variables),
                               "more");
  variables[name] = variable;
  // Simple variables start at zero; elements of arrays are zero until they are set.
  if (!cursor.accept("=")) {
    if (variable.sizes.empty() && kind != Kind::Text) store(name, kind, 0.0, cursor, from);
    return;
  }
  if (!variable.sizes.empty()) cursor.refuse(cursor.at, "no values of a whole field in DEF");
  if (kind == Kind::Text) {
    cursor.skip_blanks();
    if (cursor.current() != '"') cursor.refuse(cursor.at, "a text in quotes");
    scope().texts[name] = quoted_at(cursor);
  } else {
    store(name, kind, number_at(cursor, *this), cursor, from);
  }
}

/// Examples: 'HFF' or 'B1001'.
double Flow::quoted_number(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  const char base = upper(cursor.current());
  ++cursor.at;
  const std::size_t digits = cursor.at;
  while (!cursor.at_end() && cursor.current() != '\'') ++cursor.at;
  const std::string_view text = cursor.text.substr(std::min(digits, cursor.text.size()),
                                                   cursor.at - std::min(digits, cursor.at));
  std::uint32_t value = 0;
  const auto read =
      std::from_chars(text.data(), text.data() + text.size(), value, base == 'H' ? 16 : 2);
  const bool known = (base == 'H' || base == 'B') && read.ec == std::errc() &&
                     read.ptr == text.data() + text.size() && cursor.current() == '\'';
  if (!known) cursor.refuse(from, "a number as 'HFF' or 'B1001', of at most 32 bits");
  ++cursor.at;
  return double(value);
}

// System variables that depend only on what is simulated here.
std::optional<double> Flow::system_variable(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  const std::string name = name_at(cursor);
  if (name == "PI") return pi;
  const bool in_workpiece = name == "AA_IW" || name == "P_EP";
  if ((in_workpiece || name == "AA_IM") && cursor.accept("[")) {
    cursor.skip_blanks();
    const std::size_t at_axis = cursor.at;
    const std::string axis = name_at(cursor);
    const auto value = axis.size() == 1 ? machine_->position(axis[0], !in_workpiece) : std::nullopt;
    if (!value) cursor.refuse(at_axis, "an axis of this machine (" + run_.canon.letters() + ")");
    if (!cursor.accept("]")) cursor.refuse(cursor.at, "] behind the name of an axis");
    return value;
  }
  cursor.refuse(from, "$PI, $P_EP[axis], $AA_IW[axis] or $AA_IM[axis]: no other system variable");
}

/// Evaluates ATAN2, MINVAL, MAXVAL or BOUND at its bracket.
std::optional<double> Flow::function_of_several(Cursor& cursor, const std::string& name) {
  const std::size_t count = name == "BOUND"                                           ? 3
                            : name == "ATAN2" || name == "MINVAL" || name == "MAXVAL" ? 2
                                                                                      : 0;
  if (count == 0) return std::nullopt;
  cursor.skip_blanks();
  const std::size_t open = cursor.at;
  if (!cursor.accept("(")) cursor.refuse(open, "( behind " + name);
  std::array<double, 3> x{};
  for (std::size_t k = 0; k < count; ++k) {
    if (k > 0 && !cursor.accept(","))
      cursor.refuse(cursor.at, fmt::format(", and {} numbers of {}", count, name));
    x[k] = parse_expression(cursor, grammar(), *this);
  }
  if (!cursor.accept(")"))
    cursor.refuse(cursor.at, fmt::format(") behind {} numbers of {}", count, name));
  if (name == "ATAN2") return std::atan2(x[0], x[1]) / units::deg;
  if (name == "MINVAL") return std::min(x[0], x[1]);
  if (name == "MAXVAL") return std::max(x[0], x[1]);
  // The control raises an alarm for reversed limits.
  if (x[0] > x[1]) cursor.refuse(open, "the lower limit of BOUND before the upper one");
  return std::clamp(x[2], x[0], x[1]);
}

std::optional<double> Flow::parse_operand(Cursor& cursor) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const char first = upper(cursor.current());
  if (first == 'R' && (is_digit(cursor.peek()) || cursor.peek() == '[')) {
    const int number = int(r_parameter(cursor, from));
    if (run_.is_uncertain()) run_.require_certain(fmt::format("R{}", number), cursor.cause(from));
    // An R parameter that was never set is zero.
    return variables_.number(number).value_or(0.0);
  }
  if (first == '\'') return quoted_number(cursor);
  if (first == '$') return system_variable(cursor);
  Cursor ahead = cursor;
  const std::string name = name_at(ahead);
  if (name.empty()) return std::nullopt;
  const auto taken = [&](std::optional<double> value) {
    cursor.at = ahead.at;
    return value;
  };
  if (name == "TRUE") return taken(1.0);
  if (name == "FALSE") return taken(0.0);
  if (name == "NOT" || name == "B_NOT") {
    const double inner = parse_value(ahead, grammar(), *this);
    // B_NOT works on integers.
    return taken(name == "NOT" ? double(inner == 0) : double(~std::int64_t(inner)));
  }
  if (const auto result = function_of_several(ahead, name)) return taken(result);
  const Call& now = scope();
  const auto found = now.variables.find(name);
  // A name in doubt must not be reported as unknown.
  run_.require_certain(name, cursor.cause(from, ahead.at));
  if (found == now.variables.end()) return std::nullopt;
  if (found->second.kind == Kind::Text) cursor.refuse(from, "a number", "the text " + name);
  const std::string place = element(ahead, name, found->second);
  run_.require_certain(place, cursor.cause(from, ahead.at));
  return taken(variables_.named(place, Variables::Scope::Call).value_or(0.0));
}

}  // namespace abbe::sim::dialects::siemens
