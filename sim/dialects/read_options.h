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

/// Languages of machining programs.
enum class Dialect {
  Auto,      ///< detected by `detect_dialect`
  LinuxCnc,  ///< RS274/NGC as LinuxCNC reads it, and G43.4 of abbe's own programs
  Fanuc,
  Siemens,     ///< 840D
  Heidenhain,  ///< Klartext
  Cl,          ///< APT cutter locations, or CSV
};

/// Returns the name used in scenes, "linuxcnc".
std::string_view name_of(Dialect dialect);

/// A detected dialect and the evidence for it, for example "line 3 has TRAORI".
struct DetectedDialect {
  Dialect dialect = Dialect::LinuxCnc;
  std::string evidence;
  int line = 0;  ///< line of the evidence; 0: the file name, or no evidence
};

/// Detects the dialect from the evidence listed in this folder's README: first the file name, then
/// the first of the leading 2000 lines that only one dialect can contain. Without evidence the
/// dialect is LinuxCNC's. Comments in brackets or after ; are ignored.
DetectedDialect detect_dialect(std::string_view text, std::string_view file);

/// All input errors of a program. As a BadInput it states the first of them; `what()` has one line
/// "file:line:column: expected ..., seen ..." for each.
struct BadProgram : BadInput {
  /// `input_errors` must not be empty.
  explicit BadProgram(std::vector<BadInput> input_errors);
  const char* what() const noexcept override { return text.c_str(); }

  std::vector<BadInput> input_errors;
  std::string text;
};

/// Treatment of words that are unknown in the dialect.
enum class UnknownWordPolicy {
  Refuse,  ///< an unknown word is an input error
  Warn,    ///< an unknown word is skipped and counted
};

/// Limits of a program. Exceeding one is an input error at the line.
struct ProgramLimits {
  std::size_t blocks = 20'000'000;  ///< executed blocks; a block in a loop counts at every pass
  int call_depth = 50;              ///< nesting of calls
  std::size_t variables = 1'000'000;
};

/// Reader of LinuxCNC programs.
enum class Interpreter {
  Abbe,      ///< the front end of this folder
  LinuxCnc,  ///< LinuxCNC's own rs274, as a separate process
};

/// Limits of LinuxCNC's own interpreter. Exceeding one is an input error at the line.
struct InterpreterLimits {
  double seconds = 120.0;     ///< total run time
  double megabytes = 4000.0;  ///< size of its output, about 120 bytes for each move
};

/// Treatment of tool vectors, and of poles: poses with the tool along a rotary axis, whose rotation
/// then does not change the tool direction. `README.md` gives the sources.
enum class PoleRule {
  AsProgrammed,  ///< behaviour of the dialect unless parameters of the control select another
  LinuxCnc,      ///< rotary axes move as programmed; there are no vectors
  /// Tool posture control of G43.5: a block that would pass close to a pole passes through it
  /// instead.
  Fanuc,
  Siemens,  ///< vectors on great circles; nothing is changed at a pole
};

/// Rule and parameters for tool vectors near a pole.
struct PoleOptions {
  PoleRule rule = PoleRule::AsProgrammed;
  double near_angle = 0.0;  ///< rad, Fanuc parameter 19738: angle to the pole below which a block
                            ///< is close; 0: never
  /// rad, Fanuc parameter 19739: largest rotation about the pole of the end of a block
  double max_rotation_about_pole = 0.0;
};

/// Machine type of a control. Turning and milling controls of one maker interpret the same words
/// differently.
enum class ControlKind {
  FromMachine,  ///< turning if a spindle turns the workpiece, else milling
  Milling,
  Turning,  ///< Fanuc: G-code system A
};

/// Meaning of X words until the program selects one.
enum class XWordMeaning {
  FromControl,  ///< diameters on turning controls of Fanuc and Siemens, else radii
  Diameters,
  Radii,
};

/// Settings of a turning control that a program does not state.
struct TurningOptions {
  ControlKind control_kind = ControlKind::FromMachine;
  XWordMeaning x_words = XWordMeaning::FromControl;
  /// 0 to 9: point of the turning tool that X and Z position without nose compensation, in the
  /// numbering of Fanuc and Siemens; 0 and 9: the centre of its nose
  int tip_number = 0;
};

/// Options for reading a program in any dialect.
struct ReadOptions {
  program::NcOptions control;  ///< state of the control before the program begins
  Dialect dialect = Dialect::Auto;
  UnknownWordPolicy on_unknown = UnknownWordPolicy::Refuse;
  std::string startup_code = {};  ///< block executed before the first line
  ProgramLimits limits = {};
  std::filesystem::path subprogram_folder =
      {};  ///< folder of subprograms that are separate files; empty: none
  /// Receives the blocks while the program is read, up to `path_segment_blocks` at a time, so that
  /// none are kept in memory. Not called again after the first error.
  std::function<void(program::Path segment)> on_path_segment = {};
  /// Called at intervals with the fraction of the file that has been read.
  std::function<void(double fraction)> progress = {};
  Interpreter interpreter = Interpreter::Abbe;
  InterpreterLimits interpreter_limits = {};
  PoleOptions pole = {};
  TurningOptions turning = {};
};

/// Largest number of blocks in a segment that `on_path_segment` receives.
inline constexpr std::size_t path_segment_blocks = 32768;

/// An unknown word that was skipped.
struct SkippedWord {
  std::string word;  ///< "G187"
  std::size_t count = 0;
  int line = 0;  ///< line of its first occurrence
};

}  // namespace abbe::sim::dialects
