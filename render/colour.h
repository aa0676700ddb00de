#pragma once

#include <vector>

namespace abbe::render {

/// Red, green, blue in 0 .. 1, as a screen takes them (sRGB).
struct Colour {
  double r = 0.0;
  double g = 0.0;
  double b = 0.0;
};

namespace colours {
inline constexpr Colour white{1.0, 1.0, 1.0};
inline constexpr Colour ink{0.13, 0.14, 0.16};         ///< text
inline constexpr Colour faint_ink{0.42, 0.44, 0.47};   ///< text of less weight
inline constexpr Colour rule{0.83, 0.84, 0.86};        ///< grid lines
inline constexpr Colour uncut{0.50, 0.50, 0.50};       ///< status 1
inline constexpr Colour outside{0.70, 0.70, 0.70};     ///< status 2
inline constexpr Colour gouged{0.55, 0.10, 0.60};      ///< status 3
inline constexpr Colour beyond_high{0.30, 0.0, 0.07};  ///< above the scale
inline constexpr Colour beyond_low{0.04, 0.07, 0.33};  ///< below the scale
}  // namespace colours

/// The diverging scale as `n` colours from -1 (blue) over 0 (light grey) to +1 (red): perceptually
/// even and symmetric in lightness.
/// Source: Moreland 2009, the cool to warm map.
std::vector<Colour> diverging(int n);

inline constexpr int series_colours = 6;
/// Distinct colours for the series of a plot, repeated after `series_colours`; readable for the
/// colour blind.
Colour series_colour(int index);

}  // namespace abbe::render
