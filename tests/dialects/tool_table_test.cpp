// What the control believes of its tools and offsets, by its tables, and what the true tools cut;
// and cutters that wear.

#include "sim/cut/cut.h"
#include "sim/cut/tool_use.h"
#include "tests/sim/odd_scenes.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using cutting::VertexStatus;

/// A control as the tests speak to it.
struct OneControl {
  const char* name;
  const char* ending;
  const char* table;    ///< its name
  const char* unit;     ///< empty where the table says it
  const char* offsets;  ///< the name of the offsets
};

const OneControl linuxcnc{"linuxcnc", ".ngc", "tool.tbl", "mm", "offsets.var"};
const OneControl fanuc{"fanuc", ".nc", "tools.txt", "mm", "offsets.txt"};
const OneControl siemens{"siemens", ".mpf", "to.ini", "mm", "ufr.ini"};
const OneControl heidenhain{"heidenhain", ".h", "tool.t", "", "preset.pr"};
const OneControl four_tools[] = {linuxcnc, fanuc, siemens, heidenhain};

/// The table of one tool, in the control's format.
std::string table_of(const OneControl& control, int number, double length, double radius) {
  const std::string name = control.name;
  if (name == "linuxcnc")
    return fmt::format("T{} P1 Z{:.7f} D{:.7f}\n", number, length, 2 * radius);
  if (name == "fanuc")
    return fmt::format("%\nG10 L10 P{0} R{1:.7f}\nG10 L12 P{0} R{2:.7f}\n%\n", number, length,
                       radius);
  if (name == "siemens")
    return fmt::format("$TC_DP1[{0},1]=120\n$TC_DP3[{0},1]={1:.7f}\n$TC_DP6[{0},1]={2:.7f}\n",
                       number, length, radius);
  return fmt::format(
      "BEGIN TOOL .T MM\nT     NAME  L             R\n{:<12}{:<14.7f}{:.7f}\n[END]\n", number,
      length, radius);
}

/// G54 with its Z at -100 mm, in the control's format.
std::string offsets_of(const OneControl& control) {
  const std::string name = control.name;
  if (name == "linuxcnc") return "5220 1\n5221 0\n5222 0\n5223 -100.0\n";
  if (name == "fanuc") return "G10 L2 P1 X0. Y0. Z-100.\n";
  if (name == "siemens") return "$P_UIFR[1,Z,TR]=-100\n";
  return "BEGIN PRESET .PR MM\nNR  X    Y    Z\n1   0    0    -100\n[END]\n";
}

/// With what a program in mm begins.
const char* in_mm(const std::string& control) {
  return control == "fanuc" ? "O1\nG21\n" : control == "siemens" ? "G71\n" : "G21\n";
}

/// A line along y at x = 0 with the cutter to the right of it.
std::string wall_program(const OneControl& control, int tool) {
  const std::string name = control.name;
  if (name == "heidenhain")
    return fmt::format(
        "0 BEGIN PGM W MM\n1 TOOL CALL {} Z S9000\n2 L X+30 Y-30 R0 FMAX M3\n3 L Z+5 R0 FMAX\n"
        "4 L Z-5 F500\n5 L X+0 Y-20 RR F1000\n6 L Y+20\n7 L X+30 R0\n8 L Z+60 FMAX\n"
        "9 END PGM W MM\n",
        tool);
  const std::string length = name == "linuxcnc" ? fmt::format("G43 H{}\n", tool)
                             : name == "fanuc"  ? fmt::format("G43 H{} Z60.\n", tool)
                                                : "";
  const std::string radius = name == "siemens" ? "" : fmt::format(" D{}", tool);
  return fmt::format(
      "{}G90 G17 G94 G54\nT{} M6\nS9000 M3\n{}G0 X30. Y-30.\nZ5.\nG1 Z-5. F500.\n"
      "G42{} G1 X0. Y-20. F1000.\nY20.\nG40 X30.\nG0 Z60.\nM30\n",
      in_mm(name), tool, length, radius);
}

