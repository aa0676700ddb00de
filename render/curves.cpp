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

void check(const Series& s) {
  const bool banded = s.lower.size() > 0 || s.upper.size() > 0;
  if (s.x.size() != s.y.size() ||
      (banded && (s.lower.size() != s.x.size() || s.upper.size() != s.x.size())))
    throw std::invalid_argument("curves: x, y and both edges of a band need one size");
}

void check(const std::vector<Panel>& panels) {
  if (panels.empty()) throw std::invalid_argument("curves: at least one panel is needed");
  for (const Panel& panel : panels) {
    if (panel.series.empty()) throw std::invalid_argument("curves: a panel needs a series");
    for (const Series& s : panel.series) check(s);
  }
}

void include(std::optional<Span>& span, double value) {
  // Values that are not finite mark gaps and have no position.
  if (!std::isfinite(value)) return;
  if (!span) span = Span{value, value};
  widen(*span, value);
}

void include(Extent& extent, const Series& s) {
  for (Index i = 0; i < s.x.size(); ++i) {
    if (!std::isfinite(s.x[i])) continue;
    include(extent.x, s.x[i]);
    include(extent.y, s.y[i]);
    if (s.lower.size() == 0) continue;
    include(extent.y, s.lower[i]);
    include(extent.y, s.upper[i]);
  }
}

/// Returns round ticks, as many as fit with a gap between their labels.
Ticks fitting_ticks(const Span& span, double length_px, const TextStyle& style, bool across) {
  Ticks best = round_ticks(span.lower, span.upper, 1);
  for (int wanted = 2; wanted <= 10; ++wanted) {
    const Ticks ticks = round_ticks(span.lower, span.upper, wanted);
    // A single tick does not show the scale.
    if (ticks.values.size() < 2) continue;
    double widest = 0.0;
    for (const double value : ticks.values)
      widest = std::max(widest, text_size(fixed(value, ticks.decimals), style).x());
    const double apart =
        length_px * (ticks.values[1] - ticks.values[0]) / (span.upper - span.lower);
    // Along x a label needs its width and a gap of one letter, along y twice its height.
    if (apart > (across ? widest + style.size_px : 1.9 * style.size_px)) best = ticks;
  }
  return best;
}

/// The layout of a panel in its cell of the page.
struct PanelGeometry {
  Axes axes;
  Ticks x;
  Ticks y;
};

/// Returns as many of the names as fit: all, every second, every third ...
Ticks named_ticks(const std::vector<std::string>& names, const Axes& axes, const TextStyle& style) {
  double widest = 0.0;
  for (const std::string& name : names) widest = std::max(widest, text_size(name, style).x());
  const double apart = axes.box.width / (axes.x.upper - axes.x.lower);
  const auto every =
      std::max<std::size_t>(1, std::size_t(std::ceil((widest + style.size_px) / apart)));
  Ticks ticks;
  for (std::size_t i = 0; i < names.size(); i += every)
    if (double(i) >= axes.x.lower && double(i) <= axes.x.upper) ticks.values.push_back(double(i));
  return ticks;
}

std::string x_text(const Panel& panel, const PanelGeometry& p, double value) {
  return panel.x_names.empty() ? fixed(value, p.x.decimals)
                               : panel.x_names[std::size_t(std::lround(value))];
}

PanelGeometry placed(const Panel& panel, const Rectangle& cell, const Extent& seen,
                     const PanelStyle& look) {
  PanelGeometry p;
  p.axes.x = seen.x.value_or(Span{});
  const Span y = seen.y.value_or(Span{});
  const bool points = std::any_of(panel.series.begin(), panel.series.end(),
                                  [](const Series& s) { return s.mark != Mark::Line; });
  // Marks at the edge of the axes would be cut in half.
  if (points || p.axes.x.lower == p.axes.x.upper) p.axes.x = padded(p.axes.x);
  p.axes.y = padded(y);
  const double em = look.body.size_px;
  // In em: the room for tick labels, and for the axis label below them.
  const double below = (panel.x_label.empty() ? 1.9 : 3.4) * em;
  const double above = panel.title.empty() ? 0.8 * em : line_height(look.title) + 0.6 * em;
  p.axes.box.y = cell.y + below;
  p.axes.box.height = cell.height - below - above;
  p.y = fitting_ticks(p.axes.y, p.axes.box.height, look.body, false);
  const double left = look.ticks_px + (panel.y_label.empty() ? 1.4 : 3.0) * em;
  p.axes.box.x = cell.x + left;
  p.axes.box.width = cell.width - left - look.side_px - 1.2 * em;
  p.x = panel.x_names.empty() ? fitting_ticks(p.axes.x, p.axes.box.width, look.body, true)
                              : named_ticks(panel.x_names, p.axes, look.body);
  return p;
}

