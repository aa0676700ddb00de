#include "render/colour_bar.h"

#include <algorithm>
#include <cmath>

#include "render/figures.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

/// Draws a histogram whose bars extend to the left of `box`; the longest has the length `width`.
void draw_histogram(Canvas& canvas, const Rectangle& box, const std::vector<double>& heights,
                    double width) {
  if (heights.empty() || !(width > 0.0)) return;
  const double max_height = *std::max_element(heights.begin(), heights.end());
  if (!(max_height > 0.0)) return;
  const double bin_height = box.height / double(heights.size()), right = box.x - 5.0;
  for (std::size_t i = 0; i < heights.size(); ++i) {
    const double length = std::round(width * heights[i] / max_height);
    const double low = std::round(box.y + double(i) * bin_height);
    const double high = std::round(box.y + double(i + 1) * bin_height);
    if (length >= 1.0) canvas.fill({right - length, low, length, high - low}, {0.62, 0.64, 0.67});
  }
  canvas.line({{right + 1.0, box.y}, {right + 1.0, box.y + box.height}}, colours::faint_ink, 1.0);
}

/// Returns the colour at a fraction of the scale, 0 .. 1.
const Colour& scale_colour(const ColourScale& scale, double fraction) {
  const auto last_index = double(scale.colours.size() - 1);
  return scale.colours[std::size_t(std::lround(std::clamp(fraction, 0.0, 1.0) * last_index))];
}

}  // namespace

std::vector<double> histogram_fractions(const Eigen::VectorXd& values,
                                        const Eigen::VectorXd& weights, const Span& ends,
                                        int bins) {
  std::vector<double> sums(std::size_t(std::max(bins, 1)), 0.0);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double fraction = (values[i] - ends.lower) / (ends.upper - ends.lower);
    // The upper end belongs to the last bin.
    if (!(fraction >= 0.0 && fraction <= 1.0)) continue;
    const auto bin = std::min(std::size_t(fraction * double(sums.size())), sums.size() - 1);
    sums[bin] += weights.size() == values.size() ? weights[i] : 1.0;
  }
  return sums;
}

void draw_colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                     const TextStyle& style) {
  const double bottom = std::round(box.y);
  const double rows = std::round(box.height);
  // Every row of pixels has one colour, so that the bar has the exact colours of the map.
  for (double i = 0.0; i < rows; ++i)
    canvas.fill({box.x, bottom + i, box.width, 1.0}, scale_colour(bar.scale, i / (rows - 1.0)));
  const double top = bottom + rows;
  const double middle = box.x + 0.5 * box.width;
  const double arrow = 0.8 * box.width;
  if (bar.high_end)
    canvas.fill({{box.x, top}, {box.x + box.width, top}, {middle, top + arrow}}, bar.scale.above);
  if (bar.low_end)
    canvas.fill({{box.x, bottom}, {middle, bottom - arrow}, {box.x + box.width, bottom}},
                bar.scale.below);
  draw_histogram(canvas, {box.x, bottom, box.width, rows}, bar.histogram, bar.histogram_px);
  const LengthUnit unit = length_unit(std::max(std::abs(bar.scale.low), std::abs(bar.scale.high)));
  const double low = bar.scale.low * unit.per_um, high = bar.scale.high * unit.per_um;
  TextStyle label = style;
  label.horizontal_anchor = 0.0;
  label.vertical_anchor = 0.5;
  const Ticks ticks = round_ticks(low, high, 11);
  const double right = box.x + box.width;
  for (const double value : ticks.values) {
    const double y = bottom + rows * (value - low) / (high - low);
    canvas.line({{right, y}, {right + 0.35 * style.size_px, y}}, style.colour, 2.0);
    canvas.text({right + 0.65 * style.size_px, y}, signed_fixed(value, ticks.decimals), label);
  }
  for (const double mark : bar.marks) {
    const double y = bottom + rows * (mark * unit.per_um - low) / (high - low);
    // By rounding, a mark at the end of the bar may be half a pixel beyond it.
    if (y < bottom - 0.5 || y > top + 0.5) continue;
    // A white line behind makes the mark visible on every colour.
    canvas.line({{box.x - 4.0, y}, {right + 4.0, y}}, colours::white, 6.0);
    canvas.line({{box.x - 4.0, y}, {right + 4.0, y}}, {0.1, 0.4, 0.15}, 3.0);
  }
  TextStyle head = style;
  head.bold = true;
  canvas.text({box.x, top + arrow + 0.5 * style.size_px}, unit.name, head);
}

