#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "render/canvas.h"

/// Text, symbols, axes and pages common to several kinds of pictures.
namespace abbe::render {

/// Type sizes for a picture of `width` x `height`, px; the reference size is 1600 x 1200.
struct TypeSizes {
  double title = 36.0;
  double figures = 28.0;
  double body = 22.0;
  double unit = 1.0;  ///< px of this picture per px of the reference size
};
TypeSizes type_sizes(int width, int height);

/// Breaks `text` into lines of at most `width` px, at spaces and after hyphens. A word that is too
/// long, or the last of `max_lines` lines, is shortened and ends in "…".
std::vector<std::string> wrap_text(const std::string& text, const TextStyle& style, double width,
                                   std::size_t max_lines = 4);

/// Draws lines of text downwards from `top_left`; `style` has the horizontal anchor.
/// @return the height used, px
double draw_paragraph(Canvas& canvas, const Eigen::Vector2d& top_left,
                      const std::vector<std::string>& lines, const TextStyle& style);
/// Returns the distance of two lines of text, px.
double line_height(const TextStyle& style);

/// Returns a count with its digits in groups of three, e.g. "12 345".
std::string group_digits(std::size_t count);

/// Draws a scale bar of a round length in mm, at most `longest_px`, with its label to the right.
void draw_scale_bar(Canvas& canvas, const View& view, const Eigen::Vector2d& left,
                    double longest_px, const TextStyle& style);

/// Draws arrows along X, Y and Z of a view, within `radius` px of the centre, with labels beyond.
void draw_triad(Canvas& canvas, const View& view, const Eigen::Vector2d& centre, double radius,
                const TextStyle& style);

/// Draws a coloured square and its label.
/// @return the width used, px
double draw_swatch(Canvas& canvas, const Eigen::Vector2d& left, const Colour& colour,
                   const std::string& label, const TextStyle& style);

// Coordinates and lines common to all plots.

struct Span {
  double lower = 0.0;
  double upper = 1.0;
};

/// Extends a span to include a value.
void widen(Span& span, double value);

/// Returns the span with a margin at both ends; it is never empty.
Span pad_span(Span span);

/// The rectangle of a plot and the values at its edges.
struct Axes {
  Rectangle box;
  Span x;
  Span y;
};

/// Returns the pixel of a point of a plot.
Eigen::Vector2d at(const Axes& axes, double x, double y);

/// Returns a curve that looks the same but has at most four points for each passage through a
/// column of pixels.
std::vector<Eigen::Vector2d> decimate_curve(const std::vector<Eigen::Vector2d>& points);

/// Draws a line in the colour and dash pattern of a series.
void draw_series_line(Canvas& canvas, const std::vector<Eigen::Vector2d>& points, int index,
                      double width_px);

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

/// Returns the layout of a page.
/// @param unit  1 for the type sizes of a picture 1600 px wide
Page page(int width, int height, const std::string& title, const std::vector<std::string>& caption,
          double unit);

/// Returns the height of a page without its content, px, i.e. of title and caption.
double page_margins(int width, const std::string& title, const std::vector<std::string>& caption,
                    double unit);

/// Draws the title and the caption of a page.
void draw_page(Canvas& canvas, const Page& page);

/// An entry of a legend: its name and symbols.
struct LegendEntry {
  std::string name;
  int colour = 0;
  bool line = true;
  bool points = false;
  bool band = false;
};

/// Draws the mark of a series at a point: disc, square, diamond or triangle, by its colour index.
void draw_mark(Canvas& canvas, const Eigen::Vector2d& at, int colour, double size_px);

/// Draws legend entries downwards from `top_left`, with names wrapped to `width`, then lines of
/// text.
/// @return the height used, px
double draw_legend_column(Canvas& canvas, const Eigen::Vector2d& top_left, double width,
                          const std::vector<LegendEntry>& entries,
                          const std::vector<std::string>& note, const TextStyle& style);

/// Draws legend entries side by side, starting at `left` and centred on its height.
/// @return the width used, px
double draw_legend_row(Canvas& canvas, const Eigen::Vector2d& left,
                       const std::vector<LegendEntry>& entries, const TextStyle& style);

}  // namespace abbe::render
