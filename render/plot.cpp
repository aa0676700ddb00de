#include "render/plot.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "render/canvas.h"
#include "render/figures.h"
#include "render/layout.h"
#include "render/residual_map.h"

namespace abbe::render {

namespace {

using Eigen::Vector2d;

struct Labels {
  std::string title;
  std::vector<std::string> below_title;
  std::string x;
  std::string y;
  std::vector<std::string> caption;
};

/// The layout of a picture with one diagram.
struct DiagramSheet {
  TypeSizes type;
  TextStyle body;
  std::vector<std::string> caption;
  Axes axes;
};

DiagramSheet make_sheet(int width, int height, const Labels& labels, const Span& x, const Span& y) {
  DiagramSheet sheet{type_sizes(width, height * 4 / 3), {}, {}, {}};
  const double u = sheet.type.unit;
  sheet.body.size_px = sheet.type.body;
  for (const std::string& line : labels.caption) {
    for (const std::string& part : wrap_text(line, sheet.body, width - 80.0 * u))
      sheet.caption.push_back(part);
  }
  const double left = 150.0 * u;
  const double bottom =
      30.0 * u + static_cast<double>(sheet.caption.size()) * line_height(sheet.body) + 100.0 * u;
  const double head = 30.0 * u + 1.38 * sheet.type.title +
                      static_cast<double>(labels.below_title.size()) * 1.38 * sheet.type.figures +
                      26.0 * u;
  sheet.axes = {{left, bottom, width - left - 60.0 * u, height - bottom - head}, x, y};
  return sheet;
}

void draw_grid(Canvas& canvas, const DiagramSheet& sheet, const Labels& labels) {
  const Axes& axes = sheet.axes;
  const double u = sheet.type.unit;
  TextStyle tick = sheet.body;
  tick.horizontal_anchor = 0.5;
  tick.vertical_anchor = 1.0;
  const Ticks x = round_ticks(axes.x.lower, axes.x.upper, 10);
  for (const double value : x.values) {
    const double px = at(axes, value, axes.y.lower).x();
    canvas.line({{px, axes.box.y}, {px, axes.box.y + axes.box.height}}, colours::rule, 1.5 * u);
    canvas.text({px, axes.box.y - 10.0 * u}, fixed(value, x.decimals), tick);
  }
  tick.horizontal_anchor = 1.0;
  tick.vertical_anchor = 0.5;
  const Ticks y = round_ticks(axes.y.lower, axes.y.upper, 7);
  for (const double value : y.values) {
    const double py = at(axes, axes.x.lower, value).y();
    canvas.line({{axes.box.x, py}, {axes.box.x + axes.box.width, py}}, colours::rule, 1.5 * u);
    canvas.text({axes.box.x - 12.0 * u, py}, fixed(value, y.decimals), tick);
  }
  TextStyle name = sheet.body;
  name.horizontal_anchor = 0.5;
  name.vertical_anchor = 1.0;
  canvas.text({axes.box.x + 0.5 * axes.box.width, axes.box.y - 48.0 * u}, labels.x, name);
  name.turned_left = true;
  canvas.text({34.0 * u, axes.box.y + 0.5 * axes.box.height}, labels.y, name);
}

void draw_text(Canvas& canvas, const DiagramSheet& sheet, const Labels& labels, int width,
               int height) {
  const double u = sheet.type.unit;
  const TextStyle title{.size_px = sheet.type.title, .bold = true};
  double y = height - 30.0 * u;
  y -= draw_paragraph(canvas, {40.0 * u, y}, wrap_text(labels.title, title, width - 80.0 * u, 1),
                      title);
  draw_paragraph(canvas, {40.0 * u, y}, labels.below_title, {.size_px = sheet.type.figures});
  draw_paragraph(
      canvas,
      {40.0 * u, 24.0 * u + static_cast<double>(sheet.caption.size()) * line_height(sheet.body)},
      sheet.caption, sheet.body);
}

/// Finite deviations in ascending order, with their weights.
struct WeightedValues {
  std::vector<double> value;
  std::vector<double> weight;
  double total = 0.0;  ///< sum of the weights
};

WeightedValues sort_deviations(const Eigen::VectorXd& deviation, const Eigen::VectorXd& weights) {
  std::vector<std::pair<double, Eigen::Index>> order;
  for (Eigen::Index i = 0; i < deviation.size(); ++i)
    if (std::isfinite(deviation[i])) order.emplace_back(deviation[i], i);
  std::sort(order.begin(), order.end());
  WeightedValues result;
  for (const auto& [value, i] : order) {
    result.value.push_back(value);
    result.weight.push_back(weights[i]);
    result.total += weights[i];
  }
  return result;
}

/// Returns the value below which the values have a fraction of the total weight.
double quantile(const WeightedValues& data, double fraction) {
  double sum = 0.0;
  for (std::size_t i = 0; i < data.value.size(); ++i) {
    sum += data.weight[i];
    if (sum >= fraction * data.total) return data.value[i];
  }
  return data.value.back();
}

/// Histogram of the area over the deviation.
struct AreaHistogram {
  double first = 0.0;  ///< lower edge of the first bin
  double width = 1.0;
  std::vector<double> percent;
  double beyond_percent = 0.0;
};

AreaHistogram area_histogram(const WeightedValues& data) {
  Span span{data.value.front(), data.value.back()};
  // The axis is shortened to the central 99.9 % of the area only if that at least halves it.
  const Span inner{quantile(data, 0.0005), quantile(data, 0.9995)};
  if (span.upper - span.lower > 2.0 * (inner.upper - inner.lower) && inner.upper > inner.lower)
    span = inner;
  AreaHistogram result;
  const double range = span.upper - span.lower;
  const double largest = std::max(std::abs(span.lower), std::abs(span.upper));
  constexpr double min_bin_um = 1e-4;  // the accuracy of the values is 0.1 nm
  result.width = round_up_125(std::max({range / 80.0, 1e-7 * largest, min_bin_um}));
  const double first = std::floor(span.lower / result.width);
  const double last = std::floor(span.upper / result.width);
  // If all values are nearly equal, there are a few empty bins around them.
  const double margin = range / result.width < 10.0 ? 5.0 : 1.0;
  result.first = (first - margin) * result.width;
  result.percent.assign(static_cast<std::size_t>(last - first + 2.0 * margin + 1.0), 0.0);
  for (std::size_t i = 0; i < data.value.size(); ++i) {
    const double percent = data.total > 0.0 ? 100.0 * data.weight[i] / data.total : 0.0;
    const double bin = std::floor(data.value[i] / result.width) - (first - margin);
    const bool is_within = bin >= 0.0 && bin < static_cast<double>(result.percent.size());
    (is_within ? result.percent[static_cast<std::size_t>(bin)] : result.beyond_percent) += percent;
  }
  return result;
}

void draw_vertical_line(Canvas& canvas, const DiagramSheet& sheet, double x, const Colour& colour,
                        const std::string& label) {
  const Axes& axes = sheet.axes;
  // The axis may be shortened; a line beyond it is not drawn.
  if (x < axes.x.lower || x > axes.x.upper) return;
  const double u = sheet.type.unit;
  const Vector2d low = at(axes, x, axes.y.lower);
  const Vector2d high = at(axes, x, axes.y.upper);
  canvas.line({low, high}, colour, 3.0 * u);
  TextStyle style = sheet.body;
  style.colour = colour;
  style.turned_left = true;
  style.horizontal_anchor = 1.0;
  style.vertical_anchor = 0.0;
  // The label is to the left of the line, except near the left edge, where it would cover the tick
  // labels.
  const bool is_near_left = low.x() - axes.box.x < 1.5 * style.size_px;
  if (is_near_left) style.vertical_anchor = 1.0;
  canvas.text({low.x() + (is_near_left ? 6.0 : -6.0) * u, high.y() - 8.0 * u}, label, style);
}

void draw_bars(Canvas& canvas, const DiagramSheet& sheet, const AreaHistogram& histogram,
               double per_um) {
  for (std::size_t i = 0; i < histogram.percent.size(); ++i) {
    // An empty bin has no bar, not even a flat one.
    if (histogram.percent[i] <= 0.0) continue;
    const double left = (histogram.first + static_cast<double>(i) * histogram.width) * per_um;
    const Vector2d low = at(sheet.axes, left, 0.0);
    const Vector2d high = at(sheet.axes, left + histogram.width * per_um, histogram.percent[i]);
    canvas.fill(
        {low.x() + 0.5, low.y(), std::max(high.x() - low.x() - 1.0, 0.5), high.y() - low.y()},
        {0.36, 0.49, 0.68});
  }
}

}  // namespace

void write_histogram(const std::filesystem::path& path, const Eigen::VectorXd& deviation_um,
                     const Eigen::VectorXd& weights, const HistogramOptions& options) {
  const Figures stated_figures =
      options.figures ? *options.figures : figures(deviation_um, weights);
  const WeightedValues data = sort_deviations(deviation_um, weights);
  // Without cut vertices the picture has axes but no bars.
  const AreaHistogram histogram =
      data.value.empty() ? AreaHistogram{0.0, 1.0, {0.0}, 0.0} : area_histogram(data);
  const double end =
      histogram.first + histogram.width * static_cast<double>(histogram.percent.size());
  Span x{histogram.first, end};
  if (options.tolerance_um) {
    const auto [lower, upper] = *options.tolerance_um;
    // A limit beyond three times the values would compress the histogram, so it is not shown.
    const double max_value = std::max(std::abs(histogram.first), std::abs(end));
    const double margin = 0.05 * (upper - lower);
    if (std::abs(lower) < 3.0 * max_value) widen(x, lower - margin);
    if (std::abs(upper) < 3.0 * max_value) widen(x, upper + margin);
  }
  const LengthUnit unit = length_unit(std::max(std::abs(x.lower), std::abs(x.upper)));
  const double peak = *std::max_element(histogram.percent.begin(), histogram.percent.end());

  const double bin = histogram.width * unit.per_um;
  const std::string bin_width = fixed(bin, round_decimals(bin));
  Labels labels{options.title,
                {},
                fmt::format("deviation / {}  ({})", unit.name, sign_convention),
                fmt::format("fraction of the area in bins of {} {} / %", bin_width, unit.name),
                options.caption};
  labels.below_title.push_back(figures_text(stated_figures));
  if (histogram.beyond_percent > 0.0) {
    labels.caption.insert(
        labels.caption.begin(),
        fmt::format("{} % of the area lies beyond the axis, values from {} to {} {}",
                    figure(histogram.beyond_percent), figure(data.value.front() * unit.per_um),
                    figure(data.value.back() * unit.per_um), unit.name));
  }
  // The labels of the lines are above the highest bar, in a quarter of its height.
  const DiagramSheet sheet = make_sheet(options.width, options.height, labels,
                                        {x.lower * unit.per_um, x.upper * unit.per_um},
                                        {0.0, peak > 0.0 ? 1.25 * peak : 1.0});
  Canvas canvas(options.width, options.height);
  draw_grid(canvas, sheet, labels);
  draw_bars(canvas, sheet, histogram, unit.per_um);
  canvas.line({at(sheet.axes, sheet.axes.x.lower, 0.0), at(sheet.axes, sheet.axes.x.upper, 0.0)},
              colours::ink, 2.0 * sheet.type.unit);
  if (std::isfinite(stated_figures.mean_um)) {
    draw_vertical_line(canvas, sheet, stated_figures.mean_um * unit.per_um, {0.75, 0.25, 0.05},
                       "mean");
  }
  if (options.tolerance_um) {
    for (const double limit : *options.tolerance_um) {
      const double value = limit * unit.per_um;
      draw_vertical_line(canvas, sheet, value, {0.2, 0.45, 0.2},
                         "tolerance " + signed_figure(value));
    }
  }
  draw_text(canvas, sheet, labels, options.width, options.height);
  canvas.write_png(path);
}

namespace {

void draw_series(Canvas& canvas, const DiagramSheet& sheet, const ProfileSeries& series,
                 int index) {
  std::vector<Vector2d> points;
  const auto flush = [&] {
    // Thinning to columns of pixels bounds the cost and does not change the picture.
    draw_series_line(canvas, decimate_curve(points), index, 3.0 * sheet.type.unit);
    points.clear();
  };
  for (Eigen::Index i = 0; i < series.x.size(); ++i) {
    if (!std::isfinite(series.x[i]) || !std::isfinite(series.y[i])) {
      flush();
      continue;
    }
    points.push_back(at(sheet.axes, series.x[i], series.y[i]));
  }
  flush();
}

/// Draws the legend in a column to the right of the axes.
void draw_legend(Canvas& canvas, const DiagramSheet& sheet,
                 const std::vector<std::vector<std::string>>& names, double x) {
  const double u = sheet.type.unit;
  double y = sheet.axes.box.y + sheet.axes.box.height;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double middle = y - 0.65 * sheet.body.size_px;
    draw_series_line(canvas, {{x, middle}, {x + 44.0 * u, middle}}, static_cast<int>(i), 4.0 * u);
    y -= draw_paragraph(canvas, {x + 58.0 * u, y}, names[i], sheet.body) + 8.0 * u;
  }
}

}  // namespace

