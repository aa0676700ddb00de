// Every machine of the library: it reads, its forward and inverse agree, `check` takes it; what is
// listed of all of them, and how programs pass their poles. Their location elements are in
// location_machines_test.cpp.

#include <nlohmann/json.hpp>
#include "kinematics/inverse_kinematics.h"
#include "kinematics/pose.h"
#include "sim/commands/scene_commands.h"
#include "sim/cut/bodies.h"
#include "sim/scene/fields.h"
#include "sim/scene/machine.h"
#include "sim/scene/program.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/safety/program_run.h"
#include "tests/sim/measured_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using safety::bytes;
using safety::run;

/// Names of the machines of the library, in their order.
std::vector<std::string> library_machines() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(packaged("machines")))
    names.push_back(entry.path().stem().string());
  std::ranges::sort(names);
  return names;
}

/// A machine of the library as its file describes it.
MachineDescription described(const std::string& name) {
  InputErrors input_errors;
  const MachineDescription machine =
      read_machine(read_toml_file(packaged("machines/" + name + ".toml")), input_errors);
  for (const BadInput& fault : input_errors.list()) ADD_FAILURE() << fault.what();
  return machine;
}

Chain library_chain(const MachineDescription& machine) {
  kinematics::Pose T_st = kinematics::Pose::Identity();
  T_st.translation().z() = -80.0;
  return {machine.joints, machine.T_bw, machine.T_bs * T_st};
}

class LibraryMachine : public testing::TestWithParam<std::string> {};

TEST_P(LibraryMachine, SaysItsSourceAndItsSizes) {
  const std::string text = bytes(packaged("machines/" + GetParam() + ".toml"));
  EXPECT_TRUE(text.starts_with("# ")) << "a comment at its head";
  const std::string head = text.substr(0, text.find("\nname"));
  EXPECT_HAS(head, "typical values") << "what is chosen is said to be";
  EXPECT_HAS(head, "chosen");
  const MachineDescription machine = described(GetParam());
  EXPECT_FALSE(machine.summary.empty());
  EXPECT_GE(machine.bodies.size(), 5u);
  std::set<int> carried;
  for (const MachineBody& body : machine.bodies) {
    EXPECT_FALSE(body.body.name.empty());
    carried.insert(body.joint.value_or(-1));
  }
  for (std::size_t j = 0; j < machine.joints.size(); ++j)
    if (machine.joints[j].motion != Motion::Spindle) {
      EXPECT_TRUE(carried.count(int(j))) << machine.joints[j].name << " has a block";
    }
  EXPECT_TRUE(carried.count(-1)) << "the bed has a block";
  for (const Joint& joint : machine.joints)
    if (joint.motion == Motion::Linear) {
      EXPECT_LT(joint.max - joint.min, 1e5) << joint.name << " has a travel";
    }
}

TEST_P(LibraryMachine, IsWrittenAndReadAsTheSame) {
  const MachineDescription machine = described(GetParam());
  const Node::Table written = machine_to_table(machine);
  InputErrors input_errors;
  const MachineDescription again = read_machine(Node{{}, written}, input_errors);
  EXPECT_TRUE(input_errors.empty());
  EXPECT_EQ(to_toml(Node{{}, machine_to_table(again)}), to_toml(Node{{}, written}));
  ASSERT_EQ(again.bodies.size(), machine.bodies.size());
  for (std::size_t i = 0; i < machine.bodies.size(); ++i) {
    EXPECT_EQ(again.bodies[i].joint, machine.bodies[i].joint);
    EXPECT_EQ(body_mesh(again.bodies[i].body).vertices, body_mesh(machine.bodies[i].body).vertices);
  }
}

