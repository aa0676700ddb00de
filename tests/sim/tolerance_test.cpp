// Tolerances of a part: how they are read, where they hold, and what they say of a cut.

#include <nlohmann/json.hpp>
#include "sim/cut/part_regions.h"
#include "sim/report/line_texture.h"
#include "sim/report/summary.h"
#include "sim/scene/fields.h"
#include "sim/scene/part.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/small_scene.h"
#include "tests/sim/written_section.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

const std::string plain_disc = "surface = \"disc\"\nradius_mm = 10.0\n";

PartDescription part_of(const std::string& lines) {
  return read_section(plain_disc + lines, read_part);
}

std::string refused_part(const std::string& lines) {
  InputErrors input_errors;
  read_part(parse_toml(plain_disc + lines, "s.toml"), input_errors);
  std::string all;
  for (const BadInput& fault : input_errors.list()) all += std::string(fault.what()) + "\n";
  return all;
}

TEST(Tolerance, IsAHalfWidthOrTwoLimits) {
  const PartDescription half = part_of("tolerance_um = 5\n");
  EXPECT_EQ(half.tolerance->lower, -5.0_um);
  EXPECT_EQ(half.tolerance->upper, 5.0_um);
  const PartDescription one_sided = part_of("tolerance_um = [0, 8]\n");
  EXPECT_EQ(one_sided.tolerance->lower, 0.0);
  EXPECT_EQ(one_sided.tolerance->upper, 8.0_um);
  EXPECT_FALSE(part_of("tolerance_um = 0\n").tolerance);
  EXPECT_FALSE(part_of("").tolerance);
  for (const char* text : {"tolerance_um = 5.0", "tolerance_um = [-2.0, 8.0]"})
    EXPECT_HAS(written_again(plain_disc + text + "\n", read_part, part_to_table), text);
}

TEST(Tolerance, ThatCannotBeIsRefusedAtItsPlace) {
  for (const char* text : {"tolerance_um = [8, -2]\n", "tolerance_um = [1, 1]\n"}) {
    const std::string said = refused_part(text);
    EXPECT_HAS(said, "s.toml:3:");
    EXPECT_HAS(said, "[lower, upper] with the lower limit first");
  }
  EXPECT_NE(refused_part("tolerance_um = -1\n"), "");
  EXPECT_NE(refused_part("tolerance_um = [1, 2, 3]\n"), "");
  EXPECT_NE(refused_part("[[region]]\nname = \"a\"\ntolerance_um = 0\n"), "");
  EXPECT_NE(refused_part("[[region]]\nname = \"a\"\ntolerance_um = 1\nz_mm = [2, 1]\n"), "");
}

TEST(Tolerance, OfARegionHoldsThereAndTheLastDecides) {
  PartDescription part = part_of(
      "tolerance_um = 5\nat_mm = [100, 0, 0]\n"
      "[[region]]\nname = \"rim\"\nradius_mm = [8, 10]\ntolerance_um = [-20, 1]\n"
      "[[region]]\nname = \"corner\"\nbox_mm = [7, -1, -1, 20, 1, 1]\ntolerance_um = 3\n"
      "[[region]]\nname = \"above\"\nz_mm = [1, 2]\ntolerance_um = 7\n");
  cutting::Design at;
  at.vertices.resize(5, 3);
  at.vertices << 0, 0, 0, 0, 9, 0, 9, 0, 0, 7.5, 0, 0, 0, 0, 1;
  at.vertices.col(0).array() += 100.0;  // the part stands there
  const cutting::ToleranceBands bands = tolerance_bands(part, {}, at) / units::um;
  const double wanted[][2] = {{-5, 5}, {-20, 1}, {-3, 3}, {-3, 3}, {-7, 7}};
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(bands(i, 0), wanted[i][0], 1e-12) << i;
    EXPECT_NEAR(bands(i, 1), wanted[i][1], 1e-12) << i;
  }
  part.tolerance.reset();
  EXPECT_EQ(tolerance_bands(part, {}, at)(0, 1), std::numeric_limits<double>::infinity());
  part.regions.clear();
  EXPECT_EQ(tolerance_bands(part, {}, at).rows(), 0);
}

