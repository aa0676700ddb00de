#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>
#include <tuple>
#include <variant>

#include <fmt/format.h>

#include "errors/identification/design.h"
#include "errors/identification/model.h"
#include "kinematics/symmetric.h"
#include "kinematics/units.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using metrology::Readings;

constexpr int most_sweeps = 4;
constexpr double ridge = 1e-11;  // of unit columns: their normal equations round at 1e-16

/// Lowest order of its element at which a number takes part.
int order_of(const Coefficient& coefficient, const GeometricErrors& model) {
  const Curve& curve =
      model.elements[std::size_t(coefficient.element)].curves[std::size_t(coefficient.curve)];
  if (curve.name == pitch_name) return 0;
  const Shape& shape = curve.shape;
  if (const auto* fourier = std::get_if<Fourier>(&shape))
    return coefficient.number % int(fourier->a.size()) + 1;
  const bool is_series =
      std::holds_alternative<Polynomial>(shape) || std::holds_alternative<Legendre>(shape);
  return is_series ? coefficient.number : 0;
}

/// Sought columns of unit norm, right-hand side, and the fold of every row.
struct OrderProblem {
  MatrixXd A;
  VectorXd b;
  MatrixXd prior;
  std::vector<int> fold;     ///< (rows)
  std::vector<int> element;  ///< (columns) -1: a set-up's
  std::vector<int> order;    ///< (columns)
  int folds = 0;
  int elements = 0;
};

/// Places of one set-up, looked at in any run and from any side, share a fold. The first and the
/// last of a set-up are never left out (fold -1): between targets a curve is asked for, not beyond
/// them.
std::vector<int> folds_of(const Design& design, std::span<const Readings> readings, int folds) {
  std::map<std::tuple<int, int, int>, int> number;  // readings, set-up, target
  for (const Row& row : design.rows) {
    const metrology::Look& look =
        readings[std::size_t(row.readings)].plan.looks[std::size_t(row.look)];
    number.insert({{row.readings, look.set_up, look.target}, 0});
  }
  if (int(number.size()) < folds)
    throw std::invalid_argument(
        fmt::format("expected at least {} targets, one a fold, seen {}", folds, number.size()));
  int next = 0;
  const auto set_up_of = [](const auto& place) {
    return std::pair(std::get<0>(place.first), std::get<1>(place.first));
  };
  for (auto place = number.begin(); place != number.end(); ++place) {
    const auto after = std::next(place);
    const bool first = place == number.begin() || set_up_of(*std::prev(place)) != set_up_of(*place);
    const bool last = after == number.end() || set_up_of(*after) != set_up_of(*place);
    place->second = first || last ? -1 : next++ % folds;
  }
  std::vector<int> result;
  for (const Row& row : design.rows) {
    const metrology::Look& look =
        readings[std::size_t(row.readings)].plan.looks[std::size_t(row.look)];
    result.push_back(number.at({row.readings, look.set_up, look.target}));
  }
  return result;
}

OrderProblem problem_of(const GeometricErrors& model, std::span<const Readings> readings,
                        int folds) {
  const Design d = design(model, readings);
  const VectorXd at_start = predicted(model, readings, d, start(model, d.unknowns));
  OrderProblem problem;
  std::vector<Index> columns;
  for (Index j = 0; j < d.unknowns.size(); ++j) {
    if (!d.sought[std::size_t(j)]) continue;
    columns.push_back(j);
    const bool is_number = j < Index(d.unknowns.coefficients.size());
    const Coefficient none{-1, 0, 0};
    const Coefficient& number = is_number ? d.unknowns.coefficients[std::size_t(j)] : none;
    problem.element.push_back(number.element);
    problem.order.push_back(is_number ? order_of(number, model) : 0);
  }
  problem.A = d.A(Eigen::all, columns);
  problem.prior = d.prior(Eigen::all, columns);
  for (Index j = 0; j < problem.A.cols(); ++j) {
    const double norm = std::hypot(problem.A.col(j).norm(), problem.prior.col(j).norm());
    problem.A.col(j) /= norm;
    problem.prior.col(j) /= norm;
  }
  problem.b = (observed(readings, d) - at_start).cwiseQuotient(d.sigma);
  problem.fold = folds_of(d, readings, folds);
  problem.folds = folds;
  problem.elements = int(model.elements.size());
  return problem;
}

std::vector<Index> rows_where(const OrderProblem& problem, int fold, bool inside) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < problem.fold.size(); ++i)
    if ((problem.fold[i] == fold) == inside) rows.push_back(Index(i));
  return rows;
}

/// The columns of one element last and its orders rising, so that every lower order is a leading
/// block of the highest; those of the others up to their orders.
std::vector<Index> element_last(const OrderProblem& problem, int element,
                                const std::vector<int>& orders) {
  std::vector<Index> columns;
  for (std::size_t j = 0; j < problem.order.size(); ++j) {
    const int own = problem.element[j];
    if (own < 0 || own == element || problem.order[j] <= orders[std::size_t(own)])
      columns.push_back(Index(j));
  }
  std::stable_sort(columns.begin(), columns.end(), [&](Index a, Index b) {
    const auto key = [&](Index j) {
      const auto at = std::size_t(j);
      return problem.element[at] == element ? problem.order[at] : -1;
    };
    return key(a) < key(b);
  });
  return columns;
}

/// Squares of the prediction errors of one fold, per order tried, and how many they are of.
struct Score {
  VectorXd squares;
  int readings = 0;
};

/// Normal equations of everything but one fold.
struct Training {
  MatrixXd G;
  VectorXd h;
  std::vector<Index> left_out;
};

