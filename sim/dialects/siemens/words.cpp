#include "sim/dialects/read_program.h"
#include "sim/dialects/siemens/siemens.h"

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
     "arc clockwise, counter-clockwise, also helix: I J K from the start or by AC(), CR= "
     "(negative: more than half a turn), AR=, about the pole with AP= RP=; TURN= additional full "
     "turns"},
    {"CIP", Group::Motion, read, "arc through I1= J1= K1=, in any plane"},
    {"CT", Group::None, refused, "G2, G3 or CIP: tangential arcs are not supported"},
    {"G4", Group::Dwell, read, "dwell, F seconds or S revolutions of the spindle"},
    {"G33", Group::Motion, read,
     "line at I J K mm per revolution of the spindle, along the axis with the longest travel"},
    {"G34 G35 G63 G331 G332", Group::None, refused,
     "G33 for threads, CYCLE84 for tapping: variable pitches and taps without a cycle are not "
     "supported"},
    {"G17 G18 G19", Group::Plane, read, "plane X Y, Z X, Y Z"},
    {"G40", Group::CutterRadius, read, "cutter compensation off"},
    {"G41 G42", Group::CutterRadius, read,
     "cutter compensation left, right, by lines and arcs in the plane: approach and retract "
     "perpendicular to the contour (NORM), arcs around outside corners (G450); corners below 0.001 "
     "rad are ignored"},
    {"OFFN", Group::None, refused, "OFFN=0: no allowance on a contour"},
    {"G53 G153 SUPA", Group::WithoutOffset, read,
     "for the block: axis positions without offsets and frames; an active tool length (D1) is "
     "still included"},
    {"G54 G55 G56 G57 G505 G506", Group::WorkOffset, read,
     "work offset, G54 to G59 of the scene or as stated by `offsets`: position of the workpiece "
     "with the rotary axes at zero"},
    {"G507 G508 G509 G510 G511 G512 G513 G514 G515 G516 G517 G518 G519 G520 G521 G522 G523 G524 "
     "G525 G526 G527 G528 G529 G530 G531 G532 G533 G534 G535 G536 G537 G538 G539 G540 G541 G542 "
     "G543 G544 G545 G546 G547 G548 G549 G550 G551 G552 G553 G554 G555 G556 G557 G558 G559 G560 "
     "G561 G562 G563 G564 G565 G566 G567 G568 G569 G570 G571 G572 G573 G574 G575 G576 G577 G578 "
     "G579 G580 G581 G582 G583 G584 G585 G586 G587 G588 G589 G590 G591 G592 G593 G594 G595 G596 "
     "G597 G598 G599",
     Group::WorkOffset, read,
     "work offset of the control's table, `offsets`, $P_UIFR[7] to [99]; rejected if the table has "
     "none"},
    {"G500", Group::WorkOffset, read, "no work offset"},
    {"G58 G59", Group::None, refused, "TRANS or ATRANS: no shifts axis by axis"},
    {"TRANS ATRANS", Group::Frame, read, "programmable shift: alone, on top"},
    {"ROT AROT", Group::Frame, read,
     "programmable rotation: alone, on top; for several axes Z, then Y, then X, each about the "
     "rotated axis; RPL= about the axis normal to the plane"},
    {"MIRROR AMIRROR SCALE ASCALE ROTS AROTS CROTS", Group::None, refused,
     "TRANS and ROT: no mirroring or scaling frames, no rotation by solid angles"},
    {"G60 G601 G602 G603 G9", Group::WithMotion, none,
     "exact stop: abbe always cuts the exact path"},
    {"G64 G641 G642 G643 G644 G645 ADIS ADISPOS", Group::WithMotion, none,
     "continuous path: abbe cuts the exact path, without the roundings of a real control"},
    {"G70 G700", Group::Units, read, "inch: lengths; lengths and F"},
    {"G71 G710", Group::Units, read, "mm: lengths; lengths and F"},
    {"G90 G91", Group::Distance, read, "absolute, incremental"},
    {"G93 G94 G95", Group::FeedMode, read,
     "F: inverse time, in every block; per minute; per revolution of the spindle"},
    {"G96 G961 G962", Group::SpeedMode, read,
     "S is a surface speed at the radius of X, LIMS= the maximum rpm: the duration of a block is "
     "computed from the speeds at its points. F is per revolution; per minute; as it was"},
    {"G97 G971 G972 G973", Group::SpeedMode, read,
     "S is a speed in rpm. F is per revolution; per minute; as it was; per revolution, without "
     "LIMS"},
    {"G110 G111 G112", Group::Pole, read,
     "pole of AP= RP=: from the current position, from the origin, from the previous pole"},
    {"G25 G26", Group::Limits, none, "limits of working area and speed"},
    {"G74 G75", Group::None, refused,
     "SUPA and positions: reference points are specific to the machine"},
    {"G147 G148 G247 G248 G347 G348 G140 G141 G142 G143", Group::None, refused,
     "lines and arcs: approaches computed by the control are not supported"},
    {"G290", Group::None, none, "the language of Siemens"},
    {"G291", Group::None, refused, "G290, or dialect = \"fanuc\": programs in ISO dialect mode"},
    {"NORM G450", Group::WithMotion, none,
     "approach and retract perpendicular to the contour, arcs around outside corners: abbe always "
     "moves this way"},
    {"CUT2D CUT2DF", Group::WithMotion, none,
     "cutter compensation in the plane: abbe always computes it this way"},
    {"CFTCP CFC CFIN", Group::WithMotion, none,
     "reference point of F under G41 and G42: F is taken at the tool centre"},
    {"G451 KONT KONTC KONTT DISC", Group::None, refused,
     "G450 and NORM: no other contour approach and corner treatment"},
    {"CUT3DC CUT3DF CUT3DFS CUT3DFF", Group::None, refused,
     "a path of the tool centre: no 3D compensation"},
    {"TRAORI", Group::Transformation, read,
     "X Y Z are the tip in the workpiece frame, rotary words are axis positions"},
    {"TRAFOOF", Group::Transformation, read, "X Y Z are axes again"},
    {"TRANSMIT TRACYL TRAANG TRACON", Group::None, refused,
     "TRAORI, or axis positions: no other transformation"},
    {"ORIWKS ORIMKS", Group::OrientationFrame, read,
     "a line turns the tool on a great circle, as chords within 1 urad; its rotary axes "
     "interpolate linearly"},
    {"ORIVECT ORIPLANE ORIAXES", Group::OrientationPath, read,
     "the same as separate words, which take precedence: great circle; rotary axes interpolate "
     "linearly"},
    {"ORICONCW ORICONCCW ORICONIO ORICONTO ORICURVE ORIPATH ORIPATHS", Group::None, refused,
     "ORIVECT or ORIAXES: no orientation on cones, curves or along a path"},
    {"ORIEULER ORIRPY ORIRPY2 ORIVIRT1 ORIVIRT2", Group::WithMotion, none,
     "meaning of A2 B2 C2, which are rejected"},
    {"ORISON ORISOF", Group::WithMotion, none, "orientation smoothing: abbe cuts as programmed"},
    {"TOROT TOFRAME PAROT TCARR TCOABS TCOFR", Group::None, refused,
     "CYCLE800 or TRAORI: no frames from a tool carrier"},
    {"TOROTOF PAROTOF", Group::WithMotion, none, "no frame from a tool carrier"},
    {"ASPLINE BSPLINE CSPLINE POLY INVCW INVCCW", Group::None, refused,
     "lines and arcs: no splines, polynomials and involutes"},
    {"CHF CHR RND RNDM ANG", Group::None, refused,
     "plain contour: no chamfers, roundings and angles between blocks"},
    {"COMPCAD COMPCURV COMPON COMPSURF COMPOF", Group::WithMotion, none,
     "compressor: abbe cuts the points as programmed"},
    {"CTOL OTOL", Group::WithMotion, none,
     "tolerances of contour and orientation: abbe cuts as programmed"},
    {"SOFT BRISK DRIVE", Group::WithMotion, none, "acceleration behaviour of the axes"},
    {"FFWON FFWOF", Group::WithMotion, none, "feedforward of the drives"},
    {"JERKLIM VELOLIM ACC ACCLIMA", Group::WithMotion, none,
     "limits of jerk, speed and acceleration"},
    {"CPRECON CPRECOF", Group::WithMotion, none, "contour accuracy by a lower feed"},
    {"FIFOCTRL STARTFIFO STOPFIFO STOPRE", Group::WithMotion, none, "preparation of blocks"},
    {"SBLON SBLOF", Group::WithMotion, none, "single block"},
    {"DISPLON DISPLOF", Group::WithMotion, none, "display of blocks"},
    {"SETMS", Group::MasterSpindle, read,
     "the master spindle, to which S and M without a number apply: that with this number, without "
     "one spindle 1"},
    {"UPATH SPATH", Group::WithMotion, none, "parameter of polynomials, which are not supported"},
    {"RTLION RTLIOF", Group::WithMotion, none,
     "rapids on a line or with each axis independent: abbe takes the line"},
    {"FNORM", Group::WithMotion, none, "constant feed along a block: abbe always keeps it"},
    {"WALIMON WALIMOF", Group::WithMotion, none, "limits of the working area"},
    {"SPOS SPOSA", Group::WithMotion, none, "spindle orientation"},
    {"SPCON SPCOF", Group::WithMotion, none, "position control of the spindle"},
    {"FGROUP FGREF", Group::WithMotion, none,
     "axes to which F applies: abbe applies F to X Y Z, otherwise to the degrees of rotary axes"},
    {"FL", Group::WithMotion, none, "maximum speed of an axis"},
    {"FLIN FCUB FPO FB FZ FRC FRCM", Group::None, refused, "F: no other feed"},
    {"DIAMON DIAM90 DIAMOF", Group::Diameters, read,
     "X words are diameters; absolute ones are; none is. Also I=AC(), other I and CR= are radii. "
     "Turning controls start with DIAMON; others reject DIAMON and DIAM90"},
    {"CYCLE832", Group::None, none,
     "tolerance of fast cutting: abbe cuts as programmed; axis words with it are rejected"},
    {"GROUP_BEGIN GROUP_END GROUP_ADDEND", Group::None, none,
     "blocks folded by an editor; axis words with them are rejected"},
    {"WORKPIECE", Group::None, none,
     "the blank: that of the scene is cut; axis words with it are rejected"},
    {"EXTERN", Group::None, none, "declaration of a subprogram; axis words with it are rejected"},
    {"PROTA PROTS", Group::None, none,
     "protection areas of the control; axis words with them are rejected"},
    {"MSG", Group::WithMotion, none, "messages"},
    {"WAITM WAITMC WAITE WAITP INIT START SETM CLEARM", Group::None, none,
     "other channels: abbe has only one"},
    {"MEAS MEAW MEASA MEAWA MEAC", Group::None, refused,
     "no probing: a virtual part is measured by instruments (abbe measure)"},
    {"PCALL EXTCALL CALLPATH ISOCALL", Group::None, refused,
     "CALL \"NAME\": files in the folder of the program"},
    {"A2 B2 C2 A4 B4 C4 A5 B5 C5 A6 B6 C6 A7 B7 C7 LEAD TILT THETA", Group::None, refused,
     "A3= B3= C3=: the tool direction as a vector"},
    {"CYCLE840 CYCLE87 CYCLE88", Group::None, refused,
     "CYCLE84 to CYCLE86 or CYCLE89: no tapping with a floating chuck, no stops in a bore"},
    {"HOLES1 HOLES2 CYCLE801 CYCLE802 CYCLE71 CYCLE72 CYCLE76 CYCLE77 CYCLE78 CYCLE79 CYCLE899 "
     "CYCLE90 CYCLE60 CYCLE61 CYCLE62 CYCLE63 CYCLE64 CYCLE70 POCKET1 POCKET2 POCKET3 POCKET4 "
     "SLOT1 SLOT2 LONGHOLE CYCLE977 CYCLE978 CYCLE996 CYCLE9960",
     Group::None, refused, "explicit moves: only drilling cycles are expanded"},
    {"CYCLE92 CYCLE93 CYCLE94 CYCLE95 CYCLE96 CYCLE97 CYCLE98 CYCLE99 CYCLE930 CYCLE940 CYCLE951 "
     "CYCLE952",
     Group::None, refused,
     "explicit passes: cycles for stock removal, grooves, undercuts and threads are not expanded"},
    {"MCALL", Group::None, read, "calls a cycle or subprogram after every block with motion"},
    {"M0 M1 M60", Group::Stop, none, "stops"},
    {"M2 M30 M17", Group::Stop, read, "end of the program or subprogram"},
    {"M3 M4 M5", Group::Spindle, read, "spindle clockwise, counter-clockwise, off"},
    {"M6", Group::ToolChange, read,
     "change to the tool of T; without M6 in the program, T itself changes it"},
    {"M7 M8 M9", Group::WithMotion, none, "coolant"},
    {"M19", Group::WithMotion, none, "spindle orientation"},
    {"M40 M41 M42 M43 M44 M45", Group::WithMotion, none, "spindle gears"},
    {"M70", Group::None, refused, "M3, M4 or M5: the spindle is not an axis"},
};

