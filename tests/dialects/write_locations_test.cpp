#include "sim/dialects/read_program.h"
#include "sim/program/block_motion.h"
#include "sim/program/path_meter.h"
#include "sim/program/program_writers.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects {
namespace {

namespace machines_of = program::test;
using program::LocationOptions;

/// Every kind of move: axes and tip, with and without turning, arcs in three planes, a helix.
const std::string all_moves =
    "G21 G90 G94 G17\nT3 M6\nS3000 M3 M8\nG0 X40 Y10 Z20\nG1 Z5 F600\nX60 A10 C20\n"
    "G2 X80 Y10 I10 J0\nG18 G3 X90 Z15 I0 K10\nG19 G2 Y20 Z5 J0 K-10\nG17 G3 X80 Y30 Z8 I-10 J0\n"
    "G4 P1.5\nM9\nG43.4 H1\nG1 X50 Y40 Z5 A15 C30 F900\nX51 A16\nG2 X61 Y50 I10 J0\n"
    "G3 X61 Y50 I0 J-5\nG1 A20 C35 F300\nG0 Z60 A5 C0\nM5\nM30\n";

program::Path read_as(Dialect dialect, const std::string& text) {
  ReadOptions options;
  options.control = machines_of::options_for(machines_of::gantry());
  options.dialect = dialect;
  return read_program(text, "part.nc", options).path;
}

std::string written(const program::Path& path, const LocationOptions& options) {
  const auto chain = machines_of::gantry();
  program::LocationWriter writer(chain, options);
  writer.add(path);
  return writer.take();
}

/// The tip in the workpiece and the tool axis at an instant.
struct At {
  Vector3d tip, axis;
};

At at_time(const program::Path& path, double t) {
  const auto chain = machines_of::gantry();
  const auto block =
      std::lower_bound(path.blocks.begin(), path.blocks.end() - 1, t,
                       [](const program::Block& one, double time_s) { return one.end_s < time_s; });
  const double u = std::clamp((t - block->start_s) / (block->end_s - block->start_s), 0.0, 1.0);
  const auto T = chain.tool_in_workpiece(program::axes_at(path, *block, chain, u));
  return {T.translation(), T.linear().col(2)};
}

TEST(WriteLocations, ReadAgainTheyAreTheSamePathInTime) {
  const program::Path path = read_as(Dialect::LinuxCnc, all_moves);
  for (const auto kind : {LocationOptions::Kind::Apt, LocationOptions::Kind::Table}) {
    const std::string text = written(path, {.kind = kind});
    const program::Path again = read_as(Dialect::Cl, text);
    // rapids of axes take the time of their way in the workpiece: compare block by block
    double tip = 0.0, axis = 0.0, ends = 0.0;
    std::size_t next = 0;
    for (const program::Block& block : path.blocks) {
      if (block.interpolation == program::Interpolation::Dwell) {
        if (kind == LocationOptions::Kind::Apt) {
          EXPECT_NEAR(again.blocks[next].end_s - again.blocks[next].start_s, 1.5, 1e-12);
          ++next;
        }
        continue;
      }
      const double from = again.blocks[next].start_s;
      const At end = at_time(path, block.end_s);
      while (next < again.blocks.size() &&
             (at_time(again, again.blocks[next].end_s).tip - end.tip).norm() > 1e-6)
        ++next;
      ASSERT_LT(next, again.blocks.size()) << "line " << block.line;
      // turns at the same tip
      while (next + 1 < again.blocks.size() &&
             (at_time(again, again.blocks[next].end_s).axis - end.axis).norm() > 1e-8 &&
             (at_time(again, again.blocks[next + 1].end_s).tip - end.tip).norm() < 1e-6)
        ++next;
      const double to = again.blocks[next++].end_s;
      ends = std::max(ends, (at_time(again, to).axis - end.axis).norm());
      if (block.interpolation == program::Interpolation::Rapid) continue;
      EXPECT_NEAR(to - from, block.end_s - block.start_s, 1e-5 * (block.end_s - block.start_s))
          << "line " << block.line;
      for (int k = 0; k <= 40; ++k) {
        const At a = at_time(path, block.start_s + k / 40.0 * (block.end_s - block.start_s));
        const At b = at_time(again, from + k / 40.0 * (to - from));
        tip = std::max(tip, (a.tip - b.tip).norm());
        axis = std::max(axis, (a.axis - b.axis).norm());
      }
    }
    std::cout << (kind == LocationOptions::Kind::Apt ? "statements" : "table") << ": "
              << again.blocks.size() << " blocks, tip within " << tip << " mm, axis within " << axis
              << " rad, at the ends " << ends << "\n";
    EXPECT_LT(tip, 0.001 + 1e-6);
    EXPECT_LT(ends, 1e-9);
    EXPECT_LT(axis, 1e-4);  // between points, where each machine turns its own axes
  }
}

TEST(WriteLocations, ToolsSpindleCoolantAndFeedsAreStatements) {
  const std::string text = written(read_as(Dialect::LinuxCnc, all_moves), {});
  for (const char* one :
       {"UNITS/MM\n", "LOADTL/3\n", "COOLNT/ON\n", "SPINDL/3000,RPM,CLW\n", "FEDRAT/600,MMPM\n",
        "RAPID\nGOTO/40,10,20,0,0,1\n", "DELAY/1.5\n", "COOLNT/OFF\n", "MOVARC/"})
    EXPECT_HAS(text, one);
  EXPECT_LT(text.find("LOADTL/3"), text.find("SPINDL/3000"));
}

TEST(WriteLocations, CutterLocationsComeBackAsTheyWere) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::string text = "UNITS/MM\nFEDRAT/800\n";
  for (int i = 0; i < 200; ++i) {
    Vector3d axis(unit(random), unit(random), 0.3 + std::abs(unit(random)));
    axis.normalize();
    text += fmt::format("GOTO/{:.7f},{:.7f},{:.7f},{:.10f},{:.10f},{:.10f}\n", 80 * unit(random),
                        80 * unit(random), 80 * unit(random), axis.x(), axis.y(), axis.z());
  }
  const program::Path path = read_as(Dialect::Cl, text);
  const program::Path again = read_as(Dialect::Cl, written(path, {}));
  ASSERT_EQ(again.blocks.size(), path.blocks.size());
  double off = 0.0;
  for (std::size_t i = 0; i < path.blocks.size(); ++i)
    off = std::max(off, (again.blocks[i].end - path.blocks[i].end).head(5).cwiseAbs().maxCoeff());
  std::cout << "200 points and axes come back within " << off << " mm or rad\n";
  EXPECT_LT(off, 1e-7);
}

