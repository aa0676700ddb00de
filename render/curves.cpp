#include "render/curves.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "render/canvas.h"
#include "render/figures.h"
#include "render/layout.h"
#include "render/plot.h"

namespace abbe::render {

namespace {

using Eigen::Index;
using Eigen::Vector2d;

void check_sizes(const Series& series) {
  const bool has_band = series.lower.size() > 0 || series.upper.size() > 0;
  if (series.x.size() != series.y.size() || (has_band && (series.lower.size() != series.x.size() ||
                                                          series.upper.size() != series.x.size())))
    throw std::invalid_argument("curves: x, y and both limits of a band must have the same size");
}

void check_panels(const std::vector<Panel>& panels) {
  if (panels.empty()) throw std::invalid_argument("curves: expected at least one panel");
  for (const Panel& panel : panels) {
    if (panel.series.empty())
      throw std::invalid_argument("curves: expected at least one series in every panel");
    for (const Series& series : panel.series) check_sizes(series);
  }
}

void include(std::optional<Span>& span, double value) {
  // Values that are not finite are gaps in a curve.
  if (!std::isfinite(value)) return;
  if (!span) span = Span{value, value};
  widen(*span, value);
}

void include(Extent& extent, const Series& series) {
  for (Index i = 0; i < series.x.size(); ++i) {
    if (!std::isfinite(series.x[i])) continue;
    include(extent.x, series.x[i]);
    include(extent.y, series.y[i]);
    if (series.lower.size() == 0) continue;
    include(extent.y, series.lower[i]);
    include(extent.y, series.upper[i]);
  }
}

enum class AxisDirection { X, Y };

/// Returns round ticks, as many as fit with a gap between their labels.
Ticks fitting_ticks(const Span& span, double length_px, const TextStyle& style,
                    AxisDirection direction) {
  Ticks densest_ticks = round_ticks(span.lower, span.upper, 1);
  for (int count = 2; count <= 10; ++count) {
    const Ticks ticks = round_ticks(span.lower, span.upper, count);
    // A single tick does not show the scale.
    if (ticks.values.size() < 2) continue;
    double max_width = 0.0;
    for (const double value : ticks.values)
      max_width = std::max(max_width, text_size(fixed(value, ticks.decimals), style).x());
    const double spacing =
        length_px * (ticks.values[1] - ticks.values[0]) / (span.upper - span.lower);
    // Along x a label needs its width and a gap of one letter, along y about twice its height.
    const double min_spacing =
        direction == AxisDirection::X ? max_width + style.size_px : 1.9 * style.size_px;
    if (spacing > min_spacing) densest_ticks = ticks;
  }
  return densest_ticks;
}

/// The layout of a panel in its cell of the page.
struct PanelGeometry {
  Axes axes;
  Ticks x;
  Ticks y;
};

/// Returns ticks at as many of the names as fit: all, every second, every third ...
Ticks named_ticks(const std::vector<std::string>& names, const Axes& axes, const TextStyle& style) {
  double max_width = 0.0;
  for (const std::string& name : names) max_width = std::max(max_width, text_size(name, style).x());
  const double spacing = axes.box.width / (axes.x.upper - axes.x.lower);
  const auto stride =
      std::max<std::size_t>(1, std::size_t(std::ceil((max_width + style.size_px) / spacing)));
  Ticks ticks;
  for (std::size_t i = 0; i < names.size(); i += stride)
    if (double(i) >= axes.x.lower && double(i) <= axes.x.upper) ticks.values.push_back(double(i));
  return ticks;
}

std::string x_tick_label(const Panel& panel, const PanelGeometry& geometry, double value) {
  return panel.x_names.empty() ? fixed(value, geometry.x.decimals)
                               : panel.x_names[std::size_t(std::lround(value))];
}

PanelGeometry panel_geometry(const Panel& panel, const Rectangle& cell, const Extent& extent,
                             const PanelStyle& style) {
  PanelGeometry geometry;
  geometry.axes.x = extent.x.value_or(Span{});
  const Span y = extent.y.value_or(Span{});
  const bool has_marks =
      std::any_of(panel.series.begin(), panel.series.end(),
                  [](const Series& series) { return series.curve_style != CurveStyle::Line; });
  // Marks at the edge of the axes would be cut in half.
  if (has_marks || geometry.axes.x.lower == geometry.axes.x.upper)
    geometry.axes.x = pad_span(geometry.axes.x);
  geometry.axes.y = pad_span(y);
  const double em = style.body.size_px;
  // Space for the tick labels and for the axis label below them.
  const double below = (panel.x_label.empty() ? 1.9 : 3.4) * em;
  const double above = panel.title.empty() ? 0.8 * em : line_height(style.title) + 0.6 * em;
  geometry.axes.box.y = cell.y + below;
  geometry.axes.box.height = cell.height - below - above;
  geometry.y =
      fitting_ticks(geometry.axes.y, geometry.axes.box.height, style.body, AxisDirection::Y);
  const double left = style.ticks_px + (panel.y_label.empty() ? 1.4 : 3.0) * em;
  geometry.axes.box.x = cell.x + left;
  geometry.axes.box.width = cell.width - left - style.side_px - 1.2 * em;
  geometry.x = panel.x_names.empty() ? fitting_ticks(geometry.axes.x, geometry.axes.box.width,
                                                     style.body, AxisDirection::X)
                                     : named_ticks(panel.x_names, geometry.axes, style.body);
  return geometry;
}

void draw_axes(Canvas& canvas, const Panel& panel, const PanelGeometry& geometry,
               const PanelStyle& style) {
  const Axes& axes = geometry.axes;
  const double em = style.body.size_px, thin = 1.5 * style.unit;
  const Vector2d right(axes.box.width, 0.0), up(0.0, axes.box.height);
  TextStyle tick = style.body;
  tick.horizontal_anchor = 0.5;
  tick.vertical_anchor = 1.0;
  for (const double value : geometry.x.values) {
    const Vector2d tick_end(at(axes, value, axes.y.lower).x(), axes.box.y);
    canvas.line({tick_end, tick_end + up}, colours::rule, thin);
    canvas.text(tick_end - Vector2d(0.0, 0.4 * em), x_tick_label(panel, geometry, value), tick);
  }
  tick.horizontal_anchor = 1.0;
  tick.vertical_anchor = 0.5;
  for (const double value : geometry.y.values) {
    const Vector2d tick_end(axes.box.x, at(axes, axes.x.lower, value).y());
    // A tick is a multiple of the step and may miss zero by rounding.
    const bool is_zero = std::abs(value) < 1e-9 * (axes.y.upper - axes.y.lower);
    canvas.line({tick_end, tick_end + right}, is_zero ? colours::faint_ink : colours::rule, thin);
    canvas.text(tick_end - Vector2d(0.5 * em, 0.0), fixed(value, geometry.y.decimals), tick);
  }
  TextStyle label = style.body;
  label.horizontal_anchor = 0.5;
  label.vertical_anchor = 1.0;
  canvas.text({axes.box.x + 0.5 * axes.box.width, axes.box.y - 1.9 * em}, panel.x_label, label);
  label.turned_left = true;
  label.vertical_anchor = 0.0;
  const double label_x = axes.box.x - style.ticks_px - 1.1 * em;
  canvas.text({label_x, axes.box.y + 0.5 * axes.box.height}, panel.y_label, label);
  canvas.frame(axes.box, colours::faint_ink, thin);
}

void draw_band(Canvas& canvas, const Axes& axes, const Series& series, int colour) {
  if (series.lower.size() == 0) return;
  std::vector<Vector2d> low, high;
  const auto flush = [&] {
    low.insert(low.end(), high.rbegin(), high.rend());
    canvas.fill(low, series_colour(colour), 0.2);
    low.clear();
    high.clear();
  };
  for (Index i = 0; i < series.x.size(); ++i) {
    if (!std::isfinite(series.x[i]) || !std::isfinite(series.lower[i]) ||
        !std::isfinite(series.upper[i])) {
      flush();
      continue;
    }
    const Vector2d below = at(axes, series.x[i], std::min(series.lower[i], series.upper[i]));
    const Vector2d above = at(axes, series.x[i], std::max(series.lower[i], series.upper[i]));
    if (!low.empty() && std::abs(below.x() - low.back().x()) < 0.5) {  // same column of pixels
      low.back().y() = std::min(low.back().y(), below.y());
      high.back().y() = std::max(high.back().y(), above.y());
    } else {
      low.push_back(below);
      high.push_back(above);
    }
  }
  flush();
}

// A value that is not finite interrupts the curve.
void draw_series(Canvas& canvas, const Axes& axes, const Series& series, int colour, double unit) {
  std::vector<Vector2d> points;
  const auto flush = [&] {
    // Thinning to columns of pixels bounds the cost and does not change the picture.
    if (series.curve_style != CurveStyle::Points)
      draw_series_line(canvas, decimate_curve(points), colour, 3.0 * unit);
    if (series.curve_style != CurveStyle::Line) {
      constexpr std::size_t max_marks = 20000;
      for (const Vector2d& p : points.size() > max_marks ? decimate_curve(points) : points)
        draw_mark(canvas, p, colour, 10.0 * unit);
    }
    points.clear();
  };
  for (Index i = 0; i < series.x.size(); ++i) {
    if (std::isfinite(series.x[i]) && std::isfinite(series.y[i]))
      points.push_back(at(axes, series.x[i], series.y[i]));
    else
      flush();
  }
  flush();
}

/// Returns the index of the colour of a series.
int colour_index(const Panel& panel, std::size_t i) {
  return panel.series[i].colour.value_or(int(i));
}

std::vector<LegendEntry> legend(const Panel& panel) {
  std::vector<LegendEntry> entries;
  for (std::size_t i = 0; i < panel.series.size(); ++i) {
    const Series& series = panel.series[i];
    if (series.name.empty()) continue;
    entries.push_back({series.name, colour_index(panel, i),
                       series.curve_style != CurveStyle::Points,
                       series.curve_style != CurveStyle::Line, series.lower.size() > 0});
  }
  return entries;
}

}  // namespace

Extent extent(const Panel& panel) {
  Extent result;
  for (const Series& series : panel.series) include(result, series);
  return result;
}

double ticks_px(const std::vector<Panel>& panels, const Rectangle& cell_size,
                const std::vector<Extent>& extents, const PanelStyle& style) {
  double max_width = 0.0;
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const PanelGeometry geometry = panel_geometry(panels[i], cell_size, extents[i], style);
    for (const double value : geometry.y.values)
      max_width = std::max(max_width, text_size(fixed(value, geometry.y.decimals), style.body).x());
  }
  return max_width;
}

