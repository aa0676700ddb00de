#include "errors/identification/model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <variant>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "errors/element.h"
#include "errors/identification/design.h"
#include "kinematics/chain.h"
#include "kinematics/decompositions.h"
#include "kinematics/units.h"

namespace abbe::errors::identification {

namespace {

using Eigen::Index;
using Eigen::VectorXd;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr int order_limit = 60;
constexpr double unlimited = 1e8;  // mm; limits as wide as this mean that no travel was stated

/// Returns the index of the coordinate axis nearest to the direction of a joint.
Index nearest_axis(const Joint& joint) {
  Index k = 0;
  joint.direction_b.cwiseAbs().maxCoeff(&k);
  return k;
}

/// Element with the coefficients that are held at their values.
struct ElementModel {
  Element element;
  std::vector<std::pair<int, int>> held;  ///< indices of curve and coefficient
};

void check_order(const std::string& name, int order) {
  if (order < 0 || order > order_limit)
    throw std::invalid_argument(
        fmt::format("{}: expected an order from 0 to {}, seen {}", name, order_limit, order));
}

int element_order(const ElementName& name, int default_order, const ModelOptions& options) {
  const auto order_override = options.orders.find(to_string(name));
  return order_override == options.orders.end() ? default_order : order_override->second;
}

/// States which parameters of a straight line are identified. The others are held.
struct Line {
  bool constant = false;
  bool slope = false;
};

/// Adds a series whose coefficients 0 and 1 are constant and slope.
void add_polynomial_series(ElementModel& p, Shape shape, int order, const Line& line) {
  const int curve = int(p.element.curves.size());
  if (order == 0 && !line.constant) return;
  if (!line.constant) p.held.emplace_back(curve, 0);
  if (!line.slope && order >= 1) p.held.emplace_back(curve, 1);
  p.element.curves.push_back({std::move(shape)});
}

void add_spline(ElementModel& p, double low, double high, int order, const Line& line) {
  if (order == 0) return;
  // A spline is linear in its knot values; holding the first fixes its constant, holding the last
  // its slope.
  const int curve = int(p.element.curves.size());
  const VectorXd q = VectorXd::LinSpaced(order + 1, low, high);
  if (!line.constant) p.held.emplace_back(curve, 0);
  if (!line.slope) p.held.emplace_back(curve, order);
  p.element.curves.push_back({make_table(q, VectorXd::Zero(order + 1), TableInterpolation::Spline,
                                         TableExtrapolation::Hold)});
}

void add_fourier(ElementModel& p, int order, double period) {
  if (order > 0)
    p.element.curves.push_back({Fourier{VectorXd::Zero(order), VectorXd::Zero(order), period}});
}

/// Adds the curves of an error motion of a slide.
void add_slide_curves(ElementModel& p, const Joint& joint, const ModelOptions& options) {
  const std::string element_name = to_string(p.element.name);
  if (!(joint.max - joint.min < unlimited))
    throw std::invalid_argument(
        fmt::format("{}: the travel of its axis is not stated", element_name));
  if (!(joint.max > joint.min))
    throw std::invalid_argument(fmt::format("{}: the travel of its axis is 0", element_name));
  const int order = element_order(p.element.name, options.order, options);
  check_order(element_name, order);
  const bool is_angle = p.element.name.is_angle();
  const bool is_positioning = !is_angle && p.element.name.component() == int(nearest_axis(joint));
  const Line line{options.constants, is_angle || is_positioning || options.straightness_slopes};
  const double centre = 0.5 * (joint.min + joint.max);
  const double half_travel = 0.5 * (joint.max - joint.min);
  switch (options.slides) {
    case Basis::Polynomial:
      add_polynomial_series(p, Polynomial{VectorXd::Zero(order + 1), centre, half_travel}, order,
                            line);
      break;
    case Basis::Legendre:
      add_polynomial_series(p, Legendre{VectorXd::Zero(order + 1), centre, half_travel}, order,
                            line);
      break;
    case Basis::Fourier:
      add_polynomial_series(p, Legendre{VectorXd::Zero(2), centre, half_travel}, 1, line);
      add_fourier(p, order, 2.0 * half_travel);
      break;
    case Basis::Spline:
      add_spline(p, joint.min, joint.max, order, line);
      break;
  }
}

/// Returns true if order 1 of this error motion of a table, together with order 1 of the other one
/// across its axis, has the effect of a shift or tilt of the workpiece on the table.
bool is_workpiece_placement(const ElementName& name, const Joint& joint) {
  const int first_across = nearest_axis(joint) == 0 ? 1 : 0;
  return joint.motion == Motion::Rotary && joint.side == kinematics::Side::Workpiece &&
         name.component() % 3 == first_across;
}

/// Adds the curves of an error motion of a rotary axis or a spindle.
void add_turning_curves(ElementModel& p, const Joint& joint, const ModelOptions& options) {
  const bool is_nose = joint.motion == Motion::Spindle;
  const int default_order = is_nose ? options.spindle_harmonics : options.harmonics;
  const int order = element_order(p.element.name, default_order, options);
  check_order(to_string(p.element.name), order);
  if (is_nose || options.constants) p.element.curves.push_back({Constant{}});
  if (!options.placement && order > 0 && is_workpiece_placement(p.element.name, joint)) {
    const int curve = int(p.element.curves.size());
    p.held.emplace_back(curve, 0);
    p.held.emplace_back(curve, order);
  }
  add_fourier(p, order, 2.0 * std::numbers::pi);
}

/// Returns the model of one error motion of a joint.
ElementModel motion_model(const ElementName& name, const Joint& joint,
                          const ModelOptions& options) {
  ElementModel p{{name, {}}, {}};
  if (joint.motion == Motion::Linear) {
    add_slide_curves(p, joint, options);
  } else {
    add_turning_curves(p, joint, options);
  }
  const int moving_component = int(nearest_axis(joint)) + (joint.motion == Motion::Rotary ? 3 : 0);
  const auto pitch = options.pitch.find(joint.name);
  if (pitch != options.pitch.end() && name.component() == moving_component) {
    add_fourier(p, 2, pitch->second);
    p.element.curves.back().name = pitch_name;
  }
  if (options.backlash && joint.motion != Motion::Spindle && name.component() == moving_component)
    p.element.curves.push_back({Backlash{}});
  return p;
}

bool is_meaningful(const ElementName& name, const Chain& chain, int joint) {
  try {
    check_meaning(name, chain, joint);
  } catch (const std::invalid_argument&) {
    return false;
  }
  return true;
}

constexpr char letters[] = "XYZABC";

std::vector<ElementModel> motion_models(const Chain& chain, const ModelOptions& options) {
  std::vector<ElementModel> result;
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    const bool is_nose = joint.motion == Motion::Spindle;
    if (is_nose && chain.find('S')) continue;  // S is then the name of the work spindle
    for (int component = 0; component < 6; ++component) {
      const ElementName name{letters[component], is_nose ? 'S' : joint.name, false};
      if (is_meaningful(name, chain, j)) result.push_back(motion_model(name, joint, options));
    }
  }
  return result;
}

/// Returns the angles between the main slides, each pair once.
std::vector<ElementName> squarenesses(const Chain& chain) {
  const auto slides = kinematics::main_slides(chain.joints());
  std::vector<ElementName> result;
  for (const auto& [secondary, direction] : {std::pair(1, 'C'), {2, 'B'}, {2, 'A'}}) {
    const std::optional<int> slide = slides[std::size_t(secondary)];
    if (!slide) continue;
    const ElementName name{direction, chain.joints()[std::size_t(*slide)].name, true};
    if (is_meaningful(name, chain, *slide)) result.push_back(name);
  }
  return result;
}

/// Returns two angles and two offsets of every rotary axis. A work spindle has none: constants of
/// its error motions are equivalent to them.
std::vector<ElementName> axis_locations(const Chain& chain) {
  std::vector<ElementName> result;
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.motion != Motion::Rotary || joint.name == 'S') continue;
    for (int component = 0; component < 6; ++component) {
      const ElementName name{letters[component], joint.name, true};
      if (component % 3 != int(nearest_axis(joint)) && is_meaningful(name, chain, j))
        result.push_back(name);
    }
  }
  return result;
}

