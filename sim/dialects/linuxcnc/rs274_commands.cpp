#include "sim/dialects/linuxcnc/rs274_commands.h"

#include <charconv>
#include <fstream>

namespace abbe::sim::dialects::linuxcnc {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t max_line_bytes = 252;  // rs274 rejects longer lines as "too long"
constexpr std::size_t max_subprogram_bytes = std::size_t(1) << 26;
constexpr std::size_t max_subprograms = 1000;
// N words and int hold nine digits.
constexpr std::size_t max_lines = 1'000'000'000;

/// Returns the line in upper case without blanks and comments, as RS274 reads it.
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

/// Parses a number without minus at `at` and advances `at` past it. Returns nothing if there is
/// none.
std::optional<double> parse_literal(std::string_view text, std::size_t& at) {
  double value = 0.0;
  const char* from = text.data() + at;
  if (from != text.data() + text.size() && *from == '+') ++from;
  const auto [end, error] =
      std::from_chars(from, text.data() + text.size(), value, std::chars_format::fixed);
  if (error != std::errc()) return std::nullopt;
  at = std::size_t(end - text.data());
  return value;
}

/// Returns the position after the expression in [ ] or the name in < > that begins at `at`.
std::size_t end_of_brackets(std::string_view text, std::size_t at) {
  const char open = text[at], close = open == '[' ? ']' : '>';
  int depth = 0;
  for (; at < text.size(); ++at) {
    depth += text[at] == open;
    if (text[at] == close && --depth == 0) return at + 1;
  }
  return text.size();
}

}  // namespace

LineCodes parse_codes(std::string_view line) {
  const std::string text = compact(line);
  LineCodes words;
  words.has_assignment = text.find('=') != std::string::npos;
  for (std::size_t at = 0; at < text.size();) {
    const char letter = text[at];
    // Letters and numbers in expressions and names form no words.
    if (letter == '[' || letter == '<') {
      at = end_of_brackets(text, at);
      continue;
    }
    ++at;
    if (letter == '#') {  // the number after # forms no word
      const auto number = parse_literal(text, at);
      words.has_system_parameter |= number && *number >= 5221 && *number <= 5390;
      continue;
    }
    if (!is_letter(letter) || at == text.size()) continue;
    const bool is_code = letter == 'G' || letter == 'M';
    words.has_computed_code |= is_code && (text[at] == '[' || text[at] == '#');
    const auto value = parse_literal(text, at);
    if (!value && letter == 'H') words.h = not_literal;
    if (!value && letter == 'D') words.d = not_literal;
    if (!value) continue;
    if (is_code)
      words.codes.push_back(int(std::lround(std::clamp(*value, 0.0, 1e4) * 10)) +
                            (letter == 'M' ? LineCodes::m_code : 0));
    const int number = *value >= 0 && *value <= 1e9 ? int(*value) : -1;
    words.has_f |= letter == 'F';
    if (letter == 'H') words.h = number;
    if (letter == 'D') words.d = number;
    if (letter == 'L') words.l = number;
    if (letter == 'T') words.tool = number;
    if (letter == 'P') words.p = number;
    if (letter == 'Q') words.q = number;
  }
  // M61 states its tool by Q.
  if (words.has({LineCodes::m_code + 610})) words.tool = words.q;
  return words;
}

namespace {

/// Returns the name, in lower case, of the subprogram that a line calls by a literal name or
/// number. Returns an empty text for any other line.
std::string called_subprogram(std::string_view line, const LineCodes& words) {
  if (words.has({LineCodes::m_code + 980}) && words.p >= 0) return std::to_string(words.p);
  std::string text = compact(line);
  std::size_t at = text.starts_with("N") ? text.find_first_not_of("0123456789.", 1) : 0;
  if (at == std::string::npos || text[at] != 'O') return {};
  ++at;
  const std::size_t end = at < text.size() && text[at] == '<'
                              ? end_of_brackets(text, at)
                              : text.find_first_not_of("0123456789", at);
  if (end == std::string::npos || text.compare(end, 4, "CALL") != 0) return {};
  std::string name = text.substr(at, end - at);
  if (name.starts_with("<")) name = name.substr(1, name.size() - 2);
  for (char& c : name) c = c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
  return name;
}

/// Splits a block into its words and comments. Blanks stay with the word before them.
std::vector<std::string_view> split_words(std::string_view block) {
  std::vector<std::string_view> words;
  std::size_t from = 0;
  bool has_number = false;
  const auto cut = [&](std::size_t at) {
    if (at > from) words.push_back(block.substr(from, at - from));
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
      at = end_of_brackets(block, at);
      has_number = true;
    } else {
      has_number |= is_digit(c);
      ++at;
    }
  }
  cut(block.size());
  return words;
}

