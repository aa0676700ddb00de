#include "errors/coefficients.h"

#include <cmath>
#include <iostream>
#include <random>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "tests/errors/numbers.h"

namespace abbe::errors {
namespace {

using Eigen::VectorXd;

/// Every shape once.
std::vector<Element> all_shapes() {
  const VectorXd q = numbers({-10, 0, 5, 20});
  const Table line =
      make_table(q, numbers({1, -2, 3, 4}), TableInterpolation::Linear, TableExtrapolation::Hold);
  const Table spline =
      make_table(q, numbers({1, -2, 3, 4}), TableInterpolation::Spline, TableExtrapolation::Hold);
  return {{{'X', 'X', false},
           {{Legendre{numbers({0.1, 0.2, 0.3}), 5, 15}},
            {Fourier{numbers({1, 2}), numbers({3, 4}), 8.0}, "screw pitch"},
            {Backlash{0.7}}}},
          {{'Y', 'X', false}, {{Polynomial{numbers({1, 2, 3, 4}), 1, 9}}}},
          {{'Z', 'X', false}, {{line, "laser", Argument::Carriage, true, 0.5}}},
          {{'A', 'X', false}, {{spline}, {DirectionalTables{line, spline}, "both ways"}}},
          {{'B', 'X', false}, {{Repeatability{1.0, 3}}, {Asynchronous{1.0, 4}}}},
          {{'C', 'Y', true}, {{Constant{4.0}}}}};
}

TEST(Coefficients, ANumberIsNamedByItsElementItsCurveAndItsPlace) {
  const std::vector<Element> elements = all_shapes();
  std::vector<std::string> names;
  for (const Coefficient& c : coefficients(elements)) names.push_back(name_of(c, elements));
  const std::vector<std::string> expected = {"EXX[0]",
                                             "EXX[1]",
                                             "EXX[2]",
                                             "EXX screw pitch cos 1",
                                             "EXX screw pitch cos 2",
                                             "EXX screw pitch sin 1",
                                             "EXX screw pitch sin 2",
                                             "EXX backlash",
                                             "EYX[0]",
                                             "EYX[1]",
                                             "EYX[2]",
                                             "EYX[3]",
                                             "EZX[0]",
                                             "EZX[1]",
                                             "EZX[2]",
                                             "EZX[3]",
                                             "EAX[0]",
                                             "EAX[1]",
                                             "EAX[2]",
                                             "EAX[3]",
                                             "EAX both ways up[0]",
                                             "EAX both ways up[1]",
                                             "EAX both ways up[2]",
                                             "EAX both ways up[3]",
                                             "EAX both ways down[0]",
                                             "EAX both ways down[1]",
                                             "EAX both ways down[2]",
                                             "EAX both ways down[3]",
                                             "EC0Y"};
  EXPECT_EQ(names, expected) << "a random shape has no numbers";
}

TEST(Coefficients, NamesStayUniqueWhereCurvesAreAlike) {
  const std::vector<Element> elements = {{{'X', 'X', false},
                                          {{Constant{1}},
                                           {Constant{2}},
                                           {Backlash{1}},
                                           {Constant{3}, "backlash"},
                                           {Constant{3}, "#1"},
                                           {Legendre{numbers({1, 2}), 0, 1}},
                                           {Polynomial{numbers({1, 2}), 0, 1}},
                                           {Legendre{numbers({1}), 0, 1}, "run"},
                                           {Legendre{numbers({1}), 0, 1}, "run"}}}};
  std::set<std::string> names;
  for (const Coefficient& c : coefficients(elements)) names.insert(name_of(c, elements));
  EXPECT_EQ(names.size(), coefficients(elements).size());
}

TEST(Coefficients, ValuesComeBackAsTheyWerePut) {
  const std::vector<Element> elements = all_shapes();
  const VectorXd before = values(elements);
  ASSERT_EQ(before.size(), 29);
  EXPECT_EQ(before[7], 0.7);
  VectorXd other = VectorXd::LinSpaced(29, -3.0, 11.0);
  EXPECT_EQ(values(with_values(elements, other)), other);
  EXPECT_EQ(values(with_values(with_values(elements, other), before)), before);
  EXPECT_THROW(with_values(elements, VectorXd::Zero(28)), std::invalid_argument);
  EXPECT_THROW(with_values(elements, VectorXd::Zero(30)), std::invalid_argument);
  EXPECT_EQ(values({}).size(), 0);
}

TEST(Coefficients, EveryCurveIsItsNumbersTimesItsBasis) {
  const unsigned seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> places = {0.0, 1e-12, -1e-12, -10.0, 5.0, 20.0, 0.5 * pi, pi, -25.0, 40.0};
  for (int i = 0; i < 200; ++i) places.push_back(30.0 * normal(random));
  double worst = 0.0;
  for (const bool primed : {false, true})
    for (const int direction : {-1, 0, 1})
      for (const double q : places) {
        std::vector<Element> elements = all_shapes();
        const auto count = Eigen::Index(coefficients(elements).size());
        elements =
            with_values(elements, VectorXd::NullaryExpr(count, [&] { return normal(random); }));
        const CurveState state{q, primed ? -q : q, direction, 3, primed};
        for (const Element& element : elements)
          for (const Curve& curve : element.curves) {
            if (is_random(curve)) continue;
            const VectorXd b = basis(curve, state);
            const VectorXd v = values({{element.name, {curve}}});
            ASSERT_EQ(b.size(), v.size());
            const double size = b.cwiseAbs().dot(v.cwiseAbs());
            if (size == 0.0) {
              EXPECT_EQ(value(curve, state), 0.0);
              continue;
            }
            worst = std::max(worst, std::abs(b.dot(v) - value(curve, state)) / size);
          }
      }
  std::cout << "basis times numbers against value: " << worst << " of the sum of magnitudes\n";
  EXPECT_LT(worst, 1e-14);
}

TEST(Coefficients, ATableThatRefusesRefusesItsBasisToo) {
  const Curve curve{make_table(numbers({0, 1}), numbers({1, 2}))};
  EXPECT_THROW(basis(curve, {2.0, 2.0, 0, 0, false}), std::out_of_range);
  EXPECT_EQ(basis(curve, {0.25, 0.25, 0, 0, false}), numbers({0.75, 0.25}));
  EXPECT_EQ(basis({Repeatability{1.0, 1}}, {}).size(), 0);
}

}  // namespace
}  // namespace abbe::errors
