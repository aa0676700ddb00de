#include "render/plot.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "render/axes.h"
#include "render/canvas.h"
#include "render/label.h"
#include "render/layout.h"
#include "render/map_text.h"

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

/// A page with room for title and caption; grid and labels are drawn, the curves are the caller's.
struct Sheet {
  TypeSizes type;
  TextStyle body;
  std::vector<std::string> caption;
  Axes axes;
};

Sheet sheet(int width, int height, const Labels& labels, const Span& x, const Span& y) {
  Sheet s{type_sizes(width, height * 4 / 3), {}, {}, {}};
  const double u = s.type.unit;
  s.body.size_px = s.type.body;
  for (const std::string& line : labels.caption) {
    for (const std::string& part : wrapped(line, s.body, width - 80.0 * u))
      s.caption.push_back(part);
  }
  const double left = 150.0 * u;
  const double bottom =
      30.0 * u + static_cast<double>(s.caption.size()) * line_height(s.body) + 100.0 * u;
  const double head = 30.0 * u + 1.38 * s.type.title +
                      static_cast<double>(labels.below_title.size()) * 1.38 * s.type.figures +
                      26.0 * u;
  s.axes = {{left, bottom, width - left - 60.0 * u, height - bottom - head}, x, y};
  return s;
}

void draw_grid(Canvas& canvas, const Sheet& s, const Labels& labels) {
  const Axes& a = s.axes;
  const double u = s.type.unit;
  TextStyle tick = s.body;
  tick.across = 0.5;
  tick.upward = 1.0;
  const Ticks x = round_ticks(a.x.lower, a.x.upper, 10);
  for (const double value : x.values) {
    const double px = at(a, value, a.y.lower).x();
    canvas.line({{px, a.box.y}, {px, a.box.y + a.box.height}}, colours::rule, 1.5 * u);
    canvas.text({px, a.box.y - 10.0 * u}, fixed(value, x.decimals), tick);
  }
  tick.across = 1.0;
  tick.upward = 0.5;
  const Ticks y = round_ticks(a.y.lower, a.y.upper, 7);
  for (const double value : y.values) {
    const double py = at(a, a.x.lower, value).y();
    canvas.line({{a.box.x, py}, {a.box.x + a.box.width, py}}, colours::rule, 1.5 * u);
    canvas.text({a.box.x - 12.0 * u, py}, fixed(value, y.decimals), tick);
  }
  TextStyle name = s.body;
  name.across = 0.5;
  name.upward = 1.0;
  canvas.text({a.box.x + 0.5 * a.box.width, a.box.y - 48.0 * u}, labels.x, name);
  name.turned_left = true;
  canvas.text({34.0 * u, a.box.y + 0.5 * a.box.height}, labels.y, name);
}

void draw_text(Canvas& canvas, const Sheet& s, const Labels& labels, int width, int height) {
  const double u = s.type.unit;
  const TextStyle title{.size_px = s.type.title, .bold = true};
  double y = height - 30.0 * u;
  y -= paragraph(canvas, {40.0 * u, y}, wrapped(labels.title, title, width - 80.0 * u, 1), title);
  paragraph(canvas, {40.0 * u, y}, labels.below_title, {.size_px = s.type.figures});
  paragraph(canvas,
            {40.0 * u, 24.0 * u + static_cast<double>(s.caption.size()) * line_height(s.body)},
            s.caption, s.body);
}

/// Deviations in rising order with their weights.
struct Sorted {
  std::vector<double> value;
  std::vector<double> weight;
  double total = 0.0;
};

Sorted sorted(const Eigen::VectorXd& deviation, const Eigen::VectorXd& weights) {
  std::vector<std::pair<double, Eigen::Index>> order;
  for (Eigen::Index i = 0; i < deviation.size(); ++i)
    if (std::isfinite(deviation[i])) order.emplace_back(deviation[i], i);
  std::sort(order.begin(), order.end());
  Sorted result;
  for (const auto& [value, i] : order) {
    result.value.push_back(value);
    result.weight.push_back(weights[i]);
    result.total += weights[i];
  }
  return result;
}

/// Value below which `share` of the weight lies.
double quantile(const Sorted& data, double share) {
  double sum = 0.0;
  for (std::size_t i = 0; i < data.value.size(); ++i) {
    sum += data.weight[i];
    if (sum >= share * data.total) return data.value[i];
  }
  return data.value.back();
}

struct AreaShares {
  double first = 0.0;  ///< lower edge
  double width = 1.0;
  std::vector<double> percent;
  double beyond_percent = 0.0;
};

