#include "errors/geometric.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

#include "errors/element.h"
#include "kinematics/units.h"

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
        refuse(who, "a location error must be a constant");
  }
  try {
    for (const Curve& curve : element.curves) validate(curve);
  } catch (const std::invalid_argument& error) {
    refuse(who, error.what());
  }
}

/// Returns a measuring line relative to the point of its joint.
GeometricModel::BoundLine bind_line(const MeasuringLine& line, const Chain& chain) {
  const std::string who = std::string("measuring line of ") + line.axis;
  const int j = axis_joint(line.axis, chain, who);
  const Joint& joint = chain.joints()[std::size_t(j)];
  if (joint.motion != kinematics::Motion::Linear) refuse(who, "expected a slide");
  if (!line.at_b.allFinite()) refuse(who, "expected a finite point");
  const bool is_primed = joint.side == kinematics::Side::Workpiece;
  return {j, line.at_b - joint.point_b, joint.direction_b,
          is_primed && line.by == MeasuredBy::Tool};
}

double& deviation_component(std::vector<JointDeviation>& deviations,
                            const GeometricModel::Bound& bound) {
  JointDeviation& deviation = deviations[std::size_t(bound.joint)];
  return (bound.location ? deviation.location : deviation.motion)[bound.component];
}

/// Returns the index of the group for a series, adding one if necessary; empty if there are already
/// `max_groups`.
std::optional<int> find_or_add_group(GeometricModel& model, int joint, const SeriesBasis& basis) {
  const auto group =
      std::ranges::find_if(model.groups, [&](const GeometricModel::Group& candidate) {
        return candidate.joint == joint && candidate.series.basis.has_same_functions(basis) &&
               candidate.series.count < SeriesGroup::max_series;
      });
  if (group != model.groups.end()) return int(group - model.groups.begin());
  if (model.groups.size() == GeometricModel::max_groups) return std::nullopt;
  model.groups.push_back({joint, {basis}});
  return int(model.groups.size()) - 1;
}

/// Adds the term of a curve; a series joins the group of its basis, if there is room.
void add_term(GeometricModel& model, int element, int curve) {
  const GeometricModel::Bound& bound = model.elements[std::size_t(element)];
  const Curve& curve_to_add = bound.element.curves[std::size_t(curve)];
  GeometricModel::Term term{bound.joint, bound.component, element, curve};
  const std::optional<SeriesBasis> basis = series_basis(curve_to_add);
  if (const auto group = basis ? find_or_add_group(model, bound.joint, *basis) : std::nullopt) {
    term.group = *group;
    term.index_in_group = add(curve_to_add, model.groups[std::size_t(*group)].series);
    term.factor = factor(curve_to_add);
  }
  model.terms.push_back(term);
}

/// Returns the model with its constants, terms and groups rebuilt from its elements.
GeometricModel rebuild_terms(GeometricModel model) {
  model.constant.assign(model.is_joint_primed.size(), JointDeviation{});
  model.terms.clear();
  model.groups.clear();
  for (std::size_t e = 0; e < model.elements.size(); ++e) {
    const GeometricModel::Bound& bound = model.elements[e];
    for (std::size_t c = 0; c < bound.element.curves.size(); ++c) {
      const Curve& curve = bound.element.curves[c];
      if (std::holds_alternative<Constant>(curve.shape)) {
        deviation_component(model.constant, bound) += value(curve, CurveState{});
      } else {
        add_term(model, int(e), int(c));
      }
    }
  }
  return model;
}

[[noreturn]] void rethrow_with_name(const GeometricModel::Bound& bound, const Curve& curve,
                                    const std::out_of_range& error) {
  const std::string curve_text = curve.name.empty() ? "" : " (" + curve.name + ")";
  throw std::out_of_range(to_string(bound.element.name) + curve_text + ": " + error.what());
}

/// Returns the value of a term that belongs to no group.
double curve_value(const GeometricModel& model, const GeometricModel::Term& term,
                   const AxisState& state) {
  const GeometricModel::Bound& bound = model.elements[std::size_t(term.element)];
  const Curve& curve = bound.element.curves[std::size_t(term.curve)];
  try {
    return value(curve, curve_state(model, state, term.joint));
  } catch (const std::out_of_range& error) {
    rethrow_with_name(bound, curve, error);
  }
}