Axes draw_panel(Canvas& canvas, const Panel& panel, const Rectangle& cell, const Extent& extent,
                const PanelStyle& style) {
  const PanelGeometry geometry = panel_geometry(panel, cell, extent, style);
  draw_axes(canvas, panel, geometry, style);
  for (std::size_t i = 0; i < panel.series.size(); ++i)
    draw_band(canvas, geometry.axes, panel.series[i], colour_index(panel, i));
  for (std::size_t i = 0; i < panel.series.size(); ++i)
    draw_series(canvas, geometry.axes, panel.series[i], colour_index(panel, i), style.unit);
  const double top = geometry.axes.box.y + geometry.axes.box.height;
  // The title may extend beyond the axes, because the legend is lower.
  const double title_width = cell.x + cell.width - geometry.axes.box.x;
  draw_paragraph(canvas,
                 {geometry.axes.box.x, top + line_height(style.title) + 0.1 * style.title.size_px},
                 wrap_text(panel.title, style.title, title_width, 1), style.title);
  return geometry.axes;
}

namespace {

/// Returns the extents of the panels.
/// @param common_y  all panels get the range of y of all series
std::vector<Extent> panel_extents(const std::vector<Panel>& panels, bool common_y) {
  std::vector<Extent> extents;
  Extent total;
  for (const Panel& panel : panels) {
    extents.push_back(extent(panel));
    for (const Series& series : panel.series) include(total, series);
  }
  for (Extent& panel_extent : extents)
    if (common_y) panel_extent.y = total.y;
  return extents;
}

/// Returns the cell of a page with a number; cells are numbered by rows from the top left.
Rectangle page_cell(const Rectangle& inner, int columns, int rows, std::size_t i) {
  const double w = inner.width / columns, h = inner.height / rows;
  const int column = int(i) % columns, row = int(i) / columns;
  return {inner.x + column * w, inner.y + (rows - 1 - row) * h, w, h};
}

int row_count(std::size_t panels, int columns) { return (int(panels) + columns - 1) / columns; }

int checked_height(double height) {
  if (!(height <= max_side_px))
    throw std::invalid_argument("curves: the picture would exceed a height of 16384 px");
  return int(std::lround(height));
}

}  // namespace