TEST(Tolerance, RegionsSayWhatIsJudged) {
  const auto places = [](const std::string& more) {
    PartDescription part =
        part_of(more +
                "[[region]]\nname = \"rim\"\nradius_mm = [8, 10]\n"
                "[[region]]\nname = \"corner\"\nbox_mm = [7, -1, -1, 20, 1, 1]\njudged = false\n");
    std::string judged;
    for (const Vector3d& p : {Vector3d(0, 0, 0), Vector3d(0, 9, 0), Vector3d(9, 0, 0)}) {
      const PartRegion* region = region_at(part, {}, {p});
      judged += region == nullptr ? '-' : region->judged ? 'y' : 'n';
    }
    return judged;
  };
  EXPECT_EQ(places(""), "-yn");
  EXPECT_EQ(part_of("judged = \"regions\"\n").judged, PartDescription::JudgedArea::Regions);
}

TEST(Tolerance, VerdictIsALine) {
  cutting::Conformance c{.in = 100.0};
  EXPECT_EQ(tolerance_verdict(std::nullopt, {}), "");
  EXPECT_EQ(tolerance_verdict(c, {}), "PASS");
  c.uncut = 2.1;
  c.uncut_vertices = 3;
  EXPECT_EQ(tolerance_verdict(c, {}), "FAIL: 2.1 % of the judged area is not cut");
  c.uncut_vertices = 0;
  c.out_of_tolerance_count = 1;
  c.excess = 3.2_um;
  Verdict::ExtremePoint worst{11.2_um, {12.1, -4.0, 80.2}, 18231, false};
  EXPECT_EQ(tolerance_verdict(c, worst),
            "FAIL by 3.2 um at (12.1, -4.0, 80.2) of the part, line 18231");
  worst.is_bound = true;
  EXPECT_EQ(tolerance_verdict(c, worst),
            "FAIL by more than 3.2 um at (12.1, -4.0, 80.2) of the part, line 18231");
}

/// A flat between whose passes, 0.5 apart, a ball R 5 leaves cusps R - sqrt(R² - y²).
Verdict cusps(const std::string& tolerance) {
  const SceneFolder folder;
  const BallRaster scene{
      "surface = \"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\n"
      "at_mm = [0, 0, 80]\nvertices = 20000\nsampling = \"vertices\"\n" +
      tolerance};
  const Job job = prepare(read_scene(folder.write("s.toml", to_toml(scene))));
  return judge(job, cut_error_free(job), nullptr);
}

double half_width_below(double height) {
  return std::sqrt(ball_radius * ball_radius - std::pow(ball_radius - height, 2));
}

TEST(Tolerance, SharesOfCuspsAreTheirClosedForm) {
  const Verdict verdict = cusps("tolerance_um = [-1, 3]\n");
  const cutting::Conformance& c = *verdict.residual.conformance;
  const double in = 100.0 * half_width_below(3.0_um) / 0.25;
  std::cout << "in tolerance " << c.in << " %, closed form " << in << " %\n";
  EXPECT_NEAR(c.in, in, 2.0);
  EXPECT_NEAR(c.in + c.over, 100.0, 1e-9);
  const double cusp = ball_radius - std::sqrt(ball_radius * ball_radius - 0.25 * 0.25);
  EXPECT_NEAR(c.excess, cusp - 3.0_um, 0.5_um);
  EXPECT_EQ(c.excess, verdict.worst->residual - 3.0_um);
  EXPECT_EQ(verdict.worst->residual, verdict.highest->residual);
  EXPECT_NEAR(verdict.worst->position_m.z(), 0.0, 1e-9);
  EXPECT_LT(verdict.worst->position_m.head<2>().cwiseAbs().maxCoeff(), 2.0 + 1e-9);
  EXPECT_GT(verdict.worst->line, 0);
  EXPECT_EQ(cusps("tolerance_um = [-1, 7]\n").residual.conformance->passes(), true);
}

