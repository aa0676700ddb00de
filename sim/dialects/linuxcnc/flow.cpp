#include "sim/dialects/linuxcnc/flow.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::linuxcnc {

Flow::Flow(std::string_view text, ProgramRun& run)
    : run_(run), machine_(run), variables_(run.options().limits.variables) {
  auto main = std::make_unique<Source>();
  main->lines = lines_of_text(text);
  sources_.push_back(std::move(main));
  calls_.push_back({.source = sources_.front().get()});
}

Cursor Flow::cursor_at(const Source& source, std::size_t line) const {
  return {source.lines[line], run_.canon.place()};
}

void Flow::run() {
  run_.run_startup_code([&](std::string_view code) { block({code, run_.canon.place()}); });
  while (!ended_ && !run_.is_aborted()) {
    const Call& now = calls_.back();
    if (at_ >= now.source->lines.size()) {
      // Running over the end of the main file ends the program; of a subprogram file it is an
      // error.
      if (calls_.size() == 1) break;
      run_.try_block([&] { finish_file(); });
      continue;
    }
    run_.canon.set_line(int(at_) + 1, now.source->file);
    const std::size_t before = at_;
    // After an error reading continues at the next line, unless the line itself moved on.
    if (!run_.try_block([&] { ended_ = !line(); }) && at_ == before) ++at_;
  }
  run_.try_block([&] { machine_.finish(); });
  const std::vector<std::string_view>& lines = sources_.front()->lines;
  run_.warn_of_unread_lines(lines, {{0, lines.size()}});
}

/// Executes a line. Returns false at the end of the program.
bool Flow::line() {
  run_.count_block();
  const std::string_view text = calls_.back().source->lines[at_];
  Cursor cursor{text, run_.canon.place()};
  // Only lines with an O can have an O word; the search costs little beside parsing.
  if (text.find_first_of("oO") != std::string_view::npos)
    if (const auto o = o_word(cursor)) {
      // Counted as executed behind a /; a skipped line has no O word here.
      if (text[text.find_first_not_of(" \t")] == '/') run_.skips_block(0);
      o_line(*o, cursor);
      return true;
    }
  ++at_;
  return block({text, run_.canon.place()});
}

bool Flow::block(Cursor cursor) {
  try {
    read_block(cursor, run_, *this, block_);
  } catch (const BadInput&) {  // no parameter of the block is set
    for (const auto& [number, value] : block_.numbers) run_.mark_uncertain(fmt::format("#{}", number));
    for (const auto& [name, value] : block_.names) run_.mark_uncertain(fmt::format("#<{}>", name));
    throw;
  }
  // The second % of the main program ends it.
  if (block_.percent && calls_.size() == 1 && ++percents_ == 2) return false;
  if (block_.percent) return true;
  if (block_.deleted && run_.skips_block(0)) {
    run_.discount_block();
    return true;
  }
  if (!block_.numbers.empty() || !block_.names.empty()) set(block_, cursor);
  if (block_.empty()) {
    for (const std::string_view text : block_.comments) run_.canon.comment(text);
    return true;
  }
  if (block_[Group::State]) return save_modes(), true;
  return machine_.execute(block_);
}

/// M70 to M73: each call has one saved state.
void Flow::save_modes() {
  const Code& code = block_[Group::State];
  bool alone = block_.words.empty();
  for (const Code& other : block_.codes) alone = alone && (!other || &other == &code);
  if (!alone) run_.canon.refuse(code.word, "a block of its own for " + shown(code.word.text));
  Call& now = calls_.back();
  if (code.tenths == 700 || code.tenths == 730) now.saved = machine_.modes();
  if (code.tenths == 730) now.restores = true;
  if (code.tenths == 710) now.saved.reset();
  if (code.tenths != 720) return;
  if (!now.saved) run_.canon.refuse(code.word, "M70 or M73 before M72", "none");
  machine_.restore(*now.saved, code.word);
}

