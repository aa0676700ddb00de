// Every machine of the library: it reads, its forward and inverse agree, `check` takes it; what is
// listed of all of them. Their location elements are in location_machines_test.cpp.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <random>
#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/inverse.h"
#include "kinematics/turn_between.h"
#include "kinematics/units.h"
#include "sim/commands/library_list.h"
#include "sim/commands/new_command.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene_sections.h"
#include "tests/safety/program_run.h"
#include "tests/sim/measured_scene.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using safety::bytes;
using safety::run;

/// Names of the machines of the library, in their order.
std::vector<std::string> library_machines() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(packaged("machines")))
    names.push_back(entry.path().stem().string());
  std::ranges::sort(names);
  return names;
}

/// A machine of the library as its file describes it.
MachineDescription described(const std::string& name) {
  Faults faults;
  const MachineDescription machine =
      read_machine(read_toml_file(packaged("machines/" + name + ".toml")), faults);
  for (const BadInput& fault : faults.list()) ADD_FAILURE() << fault.what();
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
  EXPECT_NE(head.find("typical values"), std::string::npos) << "what is chosen is said to be";
  EXPECT_NE(head.find("chosen"), std::string::npos);
  const MachineDescription machine = described(GetParam());
  EXPECT_FALSE(machine.summary.empty());
  EXPECT_GE(machine.bodies.size(), 5u);
  std::set<int> carried;
  for (const MachineBody& body : machine.bodies) {
    EXPECT_FALSE(body.name.empty());
    EXPECT_GT(body.size.minCoeff(), 0.0) << body.name;
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
  const Node::Table written = written_machine(machine);
  Faults faults;
  const MachineDescription again = read_machine(Node{{}, written}, faults);
  EXPECT_TRUE(faults.empty());
  EXPECT_EQ(to_toml(Node{{}, written_machine(again)}), to_toml(Node{{}, written}));
  ASSERT_EQ(again.bodies.size(), machine.bodies.size());
  for (std::size_t i = 0; i < machine.bodies.size(); ++i) {
    EXPECT_EQ(again.bodies[i].joint, machine.bodies[i].joint);
    EXPECT_EQ(again.bodies[i].size, machine.bodies[i].size);
    EXPECT_EQ(again.bodies[i].T_b.matrix(), machine.bodies[i].T_b.matrix());
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
  Eigen::MatrixXd ways(3, Eigen::Index(slides.size()));
  for (std::size_t k = 0; k < slides.size(); ++k) {
    AxisVector moved = q;
    moved[slides[k]] = 1.0;
    ways.col(Eigen::Index(k)) = chain.tool_in_workpiece(moved).translation() - at;
  }
  const Eigen::VectorXd solved = ways.colPivHouseholderQr().solve(tip_w - at);
  for (std::size_t k = 0; k < slides.size(); ++k) q[slides[k]] = solved[Eigen::Index(k)];
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
      ASSERT_TRUE(inverse.reach == kinematics::Reach::Reached ||
                  inverse.reach == kinematics::Reach::Singular)
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
  EXPECT_NE(ran.text.find(described(machine).name), std::string::npos) << ran.text;
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
    codes.insert(to_string(kinematics::topology_of(machine.joints)));
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
  Faults faults;
  read_machine(parse_toml("code = \"w X' b Z s t\"\nnose = { at_mm = [0, 0, 0] }\n[axis.X]\n"
                          "[axis.Z]\n[[body]]\n" +
                              body,
                          "m.toml"),
               faults);
  std::string text;
  for (const BadInput& fault : faults.list()) text += std::string(fault.what()) + "\n";
  return text;
}

TEST(MachineBodies, AreRefusedWhereTheyAreWrong) {
  EXPECT_EQ(refusal_of_body("size_mm = [1, 2, 3]\ncarried_by = \"X\"\nat_mm = [4, 5, 6]\n"), "");
  EXPECT_EQ(refusal_of_body("size_mm = [1, 2, 3]\n"), "");
  EXPECT_EQ(refusal_of_body("size_mm = [1, 0, 3]\n"),
            "m.toml:6:11: expected three sizes above 0 mm for size_mm, seen one that is not\n");
  EXPECT_EQ(refusal_of_body("size_mm = [1, 2, 3]\ncarried_by = \"Y\"\n"),
            "m.toml:7:14: expected a letter of the machine's code: b X Z s, seen Y\n");
  EXPECT_NE(refusal_of_body("size_mm = [1, 2]\n").find("m.toml:6:"), std::string::npos);
  EXPECT_NE(refusal_of_body("at_mm = [1, 2, 3]\n").find("size_mm"), std::string::npos);
  EXPECT_NE(refusal_of_body("size_mm = [1, 2, 3]\nshape = \"box\"\n").find("shape"),
            std::string::npos);
}

// ---- abbe new --list, and the table of the document

TEST(LibraryList, NamesKindsAndMachinesWithAxesAndTravels) {
  const safety::Ran ran = run("new --list");
  EXPECT_EQ(ran.code, 0) << ran.text;
  for (const std::string& kind : new_kinds())
    EXPECT_NE(ran.text.find("\n  " + kind + " "), std::string::npos) << kind;
  for (const std::string& machine : library_machines())
    EXPECT_NE(ran.text.find("\n  " + machine + " "), std::string::npos) << machine;
  EXPECT_NE(ran.text.find("w C' B' b X Y Z s t; X 400, Y 200, Z 240 mm; B -50 .. 100, C any deg"),
            std::string::npos)
      << ran.text;
  const auto json = nlohmann::json::parse(run("new --list --json").text);
  EXPECT_EQ(json["kinds"].size(), new_kinds().size());
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
    EXPECT_NE(ran.text.find("expected a kind and a folder, such as abbe new gantry first, or "
                            "--list"),
              std::string::npos)
        << ran.text;
  }
}

std::string machine_table() {
  std::string rows = "| machine | what it is | structural code | travel |\n|---|---|---|---|\n";
  for (const ListedMachine& machine : library_list(new_kinds()).machines)
    rows += fmt::format("| `{}` | {} | `{}` | {} |\n", machine.name, machine.summary, machine.code,
                        travel_text(machine));
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

}  // namespace
}  // namespace abbe::sim