void draw_axes(Canvas& canvas, const Panel& panel, const PanelGeometry& p, const PanelStyle& look) {
  const Axes& a = p.axes;
  const double em = look.body.size_px, thin = 1.5 * look.unit;
  const Vector2d right(a.box.width, 0.0), up(0.0, a.box.height);
  TextStyle tick = look.body;
  tick.across = 0.5;
  tick.upward = 1.0;
  for (const double value : p.x.values) {
    const Vector2d foot(at(a, value, a.y.lower).x(), a.box.y);
    canvas.line({foot, foot + up}, colours::rule, thin);
    canvas.text(foot - Vector2d(0.0, 0.4 * em), x_text(panel, p, value), tick);
  }
  tick.across = 1.0;
  tick.upward = 0.5;
  for (const double value : p.y.values) {
    const Vector2d foot(a.box.x, at(a, a.x.lower, value).y());
    // 1e-9 of the range: a tick computed as a multiple of the step may miss 0 by rounding.
    const bool zero = std::abs(value) < 1e-9 * (a.y.upper - a.y.lower);
    canvas.line({foot, foot + right}, zero ? colours::faint_ink : colours::rule, thin);
    canvas.text(foot - Vector2d(0.5 * em, 0.0), fixed(value, p.y.decimals), tick);
  }
  TextStyle name = look.body;
  name.across = 0.5;
  name.upward = 1.0;
  canvas.text({a.box.x + 0.5 * a.box.width, a.box.y - 1.9 * em}, panel.x_label, name);
  name.turned_left = true;
  name.upward = 0.0;
  const double beside = a.box.x - look.ticks_px - 1.1 * em;
  canvas.text({beside, a.box.y + 0.5 * a.box.height}, panel.y_label, name);
  canvas.frame(a.box, colours::faint_ink, thin);
}