/// A wall or a floor on the three-axis machine.
class ToolTable : public testing::Test {
 protected:
  static constexpr const char* wall =
      "surface = \"rectangle\"\nlength_x_mm = 8\nlength_y_mm = 16\nvertices = 400\n"
      "turn_deg = [0, 90, 0]\n";
  static constexpr const char* floor =
      "surface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 4\nvertices = 400\n";

  static std::string tool(int number, const std::string& kind = "flat",
                          const std::string& more = "") {
    return fmt::format(
        "[[tool]]\nkind = \"{}\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = 100\n"
        "number = {}\n{}",
        kind, number, more);
  }
  std::string named_table(const OneControl& control, const char* file) const {
    return fmt::format("{{ file = \"{}\"{} }}", file,
                       *control.unit ? fmt::format(", unit = \"{}\"", control.unit) : "");
  }
  Scene scene(const std::string& tools, const char* part, const std::string& program) const {
    return read_scene(folder_.write(
        "s.toml", fmt::format("machine = \"{}machines/three_axis_table.toml\"\n{}[part]\n{}"
                              "[program]\n{}",
                              packaged("").string(), tools, part, program)));
  }
  std::string on_control(const OneControl& control, int tool, double length, double radius,
                         const std::string& text) const {
    folder_.write(std::string("p") + control.ending, text);
    folder_.write(control.table, table_of(control, tool, length, radius));
    folder_.write(control.offsets, offsets_of(control));
    return fmt::format("file = \"p{}\"\ndialect = \"{}\"\ntools = {}\noffsets = {}\n",
                       control.ending, control.name, named_table(control, control.table),
                       named_table(control, control.offsets));
  }
  std::string refusal(const std::string& tools, const char* part,
                      const std::string& program) const {
    return thrown_text<BadScene, BadInput>([&] { prepare(scene(tools, part, program)); });
  }
  SceneFolder folder_;
};

/// Least and most of a map that is cut everywhere.
std::pair<double, double> range_of(const cutting::Surface& surface) {
  for (const VertexStatus status : surface.status) EXPECT_EQ(status, VertexStatus::Cut);
  return {surface.residual.minCoeff(), surface.residual.maxCoeff()};
}

bool says(const std::vector<std::string>& warnings, const std::string& words) {
  return std::any_of(warnings.begin(), warnings.end(),
                     [&](const std::string& one) { return one.find(words) != std::string::npos; });
}

TEST_F(ToolTable, ARadiusThatIsBelievedTooLargeIsLeftOnTheWall) {
  constexpr double same = 1e-7;  // mm
  for (const double more : {0.005, -0.003, 0.0}) {
    for (const OneControl& control : four_tools) {
      SCOPED_TRACE(control.name);
      const Job job = prepare(scene(
          tool(7), wall, on_control(control, 7, 100.0, 5.0 + more, wall_program(control, 7))));
      const auto [least, most] = range_of(cut(job).surface);
      std::cout << fmt::format("[ measured ] {}: {:+.0f} um too large leaves {:.8f} to {:.8f} um\n",
                               control.name, more / units::um, least / units::um, most / units::um);
      EXPECT_NEAR(least, more, same);
      EXPECT_NEAR(most, more, same);
      EXPECT_EQ(says(job.warnings, "the control believes T7 to have a radius of"), more != 0.0);
    }
  }
}

TEST_F(ToolTable, AWarningHasTheFigures) {
  const Job job = prepare(
      scene(tool(7), wall, on_control(linuxcnc, 7, 99.998, 5.005, wall_program(linuxcnc, 7))));
  EXPECT_TRUE(says(job.warnings,
                   "the control believes T7 to have a length of 99.998 mm, 2 um less than the "
                   "true 100 mm, and a radius of 5.005 mm, 5 um more than the true 5 mm"))
      << (job.warnings.empty() ? "none" : job.warnings.front());
}

