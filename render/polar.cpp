#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "render/axes.h"
#include "render/canvas.h"
#include "render/label.h"
#include "render/page.h"
#include "render/plot.h"

namespace abbe::render {
namespace {

using Eigen::Index;
using Eigen::Vector2d;

constexpr double nominal_part = 0.6;  // radius of the nominal circle, of the outermost one

/// The magnified circle of a picture.
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
  d.division_um = division_um > 0.0 ? division_um : round_up_125(largest_um / 4.0);
  if (!(d.division_um > 0.0)) d.division_um = 1.0;
  d.divisions = std::clamp(int(std::ceil(largest_um / d.division_um - 1e-9)), 2, 20);
  d.nominal_px = nominal_part * radius_px;
  d.px_per_um = (radius_px - d.nominal_px) / (d.divisions * d.division_um);
  return d;
}

void draw_circle(Canvas& canvas, const Dial& d, double deviation_um, const Colour& colour,
                 double width) {
  std::vector<Vector2d> points;
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

/// Values of the circles, where no spoke is; every second or fifth where they stand close.
void draw_scale(Canvas& canvas, const Dial& d, const TextStyle& body) {
  TextStyle style = body;
  style.size_px = 0.85 * body.size_px;
  style.across = style.upward = 0.5;
  const double spacing = d.px_per_um * d.division_um;
  const int every = spacing > 1.3 * style.size_px ? 1 : (spacing > 0.7 * style.size_px ? 2 : 5);
  const int decimals = round_decimals(d.division_um);
  for (int k = -d.divisions; k <= d.divisions; ++k) {
    if (k % every != 0) continue;
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
