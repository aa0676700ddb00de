#include "sim/compensation/control_files.h"
#include "tests/compensation/control_cases.h"
#include "tests/oracles/linuxcnc_folder.h"
#include "tests/test.h"

namespace abbe::sim::compensation {
namespace {

using namespace cases;

ParameterTables linuxcnc_tables(const std::vector<ControlFile>& files) {
  return read_control_tables(files, gantry(), ControlFormat::LinuxCnc);
}

AxisTable two_points() {
  return {Y, Y, Vector2d(-10, 20), Vector2d(1e-3, -2e-3), Vector2d(0, 5e-3)};
}

TEST(LinuxCnc, WritesTrimsAndTheIniLinesThatLoadThem) {
  ParameterTables tables = none();
  tables.tables = {two_points()};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::LinuxCnc);
  ASSERT_EQ(made.files.size(), 2u);
  EXPECT_EQ(file(made, "Y.comp").text,
            "-10.00000000 0.00100000 0.00000000\n20.00000000 -0.00200000 0.00500000\n");
  EXPECT_EQ(file(made, "compensation.ini").text,
            "[JOINT_1]\nCOMP_FILE = Y.comp\nCOMP_FILE_TYPE = 1\n");
  EXPECT_TRUE(made.omissions.empty());
  EXPECT_FALSE(made.notes.empty());
}

TEST(LinuxCnc, ATrimIsAddedToTheCommand) {
  const ParameterTables tables = linuxcnc_tables({{"Y.comp", "-10 0.001 0\n20 -0.002 0.005\n"}});
  AxisState state;
  state.q = AxisVector::Zero(6);
  state.q[Y] = 5.0;
  state.direction[Y] = 1;
  EXPECT_NEAR(correction(tables, state)[Y], -0.5e-3, 1e-9);
  state.direction[Y] = -1;
  EXPECT_NEAR(correction(tables, state)[Y], 2.5e-3, 1e-9);
}

TEST(LinuxCnc, ActualPositionsBecomeTrims) {
  const std::string ini = "[JOINT_0]\nCOMP_FILE = x.comp\nCOMP_FILE_TYPE = 0\n";
  // the second row of the example in its manual: it went 2 um too far up, 3 um not far enough down
  const ParameterTables tables = linuxcnc_tables(
      {{"x.comp", "-1 -1.005 -0.995\n0 0.002 -0.003\n1 1.003 0.998\n"}, {"m.ini", ini}});
  ASSERT_EQ(tables.tables.size(), 1u);
  EXPECT_EQ(tables.tables[0].argument_joint, X);
  EXPECT_NEAR(tables.tables[0].upward[1], -0.002, 1e-9);
  EXPECT_NEAR(tables.tables[0].downward[1], 0.003, 1e-9);
  EXPECT_NEAR(tables.tables[0].upward[0], 0.005, 1e-9);
}

TEST(LinuxCnc, AnglesAreDegrees) {
  const ParameterTables tables = linuxcnc_tables({{"A.comp", "0 0.1 0.2\n90 0 0"}});
  EXPECT_DOUBLE_EQ(tables.tables[0].position[1], 0.5 * pi);
  EXPECT_NEAR(tables.tables[0].upward[0], 0.1 * units::deg, 1e-10);
}

TEST(LinuxCnc, OneLineIsAConstant) {
  for (const int type : {0, 1}) {
    const std::string ini =
        "[JOINT_0]\nCOMP_FILE=X.comp\nCOMP_FILE_TYPE=" + std::to_string(type) + "\n";
    const ParameterTables tables =
        linuxcnc_tables({{"X.comp", type == 0 ? "7 7.5 6.5\n" : "7 -0.5 0.5"}, {"m.ini", ini}});
    for (const double q : {-100.0, 7.0, 7.5, 8.0, 100.0}) {
      EXPECT_EQ(correction(tables.tables[0], q, 1), -0.5) << type << " at " << q;
      EXPECT_EQ(correction(tables.tables[0], q, -1), 0.5);
    }
  }
}

TEST(LinuxCnc, AWholeIniIsReadForItsCompFilesOnly) {
  const std::string ini =
      "# machine\n[EMC]\nMACHINE = mill\n; remark\n[JOINT_2]\r\nTYPE = LINEAR\r\n"
      "COMP_FILE = tables/Up.comp \r\n\tCOMP_FILE_TYPE=1\n[JOINT_3]\nMAX = 1\n[HAL]\nCOMP_FILE = "
      "q\n";
  const ParameterTables tables = linuxcnc_tables({{"m.ini", ini}, {"up.comp", "0 1 2\n1 2 3\n"}});
  ASSERT_EQ(tables.tables.size(), 1u);
  EXPECT_EQ(tables.tables[0].argument_joint, Z);
}

TEST(LinuxCnc, SaysWhatItCannotHold) {
  ParameterTables tables = none();
  tables.offset[Z] = -0.0123;
  tables.offset[A] = 4e-6;
  AxisTable cross = two_points();
  cross.corrected_joint = Z;
  AxisTable long_one{X, X, VectorXd::LinSpaced(300, 0, 299), {}, {}};
  long_one.upward = long_one.position.array().square() * 1e-6;
  long_one.downward = long_one.upward;
  AxisTable turned{C, C, Vector2d(0, 6), Vector2d(0, 1e-5), Vector2d(0, 0)};
  tables.tables = {cross, long_one, turned};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::LinuxCnc);
  for (const std::string& sentence : made.omissions) std::cout << sentence << "\n";
  EXPECT_EQ(made.omissions.size(), 4u);
  EXPECT_TRUE(says(made.omissions, "offset of Z, -12.3 um"));
  EXPECT_TRUE(says(made.omissions, "offset of A, 4 urad"));
  EXPECT_TRUE(says(made.omissions, "Z over Y: a COMP_FILE can only correct its own axis"));
  EXPECT_TRUE(says(made.omissions, "X: 300 points, but the control holds only 256"));
  const std::string& text = file(made, "X.comp").text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 256);
  EXPECT_TRUE(says({file(made, "compensation.ini").text}, "[JOINT_4]\nCOMP_FILE = C.comp"));
}

