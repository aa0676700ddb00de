#include <iostream>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "errors/coefficients.h"
#include "kinematics/units.h"
#include "sim/readings/belief_file.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using errors::Coefficient;
using errors::GeometricErrors;

Scene scene_with_errors(const std::string& errors, const SceneFolder& folder) {
  const auto file = folder.write("belief.toml", errors);
  return read_scene(packaged("gantry_dome.toml"), {{"errors", "\"" + file.string() + "\""}});
}

double largest_apart(const GeometricErrors& a, const GeometricErrors& b) {
  return (errors::values(a.elements) - errors::values(b.elements)).cwiseAbs().maxCoeff();
}

TEST(BeliefFile, EveryPackagedErrorFileReadsBackAsItWas) {
  for (const char* name : {"gantry_dome.toml", "platform_plane.toml"}) {
    const SceneFolder folder;
    const Scene scene = read_scene(packaged(name));
    GeometricErrors known = scene.geometric;
    for (auto& element : known.elements)
      std::erase_if(element.curves, [](const auto& curve) { return errors::is_random(curve); });
    std::erase_if(known.elements, [](const auto& element) { return element.curves.empty(); });
    const auto file = folder.write("b.toml", to_errors_file(known, scene.machine.joints));
    const Scene again = read_scene(packaged(name), {{"errors", "\"" + file.string() + "\""}});
    ASSERT_EQ(again.geometric.elements.size(), known.elements.size());
    for (std::size_t i = 0; i < known.elements.size(); ++i)
      EXPECT_EQ(again.geometric.elements[i].name, known.elements[i].name);
    const double apart = largest_apart(again.geometric, known);
    std::cout << name << ": " << apart << " mm or rad apart\n";
    EXPECT_LT(apart, 1e-17);
  }
}

GeometricErrors some_belief() {
  GeometricErrors belief;
  belief.elements = {
      {errors::parse_element_name("EXX"),
       {{errors::Legendre{Eigen::Vector3d(0.0, -5e-3, 1e-3), 10.0, 300.0}}}},
      {errors::parse_element_name("EBX"),
       {{errors::make_table(Eigen::Vector2d(-300, 300), Eigen::Vector2d(1e-5, -2e-5),
                            errors::TableInterpolation::Spline,
                            errors::TableExtrapolation::Hold)}}},
      {errors::parse_element_name("EC0Y"), {{errors::Constant{3e-5}}}},
      {errors::parse_element_name("EYY"),
       {{errors::Backlash{1e-3}, "reversal"}, {errors::Constant{2e-3}}}},
      {errors::parse_element_name("EXC"),
       {{errors::Fourier{Eigen::Vector2d(1e-3, 2e-3), Eigen::Vector2d(3e-3, 4e-3), 2 * pi}}}}};
  const std::vector<Coefficient> numbers = errors::coefficients(belief.elements);
  belief.covariance.of = {numbers[1], numbers[3], numbers[5]};
  belief.covariance.matrix.resize(3, 3);
  belief.covariance.matrix << 1e-8, 2e-11, 1e-11, 2e-11, 4e-12, -1e-12, 1e-11, -1e-12, 1e-12;
  return belief;
}

TEST(BeliefFile, ItsCovarianceReadsBack) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  const GeometricErrors belief = some_belief();
  const std::string text = to_errors_file(belief, scene.machine.joints, {"a belief"});
  const GeometricErrors again = scene_with_errors(text, folder).geometric;
  // elements come in the machine's order; each number keeps its own row
  ASSERT_EQ(again.covariance.of.size(), 3u);
  std::vector<std::string> names;
  for (const Coefficient& one : again.covariance.of)
    names.push_back(errors::name_of(one, again.elements));
  std::vector<std::string> wanted;
  for (const Coefficient& one : belief.covariance.of)
    wanted.push_back(errors::name_of(one, belief.elements));
  EXPECT_EQ(names, wanted);
  const Eigen::MatrixXd apart = again.covariance.matrix - belief.covariance.matrix;
  EXPECT_LT((apart.array() / belief.covariance.matrix.array()).abs().maxCoeff(), 1e-12);
}

TEST(BeliefFile, TwoErrorFilesKeepTheCovarianceOfEach) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  GeometricErrors belief = some_belief();
  const auto one = folder.write("one.toml", to_errors_file(belief, scene.machine.joints));
  const auto two =
      folder.write("two.toml", "scale = 2\n" + to_errors_file(belief, scene.machine.joints));
  const GeometricErrors both =
      read_scene(packaged("gantry_dome.toml"),
                 {{"errors", "[\"" + one.string() + "\", \"" + two.string() + "\"]"}})
          .geometric;
  ASSERT_EQ(both.covariance.of.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    const Coefficient& number = both.covariance.of[i];
    const auto& element = both.elements[std::size_t(number.element)];
    ASSERT_LT(std::size_t(number.curve), element.curves.size());
    EXPECT_EQ(element.curves[std::size_t(number.curve)].scale, i < 3 ? 1.0 : 2.0);
  }
  EXPECT_TRUE(both.covariance.matrix.topRightCorner(3, 3).isZero(0.0));
}

TEST(BeliefFile, ABrokenCovarianceIsRefusedByPlace) {
  const SceneFolder folder;
  const std::string curve = "EXX = { kind = \"constant\", value_um = 1 }\n[covariance]\n";
  const auto refusal = [&](const std::string& covariance) {
    const auto file = folder.write("belief.toml", curve + covariance);
    return faults_of(packaged("gantry_dome.toml"), {{"errors", "\"" + file.string() + "\""}});
  };
  const std::string good = "of = [\"EXX\"]\nstandard_uncertainty_um_urad = [0.1]\n";
  EXPECT_EQ(refusal(good), "");
  EXPECT_NE(refusal("of = [\"EXX[1]\"]\nstandard_uncertainty_um_urad = [0.1]\n")
                .find("belief.toml:3:7: expected a coefficient of the curves in this file"),
            std::string::npos);
  EXPECT_NE(refusal("of = [\"EXX\"]\nstandard_uncertainty_um_urad = [0.1, 1]\n"), "");
  EXPECT_NE(refusal("of = [\"EXX\"]\nstandard_uncertainty_um_urad = [-0.1]\n").find(">= 0"),
            std::string::npos);
  EXPECT_NE(refusal("of = [\"EXX\", \"EXX\"]\nstandard_uncertainty_um_urad = [0.1, 0.1]\n"
                    "correlation = [0.5]\n")
                .find("each number once"),
            std::string::npos);
}

TEST(BeliefFile, ChanceIsNotABelief) {
  GeometricErrors belief;
  belief.elements = {{errors::parse_element_name("EXX"), {{errors::Repeatability{1e-3, 1}}}}};
  EXPECT_THROW(to_errors_file(belief, {}), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::sim
