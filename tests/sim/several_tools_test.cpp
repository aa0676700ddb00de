#include "cutting/stock/stock.h"
#include "sim/cut/placement.h"
#include "sim/cut/placement_suggestion.h"
#include "sim/cut/tool_poses.h"
#include "sim/loop/correctors.h"
#include "sim/loop/learn.h"
#include "tests/sim/odd_scenes.h"
#include "tests/sim/refusal.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

const std::string t1 =
    "name = \"finisher\"\nkind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = 100\n"
    "number = 1\n";
const std::string t2 =
    "name = \"bull\"\nkind = \"bull\"\nradius_mm = 4\ncorner_radius_mm = 1\nflank_length_mm = "
    "20\nlength_mm = 80\nnumber = 2\n";
const std::string flat_part =
    "surface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\nvertices = 900\n";
const std::string crooked =
    "[errors]\nEXX_um = 4\nEZX = { kind = \"polynomial\", coefficients_um = [3, 20], half_range_mm "
    "= 100 }\nEBX_urad = 150\nEAY_urad = -120\nEBZ_urad = 90\nEC0Y_urad = 60\n";

std::string listed(const std::vector<std::string>& tools) {
  std::string text;
  for (const std::string& tool : tools) text += "[[tool]]\n" + tool;
  return text;
}

/// Passes of one tool along x at heights that fall a little from pass to pass.
std::string passes(int tool, double from, double to, double z) {
  std::string text = fmt::format("T{0} M6\nS9000 M3\nG43 H{0}\n", tool);
  for (double y = from; y <= to + 1e-9; y += 0.5)
    text += fmt::format("G0 X-9 Y{0}\nG0 Z5\nG1 Z{1} F500\nG1 X9 F1000\nG0 Z60\n", y, z - 0.01 * y);
  return text;
}

/// Passes of one tool with its axis tilted and turning a little, by G43.4.
std::string tilted(int tool, double from, double to, double feed) {
  std::string text = fmt::format("T{0} M6\nS12000 M3\nG43.4 H{0}\n", tool);
  for (double y = from; y <= to + 1e-9; y += 0.5)
    text += fmt::format("G0 X-9 Y{0} A{1} C{1}\nG0 Z85\nG1 Z80 F500\nG1 X9 F{3} A{2}\nG0 Z95\n", y,
                        10 + y, 12 + y, feed);
  return text;
}

/// A flat on the three-axis machine whose words are those of the tip, by G43 and G54.
class SeveralTools : public testing::Test {
 protected:
  std::string scene(const std::string& tools, const std::string& program,
                    const std::string& more = "") const {
    folder_.write("p.ngc", "G21 G90 G17 G94\nG54\n" + program + "M30\n");
    return fmt::format(
        "machine = \"{}machines/three_axis_table.toml\"\n{}[part]\n{}[program]\nfile = "
        "\"p.ngc\"\nwork_offset.G54 = {{ Z_mm = -100 }}\n{}",
        packaged("").string(), tools, flat_part, more);
  }
  Job job(const std::string& tools, const std::string& program,
          const std::string& more = "") const {
    return prepare(read_scene(folder_.write("s.toml", scene(tools, program, more))));
  }
  Job on_gantry(const std::string& tools, const std::string& program, const std::string& top = "",
                const std::string& more = "") const {
    folder_.write("p.ngc", "G21 G90 G17 G94\n" + program + "M30\n");
    return prepare(read_scene(folder_.write(
        "s.toml",
        fmt::format("machine = \"{0}machines/gantry_cxyza.toml\"\n{1}{2}[part]\n{3}at_mm = "
                    "[0, 0, 80]\n[program]\nfile = \"p.ngc\"\n{4}",
                    packaged("").string(), top, tools, flat_part, more))));
  }
  std::string refusal(const std::string& text) const {
    return thrown_text<BadScene, BadInput>(
        [&] { prepare(read_scene(folder_.write("s.toml", text))); });
  }
  void expect_refused(const std::string& text, const std::string& words) const {
    const std::string said = refusal(text);
    EXPECT_HAS(said, words);
  }
  SceneFolder folder_;
};