/// Returns true if the block changes both the tool and the tool length.
bool changes_tool_and_length(std::string_view block) {
  const LineCodes words = parse_codes(block);
  return words.has({LineCodes::m_code + 60}) && !words.has_assignment &&
         words.has({430, 431, 432, 490});
}

/// Splits a block that changes tool and tool length: returns T and M6, then the other words. For
/// one block rs274 without a control would read the axis positions again and omit the new length.
std::pair<std::string, std::string> split_tool_change(std::string_view block) {
  std::string tool_change, other_words;
  for (const std::string_view word : split_words(block)) {
    const bool changes_tool =
        upper(word.front()) == 'T' || parse_codes(word).has({LineCodes::m_code + 60});
    (changes_tool ? tool_change : other_words) += word;
  }
  return {tool_change, other_words};
}

/// Returns true if a name is safe for a file in the private folder: no path and no leading dot or
/// dash.
bool is_plain_name(const std::string& name) {
  return !name.empty() && name.front() != '.' && name.front() != '-' && name.size() < 100 &&
         name.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._"
             "-") == std::string::npos;
}

/// Returns a line without leading blanks, block skip and line number.
std::string_view without_number(std::string_view line) {
  const auto skip = [&](std::string_view characters) {
    line.remove_prefix(std::min(line.size(), line.find_first_not_of(characters)));
  };
  skip(" \t");
  if (line.starts_with("/")) line.remove_prefix(1);
  skip(" \t");
  if (line.empty() || upper(line.front()) != 'N') return line;
  const std::string_view block = line;
  line.remove_prefix(1);
  skip(" \t");
  if (line.empty() || !is_digit(line.front())) return block;
  skip("0123456789");
  if (line.starts_with(".")) {
    line.remove_prefix(1);
    skip("0123456789");
  }
  return line;
}

}  // namespace

NumberedProgram::NumberedProgram(std::string_view text, const std::string& file, std::string before,
                                 ProgramRun& run, const fs::path& folder)
    : run_(run), before_(std::move(before)) {
  name_ = fs::path(file).filename().string();
  if (!is_plain_name(name_)) name_ = "program.ngc";
  add(name_, 0, std::string(text));
  // By index, because the list grows whenever a file calls another subprogram.
  for (std::size_t i = 0; i < files_.size(); ++i) write(files_[i], folder);
}

void NumberedProgram::add(const std::string& name, int canon_file, std::string text) {
  File file{name, canon_file, std::move(text), {}, 1};
  if (!files_.empty()) file.first = files_.back().first + int(files_.back().lines.size());
  files_.push_back(std::move(file));
  File& added = files_.back();
  added.lines = lines_of_text(added.text);
  if (std::size_t(added.first) + added.lines.size() > max_lines)
    throw BadInput(name, 0, 0, fmt::format("at most {} lines", max_lines), "more");
}

/// Throws BadInput for text by which a program could run code or read other files: rs274 executes
/// Python in comments and follows paths in the names of subprograms.
void NumberedProgram::check_escapes(std::string_view line) const {
  std::string compact_line;
  for (const char c : line)
    if (!is_blank(c)) compact_line += upper(c);
  for (const std::string_view python :
       {"(PY,", ";PY,", "(PYRUN", ";PYRUN", "(PYRELOAD", ";PYRELOAD"})
    if (compact_line.find(python) != std::string::npos)
      run_.canon.throw_input_error(
          {0, line}, "no Python in a comment: a program must not start other programs");
  for (std::size_t at = 0; (at = compact_line.find("O<", at)) != std::string::npos; ++at) {
    const std::string name = compact_line.substr(at, compact_line.find('>', at) - at);
    if (name.find('/') != std::string::npos || name.find("..") != std::string::npos)
      run_.canon.throw_input_error(
          {0, line}, "a subprogram next to the program, with a name without / and ..");
  }
}

