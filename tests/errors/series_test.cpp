#include "errors/curve.h"

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "errors/geometric.h"
#include "tests/errors/machines.h"

namespace abbe::errors {
namespace {

using Eigen::VectorXd;
using kinematics::JointDeviation;

/// Machines at random: curves of every shape, series of few ranges and many lengths.
class AnyErrors {
 public:
  explicit AnyErrors(unsigned seed) : random_(seed) {}

  double unit() { return std::uniform_real_distribution<double>(-1, 1)(random_); }
  int upto(int most) { return std::uniform_int_distribution<int>(0, most)(random_); }

  VectorXd numbers(int count) {
    return VectorXd::NullaryExpr(count, [&] { return 1e-3 * unit(); });
  }

  Shape shape() {
    switch (upto(5)) {
      case 0:
        return Polynomial{numbers(upto(5)), 10.0 * upto(1), 400.0};
      case 1: {
        const int n = upto(3);
        return Fourier{numbers(n), numbers(n), upto(1) == 0 ? 16.0 : 6.5};
      }
      case 2:
        return Backlash{1e-3 * unit()};
      case 3:
        return make_table(VectorXd::LinSpaced(9, -500, 500), numbers(9));
      default:
        return Legendre{numbers(upto(9) == 0 ? 30 : upto(7)), 10.0 * upto(1), 400.0};
    }
  }

  GeometricErrors errors() {
    GeometricErrors all;
    for (const char axis : std::string("CXYZA"))
      for (const char direction : std::string("XYZABC")) {
        Element element{parse_element_name(std::string("E") + direction + axis), {}};
        for (int k = 1 + upto(2); k > 0; --k)
          element.curves.push_back({shape(),
                                    {},
                                    upto(1) == 0 ? Argument::Command : Argument::Carriage,
                                    upto(1) == 0,
                                    upto(2) == 0 ? 1.0 : unit()});
        all.elements.push_back(std::move(element));
      }
    return all;
  }

  kinematics::AxisState state() {
    kinematics::AxisState state;
    state.q = kinematics::AxisVector::NullaryExpr(6, [&] { return 300.0 * unit(); });
    for (auto& one : state.direction) one = std::int8_t(upto(2) - 1);
    return state;
  }

 private:
  std::mt19937 random_;
};

/// Curve by curve, none with what another has found.
std::vector<JointDeviation> one_by_one(const GeometricModel& model,
                                       const kinematics::AxisState& state) {
  std::vector<JointDeviation> sum(model.is_joint_primed.size());
  for (const bool constant : {true, false})
    for (const GeometricModel::Bound& bound : model.elements)
      for (const Curve& curve : bound.element.curves)
        if (std::holds_alternative<Constant>(curve.shape) == constant)
          sum[std::size_t(bound.joint)].motion[bound.component] +=
              value(curve, curve_state(model, state, bound.joint));
  return sum;
}

TEST(Series, ThatShareTheirFunctionsHaveTheBitsOfCurvesOneByOne) {
  int grouped = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    AnyErrors any(seed);
    const GeometricModel model = bind(any.errors(), gantry());
    for (const auto& term : model.terms) grouped += term.group >= 0 ? 1 : 0;
    EXPECT_LE(model.groups.size(), GeometricModel::max_groups);
    for (int k = 0; k < 50; ++k) {
      const kinematics::AxisState state = any.state();
      const std::vector<JointDeviation> expected = one_by_one(model, state);
      const std::vector<JointDeviation> seen = deviations(model, state);
      for (std::size_t j = 0; j < seen.size(); ++j)
        for (int i = 0; i < 6; ++i)
          ASSERT_EQ(seen[j].motion[i], expected[j].motion[i]) << "seed " << seed << " joint " << j;
    }
  }
  EXPECT_GT(grouped, 1000) << "the series are what is tested here";
}

TEST(Series, OfOneArgumentAndRangeShareABasisWhateverTheirLengths) {
  const auto curve = [](Shape shape, Argument argument = Argument::Command) {
    return Curve{std::move(shape), {}, argument};
  };
  const auto ones = [](int count) { return VectorXd(VectorXd::Ones(count)); };
  const SeriesBasis basis = *series_basis(curve(Legendre{ones(5), 0, 300}));
  EXPECT_TRUE(basis.has_same_functions(*series_basis(curve(Legendre{ones(7), 0, 300}))));
  EXPECT_FALSE(basis.has_same_functions(*series_basis(curve(Legendre{ones(5), 1, 300}))));
  EXPECT_FALSE(basis.has_same_functions(*series_basis(curve(Legendre{ones(5), 0, 301}))));
  EXPECT_FALSE(basis.has_same_functions(
      *series_basis(curve(Legendre{ones(5), 0, 300}, Argument::Carriage))));
  EXPECT_FALSE(basis.has_same_functions(*series_basis(curve(Fourier{ones(5), ones(5), 300}))));
  EXPECT_FALSE(series_basis(curve(Legendre{ones(SeriesBasis::max_functions + 1), 0, 300})));
  EXPECT_FALSE(series_basis(curve(Polynomial{ones(5), 0, 300})));
}

}  // namespace
}  // namespace abbe::errors
