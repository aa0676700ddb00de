#include <cmath>

#include "kinematics/units.h"
#include "sim/dialects/fanuc_block.h"

namespace abbe::sim::dialects::fanuc {
namespace {

/// A vacant variable counts as zero.
double plain(double x) { return is_vacant(x) ? 0.0 : x; }

const char* not_zero(double, double b) {
  return plain(b) == 0 ? "a divisor that is not zero" : nullptr;
}

const char* not_whole(double a, double b) {
  const auto whole = [](double x) { return x == std::floor(x) && std::abs(x) < 2147483648.0; };
  return whole(plain(a)) && whole(plain(b)) ? nullptr : "whole numbers of 32 bits on both sides";
}

const char* no_modulus(double a, double b) {
  const char* zero = not_zero(a, b);
  return zero != nullptr ? zero : not_whole(a, b);
}

long long bits(double x) { return (long long)(plain(x)); }

/// Vacant is EQ nothing but vacant.
bool equal(double a, double b) { return is_vacant(a) == is_vacant(b) && plain(a) == plain(b); }

constexpr Operator operators[] = {
    {"*", 3, [](double a, double b) { return plain(a) * plain(b); }},
    {"/", 3, [](double a, double b) { return plain(a) / plain(b); }, not_zero},
    {"MOD", 3, [](double a, double b) { return std::fmod(plain(a), plain(b)); }, no_modulus},
    {"AND", 3, [](double a, double b) { return double(bits(a) & bits(b)); }, not_whole},
    {"+", 2, [](double a, double b) { return plain(a) + plain(b); }},
    {"-", 2, [](double a, double b) { return plain(a) - plain(b); }},
    {"XOR", 2, [](double a, double b) { return double(bits(a) ^ bits(b)); }, not_whole},
    {"OR", 2, [](double a, double b) { return double(bits(a) | bits(b)); }, not_whole},
    {"EQ", 1, [](double a, double b) { return double(equal(a, b)); }},
    {"NE", 1, [](double a, double b) { return double(!equal(a, b)); }},
    {"GT", 1, [](double a, double b) { return double(plain(a) > plain(b)); }},
    {"GE", 1, [](double a, double b) { return double(plain(a) >= plain(b)); }},
    {"LT", 1, [](double a, double b) { return double(plain(a) < plain(b)); }},
    {"LE", 1, [](double a, double b) { return double(plain(a) <= plain(b)); }},
};

const char* beyond_one(double x) { return x < -1 || x > 1 ? "a number within -1 and 1" : nullptr; }

/// From 270 over 0 to 90 degrees, as parameter 6004.0 NAT = 0 has it.
double arc_sine(double x) {
  const double angle = std::asin(plain(x)) / units::deg;
  return angle < 0 ? angle + 360.0 : angle;
}

// ROUND, ATAN and POW are read by the operands.
constexpr Function functions[] = {
    {"ABS", [](double x) { return std::abs(plain(x)); }},
    {"ACOS", [](double x) { return std::acos(plain(x)) / units::deg; }, beyond_one},
    {"ASIN", arc_sine, beyond_one},
    {"COS", [](double x) { return std::cos(plain(x) * units::deg); }},
    {"EXP", [](double x) { return std::exp(plain(x)); }},
    {"FIX", [](double x) { return std::trunc(plain(x)); }},
    {"FUP", [](double x) { return plain(x) < 0 ? std::floor(x) : std::ceil(plain(x)); }},
    {"LN", [](double x) { return std::log(x); },
     [](double x) -> const char* { return plain(x) <= 0 ? "a number above zero" : nullptr; }},
    {"SIN", [](double x) { return std::sin(plain(x) * units::deg); }},
    {"SQRT", [](double x) { return std::sqrt(plain(x)); },
     [](double x) -> const char* {
       return plain(x) < 0 ? "a number that is not below zero" : nullptr;
     }},
    {"TAN", [](double x) { return std::tan(plain(x) * units::deg); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar all{operators, functions, '[', ']', false};
  return all;
}

}  // namespace abbe::sim::dialects::fanuc