TEST_P(LibraryMachine, IsMadeOfBodiesThatDoNotOverlapWhereAProgramBegins) {
  const MachineDescription machine = described(GetParam());
  const Chain chain = library_chain(machine);
  const std::vector<SolidBody> bodies = machine_bodies(machine);
  std::vector<cutting::Body> solids;
  for (const SolidBody& one : bodies) solids.push_back(cutting::make_body(one.mesh));
  for (const AxisVector& q : {AxisVector(AxisVector::Zero(chain.size())), machine.home}) {
    const std::vector<kinematics::Pose> T = carrier_poses(chain, q, {});
    for (const cutting::BodyPair& pair : collision_pairs(chain, bodies, {})) {
      const auto a = std::size_t(pair.a), b = std::size_t(pair.b);
      const kinematics::Pose &T_a = T[std::size_t(bodies[a].frame)],
                             &T_b = T[std::size_t(bodies[b].frame)];
      EXPECT_GT(cutting::gap(solids[a], T_a, solids[b], T_b).distance, 1.0)
          << bodies[a].name << " and " << bodies[b].name;
      EXPECT_FALSE(cutting::is_inside(solids[a], T_a, solids[b], T_b))
          << bodies[a].name << " and " << bodies[b].name;
    }
  }
}

/// Anywhere within the travel, turns without end within two of them.
AxisVector anywhere_in_travel(const Chain& chain, std::mt19937& random) {
  AxisVector q = AxisVector::Zero(chain.size());
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.motion == Motion::Spindle) continue;
    const double most = joint.motion == Motion::Rotary ? 4 * pi : 1e4;
    q[j] = std::uniform_real_distribution<double>(std::max(joint.min, -most),
                                                  std::min(joint.max, most))(random);
  }
  return q;
}

/// Slides that put the tip where it is, of a machine with less than three: those that its
/// directions of travel give by least squares.
AxisVector slides_by_least_squares(const Chain& chain, AxisVector q, const Vector3d& tip_w) {
  std::vector<int> slides;
  for (int j = 0; j < chain.size(); ++j)
    if (chain.joints()[std::size_t(j)].motion == Motion::Linear) slides.push_back(j);
  for (const int j : slides) q[j] = 0.0;
  const Vector3d at = chain.tool_in_workpiece(q).translation();
  MatrixXd ways(3, Index(slides.size()));
  for (std::size_t k = 0; k < slides.size(); ++k) {
    AxisVector moved = q;
    moved[slides[k]] = 1.0;
    ways.col(Index(k)) = chain.tool_in_workpiece(moved).translation() - at;
  }
  const VectorXd solved = ways.colPivHouseholderQr().solve(tip_w - at);
  for (std::size_t k = 0; k < slides.size(); ++k) q[slides[k]] = solved[Index(k)];
  return q;
}

TEST_P(LibraryMachine, InverseOfForwardGivesThePoseBack) {
  const unsigned seed = 20261125;
  const Chain chain = library_chain(described(GetParam()));
  std::mt19937 random(seed);
  int slides = 0;
  for (const Joint& joint : chain.joints()) slides += joint.motion == Motion::Linear;
  double tip = 0.0, direction = 0.0, own = 0.0;
  constexpr int poses = 2000;
  for (int i = 0; i < poses; ++i) {
    const AxisVector q = anywhere_in_travel(chain, random);
    const kinematics::Pose T_wt = chain.tool_in_workpiece(q);
    std::vector<AxisVector> found;
    if (slides == 3) {
      const auto inverse =
          kinematics::inverse(chain, {T_wt.translation(), T_wt.linear().col(2)}, q);
      ASSERT_TRUE(inverse.reach == kinematics::Reachability::Reached ||
                  inverse.reach == kinematics::Reachability::Singular)
          << "seed " << seed << ", pose " << i;
      found = inverse.branches;
    } else {
      found = {slides_by_least_squares(chain, q, T_wt.translation())};
    }
    double nearest = 1e9;
    for (const AxisVector& branch : found) {
      const kinematics::Pose again = chain.tool_in_workpiece(branch);
      tip = std::max(tip, (again.translation() - T_wt.translation()).norm());
      direction = std::max(direction,
                           kinematics::angle_between(again.linear().col(2), T_wt.linear().col(2)));
      nearest = std::min(nearest, (branch - q).cwiseAbs().maxCoeff());
    }
    own = std::max(own, nearest);
  }
  std::cout << GetParam() << ", seed " << seed << ", " << poses << " poses: tip within " << tip
            << " mm, direction " << direction << " rad, axes " << own << " mm or rad\n";
  EXPECT_LT(tip, 1e-9);
  EXPECT_LT(direction, 1e-12);
  EXPECT_LT(own, 1e-5) << "one of the branches is where the axes were";
}