void write_curves(const std::filesystem::path& path, const std::vector<Panel>& panels,
                  const CurvesOptions& options) {
  check_panels(panels);
  const int columns = std::clamp(options.columns, 1, int(panels.size()));
  const int rows = row_count(panels.size(), columns);
  // Type sizes are chosen for a width of 1600 px.
  const double unit = options.width / 1600.0;
  const double row_height =
      options.panel_height > 0 ? options.panel_height : (rows == 1 ? 700.0 : 520.0) * unit;
  const int height = checked_height(
      row_height * rows + page_margins(options.width, options.title, options.caption, unit));
  const Page sheet = page(options.width, height, options.title, options.caption, unit);
  const bool has_side_text = std::any_of(panels.begin(), panels.end(), [](const Panel& panel) {
    return !legend(panel).empty() || !panel.note.empty();
  });
  PanelStyle style{sheet.body, {.size_px = 26.0 * unit, .bold = true}, unit};
  if (has_side_text) style.side_px = (columns == 1 ? 340.0 : 250.0) * unit;
  const std::vector<Extent> extents = panel_extents(panels, options.common_y);
  style.ticks_px = ticks_px(panels, page_cell(sheet.inner, columns, rows, 0), extents, style);
  Canvas canvas(sheet.width, sheet.height);
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const Axes axes =
        draw_panel(canvas, panels[i], page_cell(sheet.inner, columns, rows, i), extents[i], style);
    const Vector2d corner(axes.box.x + axes.box.width + sheet.body.size_px,
                          axes.box.y + axes.box.height);
    draw_legend_column(canvas, corner, style.side_px - sheet.body.size_px, legend(panels[i]),
                       panels[i].note, sheet.body);
  }
  draw_page(canvas, sheet);
  canvas.write_png(path);
}

