#include "sim/dialects/heidenhain/flow.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain/block.h"
#include "sim/program/block_motion.h"
#include "sim/program/nc_block.h"

namespace abbe::sim::dialects::heidenhain {

namespace {

/// Returns the first letters of a line behind its number, in upper case.
std::string first_word(std::string_view line) {
  std::size_t at = 0;
  while (at < line.size() && (is_blank(line[at]) || is_digit(line[at]) || line[at] == '/')) ++at;
  std::string word;
  while (at < line.size() && is_letter(line[at]) && word.size() < 8) word += upper(line[at++]);
  // A line that begins with another character is not empty.
  if (word.empty() && at < line.size() && line[at] != ';' && line[at] != '*') word = "?";
  return word;
}

/// Returns the label behind LBL in a line, as in CALL LBL 5 or GOTO LBL "END"; empty if there is
/// none.
std::string label_at(std::string_view line) {
  std::size_t at = line.find("LBL");
  if (at == std::string_view::npos) return {};
  at += 3;
  while (at < line.size() && is_blank(line[at])) ++at;
  const bool quoted = at < line.size() && line[at] == '"';
  const std::size_t end = quoted ? line.find('"', at + 1) : line.find_first_of(" \t;~", at);
  return std::string(line.substr(at, end == std::string_view::npos ? end : end - at));
}

}  // namespace

Flow::Flow(std::string_view text, ProgramRun& run)
    : run_(run), machine_(run), variables_(run.options().limits.variables) {
  auto main = std::make_unique<Source>();
  main->lines = lines_of_text(text);
  sources_.push_back(std::move(main));
  calls_.push_back({.source = sources_.front().get()});
  machine_.on_parameter = [this](int number, double value) { set_cycle_parameter(number, value); };
}

void Flow::run() {
  run_.run_startup_code([&](std::string_view code) {
    read_block({code}, 0, block_);
    block();
  });
  while (!ended_ && !run_.is_aborted()) {
    const Call& now = calls_.back();
    // END PGM is missing: the file ends the program.
    if (at_ >= now.source->lines.size()) {
      run_.try_block([&] { end_program(); });
      continue;
    }
    run_.canon.set_line(int(at_) + 1, now.source->file);
    run_.try_block([&] {
      read_block(now.source->lines, at_, block_);
      at_ += block_.lines;
      try {
        block();
        // Limits and consequences of other errors keep their own location.
      } catch (const ProgramLimitExceeded&) {
        throw;
      } catch (const program::BadGeometry&) {
        throw;
      } catch (const program::FollowingError&) {
        throw;
      } catch (const BadInput& fault) {
        throw relocate_error(block_, fault);
      }
    });
    ended_ = ended_ || machine_.ended();
  }
  run_.try_block([&] { machine_.finish(); });
  warn_unread();
}

/// Warns of text behind the end of the program: subprograms that no CALL LBL or jump names, and
/// everything behind END PGM.
void Flow::warn_unread() {
  const std::vector<std::string_view>& lines = sources_.front()->lines;
  std::vector<Section> sections = {{}};
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string word = first_word(lines[i]);
    sections.back().end = i;
    // A label begins a section, LBL 0 ends one.
    if (word == "LBL") {
      const std::size_t first = label_at(lines[i]) == "0" ? i + 1 : i;
      sections.push_back({first, first});
    }
    if (word == "END") sections.push_back({i + 1, i + 1});
  }
  sections.back().end = std::max(sections.back().first, lines.size());
  std::map<std::string, int> named;
  for (const std::string_view line : lines) ++named[label_at(line)];
  // A label named more than once is called or jumped to somewhere.
  std::erase_if(sections, [&](const Section& section) {
    return section.first < lines.size() && first_word(lines[section.first]) == "LBL" &&
           named[label_at(lines[section.first])] > 1;
  });
  run_.warn_of_unread_lines(lines, sections);
}

