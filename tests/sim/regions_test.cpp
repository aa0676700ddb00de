// Regions of a part by what its mesh file says of its faces: groups and colours.

#include <nlohmann/json.hpp>
#include "sim/cut/judged_surface.h"
#include "sim/cut/part_regions.h"
#include "sim/report/check_report.h"
#include "sim/report/verdict.h"
#include "sim/scene/fields.h"
#include "sim/scene/part.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/small_scene.h"
#include "tests/sim/written_section.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

/// A block of 8 x 6 x 4, its top at z = 0 in two halves: "left" with x < 0, red, and "right", blue;
/// its walls and bottom are green, each a group.
std::string two_coloured_obj() {
  std::string text = "mtllib paint.mtl\n";
  for (const double z : {0.0, -4.0})
    for (const double y : {-3.0, 3.0})
      for (const double x : {-4.0, 0.0, 4.0}) text += fmt::format("v {} {} {}\n", x, y, z);
  return text +
         "g top left\nusemtl red\nf 1 2 5 4\ng top right\nusemtl blue\nf 2 3 6 5\n"
         "usemtl green\ng bottom\nf 7 10 11 8\nf 8 11 12 9\n"
         "g wall_y-\nf 1 7 8 2\nf 2 8 9 3\ng wall_y+\nf 4 5 11 10\nf 5 6 12 11\n"
         "g wall_x-\nf 1 4 10 7\ng wall_x+\nf 3 9 12 6\n";
}

const std::string paint =
    "newmtl red\nKd 0.8 0.1 0.1\nnewmtl blue\nKd 0 0 1\nnewmtl green\nKd 0.2 0.6 0.2\n";

/// The block under a raster, its part with more keys and regions.
struct BlockScene {
  SceneFolder folder = {};
  std::string keys = "sampling = \"vertices\"\n";
  std::string regions = {};
  std::string more = {};
  fs::path file() const {
    folder.write("block.obj", two_coloured_obj());
    folder.write("paint.mtl", paint);
    return folder.write(
        "block.toml", to_toml(BallRaster{.part = "name = \"block\"\nfile = \"block.obj\"\nat_mm = "
                                                 "[40, 25, 80]\n" +
                                                 keys + regions,
                                         .lead = 0.0,
                                         .more = more}));
  }
};

std::string region_text(const std::string& name, const std::string& keys) {
  return "[[part.region]]\nname = \"" + name + "\"\n" + keys + "\n";
}

std::string refusal_of_job(const fs::path& file) {
  return thrown_text<BadInput>([&] { prepare(read_scene(file)); }, "accepted");
}

bool has_warning(const Job& job, const std::string& text) {
  return std::ranges::any_of(job.warnings,
                             [&](const auto& one) { return one.find(text) != std::string::npos; });
}

TEST(Regions, KeysOfFacesAreReadAndWritten) {
  const SceneFolder folder;
  const std::string file = folder.write("a.stl", "").string();
  const std::string text = "file = \"" + file +
                           "\"\n[[region]]\nname = \"bore\"\nz_mm = [0.0, 1.0]\ngroup = \"Fläche "
                           "1\"\ncolour = \"#FF8000\"\n";
  const PartDescription part = read_section(text, read_part);
  EXPECT_EQ(part.regions.at(0).group, "Fläche 1");
  EXPECT_EQ(part.regions.at(0).colour, (cutting::Rgb{255, 128, 0}));
  EXPECT_EQ(part.regions.at(0).position.line, 2);
  const std::string again = written_again(text, read_part, part_to_table);
  EXPECT_HAS(again, "group = \"Fläche 1\"\ncolour = \"#ff8000\"\n");
  EXPECT_TRUE(required_marks(part).groups && required_marks(part).colours);
  EXPECT_FALSE(required_marks(read_section("file = \"" + file + "\"\n", read_part)).any());
}

TEST(Regions, KeysThatCannotBeAreRefusedAtTheirPlace) {
  const auto input_errors = [](const std::string& text) {
    InputErrors found;
    read_part(parse_toml(text, "s.toml"), found);
    std::string all;
    for (const BadInput& fault : found.list()) all += std::string(fault.what()) + "\n";
    return all;
  };
  const std::string disc = "surface = \"disc\"\nradius_mm = 10.0\n[[region]]\nname = \"a\"\n";
  EXPECT_HAS(input_errors(disc + "group = \"b\"\n"),
             "s.toml:5:9: expected a part from a mesh `file`, seen a declared surface");
  EXPECT_HAS(input_errors(disc + "colour = \"#ffffff\"\n"), "a part from a mesh `file`");
  for (const char* colour :
       {"\"red\"", "\"#fff\"", "\"#gggggg\"", "\"ff00ff\"", "\"\"", "16711680", "[1, 2, 3]"})
    EXPECT_HAS(input_errors(disc + "colour = " + colour + "\n"), "s.toml:5:10") << colour;
  EXPECT_HAS(input_errors(disc + "group = \"\"\n"), "s.toml:5:9");
  EXPECT_HAS(input_errors(disc + "color = \"#ffffff\"\n"), "nearest: part.region.colour");
}