TEST(Tolerance, SharesAreOfWhatHasATolerance) {
  const Verdict verdict =
      cusps("[[part.region]]\nname = \"right\"\nbox_mm = [0, -9, -9, 9, 9, 9]\ntolerance_um = 3\n");
  const double over = 100.0 - 100.0 * half_width_below(3.0_um) / 0.25;
  EXPECT_NEAR(verdict.residual.conformance->over, over, 2.0);
  EXPECT_GE(verdict.worst->position_m.x(), 0.0);
}

TEST(Tolerance, IsInTheSummary) {
  const SceneFolder folder;
  const BallRaster scene{
      "surface = \"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\n"
      "at_mm = [0, 0, 80]\nvertices = 500\nsampling = \"vertices\"\n"
      "tolerance_um = [-1, 3]\n"};
  const Job job = prepare(read_scene(folder.write("s.toml", to_toml(scene))));
  const Summary s = summary(job, judge(job, cut_error_free(job), nullptr));
  const auto json = to_json(s);
  EXPECT_NEAR(json["tolerance_um"][0].get<double>(), -1.0, 1e-12);
  EXPECT_NEAR(json["tolerance_um"][1].get<double>(), 3.0, 1e-12);
  const auto& c = json["conformance"];
  EXPECT_FALSE(c["passes"].get<bool>());
  EXPECT_EQ(c["in_percent"], json["residual_um"]["in_tolerance_percent"]);
  EXPECT_EQ(json["highest"]["residual_um"], json["residual_um"]["max"]);
  EXPECT_EQ(json["lowest"]["residual_um"], json["residual_um"]["min"]);
  const std::string verdict = c["verdict"];
  EXPECT_TRUE(verdict.starts_with("FAIL by ")) << verdict;
  EXPECT_HAS(to_text(s), verdict);
}

constexpr double not_cut = std::numeric_limits<double>::quiet_NaN();

/// A grid of (n + 1) x (n + 1) vertices over a square about the origin, each cell two triangles, at
/// a height, with a map.
struct SquareMap {
  cutting::Design design;
  VectorXd residual, within;
  cutting::Surface::InteriorSample interior_sample = cutting::Surface::InteriorSample::None;

  ProfiledMap map() const { return {design, residual, interior_sample, within}; }
};

using OverPlane = std::function<double(double x, double y)>;

SquareMap square_map(
    double side, int n, const OverPlane& residual,
    const OverPlane& height = [](double, double) { return 0.0; }) {
  SquareMap made;
  made.design.vertices.resize((n + 1) * (n + 1), 3);
  made.residual.resize((n + 1) * (n + 1));
  made.design.triangles.resize(2 * n * n, 3);
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double x = side * (double(i) / n - 0.5), y = side * (double(j) / n - 0.5);
      made.design.vertices.row(i * (n + 1) + j) = Vector3d(x, y, height(x, y));
      made.residual[i * (n + 1) + j] = residual(x, y);
    }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j, b = a + n + 1;
      made.design.triangles.row(2 * (i * n + j)) = Eigen::RowVector3i(a, b, b + 1);
      made.design.triangles.row(2 * (i * n + j) + 1) = Eigen::RowVector3i(a, b + 1, a + 1);
    }
  return made;
}

