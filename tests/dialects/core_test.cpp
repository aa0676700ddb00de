#include <gtest/gtest.h>

#include <cmath>

#include "kinematics/bad_input.h"
#include "sim/dialects/expression.h"

namespace abbe::sim::dialects {
namespace {

constexpr Operator operators[] = {
    {"**", 3, [](double a, double b) { return std::pow(a, b); }},
    {"*", 2, [](double a, double b) { return a * b; }},
    {"/", 2, [](double a, double b) { return a / b; },
     [](double, double b) { return b == 0 ? "a nonzero divisor" : nullptr; }},
    {"+", 1, [](double a, double b) { return a + b; }},
    {"-", 1, [](double a, double b) { return a - b; }},
};
constexpr Function functions[] = {
    {"SQRT", [](double x) { return std::sqrt(x); },
     [](double x) { return x < 0 ? "a non-negative number" : nullptr; }},
};
const ExpressionGrammar grammar{operators, functions};

class NoOperands : public OperandParser {
 public:
  std::optional<double> parse_operand(Cursor& cursor) override {
    if (!cursor.accept("#1")) return std::nullopt;
    return 7.0;
  }
};

double evaluated(std::string_view text) {
  const std::string file = "t";
  Cursor cursor{text, {file, 3}};
  NoOperands none;
  const double result = parse_bracketed(cursor, grammar, none);
  EXPECT_TRUE(cursor.at_end()) << text;
  return result;
}

std::string core_refusal(std::string_view text) {
  try {
    evaluated(text);
  } catch (const BadInput& fault) {
    return fault.what();
  }
  return "accepted";
}

TEST(Expression, BindsByLevelAndFromTheLeft) {
  EXPECT_EQ(evaluated("[1 + 2 * 3]"), 7.0);
  EXPECT_EQ(evaluated("[8 - 3 - 2]"), 3.0);
  EXPECT_EQ(evaluated("[2 ** 3 ** 2]"), 64.0);
  EXPECT_EQ(evaluated("[2 * 3 ** 2]"), 18.0);
  EXPECT_EQ(evaluated("[[1 + 2] * 3]"), 9.0);
  EXPECT_EQ(evaluated("[-2 ** 2]"), 4.0);
  EXPECT_EQ(evaluated("[-#1]"), -7.0);
  EXPECT_EQ(evaluated("[1 - -#1]"), 8.0);
  EXPECT_EQ(evaluated("[sqrt[#1 + 2] / 2]"), 1.5);
}

TEST(Expression, RefusesWhatIsNone) {
  EXPECT_EQ(core_refusal("[1 / 0]"), "t:3:4: expected a nonzero divisor, seen /");
  EXPECT_EQ(core_refusal("[1 + ]"), "t:3:6: expected a number, seen ]");
  EXPECT_EQ(core_refusal("[1"), "t:3:3: expected ] or an operator, seen the end of the line");
  EXPECT_NE(core_refusal(std::string(200, '[') + "1").find("100 nested brackets"),
            std::string::npos);
  EXPECT_NE(core_refusal("[" + std::string(100000, '-') + "#1]").find("100 nested brackets"),
            std::string::npos);
  EXPECT_NE(core_refusal("[10 ** 400]").find("finite"), std::string::npos);
  EXPECT_NE(core_refusal("[sqrt[-1]]").find("non-negative"), std::string::npos);
  EXPECT_NE(core_refusal("[99999999999]").find("1e9"), std::string::npos);
}

TEST(Variables, OfACallEndWithItAndTheirNumberIsLimited) {
  Variables variables(3);
  ASSERT_TRUE(variables.set(1, 2.0, Variables::Scope::Call));
  variables.enter();
  EXPECT_FALSE(variables.number(1, Variables::Scope::Call));
  ASSERT_TRUE(variables.set(1, 5.0, Variables::Scope::Call));
  ASSERT_TRUE(variables.set("x", 6.0));
  EXPECT_FALSE(variables.set(2, 1.0));
  EXPECT_TRUE(variables.set("x", 7.0));
  variables.leave();
  EXPECT_EQ(variables.number(1, Variables::Scope::Call), 2.0);
  EXPECT_EQ(variables.named("x"), 7.0);
  EXPECT_TRUE(variables.set(2, 1.0));
}

}  // namespace
}  // namespace abbe::sim::dialects
