#include "sim/dialects/program_run.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/program/arc_move.h"

namespace abbe::sim::dialects {

namespace {
constexpr std::size_t most_skipped = 1000;  // different words
constexpr std::size_t blocks_between_reports = 8192;
}  // namespace

ProgramRun::ProgramRun(const std::string& file, const ReadOptions& options, std::size_t lines)
    : canon(file, options.control), options_(options), lines_(lines) {}

void ProgramRun::hand_over() {
  if (!options_.each_piece) return;
  program::Path piece = canon.hand_over();
  if (faults_.empty()) options_.each_piece(std::move(piece));
}

bool ProgramRun::attempt(const std::function<void()>& block) {
  try {
    block();
    return true;
  } catch (const Exhausted& fault) {
    faults_.add(fault);
    hopeless_ = true;
  } catch (const program::BadGeometry& fault) {
    if (!fault.in_doubt) faults_.add(fault);
  } catch (const BadInput& fault) {
    faults_.add(fault);
    canon.doubt_position();
  }
  return false;
}

void ProgramRun::count_block() {
  if (canon.kept() >= piece_blocks) hand_over();
  if (options_.progress && blocks_ % blocks_between_reports == 0 && lines_ > 0)
    options_.progress(std::min(1.0, double(canon.line()) / double(lines_)));
  if (++blocks_ <= options_.limits.blocks) return;
  const program::NcPlace place = canon.place();
  throw Exhausted(place.file, place.line, 0,
                  fmt::format("at most {} blocks executed", options_.limits.blocks),
                  "more: a loop without end, or too many repeats");
}

void ProgramRun::check_depth(int depth, const program::Cause& cause) const {
  if (depth <= options_.limits.depth) return;
  const program::NcPlace place = canon.place();
  throw Exhausted(place.file, place.line, cause.column,
                  fmt::format("at most {} calls within each other", options_.limits.depth),
                  "more: " + shown(cause.text));
}

void ProgramRun::unknown(const program::Cause& word, const std::string& expected) {
  if (options_.on_unknown == OnUnknown::Refuse) canon.refuse(word, expected);
  const auto known = std::find_if(skipped_.begin(), skipped_.end(),
                                  [&](const Skipped& one) { return one.word == word.text; });
  if (known != skipped_.end()) {
    ++known->count;
    return;
  }
  if (skipped_.size() == most_skipped) {
    const program::NcPlace place = canon.place();
    throw Exhausted(place.file, place.line, word.column, "at most 1000 different unknown words",
                    shown(word.text));
  }
  skipped_.push_back({std::string(word.text.substr(0, 40)), 1, canon.line()});
}

void ProgramRun::warn_once(const std::string& text) {
  if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(text);
}

}  // namespace abbe::sim::dialects
