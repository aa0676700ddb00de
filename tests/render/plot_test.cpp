#include "render/plot.h"

#include <cmath>
#include <iostream>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "render/figures.h"
#include "render/machine_picture.h"
#include "tests/kinematics/nan.h"
#include "tests/render/picture.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::Image;
using test::Pixel;

class Plot : public test::Folder {};

Eigen::VectorXd values(const std::vector<double>& list) {
  return Eigen::Map<const Eigen::VectorXd>(list.data(), static_cast<Eigen::Index>(list.size()));
}

TEST(Figures, AreThoseOfTheWeightedValues) {
  const Figures f = figures(values({1.0, -2.0, nan, 5.0}), values({1.0, 2.0, 100.0, 1.0}));
  EXPECT_DOUBLE_EQ(f.pv_um, 7.0);
  EXPECT_DOUBLE_EQ(f.mean_um, 0.5);
  EXPECT_DOUBLE_EQ(f.rms_um, std::sqrt(34.0 / 4.0));
  EXPECT_TRUE(
      std::isnan(figures(Eigen::VectorXd::Constant(3, nan), Eigen::VectorXd::Ones(3)).pv_um));
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
  Eigen::VectorXd deviation(200);
  Eigen::VectorXd weights(200);
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
  write_histogram(file("none.png"), Eigen::VectorXd(0), Eigen::VectorXd(0));
  write_histogram(file("nan.png"), Eigen::VectorXd::Constant(3, nan), Eigen::VectorXd::Ones(3));
  write_histogram(file("zero.png"), Eigen::VectorXd::Zero(3), Eigen::VectorXd::Ones(3));
  write_histogram(file("same.png"), Eigen::VectorXd::Constant(3, 1e6), Eigen::VectorXd::Ones(3));
  write_histogram(file("weightless.png"), values({1, 2}), values({0, 0}));
  Eigen::VectorXd far = Eigen::VectorXd::LinSpaced(100000, -1.0, 1.0);
  far[5] = 1e12;
  HistogramOptions options;
  options.tolerance_um = {-0.5, 0.5};
  write_histogram(file("far.png"), far, Eigen::VectorXd::Ones(far.size()), options);
  EXPECT_GT(bar_height(Image(file("far.png")), 800),
            100);  // one far value does not squeeze the rest
  EXPECT_THROW(write_histogram(file("a.png"), far, Eigen::VectorXd::Ones(2)),
               std::invalid_argument);
}

TEST_F(Plot, HistogramAndProfileAreTheSameBytesTwice) {
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(500, -50.0, 50.0);
  const ProfileSeries series{"uncompensated", x, x.array().sin()};
  for (const char* suffix : {"a", "b"}) {
    write_histogram(file(std::string("h") + suffix), x, Eigen::VectorXd::Ones(500));
    write_profile(file(std::string("p") + suffix), {series});
  }
  EXPECT_TRUE(bytes(file("ha")) == bytes(file("hb")));
  EXPECT_TRUE(bytes(file("pa")) == bytes(file("pb")));
}

TEST_F(Plot, ProfileBreaksWhereAValueIsMissing) {
  Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(101, 0.0, 100.0);
  Eigen::VectorXd y = Eigen::VectorXd::Zero(101);
  const auto curve_px = [&](const std::filesystem::path& path) {
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
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(100000, 0.0, 100.0);
  Eigen::VectorXd y = Eigen::VectorXd::Zero(x.size());
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
  write_profile(file("empty.png"), {{"none", Eigen::VectorXd(0), Eigen::VectorXd(0)}});
  write_profile(file("point.png"), {{"point", Eigen::VectorXd::Ones(1), Eigen::VectorXd::Zero(1)}});
}

/// Pixels of a series colour.
int ink(const Image& image, int colour) {
  return image.count([&](Pixel p) { return test::distance(p, series_colour(colour)) < 20; });
}

Panel wave(int points) {
  Series line{"line", Eigen::VectorXd::LinSpaced(points, 0.0, 10.0), {}, {}, {}, CurveStyle::Line,
              {}};
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
  const Eigen::VectorXd angle = Eigen::VectorXd::LinSpaced(721, 0.0, 6.283185307);
  const auto reach = [&](double deviation) {
    write_polar(file("a.png"), {{"", angle, Eigen::VectorXd::Constant(721, deviation)}},
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
  write_polar(file("f.png"), {{"", Eigen::VectorXd(0), Eigen::VectorXd(0)}});
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
  write_machine(file("a.png"), picture());
  const Image image(file("a.png"));
  EXPECT_GT(image.count([](Pixel p) { return p.g > p.r + 60 && p.g > p.b + 60; }), 50000);
  EXPECT_GT(image.count([](Pixel p) { return p.r > p.g + 80 && p.r > p.b + 80; }), 500);
  EXPECT_GT(image.count({800, 0}, {1600, 1000}, [](Pixel p) { return p.b > p.r + 80; }), 5000);
}

TEST_F(MachineDrawing, IsTheSameBytesTwice) {
  write_machine(file("a.png"), picture());
  write_machine(file("b.png"), picture());
  EXPECT_TRUE(bytes(file("a.png")) == bytes(file("b.png")));
}

TEST_F(MachineDrawing, RefusesWhatCannotBeDrawn) {
  EXPECT_THROW(write_machine(file("a.png"), {}), std::invalid_argument);
  MachinePicture m = picture();
  m.bodies[0].T.translation().x() = std::nan("");
  EXPECT_THROW(write_machine(file("a.png"), m), std::invalid_argument);
  m = picture();
  m.part_triangles(0, 0) = 1 << 30;
  EXPECT_THROW(write_machine(file("a.png"), m), std::invalid_argument);
  m = picture();
  m.bodies.clear();
  write_machine(file("a.png"), m);  // a part alone is a picture
}

}  // namespace
}  // namespace abbe::render
