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
constexpr std::size_t blocks_between_reports =
    8192;  // rare enough to cost nothing compared with parsing

// Returns true for a turning control, stated or derived from a spindle that carries the workpiece.
bool has_turning_control(const ReadOptions& options) {
  const ControlKind kind = options.turning.control_kind;
  return kind == ControlKind::Turning ||
         (kind == ControlKind::FromMachine && program::turns_workpiece(options.control.axes));
}

/// Returns true if X is perpendicular to the axis of the workpiece spindle, as far as is known. If
/// X runs along it, X words are no diameters.
bool is_x_radial(const program::NcOptions& control) {
  constexpr double right_angle = 1e-6;  // cosine of the angle
  if (!control.control) return true;
  const auto spindle = control.control->find('S'), x_axis = control.control->find('X');
  if (!spindle || !x_axis) return true;
  const auto& joints = control.control->joints();
  return std::abs(joints[std::size_t(*spindle)].direction_b.dot(
             joints[std::size_t(*x_axis)].direction_b)) < right_angle;
}

}  // namespace

ProgramRun::ProgramRun(const std::string& file, const ReadOptions& options, std::size_t lines)
    : canon(file, options.control),
      options_(options),
      file_(file),
      line_was_read_(lines + 2),  // lines are counted from 1, and the last one may lack its end
      line_count_(lines),
      is_turning_(has_turning_control(options)) {}

bool ProgramRun::has_initial_diameters(bool usual) const {
  const XWordMeaning meaning = options_.turning.x_words;
  if (meaning != XWordMeaning::FromControl) return meaning == XWordMeaning::Diameters;
  return usual && is_turning_ && is_x_radial(options_.control);
}

void ProgramRun::emit_segment() {
  if (!options_.on_path_segment) return;
  program::Path segment = canon.take_kept_blocks();
  // After the first error the program has no valid continuation, so nothing more is passed on.
  if (input_errors_.empty()) options_.on_path_segment(std::move(segment));
}

// Only causes are reported: a user who corrects them need not read their consequences.
bool ProgramRun::try_block(const std::function<void()>& block) {
  try {
    block();
    return true;
  } catch (const ProgramLimitExceeded& input_error) {
    // A limit ends reading; otherwise every further block would report it again.
    input_errors_.add(input_error);
    is_aborted_ = true;
  } catch (const program::FollowingError&) {
    // A consequence of a reported error: the position is still not what the program intended.
    canon.mark_position_uncertain();
  } catch (const program::BadGeometry& input_error) {
    // An arc with a wrong centre leaves the axes at its programmed end, so the position stays
    // certain.
    if (!input_error.is_uncertain) input_errors_.add(input_error);
  } catch (const BadInput& input_error) {
    input_errors_.add(input_error);
    canon.mark_position_uncertain();
  }
  return false;
}

void ProgramRun::require_certain(const std::string& name, const program::Cause& cause) const {
  if (uncertain_names_.empty() || !uncertain_names_.contains(name)) return;
  const program::NcLocation location = canon.place();
  throw program::FollowingError(location.file, location.line, cause.column,
                                name + " defined without an input error",
                                "a definition with an input error");
}

void ProgramRun::refuse_once(const std::string& name, const program::Cause& cause,
                             std::string expected, std::optional<std::string> seen) {
  // From the second use on `require_certain` throws an error that is not reported.
  require_certain(name, cause);
  mark_uncertain(name);
  canon.throw_input_error(cause, std::move(expected), std::move(seen));
}

void ProgramRun::run_startup_code(const std::function<void(std::string_view)>& block) {
  if (options_.startup_code.empty()) return;
  // The startup code is a file of its own, so that messages do not point into the program.
  canon.set_line(1, canon.add_file("program.startup_code"));
  try_block([&] { block(options_.startup_code); });
}