TEST(Regions, WhatTheMeshDoesNotHaveIsRefusedWithWhatItHas) {
  EXPECT_HAS(refusal_of_job(BlockScene{.regions = region_text("a", "group = \"lefft\"")}.file()),
             "expected a part.region.group of the mesh: \"blue\", \"bottom\", \"green\", "
             "\"left\", \"red\", \"right\", \"top\", \"top left\", \"top right\", \"wall_x+\", "
             "\"wall_x-\", \"wall_y+\", \"wall_y-\", seen \"lefft\" (nearest: \"left\")");
  const BlockScene colour{.regions = region_text("a", "colour = \"#0000f0\"")};
  const std::string said = refusal_of_job(colour.file());
  EXPECT_HAS(said,
             "expected a part.region.colour of the mesh: \"#0000ff\", \"#339933\", "
             "\"#cc1a1a\", seen \"#0000f0\" (nearest: \"#0000ff\")");
  EXPECT_HAS(said, "block.toml:");
  const SceneFolder folder;
  std::istringstream lines(two_coloured_obj());
  std::string obj;
  for (std::string line; std::getline(lines, line);)
    if (line[0] == 'v' || line[0] == 'f') obj += line + "\n";
  folder.write("block.obj", obj);
  const auto file = [&](const std::string& region) {
    return folder.write("a.toml", to_toml(BallRaster{.part = "file = \"block.obj\"\n" + region}));
  };
  EXPECT_HAS(refusal_of_job(file(region_text("a", "group = \"b\""))),
             "seen \"b\" for a mesh without groups");
  EXPECT_HAS(refusal_of_job(file(region_text("a", "colour = \"#0000ff\""))),
             "seen \"#0000ff\" for a mesh without face colours");
}

TEST(Regions, MissingLibraryOfMaterialsIsSaidOnlyWhereAColourIsAskedFor) {
  const BlockScene with_group{.regions = region_text("a", "group = \"left\"")};
  const auto file = with_group.file();
  fs::remove(with_group.folder.path() / "paint.mtl");
  EXPECT_EQ(refusal_of_job(file), "accepted");
  const BlockScene with_colour{.regions = region_text("a", "colour = \"#0000ff\"")};
  const auto other = with_colour.file();
  EXPECT_EQ(read_scene(other).files.back().filename(), "paint.mtl") << "no result may replace it";
  fs::remove(with_colour.folder.path() / "paint.mtl");
  EXPECT_HAS(refusal_of_job(other), "block.obj:1:8: expected the file paint.mtl next to the OBJ");
}

TEST(Regions, SharesOfABlockAreItsExactAreas) {
  const BlockScene scene{
      .regions = region_text("left", "group = \"left\"") + region_text("top", "group = \"top\"") +
                 region_text("walls x", "colour = \"#339933\"\nz_mm = [-3.9, 0.1]") +
                 region_text("bottom", "group = \"bottom\"") +
                 region_text("paint", "colour = \"#0000ff\"") +
                 region_text("nothing", "colour = \"#0000ff\"\ngroup = \"left\"") +
                 region_text("y+", "group = \"wall_y+\"") +
                 region_text("high", "group = \"wall_y+\"\nz_mm = [2, 3]")};
  const Job job = prepare(read_scene(scene.file()));
  const nlohmann::ordered_json json = to_json(describe(job));
  std::map<std::string, double> area, decides;
  for (const auto& one : json["part"]["regions"]) {
    area[one["name"]] = one["area_mm2"];
    decides[one["name"]] = one["decides_percent"];
    EXPECT_NEAR(one["area_percent"].get<double>(), area[one["name"]] / 208.0 * 100.0, 1e-9);
  }
  EXPECT_NEAR(area["left"], 24.0, 1e-11);
  EXPECT_NEAR(area["top"], 48.0, 1e-11);
  EXPECT_NEAR(area["bottom"], 48.0, 1e-11);
  EXPECT_NEAR(area["paint"], 24.0, 1e-11);
  EXPECT_NEAR(area["y+"], 32.0, 1e-11);
  EXPECT_EQ(area["nothing"], 0.0);
  EXPECT_EQ(area["high"], 0.0);
  EXPECT_EQ(decides["left"], 0.0);
  EXPECT_NEAR(decides["top"], 2400.0 / 208.0, 1e-9);
  EXPECT_TRUE(has_warning(job, "the region \"nothing\" is empty"));
  EXPECT_TRUE(has_warning(job, "the region \"high\" is empty"));
  EXPECT_TRUE(has_warning(
      job, "the region \"left\" has no effect: later regions contain all of its 24 mm^2"));
  EXPECT_FALSE(has_warning(job, "the region \"top\""));
  EXPECT_HAS(to_text(describe(job)), "region left: 24 mm^2, 11.54 % of the part, 0 % not covered");
}

