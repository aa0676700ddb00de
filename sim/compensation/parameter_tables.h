#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/chain.h"

/// Compensation tables as controls hold them in their parameters: one-dimensional, finite, the same
/// for every program.
namespace abbe::sim::compensation {

/// Correction of one axis over the position of one axis (its own: pitch; another: straightness,
/// sag); linear between points, held outside.
struct AxisTable {
  int of = 0;                ///< joint whose position is the argument
  int moves = 0;             ///< joint that is corrected
  Eigen::VectorXd position;  ///< (n >= 2) increasing, commanded, mm or rad
  Eigen::VectorXd upward;    ///< (n) correction if `of` last moved up, mm or rad
  Eigen::VectorXd downward;  ///< (n) correction if `of` last moved down
};

/// The tables of a control and a constant offset.
struct ParameterTables {
  std::vector<AxisTable> tables;
  kinematics::AxisVector offset;  ///< (joints) constant part: tool offset, origin
};

/// Returns the correction of one table, mm or rad: linear between points, held outside. Before the
/// first motion it is the mean of both directions.
/// @param direction  of `of`: +1 up, -1 down, 0 not moved yet
double correction(const AxisTable& table, double position, int direction);

/// Returns the sum of the corrections of the tables.
/// @return (joints)
kinematics::AxisVector correction(const ParameterTables& tables,
                                  const kinematics::AxisState& state);

/// Throws std::invalid_argument if a table names a joint that the chain lacks or the spindle nose,
/// has fewer than 2 points, positions that do not increase, or numbers that are not finite.
void validate(const ParameterTables& tables, const kinematics::Chain& chain);

/// Returns the correction of a compensator at a state, from which tables are made.
using CorrectionAt = std::function<kinematics::AxisVector(const kinematics::AxisState&)>;

/// Options for making tables.
struct TableOptions {
  int max_points = 256;         ///< in a table
  double spacing = 5.0;         ///< mm between points of a slide, wider if `max_points` needs it
  double spacing_rad = 0.0873;  ///< rad, the same for a rotary axis
  bool cross = true;            ///< tables of an axis over another (straightness, sag)
  bool both_ways = true;        ///< a column for each direction (backlash); false: the mean of both
  bool constant = true;         ///< the tool and origin offset
  /// Rows lower, upper; a joint whose column has no width is corrected but has no tables over it.
  /// None: the travel; joints without limits (|limit| >= 1e9, the workpiece spindle) are left out.
  std::optional<Eigen::Matrix<double, 2, kinematics::max_joints>> range;
};

/// Returns the equidistant positions of a joint's tables, including both ends of its range, mm or
/// rad; none if the joint has no tables.
/// @throws std::invalid_argument as `tabulate`
Eigen::VectorXd table_positions(const kinematics::Chain& chain, int joint,
                                const TableOptions& options = {});

/// Returns the tables of a correction about a reference position: along each axis alone, with the
/// others at the reference before their first motion; the offset is the correction at the
/// reference. A dependence on two axes at once is lost. A table of spacing h leaves at most h^2/8
/// max|second derivative| of the tabulated correction. Tables of zeros are left out, and the
/// spindle nose always is.
/// @throws std::invalid_argument if `max_points` is below 2, a spacing is not above 0, a range is
///     not finite or reversed, or the reference does not have the size of the chain
ParameterTables tabulate(const CorrectionAt& correction, const kinematics::Chain& chain,
                         const kinematics::AxisVector& reference, const TableOptions& options = {});

// Layouts of the compensation tables of real controls. Lengths are mm, angles of rotary axes
// degrees; axes have the letters of the chain.

/// LinuxCnc: one COMP_FILE a joint with rows `nominal forward reverse`, increasing, at most 256,
/// and the INI lines that load them, in compensation.ini. Over the own axis only; linear between
/// rows, constant outside. Written as COMP_FILE_TYPE 1: trims, which the motion controller adds to
/// the commanded position and holds in single precision. No comments: LinuxCNC stops reading at the
/// first line that is not three numbers. Joints are numbered as trivkins does, X Y Z A B C U V W.
/// Source: LinuxCNC 2.9, INI configuration, [JOINT_n]; usrmotintf.cc; control.c.
///
/// Isg: six deviations of each carriage over its own axis, `X EXX EYX EZX EAX EBX ECX`, mm and rad,
/// rotary arguments in degrees; position errors `C0Y B0Z ...` with one row in a file of their own;
/// `//` begins a comment, a line with # a new header. Not documented in public: whether commas may
/// separate the columns (written as in the manual, with blanks), what holds outside the rows (taken
/// as constant), and the signs of each kinematic chain (written as here: actual minus nominal of
/// the carriage over the command; the control has `negate`).
/// Source: ISG kernel / Beckhoff TF5280, ISG CSV format, units of measure, P-VOLC-00009, -00012.
///
/// Siemens: SINUMERIK 840D sl. $AA_ENC_COMP[0,N,X1] over the own axis if both directions are alike,
/// otherwise, and over another axis, $AN_CEC[t,N] with $AN_CEC_DIRECTION 1 and -1; equidistant
/// points from MIN to MAX, linear between, the first and last value beyond; ends with M17. A
/// positive $AA_ENC_COMP moves the axis in the negative direction (so it holds the error). Not
/// documented in public: the sign of $AN_CEC, taken as added to the set-point.
/// Source: Siemens 840D sl / 828D Function Manual Extended Functions, K3, interpolatory
/// compensation.
///
/// Heidenhain: Heidenhain-style. A .COM table for each axis that is an argument, at most 256 rows:
/// AXISPOS, a column for each compensated axis with its error, which the control subtracts, and
/// BACKLASH, the error of the own axis in the negative direction; CONFIG.CMA names under each axis
/// its .COM, and ACTIVE * marks the line in force. Assumed: the frame of the text as in other
/// tables of these controls (`BEGIN name MM`, a header, columns at fixed positions, `[END]`), 4
/// decimals, linear between and constant outside, BACKLASH as a whole value and not a difference.
/// Source: HEIDENHAIN Technical Manuals MANUALplus 620 (nonlinear axis-error compensation), TNC 407
/// (256 entries, error positive where the travel is too long).
enum class ControlFormat { LinuxCnc, Isg, Siemens, Heidenhain };
/// Returns the name of a format, such as "linuxcnc".
const char* to_string(ControlFormat format);

/// A file for a control.
struct ControlFile {
  std::string name;  ///< "X.comp"
  std::string text;
};

/// The files for a control, and what they cannot hold.
struct Export {
  std::vector<ControlFile> files;
  std::vector<std::string> left_out;
  std::vector<std::string> notes;  ///< what to set on the control beside the files, and assumptions
};

}  // namespace abbe::sim::compensation
