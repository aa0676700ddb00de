#include "render/map.h"

#include <chrono>
#include <cmath>
#include <ctime>
#include <iostream>
#include <stdexcept>
#include <system_error>

#include "render/comparison.h"
#include "render/map_text.h"
#include "tests/render/picture.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::dome;
using test::flat;
using test::Image;
using test::leave_uncut;
using test::Pixel;
using test::sheet;

class Map : public test::Folder {
 protected:
  static constexpr std::array<int, 2> map_lower{40, 160};  ///< px, about where the map lies
  static constexpr std::array<int, 2> map_upper{1370, 1060};

  static MapPicture picture(Field field) {
    MapPicture p;
    p.title = "scene: case";
    p.figures = figures(field.deviation_um, field.design.area);
    p.field = std::move(field);
    return p;
  }

  static MapOptions from_above() {
    MapOptions options;
    options.from = Eigen::Vector3d::UnitZ();
    options.up = Eigen::Vector3d::UnitY();
    return options;
  }
};

double waves(double x, double y) { return 12.0 * std::sin(x / 12.0) * std::cos(y / 15.0); }

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

TEST_F(Map, IsDrawnWithoutADisplayAndWithoutAWordOnTheTerminal) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  write_map(file("a.png"), picture(dome(60, waves)));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  const Image image(file("a.png"));
  EXPECT_EQ(image.width(), 1600);
  EXPECT_EQ(image.height(), 1200);
}

TEST_F(Map, HasRedBlueAndGreyAndFillsItsPlace) {
  Field f = dome(80, waves);
  for (int i = 0; i < 400; ++i) leave_uncut(f, 3000 + i);
  write_map(file("a.png"), picture(std::move(f)));
  const Image image(file("a.png"));
  EXPECT_GT(image.count(map_lower, map_upper, [](Pixel p) { return p.is_reddish(); }), 20000);
  EXPECT_GT(image.count(map_lower, map_upper, [](Pixel p) { return p.is_blueish(); }), 20000);
  EXPECT_GT(image.count(map_lower, map_upper, [](Pixel p) { return p.is_grey(); }), 2000);
  const double total = (map_upper[0] - map_lower[0]) * (map_upper[1] - map_lower[1]);
  const double covered =
      image.count(map_lower, map_upper, [](Pixel p) { return !p.is_white(); }) / total;
  std::cout << "the dome covers " << 100.0 * covered << " % of the map\n";
  EXPECT_GT(covered, 0.45);
}

TEST_F(Map, IsTheSameBytesTwice) {
  write_map(file("a.png"), picture(dome(60, waves)));
  write_map(file("b.png"), picture(dome(60, waves)));
  EXPECT_TRUE(bytes(file("a.png")) == bytes(file("b.png")));
}

TEST_F(Map, ShowsAValueInTheColourOfItsScale) {
  // seen at right angles nothing is shaded, so the colour is the scale's own
  const std::vector<Colour> scale = diverging(1024);
  MapOptions options = from_above();
  options.range_um = 10.0;
  int worst = 0;
  for (const double value : {-9.99, -5.0, 0.0, 2.5, 9.99}) {
    write_map(file("a.png"),
              picture(sheet(80, 60, 40, 30, flat, [&](double, double) { return value; })), options);
    const Pixel centre = Image(file("a.png")).at(705, 610);
    worst =
        std::max(worst, test::distance(centre, scale[std::lround((value / 10.0 + 1.0) * 511.5)]));
  }
  std::cout << "largest difference of a colour: " << worst << " of 255\n";
  EXPECT_LE(worst, 2);
}

TEST_F(Map, TellsWhatLiesBeyondTheScaleInColoursOfItsOwn) {
  MapOptions options = from_above();
  options.range_um = 10.0;
  const auto step = [](double x, double) { return x > 0.0 ? 11.0 : -11.0; };
  write_map(file("a.png"), picture(sheet(80, 60, 40, 30, flat, step)), options);
  const Image image(file("a.png"));
  EXPECT_LE(test::distance(image.at(900, 610), colours::beyond_high), 2);
  EXPECT_LE(test::distance(image.at(500, 610), colours::beyond_low), 2);
}

TEST_F(Map, HasPositiveXAtTheRightSeenFromAboveAndPositiveIsRed) {
  const auto right = [](double x, double) { return x; };
  write_map(file("a.png"), picture(sheet(80, 60, 40, 30, flat, right)), from_above());
  const Image image(file("a.png"));
  EXPECT_TRUE(image.at(1150, 610).is_reddish());
  EXPECT_TRUE(image.at(260, 610).is_blueish());
  write_map(file("b.png"), picture(sheet(80, 60, 40, 30, flat, [](double, double y) { return y; })),
            from_above());
  const Image upright(file("b.png"));
  EXPECT_TRUE(upright.at(705, 950).is_reddish());
  EXPECT_TRUE(upright.at(705, 270).is_blueish());
}