/// The least residual of maps of one design, vertex by vertex; NaN where none cuts.
VectorXd min_of(const std::vector<cutting::Surface>& surfaces) {
  VectorXd least = VectorXd::Constant(surfaces.front().residual.size(), none);
  for (const cutting::Surface& one : surfaces)
    for (Index i = 0; i < least.size(); ++i)
      if (one.status[std::size_t(i)] == cutting::VertexStatus::Cut &&
          !(least[i] <= one.residual[i]))
        least[i] = one.residual[i];
  return least;
}

TEST_F(SeveralTools, TheOffsetOfAMovedProgramIsThatAtWhichItWasProgrammed) {
  const std::string program = passes(1, -7, 1, 0.0) + passes(2, -1, 7, 0.02);
  const auto moved = [&](const Vector3d& by) {
    std::string text = scene(listed({t1, t2}), program);
    const std::string offset = "{ Z_mm = -100 }";
    text.replace(
        text.find(offset), offset.size(),
        fmt::format("{{ X_mm = {}, Y_mm = {}, Z_mm = {} }}", by.x(), by.y(), by.z() - 100.0));
    return prepare(read_scene(folder_.write("s.toml", text)));
  };
  EXPECT_TRUE(placement(moved({0, 0, 0})).warnings.empty()) << "it fits already";
  for (const Vector3d& by : {Vector3d(0, 0, 8), Vector3d(0, 0, -3), Vector3d(40, 0, 0),
                             Vector3d(0, -30, 0), Vector3d(0, 0, 60)}) {
    const auto out = placement_suggestion(moved(by));
    ASSERT_TRUE(out) << by.transpose();
    std::cout << by.transpose() << ": " << out->words << ", " << 100.0 * out->reach.reached_fraction
              << " %\n";
    const std::array<double, 3> right = {0.0, 0.0, -100.0};
    for (int k = 0; k < 3; ++k) {
      const std::string name = fmt::format(" {} = ", "XYZ"[k]);
      const auto at = out->words.find(name);
      if (at == std::string::npos)
        EXPECT_EQ(by[k], 0.0) << out->words;
      else
        EXPECT_NEAR(std::stod(out->words.substr(at + name.size())), right[std::size_t(k)], 0.1)
            << out->words;
    }
    EXPECT_GT(out->reach.reached_fraction, 0.99) << out->words;
  }
}

TEST_F(SeveralTools, EachMoveIsCutWithItsToolAndTheLeastIsLeft) {
  const std::string first = passes(1, -7, 1, 0.0), second = passes(2, -1, 7, 0.02);
  const Job both = job(listed({t1, t2}), first + second, crooked);
  EXPECT_TRUE(both.warnings.empty()) << both.warnings.front();
  ASSERT_EQ(both.segments.size(), 2u);
  // the second has another lever to the errors of angle, and is another cutter
  for (const bool error_free : {true, false}) {
    const auto surface = [&](const Job& one) {
      return (error_free ? cut_error_free(one) : cut(one)).surface;
    };
    const cutting::Surface together = surface(both);
    const cutting::Surface alone_1 = surface(job("[tool]\n" + t1, first, crooked));
    const cutting::Surface alone_2 = surface(job("[tool]\n" + t2, second, crooked));
    const VectorXd expected = min_of({alone_1, alone_2});
    int by_first = 0, by_second = 0;
    double largest = 0.0;
    const int second_line = 2 + int(std::ranges::count(first, '\n'));
    for (Index i = 0; i < expected.size(); ++i) {
      ASSERT_EQ(together.status[std::size_t(i)], cutting::VertexStatus::Cut) << i;
      largest = std::max(largest, std::abs(together.residual[i] - expected[i]));
      const bool is_first = alone_1.residual[i] <= expected[i];
      EXPECT_EQ(together.cut_line[std::size_t(i)] <= second_line, is_first) << i;
      ++(is_first ? by_first : by_second);
    }
    std::cout << by_first << " vertices by T1, " << by_second << " by T2, at most " << largest
              << " mm from the least of each alone\n";
    EXPECT_LT(largest, 1e-9);
    EXPECT_GT(by_first, 50);
    EXPECT_GT(by_second, 200);
  }
}