/// Returns true if the block that follows rounds or bevels the corner at the end of this one.
bool Flow::before_corner(const Call& now, std::size_t line) const {
  constexpr std::size_t furthest = 20;  // lines; comments may stand between them
  for (std::size_t i = line; i < now.source->lines.size() && i < line + furthest; ++i) {
    const std::string word = first_word(now.source->lines[i]);
    if (word.empty()) continue;
    return word == "RND" || word == "CHF";
  }
  return false;
}

void Flow::block() {
  if (!block_.comment.empty()) run_.canon.comment(block_.comment);
  Words words({block_.text, run_.canon.place(),
               block_.pieces.empty() ? 0
               : block_.lines == 1   ? block_.pieces[0].offset
                                     : 0},
              *this);
  if (words.at_end() || block_.pieces.empty()) return;
  run_.count_block();
  // A skipped block is parsed for its extent but not executed.
  if (block_.skipped && run_.skips_block(0)) return run_.discount_block();
  const std::size_t from = words.cursor.at;
  // A block that begins with a parameter is an assignment.
  if (const auto parameter = parameter_at(words.cursor)) return assign(words, *parameter);
  words.cursor.at = from;
  const std::string keyword = words.name();
  if (flow_block(keyword, words)) return;
  machine_.execute(keyword, from, words, before_corner(calls_.back(), at_));
}

// Keywords of the flow; all others belong to the machine.
bool Flow::flow_block(const std::string& keyword, Words& words) {
  if (keyword == "LBL") return label(words), true;
  if (keyword == "CALL") return call(words), true;
  if (keyword == "FN") return fn(words), true;
  if (keyword == "IF") return jump_if(words), true;
  if (keyword == "BEGIN") return begin_program(words), true;
  if (keyword == "END") {
    if (!words.take("PGM")) words.refuse(words.cursor.at, "PGM after END");
    machine_.end_of_program();
    end_program();
    return true;
  }
  return false;
}

void Flow::begin_program(Words& words) {
  if (!words.take("PGM")) words.refuse(words.cursor.at, "PGM after BEGIN");
  words.cursor.skip_blanks();
  // MM or INCH is the last word; the name of the program may contain blanks.
  const std::string_view rest = words.cursor.text.substr(words.cursor.at);
  const std::size_t end = rest.find_last_not_of(" \t");
  const std::size_t space = end == std::string_view::npos ? end : rest.find_last_of(" \t", end);
  std::string unit;
  if (end != std::string_view::npos)
    for (const char c : rest.substr(space == std::string_view::npos ? 0 : space + 1,
                                    space == std::string_view::npos ? end + 1 : end - space))
      unit += upper(c);
  if (unit != "MM" && unit != "INCH")
    words.refuse(words.cursor.at, "the name of the program and MM or INCH after BEGIN PGM");
  const auto program = std::find_if(calls_.rbegin(), calls_.rend(),
                                    [](const Call& call) { return call.is_program; });
  if (std::exchange(program->begun, true))
    words.refuse(words.cursor.at, "END PGM before BEGIN PGM of another program");
  machine_.set_inch(unit == "INCH");
}

/// Ends a program at the end of its file or at END PGM.
void Flow::end_program() {
  while (!calls_.back().is_program) calls_.pop_back();
  if (calls_.size() == 1) {
    ended_ = true;
    return;
  }
  at_ = calls_.back().back;
  // The unit of the caller is in force again.
  machine_.set_inch(calls_.back().inch);
  calls_.pop_back();
  variables_.leave();
}