/// Returns a line as it is passed to rs274. It gets its number unless that would make it too long,
/// and is split in two if rs274 would misread it.
std::string NumberedProgram::numbered_line(std::string_view line, int number, int file,
                                           int at) const {
  run_.canon.set_line(at, file);
  if (const std::size_t nul = line.find('\0'); nul != std::string_view::npos)
    run_.canon.throw_input_error({int(nul) + 1, {}}, "text", "a NUL byte");
  check_escapes(line);
  const std::string_view text = line.substr(std::min(line.size(), line.find_first_not_of(" \t")));
  if (text.empty() || text.front() == '%') return std::string(text);
  // A skipped block becomes an empty line, so that the lines in messages of rs274 agree.
  if (text.front() == '/' && run_.skips_block(0)) return {};
  const std::string_view block = without_number(line);
  if (block.size() > max_line_bytes)
    run_.canon.throw_input_error(
        {},
        fmt::format("at most {} characters in a line for LinuxCNC's own interpreter",
                    max_line_bytes),
        fmt::format("{}", block.size()));
  const auto with_number = [&](std::string_view words) {
    std::string numbered = fmt::format("N{} {}", number, words);
    return numbered.size() > max_line_bytes ? std::string(words) : numbered;
  };
  if (!changes_tool_and_length(block)) return with_number(block);
  const auto [tool_change, other_words] = split_tool_change(block);
  return with_number(tool_change) + "\n" + with_number(other_words);
}

void NumberedProgram::write(const File& file, const fs::path& folder) {
  const std::vector<std::string_view>& lines = file.lines;
  std::string text;
  std::set<std::string> calls;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string line =
        numbered_line(lines[i], file.first + int(i), file.canon_file, int(i) + 1);
    const bool is_percent = line.starts_with("%");
    // A leading % must stay first, so the lines before the program follow it.
    if (!line.empty() && !is_percent) text += std::exchange(before_, {});
    text += line + '\n';
    if (is_percent) text += std::exchange(before_, {});
    const LineCodes words = parse_codes(lines[i]);
    if (words.tool > 0) tools_.insert(words.tool);
    if (words.has({LineCodes::m_code + 660})) {
      run_.canon.set_line(int(i) + 1, file.canon_file);
      run_.canon.throw_input_error({}, "no wait for an input: there are no inputs", "M66");
    }
    if (std::string call = called_subprogram(lines[i], words); !call.empty())
      calls.insert(std::move(call));
  }
  std::ofstream out(folder / file.name, std::ios::binary);
  if (!out.write(text.data(), std::streamsize(text.size())).flush())
    throw BadInput((folder / file.name).string(), 0, 0, "a writable file", "a write error");
  for (const std::string& call : calls) {
    const fs::path path = run_.options().subprogram_folder / (call + ".ngc");
    // A subprogram is written only once.
    const bool is_written = std::ranges::any_of(
        files_, [&](const File& other) { return other.name == path.filename().string(); });
    std::error_code error;
    if (is_written || run_.options().subprogram_folder.empty() || !is_plain_name(call) ||
        !fs::is_regular_file(path, error))
      continue;
    if (files_.size() > max_subprograms)
      run_.canon.throw_input_error(
          {}, fmt::format("at most {} files of subprograms", max_subprograms), "more");
    add(path.filename().string(), run_.canon.add_file(path.string()),
        read_text(path, max_subprogram_bytes));
  }
}

// Bisection, because the numbers of a file are consecutive and follow those of the file before it.
const NumberedProgram::File& NumberedProgram::file_of(int number) const {
  const auto next = std::upper_bound(files_.begin(), files_.end(), number,
                                     [](int n, const File& file) { return n < file.first; });
  return next == files_.begin() ? files_.front() : *(next - 1);
}

