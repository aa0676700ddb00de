#include "sim/dialects/flow.h"
#include "sim/dialects/linuxcnc/linuxcnc.h"
#include "sim/dialects/read_program.h"

namespace abbe::sim::dialects {
namespace linuxcnc {

/// An O word of a line: its label and its keyword.
struct OWord {
  std::string label;    ///< "100" or "<name>"
  std::string keyword;  ///< lower case
  Cause cause;
  std::size_t end = 0;  ///< first byte after the keyword
};

/// A loop that is running.
struct Loop {
  std::string label;
  enum class Kind { While, Do, Repeat } kind = Kind::While;
  std::size_t line = 0;  ///< line of its first keyword
  long long remaining_repeats = 0;
};

/// A running subprogram, or the main program.
struct Call {
  const Source* source = nullptr;
  std::size_t return_line = 0;  ///< line of the caller to continue with
  std::string name = {};
  std::vector<Loop> loops = {};
  std::array<double, 31> locals{};                       ///< #1 .. #30
  std::function<void(const Cause&)> restore_modes = {};  ///< saved by M70 and M73
  bool restores_modes = false;                           ///< M73: restored at the end of the call
};

/// Flow of a program: executes parameters, expressions and O words, and passes all other lines to
/// the machine.
class Flow : public ProgramFlow<Source, Call> {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;

 private:
  /// Location of a subprogram.
  struct Subprogram {
    const Source* source = nullptr;
    std::size_t line = 0;
  };

  const Source& source() const override { return *calls_.back().source; }
  bool execute_line() override;
  bool execute_block(Cursor cursor) override;
  void save_modes();
  std::optional<OWord> read_o_word(Cursor& cursor);
  std::optional<OWord> find_o_word(const Source& source, std::size_t at);
  void execute_o_word(const OWord& o, Cursor cursor);
  void execute_if(const OWord& o, Cursor& cursor);
  void execute_loop(const OWord& o, Cursor& cursor);
  void leave_loop(const OWord& o, bool continues);
  void call_subprogram(const OWord& o, Cursor& cursor);
  void return_from_subprogram(const OWord& o, Cursor& cursor);
  void end_call() override;
  Subprogram find_subprogram(const OWord& o);
  /// Returns the next line that has one of the keywords and the label of `o`. Throws BadInput if
  /// there is none.
  std::size_t find_next(const OWord& o, std::initializer_list<std::string_view> keywords);
  double evaluate_condition(Cursor& cursor);
  void expect_end(Cursor& cursor) const;
  double parse_parameter(Cursor& cursor);
  double read_named_parameter(const std::string& name, const Cursor& cursor, std::size_t from);
  bool has_named_parameter(const std::string& name) const;
  void set_parameters(const Block& block, const Cursor& cursor);

