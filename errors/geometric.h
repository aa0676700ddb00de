#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "errors/coefficients.h"
#include "errors/curve.h"
#include "errors/element.h"
#include "kinematics/chain.h"

namespace abbe::errors {

/// The body that carried the point at which translations were measured.
enum class MeasuredBy {
  Tool,      ///< the point is at the tool: on a tool-side slide it travels with the carriage, on a
             ///< primed slide it is fixed in the bed
  Carriage,  ///< the point travels with the carriage
};

/// The line on which the translations of a slide were measured, instead of at its joint's point.
struct MeasuringLine {
  char axis = 'X';
  Eigen::Vector3d at_b = Eigen::Vector3d::Zero();  ///< mm, bed frame, all axes at zero
  MeasuredBy by = MeasuredBy::Carriage;
};

/// Geometric errors as described in an errors file.
struct GeometricErrors {
  std::vector<Element> elements;
  std::vector<MeasuringLine> measuring_lines;
  Covariance covariance = {};  ///< of the numbers of an identified belief
};

/// The errors bound to a chain: for each joint the elements that act on it. Immutable; created by
/// `bind`.
struct GeometricModel {
  struct Bound {
    int joint = 0;      ///< index in the chain
    int component = 0;  ///< 0..5
    bool location = false;
    Element element;
  };
  std::vector<Bound> elements;
  struct BoundLine {
    int joint = 0;
    Eigen::Vector3d arm_b;  ///< measured point minus joint point at zero
    Eigen::Vector3d direction_b = Eigen::Vector3d::Zero();  ///< of the joint, unit
    bool is_point_fixed_in_bed =
        false;  ///< the joint's point travels relative to the measured point
  };
  std::vector<BoundLine> lines;
  std::vector<char> is_joint_primed;  ///< (chain size) 1 where the carriage travels by -command

  // Prepared from the members above, so that `deviations` sums only the terms that vary.
  struct Term {
    int joint = 0;
    int component = 0;       ///< 0..5 of its motion
    int element = 0;         ///< index in elements
    int curve = 0;           ///< index in its curves
    int group = -1;          ///< index in groups of a series; -1: none
    int index_in_group = 0;  ///< position in the group
    double factor = 1.0;     ///< scale of the series, with its sign
  };
  struct Group {
    int joint = 0;
    SeriesGroup series;
  };
  static constexpr std::size_t max_groups = 24;
  std::vector<kinematics::JointDeviation> constant;  ///< (chain size) sum of all constant curves
  std::vector<Term> terms;                           ///< every other curve
  std::vector<Group> groups;  ///< at most max_groups: series that share their functions
};

/// Binds the errors to a chain. Axis 'S' is the joint S (a spindle that carries the workpiece) if
/// the chain has one, else the nose s.
/// @throws std::invalid_argument naming the element: an axis that the chain lacks, a location
///         element that is not constant, a location direction that is meaningless for that axis (a
///         squareness of an axis about itself, an offset of a slide or along a rotary axis; a
///         constant error motion expresses that), a spindle's rotation about itself, a curve that
///         `validate` rejects, a measuring line on an axis that is not a slide, an element or a
///         line twice
GeometricModel bind(const GeometricErrors& errors, const kinematics::Chain& chain);

/// Returns the deviation of every joint at a state, in the order of the chain. Translations
/// measured on a line are moved to the joint's point with that joint's own angles: d(P) = d(M) -
/// theta x (M - P).
/// @throws std::out_of_range outside a table, naming the element
std::vector<kinematics::JointDeviation> deviations(const GeometricModel& model,
                                                   const kinematics::AxisState& state);

/// Returns the model without its random curves, i.e. the result of a perfect identification.
GeometricModel without_random_errors(const GeometricModel& model);

/// Returns the model with the values of all elements multiplied by `factor`.
GeometricModel scaled(const GeometricModel& model, double factor);

/// Returns the state of one joint on which its curves depend.
CurveState curve_state(const GeometricModel& model, const kinematics::AxisState& state, int joint);

/// Source of elements, for the text of a warning.
struct ElementSource {
  std::string section = "errors";  ///< section of the scene, printed before the name of an element
  bool identified = false;         ///< identified from readings, not stated
};

/// Returns a warning for each element of implausible size, as from a number in the wrong unit: at
/// least 0.25 mm or 2.5 mrad, or, for a stated element of a slide or a location, at most 10 nm or
/// 0.01 urad but not 0. Each warning names the largest value at 129 positions of the axis from
/// `min_q` to `max_q`, for a spindle over a turn. For stated curves there are also warnings if they
/// are used beyond their range, and for tables held far beyond theirs.
/// @param model  with the scale of the errors applied
std::vector<std::string> element_warnings(const GeometricModel& model,
                                          const kinematics::AxisVector& min_q,
                                          const kinematics::AxisVector& max_q,
                                          const ElementSource& source = {});

}  // namespace abbe::errors