TEST(LineTrace, OfALinearMapIsThatMap) {
  const auto linear = [](double x, double y) { return 0.5 * x - 2.0 * y + 0.25; };
  for (const int n : {6, 7, 40}) {  // with and without vertices on the line
    const SquareMap made = square_map(12.0, n, linear);
    for (const ProfileLine line : {ProfileLine::X, ProfileLine::Y, ProfileLine::Radius}) {
      const auto trace = line_trace(made.map(), line);
      ASSERT_TRUE(trace);
      EXPECT_EQ(trace->segments, 1);
      EXPECT_EQ(trace->omitted_length, 0.0);
      EXPECT_NEAR(trace->s[trace->s.size() - 1], line == ProfileLine::Radius ? 6.0 : 12.0, 1e-12);
      EXPECT_NEAR(trace->along[0], line == ProfileLine::Radius ? 0.0 : -6.0, 1e-12);
      for (Index i = 0; i < trace->s.size(); ++i) {
        const Vector3d p = trace->points.row(i);
        EXPECT_NEAR(p[line == ProfileLine::Y ? 0 : 1], 0.0, 1e-12);
        EXPECT_NEAR(trace->residual[i], linear(p.x(), p.y()), 1e-12);
        EXPECT_NEAR(trace->s[i] - trace->s[0], trace->along[i] - trace->along[0], 1e-12);
      }
    }
  }
}

TEST(LineTrace, GoesAlongTheSurface) {
  const double slope = std::tan(0.6);
  const SquareMap made = square_map(
      10.0, 20, [](double x, double) { return x; }, [&](double x, double) { return slope * x; });
  const auto trace = line_trace(made.map(), ProfileLine::X);
  ASSERT_TRUE(trace);
  EXPECT_NEAR(trace->s[trace->s.size() - 1], 10.0 / std::cos(0.6), 1e-12);
}

TEST(LineTrace, TakesTheLongestStretchThatIsCut) {
  const SquareMap made = square_map(
      10.0, 100, [](double x, double) { return std::abs(x + 2.0) < 0.45 ? not_cut : x; });
  const auto trace = line_trace(made.map(), ProfileLine::X);
  ASSERT_TRUE(trace);
  EXPECT_EQ(trace->segments, 2);
  EXPECT_NEAR(trace->along[0], -1.5, 1e-12);
  EXPECT_NEAR(trace->along[trace->s.size() - 1], 5.0, 1e-12);
  EXPECT_NEAR(trace->omitted_length, 2.5, 1e-12);
  const SquareMap nothing = square_map(10.0, 10, [](double, double) { return not_cut; });
  EXPECT_FALSE(line_trace(nothing.map(), ProfileLine::X));
}

TEST(LineTrace, OfARingBeginsWhereItIsLowest) {
  // a tube about the y axis, closed around
  constexpr int around = 24;
  SquareMap tube;
  tube.design.vertices.resize(2 * around, 3);
  tube.design.triangles.resize(2 * around, 3);
  for (int i = 0; i < around; ++i) {
    const double angle = 2.0 * pi * i / around;
    for (int j = 0; j < 2; ++j)
      tube.design.vertices.row(2 * i + j) =
          Vector3d(3.0 * std::cos(angle), j - 0.5, 3.0 * std::sin(angle));
    const int a = 2 * i, b = 2 * ((i + 1) % around);
    tube.design.triangles.row(2 * i) = Eigen::RowVector3i(a, b, b + 1);
    tube.design.triangles.row(2 * i + 1) = Eigen::RowVector3i(a, b + 1, a + 1);
  }
  tube.residual = tube.design.vertices.col(2);
  const auto trace = line_trace(tube.map(), ProfileLine::X);
  ASSERT_TRUE(trace);
  EXPECT_NEAR(trace->along[0], -3.0, 1e-12);
  EXPECT_NEAR(trace->s[trace->s.size() - 1], around * 6.0 * std::sin(pi / around), 1e-9);
}