SourceLine NumberedProgram::location_of(int number) const {
  const File& file = file_of(number);
  const int line_count = int(file.lines.size());
  return {file.canon_file, std::clamp(number - file.first + 1, 1, std::max(line_count, 1))};
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

namespace {

/// Commands without effect on the path.
constexpr std::string_view ignored_commands =
    "SET_FEED_REFERENCE ON_RESET SET_MOTION_CONTROL_MODE SET_NAIVECAM_TOLERANCE "
    "SET_TRAVERSE_RATE START_CHANGE ENABLE_FEED_OVERRIDE DISABLE_FEED_OVERRIDE "
    "ENABLE_SPEED_OVERRIDE DISABLE_SPEED_OVERRIDE ENABLE_FEED_HOLD DISABLE_FEED_HOLD "
    "ENABLE_ADAPTIVE_FEED DISABLE_ADAPTIVE_FEED SET_MOTION_OUTPUT_BIT CLEAR_MOTION_OUTPUT_BIT "
    "SET_AUX_OUTPUT_BIT CLEAR_AUX_OUTPUT_BIT SET_AUX_OUTPUT_VALUE SET_MOTION_OUTPUT_VALUE "
    "ORIENT_SPINDLE PALLET_SHUTTLE MESSAGE LOG LOGOPEN LOGAPPEND LOGCLOSE INIT_CANON "
    "CLAMP_AXIS UNCLAMP_AXIS LOCK_ROTARY UNLOCK_ROTARY TURN_PROBE_ON TURN_PROBE_OFF UPDATE_TAG "
    "RELOAD_TOOLDATA";

bool is_without_effect(std::string_view name) {
  bool is_ignored = name.find("WAIT_ORIENT_COMPLETE") != std::string_view::npos;
  each_word(ignored_commands, [&](std::string_view ignored) { is_ignored |= ignored == name; });
  return is_ignored;
}

/// Returns the text in quotes of an argument such as that of COMMENT("text").
std::string_view quoted_text(std::string_view text) {
  const std::size_t open = text.find('"'), close = text.rfind('"');
  return open == close ? std::string_view() : text.substr(open + 1, close - open - 1);
}

}  // namespace

// A line has the form "12 N34 STRAIGHT_FEED(...)": a running number, the N word of the block, and
// the command.
std::optional<PrintedCommand> parse_command(std::string_view line) {
  const auto skip = [&](std::string_view characters) {
    line.remove_prefix(std::min(line.size(), line.find_first_not_of(characters)));
  };
  skip(" ");
  const std::size_t previous_size = line.size();
  skip("0123456789");
  if (line.size() == previous_size || !line.starts_with(" N")) return std::nullopt;
  line.remove_prefix(2);
  PrintedCommand command;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), command.number);
  if (error == std::errc()) line.remove_prefix(std::size_t(end - line.data()));
  skip(". ");
  const std::size_t open = line.find('('), close = line.rfind(')');
  if (open == std::string_view::npos || close == std::string_view::npos || close < open)
    return std::nullopt;
  command.name = line.substr(0, open);
  command.arguments = line.substr(open + 1, close - open - 1);
  return command;
}

Commands::Commands(ProgramRun& run, const NumberedProgram& program, const Eigen::Vector3d& zero)
    : run_(run), canon_(run.canon), program_(program), zero_(zero) {}

void Commands::throw_input_error(std::string expected, std::optional<std::string> seen) const {
  canon_.throw_input_error({0, program_.text_of(number_)}, std::move(expected), std::move(seen));
}

/// Sets the current line to that of a command. A command without a line number, such as those of
/// M72, belongs to the line before.
void Commands::set_location(const PrintedCommand& command) {
  if (command.number <= 0 || command.number == number_) return;
  number_ = command.number;
  const SourceLine location = program_.location_of(number_);
  canon_.set_line(location.line, location.file);
  codes_ = parse_codes(program_.text_of(number_));
  reference_moves_ = 0;
}