void write_grid(const std::filesystem::path& path, const std::vector<Panel>& panels,
                const GridOptions& options) {
  check_panels(panels);
  // Cells have an aspect ratio of about 5 : 4, so the factor 0.8 makes the sheet about square.
  const int requested_columns = options.columns > 0
                                    ? options.columns
                                    : int(std::ceil(std::sqrt(double(panels.size()) * 0.8)));
  const int columns = std::clamp(requested_columns, 1, int(panels.size()));
  const int rows = row_count(panels.size(), columns);
  const double unit = options.width / 2400.0;
  const double legend_height = 60.0 * unit;
  const double row_height = std::clamp(0.68 * options.width / columns, 180.0 * unit, 600.0 * unit);
  const int height =
      checked_height(row_height * rows + legend_height +
                     page_margins(options.width, options.title, options.caption, unit));
  const Page sheet = page(options.width, height, options.title, options.caption, unit);
  const double em = std::clamp(options.width / columns / 24.0, 12.0 * unit, 22.0 * unit);
  PanelStyle style{{.size_px = em}, {.size_px = 1.1 * em, .bold = true}, 0.6 * unit};
  Rectangle inner = sheet.inner;
  inner.height -= legend_height;
  const std::vector<Extent> extents = panel_extents(panels, options.common_y);
  style.ticks_px = ticks_px(panels, page_cell(inner, columns, rows, 0), extents, style);
  Canvas canvas(sheet.width, sheet.height);
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const Axes axes =
        draw_panel(canvas, panels[i], page_cell(inner, columns, rows, i), extents[i], style);
    TextStyle note = style.body;
    note.colour = colours::faint_ink;
    note.horizontal_anchor = 1.0;
    const double top = axes.box.y + axes.box.height + 0.35 * em;
    const double note_width = axes.box.width - text_size(panels[i].title, style.title).x() - em;
    std::string text;
    for (const std::string& line : panels[i].note) text += (text.empty() ? "" : ", ") + line;
    // The note is omitted if the title leaves no space for it.
    if (!text.empty() && note_width > 2.0 * em)
      canvas.text({axes.box.x + axes.box.width, top}, wrap_text(text, note, note_width, 1).front(),
                  note);
  }
  draw_legend_row(canvas, {40.0 * unit, inner.y + inner.height + 0.5 * legend_height},
                  legend(panels.front()), sheet.body);
  draw_page(canvas, sheet);
  canvas.write_png(path);
}

