#include "render/distribution.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "render/canvas.h"
#include "render/curves.h"
#include "render/figures.h"
#include "render/layout.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

constexpr std::size_t max_series = 24;
// Fraction of the values that may be beyond the axis at either end.
constexpr double beyond_fraction = 0.001;

std::vector<double> sort_finite(const Eigen::VectorXd& values) {
  std::vector<double> finite;
  for (const double value : values)
    if (std::isfinite(value)) finite.push_back(value);
  std::sort(finite.begin(), finite.end());
  return finite;
}

double quantile(const std::vector<double>& sorted_values, double fraction) {
  return sorted_values[std::size_t(std::lround(fraction * double(sorted_values.size() - 1)))];
}

/// Bins of equal width, starting at `first`.
struct Bins {
  double first = 0.0;
  double width = 1.0;
  std::size_t count = 1;
};

/// Returns bins that resolve the narrowest series and contain nearly all values of all series.
Bins fit_bins(const std::vector<std::vector<double>>& series) {
  std::vector<double> all_values;
  double min_spread = std::numeric_limits<double>::infinity();
  for (const std::vector<double>& values : series) {
    all_values.insert(all_values.end(), values.begin(), values.end());
    if (values.size() < 2) continue;
    // The spread of the central 98 %, so that outliers do not widen the bins.
    const double spread = quantile(values, 0.99) - quantile(values, 0.01);
    if (spread > 0.0) min_spread = std::min(min_spread, spread);
  }
  if (all_values.empty()) return {};
  std::sort(all_values.begin(), all_values.end());
  Span span{all_values.front(), all_values.back()};
  const Span inner{quantile(all_values, beyond_fraction),
                   quantile(all_values, 1.0 - beyond_fraction)};
  // The axis is shortened only if that gains a third of its length.
  if (span.upper - span.lower > 1.5 * (inner.upper - inner.lower) && inner.upper > inner.lower)
    span = inner;
  const double range = span.upper - span.lower;
  const double largest = std::max(std::abs(span.lower), std::abs(span.upper));
  // Twelve bins across the narrowest series, but 40 to 300 in total.
  const double width = std::clamp(min_spread / 12.0, range / 300.0, range / 40.0);
  Bins bins;
  // The rounding errors of the bin edges are below 1e-7 of the largest value.
  bins.width = round_up_125(std::max({width, 1e-7 * largest, 1e-9}));
  const double first = std::floor(span.lower / bins.width) - 1.0;
  bins.first = first * bins.width;
  bins.count = std::size_t(std::floor(span.upper / bins.width) - first) + 2;
  return bins;
}

struct Histogram {
  std::vector<double> percent;
  std::size_t beyond = 0;  ///< number of values beyond the axis
};

Histogram histogram(const std::vector<double>& values, const Bins& bins) {
  Histogram h{std::vector<double>(bins.count, 0.0), 0};
  for (const double value : values) {
    const double bin = std::floor(value / bins.width) - std::round(bins.first / bins.width);
    if (bin >= 0.0 && bin < double(bins.count))
      h.percent[std::size_t(bin)] += 100.0 / double(values.size());
    else
      ++h.beyond;
  }
  return h;
}

/// Returns the outline of a histogram, from the first non-empty bin to the last.
Series outline(const Histogram& histogram, const Bins& bins, int colour) {
  const auto is_filled = [](double percent) { return percent > 0.0; };
  const auto first = std::find_if(histogram.percent.begin(), histogram.percent.end(), is_filled);
  const auto last =
      std::find_if(histogram.percent.rbegin(), histogram.percent.rend(), is_filled).base();
  Series series;
  series.colour = colour;
  // All values of a series may be beyond the axis.
  if (first == histogram.percent.end()) return series;
  const auto n = Eigen::Index(last - first);
  series.x.resize(2 * n + 2);
  series.y.setZero(2 * n + 2);
  const double left = bins.first + double(first - histogram.percent.begin()) * bins.width;
  for (Eigen::Index i = 0; i <= n; ++i)
    series.x[2 * i] = series.x[2 * i + 1] = left + double(i) * bins.width;
  for (Eigen::Index i = 0; i < n; ++i) series.y[2 * i + 1] = series.y[2 * i + 2] = first[i];
  return series;
}

void draw_outline(Canvas& canvas, const Axes& axes, const Series& series, double width_px) {
  std::vector<Vector2d> points;
  for (Eigen::Index i = 0; i < series.x.size(); ++i)
    points.push_back(at(axes, series.x[i], series.y[i]));
  draw_series_line(canvas, points, series.colour.value_or(0), width_px);
}