TEST_P(LibraryMachine, IsTakenByCheck) {
  const safety::Folder folder;
  const std::string machine = GetParam();
  std::string scene;
  if (machine == "platform_xz")
    scene = packaged("platform_perfect.toml").string();
  else if (machine == "lathe_zx")
    scene = packaged("stepped_shaft.toml").string();
  else
    scene = (folder / "scene.toml").string();
  if (scene.starts_with(folder.path().string()))
    folder.write("scene.toml", measured_scene("", machine));
  const safety::Ran ran = run("check " + scene);
  EXPECT_EQ(ran.code, 0) << ran.text;
  EXPECT_HAS(ran.text, described(machine).name);
}

INSTANTIATE_TEST_SUITE_P(Machines, LibraryMachine, testing::ValuesIn(library_machines()),
                         [](const auto& machine) { return machine.param; });

TEST(MachineLibrary, HasEveryKind) {
  const std::vector<std::string> names = library_machines();
  EXPECT_GE(names.size(), 10u);
  std::set<std::string> codes;
  int inclined_tables = 0, inclined_heads = 0;
  for (const std::string& name : names) {
    const MachineDescription machine = described(name);
    codes.insert(to_string(kinematics::chain_topology(machine.joints)));
    for (const Joint& joint : machine.joints)
      if (joint.motion == Motion::Rotary &&
          std::abs(joint.direction_b.cwiseAbs().maxCoeff() - std::sqrt(0.5)) < 1e-9)
        ++(joint.side == kinematics::Side::Tool ? inclined_heads : inclined_tables);
  }
  for (const char* code :
       {"w C' A' b Y X Z s t", "w C' B' b X Y Z s t", "w C' b X Y Z A s t", "w b X Y Z C A s t",
        "w b X Y Z C B s t", "w A' b X Y Z s t", "w C' b Z X Y B s t", "w S' b Z X t",
        "w X' Y' b Z s t", "w S' X' b Z t"})
    EXPECT_TRUE(codes.count(code)) << code;
  EXPECT_EQ(inclined_tables, 1);
  EXPECT_EQ(inclined_heads, 1);
}

// ---- what `[[machine.body]]` refuses

std::string refusal_of_body(const std::string& body) {
  InputErrors input_errors;
  read_machine(parse_toml("code = \"w X' b Z s t\"\nnose = { at_mm = [0, 0, 0] }\n[axis.X]\n"
                          "[axis.Z]\n[[body]]\n" +
                              body,
                          "m.toml"),
               input_errors);
  std::string text;
  for (const BadInput& fault : input_errors.list()) text += std::string(fault.what()) + "\n";
  return text;
}