/// Moves the translations from the measured point M to the joint's point P: d(P) = d(M) - theta x
/// (M - P).
void carry_to_joint(const GeometricModel::BoundLine& line, double travel,
                    JointDeviation& deviation) {
  Vector3d arm = line.arm_b;
  if (line.is_point_fixed_in_bed) arm -= travel * line.direction_b;  // P travels away from M
  const Vector3d theta = deviation.motion.tail<3>();
  deviation.motion.head<3>() -= theta.cross(arm);
}

}  // namespace

GeometricModel bind(const GeometricErrors& errors, const Chain& chain) {
  GeometricModel model;
  for (const Joint& joint : chain.joints())
    model.is_joint_primed.push_back(joint.side == kinematics::Side::Workpiece);
  for (const Element& element : errors.elements) {
    const std::string who = to_string(element.name);
    const int joint = axis_joint(element.name.axis, chain, who);
    for (const GeometricModel::Bound& other : model.elements)
      if (other.element.name == element.name) refuse(who, "given twice");
    check(element, chain, joint);
    model.elements.push_back({joint, element.name.component(), element.name.location, element});
  }
  for (const MeasuringLine& line : errors.measuring_lines) {
    model.lines.push_back(bind_line(line, chain));
    for (std::size_t i = 0; i + 1 < model.lines.size(); ++i)
      if (model.lines[i].joint == model.lines.back().joint)
        refuse(std::string("measuring line of ") + line.axis, "given twice");
  }
  return rebuild_terms(std::move(model));
}

CurveState curve_state(const GeometricModel& model, const AxisState& state, int joint) {
  const bool is_primed = model.is_joint_primed[std::size_t(joint)] != 0;
  const auto side = is_primed ? kinematics::Side::Workpiece : kinematics::Side::Tool;
  const double command = state.q[joint];
  return {command, kinematics::carriage_travel(side, command), state.direction[std::size_t(joint)],
          state.stroke[std::size_t(joint)], is_primed};
}

std::vector<JointDeviation> deviations(const GeometricModel& model, const AxisState& state) {
  assert(std::size_t(state.q.size()) == model.is_joint_primed.size());
  std::vector<JointDeviation> result = model.constant;
  // Each group is evaluated once; its terms below only pick their sum.
  std::array<SeriesGroup::Sums, GeometricModel::max_groups> series;
  for (std::size_t g = 0; g < model.groups.size(); ++g)
    series[g] = sums(model.groups[g].series, curve_state(model, state, model.groups[g].joint));
  for (const GeometricModel::Term& term : model.terms)
    result[std::size_t(term.joint)].motion[term.component] +=
        term.group < 0
            ? curve_value(model, term, state)
            : term.factor * series[std::size_t(term.group)][std::size_t(term.index_in_group)];
  for (const GeometricModel::BoundLine& line : model.lines)
    carry_to_joint(line, curve_state(model, state, line.joint).carriage,
                   result[std::size_t(line.joint)]);
  return result;
}

// Constants and terms depend on all curves, so they are rebuilt rather than edited.
GeometricModel without_random_errors(const GeometricModel& model) {
  GeometricModel result = model;
  for (GeometricModel::Bound& bound : result.elements)
    std::erase_if(bound.element.curves, is_random);
  return rebuild_terms(std::move(result));
}

GeometricModel scaled(const GeometricModel& model, double factor) {
  GeometricModel result = model;
  for (GeometricModel::Bound& bound : result.elements)
    for (Curve& curve : bound.element.curves) curve.scale *= factor;
  return rebuild_terms(std::move(result));
}

