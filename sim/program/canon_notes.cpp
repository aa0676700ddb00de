#include <algorithm>
#include <utility>

#include "kinematics/units.h"
#include "sim/program/canon.h"

namespace abbe::sim::program {
namespace {

ToolWords in_mm(ToolWords words, double unit_mm) {
  words.diameter *= unit_mm;
  if (words.corner_radius) *words.corner_radius *= unit_mm;
  words.unit_mm = unit_mm;
  return words;
}

double unit_of(const UnitWord& word) { return word.inch ? units::inch : 1.0; }

}  // namespace

void Canon::comment(std::string_view text) {
  auto words = tool_words(text);
  if (!words) return;
  if (!words->unit_mm && !path_.unit_words.empty())
    words->unit_mm = unit_of(path_.unit_words.back());
  if (words->unit_mm) words = in_mm(*words, *words->unit_mm);
  path_.tool_comments.push_back({line_, std::string(text), *words, blocks()});
}

void Canon::assume(Assumption assumption) {
  const auto same = [&](const Assumption& known) { return known.text == assumption.text; };
  if (std::any_of(path_.assumptions.begin(), path_.assumptions.end(), same)) return;
  if (assumption.line == 0) {
    assumption.line = line_;
    if (file_ > 0) assumption.file = file_name();
  }
  path_.assumptions.push_back(std::move(assumption));
}

void Canon::cutter(std::string_view word, const ToolWords& words) {
  path_.tool_comments.push_back({line_, std::string(word), words, blocks()});
}

void Canon::set_inch(bool inch) {
  inch_ = inch;
  if (!path_.unit_words.empty() && path_.unit_words.back().inch == inch) return;
  const UnitWord word{line_, inch};
  path_.unit_words.push_back(word);
  for (ToolComment& comment : path_.tool_comments)
    if (!comment.words.unit_mm) comment.words = in_mm(comment.words, unit_of(word));
}

void Canon::call_tool(double number, bool changes) {
  if (number >= 0) tool_ = int(std::min(number, 1e9));
  path_.tool_calls.push_back({line_, tool_, changes, blocks()});
}

Path Canon::hand_over() {
  Path piece;
  piece.file = path_.file;
  piece.more_files = path_.more_files;
  piece.motion_blocks = std::exchange(path_.motion_blocks, 0);
  piece.asides.swap(path_.asides);
  for (Aside& aside : piece.asides) aside.before -= handed_over_;
  handed_over_ += path_.blocks.size();
  piece.blocks.swap(path_.blocks);
  piece.arcs.swap(path_.arcs);
  piece.turns.swap(path_.turns);
  return piece;
}

void Canon::aside(std::string text) { path_.asides.push_back({blocks(), std::move(text)}); }

}  // namespace abbe::sim::program
