#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens_flow.h"

namespace abbe::sim::dialects::siemens {
namespace {

constexpr int most_r = 32767;
constexpr double most_integer = 2147483647.0;

bool begins_assignment(const Cursor& cursor) {
  Cursor ahead = cursor;
  ahead.skip_blanks();
  return ahead.here() == '=' && ahead.next() != '=';
}

}  // namespace

Flow::Call& Flow::scope() {
  std::size_t at = calls_.size() - 1;
  while (calls_[at].part) --at;
  return calls_[at];
}

/// R1, R[...]: its number as a whole one.
double Flow::r_parameter(Cursor& cursor, std::size_t from) {
  ++cursor.at;
  double number = 0.0;
  if (cursor.here() == '[') {
    ++cursor.at;
    number = number_at(cursor, *this);
    if (!cursor.take("]")) cursor.refuse(cursor.at, "] behind the number of a parameter");
  } else {
    while (is_digit(cursor.here()) && number < 1e9)
      number = 10 * number + (cursor.text[cursor.at++] - '0');
  }
  if (!(number >= 0 && number <= most_r) || number != std::floor(number))
    cursor.refuse(from, fmt::format("a parameter of R0 to R{}", most_r));
  return number;
}

/// The name of one element of a field, "FIELD[2,0]"; of what is no field the name itself.
std::string Flow::element(Cursor& cursor, const std::string& name, const Variable& variable) {
  if (variable.sizes.empty()) return name;
  const std::size_t from = cursor.at;
  if (cursor.here() != '[') cursor.refuse(from, "[ behind the name of a field");
  ++cursor.at;
  std::string all = name + "[";
  for (std::size_t k = 0; k < variable.sizes.size(); ++k) {
    if (k > 0 && !cursor.take(",")) cursor.refuse(cursor.at, ", before the next index");
    const double index = number_at(cursor, *this);
    if (!(index >= 0 && index < variable.sizes[k]) || index != std::floor(index))
      cursor.refuse(from, fmt::format("a whole index of 0 to {}", variable.sizes[k] - 1),
                    fmt::format("{}", index));
    all += fmt::format("{}{}", k > 0 ? "," : "", int(index));
  }
  if (!cursor.take("]")) cursor.refuse(cursor.at, "] behind an index");
  return all + "]";
}

void Flow::store(const std::string& name, Kind kind, double value, const Cursor& cursor,
                 std::size_t from) {
  if (kind == Kind::Integer) value = std::round(value);
  if (kind == Kind::Truth) value = value != 0 ? 1.0 : 0.0;
  if (kind == Kind::Integer && !(std::abs(value) <= most_integer))
    cursor.refuse(from, "a whole number of 32 bits", fmt::format("{}", value));
  if (!variables_.set(name, value, Variables::Of::Call))
    throw Exhausted(cursor.place.file, cursor.place.line, 0,
                    fmt::format("at most {} variables", run_.options().limits.variables), "more");
}

bool Flow::set_variable(Cursor& cursor) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const char first = upper(cursor.here());
  Cursor ahead = cursor;
  if (first == 'R' && (is_digit(cursor.next()) || cursor.next() == '[')) {
    const int number = int(r_parameter(ahead, from));
    if (!begins_assignment(ahead)) return false;
    ahead.take("=");
    run_.define(fmt::format("R{}", number), [&] {
      const double value = number_at(ahead, *this);
      if (!variables_.set(number, value))
        throw Exhausted(cursor.place.file, cursor.place.line, 0,
                        fmt::format("at most {} variables", run_.options().limits.variables),
                        "more");
    });
    cursor.at = ahead.at;
    return true;
  }
  const Call& now = scope();
  if (now.variables.empty()) return false;
  const std::string name = name_at(ahead);
  const auto found = now.variables.find(name);
  if (found == now.variables.end()) return false;
  const Variable variable = found->second;
  const std::string place = element(ahead, name, variable);
  if (!begins_assignment(ahead)) return false;
  ahead.take("=");
  if (variable.kind == Kind::Text) {
    ahead.skip_blanks();
    std::optional<std::string> text;
    if (ahead.here() == '"')
      text = quoted_at(ahead);
    else
      text = text_variable(ahead);
    if (!text) ahead.refuse(ahead.at, "a text in quotes");
    scope().texts[name] = *text;
  } else {
    run_.define(place, [&] { store(place, variable.kind, number_at(ahead, *this), ahead, from); });
  }
  cursor.at = ahead.at;
  return true;
}