bool Commands::process(std::string_view line) {
  if (has_ended_) return true;  // output after the end of the program
  const auto command = parse_command(line);
  if (!command) return true;
  // T and M6 of one block are separate commands. Any other command shows that T was alone.
  const bool is_tool_change = command->name == "START_CHANGE" ||
                              command->name == "STOP_SPINDLE_TURNING" ||
                              command->name == "CHANGE_TOOL";
  if (pending_tool_ && (!is_tool_change || pending_block_ != command->number)) end_pending_tool();
  run_.try_block([&] {
    set_location(*command);
    // The errors of a block are reported once, even if a loop repeats it.
    if (faulty_blocks_.contains(number_)) {
      try {
        apply(*command);
      } catch (const ProgramLimitExceeded&) {
        throw;
      } catch (const BadInput&) {
        canon_.mark_position_uncertain();
      }
      return;
    }
    try {
      apply(*command);
    } catch (const BadInput&) {
      faulty_blocks_.insert(number_);
      throw;
    }
  });
  return !run_.is_aborted();
}

void Commands::apply(const PrintedCommand& command) {
  run_.count_block();
  if (apply_state(command) || apply_motion(command) || apply_spindle(command) ||
      apply_tool(command) || apply_auxiliary_word(command) || is_without_effect(command.name))
    return;
  throw_input_error("a known canonical command", quoted_excerpt(command.name));
}

// Throws BadInput unless all arguments are numbers and there are at least `min_count` of them.
Commands::Numbers Commands::parse_numbers(const PrintedCommand& command,
                                          std::size_t min_count) const {
  Numbers result;
  const std::string_view text = command.arguments;
  for (std::size_t at = 0; at < text.size();) {
    if (text[at] == ',' || text[at] == ' ') {
      ++at;
      continue;
    }
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data() + at, text.data() + text.size(), value);
    if (error != std::errc() || !std::isfinite(value))
      throw_input_error("numbers in " + std::string(command.name), quoted_excerpt(text));
    result.push_back(value);
    at = std::size_t(end - text.data());
  }
  if (result.size() < min_count)
    throw_input_error(fmt::format("{} numbers in {}", min_count, command.name),
                      quoted_excerpt(text));
  return result;
}

Commands::SixAxes Commands::six_axes(const Numbers& numbers, std::size_t from) const {
  SixAxes result;
  std::copy_n(numbers.begin() + std::ptrdiff_t(from), 6, result.begin());
  return result;
}

Commands::SixAxes Commands::in_mm(SixAxes lengths) const {
  for (std::size_t k = 0; k < 3; ++k) lengths[k] *= unit_;
  return lengths;
}

/// Sets the frame. The origins that rs274 was given include `zero_`, which the canon adds too.
void Commands::apply_frame() {
  SixAxes origin = g5x_;
  for (std::size_t k = 0; k < 3; ++k) origin[k] -= zero_[Eigen::Index(k)];
  canon_.set_frame(system_ - 1,
                   system_frame(canon_, origin, g92_, rotation_, {0, program_.text_of(number_)}));
}

void Commands::set_units(bool inch) {
  if (number_ > 0 && inch != is_inch_ && canon_.feed() && codes_.has_f)
    // rs274 interprets F before it switches the unit.
    run_.warn_once(
        fmt::format("{}:{}: F in a block that changes G20 and G21: LinuxCNC's own interpreter "
                    "interprets it in the previous unit",
                    canon_.place().file, canon_.line()));
  is_inch_ = inch;
  unit_ = inch ? units::inch : 1.0;
  canon_.set_inch(inch);
}

void Commands::check_length_unit(const char* word) const {
  const bool has_length =
      std::any_of(length_.begin(), length_.end(), [](double v) { return v != 0.0; });
  if (has_length && is_inch_ != is_length_in_inch_)
    throw_input_error(
        fmt::format("no {} after a switch between G20 and G21 under a tool length: rs274 takes the "
                    "length in the wrong unit there; put G49 and G43 around the switch",
                    word),
        codes_.has_computed_code ? std::optional<std::string>("a computed code") : std::nullopt);
}

