#include "sim/program/nc_notes.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/units.h"

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

void NcNotes::note_comments(const NcBlock& block) {
  for (const std::string_view text : block.comments) {
    auto words = tool_words(text);
    if (!words) continue;
    if (!words->unit_mm && !path_.unit_words.empty())
      words->unit_mm = unit_of(path_.unit_words.back());
    if (words->unit_mm) words = in_mm(*words, *words->unit_mm);
    path_.tool_comments.push_back({block.line, std::string(text), *words, path_.blocks.size()});
  }
}

void NcNotes::note_unit(const NcBlock& block, const Codes& codes) {
  const Codes::Code& code = codes[CodeGroup::Units];
  if (!code) return;
  const UnitWord word{block.line, code.tenths == 200};
  if (!path_.unit_words.empty() && path_.unit_words.back().inch == word.inch) return;
  path_.unit_words.push_back(word);
  for (ToolComment& comment : path_.tool_comments)
    if (!comment.words.unit_mm) comment.words = in_mm(comment.words, unit_of(word));
}

void NcNotes::note_tool(const NcBlock& block, const Codes& codes) {
  if (block['T']) tool_ = int(std::min(block['T'].value, 1e9));
  const bool changes = bool(codes[CodeGroup::ToolChange]);
  if (block['T'] || changes)
    path_.tool_calls.push_back({block.line, tool_, changes, path_.blocks.size()});
}

void NcNotes::note_before_motion(const NcBlock& block, const Codes& codes) {
  note_unit(block, codes);
  note_tool(block, codes);
  std::string text = block['T'] ? fmt::format("T{:.0f}", block['T'].value) : "";
  for (const CodeGroup group : {CodeGroup::ToolChange, CodeGroup::Coolant})
    if (const Codes::Code& code = codes[group]; code && code.tenths != 90)
      text += fmt::format("{}M{}", text.empty() ? "" : " ", code.tenths / 10);
  if (!text.empty()) path_.asides.push_back({path_.blocks.size(), std::move(text)});
}

void NcNotes::note_after_motion(const Codes& codes) {
  const Codes::Code &stop = codes[CodeGroup::Stop], &coolant = codes[CodeGroup::Coolant];
  if (coolant && coolant.tenths == 90) path_.asides.push_back({path_.blocks.size(), "M9"});
  if (stop && stop.tenths <= 10)
    path_.asides.push_back({path_.blocks.size(), fmt::format("M{}", stop.tenths / 10)});
}

}  // namespace abbe::sim::program
