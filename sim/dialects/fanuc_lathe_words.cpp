#include <vector>

#include "sim/dialects/fanuc.h"
#include "sim/dialects/fanuc_block.h"

namespace abbe::sim::dialects {
namespace fanuc {
namespace {

using LatheLine = CodeLine<Group>;

constexpr Use is_read = Use::Read, no_effect = Use::WithoutEffect, is_refused = Use::Refused;

constexpr LatheLine lathe_lines[] = {
    {"G0 G1", Group::Motion, is_read, "rapid, in force at first; line"},
    {"G2 G3", Group::Motion, is_read,
     "arc clockwise, counter-clockwise, seen against Y in G18: I K from the start, I a radius, or "
     "R"},
    {"G4", Group::OneShot, is_read, "dwell, X or U in seconds, P in milliseconds"},
    {"G7.1 G107 G12.1 G112", Group::None, is_refused,
     "X Z as they are: no interpolation on a cylinder or in polar coordinates"},
    {"G5 G5.1 G8", Group::Alone, no_effect,
     "contour control, smoothing and look-ahead: abbe cuts the exact path"},
    {"G9 G61", Group::Beside, no_effect, "exact stop: abbe cuts the exact path"},
    {"G62", Group::Beside, no_effect, "slower feed in inside corners, which stays as programmed"},
    {"G63", Group::Beside, no_effect, "tapping mode: overrides, abbe runs at 100 %"},
    {"G64", Group::Beside, no_effect, "cutting mode: abbe cuts the exact path"},
    {"G10", Group::OneShot, is_read,
     "L2 L20: origin of G54 to G59 (P0: of all) or of G54.1, U W adding; without L: X Z U W R, wear "
     "of an offset P1 to P99"},
    {"G11 G13.1 G113", Group::None, no_effect, "end of what G10 and G12.1 begin; axis words beside them are refused"},
    {"G17 G18 G19", Group::Plane, is_read, "plane X Y, Z X, Y Z; G18 is in force at first"},
    {"G20 G21", Group::Units, is_read, "inch, mm"},
    {"G22 G23", Group::Alone, no_effect, "checks of stored strokes"},
    {"G25 G26", Group::Alone, no_effect, "checks of fluctuations of the spindle speed"},
    {"G27 G29 G30.1", Group::None, is_refused, "moves to a reference position by G28 or G30"},
    {"G28 G30", Group::OneShot, is_read,
     "rapid over the point of the words, U0 W0: from where they stand, to the reference position of "
     "these axes, `reference` of the machine, else where they stand at first; of G30 too"},
    {"G31 G36 G37", Group::None, is_refused,
     "no probing: a virtual part is read by instruments (abbe measure)"},
    {"G32 G33 G34 G35 G76 G78 G92", Group::None, is_refused,
     "G1 with the feed of the lead under G99: threads are not cut in turn with the spindle"},
    {"G40", Group::CutterRadius, is_read, "nose compensation off"},
    {"G41 G42", Group::CutterRadius, is_read,
     "nose compensation left, right: the nose of the tool along the contour"},
    {"G50", Group::OneShot, is_read,
     "S: the largest speed of G96; X Z: a shift so that the tool stands at the words; U W: by them"},
    {"G50.3", Group::OneShot, is_read, "ends what G50 and G52 did to these axes"},
    {"G50.2 G51.2 G250 G251", Group::None, is_refused, "G1: no polygons are turned"},
    {"G52", Group::OneShot, is_read, "shift on top of all coordinate systems"},
    {"G53", Group::OneShot, is_read, "rapid to positions of the axes, without offsets"},
    {"G54 G55 G56 G57 G58 G59", Group::WorkOffset, is_read,
     "coordinate system, as the scene says it"},
    {"G54.1", Group::WorkOffset, is_read,
     "coordinate system P 1 to 300, at zero first; G54 P the same"},
    {"G65", Group::Macro, is_read, "calls program P with arguments, L times"},
    {"G66", Group::Macro, is_read, "calls it after every block that moves, until G67"},
    {"G67", Group::Macro, is_read, "end of G66", true},
    {"G68", Group::None, is_refused, "one turret: no mirror image for a second one"},
    {"G69 G69.1", Group::None, no_effect, "end of the mirror image of a second turret; axis words beside it are refused"},
    {"G70 G71 G72 G73 G74 G75", Group::None, is_refused,
     "the passes themselves, by G1 to G3, G90 or G94: cycles of roughing, finishing and grooving "
     "are not expanded"},
    {"G80", Group::Cycle, is_read, "no cycle"},
    {"G81 G82 G83 G84 G85 G86 G87 G88 G89", Group::None, is_refused,
     "the moves themselves: drilling cycles of a turning control are not expanded"},
    {"G90 G94", Group::Motion, is_read,
     "turning along Z, facing along X: rapid to the cut, feed along it and out of it, rapid back; R "
     "tapers"},
    {"G91 G93 G95", Group::None, is_refused,
     "U V W H for increments, G98 or G99 for feeds: G91, G93 and G95 are of G-code systems B and "
     "C"},
    {"G96", Group::SpeedMode, is_read,
     "S is a surface speed at the radius of X: a block takes as long as at the speeds of its "
     "points"},
    {"G97", Group::SpeedMode, is_read, "S is a speed in rpm; without S it stays as it is"},
    {"G98 G99", Group::FeedMode, is_read, "F is per minute; per turn of the spindle"},
    {"M0 M1", Group::Stop, no_effect, "stops"},
    {"M2 M30", Group::Stop, is_read, "end of the program"},
    {"M3 M4 M5", Group::Spindle, is_read, "spindle clockwise, counter-clockwise, off"},
    {"M6", Group::Beside, no_effect, "the turret turns by T alone"},
    {"M7 M8 M9 M88 M89", Group::Coolant, no_effect, "coolant, M88 M89 through the tool"},
    {"M10 M11", Group::Beside, no_effect, "chuck closed, open"},
    {"M19", Group::Beside, no_effect, "spindle orientation"},
    {"M40 M41 M42 M43 M44 M45", Group::Beside, no_effect, "gears of the spindle"},
    {"M23 M24", Group::Beside, no_effect, "how a thread ends"},
    {"M48 M49", Group::Beside, no_effect, "overrides: abbe runs at 100 %"},
    {"M96 M97", Group::None, is_refused, "no interrupts: there is no signal"},
    {"M98", Group::Call, is_read,
     "calls program P, L times; P of up to 8 digits: repeats, then program"},
    {"M99", Group::Call, is_read, "return, P to this sequence number; of the main program its end"},
    {"M198", Group::None, is_refused, "M98: programs stand in the file or beside it"},
};

constexpr WordUse other_lathe_words[] = {
    {"O :", is_read, "number of a program"},
    {"N", is_read, "sequence number"},
    {"F S", is_read, "feed; spindle speed"},
    {"T", is_read,
     "tool and offset, T0101. With an offset X Z lead the tool's point, X0 being on the spindle "
     "line: its geometry is that of the scene's tool, program.tip says which point; T0100 ends it"},
    {"X Z Y C", is_read, "axes of the machine, X a diameter; mm or inch, degrees"},
    {"U W V H", is_read, "increments of X Z Y C"},
    {",C ,R", is_refused, "lines and arcs as they are: corners are not expanded"},
};

}  // namespace

const CodeFact& lathe_fact_of(char letter, int tenths) {
  static const CodeTable<Group> table(lathe_lines);
  return table.fact_of(letter, tenths);
}

}  // namespace fanuc

std::span<const WordUse> fanuc_lathe_words() {
  static const std::vector<WordUse> all =
      joined_words<fanuc::LatheLine>(fanuc::lathe_lines, fanuc::other_lathe_words);
  return all;
}

}  // namespace abbe::sim::dialects