TEST_F(ToolTable, ALengthThatIsBelievedTooLongIsLeftOnTheFloor) {
  for (const OneControl& control : four_tools) {
    SCOPED_TRACE(control.name);
    std::string program = wall_program(control, 7);
    const bool words = std::string(control.name) == "heidenhain";
    // straight over the floor instead of along the wall
    const std::string head = program.substr(0, program.find(words ? "2 L" : "G0 X30."));
    program = words ? head +
                          "2 L X-30 Y+0 R0 FMAX M3\n3 L Z+5 R0 FMAX\n4 L Z+0 F500\n"
                          "5 L X+30 F1000\n6 L Z+60 FMAX\n7 END PGM W MM\n"
                    : head + "G0 X-30. Y0.\nZ5.\nG1 Z0. F500.\nX30. F1000.\nG0 Z60.\nM30\n";
    const Job job = prepare(scene(tool(7), floor, on_control(control, 7, 100.004, 5.0, program)));
    const auto [least, most] = range_of(cut(job).surface);
    EXPECT_NEAR(least, 0.004, 1e-9);
    EXPECT_NEAR(most, 0.004, 1e-9);
  }
}

/// A pass along x with the axis leaning by 10 deg, the tip commanded.
std::string leaning_pass(const OneControl& control) {
  const std::string name = control.name;
  if (name == "heidenhain")
    return "0 BEGIN PGM W MM\n1 TOOL CALL 7 Z S9000\n2 M128\n3 L X-9 Y+0 Z+95 A+10 C+0 R0 FMAX M3\n"
           "4 L Z+80.1 F500\n5 L X+9 F1000\n6 L Z+95 FMAX\n7 END PGM W MM\n";
  const std::string on = name == "siemens" ? "D1\nTRAORI\n" : "G43.4 H7\n";
  return fmt::format(
      "{}G90 G17 G94\nT7 M6\nS9000 M3\n{}G0 X-9. Y0. Z95. A10. C0.\nG1 Z80.1 F500.\nX9. "
      "F1000.\nG0 Z95.\nM30\n",
      in_mm(name), on);
}

TEST_F(ToolTable, ALengthIsBelievedWhereTheTipIsCommanded) {
  for (const OneControl& control : four_tools) {
    SCOPED_TRACE(control.name);
    const auto prepared = [&](double length) {
      folder_.write(std::string("p") + control.ending, leaning_pass(control));
      folder_.write(control.table, table_of(control, 7, length, 5.0));
      return prepare(read_scene(folder_.write(
          "s.toml",
          fmt::format(
              "machine = \"{}machines/gantry_cxyza.toml\"\n{}[part]\nsurface = \"rectangle\"\n"
              "length_x_mm = 10\nlength_y_mm = 2\nvertices = 100\nat_mm = [0, 0, 80]\n[program]\n"
              "file = \"p{}\"\ndialect = \"{}\"\ntools = {}\n",
              packaged("").string(), tool(7, "ball"), control.ending, control.name,
              named_table(control, control.table)))));
    };
    const Job job = prepared(100.004);
    const cutting::Surface right = cut(prepared(100.0)).surface, wrong = cut(job).surface;
    range_of(right);
    range_of(wrong);
    // the ball's cylinder along x, its centre moved along the axis of the tool
    const Vector3d axis = job.T_wt_nominal.back().linear().col(2);
    const auto height = [&](double y, double more) {
      const Vector3d centre = Vector3d(0, 0, 0.1) + (5.0 + more) * axis;
      return centre.z() - std::sqrt(25.0 - std::pow(y - centre.y(), 2));
    };
    double off = 0.0;
    for (Index i = 0; i < wrong.residual.size(); ++i) {
      const double y = job.design_w.vertices(i, 1);
      off = std::max(off, std::abs(wrong.residual[i] - height(y, 0.004)));
      off = std::max(off, std::abs(right.residual[i] - height(y, 0.0)));
    }
    EXPECT_NEAR(axis.z(), std::cos(10.0 * units::deg), 1e-12);
    EXPECT_LT(off, 1e-8);
  }
}

TEST_F(ToolTable, AToolThatTheTableHasNotIsRefusedAsTheControlDoes) {
  for (const OneControl& control : four_tools) {
    SCOPED_TRACE(control.name);
    const std::string said =
        refusal(tool(7), wall, on_control(control, 8, 100.0, 5.0, wall_program(control, 7)));
    EXPECT_HAS(said, std::string("p") + control.ending + ":");
    EXPECT_HAS(said, "tool");
  }
}

