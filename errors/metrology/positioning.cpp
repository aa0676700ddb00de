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
      throw std::invalid_argument("positioning: expected increasing targets");
  if (runs.up.cols() == 0 && runs.down.cols() == 0)
    throw std::invalid_argument("positioning: expected at least one run");
  for (const MatrixXd* deviations : {&runs.up, &runs.down})
    if (deviations->cols() > 0 && deviations->rows() != m)
      throw std::invalid_argument("positioning: expected one row of deviations per target");
}

/// Returns the results for one direction of approach, or nothing if it was not measured.
std::optional<UnidirectionalPositioning> evaluate_direction(const MatrixXd& x) {
  if (x.cols() == 0) return std::nullopt;
  UnidirectionalPositioning result;
  result.mean = x.rowwise().mean();
  result.E = range(result.mean);
  // A single run has no standard deviation, so R and A remain empty.
  if (x.cols() == 1) return result;
  const MatrixXd from_mean = x.colwise() - result.mean;
  result.s = (from_mean.rowwise().squaredNorm() / double(x.cols() - 1)).cwiseSqrt();
  // ISO 230-2:2014 uses the coverage factor 2: R_i = 4 s_i.
  result.repeatability = 4.0 * result.s;
  result.R = result.repeatability.maxCoeff();
  result.A = (result.mean + 2.0 * result.s).maxCoeff() - (result.mean - 2.0 * result.s).minCoeff();
  return result;
}

/// Adds the bidirectional repeatability and accuracy.
void add_repeatability(const UnidirectionalPositioning& up, const UnidirectionalPositioning& down,
                       Positioning& both) {
  // ISO 230-2: the bidirectional repeatability is never smaller than that of either direction.
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
  result.up = evaluate_direction(runs.up);
  result.down = evaluate_direction(runs.down);
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

VectorXd run_mean(const PositionRuns& runs) {
  VectorXd sum = VectorXd::Zero(runs.target.size());
  if (runs.up.cols() > 0) sum += runs.up.rowwise().sum();
  if (runs.down.cols() > 0) sum += runs.down.rowwise().sum();
  return sum / double(runs.up.cols() + runs.down.cols());
}

namespace {

/// Returns the signs such that the first one not 0 is 1: the same for a diagonal and its reverse.
std::array<int, 3> canonical_signs(std::array<int, 3> signs) {
  const auto first = std::find_if(signs.begin(), signs.end(), [](int s) { return s != 0; });
  if (first != signs.end() && *first < 0)
    for (int& s : signs) s = -s;
  return signs;
}

void check(const std::vector<DiagonalRuns>& set) {
  if (set.empty()) throw std::invalid_argument("diagonals: expected at least one diagonal");
  for (std::size_t i = 0; i < set.size(); ++i) {
    const auto& signs = set[i].signs;
    const auto zeros = std::count(signs.begin(), signs.end(), 0);
    const bool has_valid_signs =
        std::all_of(signs.begin(), signs.end(), [](int s) { return s * s <= 1; });
    if (!has_valid_signs || zeros > 1)
      throw std::invalid_argument("diagonals: expected signs -1, 0, 1 and at most one 0");
    for (std::size_t k = 0; k < i; ++k)
      if (canonical_signs(set[k].signs) == canonical_signs(signs))
        throw std::invalid_argument("diagonals: expected each diagonal only once");
  }
}

/// Returns E of both directions, or of the only measured direction.
double systematic_deviation(const Positioning& result) {
  if (result.E) return *result.E;
  return result.up ? result.up->E : result.down->E;
}

}  // namespace

Diagonals diagonals(const std::vector<DiagonalRuns>& set) {
  check(set);
  Diagonals result;
  result.B_d = 0.0;
  for (const DiagonalRuns& diagonal : set) {
    result.each.push_back(positioning(diagonal.runs));
    const Positioning& latest = result.each.back();
    result.E_d = std::max(result.E_d, systematic_deviation(latest));
    if (latest.B && result.B_d)
      result.B_d = std::max(*result.B_d, *latest.B);
    else
      result.B_d.reset();
  }
  return result;
}

}  // namespace abbe::errors::metrology