void draw_tolerance_bar(Canvas& canvas, const Rectangle& box, const ToleranceBar& bar,
                        const TextStyle& style) {
  // The middle half of the bar is the tolerance, with a quarter above and a quarter below it.
  const double quarter = std::round(0.25 * box.height), bottom = std::round(box.y);
  const double right = box.x + box.width, label_x = right + 0.65 * style.size_px;
  TextStyle head = style, figure_style = style;
  head.bold = true;
  figure_style.vertical_anchor = 1.0;
  struct Band {
    const char* name;
    Colour colour;
    double low, height, percent;
  };
  for (const Band& band : {Band{"under", colours::under, 0.0, quarter, bar.under},
                           Band{"in", colours::in, quarter, 2.0 * quarter, bar.in},
                           Band{"over", colours::over, 3.0 * quarter, quarter, bar.over}}) {
    canvas.fill({box.x, bottom + band.low, box.width, band.height}, band.colour);
    const double y = bottom + band.low + 0.5 * band.height;
    canvas.text({label_x, y + 2.0}, band.name, head);
    canvas.text({label_x, y - 2.0}, percent_text(band.percent), figure_style);
  }
  draw_histogram(canvas, {box.x, bottom, box.width, 4.0 * quarter}, bar.histogram,
                 bar.histogram_px);
  TextStyle label = style;
  label.vertical_anchor = 0.5;
  for (const int upper : {0, 1}) {
    const double y = bottom + (upper ? 3.0 : 1.0) * quarter;
    canvas.line({{box.x, y}, {right + 0.35 * style.size_px, y}}, style.colour, 2.0);
    // Without common limits there are no numbers to state.
    if (!bar.limits_um) continue;
    const LengthUnit unit =
        length_unit(std::max(std::abs(bar.limits_um->lower), std::abs(bar.limits_um->upper)));
    const double value = (upper ? bar.limits_um->upper : bar.limits_um->lower) * unit.per_um;
    canvas.text({label_x, y}, signed_figure(value) + " " + unit.name, label);
  }
  canvas.text({box.x, bottom + 4.0 * quarter + 0.5 * style.size_px}, "tolerance", head);
}

void draw_horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                                const TextStyle& style) {
  const LengthUnit unit = length_unit(std::max(std::abs(bar.scale.low), std::abs(bar.scale.high)));
  const int digits =
      std::max(0, significant_decimals((bar.scale.high - bar.scale.low) * unit.per_um) - 1);
  const auto end_text = [&](double um) {
    return um == 0.0 ? std::string("0") : signed_fixed(um * unit.per_um, digits);
  };
  const std::string low_text = end_text(bar.scale.low);
  const std::string high_text = end_text(bar.scale.high) + " " + unit.name;
  TextStyle label = style;
  label.horizontal_anchor = 0.0;
  label.vertical_anchor = 0.5;
  const double gap = 0.9 * style.size_px, y = box.y + 0.5 * box.height;
  const double left = std::round(box.x + text_size(low_text, label).x() + gap);
  // The bar takes the width that the labels at both ends leave.
  const int steps =
      std::max(1, int(box.x + box.width - text_size(high_text, label).x() - gap - left));
  canvas.text({box.x, y}, low_text, label);
  canvas.text({left + steps + gap, y}, high_text, label);
  const double half = 0.36 * style.size_px, arrow = 0.6 * style.size_px, right = left + steps;
  for (int i = 0; i < steps; ++i)
    canvas.fill({left + i, y - half, 1.0, 2.0 * half},
                scale_colour(bar.scale, steps > 1 ? i / (steps - 1.0) : 0.5));
  if (bar.high_end)
    canvas.fill({{right, y - half}, {right + arrow, y}, {right, y + half}}, bar.scale.above);
  if (bar.low_end)
    canvas.fill({{left, y - half}, {left, y + half}, {left - arrow, y}}, bar.scale.below);
}

void draw_horizontal_colour_bar(Canvas& canvas, const Rectangle& box, const HorizontalBar& bar,
                                const TextStyle& style) {
  // Ranges have two significant digits.
  const int digits = std::max(0, significant_decimals(bar.range) - 1);
  const std::string low_text = bar.one_sided ? "0" : fixed(-bar.range, digits);
  std::string high_text =
      bar.one_sided ? fixed(bar.range, digits) : signed_fixed(bar.range, digits);
  if (!bar.unit.empty()) high_text += " " + bar.unit;
  TextStyle label = style;
  label.horizontal_anchor = 0.0;
  label.vertical_anchor = 0.5;
  const double gap = 0.9 * style.size_px, y = box.y + 0.5 * box.height;
  const double left = std::round(box.x + text_size(low_text, label).x() + gap);
  const double width = box.x + box.width - text_size(high_text, label).x() - gap - left;
  const int steps = std::max(1, int(width));
  canvas.text({box.x, y}, low_text, label);
  canvas.text({left + steps + gap, y}, high_text, label);
  // A one-sided bar is the upper half of the diverging scale.
  const std::vector<Colour> scale = diverging(bar.one_sided ? 2 * steps : steps);
  const double half = 0.36 * style.size_px, arrow = 0.6 * style.size_px, right = left + steps;
  for (int i = 0; i < steps; ++i)
    canvas.fill({left + i, y - half, 1.0, 2.0 * half},
                scale[std::size_t(bar.one_sided ? steps + i : i)]);
  if (bar.high_end)
    canvas.fill({{right, y - half}, {right + arrow, y}, {right, y + half}}, colours::beyond_high);
  if (bar.low_end)
    canvas.fill({{left, y - half}, {left, y + half}, {left - arrow, y}}, colours::beyond_low);
}

}  // namespace abbe::render
