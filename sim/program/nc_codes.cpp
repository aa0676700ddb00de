#include "sim/program/nc_codes.h"

#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "kinematics/text.h"

namespace abbe::sim::program {
namespace {

// by CodeGroup
constexpr std::string_view group_names[] = {"that holds for one block (G4 G53)",
                                            "of arc centres (G90.1 G91.1)",
                                            "of cutter radius (G40)",
                                            "of distances (G90 G91)",
                                            "of feed (G93 G94)",
                                            "of motion (G0 G1 G2 G3 G80)",
                                            "of the plane (G17 G18 G19)",
                                            "of tool length (G43 G43.4 G49)",
                                            "of units (G20 G21)",
                                            "of work offset (G54 ... G59)",
                                            "that stops (M0 M1 M2 M30)",
                                            "of the spindle (M3 M4 M5)",
                                            "of tool change (M6)",
                                            "of coolant (M7 M8 M9)"};

/// @param code  tenths of the number
std::optional<CodeGroup> g_group(int code) {
  switch (code) {
    case 40:
    case 530:
      return CodeGroup::OneBlock;
    case 901:
    case 911:
      return CodeGroup::ArcDistance;
    case 400:
      return CodeGroup::CutterRadius;
    case 900:
    case 910:
      return CodeGroup::Distance;
    case 930:
    case 940:
      return CodeGroup::FeedMode;
    case 0:
    case 10:
    case 20:
    case 30:
    case 800:
      return CodeGroup::Motion;
    case 170:
    case 180:
    case 190:
      return CodeGroup::Plane;
    case 430:
    case 434:
    case 490:
      return CodeGroup::ToolLength;
    case 200:
    case 210:
      return CodeGroup::Units;
    case 540:
    case 550:
    case 560:
    case 570:
    case 580:
    case 590:
      return CodeGroup::WorkOffset;
    default:
      return std::nullopt;
  }
}

std::optional<CodeGroup> m_group(int code) {
  switch (code) {
    case 0:
    case 10:
    case 20:
    case 300:
      return CodeGroup::Stop;
    case 30:
    case 40:
    case 50:
      return CodeGroup::Spindle;
    case 60:
      return CodeGroup::ToolChange;
    case 70:
    case 80:
    case 90:
      return CodeGroup::Coolant;
    default:
      return std::nullopt;
  }
}

constexpr std::string_view g_codes =
    "a G code of this control (G0 G1 G2 G3 G4 G17 G18 G19 G20 G21 G40 G43 G43.4 G49 G53 G54 ... "
    "G59 G80 G90 G90.1 G91 G91.1 G93 G94)";
constexpr std::string_view m_codes =
    "an M code of this control (M0 M1 M2 M3 M4 M5 M6 M7 M8 M9 M30)";

/// Tenths of a code's number, -1 where it has more digits than codes have.
int tenths_of(const NcWord& word) {
  const double tenths = word.value * 10;
  const bool is_code = tenths >= 0 && tenths < 2000 && std::abs(tenths - std::round(tenths)) < 1e-9;
  return is_code ? int(std::lround(tenths)) : -1;
}

}  // namespace

Codes codes_of(const NcBlock& block, const NcPlace& place) {
  Codes codes;
  const auto put = [&](const NcWord& word, std::optional<CodeGroup> group, std::string_view known) {
    if (!group) refuse(place, word, std::string(known));
    Codes::Code& code = codes.by_group[std::size_t(*group)];
    if (code)
      refuse(place, word, fmt::format("one code in a block {}", group_names[std::size_t(*group)]),
             fmt::format("{} after {}", shown(word.text), shown(code.word.text)));
    code = {tenths_of(word), word};
  };
  for (const NcWord& word : block.g) put(word, g_group(tenths_of(word)), g_codes);
  for (const NcWord& word : block.m) put(word, m_group(tenths_of(word)), m_codes);
  return codes;
}

}  // namespace abbe::sim::program
