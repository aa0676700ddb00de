#include "render/plot.h"
#include "render/distribution.h"
#include "render/figures.h"
#include "render/heat_map.h"
#include "render/machine_picture.h"
#include "tests/render/picture.h"
#include "tests/test.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::Image;
using test::Pixel;

class Plot : public test::Folder {};

VectorXd values(const std::vector<double>& list) {
  return Eigen::Map<const VectorXd>(list.data(), static_cast<Index>(list.size()));
}

TEST(Figures, AreThoseOfTheWeightedValues) {
  const Figures f = figures(values({1.0, -2.0, nan, 5.0}), values({1.0, 2.0, 100.0, 1.0}));
  EXPECT_DOUBLE_EQ(f.pv_um, 7.0);
  EXPECT_DOUBLE_EQ(f.mean_um, 0.5);
  EXPECT_DOUBLE_EQ(f.rms_um, std::sqrt(34.0 / 4.0));
  EXPECT_TRUE(std::isnan(figures(VectorXd::Constant(3, nan), VectorXd::Ones(3)).pv_um));
  EXPECT_THROW(figures(values({1, 2}), values({1, 1, 1})), std::invalid_argument);
  EXPECT_THROW(figures(values({1, 2}), values({1, -1})), std::invalid_argument);
}

/// Height in pixels of the bar that stands in a column of the picture.
int bar_height(const Image& image, int x) {
  return image.count({x, 0}, {x + 1, image.height()}, [](Pixel p) {
    return p.b > 150 && p.b < 200 && p.r < 110 && p.g > 100 && p.g < 150;
  });
}

TEST_F(Plot, HistogramWeighsByArea) {
  // three quarters of the area at +3 µm, one quarter at -3 µm, in equal numbers of vertices
  VectorXd deviation(200);
  VectorXd weights(200);
  for (int i = 0; i < 200; ++i) {
    deviation[i] = i % 2 == 0 ? 3.02 : -3.02;
    weights[i] = i % 2 == 0 ? 3.0 : 1.0;
  }
  write_histogram(file("a.png"), deviation, weights);
  const Image image(file("a.png"));
  int left = 0;
  int right = 0;
  for (int x = 150; x < 800; ++x) left = std::max(left, bar_height(image, x));
  for (int x = 900; x < 1540; ++x) right = std::max(right, bar_height(image, x));
  std::cout << "bars of " << left << " and " << right << " px\n";
  ASSERT_GT(left, 50);
  EXPECT_NEAR(right / double(left), 3.0, 0.06);  // two pixels of the shorter bar
}

TEST_F(Plot, HistogramOfAwkwardDataIsDrawn) {
  write_histogram(file("none.png"), VectorXd(0), VectorXd(0));
  write_histogram(file("nan.png"), VectorXd::Constant(3, nan), VectorXd::Ones(3));
  write_histogram(file("zero.png"), VectorXd::Zero(3), VectorXd::Ones(3));
  write_histogram(file("same.png"), VectorXd::Constant(3, 1e6), VectorXd::Ones(3));
  write_histogram(file("weightless.png"), values({1, 2}), values({0, 0}));
  VectorXd far = VectorXd::LinSpaced(100000, -1.0, 1.0);
  far[5] = 1e12;
  HistogramOptions options;
  options.tolerance_um = {-0.5, 0.5};
  write_histogram(file("far.png"), far, VectorXd::Ones(far.size()), options);
  EXPECT_GT(bar_height(Image(file("far.png")), 800),
            100);  // one far value does not squeeze the rest
  EXPECT_THROW(write_histogram(file("a.png"), far, VectorXd::Ones(2)), std::invalid_argument);
}

TEST_F(Plot, HistogramAndProfileAreTheSameBytesTwice) {
  const VectorXd x = VectorXd::LinSpaced(500, -50.0, 50.0);
  const ProfileSeries series{"uncompensated", x, x.array().sin()};
  for (const char* suffix : {"a", "b"}) {
    write_histogram(file(std::string("h") + suffix), x, VectorXd::Ones(500));
    write_profile(file(std::string("p") + suffix), {series});
  }
  EXPECT_TRUE(bytes(file("ha")) == bytes(file("hb")));
  EXPECT_TRUE(bytes(file("pa")) == bytes(file("pb")));
}

