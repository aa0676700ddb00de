#pragma once

#include <string>
#include <vector>

/// Layouts of compensation tables of real controls. Lengths are mm, angles of rotary axes degrees;
/// axes bear the letters of the chain.
namespace abbe::sim::compensation {

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