TEST_F(Map, OfAPartThatIsNowhereCutIsGrey) {
  Field f = dome(40, waves);
  for (int i = 0; i < static_cast<int>(f.status.size()); ++i) leave_uncut(f, i);
  write_map(file("a.png"), picture(std::move(f)));
  const Image image(file("a.png"));
  EXPECT_GT(image.count(map_lower, map_upper, [](Pixel p) { return p.is_grey(); }), 300000);
  EXPECT_EQ(image.count(map_lower, map_upper, [](Pixel p) { return p.is_reddish(); }), 0);
}

TEST_F(Map, OfAwkwardFieldsIsDrawn) {
  Field none;
  none.design.vertices.resize(0, 3);
  none.design.triangles.resize(0, 3);
  write_map(file("none.png"), picture(none));
  write_map(file("zero.png"), picture(dome(20, flat)));
  write_map(file("tiny.png"), picture(dome(20, [](double x, double) { return 1e-9 * x; })));
  write_map(file("huge.png"), picture(dome(20, [](double x, double) { return 1e9 * x; })));
  MapOptions options;
  options.from = options.up = Eigen::Vector3d::UnitZ();  // up along the line of sight
  write_map(file("up.png"), picture(dome(20, waves)), options);
  options.from.setZero();
  options.width = 320;
  options.height = 240;
  write_map(file("small.png"), picture(dome(20, waves)), options);
  EXPECT_EQ(Image(file("small.png")).width(), 320);
}

TEST_F(Map, RefusesWhatCannotBeDrawn) {
  MapOptions options;
  for (const double range : {0.0, -1.0, std::nan("")}) {
    options.range_um = range;
    EXPECT_THROW(write_map(file("a.png"), picture(dome(10, waves)), options),
                 std::invalid_argument);
  }
  MapPicture p = picture(dome(10, waves));
  p.field.status.pop_back();
  EXPECT_THROW(write_map(file("a.png"), p), std::invalid_argument);
  p = picture(dome(10, waves));
  p.field.design.triangles(0, 0) = 400;
  EXPECT_THROW(write_map(file("a.png"), p), std::invalid_argument);
  p = picture(dome(10, waves));
  p.field.deviation_um[3] = std::nan("");
  EXPECT_THROW(write_map(file("a.png"), p), std::invalid_argument);
  options = {};
  options.width = 3;
  EXPECT_THROW(write_map(file("a.png"), picture(dome(10, waves)), options), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(file("a.png")));
}

TEST_F(Map, SaysWhichFileCouldNotBeWritten) {
  for (const std::filesystem::path& path :
       {file("no/such/a.png"), std::filesystem::path("/dev/full")}) {
    try {
      write_map(path, picture(dome(10, waves)));
      ADD_FAILURE() << path << " was written";
    } catch (const std::system_error& failure) {
      EXPECT_NE(std::string(failure.what()).find(path.string()), std::string::npos)
          << failure.what();
    }
  }
}

TEST_F(Map, RangeHoldsAllButAHalfPercentAndIsRound) {
  Field f = sheet(1, 1, 100, 100, flat, [](double, double) { return 1.6; });
  EXPECT_EQ(fitted_range_um(f), 2.0);
  f.deviation_um.setConstant(24.99);
  EXPECT_EQ(fitted_range_um(f), 30.0);  // not 50: the scale must fit the data
  f.deviation_um.setConstant(1.6);
  f.deviation_um.head(50).setConstant(-900.0);  // 0.5 %
  EXPECT_EQ(fitted_range_um(f), 2.0);
  f.deviation_um.head(51).setConstant(-900.0);
  EXPECT_EQ(fitted_range_um(f), 1000.0);
  f.deviation_um.setZero();
  EXPECT_EQ(fitted_range_um(f), 1e-5);
  f.deviation_um.setConstant(std::nan(""));
  EXPECT_GT(fitted_range_um(f), 0.0);
}