std::size_t Flow::line_of(const std::string& label, const Words& words, std::size_t from) {
  // Labels are collected once for each file.
  Source& source = *calls_.back().source;
  if (!source.labels_known) {
    source.labels_known = true;
    for (std::size_t i = 0; i < source.lines.size(); ++i) {
      if (first_word(source.lines[i]) != "LBL") continue;
      Block block;
      read_block(source.lines, i, block);
      Words there({block.text, run_.canon.place(), block.pieces[0].offset}, *this);
      there.name();
      if (!there.has_value() && there.cursor.current() != '"')
        there.cursor.skip_blanks();  // a malformed label is reported where it is executed
      try {
        source.labels[there.label()].push_back(i);
      } catch (const BadInput&) {
      }
    }
  }
  const auto found = source.labels.find(label);
  const Cause cause = words.cursor.cause(from);
  if (found == source.labels.end() || label == "0")
    run_.refuse_once("LBL " + label, cause, "a label of this program", "LBL " + label);
  // A label must be unique, as on the control.
  if (found->second.size() > 1)
    run_.refuse_once("LBL " + label, cause, "a label that stands once",
                     fmt::format("LBL {} in the lines {} and {}", label, found->second[0] + 1,
                                 found->second[1] + 1));
  return found->second.front();
}

void Flow::label(Words& words) {
  const std::string name = words.label();
  words.ends();
  // LBL 0 ends a subprogram; in the main program it has no effect.
  if (name != "0" || calls_.back().is_program) return;
  at_ = calls_.back().back;
  calls_.pop_back();
}

void Flow::call(Words& words) {
  if (words.take("LBL")) return call_label(words);
  if (words.take("PGM")) return call_program(words);
  words.refuse(words.cursor.at, "LBL or PGM after CALL");
}

void Flow::call_label(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const std::string name = words.label();
  const std::size_t line = line_of(name, words, from);
  if (words.at_end()) {
    run_.check_depth(int(calls_.size()), words.cause(from));
    calls_.push_back({.source = calls_.back().source, .back = at_, .is_program = false});
    at_ = line + 1;
    return;
  }
  if (words.name() != "REP") words.refuse(words.cursor.at, "REP or nothing after CALL LBL");
  if (words.cursor.current() == '/') ++words.cursor.at;  // REP 2/2 of older controls
  const int times = words.whole(65534);
  if (words.cursor.current() == '/') ++words.cursor.at, words.whole(65534);
  words.ends();
  // A repeat goes back; a label behind it would be a jump.
  if (line >= at_) words.cursor.refuse(from, "a label before CALL LBL REP", "one behind it");
  auto& left = calls_.back().left;
  // The count is kept with the block, so that repeats may nest.
  const auto begun = left.emplace(at_, times).first;
  if (begun->second == 0) {
    left.erase(begun);
    return;
  }
  --begun->second;
  at_ = line + 1;
}

void Flow::call_program(Words& words) {
  constexpr std::size_t longest = 100;
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  std::string name(words.cursor.text.substr(from));
  while (!name.empty() && is_blank(name.back())) name.pop_back();
  if (name.size() > 1 && name.front() == '"' && name.back() == '"')
    name = name.substr(1, name.size() - 2);
  // The name becomes a file name: a path could lead out of the folder of the program.
  if (name.empty() || name.size() > longest || name.find_first_of("/\\:\"") != std::string::npos ||
      name.starts_with('.'))
    words.refuse(from, "the name of a program beside this one, without a path");
  run_.check_depth(int(calls_.size()), {int(from) + 1, words.cursor.text.substr(from)});
  const std::filesystem::path& folder = run_.options().folder;
  for (const char* ending : {"", ".h", ".H"})
    if (!folder.empty() && std::filesystem::is_regular_file(folder / (name + ending))) {
      Source& source = load_source(folder / (name + ending));
      calls_.push_back({.source = &source, .back = at_, .inch = machine_.inch()});
      variables_.enter();
      at_ = 0;
      return;
    }
  run_.refuse_once("PGM " + name, words.cursor.cause(from),
                   fmt::format("a program {} or {}.h beside this one", name, name), "none");
}

