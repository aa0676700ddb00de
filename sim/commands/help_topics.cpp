#include "sim/commands/help_topics.h"

namespace abbe::sim {
namespace {

constexpr const char* frames = R"(Frames and axes

A structural code names the moving parts from the workpiece over the bed to the tool: w C' b X Y Z A s t.
  w  workpiece    b  bed    s  spindle nose    t  tool tip    capitals: the carriages of the axes

T_bt is the pose of frame t in frame b. Letters cancel: T_wt = T_wb * T_bt is the tool in the workpiece,
which is what cuts. The z axis of t is the tool axis, from the tip to the spindle.

A primed axis carries the workpiece. A positive command moves the tool in the positive direction
relative to the workpiece (ISO 841), so a primed carriage itself goes the other way.

Inside everything is in mm, rad, s, N and K; any other unit stands in the name: residual_um, lead_deg.
More: kinematics/README.md; abbe check SCENE prints the chain of a machine, abbe pose SCENE its poses.
)";

constexpr const char* signs = R"(Signs of errors

A deviation is actual minus nominal of the carriage itself, at the commanded position. Elements have the
names of ISO 230-1: EXX is the positioning of X, EYX its straightness in Y, ECX its yaw about Z; EC0Y is a
location error, the squareness of Y to X.

What the tip sees, standing in the workpiece: of an axis on the tool's side the displacement itself, of
a primed axis minus it, turned into the frame of the workpiece. EXX = +5 um: an X carriage on the tool's
side goes too far, and the tip stands at +5 um in the workpiece; a primed one leaves it at -5 um.

More: errors/README.md pins the sign of every element; abbe pose SCENE --elements shows each at a pose.
)";

constexpr const char* residual = R"(The residual

A residual is the distance along the outward normal of the design from the design surface to the machined
one: plus is material left, minus is gouged.

alignment says what is taken out first, and every picture says it too:
  none    nothing           offset  the mean           rigid  a displacement and a rotation

PV, RMS and mean are of the vertices that are cut within the search band. How many were not cut, and
how many are gouged deeper than the band, is said beside them and warned of.

More: scenes/README.md, cutting/README.md; abbe explain part.alignment says what the key takes.
)";

constexpr const char* cases = R"(Cases

error_free     the machine without its errors: what sampling and cusps leave
uncompensated  the machine with them, as programmed
BELIEF-STRATEGY-CHANNEL  a compensator, as in perfect-iterated-ideal
  belief    what it holds the machine to be: perfect, identified, thermal, composite, force, part, fused
  strategy  how corrections follow from that: position, decoupled, iterated
  channel   how they reach the axes: ideal, program, pulses, open, origin, table, piezo
A name with a dot or a slash is the file of a compensator of your own: ./mine.py

[compare] cases lists those of a scene, abbe run --case NAME cuts one, abbe --cases SCENE prints the names.
More: scenes/README.md, [belief] and [compare]; sim/compensation/README.md for compensators of your own.
)";

constexpr const char* files = R"(Files

A scene (TOML) names machine, errors, tool, part and program, each in the scene or in a file of its own.
A file name is relative to the file that has it; library:NAME means a file that comes with abbe.
--set KEY=VALUE changes any value by its path. Of a list, instrument.kind=... changes every entry,
instrument.0.kind=... the first (counted from 0), instrument.NAME.kind=... the one of that name.

Results go into the folder of --out (out/SCENE), which is new, empty or abbe's own; --force takes another.
No file that a run reads is ever written over. In it lie:
  summary.json     figures, warnings, versions        residual.vtp   the map of a case, for ParaView
  comparison.json  figures of every case              comparison.png the maps on one colour scale
  scene.toml       the scene with every value; it gives the same bits again
A mistake in a file is answered by FILE:LINE:COLUMN, what was expected and what was seen, and exit code 3.
More: scenes/README.md, scenes/studies/README.md; abbe --keys lists the keys of a scene.
)";

}  // namespace

const std::vector<HelpTopic>& help_topics() {
  static const std::vector<HelpTopic> topics{
      {"frames", "frames, axes and units", frames},
      {"signs", "which way an error points", signs},
      {"residual", "what the map of a part shows", residual},
      {"cases", "names of cases: belief-strategy-channel", cases},
      {"files", "what is read, and where results go", files}};
  return topics;
}

}  // namespace abbe::sim
