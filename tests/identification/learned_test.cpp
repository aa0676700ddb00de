#include "errors/identification/learned.h"

#include <cmath>
#include <iostream>

#include <gtest/gtest.h>
#include <Eigen/LU>

namespace {

using namespace abbe::errors::identification;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Two inputs on a grid of 8 x 8 in [-1.5, 1.5], and a smooth function of them.
struct Smooth {
  MatrixXd Z{64, 2};
  VectorXd y{64};
};
double truth(double a, double b) { return std::sin(a) + 0.5 * a * b; }
Smooth smooth() {
  Smooth s;
  for (int i = 0; i < 64; ++i) {
    s.Z.row(i) << -1.5 + 3.0 * (i % 8) / 7, -1.5 + 3.0 * (i / 8) / 7;
    s.y(i) = truth(s.Z(i, 0), s.Z(i, 1));
  }
  return s;
}

/// Largest miss between the points of training.
template <typename Model>
double worst_between(const Model& model) {
  double worst = 0;
  for (int i = 0; i < 49; ++i) {
    const double a = -1.2 + 2.4 * (i % 7) / 6, b = -1.2 + 2.4 * (i / 7) / 6;
    worst = std::max(worst, std::abs(value(model, Eigen::Vector2d(a, b)) - truth(a, b)));
  }
  return worst;
}

}  // namespace

TEST(Learned, KernelRidgeIsTheClosedForm) {
  Smooth s = smooth();
  s.y.array() += 2;  // so that the bias counts
  KernelRidgeOptions options;
  options.gamma = 0.7;
  options.penalty = 1e-3;
  const KernelSum fit = fit_kernel_ridge(s.Z, s.y, options);
  // min |y - K a - b|^2 + n penalty (a'Ka + b^2): (K + 1 + n penalty) a = y, b = sum a.
  MatrixXd system(64, 64);
  for (int i = 0; i < 64; ++i)
    for (int j = 0; j < 64; ++j)
      system(i, j) =
          1 + std::exp(-0.7 * (s.Z.row(i) - s.Z.row(j)).squaredNorm()) + (i == j ? 64 * 1e-3 : 0);
  const VectorXd a = system.fullPivLu().solve(s.y);
  const KernelSum closed{s.Z, a, a.sum(), 0.7};
  double worst = 0;
  for (double t = -2; t < 2; t += 0.25)
    worst = std::max(worst, std::abs(value(fit, Eigen::Vector2d(t, 0.3 - t)) -
                                     value(closed, Eigen::Vector2d(t, 0.3 - t))));
  std::cout << "kernel ridge against its closed form: " << worst << " with " << fit.weight.size()
            << " of 64 rows\n";
  EXPECT_LT(worst, 5e-3);  // rows that nearly depend on others carry no kernel
}

TEST(Learned, SupportVectorsStayInTheTubeWhereTheCostIsHigh) {
  const Smooth s = smooth();
  SupportVectorOptions options;
  options.gamma = 0.5;
  options.cost = 1e4;
  options.epsilon = 0.02;
  const KernelSum fit = fit_support_vectors(s.Z, s.y, options);
  double worst = 0;
  for (int i = 0; i < 64; ++i)
    worst = std::max(worst, std::abs(value(fit, s.Z.row(i).transpose()) - s.y(i)));
  std::cout << "worst row " << worst << " with a tube of 0.02; " << fit.weight.size()
            << " of 64 rows are support vectors; between them " << worst_between(fit) << '\n';
  EXPECT_LT(worst, 0.02 + 2e-3);
  EXPECT_LT(fit.weight.size(), 64);
  EXPECT_LT(worst_between(fit), 0.05);
}

TEST(Learned, TheNetworkEndsWhereItsLossIsFlat) {
  const Smooth s = smooth();
  NetworkOptions options;
  options.decay = 1e-4;
  options.max_iterations = 5000;
  Network fit = fit_network(s.Z, s.y, options);
  const auto loss = [&](const Network& n) {
    double sum = 0;
    for (int i = 0; i < 64; ++i) sum += std::pow(value(n, s.Z.row(i).transpose()) - s.y(i), 2) / 64;
    return sum + options.decay * (n.in.squaredNorm() + n.out.squaredNorm());
  };
  const double end = loss(fit);
  const double between = worst_between(fit);
  double steepest = 0;
  const auto slope = [&](double& weight) {
    const double w = weight, step = 1e-5;
    weight = w + step;
    const double above = loss(fit);
    weight = w - step;
    steepest = std::max(steepest, std::abs(above - loss(fit)) / (2 * step));
    weight = w;
  };
  for (int i = 0; i < fit.in.size(); ++i) slope(fit.in.data()[i]);
  for (int i = 0; i < fit.out.size(); ++i) slope(fit.out(i)), slope(fit.in_bias(i));
  slope(fit.out_bias);
  std::cout << "loss " << end << ", steepest slope " << steepest << ", between the points "
            << between << '\n';
  EXPECT_LT(end, 0.01);
  EXPECT_LT(steepest, 1e-4);
  EXPECT_LT(between, 0.15);
}

TEST(Learned, TheSameSeedGivesTheSameBitsAndAnotherSeedOthers) {
  const Smooth s = smooth();
  NetworkOptions options;
  options.max_iterations = 50;
  const Network a = fit_network(s.Z, s.y, options), b = fit_network(s.Z, s.y, options);
  EXPECT_EQ(a.in, b.in);
  EXPECT_EQ(a.out_bias, b.out_bias);
  options.seed = 2;
  EXPECT_NE(fit_network(s.Z, s.y, options).in, a.in);
}

TEST(Learned, ConstantReadingsAndOneRowGiveAConstant) {
  const Smooth s = smooth();
  const VectorXd y = VectorXd::Constant(64, 0.3);
  const Eigen::Vector2d z(0.1, 0.2);
  // The bias of kernel ridge is shrunk a little too.
  EXPECT_NEAR(value(fit_kernel_ridge(s.Z, y), z), 0.3, 1e-3);
  EXPECT_NEAR(value(fit_support_vectors(s.Z, y), z), 0.3, 0.0501);
  EXPECT_NEAR(value(fit_network(s.Z, y), z), 0.3, 1e-3);
  EXPECT_NEAR(value(fit_kernel_ridge(s.Z.topRows(1), y.head(1)), s.Z.row(0).transpose()), 0.3,
              1e-3);
  EXPECT_NEAR(value(fit_support_vectors(s.Z.topRows(1), y.head(1)), z), 0.3, 0.0501);
}

TEST(Learned, RefusesWhatHasNoMeaning) {
  const Smooth s = smooth();
  EXPECT_THROW(fit_kernel_ridge(s.Z, s.y.head(3)), std::invalid_argument);
  EXPECT_THROW(fit_support_vectors(MatrixXd(0, 2), VectorXd(0)), std::invalid_argument);
  EXPECT_THROW(fit_network(s.Z, VectorXd::Constant(64, NAN)), std::invalid_argument);
  KernelRidgeOptions options;
  options.penalty = 0;
  EXPECT_THROW(fit_kernel_ridge(s.Z, s.y, options), std::invalid_argument);
}
