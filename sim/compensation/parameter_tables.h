#pragma once

#include <functional>
#include <optional>
#include <string>
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
  int max_points = 256;  ///< a table
  double spacing = 5.0;  ///< mm between points of a slide, wider where most_points asks for it
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
/// @throws std::invalid_argument as `tabulate`
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
ParameterTables tabulate(const CorrectionAt& correction, const kinematics::Chain& chain,
                         const kinematics::AxisVector& reference, const TableOptions& options = {});

// Layouts of compensation tables of real controls. Lengths are mm, angles of rotary axes degrees;
// axes bear the letters of the chain.

/// LinuxCnc: one COMP_FILE a joint, rows `nominal forward reverse` that increase, at most 256, and
/// the INI lines that load them, in compensation.ini. Over the own axis only; linear between rows,
/// constant outside. Written as COMP_FILE_TYPE 1: trims, which the motion controller adds to the
/// commanded position and holds in single precision. No comments: LinuxCNC stops reading at the
/// first line that is not three numbers. Joints count as trivkins counts them, X Y Z A B C U V W.
/// Source: LinuxCNC 2.9, INI configuration, [JOINT_n]; usrmotintf.cc; control.c.
///
/// Isg: six deviations of each carriage over its own axis, `X EXX EYX EZX EAX EBX ECX`, mm and rad,
/// rotary arguments in degrees; position errors `C0Y B0Z ...` with one row in a file of their own;
/// `//` begins a comment, a line with # a new head. Not said in public: whether commas may part the
/// columns (written as the manual prints them, parted by blanks), what holds outside the rows
/// (taken as constant), and the signs of each kinematic chain (written as this program has them:
/// actual minus nominal of the carriage over the command; the control has `negate`).
/// Source: ISG kernel / Beckhoff TF5280, ISG CSV format, units of measure, P-VOLC-00009, -00012.
///
/// Siemens: SINUMERIK 840D sl. $AA_ENC_COMP[0,N,X1] over the own axis where both directions are
/// alike, else and over another axis $AN_CEC[t,N] with $AN_CEC_DIRECTION 1 and -1; equidistant
/// points from MIN to MAX, linear between, the first and last value beyond; ends with M17. A
/// positive $AA_ENC_COMP moves the axis in the negative direction (so it holds the error). Not said
/// in public: the sign of $AN_CEC, taken as added to the set-point.
/// Source: Siemens 840D sl / 828D Function Manual Extended Functions, K3, interpolatory
/// compensation.
///
/// Heidenhain: Heidenhain-style. A .COM table for each axis that is looked up, at most 256 rows:
/// AXISPOS, a column for each axis that is compensated with its error, which the control takes off,
/// and BACKLASH, the own axis's error in the negative direction; CONFIG.CMA names under each axis
/// its .COM, ACTIVE * marks the line in force. Assumed: the frame of the text as other tables of
/// these controls have it (`BEGIN name MM`, a head, columns of fixed place, `[END]`), 4 decimals,
/// linear between and constant outside, BACKLASH as a whole value and not a difference.
/// Source: HEIDENHAIN Technical Manuals MANUALplus 620 (nonlinear axis-error compensation), TNC 407
/// (256 entries, error positive where the travel is too long).
enum class ControlFormat { LinuxCnc, Isg, Siemens, Heidenhain };
const char* to_string(ControlFormat format);

/// One file for a control.
struct ControlFile {
  std::string name;  ///< "X.comp"
  std::string text;
};

/// What a control can hold of some tables, and what it cannot, in words.
struct Export {
  std::vector<ControlFile> files;
  std::vector<std::string> left_out;
  std::vector<std::string> notes;  ///< what belongs to the files on the control, what is assumed
};

}  // namespace abbe::sim::compensation