bool has_words(std::string_view line) {
  int depth = 0;
  for (std::size_t at = 0; at < line.size(); ++at) {
    const char c = line[at];
    if (c == '(') ++depth;
    if (c == ')') depth = std::max(0, depth - 1);
    // Brackets inside a comment may nest; an unmatched ) does not hide the words after it.
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
  if (canon.kept() >= path_segment_blocks) emit_segment();
  if (options_.progress && block_count_ % blocks_between_reports == 0 && line_count_ > 0)
    options_.progress(std::min(1.0, double(canon.line()) / double(line_count_)));
  if (++block_count_ <= options_.limits.blocks) return;
  const program::NcLocation location = canon.place();
  throw ProgramLimitExceeded(
      location.file, location.line, 0,
      fmt::format("at most {} blocks executed (max_moves)", options_.limits.blocks),
      "more: an infinite loop or too many repeats");
}

void ProgramRun::check_moves(double move_count, const program::Cause& cause) const {
  canon.check_moves(move_count, cause);
  // Memory is checked only if the moves are kept.
  if (!options_.on_path_segment) canon.check_memory(move_count, cause);
}

void ProgramRun::throw_variable_limit(const program::NcLocation& location, const char* noun) const {
  throw ProgramLimitExceeded(location.file, location.line, 0,
                             fmt::format("at most {} {}", options_.limits.variables, noun), "more");
}

void ProgramRun::check_depth(int depth, const program::Cause& cause, const char* what) const {
  if (depth <= options_.limits.call_depth) return;
  const program::NcLocation location = canon.place();
  throw ProgramLimitExceeded(location.file, location.line, cause.column,
                             fmt::format("at most {} nested {}", options_.limits.call_depth, what),
                             "more: " + shown(cause.text));
}

void ProgramRun::handle_unknown_word(const program::Cause& word, const std::string& expected) {
  if (options_.on_unknown == UnknownWordPolicy::Refuse) canon.throw_input_error(word, expected);
  const auto entry =
      std::find_if(skipped_words_.begin(), skipped_words_.end(),
                   [&](const SkippedWord& skipped_word) { return skipped_word.word == word.text; });
  if (entry != skipped_words_.end()) {
    ++entry->count;
    return;
  }
  if (skipped_words_.size() == max_skipped) {
    const program::NcLocation location = canon.place();
    throw ProgramLimitExceeded(location.file, location.line, word.column,
                               "at most 1000 different unknown words", shown(word.text));
  }
  skipped_words_.push_back({std::string(word.text.substr(0, 40)), 1, canon.line()});
}

bool ProgramRun::skips_block(int level) {
  const bool skipped = options_.control.block_skip.test(std::size_t(level));
  // Both counts are reported as assumptions, as the state of the operator's switch is unknown.
  BlockSkipCount& blocks = skipped ? skipped_blocks_ : executed_blocks_;
  if (blocks.count++ == 0)
    blocks = {1, canon.line(), canon.file() > 0 ? canon.place().file : std::string()};
  return skipped;
}

void ProgramRun::assume_mode(StartMode mode, std::string_view assumed_state) {
  AssumedMode& assumed_mode = assumed_modes_[std::size_t(mode)];
  if (assumed_mode.is_stated) return;
  // From here on the mode counts as stated, so that it is reported once.
  assumed_mode = {assumed_state, true};
  if (first_assumption_line_ == 0) first_assumption_line_ = canon.line();
}

void ProgramRun::assume_offset(int system, std::string_view assumed_state) {
  const kinematics::AxisVector& offset = program::work_offset(canon.options(), system);
  // An offset of zero makes no difference, so nothing has been assumed.
  if (offset.size() > 0 && !offset.isZero(0.0)) assume_mode(StartMode::WorkOffset, assumed_state);
}

int ProgramRun::assume_only_tool(const program::Cause& cause,
                                 const std::string& missing_statement) {
  const auto tool = program::only_tool(canon.options());
  if (!tool) canon.throw_input_error(cause, "a tool call before it", missing_statement);
  canon.assume(
      {missing_statement + ": the only tool is assumed", "program.startup_code", "--startup-code"});
  return *tool;
}

void ProgramRun::report_assumptions() {
  const auto add_assumption = [&](const BlockSkipCount& skip_count, const char* text) {
    if (skip_count.count > 0)
      canon.assume({fmt::format("{} {} after / {}", skip_count.count,
                                skip_count.count == 1 ? "block" : "blocks", text),
                    "program.block_skip", "--block-skip", skip_count.line, skip_count.file});
  };
  add_assumption(skipped_blocks_, "left out: block skip is on");
  add_assumption(executed_blocks_, "executed: block skip is off");
  std::string assumed_state;
  for (const AssumedMode& mode : assumed_modes_)
    if (!mode.assumed_state.empty())
      assumed_state += (assumed_state.empty() ? "" : ", ") + std::string(mode.assumed_state);
  if (!assumed_state.empty())
    canon.assume({"no earlier word states otherwise: " + assumed_state, "program.startup_code",
                  "--startup-code", first_assumption_line_});
}

void ProgramRun::warn_of_unread_lines(const std::vector<std::string_view>& lines,
                                      const std::vector<Section>& sections) {
  const auto was_read = [&](std::size_t i) {
    return i + 1 < line_was_read_.size() && line_was_read_[i + 1];
  };
  std::size_t last_read_line = lines.size();  // in the section
  const auto find_last_read = [&](const Section& section) {
    last_read_line = section.end;
    for (std::size_t i = section.first; i < section.end; ++i)
      if (was_read(i)) last_read_line = i;
    return last_read_line < section.end;
  };
  const std::size_t end = std::size_t(std::max(canon.line(), 1)) - 1;
  std::size_t first_unread_line = lines.size(), count = 0;
  for (const Section& section : sections) {
    // A section other than the one where reading ended is reported only if none of its lines was
    // read: a subprogram may end before its last line.
    const bool ends_reading = canon.file() == 0 && end >= section.first && end < section.end;
    const bool has_read_lines = find_last_read(section);
    if (has_read_lines && !ends_reading) continue;
    for (std::size_t i = has_read_lines ? last_read_line + 1 : section.first; i < section.end;
         ++i) {
      if (!has_words(lines[i])) continue;
      first_unread_line = std::min(first_unread_line, i);
      ++count;
    }
  }
  if (count == 0) return;
  warn_once(fmt::format(
      "{}:{}: {} from {} on {} not read: the program ends {}", file_, first_unread_line + 1,
      count == 1 ? "the line" : fmt::format("{} lines", count),
      quoted_excerpt(lines[first_unread_line]), count == 1 ? "is" : "are",
      canon.file() == 0 ? fmt::format("on line {}", end + 1) : "in " + canon.place().file));
}

void ProgramRun::warn_once(const std::string& text) {
  if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(text);
}

}  // namespace abbe::sim::dialects