TEST(LinuxCnc, SeveralTablesOfAnAxisAreAddedUp) {
  ParameterTables tables = none();
  AxisTable other{Y, Y, Vector3d(-20, 5, 20), Vector3d(0, 1e-3, 0), Vector3d(0, 0, 1e-3)};
  tables.tables = {two_points(), other};
  std::mt19937 random(7);
  const ControlExport made = to_control(tables, gantry(), ControlFormat::LinuxCnc);
  const Difference d = difference(tables, linuxcnc_tables(made.files), gantry(), random);
  EXPECT_LT(d.mm, 1e-8);
  EXPECT_TRUE(made.omissions.empty());
}

/// What LinuxCNC 2.9 does with such a file, in the words of its manual and in its own steps: lines
/// through sscanf until one is not three numbers, trims and slopes in single precision, constant
/// before the first and after the last entry.
double as_linuxcnc(const std::string& text, double position, bool up) {
  struct Entry {
    double nominal;
    float up, down, up_slope, down_slope;
  };
  std::vector<Entry> entries;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    double nominal = 0.0, forward = 0.0, reverse = 0.0;
    if (std::sscanf(line.c_str(), "%lf %lf %lf", &nominal, &forward, &reverse) != 3) break;
    entries.push_back({nominal, float(forward), float(reverse), 0.0f, 0.0f});
  }
  for (std::size_t k = 0; k + 1 < entries.size(); ++k) {
    const double gap = entries[k + 1].nominal - entries[k].nominal;
    entries[k].up_slope = float((entries[k + 1].up - entries[k].up) / gap);
    entries[k].down_slope = float((entries[k + 1].down - entries[k].down) / gap);
  }
  if (position < entries.front().nominal) position = entries.front().nominal;
  std::size_t k = 0;
  while (k + 1 < entries.size() && position >= entries[k + 1].nominal) ++k;
  const double beyond = k + 1 == entries.size() ? 0.0 : position - entries[k].nominal;
  return up ? entries[k].up + entries[k].up_slope * beyond
            : entries[k].down + entries[k].down_slope * beyond;
}