TEST_F(Plot, ProfileBreaksWhereAValueIsMissing) {
  VectorXd x = VectorXd::LinSpaced(101, 0.0, 100.0);
  VectorXd y = VectorXd::Zero(101);
  const auto curve_px = [&](const fs::path& path) {
    write_profile(path, {{"one", x, y}});
    return Image(path).count({150, 0}, {1200, 900},
                             [](Pixel p) { return test::distance(p, series_colour(0)) < 20; });
  };
  const int whole = curve_px(file("a.png"));
  y.segment(40, 21).setConstant(std::nan(""));
  const int broken = curve_px(file("b.png"));
  std::cout << "curve of " << whole << " px, broken " << broken << " px\n";
  EXPECT_NEAR(broken / double(whole), 0.78, 0.03);
}

TEST_F(Plot, ProfileOfAHundredThousandPointsKeepsItsExtremes) {
  const VectorXd x = VectorXd::LinSpaced(100000, 0.0, 100.0);
  VectorXd y = VectorXd::Zero(x.size());
  y[50000] = 5.0;  // one point among a hundred of its column
  write_profile(file("a.png"), {{"one", x, y}});
  const Image image(file("a.png"));
  const int high = image.count({150, 500}, {1200, 900},
                               [](Pixel p) { return test::distance(p, series_colour(0)) < 20; });
  EXPECT_GT(high, 100);
}

TEST_F(Plot, ProfileRefusesWhatCannotBeDrawn) {
  EXPECT_THROW(write_profile(file("a.png"), {}), std::invalid_argument);
  EXPECT_THROW(write_profile(file("a.png"), {{"one", values({1, 2}), values({1, 2, 3})}}),
               std::invalid_argument);
  EXPECT_THROW(write_profile(file("no/a.png"), {{"one", values({1, 2}), values({1, 2})}}),
               std::system_error);
  write_profile(file("empty.png"), {{"none", VectorXd(0), VectorXd(0)}});
  write_profile(file("point.png"), {{"point", VectorXd::Ones(1), VectorXd::Zero(1)}});
}

/// Pixels of a series colour.
int ink(const Image& image, int colour) {
  return image.count([&](Pixel p) { return test::distance(p, series_colour(colour)) < 20; });
}

Panel wave(int points) {
  Series line{"line", VectorXd::LinSpaced(points, 0.0, 10.0), {}, {}, {}, CurveStyle::Line, {}};
  line.y = line.x.array().sin();
  line.lower = line.y.array() - 0.3;
  line.upper = line.y.array() + 0.3;
  Series marks{"readings", line.x, line.y, {}, {}, CurveStyle::Points, {}};
  return {"panel", "x / mm", "y / µm", {line, marks}, {"a note"}};
}

TEST_F(Plot, CurvesShowLinesMarksAndBands) {
  write_curves(file("a.png"), {wave(30)});
  const Image image(file("a.png"));
  const Colour c = series_colour(0);
  const Colour band{1.0 - 0.2 * (1.0 - c.r), 1.0 - 0.2 * (1.0 - c.g), 1.0 - 0.2 * (1.0 - c.b)};
  const int shaded = image.count([&](Pixel p) { return test::distance(p, band) < 6; });
  std::cout << "line " << ink(image, 0) << ", marks " << ink(image, 1) << ", band " << shaded
            << " px\n";
  EXPECT_GT(ink(image, 0), 2000);
  EXPECT_GT(ink(image, 1), 30 * 40);  // thirty marks about ten pixels wide
  EXPECT_LT(ink(image, 1), 30 * 110);
  EXPECT_GT(shaded, 50000);
}

TEST_F(Plot, CommonScalesMakeASmallPanelSmall) {
  Panel large = wave(100);
  for (Series& s : large.series) {
    s.curve_style = CurveStyle::Line;
    s.lower = s.upper = {};
  }
  Panel small = large;
  for (Series& s : small.series) s.y *= 0.1;
  const auto height_of_lower = [&](bool common) {
    write_curves(file("a.png"), {large, small}, {.common_y = common});
    const Image image(file("a.png"));
    int low = image.height(), high = 0;
    for (int y = 0; y < image.height() / 2; ++y) {
      const int n = image.count({100, y}, {1200, y + 1},
                                [](Pixel p) { return test::distance(p, series_colour(1)) < 20; });
      if (n == 0) continue;
      low = std::min(low, y);
      high = std::max(high, y);
    }
    return high - low;
  };
  const int own = height_of_lower(false), common = height_of_lower(true);
  std::cout << "curve " << own << " px high, on a common scale " << common << " px\n";
  EXPECT_NEAR(common / double(own), 0.1, 0.03);
}

