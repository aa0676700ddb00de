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
constexpr double bar_px = 38.0;  // from bar to bar, of a picture 1600 px wide

/// Ends of the axis: zero, every bar, whisker and the reference.
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
  }
  if (options.reference) take(*options.reference);
  if (!span || (span->lower == 0.0 && span->upper == 0.0)) return {0.0, 1.0};
  Span wide = padded(*span);
  if (span->lower == 0.0) wide.lower = 0.0;
  if (span->upper == 0.0) wide.upper = 0.0;
  return wide;
}

/// The value, to two digits of its uncertainty where there is one.
std::string shown_value(const Bar& bar) {
  if (!bar.u || !(*bar.u > 0.0) || !std::isfinite(bar.value)) return figure(bar.value);
  const int decimals = std::clamp(1 - int(std::floor(std::log10(*bar.u))), 0, 6);
  return fixed(bar.value, decimals) + " ± " + fixed(*bar.u, decimals);
}

void draw_bar(Canvas& canvas, const Axes& a, const Bar& bar, double y, const TextStyle& body) {
  const double unit = body.size_px / 22.0;
  if (!std::isfinite(bar.value)) return;
  const double zero = std::clamp(0.0, a.x.lower, a.x.upper);
  const double from = at(a, zero, 0.0).x(), to = at(a, bar.value, 0.0).x();
  const double half = 0.34 * bar_px * unit;
  canvas.fill({std::min(from, to), y - half, std::abs(to - from), 2.0 * half},
              series_colour(bar.colour), 0.85);
  if (!bar.u) return;
  const double low = at(a, bar.value - *bar.u, 0.0).x(), high = at(a, bar.value + *bar.u, 0.0).x();
  canvas.line({{low, y}, {high, y}}, colours::ink, 2.0 * unit);
  for (const double x : {low, high})
    canvas.line({{x, y - 0.5 * half}, {x, y + 0.5 * half}}, colours::ink, 2.0 * unit);
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
  const double above = options.reference ? 32.0 * unit : 8.0 * unit, below = 80.0 * unit;
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
  draw_reference(canvas, a, options, p.body);
  draw_page(canvas, p);
  canvas.write_png(path);
}

}  // namespace abbe::render
