// Every folder of tests/golden with a program.nc is read in the dialect that its name begins with,
// for the gantry or the machine that machine.txt names, and listed; every file of
// tests/corpus/dialects is refused with the faults that expected.txt has for it. With
// ABBE_UPDATE_GOLDEN set the expectations are written instead; then read them.

#include "sim/cut/cut.h"
#include "sim/cut/job.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "sim/program/block_motion.h"
#include "sim/program/sample.h"
#include "tests/dialects/five_posts.h"
#include "tests/program/machines.h"
#include "tests/sim/scene_folder.h"
#include "tests/test.h"

namespace abbe::sim::dialects {
namespace {

namespace machines = program::test;

const fs::path tests = fs::path(ABBE_SOURCE_DIR) / "tests";

bool updates() { return std::getenv("ABBE_UPDATE_GOLDEN") != nullptr; }

std::vector<fs::path> sorted(const fs::path& folder) {
  std::vector<fs::path> found;
  if (fs::exists(folder))
    for (const auto& entry : fs::directory_iterator(folder)) found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  return found;
}

Dialect dialect_of(const std::string& name) {
  for (const Dialect one :
       {Dialect::LinuxCnc, Dialect::Fanuc, Dialect::Siemens, Dialect::Heidenhain, Dialect::Cl})
    if (name.starts_with(std::string(name_of(one)) + "_")) return one;
  return Dialect::Auto;
}

machines::Chain machine_of(const fs::path& folder) {
  const std::string name = machines::file_text((folder / "machine.txt").string());
  if (name.starts_with("three_axis")) return machines::three_axis();
  if (name.starts_with("platform")) return machines::platform();
  if (name.starts_with("trunnion")) return machines::trunnion();
  return machines::gantry();
}

ReadOptions options_for(const fs::path& folder, const std::string& name) {
  ReadOptions options;
  options.control = machines::options_for(machine_of(folder));
  options.dialect = dialect_of(name);
  options.subprogram_folder = folder;
  return options;
}

TEST(DialectGolden, ProgramsMeanWhatTheirListingsSay) {
  int programs = 0;
  for (const fs::path& folder : sorted(tests / "golden")) {
    if (!fs::exists(folder / "program.nc")) continue;
    SCOPED_TRACE(folder.string());
    ++programs;
    const ReadOptions options = options_for(folder, folder.filename().string());
    std::string seen;
    try {
      const std::string text = machines::file_text((folder / "program.nc").string());
      const ParsedProgram read = read_program(text, "program.nc", options);
      seen = machines::listing(read.path, options.control);
      for (const std::string& warning : read.warnings) seen += "warning: " + warning + "\n";
    } catch (const BadInput& fault) {
      seen = std::string(fault.what()) + "\n";
    }
    if (updates()) std::ofstream(folder / "expected.txt") << seen;
    EXPECT_EQ(seen, machines::file_text((folder / "expected.txt").string()));
    EXPECT_EQ(seen.find(": expected "), std::string::npos) << "a golden program is read";
  }
  std::cout << programs << " programs\n";
}

TEST(DialectGolden, WhatIsWrongIsRefusedAllTogether) {
  const fs::path folder = tests / "corpus" / "dialects";
  std::string written;
  int files = 0;
  for (const fs::path& file : sorted(folder)) {
    const std::string name = file.filename().string();
    if (name == "expected.txt") continue;
    ++files;
    const ReadOptions options = options_for(folder, name);
    std::string seen = name + ": accepted";
    try {
      read_program(machines::file_text(file.string()), name, options);
      ADD_FAILURE() << seen;
    } catch (const BadInput& fault) {
      seen = fault.what();
    }
    written += seen + "\n";
  }
  if (updates()) std::ofstream(folder / "expected.txt") << written;
  EXPECT_EQ(written, machines::file_text((folder / "expected.txt").string()));
  std::cout << files << " files\n";
}

}  // namespace
}  // namespace abbe::sim::dialects