TEST_F(SeveralTools, ALongerToolIsSeenWhereTheMachineLeans) {
  // the same passes with the same cutter, 60 mm longer: EBZ turns the ram about Y, so it shifts
  // along x
  const std::string longer =
      "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = "
      "160\nnumber = 2\n";
  const std::string lean = "[errors]\nEBZ_urad = 100\n";
  const Job both = job(listed({t1, longer}), passes(1, -7, 0, 0.0) + passes(2, 0, 7, 0.0), lean);
  const Cut made = cut(both);
  ASSERT_EQ(both.segments.size(), 2u);
  const auto tip_error = [&](const Segment& part) {
    const Commands commands = segment_commands(part);
    const std::vector<kinematics::Pose> T_wt = tool_poses(part, commands, {});
    return (T_wt.back().translation() - part.T_wt_nominal.back().translation()).norm();
  };
  const double difference = std::abs(tip_error(both.segments[1]) - tip_error(both.segments[0]));
  EXPECT_NEAR(difference, 100e-6 * 60.0, 1e-6);  // mm
  EXPECT_GT(made.tip_error.max, 0.0);
}

TEST_F(SeveralTools, ACompensatorCorrectsEachByItsOwnLength) {
  const std::string bull =
      "kind = \"bull\"\nradius_mm = 4\ncorner_radius_mm = 1\nflank_length_mm = "
      "20\nlength_mm = 58\nnumber = 2\n";
  const std::string program = tilted(1, -7, 1, 1000) + tilted(2, -1, 7, 1000);
  const Job both =
      on_gantry(listed({t1, bull}), program,
                fmt::format("errors = \"{}errors/gantry_typical.toml\"\n", packaged("").string()));
  const cutting::Surface wanted = cut_error_free(both).surface;
  const Apart before = apart(cut(both).surface, wanted);
  const Apart after = apart(cut(both, parse_case("perfect-iterated-ideal")).surface, wanted);
  std::cout << "uncompensated " << before.rms << " mm RMS, compensated " << after.rms
            << " mm from the error-free map\n";
  EXPECT_GT(before.rms, 5e-3);
  EXPECT_LT(after.rms, 1e-6);  // by the length of the other, 20 urad would leave 1 um
  EXPECT_EQ(after.unlike, 0);
}

TEST_F(SeveralTools, ToolsThatAreAlikeAreOne) {
  const std::string alike =
      "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = 100\n";
  const std::string play = crooked + "EYY = { kind = \"backlash\", half_um = 6 }\n";
  const std::string first = passes(1, -7, -2, 0.0), second = passes(2, -1.5, 3, 0.0),
                    third = passes(1, 3.5, 7, 0.0);
  const Job three =
      job(listed({alike + "number = 1\n", alike + "number = 2\n"}), first + second + third, play);
  ASSERT_EQ(three.segments.size(), 3u);
  std::string program = first + second + third;
  for (std::size_t at; (at = program.find("T2 M6")) != std::string::npos;) program[at + 1] = '1';
  for (std::size_t at; (at = program.find("H2")) != std::string::npos;) program[at + 1] = '1';
  const Job one = job("[tool]\n" + alike + "number = 1\n", program, play);
  for (const bool error_free : {true, false}) {
    const cutting::Surface a = error_free ? cut_error_free(three).surface : cut(three).surface;
    const cutting::Surface b = error_free ? cut_error_free(one).surface : cut(one).surface;
    const Apart by = apart(a, b);
    EXPECT_EQ(by.vertices, 900);
    EXPECT_LT(by.max, 1e-9);
    EXPECT_EQ(a.cut_line, b.cut_line);
  }
}

TEST_F(SeveralTools, TheTipOfEachIsCountedByItsOwnChain) {
  // under G43.4 the words are the tip of whatever tool runs
  const std::string ball = "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\n";
  const Job two = on_gantry(
      listed({ball + "length_mm = 100\nnumber = 1\n", ball + "length_mm = 63\nnumber = 2\n"}),
      tilted(1, -7, 0, 1000) + tilted(2, 0.5, 7, 1000));
  const Job one = on_gantry("[tool]\n" + ball + "length_mm = 100\nnumber = 1\n",
                            tilted(1, -7, 0, 1000) + tilted(1, 0.5, 7, 1000));
  const Apart by = apart(cut_error_free(two).surface, cut_error_free(one).surface);
  std::cout << by.vertices << " vertices, at most " << by.max << " mm apart\n";
  EXPECT_EQ(by.vertices, 900);
  EXPECT_LT(by.max, 1e-6);  // turning moves are sampled for either length
  EXPECT_EQ(by.unlike, 0);
}

