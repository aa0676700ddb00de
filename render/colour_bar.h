#pragma once

#include <optional>
#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/layout.h"

/// Colour scales beside a map.
namespace abbe::render {

struct ColourBar {
  ColourScale scale;             ///< in micrometres
  bool low_end = false;          ///< adds an arrow in the colour of values below the scale
  bool high_end = false;         ///< adds an arrow in the colour of values above it
  std::vector<double> marks{};   ///< values marked across the bar: limits of a tolerance
  std::vector<double> shares{};  ///< histogram of the area, from the lower end to the upper
  double histogram_px = 0.0;     ///< width of the histogram, to the left of the bar
};

/// Draws a vertical colour bar with ticks. The bar fills `box`; labels extend beyond it to the
/// right, the histogram to the left.
void colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar, const TextStyle& style);

/// Colours of a tolerance with the fraction of the area in each, shown instead of a colour bar.
struct ToleranceBar {
  double over = 0.0, in = 0.0, under = 0.0;  ///< per cent of the judged area
  std::optional<Span> limits_um{};           ///< limits, if they are the same everywhere
  std::vector<double> shares{};  ///< histogram as above, from half a band below to half a band
                                 ///< above
  double histogram_px = 0.0;
};
void tolerance_bar(Canvas& canvas, const Rectangle& box, const ToleranceBar& bar,
                   const TextStyle& style);

/// Returns the sums of the weights of the values in equal bins from `ends.lower` to `ends.upper`;
/// values that are not finite or lie outside are excluded.
std::vector<double> histogram_fractions(const Eigen::VectorXd& values,
                                        const Eigen::VectorXd& weights, const Span& ends, int bins);

/// Draws a horizontal scale with its own colours and its ends as labels, all within `box`.
void horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                           const TextStyle& style);

/// A horizontal colour bar with its ends as labels: -range .. +range, or 0 .. range; all within
/// `box`.
struct HorizontalBar {
  double range = 1.0;      ///< in the displayed unit
  std::string unit{};      ///< after the label of the upper end
  bool one_sided = false;  ///< scale from 0
  bool low_end = false;    ///< as for ColourBar
  bool high_end = false;
};
void horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const HorizontalBar& bar,
                           const TextStyle& style);

}  // namespace abbe::render