// Words other than codes.
constexpr WordTableEntry siemens_other_words[] = {
    {"F", read, "feed"},
    {"S", read, "spindle speed; S2=, S[2]= for a spindle by number"},
    {"T", read,
     "tool by number or T=\"NAME\" of the scene; T1=, T2= with a spindle, which must be the "
     "master"},
    {"N", read, "line number"},
    {"D", read, "D0 no tool length, D1 that of the tool, active after every tool change"},
    {"M= M1= M[1]=", read,
     "M code as an expression, and for a spindle: M3 M4 M5 of the master spindle; for others they "
     "have no effect, with a warning"},
    {"H", none, "outputs of the control", true},
    {"X Y Z A B C U V W", read, "axes of the machine; mm or inch, degrees; X=expression"},
    {"AC() IC() DC() ACP() ACN()", read,
     "absolute, incremental, by the shortest way, in the positive, in the negative direction"},
    {"A3 B3 C3", read,
     "tool direction in the workpiece frame, from the tip to the spindle, under TRAORI: the rotary "
     "axes take the shortest way to it",
     true},
    {"I J K", read, "centre of an arc from its start, or by AC()", true},
    {"CR", read, "radius of an arc, negative for more than half a turn", true},
    {"AR", read, "opening angle of an arc", true},
    {"TURN", read, "additional full turns of a helix", true},
    {"I1 J1 K1", read, "point between the ends of the arc of CIP", true},
    {"AP RP", read, "polar angle and radius about the pole", true},
    {"RPL", read, "angle of ROT and AROT in the plane"},
    {"LIMS", read, "maximum rpm under G96", true},
    {"P", read, "number of repeats of a subprogram or a part of a program", true},
    {"CYCLE800", read,
     "swivelled plane: by angles about axes in any order or by solid angle, X0 Y0 Z0 and X1 Y1 Z1, "
     "new or additive, swivelled by _DIR or not; () ends it"},
    {"CYCLE81 CYCLE82 CYCLE83", read,
     "drilling; with dwell; with pecks, chip breaking or full retraction"},
    {"CYCLE84", read, "rigid tapping at the pitch PIT or MPIT"},
    {"CYCLE85 CYCLE86 CYCLE89", read,
     "boring: feed out at RFF; spindle stop and lift-off; dwell, feed out"},
    {"R", read, "R parameters"},
    {"DEF REAL INT BOOL CHAR STRING AXIS", read,
     "variables: numbers, arrays of them, and strings as names of tools and programs"},
    {"+ - * / DIV MOD == <> < > <= >= NOT AND OR XOR B_AND B_OR B_XOR", read,
     "expressions: * / DIV MOD, + -, B_AND, B_XOR, B_OR, AND, XOR, OR, comparisons last"},
    {"SIN COS TAN ASIN ACOS ATAN2 SQRT ABS POT TRUNC ROUND ROUNDUP LN EXP MINVAL MAXVAL BOUND",
     read, "functions, degrees"},
    {"$PI TRUE FALSE", read, "pi, 1 and 0"},
    {"$P_EP $AA_IW", read, "current positions in the workpiece frame"},
    {"$AA_IM", read, "current positions of the axes"},
    {"IF ELSE ENDIF FOR TO ENDFOR WHILE ENDWHILE LOOP ENDLOOP REPEAT UNTIL", read,
     "conditions and loops"},
    {"GOTO GOTOF GOTOB GOTOC CASE OF DEFAULT", read, "jumps to labels and line numbers"},
    {"GOTOS", refused, "GOTOB and a label: no jump to the start"},
    {"REPEATB ENDLABEL", read, "with REPEAT and labels: parts of a program again, P times"},
    {"L CALL PROC RET", read,
     "subprograms L123, NAME, NAME(...), in the program after %_N_NAME_SPF or in NAME.SPF next to "
     "it; parameters by value"},
    {"VAR SAVE", refused, "parameters by value, modes set again by the caller"},
    {"%_N_ ;", read,
     "program headers; comments, those with a tool diameter are noted; a / at the start of a line "
     "leaves it out"},
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
  static constexpr Group others[] = {Group::None, Group::Pole, Group::Dwell, Group::Frame,
                                     Group::Limits};
  return std::ranges::find(others, group) == std::end(others);
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
