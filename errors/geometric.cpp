#include "errors/geometric.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <stdexcept>

#include "errors/bound_element.h"
#include "errors/expect.h"

namespace abbe::errors {
namespace {

using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::JointDeviation;

void check(const Element& element, const Chain& chain, int joint) {
  const std::string who = to_string(element.name);
  check_meaning(element.name, chain, joint);
  if (element.name.location) {
    for (const Curve& curve : element.curves)
      if (!std::holds_alternative<Constant>(curve.shape))
        refuse(who, "a location error is one constant");
  }
  try {
    for (const Curve& curve : element.curves) validate(curve);
  } catch (const std::invalid_argument& fault) {
    refuse(who, fault.what());
  }
}

GeometricModel::Line bound_line(const MeasuringLine& line, const Chain& chain) {
  const std::string who = std::string("measuring line of ") + line.axis;
  const int j = joint_of(line.axis, chain, who);
  const Joint& joint = chain.joints()[std::size_t(j)];
  if (joint.motion != kinematics::Motion::Linear) refuse(who, "expected a slide");
  if (!line.at_b.allFinite()) refuse(who, "expected a finite point");
  const bool primed = joint.side == kinematics::Side::Workpiece;
  return {j, line.at_b - joint.point_b, joint.direction_b, primed && line.by == MeasuredBy::Tool};
}

double& slot(std::vector<JointDeviation>& deviations, const GeometricModel::Bound& bound) {
  JointDeviation& deviation = deviations[std::size_t(bound.joint)];
  return (bound.location ? deviation.location : deviation.motion)[bound.component];
}

/// The group that a series joins; none where there are too many.
std::optional<int> group_of(GeometricModel& model, int joint, const SeriesBasis& basis) {
  const auto known = std::ranges::find_if(model.groups, [&](const GeometricModel::Group& group) {
    return group.joint == joint && group.series.basis.shares(basis) &&
           group.series.count < SeriesGroup::most;
  });
  if (known != model.groups.end()) return int(known - model.groups.begin());
  if (model.groups.size() == GeometricModel::most_groups) return std::nullopt;
  model.groups.push_back({joint, {basis}});
  return int(model.groups.size()) - 1;
}

void add_term(GeometricModel& model, int element, int curve) {
  const GeometricModel::Bound& bound = model.elements[std::size_t(element)];
  const Curve& added = bound.element.curves[std::size_t(curve)];
  GeometricModel::Term term{bound.joint, bound.component, element, curve};
  const std::optional<SeriesBasis> basis = basis_of(added);
  if (const auto group = basis ? group_of(model, bound.joint, *basis) : std::nullopt) {
    term.group = *group;
    term.place = add(added, model.groups[std::size_t(*group)].series);
    term.factor = factor(added);
  }
  model.terms.push_back(term);
}

/// The model with its constant part and its terms made from its elements.
GeometricModel prepared(GeometricModel model) {
  model.constant.assign(model.joint_is_primed.size(), JointDeviation{});
  model.terms.clear();
  model.groups.clear();
  for (std::size_t e = 0; e < model.elements.size(); ++e) {
    const GeometricModel::Bound& bound = model.elements[e];
    for (std::size_t c = 0; c < bound.element.curves.size(); ++c) {
      const Curve& curve = bound.element.curves[c];
      if (std::holds_alternative<Constant>(curve.shape)) {
        slot(model.constant, bound) += value(curve, CurveState{});
      } else {
        add_term(model, int(e), int(c));
      }
    }
  }
  return model;
}

[[noreturn]] void rethrow_named(const GeometricModel::Bound& bound, const Curve& curve,
                                const std::out_of_range& fault) {
  const std::string part = curve.name.empty() ? "" : " (" + curve.name + ")";
  throw std::out_of_range(to_string(bound.element.name) + part + ": " + fault.what());
}

/// Value of a term that shares its functions with none.
double curve_value(const GeometricModel& model, const GeometricModel::Term& term,
                   const AxisState& state) {
  const GeometricModel::Bound& bound = model.elements[std::size_t(term.element)];
  const Curve& curve = bound.element.curves[std::size_t(term.curve)];
  try {
    return value(curve, curve_state(model, state, term.joint));
  } catch (const std::out_of_range& fault) {
    rethrow_named(bound, curve, fault);
  }
}

/// d(P) = d(M) - theta x (M - P): the translations as they are at the joint's point P.
void carry_to_joint(const GeometricModel::Line& line, double travel, JointDeviation& deviation) {
  Vector3d arm = line.arm_b;
  if (line.fixed_in_bed) arm -= travel * line.direction_b;  // P travels away from M
  const Vector3d theta = deviation.motion.tail<3>();
  deviation.motion.head<3>() -= theta.cross(arm);
}

}  // namespace

GeometricModel bind(const GeometricErrors& errors, const Chain& chain) {
  GeometricModel model;
  for (const Joint& joint : chain.joints())
    model.joint_is_primed.push_back(joint.side == kinematics::Side::Workpiece);
  for (const Element& element : errors.elements) {
    const std::string who = to_string(element.name);
    const int joint = joint_of(element.name.axis, chain, who);
    for (const GeometricModel::Bound& other : model.elements)
      if (other.element.name == element.name) refuse(who, "comes twice");
    check(element, chain, joint);
    model.elements.push_back({joint, element.name.component(), element.name.location, element});
  }
  for (const MeasuringLine& line : errors.measuring_lines) {
    model.lines.push_back(bound_line(line, chain));
    for (std::size_t i = 0; i + 1 < model.lines.size(); ++i)
      if (model.lines[i].joint == model.lines.back().joint)
        refuse(std::string("measuring line of ") + line.axis, "comes twice");
  }
  return prepared(std::move(model));
}

CurveState curve_state(const GeometricModel& model, const AxisState& state, int joint) {
  const bool primed = model.joint_is_primed[std::size_t(joint)] != 0;
  const auto side = primed ? kinematics::Side::Workpiece : kinematics::Side::Tool;
  const double command = state.q[joint];
  return {command, kinematics::carriage_travel(side, command), state.direction[std::size_t(joint)],
          state.stroke[std::size_t(joint)], primed};
}

std::vector<JointDeviation> deviations(const GeometricModel& model, const AxisState& state) {
  assert(std::size_t(state.q.size()) == model.joint_is_primed.size());
  std::vector<JointDeviation> result = model.constant;
  std::array<SeriesGroup::Sums, GeometricModel::most_groups> series;
  for (std::size_t g = 0; g < model.groups.size(); ++g)
    series[g] = sums(model.groups[g].series, curve_state(model, state, model.groups[g].joint));
  for (const GeometricModel::Term& term : model.terms)
    result[std::size_t(term.joint)].motion[term.component] +=
        term.group < 0 ? curve_value(model, term, state)
                       : term.factor * series[std::size_t(term.group)][std::size_t(term.place)];
  for (const GeometricModel::Line& line : model.lines)
    carry_to_joint(line, curve_state(model, state, line.joint).carriage,
                   result[std::size_t(line.joint)]);
  return result;
}

GeometricModel without_random(const GeometricModel& model) {
  GeometricModel known = model;
  for (GeometricModel::Bound& bound : known.elements)
    std::erase_if(bound.element.curves, is_random);
  return prepared(std::move(known));
}

GeometricModel scaled(const GeometricModel& model, double factor) {
  GeometricModel result = model;
  for (GeometricModel::Bound& bound : result.elements)
    for (Curve& curve : bound.element.curves) curve.scale *= factor;
  return prepared(std::move(result));
}

}  // namespace abbe::errors
