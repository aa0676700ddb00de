#pragma once

#include <optional>
#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/layout.h"

/// Colour scales as they stand beside a map.
namespace abbe::render {

struct ColourBar {
  ColourScale scale;             ///< in micrometres
  bool low_end = false;          ///< an end in the colour of what lies below the scale
  bool high_end = false;         ///< and above it
  std::vector<double> marks{};   ///< values marked across the bar: limits of a tolerance
  std::vector<double> shares{};  ///< of the area, from the lower end to the upper: a histogram
  double histogram_px = 0.0;     ///< its width, to the left of the bar
};

/// A vertical colour bar with its ticks; it takes `box`, labels to the right of it go beyond, the
/// histogram to the left.
void colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar, const TextStyle& style);

/// The colours of a tolerance with how much of the area has each; in place of a colour bar.
struct ToleranceBar {
  double over = 0.0, in = 0.0, under = 0.0;  ///< percent of the judged area
  std::optional<Span> limits_um{};           ///< where they are the same everywhere
  std::vector<double> shares{};  ///< a histogram as above, from half a band below to half above
  double histogram_px = 0.0;
};
void tolerance_bar(Canvas& canvas, const Rectangle& box, const ToleranceBar& bar,
                   const TextStyle& style);

/// Shares of the weight of the values in equal bins from `ends.lower` to `ends.upper`; of what is
/// not finite nothing, what lies beyond is left out.
std::vector<double> histogram_fractions(const Eigen::VectorXd& values,
                                        const Eigen::VectorXd& weights, const Span& ends, int bins);

/// A lying scale in colours of its own, its ends written beside it; all of it is within `box`.
void horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                           const TextStyle& style);

/// A lying colour bar, the ends of its scale written beside it: -range .. +range, or 0 .. range.
/// All of it is within `box`.
struct HorizontalBar {
  double range = 1.0;      ///< in the unit that is written
  std::string unit{};      ///< behind the upper end
  bool one_sided = false;  ///< from 0
  bool low_end = false;    ///< as of ColourBar
  bool high_end = false;
};
void horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const HorizontalBar& bar,
                           const TextStyle& style);

}  // namespace abbe::render
