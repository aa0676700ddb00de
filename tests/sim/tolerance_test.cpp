// Tolerances of a part: how they are read, where they hold, and what they say of a cut.

#include <cmath>
#include <iostream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"
#include "sim/cut/part_regions.h"
#include "sim/report/summary.h"
#include "sim/scene/fields.h"
#include "sim/scene/part.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/small_scene.h"
#include "tests/sim/written_section.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;

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
    EXPECT_NE(written_again(plain_disc + text + "\n", read_part, part_to_table).find(text),
              std::string::npos);
}

TEST(Tolerance, ThatCannotBeIsRefusedAtItsPlace) {
  for (const char* text : {"tolerance_um = [8, -2]\n", "tolerance_um = [1, 1]\n"}) {
    const std::string said = refused_part(text);
    EXPECT_NE(said.find("s.toml:3:"), std::string::npos) << said;
    EXPECT_NE(said.find("[lower, upper] with the lower limit first"), std::string::npos) << said;
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
    for (const Eigen::Vector3d& p :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 9, 0), Eigen::Vector3d(9, 0, 0)}) {
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
  EXPECT_NE(to_text(s).find(verdict), std::string::npos) << to_text(s);
}

}  // namespace
}  // namespace abbe::sim
