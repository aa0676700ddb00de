#include "render/canvas.h"
#include "render/figures.h"
#include "render/layout.h"
#include "tests/test.h"

namespace abbe::render {
namespace {

/// How much of a pixel is ink, counted from the upper left corner.
double ink(const Pixels& pixels, int x, int y) {
  const auto at = 3 * (std::size_t(y) * std::size_t(pixels.width) + std::size_t(x));
  return 1.0 - double(static_cast<unsigned char>(pixels.rgb[at])) / 255.0;
}

constexpr Colour black{0.0, 0.0, 0.0};

/// Area of a triangle that is drawn with so many samples a pixel for scenes, px².
double area_drawn(int finer) {
  Canvas canvas(200, 100, finer);
  canvas.fill({{10.0, 10.0}, {191.3, 24.7}, {77.1, 90.2}}, black);
  const Pixels pixels = canvas.pixels();
  double area = 0.0;
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 200; ++x) area += ink(pixels, x, y);
  return area;
}

TEST(Canvas, APixelHasTheInkOfTheAreaThatCoversIt) {
  const Vector2d a(181.3, 14.7), b(67.1, 80.2);
  const double area = 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
  const double edges = a.norm() + b.norm() + (a - b).norm();
  // whatever the samples of scenes
  for (const int finer : {1, 2, 3, 4})
    EXPECT_NEAR(area_drawn(finer), area, 0.05 * edges) << finer << " samples each way";
  Canvas canvas(64, 64);
  canvas.fill(Rectangle{10.0, 10.0, 20.5, 5.0}, black);
  const Pixels pixels = canvas.pixels();
  EXPECT_NEAR(ink(pixels, 29, 64 - 12), 1.0, 1.0 / 255.0);
  EXPECT_NEAR(ink(pixels, 30, 64 - 12), 0.5, 1.0 / 255.0) << "half of a column";
  EXPECT_EQ(ink(pixels, 31, 64 - 12), 0.0);
}

TEST(Canvas, DrawsATextAsWideAsItIsSaidToBe) {
  const TextStyle style{.size_px = 17.0, .colour = black};
  const std::string text = "tolerance −20 to +20 µm, 40.9 % of the area in tolerance";
  const Vector2d size = text_size(text, style);
  for (const int finer : {1, 2, 3, 4}) {
    Canvas canvas(900, 64, finer);
    canvas.text({20.0, 20.0}, text, style);
    const Pixels pixels = canvas.pixels();
    int first = pixels.width, last = 0;
    for (int y = 0; y < pixels.height; ++y)
      for (int x = 0; x < pixels.width; ++x)
        if (ink(pixels, x, y) > 0.3) {
          first = std::min(first, x);
          last = std::max(last, x);
        }
    EXPECT_NEAR(first, 20.0, 3.0) << finer;
    EXPECT_NEAR(last - first + 1, size.x(), 1.5) << finer;
  }
}

TEST(Canvas, IsDrawnLessFinelyWhereItIsLong) {
  Canvas canvas(8200, 64, 4);
  canvas.fill(Rectangle{8100.0, 10.0, 50.0, 20.0}, black);
  const Pixels pixels = canvas.pixels();
  EXPECT_EQ(pixels.width, 8200);
  EXPECT_EQ(ink(pixels, 8125, 64 - 20), 1.0);
  EXPECT_EQ(ink(pixels, 8099, 64 - 20), 0.0);
  EXPECT_THROW(Canvas(200, 100, 0), std::invalid_argument);
  EXPECT_THROW(Canvas(200, 100, 5), std::invalid_argument);
  EXPECT_THROW(Canvas(200, max_side_px + 1), std::invalid_argument);
}

TEST(Label, HasATrueMinusAndNoSignOnZero) {
  EXPECT_EQ(fixed(-1.26, 1), "−1.3");
  EXPECT_EQ(fixed(-0.001, 2), "0.00");
  EXPECT_EQ(signed_fixed(0.5, 1), "+0.5");
  EXPECT_EQ(signed_fixed(-0.5, 1), "−0.5");
  EXPECT_EQ(signed_fixed(0.0, 0), "0");
}

TEST(Label, FigureShowsThreeDigits) {
  EXPECT_EQ(figure(12.345), "12.3");
  EXPECT_EQ(figure(0.012345), "0.0123");
  EXPECT_EQ(figure(1234.5), "1234");
  EXPECT_EQ(figure(0.0), "0");
  EXPECT_EQ(figure(std::nan("")), "–");
}

TEST(Label, OfAGivenNumberHasNoZerosAtItsEnd) {
  EXPECT_EQ(signed_figure(2.5), "+2.5");
  EXPECT_EQ(signed_figure(-8.0), "−8");
  EXPECT_EQ(signed_figure(20.0), "+20");
  EXPECT_EQ(signed_figure(0.0), "0");
}

TEST(Label, PercentSaysWhatIsNotQuiteNothingOrAll) {
  EXPECT_EQ(percent_text(0.0), "0 %");
  EXPECT_EQ(percent_text(0.001), "< 0.01 %");
  EXPECT_EQ(percent_text(5.167), "5.17 %");
  EXPECT_EQ(percent_text(41.34), "41.3 %");
  EXPECT_EQ(percent_text(99.96), "99.96 %");
  EXPECT_EQ(percent_text(99.999), "> 99.99 %");
  EXPECT_EQ(percent_text(100.0), "100 %");
}

TEST(Label, RoundUpGoesToTheNextOfOneTwoFive) {
  const double pairs[][2] = {{1, 1},    {1.01, 2},      {2, 2},      {2.2, 5},
                             {5.5, 10}, {0.003, 0.005}, {730, 1000}, {1e-9, 1e-9}};
  for (const auto& [value, up] : pairs) EXPECT_DOUBLE_EQ(round_up_125(value), up) << value;
  EXPECT_EQ(round_up_125(0.0), 0.0);
}

TEST(Label, TicksAreRoundAndWithinTheSpan) {
  const Ticks ticks = round_ticks(-5.0, 5.0, 11);
  ASSERT_EQ(ticks.values.size(), 11u);
  EXPECT_EQ(ticks.values.front(), -5.0);
  EXPECT_EQ(ticks.values.back(), 5.0);
  EXPECT_EQ(ticks.values[5], 0.0);
  EXPECT_EQ(ticks.decimals, 0);
  EXPECT_EQ(round_ticks(-0.2, 0.2, 11).decimals, 2);
  EXPECT_TRUE(round_ticks(1.0, 1.0, 5).values.empty());
  EXPECT_TRUE(round_ticks(0.0, std::nan(""), 5).values.empty());
}

TEST(Label, UnitIsNanometresBelowATenthOfAMicrometre) {
  EXPECT_STREQ(length_unit(0.05).name, "nm");
  EXPECT_STREQ(length_unit(0.1).name, "µm");
  EXPECT_EQ(length_unit(0.05).per_um, 1000.0);
}

TEST(Label, CountsAreGroupedByThousands) {
  EXPECT_EQ(group_digits(7), "7");
  EXPECT_EQ(group_digits(999), "999");
  EXPECT_EQ(group_digits(1000), "1 000");
  EXPECT_EQ(group_digits(12345678), "12 345 678");
}

TEST(Layout, WrappedTextStaysWithinItsWidth) {
  const TextStyle style{.size_px = 23.0};
  for (const std::string text :
       {"perfect-iterated-program", "warm_3_h-identified-decoupled-program",
        "a plain sentence that is long enough to need several lines of this width",
        "onewordthatisfartoolongforthecellandcannotbebrokenanywhere",
        "µµµµµµµµµµµµµµµµµµµµµµµµµµµµµµµµµ"}) {
    for (const double width : {90.0, 180.0, 333.0}) {
      const auto lines = wrap_text(text, style, width, 2);
      EXPECT_LE(lines.size(), 2u) << text;
      for (const std::string& line : lines) EXPECT_LE(text_size(line, style).x(), width) << line;
    }
  }
}

TEST(Layout, AWordIsPartedOnlyWhereItIsLongerThanALine) {
  const TextStyle style{.size_px = 23.0};
  const double line = text_size("a dome minus error_", style).x() + 1.0;
  EXPECT_EQ(wrap_text("a dome minus error_free", style, line, 2),
            (std::vector<std::string>{"a dome minus ", "error_free"}));
  const double narrow =
      std::max(text_size("perfect-", style).x(), text_size("program", style).x()) + 1.0;
  EXPECT_EQ(wrap_text("a perfect-program", style, narrow, 3),
            (std::vector<std::string>{"a ", "perfect-", "program"}));
}

TEST(Layout, ASignAndAUnitStayWithTheirNumber) {
  const TextStyle style{.size_px = 23.0};
  for (const std::string figure : {"± 0.243", "< 0.01 %", "> 99.99 %", "12.3 µm"}) {
    const std::string before = figure.substr(0, figure.rfind(' ') + 1);
    const double line =
        std::max(text_size("form " + before, style).x(), text_size(figure, style).x()) + 1.0;
    EXPECT_EQ(wrap_text("form " + figure, style, line, 2),
              (std::vector<std::string>{"form ", figure}));
  }
}

}  // namespace
}  // namespace abbe::render
