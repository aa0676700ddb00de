#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "kinematics/axes.h"

/// A program as a path: blocks with geometry and time, in the coordinates of the axes or the tip.
namespace abbe::sim::program {

/// A decision of the reader where the program leaves a choice to the control or the operator. A
/// reader reports it with `Canon::assume` at the line that depends on it. `abbe program`, `check`,
/// `run` and `compare` print each assumption once, and summary.json lists them under `assumptions`.
struct Assumption {
  std::string text;  ///< the assumption and its effect on this program
  std::string key;   ///< scene key that changes it, for example "program.block_skip"
  /// Option of `abbe program` that changes it, for example "--block-skip"; empty if there is none.
  std::string option = {};
  int line = 0;  ///< first line that depends on it; 0: the whole program
  /// File of that line if it is a subprogram file; empty: the program itself.
  std::string file = {};
};

/// Returns the assumption as text, for example "line 7: block skip is on: 3 blocks left out
/// (program.block_skip)".
std::string to_text(const Assumption& assumption);

/// Cutter data found in a comment of a CAM system.
struct CutterData {
  enum class End { Unspecified, Flat, Ball };
  std::optional<int> number;  ///< tool number (T)
  double diameter = 0.0;      ///< > 0, in the unit of the comment
  std::optional<double> corner_radius;
  End end = End::Unspecified;
  /// mm per unit if the comment names a unit; otherwise the unit of the program applies
  std::optional<double> unit_mm;
};

/// A comment of the program that gives the diameter of a cutter.
struct ToolComment {
  int line = 0;
  std::string text;
  CutterData words;  ///< in mm
  /// Index of the block that follows; the number of blocks at the end of the program.
  std::size_t before = 0;
};

/// Parses a tool comment such as "T1 D=10. CR=0. - FLAT END MILL", "TOOL - 1 DIA. OFF. - 1 LEN. - 1
/// DIA. - 10.", "T1 | 10. FLAT ENDMILL | H1", "TOOL DIAMETER: 10", "D10R1", "T2 D6", "5mm Endmill"
/// or "End Mill {6.35 mm}", in upper or lower case. Lengths may be fractions ("1/2", "1-1/2").
/// Register numbers (H1 D1, DIA. OFF.) are not taken as diameters. Returns nothing if the comment
/// gives no diameter.
std::optional<CutterData> parse_cutter_comment(std::string_view comment);

/// Meaning of the programmed coordinates of a block.
enum class Coordinates {
  Axis,  ///< positions of the axes
  Tip,   ///< X Y Z: tip in the workpiece frame (G43.4); the other coordinates: axis positions
};

/// Motion type of a block.
enum class Interpolation {
  Rapid,  ///< G0, straight in the programmed coordinates
  Line,   ///< G1
  Arc,    ///< G2 G3: circle in one plane, all other coordinates linear in time (helix)
  Cubic,  ///< PVT: Hermite cubic of every coordinate
  Dwell,  ///< G4, or a change of offset without motion
};

/// A circular arc in the plane of two joints, or in a rotated plane.
struct Arc {
  int first = 0;  ///< joint indices that span the plane, right-handed: G17 X Y, G18 Z X, G19 Y Z
  int second = 1;
  Eigen::Vector2d centre;  ///< mm
  double radius = 0.0;     ///< mm, at the start
  /// mm, end radius minus start radius: the mismatch that the reader tolerates, spread evenly over
  /// the arc
  double growth = 0.0;
  double start_angle = 0.0;  ///< rad
  double sweep = 0.0;        ///< rad, signed: positive from the first to the second axis (G3)
  int third = -1;            ///< joint normal to the plane; only for an arc in a rotated plane
  /// Index into Path::plane_rotations; -1 for the plane of the joints. In a rotated plane first,
  /// second and third are X Y Z in some order, and the first two axes of the rotation span the
  /// plane.
  int plane_rotation = -1;
};

/// Returns the point of the arc at fraction u of its sweep, mm, in the plane of the arc.
Eigen::Vector2d position(const Arc& arc, double u);

/// End points and centre of an arc in its plane, mm.
struct ArcGeometry {
  Eigen::Vector2d start, end, centre;
  bool clockwise = false;
};

/// Returns the arc through the end points; its sweep is above zero and at most one whole turn. An
/// end within 1e-8 mm of the start makes a full circle. `first` and `second` are not set.
Arc arc_through(const ArcGeometry& geometry);

/// End velocities of a Hermite cubic.
struct Cubic {
  kinematics::AxisVector start_velocity;  ///< (joints) mm/s, rad/s
  kinematics::AxisVector end_velocity;    ///< (joints) mm/s, rad/s
};

/// One block with its start and end time. Programmed coordinates, mm and rad, have one entry for
/// each joint in the order of the structural code. They include work offsets and tool length.
struct Block {
  int line = 0;
  Interpolation interpolation = Interpolation::Line;
  Coordinates coordinates = Coordinates::Axis;
  double start_s = 0.0;
  double end_s = 0.0;
  kinematics::AxisVector start;
  kinematics::AxisVector end;
  std::uint32_t shape = 0;    ///< index into Path::arcs or Path::cubics
  bool inch = false;          ///< programmed in inches (G20)
  bool inverse_time = false;  ///< programmed under G93
  /// 0 .. 5 for G54 .. G59, more for other systems; -1 for none (G53, PVT)
  std::int16_t work_offset = 0;
  std::uint16_t file = 0;  ///< 0: the file of the path; else 1 + index into Path::more_files
  int tool_length = -1;    ///< H number of the G43 or G43.4 in force; -1 for none
};

/// Returns true if the block is neither a rapid nor a dwell.
bool is_feed(const Block& block);

/// Words of an NC program that cause no motion: T, M0 M1 M6 M7 M8 M9.
struct AuxiliaryWord {
  /// Index of the block that follows; the number of blocks at the end of the program.
  std::size_t before = 0;
  std::string text;
};

/// A tool call of an NC program.
struct ToolCall {
  int line = 0;
  int number = 0;        ///< of the T word in force; -1: M6 before any T
  bool changes = false;  ///< true: M6; false: T alone
  /// Index of the block that follows; the number of blocks at the end of the program.
  std::size_t before = 0;
};

/// A G20 or G21 that changes the unit in force, or states the first one.
struct UnitWord {
  int line = 0;
  bool inch = false;
};

/// A program after reading: the commanded motion over time, block by block. Its memory is
/// proportional to the number of blocks.
struct Path {
  std::string file;
  std::string read_as = {};  ///< dialect and the reason it was recognised; empty: nothing to report
  std::vector<std::string> subprogram_files = {};  ///< files of subprograms outside the main file
  std::vector<Block> blocks;
  std::vector<Arc> arcs;
  std::vector<Eigen::Matrix3d> plane_rotations = {};  ///< of arc planes that no two joints span
  std::vector<Cubic> cubics;
  std::vector<AuxiliaryWord> auxiliary_words;  ///< in program order
  std::vector<ToolCall> tool_calls;            ///< in program order
  std::vector<ToolComment> tool_comments;      ///< in program order
  std::vector<UnitWord> unit_words;            ///< in program order
  std::vector<Assumption> assumptions;         ///< without repeats, in the order of first use
  int motion_blocks = 0;  ///< number of blocks with motion, `moves` in the summary
};

/// Returns a path of blocks `first` to `last` - 1 and the auxiliary words that precede them.
Path path_segment(const Path& path, std::size_t first, std::size_t last);

/// Returns the programmed coordinates at fraction u in [0, 1] of the block's time. The values at u
/// = 0 and u = 1 are the block's start and end, bit for bit.
kinematics::AxisVector position(const Path& path, const Block& block, double u);

/// Returns the fractions of an arc block at which one of its axes reverses, in no particular order.
std::vector<double> reversal_points(const Path& path, const Block& block);

/// Returns the rate of the programmed coordinates at fraction u, mm/s and rad/s. In a dwell it is
/// zero except for a turning spindle.
kinematics::AxisVector velocity(const Path& path, const Block& block, double u);

}  // namespace abbe::sim::program
