// The machined body of a scene against its design: a planted gouge, its clean twin, what is left.

#include "sim/report/stock_check.h"
#include <nlohmann/json.hpp>
#include "cutting/map/residual.h"
#include "sim/commands/scene_runs.h"
#include "sim/cut/judged_surface.h"
#include "sim/report/summary.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

/// A flat at z = 78 of the machine, milled by a flat R5 in strips that overlap, on the three-axis
/// machine without errors; the block reaches 2 mm higher.
std::string checked_scene_text(const std::string& more) {
  return fmt::format(
      "machine = \"{0}machines/three_axis_table.toml\"\n"
      "[tool]\nkind = \"flat\"\nradius_mm = 5\nflank_length_mm = 10\nlength_mm = 80\n"
      "[part]\nsurface = \"rectangle\"\nlength_x_mm = 30\nlength_y_mm = 20\nat_mm = [0, 0, 78]\n"
      "vertices = 400\n"
      "[program]\nfile = \"flat.ngc\"\nwork_offset.G54 = {{ Z_mm = -20 }}\n"
      "[cutting]\nblank = \"box\"\nlower_mm = [-20, -15, -18]\nupper_mm = [20, 15, 2]\n"
      "directions = 3\n{1}",
      packaged("").string(), more);
}

/// Strips at z over the block; `between` stands after the strip in the middle.
std::string program_text(const std::string& between = "", int strips = 6) {
  std::string text = "G17 G21 G90 G94\nG49\nS6000 M3\nG0 Z100\n";
  for (int i = 0; i < strips; ++i) {
    const double y = -15.0 + 6.0 * i;
    text += fmt::format("G0 X-30 Y{}\nG0 Z78\nG1 X30 F1200\nG0 Z100\n", y);
    if (i == 3) text += between;
  }
  return text + "M2\n";
}

struct CheckedRun {
  Outcome outcome;
  nlohmann::json summary;
  const nlohmann::json& stock() const { return summary.at("stock"); }
};
CheckedRun ran(const SceneFolder& folder, const std::string& program,
               const std::string& more = "") {
  folder.write("flat.ngc", program);
  const auto file = folder.write("flat.toml", checked_scene_text(more));
  RunOptions options;
  options.folder = folder.path() / "out";
  CheckedRun all{run(file, options), {}};
  std::ifstream in(options.folder / "summary.json");
  all.summary = nlohmann::json::parse(in);
  return all;
}

bool warns(const CheckedRun& all, const std::string& what) {
  for (const auto& warning : all.summary.at("warnings"))
    if (warning.get<std::string>().find(what) != std::string::npos) return true;
  return false;
}

/// Says what of a map its body does not show, in all that is said of the body.
TEST(StockCheck, TheBodyNamesTheEffectsThatItDoesNotShow) {
  const std::vector<Override> coarse{{"cutting.spacing_mm", "1"}, {"part.vertices", "500"}};
  const Job wall = job_of("thin_wall.toml", coarse);
  const Verdict verdict = judge(wall, cut(wall), nullptr);
  ASSERT_GT(*verdict.residual.max, 3e-3) << "the wall bends";
  const auto check = stock_check(wall, verdict);
  const std::string springs = "the body does not show material that springs back from the flank";
  ASSERT_EQ(check->omitted_effects.size(), 1u);
  EXPECT_TRUE(check->omitted_effects.front().starts_with(springs))
      << check->omitted_effects.front();
  EXPECT_HAS(to_text(*check), springs);
  EXPECT_EQ(to_json(*check).at("left_out").size(), 1u);
  const Verdict error_free = judge(wall, cut_error_free(wall), nullptr);
  EXPECT_TRUE(stock_check(wall, error_free)->omitted_effects.empty());
  const SceneFolder folder;
  EXPECT_TRUE(ran(folder, program_text()).stock().at("left_out").empty()) << "nothing yields";
}