void draw_histogram_bars(Canvas& canvas, const Axes& axes, const Histogram& histogram,
                         const Bins& bins, int colour) {
  for (std::size_t i = 0; i < bins.count; ++i) {
    if (histogram.percent[i] <= 0.0) continue;
    const double left = bins.first + double(i) * bins.width;
    const Vector2d low = at(axes, left, 0.0),
                   high = at(axes, left + bins.width, histogram.percent[i]);
    canvas.fill({low.x(), low.y(), high.x() - low.x(), high.y() - low.y()}, series_colour(colour),
                0.22);
  }
}

/// Draws a regular polygon in the strip between zero and the lower edge of the axes.
void draw_marker(Canvas& canvas, const Axes& axes, double x, int corners, int colour, double size) {
  // The negated comparison is true for NaN as well.
  if (!(x >= axes.x.lower && x <= axes.x.upper)) return;
  const Vector2d middle(at(axes, x, 0.0).x(), 0.5 * (axes.box.y + at(axes, x, 0.0).y()));
  std::vector<Vector2d> shape;
  for (int i = 0; i < corners; ++i) {
    const double angle = pi * (0.5 + 2.0 * i / corners);
    shape.push_back(middle + 0.5 * size * Vector2d(std::cos(angle), std::sin(angle)));
  }
  canvas.fill(shape, series_colour(colour));
}

constexpr int disc = 16, triangle = 3;

void draw_limit(Canvas& canvas, const Axes& axes, const DistributionOptions& options,
                const TextStyle& body) {
  if (!options.limit) return;
  const bool is_within = *options.limit >= axes.x.lower && *options.limit <= axes.x.upper;
  const double x = at(axes, std::clamp(*options.limit, axes.x.lower, axes.x.upper), 0.0).x();
  const double top = axes.box.y + axes.box.height;
  const Colour limit_colour{0.2, 0.45, 0.2};
  if (is_within) canvas.line({{x, axes.box.y}, {x, top}}, limit_colour, 3.0 * body.size_px / 22.0);
  const std::string text = options.limit_label + (is_within ? "" : ", beyond the axis");
  TextStyle style = body;
  style.colour = limit_colour;
  style.horizontal_anchor = 0.5;
  const double half_width = 0.5 * text_size(text, style).x();
  const double centre =
      std::clamp(x, axes.box.x + std::min(half_width, 0.5 * axes.box.width),
                 axes.box.x + axes.box.width - std::min(half_width, 0.5 * axes.box.width));
  canvas.text({centre, top + 0.25 * body.size_px}, text, style);
}

/// Returns the height of the table, px.
double table_height(std::size_t rows, const TextStyle& body) {
  return double(rows + 1) * line_height(body) + 1.2 * body.size_px;
}

/// Draws a table with a row for each series: its line, its name and its figures.
void draw_table(Canvas& canvas, const std::vector<DistributionSeries>& series,
                const DistributionOptions& options, const Rectangle& box, const TextStyle& body) {
  std::vector<double> column_widths;
  double total_width = 0.0;
  for (std::size_t j = 0; j < options.headings.size(); ++j) {
    double width = text_size(options.headings[j], body).x();
    for (const DistributionSeries& s : series)
      if (!s.figures.empty()) width = std::max(width, text_size(s.figures[j], body).x());
    column_widths.push_back(width);
    total_width += width;
  }
  TextStyle style = body;
  double max_name_width = 0.0;
  for (const DistributionSeries& s : series)
    max_name_width = std::max(max_name_width, text_size(s.name, body).x());
  const double swatch_width = 2.8 * body.size_px;  // of the line before a name
  const double gaps = double(column_widths.size()) * 1.6 * body.size_px;
  // The names are shortened to at least a quarter of the width; if that does not suffice, the
  // figures shrink.
  const double name_width = std::clamp(box.width - total_width - gaps - swatch_width,
                                       0.25 * box.width - swatch_width, max_name_width);
  const double shrink =
      std::min(1.0, (box.width - name_width - swatch_width) / std::max(total_width + gaps, 1.0));
  style.size_px *= shrink;
  double y = box.y + box.height - 0.6 * body.size_px;
  for (std::size_t row = 0; row <= series.size(); ++row, y -= line_height(body)) {
    const bool is_head = row == 0;
    double x = box.x + swatch_width + name_width;
    if (!is_head) {
      const Vector2d left(box.x, y - 0.62 * body.size_px);
      draw_series_line(canvas, {left, left + Vector2d(2.0 * body.size_px, 0.0)}, int(row) - 1,
                       0.16 * body.size_px);
      TextStyle name = body;
      name.vertical_anchor = 1.0;
      canvas.text({box.x + swatch_width, y},
                  wrap_text(series[row - 1].name, body, name_width + 1.0, 1).front(), name);
    }
    TextStyle cell = style;
    cell.horizontal_anchor = cell.vertical_anchor = 1.0;
    if (is_head) cell.colour = colours::faint_ink;
    for (std::size_t j = 0; j < column_widths.size(); ++j) {
      x += shrink * (column_widths[j] + 1.6 * body.size_px);
      if (is_head || !series[row - 1].figures.empty())
        canvas.text({x, y}, is_head ? options.headings[j] : series[row - 1].figures[j], cell);
    }
  }
}

