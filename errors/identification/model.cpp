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

constexpr int max_order = 60;
constexpr double endless = 1e8;  // mm: a larger travel is one that was not stated

Index along(const Joint& joint) {
  Index k = 0;
  joint.direction_b.cwiseAbs().maxCoeff(&k);
  return k;
}

/// An element with the numbers that are held at their values.
struct ElementModel {
  Element element;
  std::vector<std::pair<int, int>> held;  ///< curve and number
};

void check_order(const std::string& name, int order) {
  if (order < 0 || order > max_order)
    throw std::invalid_argument(
        fmt::format("{}: expected an order from 0 to {}, seen {}", name, max_order, order));
}

int order_of(const ElementName& name, int usual, const ModelOptions& options) {
  const auto own = options.orders.find(to_string(name));
  return own == options.orders.end() ? usual : own->second;
}

/// Selection of the constant and the slope of a straight line, to be identified or held.
struct Line {
  bool constant = false;
  bool slope = false;
};

void add_series(ElementModel& p, Shape shape, int order, const Line& line) {
  const int curve = int(p.element.curves.size());
  if (order == 0 && !line.constant) return;
  if (!line.constant) p.held.emplace_back(curve, 0);
  if (!line.slope && order >= 1) p.held.emplace_back(curve, 1);
  p.element.curves.push_back({std::move(shape)});
}

void add_spline(ElementModel& p, double low, double high, int order, const Line& line) {
  if (order == 0) return;
  // A spline is linear in its knot values; the first stands for its constant and the last for its
  // slope.
  const int curve = int(p.element.curves.size());
  const VectorXd q = VectorXd::LinSpaced(order + 1, low, high);
  if (!line.constant) p.held.emplace_back(curve, 0);
  if (!line.slope) p.held.emplace_back(curve, order);
  p.element.curves.push_back(
      {make_table(q, VectorXd::Zero(order + 1), Between::Spline, Outside::Hold)});
}

void add_fourier(ElementModel& p, int order, double period) {
  if (order > 0)
    p.element.curves.push_back({Fourier{VectorXd::Zero(order), VectorXd::Zero(order), period}});
}

void add_slide_curves(ElementModel& p, const Joint& joint, const ModelOptions& options) {
  const std::string who = to_string(p.element.name);
  if (!(joint.max - joint.min < endless))
    throw std::invalid_argument(fmt::format("{}: its travel is not stated", who));
  if (!(joint.max > joint.min))
    throw std::invalid_argument(fmt::format("{}: its travel is nothing", who));
  const int order = order_of(p.element.name, options.order, options);
  check_order(who, order);
  const bool is_angle = p.element.name.is_angle();
  const bool is_positioning = !is_angle && p.element.name.component() == int(along(joint));
  const Line line{options.constants, is_angle || is_positioning || options.straightness_slopes};
  const double centre = 0.5 * (joint.min + joint.max);
  const double half = 0.5 * (joint.max - joint.min);
  switch (options.slides) {
    case Basis::Polynomial:
      add_series(p, Polynomial{VectorXd::Zero(order + 1), centre, half}, order, line);
      break;
    case Basis::Legendre:
      add_series(p, Legendre{VectorXd::Zero(order + 1), centre, half}, order, line);
      break;
    case Basis::Fourier:
      add_series(p, Legendre{VectorXd::Zero(2), centre, half}, 1, line);
      add_fourier(p, order, 2.0 * half);
      break;
    case Basis::Spline:
      add_spline(p, joint.min, joint.max, order, line);
      break;
  }
}

/// Returns true if order 1 of this motion of a table, together with that of the other motion across
/// its axis, is equivalent to the position of the workpiece on the table.
bool is_workpiece_placement(const ElementName& name, const Joint& joint) {
  const int first_across = along(joint) == 0 ? 1 : 0;
  return joint.motion == Motion::Rotary && joint.side == kinematics::Side::Workpiece &&
         name.component() % 3 == first_across;
}

void add_turning_curves(ElementModel& p, const Joint& joint, const ModelOptions& options) {
  const bool is_nose = joint.motion == Motion::Spindle;
  const int usual = is_nose ? options.spindle_harmonics : options.harmonics;
  const int order = order_of(p.element.name, usual, options);
  check_order(to_string(p.element.name), order);
  if (is_nose || options.constants) p.element.curves.push_back({Constant{}});
  if (!options.placement && order > 0 && is_workpiece_placement(p.element.name, joint)) {
    const int curve = int(p.element.curves.size());
    p.held.emplace_back(curve, 0);
    p.held.emplace_back(curve, order);
  }
  add_fourier(p, order, 2.0 * std::numbers::pi);
}