TEST(StockCheck, ACleanCutHasNoFinding) {
  const SceneFolder folder;
  const CheckedRun all = ran(folder, program_text());
  const nlohmann::json& stock = all.stock();
  for (const char* kind : {"rest", "gouges", "undercuts"}) {
    EXPECT_EQ(stock.at(kind).at("regions"), 0) << kind;
    EXPECT_EQ(stock.at(kind).at("speckles"), 0) << kind;
    EXPECT_TRUE(stock.at(kind).at("list").empty()) << kind;
  }
  EXPECT_EQ(stock.at("design"), "open");
  EXPECT_NEAR(stock.at("compared_mm2").get<double>(), 600.0, 30.0);
  EXPECT_FALSE(warns(all, "gouge"));
  const std::string text = to_text(std::get<Summary>(all.outcome.figures));
  EXPECT_HAS(text, "no rest material beyond 50 um, no gouge beyond 50 um, no undercut");
}

TEST(StockCheck, APlantedGougeIsFoundWithItsPlaceAndLine) {
  const SceneFolder folder;
  // a plunge of 0.3 mm too deep, at (4, 2) of the part
  const CheckedRun all = ran(folder, program_text("G0 X4 Y2\nG0 Z80\nG1 Z77.7 F300\nG0 Z100\n"));
  const nlohmann::json& gouges = all.stock().at("gouges");
  ASSERT_EQ(gouges.at("regions"), 1);
  EXPECT_EQ(all.stock().at("rest").at("regions"), 0);
  const nlohmann::json& gouge = gouges.at("list").at(0);
  const double expected = pi * 25 * 0.3;
  std::cout << "gouge " << gouge.at("volume_mm3") << " of " << expected << " mm^3\n";
  EXPECT_NEAR(gouge.at("volume_mm3").get<double>(), expected, 2 * pi * 5 * 0.3 * 0.25);
  EXPECT_NEAR(gouge.at("depth_mm").get<double>(), 0.3, 1e-6);
  EXPECT_NEAR(gouge.at("area_mm2").get<double>(), pi * 25, 2 * pi * 5 * 0.75);
  EXPECT_EQ(gouge.at("line"), 23);
  EXPECT_FALSE(gouge.at("by_crash").get<bool>());
  EXPECT_FALSE(gouge.at("is_at_least").get<bool>());
  EXPECT_LT(std::hypot(gouge.at("at_mm").at(0).get<double>() - 4,
                       gouge.at("at_mm").at(1).get<double>() - 2),
            5.0);
  EXPECT_TRUE(warns(all, "gouged in 1 place, deepest 0.3 mm at ("));
  EXPECT_TRUE(warns(all, ") of the workpiece, line 23"));
  const std::string text = to_text(std::get<Summary>(all.outcome.figures));
  EXPECT_HAS(text, "gouge: ");
  EXPECT_HAS(text, " mm^3 in 1 place, deepest 0.3 mm at (");
  EXPECT_HAS(text, ") of the workpiece, line 23");
}

TEST(StockCheck, TheLimitsOfTheSceneDecide) {
  const SceneFolder folder;
  const std::string deep = program_text("G0 X4 Y2\nG0 Z80\nG1 Z77.7 F300\nG0 Z100\n");
  EXPECT_EQ(ran(folder, deep, "gouge_um = 310\n").stock().at("gouges").at("regions"), 0);
  EXPECT_EQ(ran(folder, deep, "gouge_um = 290\n").stock().at("gouges").at("regions"), 1);
}

TEST(StockCheck, AStripThatIsLeftOutIsRestMaterialOfTheBlank) {
  const SceneFolder folder;
  std::string program = program_text();
  const std::string strip = "G0 X-30 Y3\nG0 Z78\nG1 X30 F1200\nG0 Z100\n";
  program.erase(program.find(strip), strip.size());
  const CheckedRun all = ran(folder, program);
  ASSERT_EQ(all.stock().at("rest").at("regions"), 1);
  const nlohmann::json& rest = all.stock().at("rest").at("list").at(0);
  // between the strips at y = -3 and 9, of the design 30 mm long, 2 mm high
  EXPECT_NEAR(rest.at("volume_mm3").get<double>(), 2 * 2 * 30, 0.25 * 120);
  EXPECT_NEAR(rest.at("depth_mm").get<double>(), 2.0, 1e-6);
  EXPECT_EQ(rest.at("line"), 0);
  const std::string text = to_text(std::get<Summary>(all.outcome.figures));
  EXPECT_HAS(text, "rest material: ");
  EXPECT_HAS(text, "never cut");
}

