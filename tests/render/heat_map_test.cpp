#include "render/heat_map.h"

#include <iostream>
#include <limits>
#include <stdexcept>
#include <system_error>

#include "tests/kinematics/nan.h"
#include "tests/render/picture.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::Image;
using test::Pixel;

class Heat : public test::Folder {};

HeatMap matrix(int rows, int columns) {
  HeatMap map;
  for (int i = 0; i < rows; ++i) map.rows.push_back("input number " + std::to_string(i));
  for (int j = 0; j < columns; ++j) map.columns.push_back("response " + std::to_string(j));
  map.values.resize(rows, columns);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) map.values(i, j) = std::cos(i + 2.0 * j);
  return map;
}

int reddish(const Image& image) {
  return image.count([](Pixel p) { return p.is_reddish(); });
}
int blueish(const Image& image) {
  return image.count([](Pixel p) { return p.is_blueish(); });
}

TEST_F(Heat, ColoursACellBySignAndSize) {
  const auto draw = [&](double value, std::optional<double> range) {
    write_heat_map(file("a.png"), {{"a"}, {"b", "c"}, Eigen::RowVector2d(value, 0.0)},
                   {.range = range});
    return Image(file("a.png"));
  };
  const int bar =
      reddish(draw(0.02, 1.0));  // the scale alone, which also has red where it is faint
  const Image red = draw(0.9, 1.0), blue = draw(-0.9, 1.0);
  std::cout << "red " << reddish(red) << ", " << reddish(blue) << " px; blue " << blueish(blue)
            << " px; scale alone " << bar << " px\n";
  EXPECT_GT(reddish(red), bar + 1500);
  EXPECT_GT(blueish(blue), 1500);
}

TEST_F(Heat, BeyondItsRangeIsDark) {
  write_heat_map(file("a.png"), {{"a"}, {"b"}, Eigen::MatrixXd::Constant(1, 1, 5.0)},
                 {.range = 1.0});
  const int dark = Image(file("a.png")).count([](Pixel p) {
    return test::distance(p, colours::beyond_high) < 4;
  });
  EXPECT_GT(dark, 1500);
}

TEST_F(Heat, OfOneCellUpToTheMostIsDrawn) {
  for (const auto& [rows, columns] : {std::pair(1, 1), {1, 64}, {256, 1}, {46, 14}, {256, 64}}) {
    write_heat_map(file("a.png"), matrix(rows, columns), {.title = "title", .range = 1.0});
    const Image image(file("a.png"));
    EXPECT_LE(image.width(), 1600);
    EXPECT_GT(image.height(), 20 * rows);
  }
}

TEST_F(Heat, OfAwkwardValuesIsDrawn) {
  HeatMap map = matrix(3, 3);
  map.values.setConstant(nan);
  write_heat_map(file("a.png"), map);
  map.values.setZero();
  write_heat_map(file("b.png"), map);
  map.values.setConstant(-1e300);
  map.values(1, 1) = std::numeric_limits<double>::infinity();
  write_heat_map(file("c.png"), map);
  map.rows[1] = std::string(1000, 'r');
  map.columns[1] = std::string(1000, 'c');
  write_heat_map(file("d.png"), map,
                 {.row_label = "trained on", .column_label = "tested on", .value_label = "µm"});
  EXPECT_LE(Image(file("d.png")).width(), 1600);
}

TEST_F(Heat, IsTheSameBytesTwice) {
  for (const char* name : {"a", "b"}) write_heat_map(file(name), matrix(5, 4));
  EXPECT_TRUE(bytes(file("a")) == bytes(file("b")));
}

TEST_F(Heat, RefusesWhatCannotBeDrawn) {
  EXPECT_THROW(write_heat_map(file("a.png"), {}), std::invalid_argument);
  EXPECT_THROW(write_heat_map(file("a.png"), matrix(257, 1)), std::invalid_argument);
  EXPECT_THROW(write_heat_map(file("a.png"), matrix(1, 65)), std::invalid_argument);
  HeatMap map = matrix(2, 2);
  map.rows.pop_back();
  EXPECT_THROW(write_heat_map(file("a.png"), map), std::invalid_argument);
  for (const double range : {0.0, -1.0, nan})
    EXPECT_THROW(write_heat_map(file("a.png"), matrix(2, 2), {.range = range}),
                 std::invalid_argument);
  EXPECT_THROW(write_heat_map(file("no/a.png"), matrix(2, 2)), std::system_error);
}

TEST_F(Heat, OfOneRowKeepsItsLabelsApartAndInThePicture) {
  HeatMap one{{"the only day"}, {"cold", "3 h"}, Eigen::MatrixXd::Constant(1, 2, 1.5)};
  one.values(0, 1) = 0.0123;
  write_heat_map(file("a.png"), one,
                 {.title = "title", .row_label = "learnt on a day", .value_label = "RMS / µm"});
  const Image image(file("a.png"));
  EXPECT_EQ(image.count({0, 0}, {16, image.height()}, [](Pixel p) { return !p.is_white(); }), 0);
  // a row of cells is high enough to be seen as a table
  int tallest = 0;
  for (int x = 0; x < image.width(); ++x)
    tallest = std::max(tallest, image.count({x, 0}, {x + 1, image.height()},
                                            [](Pixel p) { return p.is_reddish(); }));
  EXPECT_GE(tallest, 60);
}

}  // namespace
}  // namespace abbe::render