void draw_band(Canvas& canvas, const Axes& a, const Series& s, int colour) {
  // The band is filled in quadrilaterals, since a canvas fills convex polygons only.
  if (s.lower.size() == 0) return;
  std::vector<Vector2d> low, high;
  const auto flush = [&] {
    for (std::size_t i = 1; i < low.size(); ++i)
      canvas.fill({low[i - 1], low[i], high[i], high[i - 1]}, series_colour(colour), 0.2);
    low.clear();
    high.clear();
  };
  for (Index i = 0; i < s.x.size(); ++i) {
    if (!std::isfinite(s.x[i]) || !std::isfinite(s.lower[i]) || !std::isfinite(s.upper[i])) {
      flush();
      continue;
    }
    const Vector2d below = at(a, s.x[i], std::min(s.lower[i], s.upper[i]));
    const Vector2d above = at(a, s.x[i], std::max(s.lower[i], s.upper[i]));
    if (!low.empty() && std::abs(below.x() - low.back().x()) < 0.5) {  // one column of pixels
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
void draw_series(Canvas& canvas, const Axes& a, const Series& s, int colour, double unit) {
  std::vector<Vector2d> run;
  const auto flush = [&] {
    // Thinning to pixel columns keeps the picture and bounds its cost.
    if (s.mark != Mark::Points) stroke(canvas, thinned(run), colour, 3.0 * unit);
    if (s.mark != Mark::Line) {
      constexpr std::size_t max_marks = 20000;
      for (const Vector2d& p : run.size() > max_marks ? thinned(run) : run)
        draw_mark(canvas, p, colour, 10.0 * unit);
    }
    run.clear();
  };
  for (Index i = 0; i < s.x.size(); ++i) {
    if (std::isfinite(s.x[i]) && std::isfinite(s.y[i]))
      run.push_back(at(a, s.x[i], s.y[i]));
    else
      flush();
  }
  flush();
}

int colour_of(const Panel& panel, std::size_t i) { return panel.series[i].colour.value_or(int(i)); }

std::vector<LegendEntry> legend(const Panel& panel) {
  std::vector<LegendEntry> entries;
  for (std::size_t i = 0; i < panel.series.size(); ++i) {
    const Series& s = panel.series[i];
    if (s.name.empty()) continue;
    entries.push_back({s.name, colour_of(panel, i), s.mark != Mark::Points, s.mark != Mark::Line,
                       s.lower.size() > 0});
  }
  return entries;
}

}  // namespace

Extent extent(const Panel& panel) {
  Extent all;
  for (const Series& s : panel.series) include(all, s);
  return all;
}

double ticks_px(const std::vector<Panel>& panels, const Rectangle& cell_size,
                const std::vector<Extent>& seen, const PanelStyle& look) {
  double widest = 0.0;
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const PanelGeometry p = placed(panels[i], cell_size, seen[i], look);
    for (const double value : p.y.values)
      widest = std::max(widest, text_size(fixed(value, p.y.decimals), look.body).x());
  }
  return widest;
}

Axes draw_panel(Canvas& canvas, const Panel& panel, const Rectangle& cell, const Extent& seen,
                const PanelStyle& look) {
  const PanelGeometry p = placed(panel, cell, seen, look);
  draw_axes(canvas, panel, p, look);
  for (std::size_t i = 0; i < panel.series.size(); ++i)
    draw_band(canvas, p.axes, panel.series[i], colour_of(panel, i));
  for (std::size_t i = 0; i < panel.series.size(); ++i)
    draw_series(canvas, p.axes, panel.series[i], colour_of(panel, i), look.unit);
  const double top = p.axes.box.y + p.axes.box.height;
  const double room = cell.x + cell.width - p.axes.box.x;  // beyond the axes: the legend is lower
  paragraph(canvas, {p.axes.box.x, top + line_height(look.title) + 0.1 * look.title.size_px},
            wrapped(panel.title, look.title, room, 1), look.title);
  return p.axes;
}

namespace {

/// Returns the extents of the panels, with a common y if requested.
std::vector<Extent> extents(const std::vector<Panel>& panels, bool common_y) {
  std::vector<Extent> all;
  Extent together;
  for (const Panel& panel : panels) {
    all.push_back(extent(panel));
    for (const Series& s : panel.series) include(together, s);
  }
  for (Extent& one : all)
    if (common_y) one.y = together.y;
  return all;
}

/// Returns a cell of a page, in rows from the top left.
Rectangle cell(const Rectangle& inner, int columns, int rows, std::size_t i) {
  const double w = inner.width / columns, h = inner.height / rows;
  const int column = int(i) % columns, row = int(i) / columns;
  return {inner.x + column * w, inner.y + (rows - 1 - row) * h, w, h};
}

int rows_of(std::size_t panels, int columns) { return (int(panels) + columns - 1) / columns; }

int page_height(double height) {
  if (!(height <= longest_side))
    throw std::invalid_argument("curves: the picture would be higher than 16384 px");
  return int(std::lround(height));
}

}  // namespace

void write_curves(const std::filesystem::path& path, const std::vector<Panel>& panels,
                  const CurvesOptions& options) {
  check(panels);
  const int columns = std::clamp(options.columns, 1, int(panels.size()));
  const int rows = rows_of(panels.size(), columns);
  // 1600 px is the width for which the sizes of type are chosen.
  const double unit = options.width / 1600.0;
  const double row_height =
      options.panel_height > 0 ? options.panel_height : (rows == 1 ? 700.0 : 520.0) * unit;
  const int height = page_height(row_height * rows +
                                 page_margins(options.width, options.title, options.caption, unit));
  const Page p = page(options.width, height, options.title, options.caption, unit);
  const bool beside = std::any_of(panels.begin(), panels.end(), [](const Panel& panel) {
    return !legend(panel).empty() || !panel.note.empty();
  });
  PanelStyle look{p.body, {.size_px = 26.0 * unit, .bold = true}, unit};
  if (beside) look.side_px = (columns == 1 ? 340.0 : 250.0) * unit;
  const std::vector<Extent> seen = extents(panels, options.common_y);
  look.ticks_px = ticks_px(panels, cell(p.inner, columns, rows, 0), seen, look);
  Canvas canvas(p.width, p.height);
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const Axes a = draw_panel(canvas, panels[i], cell(p.inner, columns, rows, i), seen[i], look);
    const Vector2d corner(a.box.x + a.box.width + p.body.size_px, a.box.y + a.box.height);
    draw_legend_column(canvas, corner, look.side_px - p.body.size_px, legend(panels[i]),
                       panels[i].note, p.body);
  }
  draw_page(canvas, p);
  canvas.write_png(path);
}