std::optional<std::string> Flow::text_variable(Cursor& cursor) {
  const Call& now = scope();
  if (now.variables.empty()) return std::nullopt;
  Cursor ahead = cursor;
  ahead.skip_blanks();
  const std::string name = name_at(ahead);
  const auto found = now.variables.find(name);
  if (found == now.variables.end() || found->second.kind != Kind::Text) return std::nullopt;
  cursor.at = ahead.at;
  const auto text = now.texts.find(name);
  return text == now.texts.end() ? std::string() : text->second;
}

/// DEF REAL A1, A2=5, FIELD[10]
void Flow::define(Cursor& cursor) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const std::string type = name_at(cursor);
  static constexpr std::array<std::pair<std::string_view, Kind>, 5> kinds = {
      {{"REAL", Kind::Real},
       {"INT", Kind::Integer},
       {"BOOL", Kind::Truth},
       {"CHAR", Kind::Integer},
       {"STRING", Kind::Text}}};
  const auto kind =
      std::find_if(kinds.begin(), kinds.end(), [&](const auto& one) { return one.first == type; });
  if (kind == kinds.end()) cursor.refuse(from, "REAL, INT, BOOL, CHAR or STRING behind DEF");
  if (kind->second == Kind::Text && cursor.here() == '[') {
    ++cursor.at;
    number_at(cursor, *this);
    if (!cursor.take("]")) cursor.refuse(cursor.at, "] behind the length of a text");
  }
  Cursor names = cursor;
  try {
    do define_one(cursor, kind->second);
    while (cursor.take(","));
    ends(cursor);
  } catch (const BadInput&) {
    for (; !names.at_end(); ++names.at)
      if (const std::string name = name_at(names); !name.empty()) run_.doubt(name);
    throw;
  }
}

void Flow::define_one(Cursor& cursor, Kind kind) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const std::string name = name_at(cursor);
  if (name.size() < 2 || (is_letter(name[0]) && is_digit(name[1])) || fact_of(name) != nullptr ||
      Machine::is_cycle(name))
    cursor.refuse(from, "a name of two letters or more that is no word of the control");
  Variable variable{kind, {}};
  if (cursor.here() == '[') {
    if (kind == Kind::Text) cursor.refuse(cursor.at, "no fields of texts");
    ++cursor.at;
    double all = 1.0;
    do {
      const std::size_t at_size = cursor.at;
      const double size = number_at(cursor, *this);
      all *= size;
      if (!(size >= 1 && all <= 1e6) || size != std::floor(size) || variable.sizes.size() == 3)
        cursor.refuse(at_size, "at most three sizes and 1e6 elements of a field");
      variable.sizes.push_back(int(size));
    } while (cursor.take(","));
    if (!cursor.take("]")) cursor.refuse(cursor.at, "] behind the size of a field");
  }
  auto& variables = scope().variables;
  if (variables.size() >= run_.options().limits.variables)
    throw Exhausted(cursor.place.file, cursor.place.line, 0,
                    fmt::format("at most {} variables", run_.options().limits.variables), "more");
  variables[name] = variable;
  if (!cursor.take("=")) {
    if (variable.sizes.empty() && kind != Kind::Text) store(name, kind, 0.0, cursor, from);
    return;
  }
  if (!variable.sizes.empty()) cursor.refuse(cursor.at, "no values of a whole field in DEF");
  if (kind == Kind::Text) {
    cursor.skip_blanks();
    if (cursor.here() != '"') cursor.refuse(cursor.at, "a text in quotes");
    scope().texts[name] = quoted_at(cursor);
  } else {
    store(name, kind, number_at(cursor, *this), cursor, from);
  }
}

/// 'HFF' or 'B1001'
double Flow::quoted_number(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  const char base = upper(cursor.here());
  ++cursor.at;
  const std::size_t digits = cursor.at;
  while (!cursor.at_end() && cursor.here() != '\'') ++cursor.at;
  const std::string_view text = cursor.text.substr(std::min(digits, cursor.text.size()),
                                                   cursor.at - std::min(digits, cursor.at));
  std::uint32_t value = 0;
  const auto read =
      std::from_chars(text.data(), text.data() + text.size(), value, base == 'H' ? 16 : 2);
  const bool known = (base == 'H' || base == 'B') && read.ec == std::errc() &&
                     read.ptr == text.data() + text.size() && cursor.here() == '\'';
  if (!known) cursor.refuse(from, "a number as 'HFF' or 'B1001', of at most 32 bits");
  ++cursor.at;
  return double(value);
}

