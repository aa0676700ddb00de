#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

namespace abbe::render {

/// A colour in sRGB: red, green and blue in 0 .. 1.
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
inline constexpr Colour uncut{0.50, 0.50, 0.50};       ///< status 1 of a vertex
inline constexpr Colour outside{0.70, 0.70, 0.70};     ///< status 2 of a vertex, not judged
inline constexpr Colour gouged{0.55, 0.10, 0.60};      ///< status 3 of a vertex
inline constexpr Colour beyond_high{0.30, 0.0, 0.07};  ///< above the scale
inline constexpr Colour beyond_low{0.04, 0.07, 0.33};  ///< below the scale
inline constexpr Colour over{0.85, 0.37, 0.13};        ///< above the tolerance
inline constexpr Colour in{0.84, 0.89, 0.80};          ///< within the tolerance
inline constexpr Colour under{0.16, 0.36, 0.68};       ///< below the tolerance
}  // namespace colours

/// Returns `n` colours of the diverging scale from blue over light grey to red. It is perceptually
/// uniform and symmetric in lightness.
/// Source: Moreland 2009, the cool to warm map.
std::vector<Colour> diverging(int n);

enum class Palette {
  Diverging,  ///< blue to red about zero; for values of one sign a scale from light to dark
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
/// Returns a colour scale. In a diverging scale, equal magnitudes have equally strong colours; the
/// end nearer to zero truncates its side.
ColourScale colour_scale(double low, double high, Palette palette = Palette::Diverging);

/// Returns the scale of a tolerance; values in 0 .. 1 are within it.
ColourScale tolerance_scale();

inline constexpr int series_colours = 6;
/// Returns the colour of a series by its index. Colours repeat after `series_colours`; colour-blind
/// readers can distinguish them.
Colour series_colour(int index);

/// Converts a fraction, clamped to 0 .. 1, to a byte.
unsigned char to_byte(double fraction);

/// A rectangle of a picture in pixels, from its lower left corner.
struct Rectangle {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;
};

/// A parallel projection onto the picture. The directions to the right, up and toward the eye are
/// orthonormal.
struct View {
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  Eigen::Vector3d toward_eye = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm, shown in the middle of the rectangle
  double mm_per_px = 1.0;
  double depth = 1.0;  ///< mm, clipping distance in front of and behind the centre
  Rectangle area;
};

/// Returns the view in which the points just fill `area`.
/// @param from  direction from the part to the eye, of any length; zero means +Z
/// @param up    direction shown upwards; if it is parallel to `from`, Y or X is used
View fit_view(const cutting::Points& points, const Eigen::Vector3d& from, const Eigen::Vector3d& up,
              const Rectangle& area);

/// Returns the ratio of height to width of the points in such a view.
double aspect(const cutting::Points& points, const Eigen::Vector3d& from,
              const Eigen::Vector3d& up);

/// Returns the pixel of a point p in a view.
Eigen::Vector2d project(const View& view, const Eigen::Vector3d& p);

/// Returns the name of a view: "from +Z", "from (−0.35, −0.70, 0.63)".
std::string view_description(const View& view);

/// A picture as pixels.
struct Pixels {
  int width = 0;
  int height = 0;
  std::string rgb;  ///< (3 * width * height) the top row first
};

/// Optimisation goal of a PNG file.
enum class PngPurpose {
  Speed,
  Size,  ///< a palette of at most 256 colours in steps of 8, which saves two thirds of the bytes
};

/// Returns the bytes of a PNG file. Thread-safe, also while another thread draws. The same pixels
/// give the same bytes.
/// @throws std::invalid_argument if the sizes do not match
std::string png_file(const Pixels& pixels, PngPurpose png_purpose = PngPurpose::Speed);

}  // namespace abbe::render