TEST(MachineBodies, AreRefusedWhereTheyAreWrong) {
  EXPECT_EQ(refusal_of_body("size_mm = [1, 2, 3]\ncarried_by = \"X\"\nat_mm = [4, 5, 6]\n"), "");
  EXPECT_EQ(refusal_of_body("size_mm = [1, 2, 3]\n"), "");
  EXPECT_EQ(refusal_of_body("size_mm = [1, 0, 3]\n"),
            "m.toml:6:11: expected three sizes above 0 and at most 100000 mm for size_mm, seen 1, "
            "0, 3\n");
  EXPECT_EQ(refusal_of_body("size_mm = [1, 2, 3]\ncarried_by = \"Y\"\n"),
            "m.toml:7:14: expected a letter of the machine's code: b X Z s, seen Y\n");
  EXPECT_HAS(refusal_of_body("size_mm = [1, 2]\n"), "m.toml:6:");
  EXPECT_HAS(refusal_of_body("at_mm = [1, 2, 3]\n"), "size_mm");
  EXPECT_HAS(refusal_of_body("size_mm = [1, 2, 3]\nshapes = \"box\"\n"), "shapes");
}

// ---- abbe new --list, and the table of the document

TEST(LibraryList, NamesKindsAndMachinesWithAxesAndTravels) {
  const safety::Ran ran = run("new --list");
  EXPECT_EQ(ran.code, 0) << ran.text;
  for (const std::string& kind : scene_kinds()) EXPECT_HAS(ran.text, "\n  " + kind + " ") << kind;
  for (const std::string& machine : library_machines())
    EXPECT_HAS(ran.text, "\n  " + machine + " ") << machine;
  EXPECT_HAS(ran.text, "w C' B' b X Y Z s t; X 400, Y 200, Z 240 mm; B -50 .. 100, C any deg");
  const auto json = nlohmann::json::parse(run("new --list --json").text);
  EXPECT_EQ(json["kinds"].size(), scene_kinds().size());
  EXPECT_EQ(json["machines"].size(), library_machines().size());
  for (const auto& machine : json["machines"])
    if (machine["name"] == "trunnion_cb") {
      EXPECT_EQ(machine["axes"]["B"]["travel"][0], -50.0);
      EXPECT_TRUE(machine["axes"]["C"]["travel"].is_null());
      EXPECT_EQ(machine["axes"]["X"]["unit"], "mm");
    }
}

TEST(LibraryList, NewWithoutKindOrFolderSaysWhatItWants) {
  for (const char* line : {"new", "new gantry"}) {
    const safety::Ran ran = run(line);
    EXPECT_EQ(ran.code, 2) << line;
    EXPECT_HAS(ran.text,
               "expected a kind and a folder, such as abbe new gantry first, or "
               "--list");
  }
}

std::string machine_table() {
  std::string rows = "| machine | what it is | structural code | travel |\n|---|---|---|---|\n";
  for (const MachineEntry& machine : library_contents(scene_kinds()).machines)
    rows += fmt::format("| `{}` | {} | `{}` | {} |\n", machine.name, machine.summary,
                        machine.structural_code, travel_text(machine));
  return rows;
}

// ABBE_WRITE_KEYS=1 writes it, as it does the tables of keys.
TEST(KeyTablesOfMachines, OfTheDocumentIsThatOfTheLibrary) {
  const fs::path file = fs::path(ABBE_SOURCE_DIR) / "scenes/README.md";
  const std::string document = bytes(file), begin = "<!-- machines -->\n",
                    end = "<!-- end of machines -->";
  const std::size_t from = document.find(begin), to = document.find(end);
  ASSERT_TRUE(from != std::string::npos && to != std::string::npos && from < to);
  const std::string again =
      document.substr(0, from + begin.size()) + machine_table() + document.substr(to);
  if (std::getenv("ABBE_WRITE_KEYS")) std::ofstream(file) << again;
  EXPECT_EQ(document == again, true) << "scenes/README.md is stale; ABBE_WRITE_KEYS=1 sim_test "
                                        "--gtest_filter=KeyTables* writes it";
}

// ---- poles

/// Rotary axes of a machine of the library.
int rotary_axes_of(const std::string& name) {
  int turns = 0;
  for (const kinematics::Joint& joint : described(name).joints)
    turns += joint.motion == kinematics::Motion::Rotary && joint.name != 'S';
  return turns;
}