std::vector<ElementModel> all_element_models(const Chain& chain, const ModelOptions& options) {
  std::vector<ElementModel> models = motion_models(chain, options);
  if (!options.locations) return models;
  std::vector<ElementName> names = squarenesses(chain);
  for (const ElementName& name : axis_locations(chain)) names.push_back(name);
  for (const ElementName& name : names) models.push_back({{name, {Curve{Constant{}}}}, {}});
  return models;
}

void check_element_names(const std::string& name, const std::vector<ElementModel>& models) {
  for (const ElementModel& p : models)
    if (to_string(p.element.name) == name) return;
  throw std::invalid_argument(
      fmt::format("expected an element that applies to this machine, seen {}", name));
}

}  // namespace

GeometricErrors error_model(const Chain& nominal, const ModelOptions& options) {
  check_order("order of the slides", options.order);
  check_order("harmonics of the rotary axes", options.harmonics);
  check_order("harmonics of the spindle nose", options.spindle_harmonics);
  for (const auto& [axis, period] : options.pitch) {
    const auto joint = nominal.find(axis);
    if (!joint || nominal.joints()[std::size_t(*joint)].motion != Motion::Linear)
      throw std::invalid_argument(
          fmt::format("pitch: expected a slide of this machine, seen {}", axis));
    if (!(period > 0.0 && period < unlimited))
      throw std::invalid_argument(
          fmt::format("pitch of {}: expected a pitch above 0 mm, seen {}", axis, period));
  }
  const std::vector<ElementModel> models = all_element_models(nominal, options);
  for (const std::string& name : options.only) check_element_names(name, models);
  for (const auto& order_override : options.orders)
    check_element_names(order_override.first, models);

  GeometricErrors model;
  for (const ElementModel& p : models) {
    const std::string name = to_string(p.element.name);
    const auto& selected = options.only;
    if (!selected.empty() && std::find(selected.begin(), selected.end(), name) == selected.end())
      continue;
    // An element whose coefficients are all held has nothing to identify.
    if (coefficients({p.element}).size() == p.held.size()) continue;
    for (const auto& [curve, number] : p.held)
      model.covariance.of.push_back({int(model.elements.size()), curve, number});
    model.elements.push_back(p.element);
  }
  const auto held = Index(model.covariance.of.size());
  model.covariance.matrix = Eigen::MatrixXd::Zero(held, held);
  return model;
}

