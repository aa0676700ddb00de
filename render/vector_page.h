#pragma once

#include <string>
#include <variant>
#include <vector>

#include "render/canvas.h"

/// Pictures whose flat parts stay sharp at any size. Letters are written as outlines, so that a
/// reader needs no font.
namespace abbe::render {

/// A convex polygon.
struct FlatPolygon {
  std::vector<Eigen::Vector2d> corners;  ///< px from the lower left corner of the picture
  Colour colour;
  double opacity = 1.0;
};
struct FlatText {
  Eigen::Vector2d at;  ///< px, its lower left corner before it is turned
  std::string text;
  TextStyle style;
};
using FlatMark = std::variant<FlatPolygon, FlatText>;

/// What stands behind the flat marks, on the whole page; empty where nothing does.
struct Raster {
  std::string png;  ///< a file
  std::string rgb;  ///< the same as three bytes a pixel, the upper row first
};

/// A whole file; marks in the order in which they are painted.
std::string svg_of(int width, int height, const std::vector<FlatMark>& marks, const Raster& behind);
std::string pdf_of(int width, int height, const std::vector<FlatMark>& marks, const Raster& behind);

}  // namespace abbe::render
