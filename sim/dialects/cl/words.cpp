#include <string>
#include <unordered_map>
#include <vector>

#include "sim/dialects/cl/machine.h"
#include "sim/dialects/front_ends.h"

namespace abbe::sim::dialects {

namespace cl {
namespace {

// Short names, so that an entry fits its line.
constexpr WordTreatment read = WordTreatment::Read, none = WordTreatment::WithoutEffect,
                        refused = WordTreatment::Refused;

// The word table in the README, the messages and the dispatch of statements are made from it.
const WordEntry entries[] = {
    {"GOTO", read,
     "x,y,z or x,y,z,i,j,k: the tip there, the tool axis along i,j,k, else as before. Straight at "
     "feed, or what RAPID, CIRCLE, MOVARC or CYCLE before it say. The slash may be missing",
     static_cast<void (Machine::*)(const Statement&)>(&Machine::go_to)},
    {"GODLTA", read, "dx,dy,dz, or one step along the tool axis", &Machine::go_delta},
    {"FROM", read, "where the tool stands: if it does not, it goes there at rapid, with a warning",
     &Machine::from},
    {"GOHOME", read, "rapid to the point of FROM, else to where the axes stood at first",
     &Machine::go_home},
    {"RAPID", read, "the next point at rapid", &Machine::rapid},
    {"FEDRAT", read,
     "feed of the tip with MMPM, IPM or PERMIN, of a turn with MMPR, IPR or PERREV, per minute of "
     "inverse time with INVERS, before or behind the number; degrees per minute where only rotary "
     "axes move",
     &Machine::feedrate},
    {"TLAXIS", read, "i,j,k: the tool axis of points that state none", &Machine::tool_axis},
    {"MULTAX", read, "ON or nothing: points have tool vectors; OFF: the tool axis is 0,0,1",
     &Machine::multax},
    {"CIRCLE", read,
     "x,y,z,i,j,k,r, centre, vector, radius: the points behind it that lie on it end arcs, "
     "counter-clockwise about the vector. With t,f,d,e behind, as NX: one point, clockwise",
     &Machine::circle},
    {"MOVARC", read, "x,y,z,i,j,k,r,ANGLE,a: one arc of a degrees, counter-clockwise about i,j,k",
     &Machine::moving_arc},
    {"CYCLE", read,
     "DRILL with DEPTH or FEDTO, CLEAR or RAPTO, RTRCTO or RETURN, DWELL seconds and a feed, "
     "distances from the point along the tool axis, at every point up to CYCLE/OFF; other cycles "
     "are refused",
     &Machine::cycle},
    {"UNITS", read, "MM or INCHES; mm where none is stated, with a warning", &Machine::units},
    {"LOADTL", read, "n: the tool is changed; LENGTH, OSETNO, ADJUST move nothing",
     &Machine::load_tool},
    {"LOAD", read, "TOOL,n: the same", &Machine::load},
    {"SELECT SELCTL", read, "TOOL,n or n: the next tool", &Machine::select},
    {"CUTTER", read, "diameter and corner radius, held against the tool of the scene",
     &Machine::cutter},
    {"TLDATA", read, "MILL, diameter, corner radius: the same", &Machine::tool_data},
    {"SPINDL", read, "speed with RPM, CLW, CCLW, ON, OFF; RANGE, MAXRPM and ORIENT without effect",
     &Machine::spindle},
    {"COOLNT", read, "coolant, which cuts nothing", &Machine::coolant},
    {"DELAY", read, "seconds, or turns of the spindle with REV", &Machine::delay},
    {"STOP OPSTOP", read, "stops, which take no time", &Machine::stop},
    {"FINI END", read, "end of the program", &Machine::fini},
    {"MSYS", read, "the system in which the points are; a second one is refused", &Machine::msys},
    {"ORIGIN", read, "0,0,0 only: a work offset says where the points count from",
     &Machine::origin},
    {"CUTCOM OPSKIP", read, "OFF only: paths are those of the tip, and nothing is left out",
     &Machine::require_off},
    {"PARTNO PPRINT REMARK TITLES LETTER PRINT TPRINT", none, "texts"},
    {"TOOL PATH END-OF-PATH CATPROCESS CATMAT", none, "names of a CAM system"},
    {"PAINT DISPLY", none, "colours and display of a CAM system"},
    {"MACHIN", none, "name of a postprocessor"},
    {"LINTOL INTOL OUTTOL TOLER MCHTOL", none,
     "tolerances of postprocessors: abbe goes straight between points as they stand"},
    {"CHECK", none, "limits that a postprocessor checks"},
    {"SEQNO LEADER REWIND BREAK NOPOST CLPRNT", none, "how a postprocessor writes its program"},
    {"CLAMP", none, "rotary axes clamped, free"},
    {"TRNTYP TOOLNO", none, "how a control turns and numbers its tools"},
    {"CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH", none, "lengths of a tool"},
    // Reported once by its handler, since M codes may change the motion on a real control.
    {"AUXFUN", none, "an M code of the control", &Machine::auxiliary},
    {"INSERT PREFUN", refused,
     "statements: words of a control are not read within cutter locations"},
    {"TRANS TRACUT COPY ROTATE MATRIX", refused,
     "points as they are cut: transformations are not carried out"},
    {"ROTABL ROTHED ROTREF HEAD TURRET", refused,
     "tool vectors, of which the machine makes its rotary axes"},
    {"HELIX NURBS SPLINE MOVCRV", refused, "points, CIRCLE/ or MOVARC/"},
    {"INDIRV INDIRP TLON TLLFT TLRGT GOFWD GOLFT GORGT GOBACK GOUP GODOWN GO PSIS DNTCUT CUT",
     refused, "CIRCLE/ and GOTO/: contours along surfaces are for an APT processor"},
    {"POINT LINE PLANE VECTOR SCAN MACRO CALL CALSUB TERMAC LOOPST LOOPND IF JUMPTO", refused,
     "posted statements: an APT source is processed first"},
    {"THREAD PITCH", refused, "points with the feed of the thread: threads are not expanded"},
    {"RETRCT CLRSRF", refused, "points: planes of retraction are not carried out"},
};

}  // namespace

const WordEntry* find_entry(std::string_view major) {
  // An index, because every statement of a program is looked up.
  static const std::unordered_map<std::string_view, const WordEntry*> index = [] {
    std::unordered_map<std::string_view, const WordEntry*> entries_by_word;
    for (const WordEntry& entry : entries)
      each_word(entry.words, [&](std::string_view word) { entries_by_word.emplace(word, &entry); });
    return entries_by_word;
  }();
  const auto entry = index.find(major);
  return entry == index.end() ? nullptr : entry->second;
}

}  // namespace cl

std::span<const WordTableEntry> cl_words() {
  static const std::vector<WordTableEntry> table = [] {
    std::vector<WordTableEntry> words;
    for (const cl::WordEntry& entry : cl::entries)
      words.push_back({entry.words, entry.use, entry.sentence});
    words.push_back({"$ $$", WordTreatment::Read,
                     "the statement goes on in the next line; the rest of the line is a comment"});
    words.push_back({"x y z i j k feed", WordTreatment::Read,
                     "head of a table (CSV): columns parted by commas, semicolons or blanks; feed "
                     "mm/min, or rapid; lines of # are comments. Without a head: 3, 4, 6 or 7 "
                     "columns in this order. The first row is reached at rapid"});
    return words;
  }();
  return table;
}

}  // namespace abbe::sim::dialects