TEST_F(Map, SaysEverythingThatAMapMustSay) {
  Field f = sheet(1, 1, 100, 100, flat, [](double, double) { return 1.5; });
  leave_uncut(f, 4);
  f.deviation_um[8] = -31.24;
  MapPicture p = picture(std::move(f));
  p.datum = "touch off";
  p.alignment = "rigid";
  p.caption = {"facet error 0.4 µm"};
  std::string text;
  for (const std::string& line : map_text(p, tally(p.field, 2.0), 2.0, "from +Z"))
    text += line + "\n";
  for (const char* needed :
       {"+ material left, − gouged", "along the outward design normal", "datum touch off",
        "alignment rigid", "view from +Z", "10 000 vertices, 1 uncut (0.01 %)",
        "0.0100 % of the cut vertices", "−31.2", "facet error 0.4 µm"}) {
    EXPECT_NE(text.find(needed), std::string::npos) << needed << " in\n" << text;
  }
  p.field.status[5] = p.field.status[6] = 3;
  p.field.deviation_um[5] = p.field.deviation_um[6] = std::nan("");
  const std::string gouged = map_text(p, tally(p.field, 2.0), 2.0, "from +Z")[1];
  EXPECT_NE(gouged.find("10 000 vertices, 1 uncut (0.01 %), 2 gouged deeper than the band"),
            std::string::npos)
      << gouged;
  EXPECT_EQ(figures_text({12.34, 2.345, -0.0004}), "PV 12.3 µm    RMS 2.35 µm    mean 0.00 µm");
  EXPECT_EQ(figures_text({0.0123, 0.002, 0.001}), "PV 12.3 nm    RMS 2.00 nm    mean +1.00 nm");
  EXPECT_EQ(figures_text({}), "nothing was cut");
}

TEST_F(Map, OfTwoHundredThousandVerticesTakesSeconds) {
  const MapPicture p = picture(sheet(
      100, 100, 450, 450,
      [](double x, double y) { return 5.0 * std::sin(x / 15.0) * std::cos(y / 18.0); }, waves));
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t processor = std::clock();
  write_map(file("a.png"), p);
  std::cout << "202 500 vertices: " << seconds_since(start) << " s, processor "
            << static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC << " s\n";
}

class Comparison : public Map {
 protected:
  static std::vector<MapPicture> cases(int count, int rings) {
    std::vector<MapPicture> all;
    for (int i = 0; i < count; ++i) {
      all.push_back(
          picture(dome(rings, [&](double x, double y) { return waves(x, y) / (1 + i * i); })));
      all.back().title = i % 3 == 2 ? "warm_3_h-identified-decoupled-program-with-a-very-long-name"
                                    : "perfect-iterated";
      if (i > 0) all.back().caption = {"−92 % RMS"};
    }
    return all;
  }
};

TEST_F(Comparison, OfOneToTwelveCasesIsDrawn) {
  for (int count = 1; count <= 12; ++count) {
    write_comparison(file("a.png"), cases(count, 20));
    const Image image(file("a.png"));
    EXPECT_EQ(image.width(), 1600) << count;
    EXPECT_LE(image.height(), 2400) << count;
    EXPECT_GT(image.count([](Pixel p) { return p.is_reddish(); }), 3000) << count;
  }
}

TEST_F(Comparison, PutsAllCasesOnOneScale) {
  // the second case is a hundred times smaller: on the first one's scale it has no colour
  std::vector<MapPicture> two = cases(2, 40);
  two[1].field.deviation_um = two[0].field.deviation_um / 100.0;
  write_comparison(file("a.png"), two);
  const Image image(file("a.png"));
  const int middle = 36 + (1600 - 2 * 36 - 170) / 2;
  const auto coloured = [](Pixel p) { return p.is_reddish() || p.is_blueish(); };
  EXPECT_GT(image.count({36, 0}, {middle, image.height()}, coloured), 10000);
  EXPECT_EQ(image.count({middle, 0}, {1600 - 36 - 170, image.height()}, coloured), 0);
}

TEST_F(Comparison, IsTheSameBytesTwice) {
  write_comparison(file("a.png"), cases(5, 30));
  write_comparison(file("b.png"), cases(5, 30));
  EXPECT_TRUE(bytes(file("a.png")) == bytes(file("b.png")));
}

TEST_F(Comparison, RefusesToCompareNothing) {
  EXPECT_THROW(write_comparison(file("a.png"), {}), std::invalid_argument);
}

TEST_F(Comparison, OfSixCasesOfAHundredThousandVerticesTakesSeconds) {
  const std::vector<MapPicture> six = cases(6, 158);
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t processor = std::clock();
  write_comparison(file("a.png"), six);
  std::cout << six[0].field.status.size() << " vertices x 6: " << seconds_since(start)
            << " s, processor " << static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC
            << " s\n";
}

}  // namespace
}  // namespace abbe::render