TEST_F(Plot, AGridHasAllItsPanels) {
  std::vector<Panel> panels(46, wave(20));
  write_grid(file("a.png"), panels);
  const int all = ink(Image(file("a.png")), 1);
  for (std::size_t i = 10; i < 46; ++i) panels[i].series.pop_back();
  write_grid(file("b.png"), panels);
  const int some = ink(Image(file("b.png")), 1);
  std::cout << "marks " << all << " px in 46 panels, " << some << " px in ten\n";
  EXPECT_NEAR(some / double(all), 10.0 / 46.0, 0.02);
}

TEST_F(Plot, APolarTraceLiesOutsideTheNominalCircleWhereItIsPositive) {
  const VectorXd angle = VectorXd::LinSpaced(721, 0.0, 6.283185307);
  const auto reach = [&](double deviation) {
    write_polar(file("a.png"), {{"", angle, VectorXd::Constant(721, deviation)}},
                {.division_um = 1.0});
    const Image image(file("a.png"));
    int left = image.width(), right = 0;
    for (int x = 0; x < image.width(); ++x) {
      const int n = image.count({x, 0}, {x + 1, image.height()},
                                [](Pixel p) { return test::distance(p, series_colour(0)) < 20; });
      if (n == 0) continue;
      left = std::min(left, x);
      right = std::max(right, x);
    }
    return 0.5 * (right - left);
  };
  const double plus = reach(2.0), zero = reach(0.0), minus = reach(-2.0);
  std::cout << "radii " << minus << ", " << zero << ", " << plus << " px\n";
  EXPECT_GT(minus, 50.0);
  EXPECT_NEAR(plus - zero, zero - minus, 2.0);  // two divisions either way fill the scale
  EXPECT_GT(plus - zero, 100.0);
}

TEST_F(Plot, BarsAreAsLongAsTheirValues) {
  const auto bar = [&](double value) {
    write_bars(file("a.png"), {{"longest", 4.0, {}, 1}, {"this", value, {}, 0}});
    const Image image(file("a.png"));
    int longest = 0;
    for (int y = 0; y < image.height(); ++y)
      longest = std::max(longest, image.count({0, y}, {image.width(), y + 1}, [](Pixel p) {
        return p.b > p.r + 60 && p.b > p.g + 30;
      }));
    return longest;
  };
  const int one = bar(1.0), three = bar(3.0);
  std::cout << "bars of " << one << " and " << three << " px\n";
  EXPECT_NEAR(three / double(one), 3.0, 0.05);
}

TEST_F(Plot, AwkwardSeriesAreDrawn) {
  Panel p = wave(5);
  p.series[0].y.setConstant(nan);
  p.series[0].lower[2] = nan;
  p.series[1].y.setZero();
  write_curves(file("a.png"), {p});
  for (Series& s : p.series) s.x.setConstant(nan);
  write_curves(file("b.png"), {p}, {.columns = 7});
  write_grid(file("c.png"), {p, wave(1), wave(0)}, {.columns = 100, .common_y = true});
  Panel constant = wave(2);
  for (Series& s : constant.series) s.y.setConstant(1e9);
  write_curves(file("d.png"), {constant});
  write_curves(file("e.png"), {wave(200000)});
  write_polar(file("f.png"), {{"", VectorXd(0), VectorXd(0)}});
  write_polar(file("g.png"), {{"n", values({0, 1, 2}), values({0, nan, 0})}});
  write_polar(file("h.png"), {{"n", values({0, 1}), values({1e9, -1e9})}}, {.division_um = 1e-9});
  write_bars(file("i.png"), {{"none", nan, {}, 0}, {"", 0.0, nan, 0}});
  write_bars(file("j.png"), {{std::string(500, 'x'), -1e9, 1e-12, 0}},
             {.reference = 1e9, .reference_label = "r", .from_zero = false});
  EXPECT_GT(Image(file("e.png")).width(), 0);
}

TEST_F(Plot, NewPlotsAreTheSameBytesTwice) {
  for (const char* name : {"1", "2"}) {
    const std::string n = name;
    write_curves(file("c" + n), {wave(50)});
    write_grid(file("g" + n), std::vector<Panel>(5, wave(50)));
    write_polar(file("p" + n), {{"t", wave(50).series[0].x, wave(50).series[0].y}});
    write_bars(file("b" + n), {{"a", 1.0, 0.1, 0}, {"b", -2.0, {}, 1}});
  }
  for (const std::string kind : {"c", "g", "p", "b"})
    EXPECT_TRUE(bytes(file(kind + "1")) == bytes(file(kind + "2"))) << kind;
}

