#include "sim/dialects/linuxcnc/linuxcnc.h"
#include "sim/dialects/read_program.h"

namespace abbe::sim::dialects {

namespace linuxcnc {
namespace {

using Line = CodeTableLine<Group>;

// Short names, so that most entries fit on a line.
constexpr WordTreatment read = WordTreatment::Read, none = WordTreatment::WithoutEffect,
                        refused = WordTreatment::Refused;

// The only list of codes: the word table of the README, messages and groups are all made from it.
constexpr Line lines[] = {
    {"G0 G1", Group::Motion, read, "rapid; line"},
    {"G2 G3", Group::Motion, read,
     "arc clockwise, counter-clockwise, also helix; I J K or R, P full or partial turns"},
    {"G4", Group::OneShot, read, "dwell, P seconds, before a move of the same block", true},
    {"G5 G5.1", Group::Motion, read,
     "cubic (I J P Q) and quadratic (I J) spline in X Y, as chords within 0.0001 mm; the previous "
     "motion mode stays active"},
    {"G5.2 G5.3", Group::Motion, read,
     "NURBS in X Y, P weights, L order, as chords within 0.0001 mm"},
    {"G7 G8", Group::LatheDiameter, read,
     "X words are diameters; radii, active at the start unless `x_words` states otherwise"},
    {"G10", Group::OneShot, read,
     "L2 L20: origin (and R rotation) of a coordinate system, as stated or so that the current "
     "position has the stated coordinates; L1 L10 L11: length and radius of a tool"},
    {"G17 G18 G19", Group::Plane, read, "plane X Y, Z X, Y Z"},
    {"G17.1 G18.1 G19.1", Group::None, refused,
     "a plane of X Y Z: planes of U V W are not supported"},
    {"G20 G21", Group::Units, read, "inch, mm; for the whole block, including F"},
    {"G28 G30", Group::OneShot, read,
     "rapid to the stored position, through the point of the axis words if there are any"},
    {"G28.1 G30.1", Group::OneShot, read, "stores the position; axis words are rejected"},
    {"G33", Group::Motion, read, "line at K mm per revolution of the spindle"},
    {"G33.1", Group::Motion, read,
     "rigid tapping: at K mm per revolution and back, the spindle reversed"},
    {"G38.2 G38.3 G38.4 G38.5", Group::None, refused,
     "no probing: a virtual part is measured by instruments (abbe measure)"},
    {"G40", Group::CutterRadius, read, "cutter compensation off"},
    {"G41 G42", Group::CutterRadius, read,
     "cutter compensation left, right; tool D, otherwise that in the spindle"},
    {"G41.1 G42.1", Group::CutterRadius, read, "the same, D is the diameter, L1 ... L9 rejected"},
    {"G43", Group::ToolLength, read,
     "tool length, tool H, otherwise that in the spindle; on a turning control its offset: X Z "
     "guide the tip, X0 is on the spindle line"},
    {"G43.1", Group::ToolLength, read, "tool length by axis words"},
    {"G43.2", Group::ToolLength, read, "adds a second tool length, tool H"},
    {"G43.4", Group::ToolLength, read,
     "abbe's own word, tool H: X Y Z are the tip in the workpiece frame, rotary words are axis "
     "positions"},
    {"G49", Group::ToolLength, read, "no tool length; ends G43.4"},
    {"G52", Group::OneShot, read, "shift on top of the coordinate system"},
    {"G53", Group::OneShot, read,
     "with G0 or G1, also a modal one, under G90: axis positions, without offsets", true},
    {"G54 G55 G56 G57 G58 G59 G59.1 G59.2 G59.3", Group::WorkOffset, read,
     "coordinate system 1 to 9; 1 to 6 start as stated by `work_offset`, all as stated by "
     "`offsets`, others at zero"},
    {"G61 G61.1", Group::PathMode, none, "exact path: abbe always cuts it"},
    {"G64", Group::PathMode, none,
     "blending within P and Q: abbe cuts the exact path, without the roundings of a real control"},
    {"G70 G71 G71.1 G71.2 G72 G72.1 G72.2", Group::None, refused,
     "explicit passes: turning cycles G70 to G72 are not expanded"},
    {"G73 G83", Group::Motion, read,
     "drilling with pecks Q, with chip breaking; with full retraction"},
    {"G74 G84", Group::Motion, read,
     "tapping left, right, with the spindle reversed at the bottom"},
    {"G76", Group::Motion, read, "threading cycle, P Z I J R K Q H E L"},
    {"G80", Group::Motion, read, "cancels the motion mode; no effect with another motion code"},
    {"G81 G82", Group::Motion, read, "drilling; with dwell P"},
    {"G85 G86 G89", Group::Motion, read,
     "boring: feed out; spindle stop, rapid out; dwell, feed out"},
    {"G87 G88", Group::None, refused, "G81 to G86 or G89: LinuxCNC has no G87 and G88 either"},
    {"G90 G91", Group::Distance, read, "absolute, incremental"},
    {"G90.1 G91.1", Group::ArcDistance, read, "centres I J K absolute; from the start of the arc"},
    {"G92", Group::OneShot, read,
     "shift that gives the current position the programmed coordinates"},
    {"G92.1 G92.2 G92.3", Group::OneShot, read,
     "shift of G92 and G52 cleared; suspended; restored; axis words are rejected"},
    {"G93 G94 G95", Group::FeedMode, read,
     "F: inverse time, in every block; per minute; per revolution of the spindle; each clears F"},
    {"G96", Group::SpeedMode, read,
     "S is a surface speed at the radius of X, D the maximum rpm: the duration of a block is "
     "computed from the speeds at its points"},
    {"G97", Group::SpeedMode, read, "S is a speed in rpm"},
    {"G98 G99", Group::ReturnLevel, read, "cycles return to the initial level; to R"},
    {"M0 M1 M60", Group::Stop, none, "stops"},
    {"M2 M30", Group::Stop, read, "end of the program"},
    {"M3 M4 M5", Group::Spindle, read, "spindle clockwise, counter-clockwise, off"},
    {"M6", Group::ToolChange, read, "change to the tool of T"},
    {"M7 M8 M9", Group::Coolant, none, "coolant"},
    {"M19", Group::Spindle, none, "spindle orientation"},
    {"M48 M49 M50 M51 M52 M53", Group::Override, none, "no overrides: abbe runs at 100 %"},
    {"M61", Group::ToolChange, read, "Q is the tool in the spindle"},
    {"M62 M63 M64 M65", Group::Override, none, "digital outputs, P their number"},
    {"M67 M68", Group::Override, none, "analog outputs, E their number, Q the value"},
    {"M66", Group::None, refused, "no wait for an input: there are no inputs"},
    {"M70 M71 M72 M73", Group::State, read,
     "modes saved; discarded; restored; saved here and restored at the end of the call, in a "
     "separate block. Tool length and cutter compensation must be as saved"},
    {"M98 M99", Group::None, refused, "o call and o return, or dialect = \"fanuc\""},
    {"M428", Group::Kinematics, read,
     "kinematics of the tip, as G43.4; the length of G43 must be that of the tool"},
    {"M429", Group::Kinematics, read, "identity kinematics: G43 as before, ends G43.4"},
};

// Words other than G and M codes.
constexpr WordTableEntry other_words[] = {
    {"F S", read, "feed; spindle speed"},
    {"T", read, "tool"},
    {"N", read, "line number"},
    {"X Y Z A B C U V W", read, "axes of the machine; mm or inch, degrees"},
    {"$", read, "spindle for S M3 M4 M5: 0 is that of the machine, others have no effect"},
    {"@ ^", read, "polar X Y: radius, and angle in degrees; an omitted one keeps its value"},
    {"#n #<name> #<_name>", read,
     "parameters, of the call and of the program; #1 to #30 of the call"},
    {"[ ] + - * / ** MOD EQ NE GT GE LT LE AND OR XOR", read,
     "expressions: ** first, then * / MOD, + -, comparisons, AND OR XOR, each left to right"},
    {"ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT TAN", read,
     "functions, degrees; ATAN[y]/[x]"},
    {"sub endsub call return", read,
     "subprograms o<name> or o123, in the file or in name.ngc next to it; results in #<_value>"},
    {"if elseif else endif while endwhile do repeat endrepeat break continue", read,
     "conditions and loops"},
    {"( ) ; %", read,
     "comments, those with a tool diameter are noted; tape marks. A / at the start of a line "
     "leaves it out"},
    {"(MSG,) (DEBUG,) (PRINT,) (LOG,)", none, "messages"},
};

}  // namespace

// Built once and indexed by tenths, because every code of a program is looked up.
const gcode::CodeProperties& find_entry(char letter, int tenths) {
  static const CodeTable<Group> table(lines);
  return table.find_entry(letter, tenths);
}

}  // namespace linuxcnc

std::span<const WordTableEntry> linuxcnc_words() {
  static const std::vector<WordTableEntry> table =
      word_table<linuxcnc::Line>(linuxcnc::lines, linuxcnc::other_words);
  return table;
}

}  // namespace abbe::sim::dialects
