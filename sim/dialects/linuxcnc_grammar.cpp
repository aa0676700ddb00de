#include <cmath>

#include "kinematics/units.h"
#include "sim/dialects/linuxcnc_block.h"

namespace abbe::sim::dialects::linuxcnc {
namespace {

constexpr double equal = 1e-4;  // numbers this near are EQ

double modulo(double a, double b) {
  const double rest = std::fmod(a, b);
  return rest < 0 ? rest + std::abs(b) : rest;
}

const char* not_zero(double, double b) { return b == 0 ? "a divisor that is not zero" : nullptr; }

const char* power_fault(double a, double b) {
  if (a < 0 && std::floor(b) != b) return "a whole exponent of a number below zero";
  return a == 0 && b < 0 ? "an exponent of zero that is not below zero" : nullptr;
}

constexpr Operator operators[] = {
    {"**", 6, [](double a, double b) { return std::pow(a, b); }, power_fault},
    {"*", 5, [](double a, double b) { return a * b; }},
    {"/", 5, [](double a, double b) { return a / b; }, not_zero},
    {"MOD", 5, modulo, not_zero},
    {"+", 4, [](double a, double b) { return a + b; }},
    {"-", 4, [](double a, double b) { return a - b; }},
    {"EQ", 3, [](double a, double b) { return double(std::abs(a - b) < equal); }},
    {"NE", 3, [](double a, double b) { return double(std::abs(a - b) >= equal); }},
    {"GT", 3, [](double a, double b) { return double(a > b); }},
    {"GE", 3, [](double a, double b) { return double(a >= b); }},
    {"LT", 3, [](double a, double b) { return double(a < b); }},
    {"LE", 3, [](double a, double b) { return double(a <= b); }},
    {"AND", 2, [](double a, double b) { return double(a != 0 && b != 0); }},
    {"XOR", 2, [](double a, double b) { return double((a != 0) != (b != 0)); }},
    {"OR", 2, [](double a, double b) { return double(a != 0 || b != 0); }},
};

const char* beyond_one(double x) { return x < -1 || x > 1 ? "a number within -1 and 1" : nullptr; }

// The argument of ATAN, which has a second one, is read by the operands.
constexpr Function functions[] = {
    {"ABS", [](double x) { return std::abs(x); }},
    {"ACOS", [](double x) { return std::acos(x) / units::deg; }, beyond_one},
    {"ASIN", [](double x) { return std::asin(x) / units::deg; }, beyond_one},
    {"COS", [](double x) { return std::cos(x * units::deg); }},
    {"EXP", [](double x) { return std::exp(x); }},
    {"FIX", [](double x) { return std::floor(x); }},
    {"FUP", [](double x) { return std::ceil(x); }},
    {"LN", [](double x) { return std::log(x); },
     [](double x) -> const char* { return x <= 0 ? "a number above zero" : nullptr; }},
    {"ROUND", [](double x) { return double(std::round(x)); }},  // halves away from zero
    {"SIN", [](double x) { return std::sin(x * units::deg); }},
    {"SQRT", [](double x) { return std::sqrt(x); },
     [](double x) -> const char* { return x < 0 ? "a number that is not below zero" : nullptr; }},
    {"TAN", [](double x) { return std::tan(x * units::deg); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar all{operators, functions, '[', ']', true};
  return all;
}

}  // namespace abbe::sim::dialects::linuxcnc
