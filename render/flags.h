#pragma once

#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/field.h"

/// Marked places of a map with what is to be read there.
namespace abbe::render {

struct Flag {
  Eigen::Vector2d at;  ///< px
  std::string text;
  bool hidden = false;  ///< the surface lies before it: an open mark
};

/// Whether the surface, seen in this view, lies before a point of it.
bool is_hidden(const View& view, const cutting::Design& design, const Eigen::Vector3d& point);

/// Where labels of these sizes stand: each near its point, within the room, over no other label
/// and no point, as long as there is such a place.
std::vector<Rectangle> placed_labels(const std::vector<Eigen::Vector2d>& points,
                                     const std::vector<Eigen::Vector2d>& sizes,
                                     const Rectangle& room, double em);

/// Marks the places, with leaders to their labels.
void draw_flags(Canvas& canvas, const std::vector<Flag>& flags, const Rectangle& room,
                const TextStyle& style);

}  // namespace abbe::render