/// Vectors that pass z by half a degree, 20 degrees in steps of one, along a line at feed.
std::vector<Vector3d> vectors_past_z() {
  std::vector<Vector3d> all;
  for (int k = -10; k <= 10; ++k)
    all.push_back(Vector3d(std::tan(k * units::deg), std::tan(0.5 * units::deg), 1.0).normalized());
  return all;
}

/// The first and the last of them alone: one block passes z.
std::string cl_across_the_pole() {
  const std::vector<Vector3d> all = vectors_past_z();
  std::string text = "UNITS/MM\nMULTAX/ON\nFEDRAT/1000\nRAPID\n";
  for (const Vector3d& v : {all.front(), all.back()})
    text += fmt::format("GOTO/0,0,40,{:.9f},{:.9f},{:.9f}\n", v.x(), v.y(), v.z());
  return text + "FINI\n";
}

/// A line of a program for each vector, the first at rapid. @param line  (x, vector, rapid)
template <typename Line>
std::string past_the_pole(std::string head, const Line& line, const char* end) {
  int x = -10;
  for (const Vector3d& v : vectors_past_z()) {
    head += line(x, v, x == -10);
    ++x;
  }
  return head + end;
}

std::string cl_past_the_pole() {
  return past_the_pole(
      "UNITS/MM\nMULTAX/ON\nFEDRAT/1000\n",
      [](int x, const Vector3d& v, bool rapid) {
        return fmt::format("{}GOTO/{},0,40,{:.9f},{:.9f},{:.9f}\n", rapid ? "RAPID\n" : "", x,
                           v.x(), v.y(), v.z());
      },
      "FINI\n");
}

std::string fanuc_past_the_pole() {
  return past_the_pole(
      "O1\nG21 G90 G94 G17\nG54\nG43.5 H1\n",
      [](int x, const Vector3d& v, bool rapid) {
        return fmt::format("{} X{}. Y0. Z40. I{:.9f} J{:.9f} K{:.9f}\n", rapid ? "G0" : "G1 F1000.",
                           x, v.x(), v.y(), v.z());
      },
      "M30\n");
}

std::string siemens_past_the_pole() {
  return past_the_pole(
      "G90 G54 T1 D1\nTRAORI\nORIAXES\n",
      [](int x, const Vector3d& v, bool rapid) {
        return fmt::format("{} X{} Y0 Z40 A3={:.9f} B3={:.9f} C3={:.9f}\n",
                           rapid ? "G0" : "G1 F1000", x, v.x(), v.y(), v.z());
      },
      "M30\n");
}

TEST(PoleWarning, SaysHowCloseWhereAndHowTheFreeAxisTurnsOnEveryFiveAxisMachine) {
  const safety::Folder folder;
  const std::string program = folder.write("p.cl", cl_past_the_pole()).string();
  int machines = 0;
  for (const std::string& name : library_machines()) {
    if (rotary_axes_of(name) != 2) continue;
    ++machines;
    const safety::Ran ran = safety::shell("(" + std::string(ABBE_PROGRAM) + " program " + program +
                                          " --machine " + name + " --json 2>/dev/null)");
    EXPECT_EQ(ran.code, 0) << name << ": " << ran.text;
    if (ran.code != 0) continue;
    const auto pole = nlohmann::json::parse(ran.text)["near_pole"];
    ASSERT_FALSE(pole.is_null()) << name;
    std::cout << name << ": " << pole << "\n";
    EXPECT_NEAR(pole["angle_deg"].get<double>(), 0.5, 1e-3) << name;
    EXPECT_NEAR(pole["line"].get<int>(), 15, 1) << name;
    EXPECT_EQ(pole["axis"], "C") << name;
    EXPECT_GT(pole["turned_deg"].get<double>(), 140.0) << name;
    EXPECT_LT(pole["turned_deg"].get<double>(), 185.0) << name;
    EXPECT_HAS(ran.text,
               "the tool passes a pole of the machine, where it is parallel to C and "
               "C does not change its direction, within 0.5 deg (line ");
  }
  EXPECT_EQ(machines, 8);
}