TEST_F(Plot, NewPlotsRefuseWhatCannotBeDrawn) {
  Panel p = wave(5);
  EXPECT_THROW(write_curves(file("a.png"), {}), std::invalid_argument);
  EXPECT_THROW(write_grid(file("a.png"), {Panel{}}), std::invalid_argument);
  p.series[0].upper = {};
  EXPECT_THROW(write_curves(file("a.png"), {p}), std::invalid_argument);
  p = wave(5);
  p.series[1].y.conservativeResize(4);
  EXPECT_THROW(write_grid(file("a.png"), {p}), std::invalid_argument);
  EXPECT_THROW(write_curves(file("a.png"), std::vector<Panel>(200, wave(5))),
               std::invalid_argument);
  EXPECT_THROW(write_polar(file("a.png"), {}), std::invalid_argument);
  EXPECT_THROW(write_polar(file("a.png"), {{"", values({1}), values({1, 2})}}),
               std::invalid_argument);
  EXPECT_THROW(write_bars(file("a.png"), {}), std::invalid_argument);
  EXPECT_THROW(write_bars(file("a.png"), std::vector<Bar>(401)), std::invalid_argument);
  EXPECT_THROW(write_bars(file("no/a.png"), {{"a", 1.0, {}, 0}}), std::system_error);
}

class MachineDrawing : public test::Folder {
 protected:
  static MachinePicture picture() {
    MachinePicture m;
    m.title = "machine";
    m.magnification = 500.0;
    m.bodies.push_back({"bed",
                        kinematics::Pose(Eigen::Translation3d(0, 0, -250)),
                        BlockShape{{900, 700, 120}},
                        {0.2, 0.8, 0.2},
                        1.0});
    m.bodies.push_back(
        {"tool", kinematics::Pose::Identity(), CylinderShape{20, 300}, {0.8, 0.2, 0.2}, 1.0});
    const Field part = test::dome(20, test::flat);
    m.part_vertices = part.design.vertices;
    m.part_triangles = part.design.triangles;
    m.paths.push_back({"actual", part.design.vertices, {0.1, 0.1, 0.9}, 2.0});
    m.frames.push_back({"w", kinematics::Pose::Identity()});
    return m;
  }
};

TEST_F(MachineDrawing, ShowsBodiesPartAndPath) {
  write_machine_picture(file("a.png"), picture());
  const Image image(file("a.png"));
  EXPECT_GT(image.count([](Pixel p) { return p.g > p.r + 60 && p.g > p.b + 60; }), 50000);
  EXPECT_GT(image.count([](Pixel p) { return p.r > p.g + 80 && p.r > p.b + 80; }), 500);
  EXPECT_GT(image.count({800, 0}, {1600, 1000}, [](Pixel p) { return p.b > p.r + 80; }), 5000);
}

TEST_F(MachineDrawing, IsTheSameBytesTwice) {
  write_machine_picture(file("a.png"), picture());
  write_machine_picture(file("b.png"), picture());
  EXPECT_TRUE(bytes(file("a.png")) == bytes(file("b.png")));
}

TEST_F(MachineDrawing, RefusesWhatCannotBeDrawn) {
  EXPECT_THROW(write_machine_picture(file("a.png"), {}), std::invalid_argument);
  MachinePicture m = picture();
  m.bodies[0].T.translation().x() = std::nan("");
  EXPECT_THROW(write_machine_picture(file("a.png"), m), std::invalid_argument);
  m = picture();
  m.part_triangles(0, 0) = 1 << 30;
  EXPECT_THROW(write_machine_picture(file("a.png"), m), std::invalid_argument);
  m = picture();
  m.bodies.clear();
  write_machine_picture(file("a.png"), m);  // a part alone is a picture
}

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
  Series line{"", VectorXd::LinSpaced(5, 0.0, 4.0), {}, {}, {}, CurveStyle::Points, {}};
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

class Distribution : public test::Folder {};

VectorXd drawn(int count, double mean, double spread) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(mean, spread);
  return VectorXd::NullaryExpr(count, [&] { return normal(random); });
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
  VectorXd values = drawn(5000, 10.0, 1.0);
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
  const auto one = [&](const VectorXd& values) {
    write_distribution(file("a.png"), {{"one", values, nan, 1e9, {}}}, {.limit = 0.0});
  };
  one({});
  one(VectorXd::Constant(4, nan));
  one(VectorXd::Zero(1));
  one(VectorXd::Constant(1000, 1e6));
  one(Vector3d(0.0, 1e-12, -1e-12));
  one(Vector2d(-1e300, 1e300));
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
  write_heat_map(file("a.png"), {{"a"}, {"b"}, MatrixXd::Constant(1, 1, 5.0)}, {.range = 1.0});
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
  HeatMap one{{"the only day"}, {"cold", "3 h"}, MatrixXd::Constant(1, 2, 1.5)};
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