TEST_F(SeveralTools, HeatAndSignalsGoOnFromOneToTheNext) {
  const std::string ball =
      "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = 100\n";
  const std::string heat = fmt::format(
      "thermal = \"{}errors/gantry_heat.toml\"\nhistory = [{{ duration_min = 5, speed_rpm = 9000 "
      "}}]\n",
      packaged("").string());
  const std::string rows = "[signals]\ninterval_s = 5\nhistory_interval_s = 60\n";
  const Job two = on_gantry(listed({ball + "number = 1\n", ball + "number = 2\n"}),
                            tilted(1, -7, 0, 100) + tilted(2, 0.5, 7, 100), heat, rows);
  const Job one = on_gantry("[tool]\n" + ball + "number = 1\n",
                            tilted(1, -7, 0, 100) + tilted(1, 0.5, 7, 100), heat, rows);
  const Cut a = cut(two), b = cut(one);
  EXPECT_GT(apart(b.surface, cut_error_free(one).surface).max, 1e-3) << "heat shows";
  EXPECT_LT(apart(a.surface, b.surface).max, 1e-9);
  EXPECT_NEAR(a.tip_error.rms, b.tip_error.rms, 1e-3 * b.tip_error.rms);
  EXPECT_EQ(a.signals.columns, b.signals.columns);
  // rows every 5 s; the second tool begins with one of its own
  EXPECT_NEAR(double(a.signals.rows.rows()), double(b.signals.rows.rows()), 2.0);
  for (Index i = 1; i < a.signals.rows.rows(); ++i)
    EXPECT_LE(a.signals.rows(i - 1, 0), a.signals.rows(i, 0)) << "time";
}

TEST_F(SeveralTools, WhatTheyDoNotGoWithIsRefused) {
  const std::string both = listed({t1, t2});
  const std::string program = passes(1, -7, 0, 0.0) + passes(2, 0, 7, 0.0);
  const auto with_length = [](std::string words, const std::string& from, const std::string& to) {
    return words.replace(words.find(from), from.size(), to);
  };
  expect_refused(
      scene(both, passes(1, -7, 0, 0.0) + with_length(passes(3, 0, 7, 0.0), "H3", "H1")),
      "p.ngc:81: expected a tool described by a [[tool]] of the scene (T1, T2), seen T3");
  expect_refused(scene("[tool]\n" + t1, with_length(program, "H2", "H1")),
                 "expected T1, which is the scene's tool.number, seen T2: describe it in a "
                 "[[tool]] of its own, or set tool.number = 2 if it is the scene's tool");
  expect_refused(scene(listed({t1, t1}), program),
                 "expected a tool.number that no other tool has, seen 1 again");
  expect_refused(scene(listed({t1,
                               "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = "
                               "100\n"}),
                       program),
                 "expected tool.number for each of several tools, seen a tool without a number");
  expect_refused(
      scene(listed({t1, "kind = \"nose\"\nradius_mm = 1\nlength_mm = 30\nnumber = 2\n"}), program),
      "expected tools that are all for milling or all for turning, seen one of each kind");
  expect_refused(scene(both, program, "[control]\ntool_length_mm = 99\n"),
                 "expected one tool with tool_length_mm");
  expect_refused(
      fmt::format("machine = \"{}machines/gantry_cxyza.toml\"\n{}[part]\n{}[program]\n"
                  "generator = \"raster\"\n",
                  packaged("").string(), both, flat_part),
      "expected one tool for a generator; several tools need a program file, seen 2 tools");
}

