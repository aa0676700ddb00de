#include "render/colour_bar.h"

#include <algorithm>
#include <cmath>

#include "render/figures.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

/// Draws a histogram of bars that extend to the left, the longest of length `width`.
void draw_shares(Canvas& canvas, const Rectangle& box, const std::vector<double>& shares,
                 double width) {
  if (shares.empty() || !(width > 0.0)) return;
  const double largest = *std::max_element(shares.begin(), shares.end());
  if (!(largest > 0.0)) return;
  const double rows = box.height / double(shares.size()), right = box.x - 5.0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double length = std::round(width * shares[i] / largest);
    const double low = std::round(box.y + double(i) * rows);
    const double high = std::round(box.y + double(i + 1) * rows);
    if (length >= 1.0) canvas.fill({right - length, low, length, high - low}, {0.62, 0.64, 0.67});
  }
  canvas.line({{right + 1.0, box.y}, {right + 1.0, box.y + box.height}}, colours::faint_ink, 1.0);
}

const Colour& colour_at(const ColourScale& scale, double part) {
  const auto last = double(scale.colours.size() - 1);
  return scale.colours[std::size_t(std::lround(std::clamp(part, 0.0, 1.0) * last))];
}

}  // namespace

std::vector<double> histogram_fractions(const Eigen::VectorXd& values,
                                        const Eigen::VectorXd& weights, const Span& ends,
                                        int bins) {
  std::vector<double> shares(std::size_t(std::max(bins, 1)), 0.0);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double part = (values[i] - ends.lower) / (ends.upper - ends.lower);
    // The upper end belongs to the last bin.
    if (!(part >= 0.0 && part <= 1.0)) continue;
    const auto bin = std::min(std::size_t(part * double(shares.size())), shares.size() - 1);
    shares[bin] += weights.size() == values.size() ? weights[i] : 1.0;
  }
  return shares;
}

void colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                const TextStyle& style) {
  const double bottom = std::round(box.y);
  const double rows = std::round(box.height);
  // One row of pixels per step, so that the bar has the exact colours of the map.
  for (double i = 0.0; i < rows; ++i)
    canvas.fill({box.x, bottom + i, box.width, 1.0}, colour_at(bar.scale, i / (rows - 1.0)));
  const double top = bottom + rows;
  const double middle = box.x + 0.5 * box.width;
  const double arrow = 0.8 * box.width;
  if (bar.high_end)
    canvas.fill({{box.x, top}, {box.x + box.width, top}, {middle, top + arrow}}, bar.scale.above);
  if (bar.low_end)
    canvas.fill({{box.x, bottom}, {middle, bottom - arrow}, {box.x + box.width, bottom}},
                bar.scale.below);
  draw_shares(canvas, {box.x, bottom, box.width, rows}, bar.shares, bar.histogram_px);
  const LengthUnit unit = length_unit(std::max(std::abs(bar.scale.low), std::abs(bar.scale.high)));
  const double low = bar.scale.low * unit.per_um, high = bar.scale.high * unit.per_um;
  TextStyle label = style;
  label.across = 0.0;
  label.upward = 0.5;
  const Ticks ticks = round_ticks(low, high, 11);
  const double right = box.x + box.width;
  for (const double value : ticks.values) {
    const double y = bottom + rows * (value - low) / (high - low);
    canvas.line({{right, y}, {right + 0.35 * style.size_px, y}}, style.colour, 2.0);
    canvas.text({right + 0.65 * style.size_px, y}, signed_fixed(value, ticks.decimals), label);
  }
  for (const double mark : bar.marks) {
    const double y = bottom + rows * (mark * unit.per_um - low) / (high - low);
    // A limit that was scaled to the very end of the bar may be half a pixel beyond it.
    if (y < bottom - 0.5 || y > top + 0.5) continue;
    // A white line below makes the mark visible on any colour.
    canvas.line({{box.x - 4.0, y}, {right + 4.0, y}}, colours::white, 6.0);
    canvas.line({{box.x - 4.0, y}, {right + 4.0, y}}, {0.1, 0.4, 0.15}, 3.0);
  }
  TextStyle head = style;
  head.bold = true;
  canvas.text({box.x, top + arrow + 0.5 * style.size_px}, unit.name, head);
}

