#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "render/axes.h"
#include "render/canvas.h"
#include "render/label.h"
#include "render/page.h"
#include "render/plot.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

constexpr std::size_t most_bars = 400;
constexpr double bar_px = 38.0;     // from bar to bar, of a picture 1600 px wide
constexpr double legend_px = 44.0;  // above the bars
constexpr double bar_opacity = 0.85;

std::vector<double> running_sums(const std::vector<Bar>& bars) {
  std::vector<double> sums;
  double sum = 0.0;
  for (const Bar& bar : bars) sums.push_back(sum += std::isfinite(bar.value) ? bar.value : 0.0);
  return sums;
}

/// Ends of the axis: zero, every bar, whisker, running sum and the reference.
Span reach(const std::vector<Bar>& bars, const BarsOptions& options) {
  std::optional<Span> span;
  if (options.from_zero) span = Span{0.0, 0.0};
  const auto take = [&](double value) {
    if (!std::isfinite(value)) return;
    if (!span) span = Span{value, value};
    widen(*span, value);
  };
  for (const Bar& bar : bars) {
    take(bar.value);
    take(bar.value - bar.u.value_or(0.0));
    take(bar.value + bar.u.value_or(0.0));
    if (bar.other) take(*bar.other);
  }
  if (!options.running_sum.empty())
    for (const double sum : running_sums(bars)) take(sum);
  if (options.reference) take(*options.reference);
  if (!span || (span->lower == 0.0 && span->upper == 0.0)) return {0.0, 1.0};
  Span wide = padded(*span);
  if (span->lower == 0.0) wide.lower = 0.0;
  if (span->upper == 0.0) wide.upper = 0.0;
  return wide;
}

/// The value, to two digits of its uncertainty where there is one.
std::string shown_value(const Bar& bar) {
  if (!bar.text.empty()) return bar.text;
  if (bar.other) return figure(bar.value) + " / " + figure(*bar.other);
  if (!bar.u || !(*bar.u > 0.0) || !std::isfinite(bar.value)) return figure(bar.value);
  const int decimals = std::clamp(1 - int(std::floor(std::log10(*bar.u))), 0, 6);
  return fixed(bar.value, decimals) + " ± " + fixed(*bar.u, decimals);
}

/// From zero to the value, between two heights in px.
void draw_body(Canvas& canvas, const Axes& a, double value, const Span& rows, int colour) {
  if (!std::isfinite(value)) return;
  const double zero = std::clamp(0.0, a.x.lower, a.x.upper);
  const double from = at(a, zero, 0.0).x(), to = at(a, value, 0.0).x();
  canvas.fill({std::min(from, to), rows.lower, std::abs(to - from), rows.upper - rows.lower},
              series_colour(colour), bar_opacity);
}

void draw_bar(Canvas& canvas, const Axes& a, const Bar& bar, double y, const TextStyle& body) {
  const double unit = body.size_px / 22.0;
  const double half = 0.34 * bar_px * unit;
  const bool shared = bar.other && bar.value * *bar.other > 0.0;
  draw_body(canvas, a, bar.value, {shared ? y : y - half, y + half}, bar.colour);
  if (bar.other)
    draw_body(canvas, a, *bar.other, {y - half, shared ? y : y + half}, bar.colour + 1);
  if (!bar.u || !std::isfinite(bar.value)) return;
  const double low = at(a, bar.value - *bar.u, 0.0).x(), high = at(a, bar.value + *bar.u, 0.0).x();
  canvas.line({{low, y}, {high, y}}, colours::ink, 2.0 * unit);
  for (const double x : {low, high})
    canvas.line({{x, y - 0.5 * half}, {x, y + 0.5 * half}}, colours::ink, 2.0 * unit);
}

constexpr int running_sum_colour = 1;

void draw_running_sum(Canvas& canvas, const Axes& a, const std::vector<Bar>& bars, double row_px,
                      double unit) {
  std::vector<Vector2d> points;
  const std::vector<double> sums = running_sums(bars);
  for (std::size_t i = 0; i < sums.size(); ++i)
    points.emplace_back(at(a, sums[i], 0.0).x(),
                        a.box.y + a.box.height - (double(i) + 0.5) * row_px);
  stroke(canvas, points, running_sum_colour, 3.0 * unit);
  for (const Vector2d& p : points) draw_mark(canvas, p, running_sum_colour, 11.0 * unit);
}

bool has_legend(const BarsOptions& options) {
  return !options.legend.empty() || !options.running_sum.empty();
}