ElementModel motion_of(const ElementName& name, const Joint& joint, const ModelOptions& options) {
  ElementModel p{{name, {}}, {}};
  if (joint.motion == Motion::Linear) {
    add_slide_curves(p, joint, options);
  } else {
    add_turning_curves(p, joint, options);
  }
  const int moves = int(along(joint)) + (joint.motion == Motion::Rotary ? 3 : 0);
  const auto pitch = options.pitch.find(joint.name);
  if (pitch != options.pitch.end() && name.component() == moves) {
    add_fourier(p, 2, pitch->second);
    p.element.curves.back().name = pitch_name;
  }
  if (options.backlash && joint.motion != Motion::Spindle && name.component() == moves)
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

std::vector<ElementModel> motions(const Chain& chain, const ModelOptions& options) {
  std::vector<ElementModel> result;
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    const bool is_nose = joint.motion == Motion::Spindle;
    if (is_nose && chain.find('S')) continue;  // there the letter S denotes the work spindle
    for (int component = 0; component < 6; ++component) {
      const ElementName name{letters[component], is_nose ? 'S' : joint.name, false};
      if (is_meaningful(name, chain, j)) result.push_back(motion_of(name, joint, options));
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

/// Returns two angles and two offsets of every rotary axis; for a work spindle its constants are
/// equivalent.
std::vector<ElementName> places(const Chain& chain) {
  std::vector<ElementName> result;
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.motion != Motion::Rotary || joint.name == 'S') continue;
    for (int component = 0; component < 6; ++component) {
      const ElementName name{letters[component], joint.name, true};
      if (component % 3 != int(along(joint)) && is_meaningful(name, chain, j))
        result.push_back(name);
    }
  }
  return result;
}

std::vector<ElementModel> all_element_models(const Chain& chain, const ModelOptions& options) {
  std::vector<ElementModel> all = motions(chain, options);
  if (!options.locations) return all;
  std::vector<ElementName> names = squarenesses(chain);
  for (const ElementName& name : places(chain)) names.push_back(name);
  for (const ElementName& name : names) all.push_back({{name, {Curve{Constant{}}}}, {}});
  return all;
}

void check_element_names(const std::string& name, const std::vector<ElementModel>& all) {
  for (const ElementModel& p : all)
    if (to_string(p.element.name) == name) return;
  throw std::invalid_argument(
      fmt::format("expected an element that means something on this machine, seen {}", name));
}

}  // namespace

GeometricErrors model_of(const Chain& nominal, const ModelOptions& options) {
  check_order("order of slides", options.order);
  check_order("harmonics of rotary axes", options.harmonics);
  check_order("harmonics of the nose", options.spindle_harmonics);
  for (const auto& [axis, period] : options.pitch) {
    const auto joint = nominal.find(axis);
    if (!joint || nominal.joints()[std::size_t(*joint)].motion != Motion::Linear)
      throw std::invalid_argument(
          fmt::format("pitch: expected a slide of this machine, seen {}", axis));
    if (!(period > 0.0 && period < endless))
      throw std::invalid_argument(
          fmt::format("pitch of {}: expected mm above 0, seen {}", axis, period));
  }
  const std::vector<ElementModel> all = all_element_models(nominal, options);
  for (const std::string& name : options.only) check_element_names(name, all);
  for (const auto& own : options.orders) check_element_names(own.first, all);

  GeometricErrors model;
  for (const ElementModel& p : all) {
    const std::string name = to_string(p.element.name);
    const auto& only = options.only;
    if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
    // An element whose numbers are all held cannot be identified.
    if (coefficients({p.element}).size() == p.held.size()) continue;
    for (const auto& [curve, number] : p.held)
      model.covariance.of.push_back({int(model.elements.size()), curve, number});
    model.elements.push_back(p.element);
  }
  const auto held = Index(model.covariance.of.size());
  model.covariance.matrix = Eigen::MatrixXd::Zero(held, held);
  return model;
}

std::string element_of_number(const std::string& number) {
  return number.substr(0, number.find_first_of(" ["));
}

double shown_unit(const std::string& number) {
  return parse_element_name(element_of_number(number)).is_angle() ? units::urad : units::um;
}

double typical_deviation(const std::string& number) {
  const ElementName name = parse_element_name(element_of_number(number));
  const double unit = shown_unit(number);
  // Half of the tolerances of ISO 10791-1 and -2, as listed in the header.
  if (name.location) return 20.0 * unit;
  const double whole =
      name.axis == 'S' ? (name.is_angle() ? 10.0 : 5.0) : (name.is_angle() ? 15.0 : 5.0);
  // the 2 of "EXX[2]" and of "EXC cos 2"
  const std::size_t digits = number.find_last_not_of("0123456789]") + 1;
  const std::string order =
      number.substr(digits, std::min<std::size_t>(6, number.find(']', digits) - digits));
  const bool has_order = digits > to_string(name).size() && !order.empty();
  return whole * unit / (has_order ? std::max(1, std::stoi(order)) : 1);
}

namespace {

using Eigen::MatrixXd;
using metrology::Readings;

constexpr int max_sweeps = 4;
constexpr double ridge = 1e-11;  // relative to unit columns, whose normal equations have a rounding
                                 // of 1e-16

/// Returns the lowest order of its element at which a number takes part.
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
  std::vector<int> element;  ///< (columns) -1: of a set-up
  std::vector<int> order;    ///< (columns)
  int folds = 0;
  int elements = 0;
};

