#include <charconv>

#include "sim/dialects/siemens/siemens.h"

namespace abbe::sim::dialects::siemens {

namespace {

namespace fs = std::filesystem;

// The control compares names in upper case.
std::string to_upper(std::string_view text) {
  std::string result;
  for (const char c : text) result += upper(c);
  return result;
}

/// Returns NAME of a header %_N_NAME_MPF or %_N_NAME_SPF, or nothing if the line is no header.
std::optional<std::string> program_name_in_header(std::string_view line) {
  const std::string text = to_upper(line.substr(0, line.find_first_of(" \t;")));
  if (!text.starts_with("%_N_")) return std::nullopt;
  const std::string name = text.substr(4);
  const bool has_type = name.ends_with("_MPF") || name.ends_with("_SPF");
  return has_type ? name.substr(0, name.size() - 4) : name;
}

bool is_not_blank(std::string_view line) {
  return split_comment(line).block.find_first_not_of(" \t") != std::string_view::npos;
}

/// Splits a text into programs; each header begins another one. Returns at least one program.
std::vector<std::unique_ptr<Program>> split(std::string_view text) {
  std::vector<std::unique_ptr<Program>> programs;
  programs.push_back(std::make_unique<Program>());
  LineReader lines(text);
  while (const auto line = lines.next()) {
    if (const auto name = program_name_in_header(*line)) {
      Program& previous = *programs.back();
      // Blank lines before the first header belong to no program.
      if (programs.size() > 1 || std::ranges::any_of(previous.lines, is_not_blank))
        programs.push_back(std::make_unique<Program>());
      else
        previous.lines.clear();
      programs.back()->name = *name;
      programs.back()->first_line = lines.number() + 1;
      continue;
    }
    programs.back()->lines.push_back(*line);
  }
  return programs;
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

Flow::Flow(std::string_view text, ProgramRun& run) : ProgramFlow(run) {
  sources_ = split(text);
  calls_.push_back({.program = sources_.front().get()});
}

// In a text without M6 T itself changes the tool, to which machine data can set the control.
bool Flow::uses_m6() const {
  return std::any_of(sources_.begin(), sources_.end(), [](const auto& program) {
    return std::any_of(program->lines.begin(), program->lines.end(),
                       [](std::string_view line) { return has_m6(split_comment(line).block); });
  });
}

Program* Flow::load_program_file(const fs::path& file, const std::string& name) {
  std::string text = read_text(file, run_.options().control.max_bytes);
  auto program = std::make_unique<Program>();
  program->text = std::move(text);
  auto programs = split(program->text);
  program->lines = std::move(programs.front()->lines);
  program->first_line = programs.front()->first_line;
  program->name = name;
  program->file = run_.canon.add_file(file.string());
  // A file named after a subprogram contains only that subprogram.
  if (programs.size() > 1)
    run_.warn_once(
        fmt::format("{}:{}: a second program, {}, is not read: a subprogram needs its own file",
                    file.string(), programs[1]->first_line, programs[1]->name));
  sources_.push_back(std::move(program));
  return sources_.back().get();
}

/// Returns a subprogram from the text, or else from a file of its name. Returns null if there is
/// none.
Program* Flow::find_program(const std::string& name) {
  if (const auto entry = programs_by_name_.find(name); entry != programs_by_name_.end())
    return entry->second;
  Program* result = nullptr;
  for (const auto& program : sources_)
    if (!name.empty() && program->name == name) result = program.get();
  const fs::path& folder = run_.options().subprogram_folder;
  if (result == nullptr && !folder.empty()) {
    std::string lower_name = name;
    std::transform(lower_name.begin(), lower_name.end(), lower_name.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
    // Linux distinguishes case in file names, the control does not.
    for (const std::string& file :
         {name + ".SPF", name + ".spf", lower_name + ".spf", lower_name + ".SPF"}) {
      std::error_code error;
      if (!fs::is_regular_file(folder / file, error)) continue;
      result = load_program_file(folder / file, name);
      break;
    }
  }
  programs_by_name_[name] = result;
  return result;
}

void Flow::call_program(const ProgramCall& program_call, long long count) {
  Program* program = find_program(program_call.name);
  // A call of a name whose definition has an error is not reported.
  run_.require_certain(program_call.name, program_call.cause);
  if (program == nullptr)
    return run_.handle_unknown_word(
        program_call.cause,
        fmt::format("a Siemens word, or a subprogram {} in the program or in {}.SPF next to it",
                    program_call.name, program_call.name));
  enter_program(*program, program_call, count);
}

void Flow::enter_program(Program& program, const ProgramCall& program_call, long long count) {
  run_.check_depth(int(calls_.size()), program_call.cause);
  calls_.push_back({.program = &program,
                    .return_line = line_index_,
                    .remaining_repeats = count - 1,
                    .arguments = program_call.arguments});
  variables_.enter();
  line_index_ = 0;
  // An error in the parameters undoes the call, so that reading continues after it.
  try {
    bind_parameters(program, program_call.arguments, program_call.cause);
  } catch (const BadInput&) {
    line_index_ = calls_.back().return_line;
    calls_.pop_back();
    variables_.leave();
    throw;
  }
}

/// Assigns the arguments to the parameters that PROC declares.
void Flow::bind_parameters(Program& program, const std::vector<Argument>& arguments,
                           const Cause& cause) {
  std::size_t first = 0;
  // PROC must be the first line with content.
  while (first < program.lines.size() && !is_not_blank(program.lines[first])) ++first;
  const bool has_lines = first < program.lines.size();
  const std::string_view text = has_lines ? split_comment(program.lines[first]).block : "";
  const LineHead head = parse_line_head(text);
  const int line = run_.canon.line();
  if (head.keyword != "PROC") {
    if (!arguments.empty()) throw_input_error(cause, "no parameters of a subprogram without PROC");
    return;
  }
  Cursor cursor{text, run_.canon.place(), head.end};
  cursor.skip_blanks();
  parse_name(cursor);
  std::size_t count = 0;
  if (cursor.accept("(")) {
    for (; !cursor.accept(")"); ++count) {
      const std::size_t from = skip_blanks(cursor);
      const std::string type = parse_name(cursor);
      const auto kind = find_kind(type);
      if (!kind || *kind == VariableKind::Text)
        cursor.throw_input_error(from, "parameters of REAL, INT, BOOL or CHAR by value in PROC");
      const std::size_t name_from = skip_blanks(cursor);
      const std::string name = parse_name(cursor);
      if (name.size() < 2) cursor.throw_input_error(name_from, "a name of at least two letters");
      calls_.back().variables[name] = {*kind, {}};
      // A parameter that is not passed has its default, or zero.
      double value = 0.0;
      if (cursor.accept("=")) value = parse_number(cursor, *this);
      if (count < arguments.size() && arguments[count].text)
        throw_input_error(arguments[count].cause, "a number for " + name);
      if (count < arguments.size() && arguments[count].number) value = *arguments[count].number;
      store_value(name, *kind, value, cursor, name_from);
      cursor.accept(",");
    }
  }
  if (arguments.size() > count)
    throw_input_error(cause, fmt::format("at most {} parameters of {}", count, program.name),
                      fmt::format("{}", arguments.size()));
  // Words that affect only the display may follow; SAVE would have to restore modes.
  for (cursor.skip_blanks(); !cursor.at_end(); cursor.skip_blanks()) {
    const std::size_t from = cursor.at;
    const std::string word = parse_name(cursor);
    if (word != "DISPLOF" && word != "DISPLON" && word != "SBLOF" && word != "ACTBLOCNO")
      cursor.throw_input_error(
          from, "modes set again by the caller: SAVE and similar after PROC are not supported");
  }
  line_index_ = first + 1;
  // From here on messages point at the line of the call.
  run_.canon.set_line(line, calls_[calls_.size() - 2].program->file);
}

long long Flow::parse_repeat_count(Cursor& cursor) {
  cursor.skip_blanks();
  if (cursor.at_end()) return 1;
  const std::size_t from = cursor.at;
  if (!cursor.accept("P")) cursor.throw_input_error(from, "P, the number of repeats");
  cursor.accept("=");
  const double count = parse_number(cursor, *this);
  if (!(count >= 1 && count <= 9999) || count != double((long long)(count)))
    cursor.throw_input_error(from, "an integer P from 1 to 9999 (repeats)");
  expect_end(cursor);
  return (long long)(count);
}

/// Executes REPEAT A, REPEAT A B and REPEATB A, each with or without P: runs lines of this program
/// again.
void Flow::repeat_section(Cursor& cursor, bool one_block) {
  const std::size_t repeat_line = line_index_;
  std::vector<std::size_t> lines;
  const std::size_t start = skip_blanks(cursor);
  while (lines.size() < 2) {
    const std::size_t from = skip_blanks(cursor);
    const std::string label = parse_name(cursor);
    // P or P5 after the labels is the number of repeats, not a label.
    const bool is_repeat_count = label.empty() || label == "P" ||
                                 (label[0] == 'P' && label.size() > 1 &&
                                  std::all_of(label.begin() + 1, label.end(), is_digit));
    if (is_repeat_count) {
      cursor.at = from;
      break;
    }
    const Cause cause = cursor.cause(from);
    std::size_t line = 0;
    // The label may be before or after REPEAT.
    try {
      line = line_of(label, "GOTOB", cause);
    } catch (const BadInput&) {
      line = line_of(label, "GOTO", cause);
    }
    lines.push_back(line);
  }
  const Cause cause = cursor.cause(start);
  if (lines.empty() || (one_block && lines.size() > 1))
    cursor.throw_input_error(start, "a label after REPEATB");
  const long long count = parse_repeat_count(cursor);
  std::size_t end = repeat_line;
  if (one_block) {
    end = lines[0] + 1;
  } else if (lines.size() == 2) {
    end = lines[1] + 1;
  } else {
    // With one label the section ends at ENDLABEL. Without ENDLABEL it ends at REPEAT if the label
    // stands before it.
    const std::vector<std::string_view>& program_lines = calls_.back().program->lines;
    const std::size_t search_end = lines[0] < repeat_line ? repeat_line : program_lines.size();
    for (std::size_t at = lines[0]; at < search_end; ++at)
      if (parse_line_head(split_comment(program_lines[at]).block).label == "ENDLABEL") {
        end = at + 1;
        break;
      }
  }
  if (end <= lines[0]) throw_input_error(cause, "ENDLABEL: after a label below REPEAT");
  // A repeated section counts as a call because sections may nest.
  run_.check_depth(int(calls_.size()), cause);
  calls_.push_back({.program = calls_.back().program,
                    .return_line = repeat_line + 1,
                    .is_repeated_section = true,
                    .begin = lines[0],
                    .end = end,
                    .remaining_repeats = count - 1});
  line_index_ = lines[0];
}

/// Warns of programs in the text that nothing calls, and of text after the end of the main
/// program. Blocks from a label on are not reported: a jump whose condition did not hold may lead
/// to them.
void Flow::warn_unread() {
  std::vector<std::string_view> lines;
  std::vector<Section> sections;
  for (const auto& program : sources_) {
    if (program->file != 0) continue;
    const std::size_t first = std::size_t(program->first_line) - 1;
    Section section{first, first + program->lines.size()};
    lines.resize(std::max(lines.size(), section.end));
    std::copy(program->lines.begin(), program->lines.end(), lines.begin() + std::ptrdiff_t(first));
    for (std::size_t i = std::size_t(std::max(run_.canon.line(), 1)); i < section.end; ++i)
      if (i >= first && !parse_line_head(split_comment(lines[i]).block).label.empty()) {
        section.end = i;
        break;
      }
    sections.push_back(section);
  }
  run_.warn_of_unread_lines(lines, sections);
}

/// Begins the next pass of a repeated section, or continues after REPEAT.
void Flow::finish_repeated_section() {
  Call& section = calls_.back();
  if (section.remaining_repeats-- > 0) {
    line_index_ = section.begin;
    return;
  }
  line_index_ = section.return_line;
  calls_.pop_back();
}

/// Ends the running subprogram, or the whole program if that is the main program.
void Flow::leave_program() {
  // Repeated sections of the subprogram end with it.
  while (calls_.back().is_repeated_section) calls_.pop_back();
  if (calls_.size() == 1) {
    has_ended_ = true;
    return;
  }
  Call& subprogram = calls_.back();
  const std::size_t return_line = subprogram.return_line;
  // A repeat begins with new local variables.
  if (subprogram.remaining_repeats-- > 0) {
    variables_.leave();
    variables_.enter();
    subprogram.variables.clear();
    subprogram.texts.clear();
    const std::vector<Argument> arguments = subprogram.arguments;
    line_index_ = 0;
    return bind_parameters(*subprogram.program, arguments, {1, {}});
  }
  line_index_ = return_line;
  calls_.pop_back();
  variables_.leave();
  // The modal subprogram has ended, so later moves call it again.
  if (calls_.size() < modal_depth_) modal_depth_ = 0;
}

/// Executes CALL, for example CALL "NAME".
void Flow::call_by_name(Cursor& cursor) {
  const std::size_t from = skip_blanks(cursor);
  std::optional<std::string> name;
  if (cursor.current() == '"')
    name = parse_quoted_text(cursor);
  else
    name = parse_text_variable(cursor);
  if (!name) cursor.throw_input_error(from, "the name of a subprogram in quotes after CALL");
  // The name becomes a file name: a path could lead out of the folder of the program.
  if (!std::ranges::all_of(*name, is_name_char) || name->empty() || name->size() > 100)
    cursor.throw_input_error(from, "a name of letters, digits and _, without folders",
                             quoted_excerpt(*name));
  const ProgramCall program_call{to_upper(*name), {}, cursor.cause(from)};
  expect_end(cursor);
  ++line_index_;
  call_program(program_call, 1);
}

namespace {

// R parameters of the control; the number is usually limited by machine data.
constexpr int max_r_parameter = 32767;
// INT of the control has 32 bits.
constexpr double max_integer = 2147483647.0;

}  // namespace

// Repeated sections use the variables of the program around them.
Call& Flow::local_scope() {
  std::size_t at = calls_.size() - 1;
  while (calls_[at].is_repeated_section) --at;
  return calls_[at];
}

/// Parses R1 or R[...] and returns its number.
double Flow::parse_r_parameter(Cursor& cursor, std::size_t from) {
  ++cursor.at;
  double number = 0.0;
  if (cursor.current() == '[') {
    ++cursor.at;
    number = parse_number(cursor, *this);
    expect_text(cursor, "]", "] after a parameter number");
  } else {
    // The limit bounds the digits of a hostile text.
    while (is_digit(cursor.current()) && number < 1e9)
      number = 10 * number + (cursor.text[cursor.at++] - '0');
  }
  if (!(number >= 0 && number <= max_r_parameter) || number != std::floor(number))
    cursor.throw_input_error(from, fmt::format("a parameter from R0 to R{}", max_r_parameter));
  return number;
}

/// Parses the index of an array. Returns the name of the element, "FIELD[2,0]", or the name itself
/// for a simple variable.
std::string Flow::parse_element(Cursor& cursor, const std::string& name, const Variable& variable) {
  if (variable.sizes.empty()) return name;
  const std::size_t from = cursor.at;
  if (cursor.current() != '[') cursor.throw_input_error(from, "[ after the name of an array");
  ++cursor.at;
  std::string element_name = name + "[";
  for (std::size_t k = 0; k < variable.sizes.size(); ++k) {
    if (k > 0 && !cursor.accept(","))
      cursor.throw_input_error(cursor.at, ", before the next index");
    const double index = parse_number(cursor, *this);
    if (!(index >= 0 && index < variable.sizes[k]) || index != std::floor(index))
      cursor.throw_input_error(from,
                               fmt::format("an integer index from 0 to {}", variable.sizes[k] - 1),
                               fmt::format("{}", index));
    element_name += fmt::format("{}{}", k > 0 ? "," : "", int(index));
  }
  expect_text(cursor, "]", "] after an index");
  return element_name + "]";
}

/// Sets a variable. Its value is converted to its type, as on the control.
void Flow::store_value(const std::string& name, VariableKind kind, double value,
                       const Cursor& cursor, std::size_t from) {
  if (kind == VariableKind::Integer) value = std::round(value);
  if (kind == VariableKind::Boolean) value = value != 0 ? 1.0 : 0.0;
  if (kind == VariableKind::Integer && !(std::abs(value) <= max_integer))
    cursor.throw_input_error(from, "a 32-bit integer", fmt::format("{}", value));
  if (!variables_.set(name, value, Variables::Scope::Call))
    run_.throw_variable_limit(cursor.location, "variables");
}

bool Flow::assign_variable(Cursor& cursor) {
  const std::size_t from = skip_blanks(cursor);
  const char first = upper(cursor.current());
  Cursor ahead = cursor;
  if (first == 'R' && (is_digit(cursor.peek()) || cursor.peek() == '[')) {
    const int number = int(parse_r_parameter(ahead, from));
    if (!is_before_assignment(ahead)) return false;
    ahead.accept("=");
    // A variable whose assignment has an error is uncertain: its uses are not reported.
    run_.define(fmt::format("R{}", number), [&] {
      const double value = parse_number(ahead, *this);
      if (!variables_.set(number, value)) run_.throw_variable_limit(cursor.location, "variables");
    });
    cursor.at = ahead.at;
    return true;
  }
  const Call& scope = local_scope();
  if (scope.variables.empty()) return false;
  const std::string name = parse_name(ahead);
  const auto entry = scope.variables.find(name);
  if (entry == scope.variables.end()) return false;
  const Variable variable = entry->second;
  const std::string element = parse_element(ahead, name, variable);
  if (!is_before_assignment(ahead)) return false;
  ahead.accept("=");
  if (variable.kind == VariableKind::Text) {
    ahead.skip_blanks();
    std::optional<std::string> text;
    if (ahead.current() == '"')
      text = parse_quoted_text(ahead);
    else
      text = parse_text_variable(ahead);
    if (!text) ahead.throw_input_error(ahead.at, "a string in quotes");
    local_scope().texts[name] = *text;
  } else {
    run_.define(element, [&] {
      store_value(element, variable.kind, parse_number(ahead, *this), ahead, from);
    });
  }
  cursor.at = ahead.at;
  return true;
}

std::optional<std::string> Flow::parse_text_variable(Cursor& cursor) {
  const Call& scope = local_scope();
  if (scope.variables.empty()) return std::nullopt;
  Cursor ahead = cursor;
  ahead.skip_blanks();
  const std::string name = parse_name(ahead);
  const auto entry = scope.variables.find(name);
  if (entry == scope.variables.end() || entry->second.kind != VariableKind::Text)
    return std::nullopt;
  cursor.at = ahead.at;
  const auto text = scope.texts.find(name);
  return text == scope.texts.end() ? std::string() : text->second;
}

/// Returns the kind of variables of a type, or nothing for an unknown type.
std::optional<VariableKind> Flow::find_kind(std::string_view type) {
  static constexpr std::array<std::pair<std::string_view, VariableKind>, 5> kinds = {
      {{"REAL", VariableKind::Real},
       {"INT", VariableKind::Integer},
       {"BOOL", VariableKind::Boolean},
       {"CHAR", VariableKind::Integer},
       {"STRING", VariableKind::Text}}};
  for (const auto& [name, kind] : kinds)
    if (name == type) return kind;
  return std::nullopt;
}

/// Executes DEF, for example DEF REAL A1, A2=5, FIELD[10].
void Flow::execute_definition(Cursor& cursor) {
  const std::size_t from = skip_blanks(cursor);
  const std::string type = parse_name(cursor);
  const auto kind = find_kind(type);
  if (!kind) cursor.throw_input_error(from, "REAL, INT, BOOL, CHAR or STRING after DEF");
  // The length of a string does not matter here.
  if (*kind == VariableKind::Text && cursor.current() == '[') {
    ++cursor.at;
    parse_number(cursor, *this);
    expect_text(cursor, "]", "] after the length of a string");
  }
  Cursor names = cursor;
  try {
    do define_variable(cursor, *kind);
    while (cursor.accept(","));
    expect_end(cursor);
  } catch (const BadInput&) {
    // All names of a definition with an error are uncertain, so that their uses are not reported.
    for (; !names.at_end(); ++names.at)
      if (const std::string name = parse_name(names); !name.empty()) run_.mark_uncertain(name);
    throw;
  }
}

void Flow::define_variable(Cursor& cursor, VariableKind kind) {
  const std::size_t from = skip_blanks(cursor);
  const std::string name = parse_name(cursor);
  // A letter followed by a digit would be an address (X1).
  if (name.size() < 2 || (is_letter(name[0]) && is_digit(name[1])) || find_entry(name) != nullptr ||
      Machine::is_cycle(name))
    cursor.throw_input_error(from,
                             "a name of at least two letters that is not a word of the control");
  Variable variable{kind, {}};
  if (cursor.current() == '[') {
    if (kind == VariableKind::Text) cursor.throw_input_error(cursor.at, "no arrays of strings");
    // Limits the number of elements, 1e6, before any is stored.
    ++cursor.at;
    double element_count = 1.0;
    do {
      const std::size_t size_from = cursor.at;
      const double size = parse_number(cursor, *this);
      element_count *= size;
      if (!(size >= 1 && element_count <= 1e6) || size != std::floor(size) ||
          variable.sizes.size() == 3)
        cursor.throw_input_error(size_from,
                                 "at most three dimensions and 1e6 elements in an array");
      variable.sizes.push_back(int(size));
    } while (cursor.accept(","));
    expect_text(cursor, "]", "] after the size of an array");
  }
  auto& variables = local_scope().variables;
  if (variables.size() >= run_.options().limits.variables)
    run_.throw_variable_limit(cursor.location, "variables");
  variables[name] = variable;
  // Simple variables start at zero; elements of arrays are zero until they are set.
  if (!cursor.accept("=")) {
    if (variable.sizes.empty() && kind != VariableKind::Text)
      store_value(name, kind, 0.0, cursor, from);
    return;
  }
  if (!variable.sizes.empty())
    cursor.throw_input_error(cursor.at, "no values for a whole array in DEF");
  if (kind == VariableKind::Text) {
    if (next_char(cursor) != '"') cursor.throw_input_error(cursor.at, "a string in quotes");
    local_scope().texts[name] = parse_quoted_text(cursor);
  } else {
    store_value(name, kind, parse_number(cursor, *this), cursor, from);
  }
}

/// Parses a hexadecimal or binary number, for example 'HFF' or 'B1001'.
double Flow::parse_quoted_number(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  const char base = upper(cursor.current());
  ++cursor.at;
  const std::size_t digits = cursor.at;
  while (!cursor.at_end() && cursor.current() != '\'') ++cursor.at;
  const std::string_view text = cursor.text.substr(std::min(digits, cursor.text.size()),
                                                   cursor.at - std::min(digits, cursor.at));
  std::uint32_t value = 0;
  const auto result =
      std::from_chars(text.data(), text.data() + text.size(), value, base == 'H' ? 16 : 2);
  const bool is_valid = (base == 'H' || base == 'B') && result.ec == std::errc() &&
                        result.ptr == text.data() + text.size() && cursor.current() == '\'';
  if (!is_valid)
    cursor.throw_input_error(from, "a number such as 'HFF' or 'B1001', of at most 32 bits");
  ++cursor.at;
  return double(value);
}

/// Parses a system variable: pi, or the position of an axis.
std::optional<double> Flow::parse_system_variable(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  const std::string name = parse_name(cursor);
  if (name == "PI") return pi;
  const bool in_workpiece = name == "AA_IW" || name == "P_EP";
  if ((in_workpiece || name == "AA_IM") && cursor.accept("[")) {
    const std::size_t axis_from = skip_blanks(cursor);
    const std::string axis = parse_name(cursor);
    const auto value = axis.size() == 1 ? machine_->position(axis[0], !in_workpiece) : std::nullopt;
    if (!value)
      cursor.throw_input_error(axis_from, "an axis of this machine (" + run_.canon.letters() + ")");
    expect_text(cursor, "]", "] after the name of an axis");
    return value;
  }
  cursor.throw_input_error(
      from,
      "$PI, $P_EP[axis], $AA_IW[axis] or $AA_IM[axis]: no other system variable is supported");
}

/// Evaluates ATAN2, MINVAL, MAXVAL or BOUND with the cursor at its bracket.
std::optional<double> Flow::parse_multi_argument_function(Cursor& cursor, const std::string& name) {
  const std::size_t count = name == "BOUND"                                           ? 3
                            : name == "ATAN2" || name == "MINVAL" || name == "MAXVAL" ? 2
                                                                                      : 0;
  if (count == 0) return std::nullopt;
  const std::size_t open = skip_blanks(cursor);
  if (!cursor.accept("(")) cursor.throw_input_error(open, "( after " + name);
  std::array<double, 3> x{};
  for (std::size_t k = 0; k < count; ++k) {
    if (k > 0 && !cursor.accept(","))
      cursor.throw_input_error(cursor.at, fmt::format(", and {} numbers of {}", count, name));
    x[k] = parse_expression(cursor, grammar(), *this);
  }
  expect_text(cursor, ")", fmt::format(") after {} numbers of {}", count, name));
  if (name == "ATAN2") return std::atan2(x[0], x[1]) / units::deg;
  if (name == "MINVAL") return std::min(x[0], x[1]);
  if (name == "MAXVAL") return std::max(x[0], x[1]);
  // The control raises an alarm for reversed limits.
  if (x[0] > x[1]) cursor.throw_input_error(open, "the lower limit of BOUND before the upper one");
  return std::clamp(x[2], x[0], x[1]);
}

std::optional<double> Flow::parse_operand(Cursor& cursor) {
  const std::size_t from = skip_blanks(cursor);
  const char first = upper(cursor.current());
  if (first == 'R' && (is_digit(cursor.peek()) || cursor.peek() == '[')) {
    const int number = int(parse_r_parameter(cursor, from));
    if (run_.is_uncertain()) run_.require_certain(fmt::format("R{}", number), cursor.cause(from));
    // An R parameter that was never set is zero.
    return variables_.number(number).value_or(0.0);
  }
  if (first == '\'') return parse_quoted_number(cursor);
  if (first == '$') return parse_system_variable(cursor);
  Cursor ahead = cursor;
  const std::string name = parse_name(ahead);
  if (name.empty()) return std::nullopt;
  const auto accept = [&](std::optional<double> value) {
    cursor.at = ahead.at;
    return value;
  };
  if (name == "TRUE") return accept(1.0);
  if (name == "FALSE") return accept(0.0);
  if (name == "NOT" || name == "B_NOT") {
    const double inner = parse_value(ahead, grammar(), *this);
    // B_NOT works on integers.
    return accept(name == "NOT" ? double(inner == 0) : double(~std::int64_t(inner)));
  }
  if (const auto result = parse_multi_argument_function(ahead, name)) return accept(result);
  const Call& scope = local_scope();
  const auto entry = scope.variables.find(name);
  // An uncertain name must not be reported as unknown.
  run_.require_certain(name, cursor.cause(from, ahead.at));
  if (entry == scope.variables.end()) return std::nullopt;
  if (entry->second.kind == VariableKind::Text)
    cursor.throw_input_error(from, "a number", "the string " + name);
  const std::string element = parse_element(ahead, name, entry->second);
  run_.require_certain(element, cursor.cause(from, ahead.at));
  return accept(variables_.named(element, Variables::Scope::Call).value_or(0.0));
}

}  // namespace abbe::sim::dialects::siemens
