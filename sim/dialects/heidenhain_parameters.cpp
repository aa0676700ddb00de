#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain_flow.h"
#include "sim/dialects/heidenhain_words.h"

/// Q parameters: what Flow does with numbers.
namespace abbe::sim::dialects::heidenhain {
namespace {

constexpr double equal = 1e-9;  // Q parameters this near are EQU: their rounding

bool holds(const std::string& comparison, double a, double b) {
  if (comparison == "EQU") return std::abs(a - b) < equal;
  if (comparison == "NE") return std::abs(a - b) >= equal;
  return comparison == "GT" ? a > b : a < b;
}

}  // namespace

std::optional<Flow::Parameter> Flow::parameter_at(Cursor& cursor) const {
  cursor.skip_blanks();
  if (upper(cursor.here()) != 'Q') return std::nullopt;
  Parameter parameter;
  parameter.from = cursor.at++;
  parameter.kind = "Q";
  if (const char c = upper(cursor.here()); c == 'L' || c == 'R' || c == 'S') {
    parameter.kind += c;
    ++cursor.at;
  }
  const std::size_t digits = cursor.at;
  while (is_digit(cursor.here()) && cursor.at < digits + 4)
    parameter.number = 10 * parameter.number + (cursor.text[cursor.at++] - '0');
  const int most = parameter.kind == "Q" ? 1999 : 499;
  if (parameter.kind == "QS")
    cursor.refuse(parameter.from, "a parameter of numbers: texts in QS are not kept");
  if (cursor.at == digits || is_digit(cursor.here()) || parameter.number > most)
    cursor.refuse(parameter.from,
                  fmt::format("a number of 0 to {} after {}", most, parameter.kind));
  return parameter;
}

std::optional<double> Flow::operand(Cursor& cursor) {
  if (upper(cursor.here()) == 'Q') {
    const auto parameter = parameter_at(cursor);
    return read(*parameter, cursor);
  }
  return function_value(cursor, *this);
}

double Flow::read(const Parameter& parameter, const Cursor& cursor) const {
  std::optional<double> known;
  if (parameter.kind == "Q") {
    known = variables_.number(parameter.number);
    if (!known) known = machine_.preset_parameter(parameter.number);
  } else if (parameter.kind == "QR") {
    known = variables_.number(10000 + parameter.number);
  } else {
    known = variables_.number(parameter.number, Variables::Of::Call);
  }
  if (run_.in_doubt()) run_.require_certain(parameter.name(), cursor.cause(parameter.from));
  if (!known) cursor.refuse(parameter.from, "a parameter that has been set");
  return *known;
}

void Flow::set(const Parameter& parameter, double value, const Words& words) {
  const bool local = parameter.kind == "QL";
  const int number = parameter.kind == "QR" ? 10000 + parameter.number : parameter.number;
  if (parameter.kind == "Q" && number >= 100 && number < 200)
    words.cursor.refuse(parameter.from, "a parameter that the control does not set itself");
  if (parameter.kind == "Q" && number >= 200 && number < 500 && machine_.has_cycle())
    run_.warn_once(
        "Q200 to Q499 are set outside of CYCL DEF: a cycle that is defined keeps its values");
  if (!variables_.set(number, value, local ? Variables::Of::Call : Variables::Of::Program))
    throw Exhausted(words.cursor.place.file, words.cursor.place.line, 0,
                    fmt::format("at most {} parameters", run_.options().limits.variables), "more");
}

/// Those that the machine sets: of CYCL DEF and of tilted planes.
void Flow::set_cycle_parameter(int number, double value) {
  if (!variables_.set(number, value))
    throw Exhausted(run_.canon.place().file, run_.canon.line(), 0,
                    fmt::format("at most {} parameters", run_.options().limits.variables), "more");
}

void Flow::assign(Words& words, const Parameter& parameter) {
  if (!words.cursor.take("=")) words.refuse(words.cursor.at, "= after a parameter");
  words.cursor.skip_blanks();
  if (words.cursor.here() == '"')
    words.refuse(words.cursor.at, "a number: texts in parameters are not kept");
  run_.define(parameter.name(), [&] {
    const double value = expression(words.cursor, grammar(), *this);
    words.ends();
    set(parameter, value, words);
  });
}

void Flow::fn(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const int number = words.whole(99);
  if (!words.cursor.take(":")) words.refuse(words.cursor.at, ": after FN and its number");
  if (number >= 9 && number <= 12) return jump_if(words);
  const std::string name = fmt::format("FN\u00a0{}", number);
  if (const WordUse* use = find_word(heidenhain_words(), name);
      use != nullptr && use->use == Use::Refused)
    words.refuse(from, std::string(use->sentence));
  if (number > 13) words.refuse(from, "FN 0 to FN 13");
  const auto parameter = parameter_at(words.cursor);
  if (!parameter) words.refuse(words.cursor.at, "a Q parameter");
  run_.define(parameter->name(), [&] {
    if (!words.cursor.take("=")) words.refuse(words.cursor.at, "= after a parameter");
    set(*parameter, fn_result(number, words), words);
  });
}

/// What stands behind = of FN 0 to FN 8 and FN 13.
double Flow::fn_result(int number, Words& words) {
  const auto word = [&](std::string_view wanted) {
    if (!words.cursor.take(wanted)) words.refuse(words.cursor.at, std::string(wanted));
  };
  if (number == 0 && words.take("SET"))
    words.refuse(words.cursor.at, "a number: parameters are not made undefined");
  if (number >= 5 && number <= 7) word(number == 5 ? "SQRT" : number == 6 ? "SIN" : "COS");
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const double a = words.value();
  if (number == 5 && a < 0) words.refuse(from, "a number that is not below zero");
  double result = number == 5   ? std::sqrt(a)
                  : number == 6 ? std::sin(a * units::deg)
                  : number == 7 ? std::cos(a * units::deg)
                                : a;
  if (number != 0 && (number < 5 || number > 7)) {
    static constexpr std::string_view between[] = {"", "+", "-", "*", "DIV"};
    word(number == 8 ? "LEN" : number == 13 ? "ANG" : between[number]);
    words.cursor.skip_blanks();
    const std::size_t second = words.cursor.at;
    const double b = words.value();
    if (number == 4 && b == 0) words.refuse(second, "a divisor that is not zero");
    if (number == 13 && a == 0 && b == 0) words.refuse(second, "two legs of an angle");
    double angle = std::atan2(a, b) / units::deg;
    if (angle < 0) angle += 360;
    const double all[] = {0, a + b, a - b, a * b, number == 4 ? a / b : 0};
    result = number == 8 ? std::hypot(a, b) : number == 13 ? angle : all[number];
  }
  words.ends();
  if (!std::isfinite(result)) words.refuse(from, "a result that is a finite number");
  return result;
}

/// IF +Q1 EQU +Q2 GOTO LBL 5
void Flow::jump_if(Words& words) {
  words.take("IF");
  const double a = words.value();
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const std::string comparison = words.name();
  if (comparison != "EQU" && comparison != "NE" && comparison != "GT" && comparison != "LT")
    words.refuse(from, "EQU, NE, GT or LT");
  const double b = words.value();
  if (!words.take("GOTO") || !words.take("LBL")) words.refuse(words.cursor.at, "GOTO LBL");
  words.cursor.skip_blanks();
  const std::size_t at = words.cursor.at;
  const std::string label = words.label();
  words.ends();
  const std::size_t line = line_of(label, words, at);
  if (holds(comparison, a, b)) at_ = line;
}

}  // namespace abbe::sim::dialects::heidenhain