// The tables of a control know no tools: they are made for the tip of the first, and move the axes
// alike under the second, whose tip keeps the difference of both errors.
TEST_F(SeveralTools, TablesOfTheFirstActUnderAll) {
  const std::string first = passes(1, -7, 1, 0.0);
  const CaseDescription compensator = parse_case("perfect-iterated-table");
  for (const char* format : {"", "format = \"siemens\"\n"}) {
    const std::string more =
        crooked +
        "[compensation.table]\nconstant = true\nreference = { X_mm = 0, Y_mm = 0, "
        "Z_mm = 0 }\n" +
        format;
    const Job both = job(listed({t1, t2}), first + passes(2, -1, 7, 0.02), more);
    const Commands commands = compensate(both, compensator);
    ASSERT_EQ(commands.segments.size(), 2u);
    ASSERT_FALSE(commands.warnings.empty());
    EXPECT_HAS(commands.warnings.front(), "the tables correct the tip of T1");
    const Job alone = job("[tool]\n" + t1, first, more);
    const ControlTables tables =
        control_tables(make_table_view(alone), learn_correction(alone, compensator).corrector, {});
    double largest = 0.0, apart = 0.0, longest = 0.0;
    for (std::size_t tool = 0; tool < 2; ++tool) {
      const auto& states = both.segments[tool].samples.states;
      for (std::size_t i = 0; i < states.size(); ++i) {
        const kinematics::AxisVector expected = compensation::correction(
            std::get<compensation::ParameterTables>(tables.values), states[i]);
        largest = std::max(largest, expected.norm());
        apart = std::max(apart, (commands.segments[tool].correction[i] - expected).norm());
      }
    }
    for (std::size_t i = 0; i < both.segments[1].samples.states.size(); ++i) {
      const auto tip_error = [&](const Truth& truth, const Machine& machine) {
        const kinematics::AxisState& state = both.segments[1].samples.states[i];
        return Vector3d(tool_in_workpiece(truth, state).translation() -
                        machine.nominal.tool_in_workpiece(state.q).translation());
      };
      longest = std::max(longest, (tip_error(both.segments[1].truth, both.segments[1].machine) -
                                   tip_error(both.segments[0].truth, both.segments[0].machine))
                                      .norm());
    }
    std::cout << "corrections of up to " << largest << " mm, " << apart
              << " mm from those of the first tool alone; the second has another error by "
              << longest << " mm\n";
    EXPECT_GT(largest, 5e-3);
    EXPECT_LT(apart, 1e-12);
    EXPECT_GT(longest, 2e-3) << "so tables for its own tip would be others";
    // The scene may name the second instead.
    Job second = both;
    second.scene.compensation.table.tool = 2;
    const Commands others = compensate(second, compensator);
    EXPECT_HAS(others.warnings.front(), "the tables correct the tip of T2, 80 mm long");
    // Constant offsets over 20 mm of 150 and 120 urad, which the tables of this control cannot
    // have.
    const double changed =
        (others.segments[0].correction[0] - commands.segments[0].correction[0]).norm();
    EXPECT_EQ(changed > 1e-3, std::string(format).empty()) << changed;
  }
  expect_refused(scene(listed({t1, t2}), first, "[compensation.table]\ntool = 3\n"),
                 "expected the tool.number of a tool of the scene, seen 3");
}

const std::string block =
    "[cutting]\nblank = \"box\"\nlower_mm = [-10, -10, -5]\nupper_mm = [10, 10, 1]\nspacing_mm = "
    "0.25\n";
std::string material(double K_tc) {
  return fmt::format(
      "name = \"alloy\"\nsource = \"test\"\nK_tc_N_per_mm2 = {}\nK_rc_N_per_mm2 = 300\n"
      "K_ac_N_per_mm2 = 100\nK_te_N_per_mm = 10\nK_re_N_per_mm = 8\nK_ae_N_per_mm = 2\n",
      K_tc);
}
const std::string soft_tool = "[compliance.tool]\nstiffness_N_per_um = [20, 20, 100]\n";

TEST_F(SeveralTools, TheStockOfAllIsWhatEachLeaves) {
  const std::string first = passes(1, -7, 1, 0.0), second = passes(2, -1, 7, 0.02);
  const auto stock = [&](const std::string& tools, const std::string& program) {
    return job(tools, program, block).nominal_process;
  };
  const Process both = stock(listed({t1, t2}), first + second);
  const Process alone_1 = stock("[tool]\n" + t1, first), alone_2 = stock("[tool]\n" + t2, second);
  const cutting::Stock blank =
      cutting::make_stock(cutting::BoxBlank{{-10, -10, -5}, {10, 10, 1}},
                          Eigen::Isometry3d::Identity(), {.spacing = 0.25});
  const double removed = cutting::volume(blank) - cutting::volume(*both.stock);
  EXPECT_NEAR(totals(both).removed, removed, 1e-6 * removed);
  EXPECT_LT(totals(both).removed, totals(alone_1).removed + totals(alone_2).removed - 5.0)
      << "both reach the same material";
  std::mt19937 random(50);  // seed
  std::uniform_real_distribution<double> across(-9.5, 9.5), up(-1.0, 0.99);
  int in_material = 0, in_air = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Vector3d point(across(random), across(random), up(random));
    const double expected =
        std::min(cutting::depth(*alone_1.stock, point), cutting::depth(*alone_2.stock, point));
    if (std::abs(expected) < 0.3) continue;  // the interpolation of depths is no intersection
    ++(expected > 0.0 ? in_material : in_air);
    EXPECT_EQ(cutting::depth(*both.stock, point) > 0.0, expected > 0.0) << point.transpose();
  }
  std::cout << in_material << " points in material, " << in_air << " in air, " << removed
            << " mm^3 removed\n";
  EXPECT_GT(std::min(in_material, in_air), 500);
}