bool Commands::apply_state(const PrintedCommand& command) {
  const std::string_view name = command.name;
  if (name == "USE_LENGTH_UNITS") {
    set_units(command.arguments.find("INCHES") != std::string_view::npos);
  } else if (name == "SET_G5X_OFFSET") {
    const Numbers n = parse_numbers(command, 7);
    system_ = int(std::clamp(n[0], 1.0, 9.0));
    g5x_ = in_mm(six_axes(n, 1));
    apply_frame();
  } else if (name == "SET_G92_OFFSET") {
    // This is the first command that certainly contains zeros. They are printed as 0.0000 if the
    // preloaded library does not work.
    if (!are_digits_checked_ && command.arguments.find("0.0000") != std::string_view::npos)
      throw ProgramLimitExceeded("rs274", 0, 0, "numbers with all their digits",
                                 quoted_excerpt(command.arguments));
    are_digits_checked_ = true;
    g92_ = in_mm(six_axes(parse_numbers(command, 6), 0));
    apply_frame();
  } else if (name == "SET_XY_ROTATION") {
    rotation_ = parse_numbers(command, 1)[0] * units::deg;
    apply_frame();
  } else if (name == "SELECT_PLANE") {
    const auto has_name = [&](const char* plane) {
      return command.arguments.find(plane) != std::string_view::npos;
    };
    if (has_name("_XY")) plane_ = {0, 1, 2};
    // rs274 calls the plane of G18 XZ, but the right-handed order of its axes is Z X.
    else if (has_name("_XZ"))
      plane_ = {2, 0, 1};
    else if (has_name("_YZ"))
      plane_ = {1, 2, 0};
    else
      throw_input_error("a plane of X Y Z", quoted_excerpt(command.arguments));
  } else if (name == "SET_FEED_MODE") {
    canon_.set_feed_mode(parse_numbers(command, 2)[1] == 1 ? FeedMode::PerRevolution
                                                           : FeedMode::PerMinute);
  } else if (name == "SET_FEED_RATE") {
    const double rate = parse_numbers(command, 1)[0];
    // F0 means that no feed is set.
    canon_.set_feed(rate > 0 ? std::optional(Feed{rate, unit_}) : std::nullopt);
  } else {
    return false;
  }
  return true;
}

/// Handles comments of the program, and those of rs274 itself, which announce cutter compensation.
void Commands::comment(std::string_view text) {
  constexpr std::string_view prefix = "interpreter: ";
  if (!text.starts_with(prefix)) return canon_.comment(text);
  if (!text.starts_with("interpreter: cutter radius compensation on")) return;
  run_.warn_once(
      "under G41 and G42 LinuxCNC's own interpreter outputs a move when it reads the next one: the "
      "lines of such moves may be those of the next block");
  // The tool table has a placeholder for every unknown radius, so rs274 cannot detect this error.
  if (codes_.has({410, 420}) && codes_.d == -1 && tool_ <= 0)
    throw_input_error("T and M6 before G41 and G42", "no tool called");
  const int tool = codes_.d >= 0 ? codes_.d : tool_;
  if (codes_.has({410, 420}) && codes_.d != not_literal && tool > 0 &&
      run_.options().control.tool_radius.count(tool) == 0 && stored_tools_.count(tool) == 0)
    throw_input_error("a tool with a known radius", fmt::format("tool {}", tool));
}

bool Commands::apply_auxiliary_word(const PrintedCommand& command) {
  const std::string_view name = command.name;
  if (name == "COMMENT")
    comment(quoted_text(command.arguments));
  else if (name == "MIST_ON")
    canon_.record_auxiliary_word("M7");
  else if (name == "FLOOD_ON")
    canon_.record_auxiliary_word("M8");
  else if (name == "FLOOD_OFF")  // M9 prints MIST_OFF and FLOOD_OFF
    canon_.record_auxiliary_word("M9");
  else if (name == "MIST_OFF")
    return true;
  else if (name == "PROGRAM_STOP")
    canon_.record_auxiliary_word("M0");
  else if (name == "OPTIONAL_PROGRAM_STOP")
    canon_.record_auxiliary_word("M1");
  else if (name == "PROGRAM_END" || name == "FINISH")
    has_ended_ = true;
  else
    return false;
  return true;
}

}  // namespace abbe::sim::dialects::linuxcnc