namespace {

using kinematics::AxisVector;

/// The largest value of an element, mm or rad, and the position of its axis there.
struct LargestDeviation {
  double value = 0.0;
  double position = 0.0;  // mm or rad
};

/// Returns the value of an element at commanded positions, moving in the positive direction.
double value_at(const GeometricModel& model, const GeometricModel::Bound& bound,
                const AxisVector& q) {
  kinematics::AxisState state;
  state.q = q;
  state.direction.fill(1);
  const CurveState arguments = curve_state(model, state, bound.joint);
  double sum = 0.0;
  for (const Curve& curve : bound.element.curves) sum += value(curve, arguments);
  return sum;
}

/// Returns the largest value of an element over the travel of its axis.
LargestDeviation largest_deviation(const GeometricModel& model, const GeometricModel::Bound& bound,
                                   const AxisVector& min_q, const AxisVector& max_q) {
  // 128 intervals: more than two samples per period of every harmonic below the 64th of the travel.
  constexpr int position_count = 129;
  LargestDeviation largest;
  for (int i = 0; i < position_count; ++i) {
    const AxisVector q = min_q + (double(i) / (position_count - 1)) * (max_q - min_q);
    try {
      const double value = value_at(model, bound, q);
      if (std::abs(value) > std::abs(largest.value)) largest = {value, q[bound.joint]};
    } catch (const std::out_of_range&) {
      continue;  // reported where the deviation is evaluated
    }
  }
  return largest;
}

bool is_slide_element(const ElementName& name) {
  return !name.location && std::string_view("XYZUVW").find(name.axis) != std::string_view::npos;
}

/// Returns the distance of a position from the centre of a curve that states a range, in half
/// ranges; else 0.
double position_in_half_ranges(const Curve& curve, double q) {
  // A half range of 1 or 10 mm does not state a range: the polynomial is one in mm or cm, as in
  // papers.
  const auto* polynomial = std::get_if<Polynomial>(&curve.shape);
  if (polynomial && polynomial->half_range != 1.0 && polynomial->half_range != 10.0)
    return std::abs(q - polynomial->centre) / polynomial->half_range;
  if (const auto* legendre = std::get_if<Legendre>(&curve.shape))
    return std::abs(q - legendre->centre) / legendre->half_range;
  return 0.0;
}

/// Returns the distance of a position beyond the ends of a table that holds its last value, in
/// lengths of the table; 0 within it.
double excess_in_lengths(const Table& table, double q) {
  if (table.outside != TableExtrapolation::Hold) return 0.0;
  const double low = table.q[0], high = table.q[table.q.size() - 1];
  return std::max({0.0, low - q, q - high}) / (high - low);
}

double excess_in_lengths(const Curve& curve, double q) {
  if (const auto* table = std::get_if<Table>(&curve.shape)) return excess_in_lengths(*table, q);
  if (const auto* both = std::get_if<DirectionalTables>(&curve.shape))
    return std::max(excess_in_lengths(both->up, q), excess_in_lengths(both->down, q));
  return 0.0;
}

double curve_argument(const Curve& curve, const CurveState& arguments) {
  return curve.argument == Argument::Command ? arguments.command : arguments.carriage;
}

/// Returns e.g. "EXX 3.33, EYX 2" for the elements whose curves are extrapolated beyond a limit at
/// either end of travel.
/// @param beyond  extrapolation of a curve at a position, function of (curve, position)
template <typename Beyond>
std::string extrapolated_elements(const GeometricModel& model,
                                  const std::array<const AxisVector*, 2>& ends, double limit,
                                  const Beyond& beyond) {
  std::string text;
  for (const auto& bound : model.elements) {
    double farthest = 0.0;
    for (const AxisVector* q : ends) {
      kinematics::AxisState state;
      state.q = *q;
      const CurveState arguments = curve_state(model, state, bound.joint);
      for (const Curve& curve : bound.element.curves)
        farthest = std::max(farthest, beyond(curve, curve_argument(curve, arguments)));
    }
    if (farthest > limit)
      text += fmt::format("{}{} {:.3g}", text.empty() ? "" : ", ", to_string(bound.element.name),
                          farthest);
  }
  return text;
}

/// Returns warnings for curves that are used beyond the range for which they are stated.
std::vector<std::string> extrapolation_warnings(const GeometricModel& model,
                                                const AxisVector& min_q, const AxisVector& max_q,
                                                const std::string& section) {
  // A table held over more than half of its own length belongs to another travel or is in m.
  constexpr double max_held = 0.5;
  const std::array<const AxisVector*, 2> ends{&min_q, &max_q};
  std::vector<std::string> texts;
  const std::string prefix = section == "errors" ? "" : section + ": ";
  const auto by_range = [](const Curve& curve, double q) {
    return position_in_half_ranges(curve, q);
  };
  // 1e-9: the end of the range counts as within it, whatever the rounding of its limits.
  if (const auto beyond = extrapolated_elements(model, ends, 1.0 + 1e-9, by_range); !beyond.empty())
    texts.push_back(prefix +
                    "curves are evaluated beyond their stated range (distance from its middle in "
                    "half ranges): " +
                    beyond);
  const auto by_table = [](const Curve& curve, double q) { return excess_in_lengths(curve, q); };
  if (const auto beyond = extrapolated_elements(model, ends, max_held, by_table); !beyond.empty())
    texts.push_back(prefix +
                    "tables hold their last value (outside = \"hold\") far beyond their range "
                    "(excess in table lengths): " +
                    beyond);
  return texts;
}

std::string position_text(const ElementName& name, const LargestDeviation& largest) {
  if (name.location) return "";
  const double unit = is_slide_element(name) ? 1.0 : units::deg;
  return fmt::format(" at {} = {:.4g} {}", name.axis, largest.position / unit,
                     is_slide_element(name) ? "mm" : "deg");
}

/// Returns the warning for an element that is implausibly large.
std::string oversize_warning(const ElementName& name, const LargestDeviation& largest,
                             const ElementSource& source) {
  const std::string key = to_string(name);
  const char* unit_name = name.is_angle() ? "urad" : "um";
  const double unit = name.is_angle() ? units::urad : units::um;
  const std::string size =
      fmt::format("{:.4g} {}{}, which is implausible for a machine", largest.value / (unit * 1e3),
                  name.is_angle() ? "mrad" : "mm", position_text(name, largest));
  if (source.identified)
    return fmt::format("{} is {}: check unit, sign and order of the readings", key, size);
  return fmt::format("{}.{} is {}: values of {}_{} are in {} ({:.4g} here)", source.section, key,
                     size, key, unit_name, unit_name, largest.value / unit);
}

}  // namespace