std::string coefficient_element(const std::string& coefficient_name) {
  return coefficient_name.substr(0, coefficient_name.find_first_of(" ["));
}

double display_unit(const std::string& coefficient_name) {
  return parse_element_name(coefficient_element(coefficient_name)).is_angle() ? units::urad
                                                                              : units::um;
}

double typical_deviation(const std::string& coefficient_name) {
  const ElementName name = parse_element_name(coefficient_element(coefficient_name));
  const double unit = display_unit(coefficient_name);
  // Half of the tolerances of ISO 10791-1 and -2, as listed in the header.
  if (name.location) return 20.0 * unit;
  const double element_deviation =
      name.axis == 'S' ? (name.is_angle() ? 10.0 : 5.0) : (name.is_angle() ? 15.0 : 5.0);
  // The order is the number at the end: 2 in "EXX[2]" and "EXC cos 2".
  const std::size_t first_digit = coefficient_name.find_last_not_of("0123456789]") + 1;
  const std::string order = coefficient_name.substr(
      first_digit, std::min<std::size_t>(6, coefficient_name.find(']', first_digit) - first_digit));
  const bool has_order = first_digit > to_string(name).size() && !order.empty();
  return element_deviation * unit / (has_order ? std::max(1, std::stoi(order)) : 1);
}

