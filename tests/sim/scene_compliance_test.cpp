#include "sim/scene/compliance.h"
#include "sim/scene/fields.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/gantry.h"
#include "tests/sim/refusal.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/written_section.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

struct ReadCompliance {
  errors::ComplianceErrors compliance;
  std::string input_errors;
};

ReadCompliance read_with_faults(const std::string& text) {
  InputErrors input_errors;
  ReadCompliance result;
  result.compliance = read_compliance(parse_toml(text, "c.toml"), gantry(), input_errors);
  result.input_errors = text_of(input_errors);
  return result;
}

testing::AssertionResult refused(const std::string& text, const std::string& part) {
  const std::string input_errors = read_with_faults(text).input_errors;
  if (input_errors.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "\"" << input_errors << "\" has no \"" << part << "\"";
}

TEST(SceneCompliance, ReadsStiffnessesAsTheirInverse) {
  const ReadCompliance r = read_with_faults(R"(
name = "soft"
scale = 2
[axis.X]
stiffness_N_per_um = [50, 100, 200]
turning_stiffness_Nm_per_urad = [1, 2, 4]
[axis.S]
stiffness_N_per_um = [80, 80, 160]
[fixture]
turning_stiffness_Nm_per_urad = [0.5, 0.5, 0.5]
)");
  ASSERT_EQ(r.input_errors, "");
  ASSERT_EQ(r.compliance.joints.size(), 2u);
  const errors::Compliance& C = r.compliance.joints[0].C;
  EXPECT_EQ(r.compliance.joints[0].axis, 'X');
  EXPECT_NEAR(C(0, 0), 1.0 / 50e3, 1e-20);  // 1 N moves 1/50 um
  EXPECT_NEAR(C(2, 2), 1.0 / 200e3, 1e-20);
  EXPECT_NEAR(C(3, 3), 1e-9, 1e-24);  // 1 N m = 1000 N mm turns 1 urad
  EXPECT_NEAR(C(5, 5), 0.25e-9, 1e-24);
  EXPECT_EQ(r.compliance.joints[1].axis, 'S');
  EXPECT_EQ(r.compliance.joints[1].C(4, 4), 0.0) << "left out is stiff";
  EXPECT_NEAR(r.compliance.fixture(3, 3), 2e-9, 1e-24);
  EXPECT_EQ(r.compliance.scale, 2.0);
  EXPECT_FALSE(r.compliance.gravity_b);
  EXPECT_FALSE(r.compliance.workpiece);
  EXPECT_FALSE(r.compliance.inertia);
  EXPECT_TRUE(r.compliance.tool.isZero(0.0));
}

TEST(SceneCompliance, PrincipalAxesOfAStiffnessMayBeTurned) {
  const ReadCompliance r = read_with_faults(R"(
[axis.X]
stiffness_N_per_um = [50, 2, 40]
turning_stiffness_Nm_per_urad = [1, 2, 4]
turn_deg = [0, 0, 30]
[fixture]
stiffness_N_per_um = [50, 2, 40]
turn_deg = [0, 0, 90]
)");
  ASSERT_EQ(r.input_errors, "");
  const errors::Compliance& C = r.compliance.joints[0].C;
  // by hand: the soft direction is y turned about z, (-1/2, sqrt(3)/2, 0)
  const double stiff = 1 / 50e3, soft = 1 / 2e3;
  EXPECT_NEAR(C(0, 0), 0.75 * stiff + 0.25 * soft, 1e-18);
  EXPECT_NEAR(C(1, 1), 0.25 * stiff + 0.75 * soft, 1e-18);
  EXPECT_NEAR(C(0, 1), std::sqrt(3.0) / 4 * (stiff - soft), 1e-18);
  EXPECT_NEAR(C(1, 0), C(0, 1), 1e-20);
  EXPECT_NEAR(C(2, 2), 1 / 40e3, 1e-20);
  EXPECT_NEAR(C(3, 4), std::sqrt(3.0) / 4 * (1e-9 - 0.5e-9), 1e-22);
  EXPECT_TRUE((C.topRightCorner<3, 3>().isZero(0.0)));
  EXPECT_NO_THROW(errors::validate(C, "turned"));
  EXPECT_EQ(r.compliance.fixture(0, 0), soft) << "a quarter turn is exact";
  EXPECT_EQ(r.compliance.fixture(0, 1), 0.0);
  EXPECT_TRUE(
      refused("fixture = { turn_deg = [0, 0, 30] }", "stiffnesses to which turn_deg applies"));
  EXPECT_TRUE(
      refused("axis.X = { stiffness_N_per_um = [1, 1, 1], turn_deg = [0, 0] }", "turn_deg"));
}

TEST(SceneCompliance, ReadsAMatrixRowByRow) {
  std::string numbers = "matrix = [";
  for (int i = 0; i < 36; ++i)
    numbers += std::string(i ? ", " : "") + (i % 7 == 0          ? "1e-5"
                                             : i == 4 || i == 24 ? "-2e-6"
                                                                 : "0");
  const ReadCompliance r = read_with_faults("[axis.Z]\n" + numbers + "]\n");
  ASSERT_EQ(r.input_errors, "");
  EXPECT_EQ(r.compliance.joints[0].C(0, 0), 1e-5);
  EXPECT_EQ(r.compliance.joints[0].C(0, 4), -2e-6);
  EXPECT_EQ(r.compliance.joints[0].C(4, 0), -2e-6);
  EXPECT_EQ(r.compliance.joints[0].C(0, 5), 0.0);
}

TEST(SceneCompliance, AddsHolderAndSectionsOfTheTool) {
  const ReadCompliance r = read_with_faults(R"(
[tool]
stiffness_N_per_um = [20, 20, 100]
section = [{ length_mm = 40, diameter_mm = 10, youngs_modulus_GPa = 600, poisson_ratio = 0.22 },
           { length_mm = 30, diameter_mm = 16, youngs_modulus_GPa = 600 }]
)");
  ASSERT_EQ(r.input_errors, "");
  EXPECT_NEAR(100.0 * (r.compliance.tool(0, 0) - 1.0 / 20e3), 0.0120614855, 5e-11);
}

TEST(SceneCompliance, ReadsBarsAndPlates) {
  const ReadCompliance bar = read_with_faults(R"(
[workpiece]
kind = "bar"
clamp_mm = [0, 0, 10]
direction = [2, 0, 0]
length_mm = 100
diameter_mm = 25
youngs_modulus_GPa = 210
)");
  ASSERT_EQ(bar.input_errors, "");
  const auto& b = std::get<errors::WorkpieceBar>(*bar.compliance.workpiece);
  EXPECT_EQ(b.direction_w, Vector3d::UnitX());
  EXPECT_NEAR(b.second_moment, pi * 390625.0 / 64.0, 1e-9);
  EXPECT_EQ(b.youngs_modulus, 210e3);
  const ReadCompliance plate = read_with_faults(R"(
[workpiece]
kind = "plate"
foot_mm = [0, 0, 5]
normal = [0, 1, 0]
height_mm = 30
thickness_mm = 3
youngs_modulus_GPa = 70
)");
  ASSERT_EQ(plate.input_errors, "");
  const auto& p = std::get<errors::WorkpiecePlate>(*plate.compliance.workpiece);
  EXPECT_EQ(p.up_w, Vector3d::UnitZ());
  EXPECT_EQ(p.poisson_ratio, 0.33);
  const ReadCompliance moment = read_with_faults(
      "workpiece = { kind = \"bar\", length_mm = 10, second_moment_mm4 = 5, "
      "youngs_modulus_GPa = 1 }");
  ASSERT_EQ(moment.input_errors, "");
  EXPECT_EQ(std::get<errors::WorkpieceBar>(*moment.compliance.workpiece).second_moment, 5.0);
}

TEST(SceneCompliance, ReadsMassesGravityAndClamping) {
  const ReadCompliance r = read_with_faults(R"(
gravity = [0, 0, -3]
inertia = true
[[mass]]
name = "ram"
axis = "Z"
mass_kg = 120
centre_mm = [0, 10, 300]
[[mass]]
axis = "w"
mass_kg = 5
centre_mm = [0, 0, 0]
[clamping]
FZ_N = -500
MX_Nm = 2
)");
  ASSERT_EQ(r.input_errors, "");
  ASSERT_EQ(r.compliance.masses.size(), 2u);
  EXPECT_EQ(r.compliance.masses[0].axis, 'Z');
  EXPECT_EQ(r.compliance.masses[0].centre_b, Vector3d(0, 10, 300));
  EXPECT_EQ(*r.compliance.gravity_b, Vector3d(0, 0, -9806.65));
  EXPECT_TRUE(r.compliance.inertia);
  EXPECT_EQ(r.compliance.clamping_w[2], -500.0);
  EXPECT_EQ(r.compliance.clamping_w[3], 2000.0);
}

TEST(SceneCompliance, RefusesWhatIsNotPhysicalWhereItStands) {
  EXPECT_TRUE(refused("axis.X = { stiffness_N_per_um = [1, 0, 1] }", "c.toml:1:"));
  EXPECT_TRUE(
      refused("axis.X = { stiffness_N_per_um = [1, -2, 1] }", "three stiffnesses of at least"));
  EXPECT_TRUE(refused("axis.X = { stiffness_N_per_um = [1, 2] }", "c.toml:1:"));
  EXPECT_TRUE(refused("axis.X = { stiffness_N_per_mm = [1, 2, 3] }", "N_per_um"));
  EXPECT_TRUE(refused("axis.X = { matrix = [1, 2, 3] }", "36"));
  std::string m = "matrix = [0";
  for (int i = 1; i < 36; ++i) m += i == 1 ? ", 1e-5" : ", 0";
  m += "]";
  EXPECT_TRUE(refused("[axis.X]\n" + m, "c.toml:2:10: "));
  EXPECT_TRUE(refused("[axis.X]\n" + m, "symmetric"));
  EXPECT_TRUE(refused("[fixture]\nstiffness_N_per_um = [1, 1, 1]\n" + m, "both"));
  EXPECT_TRUE(refused("axis.B = {}", "c.toml:1:"));
  EXPECT_TRUE(refused("axis.U = {}", "U"));
  EXPECT_TRUE(refused("tool.section = [{ length_mm = 0, diameter_mm = 1, youngs_modulus_GPa = 1 }]",
                      "length_mm"));
  EXPECT_TRUE(refused("tool.section = [{ length_mm = 1, diameter_mm = 1 }]", "youngs_modulus_GPa"));
  EXPECT_TRUE(
      refused("tool.section = [{ length_mm = 1, diameter_mm = 1, youngs_modulus_GPa = 1, "
              "poisson_ratio = 0.7 }]",
              "poisson_ratio"));
  EXPECT_TRUE(refused("workpiece = { kind = \"beam\" }", "bar"));
  EXPECT_TRUE(refused("workpiece = { kind = \"bar\", length_mm = 1, youngs_modulus_GPa = 1 }",
                      "diameter_mm"));
  EXPECT_TRUE(
      refused("workpiece = { kind = \"bar\", length_mm = 1, youngs_modulus_GPa = 1, "
              "diameter_mm = 1, second_moment_mm4 = 1 }",
              "both"));
  EXPECT_TRUE(
      refused("workpiece = { kind = \"plate\", normal = [0, 0, 1], height_mm = 1, "
              "thickness_mm = 1, youngs_modulus_GPa = 1 }",
              "perpendicular to"));
  EXPECT_TRUE(
      refused("mass = [{ axis = \"Q\", mass_kg = 1, centre_mm = [0, 0, 0] }]", "mass on Q"));
  EXPECT_TRUE(
      refused("mass = [{ axis = \"XY\", mass_kg = 1, centre_mm = [0, 0, 0] }]", "a single letter"));
  EXPECT_TRUE(refused("mass = [{ axis = \"X\", mass_kg = -1, centre_mm = [0, 0, 0] }]", "mass_kg"));
  EXPECT_TRUE(refused("mass = [{ axis = \"X\", mass_kg = 1 }]", "centre_mm"));
  EXPECT_TRUE(refused("gravity = [0, 0, 0]", "a nonzero direction"));
  EXPECT_TRUE(refused("scale = -1", "scale"));
  EXPECT_TRUE(refused("scale = 1.1e6", "c.toml:1:9: "));
  EXPECT_TRUE(refused("axis.X = { stiffness_N_per_um = [1, 1, 0.9e-6] }", "at least 1e-06"));
  EXPECT_TRUE(
      refused("axis.X = { turning_stiffness_Nm_per_urad = [1, 1, 0.9e-9] }", "at least 1e-09"));
  EXPECT_EQ(read_with_faults("scale = 1e6\n[axis.X]\nstiffness_N_per_um = [1e-6, 1, 1]\n"
                             "turning_stiffness_Nm_per_urad = [1, 1e-9, 1]")
                .input_errors,
            "");
  std::string soft = "[axis.X]\nmatrix = [1001";
  for (int i = 1; i < 36; ++i) soft += ", 0";
  EXPECT_TRUE(refused(soft + "]", "c.toml:2:10: expected entries of at most 1000"));
  EXPECT_TRUE(refused("clamping = { FX_Nm = 1 }", "FX_N"));
  EXPECT_TRUE(refused("stiffnes = 1", "stiffnes"));
}

const std::string field_csv =
    "x_mm,y_mm,z_mm,Cxx_um_per_N,Cyy_um_per_N,Czz_um_per_N\n0,0,0,1,2,3\n10,0,0,4,5,6\n";

TEST(SceneCompliance, ReadsAFieldFromCsv) {
  const SceneFolder folder;
  const std::string file = folder.write("wall.csv", field_csv).string();
  const ReadCompliance r =
      read_with_faults("workpiece = { kind = \"field\", file = \"" + file + "\" }");
  ASSERT_EQ(r.input_errors, "");
  const auto& field = std::get<errors::WorkpieceField>(*r.compliance.workpiece);
  ASSERT_EQ(field.points_w.rows(), 2);
  EXPECT_EQ(field.compliance_w[1](2, 2), 6e-3);

  const std::string bad = folder.write("bad.csv", field_csv + "1,2,3,4,5,-6\n").string();
  EXPECT_TRUE(refused("workpiece = { kind = \"field\", file = \"" + bad + "\" }",
                      "bad.csv:4:1: expected a compliance without negative eigenvalue"));
  EXPECT_TRUE(
      refused("workpiece = { kind = \"field\", file = \"" + file + "x\" }", ".csv or .vtu"));
  EXPECT_TRUE(refused("workpiece = { kind = \"field\", file = \"/nowhere/a.csv\" }",
                      "/nowhere/a.csv: none"));
  EXPECT_TRUE(refused("workpiece = { kind = \"field\" }", "file"));
}

std::string compliance_again(const std::string& text) {
  const MachineDescription machine = gantry();
  return written_again(
      text,
      [&](const Node& node, InputErrors& input_errors) {
        return read_compliance(node, machine, input_errors);
      },
      [&](const errors::ComplianceErrors& soft) { return compliance_to_table(soft, machine); });
}

TEST(SceneCompliance, EveryKeyIsWritten) {
  const std::string text = R"(scale = 2.0
gravity = [0.0, 0.0, -1.0]
inertia = true

[workpiece]
kind = "bar"
clamp_mm = [0.0, 0.0, 10.0]
direction = [1.0, 0.0, 0.0]
length_mm = 100.0
youngs_modulus_GPa = 210.0
second_moment_mm4 = 5.0

[[mass]]
axis = "Z"
mass_kg = 120.0
centre_mm = [0.0, 10.0, 300.0]

[[mass]]
axis = "w"
mass_kg = 5.0
centre_mm = [0.0, 0.0, 0.0]

[clamping]
FX_N = 1.0
FY_N = 2.0
FZ_N = -500.0
MX_Nm = 2.0
MY_Nm = 3.0
MZ_Nm = 4.0
)";
  EXPECT_EQ(compliance_again(text), text);
  const std::string plate = R"(kind = "plate"
foot_mm = [0.0, 0.0, 5.0]
up = [0.0, 0.0, 1.0]
normal = [0.0, 1.0, 0.0]
height_mm = 30.0
thickness_mm = 3.0
youngs_modulus_GPa = 70.0
poisson_ratio = 0.3
)";
  EXPECT_HAS(compliance_again("[workpiece]\n" + plate), "[workpiece]\n" + plate);
  const SceneFolder folder;
  const std::string field =
      "kind = \"field\"\nfile = \"" + folder.write("wall.csv", field_csv).string() + "\"\n";
  EXPECT_HAS(compliance_again("[workpiece]\n" + field), "[workpiece]\n" + field);
}