namespace {

// Radius of the nominal circle relative to the outermost one.
constexpr double nominal_radius_ratio = 0.6;

/// Geometry of a polar diagram: deviations are magnified about a nominal circle.
struct Dial {
  Vector2d centre = Vector2d::Zero();
  double nominal_px = 0.0;
  double px_per_um = 0.0;
  double division_um = 1.0;
  int divisions = 1;  ///< on either side of the nominal circle

  Vector2d at(double angle, double deviation_um) const {
    const double r = nominal_px + px_per_um * deviation_um;
    return centre + r * Vector2d(std::cos(angle), std::sin(angle));
  }
};

double max_deviation_um(const std::vector<PolarTrace>& traces) {
  double max_um = 0.0;
  for (const PolarTrace& t : traces)
    for (Index i = 0; i < t.angle.size(); ++i)
      if (std::isfinite(t.angle[i]) && std::isfinite(t.deviation_um[i]))
        max_um = std::max(max_um, std::abs(t.deviation_um[i]));
  return max_um;
}

Dial make_dial(const Vector2d& centre, double radius_px, double largest_um, double division_um) {
  Dial dial;
  dial.centre = centre;
  // About four divisions on either side are readable. The -1e-9 keeps an exact multiple of the
  // division from adding another one.
  dial.division_um = division_um > 0.0 ? division_um : round_up_125(largest_um / 4.0);
  if (!(dial.division_um > 0.0)) dial.division_um = 1.0;
  dial.divisions = std::clamp(int(std::ceil(largest_um / dial.division_um - 1e-9)), 2, 20);
  dial.nominal_px = nominal_radius_ratio * radius_px;
  dial.px_per_um = (radius_px - dial.nominal_px) / (dial.divisions * dial.division_um);
  return dial;
}

void draw_circle(Canvas& canvas, const Dial& dial, double deviation_um, const Colour& colour,
                 double width) {
  std::vector<Vector2d> points;
  // With one segment per degree the chord error is below 0.1 px at a radius of 1000 px.
  for (int i = 0; i <= 360; ++i) points.push_back(dial.at(2.0 * pi * i / 360.0, deviation_um));
  canvas.line(points, colour, width);
}

std::string axis_label(const PolarOptions& options, int eighth) {
  switch (eighth) {
    case 0:
      return "+" + options.first_axis;
    case 2:
      return "+" + options.second_axis;
    case 4:
      return "−" + options.first_axis;
    case 6:
      return "−" + options.second_axis;
    default:
      return fmt::format("{}°", 45 * eighth);
  }
}

void draw_dial(Canvas& canvas, const Dial& dial, const PolarOptions& options,
               const TextStyle& body) {
  const double unit = body.size_px / 22.0;
  const double outermost = dial.divisions * dial.division_um;
  for (int i = 0; i < 8; ++i) {
    const double angle = 0.25 * pi * i;
    canvas.line({dial.at(angle, -outermost), dial.at(angle, outermost)}, colours::rule, 1.5 * unit);
    TextStyle label = body;
    label.horizontal_anchor = 0.5 - 0.5 * std::cos(angle);
    label.vertical_anchor = 0.5 - 0.5 * std::sin(angle);
    label.bold = i % 2 == 0;
    if (i % 2 == 1) label.colour = colours::faint_ink;
    canvas.text(
        dial.at(angle, outermost) + 0.6 * body.size_px * Vector2d(std::cos(angle), std::sin(angle)),
        axis_label(options, i), label);
  }
  for (int k = -dial.divisions; k <= dial.divisions; ++k)
    draw_circle(canvas, dial, k * dial.division_um, k == 0 ? colours::faint_ink : colours::rule,
                (k == 0 ? 3.0 : 1.5) * unit);
}

/// Draws the labels of the circles; of close circles only every second or fifth.
void draw_scale(Canvas& canvas, const Dial& dial, const TextStyle& body) {
  TextStyle style = body;
  style.size_px = 0.85 * body.size_px;
  style.horizontal_anchor = style.vertical_anchor = 0.5;
  const double spacing = dial.px_per_um * dial.division_um;
  const int stride = spacing > 1.3 * style.size_px ? 1 : (spacing > 0.7 * style.size_px ? 2 : 5);
  const int decimals = round_decimals(dial.division_um);
  for (int k = -dial.divisions; k <= dial.divisions; ++k) {
    if (k % stride != 0) continue;
    // The labels are at 67.5 degrees, midway between two spokes.
    const Vector2d p = dial.at(0.375 * pi, k * dial.division_um);
    const std::string text = signed_fixed(k * dial.division_um, decimals);
    const Vector2d size = text_size(text, style) + Vector2d(6.0, 2.0);
    canvas.fill({p.x() - 0.5 * size.x(), p.y() - 0.5 * size.y(), size.x(), size.y()},
                colours::white, 0.85);
    canvas.text(p, text, style);
  }
}

void draw_trace(Canvas& canvas, const Dial& dial, const PolarTrace& trace, int index,
                double width) {
  std::vector<Vector2d> points;
  const auto flush = [&] {
    draw_series_line(canvas, points, index, width);
    points.clear();
  };
  for (Index i = 0; i < trace.angle.size(); ++i) {
    if (std::isfinite(trace.angle[i]) && std::isfinite(trace.deviation_um[i]))
      points.push_back(dial.at(trace.angle[i], trace.deviation_um[i]));
    else
      flush();
  }
  flush();
}

}  // namespace

