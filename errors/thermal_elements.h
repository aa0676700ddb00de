#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "errors/curve.h"
#include "errors/element.h"
#include "kinematics/chain.h"

namespace abbe::errors {

/// A function of node temperatures: a constant plus a sum of terms.
struct ThermalFunction {
  struct Term {
    int node = 0;
    std::optional<int> minus;    ///< node that is subtracted, for differences such as a tilt
    double per_K = 0.0;          ///< per K of dT_K, if there is no table
    std::optional<Table> table;  ///< of dT_K, instead of `per_K`
  };
  double constant = 0.0;  ///< at dT = 0
  std::vector<Term> terms;
};

/// Thermal contribution to one element: delta = offset(T) + slope(T) (p - fixed), p the axis
/// position.
struct ThermalElement {
  ElementName name;
  ThermalFunction offset;  ///< mm or rad
  ThermalFunction slope;   ///< mm or rad per mm or rad of travel; zero for location and spindle
  double fixed = 0.0;      ///< mm or rad, commanded position of the fixed bearing
};

/// The position feedback of an axis, which determines the growth that is visible.
enum class Feedback {
  Motor,  ///< encoder on the screw: the growth of the screw is visible
  Scale,  ///< linear scale: the growth of the scale is visible, that of the screw is not
};
/// Expansion of a screw or scale along a slide.
struct Expansion {
  int node = 0;
  double per_K = 0.0;  ///< relative growth, e.g. 11.7e-6 for steel
  double fixed = 0.0;  ///< mm, commanded position of the fixed bearing or end
};
/// Expansion of the screw and the scale of a slide.
struct AxisExpansion {
  char axis = 'X';
  Feedback feedback = Feedback::Motor;
  std::optional<Expansion> screw;
  std::optional<Expansion> scale;
};

/// Expansion of the workpiece, which is cut warm and inspected at 20 deg C (ISO 1).
struct WorkpieceExpansion {
  int node = 0;
  double per_K = 0.0;
  Eigen::Vector3d fixed_w = Eigen::Vector3d::Zero();  ///< mm, the point where it is held
};

/// Thermal errors as described in a scene. dT_K of a node is its temperature minus `reference_T_C`.
struct ThermalErrors {
  std::vector<ThermalElement> elements;
  std::vector<AxisExpansion> expansions;
  std::optional<WorkpieceExpansion> workpiece;
  double reference_T_C = 20.0;
};

/// The errors bound to a chain. Immutable; created by `bind`. A screw or scale that has grown moves
/// the carriage away from its fixed end along the travel, so on either side of the bed it adds
/// per_K dT (carriage travel - carriage travel of the fixed end), which is E_LL if the slide lies
/// along a bed axis.
struct ThermalModel {
  struct Bound {
    int joint = 0;
    int component = 0;  ///< 0..5
    bool location = false;
    ThermalElement element;
    bool primed = false;  ///< the slope refers to the carriage's own travel, opposite to the
                          ///< command
  };
  std::vector<Bound> elements;  ///< those described, then those of the expansions
  std::optional<WorkpieceExpansion> workpiece;
  double reference_T_C = 20.0;
  int joints = 0;

  // Prepared from the members above, so that `deviations` sums a flat list.
  struct Term {
    int element = 0;  ///< index in elements
    bool of_slope = false;
    int node = -1;        ///< -1: a constant
    int minus = -1;       ///< -1: relative to the reference temperature
    double factor = 0.0;  ///< the constant, or the value per K
    int table = -1;       ///< index in tables, instead of the factor; -1: none
  };
  std::vector<Term> terms;
  std::vector<Curve> tables;
};

/// Binds the errors to a chain.
/// @param nodes  number of nodes of the network
/// @throws std::invalid_argument naming the element: an axis that the chain lacks, an element that
///         the axis cannot have (as for geometric errors), a slope of a location or spindle
///         element, an element twice, a node out of range, a table that `validate` rejects, an
///         expansion of an axis that is not a slide, `motor` without a screw or `scale` without a
///         scale, an expansion twice, a workpiece that grows by 1e-3 per K or more, a number that
///         is not finite
ThermalModel bind(const ThermalErrors& errors, const kinematics::Chain& chain, int nodes);

/// Returns the thermal deviation of every joint, in the order of the chain.
/// @param q    (joints) commanded positions
/// @param T_C  (nodes)
/// @throws std::out_of_range outside a table that does not extrapolate, naming the element and node
std::vector<kinematics::JointDeviation> deviations(const ThermalModel& model,
                                                   const kinematics::AxisVector& q,
                                                   const Eigen::VectorXd& T_C);

/// Returns the position of a point of the workpiece after it has returned to 20 deg C: fixed +
/// (point - fixed) / (1 + per_K (T - 20)). The point itself, bit for bit, if the model has no
/// workpiece or the workpiece is at 20 deg C.
Eigen::Vector3d position_at_20_C(const ThermalModel& model, const Eigen::VectorXd& T_C,
                                 const Eigen::Vector3d& point_w);

/// Returns the model with every value, including the growth of the workpiece, multiplied by
/// `factor`.
ThermalModel scaled(const ThermalModel& model, double factor);

}  // namespace abbe::errors