TEST(LinuxCnc, WhatIsReadIsWhatItsMotionControllerDoes) {
  SeededRandom random(20250701);
  const Chain chain = gantry();
  double largest = 0.0;
  for (int run = 0; run < 10; ++run) {
    const ParameterTables tables = any_tables(chain, random, {false, true, run % 2 == 0, 256});
    for (const ControlFile& f : to_control(tables, chain, ControlFormat::LinuxCnc).files) {
      if (f.name == "compensation.ini") continue;
      const ParameterTables back = linuxcnc_tables({f});
      const AxisTable& table = back.tables.at(0);
      const double unit = table.argument_joint == A ? units::deg : 1.0;
      std::uniform_real_distribution<double> anywhere(-450.0, 300.0);
      for (int k = 0; k < 100; ++k) {
        const double q = anywhere(random);
        for (const bool up : {true, false})
          largest = std::max(largest, std::abs(correction(table, q * unit, up ? 1 : -1) / unit -
                                               as_linuxcnc(f.text, q, up)));
      }
    }
  }
  std::cout << "largest difference " << largest << " mm or degrees\n";
  EXPECT_LT(largest, 1e-8) << "single precision of slopes";
}

TEST(LinuxCnc, RandomTablesComeBack) {
  SeededRandom random(20250702);
  const Chain chain = gantry();
  Difference largest;
  for (int run = 0; run < 100; ++run) {
    const ParameterTables tables = any_tables(chain, random, {false, true, run % 2 == 0, 256});
    const ControlExport made = to_control(tables, chain, ControlFormat::LinuxCnc);
    EXPECT_TRUE(made.omissions.empty());
    const ParameterTables back = linuxcnc_tables(made.files);
    ASSERT_EQ(back.tables.size(), tables.tables.size());
    for (std::size_t k = 0; k < tables.tables.size(); ++k)
      EXPECT_EQ(back.tables[k].corrected_joint, tables.tables[k].corrected_joint);
    const Difference d = difference(tables, back, chain, random);
    largest.mm = std::max(largest.mm, d.mm);
    largest.rad = std::max(largest.rad, d.rad);
  }
  std::cout << largest.mm << " mm, " << largest.rad << " rad\n";
  // half a digit, single precision of 20 um, and half a digit of position on the steepest piece
  EXPECT_LT(largest.mm, 0.5e-8 + 1e-9 + 0.5e-8 * 0.05);
  EXPECT_LT(largest.rad, (0.5e-8 + 1e-9 + 0.5e-8 * 0.05) * units::deg);
}

TEST(LinuxCnc, RefusesByLineAndColumn) {
  const auto at = [](const std::string& text) {
    return refusal([&] { linuxcnc_tables({{"X.comp", text}}); });
  };
  EXPECT_EQ(at("0 0 0\n1 0 0\n"), Place{});
  EXPECT_EQ(at("0 0 0\n1 0 zero\n"), (Place{2, 5}));
  EXPECT_EQ(at("0 0 0\n1 0\n"), (Place{2, 4}));
  EXPECT_EQ(at("0 0 0\n 1 0 0 0\n"), (Place{2, 8}));
  EXPECT_EQ(at("# X\n0 0 0\n"), (Place{1, 1})) << "LinuxCNC would load nothing";
  EXPECT_EQ(at("0 0 0\n\n1 0 0\n"), (Place{3, 1})) << "LinuxCNC would stop before the third line";
  EXPECT_EQ(at("\n0 0 0\n"), (Place{2, 1}));
  EXPECT_EQ(at("0 0 0\n0 0 0\n"), (Place{2, 1}));
  EXPECT_EQ(at("0 0 0\n-1 0 0\n"), (Place{2, 1}));
  EXPECT_EQ(at("0 nan 0\n"), (Place{1, 3}));
  EXPECT_EQ(at("0 0 1e99\n"), (Place{1, 5}));
  EXPECT_EQ(at(std::string("0 0 \0", 5)), (Place{1, 5}));
  EXPECT_EQ(at("").line, 0);
  EXPECT_EQ(at("0" + std::string(300, ' ') + "0 0\n"), (Place{1, 255}));
  std::string many;
  for (int k = 0; k < 257; ++k) many += std::to_string(k) + " 0 0\n";
  EXPECT_EQ(at(many), (Place{257, 1}));
}