AreaShares area_shares(const Sorted& data) {
  Span span{data.value.front(), data.value.back()};
  const Span most{quantile(data, 0.0005), quantile(data, 0.9995)};
  if (span.upper - span.lower > 2.0 * (most.upper - most.lower) && most.upper > most.lower)
    span = most;
  AreaShares result;
  const double range = span.upper - span.lower;
  const double largest = std::max(std::abs(span.lower), std::abs(span.upper));
  constexpr double least_bin_um = 1e-4;  // what is computed is not better than 0.1 nm
  // a map without any spread still gets a few bins about its value
  result.width = round_up_125(std::max({range / 80.0, 1e-7 * largest, least_bin_um}));
  const double first = std::floor(span.lower / result.width);
  const double last = std::floor(span.upper / result.width);
  const double margin = range / result.width < 10.0 ? 5.0 : 1.0;
  result.first = (first - margin) * result.width;
  result.percent.assign(static_cast<std::size_t>(last - first + 2.0 * margin + 1.0), 0.0);
  for (std::size_t i = 0; i < data.value.size(); ++i) {
    const double share = data.total > 0.0 ? 100.0 * data.weight[i] / data.total : 0.0;
    const double bin = std::floor(data.value[i] / result.width) - (first - margin);
    const bool within = bin >= 0.0 && bin < static_cast<double>(result.percent.size());
    (within ? result.percent[static_cast<std::size_t>(bin)] : result.beyond_percent) += share;
  }
  return result;
}

void draw_upright(Canvas& canvas, const Sheet& s, double x, const Colour& colour,
                  const std::string& label) {
  const Axes& a = s.axes;
  if (x < a.x.lower || x > a.x.upper) return;
  const double u = s.type.unit;
  const Vector2d low = at(a, x, a.y.lower);
  const Vector2d high = at(a, x, a.y.upper);
  canvas.line({low, high}, colour, 3.0 * u);
  TextStyle style = s.body;
  style.colour = colour;
  style.turned_left = true;
  style.across = 1.0;
  style.upward = 0.0;
  const bool near_left = low.x() - a.box.x < 1.5 * style.size_px;
  if (near_left) style.upward = 1.0;
  canvas.text({low.x() + (near_left ? 6.0 : -6.0) * u, high.y() - 8.0 * u}, label, style);
}

void draw_bars(Canvas& canvas, const Sheet& s, const AreaShares& b, double per_um) {
  for (std::size_t i = 0; i < b.percent.size(); ++i) {
    if (b.percent[i] <= 0.0) continue;
    const double left = (b.first + static_cast<double>(i) * b.width) * per_um;
    const Vector2d low = at(s.axes, left, 0.0);
    const Vector2d high = at(s.axes, left + b.width * per_um, b.percent[i]);
    canvas.fill(
        {low.x() + 0.5, low.y(), std::max(high.x() - low.x() - 1.0, 0.5), high.y() - low.y()},
        {0.36, 0.49, 0.68});
  }
}

}  // namespace

void write_histogram(const std::filesystem::path& path, const Eigen::VectorXd& deviation_um,
                     const Eigen::VectorXd& weights, const HistogramOptions& options) {
  const Figures shown = options.figures ? *options.figures : figures(deviation_um, weights);
  const Sorted data = sorted(deviation_um, weights);
  const bool any = !data.value.empty();
  const AreaShares b = any ? area_shares(data) : AreaShares{0.0, 1.0, {0.0}, 0.0};
  const double end = b.first + b.width * static_cast<double>(b.percent.size());
  Span x{b.first, end};
  if (options.tolerance_um) {
    const auto [lower, upper] = *options.tolerance_um;
    const double seen = std::max(std::abs(b.first), std::abs(end)), margin = 0.05 * (upper - lower);
    if (std::abs(lower) < 3.0 * seen) widen(x, lower - margin);
    if (std::abs(upper) < 3.0 * seen) widen(x, upper + margin);
  }
  const LengthUnit unit = unit_for(std::max(std::abs(x.lower), std::abs(x.upper)));
  const double peak = *std::max_element(b.percent.begin(), b.percent.end());

  const double bin = b.width * unit.per_um;
  const std::string bin_width = fixed(bin, round_decimals(bin));
  Labels labels{options.title,
                {},
                fmt::format("deviation / {}  ({})", unit.name, sign_convention),
                fmt::format("share of the area in bins of {} {} / %", bin_width, unit.name),
                options.caption};
  labels.below_title.push_back(figures_text(shown));
  if (b.beyond_percent > 0.0) {
    labels.caption.insert(
        labels.caption.begin(),
        fmt::format("{} % of the area lies beyond the axis, values from {} to {} {}",
                    figure(b.beyond_percent), figure(data.value.front() * unit.per_um),
                    figure(data.value.back() * unit.per_um), unit.name));
  }
  const Sheet s =
      sheet(options.width, options.height, labels, {x.lower * unit.per_um, x.upper * unit.per_um},
            {0.0, peak > 0.0 ? 1.25 * peak : 1.0});
  Canvas canvas(options.width, options.height);
  draw_grid(canvas, s, labels);
  draw_bars(canvas, s, b, unit.per_um);
  canvas.line({at(s.axes, s.axes.x.lower, 0.0), at(s.axes, s.axes.x.upper, 0.0)}, colours::ink,
              2.0 * s.type.unit);
  if (std::isfinite(shown.mean_um)) {
    draw_upright(canvas, s, shown.mean_um * unit.per_um, {0.75, 0.25, 0.05}, "mean");
  }
  if (options.tolerance_um) {
    for (const double limit : *options.tolerance_um) {
      const double value = limit * unit.per_um;
      draw_upright(canvas, s, value, {0.2, 0.45, 0.2}, "tolerance " + signed_figure(value));
    }
  }
  draw_text(canvas, s, labels, options.width, options.height);
  canvas.write_png(path);
}