std::optional<double> Flow::system_variable(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  const std::string name = name_at(cursor);
  if (name == "PI") return pi;
  const bool in_workpiece = name == "AA_IW" || name == "P_EP";
  if ((in_workpiece || name == "AA_IM") && cursor.take("[")) {
    cursor.skip_blanks();
    const std::size_t at_axis = cursor.at;
    const std::string axis = name_at(cursor);
    const auto value = axis.size() == 1 ? machine_->position(axis[0], !in_workpiece) : std::nullopt;
    if (!value) cursor.refuse(at_axis, "an axis of this machine (" + run_.canon.letters() + ")");
    if (!cursor.take("]")) cursor.refuse(cursor.at, "] behind the name of an axis");
    return value;
  }
  cursor.refuse(from, "$PI, $P_EP[axis], $AA_IW[axis] or $AA_IM[axis]: no other system variable");
}

/// ATAN2, MINVAL, MAXVAL, BOUND, with the cursor at the bracket.
std::optional<double> Flow::function_of_several(Cursor& cursor, const std::string& name) {
  const std::size_t count = name == "BOUND"                                           ? 3
                            : name == "ATAN2" || name == "MINVAL" || name == "MAXVAL" ? 2
                                                                                      : 0;
  if (count == 0) return std::nullopt;
  cursor.skip_blanks();
  const std::size_t open = cursor.at;
  if (!cursor.take("(")) cursor.refuse(open, "( behind " + name);
  std::array<double, 3> x{};
  for (std::size_t k = 0; k < count; ++k) {
    if (k > 0 && !cursor.take(","))
      cursor.refuse(cursor.at, fmt::format(", and {} numbers of {}", count, name));
    x[k] = expression(cursor, grammar(), *this);
  }
  if (!cursor.take(")"))
    cursor.refuse(cursor.at, fmt::format(") behind {} numbers of {}", count, name));
  if (name == "ATAN2") return std::atan2(x[0], x[1]) / units::deg;
  if (name == "MINVAL") return std::min(x[0], x[1]);
  if (name == "MAXVAL") return std::max(x[0], x[1]);
  if (x[0] > x[1]) cursor.refuse(open, "the lower limit of BOUND before the upper one");
  return std::clamp(x[2], x[0], x[1]);
}

std::optional<double> Flow::operand(Cursor& cursor) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const char first = upper(cursor.here());
  if (first == 'R' && (is_digit(cursor.next()) || cursor.next() == '[')) {
    const int number = int(r_parameter(cursor, from));
    if (run_.in_doubt()) run_.require_certain(fmt::format("R{}", number), cursor.cause(from));
    return variables_.number(number).value_or(0.0);
  }
  if (first == '\'') return quoted_number(cursor);
  if (first == '$') return system_variable(cursor);
  Cursor ahead = cursor;
  const std::string name = name_at(ahead);
  if (name.empty()) return std::nullopt;
  const auto taken = [&](std::optional<double> value) {
    cursor.at = ahead.at;
    return value;
  };
  if (name == "TRUE") return taken(1.0);
  if (name == "FALSE") return taken(0.0);
  if (name == "NOT" || name == "B_NOT") {
    const double inner = value(ahead, grammar(), *this);
    return taken(name == "NOT" ? double(inner == 0) : double(~std::int64_t(inner)));
  }
  if (const auto result = function_of_several(ahead, name)) return taken(result);
  const Call& now = scope();
  const auto found = now.variables.find(name);
  run_.require_certain(name, cursor.cause(from, ahead.at));
  if (found == now.variables.end()) return std::nullopt;
  if (found->second.kind == Kind::Text) cursor.refuse(from, "a number", "the text " + name);
  const std::string place = element(ahead, name, found->second);
  run_.require_certain(place, cursor.cause(from, ahead.at));
  return taken(variables_.named(place, Variables::Of::Call).value_or(0.0));
}

}  // namespace abbe::sim::dialects::siemens
