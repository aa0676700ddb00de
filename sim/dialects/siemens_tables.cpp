#include "sim/dialects/siemens_tables.h"

#include <array>
#include <map>
#include <string_view>
#include <vector>

#include <fmt/format.h>

namespace abbe::sim::dialects {

namespace {

/// Values of a tool as the file has them, until all are known: the radius and length are sums.
struct EdgeParts {
  double length = 0.0, wear = 0.0, base = 0.0, radius = 0.0, radius_wear = 0.0;
  std::string name;
  int line = 0;
  bool edge = false;  // a $TC_DP of its first cutting edge
};
using Edges = std::map<int, EdgeParts>;

/// What stands before an =.
struct Assigned {
  std::string name;                // $TC_DP3
  std::vector<std::string> index;  // 1, X, TR
  std::size_t from = 0;
};

Assigned assigned_in(Cursor& line) {
  Assigned to{{}, {}, line.at};
  while (!line.at_end() && line.here() != '[' && line.here() != '=' && !is_blank(line.here()))
    to.name += upper(line.text[line.at++]);
  line.skip_blanks();
  if (line.here() == '[') {
    const std::size_t close = line.text.find(']', line.at);
    if (close == std::string_view::npos) line.refuse(line.at, "a ] that closes the index");
    to.index.emplace_back();
    for (++line.at; line.at < close; ++line.at) {
      const char c = line.here();
      if (c == ',')
        to.index.emplace_back();
      else if (!is_blank(c))
        to.index.back() += upper(c);
    }
    line.at = close + 1;
  }
  line.skip_blanks();
  if (line.here() != '=') line.refuse(line.at, "= behind " + to.name);
  ++line.at;
  return to;
}

int table_index(const Assigned& to, std::size_t i, int most, const Cursor& line) {
  const std::string& text = i < to.index.size() ? to.index[i] : std::string();
  int value = -1;
  if (!text.empty() && text.size() <= 8 &&
      text.find_first_not_of("0123456789") == std::string::npos)
    value = std::stoi(text);
  if (value < 0 || value > most)
    line.refuse(to.from, fmt::format("an index from 0 to {} in {}", most, to.name));
  return value;
}

/// Passes over a value whatever it is: a text, or all up to the next blank. @return it is zero
bool pass_value(Cursor& line) {
  line.skip_blanks();
  const std::size_t from = line.at;
  if (line.here() == '"') {
    const std::size_t close = line.text.find('"', from + 1);
    if (close == std::string_view::npos) line.refuse(from, "a \" that closes the text");
    line.at = close + 1;
    return close == from + 1;
  }
  while (!line.at_end() && !is_blank(line.here())) ++line.at;
  const std::string_view value = line.text.substr(from, line.at - from);
  if (value.empty()) line.refuse(from, "a value behind =");
  return value.find_first_not_of("+-0.") == std::string_view::npos;
}

std::string text_value(Cursor& line) {
  line.skip_blanks();
  const std::size_t from = line.at;
  if (line.here() != '"') line.refuse(from, "a name in \"\"");
  pass_value(line);
  return std::string(line.text.substr(from + 1, line.at - from - 2));
}

void edge_value(TableReading& reading, const Assigned& to, int parameter, EdgeParts& tool,
                Cursor& line) {
  const std::size_t from = line.at;
  const double value = table_number(line, to.name);
  const auto mm = [&] { return value == 0.0 ? 0.0 : value * reading.unit_at(line, from); };
  tool.edge = true;
  switch (parameter) {
    case 1:
      if (value != 0.0 && !(value >= 100.0 && value < 300.0))
        line.refuse(from, "a milling cutter or drill, of type 100 to 299");
      return;
    case 3:
      tool.length = mm();
      return;
    case 6:
      tool.radius = mm();
      return;
    case 12:
      tool.wear = mm();
      return;
    case 15:
      tool.radius_wear = mm();
      return;
    case 21:
      tool.base = mm();
      return;
    case 4:
    case 5:
    case 13:
    case 14:
    case 22:
    case 23:
      if (value != 0.0)
        line.refuse(from, "0 for length 2 and 3: the length of a tool lies along it");
      return;
    default:
      if (value != 0.0) reading.leave_out(fmt::format("$TC_DP{}", parameter));
  }
}

/// Number behind $TC_DP; none for another name.
std::optional<int> edge_parameter(const std::string& name) {
  constexpr std::string_view head = "$TC_DP";
  if (!name.starts_with(head) || name.size() <= head.size() || name.size() > head.size() + 3 ||
      name.find_first_not_of("0123456789", head.size()) != std::string::npos)
    return std::nullopt;
  return std::stoi(name.substr(head.size()));
}

void tool_value(TableReading& reading, const Assigned& to, Edges& edges, Cursor& line) {
  const auto parameter = edge_parameter(to.name);
  if (!parameter && to.name != "$TC_TP2") {
    if (!pass_value(line)) reading.leave_out(to.name);
    return;
  }
  const int number = table_index(to, 0, 999'999, line);
  if (parameter && table_index(to, 1, 12, line) != 1) {
    if (!pass_value(line)) reading.leave_out("$TC_DP of cutting edges other than 1");
    return;
  }
  EdgeParts& tool = edges[number];
  if (tool.line == 0) tool.line = line.place.line;
  if (parameter)
    edge_value(reading, to, *parameter, tool, line);
  else
    tool.name = text_value(line);
}

char axis_letter(const std::string& name, const Cursor& line, std::size_t from) {
  if (name.size() != 1 || std::string_view("XYZABCUVW").find(name[0]) == std::string_view::npos)
    line.refuse(from, "an axis X Y Z A B C U V or W", name.empty() ? "none" : name);
  return name[0];
}

void add_to_offset(TableReading& reading, int system, char axis, double value, std::size_t from,
                   const Cursor& line) {
  const bool turns = axis >= 'A' && axis <= 'C';
  const double unit = turns || value == 0.0 ? 1.0 : reading.unit_at(line, from);
  TableOffset::Value& to = reading.table.offsets[system].axes[axis];
  to = {to.value + value * unit, line.place.line, int(from) + 1};
}

/// CTRANS(X,10,Y,20):CFINE(X,0.1)
void frame_value(TableReading& reading, int system, Cursor& line) {
  while (true) {
    line.skip_blanks();
    const std::size_t from = line.at;
    if (!line.take_word("CTRANS") && !line.take_word("CFINE"))
      line.refuse(from,
                  "CTRANS or CFINE: a work offset that is neither turned, scaled nor mirrored");
    line.skip_blanks();
    if (line.here() != '(') line.refuse(line.at, "( and axes with their values");
    do {
      ++line.at;
      line.skip_blanks();
      const std::size_t at = line.at;
      std::string name;
      while (is_letter(line.here())) name += upper(line.text[line.at++]);
      const char axis = axis_letter(name, line, at);
      line.skip_blanks();
      if (line.here() != ',') line.refuse(line.at, "a comma and the value of the axis");
      ++line.at;
      const double value = table_number(line, name);
      add_to_offset(reading, system, axis, value, at, line);
      line.skip_blanks();
    } while (line.here() == ',');
    if (line.here() != ')') line.refuse(line.at, "a ) that closes the frame");
    ++line.at;
    line.skip_blanks();
    if (line.here() != ':') return;
    ++line.at;
  }
}

void offset_value(TableReading& reading, const Assigned& to, int system, Cursor& line) {
  if (to.index.size() == 1) return frame_value(reading, system, line);
  if (to.index.size() != 3)
    line.refuse(to.from, "an index of number, axis and TR, FI, RT, SC or MI");
  line.skip_blanks();
  const std::size_t from = line.at;
  const double value = table_number(line, to.name);
  const std::string& part = to.index[2];
  const char axis = axis_letter(to.index[1], line, to.from);
  if (part == "TR" || part == "FI") return add_to_offset(reading, system, axis, value, from, line);
  if (part != "RT" && part != "SC" && part != "MI") line.refuse(to.from, "TR, FI, RT, SC or MI");
  if (value != (part == "SC" ? 1.0 : 0.0))
    line.refuse(from, "a work offset that is neither turned, scaled nor mirrored");
}

/// $P_UIFR[n]: n to 6 as the table must have them, those beyond as far as they can be read.
void numbered_offset(TableReading& reading, const Assigned& to, Cursor& line) {
  const int number = table_index(to, 0, 99, line), system = 500 + number;
  if (number <= 6) return offset_value(reading, to, number, line);
  const std::size_t value = line.at;
  reading.read_beyond(system, [&] { offset_value(reading, to, system, line); });
  if (reading.unread.contains(system))  // what it refused may stand on in the line
    line.at = std::min(line.text.find('$', value), line.text.size());
}

bool siemens_line(TableReading& reading, Edges& edges, Cursor& line) {
  line.skip_blanks();
  if (line.here() == '%') return true;  // %_N_TO1_TOA
  for (; !line.at_end() && line.here() != ';'; line.skip_blanks()) {
    const std::size_t from = line.at;
    const char c = upper(line.here());
    if ((c == 'N' || c == 'M') && is_digit(line.next())) {
      ++line.at;
      table_whole(line, 0, 1'000'000'000, "a block or M number");
      continue;
    }
    if (line.take("CHANDATA(")) {
      table_whole(line, 1, 99, "a channel");
      if (line.here() != ')') line.refuse(from, "CHANDATA and a channel in ()");
      ++line.at;
      continue;
    }
    if (c != '$') line.refuse(from, "$ and the name of a value, as $TC_DP3[1,1]=");
    const Assigned to = assigned_in(line);
    const bool is_tool = to.name.starts_with("$TC_"), is_offset = to.name == "$P_UIFR";
    if (is_tool && reading.kind == TableKind::Tools) {
      tool_value(reading, to, edges, line);
    } else if (is_offset && reading.kind == TableKind::Offsets) {
      numbered_offset(reading, to, line);
    } else {
      if (!pass_value(line)) reading.leave_out(to.name);
    }
  }
  return true;
}

/// G500 is no offset of a scene.
void check_g500(TableReading& reading) {
  const auto found = reading.table.offsets.find(0);
  if (found == reading.table.offsets.end()) return;
  for (const auto& [axis, value] : found->second.axes)
    if (value.value != 0.0)
      reading.faults.add(BadInput(reading.table.file, value.line, value.column,
                                  "0 for $P_UIFR[0], which G500 calls",
                                  fmt::format("{}", value.value)));
  reading.table.offsets.erase(found);
}

}  // namespace

void read_siemens_table(TableReading& reading) {
  Edges edges;
  each_line(reading, [&](Cursor& line) { return siemens_line(reading, edges, line); });
  for (const auto& [number, tool] : edges)
    if (tool.edge)
      reading.table.tools[number] = {tool.length + tool.wear + tool.base,
                                     tool.radius + tool.radius_wear,
                                     tool.wear,
                                     tool.radius_wear,
                                     tool.name,
                                     tool.line};
  check_g500(reading);
}

}  // namespace abbe::sim::dialects
