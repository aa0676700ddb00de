#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "render/canvas.h"

/// Text and marks that several kinds of picture share.
namespace abbe::render {

/// Sizes of type for a picture of `width` x `height`, in pixels; 1600 x 1200 is the size they are
/// chosen for.
struct TypeSizes {
  double title = 36.0;
  double figures = 28.0;
  double body = 22.0;
  double unit = 1.0;  ///< px of this picture for one px of the chosen size
};
TypeSizes type_sizes(int width, int height);

/// `text` in lines no wider than `width` px, broken at spaces and after hyphens; a word that is too
/// long, or what does not fit into `most` lines, ends in "…".
std::vector<std::string> wrapped(const std::string& text, const TextStyle& style, double width,
                                 std::size_t most = 4);

/// Writes lines downwards from `top_left` (their alignment across as `style` says).
/// @return the height used, px
double paragraph(Canvas& canvas, const Eigen::Vector2d& top_left,
                 const std::vector<std::string>& lines, const TextStyle& style);
double line_height(const TextStyle& style);

/// "12 345"
std::string grouped(std::size_t count);

/// A bar of a round length in mm with its label to the right.
void scale_bar(Canvas& canvas, const View& view, const Eigen::Vector2d& left, double longest_px,
               const TextStyle& style);

/// The directions of X, Y, Z in a view; `radius` px about the centre, labels a little beyond.
void triad(Canvas& canvas, const View& view, const Eigen::Vector2d& centre, double radius,
           const TextStyle& style);

/// A coloured square and what it stands for.
/// @return the width used, px
double swatch(Canvas& canvas, const Eigen::Vector2d& left, const Colour& colour,
              const std::string& label, const TextStyle& style);

// What plots of every kind do with coordinates and lines.

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

/// A page with a title above, a caption below and a rectangle for everything else.
struct Page {
  int width = 1600;
  int height = 900;
  TextStyle title;
  TextStyle body;
  std::vector<std::string> title_lines;
  std::vector<std::string> caption_lines;
  double unit = 1.0;  ///< px of this picture for one of the size that type is chosen for
  Rectangle inner;
};

/// @param unit  1 for type as in a picture 1600 px wide
Page page(int width, int height, const std::string& title, const std::vector<std::string>& caption,
          double unit);

/// Height in pixels that title and caption take, so that a page can be made around its content.
double page_margins(int width, const std::string& title, const std::vector<std::string>& caption,
                    double unit);

void draw_page(Canvas& canvas, const Page& page);

/// An entry of a legend: how it is drawn and called.
struct LegendEntry {
  std::string name;
  int colour = 0;
  bool line = true;
  bool points = false;
  bool band = false;
};

/// A mark of a series about a point: disc, square, diamond or triangle, by the number of its
/// colour.
void draw_mark(Canvas& canvas, const Eigen::Vector2d& at, int colour, double size_px);

/// Entries downwards from `top_left`, names wrapped to `width`, then lines of text.
/// @return the height used, px
double draw_legend_column(Canvas& canvas, const Eigen::Vector2d& top_left, double width,
                          const std::vector<LegendEntry>& entries,
                          const std::vector<std::string>& note, const TextStyle& style);

/// Entries side by side from `left` (the middle of their line). @return the width used, px
double draw_legend_row(Canvas& canvas, const Eigen::Vector2d& left,
                       const std::vector<LegendEntry>& entries, const TextStyle& style);

}  // namespace abbe::render