Source& Flow::load_source(const std::filesystem::path& file) {
  constexpr std::size_t max_file = std::size_t(1) << 26, max_files = 1000;
  const auto known = files_.find(file.string());
  if (known != files_.end()) return *known->second;
  if (sources_.size() == max_files)
    run_.canon.refuse({1, {}}, "at most 1000 programs that are called", "more");
  auto source = std::make_unique<Source>();
  source->text = read_text(file, max_file);
  source->lines = lines_of_text(source->text);
  source->file = run_.canon.add_file(file.filename().string());
  sources_.push_back(std::move(source));
  return *(files_[file.string()] = sources_.back().get());
}

// Q parameters.

namespace {

constexpr double equal = 1e-9;  // rounding of Q parameters

bool holds(const std::string& comparison, double a, double b) {
  if (comparison == "EQU") return std::abs(a - b) < equal;
  if (comparison == "NE") return std::abs(a - b) >= equal;
  return comparison == "GT" ? a > b : a < b;
}

}  // namespace

std::optional<Flow::Parameter> Flow::parameter_at(Cursor& cursor) const {
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
  // Ranges of the control: Q0 to Q1999, QL and QR 0 to 499.
  const int most = parameter.kind == "Q" ? 1999 : 499;
  if (parameter.kind == "QS")
    cursor.refuse(parameter.from, "a parameter of numbers: texts in QS are not kept");
  if (cursor.at == digits || is_digit(cursor.current()) || parameter.number > most)
    cursor.refuse(parameter.from,
                  fmt::format("a number of 0 to {} after {}", most, parameter.kind));
  return parameter;
}

std::optional<double> Flow::parse_operand(Cursor& cursor) {
  if (upper(cursor.current()) == 'Q') {
    const auto parameter = parameter_at(cursor);
    return read(*parameter, cursor);
  }
  return function_value(cursor, *this);
}

double Flow::read(const Parameter& parameter, const Cursor& cursor) const {
  std::optional<double> known;
  // Q is shared by all programs, QL is local to one, QR is stored behind the others from 10000 on.
  if (parameter.kind == "Q") {
    known = variables_.number(parameter.number);
    if (!known) known = machine_.preset_parameter(parameter.number);
  } else if (parameter.kind == "QR") {
    known = variables_.number(10000 + parameter.number);
  } else {
    known = variables_.number(parameter.number, Variables::Scope::Call);
  }
  if (run_.is_uncertain()) run_.require_certain(parameter.name(), cursor.cause(parameter.from));
  if (!known) cursor.refuse(parameter.from, "a parameter that has been set");
  return *known;
}

void Flow::set(const Parameter& parameter, double value, const Words& words) {
  const bool local = parameter.kind == "QL";
  const int number = parameter.kind == "QR" ? 10000 + parameter.number : parameter.number;
  // Q100 to Q199 are set by the control itself.
  if (parameter.kind == "Q" && number >= 100 && number < 200)
    words.cursor.refuse(parameter.from, "a parameter that the control does not set itself");
  // Cycles copy their parameters at CYCL DEF, so a later assignment has no effect on them.
  if (parameter.kind == "Q" && number >= 200 && number < 500 && machine_.has_cycle())
    run_.warn_once(
        "Q200 to Q499 are set outside of CYCL DEF: a cycle that is defined keeps its values");
  if (!variables_.set(number, value, local ? Variables::Scope::Call : Variables::Scope::Program))
    throw ProgramLimitExceeded(
        words.cursor.location.file, words.cursor.location.line, 0,
        fmt::format("at most {} parameters", run_.options().limits.variables), "more");
}

/// Sets parameters on behalf of the machine: those of CYCL DEF and of tilted planes.
void Flow::set_cycle_parameter(int number, double value) {
  if (!variables_.set(number, value))
    throw ProgramLimitExceeded(
        run_.canon.place().file, run_.canon.line(), 0,
        fmt::format("at most {} parameters", run_.options().limits.variables), "more");
}

