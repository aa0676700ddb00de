#include "render/canvas.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace abbe::render {
namespace {

using Eigen::Vector2d;

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

}  // namespace
}  // namespace abbe::render