void write_polar(const std::filesystem::path& path, const std::vector<PolarTrace>& traces,
                 const PolarOptions& options) {
  if (traces.empty()) throw std::invalid_argument("polar: expected at least one trace");
  for (const PolarTrace& t : traces)
    if (t.angle.size() != t.deviation_um.size())
      throw std::invalid_argument(
          "polar: angles and deviations of a trace must have the same size");
  const double unit = std::max(0.4, std::min(options.width / 1500.0, options.height / 1200.0));
  const Page sheet = page(options.width, options.height, options.title, options.caption, unit);
  const double em = sheet.body.size_px, side = 380.0 * unit;
  const double dial_width = sheet.inner.width - side;
  const double radius =
      std::max(20.0, 0.5 * std::min(dial_width - 6.0 * em, sheet.inner.height - 4.5 * em));
  const Vector2d centre(sheet.inner.x + 0.5 * dial_width, sheet.inner.y + 0.5 * sheet.inner.height);
  const Dial dial = make_dial(centre, radius, max_deviation_um(traces), options.division_um);
  Canvas canvas(sheet.width, sheet.height);
  draw_dial(canvas, dial, options, sheet.body);
  std::vector<LegendEntry> entries;
  for (std::size_t i = 0; i < traces.size(); ++i) {
    draw_trace(canvas, dial, traces[i], int(i), 3.0 * unit);
    if (!traces[i].name.empty()) entries.push_back({traces[i].name, int(i), true, false, false});
  }
  draw_scale(canvas, dial, sheet.body);
  std::vector<std::string> note{
      fmt::format("{} µm per division", fixed(dial.division_um, round_decimals(dial.division_um))),
      "radial deviation, + outwards", ""};
  note.insert(note.end(), options.note.begin(), options.note.end());
  draw_legend_column(canvas, {sheet.inner.x + dial_width, sheet.inner.y + sheet.inner.height - em},
                     side - em, entries, note, sheet.body);
  draw_page(canvas, sheet);
  canvas.write_png(path);
}

}  // namespace abbe::render
