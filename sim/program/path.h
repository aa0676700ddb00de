#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "kinematics/axes.h"

namespace abbe::sim::program {

/// A choice that a program leaves to its control or its operator, as the reader made it. A reader
/// reports one with `Canon::assume` where the program depends on it; `abbe program`, `check`, `run`
/// and `compare` print each once, and summary.json lists them under `assumptions`.
struct Assumption {
  std::string text;         ///< what was assumed, and what follows from it here
  std::string key;          ///< scene key that changes it, "program.block_skip"
  std::string option = {};  ///< of `abbe program` that changes it, "--block-skip"; empty: none
  int line = 0;             ///< first line that depends on it; 0: the whole program
  std::string file = {};    ///< file of that line, if it is a subprogram's
};

/// Returns "line 7: block skip is on: 3 blocks left out (program.block_skip)".
std::string to_text(const Assumption& assumption);

/// What a comment of a CAM system says of a cutter.
struct CutterData {
  enum class End { Unspecified, Flat, Ball };
  std::optional<int> number;  ///< T of the tool
  double diameter = 0.0;      ///< > 0, in the unit of the words
  std::optional<double> corner_radius;
  End end = End::Unspecified;
  std::optional<double> unit_mm;  ///< mm per unit, where the words name one; else the program's
};

/// A comment of a program that gives the diameter of a cutter.
struct ToolComment {
  int line = 0;
  std::string text;
  CutterData words;        ///< in mm
  std::size_t before = 0;  ///< block that it stands before; the number of blocks at the end
};

/// Reads "T1 D=10. CR=0. - FLAT END MILL", "TOOL - 1 DIA. OFF. - 1 LEN. - 1 DIA. - 10.",
/// "T1 | 10. FLAT ENDMILL | H1", "TOOL DIAMETER: 10", "D10R1", "T2 D6", "5mm Endmill",
/// "End Mill {6.35 mm}" and what is like them, in letters of either case; lengths may be fractions
/// ("1/2", "1-1/2"). Register numbers (H1 D1, DIA. OFF.) are no diameters. @return none for a
/// comment that gives no diameter
std::optional<CutterData> parse_cutter_comment(std::string_view comment);

/// What the numbers of a block mean.
enum class Coordinates {
  Axis,  ///< positions of the axes
  Tip,   ///< X Y Z are the tip in the workpiece frame (G43.4), the others positions of axes
};

enum class Interpolation {
  Rapid,  ///< G0, straight in the programmed coordinates
  Line,   ///< G1
  Arc,    ///< G2 G3: circle in one plane, all other coordinates in proportion (helix)
  Cubic,  ///< PVT: Hermite cubic of every coordinate
  Dwell,  ///< G4, or a change of offset without motion
};

struct Arc {
  int first = 0;  ///< joint indices of the plane, right-handed: G17 X Y, G18 Z X, G19 Y Z
  int second = 1;
  Eigen::Vector2d centre;    ///< mm
  double radius = 0.0;       ///< mm, at the start
  double growth = 0.0;       ///< mm, radius at the end minus that at the start: what the reader
                             ///< tolerates, spread evenly over the arc
  double start_angle = 0.0;  ///< rad
  double sweep = 0.0;        ///< rad, signed: + from first to second axis (G3)
  int third = -1;            ///< joint across the plane, of a turned arc
  int turned = -1;  ///< index into Path::turns: first, second and third are X Y Z in some order,
                    ///< and the plane is that of the first two of these turned; -1: of the joints
};

/// A place on the arc at fraction u of it, in the plane. @return mm
Eigen::Vector2d position(const Arc& arc, double u);

/// Ends and centre of an arc in its plane, mm.
struct ArcGeometry {
  Eigen::Vector2d start, end, centre;
  bool clockwise = false;
};

/// The arc through them, of more than nothing and at most a whole turn; an end within 1e-8 mm of
/// the start makes a circle. `first` and `second` are left.
Arc arc_through(const ArcGeometry& words);

struct Cubic {
  kinematics::AxisVector start_velocity;  ///< (joints) mm/s, rad/s
  kinematics::AxisVector end_velocity;    ///< (joints)
};

/// One block with its time. Programmed coordinates are per joint in the order of the structural
/// code, mm and rad, work offsets and tool length already in.
struct Block {
  int line = 0;
  Interpolation interpolation = Interpolation::Line;
  Coordinates coordinates = Coordinates::Axis;
  double start_s = 0.0;
  double end_s = 0.0;
  kinematics::AxisVector start;
  kinematics::AxisVector end;
  std::uint32_t shape = 0;       ///< index into Path::arcs or Path::cubics
  bool inch = false;             ///< it stood in inches (G20)
  bool inverse_time = false;     ///< under G93
  std::int16_t work_offset = 0;  ///< 0 .. 5, G54 .. G59, more for others; -1 for none (G53, PVT)
  std::uint16_t file = 0;        ///< 0 that of the path, else counted from 1 in Path::more_files
  int tool_length = -1;          ///< H of the G43 or G43.4 in force; -1 for none
};

/// Neither rapid nor dwell.
bool is_feed(const Block& block);

/// Words of an NC program that move nothing: T, M0 M1 M6 M7 M8 M9.
struct AuxiliaryWord {
  std::size_t before = 0;  ///< block that they stand before; the number of blocks at the end
  std::string text;
};

/// A tool that an NC program names.
struct ToolCall {
  int line = 0;
  int number = 0;          ///< of the T word in force; -1: M6 before any
  bool changes = false;    ///< M6; else T alone
  std::size_t before = 0;  ///< block that it stands before; the number of blocks at the end
};

/// G20 or G21 where another unit was in force, or none yet.
struct UnitWord {
  int line = 0;
  bool inch = false;
};

/// A program read: what the axes are commanded, block by block, in time. Memory is linear in the
/// blocks.
struct Path {
  std::string file;
  std::string read_as = {};                  ///< its dialect and by which sign; empty: none to say
  std::vector<std::string> more_files = {};  ///< of subprograms that stand in files of their own
  std::vector<Block> blocks;
  std::vector<Arc> arcs;
  std::vector<Eigen::Matrix3d> turns = {};  ///< of planes that no two joints span
  std::vector<Cubic> cubics;
  std::vector<AuxiliaryWord> auxiliary_words;  ///< in the order of the program
  std::vector<ToolCall> tool_calls;            ///< the same
  std::vector<ToolComment> tool_comments;      ///< the same
  std::vector<UnitWord> unit_words;            ///< the same
  std::vector<Assumption> assumptions;         ///< each once, in the order they were met
  int motion_blocks = 0;                       ///< blocks with motion, as `moves` in the summary
};

/// The blocks from `first` to before `last` as a program of their own, with the words that stand
/// before them.
Path stretch_of(const Path& path, std::size_t first, std::size_t last);

/// Programmed coordinates at fraction u in [0, 1] of the block's time; the ends are the block's bit
/// for bit.
kinematics::AxisVector position(const Path& path, const Block& block, double u);

/// Fractions of an arc block at which one of its axes turns back, in no order.
std::vector<double> turning_points(const Path& path, const Block& block);

/// Their rate there, mm/s and rad/s; zero for a dwell but for a turning spindle.
kinematics::AxisVector velocity(const Path& path, const Block& block, double u);

}  // namespace abbe::sim::program