TEST(WriteLocations, APathThatComesInPiecesIsWrittenAlike) {
  std::string text = "UNITS/MM\nFEDRAT/800\nLOADTL/1\n";
  for (int i = 0; i < 70000; ++i) text += fmt::format("GOTO/{},{},0\n", i % 100, i % 7);
  text += "COOLNT/ON\nLOADTL/2\nGOTO/0,0,50\n";
  ReadOptions options;
  options.control = machines_of::options_for(machines_of::gantry());
  options.dialect = Dialect::Cl;
  const ParsedProgram whole = read_program(text, "part.cl", options);
  const auto chain = machines_of::gantry();
  program::LocationWriter writer(chain, {});
  program::PathMeter meter(chain, {100.0, 1.0}), at_once(chain, {100.0, 1.0});
  std::size_t pieces = 0, most = 0;
  options.on_path_segment = [&](const program::Path& piece) {
    ++pieces;
    most = std::max(most, piece.blocks.size());
    writer.add(piece);
    meter.add(piece);
  };
  std::vector<double> fractions;
  options.progress = [&](double fraction) { fractions.push_back(fraction); };
  const ParsedProgram read = read_program(text, "part.cl", options);
  EXPECT_GE(fractions.size(), 8u);
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_TRUE(fractions.front() >= 0.0 && fractions.back() > 0.9 && fractions.back() <= 1.0);
  at_once.add(whole.path);
  EXPECT_GE(pieces, 3u);
  EXPECT_LE(most, path_segment_blocks + 1);
  EXPECT_TRUE(read.path.blocks.empty());
  EXPECT_EQ(writer.take(), written(whole.path, {}));
  EXPECT_EQ(meter.figures().blocks, whole.path.blocks.size());
  EXPECT_EQ(meter.figures().lines.limited_s, at_once.figures().lines.limited_s);
  ASSERT_EQ(read.path.tool_calls.size(), 2u);
  EXPECT_EQ(read.path.tool_calls[1].before, whole.path.tool_calls[1].before);
  EXPECT_EQ(read.blocks, whole.blocks);
}

}  // namespace
}  // namespace abbe::sim::dialects
