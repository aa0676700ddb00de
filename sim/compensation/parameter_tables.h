#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "kinematics/chain.h"

/// Compensation tables as the parameters of a control hold them: one-dimensional, finite, the same
/// for every program.
namespace abbe::sim::compensation {

/// Correction of one axis over the position of one axis (its own: pitch; another: straightness,
/// sag), linear between points, held outside.
struct AxisTable {
  int of = 0;                ///< joint whose position is looked up
  int moves = 0;             ///< joint that is corrected
  Eigen::VectorXd position;  ///< (n >= 2) increasing, commanded, mm or rad
  Eigen::VectorXd upward;    ///< (n) correction where `of` last moved up, mm or rad
  Eigen::VectorXd downward;  ///< (n) the same where it moved down
};

struct ParameterTables {
  std::vector<AxisTable> tables;
  kinematics::AxisVector offset;  ///< (joints) constant: tool offset, origin
};

/// Correction of one table: linear between points, held outside. Between the directions before the
/// first motion their mean. mm or rad
/// @param direction  of `of`: +1 up, -1 down, 0 has not moved yet
double correction(const AxisTable& table, double position, int direction);

/// Correction that the tables give, added up. @return (joints)
kinematics::AxisVector correction(const ParameterTables& tables,
                                  const kinematics::AxisState& state);

/// @throws std::invalid_argument if a table names a joint that the chain lacks or the spindle nose,
///         has fewer than 2 points, positions that do not increase, or numbers that are not finite
void validate(const ParameterTables& tables, const kinematics::Chain& chain);

/// Correction that a compensator would give at a state: what tables are made from.
using CorrectionAt = std::function<kinematics::AxisVector(const kinematics::AxisState&)>;

struct TableOptions {
  int most_points = 256;  ///< a table
  double spacing = 5.0;   ///< mm between points of a slide, wider where most_points asks for it
  double spacing_rad = 0.0873;  ///< the same of a rotary axis
  bool cross = true;            ///< tables of an axis over another (straightness, sag)
  bool both_ways = true;        ///< backlash: one column a direction; else the mean of both
  bool constant = true;         ///< the tool and origin offset
  /// Rows lower, upper; a joint whose column has no width is corrected but not looked up. None: the
  /// travel; joints whose travel has no end (|limit| >= 1e9, the workpiece spindle) are left out.
  std::optional<Eigen::Matrix<double, 2, kinematics::max_joints>> range;
};

/// Equidistant positions at which a joint is looked up, both ends of its range among them; none for
/// a joint that is not. mm or rad
/// @throws std::invalid_argument as `tabulated`
Eigen::VectorXd table_positions(const kinematics::Chain& chain, int joint,
                                const TableOptions& options = {});

/// Tables of a correction about a reference position: along each axis alone, the others standing
/// there as before their first motion; the offset is the correction at the reference. What depends
/// on two axes at once no table holds. A table of spacing h leaves at most
/// h^2/8 max|second derivative| of what it tabulates. Tables that would hold zeros only are left
/// out, and the spindle nose always is.
/// @throws std::invalid_argument if most_points is below 2, a spacing is not above 0, a range is
/// not
///         finite or reversed, or the reference is not of the chain's size
ParameterTables tabulated(const CorrectionAt& correction, const kinematics::Chain& chain,
                          const kinematics::AxisVector& reference,
                          const TableOptions& options = {});

}  // namespace abbe::sim::compensation