TEST_F(ToolTable, FaultsOfATableStandWithThoseOfTheScene) {
  folder_.write("p.ngc", wall_program(linuxcnc, 7));
  folder_.write("tool.tbl", "T7 P1 Z100 D10\nT8 P2 Z1O\n");
  const std::string program = "file = \"p.ngc\"\ntools = { file = \"tool.tbl\", unit = \"mm\" }\n";
  EXPECT_HAS(refusal(tool(7), wall, program), "tool.tbl:2:8: expected a number for Z");
  folder_.write("tool.tbl", "T7 P1 Z100 D10\n");
  EXPECT_HAS(refusal(tool(7), wall, "file = \"p.ngc\"\ntools = { file = \"tool.tbl\" }\n"),
             "tool.tbl:1:7: expected a unit");
  EXPECT_HAS(refusal(tool(7), wall, program + "tool_length_mm = { 2 = 80 }\n"),
             "either tool_length_mm or");
  folder_.write("o.var", "5224 10\n");
  EXPECT_HAS(
      refusal(tool(7), wall, "file = \"p.ngc\"\noffsets = { file = \"o.var\", unit = \"mm\" }\n"),
      "o.var:1:6: expected an offset of an axis of this machine");
  EXPECT_HAS(refusal("[tool]\nkind = \"flat\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = "
                     "100\n",
                     wall, program),
             "tool.number of every tool");
}

/// A plunge of 5 mm and a pass of 40 mm along x over the floor.
std::string one_pass() {
  return "G21 G90 G17 G94 G54\nT7 M6\nS9000 M3\nG43 H7\nG0 X-20 Y0\nZ5\nG1 Z0 F500\nX20 F1000\n"
         "G0 Z60\nM30\n";
}

TEST_F(ToolTable, LengthWearIsTheClosedForm) {
  // a ball: its centre rises along the pass, and the cylinder that it leaves rises with it
  folder_.write("p.ngc", one_pass());
  const std::string program = "file = \"p.ngc\"\nwork_offset.G54 = { Z_mm = -100 }\n";
  constexpr double plunge = 5.0, pass = 40.0, lost = 0.01, radius = 5.0;
  const Job job =
      prepare(scene(tool(7, "ball", "wear = { way_mm = 45, length_um = 10 }\n"), floor, program));
  EXPECT_TRUE(says(job.warnings, "T7 is assumed to lose 0 um of its radius and 10 um"));
  const cutting::Surface surface = cut(job).surface;
  const double slope = lost / (plunge + pass);
  double off = 0.0;
  for (Index i = 0; i < surface.residual.size(); ++i) {
    ASSERT_EQ(surface.status[std::size_t(i)], VertexStatus::Cut);
    const double x = job.design_w.vertices(i, 0), y = job.design_w.vertices(i, 1);
    const double z = slope * (plunge + x + 20.0) + radius -
                     std::sqrt(radius * radius - y * y) * std::sqrt(1.0 + slope * slope);
    off = std::max(off, std::abs(surface.residual[i] - z));
  }
  std::cout << fmt::format("[ measured ] length wear is {:.3g} nm from the closed form\n",
                           off / units::nm);
  EXPECT_LT(off, 1e-8);
}

