#include <ctime>
#include "render/canvas.h"
#include "render/colour_bar.h"
#include "render/map_sheet.h"
#include "render/picture.h"
#include "render/residual_map.h"
#include "render/surface_scene.h"
#include "tests/render/picture.h"
#include "tests/test.h"

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
    options.from = Vector3d::UnitZ();
    options.up = Vector3d::UnitY();
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
  options.from = options.up = Vector3d::UnitZ();  // up along the line of sight
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
  EXPECT_FALSE(fs::exists(file("a.png")));
}

TEST_F(Map, SaysWhichFileCouldNotBeWritten) {
  for (const fs::path& path : {file("no/such/a.png"), fs::path("/dev/full")}) {
    const std::string said =
        thrown_text<std::system_error>([&] { write_map(path, picture(dome(10, waves))); });
    EXPECT_HAS(said, path.string());
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
  EXPECT_EQ(fitted_range_um(f), 1e-3);
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
  for (const std::string& line : map_text(p, count_vertices(p.field, 2.0), 2.0, "from +Z"))
    text += line + "\n";
  for (const char* needed :
       {"+ material left, − gouged", "along the outward design normal", "datum touch off",
        "alignment rigid", "view from +Z", "10 000 vertices, 1 uncut (0.01 %)",
        "0.0100 % of the cut vertices", "−31.2", "facet error 0.4 µm"}) {
    EXPECT_HAS(text, needed);
  }
  p.field.status[5] = p.field.status[6] = 3;
  p.field.deviation_um[5] = p.field.deviation_um[6] = std::nan("");
  const std::string gouged = map_text(p, count_vertices(p.field, 2.0), 2.0, "from +Z")[1];
  EXPECT_HAS(gouged, "10 000 vertices, 1 uncut (0.01 %), 2 gouged deeper than the band");
  EXPECT_EQ(figures_text({12.34, 2.345, -0.0004}), "PV 12.3 µm    RMS 2.35 µm    mean 0.00 µm");
  EXPECT_EQ(figures_text({0.0123, 0.002, 0.001}), "PV 12.3 nm    RMS 2.00 nm    mean +1.00 nm");
  EXPECT_EQ(figures_text({2.5e-7, 4e-8, 0.0}, Mean::Omitted),
            "PV below 0.001 nm    RMS below 0.001 nm");
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

TEST_F(Map, GivesEqualValuesEqualColoursWhereverTheSurfaceLooks) {
  MapOptions options;
  options.range_um = 10.0;
  const Field bowl = sheet(
      80, 60, 200, 150, [](double x, double y) { return 0.02 * (x * x - y * y); },
      [](double, double) { return 5.0; });
  write_map(file("a.png"), picture(bowl), options);
  const Colour wanted = diverging(1024)[std::lround(1.5 * 511.5)];
  const Image image(file("a.png"));
  const int colour_map =
      image.count(map_lower, {1290, 1060}, [](Pixel p) { return p.is_reddish(); });
  const int equal =
      image.count(map_lower, {1290, 1060}, [&](Pixel p) { return test::distance(p, wanted) <= 2; });
  std::cout << equal << " of " << colour_map << " coloured pixels have the one colour\n";
  EXPECT_GT(equal, 100000);
  EXPECT_GT(equal, 0.98 * colour_map);  // the rest lies beside the lines at the rim
}

TEST_F(Map, UsesTheWholeScaleWhereAllValuesHaveOneSign) {
  Field f = sheet(1, 1, 100, 100, flat, [](double x, double) { return 5.0 + 9.8 * x; });
  EXPECT_EQ(fitted_ends_um(f).lower, 0.0);
  EXPECT_EQ(fitted_ends_um(f).upper, 10.0);
  f.deviation_um *= -1.0;
  EXPECT_EQ(fitted_ends_um(f).lower, -10.0);
  EXPECT_EQ(fitted_ends_um(f).upper, 0.0);
  // 500.1 to 500.9: a scale from zero would have one colour
  f.deviation_um = (-f.deviation_um.array()) * 0.08 + 500.1;
  EXPECT_NEAR(fitted_ends_um(f).lower, 500.1, 0.1);
  EXPECT_NEAR(fitted_ends_um(f).upper, 500.9, 0.1);
  // hardly anything below zero: the scale is cut short there, and nothing lies beyond it
  f = sheet(1, 1, 100, 100, flat, [](double x, double) { return 4.5 + 9.8 * x; });
  EXPECT_EQ(fitted_ends_um(f).lower, -1.0);
  EXPECT_EQ(fitted_ends_um(f).upper, 10.0);
  f.deviation_um.array() -= 4.5;
  EXPECT_EQ(fitted_ends_um(f).lower, -fitted_ends_um(f).upper);
  // lighter to darker from nothing to much
  const ColourScale reds = colour_scale(0.0, 10.0), blues = colour_scale(-10.0, 0.0);
  const auto light = [](const Colour& c) { return 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b; };
  for (std::size_t i = 1; i < reds.colours.size(); ++i) {
    EXPECT_LT(light(reds.colours[i]), light(reds.colours[i - 1]));
    EXPECT_GT(light(blues.colours[i]), light(blues.colours[i - 1]));
  }
}

TEST_F(Map, OfATolerancesBandsHasTheirColoursInTheirShares) {
  // a ramp from -10 to +10 over the width: 30 % below -4, 10 % above +8
  MapPicture p = picture(sheet(80, 60, 81, 61, flat, [](double x, double) { return x / 4.0; }));
  p.tolerance_um = Eigen::RowVector2d(-4.0, 8.0).replicate(81 * 61, 1);
  MapOptions options = from_above();
  options.colours = MapColours::Tolerance;
  write_map(file("a.png"), p, options);
  const Image image(file("a.png"));
  const auto seen = [&](const Colour& c) {
    return double(
        image.count(map_lower, {1290, 1060}, [&](Pixel q) { return test::distance(q, c) <= 2; }));
  };
  const double over = seen(colours::over), in = seen(colours::in), under = seen(colours::under);
  const double all = over + in + under;
  std::cout << "pixels over " << over / all << ", in " << in / all << ", under " << under / all
            << "\n";
  EXPECT_NEAR(over / all, 0.1, 0.01);
  EXPECT_NEAR(under / all, 0.3, 0.01);
  const TolerancePercentages s = tolerance_percentages(p.field, p.tolerance_um);
  EXPECT_NEAR(s.over, 10.0, 1.5);  // by vertices
  EXPECT_NEAR(s.under, 30.0, 1.5);
  EXPECT_NEAR(s.in + s.over + s.under + s.uncut, 100.0, 1e-9);
  EXPECT_EQ(limits_text(p.tolerance_um), "−4 to +8 µm");
  p.tolerance_um(3, 1) = 9.0;
  EXPECT_EQ(limits_text(p.tolerance_um), "by region");
  p.tolerance_um.resize(0, 2);
  EXPECT_THROW(write_map(file("b.png"), p, options), std::invalid_argument);
}

TEST_F(Map, LabelsOfFlagsStayInTheRoomAndApart) {
  const Rectangle room{100, 100, 600, 400};
  const auto overlap = [](const Rectangle& a, const Rectangle& b) {
    return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height &&
           b.y < a.y + a.height;
  };
  const Vector2d size(120, 30);
  for (int i = 0; i <= 20; ++i) {
    for (int j = 0; j <= 20; ++j) {
      const Vector2d a(100 + 30 * i, 100 + 20 * j), b = a + Vector2d(4, 2);
      const auto boxes = place_labels({a, b}, {size, size}, room, 22.0);
      for (const Rectangle& box : boxes) {
        EXPECT_GE(box.x, 100.0);
        EXPECT_GE(box.y, 100.0);
        EXPECT_LE(box.x + box.width, 700.0);
        EXPECT_LE(box.y + box.height, 500.0);
      }
      EXPECT_FALSE(overlap(boxes[0], boxes[1])) << i << ", " << j;
    }
  }
}

TEST_F(Map, KnowsWhatTheSurfaceHides) {
  const Field f = sheet(
      80, 60, 81, 61, [](double x, double) { return 30.0 - std::abs(x); }, flat);
  const View view =
      fit_view(f.design.vertices, Vector3d(1, 0, 0.1), Vector3d::UnitZ(), {0, 0, 800, 600});
  EXPECT_FALSE(is_hidden(view, f.design, {20, 0, 10}));
  EXPECT_TRUE(is_hidden(view, f.design, {-20, 0, 10}));
}

TEST_F(Map, HistogramOfTheBarHoldsAllOfTheArea) {
  const Field f = sheet(1, 1, 300, 100, flat, [](double x, double) { return 10.0 * x; });
  const std::vector<double> shares =
      histogram_fractions(f.deviation_um, f.design.area, {-5.0, 5.0}, 10);  // an even ramp
  double sum = 0.0;
  for (const double share : shares) {
    sum += share;
    EXPECT_NEAR(share, 0.1, 0.002);
  }
  EXPECT_NEAR(sum, f.design.area.sum(), 1e-9);
}

TEST_F(Map, AreasOfAFieldAreThoseOfItsStatistics) {
  Field f = sheet(1, 1, 30, 10, flat, [](double x, double) { return 10.0 * x * x; });
  f.interior_sample = cutting::Surface::InteriorSample::Middle;
  f.within_um.resize(f.design.triangles.rows());
  for (Index t = 0; t < f.within_um.size(); ++t) {
    double x = 0.0;
    for (const int corner : f.design.triangles.row(t)) x += f.design.vertices(corner, 0) / 3.0;
    f.within_um[t] = 10.0 * x * x;
  }
  const cutting::Weights w = weights(f);
  EXPECT_NEAR(w.vertex.sum() + w.within.sum(), f.design.area.sum(), 1e-12);
  const double mean = (w.vertex.dot(f.deviation_um) + w.within.dot(f.within_um)) * units::um;
  EXPECT_NEAR(mean / f.design.area.sum(), *statistics(f).mean, 1e-15);
}

TEST_F(Map, IsolinesLieAtTheirLevel) {
  const Field f = sheet(80, 60, 41, 31, flat, [](double x, double y) { return x + 0.3 * y; });
  const Wire lines = isolines(f, f.deviation_um, {-7.3, 11.1});
  ASSERT_GT(lines.segments.size(), 40u);
  for (Index i = 0; i < lines.points.rows(); ++i) {
    const double value = lines.points(i, 0) + 0.3 * lines.points(i, 1);
    EXPECT_LT(std::min(std::abs(value + 7.3), std::abs(value - 11.1)), 1e-9);
  }
}

TEST_F(Map, IsWrittenAsSvgAndPdfToo) {
  MapPicture p = picture(dome(20, waves));
  p.title = "title";
  MapOptions options;
  options.format = PictureFormat::Svg;
  write_map(file("a.svg"), p, options);
  const std::string svg = bytes(file("a.svg"));
  EXPECT_TRUE(svg.starts_with("<?xml "));
  EXPECT_NE(svg.find("<svg "), std::string::npos);
  EXPECT_TRUE(svg.ends_with("</svg>\n"));
  EXPECT_HAS(svg, "data:image/png;base64,iVBOR");
  write_map(file("b.svg"), p, options);
  EXPECT_TRUE(svg == bytes(file("b.svg")));
  options.format = PictureFormat::Pdf;
  write_map(file("a.pdf"), p, options);
  const std::string pdf = bytes(file("a.pdf"));
  EXPECT_TRUE(pdf.starts_with("%PDF-"));
  EXPECT_TRUE(pdf.ends_with("%%EOF\n"));
  const std::size_t table = std::stoul(pdf.substr(pdf.rfind("startxref") + 10));
  EXPECT_EQ(pdf.substr(table, 4), "xref");
  write_map(file("b.pdf"), p, options);
  EXPECT_TRUE(pdf == bytes(file("b.pdf")));
}

TEST_F(Map, WithALongTitleHasRoomForIt) {
  MapPicture p = picture(dome(20, waves));
  const auto ink_above_the_map = [&](const std::string& title) {
    p.title = title;
    write_map(file("a.png"), p);
    const Image image(file("a.png"));
    EXPECT_EQ(image.count({1570, 0}, {1600, 1200}, [](Pixel q) { return !q.is_white(); }), 0);
    return image.count({40, 1000}, {1560, 1200}, [](Pixel q) { return q.r < 90 && q.b < 90; });
  };
  const std::string words = "a scene that somebody gave a long name without a thought: ";
  EXPECT_GT(ink_above_the_map(words + words + "uncompensated"), 1.5 * ink_above_the_map(words));
}

TEST_F(Map, DrawsGreekChineseAndSquareBrackets) {
  const auto svg_of_text = [&](const std::string& words) {
    Canvas canvas(100, 100);
    canvas.text({0, 0}, words, {.size_px = 40.0});
    canvas.write(file("text.svg"), PictureFormat::Svg);
    return bytes(file("text.svg"));
  };
  for (const char* text : {"αβγ", "五轴机床", "é ø ß", "±µ−"}) {
    ASSERT_EQ(missing_font_package(text), "") << "the launcher installs it";
    // a letter that a font lacks is a box, and all boxes are alike
    EXPECT_NE(svg_of_text(text), svg_of_text("\uE000\uE001\uE002\uE003")) << text;
    EXPECT_GT(svg_of_text(text).size(), 600u) << text;
  }
  // corners: a round bracket has curves, a square one only lines
  const auto curves = [&](const std::string& text) {
    const std::string svg = svg_of_text(text);
    return std::count(svg.begin() + std::ptrdiff_t(svg.find(" d=")), svg.end(), 'C');
  };
  EXPECT_EQ(curves("["), 0);
  EXPECT_GT(curves("("), 0);
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
    EXPECT_LE(image.height(), 3000) << count;
    EXPECT_GT(image.count([](Pixel p) { return p.is_reddish(); }), 3000) << count;
  }
}

TEST_F(Comparison, PutsAllCasesOnOneScaleAndThoseThatItHidesAgainOnTheirOwn) {
  // the second case is a hundred times smaller: on the first one's scale it has no colour
  std::vector<MapPicture> two = cases(2, 40);
  two[1].field.deviation_um = two[0].field.deviation_um / 100.0;
  ComparisonOptions options;
  write_comparison(file("a.png"), two, options);
  const Image image(file("a.png"));
  const auto colour_map = [](Pixel p) { return p.is_reddish() || p.is_blueish(); };
  const auto upper = [&](int x0, int x1, int y0, int y1) {
    return image.count({x0, y0}, {x1, y1}, colour_map);
  };
  // two columns: the first case alone above, below it the second, on both scales
  const int middle = image.width() / 2, half = image.height() / 2;
  std::cout << "coloured: " << upper(0, middle, half, image.height()) << ", "
            << upper(0, middle, 0, half) << ", " << upper(middle, 1600, 0, half) << "\n";
  EXPECT_GT(upper(0, middle, half, image.height()), 10000);
  EXPECT_LT(upper(0, middle, 0, half), 6000) << "but for its colour bar";
  EXPECT_GT(upper(middle, 1600, 0, half), 10000);
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

/// Every value of every pixel by a rule.
Pixels painted(int width, int height, const std::function<int(int x, int y, int value)>& by) {
  Pixels pixels{width, height, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int k = 0; k < 3; ++k) pixels.rgb.push_back(char(by(x, y, k)));
  return pixels;
}

/// By how much a value differs at most once a PNG is read back by VTK.
int largest_difference(const Pixels& pixels, const fs::path& file, PngPurpose png_purpose) {
  std::ofstream(file, std::ios::binary) << png_file(pixels, png_purpose);
  const Image image(file);
  EXPECT_EQ(image.width(), pixels.width);
  EXPECT_EQ(image.height(), pixels.height);
  int largest = 0;
  for (int y = 0; y < pixels.height; ++y)
    for (int x = 0; x < pixels.width; ++x) {
      const Pixel seen = image.at(x, pixels.height - 1 - y);
      const auto* value = reinterpret_cast<const unsigned char*>(
          pixels.rgb.data() + 3 * (std::size_t(y) * std::size_t(pixels.width) + std::size_t(x)));
      largest = std::max({largest, std::abs(seen.r - value[0]), std::abs(seen.g - value[1]),
                          std::abs(seen.b - value[2])});
    }
  return largest;
}

using Png = Map;

TEST_F(Png, KeepsEveryColourWhereItIsMadeForSpeed) {
  std::mt19937 random(5);
  const Pixels noise = painted(67, 41, [&](int, int, int) { return int(random() % 256); });
  EXPECT_EQ(largest_difference(noise, file("noise.png"), PngPurpose::Speed), 0);
}

TEST_F(Png, ForSizeIsWithinHalfAStepOfEightAndWhiteStaysWhite) {
  const Pixels grey = painted(256, 3, [](int x, int, int) { return x; });
  EXPECT_EQ(largest_difference(grey, file("grey.png"), PngPurpose::Size), 4);
  const Pixels white = painted(9, 9, [](int, int, int) { return 255; });
  EXPECT_EQ(largest_difference(white, file("white.png"), PngPurpose::Size), 0);
  EXPECT_LT(png_file(white, PngPurpose::Size).size(), 120u);
}

TEST_F(Png, ForSizeTakesTheNearestOf256WhereThereAreMoreColours) {
  // 256 colours four times each, and 32 shades beside them once
  const Pixels many = painted(32, 33, [](int x, int y, int k) {
    if (y == 32) return k == 0 ? 8 * x : k == 1 ? 100 : 32;
    const int colour = (32 * y + x) % 256;
    return k == 0 ? 16 * (colour % 16) : k == 1 ? 16 * (colour / 16) : 32;
  });
  const int largest = largest_difference(many, file("many.png"), PngPurpose::Size);
  EXPECT_GT(largest, 0);
  EXPECT_LE(largest, 4 + 8);  // rounded by half a step, and then a whole one to the nearest
}

TEST_F(Png, ForSizeKeepsARareColourThatIsLikeNoOther) {
  // 400 reds and greens four times each; a pixel of purple, and one of dark red
  const Pixels many = painted(40, 40, [](int x, int y, int k) {
    if (x == 7 && y == 9) return k == 1 ? 0 : 200;
    if (x == 8 && y == 9) return k == 0 ? 104 : 24;
    return k == 0 ? 64 + 8 * (x / 2) : k == 1 ? 8 * (y % 20) + 64 : 128;
  });
  std::ofstream(file("rare.png"), std::ios::binary) << png_file(many, PngPurpose::Size);
  const Image image(file("rare.png"));
  const Pixel purple = image.at(7, 40 - 1 - 9), dark = image.at(8, 40 - 1 - 9);
  const auto values = [](const Pixel& pixel) { return std::vector{pixel.r, pixel.g, pixel.b}; };
  EXPECT_EQ(values(purple), (std::vector{200, 0, 200}));
  EXPECT_EQ(values(dark), (std::vector{104, 24, 24}));
}

}  // namespace
}  // namespace abbe::render