void write_grid(const std::filesystem::path& path, const std::vector<Panel>& panels,
                const GridOptions& options) {
  check(panels);
  // Cells are about 5 : 4, so 0.8 of the number of panels makes the sheet about square.
  const int wanted = options.columns > 0 ? options.columns
                                         : int(std::ceil(std::sqrt(double(panels.size()) * 0.8)));
  const int columns = std::clamp(wanted, 1, int(panels.size()));
  const int rows = rows_of(panels.size(), columns);
  const double unit = options.width / 2400.0;
  const double legend_height = 60.0 * unit;
  const double row_height = std::clamp(0.68 * options.width / columns, 180.0 * unit, 600.0 * unit);
  const int height = page_height(row_height * rows + legend_height +
                                 page_margins(options.width, options.title, options.caption, unit));
  const Page p = page(options.width, height, options.title, options.caption, unit);
  const double em = std::clamp(options.width / columns / 24.0, 12.0 * unit, 22.0 * unit);
  PanelStyle look{{.size_px = em}, {.size_px = 1.1 * em, .bold = true}, 0.6 * unit};
  Rectangle inner = p.inner;
  inner.height -= legend_height;
  const std::vector<Extent> seen = extents(panels, options.common_y);
  look.ticks_px = ticks_px(panels, cell(inner, columns, rows, 0), seen, look);
  Canvas canvas(p.width, p.height);
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const Axes a = draw_panel(canvas, panels[i], cell(inner, columns, rows, i), seen[i], look);
    TextStyle note = look.body;
    note.colour = colours::faint_ink;
    note.across = 1.0;
    const double top = a.box.y + a.box.height + 0.35 * em;
    const double free = a.box.width - text_size(panels[i].title, look.title).x() - em;
    std::string text;
    for (const std::string& line : panels[i].note) text += (text.empty() ? "" : ", ") + line;
    // A note is omitted if the title leaves no room for it.
    if (!text.empty() && free > 2.0 * em)
      canvas.text({a.box.x + a.box.width, top}, wrapped(text, note, free, 1).front(), note);
  }
  draw_legend_row(canvas, {40.0 * unit, inner.y + inner.height + 0.5 * legend_height},
                  legend(panels.front()), p.body);
  draw_page(canvas, p);
  canvas.write_png(path);
}