namespace {

using Eigen::MatrixXd;
using metrology::Readings;

constexpr int max_sweeps = 4;
constexpr double ridge = 1e-11;  // relative to unit columns, whose normal equations have a rounding
                                 // of 1e-16

/// Returns the lowest order of its element that includes a coefficient.
int element_order(const Coefficient& coefficient, const GeometricErrors& model) {
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

/// Linear least-squares problem for the choice of orders: sought columns scaled to unit norm,
/// right-hand side, and the fold of every row.
struct OrderProblem {
  MatrixXd A;
  VectorXd b;
  MatrixXd prior;
  std::vector<int> fold;     ///< (rows) -1: never left out
  std::vector<int> element;  ///< (columns) index of the element; -1: unknown of a set-up
  std::vector<int> order;    ///< (columns) lowest order that includes the column
  int folds = 0;
  int elements = 0;
};

/// Returns the fold of every row. All readings of one target of a set-up, in any run and direction,
/// belong to one fold. The first and the last target are never left out (fold -1): a curve must
/// interpolate between targets, not extrapolate beyond them.
std::vector<int> fold_numbers(const Design& design, std::span<const Readings> readings, int folds) {
  std::map<std::tuple<int, int, int>, int> fold_of_target;  // key: readings, set-up, target
  for (const Row& row : design.rows) {
    const metrology::Measurement& measurement =
        readings[std::size_t(row.readings)].plan.measurements[std::size_t(row.measurement)];
    fold_of_target.insert({{row.readings, measurement.set_up, measurement.target}, 0});
  }
  if (int(fold_of_target.size()) < folds)
    throw std::invalid_argument(fmt::format("expected at least {} targets, one per fold, seen {}",
                                            folds, fold_of_target.size()));
  int interior_count = 0;
  const auto set_up_key = [](const auto& entry) {
    return std::pair(std::get<0>(entry.first), std::get<1>(entry.first));
  };
  for (auto entry = fold_of_target.begin(); entry != fold_of_target.end(); ++entry) {
    const auto following = std::next(entry);
    const bool first =
        entry == fold_of_target.begin() || set_up_key(*std::prev(entry)) != set_up_key(*entry);
    const bool last =
        following == fold_of_target.end() || set_up_key(*following) != set_up_key(*entry);
    entry->second = first || last ? -1 : interior_count++ % folds;
  }
  std::vector<int> result;
  for (const Row& row : design.rows) {
    const metrology::Measurement& measurement =
        readings[std::size_t(row.readings)].plan.measurements[std::size_t(row.measurement)];
    result.push_back(fold_of_target.at({row.readings, measurement.set_up, measurement.target}));
  }
  return result;
}

/// Returns the problem linearised at the start, with columns scaled to unit norm.
OrderProblem order_problem(const GeometricErrors& model, std::span<const Readings> readings,
                           int folds) {
  const Design d = design(model, readings);
  const VectorXd at_start = predicted_readings(model, readings, d, start(model, d.unknowns));
  OrderProblem problem;
  std::vector<Index> columns;
  for (Index j = 0; j < d.unknowns.size(); ++j) {
    if (!d.is_sought[std::size_t(j)]) continue;
    columns.push_back(j);
    const bool is_coefficient = j < Index(d.unknowns.coefficients.size());
    const Coefficient none{-1, 0, 0};
    const Coefficient& coefficient =
        is_coefficient ? d.unknowns.coefficients[std::size_t(j)] : none;
    problem.element.push_back(coefficient.element);
    problem.order.push_back(is_coefficient ? element_order(coefficient, model) : 0);
  }
  problem.A = d.A(Eigen::all, columns);
  problem.prior = d.prior(Eigen::all, columns);
  for (Index j = 0; j < problem.A.cols(); ++j) {
    const double norm = std::hypot(problem.A.col(j).norm(), problem.prior.col(j).norm());
    problem.A.col(j) /= norm;
    problem.prior.col(j) /= norm;
  }
  problem.b = (observed_readings(readings, d) - at_start).cwiseQuotient(d.sigma);
  problem.fold = fold_numbers(d, readings, folds);
  problem.folds = folds;
  problem.elements = int(model.elements.size());
  return problem;
}

/// Returns the rows of a fold, or all others.
std::vector<Index> select_rows(const OrderProblem& problem, int fold, bool inside) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < problem.fold.size(); ++i)
    if ((problem.fold[i] == fold) == inside) rows.push_back(Index(i));
  return rows;
}