void Flow::set(const Block& block, const Cursor& cursor) {
  const auto too_many = [&] {
    throw ProgramLimitExceeded(
        cursor.location.file, cursor.location.line, 0,
        fmt::format("at most {} parameters", run_.options().limits.variables), "more");
  };
  for (const auto& [number, value] : block.numbers) {
    if (number < 1) cursor.refuse(0, "a parameter of #1 to #5601", fmt::format("#{}", number));
    // #1 to #30 are local to the call.
    if (number <= 30)
      calls_.back().locals[std::size_t(number)] = value;
    else if (!machine_.set_parameter(number, value))
      cursor.refuse(0, "a parameter that can be set", fmt::format("#{}", number));
  }
  for (const auto& [name, value] : block.names) {
    // Names with a leading _ are global.
    const bool global = name.front() == '_';
    if (global && machine_.named(name))
      cursor.refuse(0, "a parameter that can be set", "#<" + name + ">");
    if (!variables_.set(name, value, global ? Variables::Scope::Program : Variables::Scope::Call))
      too_many();
  }
}

double Flow::named(const std::string& name, const Cursor& cursor, std::size_t from) {
  // A parameter whose assignment has an error is uncertain: its uses are not reported again.
  if (run_.is_uncertain()) run_.require_certain(fmt::format("#<{}>", name), cursor.cause(from));
  const bool global = name.front() == '_';
  if (const auto own =
          variables_.named(name, global ? Variables::Scope::Program : Variables::Scope::Call))
    return *own;
  if (global) {
    if (name == "_call_level") return double(calls_.size() - 1);
    if (const auto system = machine_.named(name)) return *system;
  }
  cursor.refuse(from, "a named parameter that has been set", "#<" + name + ">");
}

bool Flow::exists(const std::string& name) const {
  const bool global = name.front() == '_';
  return variables_.named(name, global ? Variables::Scope::Program : Variables::Scope::Call) ||
         (global && machine_.named(name));
}

/// Parses #n, ##n, #[...] or #<name>.
double Flow::parameter(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  cursor.skip_blanks();
  if (cursor.current() == '<') return named(name_in_brackets(cursor), cursor, from);
  const int number = whole(cursor, from, parse_value(cursor, grammar(), *this), 5601);
  if (number < 1) cursor.refuse(from, "a parameter of #1 to #5601", fmt::format("#{}", number));
  if (run_.is_uncertain()) run_.require_certain(fmt::format("#{}", number), cursor.cause(from));
  return number <= 30 ? calls_.back().locals[std::size_t(number)] : machine_.parameter(number);
}

std::optional<double> Flow::parse_operand(Cursor& cursor) {
  if (cursor.current() == '#') return parameter(cursor);
  const std::size_t from = cursor.at;
  // ATAN[y]/[x] has two arguments and a range of +-180 degrees.
  if (cursor.accept("ATAN")) {
    const double y = parse_bracketed(cursor, grammar(), *this);
    if (!cursor.accept("/")) cursor.refuse(cursor.at, "/ after the first argument of ATAN");
    const double x = parse_bracketed(cursor, grammar(), *this);
    return std::atan2(y, x) / units::deg;
  }
  if (cursor.accept("EXISTS")) {
    if (!cursor.accept("[") || !cursor.accept("#") || (cursor.skip_blanks(), cursor.current() != '<'))
      cursor.refuse(from, "[#<name>] after EXISTS");
    const bool is = exists(name_in_brackets(cursor));
    if (!cursor.accept("]")) cursor.refuse(cursor.at, "] after EXISTS");
    return is ? 1.0 : 0.0;
  }
  return std::nullopt;
}

namespace {

constexpr std::size_t max_file = std::size_t(1) << 26;  // bytes of a subprogram file
// A folder of generated programs could otherwise use up all memory.
constexpr std::size_t max_sources = 1000;
// Keeps the count within a long long and names an endless repeat before it runs.
constexpr double max_repeats = 1e9;

}  // namespace

