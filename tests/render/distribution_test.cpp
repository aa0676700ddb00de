#include "render/distribution.h"

#include <iostream>
#include <random>
#include <stdexcept>
#include <system_error>

#include "tests/kinematics/nan.h"
#include "tests/render/picture.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::Image;
using test::Pixel;

class Distribution : public test::Folder {};

Eigen::VectorXd drawn(int count, double mean, double spread) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(mean, spread);
  return Eigen::VectorXd::NullaryExpr(count, [&] { return normal(random); });
}

/// Pixels of a body in a series colour, over white.
int body_pixels(const Image& image, int colour) {
  const Colour c = series_colour(colour);
  const auto paled = [](double part) { return 1.0 - 0.22 * (1.0 - part); };
  const Colour pale{paled(c.r), paled(c.g), paled(c.b)};
  return image.count([&](Pixel p) { return test::distance(p, pale) < 3; });
}

TEST_F(Distribution, BodiesOfOneBinWidthHaveOneArea) {
  // shares add to 100 % whatever the number of values and wherever they lie
  write_distribution(file("a.png"), {{"many", drawn(20000, 10.0, 1.0), {}, {}, {}},
                                     {"few", drawn(500, 30.0, 1.0), {}, {}, {}}});
  const Image image(file("a.png"));
  const int many = body_pixels(image, 0), few = body_pixels(image, 1);
  std::cout << "bodies of " << many << " and " << few << " px\n";
  EXPECT_GT(many, 5000);
  EXPECT_NEAR(few / double(many), 1.0, 0.1);
}

TEST_F(Distribution, OneFarValueDoesNotSqueezeTheRest) {
  Eigen::VectorXd values = drawn(5000, 10.0, 1.0);
  write_distribution(file("a.png"), {{"", values, {}, {}, {}}});
  values[77] = 1e9;
  write_distribution(file("b.png"), {{"", values, {}, {}, {}}});
  const int without = body_pixels(Image(file("a.png")), 0),
            with = body_pixels(Image(file("b.png")), 0);
  std::cout << "bodies of " << without << " and " << with << " px\n";
  EXPECT_GT(with, 0.5 * without);
}

TEST_F(Distribution, LimitStandsInThePictureAlsoWhereItIsFarAway) {
  const auto green = [&](std::optional<double> limit) {
    write_distribution(file("a.png"), {{"", drawn(500, 10.0, 1.0), {}, {}, {}}},
                       {.limit = limit, .limit_label = "limit 12 µm"});
    return Image(file("a.png")).count([](Pixel p) {
      return test::distance(p, {0.2, 0.45, 0.2}) < 10;
    });
  };
  EXPECT_EQ(green({}), 0);
  const int line = green(12.0), label = green(1e6);
  std::cout << "limit of " << line << " px, its label alone " << label << " px\n";
  EXPECT_GT(line, 1000);
  EXPECT_GT(label, 50);
  EXPECT_LT(label, 1000);
}

TEST_F(Distribution, OfAwkwardValuesIsDrawn) {
  const auto one = [&](const Eigen::VectorXd& values) {
    write_distribution(file("a.png"), {{"one", values, nan, 1e9, {}}}, {.limit = 0.0});
  };
  one({});
  one(Eigen::VectorXd::Constant(4, nan));
  one(Eigen::VectorXd::Zero(1));
  one(Eigen::VectorXd::Constant(1000, 1e6));
  one(Eigen::Vector3d(0.0, 1e-12, -1e-12));
  one(Eigen::Vector2d(-1e300, 1e300));
  std::vector<DistributionSeries> most(
      24, {std::string(200, 'n'), drawn(100, 1.0, 0.1), 1.0, 1.2, {"1", "2"}});
  most.front().values = drawn(100, 1000.0, 100.0);
  write_distribution(file("b.png"), most, {.headings = {"mean / µm", std::string(200, 'h')}});
  EXPECT_GT(Image(file("b.png")).height(), 1200);
}

TEST_F(Distribution, IsTheSameBytesTwice) {
  for (const char* name : {"a", "b"})
    write_distribution(file(name), {{"one", drawn(999, 3.0, 1.0), 3.0, 4.6, {}}});
  EXPECT_TRUE(bytes(file("a")) == bytes(file("b")));
}

TEST_F(Distribution, RefusesWhatCannotBeDrawn) {
  const DistributionSeries one{"one", drawn(9, 3.0, 1.0), {}, {}, {"1"}};
  EXPECT_THROW(write_distribution(file("a.png"), {}), std::invalid_argument);
  EXPECT_THROW(write_distribution(file("a.png"), {one}), std::invalid_argument);
  EXPECT_THROW(write_distribution(file("a.png"), std::vector<DistributionSeries>(25)),
               std::invalid_argument);
  EXPECT_THROW(write_distribution(file("no/a.png"), {one}, {.headings = {"h"}}), std::system_error);
}

}  // namespace
}  // namespace abbe::render
