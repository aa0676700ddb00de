#include "errors/thermal_elements.h"

#include <cassert>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/element.h"

namespace abbe::errors {
namespace {

using Eigen::VectorXd;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::JointDeviation;

constexpr double length_reference_T_C = 20.0;  // ISO 1

void check(const ThermalFunction& function, int nodes, const std::string& who) {
  require_finite(function.constant, who, "constant");
  for (const ThermalFunction::Term& term : function.terms) {
    require_node(term.node, nodes, who);
    if (term.minus) require_node(*term.minus, nodes, who);
    require_finite(term.per_K, who, "value per K");
    if (!term.table) continue;
    try {
      validate(Curve{*term.table});
    } catch (const std::invalid_argument& error) {
      refuse(who, error.what());
    }
  }
}

bool is_zero_function(const ThermalFunction& function) {
  return function.constant == 0.0 && function.terms.empty();
}

void check(const ThermalElement& element, const Chain& chain, int joint, int nodes) {
  const std::string who = to_string(element.name);
  check_meaning(element.name, chain, joint);
  const bool has_travel = !element.name.location && element.name.axis != 'S';
  // A slope acts over a position, which only an axis has.
  if (!has_travel && !is_zero_function(element.slope))
    refuse(who, "a location or spindle element cannot have a slope along an axis");
  check(element.offset, nodes, who);
  check(element.slope, nodes, who);
  require_finite(element.fixed, who, "fixed position");
}

void check(const Expansion& expansion, int nodes, const std::string& who) {
  require_node(expansion.node, nodes, who);
  require_finite(expansion.per_K, who, "growth per K");
  require_finite(expansion.fixed, who, "fixed position");
}

/// Returns the expansion that is visible at the given feedback.
const Expansion& visible_expansion(const AxisExpansion& axis, int nodes) {
  const std::string who = std::string("expansion of ") + axis.axis;
  // Both expansions are checked, also the one that the feedback hides.
  if (axis.screw) check(*axis.screw, nodes, who + ", screw");
  if (axis.scale) check(*axis.scale, nodes, who + ", scale");
  const bool is_motor_feedback = axis.feedback == Feedback::Motor;
  const std::optional<Expansion>& expansion = is_motor_feedback ? axis.screw : axis.scale;
  if (!expansion)
    refuse(who, is_motor_feedback ? "feedback from the motor requires a screw"
                                  : "feedback from a scale requires a scale");
  return *expansion;
}

/// Returns the growth along a slide as elements of its joint; a single one if the slide lies along
/// a bed axis.
std::vector<ThermalModel::Bound> bind_expansion(const AxisExpansion& axis, const Chain& chain,
                                                int nodes) {
  const std::string who = std::string("expansion of ") + axis.axis;
  const int j = axis_joint(axis.axis, chain, who);
  const Joint& joint = chain.joints()[std::size_t(j)];
  if (joint.motion != kinematics::Motion::Linear) refuse(who, "expected a slide");
  const Expansion& growth = visible_expansion(axis, nodes);
  std::vector<ThermalModel::Bound> bound_elements;
  for (int i = 0; i < 3; ++i) {
    // Exact zeros are skipped, so a slide along a bed axis needs a single element.
    if (joint.direction_b[i] == 0.0) continue;
    ThermalElement element;
    element.name = {char('X' + i), axis.axis, false};
    element.slope.terms.push_back(
        {growth.node, std::nullopt, growth.per_K * joint.direction_b[i], std::nullopt});
    element.fixed = growth.fixed;
    bound_elements.push_back({j, i, false, element, joint.side == kinematics::Side::Workpiece});
  }
  return bound_elements;
}

void check(const WorkpieceExpansion& workpiece, int nodes) {
  const std::string who = "workpiece";
  require_node(workpiece.node, nodes, who);
  require_finite(workpiece.per_K, who, "growth per K");
  if (!workpiece.fixed_w.allFinite()) refuse(who, "expected a finite fixed point");
  // 1e-3 per K is a hundred times the value of steel: such a number is in um/(m K) or per cent.
  if (!(std::abs(workpiece.per_K) < 1e-3))
    refuse(who, fmt::format("expected a growth below 1e-3 per K, seen {}", workpiece.per_K));
}

/// Appends the terms of the offset or the slope of an element.
void append_terms(ThermalModel& model, int element, bool of_slope) {
  const ThermalElement& source_element = model.elements[std::size_t(element)].element;
  const ThermalFunction& function = of_slope ? source_element.slope : source_element.offset;
  // Zero constants are dropped, so that `deviations` sums only terms that contribute.
  if (function.constant != 0.0)
    model.terms.push_back({element, of_slope, -1, -1, function.constant, -1});
  for (const ThermalFunction::Term& term : function.terms) {
    int table = -1;
    if (term.table) {
      table = int(model.tables.size());
      model.tables.push_back(Curve{*term.table});
    }
    model.terms.push_back(
        {element, of_slope, term.node, term.minus.value_or(-1), term.per_K, table});
  }
}

ThermalModel rebuild_terms(ThermalModel model) {
  model.terms.clear();
  model.tables.clear();
  for (int i = 0; i < int(model.elements.size()); ++i)
    for (const bool of_slope : {false, true}) append_terms(model, i, of_slope);
  return model;
}

/// Returns the value of a term at node temperatures, mm or rad, or per mm or rad for a slope.
double term_value(const ThermalModel& model, const ThermalModel::Term& term, const VectorXd& T_C) {
  // A term without a node is the constant of its function.
  if (term.node < 0) return term.factor;
  const double reference_T_C = term.minus < 0 ? model.reference_T_C : T_C[term.minus];
  const double dT_K = T_C[term.node] - reference_T_C;
  if (term.table < 0) return term.factor * dT_K;
  try {
    return value(model.tables[std::size_t(term.table)], CurveState{dT_K});
  } catch (const std::out_of_range& error) {
    const ElementName& name = model.elements[std::size_t(term.element)].element.name;
    throw std::out_of_range(
        fmt::format("{}, dT_K of node {}: {}", to_string(name), term.node, error.what()));
  }
}

void scale(ThermalFunction& function, double factor) {
  function.constant *= factor;
  for (ThermalFunction::Term& term : function.terms) {
    term.per_K *= factor;
    if (!term.table) continue;
    // Values and second derivatives of a spline scale alike.
    term.table->value *= factor;
    term.table->second *= factor;
  }
}

}  // namespace

ThermalModel bind(const ThermalErrors& errors, const Chain& chain, int nodes) {
  ThermalModel model;
  require_finite(errors.reference_T_C, "thermal errors", "reference temperature");
  model.reference_T_C = errors.reference_T_C;
  model.joints = chain.size();
  for (const ThermalElement& element : errors.elements) {
    const std::string who = to_string(element.name);
    const int joint = axis_joint(element.name.axis, chain, who);
    for (const ThermalModel::Bound& other : model.elements)
      if (other.element.name == element.name) refuse(who, "given twice");
    check(element, chain, joint, nodes);
    model.elements.push_back(
        {joint, element.name.component(), element.name.location, element, false});
  }
  for (std::size_t i = 0; i < errors.expansions.size(); ++i) {
    const AxisExpansion& axis = errors.expansions[i];
    for (std::size_t j = 0; j < i; ++j)
      if (errors.expansions[j].axis == axis.axis)
        refuse(std::string("expansion of ") + axis.axis, "given twice");
    for (ThermalModel::Bound& bound_element : bind_expansion(axis, chain, nodes))
      model.elements.push_back(std::move(bound_element));
  }
  if (errors.workpiece) check(*errors.workpiece, nodes);
  model.workpiece = errors.workpiece;
  return rebuild_terms(std::move(model));
}

std::vector<JointDeviation> deviations(const ThermalModel& model, const kinematics::AxisVector& q,
                                       const VectorXd& T_C) {
  assert(q.size() == model.joints);
  std::vector<JointDeviation> result(std::size_t(model.joints), JointDeviation{});
  for (const ThermalModel::Term& term : model.terms) {
    const ThermalModel::Bound& bound = model.elements[std::size_t(term.element)];
    double amount = term_value(model, term, T_C);
    if (term.of_slope) {
      const auto side = bound.primed ? kinematics::Side::Workpiece : kinematics::Side::Tool;
      amount *= kinematics::carriage_travel(side, q[bound.joint] - bound.element.fixed);
    }
    JointDeviation& deviation = result[std::size_t(bound.joint)];
    (bound.location ? deviation.location : deviation.motion)[bound.component] += amount;
  }
  return result;
}

Eigen::Vector3d position_at_20_C(const ThermalModel& model, const VectorXd& T_C,
                                 const Eigen::Vector3d& point_w) {
  // At 20 deg C the point is returned unchanged, so that its bits stay the same.
  if (!model.workpiece) return point_w;
  const WorkpieceExpansion& workpiece = *model.workpiece;
  const double growth = workpiece.per_K * (T_C[workpiece.node] - length_reference_T_C);
  if (growth == 0.0) return point_w;
  return workpiece.fixed_w + (point_w - workpiece.fixed_w) / (1.0 + growth);
}

ThermalModel scaled(const ThermalModel& model, double factor) {
  ThermalModel result = model;
  for (ThermalModel::Bound& bound : result.elements) {
    scale(bound.element.offset, factor);
    scale(bound.element.slope, factor);
  }
  if (result.workpiece) result.workpiece->per_K *= factor;
  // The list of terms contains factors, so it is rebuilt from the scaled elements.
  return rebuild_terms(std::move(result));
}

}  // namespace abbe::errors
