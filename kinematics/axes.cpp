#include "kinematics/axes.h"

#include <stdexcept>

namespace abbe::kinematics {

namespace {

// A control character in a message would act on the terminal, so its code is shown instead.
std::string quoted(char c) {
  if (c >= ' ' && c <= '~') return {'\'', c, '\''};
  return "a character of code " + std::to_string(int(static_cast<unsigned char>(c)));
}

[[noreturn]] void throw_code_error(const std::string& expected, const std::string& seen) {
  throw std::invalid_argument("structural code: expected " + expected + ", seen " + seen);
}

// Letters of ISO 841, in upper case; the spindle nose is a lower-case s.
constexpr std::string_view axis_letters = "XYZUVWABCS";

}  // namespace

Topology parse_structural_code(std::string_view code) {
  std::string symbols;
  for (const char c : code)
    if (c != ' ' && c != '\t') symbols += c;
  if (symbols.empty()) throw_code_error("w as the first letter", "nothing");
  if (symbols.front() != 'w') throw_code_error("w as the first letter", quoted(symbols.front()));
  if (symbols.size() < 2 || symbols.back() != 't')
    throw_code_error("t as the last letter", quoted(symbols.back()));

  Topology topology;
  bool is_past_bed = false;
  for (std::size_t i = 1; i + 1 < symbols.size(); ++i) {
    const char c = symbols[i];
    if (c == 'b') {
      if (is_past_bed) throw_code_error("only one b", "a second b");
      is_past_bed = true;
      continue;
    }
    const bool is_nose = c == 's';
    if (!is_nose && axis_letters.find(c) == std::string_view::npos)
      throw_code_error("an axis letter of " + std::string(axis_letters) + ", b or s", quoted(c));
    // A prime stands after its letter, so the letter is judged with the character that follows it.
    const bool is_primed = symbols[i + 1] == '\'';
    if (is_nose && (!is_past_bed || i + 2 != symbols.size()))
      throw_code_error("s directly before t", "s elsewhere");
    if (!is_past_bed && !is_primed)
      throw_code_error("a prime after " + quoted(c) + ", which carries the workpiece", "no prime");
    if (is_past_bed && is_primed)
      throw_code_error("no prime after " + quoted(c) + ", which carries the tool", "a prime");
    for (const CodeAxis& axis : topology)
      if (axis.name == c) throw_code_error("each letter only once", quoted(c) + " twice");
    topology.push_back({c, is_past_bed ? Side::Tool : Side::Workpiece});
    if (is_primed) ++i;
  }
  if (!is_past_bed) throw_code_error("b for the bed", "no b");
  if (topology.size() > std::size_t(max_joints))
    throw_code_error("at most " + std::to_string(max_joints) + " joints",
                     std::to_string(topology.size()));
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
