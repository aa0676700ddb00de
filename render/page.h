#pragma once

#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/layout.h"

namespace abbe::render {

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