namespace {

void draw_series(Canvas& canvas, const Sheet& s, const ProfileSeries& one, int index) {
  std::vector<Vector2d> run;
  const auto flush = [&] {
    stroke(canvas, thinned(run), index, 3.0 * s.type.unit);
    run.clear();
  };
  for (Eigen::Index i = 0; i < one.x.size(); ++i) {
    if (!std::isfinite(one.x[i]) || !std::isfinite(one.y[i])) {
      flush();
      continue;
    }
    run.push_back(at(s.axes, one.x[i], one.y[i]));
  }
  flush();
}

/// In a column at the right, outside the curves' rectangle.
void draw_legend(Canvas& canvas, const Sheet& s, const std::vector<std::vector<std::string>>& names,
                 double x) {
  const double u = s.type.unit;
  double y = s.axes.box.y + s.axes.box.height;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double middle = y - 0.65 * s.body.size_px;
    stroke(canvas, {{x, middle}, {x + 44.0 * u, middle}}, static_cast<int>(i), 4.0 * u);
    y -= paragraph(canvas, {x + 58.0 * u, y}, names[i], s.body) + 8.0 * u;
  }
}

}  // namespace

void write_profile(const std::filesystem::path& path, const std::vector<ProfileSeries>& series,
                   const ProfileOptions& options) {
  if (series.empty()) throw std::invalid_argument("profile: at least one series is needed");
  bool any = false;
  Span x;
  Span y;
  for (const ProfileSeries& one : series) {
    if (one.x.size() != one.y.size()) {
      throw std::invalid_argument("profile: x and y of a series need one size");
    }
    for (Eigen::Index i = 0; i < one.x.size(); ++i) {
      if (!std::isfinite(one.x[i]) || !std::isfinite(one.y[i])) continue;
      if (!any) {
        x = {one.x[i], one.x[i]};
        y = {one.y[i], one.y[i]};
        any = true;
      }
      widen(x, one.x[i]);
      widen(y, one.y[i]);
    }
  }
  const Labels labels{options.title, {}, options.x_label, options.y_label, options.caption};
  if (x.lower == x.upper) x = padded(x);
  Sheet s = sheet(options.width, options.height, labels, x, padded(y));
  const double legend_width = 330.0 * s.type.unit;
  s.axes.box.width -= legend_width - 30.0 * s.type.unit;
  std::vector<std::vector<std::string>> names;
  for (const ProfileSeries& one : series) {
    names.push_back(wrapped(one.name, s.body, legend_width - 100.0 * s.type.unit, 3));
  }

  Canvas canvas(options.width, options.height);
  draw_grid(canvas, s, labels);
  canvas.frame(s.axes.box, colours::faint_ink, 1.5 * s.type.unit);
  for (std::size_t i = 0; i < series.size(); ++i) {
    draw_series(canvas, s, series[i], static_cast<int>(i));
  }
  draw_legend(canvas, s, names, s.axes.box.x + s.axes.box.width + 30.0 * s.type.unit);
  draw_text(canvas, s, labels, options.width, options.height);
  canvas.write(path, options.format);
}

}  // namespace abbe::render