namespace {

constexpr double nominal_radius_ratio = 0.6;  // radius of the nominal circle relative to the
                                              // outermost one

/// Geometry of the magnified circle.
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

double largest(const std::vector<PolarTrace>& traces) {
  double most = 0.0;
  for (const PolarTrace& t : traces)
    for (Index i = 0; i < t.angle.size(); ++i)
      if (std::isfinite(t.angle[i]) && std::isfinite(t.deviation_um[i]))
        most = std::max(most, std::abs(t.deviation_um[i]));
  return most;
}

Dial dial(const Vector2d& centre, double radius_px, double largest_um, double division_um) {
  Dial d;
  d.centre = centre;
  // About four divisions on either side are readable; -1e-9 keeps an exact multiple within its
  // division.
  d.division_um = division_um > 0.0 ? division_um : round_up_125(largest_um / 4.0);
  if (!(d.division_um > 0.0)) d.division_um = 1.0;
  d.divisions = std::clamp(int(std::ceil(largest_um / d.division_um - 1e-9)), 2, 20);
  d.nominal_px = nominal_radius_ratio * radius_px;
  d.px_per_um = (radius_px - d.nominal_px) / (d.divisions * d.division_um);
  return d;
}

void draw_circle(Canvas& canvas, const Dial& d, double deviation_um, const Colour& colour,
                 double width) {
  std::vector<Vector2d> points;
  // One degree per segment: the chord error is below 0.1 px at a radius of 1000 px.
  for (int i = 0; i <= 360; ++i) points.push_back(d.at(2.0 * pi * i / 360.0, deviation_um));
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

void draw_dial(Canvas& canvas, const Dial& d, const PolarOptions& options, const TextStyle& body) {
  const double unit = body.size_px / 22.0;
  const double outermost = d.divisions * d.division_um;
  for (int i = 0; i < 8; ++i) {
    const double angle = 0.25 * pi * i;
    canvas.line({d.at(angle, -outermost), d.at(angle, outermost)}, colours::rule, 1.5 * unit);
    TextStyle end = body;
    end.across = 0.5 - 0.5 * std::cos(angle);
    end.upward = 0.5 - 0.5 * std::sin(angle);
    end.bold = i % 2 == 0;
    if (i % 2 == 1) end.colour = colours::faint_ink;
    canvas.text(
        d.at(angle, outermost) + 0.6 * body.size_px * Vector2d(std::cos(angle), std::sin(angle)),
        axis_label(options, i), end);
  }
  for (int k = -d.divisions; k <= d.divisions; ++k)
    draw_circle(canvas, d, k * d.division_um, k == 0 ? colours::faint_ink : colours::rule,
                (k == 0 ? 3.0 : 1.5) * unit);
}

/// Draws the labels of the circles between two spokes; every second or fifth if they are close.
void draw_scale(Canvas& canvas, const Dial& d, const TextStyle& body) {
  TextStyle style = body;
  style.size_px = 0.85 * body.size_px;
  style.across = style.upward = 0.5;
  const double spacing = d.px_per_um * d.division_um;
  const int every = spacing > 1.3 * style.size_px ? 1 : (spacing > 0.7 * style.size_px ? 2 : 5);
  const int decimals = round_decimals(d.division_um);
  for (int k = -d.divisions; k <= d.divisions; ++k) {
    if (k % every != 0) continue;
    // 67.5 degrees: midway between two spokes.
    const Vector2d p = d.at(0.375 * pi, k * d.division_um);
    const std::string text = signed_fixed(k * d.division_um, decimals);
    const Vector2d size = text_size(text, style) + Vector2d(6.0, 2.0);
    canvas.fill({p.x() - 0.5 * size.x(), p.y() - 0.5 * size.y(), size.x(), size.y()},
                colours::white, 0.85);
    canvas.text(p, text, style);
  }
}

void draw_trace(Canvas& canvas, const Dial& d, const PolarTrace& trace, int index, double width) {
  std::vector<Vector2d> run;
  const auto flush = [&] {
    stroke(canvas, run, index, width);
    run.clear();
  };
  for (Index i = 0; i < trace.angle.size(); ++i) {
    if (std::isfinite(trace.angle[i]) && std::isfinite(trace.deviation_um[i]))
      run.push_back(d.at(trace.angle[i], trace.deviation_um[i]));
    else
      flush();
  }
  flush();
}

}  // namespace

void write_polar(const std::filesystem::path& path, const std::vector<PolarTrace>& traces,
                 const PolarOptions& options) {
  if (traces.empty()) throw std::invalid_argument("polar: at least one trace is needed");
  for (const PolarTrace& t : traces)
    if (t.angle.size() != t.deviation_um.size())
      throw std::invalid_argument("polar: angles and deviations of a trace need one size");
  const double unit = std::max(0.4, std::min(options.width / 1500.0, options.height / 1200.0));
  const Page p = page(options.width, options.height, options.title, options.caption, unit);
  const double em = p.body.size_px, side = 380.0 * unit;
  const double across = p.inner.width - side,
               radius =
                   std::max(20.0, 0.5 * std::min(across - 6.0 * em, p.inner.height - 4.5 * em));
  const Vector2d centre(p.inner.x + 0.5 * across, p.inner.y + 0.5 * p.inner.height);
  const Dial d = dial(centre, radius, largest(traces), options.division_um);
  Canvas canvas(p.width, p.height);
  draw_dial(canvas, d, options, p.body);
  std::vector<LegendEntry> entries;
  for (std::size_t i = 0; i < traces.size(); ++i) {
    draw_trace(canvas, d, traces[i], int(i), 3.0 * unit);
    if (!traces[i].name.empty()) entries.push_back({traces[i].name, int(i), true, false, false});
  }
  draw_scale(canvas, d, p.body);
  std::vector<std::string> note{
      fmt::format("{} µm per division", fixed(d.division_um, round_decimals(d.division_um))),
      "radial deviation, + outwards", ""};
  note.insert(note.end(), options.note.begin(), options.note.end());
  draw_legend_column(canvas, {p.inner.x + across, p.inner.y + p.inner.height - em}, side - em,
                     entries, note, p.body);
  draw_page(canvas, p);
  canvas.write_png(path);
}

}  // namespace abbe::render