/// Vertices of the triangles of the design whose middle lies in a half of the top, and the thirds
/// of the areas of these triangles.
std::map<int, double> half_of_the_top(const cutting::Design& design_m, double sign) {
  std::map<int, double> area;
  for (const auto& t : design_m.triangles.rowwise()) {
    const Vector3d a = design_m.vertices.row(t[0]), b = design_m.vertices.row(t[1]),
                   c = design_m.vertices.row(t[2]);
    const Vector3d cross = (b - a).cross(c - a);
    const bool is_top = cross.z() > 0.99 * cross.norm() && a.z() > -1e-6;
    if (is_top && sign * (a + b + c).x() > 0.0)
      for (const int v : t) area[v] += cross.norm() / 6.0;
  }
  return area;
}

/// Sums over vertices, or places within triangles, that no statistics of the project has made.
struct Sums {
  double area = 0.0, mean = 0.0, square = 0.0, low = 1.0, high = -1.0;
  int count = 0;
  void add(double weight, double r) {
    area += weight;
    mean += weight * r;
    square += weight * r * r;
    low = std::min(low, r);
    high = std::max(high, r);
    ++count;
  }
};

void expect_same(const cutting::Statistics& seen, const Sums& wanted) {
  EXPECT_EQ(seen.cut_vertices, wanted.count);
  EXPECT_NEAR(*seen.mean, wanted.mean / wanted.area, 1e-12);
  EXPECT_NEAR(*seen.rms, std::sqrt(wanted.square / wanted.area), 1e-12);
  EXPECT_NEAR(*seen.pv, wanted.high - wanted.low, 1e-15);
}

TEST(Regions, JudgedByColourAreTheStatisticsOfTheseFacesAlone) {
  constexpr double margin = 0.3;
  std::vector<double> means;
  for (const bool is_red : {true, false}) {
    const BlockScene scene{
        .keys =
            "sampling = \"spacing\"\nspacing_mm = 0.2\njudged = \"regions\"\nedge_margin_mm = "
            "0.3\n",
        .regions = region_text("half", is_red ? "colour = \"#cc1a1a\"" : "colour = \"#0000ff\""),
        .more = "[errors]\nEYX_um = 6\n[setup]\nEB_urad = 400\n"};  // left and right differ
    const Job job = sampled(prepare(read_scene(scene.file())));
    const Verdict verdict = judge(job, cut(job), nullptr);
    const cutting::Design design_m =
        cutting::transformed(job.design_w, job.scene.part.T_wm.inverse());
    cutting::Surface surface = verdict.alignment.surface;
    const std::map<int, double> half = half_of_the_top(design_m, is_red ? -1.0 : 1.0);
    Sums vertices;
    for (Index v = 0; v < design_m.vertices.rows(); ++v) {
      const Vector3d p = design_m.vertices.row(v);
      const double rim = std::min(
          {is_red ? p.x() + 4.0 : 4.0 - p.x(), 3.0 - p.y(), p.y() + 3.0});  // not the border x = 0
      const bool wanted = half.contains(int(v)) && !(rim < margin);
      const bool seen = surface.status[std::size_t(v)] != cutting::VertexStatus::Outside;
      if (std::abs(rim - margin) > 1e-9) {
        EXPECT_EQ(seen, wanted) << p.transpose();
      }
      if (!seen) continue;
      ASSERT_EQ(surface.status[std::size_t(v)], cutting::VertexStatus::Cut);
      vertices.add(half.at(int(v)), surface.residual[v]);
    }
    const cutting::Weights weights = cutting::weights(surface, design_m);
    for (Index t = 0; t < weights.within.size(); ++t) {
      if (!(weights.within[t] > 0.0)) continue;
      for (const int v : design_m.triangles.row(t)) ASSERT_TRUE(half.contains(v)) << t;
    }
    surface.within.resize(0);
    surface.interior_sample = cutting::Surface::InteriorSample::None;
    expect_same(cutting::statistics(surface, design_m), vertices);
    EXPECT_NEAR(job.sampled->judged_area, vertices.area, 1e-9);
    means.push_back(*verdict.residual.mean);
    std::cout << (is_red ? "red: " : "blue: ") << vertices.count << " vertices on " << vertices.area
              << " mm^2, mean " << vertices.mean / vertices.area / units::um << " um, rms "
              << std::sqrt(vertices.square / vertices.area) / units::um << " um, pv "
              << (vertices.high - vertices.low) / units::um << " um; with places within mean "
              << means.back() / units::um << " um\n";
  }
  EXPECT_NEAR(std::abs(means[0] - means[1]), 400e-6 * 3.7, 0.03 * units::um)
      << "a tilt, over the 3.7 mm between the middles";
}