/// Returns the columns of all elements up to their orders and all columns of one element. The
/// latter come last and in ascending order, so that the equations of a lower order are a leading
/// block.
std::vector<Index> columns_for_element(const OrderProblem& problem, int element,
                                       const std::vector<int>& orders) {
  std::vector<Index> columns;
  for (std::size_t j = 0; j < problem.order.size(); ++j) {
    const int column_element = problem.element[j];
    if (column_element < 0 || column_element == element ||
        problem.order[j] <= orders[std::size_t(column_element)])
      columns.push_back(Index(j));
  }
  std::stable_sort(columns.begin(), columns.end(), [&](Index a, Index b) {
    const auto key = [&](Index j) {
      const auto column = std::size_t(j);
      return problem.element[column] == element ? problem.order[column] : -1;
    };
    return key(a) < key(b);
  });
  return columns;
}

/// Prediction errors of one fold.
struct Score {
  VectorXd squares;  ///< (orders) sum of squared prediction errors
  int readings = 0;  ///< number of predicted readings
};

/// Normal equations G x = h of all rows outside a fold.
struct Training {
  MatrixXd G;
  VectorXd h;
  std::vector<Index> left_out;  ///< rows of the fold
};

/// Returns the normal equations of all rows outside a fold, with the prior.
Training training(const OrderProblem& problem, int fold) {
  const std::vector<Index> training_rows = select_rows(problem, fold, false);
  const MatrixXd A = problem.A(training_rows, Eigen::all);
  MatrixXd G = MatrixXd::Zero(A.cols(), A.cols());
  G.selfadjointView<Eigen::Lower>().rankUpdate(A.transpose());
  G.selfadjointView<Eigen::Lower>().rankUpdate(problem.prior.transpose());
  G.diagonal().array() += ridge;
  return {G.selfadjointView<Eigen::Lower>(), A.transpose() * problem.b(training_rows),
          select_rows(problem, fold, true)};
}

/// Returns the prediction errors of a fold for every order of one element.
Score score(const OrderProblem& problem, const Training& fold, int element,
            const std::vector<int>& orders, int highest_order) {
  // One Cholesky factor serves all orders: the equations of a lower order are its leading block.
  const std::vector<Index> columns = columns_for_element(problem, element, orders);
  const MatrixXd L = cholesky(fold.G(columns, columns)).L;
  const VectorXd forward_solution = L.triangularView<Eigen::Lower>().solve(fold.h(columns));
  std::vector<Index> rows;  // readings that depend on the element
  for (const Index i : fold.left_out)
    for (const Index j : columns)
      if (problem.element[std::size_t(j)] == element && problem.A(i, j) != 0.0) {
        rows.push_back(i);
        break;
      }
  Score result{VectorXd::Zero(highest_order + 1), int(rows.size())};
  const MatrixXd A = problem.A(rows, columns);
  for (int order = 0; order <= highest_order; ++order) {
    const Index n = std::count_if(columns.begin(), columns.end(), [&](Index j) {
      const auto column = std::size_t(j);
      return problem.element[column] != element || problem.order[column] <= order;
    });
    const VectorXd x = L.topLeftCorner(n, n).transpose().triangularView<Eigen::Upper>().solve(
        forward_solution.head(n));
    result.squares[order] = (problem.b(rows) - A.leftCols(n) * x).squaredNorm();
  }
  return result;
}

