#pragma once

#include <optional>
#include <vector>

#include "render/layout.h"
#include "render/plot.h"

/// A diagram as it stands in a picture, alone or among others.
namespace abbe::render {

/// What there is to be seen; empty where nothing is finite.
struct Extent {
  std::optional<Span> x;
  std::optional<Span> y;
};
Extent extent(const Panel& panel);

struct PanelStyle {
  TextStyle body;
  TextStyle title;
  double unit = 1.0;
  double side_px = 0.0;   ///< kept free at the right for legend and note
  double ticks_px = 0.0;  ///< at the left, for the numbers of y
};

/// The same room for the numbers of y in all panels, so that their axes stand above each other.
double ticks_px(const std::vector<Panel>& panels, const Rectangle& cell_size,
                const std::vector<Extent>& seen, const PanelStyle& look);

/// Axes and curves in their cell of a page; the legend is the caller's.
Axes draw_panel(Canvas& canvas, const Panel& panel, const Rectangle& cell, const Extent& seen,
                const PanelStyle& look);

}  // namespace abbe::render