/// Returns the O word that a line begins with, after block skip and line number; nothing if there
/// is none.
std::optional<OWord> Flow::o_word(Cursor& cursor) {
  cursor.skip_blanks();
  if (cursor.current() == '/') {
    if (run_.canon.options().block_skip.test(0)) return std::nullopt;
    ++cursor.at;
    cursor.skip_blanks();
  }
  if (upper(cursor.current()) == 'N') {
    ++cursor.at;
    cursor.number(false, true);
    cursor.skip_blanks();
  }
  if (upper(cursor.current()) != 'O') return std::nullopt;
  OWord o;
  const std::size_t from = cursor.at++;
  cursor.skip_blanks();
  if (cursor.current() == '<') {
    o.label = "<" + name_in_brackets(cursor) + ">";
  } else {
    const std::size_t number = cursor.at;
    o.label = fmt::format("{}", whole(cursor, number, parse_value(cursor, grammar(), *this), 1000000));
  }
  cursor.skip_blanks();
  while (is_letter(cursor.current())) o.word += char(upper(cursor.text[cursor.at++]) - 'A' + 'a');
  o.cause = cursor.cause(from);
  o.rest = cursor.at;
  return o;
}

/// Same for a line that is searched, not executed: a computed label with an error matches nothing.
std::optional<OWord> Flow::parse_o_word(const Source& source, std::size_t at) {
  const std::string_view text = source.lines[at];
  Cursor cursor = cursor_at(source, at);
  std::size_t i = text.find_first_not_of(" \t");
  if (i == std::string_view::npos) return std::nullopt;
  const char c = upper(text[i]);
  // A quick test: few lines of a program begin with O.
  if (c != 'O' && c != 'N' && c != '/') return std::nullopt;
  try {
    return o_word(cursor);
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

// Found jumps are remembered, since loops repeat them.
std::size_t Flow::find_next(const OWord& o, std::initializer_list<std::string_view> words) {
  const Source& source = *calls_.back().source;
  std::string key = fmt::format("{}:{}:{}", source.file, at_, *words.begin());
  if (const auto known = jumps_.find(key); known != jumps_.end()) return known->second;
  for (std::size_t i = at_ + 1; i < source.lines.size(); ++i) {
    const auto other = parse_o_word(source, i);
    if (!other || other->label != o.label) continue;
    if (std::find(words.begin(), words.end(), other->word) == words.end()) continue;
    jumps_.emplace(std::move(key), i);
    return i;
  }
  run_.canon.refuse(o.cause, fmt::format("o{} {} behind it", o.label, *(words.end() - 1)), "none");
}

double Flow::condition(Cursor& cursor) {
  const double result = parse_bracketed(cursor, grammar(), *this);
  ends(cursor);
  return result;
}

/// Throws BadInput unless only a comment follows.
void Flow::ends(Cursor& cursor) const {
  cursor.skip_blanks();
  if (!cursor.at_end() && cursor.current() != '(' && cursor.current() != ';')
    cursor.refuse(cursor.at, "nothing more behind an O word");
}

void Flow::o_line(const OWord& o, Cursor cursor) {
  const auto is = [&](std::initializer_list<std::string_view> words) {
    return std::find(words.begin(), words.end(), o.word) != words.end();
  };
  cursor.at = o.rest;
  if (is({"if", "elseif", "else", "endif"})) return branch(o, cursor);
  if (is({"while", "endwhile", "do", "repeat", "endrepeat"})) return loop(o, cursor);
  if (is({"break", "continue"})) return leave_loop(o, o.word == "continue");
  if (o.word == "call") return call(o, cursor);
  if (is({"return", "endsub"})) return leave(o, cursor);
  if (o.word == "sub") {
    if (calls_.size() > 1) run_.canon.refuse(o.cause, "endsub before another sub");
    // A subprogram is skipped where it is defined.
    at_ = find_next(o, {"endsub"}) + 1;
    return;
  }
  run_.canon.refuse(o.cause,
                    "sub endsub call return if elseif else endif while endwhile do repeat "
                    "endrepeat break or continue after an O word");
}

void Flow::branch(const OWord& o, Cursor& cursor) {
  // LinuxCNC rejects elseif, else and endif whose if has not been executed.
  std::string key = fmt::format("{}:{}", calls_.back().source->file, o.label);
  if (o.word == "if")
    begun_ifs_.insert(std::move(key));
  else if (!begun_ifs_.contains(key))
    run_.canon.refuse(o.cause, fmt::format("o{} if before {}", o.label, o.word), "none");
  if (o.word == "endif") {
    ++at_;
    return;
  }
  if (o.word != "if") {  // the branch before it has been executed
    at_ = find_next(o, {"endif"}) + 1;
    return;
  }
  if (condition(cursor) != 0) {
    ++at_;
    return;
  }
  // Conditions of elseif are evaluated in order until one holds.
  while (true) {
    at_ = find_next(o, {"elseif", "else", "endif"});
    run_.count_block();
    const Source& source = *calls_.back().source;
    run_.canon.set_line(int(at_) + 1, source.file);
    Cursor next = cursor_at(source, at_);
    const auto other = o_word(next);
    next.at = other->rest;
    if (other->word != "elseif" || condition(next) != 0) break;
  }
  ++at_;
}

void Flow::loop(const OWord& o, Cursor& cursor) {
  std::vector<Loop>& loops = calls_.back().loops;
  run_.check_depth(int(loops.size()), o.cause, "loops");
  // A keyword belongs to the innermost loop only if its label matches.
  const bool running = !loops.empty() && loops.back().label == o.label;
  if (o.word == "do") {
    loops.push_back({o.label, Loop::Kind::Do, at_});
    ++at_;
  } else if (o.word == "while" && running && loops.back().kind == Loop::Kind::Do) {
    // The while that ends a do-while has the same keyword as one that begins a loop.
    if (condition(cursor) != 0) {
      at_ = loops.back().line + 1;
    } else {
      loops.pop_back();
      ++at_;
    }
  } else if (o.word == "while") {
    // The loop itself returns to its while, so it must not be opened again.
    const bool again =
        running && loops.back().kind == Loop::Kind::While && loops.back().line == at_;
    if (condition(cursor) != 0) {
      if (!again) loops.push_back({o.label, Loop::Kind::While, at_});
      ++at_;
    } else {
      if (again) loops.pop_back();
      at_ = find_next(o, {"endwhile"}) + 1;
    }
  } else if (o.word == "endwhile") {
    if (!running || loops.back().kind != Loop::Kind::While)
      run_.canon.refuse(o.cause, fmt::format("o{} while before endwhile", o.label), "none");
    at_ = loops.back().line;
  } else if (o.word == "repeat") {
    const double count = condition(cursor);
    if (!(count <= max_repeats)) run_.canon.refuse(o.cause, "at most 1e9 repeats");
    if (std::llround(count) <= 0) {
      at_ = find_next(o, {"endrepeat"}) + 1;
    } else {
      loops.push_back({o.label, Loop::Kind::Repeat, at_, std::llround(count)});
      ++at_;
    }
  } else {
    if (!running || loops.back().kind != Loop::Kind::Repeat)
      run_.canon.refuse(o.cause, fmt::format("o{} repeat before endrepeat", o.label), "none");
    if (--loops.back().left > 0) {
      at_ = loops.back().line + 1;
    } else {
      loops.pop_back();
      ++at_;
    }
  }
}

/// break and continue of the loop with that label; loops inside it end.
void Flow::leave_loop(const OWord& o, bool again) {
  std::vector<Loop>& loops = calls_.back().loops;
  const auto found = std::find_if(loops.rbegin(), loops.rend(),
                                  [&](const Loop& one) { return one.label == o.label; });
  if (found == loops.rend())
    run_.canon.refuse(o.cause, "a loop of this label around " + o.word, "none");
  loops.erase(found.base(), loops.end());
  const Loop loop = loops.back();
  const std::string_view end = loop.kind == Loop::Kind::While ? "endwhile"
                               : loop.kind == Loop::Kind::Do  ? "while"
                                                              : "endrepeat";
  if (again) {
    // continue of a do or repeat loop goes to its last line, which decides about another pass.
    at_ = loop.kind == Loop::Kind::While ? loop.line : find_next(o, {end});
  } else {
    at_ = find_next(o, {end}) + 1;
    loops.pop_back();
  }
}

const Source& Flow::load_source(const std::filesystem::path& file) {
  if (sources_.size() == max_sources)
    run_.canon.refuse({1, {}}, "at most 1000 files of subprograms", "more");
  auto source = std::make_unique<Source>();
  source->text = read_text(file, max_file);
  source->lines = lines_of_text(source->text);
  source->file = run_.canon.add_file(file.string());
  sources_.push_back(std::move(source));
  return *sources_.back();
}

/// Searches a subprogram in the running file, then in the main program, then in a file of its name.
Flow::Sub Flow::find_sub(const OWord& o) {
  const auto key = [&](const Source& source) { return fmt::format("{}:{}", source.file, o.label); };
  for (const Source* source : {calls_.back().source, (const Source*)sources_.front().get()}) {
    if (const auto known = subs_.find(key(*source)); known != subs_.end()) return known->second;
    for (std::size_t i = 0; i < source->lines.size(); ++i)
      if (const auto other = parse_o_word(*source, i);
          other && other->word == "sub" && other->label == o.label)
        return subs_[key(*source)] = {source, i};
  }
  const std::string of_file = "file:" + o.label;
  if (const auto known = subs_.find(of_file); known != subs_.end()) return known->second;
  const bool named = o.label.front() == '<';
  const std::string name = named ? o.label.substr(1, o.label.size() - 2) : o.label;
  // The name becomes a file name: only letters, digits, _ - and . are allowed, and no path.
  const auto is_name = [](char c) {
    return is_letter(c) || is_digit(c) || c == '_' || c == '-' || c == '.';
  };
  const std::filesystem::path file = run_.options().folder / (name + ".ngc");
  std::error_code failure;
  if (run_.options().folder.empty() || name.front() == '.' ||
      !std::all_of(name.begin(), name.end(), is_name) ||
      !std::filesystem::is_regular_file(file, failure))
    run_.refuse_once(
        "o" + o.label, o.cause,
        fmt::format("a subprogram o{} in the program, or {}.ngc beside it", o.label, name), "none");
  const Source& source = load_source(file);
  for (std::size_t i = 0; i < source.lines.size(); ++i)
    if (const auto other = parse_o_word(source, i);
        other && other->word == "sub" && other->label == o.label)
      return subs_[of_file] = {&source, i};
  run_.canon.refuse(o.cause, fmt::format("o{} sub in {}", o.label, file.string()), "none");
}

void Flow::call(const OWord& o, Cursor& cursor) {
  std::array<double, 31> arguments{};
  std::size_t n = 0;
  for (cursor.skip_blanks(); cursor.current() == '['; cursor.skip_blanks()) {
    const std::size_t from = cursor.at;
    if (++n > 30) cursor.refuse(from, "at most 30 arguments", "more");
    arguments[n] = parse_bracketed(cursor, grammar(), *this);
  }
  ends(cursor);
  run_.check_depth(int(calls_.size()), o.cause);
  const Sub sub = find_sub(o);
  Call next{.source = sub.source, .back = at_ + 1, .name = o.label};
  // Arguments become #1 to #30; missing ones are zero.
  next.locals = arguments;
  calls_.push_back(std::move(next));
  variables_.enter();
  at_ = sub.line + 1;
}

void Flow::leave(const OWord& o, Cursor& cursor) {
  if (calls_.size() == 1) run_.canon.refuse(o.cause, "a call before " + o.word, "none");
  // The label of endsub must match, since subprograms do not nest.
  if (calls_.back().name != o.label)
    run_.canon.refuse(o.cause, fmt::format("o{} {}", calls_.back().name, o.word));
  cursor.skip_blanks();
  std::optional<double> result;
  if (cursor.current() == '[') result = parse_bracketed(cursor, grammar(), *this);
  ends(cursor);
  const Call ended = calls_.back();
  at_ = ended.back;
  calls_.pop_back();
  variables_.leave();
  // M73 restores the modes at the end of the call.
  if (ended.restores && ended.saved) machine_.restore(*ended.saved, o.cause);
  if (!variables_.set("_value", result.value_or(0.0)) ||
      !variables_.set("_value_returned", result ? 1.0 : 0.0))
    cursor.refuse(0, "fewer parameters", "too many");
}

void Flow::finish_file() {
  const Call ended = calls_.back();
  at_ = ended.back;
  calls_.pop_back();
  variables_.leave();
  // Without endsub the end of the file leaves the call open.
  const program::NcLocation location = run_.canon.place();
  throw BadInput(location.file, location.line, 0, fmt::format("o{} endsub", ended.name),
                 "the end of the file");
}

}  // namespace abbe::sim::dialects::linuxcnc
