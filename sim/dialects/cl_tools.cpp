#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "sim/dialects/cl_machine.h"

namespace abbe::sim::dialects::cl {

using program::ToolWords;

namespace {

constexpr int most_tool = 1'000'000;
constexpr double most_rpm = 1e7;

/// What stands beside a tool's number and moves nothing: the point is the tip whatever its length.
constexpr std::array<std::string_view, 13> beside_tools = {
    "LENGTH", "OSETNO", "ADJUST", "RADIUS", "MANUAL", "AUTO",  "HOLDER",
    "MINUS",  "PLUS",   "LARGE",  "SMALL",  "CLW",    "MAGAZN"};

template <typename List>
bool is_one_of(const Item& item, const List& list) {
  return std::any_of(list.begin(), list.end(),
                     [&](std::string_view word) { return item.is(word); });
}

}  // namespace

/// LOADTL/n, LENGTH,l,OSETNO,k ...
void Machine::load_tool(const Statement& s) {
  if (s.items.empty()) refuse(s.cause, "the number of a tool behind LOADTL/", "none");
  const int tool = whole(s.items.front(), most_tool, "the number of a tool");
  for (std::size_t i = 1; i < s.items.size(); ++i)
    if (!s.items[i].number && !is_one_of(s.items[i], beside_tools))
      unknown(s, s.items[i], "LENGTH, OSETNO, ADJUST, RADIUS, MANUAL, AUTO or HOLDER");
  canon_.call_tool(tool, true);
  canon_.aside(fmt::format("T{} M6", tool));
  const auto& lengths = canon_.options().tool_length;
  tool_ = tool;
  if (canon_.options().control_of_h.empty() && !lengths.count(tool) && !lengths.empty())
    tool_ = lengths.begin()->first;
  canon_.call_length(tool_, s.cause);
}

/// LOAD/TOOL,n ...
void Machine::load(const Statement& s) {
  if (s.items.size() < 2 || !s.items.front().is("TOOL")) refuse(s.cause, "LOAD/TOOL and a number");
  Statement rest = s;
  rest.items.erase(rest.items.begin());
  load_tool(rest);
}

/// SELECT/TOOL,n and SELCTL/n: of the magazine, for the next change.
void Machine::select(const Statement& s) {
  const std::size_t i = !s.items.empty() && s.items.front().is("TOOL") ? 1 : 0;
  if (i >= s.items.size()) refuse(s.cause, "the number of a tool", "none");
  const int tool = whole(s.items[i], most_tool, "the number of a tool");
  canon_.call_tool(tool, false);
  canon_.aside(fmt::format("T{}", tool));
}

/// SPINDL/1000,RPM,CLW, SPINDL/RPM,1000,CLW, SPINDL/ON, SPINDL/OFF.
void Machine::spindle(const Statement& s) {
  int turns = spindle_turns_;
  for (std::size_t i = 0; i < s.items.size(); ++i) {
    const Item& item = s.items[i];
    const auto skip_value = [&] { i += i + 1 < s.items.size() && s.items[i + 1].number; };
    if (item.number) {
      if (!(*item.number >= 0 && *item.number <= most_rpm))
        refuse(item, "a spindle speed of 0 to 1e7 rpm");
      speed_rpm_ = *item.number;
    } else if (item.is("CLW") || item.is("CCLW")) {
      turns = spindle_turns_ = item.is("CLW") ? 1 : -1;
    } else if (item.is("OFF") || item.is("STOP")) {
      turns = 0;
    } else if (item.is("SFM") || item.is("SMM") || item.is("SFPM")) {
      refuse(item, "a speed in RPM: surface speeds are not read");
    } else if (item.is("RANGE") || item.is("MAXRPM")) {
      skip_value();
    } else if (item.is("ORIENT")) {
      return;
    } else if (!item.is("RPM") && !item.is("ON") && !item.is("LOW") && !item.is("MEDIUM") &&
               !item.is("HIGH")) {
      unknown(s, item, "RPM, CLW, CCLW, ON, OFF, RANGE or ORIENT");
    }
  }
  if (s.items.empty()) refuse(s.cause, "a speed, ON or OFF behind SPINDL/", "none");
  canon_.set_spindle_speed(speed_rpm_);
  canon_.turn_spindle(turns);
}

void Machine::coolant(const Statement& s) {
  if (s.items.empty()) refuse(s.cause, "ON, OFF, FLOOD, MIST or another coolant", "none");
  const Item& item = s.items.front();
  canon_.aside(item.is("OFF") ? "M9" : item.is("MIST") ? "M7" : "M8");
}

/// CUTTER/diameter,corner radius ...
void Machine::cutter(const Statement& s) {
  ToolWords words;
  words.diameter = number(s, 0, "the diameter of a cutter") * unit();
  words.unit_mm = unit();
  if (s.items.size() > 1) words.corner_radius = number(s, 1, "its corner radius") * unit();
  if (words.diameter > 0) canon_.cutter("CUTTER/", words);
}

/// TLDATA/MILL,diameter,corner radius ...; of other tools nothing is taken.
void Machine::tool_data(const Statement& s) {
  if (s.items.empty() || !s.items.front().is("MILL")) return;
  ToolWords words;
  words.diameter = number(s, 1, "the diameter of a cutter") * unit();
  words.unit_mm = unit();
  if (s.items.size() > 2) words.corner_radius = number(s, 2, "its corner radius") * unit();
  if (words.diameter > 0) canon_.cutter("TLDATA/MILL", words);
}

}  // namespace abbe::sim::dialects::cl