TEST_F(SeveralTools, EachCutsWithItsOwnFlutesMaterialAndStiffness) {
  // beside each other, so that the second meets the blank too
  const std::string first = passes(1, -7, -3, 0.0), second = passes(2, 5, 7, 0.0);
  const std::string own = t2 +
                          "cutting_edges = { flutes = 4, helix_deg = 10 }\ncompliance = { "
                          "stiffness_N_per_um = [5, 5, 50] }\n[tool.material]\n" +
                          material(900);
  const Job both =
      job(listed({t1, own}), first + second, block + soft_tool + "[material]\n" + material(600));
  const Job alone_1 =
      job("[tool]\n" + t1, first, block + soft_tool + "[material]\n" + material(600));
  const Job alone_2 = job("[tool]\n" + t2, second,
                          block +
                              "flutes = 4\nhelix_deg = 10\n[compliance.tool]\n"
                              "stiffness_N_per_um = [5, 5, 50]\n[material]\n" +
                              material(900));
  const Process process = cut(both).process;
  ASSERT_EQ(process.part_starts.size(), 2u);
  std::size_t part = 0;
  for (const Job* alone : {&alone_1, &alone_2}) {
    const auto forces = [](const Process& one) {
      std::vector<double> loaded;
      for (const ProcessStep& step : one.steps)
        if (!step.load.tool_wrench_t.isZero(0.0))
          loaded.push_back(step.load.tool_wrench_t.head<3>().norm());
      return loaded;
    };
    const std::vector<double> seen = forces(part_process(process, part++)),
                              expected = forces(cut(*alone).process);
    ASSERT_EQ(seen.size(), expected.size());
    ASSERT_GT(seen.size(), 50u);
    double largest = 0.0, apart = 0.0;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      largest = std::max(largest, expected[i]);
      apart = std::max(apart, std::abs(seen[i] - expected[i]));
    }
    std::cout << "T" << part << ": " << seen.size() << " loaded steps, at most " << largest
              << " N, off by " << apart << " N\n";
    EXPECT_LT(apart, 1e-6 * largest);
  }
}

TEST_F(SeveralTools, TheCompensatedProgramIsOneFileThatCutsWhatIsSaid) {
  const std::string force = block + soft_tool + "[material]\n" + material(600);
  const std::string program = passes(1, -7, 1, 0.0) + passes(2, -1, 7, 0.02);
  // the three axes of this machine cannot correct a tilted tool
  const std::string straight =
      "[errors]\nEXX_um = 4\nEZX = { kind = \"polynomial\", coefficients_um = [3, 20], "
      "half_range_mm = 100 }\n";
  const Job both = job(listed({t1, t2}), program, straight + force);
  const cutting::Surface wanted = cut_error_free(both).surface;
  const Apart before = apart(cut(both).surface, wanted);
  const Apart ideal = apart(cut(both, parse_case("perfect-iterated-ideal")).surface, wanted);
  const Cut rewritten = cut(both, parse_case("perfect-iterated-program"));
  const Apart after = apart(rewritten.surface, wanted);
  std::cout << "uncompensated " << before.rms << " mm RMS from the error-free map, ideal "
            << ideal.rms << ", rewritten " << after.rms << '\n';
  EXPECT_GT(before.rms, 3e-3);
  EXPECT_LT(ideal.rms, 2e-5);
  EXPECT_LT(after.rms, 1.5e-4);  // the words have 0.1 um
  EXPECT_NE(rewritten.rewritten_program.find("T2 M6"), std::string::npos);
  // the written file as the program of the scene, without a compensator
  folder_.write("p.ngc", rewritten.rewritten_program);
  const Job file = prepare(read_scene(folder_.path() / "s.toml"));
  ASSERT_EQ(file.segments.size(), 2u);
  const Apart read = apart(cut(file).surface, rewritten.surface);
  std::cout << "the file cuts within " << read.max << " mm of what was said\n";
  EXPECT_LT(read.max, 1e-6);
}