/// A wave of 0.5 mm and 1 um across 20 mm, so many cells wide; `seen` within all triangles.
LineTexture wave_texture(int cells, double side, const std::function<double(double)>& seen,
                         const LineTextureOptions& options = {}) {
  const auto wave = [](double x) { return 1e-3 * std::sin(2.0 * pi * x / 0.5); };
  SquareMap made = square_map(side, cells, [&](double x, double) { return wave(x); });
  if (seen) {
    made.interior_sample = cutting::Surface::InteriorSample::Middle;
    made.within.resize(made.design.triangles.rows());
    for (Index t = 0; t < made.within.size(); ++t) {
      const Vector3d p = cutting::value_at_sample(made.interior_sample, made.design.vertices,
                                                  made.design.triangles, t);
      made.within[t] = seen(p.x());
    }
  }
  return line_texture(*line_trace(made.map(), ProfileLine::X), 2.5, options);
}

TEST(LineTextureOf, AResolvedWaveAreItsClosedFormsAndNoWarnings) {
  const auto wave = [](double x) { return 1e-3 * std::sin(2.0 * pi * x / 0.5); };
  const LineTexture t = wave_texture(800, 20.0, wave);
  EXPECT_TRUE(t.warnings.empty()) << t.warnings.front();
  const double A = 1e-3 * (1.0 - std::exp2(-25.0));
  EXPECT_NEAR(t.texture.R.q, A / std::sqrt(2.0), 0.01 * A);
  EXPECT_NEAR(t.texture.R.a, 2.0 * A / pi, 0.01 * A);
  EXPECT_NEAR(t.texture.R.z, 2.0 * A, 0.01 * A);
  EXPECT_NEAR(*t.texture.R.sm, 0.5, 1e-3);
  EXPECT_LT(t.texture.W.q, 0.1 * A);  // of the ends, where the mean line is fitted to one side
  const nlohmann::ordered_json json = to_json(t);
  EXPECT_EQ(json["setting_class"], "Sc4");
  EXPECT_NEAR(json["R"]["Rq_um"].get<double>(), 1e3 * t.texture.R.q, 1e-12);
  EXPECT_EQ(json["evaluation"]["R"]["sections"], 5);
  EXPECT_NEAR(json["evaluation"]["P"]["length_mm"].get<double>(), 20.0, 1e-9);
}

bool warns(const LineTexture& t, const std::string& of) {
  for (const std::string& warning : t.warnings)
    if (warning.find(of) != std::string::npos) return true;
  return false;
}

TEST(LineTextureOf, AMapThatDoesNotResolveItAreWarnedAbout) {
  const auto wave = [](double x) { return 1e-3 * std::sin(2.0 * pi * x / 0.5); };
  EXPECT_TRUE(warns(wave_texture(45, 20.0, wave), "does not resolve the profile"));
  EXPECT_FALSE(resolution_warning(wave_texture(45, 20.0, wave)).empty());
  EXPECT_TRUE(warns(wave_texture(400, 20.0, {}), "it is unknown whether"));
}

TEST(LineTextureOf, AShortLineAreWarnedAbout) {
  EXPECT_TRUE(warns(wave_texture(60, 2.0, {}), "less than one section length of 2.5 mm"));
  EXPECT_TRUE(warns(wave_texture(60, 6.0, {}), "R covers 2 sections of 2.5 mm instead of 5"));
  EXPECT_TRUE(warns(wave_texture(60, 13.0, {}), "less than half of Nic"));
  EXPECT_TRUE(warns(wave_texture(60, 20.0, {}, {.Nic = 0.8, .Nis = 1e-6, .sections = 5}),
                    "Nis is 1 um instead of 0.001 um"));
}

TEST(LineTextureOf, ATableHasARowAPlace) {
  const LineTexture t = wave_texture(60, 20.0, {}, {.Nic = 2.5, .Nis = 0.5, .sections = 5});
  const std::string table = to_csv(t);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 1 + t.texture.primary.z.size());
  EXPECT_TRUE(
      table.starts_with("s_mm,x_mm,y_mm,z_mm,residual_um,primary_um,waviness_um,roughness"));
}

}  // namespace
}  // namespace abbe::sim