std::vector<std::string> element_warnings(const GeometricModel& model, const AxisVector& min_q,
                                          const AxisVector& max_q, const ElementSource& source) {
  // Numbers in a wrong unit (um taken as mm, urad as rad, or the reverse) are off by 1e3 or 1e6, so
  // the bounds need not be sharp.
  constexpr double large_mm = 0.25, large_rad = 2.5e-3, small_mm = 1e-5, small_rad = 1e-8;
  std::vector<std::string> warnings;
  for (const auto& bound : model.elements) {
    const ElementName& name = bound.element.name;
    const LargestDeviation largest = largest_deviation(model, bound, min_q, max_q);
    const double size = std::abs(largest.value);
    if (size >= (name.is_angle() ? large_rad : large_mm)) {
      warnings.push_back(oversize_warning(name, largest, source));
      continue;
    }
    // A perfect machine measured without noise is correctly identified with elements of almost 0.
    if (source.identified || !(is_slide_element(name) || name.location)) continue;
    const char* unit_name = name.is_angle() ? "urad" : "um";
    if (size > 0.0 && size <= (name.is_angle() ? small_rad : small_mm))
      warnings.push_back(fmt::format(
          "{}.{} is at most {:.4g} {}, which is implausibly small for a {}: values of {}_{} are in "
          "{}, not in {}",
          source.section, to_string(name), size / (name.is_angle() ? units::urad : units::um),
          unit_name, name.location ? "machine" : "slide", to_string(name), unit_name, unit_name,
          name.is_angle() ? "rad" : "mm"));
  }
  if (!source.identified)
    for (std::string& text : extrapolation_warnings(model, min_q, max_q, source.section))
      warnings.push_back(std::move(text));
  return warnings;
}

}  // namespace abbe::errors
