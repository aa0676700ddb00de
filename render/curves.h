#pragma once

#include <optional>
#include <vector>

#include "render/layout.h"
#include "render/plot.h"

/// Draws one panel of curves in its cell of a page.
namespace abbe::render {

/// The ranges of the finite values of a panel; empty if there are none.
struct Extent {
  std::optional<Span> x;
  std::optional<Span> y;
};
Extent extent(const Panel& panel);

struct PanelStyle {
  TextStyle body;
  TextStyle title;
  double unit = 1.0;      ///< px of this picture per px of the reference size
  double side_px = 0.0;   ///< width at the right, reserved for legend and note
  double ticks_px = 0.0;  ///< width at the left, reserved for the tick labels of y
};

/// Returns the largest width of the tick labels of y in all panels, so that their axes can be
/// aligned.
double ticks_px(const std::vector<Panel>& panels, const Rectangle& cell_size,
                const std::vector<Extent>& extents, const PanelStyle& style);

/// Draws axes and curves of a panel without its legend, and returns the axes.
Axes draw_panel(Canvas& canvas, const Panel& panel, const Rectangle& cell, const Extent& extent,
                const PanelStyle& style);

}  // namespace abbe::render
