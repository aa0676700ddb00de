#include <iostream>

#include "render/plot.h"
#include "tests/kinematics/nan.h"
#include "tests/render/picture.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::Image;
using test::Pixel;

class Bars : public test::Folder {};

/// Pixels of a bar in a series colour, over white.
int bar_pixels(const Image& image, int colour) {
  const Colour c = series_colour(colour);
  const auto paled = [](double part) { return 1.0 - 0.85 * (1.0 - part); };
  const Colour pale{paled(c.r), paled(c.g), paled(c.b)};
  return image.count([&](Pixel p) { return test::distance(p, pale) < 3; });
}

Bar two_sided(double low, double high) {
  Bar bar{"input", low};
  bar.second_value = high;
  return bar;
}

TEST_F(Bars, OfATornadoAreAsLongAsTheirChanges) {
  write_bars(file("a.png"), {two_sided(-1.0, 3.0)});
  const Image image(file("a.png"));
  const int low = bar_pixels(image, 0), high = bar_pixels(image, 1);
  std::cout << "bars of " << low << " and " << high << " px\n";
  ASSERT_GT(low, 1000);
  EXPECT_NEAR(high / double(low), 3.0, 0.05);
}

TEST_F(Bars, OfATornadoThatPointOneWayShareTheirRow) {
  write_bars(file("a.png"), {two_sided(2.0, 4.0)});
  const Image image(file("a.png"));
  const int low = bar_pixels(image, 0), high = bar_pixels(image, 1);
  std::cout << "bars of " << low << " and " << high << " px\n";
  ASSERT_GT(low, 1000);                       // the shorter one is not hidden
  EXPECT_NEAR(high / double(low), 2.0, 0.2);  // a row of pixels at the seam
}

TEST_F(Bars, RunningSumReachesTheSumOfAllBars) {
  const std::vector<Bar> bars{{"a", 60.0}, {"b", 30.0}, {"c", 10.0}};
  write_bars(file("a.png"), bars, {.running_sum = "running sum"});
  const Image image(file("a.png"));
  const auto rightmost = [&](int colour, int least, int from) {
    int found = 0;
    for (int x = 0; x < image.width(); ++x)
      if (image.count({x, from}, {x + 1, image.height() - 60}, [&](Pixel p) {
            return test::distance(p, series_colour(colour)) < 45;
          }) >= least)
        found = x;
    return found;
  };
  int left = image.width();  // of the bars: where zero is
  for (int x = image.width() - 1; x >= 0; --x)
    if (image.count({x, 0}, {x + 1, image.height()},
                    [](Pixel p) { return test::distance(p, series_colour(0)) < 45; }) > 15)
      left = x;
  const double longest = rightmost(0, 10, 0) - left, sum = rightmost(1, 4, 0) - left;
  std::cout << "longest bar " << longest << " px, running sum up to " << sum << " px\n";
  EXPECT_NEAR(sum / longest, 100.0 / 60.0, 0.03);
}

TEST_F(Bars, OfAwkwardChangesAreDrawn) {
  BarsOptions options;
  options.legend = {std::string(300, 'l'), ""};
  options.running_sum = std::string(300, 'r');
  Bar labelled = two_sided(nan, 0.0);
  labelled.text = std::string(300, 't');
  write_bars(file("a.png"),
             {two_sided(nan, nan), two_sided(0.0, 0.0), two_sided(-1e300, nan), labelled}, options);
  EXPECT_EQ(Image(file("a.png")).width(), 1600);
}

TEST_F(Bars, NamesInsteadOfNumbersStandAtWholeX) {
  // the names are text and change the picture; those without room are left out
  Panel panel;
  Series line{"", Eigen::VectorXd::LinSpaced(5, 0.0, 4.0), {}, {}, {}, CurveStyle::Points, {}};
  line.y = line.x;
  panel.series = {line};
  write_curves(file("numbers.png"), {panel});
  panel.x_names = {"8", "16", "32", "64", "128"};
  write_curves(file("names.png"), {panel});
  EXPECT_FALSE(bytes(file("numbers.png")) == bytes(file("names.png")));
  panel.x_names.assign(100000, std::string(50, 'n'));
  write_curves(file("many.png"), {panel});
  panel.x_names = {"only one"};
  write_curves(file("few.png"), {panel});
}

}  // namespace
}  // namespace abbe::render
