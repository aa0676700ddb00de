// Mistakes that users make, one a row: a number in another unit, a sign, a name, a file of another
// machine. None may give another result in silence. A row is a scene that is right, one thing wrong
// in one of its files, and what has to be said of it. The list has what can be known from the input
// to be odd: what no machine, tool, room or program has, or what two inputs contradict each other
// in. A number that is wrong and as likely as the right one (a feed of 20 mm/min in place of 1200,
// a part turned by a right angle on a table that has room for it) cannot be known, and is not in
// it.

#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/bad_input.h"
#include "sim/commands/measure_command.h"
#include "sim/cut/reach.h"
#include "sim/loop/compensate.h"
#include "sim/report/summary.h"
#include "sim/scene/read_scene.h"
#include "sim/study/arm.h"
#include "sim/study/study.h"
#include "tests/safety/program_run.h"

namespace abbe::safety {
namespace {

using Files = std::map<std::string, std::string>;

/// What a run has to say.
enum class Expected { InputError, Warning };

/// What reads the files.
enum class Command { Run, Measure, Study };

/// A change of a file: `was` becomes `is`; all of it, where `was` is empty; or `is` at its end,
/// where `was` is "+".
struct Edit {
  std::string file, was, is;
};

struct Mistake {
  std::string name, base;
  std::vector<Edit> edits;
  Expected expected;
  std::string says;  ///< part of the message
  Command command = Command::Run;
};

std::string library(const std::string& file) { return bytes(source / "scenes" / file); }

std::string replaced(std::string text, const std::string& was, const std::string& is) {
  const std::size_t at = text.find(was);
  EXPECT_NE(at, std::string::npos) << "no \"" << was << "\" in\n" << text;
  return at == std::string::npos ? text : text.replace(at, was.size(), is);
}

/// A closed box on z = 0, its sides in squares, as text of an .obj.
std::string box_obj(double x, double y, double z, double scale = 1.0) {
  constexpr int squares = 6;
  std::string vertices, faces;
  std::map<std::string, int> known;
  const auto number_of = [&](const Eigen::Vector3d& p) {
    const std::string line =
        fmt::format("v {:.9g} {:.9g} {:.9g}\n", scale * p.x(), scale * p.y(), scale * p.z());
    const auto [at, is_new] = known.try_emplace(line, int(known.size()) + 1);
    if (is_new) vertices += line;
    return at->second;
  };
  const auto add_side = [&](const Eigen::Vector3d& o, const Eigen::Vector3d& u,
                            const Eigen::Vector3d& v) {
    const auto corner = [&](int i, int j) {
      return number_of(o + u * (double(i) / squares) + v * (double(j) / squares));
    };
    for (int i = 0; i < squares; ++i)
      for (int j = 0; j < squares; ++j) {
        const int a = corner(i, j), b = corner(i + 1, j), c = corner(i + 1, j + 1),
                  d = corner(i, j + 1);
        faces += fmt::format("f {} {} {}\nf {} {} {}\n", a, b, c, a, c, d);
      }
  };
  const double X = x / 2, Y = y / 2;
  add_side({-X, -Y, z}, {x, 0, 0}, {0, y, 0});
  add_side({-X, -Y, 0}, {0, y, 0}, {x, 0, 0});
  add_side({-X, -Y, 0}, {x, 0, 0}, {0, 0, z});
  add_side({X, Y, 0}, {-x, 0, 0}, {0, 0, z});
  add_side({X, -Y, 0}, {0, y, 0}, {0, 0, z});
  add_side({-X, Y, 0}, {0, -y, 0}, {0, 0, z});
  return vertices + faces;
}

const std::string face_program = R"((T1 D16 flat end mill)
G17 G21 G90 G94
T1 M6
G54 G43 H1
S4000 M3
G0 Z60
G0 X-40 Y-24
G1 Z40 F500
G1 X40 F1200
G1 Y-12
G1 X-40
G1 Y0
G1 X40
G1 Y12
G1 X-40
G1 Y24
G1 X40
G0 Z60
M5
M30
)";

std::string flat_tool() {
  return replaced(library("tools/flat_r8.toml"), "length_mm = 110.0",
                  "length_mm = 110.0\nnumber = 1");
}

/// A face on three axes, touched off, with errors, clamping, tolerance and a limit.
Files face_files() {
  return {{"scene.toml", R"(title = "face"
machine = "machine.toml"
errors = "errors.toml"
tool = "tool.toml"
[part]
surface = "rectangle"
length_x_mm = 60
length_y_mm = 40
at_mm = [150, -80, 40]
vertices = 300
tolerance_um = 20
[program]
file = "face.ngc"
work_offset = { G54 = { X_mm = 150, Y_mm = -80, Z_mm = -100 } }
[datum]
kind = "touch_off"
touch = [{ point_mm = [150, -80, 40], direction = [0, 0, -1] }]
[setup]
EX_um = 5
EA_urad = 20
[limits]
pv_um = 100
)"},
          {"machine.toml", library("machines/three_axis_table.toml")},
          {"errors.toml", library("errors/three_axis_typical.toml")},
          {"tool.toml", flat_tool()},
          {"face.ngc", face_program}};
}

/// A dome on the gantry after three hours of work, with instruments and channels.
Files dome_files() {
  return {{"scene.toml", R"(title = "dome"
machine = "machine.toml"
errors = "errors.toml"
tool = "tool.toml"
thermal = "heat.toml"
room_C = 20
history = [{ duration_h = 3, speed_rpm = 12000, axis_speed_mm_per_min = { X = 8000, Y = 8000, Z = 3000 } }]
[part]
surface = "sphere_cap"
radius_mm = 100
rim_radius_mm = 20
at_mm = [40, 25, 80]
vertices = 300
tolerance_um = 50
[program]
generator = "raster"
step_over_mm = 4
step_mm = 4
lead_deg = 36
feed_mm_per_min = 3000
speed_rpm = 12000
clearance_mm = 10
[datum]
kind = "ideal"
point_mm = [40, 25, 80]
time_h = -3
[sampling]
chord_tolerance_nm = 50
[signals]
interval_s = 1
encoder_resolution_um = 0.1
[compensation.loop]
order = "second"
bandwidth_Hz = 20
damping = 0.7
[compensation.pulses]
count_um = 0.25
cycle_ms = 1
[compensation.origin]
increment_um = 1
delay_ms = 10
[compensation.piezo]
range_um = 100
stiffness_N_per_um = 50
[[instrument]]
name = "laser"
kind = "laser"
axes = ["X"]
noise_um = 0.1
targets = 5
runs = 3
speed_mm_per_min = 1000
[[instrument]]
name = "drift"
kind = "drift"
interval_s = 60
duration_h = 1
)"},
          {"machine.toml", library("machines/gantry_cxyza.toml")},
          {"errors.toml", library("errors/gantry_typical.toml")},
          {"tool.toml", library("tools/ball_r5.toml")},
          {"heat.toml", library("errors/gantry_heat.toml")}};
}

/// A narrow face, its blank, forces, what gives way, vibration and a jaw of the vise.
Files force_files() {
  return {{"scene.toml", R"(title = "force"
machine = "machine.toml"
material = "material.toml"
compliance = "compliance.toml"
tool = "tool.toml"
[part]
surface = "rectangle"
length_x_mm = 20
length_y_mm = 12
at_mm = [150, -80, 40]
vertices = 300
tolerance_um = 20
[program]
file = "face.ngc"
work_offset = { G54 = { X_mm = 150, Y_mm = -80, Z_mm = -100 } }
[sampling]
chord_tolerance_nm = 50
[cutting]
blank = "box"
lower_mm = [-10, -6, -5]
upper_mm = [10, 6, 0.5]
spacing_mm = 0.5
flutes = 4
helix_deg = 30
run_out_um = 5
[[vibration]]
element = "EXS"
amplitude_um = 0.5
at_rpm = 4000
exponent = 2
resonance_Hz = 400
damping = 0.05
[[fixture]]
name = "vise jaw"
shape = "box"
size_mm = [40, 20, 30]
at_mm = [150, -105, 15]
)"},
          {"machine.toml", library("machines/three_axis_table.toml")},
          {"tool.toml", flat_tool()},
          {"material.toml", library("materials/al6061_t6_carbide.toml")},
          {"compliance.toml", R"(gravity = [0, 0, -1]
[axis.Z]
stiffness_N_per_um = [60.0, 60.0, 80.0]
[[mass]]
axis = "Z"
mass_kg = 400
centre_mm = [0, 140, 270]
[[tool.section]]
length_mm = 60
diameter_mm = 14
youngs_modulus_GPa = 600
)"},
          {"face.ngc", R"(G17 G21 G90 G94
T1 M6
G54 G43 H1
S4000 M3
G0 Z60
G0 X-20 Y-3
G1 Z40 F500
G1 X20 F1200
G1 Y3
G1 X-20
G0 Z60
M5
M30
)"}};
}

/// A block from a mesh, its top judged.
Files mesh_files() {
  return {{"scene.toml", R"(title = "block"
machine = "machine.toml"
errors = "errors.toml"
tool = "tool.toml"
[part]
file = "block.obj"
at_mm = [150, -80, 0]
sampling = "vertices"
judged_normal_z = 0.9
tolerance_um = 30
[program]
file = "face.ngc"
work_offset = { G54 = { X_mm = 150, Y_mm = -80, Z_mm = -100 } }
)"},
          {"machine.toml", library("machines/three_axis_table.toml")},
          {"errors.toml", library("errors/three_axis_typical.toml")},
          {"tool.toml", flat_tool()},
          {"face.ngc", face_program},
          {"block.obj", box_obj(60, 40, 40)}};
}

/// Random machines for the face.
Files study_files() {
  Files files = face_files();
  files["study.toml"] = R"(title = "study"
scene = "scene.toml"
responses = ["pv"]
[[input]]
name = "squareness"
path = "errors.EC0Y_urad"
spread = 10
[[input]]
name = "radius"
path = "tool.actual.radius_mm"
centre = 8
spread = 0.005
[[inputs]]
every = "element"
spread = 1
[monte_carlo]
cases = 400
)";
  return files;
}

const std::map<std::string, std::function<Files()>> bases{
    {"face", face_files}, {"dome", dome_files}, {"force", force_files}, {"mesh", mesh_files},
    {"study", study_files}};

std::vector<Mistake> mistakes();

Files with(Files files, const std::vector<Edit>& edits) {
  for (const Edit& edit : edits) {
    std::string& text = files[edit.file];
    text = edit.was == "+"    ? text + edit.is
           : edit.was.empty() ? edit.is
                              : replaced(std::move(text), edit.was, edit.is);
  }
  return files;
}

struct Said {
  std::string input_error;
  std::vector<std::string> warnings;
};

std::vector<std::string> warnings_of_run(const fs::path& scene) {
  const sim::Job job = sim::placed(sim::prepare(sim::read_scene(scene)));
  sim::Cut cut = sim::cut(job);
  sim::check_cuts_part(job, cut);
  const sim::Verdict verdict = sim::judge(job, std::move(cut), nullptr);
  std::vector<std::string> warnings = sim::summary(job, verdict).warnings;
  for (std::string& text : sim::exceeded(job.scene.limits, verdict))
    warnings.push_back(std::move(text));
  return warnings;
}

std::vector<std::string> warnings_of_measuring(const Folder& folder) {
  std::vector<std::string> warnings;
  for (const sim::Measured& file :
       sim::measure(folder / "scene.toml",
                    {.overrides = {}, .instruments = {}, .folder = folder / "readings"}))
    warnings.insert(warnings.end(), file.warnings.begin(), file.warnings.end());
  return warnings;
}

std::vector<std::string> warnings_of_study(const fs::path& file) {
  const sim::study::Study study = sim::study::with_scene(sim::study::read_study(file));
  return sim::study::ready_arm(study, study.arms.front(), {}).job.warnings;
}

/// What is said of files by the command that reads them; a result follows, but no picture.
Said said_of(const Files& files, Command command) {
  const Folder folder;
  for (const auto& [name, text] : files) folder.write(name, text);
  try {
    switch (command) {
      case Command::Run:
        return {"", warnings_of_run(folder / "scene.toml")};
      case Command::Measure:
        return {"", warnings_of_measuring(folder)};
      case Command::Study:
        return {"", warnings_of_study(folder / "study.toml")};
    }
  } catch (const sim::BadScene& fault) {
    return {fault.what(), {}};
  } catch (const BadInput& fault) {
    return {fault.what(), {}};
  }
  return {};
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += "\n  " + line;
  return text.empty() ? " nothing" : text;
}

TEST(UserMistakes, OfARightSceneNothingIsSaid) {
  for (const auto& [name, files] : bases) {
    const Said said = said_of(files(), name == "study" ? Command::Study : Command::Run);
    EXPECT_EQ(said.input_error, "") << name;
    EXPECT_TRUE(said.warnings.empty()) << name << joined(said.warnings);
  }
}

TEST(UserMistakes, NoneGivesAnotherResultInSilence) {
  const std::vector<Mistake> rows = mistakes();
  std::set<std::string> names;
  for (const Mistake& row : rows) {
    SCOPED_TRACE(row.base + ": " + row.name);
    EXPECT_TRUE(names.insert(row.name).second) << "a row of that name stands twice";
    const Said said = said_of(with(bases.at(row.base)(), row.edits), row.command);
    const bool is_error = row.expected == Expected::InputError;
    EXPECT_EQ(!said.input_error.empty(), is_error) << said.input_error << joined(said.warnings);
    const std::string text = is_error ? said.input_error : joined(said.warnings);
    EXPECT_NE(text.find(row.says), std::string::npos)
        << "expected \"" << row.says << "\", seen" << text;
  }
  std::cout << rows.size() << " mistakes\n";
  EXPECT_GE(rows.size(), 100u);
}

const std::string straightness =
    "[EYX]\nkind = \"legendre\"\ncoefficients_um = [0.00, -0.25, -2.20, 1.85, "
    "-0.68]\nhalf_range_mm = 400";

std::vector<Mistake> mistakes() {
  return {
      {"work offset forgotten",
       "face",
       {{"scene.toml", "work_offset = { G54 = { X_mm = 150, Y_mm = -80, Z_mm = -100 } }\n", ""}},
       Expected::InputError,
       "a program that comes within"},
      {"work offset in metres",
       "face",
       {{"scene.toml", "X_mm = 150, Y_mm = -80, Z_mm = -100",
         "X_mm = 0.150, Y_mm = -0.080, Z_mm = -0.100"}},
       Expected::InputError,
       "a program that comes within"},
      {"work offset sign of X",
       "face",
       {{"scene.toml", "X_mm = 150", "X_mm = -150"}},
       Expected::InputError,
       "a program that comes within"},
      {"work offset X and Y swapped",
       "face",
       {{"scene.toml", "X_mm = 150, Y_mm = -80", "X_mm = -80, Y_mm = 150"}},
       Expected::InputError,
       "a program that comes within"},
      {"work offset in G55 only",
       "face",
       {{"scene.toml", "G54 =", "G55 ="}},
       Expected::InputError,
       "a program that comes within"},
      {"work offset Z by tool length",
       "face",
       {{"scene.toml", "Z_mm = -100", "Z_mm = 10"}},
       Expected::InputError,
       "a program that comes within"},
      {"work offset 1 mm typing slip",
       "face",
       {{"scene.toml", "Z_mm = -100", "Z_mm = -101"}},
       Expected::Warning,
       "the program takes the tool into the design"},
      {"program in inches without G20",
       "face",
       {{"face.ngc", "X-40 Y-24", "X-1.575 Y-.945"},
        {"face.ngc",
         "G1 X40 F1200\nG1 Y-12\nG1 X-40\nG1 Y0\nG1 X40\nG1 Y12\nG1 X-40\nG1 Y24\nG1 X40",
         "G1 X1.575 F47\nG1 Y-.472\nG1 X-1.575\nG1 Y0\nG1 X1.575\nG1 Y.472\nG1 X-1.575\nG1 "
         "Y.945\nG1 X1.575"}},
       Expected::Warning,
       "the program comes within 2 mm of 13 %"},
      {"G20 left in a metric program",
       "face",
       {{"face.ngc", "G17 G21", "G17 G20"}},
       Expected::InputError,
       "whose words count in inches"},
      {"spindle speed 4 for 4000",
       "face",
       {{"face.ngc", "S4000", "S4"}},
       Expected::Warning,
       "a turn of the spindle"},
      {"spindle speed in 1/s",
       "face",
       {{"face.ngc", "S4000", "S67"}},
       Expected::Warning,
       "a turn of the spindle"},
      {"M4 for M3",
       "face",
       {{"face.ngc", "M3", "M4"}},
       Expected::Warning,
       "counter-clockwise (M4)"},
      {"M3 forgotten",
       "face",
       {{"face.ngc", "S4000 M3", "S4000"}},
       Expected::Warning,
       "the spindle never turns"},
      {"S forgotten",
       "face",
       {{"face.ngc", "S4000 M3", "M3"}},
       Expected::Warning,
       "the spindle never turns"},
      {"M5 too early",
       "face",
       {{"face.ngc", "G1 Y0\n", "M5\nG1 Y0\n"}},
       Expected::Warning,
       "the spindle stands in"},
      {"feed in m/min",
       "face",
       {{"face.ngc", "F1200", "F1.2"}},
       Expected::Warning,
       "feeds at 1.2 mm/min"},
      {"feed in um/s",
       "face",
       {{"face.ngc", "F1200", "F120000"}},
       Expected::Warning,
       "a turn of the spindle"},
      {"feed per tooth under G94",
       "face",
       {{"face.ngc", "F1200", "F0.1"}},
       Expected::Warning,
       "feeds at 0.1 mm/min"},
      {"G95 left in, feed a minute",
       "face",
       {{"face.ngc", "G90 G94", "G90 G95"}},
       Expected::Warning,
       "a turn of the spindle"},
      {"rapid in place of feed",
       "face",
       {{"face.ngc", "G1 X40 F1200", "G0 X40"}},
       Expected::Warning,
       "are cut by rapids"},
      {"G91 for G90",
       "face",
       {{"face.ngc", "G90", "G91"}},
       Expected::InputError,
       "expected Z between"},
      {"G18 for G17 with an arc",
       "face",
       {{"face.ngc", "G17", "G18"}, {"face.ngc", "G1 Y-12\n", "G2 X40 Y-12 J6 I0\n"}},
       Expected::InputError,
       "in the plane of G18"},
      {"tool number of another tool",
       "face",
       {{"face.ngc", "T1 M6", "T2 M6"}},
       Expected::InputError,
       "expected T1"},
      {"tool comment of another diameter",
       "face",
       {{"face.ngc", "(T1 D16 flat end mill)", "(T1 D10 flat end mill)"}},
       Expected::Warning,
       "D10"},
      {"tool comment of a ball",
       "face",
       {{"face.ngc", "(T1 D16 flat end mill)", "(T1 D16 ball end mill)"}},
       Expected::Warning,
       "ball"},
      {"H of no tool",
       "face",
       {{"face.ngc", "G43 H1", "G43 H7"}},
       Expected::InputError,
       "expected a tool length that is known"},
      {"G43 forgotten",
       "face",
       {{"face.ngc", "G54 G43 H1", "G54"}},
       Expected::InputError,
       "with G54 Z = 10"},
      {"diameter for radius",
       "face",
       {{"tool.toml", "radius_mm = 8.0", "radius_mm = 16.0"}},
       Expected::Warning,
       "D16"},
      {"tool radius in m",
       "face",
       {{"tool.toml", "radius_mm = 8.0", "radius_mm = 0.008"}},
       Expected::InputError,
       "no farther apart than the cutter is wide"},
      {"tool radius in inches",
       "face",
       {{"tool.toml", "radius_mm = 8.0", "radius_mm = 0.315"}},
       Expected::InputError,
       "no farther apart than the cutter is wide"},
      {"tool length in m",
       "face",
       {{"tool.toml", "length_mm = 110.0", "length_mm = 0.110"}},
       Expected::InputError,
       "at most the length of the tool"},
      {"tool length zero",
       "face",
       {{"tool.toml", "length_mm = 110.0", "length_mm = 0"}},
       Expected::InputError,
       "at most the length of the tool"},
      {"tool length in inches",
       "face",
       {{"tool.toml", "length_mm = 110.0", "length_mm = 4.33"}},
       Expected::InputError,
       "at most the length of the tool"},
      {"tool length negative",
       "face",
       {{"tool.toml", "length_mm = 110.0", "length_mm = -110"}},
       Expected::InputError,
       "at most the length of the tool"},
      {"flank length in m",
       "face",
       {{"tool.toml", "flank_length_mm = 50.0", "flank_length_mm = 0.05"}},
       Expected::Warning,
       "tool.flank_length_mm is 0.05: looks like m"},
      {"flank longer than the tool",
       "face",
       {{"tool.toml", "flank_length_mm = 50.0", "flank_length_mm = 150.0"}},
       Expected::InputError,
       "at most the length of the tool"},
      {"actual length as a difference",
       "face",
       {{"tool.toml", "+", "[actual]\nlength_mm = 0.01\n"}},
       Expected::InputError,
       "at least the length of the flank"},
      {"actual radius as a difference",
       "face",
       {{"tool.toml", "+", "[actual]\nradius_mm = 0.02\n"}},
       Expected::InputError,
       "a program that cuts the part"},
      {"actual radius as a diameter",
       "face",
       {{"tool.toml", "+", "[actual]\nradius_mm = 15.98\n"}},
       Expected::Warning,
       "it is the size itself"},
      {"control believes a length in m",
       "face",
       {{"scene.toml", "+", "[control]\ntool_length_mm = 0.11\n"}},
       Expected::InputError,
       "a program that comes within"},
      {"control believes a difference of length",
       "face",
       {{"scene.toml", "+", "[control]\ntool_length_mm = 0\n"}},
       Expected::InputError,
       "a program that comes within"},
      {"wear a minute in hours",
       "face",
       {{"tool.toml", "+", "[wear]\ntime_min = 0.05\nradius_um = 10\n"}},
       Expected::Warning,
       "tool.wear.time_min is 0.05: looks like hours"},
      {"wear in mm",
       "face",
       {{"tool.toml", "+", "[wear]\ntime_min = 30\nradius_um = 0.001\n"}},
       Expected::Warning,
       "tool.wear.radius_um is 0.001: looks like mm"},
      {"part size in m",
       "face",
       {{"scene.toml", "length_x_mm = 60", "length_x_mm = 0.06"},
        {"scene.toml", "length_y_mm = 40", "length_y_mm = 0.04"}},
       Expected::Warning,
       "part.length_x_mm is 0.06: looks like m"},
      {"part size in cm",
       "face",
       {{"scene.toml", "length_x_mm = 60", "length_x_mm = 6"},
        {"scene.toml", "length_y_mm = 40", "length_y_mm = 4"}},
       Expected::Warning,
       "times the part of"},
      {"part five times as large",
       "face",
       {{"scene.toml", "length_x_mm = 60", "length_x_mm = 300"},
        {"scene.toml", "length_y_mm = 40", "length_y_mm = 200"}},
       Expected::Warning,
       "% of the judged area"},
      {"part ten times as small",
       "face",
       {{"scene.toml", "length_x_mm = 60", "length_x_mm = 16"},
        {"scene.toml", "length_y_mm = 40", "length_y_mm = 8"}},
       Expected::Warning,
       "times the part of"},
      {"part in metres of place",
       "face",
       {{"scene.toml", "at_mm = [150, -80, 40]\nvert", "at_mm = [0.150, -0.080, 0.040]\nvert"}},
       Expected::InputError,
       "a program that comes within"},
      {"part turned in radians",
       "face",
       {{"scene.toml", "at_mm = [150, -80, 40]\nvert",
         "at_mm = [150, -80, 40]\nturn_deg = [0, 0, 1.5708]\nvert"}},
       Expected::Warning,
       "part.turn_deg is 1.5708: looks like radians"},
      {"part upside down",
       "face",
       {{"scene.toml", "at_mm = [150, -80, 40]\nvert",
         "at_mm = [150, -80, 40]\nturn_deg = [180, 0, 0]\nvert"}},
       Expected::InputError,
       "turn it round"},
      {"tolerance in mm",
       "face",
       {{"scene.toml", "tolerance_um = 20", "tolerance_um = 0.02"}},
       Expected::Warning,
       "part.tolerance_um is 0.02: looks like mm"},
      {"tolerance in nm",
       "face",
       {{"scene.toml", "tolerance_um = 20", "tolerance_um = 20000"}},
       Expected::Warning,
       "part.tolerance_um is 20000: looks like nm"},
      {"tolerance turned round",
       "face",
       {{"scene.toml", "tolerance_um = 20", "tolerance_um = [20, -20]"}},
       Expected::InputError,
       "the lower limit first"},
      {"limit in mm",
       "face",
       {{"scene.toml", "pv_um = 100", "pv_um = 0.02"}},
       Expected::Warning,
       "limits.pv_um is 0.02: looks like mm"},
      {"limit in nm",
       "face",
       {{"scene.toml", "pv_um = 100", "pv_um = 100000"}},
       Expected::Warning,
       "the number looks like nm"},
      {"setup in mm",
       "face",
       {{"scene.toml", "EX_um = 5", "EX_um = 0.005"}},
       Expected::Warning,
       "setup.EX_um is 0.005: looks like mm"},
      {"setup in nm",
       "face",
       {{"scene.toml", "EX_um = 5", "EX_um = 50000"}},
       Expected::Warning,
       "setup.EX_um is 50000: looks like nm"},
      {"setup angle in rad",
       "face",
       {{"scene.toml", "EA_urad = 20", "EA_urad = 2e-5"}},
       Expected::Warning,
       "setup.EA_urad is 2e-05: looks like rad"},
      {"setup angle in degrees",
       "face",
       {{"scene.toml", "EA_urad = 20", "EA_urad = 0.001"}},
       Expected::Warning,
       "setup.EA_urad is 0.001: looks like rad"},
      {"travel in m",
       "face",
       {{"machine.toml", "travel_mm = [-400, 400]", "travel_mm = [-0.4, 0.4]"}},
       Expected::InputError,
       "expected X between"},
      {"travel turned round",
       "face",
       {{"machine.toml", "travel_mm = [-400, 400]", "travel_mm = [400, -400]"}},
       Expected::InputError,
       "with least below most"},
      {"rapid in m/min",
       "face",
       {{"machine.toml", "rapid_mm_per_min = 15000", "rapid_mm_per_min = 15"}},
       Expected::Warning,
       "machine.rapid_mm_per_min is 15: looks like m/min"},
      {"home outside the travel",
       "face",
       {{"machine.toml", "Z_mm = 390", "Z_mm = 3900"}},
       Expected::InputError,
       "expected Z between"},
      {"nose in m",
       "face",
       {{"machine.toml", "at_mm = [0, 0, 100]\n\n# Where", "at_mm = [0, 0, 0.1]\n\n# Where"}},
       Expected::InputError,
       "a program that comes within"},
      {"axis direction turned round",
       "face",
       {{"machine.toml", "[axis.Z]\n", "[axis.Z]\ndirection = [0, 0, -1]\n"}},
       Expected::InputError,
       "a program that comes within"},
      {"body size in m",
       "face",
       {{"machine.toml", "size_mm = [900, 400, 60]", "size_mm = [0.9, 0.4, 0.06]"}},
       Expected::Warning,
       "machine.body.size_mm is 0.9: looks like m"},
      {"body of no axis",
       "face",
       {{"machine.toml", "carried_by = \"X\"", "carried_by = \"B\""}},
       Expected::InputError,
       "a letter of the machine's code"},
      {"squareness in rad",
       "face",
       {{"errors.toml", "EC0Y_urad = 24.0", "EC0Y_urad = 24e-6"}},
       Expected::Warning,
       "no machine is that good"},
      {"squareness in degrees",
       "face",
       {{"errors.toml", "EC0Y_urad = 24.0", "EC0Y_urad = 0.0014"}},
       Expected::Warning,
       "no machine is that good"},
      {"straightness in mm",
       "face",
       {{"errors.toml", "coefficients_um = [0.00, -0.25, -2.20, 1.85, -0.68]",
         "coefficients_um = [0.00, -0.00025, -0.00220, 0.00185, -0.00068]"}},
       Expected::Warning,
       "errors.EYX is at most"},
      {"straightness in nm",
       "face",
       {{"errors.toml", "coefficients_um = [0.00, -0.25, -2.20, 1.85, -0.68]",
         "coefficients_um = [0.00, -250, -2200, 1850, -680]"}},
       Expected::Warning,
       "errors.EYX is"},
      {"half range in m",
       "face",
       {{"errors.toml", "half_range_mm = 400", "half_range_mm = 0.4"}},
       Expected::InputError,
       "that move the tip by at most 1000 mm"},
      {"half range of the whole travel missed",
       "face",
       {{"errors.toml", "half_range_mm = 400", "half_range_mm = 40"}},
       Expected::Warning,
       "beyond the range that they are stated over"},
      {"screw pitch in m",
       "face",
       {{"errors.toml", "period_mm = 12", "period_mm = 0.012"}},
       Expected::Warning,
       "period_mm is 0.012: looks like m"},
      {"errors of another machine",
       "face",
       {{"errors.toml", "", library("errors/platform_peng.toml")}},
       Expected::Warning,
       "and no machine is that wrong"},
      {"errors of a gantry with rotary axes",
       "face",
       {{"errors.toml", "", library("errors/gantry_typical.toml")}},
       Expected::InputError,
       "an element that fits the machine"},
      {"table of another travel",
       "face",
       {{"errors.toml", straightness,
         "[EYX]\nkind = \"table\"\nq_mm = [0, 10, 20]\nvalue_um = [0, 1, 2]"}},
       Expected::InputError,
       "errors that reach to where the datum is found"},
      {"table reversed",
       "face",
       {{"errors.toml", straightness,
         "[EYX]\nkind = \"table\"\nq_mm = [400, 0, -400]\nvalue_um = [0, 1, 2]"}},
       Expected::InputError,
       "rising positions"},
      {"table with a row twice",
       "face",
       {{"errors.toml", straightness,
         "[EYX]\nkind = \"table\"\nq_mm = [-400, 0, 0, 400]\nvalue_um = [0, 1, 1, 2]"}},
       Expected::InputError,
       "a position above 0"},
      {"table of unequal columns",
       "face",
       {{"errors.toml", straightness,
         "[EYX]\nkind = \"table\"\nq_mm = [-400, 0, 400]\nvalue_um = [0, 1]"}},
       Expected::InputError,
       "as many values as positions"},
      {"positions of a table in m",
       "face",
       {{"errors.toml", straightness,
         "[EYX]\nkind = \"table\"\nq_mm = [-0.4, 0, 0.4]\nvalue_um = [0, 1, 2]\noutside = "
         "\"hold\""}},
       Expected::Warning,
       "tables hold their last value"},
      {"table holds beyond its range",
       "face",
       {{"errors.toml", straightness,
         "[EYX]\nkind = \"table\"\nq_mm = [-40, 0, 40]\nvalue_um = [0, 1, 2]\noutside = \"hold\""}},
       Expected::Warning,
       "tables hold their last value"},
      {"element named in another standard",
       "face",
       {{"errors.toml", "[EYX]", "[DYX]"}},
       Expected::InputError,
       "nearest: errors.EYX"},
      {"element of an axis that is not there",
       "face",
       {{"errors.toml", "[EYX]", "[EYW]"}},
       Expected::InputError,
       "an element that fits the machine"},
      {"scale of errors as percent",
       "face",
       {{"scene.toml", "errors = \"errors.toml\"", "errors = \"errors.toml\""},
        {"errors.toml", "name = \"three axes, typical\"",
         "name = \"three axes, typical\"\nscale = 100"}},
       Expected::Warning,
       "no machine is that wrong"},
      {"reversal in mm",
       "face",
       {{"errors.toml", straightness, "[EYX]\nkind = \"backlash\"\nhalf_um = 0.002"}},
       Expected::Warning,
       "errors.EYX is"},
      {"datum beside the part",
       "face",
       {{"scene.toml", "point_mm = [150, -80, 40], dir", "point_mm = [550, -80, 40], dir"}},
       Expected::InputError,
       "scene.toml:17:23: expected a touch"},
      {"datum in program coordinates",
       "face",
       {{"scene.toml", "point_mm = [150, -80, 40], dir", "point_mm = [0, 0, 40], dir"}},
       Expected::InputError,
       "a touch in the air"},
      {"datum along the face",
       "face",
       {{"scene.toml", "direction = [0, 0, -1]", "direction = [1, 0, 0]"}},
       Expected::InputError,
       "a touch along a face of the part"},
      {"datum from below",
       "face",
       {{"scene.toml", "direction = [0, 0, -1]", "direction = [0, 0, 1]"}},
       Expected::InputError,
       "turn it round"},
      {"datum touched at tool length",
       "face",
       {{"scene.toml", "point_mm = [150, -80, 40], dir", "point_mm = [150, -80, 150], dir"}},
       Expected::InputError,
       "a touch in the air"},
      {"datum at a skew",
       "face",
       {{"scene.toml", "direction = [0, 0, -1]", "direction = [1, 0, -1]"}},
       Expected::InputError,
       "leans 45 degrees"},
      {"ideal datum far away",
       "face",
       {{"scene.toml",
         "kind = \"touch_off\"\ntouch = [{ point_mm = [150, -80, 40], direction = [0, 0, -1] }]",
         "kind = \"ideal\"\npoint_mm = [15000, -8000, 4000]"}},
       Expected::InputError,
       "expected X between"},
      {"band in um",
       "face",
       {{"scene.toml", "+", "[search]\nband_mm = 2000\n"}},
       Expected::Warning,
       "search.band_mm is 2000: looks like um"},
      {"band in m",
       "face",
       {{"scene.toml", "+", "[search]\nband_mm = 0.002\n"}},
       Expected::Warning,
       "search.band_mm is 0.002: looks like m"},
      {"chord tolerance in um",
       "face",
       {{"scene.toml", "+", "[sampling]\nchord_tolerance_nm = 0.0005\n"}},
       Expected::InputError,
       "chord_tolerance_nm"},
      {"misspelt key",
       "face",
       {{"scene.toml", "tolerance_um", "tolerence_um"}},
       Expected::InputError,
       "nearest: part.tolerance_um"},
      {"key of another unit",
       "face",
       {{"scene.toml", "tolerance_um = 20", "tolerance_mm = 0.02"}},
       Expected::InputError,
       "part.tolerance_um in um"},
      {"case of no such name",
       "face",
       {{"scene.toml", "+", "[compare]\ncases = [\"perfect-iterated-idael\"]\n"}},
       Expected::InputError,
       "idael"},
      {"room in kelvin",
       "dome",
       {{"scene.toml", "room_C = 20", "room_C = 293.15"}},
       Expected::Warning,
       "room_C is 293.15: looks like kelvin"},
      {"room in Fahrenheit",
       "dome",
       {{"scene.toml", "room_C = 20", "room_C = 68"}},
       Expected::Warning,
       "room_C is 68: looks like Fahrenheit"},
      {"reference in kelvin",
       "dome",
       {{"heat.toml", "reference_C = 20", "reference_C = 293"}},
       Expected::Warning,
       "thermal.reference_C is 293: looks like kelvin"},
      {"history in seconds",
       "dome",
       {{"scene.toml", "duration_h = 3,", "duration_h = 10800,"}},
       Expected::Warning,
       "history.duration_h is 10800: looks like minutes or seconds"},
      {"history in minutes",
       "dome",
       {{"scene.toml", "duration_h = 3,", "duration_h = 480,"}},
       Expected::Warning,
       "history.duration_h is 480: looks like minutes or seconds"},
      {"history hours under seconds",
       "dome",
       {{"scene.toml", "duration_h = 3,", "duration_s = 3,"}},
       Expected::Warning,
       "history.duration_s is 3: looks like hours"},
      {"history speed in 1/s",
       "dome",
       {{"scene.toml", "speed_rpm = 12000, axis", "speed_rpm = 200, axis"}},
       Expected::Warning,
       "the spindle runs at 200 rpm"},
      {"history speed in 1000 rpm",
       "dome",
       {{"scene.toml", "speed_rpm = 12000, axis", "speed_rpm = 12, axis"}},
       Expected::Warning,
       "history.speed_rpm is 12: looks like 1/s or 1000 rpm"},
      {"source speed in 1/s",
       "dome",
       {{"heat.toml", "at_rpm = 12000", "at_rpm = 200"}},
       Expected::InputError,
       "a thermal network that stays within"},
      {"axis speed in m/min",
       "dome",
       {{"scene.toml", "X = 8000, Y = 8000, Z = 3000", "X = 8, Y = 8, Z = 3"}},
       Expected::Warning,
       "history.axis_speed_mm_per_min.X is 8: looks like m/min"},
      {"source in kW",
       "dome",
       {{"heat.toml", "power_W = 220", "power_W = 0.25"}},
       Expected::Warning,
       "thermal.source.power_W is 0.25: looks like kW"},
      {"source in mW",
       "dome",
       {{"heat.toml", "power_W = 220", "power_W = 220000"}},
       Expected::InputError,
       "a thermal network that stays within"},
      {"capacity in kJ/K",
       "dome",
       {{"heat.toml", "capacity_J_per_K = 4000", "capacity_J_per_K = 4"}},
       Expected::Warning,
       "thermal.node.capacity_J_per_K is 4: looks like kJ/K"},
      {"conductance in kW/K",
       "dome",
       {{"heat.toml", "conductance_W_per_K = 30", "conductance_W_per_K = 0.003"}},
       Expected::Warning,
       "thermal.link.conductance_W_per_K is 0.003: looks like kW/K"},
      {"conductance of no cooling",
       "dome",
       {{"heat.toml", "conductance_W_per_K = 6\n", "conductance_W_per_K = 0.006\n"}},
       Expected::Warning,
       "thermal.link.conductance_W_per_K is 0.006: looks like kW/K"},
      {"heat feed of the program in m/min",
       "dome",
       {{"scene.toml", "feed_mm_per_min = 3000", "feed_mm_per_min = 3"}},
       Expected::Warning,
       "program.feed_mm_per_min is 3: looks like m/min"},
      {"program speed in 1/s",
       "dome",
       {{"scene.toml", "speed_rpm = 12000\nclear", "speed_rpm = 200\nclear"}},
       Expected::Warning,
       "a turn of the spindle"},
      {"lead in radians",
       "dome",
       {{"scene.toml", "lead_deg = 36", "lead_deg = 0.785"}},
       Expected::Warning,
       "program.lead_deg is 0.785: looks like radians"},
      {"step over in um",
       "dome",
       {{"scene.toml", "step_over_mm = 4", "step_over_mm = 300"}},
       Expected::Warning,
       "program.step_over_mm is 300: looks like um"},
      {"datum time in seconds",
       "dome",
       {{"scene.toml", "time_h = -3", "time_h = -10800"}},
       Expected::Warning,
       "datum.time_h is -10800: looks like minutes or seconds"},
      {"datum hours under seconds",
       "dome",
       {{"scene.toml", "time_h = -3", "time_s = -3"}},
       Expected::Warning,
       "datum.time_s is -3: looks like hours"},
      {"datum time of the wrong sign",
       "dome",
       {{"scene.toml", "time_h = -3", "time_h = 3"}},
       Expected::Warning,
       "a datum found before the program has a negative time"},
      {"datum before the history",
       "dome",
       {{"scene.toml", "time_h = -3", "time_h = -30"}},
       Expected::Warning,
       "the history begins at -3 h"},
      {"room profile in seconds",
       "dome",
       {{"scene.toml", "room_C = 20\n", "room = { time_h = [-10800, 0], T_C = [20, 22] }\n"}},
       Expected::Warning,
       "room.time_h is -10800: looks like minutes or seconds"},
      {"room profile turned round",
       "dome",
       {{"scene.toml", "room_C = 20\n", "room = { time_h = [0, -3], T_C = [20, 22] }\n"}},
       Expected::InputError,
       "rising times"},
      {"room profile in kelvin",
       "dome",
       {{"scene.toml", "room_C = 20\n", "room = { time_h = [-3, 0], T_C = [293, 295] }\n"}},
       Expected::Warning,
       "room.T_C is 293: looks like kelvin"},
      {"laser noise in mm",
       "dome",
       {{"scene.toml", "noise_um = 0.1", "noise_um = 0.0001"}},
       Expected::Warning,
       "instrument.noise_um is 0.0001: looks like mm",
       Command::Measure},
      {"laser noise in nm",
       "dome",
       {{"scene.toml", "noise_um = 0.1", "noise_um = 1000"}},
       Expected::Warning,
       "instrument.noise_um is 1000: looks like nm",
       Command::Measure},
      {"laser axis that is not there",
       "dome",
       {{"scene.toml", "axes = [\"X\"]", "axes = [\"B\"]"}},
       Expected::InputError,
       "an axis of the machine",
       Command::Measure},
      {"laser speed in m/min",
       "dome",
       {{"scene.toml", "targets = 5\nruns = 3\nspeed_mm_per_min = 1000",
         "targets = 5\nruns = 3\nspeed_mm_per_min = 1"}},
       Expected::Warning,
       "instrument.speed_mm_per_min is 1: looks like m/min",
       Command::Measure},
      {"drift interval in ms",
       "dome",
       {{"scene.toml", "interval_s = 60\nduration_h = 1", "interval_s = 60000\nduration_h = 100"}},
       Expected::Warning,
       "instrument.interval_s is 60000: looks like ms",
       Command::Measure},
      {"drift duration in seconds",
       "dome",
       {{"scene.toml", "interval_s = 60\nduration_h = 1", "interval_s = 60\nduration_h = 3600"}},
       Expected::InputError,
       "at most 100000 intervals",
       Command::Measure},
      {"drift duration shorter than its interval",
       "dome",
       {{"scene.toml", "interval_s = 60\nduration_h = 1", "interval_s = 60\nduration_h = 0.01"}},
       Expected::InputError,
       "so that something is read twice",
       Command::Measure},
      {"encoder in nm",
       "dome",
       {{"scene.toml", "encoder_resolution_um = 0.1", "encoder_resolution_um = 1000"}},
       Expected::Warning,
       "signals.encoder_resolution_um is 1000: looks like nm"},
      {"bandwidth in kHz",
       "dome",
       {{"scene.toml", "bandwidth_Hz = 20\ndamping = 0.7", "bandwidth_Hz = 0.02\ndamping = 0.7"}},
       Expected::Warning,
       "compensation.loop.bandwidth_Hz is 0.02: looks like kHz"},
      {"damping in percent",
       "dome",
       {{"scene.toml", "damping = 0.7", "damping = 70"}},
       Expected::Warning,
       "compensation.loop.damping is 70: looks like percent"},
      {"pulse in mm",
       "dome",
       {{"scene.toml", "count_um = 0.25", "count_um = 0.00025"}},
       Expected::Warning,
       "compensation.pulses.count_um is 0.00025: looks like mm"},
      {"pulse in nm",
       "dome",
       {{"scene.toml", "count_um = 0.25", "count_um = 250"}},
       Expected::Warning,
       "compensation.pulses.count_um is 250: looks like nm"},
      {"cycle in s",
       "dome",
       {{"scene.toml", "cycle_ms = 1\n", "cycle_ms = 0.001\n"}},
       Expected::Warning,
       "compensation.pulses.cycle_ms is 0.001: looks like s"},
      {"increment in mm",
       "dome",
       {{"scene.toml", "increment_um = 1", "increment_um = 0.001"}},
       Expected::Warning,
       "compensation.origin.increment_um is 0.001: looks like mm"},
      {"piezo range in mm",
       "dome",
       {{"scene.toml", "range_um = 100", "range_um = 0.1"}},
       Expected::Warning,
       "compensation.piezo.range_um is 0.1: looks like mm"},
      {"piezo stiffness in N/mm",
       "dome",
       {{"scene.toml", "stiffness_N_per_um = 50", "stiffness_N_per_um = 50000"}},
       Expected::Warning,
       "compensation.piezo.stiffness_N_per_um is 50000: looks like N/mm"},
      {"signals interval in ms",
       "dome",
       {{"scene.toml", "interval_s = 1\nenc", "interval_s = 10000\nenc"}},
       Expected::Warning,
       "signals.interval_s is 10000: looks like ms"},
      {"rotary axis travel in radians",
       "dome",
       {{"machine.toml", "travel_deg = [-110, 110]", "travel_deg = [-1.92, 1.92]"}},
       Expected::InputError,
       "an axis would leave its"},
  };
}

}  // namespace
}  // namespace abbe::safety