  Machine machine_;
  std::map<std::string, Subprogram> subprograms_;  ///< those found so far, by file and label
  std::unordered_map<std::string, std::size_t> found_lines_;  ///< results of `find_next`
  std::set<std::string> executed_ifs_;  ///< file and label of each executed `if`
  int percent_count_ = 0;
  Block block_;
};

Flow::Flow(std::string_view text, ProgramRun& run) : ProgramFlow(run), machine_(run) {
  calls_.push_back({.source = &add_source(text)});
}

void Flow::run() {
  run_lines();
  run_.try_block([&] { machine_.finish(); });
  const std::vector<std::string_view>& lines = sources_.front()->lines;
  run_.warn_of_unread_lines(lines, {{0, lines.size()}});
}

/// Executes a line. Returns false at the end of the program.
bool Flow::execute_line() {
  run_.count_block();
  const std::string_view text = source().lines[line_index_];
  Cursor cursor{text, run_.canon.place()};
  // Only a line with an O can have an O word; the search costs little compared with parsing.
  if (text.find_first_of("oO") != std::string_view::npos)
    if (const auto o = read_o_word(cursor)) {
      // Counts the block as executed after a /: `read_o_word` returns nothing for a skipped line.
      if (text[text.find_first_not_of(" \t")] == '/') run_.skips_block(0);
      execute_o_word(*o, cursor);
      return true;
    }
  ++line_index_;
  return execute_block({text, run_.canon.place()});
}

bool Flow::execute_block(Cursor cursor) {
  try {
    read_block(cursor, run_, *this, block_);
  } catch (const BadInput&) {
    // The block sets none of its parameters, so all of them are uncertain.
    for (const auto& [number, value] : block_.number_assignments)
      run_.mark_uncertain(fmt::format("#{}", number));
    for (const auto& [name, value] : block_.name_assignments)
      run_.mark_uncertain(fmt::format("#<{}>", name));
    throw;
  }
  // The second % of the main program ends it.
  if (block_.is_percent_line && calls_.size() == 1 && ++percent_count_ == 2) return false;
  if (block_.is_percent_line) return true;
  if (block_.is_deleted && run_.skips_block(0)) {
    run_.discount_block();
    return true;
  }
  if (!block_.number_assignments.empty() || !block_.name_assignments.empty())
    set_parameters(block_, cursor);
  if (block_.empty()) {
    for (const std::string_view text : block_.comments) run_.canon.comment(text);
    return true;
  }
  if (block_[Group::State]) return save_modes(), true;
  return machine_.execute(block_);
}

/// Executes M70 to M73. Each call has one saved state.
void Flow::save_modes() {
  const Code& code = block_[Group::State];
  const bool is_alone =
      block_.words.empty() && std::ranges::all_of(block_.codes, [&](const Code& other) {
        return !other || &other == &code;
      });
  if (!is_alone) throw_input_error(code.word, "a separate block for " + shown(code.word.text));
  Call& call = calls_.back();
  if (code.tenths == 700 || code.tenths == 730) call.restore_modes = machine_.saved_modes();
  if (code.tenths == 730) call.restores_modes = true;
  if (code.tenths == 710) call.restore_modes = nullptr;
  if (code.tenths != 720) return;
  if (!call.restore_modes) throw_input_error(code.word, "M70 or M73 before M72", "none");
  call.restore_modes(code.word);
}

void Flow::set_parameters(const Block& block, const Cursor& cursor) {
  for (const auto& [number, value] : block.number_assignments) {
    if (number < 1)
      cursor.throw_input_error(0, "a parameter from #1 to #5601", fmt::format("#{}", number));
    // #1 to #30 are local to the call.
    if (number <= 30)
      calls_.back().locals[std::size_t(number)] = value;
    else if (!machine_.set_parameter(number, value))
      cursor.throw_input_error(0, "a parameter that can be set", fmt::format("#{}", number));
  }
  for (const auto& [name, value] : block.name_assignments) {
    // Names with a leading _ are global.
    const bool is_global = name.front() == '_';
    if (is_global && machine_.named_parameter(name))
      cursor.throw_input_error(0, "a parameter that can be set", "#<" + name + ">");
    if (!variables_.set(name, value,
                        is_global ? Variables::Scope::Program : Variables::Scope::Call))
      run_.throw_variable_limit(cursor.location, "parameters");
  }
}

double Flow::read_named_parameter(const std::string& name, const Cursor& cursor, std::size_t from) {
  // A parameter whose assignment has an error is uncertain: its uses are not reported.
  if (run_.is_uncertain()) run_.require_certain(fmt::format("#<{}>", name), cursor.cause(from));
  const bool is_global = name.front() == '_';
  if (const auto value =
          variables_.named(name, is_global ? Variables::Scope::Program : Variables::Scope::Call))
    return *value;
  if (is_global) {
    if (name == "_call_level") return double(calls_.size() - 1);
    if (const auto system = machine_.named_parameter(name)) return *system;
  }
  cursor.throw_input_error(from, "a named parameter that has been set", "#<" + name + ">");
}

bool Flow::has_named_parameter(const std::string& name) const {
  const bool is_global = name.front() == '_';
  return variables_.named(name, is_global ? Variables::Scope::Program : Variables::Scope::Call) ||
         (is_global && machine_.named_parameter(name));
}

/// Parses #n, ##n, #[...] or #<name>.
double Flow::parse_parameter(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  if (next_char(cursor) == '<') return read_named_parameter(parse_name(cursor), cursor, from);
  const int number = whole_number(cursor, from, parse_value(cursor, grammar(), *this), 5601);
  if (number < 1)
    cursor.throw_input_error(from, "a parameter from #1 to #5601", fmt::format("#{}", number));
  if (run_.is_uncertain()) run_.require_certain(fmt::format("#{}", number), cursor.cause(from));
  return number <= 30 ? calls_.back().locals[std::size_t(number)] : machine_.parameter(number);
}

std::optional<double> Flow::parse_operand(Cursor& cursor) {
  if (cursor.current() == '#') return parse_parameter(cursor);
  const std::size_t from = cursor.at;
  // ATAN[y]/[x] is within -180 to 180 degrees.
  if (cursor.accept("ATAN")) {
    const double y = parse_bracketed(cursor, grammar(), *this);
    expect_text(cursor, "/", "/ after the first argument of ATAN");
    const double x = parse_bracketed(cursor, grammar(), *this);
    return std::atan2(y, x) / units::deg;
  }
  if (cursor.accept("EXISTS")) {
    if (!cursor.accept("[") || !cursor.accept("#") ||
        (cursor.skip_blanks(), cursor.current() != '<'))
      cursor.throw_input_error(from, "[#<name>] after EXISTS");
    const bool exists = has_named_parameter(parse_name(cursor));
    expect_text(cursor, "]", "] after EXISTS");
    return exists ? 1.0 : 0.0;
  }
  return std::nullopt;
}

namespace {

// Keeps the count within a long long, and reports an endless repeat before it runs.
constexpr double max_repeats = 1e9;

}  // namespace

/// Parses the O word at the beginning of a line, after block skip and line number. Returns nothing
/// if the line has none or is skipped.
std::optional<OWord> Flow::read_o_word(Cursor& cursor) {
  if (next_char(cursor) == '/') {
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
  if (next_char(cursor) == '<') {
    o.label = "<" + parse_name(cursor) + ">";
  } else {
    const std::size_t number = cursor.at;
    o.label = fmt::format(
        "{}", whole_number(cursor, number, parse_value(cursor, grammar(), *this), 1000000));
  }
  cursor.skip_blanks();
  while (is_letter(cursor.current()))
    o.keyword += char(upper(cursor.text[cursor.at++]) - 'A' + 'a');
  o.cause = cursor.cause(from);
  o.end = cursor.at;
  return o;
}

/// Returns the O word of any line, for a search. Returns nothing for a computed label with an
/// error.
std::optional<OWord> Flow::find_o_word(const Source& source, std::size_t at) {
  const std::string_view text = source.lines[at];
  Cursor cursor{text, run_.canon.place()};
  std::size_t i = text.find_first_not_of(" \t");
  if (i == std::string_view::npos) return std::nullopt;
  const char c = upper(text[i]);
  if (c != 'O' && c != 'N' && c != '/') return std::nullopt;
  try {
    return read_o_word(cursor);
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

// Lines are stored because loops repeat the search.
std::size_t Flow::find_next(const OWord& o, std::initializer_list<std::string_view> keywords) {
  const Source& source = this->source();
  std::string key = fmt::format("{}:{}:{}", source.file, line_index_, *keywords.begin());
  if (const auto entry = found_lines_.find(key); entry != found_lines_.end()) return entry->second;
  for (std::size_t i = line_index_ + 1; i < source.lines.size(); ++i) {
    const auto other = find_o_word(source, i);
    if (!other || other->label != o.label) continue;
    if (std::ranges::find(keywords, other->keyword) == keywords.end()) continue;
    found_lines_.emplace(std::move(key), i);
    return i;
  }
  throw_input_error(o.cause, fmt::format("o{} {} after it", o.label, *(keywords.end() - 1)),
                    "none");
}

double Flow::evaluate_condition(Cursor& cursor) {
  const double result = parse_bracketed(cursor, grammar(), *this);
  expect_end(cursor);
  return result;
}

/// Throws BadInput unless only a comment follows.
void Flow::expect_end(Cursor& cursor) const {
  cursor.skip_blanks();
  if (!cursor.at_end() && cursor.current() != '(' && cursor.current() != ';')
    cursor.throw_input_error(cursor.at, "nothing more after an O word");
}

void Flow::execute_o_word(const OWord& o, Cursor cursor) {
  const auto is_one_of = [&](std::initializer_list<std::string_view> keywords) {
    return std::ranges::find(keywords, o.keyword) != keywords.end();
  };
  cursor.at = o.end;
  if (is_one_of({"if", "elseif", "else", "endif"})) return execute_if(o, cursor);
  if (is_one_of({"while", "endwhile", "do", "repeat", "endrepeat"})) return execute_loop(o, cursor);
  if (is_one_of({"break", "continue"})) return leave_loop(o, o.keyword == "continue");
  if (o.keyword == "call") return call_subprogram(o, cursor);
  if (is_one_of({"return", "endsub"})) return return_from_subprogram(o, cursor);
  if (o.keyword == "sub") {
    if (calls_.size() > 1) throw_input_error(o.cause, "endsub before another sub");
    // The definition of a subprogram is skipped.
    line_index_ = find_next(o, {"endsub"}) + 1;
    return;
  }
  throw_input_error(o.cause,
                    "sub endsub call return if elseif else endif while endwhile do repeat "
                    "endrepeat break or continue after an O word");
}

void Flow::execute_if(const OWord& o, Cursor& cursor) {
  // LinuxCNC rejects elseif, else and endif if their if has not been executed.
  std::string key = fmt::format("{}:{}", source().file, o.label);
  if (o.keyword == "if")
    executed_ifs_.insert(std::move(key));
  else if (!executed_ifs_.contains(key))
    throw_input_error(o.cause, fmt::format("o{} if before {}", o.label, o.keyword), "none");
  if (o.keyword == "endif") {
    ++line_index_;
    return;
  }
  if (o.keyword != "if") {
    // The branch before elseif or else has been executed.
    line_index_ = find_next(o, {"endif"}) + 1;
    return;
  }
  if (evaluate_condition(cursor) != 0) {
    ++line_index_;
    return;
  }
  // Conditions of elseif are evaluated in their order until one is true.
  while (true) {
    line_index_ = find_next(o, {"elseif", "else", "endif"});
    run_.count_block();
    run_.canon.set_line(int(line_index_) + 1, source().file);
    Cursor next{source().lines[line_index_], run_.canon.place()};
    const auto other = read_o_word(next);
    next.at = other->end;
    if (other->keyword != "elseif" || evaluate_condition(next) != 0) break;
  }
  ++line_index_;
}

void Flow::execute_loop(const OWord& o, Cursor& cursor) {
  std::vector<Loop>& loops = calls_.back().loops;
  run_.check_depth(int(loops.size()), o.cause, "loops");
  // A keyword belongs to the innermost loop if its label matches.
  const bool is_running = !loops.empty() && loops.back().label == o.label;
  if (o.keyword == "do") {
    loops.push_back({o.label, Loop::Kind::Do, line_index_});
    ++line_index_;
  } else if (o.keyword == "while" && is_running && loops.back().kind == Loop::Kind::Do) {
    // This while ends a do loop; the same keyword begins a while loop.
    if (evaluate_condition(cursor) != 0) {
      line_index_ = loops.back().line + 1;
    } else {
      loops.pop_back();
      ++line_index_;
    }
  } else if (o.keyword == "while") {
    // endwhile has returned to this while, so the loop must not be opened again.
    const bool is_next_pass =
        is_running && loops.back().kind == Loop::Kind::While && loops.back().line == line_index_;
    if (evaluate_condition(cursor) != 0) {
      if (!is_next_pass) loops.push_back({o.label, Loop::Kind::While, line_index_});
      ++line_index_;
    } else {
      if (is_next_pass) loops.pop_back();
      line_index_ = find_next(o, {"endwhile"}) + 1;
    }
  } else if (o.keyword == "endwhile") {
    if (!is_running || loops.back().kind != Loop::Kind::While)
      throw_input_error(o.cause, fmt::format("o{} while before endwhile", o.label), "none");
    line_index_ = loops.back().line;
  } else if (o.keyword == "repeat") {
    const double count = evaluate_condition(cursor);
    if (!(count <= max_repeats)) throw_input_error(o.cause, "at most 1e9 repeats");
    if (std::llround(count) <= 0) {
      line_index_ = find_next(o, {"endrepeat"}) + 1;
    } else {
      loops.push_back({o.label, Loop::Kind::Repeat, line_index_, std::llround(count)});
      ++line_index_;
    }
  } else {
    if (!is_running || loops.back().kind != Loop::Kind::Repeat)
      throw_input_error(o.cause, fmt::format("o{} repeat before endrepeat", o.label), "none");
    if (--loops.back().remaining_repeats > 0) {
      line_index_ = loops.back().line + 1;
    } else {
      loops.pop_back();
      ++line_index_;
    }
  }
}

/// Executes break and continue of the loop with the label; loops inside it end.
void Flow::leave_loop(const OWord& o, bool continues) {
  std::vector<Loop>& loops = calls_.back().loops;
  const auto target = std::find_if(loops.rbegin(), loops.rend(),
                                   [&](const Loop& loop) { return loop.label == o.label; });
  if (target == loops.rend())
    throw_input_error(o.cause, "a loop with this label around " + o.keyword, "none");
  loops.erase(target.base(), loops.end());
  const Loop loop = loops.back();
  const std::string_view end = loop.kind == Loop::Kind::While ? "endwhile"
                               : loop.kind == Loop::Kind::Do  ? "while"
                                                              : "endrepeat";
  if (continues) {
    // In a do or repeat loop the last line decides about another pass.
    line_index_ = loop.kind == Loop::Kind::While ? loop.line : find_next(o, {end});
  } else {
    line_index_ = find_next(o, {end}) + 1;
    loops.pop_back();
  }
}

/// Returns a subprogram of the running file, else of the main program, else of a file of its name.
/// Throws BadInput if there is none.
Flow::Subprogram Flow::find_subprogram(const OWord& o) {
  const auto key = [&](const Source& source) { return fmt::format("{}:{}", source.file, o.label); };
  for (const Source* source : {calls_.back().source, (const Source*)sources_.front().get()}) {
    if (const auto entry = subprograms_.find(key(*source)); entry != subprograms_.end())
      return entry->second;
    for (std::size_t i = 0; i < source->lines.size(); ++i)
      if (const auto other = find_o_word(*source, i);
          other && other->keyword == "sub" && other->label == o.label)
        return subprograms_[key(*source)] = {source, i};
  }
  const std::string file_key = "file:" + o.label;
  if (const auto entry = subprograms_.find(file_key); entry != subprograms_.end())
    return entry->second;
  const bool has_name = o.label.front() == '<';
  const std::string name = has_name ? o.label.substr(1, o.label.size() - 2) : o.label;
  // The name becomes a file name, which must not be a path.
  const auto is_name = [](char c) {
    return is_letter(c) || is_digit(c) || c == '_' || c == '-' || c == '.';
  };
  const std::filesystem::path file = run_.options().subprogram_folder / (name + ".ngc");
  std::error_code error;
  if (run_.options().subprogram_folder.empty() || name.front() == '.' ||
      !std::all_of(name.begin(), name.end(), is_name) ||
      !std::filesystem::is_regular_file(file, error))
    run_.refuse_once(
        "o" + o.label, o.cause,
        fmt::format("a subprogram o{} in the program, or {}.ngc next to it", o.label, name),
        "none");
  const Source& source = add_source_file(file, file.string());
  for (std::size_t i = 0; i < source.lines.size(); ++i)
    if (const auto other = find_o_word(source, i);
        other && other->keyword == "sub" && other->label == o.label)
      return subprograms_[file_key] = {&source, i};
  throw_input_error(o.cause, fmt::format("o{} sub in {}", o.label, file.string()), "none");
}

void Flow::call_subprogram(const OWord& o, Cursor& cursor) {
  std::array<double, 31> arguments{};
  std::size_t count = 0;
  for (cursor.skip_blanks(); cursor.current() == '['; cursor.skip_blanks()) {
    const std::size_t from = cursor.at;
    if (++count > 30) cursor.throw_input_error(from, "at most 30 arguments", "more");
    arguments[count] = parse_bracketed(cursor, grammar(), *this);
  }
  expect_end(cursor);
  run_.check_depth(int(calls_.size()), o.cause);
  const Subprogram subprogram = find_subprogram(o);
  // Arguments become #1 to #30; missing ones are zero.
  calls_.push_back({.source = subprogram.source,
                    .return_line = line_index_ + 1,
                    .name = o.label,
                    .locals = arguments});
  variables_.enter();
  line_index_ = subprogram.line + 1;
}

void Flow::return_from_subprogram(const OWord& o, Cursor& cursor) {
  if (calls_.size() == 1) throw_input_error(o.cause, "a call before " + o.keyword, "none");
  // Subprograms do not nest, so the label must be that of the running one.
  if (calls_.back().name != o.label)
    throw_input_error(o.cause, fmt::format("o{} {}", calls_.back().name, o.keyword));
  cursor.skip_blanks();
  std::optional<double> result;
  if (cursor.current() == '[') result = parse_bracketed(cursor, grammar(), *this);
  expect_end(cursor);
  const Call call = calls_.back();
  line_index_ = call.return_line;
  calls_.pop_back();
  variables_.leave();
  // M73 restores the modes at the end of the call.
  if (call.restores_modes && call.restore_modes) call.restore_modes(o.cause);
  if (!variables_.set("_value", result.value_or(0.0)) ||
      !variables_.set("_value_returned", result ? 1.0 : 0.0))
    cursor.throw_input_error(0, "fewer parameters", "too many");
}

void Flow::end_call() {
  const Call call = calls_.back();
  line_index_ = call.return_line;
  calls_.pop_back();
  variables_.leave();
  // Without endsub the end of the file leaves the call open.
  const program::NcLocation location = run_.canon.place();
  throw BadInput(location.file, location.line, 0, fmt::format("o{} endsub", call.name),
                 "the end of the file");
}

}  // namespace linuxcnc

void read_linuxcnc(std::string_view text, ProgramRun& run) { linuxcnc::Flow(text, run).run(); }

}  // namespace abbe::sim::dialects
