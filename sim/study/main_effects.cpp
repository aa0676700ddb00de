#include "sim/study/main_effects.h"

#include <algorithm>
#include <cmath>

namespace abbe::sim::study {
namespace {

constexpr Eigen::Index least_cases = 10;
constexpr double regressors = 2.0;  // line, parabola

Eigen::VectorXd centred(const Eigen::VectorXd& values) { return values.array() - values.mean(); }

/// R^2 less what it has on the average where there is nothing.
double adjusted(double r_squared, Eigen::Index cases) {
  const double n = double(cases);
  return 1.0 - (1.0 - r_squared) * (n - 1.0) / (n - 1.0 - regressors);
}

/// Part of y, which is centred, that lies along a direction.
double explained(const Eigen::VectorXd& y, const Eigen::VectorXd& along) {
  const double size = along.squaredNorm();
  return size > 0.0 ? std::pow(y.dot(along), 2) / size : 0.0;
}

}  // namespace

Eigen::VectorXd main_effects(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& answers) {
  Eigen::VectorXd effects = Eigen::VectorXd::Zero(inputs.rows());
  const Eigen::VectorXd y = centred(answers);
  if (answers.size() < least_cases || !(y.squaredNorm() > 0.0)) return effects;
  for (Eigen::Index i = 0; i < inputs.rows(); ++i) {
    Eigen::VectorXd x = centred(inputs.row(i).transpose());
    const double spread = x.norm() / std::sqrt(double(x.size()));
    if (!(spread > 0.0)) continue;
    x /= spread;  // so that its squares neither vanish nor overflow
    Eigen::VectorXd parabola = centred(x.cwiseProduct(x));
    parabola -= parabola.dot(x) / x.squaredNorm() * x;
    // of two values alone it is nothing but rounding
    const bool bends = parabola.norm() > 1e-9 * x.norm();
    const double r_squared =
        (explained(y, x) + (bends ? explained(y, parabola) : 0.0)) / y.squaredNorm();
    effects[i] = std::clamp(adjusted(r_squared, answers.size()), 0.0, 1.0);
  }
  return effects;
}

double chance_effect(Eigen::Index cases, Eigen::Index inputs) {
  if (cases < least_cases || inputs < 1) return 1.0;
  // R^2 of two regressors is beta distributed: P(R^2 > r) = (1 - r)^((n - 3) / 2)
  const double any = 0.05 / double(inputs);
  return std::max(0.0, adjusted(1.0 - std::pow(any, 2.0 / double(cases - 3)), cases));
}

}  // namespace abbe::sim::study