void Flow::assign(Words& words, const Parameter& parameter) {
  if (!words.cursor.accept("=")) words.refuse(words.cursor.at, "= after a parameter");
  words.cursor.skip_blanks();
  if (words.cursor.current() == '"')
    words.refuse(words.cursor.at, "a number: texts in parameters are not kept");
  // A parameter whose assignment has an error is uncertain: its uses are not reported again.
  run_.define(parameter.name(), [&] {
    const double value = parse_expression(words.cursor, grammar(), *this);
    words.ends();
    set(parameter, value, words);
  });
}

void Flow::fn(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const int number = words.whole(99);
  if (!words.cursor.accept(":")) words.refuse(words.cursor.at, ": after FN and its number");
  // FN 9 to FN 12 are the four comparisons of IF.
  if (number >= 9 && number <= 12) return jump_if(words);
  const std::string name = fmt::format("FN\u00a0{}", number);
  if (const WordTableEntry* use = find_word(heidenhain_words(), name);
      use != nullptr && use->use == Use::Refused)
    words.refuse(from, std::string(use->sentence));
  if (number > 13) words.refuse(from, "FN 0 to FN 13");
  const auto parameter = parameter_at(words.cursor);
  if (!parameter) words.refuse(words.cursor.at, "a Q parameter");
  run_.define(parameter->name(), [&] {
    if (!words.cursor.accept("=")) words.refuse(words.cursor.at, "= after a parameter");
    set(*parameter, fn_result(number, words), words);
  });
}

/// Returns the value behind = of FN 0 to FN 8 and FN 13.
double Flow::fn_result(int number, Words& words) {
  const auto word = [&](std::string_view wanted) {
    if (!words.cursor.accept(wanted)) words.refuse(words.cursor.at, std::string(wanted));
  };
  if (number == 0 && words.take("SET"))
    words.refuse(words.cursor.at, "a number: parameters are not made undefined");
  if (number >= 5 && number <= 7) word(number == 5 ? "SQRT" : number == 6 ? "SIN" : "COS");
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const double a = words.value();
  if (number == 5 && a < 0) words.refuse(from, "a number that is not below zero");
  double result = number == 5   ? std::sqrt(a)
                  : number == 6 ? std::sin(a * units::deg)
                  : number == 7 ? std::cos(a * units::deg)
                                : a;
  if (number != 0 && (number < 5 || number > 7)) {
    static constexpr std::string_view between[] = {"", "+", "-", "*", "DIV"};
    word(number == 8 ? "LEN" : number == 13 ? "ANG" : between[number]);
    words.cursor.skip_blanks();
    const std::size_t second = words.cursor.at;
    const double b = words.value();
    if (number == 4 && b == 0) words.refuse(second, "a divisor that is not zero");
    if (number == 13 && a == 0 && b == 0) words.refuse(second, "two legs of an angle");
    double angle = std::atan2(a, b) / units::deg;
    // ANG has a range of 0 to 360 degrees.
    if (angle < 0) angle += 360;
    const double all[] = {0, a + b, a - b, a * b, number == 4 ? a / b : 0};
    result = number == 8 ? std::hypot(a, b) : number == 13 ? angle : all[number];
  }
  words.ends();
  if (!std::isfinite(result)) words.refuse(from, "a result that is a finite number");
  return result;
}

/// Example: IF +Q1 EQU +Q2 GOTO LBL 5.
void Flow::jump_if(Words& words) {
  words.take("IF");
  const double a = words.value();
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const std::string comparison = words.name();
  if (comparison != "EQU" && comparison != "NE" && comparison != "GT" && comparison != "LT")
    words.refuse(from, "EQU, NE, GT or LT");
  const double b = words.value();
  if (!words.take("GOTO") || !words.take("LBL")) words.refuse(words.cursor.at, "GOTO LBL");
  words.cursor.skip_blanks();
  const std::size_t at = words.cursor.at;
  const std::string label = words.label();
  words.ends();
  // The label is checked even if the condition does not hold: errors do not depend on parameters.
  const std::size_t line = line_of(label, words, at);
  if (holds(comparison, a, b)) at_ = line;
}

}  // namespace abbe::sim::dialects::heidenhain