/// Returns the smallest order within one standard error of the best. Errors common to all orders
/// carry no information about the order, so each order is compared with the best fold by fold, and
/// the standard error is that of the difference.
int smallest_sufficient_order(const std::vector<VectorXd>& mean_square_of_folds) {
  const auto folds = double(mean_square_of_folds.size());
  VectorXd mean = VectorXd::Zero(mean_square_of_folds[0].size());
  for (const VectorXd& f : mean_square_of_folds) mean += f / folds;
  Index best = 0;
  mean.minCoeff(&best);
  for (int order = 0; order < best; ++order) {
    const double worse = mean[order] - mean[best];
    double spread = 0.0;
    for (const VectorXd& f : mean_square_of_folds) {
      const double deviation = f[order] - f[best] - worse;
      spread += deviation * deviation;
    }
    if (worse <= std::sqrt(spread / (folds - 1.0) / folds)) return order;
  }
  return int(best);
}

/// Returns the options with all orders at the highest order to be tried. Over part of a turn
/// harmonics are nearly dependent on each other and on a constant, so no more are tried there than
/// the model has.
ModelOptions with_highest_orders(ModelOptions model, const kinematics::Chain& nominal,
                                 int highest_order) {
  model.orders.clear();
  for (const kinematics::Joint& joint : nominal.joints())
    if (joint.motion == kinematics::Motion::Rotary && joint.max - joint.min < 2.0 * pi - 1e-9)
      for (const char direction : {'X', 'Y', 'Z', 'A', 'B', 'C'})
        model.orders[to_string(ElementName{direction, joint.name, false})] =
            std::min(model.harmonics, highest_order);
  model.order = highest_order;
  model.harmonics = highest_order;
  if (model.spindle_harmonics > 0) model.spindle_harmonics = highest_order;
  return model;
}

void check(const ModelOptions& model, const OrderOptions& options) {
  if (model.slides == Basis::Spline)
    throw std::invalid_argument(
        "spline models of different order are not nested: choose another basis");
  if (options.folds < 2) throw std::invalid_argument("expected at least 2 folds");
  if (options.max_order < 0) throw std::invalid_argument("expected a highest order of at least 0");
}

}  // namespace

OrderChoice choose_orders(std::span<const Readings> readings, const ModelOptions& model,
                          const OrderOptions& options) {
  check(model, options);
  if (readings.empty()) throw std::invalid_argument("there are no readings");
  const GeometricErrors highest =
      error_model(readings.front().nominal,
                  with_highest_orders(model, readings.front().nominal, options.max_order));
  const OrderProblem problem = order_problem(highest, readings, options.folds);
  std::vector<Training> folds;
  for (int f = 0; f < options.folds; ++f) folds.push_back(training(problem, f));
  std::vector<int> orders(std::size_t(problem.elements), options.max_order);
  OrderChoice choice;
  // Finished fraction before each sweep: the first takes longest, since all other elements are at
  // their highest order.
  constexpr std::array finished{0.0, 0.6, 0.8, 0.9, 1.0};
  static_assert(finished.size() == max_sweeps + 1);
  for (int sweep = 0; sweep < max_sweeps; ++sweep) {
    const std::vector<int> previous_orders = orders;
    for (int e = 0; e < problem.elements; ++e) {
      if (options.progress)
        options.progress((finished[std::size_t(sweep)] * (problem.elements - e) +
                          finished[std::size_t(sweep) + 1] * e) /
                         problem.elements);
      if (highest.elements[std::size_t(e)].name.location) continue;
      std::vector<VectorXd> mean_squares;
      Score total{VectorXd::Zero(options.max_order + 1), 0};
      for (const Training& fold : folds) {
        const Score fold_score = score(problem, fold, e, previous_orders, options.max_order);
        if (fold_score.readings == 0) continue;
        mean_squares.push_back(fold_score.squares / fold_score.readings);
        total.squares += fold_score.squares;
        total.readings += fold_score.readings;
      }
      if (mean_squares.size() < 2) continue;  // read at too few positions
      const std::string name = to_string(highest.elements[std::size_t(e)].name);
      orders[std::size_t(e)] = choice.orders[name] = smallest_sufficient_order(mean_squares);
      choice.rms[name] = (total.squares / total.readings).cwiseSqrt();
    }
    if (orders == previous_orders) break;
  }
  return choice;
}

}  // namespace abbe::errors::identification