// One five-axis part, posted from the same cutter locations for five controls: with one work offset
// of the scene every control cuts the same part.
namespace abbe::sim::dialects::posts {
namespace {

using kinematics::Pose;

constexpr double ball = 4.0, dome = 40.0, rim = 14.0;  // mm, radii

/// A finish of a dome whose top is the zero of the program: rows of the upright tool across the
/// top, then rows around it with the tool leaning outwards by half the slope.
Toolpath finish_of_dome() {
  Toolpath path;
  const auto at = [](double rho, double angle, double lean, bool rapid, double above) {
    const double slope = std::asin(rho / dome);
    const Vector3d out(std::cos(angle), std::sin(angle), 0);
    const Vector3d normal = std::sin(slope) * out + std::cos(slope) * Vector3d::UnitZ();
    const Vector3d axis = std::sin(lean * slope) * out + std::cos(lean * slope) * Vector3d::UnitZ();
    const Vector3d centre = (dome + ball + above) * normal - dome * Vector3d::UnitZ();
    return PostedPoint{centre - ball * axis, lean == 0 ? Vector3d::UnitZ() : axis, rapid};
  };
  path.upright.push_back(at(5, 0, 0, true, 30));
  for (int row = 0; row < 4; ++row)
    for (int i = 0; i <= 12; ++i) path.upright.push_back(at(1 + row, 2 * pi * i / 12, 0, false, 0));
  path.upright.push_back(at(4, 0, 0, true, 30));
  for (int row = 0; row < 10; ++row)
    for (int i = 0; i <= 24; ++i)
      path.leaning.push_back(
          at(5 + row, 2 * pi * i / 24, 0.5, row + i == 0, i == 0 && row == 0 ? 5 : 0));
  path.leaning.push_back(at(rim, 0, 0.5, true, 30));
  return path;
}

struct PartOf {
  const char* machine;
  const char* errors;
};

class SamePart : public testing::TestWithParam<PartOf> {
 protected:
  /// @param offset  of G54, words of a scene; empty states none
  Job job(const std::string& file, const std::string& dialect, const std::string& text,
          const std::string& offset) const {
    folder_.write(file, text);
    return prepare(read_scene(folder_.write(
        "s.toml",
        fmt::format(
            "machine = \"{0}/machines/{1}.toml\"\nerrors = \"{0}/errors/{2}.toml\"\n"
            "[tool]\nkind = \"ball\"\nradius_mm = {3}\nflank_length_mm = 20\nlength_mm = 90\n"
            "[part]\nsurface = \"sphere_cap\"\nradius_mm = {4}\nrim_radius_mm = {5}\n"
            "vertices = 3000\nat_mm = [21, -13, 60]\n"
            "[program]\nfile = \"{6}\"\ndialect = \"{7}\"\n{8}",
            std::string(ABBE_SOURCE_DIR) + "/scenes", GetParam().machine, GetParam().errors, ball,
            dome, rim - 2, file, dialect, offset))));
  }
  SceneFolder folder_;
};

/// The tip and the tool axis in the workpiece, at shares of each block.
std::vector<Pose> way_of(const Job& job) {
  std::vector<Pose> way;
  for (const program::Block& block : job.path.blocks)
    for (const double u : {0.0, 0.21, 0.5, 0.83, 1.0})
      way.push_back(job.machine.control.tool_in_workpiece(
          program::axes_at(job.path, block, job.machine.control, u)));
  return way;
}

TEST_P(SamePart, IsCutFromFiveDialects) {
  const Vector3d zero_w(21, -13, 60);
  const std::string offset = "work_offset.G54 = { X_mm = 21, Y_mm = -13, Z_mm = 60 }\n";
  const Toolpath path = finish_of_dome();
  const Job locations = job("part.cl", "cl", to_locations(path), offset);
  const std::vector<Pose> way = way_of(locations);
  const Cut expected = cut(locations);
  const auto& residual = expected.surface.residual;
  std::cout << fmt::format("{}: {} locations, {} vertices, residual of {:.3f} to {:.3f} um\n",
                           GetParam().machine, path.upright.size() + path.leaning.size(),
                           residual.size(), 1e3 * residual.minCoeff(), 1e3 * residual.maxCoeff());
  ASSERT_TRUE(residual.allFinite()) << "all of it is cut";
  ASSERT_GT(residual.maxCoeff() - residual.minCoeff(), 1e-3) << "a map that shows something";
  for (const Post& post : all_posts()) {
    SCOPED_TRACE(post.name);
    const Job posted =
        job(post.file, post.name, to_post(path, post, locations.machine.control, zero_w), offset);
    const std::vector<Pose> posted_way = way_of(posted);
    ASSERT_EQ(posted_way.size(), way.size());
    double tip = 0.0, axis = 0.0;
    for (std::size_t i = 0; i < way.size(); ++i) {
      tip = std::max(tip, (posted_way[i].translation() - way[i].translation()).norm());
      axis = std::max(axis, (posted_way[i].linear().col(2) - way[i].linear().col(2)).norm());
    }
    const Cut seen = cut(posted);
    ASSERT_EQ(seen.surface.residual.size(), residual.size());
    EXPECT_EQ(seen.surface.status, expected.surface.status);
    const double apart = (seen.surface.residual - residual).cwiseAbs().maxCoeff();
    std::cout << fmt::format(
        "  {}: tip within {:.2e} mm, axis within {:.2e}, residual within "
        "{:.2e} mm\n",
        post.name, tip, axis, apart);
    EXPECT_LT(tip, 1e-6);
    EXPECT_LT(axis, 1e-9);
    EXPECT_LT(apart, 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(Machines, SamePart,
                         testing::Values(PartOf{"trunnion_ca", "trunnion_typical"},
                                         PartOf{"head_head", "head_head_typical"}),
                         [](const auto& info) { return info.param.machine; });

}  // namespace
}  // namespace abbe::sim::dialects::posts
