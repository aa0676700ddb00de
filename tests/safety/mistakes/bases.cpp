#include <regex>
#include "sim/commands/calibration_commands.h"
#include "tests/safety/mistakes/mistake.h"
#include "tests/test.h"

namespace abbe::safety {

std::string library(const std::string& file) { return bytes(source / "scenes" / file); }

std::string replaced(std::string text, const std::string& was, const std::string& is) {
  const std::size_t at = text.find(was);
  EXPECT_NE(at, std::string::npos) << "no \"" << was << "\" in\n" << text;
  return at == std::string::npos ? text : text.replace(at, was.size(), is);
}

std::string box_obj(double x, double y, double z, double scale) {
  constexpr int squares = 6;
  std::string vertices, faces;
  std::map<std::string, int> known;
  const auto number_of = [&](const Vector3d& p) {
    const std::string line =
        fmt::format("v {:.9g} {:.9g} {:.9g}\n", scale * p.x(), scale * p.y(), scale * p.z());
    const auto [at, is_new] = known.try_emplace(line, int(known.size()) + 1);
    if (is_new) vertices += line;
    return at->second;
  };
  const auto add_side = [&](const Vector3d& o, const Vector3d& u, const Vector3d& v) {
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

std::string inside_out(const std::string& text) {
  return std::regex_replace(text, std::regex("f (\\d+) (\\d+) (\\d+)"), "f $1 $3 $2");
}

namespace {

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

/// A narrow face, its blank, forces and what gives way.
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
spacing_mm = 1
flutes = 4
helix_deg = 30
run_out_um = 5
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
G0 X-14 Y-3
G1 Z40 F500
G1 X14 F4000
G1 Y3
G1 X-14
G0 Z60
M5
M30
)"}};
}

/// A face that the spindle's vibration marks.
Files vibration_files() {
  Files files = force_files();
  std::string& scene = files["scene.toml"];
  scene = replaced(scene, "material = \"material.toml\"\ncompliance = \"compliance.toml\"\n", "");
  scene = scene.substr(0, scene.find("[cutting]")) + R"([[vibration]]
element = "EXS"
amplitude_um = 0.5
at_rpm = 4000
exponent = 2
resonance_Hz = 400
damping = 0.05
)";
  return files;
}

/// A block from a mesh, its top judged, and a jaw of the vise beside it.
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
[[fixture]]
name = "vise jaw"
shape = "box"
size_mm = [40, 20, 30]
at_mm = [150, -112, 15]
)"},
          {"machine.toml", library("machines/three_axis_table.toml")},
          {"errors.toml", library("errors/three_axis_typical.toml")},
          {"tool.toml", flat_tool()},
          {"face.ngc", face_program},
          {"block.obj", box_obj(60, 40, 40)}};
}

/// The dome with what compensators believe.
Files belief_files() {
  Files files = dome_files();
  files["scene.toml"] += R"([belief]
identified = "belief.toml"
[belief.thermal]
file = "thermal.txt"
[compare]
cases = ["identified-iterated-ideal"]
)";
  files["belief.toml"] = library("beliefs/gantry.toml");
  files["thermal.txt"] = library("beliefs/gantry_warmup_thermal.txt");
  return files;
}

/// What the instruments of a scene read, by the names of their files.
Files measured_files(const fs::path& scene) {
  const Folder folder;
  sim::measure(scene, {.overrides = {}, .instruments = {}, .folder = folder / "readings"});
  Files files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder / "readings"))
    if (entry.path().extension() == ".csv")
      files[entry.path().filename().string()] = bytes(entry.path());
  return files;
}

Files measured_by_laser_and_square() {
  const Folder folder;
  folder.write("machine.toml", library("machines/three_axis_table.toml"));
  folder.write("tool.toml", library("tools/ball_r5.toml"));
  folder.write("scene.toml", R"(title = "measured"
seed = 3
machine = "machine.toml"
tool = "tool.toml"
[errors]
EC0Y_urad = 24.0
EB0Z_urad = -22.0
EA0Z_urad = 29.0
[errors.EXX]
kind = "legendre"
coefficients_um = [0.00, 4.42, -2.91, 3.74]
half_range_mm = 400
[errors.EYY]
kind = "legendre"
coefficients_um = [0.00, 4.43, -4.35, 3.68]
half_range_mm = 250
[errors.EZZ]
kind = "legendre"
coefficients_um = [0.00, 3.66, -2.55, -2.96]
centre_mm = 150
half_range_mm = 250
[part]
surface = "rectangle"
length_x_mm = 4
length_y_mm = 4
at_mm = [0, 0, 80]
vertices = 100
[program]
generator = "raster"
step_over_mm = 1
step_mm = 1
[[instrument]]
kind = "laser"
targets = 11
runs = 3
[[instrument]]
kind = "square"
)");
  return measured_files(folder / "scene.toml");
}

}  // namespace

Files study_files() {
  return {{"scene.toml", R"(title = "small dome"
machine = "machine.toml"
errors = "errors.toml"
tool = "tool.toml"
[part]
surface = "sphere_cap"
radius_mm = 20
rim_radius_mm = 6
at_mm = [40, 25, 80]
vertices = 300
tolerance_um = 20
[program]
generator = "raster"
step_over_mm = 0.8
step_mm = 2
lead_deg = 36
feed_mm_per_min = 1500
clearance_mm = 10
pattern = "one_way"
overrun_mm = 1.0
[sampling]
chord_tolerance_nm = 100
max_step_mm = 1000
)"},
          {"study.toml", R"(title = "study"
scene = "scene.toml"
responses = ["pv"]
[[input]]
name = "squareness"
path = "errors.EC0Y_urad"
spread = 10
[[input]]
name = "radius"
path = "tool.actual.radius_mm"
centre = 5
spread = 0.005
[[inputs]]
every = "element"
of = ["EXX", "EYY", "EZZ"]
spread = 1
[monte_carlo]
cases = 400
)"},
          {"machine.toml", library("machines/gantry_cxyza.toml")},
          {"errors.toml", library("errors/gantry_typical.toml")},
          {"tool.toml", library("tools/ball_r5.toml")}};
}

Files readings_files() {
  static const Files files = measured_by_laser_and_square();
  return files;
}

Files day_files() {
  static const Files files = [] {
    const Files measured = measured_files(source / "scenes/thermal_protocol_chen.toml");
    return Files{{"day.csv", measured.at("drift.csv")}};
  }();
  return files;
}

const std::map<std::string, Base>& bases() {
  static const std::map<std::string, Base> all{
      {"face", {face_files}},
      {"dome", {dome_files}},
      {"force", {force_files}},
      {"vibration", {vibration_files}},
      {"mesh", {mesh_files}},
      {"belief", {belief_files, Command::RunCase}},
      {"study", {study_files, Command::Study}},
      {"readings",
       {readings_files, Command::Identify,
        [](sim::IdentificationOptions& options) {
          options.model.only = {"EXX", "EYY", "EZZ", "EC0Y", "EB0Z", "EA0Z"};
        }}},
      {"day", {day_files, Command::Identify, [](sim::IdentificationOptions& options) {
                 options.method = sim::IdentificationOptions::Method::Thermal;
                 options.sensors = {"S12_spindle_box_bearing"};
               }}}};
  return all;
}

Edit::Edit(std::string file, std::string was, std::string is)
    : file(std::move(file)), change([was, is](const std::string& text) {
        return was == "+" ? text + is : was.empty() ? is : replaced(text, was, is);
      }) {}

}  // namespace abbe::safety