TEST(StockCheck, TheTextSaysHowManyPlacesItLeavesOut) {
  const SceneFolder folder;
  std::string plunges;
  for (const char* at : {"X-10 Y-6", "X10 Y-6", "X-10 Y6", "X10 Y6"})
    plunges += fmt::format("G0 {}\nG0 Z80\nG1 Z77 F500\nG1 Z100 F3000\n", at);
  const CheckedRun all = ran(folder, program_text(plunges, 7));
  ASSERT_EQ(all.stock().at("gouges").at("regions"), 4);
  const std::string text = to_text(std::get<Summary>(all.outcome.figures));
  EXPECT_HAS(text, "\n  1 more in summary.json\n");
}

TEST(StockCheck, TheBodyIsWrittenAsStlAndRemovedWhereThereIsNone) {
  const SceneFolder folder;
  ran(folder, program_text());
  const auto stl = folder.path() / "out" / "stock.stl";
  std::ifstream in(stl, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(in)), {});
  ASSERT_GT(bytes.size(), 84u);
  EXPECT_EQ(bytes.substr(0, 5), "abbe ");
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, 4);
  EXPECT_EQ(bytes.size(), 84 + 50 * std::size_t(count));
  double volume = 0.0;  // by the divergence theorem, of a block of 40 x 30 x 18
  for (std::size_t t = 0; t < count; ++t) {
    float p[9];
    std::memcpy(p, bytes.data() + 84 + 50 * t + 12, sizeof p);
    const Vector3d a(p[0], p[1], p[2]), b(p[3], p[4], p[5]), c(p[6], p[7], p[8]);
    volume += a.dot(b.cross(c)) / 6;
  }
  EXPECT_NEAR(volume, 40 * 30 * 18, 0.01 * 40 * 30 * 18);
  in.close();
  const auto bare = folder.write("bare.toml", [] {
    std::string text = checked_scene_text("");
    return text.substr(0, text.find("[cutting]"));
  }());
  RunOptions options;
  options.folder = folder.path() / "out";
  run(bare, options);
  EXPECT_FALSE(fs::exists(stl));
}

TEST(StockCheck, ComparedCasesNameTheirGouges) {
  const SceneFolder folder;
  folder.write("flat.ngc", program_text("G0 X4 Y2\nG0 Z80\nG1 Z77.7 F300\nG0 Z100\n"));
  const auto file = folder.write("flat.toml", checked_scene_text(""));
  RunOptions options;
  options.folder = folder.path() / "out";
  const Outcome outcome = compare(file, options);
  std::size_t named = 0;
  for (const std::string& warning : std::get<Comparison>(outcome.figures).warnings)
    named += warning.find(": the machined body is gouged in 1 place") != std::string::npos;
  EXPECT_EQ(named, 2u) << "error_free and uncompensated";
}

// Parts thinner than the search band: a ray through one must not start beyond its far side.

/// A pin of 1.4 mm diameter turned by a round insert R 3, its band 2 mm.
TEST(ThinPart, IsCutAlikeAtItsVerticesAndBetweenThem) {
  const SceneFolder folder;
  const std::string scenes = packaged("").string();
  folder.write("pin.ngc", "G18 G21 G90 G94\nS2500 M3\nG0 X3.7 Z6\nG1 Z-1 F500\nG0 X25\nM5\nM30\n");
  const Job job = sampled(prepare(read_scene(folder.write(
      "pin.toml", "machine = \"" + scenes + "machines/lathe_zx.toml\"\ntool = \"" + scenes +
                      "tools/insert_r3_long.toml\"\n[part]\nsurface = \"cylinder\"\n"
                      "radius_mm = 0.7\nheight_mm = 2\nvertices = 500\n[program]\n"
                      "file = \"pin.ngc\"\n"))));
  const Cut cut = cut_error_free(job);
  const cutting::Statistics all = cutting::statistics(cut.surface, job.design_w);
  EXPECT_EQ(all.cut_vertices, all.vertices);
  ASSERT_TRUE(cut.interpolation);
  std::cout << "PV " << 1e3 * *all.pv << " um, " << cut.interpolation->places
            << " places between, worst " << 1e3 * cut.interpolation->worst << " um off\n";
  EXPECT_EQ(cut.interpolation->places, 2000);
  EXPECT_LT(cut.interpolation->worst, 1.1 * *all.pv);
}

}  // namespace
}  // namespace abbe::sim