TEST(PoleWarning, StandsForEveryDialectOfVectors) {
  const safety::Folder folder;
  const std::pair<const char*, std::string> programs[] = {{"p.nc", fanuc_past_the_pole()},
                                                          {"p.mpf", siemens_past_the_pole()},
                                                          {"p.cl", cl_past_the_pole()}};
  for (const auto& [name, text] : programs) {
    const std::string program = folder.write(name, text).string();
    const safety::Ran ran = run("program " + program + " --machine trunnion_ca");
    EXPECT_EQ(ran.code, 0) << ran.text;
    EXPECT_HAS(ran.text,
               "passes a pole of the machine, where it is parallel to C and C does "
               "not change its direction, within 0.5 deg")
        << name;
    EXPECT_HAS(ran.text, "closer than 2 deg C turns by");
    EXPECT_HAS(ran.text, "deg/min as programmed");
    for (const char* less : {" --pole-warning 0.4", " --pole-warning 0"})
      EXPECT_EQ(
          run("program " + program + " --machine trunnion_ca" + less).text.find("passes a pole"),
          std::string::npos)
          << name << less;
  }
}

TEST(PoleWarning, IsNotGivenWhereTheToolPassesWithoutATurn) {
  const safety::Folder folder;
  const std::string program =
      folder
          .write("p.cl",
                 "UNITS/MM\nMULTAX/ON\nFEDRAT/1000\nRAPID\nGOTO/0,0,40,0,-0.173648178,0.984807753\n"
                 "GOTO/0,0,40,0,0.173648178,0.984807753\nFINI\n")
          .string();
  const safety::Ran ran = run("program " + program + " --machine trunnion_ca");
  EXPECT_EQ(ran.code, 0) << ran.text;
  EXPECT_EQ(ran.text.find("passes a pole"), std::string::npos) << ran.text;
}

std::string pole_scene(const std::string& program_keys) {
  return fmt::format(
      "machine = \"library:trunnion_ca\"\ntool = \"library:ball_r5\"\n[part]\nsurface = "
      "\"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\nat_mm = [0, 0, 40]\nvertices = 100\n"
      "[program]\nfile = \"p.cl\"\n{}",
      program_keys);
}

TEST(PoleWarning, StandsInTheSummaryOfARun) {
  const safety::Folder folder;
  folder.write("p.cl", cl_past_the_pole());
  const std::string scene = folder.write("s.toml", pole_scene("")).string();
  const safety::Ran ran = run("run " + scene + " --out " + (folder / "out").string());
  EXPECT_EQ(ran.code, 0) << ran.text;
  EXPECT_HAS(ran.text, "passes a pole of the machine");
  const auto summary = nlohmann::json::parse(bytes(folder / "out/summary.json"));
  bool said = false;
  for (const auto& warning : summary["warnings"])
    said = said ||
           warning.get<std::string>().find("passes a pole of the machine") != std::string::npos;
  EXPECT_TRUE(said) << summary["warnings"];
  folder.write("s.toml", pole_scene("pole_warning_deg = 0\n"));
  EXPECT_EQ(run("check " + scene).text.find("passes a pole"), std::string::npos);
}