TEST(SceneCompliance, StiffnessesAreWrittenAsTheirMatrix) {
  const std::string text = R"(
[axis.X]
stiffness_N_per_um = [50, 2, 40]
turning_stiffness_Nm_per_urad = [1, 2, 4]
turn_deg = [10, 20, 30]
[axis.S]
stiffness_N_per_um = [80, 80, 160]
[fixture]
turning_stiffness_Nm_per_urad = [0.5, 0.5, 0.5]
[tool]
stiffness_N_per_um = [20, 20, 100]
section = [{ length_mm = 40, diameter_mm = 10, youngs_modulus_GPa = 600 }]
)";
  const errors::ComplianceErrors soft = read_with_faults(text).compliance;
  const errors::ComplianceErrors again = read_with_faults(compliance_again(text)).compliance;
  ASSERT_EQ(again.joints.size(), 2u);
  EXPECT_EQ(again.joints[0].C, soft.joints[0].C);
  EXPECT_EQ(again.joints[1].C, soft.joints[1].C);
  EXPECT_EQ(again.joints[1].axis, 'S');
  EXPECT_EQ(again.fixture, soft.fixture);
  EXPECT_EQ(again.tool, soft.tool);
}

const std::string vtu = R"(<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="2" NumberOfCells="0"><PointData>
<DataArray Name="compliance_um_per_N" type="Float64" NumberOfComponents="6" format="ascii">
1 2 3 0.1 0 0 4 5 6 0 0 -0.5</DataArray></PointData><Points>
<DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 10 0 0</DataArray>
</Points></Piece></UnstructuredGrid></VTKFile>
)";

TEST(SceneCompliance, ReadsAFieldFromVtuWhereItCan) {
  const SceneFolder folder;
  const std::string file = folder.write("wall.vtu", vtu).string();
  const std::string text = "workpiece = { kind = \"field\", file = \"" + file + "\" }";
#if ABBE_RENDER
  const ReadCompliance r = read_with_faults(text);
  ASSERT_EQ(r.input_errors, "");
  const auto& field = std::get<errors::WorkpieceField>(*r.compliance.workpiece);
  EXPECT_NEAR(field.compliance_w[0](0, 1), 1e-4, 1e-19);
  EXPECT_NEAR(field.compliance_w[1](2, 0), -5e-4, 1e-19);
  std::string bad = vtu;
  bad.replace(bad.find("4 5 6"), 5, "4 -5 6");
  folder.write("wall.vtu", bad);
  EXPECT_TRUE(refused(text, "negative eigenvalues at node 2"));
  bad.resize(300);
  folder.write("wall.vtu", bad);
  EXPECT_TRUE(refused(text, "wall.vtu"));
#else
  EXPECT_TRUE(refused(text, "-DABBE_RENDER=ON"));
#endif
}

}  // namespace
}  // namespace abbe::sim
