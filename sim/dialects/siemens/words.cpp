#include <string_view>
#include <unordered_map>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/read_program.h"
#include "sim/dialects/siemens/block.h"

namespace abbe::sim::dialects {

namespace siemens {
namespace {

using WordLine = CodeTableLine<Group>;

// Short names, so that an entry fits its line.
constexpr WordTreatment read = WordTreatment::Read, none = WordTreatment::WithoutEffect,
                        refused = WordTreatment::Refused;

// The single source of the word table in the README, of the messages and of the groups of words.
constexpr WordLine word_lines[] = {
    {"G0 G1", Group::Motion, read, "rapid; line"},
    {"G2 G3", Group::Motion, read,
     "arc clockwise, counter-clockwise, helix too: I J K from the start or by AC(), CR= (below "
     "zero: more than half a turn), AR=, about the pole with AP= RP=; TURN= further whole turns"},
    {"CIP", Group::Motion, read, "arc through I1= J1= K1=, in any plane"},
    {"CT", Group::None, refused, "G2, G3 or CIP: a circle that joins by its tangent is not made"},
    {"G4", Group::Dwell, read, "dwell, F seconds or S turns of the spindle"},
    {"G33", Group::Motion, read, "line at I J K mm per turn of the spindle, by the longest way"},
    {"G34 G35 G63 G331 G332", Group::None, refused,
     "G33 for threads, CYCLE84 for tapping: changing pitches and taps on their own are not made"},
    {"G17 G18 G19", Group::Plane, read, "plane X Y, Z X, Y Z"},
    {"G40", Group::CutterRadius, read, "cutter compensation off"},
    {"G41 G42", Group::CutterRadius, read,
     "cutter compensation left, right, by lines and arcs in the plane: upright to the contour in "
     "and "
     "out (NORM), arcs around outside corners (G450); corners below 0.001 rad count as none"},
    {"OFFN", Group::None, refused, "OFFN=0: no allowance on a contour"},
    {"G53 G153 SUPA", Group::WithoutOffset, read,
     "for the block: positions of the axes without offsets and frames; a tool length in force (D1) "
     "still counts"},
    {"G54 G55 G56 G57 G505 G506", Group::WorkOffset, read,
     "work offset, G54 to G59 of the scene or as `offsets` has it: where the workpiece is, with "
     "rotary axes at zero"},
    {"G507 G508 G509 G510 G511 G512 G513 G514 G515 G516 G517 G518 G519 G520 G521 G522 G523 G524 "
     "G525 G526 G527 G528 G529 G530 G531 G532 G533 G534 G535 G536 G537 G538 G539 G540 G541 G542 "
     "G543 G544 G545 G546 G547 G548 G549 G550 G551 G552 G553 G554 G555 G556 G557 G558 G559 G560 "
     "G561 G562 G563 G564 G565 G566 G567 G568 G569 G570 G571 G572 G573 G574 G575 G576 G577 G578 "
     "G579 G580 G581 G582 G583 G584 G585 G586 G587 G588 G589 G590 G591 G592 G593 G594 G595 G596 "
     "G597 G598 G599",
     Group::WorkOffset, read,
     "work offset of the control's table, `offsets`, $P_UIFR[7] to [99]; refused where it has "
     "none"},
    {"G500", Group::WorkOffset, read, "no work offset"},
    {"G58 G59", Group::None, refused, "TRANS or ATRANS: no shifts axis by axis"},
    {"TRANS ATRANS", Group::Frame, read, "programmable shift: alone, on top"},
    {"ROT AROT", Group::Frame, read,
     "programmable rotation: alone, on top; of several axes Z, then Y, then X, each about the axis "
     "as turned; RPL= about the axis across the plane"},
    {"MIRROR AMIRROR SCALE ASCALE ROTS AROTS CROTS", Group::None, refused,
     "TRANS and ROT: no frame that mirrors or scales, none by solid angles"},
    {"G60 G601 G602 G603 G9", Group::WithMotion, none, "exact stop: what abbe cuts anyway"},
    {"G64 G641 G642 G643 G644 G645 ADIS ADISPOS", Group::WithMotion, none,
     "continuous path: abbe cuts the exact path, without the roundings of a real control"},
    {"G70 G700", Group::Units, read, "inch: lengths; lengths and F"},
    {"G71 G710", Group::Units, read, "mm: lengths; lengths and F"},
    {"G90 G91", Group::Distance, read, "absolute, incremental"},
    {"G93 G94 G95", Group::FeedMode, read,
     "F: inverse time, in every block; per minute; per turn of the spindle"},
    {"G96 G961 G962", Group::SpeedMode, read,
     "S is a surface speed at the radius of X, LIMS= the largest rpm: a block takes as long as at "
     "the speeds of its points. F is per turn; per minute; as it was"},
    {"G97 G971 G972 G973", Group::SpeedMode, read,
     "S is a speed in rpm. F is per turn; per minute; as it was; per turn, without LIMS"},
    {"G110 G111 G112", Group::Pole, read,
     "pole of AP= RP=: from where the axes stand, from the origin, from the pole before"},
    {"G25 G26", Group::Limits, none, "limits of working area and speed"},
    {"G74 G75", Group::None, refused, "SUPA and positions: reference points are the machine's own"},
    {"G147 G148 G247 G248 G347 G348 G140 G141 G142 G143", Group::None, refused,
     "lines and arcs: no approach that a control works out"},
    {"G290", Group::None, none, "the language of Siemens"},
    {"G291", Group::None, refused, "G290, or dialect = \"fanuc\": programs in ISO dialect mode"},
    {"NORM G450", Group::WithMotion, none,
     "upright into and out of a contour, arcs around outside corners: what abbe does anyway"},
    {"CUT2D CUT2DF", Group::WithMotion, none,
     "cutter compensation in the plane: what abbe does anyway"},
    {"CFTCP CFC CFIN", Group::WithMotion, none,
     "where F counts under G41 and G42: it is taken as that of the centre of the tool"},
    {"G451 KONT KONTC KONTT DISC", Group::None, refused,
     "G450 and NORM: no other way into a contour and around its corners"},
    {"CUT3DC CUT3DF CUT3DFS CUT3DFF", Group::None, refused,
     "a path of the tool's centre: no compensation in space"},
    {"TRAORI", Group::Transformation, read,
     "X Y Z are the tip in the workpiece, rotary words axis positions"},
    {"TRAFOOF", Group::Transformation, read, "X Y Z are axes again"},
    {"TRANSMIT TRACYL TRAANG TRACON", Group::None, refused,
     "TRAORI, or positions of the axes: no other transformation"},
    {"ORIWKS ORIMKS", Group::OrientationFrame, read,
     "a line turns the tool on a great circle, as chords within 1 urad; its rotary axes in "
     "proportion"},
    {"ORIVECT ORIPLANE ORIAXES", Group::OrientationPath, read,
     "the same as words of their own, which rule: great circle; rotary axes in proportion"},
    {"ORICONCW ORICONCCW ORICONIO ORICONTO ORICURVE ORIPATH ORIPATHS", Group::None, refused,
     "ORIVECT or ORIAXES: no orientation on cones, curves or along a path"},
    {"ORIEULER ORIRPY ORIRPY2 ORIVIRT1 ORIVIRT2", Group::WithMotion, none,
     "how A2 B2 C2 count, which are refused"},
    {"ORISON ORISOF", Group::WithMotion, none, "smoothing of orientation: abbe cuts as programmed"},
    {"TOROT TOFRAME PAROT TCARR TCOABS TCOFR", Group::None, refused,
     "CYCLE800 or TRAORI: no frames from a tool carrier"},
    {"TOROTOF PAROTOF", Group::WithMotion, none, "no frame from a tool carrier"},
    {"ASPLINE BSPLINE CSPLINE POLY INVCW INVCCW", Group::None, refused,
     "lines and arcs: no splines, polynomials and involutes"},
    {"CHF CHR RND RNDM ANG", Group::None, refused,
     "the contour as it is: no chamfers, roundings and angles between blocks"},
    {"COMPCAD COMPCURV COMPON COMPSURF COMPOF", Group::WithMotion, none,
     "compressor: abbe cuts the points as programmed"},
    {"CTOL OTOL", Group::WithMotion, none,
     "tolerances of contour and orientation: abbe cuts as programmed"},
    {"SOFT BRISK DRIVE", Group::WithMotion, none, "how the axes accelerate"},
    {"FFWON FFWOF", Group::WithMotion, none, "feedforward of the drives"},
    {"JERKLIM VELOLIM ACC ACCLIMA", Group::WithMotion, none,
     "limits of jerk, speed and acceleration"},
    {"CPRECON CPRECOF", Group::WithMotion, none, "contour accuracy by a lower feed"},
    {"FIFOCTRL STARTFIFO STOPFIFO STOPRE", Group::WithMotion, none, "how blocks are prepared"},
    {"SBLON SBLOF", Group::WithMotion, none, "single block"},
    {"DISPLON DISPLOF", Group::WithMotion, none, "whether blocks are shown"},
    {"SETMS", Group::MasterSpindle, read,
     "the spindle whose S and M have no number: that of the number, without one spindle 1"},
    {"UPATH SPATH", Group::WithMotion, none, "parameter of polynomials, of which there are none"},
    {"RTLION RTLIOF", Group::WithMotion, none,
     "rapids on a line or each axis on its own: abbe takes the line"},
    {"FNORM", Group::WithMotion, none, "constant feed along a block: what abbe does anyway"},
    {"WALIMON WALIMOF", Group::WithMotion, none, "limits of the working area"},
    {"SPOS SPOSA", Group::WithMotion, none, "spindle orientation"},
    {"SPCON SPCOF", Group::WithMotion, none, "position control of the spindle"},
    {"FGROUP FGREF", Group::WithMotion, none,
     "axes of which F is the speed: abbe counts F along X Y Z, else in degrees of turns"},
    {"FL", Group::WithMotion, none, "largest speed of an axis"},
    {"FLIN FCUB FPO FB FZ FRC FRCM", Group::None, refused, "F: no other feed"},
    {"DIAMON DIAM90 DIAMOF", Group::Diameters, read,
     "X words are diameters; absolute ones are; none is. I=AC() too, other I and CR= are radii. "
     "Turning controls begin with DIAMON; others refuse DIAMON and DIAM90"},
    {"CYCLE832", Group::None, none,
     "tolerance of fast cutting: abbe cuts as programmed; axis words beside it are refused"},
    {"GROUP_BEGIN GROUP_END GROUP_ADDEND", Group::None, none,
     "blocks that an editor folds; axis words beside them are refused"},
    {"WORKPIECE", Group::None, none,
     "the blank: that of the scene is cut; axis words beside it are refused"},
    {"EXTERN", Group::None, none, "declaration of a subprogram; axis words beside it are refused"},
    {"PROTA PROTS", Group::None, none,
     "protection areas of the control; axis words beside them are refused"},
    {"MSG", Group::WithMotion, none, "messages"},
    {"WAITM WAITMC WAITE WAITP INIT START SETM CLEARM", Group::None, none,
     "other channels: abbe has one"},
    {"MEAS MEAW MEASA MEAWA MEAC", Group::None, refused,
     "no probing: a virtual part is read by instruments (abbe measure)"},
    {"PCALL EXTCALL CALLPATH ISOCALL", Group::None, refused,
     "CALL \"NAME\": files in the folder of the program"},
    {"A2 B2 C2 A4 B4 C4 A5 B5 C5 A6 B6 C6 A7 B7 C7 LEAD TILT THETA", Group::None, refused,
     "A3= B3= C3=: the direction of the tool as a vector"},
    {"CYCLE840 CYCLE87 CYCLE88", Group::None, refused,
     "CYCLE84 to CYCLE86 or CYCLE89: no tapping in a chuck, no stops in a bore"},
    {"HOLES1 HOLES2 CYCLE801 CYCLE802 CYCLE71 CYCLE72 CYCLE76 CYCLE77 CYCLE78 CYCLE79 CYCLE899 "
     "CYCLE90 CYCLE60 CYCLE61 CYCLE62 CYCLE63 CYCLE64 CYCLE70 POCKET1 POCKET2 POCKET3 POCKET4 "
     "SLOT1 "
     "SLOT2 LONGHOLE CYCLE977 CYCLE978 CYCLE996 CYCLE9960",
     Group::None, refused, "the moves themselves: only drilling cycles are expanded"},
    {"CYCLE92 CYCLE93 CYCLE94 CYCLE95 CYCLE96 CYCLE97 CYCLE98 CYCLE99 CYCLE930 CYCLE940 CYCLE951 "
     "CYCLE952",
     Group::None, refused,
     "the passes themselves: cycles of stock removal, grooves, undercuts and threads are not "
     "expanded"},
    {"MCALL", Group::None, read, "calls a cycle or subprogram after every block with motion"},
    {"M0 M1 M60", Group::Stop, none, "stops"},
    {"M2 M30 M17", Group::Stop, read, "end of the program or subprogram"},
    {"M3 M4 M5", Group::Spindle, read, "spindle clockwise, counter-clockwise, off"},
    {"M6", Group::ToolChange, read, "change to the tool of T; without M6 in the program T changes"},
    {"M7 M8 M9", Group::WithMotion, none, "coolant"},
    {"M19", Group::WithMotion, none, "spindle orientation"},
    {"M40 M41 M42 M43 M44 M45", Group::WithMotion, none, "gears of the spindle"},
    {"M70", Group::None, refused, "M3, M4 or M5: the spindle is no axis"},
};

// Words other than codes.
constexpr WordTableEntry siemens_other_words[] = {
    {"F", read, "feed"},
    {"S", read, "spindle speed; S2=, S[2]= that of a spindle by number"},
    {"T", read,
     "tool by number or T=\"NAME\" of the scene; T1=, T2= with a spindle, which must be the "
     "master"},
    {"N", read, "line number"},
    {"D", read, "D0 no tool length, D1 that of the tool, in force after every change"},
    {"M= M1= M[1]=", read,
     "M code as an expression, and of a spindle: M3 M4 M5 of the master spindle, without effect of "
     "another, which is warned of"},
    {"H", none, "outputs of the control", true},
    {"X Y Z A B C U V W", read, "axes of the machine; mm or inch, degrees; X=expression"},
    {"AC() IC() DC() ACP() ACN()", read,
     "absolute, incremental, by the shortest way, upwards, downwards"},
    {"A3 B3 C3", read,
     "direction of the tool in the workpiece, from the tip to the spindle, under TRAORI: the "
     "rotary "
     "axes take the shortest way to it",
     true},
    {"I J K", read, "centre of an arc from its start, or by AC()", true},
    {"CR", read, "radius of an arc, below zero for more than half a turn", true},
    {"AR", read, "opening angle of an arc", true},
    {"TURN", read, "whole turns of a helix besides", true},
    {"I1 J1 K1", read, "point between the ends of the arc of CIP", true},
    {"AP RP", read, "polar angle and radius about the pole", true},
    {"RPL", read, "angle of ROT and AROT in the plane"},
    {"LIMS", read, "largest rpm under G96", true},
    {"P", read, "how often a subprogram or a part of a program runs", true},
    {"CYCLE800", read,
     "swivelled plane: by angles about axes in any order or by solid angle, X0 Y0 Z0 and X1 Y1 Z1, "
     "new or additive, swivelled by _DIR or not; () ends it"},
    {"CYCLE81 CYCLE82 CYCLE83", read, "drilling; with dwell; with pecks, cleared or broken"},
    {"CYCLE84", read, "rigid tapping at the pitch PIT or MPIT"},
    {"CYCLE85 CYCLE86 CYCLE89", read,
     "boring: feed out at RFF; spindle stopped and lifted off; dwell, feed out"},
    {"R", read, "R parameters"},
    {"DEF REAL INT BOOL CHAR STRING AXIS", read,
     "variables: numbers, fields of them, and texts as names of tools and programs"},
    {"+ - * / DIV MOD == <> < > <= >= NOT AND OR XOR B_AND B_OR B_XOR", read,
     "expressions: * / DIV MOD, + -, B_AND, B_XOR, B_OR, AND, XOR, OR, comparisons least"},
    {"SIN COS TAN ASIN ACOS ATAN2 SQRT ABS POT TRUNC ROUND ROUNDUP LN EXP MINVAL MAXVAL BOUND",
     read, "functions, degrees"},
    {"$PI TRUE FALSE", read, "pi, 1 and 0"},
    {"$P_EP $AA_IW", read, "where the axes stand in the workpiece"},
    {"$AA_IM", read, "where the axes stand as axes"},
    {"IF ELSE ENDIF FOR TO ENDFOR WHILE ENDWHILE LOOP ENDLOOP REPEAT UNTIL", read,
     "conditions and loops"},
    {"GOTO GOTOF GOTOB GOTOC CASE OF DEFAULT", read, "jumps to labels and line numbers"},
    {"GOTOS", refused, "GOTOB and a label: no jump to the beginning"},
    {"REPEATB ENDLABEL", read, "with REPEAT and labels: parts of a program again, P times"},
    {"L CALL PROC RET", read,
     "subprograms L123, NAME, NAME(...), in the program behind %_N_NAME_SPF or in NAME.SPF beside "
     "it; parameters by value"},
    {"VAR SAVE", refused, "parameters by value, modes set again by the caller"},
    {"%_N_ ;", read,
     "heads of programs; comments, those with the diameter of a tool are noted; a / at the "
     "beginning "
     "of a line leaves it out"},
};

// Built at first use: every word of a program is looked up.
std::unordered_map<std::string_view, WordEntry> entries_by_word() {
  std::unordered_map<std::string_view, WordEntry> entries;
  for (const WordLine& line : word_lines)
    each_word(line.words, [&](std::string_view word) {
      entries[word] = {word, line.group, line.use, line.sentence};
    });
  return entries;
}

}  // namespace

bool is_beside_motion(Group group) {
  switch (group) {
    case Group::None:
    case Group::Pole:
    case Group::Dwell:
    case Group::Frame:
    case Group::Limits:
    case Group::Count:
      return false;
    case Group::WithMotion:
    case Group::MasterSpindle:
    case Group::Motion:
    case Group::Plane:
    case Group::Units:
    case Group::Distance:
    case Group::FeedMode:
    case Group::SpeedMode:
    case Group::Diameters:
    case Group::CutterRadius:
    case Group::WorkOffset:
    case Group::WithoutOffset:
    case Group::Transformation:
    case Group::OrientationFrame:
    case Group::OrientationPath:
    case Group::Stop:
    case Group::ToolChange:
    case Group::Spindle:
      return true;
  }
  return false;
}

const WordEntry* find_entry(std::string_view word) {
  static const std::unordered_map<std::string_view, WordEntry> entries = entries_by_word();
  const auto entry = entries.find(word);
  return entry == entries.end() ? nullptr : &entry->second;
}

}  // namespace siemens

std::span<const WordTableEntry> siemens_words() {
  static const std::vector<WordTableEntry> table =
      word_table<siemens::WordLine>(siemens::word_lines, siemens::siemens_other_words);
  return table;
}

}  // namespace abbe::sim::dialects