TEST_F(SeveralTools, TheCompensatedProgramCommandsTheTipOfEach) {
  const std::string bull =
      "kind = \"bull\"\nradius_mm = 4\ncorner_radius_mm = 1\nflank_length_mm = "
      "20\nlength_mm = 58\nnumber = 2\n";
  const Job both =
      on_gantry(listed({t1, bull}), tilted(1, -7, 1, 1000) + tilted(2, -1, 7, 1000),
                fmt::format("errors = \"{}errors/gantry_typical.toml\"\n", packaged("").string()));
  const Cut rewritten = cut(both, parse_case("perfect-iterated-program"));
  const Apart after = apart(rewritten.surface, cut_error_free(both).surface);
  std::cout << "compensated " << after.rms << " mm from the error-free map\n";
  EXPECT_LT(after.rms, 1.5e-4);
  for (const char* words : {"G43.4 H1", "G43.4 H2", "T2 M6"})
    EXPECT_NE(rewritten.rewritten_program.find(words), std::string::npos) << words;
  folder_.write("p.ngc", rewritten.rewritten_program);
  const Apart read =
      apart(cut(prepare(read_scene(folder_.path() / "s.toml"))).surface, rewritten.surface);
  EXPECT_LT(read.max, 1e-6);
}

TEST_F(SeveralTools, AnIndexBeyondTheListIsAnsweredWithTheNumbersOfAll) {
  const std::string text = scene(listed({t1, t2}), passes(1, -4, 4, 0));
  const auto file = folder_.write("s.toml", text);
  const auto changed = [&](const std::string& path) { return read_scene(file, {{path, "3"}}); };
  EXPECT_EQ(refusal_by([&] { changed("tool.2.radius_mm"); }),
            "--set tool.2.radius_mm=3: expected an index from 0 to 1 in tool.2.radius_mm, as lists "
            "are numbered from 0; tool.0 has number 1, tool.1 has number 2, seen 2");
  EXPECT_EQ(
      std::get<cutting::Cutter>(changed("tool.1.radius_mm").additional_tools.at(0).nominal).radius,
      3.0);
}

TEST_F(SeveralTools, ALengthThatIsNotTheToolsIsSaid) {
  std::string program = passes(1, -7, 0, 0.0) + passes(2, 0, 7, 20.0);
  program.replace(program.find("H2"), 2, "H1");
  const Job wrong = job(listed({t1, t2}), program);
  ASSERT_FALSE(wrong.warnings.empty());
  EXPECT_HAS(wrong.warnings.front(), "T2 runs with the length H1 of G43 instead of its own");
  // the tip then stands 20 mm off
  EXPECT_NEAR(wrong.segments[1].T_wt_nominal.back().translation().z(), 60.0 + 20.0, 1e-9);
}

TEST_F(SeveralTools, AProgramAboveThePartIsHeldAgainstItWithEveryTool) {
  // the plunges begin at Z5; beside the part it is the corner of T2 that would touch it first
  const std::string high = passes(1, -7, 0, 40.0) + passes(2, 0, 7, 30.0);
  const Placement found = placement(job(listed({t1, t2}), high));
  ASSERT_TRUE(found.fault);
  EXPECT_HAS(std::string(found.fault->what()),
             "seen the lowest cut is 5.0 mm above the part; with G54 Z = -106 (now -100) "
             "it touches")
      << found.fault->what();
}

TEST_F(SeveralTools, TheSceneIsWrittenWithAllOfThem) {
  const Scene read = read_scene(folder_.write(
      "s.toml", scene(listed({t1, t2}), passes(1, -7, 0, 0.0) + passes(2, 0, 7, 0.0))));
  ASSERT_EQ(read.additional_tools.size(), 1u);
  EXPECT_EQ(read.additional_tools.front().number, 2);
  EXPECT_EQ(read.additional_tools.front().name, "bull");
  const Scene again = read_scene(folder_.write("again.toml", read.resolved));
  ASSERT_EQ(again.additional_tools.size(), 1u);
  EXPECT_EQ(again.additional_tools.front().length, 80.0);
}

}  // namespace
}  // namespace abbe::sim
