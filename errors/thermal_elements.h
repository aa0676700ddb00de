#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "errors/curve.h"
#include "errors/element.h"
#include "kinematics/chain.h"

namespace abbe::errors {

/// Function of node temperatures: constant + sum of terms.
struct ThermalFunction {
  struct Term {
    int node = 0;
    std::optional<int> minus;    ///< of the difference to this node, as a tilt is
    double per_K = 0.0;          ///< times dT_K, where there is no table
    std::optional<Table> table;  ///< of dT_K, instead of `per_K`
  };
  double constant = 0.0;  ///< at dT = 0
  std::vector<Term> terms;
};

/// What heat adds to one element: delta = offset(T) + slope(T) (p - fixed), p the axis position.
struct ThermalElement {
  ElementName name;
  ThermalFunction offset;  ///< mm or rad
  ThermalFunction slope;   ///< mm or rad per mm or rad of the axis; none for location and spindle
  double fixed = 0.0;      ///< mm or rad, the fixed bearing, in the axis's commanded positions
};

/// Where an axis is measured, hence what of its growth shows.
enum class Feedback {
  Motor,  ///< encoder on the screw: the screw's growth shows
  Scale,  ///< linear scale: the scale's growth shows, the screw's does not
};
/// Something that grows along a slide.
struct Expansion {
  int node = 0;
  double per_K = 0.0;  ///< relative growth, 11.7e-6 for steel
  double fixed = 0.0;  ///< mm, commanded position of the fixed bearing or end
};
struct AxisExpansion {
  char axis = 'X';
  Feedback feedback = Feedback::Motor;
  std::optional<Expansion> screw;
  std::optional<Expansion> scale;
};

/// The workpiece grows while it is cut and is judged at 20 deg C (ISO 1).
struct WorkpieceExpansion {
  int node = 0;
  double per_K = 0.0;
  Eigen::Vector3d fixed_w = Eigen::Vector3d::Zero();  ///< mm, where it is held
};

/// A description of thermal errors. dT_K of a node is its temperature minus `reference_T_C`.
struct ThermalErrors {
  std::vector<ThermalElement> elements;
  std::vector<AxisExpansion> expansions;
  std::optional<WorkpieceExpansion> workpiece;
  double reference_T_C = 20.0;
};

/// The same bound to a chain. Immutable: made by `bind`. A grown screw or scale moves the carriage
/// itself farther from its fixed end along its travel, so on either side it adds per_K dT (carriage
/// travel - carriage travel of the fixed end): E_LL where the slide lies along a bed axis.
struct ThermalModel {
  struct Bound {
    int joint = 0;
    int component = 0;  ///< 0..5
    bool location = false;
    ThermalElement element;
    bool primed = false;  ///< the slope counts the carriage's own travel, against the command
  };
  std::vector<Bound> elements;  ///< those described, then those of the expansions
  std::optional<WorkpieceExpansion> workpiece;
  double reference_T_C = 20.0;
  int joints = 0;

  // Prepared from the above, so that `deviations` walks one list.
  struct Term {
    int element = 0;  ///< index in elements
    bool of_slope = false;
    int node = -1;        ///< -1: a constant
    int minus = -1;       ///< -1: against the reference
    double factor = 0.0;  ///< the constant, or per K
    int table = -1;       ///< index in tables, instead of the factor
  };
  std::vector<Term> terms;
  std::vector<Curve> tables;
};

/// @param nodes  number of nodes of the network
/// @throws std::invalid_argument naming the element: an axis that the chain lacks, an element that
///         the axis cannot have (as for geometric errors), a slope of a location or spindle
///         element, an element twice, a node out of range, a table that `validate` refuses, an
///         expansion of an axis that is no slide, `motor` without a screw or `scale` without a
///         scale, an expansion twice, a workpiece that grows by 1e-3 per K or more, a number that
///         is not finite
ThermalModel bind(const ThermalErrors& errors, const kinematics::Chain& chain, int nodes);

/// Thermal part of every joint's deviation, in the order of the chain.
/// @param q    (joints) commanded positions
/// @param T_C  (nodes)
/// @throws std::out_of_range where a table that refuses is left, naming the element and node
std::vector<kinematics::JointDeviation> deviations(const ThermalModel& model,
                                                   const kinematics::AxisVector& q,
                                                   const Eigen::VectorXd& T_C);

/// Place on the part, once it is back at 20 deg C, of a point of the workpiece as it is now:
/// fixed + (point - fixed) / (1 + per_K (T - 20)). The same bits where the model has no workpiece
/// or it stands at 20 deg C.
Eigen::Vector3d at_20_C(const ThermalModel& model, const Eigen::VectorXd& T_C,
                        const Eigen::Vector3d& point_w);

/// Every value of the model times `factor` (of the workpiece's growth too).
ThermalModel scaled(const ThermalModel& model, double factor);

}  // namespace abbe::errors
