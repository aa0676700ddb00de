#include "errors/identification/model.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/bound_element.h"
#include "kinematics/location.h"
#include "kinematics/units.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr int most_order = 60;
constexpr double endless = 1e8;  // mm: no travel that anyone stated

Index along(const Joint& joint) {
  Index k = 0;
  joint.direction_b.cwiseAbs().maxCoeff(&k);
  return k;
}

/// An element with the numbers of it that stay as they are.
struct Parameterised {
  Element element;
  std::vector<std::pair<int, int>> held;  ///< curve and number
};

void check_order(const std::string& name, int order) {
  if (order < 0 || order > most_order)
    throw std::invalid_argument(
        fmt::format("{}: expected an order from 0 to {}, seen {}", name, most_order, order));
}

int order_of(const ElementName& name, int usual, const ModelOptions& options) {
  const auto own = options.orders.find(to_string(name));
  return own == options.orders.end() ? usual : own->second;
}

/// Holds numbers of a straight line: its constant, its slope.
struct Line {
  bool constant = false;
  bool slope = false;
};

void add_series(Parameterised& p, Shape shape, int order, const Line& line) {
  const int curve = int(p.element.curves.size());
  if (order == 0 && !line.constant) return;
  if (!line.constant) p.held.emplace_back(curve, 0);
  if (!line.slope && order >= 1) p.held.emplace_back(curve, 1);
  p.element.curves.push_back({std::move(shape)});
}

void add_spline(Parameterised& p, double low, double high, int order, const Line& line) {
  if (order == 0) return;
  const int curve = int(p.element.curves.size());
  const VectorXd q = VectorXd::LinSpaced(order + 1, low, high);
  if (!line.constant) p.held.emplace_back(curve, 0);
  if (!line.slope) p.held.emplace_back(curve, order);
  p.element.curves.push_back(
      {make_table(q, VectorXd::Zero(order + 1), Between::Spline, Outside::Hold)});
}

void add_fourier(Parameterised& p, int order, double period) {
  if (order > 0)
    p.element.curves.push_back({Fourier{VectorXd::Zero(order), VectorXd::Zero(order), period}});
}

void add_slide_curves(Parameterised& p, const Joint& joint, const ModelOptions& options) {
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

/// Whether the order 1 of this motion of a table, beside that of the other motion across its axis,
/// amounts to how the workpiece lies on it.
bool places_the_workpiece(const ElementName& name, const Joint& joint) {
  const int first_across = along(joint) == 0 ? 1 : 0;
  return joint.motion == Motion::Rotary && joint.side == kinematics::Side::Workpiece &&
         name.component() % 3 == first_across;
}

void add_turning_curves(Parameterised& p, const Joint& joint, const ModelOptions& options) {
  const bool is_nose = joint.motion == Motion::Spindle;
  const int usual = is_nose ? options.spindle_harmonics : options.harmonics;
  const int order = order_of(p.element.name, usual, options);
  check_order(to_string(p.element.name), order);
  if (is_nose || options.constants) p.element.curves.push_back({Constant{}});
  if (!options.placement && order > 0 && places_the_workpiece(p.element.name, joint)) {
    const int curve = int(p.element.curves.size());
    p.held.emplace_back(curve, 0);
    p.held.emplace_back(curve, order);
  }
  add_fourier(p, order, 2.0 * std::numbers::pi);
}

Parameterised motion_of(const ElementName& name, const Joint& joint, const ModelOptions& options) {
  Parameterised p{{name, {}}, {}};
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

std::vector<Parameterised> motions(const Chain& chain, const ModelOptions& options) {
  std::vector<Parameterised> result;
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    const bool is_nose = joint.motion == Motion::Spindle;
    if (is_nose && chain.find('S')) continue;  // the letter S means the work spindle there
    for (int component = 0; component < 6; ++component) {
      const ElementName name{letters[component], is_nose ? 'S' : joint.name, false};
      if (is_meaningful(name, chain, j)) result.push_back(motion_of(name, joint, options));
    }
  }
  return result;
}

/// The angles of the main slides, each pair once.
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

/// Two angles and two offsets of every rotary axis; a work spindle's constants say the same.
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

std::vector<Parameterised> everything(const Chain& chain, const ModelOptions& options) {
  std::vector<Parameterised> all = motions(chain, options);
  if (!options.locations) return all;
  std::vector<ElementName> names = squarenesses(chain);
  for (const ElementName& name : places(chain)) names.push_back(name);
  for (const ElementName& name : names) all.push_back({{name, {Curve{Constant{}}}}, {}});
  return all;
}

void check_known(const std::string& name, const std::vector<Parameterised>& all) {
  for (const Parameterised& p : all)
    if (to_string(p.element.name) == name) return;
  throw std::invalid_argument(
      fmt::format("expected an element that means something on this machine, seen {}", name));
}

ElementName element_of_number(const std::string& number) {
  return parse_element_name(number.substr(0, number.find_first_of(" [")));
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
  const std::vector<Parameterised> all = everything(nominal, options);
  for (const std::string& name : options.only) check_known(name, all);
  for (const auto& own : options.orders) check_known(own.first, all);

  GeometricErrors model;
  for (const Parameterised& p : all) {
    const std::string name = to_string(p.element.name);
    const auto& only = options.only;
    if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
    if (coefficients({p.element}).size() == p.held.size()) continue;
    for (const auto& [curve, number] : p.held)
      model.covariance.of.push_back({int(model.elements.size()), curve, number});
    model.elements.push_back(p.element);
  }
  const auto held = Index(model.covariance.of.size());
  model.covariance.matrix = Eigen::MatrixXd::Zero(held, held);
  return model;
}

double shown_unit(const std::string& number) {
  return element_of_number(number).is_angle() ? units::urad : units::um;
}

double typical_deviation(const std::string& number) {
  const ElementName name = element_of_number(number);
  const double unit = shown_unit(number);
  if (name.location) return 20.0 * unit;
  const double whole =
      name.axis == 'S' ? (name.is_angle() ? 10.0 : 5.0) : (name.is_angle() ? 15.0 : 5.0);
  // 2 of "EXX[2]" and of "EXC cos 2"
  const std::size_t digits = number.find_last_not_of("0123456789]") + 1;
  const std::string order =
      number.substr(digits, std::min<std::size_t>(6, number.find(']', digits) - digits));
  const bool has_order = digits > to_string(name).size() && !order.empty();
  return whole * unit / (has_order ? std::max(1, std::stoi(order)) : 1);
}

}  // namespace abbe::errors::identification
