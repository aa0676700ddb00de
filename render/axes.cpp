#include "render/axes.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace abbe::render {

using Eigen::Vector2d;

namespace {

/// Beyond the colours there are, series are distinguished by their dashes: lengths drawn and left
/// out, in widths of the line.
struct Dash {
  double drawn = 0.0;  ///< 0: without gaps
  double gap = 0.0;
};
Dash series_dash(int index) {
  constexpr Dash dashes[] = {{}, {5.0, 3.0}, {1.5, 2.0}};
  return dashes[std::min(index / series_colours, 2)];
}

}  // namespace

Vector2d at(const Axes& axes, double x, double y) {
  return {axes.box.x + axes.box.width * (x - axes.x.lower) / (axes.x.upper - axes.x.lower),
          axes.box.y + axes.box.height * (y - axes.y.lower) / (axes.y.upper - axes.y.lower)};
}

void widen(Span& span, double value) {
  span.lower = std::min(span.lower, value);
  span.upper = std::max(span.upper, value);
}

Span padded(Span span) {
  const double size = span.upper - span.lower;
  const double pad = size > 0.0 ? 0.06 * size : std::max(1e-6, 0.1 * std::abs(span.lower));
  return {span.lower - pad, span.upper + pad};
}

std::vector<Vector2d> thinned(const std::vector<Vector2d>& run) {
  std::vector<Vector2d> kept;
  for (std::size_t i = 0; i < run.size();) {
    const double column = std::floor(run[i].x());
    std::size_t end = i;
    std::size_t low = i;
    std::size_t high = i;
    for (; end < run.size() && std::floor(run[end].x()) == column; ++end) {
      if (run[end].y() < run[low].y()) low = end;
      if (run[end].y() > run[high].y()) high = end;
    }
    std::array<std::size_t, 4> shown{i, std::min(low, high), std::max(low, high), end - 1};
    const auto last = std::unique(shown.begin(), shown.end());
    for (auto k = shown.begin(); k != last; ++k) kept.push_back(run[*k]);
    i = end;
  }
  return kept;
}

void stroke(Canvas& canvas, const std::vector<Vector2d>& points, int index, double width_px) {
  const Dash dash = series_dash(index);
  if (dash.drawn == 0.0) {
    canvas.line(points, series_colour(index), width_px);
    return;
  }
  std::vector<Vector2d> piece;
  bool drawing = true;
  double left = dash.drawn * width_px;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i > 0) {
      Vector2d from = points[i - 1];
      double length = (points[i] - from).norm();
      while (length > left) {
        from += (points[i] - from) * (left / length);
        length -= left;
        if (drawing) {
          piece.push_back(from);
          canvas.line(piece, series_colour(index), width_px);
        }
        drawing = !drawing;
        piece.assign(drawing ? 1 : 0, from);
        left = (drawing ? dash.drawn : dash.gap) * width_px;
      }
      left -= length;
    }
    if (drawing) piece.push_back(points[i]);
  }
  if (drawing && piece.size() > 1) canvas.line(piece, series_colour(index), width_px);
}

}  // namespace abbe::render
