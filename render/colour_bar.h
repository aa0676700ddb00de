#pragma once

#include <optional>
#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/layout.h"

/// Colour bars, drawn beside a map.
namespace abbe::render {

struct ColourBar {
  ColourScale scale;                ///< in micrometres
  bool low_end = false;             ///< adds an arrow in the colour of values below the scale
  bool high_end = false;            ///< adds an arrow in the colour of values above it
  std::vector<double> marks{};      ///< values marked on the bar, such as limits of a tolerance
  std::vector<double> histogram{};  ///< histogram of the area, from the lower end to the upper
  double histogram_px = 0.0;        ///< width of the histogram, to the left of the bar
};

/// Draws a vertical colour bar with ticks. The bar fills `box`; labels are to the right of it, the
/// histogram to the left.
void draw_colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                     const TextStyle& style);

/// The colours of a tolerance with the fraction of the area in each, shown instead of a colour bar.
struct ToleranceBar {
  double over = 0.0, in = 0.0, under = 0.0;  ///< per cent of the judged area
  std::optional<Span> limits_um{};           ///< the limits, if all regions have the same
  std::vector<double> histogram{};  ///< histogram of the area, from half a tolerance below the
                                    ///< limits to half a tolerance above
  double histogram_px = 0.0;
};
void draw_tolerance_bar(Canvas& canvas, const Rectangle& box, const ToleranceBar& bar,
                        const TextStyle& style);

/// Returns the sum of the weights in each of several equal bins from `ends.lower` to `ends.upper`.
/// Values outside and values that are not finite are excluded. Empty `weights` mean a weight of 1.
std::vector<double> histogram_fractions(const Eigen::VectorXd& values,
                                        const Eigen::VectorXd& weights, const Span& ends, int bins);

/// Draws a horizontal colour bar, with the values at its ends as labels, all within `box`.
void draw_horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                                const TextStyle& style);

/// A horizontal colour bar from -range to +range, or from 0 to range.
struct HorizontalBar {
  double range = 1.0;      ///< in the displayed unit
  std::string unit{};      ///< after the label of the upper end
  bool one_sided = false;  ///< the scale starts at 0
  bool low_end = false;    ///< as in ColourBar
  bool high_end = false;
};
void draw_horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const HorizontalBar& bar,
                                const TextStyle& style);

}  // namespace abbe::render
