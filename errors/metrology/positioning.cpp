#include "errors/metrology/positioning.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace abbe::errors::metrology {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void check(const PositionRuns& runs) {
  const Eigen::Index m = runs.target.size();
  if (m < 2) throw std::invalid_argument("positioning: expected at least 2 targets");
  if (!runs.target.allFinite() || !runs.up.allFinite() || !runs.down.allFinite())
    throw std::invalid_argument("positioning: expected finite numbers");
  for (Eigen::Index i = 1; i < m; ++i)
    if (!(runs.target[i] > runs.target[i - 1]))
      throw std::invalid_argument("positioning: expected targets that increase");
  if (runs.up.cols() == 0 && runs.down.cols() == 0)
    throw std::invalid_argument("positioning: expected at least one run");
  for (const MatrixXd* way : {&runs.up, &runs.down})
    if (way->cols() > 0 && way->rows() != m)
      throw std::invalid_argument("positioning: expected a row of deviations for every target");
}

std::optional<OneWayPositioning> one_way(const MatrixXd& x) {
  if (x.cols() == 0) return std::nullopt;
  OneWayPositioning result;
  result.mean = x.rowwise().mean();
  result.E = range(result.mean);
  if (x.cols() == 1) return result;
  const MatrixXd from_mean = x.colwise() - result.mean;
  result.s = (from_mean.rowwise().squaredNorm() / double(x.cols() - 1)).cwiseSqrt();
  result.repeatability = 4.0 * result.s;
  result.R = result.repeatability.maxCoeff();
  result.A = (result.mean + 2.0 * result.s).maxCoeff() - (result.mean - 2.0 * result.s).minCoeff();
  return result;
}

void add_repeatability(const OneWayPositioning& up, const OneWayPositioning& down,
                       Positioning& both) {
  both.repeatability = (2.0 * up.s + 2.0 * down.s + both.reversal.cwiseAbs())
                           .cwiseMax(up.repeatability)
                           .cwiseMax(down.repeatability);
  both.R = both.repeatability.maxCoeff();
  const VectorXd highest = (up.mean + 2.0 * up.s).cwiseMax(down.mean + 2.0 * down.s);
  const VectorXd lowest = (up.mean - 2.0 * up.s).cwiseMin(down.mean - 2.0 * down.s);
  both.A = highest.maxCoeff() - lowest.minCoeff();
}

}  // namespace

double range(const VectorXd& values) { return values.maxCoeff() - values.minCoeff(); }

Positioning positioning(const PositionRuns& runs) {
  check(runs);
  Positioning result;
  result.target = runs.target;
  result.up = one_way(runs.up);
  result.down = one_way(runs.down);
  if (!result.up || !result.down) return result;
  const VectorXd& up = result.up->mean;
  const VectorXd& down = result.down->mean;
  result.reversal = up - down;
  result.mean = 0.5 * (up + down);
  result.B = result.reversal.cwiseAbs().maxCoeff();
  result.B_mean = result.reversal.mean();
  result.M = range(result.mean);
  result.E = up.cwiseMax(down).maxCoeff() - up.cwiseMin(down).minCoeff();
  if (result.up->R && result.down->R) add_repeatability(*result.up, *result.down, result);
  return result;
}

VectorXd mean_of(const PositionRuns& runs) {
  VectorXd sum = VectorXd::Zero(runs.target.size());
  if (runs.up.cols() > 0) sum += runs.up.rowwise().sum();
  if (runs.down.cols() > 0) sum += runs.down.rowwise().sum();
  return sum / double(runs.up.cols() + runs.down.cols());
}

}  // namespace abbe::errors::metrology
