#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

namespace abbe::render {

/// A colour: red, green, blue in 0 .. 1 (sRGB).
struct Colour {
  double r = 0.0;
  double g = 0.0;
  double b = 0.0;
};

namespace colours {
inline constexpr Colour white{1.0, 1.0, 1.0};
inline constexpr Colour ink{0.13, 0.14, 0.16};         ///< text
inline constexpr Colour faint_ink{0.42, 0.44, 0.47};   ///< secondary text
inline constexpr Colour rule{0.83, 0.84, 0.86};        ///< grid lines
inline constexpr Colour uncut{0.50, 0.50, 0.50};       ///< status 1
inline constexpr Colour outside{0.70, 0.70, 0.70};     ///< status 2
inline constexpr Colour gouged{0.55, 0.10, 0.60};      ///< status 3
inline constexpr Colour beyond_high{0.30, 0.0, 0.07};  ///< above the scale
inline constexpr Colour beyond_low{0.04, 0.07, 0.33};  ///< below the scale
inline constexpr Colour over{0.85, 0.37, 0.13};        ///< above the tolerance
inline constexpr Colour in{0.84, 0.89, 0.80};          ///< within the tolerance
inline constexpr Colour under{0.16, 0.36, 0.68};       ///< below the tolerance
}  // namespace colours

/// Returns the diverging scale as `n` colours from -1 (blue) over 0 (light grey) to +1 (red):
/// perceptually uniform and symmetric in lightness.
/// Source: Moreland 2009, the cool to warm map.
std::vector<Colour> diverging(int n);

enum class Palette {
  Diverging,  ///< blue to red about zero; for values of one sign its light to dark half, extended
  Cividis,    ///< dark blue to yellow; Nuñez, Anderton, Renslow 2018; suitable for colour-blind
              ///< readers
};

/// Map from values to colours.
struct ColourScale {
  double low = -1.0;  ///< value of the first colour
  double high = 1.0;  ///< value of the last colour, above `low`
  std::vector<Colour> colours = diverging(1024);
  Colour below = colours::beyond_low;
  Colour above = colours::beyond_high;
};
/// Returns a colour scale.
/// @param low, high  for a diverging scale the end nearer to zero only truncates it
ColourScale colour_scale(double low, double high, Palette palette = Palette::Diverging);

/// Returns the scale of a tolerance; values in 0 .. 1 are within it.
ColourScale tolerance_scale();

inline constexpr int series_colours = 6;
/// Returns distinct colours for the series of a plot, repeated after `series_colours`;
/// distinguishable by colour-blind readers.
Colour series_colour(int index);

/// Returns a fraction of 0 .. 1 as a byte, clamped.
unsigned char to_byte(double share);

/// A rectangle of a picture in pixels, from its lower left corner.
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
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm, shown in the middle of the rectangle
  double mm_per_px = 1.0;
  double depth = 1.0;  ///< mm, everything lies within this distance in front of and behind the
                       ///< centre
  Rectangle area;
};

/// Returns the view from direction `from` in which the points just fill `area`.
/// @param from  from the part to the eye, any length; zero means +Z
/// @param up    shown upwards; if it is parallel to `from`, Y or X is used
View fit_view(const cutting::Points& points, const Eigen::Vector3d& from, const Eigen::Vector3d& up,
              const Rectangle& area);

/// Returns height over width of such a view.
double aspect(const cutting::Points& points, const Eigen::Vector3d& from,
              const Eigen::Vector3d& up);

/// Returns the pixel at which point p appears.
Eigen::Vector2d projected(const View& view, const Eigen::Vector3d& p);

/// Returns the name of a view: "from +Z", "from (−0.35, −0.70, 0.63)".
std::string view_description(const View& view);

/// A picture as pixels.
struct Pixels {
  int width = 0;
  int height = 0;
  std::string rgb;  ///< (3 * width * height) the upper row first
};

/// Optimisation goal of a PNG file.
enum class PngPurpose {
  Speed,
  Size,  ///< colours in steps of 8, white kept, at most 256: the most frequent and the most
         ///< distinct; saves two thirds of the bytes
};

/// Returns a picture as a PNG file. No graphics library is involved, so any thread may encode while
/// another one draws. The same pixels give the same bytes.
/// @throws std::invalid_argument if the sizes do not match
std::string png_file(const Pixels& pixels, PngPurpose png_purpose = PngPurpose::Speed);

}  // namespace abbe::render
