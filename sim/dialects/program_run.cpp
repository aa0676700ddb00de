#include "sim/dialects/program_run.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/dialects/cursor.h"
#include "sim/program/block_motion.h"

namespace abbe::sim::dialects {

namespace {
// Different words; bounds memory for a file that is no program of this dialect.
constexpr std::size_t max_skipped = 1000;
constexpr std::size_t blocks_between_reports = 8192;  // rare enough to cost nothing beside parsing

// Returns true for a turning control, stated or derived from a spindle that turns the workpiece.
bool is_turning(const ReadOptions& options) {
  const ControlKind kind = options.turning.control;
  return kind == ControlKind::Turning ||
         (kind == ControlKind::FromMachine && program::turns_workpiece(options.control.axes));
}

/// Returns true if X is perpendicular to the axis of the workpiece spindle, as far as is known. If
/// X runs along it, X words are no diameters.
bool is_x_radial(const program::NcOptions& control) {
  constexpr double right_angle = 1e-6;  // cosine of the angle
  if (!control.control) return true;
  const auto spindle = control.control->find('S'), x = control.control->find('X');
  if (!spindle || !x) return true;
  const auto& joints = control.control->joints();
  return std::abs(joints[std::size_t(*spindle)].direction_b.dot(
             joints[std::size_t(*x)].direction_b)) < right_angle;
}

}  // namespace

ProgramRun::ProgramRun(const std::string& file, const ReadOptions& options, std::size_t lines)
    : canon(file, options.control),
      options_(options),
      file_(file),
      line_was_read_(lines + 2),  // lines are counted from 1, and the last one may lack its end
      lines_(lines),
      turning_(is_turning(options)) {}

bool ProgramRun::has_initial_diameters(bool usual) const {
  const XWordMeaning words = options_.turning.x_words;
  if (words != XWordMeaning::FromControl) return words == XWordMeaning::Diameters;
  return usual && turning_ && is_x_radial(options_.control);
}

void ProgramRun::hand_over() {
  if (!options_.on_path_segment) return;
  program::Path piece = canon.hand_over();
  // After the first error the program has no valid continuation, so nothing more is passed on.
  if (input_errors_.empty()) options_.on_path_segment(std::move(piece));
}

// Only the first cause is reported: errors that follow from an uncertain position are dropped.
bool ProgramRun::attempt(const std::function<void()>& block) {
  try {
    block();
    return true;
  } catch (const ProgramLimitExceeded& fault) {
    // A limit ends reading; otherwise every further block would report it again.
    input_errors_.add(fault);
    aborted_ = true;
  } catch (const program::FollowingError&) {
    // A consequence of a reported error: the position is still not what the program intended.
    canon.mark_position_uncertain();
  } catch (const program::BadGeometry& fault) {
    // An arc with a wrong centre leaves the axes at its programmed end, so the position stays
    // certain.
    if (!fault.is_uncertain) input_errors_.add(fault);
  } catch (const BadInput& fault) {
    input_errors_.add(fault);
    canon.mark_position_uncertain();
  }
  return false;
}

void ProgramRun::require_certain(const std::string& name, const program::Cause& cause) const {
  if (uncertain_names_.empty() || !uncertain_names_.contains(name)) return;
  const program::NcLocation place = canon.place();
  throw program::FollowingError(place.file, place.line, cause.column,
                                name + " without an input error", "one that is reported");
}

void ProgramRun::refuse_once(const std::string& name, const program::Cause& cause,
                             std::string expected, std::optional<std::string> seen) {
  // A second search for the same name fails silently by `require_certain`.
  require_certain(name, cause);
  doubt(name);
  canon.refuse(cause, std::move(expected), std::move(seen));
}

void ProgramRun::start(const std::function<void(std::string_view)>& block) {
  if (options_.startup_code.empty()) return;
  // The startup code is a file of its own, so that messages do not point into the program.
  canon.set_line(1, canon.add_file("program.startup_code"));
  attempt([&] { block(options_.startup_code); });
}

bool has_words(std::string_view line) {
  int depth = 0;
  for (std::size_t at = 0; at < line.size(); ++at) {
    const char c = line[at];
    if (c == '(') ++depth;
    if (c == ')') depth = std::max(0, depth - 1);
    // Brackets inside a comment may nest; an unmatched ) does not hide the words behind it.
    if (depth > 0) continue;
    if (c == ';' || c == '*' || line.substr(at, 2) == "$$") return false;
    if (is_letter(c)) return true;
  }
  return false;
}

void ProgramRun::count_block() {
  // Only lines of the main file are tracked: warnings about unread lines are about that file.
  if (canon.file() == 0 && std::size_t(canon.line()) < line_was_read_.size())
    line_was_read_[std::size_t(canon.line())] = true;
  if (canon.kept() >= path_segment_blocks) hand_over();
  if (options_.progress && blocks_ % blocks_between_reports == 0 && lines_ > 0)
    options_.progress(std::min(1.0, double(canon.line()) / double(lines_)));
  if (++blocks_ <= options_.limits.blocks) return;
  const program::NcLocation place = canon.place();
  throw ProgramLimitExceeded(
      place.file, place.line, 0,
      fmt::format("at most {} blocks executed (max_moves)", options_.limits.blocks),
      "more: a loop without end, or too many repeats");
}

void ProgramRun::check_moves(double more, const program::Cause& cause) const {
  canon.check_moves(more, cause);
  // Memory is checked only if the moves are kept.
  if (!options_.on_path_segment) canon.check_memory(more, cause);
}

void ProgramRun::check_depth(int depth, const program::Cause& cause, const char* what) const {
  if (depth <= options_.limits.depth) return;
  const program::NcLocation place = canon.place();
  throw ProgramLimitExceeded(
      place.file, place.line, cause.column,
      fmt::format("at most {} {} within each other", options_.limits.depth, what),
      "more: " + shown(cause.text));
}

void ProgramRun::unknown(const program::Cause& word, const std::string& expected) {
  if (options_.on_unknown == UnknownWordPolicy::Refuse) canon.refuse(word, expected);
  const auto known = std::find_if(skipped_.begin(), skipped_.end(),
                                  [&](const SkippedWord& one) { return one.word == word.text; });
  if (known != skipped_.end()) {
    ++known->count;
    return;
  }
  if (skipped_.size() == max_skipped) {
    const program::NcLocation place = canon.place();
    throw ProgramLimitExceeded(place.file, place.line, word.column,
                               "at most 1000 different unknown words", shown(word.text));
  }
  skipped_.push_back({std::string(word.text.substr(0, 40)), 1, canon.line()});
}

bool ProgramRun::skips(int level) {
  const bool skipped = options_.control.block_skip.test(std::size_t(level));
  // Blocks skipped and blocks executed behind a / are counted apart: both are assumptions.
  BlockSkipCount& blocks = skipped ? left_out_ : executed_;
  if (blocks.count++ == 0)
    blocks = {1, canon.line(), canon.file() > 0 ? canon.place().file : std::string()};
  return skipped;
}

void ProgramRun::assume_mode(StartMode mode, std::string_view taken) {
  AssumedMode& known = modes_[std::size_t(mode)];
  if (known.stated) return;
  // Stated from here on, so that each mode is reported once.
  known = {taken, true};
  if (modes_line_ == 0) modes_line_ = canon.line();
}

void ProgramRun::assume_offset(int system, std::string_view taken) {
  const kinematics::AxisVector& offset = program::work_offset(canon.options(), system);
  // An offset of zero makes no difference, so nothing has been assumed.
  if (offset.size() > 0 && !offset.isZero(0.0)) assume_mode(StartMode::WorkOffset, taken);
}

int ProgramRun::uncalled_tool(const program::Cause& cause, const std::string& missing_statement) {
  const auto tool = program::only_tool(canon.options());
  if (!tool) canon.refuse(cause, "a tool that is called before it", missing_statement);
  canon.assume({missing_statement + ": the only tool is taken to be meant", "program.startup_code",
                "--startup-code"});
  return *tool;
}

void ProgramRun::report_assumptions() {
  const auto blocks = [&](const BlockSkipCount& marked, const char* text) {
    if (marked.count > 0)
      canon.assume({fmt::format("{} {} behind / {}", marked.count,
                                marked.count == 1 ? "block" : "blocks", text),
                    "program.block_skip", "--block-skip", marked.line, marked.file});
  };
  blocks(left_out_, "left out: block skip is on");
  blocks(executed_, "executed: block skip is off");
  std::string taken;
  for (const AssumedMode& mode : modes_)
    if (!mode.taken.empty()) taken += (taken.empty() ? "" : ", ") + std::string(mode.taken);
  if (!taken.empty())
    canon.assume({"no word before says otherwise: " + taken, "program.startup_code",
                  "--startup-code", modes_line_});
}

void ProgramRun::warn_unread(const std::vector<std::string_view>& lines,
                             const std::vector<Section>& sections) {
  const auto is_read = [&](std::size_t i) {
    return i + 1 < line_was_read_.size() && line_was_read_[i + 1];
  };
  std::size_t last = lines.size();  // last line read of the section
  const auto find_last = [&](const Section& section) {
    last = section.end;
    for (std::size_t i = section.first; i < section.end; ++i)
      if (is_read(i)) last = i;
    return last < section.end;
  };
  const std::size_t end = std::size_t(std::max(canon.line(), 1)) - 1;
  std::size_t first = lines.size(), count = 0;
  for (const Section& section : sections) {
    // In the section where reading ended, lines behind the last one read are unread. Another
    // section is reported only if none of its lines was read: a subprogram may end before its last
    // line.
    const bool ends_here = canon.file() == 0 && end >= section.first && end < section.end;
    const bool any = find_last(section);
    if (any && !ends_here) continue;
    for (std::size_t i = any ? last + 1 : section.first; i < section.end; ++i) {
      if (!has_words(lines[i])) continue;
      first = std::min(first, i);
      ++count;
    }
  }
  if (count == 0) return;
  warn_once(fmt::format(
      "{}:{}: {} from {} on {} not read: the program ends {}", file_, first + 1,
      count == 1 ? "the line" : fmt::format("{} lines", count), in_quotes(lines[first]),
      count == 1 ? "is" : "are",
      canon.file() == 0 ? fmt::format("on line {}", end + 1) : "in " + canon.place().file));
}

void ProgramRun::warn_once(const std::string& text) {
  if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(text);
}

}  // namespace abbe::sim::dialects