void write_profile(const std::filesystem::path& path, const std::vector<ProfileSeries>& series,
                   const ProfileOptions& options) {
  if (series.empty()) throw std::invalid_argument("profile: expected at least one series");
  bool has_points = false;
  Span x;
  Span y;
  for (const ProfileSeries& curve : series) {
    if (curve.x.size() != curve.y.size()) {
      throw std::invalid_argument("profile: x and y of a series must have the same size");
    }
    for (Eigen::Index i = 0; i < curve.x.size(); ++i) {
      if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.y[i])) continue;
      if (!has_points) {
        x = {curve.x[i], curve.x[i]};
        y = {curve.y[i], curve.y[i]};
        has_points = true;
      }
      widen(x, curve.x[i]);
      widen(y, curve.y[i]);
    }
  }
  const Labels labels{options.title, {}, options.x_label, options.y_label, options.caption};
  // With a single position the axis would have no length.
  if (x.lower == x.upper) x = pad_span(x);
  DiagramSheet sheet = make_sheet(options.width, options.height, labels, x, pad_span(y));
  const double legend_width = 330.0 * sheet.type.unit;
  sheet.axes.box.width -= legend_width - 30.0 * sheet.type.unit;
  std::vector<std::vector<std::string>> names;
  for (const ProfileSeries& curve : series) {
    names.push_back(wrap_text(curve.name, sheet.body, legend_width - 100.0 * sheet.type.unit, 3));
  }

  Canvas canvas(options.width, options.height);
  draw_grid(canvas, sheet, labels);
  canvas.frame(sheet.axes.box, colours::faint_ink, 1.5 * sheet.type.unit);
  for (std::size_t i = 0; i < series.size(); ++i) {
    draw_series(canvas, sheet, series[i], static_cast<int>(i));
  }
  draw_legend(canvas, sheet, names,
              sheet.axes.box.x + sheet.axes.box.width + 30.0 * sheet.type.unit);
  draw_text(canvas, sheet, labels, options.width, options.height);
  canvas.write(path, options.format);
}