void draw_legend(Canvas& canvas, const BarsOptions& options, Vector2d left, const TextStyle& body) {
  for (std::size_t i = 0; i < options.legend.size(); ++i) {
    const Colour c = series_colour(int(i));
    const auto paled = [](double part) { return 1.0 - bar_opacity * (1.0 - part); };
    left.x() += swatch(canvas, left, {paled(c.r), paled(c.g), paled(c.b)}, options.legend[i], body);
    left.x() += 1.8 * body.size_px;
  }
  if (!options.running_sum.empty())
    draw_legend_row(canvas, left, {{options.running_sum, running_sum_colour, true, true}}, body);
}

double widest(const std::vector<Bar>& bars, const TextStyle& style, bool values) {
  double most = 0.0;
  for (const Bar& bar : bars)
    most = std::max(most, text_size(values ? shown_value(bar) : bar.label, style).x());
  return most;
}

void draw_scale(Canvas& canvas, const Axes& a, const BarsOptions& options, const TextStyle& body) {
  const double unit = body.size_px / 22.0;
  TextStyle tick = body;
  tick.across = 0.5;
  tick.upward = 1.0;
  const Ticks ticks = round_ticks(a.x.lower, a.x.upper, 7);
  for (const double value : ticks.values) {
    const double x = at(a, value, 0.0).x();
    const bool zero = std::abs(value) < 1e-9 * (a.x.upper - a.x.lower);
    canvas.line({{x, a.box.y}, {x, a.box.y + a.box.height}},
                zero ? colours::faint_ink : colours::rule, (zero ? 2.0 : 1.5) * unit);
    canvas.text({x, a.box.y - 0.3 * body.size_px}, fixed(value, ticks.decimals), tick);
  }
  canvas.text({a.box.x + 0.5 * a.box.width, a.box.y - 1.8 * body.size_px}, options.x_label, tick);
}

void draw_reference(Canvas& canvas, const Axes& a, const BarsOptions& options,
                    const TextStyle& body) {
  if (!options.reference) return;
  const Colour green{0.2, 0.45, 0.2};
  const double x = at(a, *options.reference, 0.0).x(), top = a.box.y + a.box.height;
  canvas.line({{x, a.box.y}, {x, top}}, green, 3.0 * body.size_px / 22.0);
  TextStyle style = body;
  style.colour = green;
  style.across = x > a.box.x + 0.5 * a.box.width ? 1.0 : 0.0;
  canvas.text({x, top + 0.1 * body.size_px}, options.reference_label, style);
}

}  // namespace

void write_bars(const std::filesystem::path& path, const std::vector<Bar>& bars,
                const BarsOptions& options) {
  if (bars.empty() || bars.size() > most_bars)
    throw std::invalid_argument("bars: expected 1 to 400 bars");
  const double unit = options.width / 1600.0;
  const double legend = has_legend(options) ? legend_px * unit : 0.0;
  const double above = (options.reference ? 32.0 * unit : 8.0 * unit) + legend, below = 80.0 * unit;
  const double margins = page_margins(options.width, options.title, options.caption, unit);
  const int height =
      int(std::lround(double(bars.size()) * bar_px * unit + above + below + margins));
  const Page p = page(options.width, std::max(height, 64), options.title, options.caption, unit);
  const double em = p.body.size_px;
  const double names = std::min(widest(bars, p.body, false), 0.4 * p.width);
  const double values = widest(bars, p.body, true);
  const double left = p.inner.x + names + 1.5 * em;
  const Axes a{{left, p.inner.y + below, p.inner.x + p.inner.width - left - values - 2.0 * em,
                double(bars.size()) * bar_px * unit},
               reach(bars, options),
               {}};
  Canvas canvas(p.width, p.height);
  draw_scale(canvas, a, options, p.body);
  for (std::size_t i = 0; i < bars.size(); ++i) {
    const double y = a.box.y + a.box.height - (double(i) + 0.5) * bar_px * unit;
    draw_bar(canvas, a, bars[i], y, p.body);
    TextStyle label = p.body;
    label.upward = 0.5;
    canvas.text({a.box.x + a.box.width + em, y}, shown_value(bars[i]), label);
    label.across = 1.0;
    canvas.text({left - 0.7 * em, y}, wrapped(bars[i].label, label, names + 1.0, 1).front(), label);
  }
  if (!options.running_sum.empty()) draw_running_sum(canvas, a, bars, bar_px * unit, unit);
  draw_reference(canvas, a, options, p.body);
  draw_legend(canvas, options, {p.inner.x + 0.5 * em, p.inner.y + p.inner.height - 0.5 * legend},
              p.body);
  draw_page(canvas, p);
  canvas.write_png(path);
}

}  // namespace abbe::render
