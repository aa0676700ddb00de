#include "render/map.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "render/canvas.h"
#include "render/label.h"
#include "render/layout.h"
#include "render/map_text.h"
#include "render/surface_scene.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

/// What stands where, from the lower left corner.
struct MapPage {
  double margin;
  double title_top;
  Rectangle map;
  Rectangle strip;  ///< scale bar and swatches, between map and text
  Rectangle bar;
  Vector2d triad;
};

MapPage map_page(const MapOptions& options, const TypeSizes& type, double text_height) {
  const double u = type.unit;
  MapPage p{};
  p.margin = 40.0 * u;
  p.title_top = options.height - 30.0 * u;
  const double head = 30.0 * u + 1.38 * (type.title + type.figures) + 22.0 * u;
  const double side = 190.0 * u;
  p.strip = {p.margin, p.margin * 0.7 + text_height, options.width - 2.0 * p.margin, 64.0 * u};
  const double map_bottom = p.strip.y + p.strip.height;
  p.map = {p.margin, map_bottom, options.width - 2.0 * p.margin - side,
           options.height - head - map_bottom};
  const double bar_bottom = map_bottom + 190.0 * u;
  p.bar = {options.width - p.margin - side + 40.0 * u, bar_bottom, 38.0 * u,
           p.map.y + p.map.height - 72.0 * u - bar_bottom};
  p.triad = {options.width - p.margin - 0.5 * side + 8.0 * u, map_bottom + 62.0 * u};
  return p;
}

void draw_head(Canvas& canvas, const MapPage& p, const MapPicture& picture, const TypeSizes& type,
               double width) {
  const TextStyle title{.size_px = type.title, .bold = true};
  const double used =
      paragraph(canvas, {p.margin, p.title_top}, wrapped(picture.title, title, width, 1), title);
  paragraph(canvas, {p.margin, p.title_top - used}, {figures_text(picture.figures)},
            {.size_px = type.figures});
}

void draw_strip(Canvas& canvas, const MapPage& p, const View& view, const Tally& counts,
                const TextStyle& body) {
  const double y = p.strip.y + 0.5 * p.strip.height;
  scale_bar(canvas, view, {p.strip.x, y}, 0.22 * p.map.width, body);
  double x = p.strip.x + 0.42 * p.map.width;
  const double gap = 1.6 * body.size_px;
  if (counts.uncut > 0) x += swatch(canvas, {x, y}, colours::uncut, "uncut", body) + gap;
  if (counts.gouged > 0) x += swatch(canvas, {x, y}, colours::gouged, "gouged deeper", body) + gap;
  if (counts.outside > 0) {
    swatch(canvas, {x, y}, colours::outside, "outside the judged region", body);
  }
}

}  // namespace

double fitted_range_um(const Field& field) {
  std::vector<double> size;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    if (std::isfinite(field.deviation_um[i])) size.push_back(std::abs(field.deviation_um[i]));
  }
  constexpr double least_um = 1e-5;
  if (size.empty()) return 1.0;
  const auto rank =
      static_cast<std::ptrdiff_t>(std::ceil(0.995 * static_cast<double>(size.size()))) - 1;
  std::nth_element(size.begin(), size.begin() + rank, size.end());
  return std::max(round_up_range(size[rank]), least_um);
}

void write_map(const std::filesystem::path& path, const MapPicture& picture,
               const MapOptions& options) {
  check(picture.field);
  const double range = options.range_um.value_or(fitted_range_um(picture.field));
  if (!(range > 0.0) || !std::isfinite(range)) {
    throw std::invalid_argument("map: the range must be positive");
  }
  const Tally counts = tally(picture.field, range);
  const TypeSizes type = type_sizes(options.width, options.height);
  const TextStyle body{.size_px = type.body};
  Canvas canvas(options.width, options.height);

  const View named = fitted_view({}, options.from, options.up, {});
  std::vector<std::string> lines;
  const double width = options.width - 80.0 * type.unit;
  for (const std::string& text : map_text(picture, counts, range, view_name(named))) {
    for (const std::string& line : wrapped(text, body, width)) lines.push_back(line);
  }
  const double text_height = static_cast<double>(lines.size()) * line_height(body);
  const MapPage p = map_page(options, type, text_height);
  const View view = fitted_view(picture.field.design.vertices, options.from, options.up, p.map);
  const SurfaceScene scene = surface_scene(picture.field, range);

  canvas.scene(view, scene.solids, scene.wires);
  draw_head(canvas, p, picture, type, width);
  draw_strip(canvas, p, view, counts, body);
  colour_bar(canvas, p.bar, {range, counts.lowest_um<-range, counts.highest_um> range}, body);
  triad(canvas, view, p.triad, 46.0 * type.unit, body);
  paragraph(canvas, {p.margin, p.strip.y}, lines, body);
  canvas.write_png(path);
}

}  // namespace abbe::render