namespace {

constexpr std::size_t max_bars = 400;
constexpr double bar_px = 38.0;     // distance of the bars in a picture 1600 px wide
constexpr double legend_px = 44.0;  // height of the legend in a picture 1600 px wide
constexpr double bar_opacity = 0.85;

std::vector<double> running_sums(const std::vector<Bar>& bars) {
  std::vector<double> sums;
  double sum = 0.0;
  for (const Bar& bar : bars) sums.push_back(sum += std::isfinite(bar.value) ? bar.value : 0.0);
  return sums;
}

/// Returns the range of the axis, which includes every bar, whisker, cumulative sum and the
/// reference.
Span axis_range(const std::vector<Bar>& bars, const BarsOptions& options) {
  std::optional<Span> span;
  if (options.from_zero) span = Span{0.0, 0.0};
  const auto include_value = [&](double value) {
    if (!std::isfinite(value)) return;
    if (!span) span = Span{value, value};
    widen(*span, value);
  };
  for (const Bar& bar : bars) {
    include_value(bar.value);
    include_value(bar.value - bar.u.value_or(0.0));
    include_value(bar.value + bar.u.value_or(0.0));
    if (bar.second_value) include_value(*bar.second_value);
  }
  if (!options.running_sum.empty())
    for (const double sum : running_sums(bars)) include_value(sum);
  if (options.reference) include_value(*options.reference);
  // If all bars are zero, the axis needs some length.
  if (!span || (span->lower == 0.0 && span->upper == 0.0)) return {0.0, 1.0};
  // Bars start at zero, so an end at zero gets no margin.
  Span range = pad_span(*span);
  if (span->lower == 0.0) range.lower = 0.0;
  if (span->upper == 0.0) range.upper = 0.0;
  return range;
}

/// Returns the text at the right of a bar: its own text or its value, with the uncertainty if there
/// is one.
std::string value_text(const Bar& bar) {
  if (!bar.text.empty()) return bar.text;
  if (bar.second_value) return figure(bar.value) + " / " + figure(*bar.second_value);
  if (!bar.u || !(*bar.u > 0.0) || !std::isfinite(bar.value)) return figure(bar.value);
  // The uncertainty has two significant digits, and the value as many decimals.
  const int decimals = std::clamp(1 - int(std::floor(std::log10(*bar.u))), 0, 6);
  return fixed(bar.value, decimals) + " ± " + fixed(*bar.u, decimals);
}

/// Draws a bar from zero to the value, between two heights in px.
void draw_body(Canvas& canvas, const Axes& axes, double value, const Span& rows, int colour) {
  if (!std::isfinite(value)) return;
  const double base = std::clamp(0.0, axes.x.lower, axes.x.upper);
  const double base_px = at(axes, base, 0.0).x(), end_px = at(axes, value, 0.0).x();
  canvas.fill(
      {std::min(base_px, end_px), rows.lower, std::abs(end_px - base_px), rows.upper - rows.lower},
      series_colour(colour), bar_opacity);
}

void draw_bar(Canvas& canvas, const Axes& axes, const Bar& bar, double y, const TextStyle& body) {
  const double unit = body.size_px / 22.0;
  const double half = 0.34 * bar_px * unit;
  // Two bars of the same sign would hide each other, so each takes half of the row.
  const bool is_row_divided = bar.second_value && bar.value * *bar.second_value > 0.0;
  draw_body(canvas, axes, bar.value, {is_row_divided ? y : y - half, y + half}, bar.colour);
  if (bar.second_value)
    draw_body(canvas, axes, *bar.second_value, {y - half, is_row_divided ? y : y + half},
              bar.colour + 1);
  if (!bar.u || !std::isfinite(bar.value)) return;
  const double low = at(axes, bar.value - *bar.u, 0.0).x(),
               high = at(axes, bar.value + *bar.u, 0.0).x();
  canvas.line({{low, y}, {high, y}}, colours::ink, 2.0 * unit);
  for (const double x : {low, high})
    canvas.line({{x, y - 0.5 * half}, {x, y + 0.5 * half}}, colours::ink, 2.0 * unit);
}

constexpr int running_sum_colour = 1;

void draw_running_sum(Canvas& canvas, const Axes& axes, const std::vector<Bar>& bars, double row_px,
                      double unit) {
  std::vector<Vector2d> points;
  const std::vector<double> sums = running_sums(bars);
  for (std::size_t i = 0; i < sums.size(); ++i)
    points.emplace_back(at(axes, sums[i], 0.0).x(),
                        axes.box.y + axes.box.height - (double(i) + 0.5) * row_px);
  draw_series_line(canvas, points, running_sum_colour, 3.0 * unit);
  for (const Vector2d& p : points) draw_mark(canvas, p, running_sum_colour, 11.0 * unit);
}

bool has_legend(const BarsOptions& options) {
  return !options.legend.empty() || !options.running_sum.empty();
}

void draw_legend(Canvas& canvas, const BarsOptions& options, Vector2d left, const TextStyle& body) {
  for (std::size_t i = 0; i < options.legend.size(); ++i) {
    const Colour c = series_colour(int(i));
    // The colour of a bar, which is drawn with this opacity on white.
    const auto blend = [](double component) { return 1.0 - bar_opacity * (1.0 - component); };
    left.x() +=
        draw_swatch(canvas, left, {blend(c.r), blend(c.g), blend(c.b)}, options.legend[i], body);
    left.x() += 1.8 * body.size_px;
  }
  if (!options.running_sum.empty())
    draw_legend_row(canvas, left, {{options.running_sum, running_sum_colour, true, true}}, body);
}

double max_label_width(const std::vector<Bar>& bars, const TextStyle& style) {
  double max_width = 0.0;
  for (const Bar& bar : bars) max_width = std::max(max_width, text_size(bar.label, style).x());
  return max_width;
}

double max_value_width(const std::vector<Bar>& bars, const TextStyle& style) {
  double max_width = 0.0;
  for (const Bar& bar : bars)
    max_width = std::max(max_width, text_size(value_text(bar), style).x());
  return max_width;
}

void draw_scale(Canvas& canvas, const Axes& axes, const BarsOptions& options,
                const TextStyle& body) {
  const double unit = body.size_px / 22.0;
  TextStyle tick = body;
  tick.horizontal_anchor = 0.5;
  tick.vertical_anchor = 1.0;
  const Ticks ticks = round_ticks(axes.x.lower, axes.x.upper, 7);
  for (const double value : ticks.values) {
    const double x = at(axes, value, 0.0).x();
    // A tick is a multiple of the step and may miss zero by rounding.
    const bool is_zero = std::abs(value) < 1e-9 * (axes.x.upper - axes.x.lower);
    canvas.line({{x, axes.box.y}, {x, axes.box.y + axes.box.height}},
                is_zero ? colours::faint_ink : colours::rule, (is_zero ? 2.0 : 1.5) * unit);
    canvas.text({x, axes.box.y - 0.3 * body.size_px}, fixed(value, ticks.decimals), tick);
  }
  canvas.text({axes.box.x + 0.5 * axes.box.width, axes.box.y - 1.8 * body.size_px}, options.x_label,
              tick);
}

void draw_reference(Canvas& canvas, const Axes& axes, const BarsOptions& options,
                    const TextStyle& body) {
  if (!options.reference) return;
  const Colour reference_colour{0.2, 0.45, 0.2};
  const double x = at(axes, *options.reference, 0.0).x(), top = axes.box.y + axes.box.height;
  canvas.line({{x, axes.box.y}, {x, top}}, reference_colour, 3.0 * body.size_px / 22.0);
  TextStyle style = body;
  style.colour = reference_colour;
  // The label extends towards the middle, so that it remains in the picture.
  style.horizontal_anchor = x > axes.box.x + 0.5 * axes.box.width ? 1.0 : 0.0;
  canvas.text({x, top + 0.1 * body.size_px}, options.reference_label, style);
}

}  // namespace