TEST_F(ToolTable, RadiusWearIsWithinItsBound) {
  folder_.write("p.ngc",
                "G21 G90 G17 G94 G54\nT7 M6\nS9000 M3\nG43 H7\nG0 X5 Y-20\nZ5\nG1 Z-5 F600\n"
                "Y20 F1200\nG0 Z60\nM30\n");
  const std::string program = "file = \"p.ngc\"\nwork_offset.G54 = { Z_mm = -100 }\n";
  // a second to plunge, two along the wall
  constexpr double lost = 0.003;
  const Job job =
      prepare(scene(tool(7, "flat", "wear = { time_min = 0.05, radius_um = 3 }\n"), wall, program));
  const Cut made = cut(job);
  ASSERT_EQ(made.wear.size(), 1u);
  EXPECT_NEAR(made.wear[0].radius, lost, 1e-12);
  EXPECT_NEAR(made.wear[0].use.distance, 50.0, 1e-9);
  EXPECT_EQ(made.wear[0].within, wear_tolerance);
  double off = 0.0, error_free = 0.0;
  const cutting::Surface perfect = cut_error_free(job).surface;
  for (Index i = 0; i < made.surface.residual.size(); ++i) {
    ASSERT_EQ(made.surface.status[std::size_t(i)], VertexStatus::Cut);
    const double y = job.design_w.vertices(i, 1);
    // of the three seconds, those until the cutter is beside the place
    const double share = (1.0 + 2.0 * (y + 20.0) / 40.0) / 3.0;
    off = std::max(off, std::abs(made.surface.residual[i] - lost * share));
    error_free = std::max(error_free, std::abs(perfect.residual[i]));
  }
  std::cout << fmt::format(
      "[ measured ] radius wear of 3 um is {:.4g} nm from the line (bound {} "
      "nm, and {:.2g} nm of the slope)\n",
      off / units::nm, wear_tolerance / units::nm,
      0.5 * 5.0 * std::pow(lost * 2.0 / 3.0 / 40.0, 2) / units::nm);
  EXPECT_LT(off, wear_tolerance + 1e-7);
  EXPECT_LT(error_free, 1e-9);
}

TEST_F(ToolTable, PiecesOfAWornSweepFollowTheCutter) {
  folder_.write("p.ngc", one_pass());
  const Job job = prepare(scene(tool(7, "ball", "wear = { way_mm = 45, radius_um = 100 }\n"), floor,
                                "file = \"p.ngc\"\nwork_offset.G54 = { Z_mm = -100 }\n"));
  EXPECT_TRUE(says(job.warnings, "its sweep follows the worn radius within 0.125 um"));
  const std::vector<double> shares = wear_fractions(tool_run(job), job.samples);
  EXPECT_DOUBLE_EQ(shares.front(), 0.0);
  EXPECT_NEAR(shares.back(), 1.0, 1e-12);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  const auto pieces = worn_segments(job.scene.tool, shares, job.samples, job.T_wt_nominal);
  EXPECT_NEAR(double(pieces.size()), double(max_wear_segments), 1.0);
  for (std::size_t k = 1; k < pieces.size(); ++k) {
    EXPECT_EQ(pieces[k].samples.states.front().time_s, pieces[k - 1].samples.states.back().time_s);
    const auto& cutter = std::get<cutting::Cutter>(pieces[k].tool);
    EXPECT_EQ(cutter.corner_radius, cutter.radius);
    EXPECT_LT(cutter.radius, std::get<cutting::Cutter>(pieces[k - 1].tool).radius);
  }
}

TEST_F(ToolTable, WearGoesOnWhenAToolComesBack) {
  const auto pass = [](int number, double y) {
    return fmt::format("T{0} M6\nG43 H{0}\nG0 X-20 Y{1}\nZ5\nG1 Z0 F500\nX20 F1000\nG0 Z60\n",
                       number, y);
  };
  folder_.write(
      "p.ngc", "G21 G90 G17 G94 G54\nS9000 M3\n" + pass(7, -1) + pass(8, 0) + pass(7, 1) + "M30\n");
  const Job job =
      prepare(scene(tool(7, "ball", "wear = { way_mm = 90, length_um = 10 }\n") + tool(8, "ball"),
                    floor, "file = \"p.ngc\"\nwork_offset.G54 = { Z_mm = -100 }\n"));
  ASSERT_EQ(job.segments.size(), 3u);
  EXPECT_NEAR(job.segments[0].previous_use.distance, 0.0, 1e-12);
  EXPECT_NEAR(job.segments[1].previous_use.distance, 0.0, 1e-12);
  EXPECT_NEAR(job.segments[2].previous_use.distance, 45.0, 1e-9);
  const std::vector<WornTool> worn = worn_tools(tool_runs(job));
  ASSERT_EQ(worn.size(), 1u);
  EXPECT_NEAR(worn[0].length, 0.01, 1e-12);
}

}  // namespace
}  // namespace abbe::sim