TEST(Regions, TolerancesFollowGroupsThroughAdaptiveSampling) {
  const BlockScene scene{
      .keys = "tolerance_um = 50\nresolution_um = 0.5\npoints = 20000\n",
      .regions = region_text("left", "group = \"left\"\ntolerance_um = [-1, 2]") +
                 region_text("blue below",
                             "colour = \"#0000ff\"\nbox_mm = [-9, -9, -9, 9, 0, 9]\n"
                             "tolerance_um = 3")};
  const Job job = sampled(prepare(read_scene(scene.file())));
  ASSERT_GT(job.design_w.vertices.rows(), job.sampled->given);
  const cutting::Design design_m =
      cutting::transformed(job.design_w, job.scene.part.T_wm.inverse());
  const cutting::ToleranceBands bands =
      tolerance_bands(job.scene.part, job.face_groups, job.design_w) / units::um;
  const std::map<int, double> left = half_of_the_top(design_m, -1.0),
                              right = half_of_the_top(design_m, 1.0);
  double area_left = 0.0, area_right = 0.0;
  for (const auto& [v, area] : left) area_left += area;
  for (const auto& [v, area] : right) area_right += area;
  EXPECT_NEAR(area_left, 24.0, 24e-12);
  EXPECT_NEAR(area_right, 24.0, 24e-12);
  std::map<double, int> count;
  for (Index v = 0; v < bands.rows(); ++v) {
    const double y = design_m.vertices(v, 1);
    if (std::abs(y) < 2e-6) continue;  // the rim of the box
    const double wanted = left.contains(int(v))               ? 2.0
                          : right.contains(int(v)) && y < 0.0 ? 3.0
                                                              : 50.0;
    EXPECT_NEAR(bands(v, 1), wanted, 1e-9) << design_m.vertices.row(v);
    ++count[wanted];
  }
  std::cout << count[2.0] << " vertices left, " << count[3.0] << " right and below, " << count[50.0]
            << " elsewhere\n";
  EXPECT_GT(count[2.0], 100);
  EXPECT_GT(count[3.0], 100);
}

TEST(Regions, ABorderBetweenGroupsChangesNoFigureOfASmoothFace) {
  // one part, its top one face: with a border through it that decides nothing
  const std::string errors = "[errors]\nEYX_um = 6\nEZY_um = 3\n";
  const std::string keys = "sampling = \"spacing\"\nspacing_mm = 0.2\njudged = \"cut\"\n";
  const BlockScene without{.keys = keys, .more = errors};
  const BlockScene with{.keys = keys,
                        .regions = region_text("left", "group = \"left\"\ntolerance_um = 9"),
                        .more = errors};
  const Job plain = sampled(prepare(read_scene(without.file())));
  const Job parted = sampled(prepare(read_scene(with.file())));
  EXPECT_GT(parted.design_w.vertices.rows(), plain.design_w.vertices.rows());
  EXPECT_TRUE(plain.design_w.group.empty());
  const Verdict a = judge(plain, cut(plain), nullptr), b = judge(parted, cut(parted), nullptr);
  // triangles are halved in another order, and looked at elsewhere within: figures of sampling
  std::cout << "mean " << *a.residual.mean / units::um << " and " << *b.residual.mean / units::um
            << " um, rms of form " << *a.form_statistics->rms / units::um << " and "
            << *b.form_statistics->rms / units::um << " um\n";
  EXPECT_NEAR(*b.residual.mean / *a.residual.mean, 1.0, 1e-3);
  EXPECT_NEAR(*b.residual.rms / *a.residual.rms, 1.0, 1e-3);
  EXPECT_NEAR(*b.form_statistics->rms / *a.form_statistics->rms, 1.0, 1e-3);
  EXPECT_NEAR(plain.sampled->judged_area, parted.sampled->judged_area, 1e-9);
}

}  // namespace
}  // namespace abbe::sim
