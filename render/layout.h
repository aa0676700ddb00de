#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "render/canvas.h"

/// Text and symbols common to several kinds of pictures.
namespace abbe::render {

/// Type sizes for a picture of `width` x `height`, px; the reference size is 1600 x 1200.
struct TypeSizes {
  double title = 36.0;
  double figures = 28.0;
  double body = 22.0;
  double unit = 1.0;  ///< px of this picture per px of the reference size
};
TypeSizes type_sizes(int width, int height);

/// Returns `text` in lines no wider than `width` px, broken at spaces and after hyphens; a word
/// that is too long, or text that exceeds `most` lines, ends in "…".
std::vector<std::string> wrapped(const std::string& text, const TextStyle& style, double width,
                                 std::size_t most = 4);

/// Writes lines downwards from `top_left` (horizontal alignment by `style`).
/// @return the height used, px
double paragraph(Canvas& canvas, const Eigen::Vector2d& top_left,
                 const std::vector<std::string>& lines, const TextStyle& style);
double line_height(const TextStyle& style);

/// Returns a count in groups of three digits, e.g. "12 345".
std::string grouped(std::size_t count);

/// Draws a bar of a round length in mm with its label to the right.
void scale_bar(Canvas& canvas, const View& view, const Eigen::Vector2d& left, double longest_px,
               const TextStyle& style);

/// Draws the directions of X, Y, Z in a view within `radius` px of the centre, labels slightly
/// beyond.
void triad(Canvas& canvas, const View& view, const Eigen::Vector2d& centre, double radius,
           const TextStyle& style);

/// Draws a coloured square and its label.
/// @return the width used, px
double swatch(Canvas& canvas, const Eigen::Vector2d& left, const Colour& colour,
              const std::string& label, const TextStyle& style);

// Coordinates and lines common to all plots.

struct Span {
  double lower = 0.0;
  double upper = 1.0;
};

void widen(Span& span, double value);

/// Returns a slightly wider span that is never empty.
Span padded(Span span);

/// The rectangle of a plot and the values at its edges.
struct Axes {
  Rectangle box;
  Span x;
  Span y;
};

/// Returns the pixel of a point.
Eigen::Vector2d at(const Axes& axes, double x, double y);

/// Returns a visually identical curve with at most four points per passage through a column of
/// pixels.
std::vector<Eigen::Vector2d> thinned(const std::vector<Eigen::Vector2d>& run);

/// Draws a line in the colour of a series, dashed if the dash of that series requires it.
void stroke(Canvas& canvas, const std::vector<Eigen::Vector2d>& points, int index, double width_px);

/// A page with a title above, a caption below and a rectangle for the content.
struct Page {
  int width = 1600;
  int height = 900;
  TextStyle title;
  TextStyle body;
  std::vector<std::string> title_lines;
  std::vector<std::string> caption_lines;
  double unit = 1.0;  ///< px of this picture per px of the reference size
  Rectangle inner;
};

/// Returns a page. @param unit  1 for type sizes of a picture 1600 px wide
Page page(int width, int height, const std::string& title, const std::vector<std::string>& caption,
          double unit);

/// Returns the height of title and caption in px, so that a page can be made to fit its content.
double page_margins(int width, const std::string& title, const std::vector<std::string>& caption,
                    double unit);

void draw_page(Canvas& canvas, const Page& page);

/// An entry of a legend: its symbols and name.
struct LegendEntry {
  std::string name;
  int colour = 0;
  bool line = true;
  bool points = false;
  bool band = false;
};

/// Draws the mark of a series at a point: disc, square, diamond or triangle, by the number of its
/// colour.
void draw_mark(Canvas& canvas, const Eigen::Vector2d& at, int colour, double size_px);

/// Draws entries downwards from `top_left`, names wrapped to `width`, then lines of text.
/// @return the height used, px
double draw_legend_column(Canvas& canvas, const Eigen::Vector2d& top_left, double width,
                          const std::vector<LegendEntry>& entries,
                          const std::vector<std::string>& note, const TextStyle& style);

/// Draws entries side by side from `left` (the middle of their line). @return the width used, px
double draw_legend_row(Canvas& canvas, const Eigen::Vector2d& left,
                       const std::vector<LegendEntry>& entries, const TextStyle& style);

}  // namespace abbe::render
