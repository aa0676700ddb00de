#pragma once

#include <vector>

#include <Eigen/Core>

#include "render/canvas.h"

/// What plots of every kind do with coordinates and lines.
namespace abbe::render {

struct Span {
  double lower = 0.0;
  double upper = 1.0;
};

void widen(Span& span, double value);

/// A little more on both sides, and never empty.
Span padded(Span span);

/// The rectangle of a plot and what its edges mean.
struct Axes {
  Rectangle box;
  Span x;
  Span y;
};

/// Pixels of a point.
Eigen::Vector2d at(const Axes& axes, double x, double y);

/// The same curve to the eye with at most four points for each run through one column of pixels.
std::vector<Eigen::Vector2d> thinned(const std::vector<Eigen::Vector2d>& run);

/// A line in the colour of a series, or the pieces of it that the dash of that series leaves.
void stroke(Canvas& canvas, const std::vector<Eigen::Vector2d>& points, int index, double width_px);

}  // namespace abbe::render