Training training(const OrderProblem& problem, int fold) {
  const std::vector<Index> in = rows_where(problem, fold, false);
  const MatrixXd A = problem.A(in, Eigen::all);
  MatrixXd G = MatrixXd::Zero(A.cols(), A.cols());
  G.selfadjointView<Eigen::Lower>().rankUpdate(A.transpose());
  G.selfadjointView<Eigen::Lower>().rankUpdate(problem.prior.transpose());
  G.diagonal().array() += ridge;
  return {G.selfadjointView<Eigen::Lower>(), A.transpose() * problem.b(in),
          rows_where(problem, fold, true)};
}

Score score(const OrderProblem& problem, const Training& fold, int element,
            const std::vector<int>& orders, int most) {
  const std::vector<Index> columns = element_last(problem, element, orders);
  const MatrixXd L = cholesky(fold.G(columns, columns)).L;
  const VectorXd half = L.triangularView<Eigen::Lower>().solve(fold.h(columns));
  std::vector<Index> rows;  // readings that see the element
  for (const Index i : fold.left_out)
    for (const Index j : columns)
      if (problem.element[std::size_t(j)] == element && problem.A(i, j) != 0.0) {
        rows.push_back(i);
        break;
      }
  Score result{VectorXd::Zero(most + 1), int(rows.size())};
  const MatrixXd A = problem.A(rows, columns);
  for (int order = 0; order <= most; ++order) {
    const Index n = std::count_if(columns.begin(), columns.end(), [&](Index j) {
      const auto at = std::size_t(j);
      return problem.element[at] != element || problem.order[at] <= order;
    });
    const VectorXd x =
        L.topLeftCorner(n, n).transpose().triangularView<Eigen::Upper>().solve(half.head(n));
    result.squares[order] = (problem.b(rows) - A.leftCols(n) * x).squaredNorm();
  }
  return result;
}

// What all orders predict equally badly says nothing of the order, so each is compared with the
// best fold by fold, and the standard error is that of the difference.
int smallest_good(const std::vector<VectorXd>& mean_square_of_folds) {
  const auto folds = double(mean_square_of_folds.size());
  VectorXd mean = VectorXd::Zero(mean_square_of_folds[0].size());
  for (const VectorXd& f : mean_square_of_folds) mean += f / folds;
  Index best = 0;
  mean.minCoeff(&best);
  for (int order = 0; order < best; ++order) {
    const double worse = mean[order] - mean[best];
    double spread = 0.0;
    for (const VectorXd& f : mean_square_of_folds) {
      const double off = f[order] - f[best] - worse;
      spread += off * off;
    }
    if (worse <= std::sqrt(spread / (folds - 1.0) / folds)) return order;
  }
  return int(best);
}

// Over part of a turn harmonics are nearly dependent, on each other and on a constant; there no
// more are tried than the model has.
ModelOptions at_highest(ModelOptions model, const kinematics::Chain& nominal, int most) {
  model.orders.clear();
  for (const kinematics::Joint& joint : nominal.joints())
    if (joint.motion == kinematics::Motion::Rotary && joint.max - joint.min < 2.0 * pi - 1e-9)
      for (const char direction : {'X', 'Y', 'Z', 'A', 'B', 'C'})
        model.orders[to_string(ElementName{direction, joint.name, false})] =
            std::min(model.harmonics, most);
  model.order = most;
  model.harmonics = most;
  if (model.spindle_harmonics > 0) model.spindle_harmonics = most;
  return model;
}

void check(const ModelOptions& model, const OrderOptions& options) {
  if (model.slides == Basis::Spline)
    throw std::invalid_argument("orders of splines do not hold each other: choose another basis");
  if (options.folds < 2) throw std::invalid_argument("expected at least 2 folds");
  if (options.most < 0) throw std::invalid_argument("expected a highest order of 0 or more");
}

}  // namespace

OrderChoice choose_orders(std::span<const Readings> readings, const ModelOptions& model,
                          const OrderOptions& options) {
  check(model, options);
  if (readings.empty()) throw std::invalid_argument("there are no readings");
  const GeometricErrors highest =
      model_of(readings.front().nominal, at_highest(model, readings.front().nominal, options.most));
  const OrderProblem problem = problem_of(highest, readings, options.folds);
  std::vector<Training> folds;
  for (int f = 0; f < options.folds; ++f) folds.push_back(training(problem, f));
  std::vector<int> orders(std::size_t(problem.elements), options.most);
  OrderChoice choice;
  // the first sweep has all other elements at the highest order
  constexpr std::array done{0.0, 0.6, 0.8, 0.9, 1.0};
  static_assert(done.size() == most_sweeps + 1);
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    const std::vector<int> before = orders;
    for (int e = 0; e < problem.elements; ++e) {
      if (options.progress)
        options.progress(
            (done[std::size_t(sweep)] * (problem.elements - e) + done[std::size_t(sweep) + 1] * e) /
            problem.elements);
      if (highest.elements[std::size_t(e)].name.location) continue;
      std::vector<VectorXd> mean_squares;
      Score total{VectorXd::Zero(options.most + 1), 0};
      for (const Training& fold : folds) {
        const Score s = score(problem, fold, e, before, options.most);
        if (s.readings == 0) continue;
        mean_squares.push_back(s.squares / s.readings);
        total.squares += s.squares;
        total.readings += s.readings;
      }
      if (mean_squares.size() < 2) continue;  // seen from too few places
      const std::string name = to_string(highest.elements[std::size_t(e)].name);
      orders[std::size_t(e)] = choice.orders[name] = smallest_good(mean_squares);
      choice.rms[name] = (total.squares / total.readings).cwiseSqrt();
    }
    if (orders == before) break;
  }
  return choice;
}

}  // namespace abbe::errors::identification
