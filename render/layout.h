#pragma once

#include <cstddef>
#include <string>
#include <vector>

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

}  // namespace abbe::render
