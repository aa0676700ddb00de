#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

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
inline constexpr Colour over{0.85, 0.37, 0.13};        ///< above the tolerance
inline constexpr Colour in{0.84, 0.89, 0.80};          ///< within it
inline constexpr Colour under{0.16, 0.36, 0.68};       ///< below it
}  // namespace colours

/// The diverging scale as `n` colours from -1 (blue) over 0 (light grey) to +1 (red): perceptually
/// even and symmetric in lightness.
/// Source: Moreland 2009, the cool to warm map.
std::vector<Colour> diverging(int n);

enum class Palette {
  Diverging,  ///< blue to red about zero; of values of one sign its light to dark half, lengthened
  Cividis,    ///< dark blue to yellow; Nuñez, Anderton, Renslow 2018: for the colour blind too
};

/// What colour a value has.
struct ColourScale {
  double low = -1.0;  ///< value of the first colour
  double high = 1.0;  ///< of the last, above `low`
  std::vector<Colour> colours = diverging(1024);
  Colour below = colours::beyond_low;
  Colour above = colours::beyond_high;
};
/// @param low, high  of a diverging scale about zero the end that is nearer to it only cuts off
ColourScale colour_scale(double low, double high, Palette palette = Palette::Diverging);

/// Values of 0 .. 1 are within a tolerance.
ColourScale tolerance_scale();

inline constexpr int series_colours = 6;
/// Distinct colours for the series of a plot, repeated after `series_colours`; readable for the
/// colour blind.
Colour series_colour(int index);

/// A share of 0 .. 1 as a byte, cut off beyond.
unsigned char to_byte(double share);

/// Part of a picture in pixels, from its lower left corner.
struct Rectangle {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;
};

/// A parallel projection onto the picture: right, up and toward the eye are orthonormal.
struct View {
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  Eigen::Vector3d toward = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm, in the middle of the rectangle
  double mm_per_px = 1.0;
  double depth = 1.0;  ///< mm, everything lies within it before and behind the centre
  Rectangle area;
};

/// The view from direction `from` in which the points just fill `area`.
/// @param from  from the part to the eye, any length; zero is taken as +Z
/// @param up    shown upwards; where it is parallel to `from`, Y or X stands in
View fit_view(const cutting::Points& points, const Eigen::Vector3d& from, const Eigen::Vector3d& up,
              const Rectangle& area);

/// Height over width of what such a view shows.
double aspect(const cutting::Points& points, const Eigen::Vector3d& from,
              const Eigen::Vector3d& up);

/// Pixel of the picture where point p appears.
Eigen::Vector2d projected(const View& view, const Eigen::Vector3d& p);

/// How a view is named in a picture: "from +Z", "from (−0.35, −0.70, 0.63)".
std::string view_description(const View& view);

/// A picture as it is on a screen.
struct Pixels {
  int width = 0;
  int height = 0;
  std::string rgb;  ///< (3 * width * height) the upper row first
};

/// What the file of a picture is made for.
enum class PngPurpose {
  Speed,
  Size,  ///< colours in steps of 8, white kept, 256 at most: of more, the most frequent and those
         ///< that are like no other; two thirds of the bytes go
};

/// A PNG file of it: no graphics library takes part, so any thread may encode while
/// another one draws. The same pixels give the same bytes.
/// @throws std::invalid_argument if the sizes do not fit
std::string png_file(const Pixels& pixels, PngPurpose png_purpose = PngPurpose::Speed);

}  // namespace abbe::render