/// Returns the fold of every row. All readings of one position of a set-up, in any run and
/// direction, belong to one fold. The first and the last position are never left out (fold -1): a
/// curve is needed between targets, not beyond them.
std::vector<int> fold_numbers(const Design& design, std::span<const Readings> readings, int folds) {
  std::map<std::tuple<int, int, int>, int> number;  // key: readings, set-up, target
  for (const Row& row : design.rows) {
    const metrology::Measurement& measurement =
        readings[std::size_t(row.readings)].plan.measurements[std::size_t(row.measurement)];
    number.insert({{row.readings, measurement.set_up, measurement.target}, 0});
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
    const metrology::Measurement& measurement =
        readings[std::size_t(row.readings)].plan.measurements[std::size_t(row.measurement)];
    result.push_back(number.at({row.readings, measurement.set_up, measurement.target}));
  }
  return result;
}

OrderProblem order_problem(const GeometricErrors& model, std::span<const Readings> readings,
                           int folds) {
  const Design d = design(model, readings);
  const VectorXd at_start = predicted(model, readings, d, start(model, d.unknowns));
  OrderProblem problem;
  std::vector<Index> columns;
  for (Index j = 0; j < d.unknowns.size(); ++j) {
    if (!d.is_sought[std::size_t(j)]) continue;
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
  problem.fold = fold_numbers(d, readings, folds);
  problem.folds = folds;
  problem.elements = int(model.elements.size());
  return problem;
}

std::vector<Index> select_rows(const OrderProblem& problem, int fold, bool inside) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < problem.fold.size(); ++i)
    if ((problem.fold[i] == fold) == inside) rows.push_back(Index(i));
  return rows;
}

/// Returns the columns with those of one element last and in ascending order, so that every lower
/// order is a leading block of the highest; those of the others up to their orders.
std::vector<Index> columns_for_element(const OrderProblem& problem, int element,
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

/// Squared prediction errors of one fold, per order, and the number of readings.
struct Score {
  VectorXd squares;
  int readings = 0;
};

/// Normal equations without one fold.
struct Training {
  MatrixXd G;
  VectorXd h;
  std::vector<Index> left_out;
};

Training training(const OrderProblem& problem, int fold) {
  const std::vector<Index> in = select_rows(problem, fold, false);
  const MatrixXd A = problem.A(in, Eigen::all);
  MatrixXd G = MatrixXd::Zero(A.cols(), A.cols());
  G.selfadjointView<Eigen::Lower>().rankUpdate(A.transpose());
  G.selfadjointView<Eigen::Lower>().rankUpdate(problem.prior.transpose());
  G.diagonal().array() += ridge;
  return {G.selfadjointView<Eigen::Lower>(), A.transpose() * problem.b(in),
          select_rows(problem, fold, true)};
}

Score score(const OrderProblem& problem, const Training& fold, int element,
            const std::vector<int>& orders, int most) {
  // One Cholesky factor serves all orders: the equations of a lower order are its leading block.
  const std::vector<Index> columns = columns_for_element(problem, element, orders);
  const MatrixXd L = cholesky(fold.G(columns, columns)).L;
  const VectorXd half = L.triangularView<Eigen::Lower>().solve(fold.h(columns));
  std::vector<Index> rows;  // readings that depend on the element
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

// Errors that all orders have in common say nothing about the order, so each order is compared with
// the best fold by fold, and the standard error is that of the difference.
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
      const double off = f[order] - f[best] - worse;
      spread += off * off;
    }
    if (worse <= std::sqrt(spread / (folds - 1.0) / folds)) return order;
  }
  return int(best);
}

// Over part of a turn harmonics are nearly dependent on each other and on a constant; there no more
// are tried than the model has.
ModelOptions with_highest_orders(ModelOptions model, const kinematics::Chain& nominal, int most) {
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
  const GeometricErrors highest = model_of(
      readings.front().nominal, with_highest_orders(model, readings.front().nominal, options.most));
  const OrderProblem problem = order_problem(highest, readings, options.folds);
  std::vector<Training> folds;
  for (int f = 0; f < options.folds; ++f) folds.push_back(training(problem, f));
  std::vector<int> orders(std::size_t(problem.elements), options.most);
  OrderChoice choice;
  // the first sweep has all other elements at their highest order
  constexpr std::array done{0.0, 0.6, 0.8, 0.9, 1.0};
  static_assert(done.size() == max_sweeps + 1);
  for (int sweep = 0; sweep < max_sweeps; ++sweep) {
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
      if (mean_squares.size() < 2) continue;  // read at too few positions
      const std::string name = to_string(highest.elements[std::size_t(e)].name);
      orders[std::size_t(e)] = choice.orders[name] = smallest_sufficient_order(mean_squares);
      choice.rms[name] = (total.squares / total.readings).cwiseSqrt();
    }
    if (orders == before) break;
  }
  return choice;
}

}  // namespace abbe::errors::identification
