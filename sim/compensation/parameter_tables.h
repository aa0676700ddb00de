#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/chain.h"

/// Compensation tables in the parameters of controls. They are one-dimensional, finite, and the
/// same for every program.
namespace abbe::sim::compensation {

/// Correction of one axis over the position of the same axis (pitch) or of another one
/// (straightness, sag). It is linear between points and constant outside.
struct AxisTable {
  int argument_joint = 0;    ///< joint whose position is the argument
  int corrected_joint = 0;   ///< joint that is corrected
  Eigen::VectorXd position;  ///< (n >= 2) increasing, commanded, mm or rad
  Eigen::VectorXd upward;    ///< (n) correction if that joint last moved up, mm or rad
  Eigen::VectorXd downward;  ///< (n) correction if the argument joint last moved down
};

/// The tables of a control and a constant offset.
struct ParameterTables {
  std::vector<AxisTable> tables;
  kinematics::AxisVector offset;  ///< (joints) constant part: tool offset, origin
};

/// Returns the correction of one table, mm or rad. Before the first motion it is the mean of both
/// directions.
/// @param direction  of the argument joint: +1 up, -1 down, 0 not moved yet
double correction(const AxisTable& table, double position, int direction);

/// Returns the sum of the corrections of the tables.
/// @return (joints)
kinematics::AxisVector correction(const ParameterTables& tables,
                                  const kinematics::AxisState& state);

/// Throws std::invalid_argument if a table names a joint that the chain lacks or the spindle nose,
/// has fewer than 2 points, positions that do not increase, or numbers that are not finite.
void validate(const ParameterTables& tables, const kinematics::Chain& chain);

/// Returns the correction of a compensator at a state; `tabulate` makes tables of it.
using CorrectionFunction = std::function<kinematics::AxisVector(const kinematics::AxisState&)>;

/// Options of `tabulate`.
struct TableOptions {
  int max_points = 256;         ///< in a table
  double spacing = 5.0;         ///< mm between points of a slide; wider if `max_points` requires it
  double spacing_rad = 0.0873;  ///< rad between points of a rotary axis
  bool cross = true;            ///< includes tables of one axis over another (straightness, sag)
  bool has_direction_columns =
      true;              ///< a column for each direction (backlash); false: the mean of both
  bool constant = true;  ///< includes the tool and origin offset
  /// Rows lower, upper. A joint whose range has no width is corrected but is no argument of tables.
  /// Empty: the travel, without joints that have no limits (|limit| >= 1e9, the workpiece spindle).
  std::optional<Eigen::Matrix<double, 2, kinematics::max_joints>> range;
};

/// Returns the equidistant positions of the tables over a joint, including both ends of its range,
/// mm or rad; an empty vector if it has no tables.
/// @throws std::invalid_argument as `tabulate`
Eigen::VectorXd table_positions(const kinematics::Chain& chain, int joint,
                                const TableOptions& options = {});

/// Returns the tables of a correction about a reference position. Each table follows one axis
/// alone, with the others at the reference before their first motion; the offset is the correction
/// at the reference. A dependence on two axes at once is lost. With spacing h the error of a table
/// is at most h^2/8 max|second derivative| of the tabulated correction. Tables of zeros and of the
/// tool spindle are omitted.
/// @throws std::invalid_argument if `max_points` is below 2, a spacing is not above 0, a range is
///     not finite or reversed, or the reference does not have the size of the chain
ParameterTables tabulate(const CorrectionFunction& correction, const kinematics::Chain& chain,
                         const kinematics::AxisVector& reference, const TableOptions& options = {});

// Layouts of the compensation tables of real controls. Lengths are mm, angles of rotary axes
// degrees; axes have the letters of the chain.

/// LinuxCnc: one COMP_FILE for each joint with at most 256 increasing rows `nominal forward
/// reverse`, and the INI lines that load them, in compensation.ini. Tables are over the same axis
/// only, linear between rows and constant outside. They are written as COMP_FILE_TYPE 1: trims,
/// which the motion controller adds to the commanded position and stores in single precision. They
/// have no comments, because LinuxCNC stops reading at the first line that is not three numbers.
/// Joints are numbered as by trivkins, X Y Z A B C U V W. Source: LinuxCNC 2.9, INI configuration,
/// [JOINT_n]; usrmotintf.cc; control.c.
///
/// Isg: six deviations of each carriage over its own axis, `X EXX EYX EZX EAX EBX ECX`, mm and rad,
/// rotary arguments in degrees; position errors `C0Y B0Z ...` with one row in a separate file; `//`
/// begins a comment, a line with # a new header. Public documents do not state whether commas may
/// separate the columns (blanks are written, as in the manual), which values apply outside the rows
/// (assumed constant), and the signs of each kinematic chain (written: actual minus nominal of the
/// carriage over the command; the control has `negate`).
/// Source: ISG kernel / Beckhoff TF5280, ISG CSV format, units of measure, P-VOLC-00009, -00012.
///
/// Siemens: SINUMERIK 840D sl. $AA_ENC_COMP[0,N,X1] is used over the same axis if both directions
/// are alike; otherwise, and over another axis, $AN_CEC[t,N] with $AN_CEC_DIRECTION 1 and -1.
/// Points are equidistant from MIN to MAX, values linear between them and constant outside; the
/// file ends with M17. A positive $AA_ENC_COMP moves the axis in the negative direction, so it
/// holds the error. Public documents do not state the sign of $AN_CEC; it is assumed to be added to
/// the set-point. Source: Siemens 840D sl / 828D Function Manual Extended Functions, K3,
/// interpolatory compensation.
///
/// Heidenhain: Heidenhain-style. Each argument axis has a .COM table of at most 256 rows with
/// AXISPOS, a column for each compensated axis with its error, which the control subtracts, and
/// BACKLASH, the error of the argument axis itself in the negative direction. CONFIG.CMA names the
/// .COM of each axis, and ACTIVE * marks the active line. Assumed are the frame of the text as in
/// other tables of these controls (`BEGIN name MM`, a header, columns at fixed positions, `[END]`),
/// 4 decimals, values linear between rows and constant outside, and BACKLASH as an absolute value,
/// not a difference. Source: HEIDENHAIN Technical Manuals MANUALplus 620 (nonlinear axis-error
/// compensation), TNC 407 (256 entries, error positive where the travel is too long).
enum class ControlFormat { LinuxCnc, Isg, Siemens, Heidenhain };
/// Returns the name of a format, such as "linuxcnc".
const char* to_string(ControlFormat format);

/// A file of a control.
struct ControlFile {
  std::string name;  ///< "X.comp"
  std::string text;
};

/// Files for a control.
struct ControlExport {
  std::vector<ControlFile> files;
  std::vector<std::string> omissions;  ///< parts of the correction that the files cannot hold
  std::vector<std::string> notes;      ///< required settings of the control, and assumptions
};

}  // namespace abbe::sim::compensation
