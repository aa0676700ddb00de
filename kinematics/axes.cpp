#include "kinematics/axes.h"

#include <stdexcept>

namespace abbe::kinematics {

namespace {

// A control character in a message would act on the terminal, so it is given as its code.
std::string quoted(char c) {
  if (c >= ' ' && c <= '~') return {'\'', c, '\''};
  return "a character of code " + std::to_string(int(static_cast<unsigned char>(c)));
}

[[noreturn]] void refuse(const std::string& expected, const std::string& seen) {
  throw std::invalid_argument("structural code: expected " + expected + ", seen " + seen);
}

// Letters of ISO 841, in upper case; the spindle nose is a lower-case s.
constexpr std::string_view axis_letters = "XYZUVWABCS";

}  // namespace

Topology parse_structural_code(std::string_view code) {
  std::string marks;
  for (const char c : code)
    if (c != ' ' && c != '\t') marks += c;
  if (marks.empty()) refuse("w first", "nothing");
  if (marks.front() != 'w') refuse("w first", quoted(marks.front()));
  if (marks.size() < 2 || marks.back() != 't') refuse("t last", quoted(marks.back()));

  Topology topology;
  bool is_past_bed = false;
  for (std::size_t i = 1; i + 1 < marks.size(); ++i) {
    const char c = marks[i];
    if (c == 'b') {
      if (is_past_bed) refuse("one b", "a second");
      is_past_bed = true;
      continue;
    }
    const bool nose = c == 's';
    if (!nose && axis_letters.find(c) == std::string_view::npos)
      refuse("an axis letter of " + std::string(axis_letters) + ", b or s", quoted(c));
    // A prime stands after its letter, so the letter is judged with the character that follows it.
    const bool primed = marks[i + 1] == '\'';
    if (nose && (!is_past_bed || i + 2 != marks.size())) refuse("s right before t", "it elsewhere");
    if (!is_past_bed && !primed)
      refuse("a prime after " + quoted(c) + ", which carries the workpiece", "none");
    if (is_past_bed && primed)
      refuse("no prime after " + quoted(c) + ", which carries the tool", "one");
    for (const CodeAxis& axis : topology)
      if (axis.name == c) refuse("every letter once", quoted(c) + " twice");
    topology.push_back({c, is_past_bed ? Side::Tool : Side::Workpiece});
    if (primed) ++i;
  }
  if (!is_past_bed) refuse("b for the bed", "none");
  if (topology.size() > std::size_t(max_joints))
    refuse("at most " + std::to_string(max_joints) + " joints", std::to_string(topology.size()));
  return topology;
}

std::string to_string(const Topology& topology) {
  std::string code = "w";
  bool is_past_bed = false;
  for (const CodeAxis& axis : topology) {
    if (axis.side == Side::Tool && !is_past_bed) {
      code += " b";
      is_past_bed = true;
    }
    code += std::string(" ") + axis.name + (axis.side == Side::Workpiece ? "'" : "");
  }
  return code + (is_past_bed ? " t" : " b t");
}

BodyArray low_order_body_array(const Topology& topology) {
  BodyArray array;
  int parent = 0;
  const auto add = [&](std::string body) {
    array.body.push_back(std::move(body));
    array.parent.push_back(parent);
    parent = int(array.body.size());
  };
  // The structural code lists the workpiece side towards the bed, so it is walked backwards.
  for (auto axis = topology.rbegin(); axis != topology.rend(); ++axis)
    if (axis->side == Side::Workpiece) add(std::string(1, axis->name));
  add("workpiece");
  parent = 0;
  for (const CodeAxis& axis : topology)
    if (axis.side == Side::Tool) add(std::string(1, axis.name));
  add("tool");
  return array;
}

}  // namespace abbe::kinematics
