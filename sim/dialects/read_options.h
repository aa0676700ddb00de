#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bad_input.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects {

/// The languages in which machining programs are written.
enum class Dialect {
  Auto,      ///< by the signs that `recognised` looks for
  LinuxCnc,  ///< RS274/NGC as LinuxCNC reads it, and G43.4 of abbe's own programs
  Fanuc,
  Siemens,     ///< 840D
  Heidenhain,  ///< Klartext
  Cl,          ///< APT cutter locations, or CSV
};

/// "linuxcnc", as a scene says it.
std::string_view name_of(Dialect dialect);

/// A dialect and the sign by which it was taken, as "line 3 has TRAORI".
struct Recognised {
  Dialect dialect = Dialect::LinuxCnc;
  std::string sign;
  int line = 0;  ///< of the sign; 0: it is the name of the file, or there is none
};

/// The dialect of a program by its signs, listed in the README of this folder: what its file is
/// named, then the first line of the first 2000 that only one dialect can have; else LinuxCNC's.
/// A line in brackets or behind ; is no sign.
Recognised recognised(std::string_view text, std::string_view file);

/// All faults of a program at once: as a BadInput it is the first of them, `what()` has one
/// "file:line:column: expected ..., seen ..." a line.
struct BadProgram : BadInput {
  /// @param faults  at least one
  explicit BadProgram(std::vector<BadInput> input_errors);
  const char* what() const noexcept override { return text.c_str(); }

  std::vector<BadInput> input_errors;
  std::string text;
};

enum class UnknownWordPolicy {
  Refuse,  ///< a word that the dialect has not is a fault
  Warn,    ///< it is skipped, and counted
};

/// How far a program may go. Each ends in a refusal that names the line.
struct Limits {
  std::size_t blocks = 20'000'000;  ///< executed, those of loops and calls each time
  int depth = 50;                   ///< of calls within calls
  std::size_t variables = 1'000'000;
};

/// What reads a program of LinuxCNC.
enum class Interpreter {
  Abbe,      ///< the front end of this folder
  LinuxCnc,  ///< LinuxCNC's own rs274, as a process of its own
};

/// How far LinuxCNC's own interpreter may go. Each ends in a refusal that names the line.
struct InterpreterLimits {
  double seconds = 120.0;     ///< until its end
  double megabytes = 4000.0;  ///< of commands, about 120 bytes a move
};

/// What a control does with vectors of the tool, and near a pole: where the tool lies along a
/// rotary axis, which then turns nothing. `README.md` says where each is documented.
enum class PoleRule {
  AsProgrammed,  ///< what the dialect does unless parameters of the control ask for more
  LinuxCnc,      ///< rotary axes go as they are written; there are no vectors
  Fanuc,         ///< tool posture control of G43.5: a block that would pass close by a pole is led
                 ///< through it
  Siemens,       ///< vectors on great circles; nothing is changed at a pole
};

struct PoleOptions {
  PoleRule rule = PoleRule::AsProgrammed;
  double near = 0.0;        ///< rad, Fanuc's parameter 19738: nearer than this is close; 0: never
  double max_change = 0.0;  ///< rad, Fanuc's parameter 19739: by which the end of a block may be
                            ///< turned about the pole
};

/// For what kind of machine a control is made: both kinds of one maker read the same words
/// differently.
enum class ControlKind {
  FromMachine,  ///< turning where a spindle turns the workpiece, else milling
  Milling,
  Turning,  ///< Fanuc: G-code system A
};

/// Diameters in X words until the program says otherwise.
enum class XWordMeaning {
  FromControl,  ///< diameters on turning controls of Fanuc and Siemens, else radii
  Diameters,
  Radii,
};

/// What is known of a turning control beside its program.
struct TurningOptions {
  ControlKind control = ControlKind::FromMachine;
  XWordMeaning x_words = XWordMeaning::FromControl;
  int tip = 0;  ///< 0 to 9: which point of a turning tool X Z lead without nose compensation, as
                ///< Fanuc and Siemens number them; 0 and 9: the centre of its nose
};

struct ReadOptions {
  program::NcOptions control;  ///< what the control knows before it reads
  Dialect dialect = Dialect::Auto;
  UnknownWordPolicy on_unknown = UnknownWordPolicy::Refuse;
  std::string startup_code = {};  ///< a block that is read before the program's first line
  Limits limits = {};
  std::filesystem::path folder =
      {};  ///< where subprograms in files of their own stand; empty: none do
  /// Takes the blocks as they are made, up to `path_segment_blocks` at a time, so that none are
  /// kept: of a program of which only figures are wanted. Not called again after the first fault.
  std::function<void(program::Path piece)> on_path_segment = {};
  /// Called now and then with the share of the file that has been read.
  std::function<void(double fraction)> progress = {};
  Interpreter interpreter = Interpreter::Abbe;
  InterpreterLimits interpreter_limits = {};
  PoleOptions pole = {};
  TurningOptions turning = {};
};

/// Blocks of a piece.
inline constexpr std::size_t path_segment_blocks = 32768;

/// A word that was skipped.
struct SkippedWord {
  std::string word;  ///< "G187"
  std::size_t count = 0;
  int line = 0;  ///< of the first
};

}  // namespace abbe::sim::dialects