TEST(LinuxCnc, RefusesAnIniByLineAndColumn) {
  const std::string ini = "[JOINT_0]\nCOMP_FILE = X.comp\nCOMP_FILE_TYPE = 1\n";
  const auto at = [&](const std::string& from, const std::string& to) {
    return refusal([&] {
      linuxcnc_tables({{"m.ini", with(ini, from, to)}, {"X.comp", "0 0 0\n1 0 0"}});
    });
  };
  EXPECT_EQ(at("_0", "_0"), Place{});
  EXPECT_EQ(at("_0", "_5"), (Place{1, 8})) << "the machine has joints 0 to 4";
  EXPECT_EQ(at("_0", "_x"), (Place{1, 8}));
  EXPECT_EQ(at("]", ""), (Place{1, 1}));
  EXPECT_EQ(at("X.comp", "Y.comp"), (Place{2, 13}));
  EXPECT_EQ(at("X.comp", ""), (Place{2, 13}));
  EXPECT_EQ(at("TYPE = 1", "TYPE = 2"), (Place{3, 18}));
  EXPECT_EQ(at("COMP_FILE_TYPE = 1\n", ""), (Place{1, 1}));
  EXPECT_EQ(at("[JOINT_0]\n", "[JOINT_0]\n[JOINT_0]\n"), (Place{2, 8}));
  EXPECT_EQ(at("COMP_FILE =", "COMP_FILE = a\nCOMP_FILE ="), (Place{3, 13}));
  EXPECT_EQ(at("COMP_FILE =", "FILE ="), (Place{0, 0})) << "X.comp would not be loaded";
}

TEST(LinuxCnc, AFileIsNamedAfterItsAxis) {
  const std::string text = "0 0 0\n1 0 0\n";
  const auto refused = [&](const std::vector<ControlFile>& files) {
    return refusal([&] { linuxcnc_tables(files); }) != Place{};
  };
  EXPECT_FALSE(refused({{"tables/x.comp", text}}));
  EXPECT_TRUE(refused({{"B.comp", text}})) << "the machine has none";
  EXPECT_TRUE(refused({{"s.comp", text}}));
  EXPECT_TRUE(refused({{"pitch.comp", text}}));
  EXPECT_TRUE(refused({{"", text}}));
  EXPECT_TRUE(refused({{"X.comp", text}, {"x.COMP", text}}));
  EXPECT_TRUE(refused({{"X.comp", text}, {"X.txt", text}}));
  EXPECT_TRUE(linuxcnc_tables({}).tables.empty());
}

/// Loaded before LinuxCNC's own task controller, which then does nothing but load one file: it gets
/// memory in place of what it would share with the motion controller, clocks in which nobody
/// answers, and prints what it would have sent, a line a command.
const char* const in_its_stead = R"(
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static unsigned char* memory;
static size_t size;
int rtapi_init(const char* name) { return 1; }
int rtapi_exit(int module) { return 0; }
int rtapi_shmem_new(int key, int module, unsigned long bytes) {
  size = bytes;
  memory = calloc(1, bytes);
  return 1;
}
int rtapi_shmem_getptr(int id, void** pointer) { *pointer = memory; return 0; }
int rtapi_shmem_delete(int id, int module) { return 0; }
static void show(void) {
  double last[3] = {0.0, 0.0, 0.0};
  for (size_t i = 0; i + 8 <= size; i += 8) {
    double x;
    memcpy(&x, memory + i, 8);
    if (fabs(x) > 1e-9 && fabs(x) < 1e9) last[0] = last[1], last[1] = last[2], last[2] = x;
  }
  if (last[0] != 0.0) printf("sent %.17g %.17g %.17g\n", last[0], last[1], last[2]);
}
double etime(void) { static double t; show(); return t += 1000.0; }
void esleep(double seconds) {}
/* It sends commands that it has filled only in part: one whose number is below zero by chance of
   what lies on the stack is not sent. */