void tolerance_bar(Canvas& canvas, const Rectangle& box, const ToleranceBar& bar,
                   const TextStyle& style) {
  // Half of the bar is the tolerance, a quarter each lies above and below it.
  const double quarter = std::round(0.25 * box.height), bottom = std::round(box.y);
  const double right = box.x + box.width, beside = right + 0.65 * style.size_px;
  TextStyle head = style, figure_style = style;
  head.bold = true;
  figure_style.upward = 1.0;
  struct Part {
    const char* name;
    Colour colour;
    double low, height, percent;
  };
  for (const Part& part : {Part{"under", colours::under, 0.0, quarter, bar.under},
                           Part{"in", colours::in, quarter, 2.0 * quarter, bar.in},
                           Part{"over", colours::over, 3.0 * quarter, quarter, bar.over}}) {
    canvas.fill({box.x, bottom + part.low, box.width, part.height}, part.colour);
    const double y = bottom + part.low + 0.5 * part.height;
    canvas.text({beside, y + 2.0}, part.name, head);
    canvas.text({beside, y - 2.0}, percent_text(part.percent), figure_style);
  }
  draw_shares(canvas, {box.x, bottom, box.width, 4.0 * quarter}, bar.shares, bar.histogram_px);
  TextStyle label = style;
  label.upward = 0.5;
  for (const int upper : {0, 1}) {
    const double y = bottom + (upper ? 3.0 : 1.0) * quarter;
    canvas.line({{box.x, y}, {right + 0.35 * style.size_px, y}}, style.colour, 2.0);
    // Limits that differ between regions have no common figures.
    if (!bar.limits_um) continue;
    const LengthUnit unit =
        length_unit(std::max(std::abs(bar.limits_um->lower), std::abs(bar.limits_um->upper)));
    const double value = (upper ? bar.limits_um->upper : bar.limits_um->lower) * unit.per_um;
    canvas.text({beside, y}, signed_figure(value) + " " + unit.name, label);
  }
  canvas.text({box.x, bottom + 4.0 * quarter + 0.5 * style.size_px}, "tolerance", head);
}

void horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                           const TextStyle& style) {
  const LengthUnit unit = length_unit(std::max(std::abs(bar.scale.low), std::abs(bar.scale.high)));
  const int digits =
      std::max(0, significant_decimals((bar.scale.high - bar.scale.low) * unit.per_um) - 1);
  const auto end_text = [&](double um) {
    return um == 0.0 ? std::string("0") : signed_fixed(um * unit.per_um, digits);
  };
  const std::string low = end_text(bar.scale.low);
  const std::string high = end_text(bar.scale.high) + " " + unit.name;
  TextStyle label = style;
  label.across = 0.0;
  label.upward = 0.5;
  const double gap = 0.9 * style.size_px, y = box.y + 0.5 * box.height;
  const double first = std::round(box.x + text_size(low, label).x() + gap);
  // The labels at both ends take their room first, and the bar has what remains.
  const int steps = std::max(1, int(box.x + box.width - text_size(high, label).x() - gap - first));
  canvas.text({box.x, y}, low, label);
  canvas.text({first + steps + gap, y}, high, label);
  const double half = 0.36 * style.size_px, arrow = 0.6 * style.size_px, last = first + steps;
  for (int i = 0; i < steps; ++i)
    canvas.fill({first + i, y - half, 1.0, 2.0 * half},
                colour_at(bar.scale, steps > 1 ? i / (steps - 1.0) : 0.5));
  if (bar.high_end)
    canvas.fill({{last, y - half}, {last + arrow, y}, {last, y + half}}, bar.scale.above);
  if (bar.low_end)
    canvas.fill({{first, y - half}, {first, y + half}, {first - arrow, y}}, bar.scale.below);
}

void horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const HorizontalBar& bar,
                           const TextStyle& style) {
  // ranges have two significant digits
  const int digits = std::max(0, significant_decimals(bar.range) - 1);
  const std::string low = bar.one_sided ? "0" : fixed(-bar.range, digits);
  std::string high = bar.one_sided ? fixed(bar.range, digits) : signed_fixed(bar.range, digits);
  if (!bar.unit.empty()) high += " " + bar.unit;
  TextStyle label = style;
  label.across = 0.0;
  label.upward = 0.5;
  const double gap = 0.9 * style.size_px, y = box.y + 0.5 * box.height;
  const double first = std::round(box.x + text_size(low, label).x() + gap);
  const double room = box.x + box.width - text_size(high, label).x() - gap - first;
  const int steps = std::max(1, int(room));
  canvas.text({box.x, y}, low, label);
  canvas.text({first + steps + gap, y}, high, label);
  // A one-sided bar is the upper half of the diverging scale.
  const std::vector<Colour> scale = diverging(bar.one_sided ? 2 * steps : steps);
  const double half = 0.36 * style.size_px, arrow = 0.6 * style.size_px, last = first + steps;
  for (int i = 0; i < steps; ++i)
    canvas.fill({first + i, y - half, 1.0, 2.0 * half},
                scale[std::size_t(bar.one_sided ? steps + i : i)]);
  if (bar.high_end)
    canvas.fill({{last, y - half}, {last + arrow, y}, {last, y + half}}, colours::beyond_high);
  if (bar.low_end)
    canvas.fill({{first, y - half}, {first, y + half}, {first - arrow, y}}, colours::beyond_low);
}

}  // namespace abbe::render