void check_series(const std::vector<DistributionSeries>& series,
                  const DistributionOptions& options) {
  if (series.empty() || series.size() > max_series)
    throw std::invalid_argument("distribution: expected 1 to 24 series");
  for (const DistributionSeries& s : series)
    if (!s.figures.empty() && s.figures.size() != options.headings.size())
      throw std::invalid_argument("distribution: expected one figure per heading");
}

std::vector<std::string> caption(const std::vector<DistributionSeries>& series,
                                 const std::vector<Histogram>& histograms, const Bins& bins,
                                 const DistributionOptions& options) {
  std::vector<std::string> lines{fmt::format("bins of {} {}  ·  disc: mean, triangle: P95",
                                             fixed(bins.width, round_decimals(bins.width)),
                                             options.unit)};
  std::string beyond;
  for (std::size_t i = 0; i < series.size(); ++i)
    if (histograms[i].beyond > 0)
      beyond += fmt::format("{}{} of {}", beyond.empty() ? "" : ", ",
                            group_digits(histograms[i].beyond), series[i].name);
  if (!beyond.empty()) lines.push_back("beyond the axis: " + beyond);
  lines.insert(lines.end(), options.caption.begin(), options.caption.end());
  return lines;
}

/// Returns the ranges of the outlines, extended to the limit unless that is too far away.
Extent extent_with_limit(const Panel& panel, const DistributionOptions& options) {
  Extent e = extent(panel);
  if (e.x && options.limit) {
    const double range = e.x->upper - e.x->lower;
    const double excess = std::max(*options.limit - e.x->upper, e.x->lower - *options.limit);
    // A limit farther away than 1.5 times the range would compress the histogram; it is named at
    // the edge instead.
    if (excess < 1.5 * range) widen(*e.x, *options.limit + (excess > 0.0 ? 0.03 * range : 0.0));
  }
  return e;
}

}  // namespace

void write_distribution(const std::filesystem::path& path,
                        const std::vector<DistributionSeries>& series,
                        const DistributionOptions& options) {
  check_series(series, options);
  std::vector<std::vector<double>> sorted_values;
  for (const DistributionSeries& s : series) sorted_values.push_back(sort_finite(s.values));
  const Bins bins = fit_bins(sorted_values);
  Panel panel{{}, options.x_label, "fraction of the machines / %", {}, {}, {}};
  std::vector<Histogram> histograms;
  for (std::size_t i = 0; i < series.size(); ++i) {
    histograms.push_back(histogram(sorted_values[i], bins));
    panel.series.push_back(outline(histograms.back(), bins, int(i)));
  }
  const double unit = options.width / 1600.0;
  const TextStyle body{.size_px = 22.0 * unit};
  const double table = table_height(series.size(), body);
  const Page sheet = page(options.width, int(std::lround(options.height + table)), options.title,
                          caption(series, histograms, bins, options), unit);
  const double em = body.size_px;
  PanelStyle style{sheet.body, {.size_px = 26.0 * unit, .bold = true}, unit};
  const Rectangle cell{sheet.inner.x, sheet.inner.y + table, sheet.inner.width,
                       sheet.inner.height - table - 1.2 * em};
  const Extent extent = extent_with_limit(panel, options);
  style.ticks_px = ticks_px({panel}, cell, {extent}, style);
  Canvas canvas(sheet.width, sheet.height);
  const Axes axes = draw_panel(canvas, panel, cell, extent, style);
  for (std::size_t i = 0; i < series.size(); ++i)
    draw_histogram_bars(canvas, axes, histograms[i], bins, int(i));
  for (std::size_t i = 0; i < series.size(); ++i) {
    // Drawn again, because the bars of other series may hide the outline.
    draw_outline(canvas, axes, panel.series[i], 3.0 * unit);
    if (series[i].mean) draw_marker(canvas, axes, *series[i].mean, disc, int(i), 13.0 * unit);
    if (series[i].p95) draw_marker(canvas, axes, *series[i].p95, triangle, int(i), 17.0 * unit);
  }
  draw_limit(canvas, axes, options, sheet.body);
  draw_table(canvas, series, options,
             {sheet.inner.x + em, sheet.inner.y, sheet.inner.width - 2.0 * em, table}, sheet.body);
  draw_page(canvas, sheet);
  canvas.write_png(path);
}

}  // namespace abbe::render