TEST(PoleRules, OfASceneAreReadWrittenAndRefused) {
  const safety::Folder folder;
  folder.write("p.cl", cl_across_the_pole());
  const auto said = [&](const std::string& keys) {
    return run("check " + folder.write("s.toml", pole_scene(keys)).string());
  };
  const safety::Ran led = said("pole = \"fanuc\"\npole_near_deg = 1\npole_change_deg = 10\n");
  EXPECT_EQ(led.code, 0) << led.text;
  EXPECT_HAS(led.text, "would pass a pole closer than 1 deg and are led through it");
  const safety::Ran siemens = said("pole = \"siemens\"\n");
  EXPECT_EQ(siemens.code, 0) << siemens.text;
  const safety::Ran linuxcnc = said("pole = \"linuxcnc\"\n");
  EXPECT_EQ(linuxcnc.code, 3);
  EXPECT_HAS(linuxcnc.text, "a LinuxCNC program, which has no tool vectors");
  const safety::Ran none = said("pole = \"fanuc\"\n");
  EXPECT_EQ(none.code, 3);
  EXPECT_HAS(none.text, "pole_near_deg");
  EXPECT_HAS(none.text, "pole_change_deg");
  const safety::Ran alone = said("pole_near_deg = 1\n");
  EXPECT_EQ(alone.code, 3);
  EXPECT_HAS(alone.text, "s.toml:11:1:");
  folder.write("p.pvt", "time_s,X_mm\n0,0\n1,1\n");
  std::string table = pole_scene("pole = \"siemens\"\n");
  table.replace(table.find("p.cl"), 4, "p.pvt");
  const safety::Ran of_times = run("check " + folder.write("t.toml", table).string());
  EXPECT_EQ(of_times.code, 3);
  EXPECT_HAS(of_times.text, "expected no pole with a table of times, which has no vectors");
  const Scene scene = read_scene(folder.write(
      "s.toml", pole_scene("pole = \"fanuc\"\npole_near_deg = 1.5\npole_change_deg = 20\n")));
  const Scene again = read_scene(folder.write("again.toml", scene.resolved));
  const auto& file = std::get<ProgramFile>(again.program.source);
  EXPECT_EQ(file.pole.rule, dialects::PoleRule::Fanuc);
  EXPECT_EQ(file.pole.near_angle, 1.5 * units::deg);
  EXPECT_EQ(file.pole.max_rotation_about_pole, 20 * units::deg);
}

// FANUC's formula is of axes at right angles.
TEST(PoleRules, FanucLeadsThroughThePoleOfEveryMachineAtRightAngles) {
  const safety::Folder folder;
  const std::string program = folder.write("p.cl", cl_across_the_pole()).string();
  int led = 0, refused = 0;
  for (const std::string& name : library_machines()) {
    if (rotary_axes_of(name) != 2) continue;
    const safety::Ran ran = run("program " + program + " --machine " + name +
                                " --pole fanuc --pole-near 1 --pole-change 10");
    if (name.starts_with("nutating")) {
      ++refused;
      EXPECT_EQ(ran.code, 3) << ran.text;
      EXPECT_HAS(ran.text,
                 "p.cl:6:1: expected a machine with two rotary axes perpendicular to "
                 "each other and to the tool, with pole = \"fanuc\"");
      continue;
    }
    ++led;
    EXPECT_EQ(ran.code, 0) << name << ": " << ran.text;
    EXPECT_HAS(ran.text, "1 blocks would pass a pole closer than 1 deg and are led through it")
        << name;
  }
  EXPECT_EQ(led, 6);
  EXPECT_EQ(refused, 2);
}

TEST(PoleRules, OfTheCommandLineAskForEachOther) {
  const safety::Folder folder;
  const std::string program =
      "program " + folder.write("p.cl", cl_across_the_pole()).string() + " --machine trunnion_ca ";
  EXPECT_EQ(run(program + "--pole fanuc").code, 2);
  EXPECT_EQ(run(program + "--pole-near 1").code, 2);
  const safety::Ran led = run(program + "--pole fanuc --pole-near 1 --pole-change 10");
  EXPECT_EQ(led.code, 0) << led.text;
  EXPECT_HAS(led.text, "are led through it");
  EXPECT_EQ(run(program + "--pole siemens").code, 0);
  EXPECT_EQ(run(program + "--pole linuxcnc").code, 3);
}

}  // namespace
}  // namespace abbe::sim
