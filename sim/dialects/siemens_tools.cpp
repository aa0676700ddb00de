#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens_machine.h"
#include "sim/dialects/turning_tool.h"

namespace abbe::sim::dialects::siemens {

using kinematics::AxisVector;
using kinematics::Chain;

/// A tool of the scene: by its number, by its name, or the only one.
int Machine::number_of_tool(const Block& block) const {
  const Value& word = block[Address::T];
  if (!block.tool_name) return int(word.value);
  const std::string& name = *block.tool_name;
  const auto& numbers = canon_.options().tool_number;
  if (const auto known = numbers.find(name); known != numbers.end()) return known->second;
  if (!name.empty() && name.size() < 9 && std::all_of(name.begin(), name.end(), is_digit))
    return std::stoi(name);
  if (canon_.options().control_of_h.empty() && !canon_.options().tool_length.empty() &&
      !canon_.options().tool_table) {
    canon_.assume({fmt::format("T={} is the scene's only tool", in_quotes(name)), "tool.name"});
    return canon_.options().tool_length.begin()->first;
  }
  std::string known;
  for (const auto& [one, number] : numbers) known += (known.empty() ? "" : ", ") + in_quotes(one);
  refuse(word, "the name of a tool of the scene (" + (known.empty() ? "none has one" : known) + ")",
         in_quotes(name));
}

void Machine::call_tools(const Block& block) {
  const Value &t = block[Address::T], &d = block[Address::D];
  const Code& change = block[Group::ToolChange];
  if (t) selected_ = number_of_tool(block);
  if (t && !program::knows_tool(canon_.options(), selected_))
    refuse(t.cause, "a tool of the tool table");
  const bool changes = change || (t && !changes_by_m6_);
  if (changes && selected_ >= 0) tool_ = selected_;
  if (t || change) canon_.call_tool(t ? double(selected_) : -1.0, bool(change));
  std::string text = t ? fmt::format("T{}", selected_) : "";
  if (change) text += text.empty() ? "M6" : " M6";
  if (!text.empty()) canon_.aside(std::move(text));
  if (!changes && !d) return;
  compensation_.left_behind();  // a control looks again where its axes stand
  if (changes) length_counts_ = true;
  if (d) length_counts_ = d.value != 0;
  if (changes && tool_ == 0) length_counts_ = false;
  if (tool_ >= 0)
    canon_.call_length(length_counts_ ? tool_ : -1, t ? t.cause : change ? change.cause : d.cause);
  apply_tool();
}

/// Whatever tool is in the spindle, there is one length.
bool Machine::one_length() const {
  const auto& lengths = canon_.options().tool_length;
  return !lengths.empty() && canon_.options().control_of_h.empty() &&
         !canon_.options().tool_table &&
         std::all_of(lengths.begin(), lengths.end(),
                     [&](const auto& one) { return one.second == lengths.begin()->second; });
}

double Machine::length_of_tool(const Cause& cause) const {
  const auto& lengths = canon_.options().tool_length;
  const auto own = lengths.find(tool_);
  if (own != lengths.end()) return own->second;
  if (one_length()) return lengths.begin()->second;
  std::string known;
  for (const auto& [number, mm] : lengths) known += fmt::format(" T{}", number);
  refuse(cause,
         "a tool whose length is known (" + (known.empty() ? "none is" : known.substr(1)) +
             ") in the spindle",
         tool_ < 0 ? "none called" : fmt::format("T{}", tool_));
}

std::optional<double> Machine::nose_radius(int tool) const {
  const auto& radii = canon_.options().tool_radius;
  auto own = radii.find(tool);
  if (own == radii.end())
    if (const auto only = program::only_tool(canon_.options())) own = radii.find(*only);
  return own == radii.end() ? std::nullopt : std::optional(own->second);
}

/// mm, from the point of a turning tool that X Z lead to the centre of its nose.
AxisVector Machine::nose_from_led_tip() const {
  return nose_from_tip(canon_, run_.turning() ? run_.options().turning.tip : 0, nose_radius(tool_));
}

void Machine::set_compensation(const Code& code) {
  if (code.word == "G40") {
    if (!compensation_.on()) return;
    compensation_.end();
    if (!run_.turning()) return;
    apply_tool();
    return compensation_.shift_programmed(nose_from_led_tip());
  }
  const bool left = code.word == "G41";
  if (compensation_.on()) return;
  if (!length_counts_) refuse(code.cause, "D1 before " + shown(code.cause.text));
  const Plane in = plane(code.cause);
  const Eigen::Matrix3d R = total_rotation();
  const int across = plane_ == 17 ? 2 : plane_ == 18 ? 1 : 0;
  if (std::abs(R(across, across) - 1.0) > 1e-14)
    refuse(code.cause, "a path of the tool's centre in a plane that is tilted: no " +
                           std::string(code.word) + " in it");
  const int tool =
      tool_ >= 0 ? tool_ : run_.uncalled_tool(code.cause, "no tool called");
  const auto radius = nose_radius(tool);
  if (!radius) refuse(code.cause, "a tool whose radius is known", fmt::format("T{}", tool));
  compensation_.begin(left, *radius, {in.first, in.second});
  if (!run_.turning()) return;
  apply_tool();  // G41 and G42 lead the centre of the nose beside the contour
  compensation_.shift_programmed(-nose_from_led_tip());
}

/// On a machine with rotary axes the length of a tool is that of its chain, on a turning control it
/// is measured so that X Z lead its tip, else it is added to Z.
void Machine::apply_tool() {
  canon_.set_tool_shift(tip_mode() ? AxisVector() : shift_of_tool());
  apply_frame();
}

AxisVector Machine::shift_of_tool() const {
  if (run_.turning()) {
    const Chain* to_tip = chain_to_tip(canon_.options(), tool_);
    if (to_tip == nullptr || !length_counts_ || !knows_tool()) return {};
    AxisVector measured = measured_offset(canon_, *to_tip, {1, {}});
    if (!compensation_.on()) measured += nose_from_led_tip();
    return measured;
  }
  AxisVector shift = AxisVector::Zero(canon_.position().size());
  const auto& zero = canon_.zero();
  if (zero && zero->places && turning_.possible()) {
    const auto& options = canon_.options();
    const auto own = options.control_of_h.find(tool_);
    const Chain& chain = own == options.control_of_h.end() ? *options.control : own->second;
    const auto tip_w = program::tip_at_zero(chain);
    if (!tip_w || (!length_counts_ && knows_tool())) return {};
    for (int k = 0; k < 3; ++k) shift[joint(k)] = zero->nose_w[k] - (*tip_w)[k];
    return shift;
  }
  const int z = joint(2);
  if (z < 0 || turning_.possible() || !length_counts_ || !knows_tool()) return {};
  shift[z] = length_of_tool({1, {}});
  return shift;
}

}  // namespace abbe::sim::dialects::siemens
