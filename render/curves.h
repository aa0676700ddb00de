#pragma once

#include <optional>
#include <vector>

#include "render/layout.h"
#include "render/plot.h"

/// A diagram in a picture, alone or among others.
namespace abbe::render {

/// Range of the finite values; empty if there are none.
struct Extent {
  std::optional<Span> x;
  std::optional<Span> y;
};
Extent extent(const Panel& panel);

struct PanelStyle {
  TextStyle body;
  TextStyle title;
  double unit = 1.0;
  double side_px = 0.0;   ///< width at the right, reserved for legend and note
  double ticks_px = 0.0;  ///< width at the left, for the labels of y
};

/// Returns the width for the labels of y that suits all panels, so that their axes are aligned.
double ticks_px(const std::vector<Panel>& panels, const Rectangle& cell_size,
                const std::vector<Extent>& seen, const PanelStyle& look);

/// Draws axes and curves in their cell of a page; the legend is left to the caller.
Axes draw_panel(Canvas& canvas, const Panel& panel, const Rectangle& cell, const Extent& seen,
                const PanelStyle& look);

}  // namespace abbe::render