static __attribute__((noinline)) void clear_stack(void) {
  volatile char below[1 << 17];
  for (size_t i = 0; i < sizeof below; ++i) below[i] = 0;
}
int __libc_start_main(void* a, int b, char** c, void* d, void* e, void* f, void* g) {
  int (*init)(const char*) = (int (*)(const char*))dlsym(RTLD_DEFAULT, "usrmotInit");
  int (*load)(int, const char*, int) =
      (int (*)(int, const char*, int))dlsym(RTLD_DEFAULT, "usrmotLoadComp");
  if (!init || !load || init("test") != 0) exit(3);
  const char* file = getenv("ABBE_COMP_FILE");
  int type = atoi(getenv("ABBE_COMP_TYPE"));
  clear_stack();
  load(0, file, type);
  show();
  fflush(stdout);
  _Exit(0);
}
)";

using Triplet = std::array<double, 3>;

/// Triplets that LinuxCNC itself loads from a file; every number must differ from zero.
std::vector<Triplet> loaded_by_linuxcnc(const fs::path& linuxcnc, const fs::path& folder,
                                        const std::string& text, int type) {
  std::ofstream(folder / "axis.comp") << text;
  const std::string usr = (linuxcnc / "usr").string(), here = folder.string();
  const std::string command =
      "ABBE_COMP_FILE=" + here + "/axis.comp ABBE_COMP_TYPE=" + std::to_string(type) +
      " LD_LIBRARY_PATH=" + usr + "/lib:" + usr + "/lib/x86_64-linux-gnu LD_PRELOAD=" + here +
      "/stead.so " + usr + "/bin/milltask 2>/dev/null";
  std::vector<Triplet> triplets;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (!pipe) return triplets;
  for (std::array<char, 256> line; std::fgets(line.data(), int(line.size()), pipe);) {
    Triplet t;  // among what it says of the silence
    if (std::sscanf(line.data(), "sent %lf %lf %lf", &t[0], &t[1], &t[2]) != 3) continue;
    if (triplets.empty() || triplets.back() != t) triplets.push_back(t);
  }
  EXPECT_EQ(::pclose(pipe), 0);
  return triplets;
}

TEST(LinuxCnc, ItselfLoadsTheFilesAsTheyAreRead) {
  const auto linuxcnc = oracles::linuxcnc_folder();
  if (!linuxcnc) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const auto folder = fs::temp_directory_path() / ("abbe-linuxcnc-" + std::to_string(::getpid()));
  fs::create_directories(folder);
  std::ofstream(folder / "stead.c") << in_its_stead;
  const std::string here = folder.string();
  if (std::system(
          ("cc -w -shared -fPIC -o " + here + "/stead.so " + here + "/stead.c -ldl -lm").c_str()) !=
      0)
    GTEST_SKIP() << "no C compiler";
  SeededRandom random(20250707);
  const Chain chain = gantry();
  const ParameterTables tables = any_tables(chain, random, {false, true, false, 256});
  int lines = 0;
  for (const ControlFile& f : to_control(tables, chain, ControlFormat::LinuxCnc).files) {
    if (f.name == "compensation.ini") continue;
    for (const int type : {0, 1}) {
      const std::vector<Triplet> theirs = loaded_by_linuxcnc(*linuxcnc, folder, f.text, type);
      const std::string joint = std::to_string(std::string("XYZA").find(f.name[0]));
      const AxisTable ours =
          linuxcnc_tables({f,
                           {"m.ini", "[JOINT_" + joint + "]\nCOMP_FILE = " + f.name +
                                         "\nCOMP_FILE_TYPE = " + std::to_string(type)}})
              .tables.at(0);
      const double unit = f.name == "A.comp" ? units::deg : 1.0;
      ASSERT_EQ(Index(theirs.size()), ours.position.size()) << f.name;
      for (std::size_t k = 0; k < theirs.size(); ++k) {
        const auto i = Index(k);
        EXPECT_EQ(theirs[k][0] * unit, ours.position[i]);
        EXPECT_EQ(double(float(theirs[k][1])) * unit, ours.upward[i]);
        EXPECT_EQ(double(float(theirs[k][2])) * unit, ours.downward[i]);
      }
      lines += int(theirs.size());
    }
  }
  fs::remove_all(folder);
  std::cout << lines << " lines loaded alike\n";
  EXPECT_GT(lines, 200);
}

}  // namespace
}  // namespace abbe::sim::compensation