void write_bars(const std::filesystem::path& path, const std::vector<Bar>& bars,
                const BarsOptions& options) {
  if (bars.empty() || bars.size() > max_bars)
    throw std::invalid_argument("bars: expected 1 to 400 bars");
  const double unit = options.width / 1600.0;
  const double legend = has_legend(options) ? legend_px * unit : 0.0;
  const double above = (options.reference ? 32.0 * unit : 8.0 * unit) + legend, below = 80.0 * unit;
  const double margins = page_margins(options.width, options.title, options.caption, unit);
  const int height =
      int(std::lround(double(bars.size()) * bar_px * unit + above + below + margins));
  const Page sheet =
      page(options.width, std::max(height, 64), options.title, options.caption, unit);
  const double em = sheet.body.size_px;
  // Long labels are shortened, so that the bars have most of the width.
  const double names = std::min(max_label_width(bars, sheet.body), 0.4 * sheet.width);
  const double values = max_value_width(bars, sheet.body);
  const double left = sheet.inner.x + names + 1.5 * em;
  const Axes axes{
      {left, sheet.inner.y + below, sheet.inner.x + sheet.inner.width - left - values - 2.0 * em,
       double(bars.size()) * bar_px * unit},
      axis_range(bars, options),
      {}};
  Canvas canvas(sheet.width, sheet.height);
  draw_scale(canvas, axes, options, sheet.body);
  for (std::size_t i = 0; i < bars.size(); ++i) {
    const double y = axes.box.y + axes.box.height - (double(i) + 0.5) * bar_px * unit;
    draw_bar(canvas, axes, bars[i], y, sheet.body);
    TextStyle label = sheet.body;
    label.vertical_anchor = 0.5;
    canvas.text({axes.box.x + axes.box.width + em, y}, value_text(bars[i]), label);
    label.horizontal_anchor = 1.0;
    canvas.text({left - 0.7 * em, y}, wrap_text(bars[i].label, label, names + 1.0, 1).front(),
                label);
  }
  if (!options.running_sum.empty()) draw_running_sum(canvas, axes, bars, bar_px * unit, unit);
  draw_reference(canvas, axes, options, sheet.body);
  draw_legend(canvas, options,
              {sheet.inner.x + 0.5 * em, sheet.inner.y + sheet.inner.height - 0.5 * legend},
              sheet.body);
  draw_page(canvas, sheet);
  canvas.write_png(path);
}

}  // namespace abbe::render
