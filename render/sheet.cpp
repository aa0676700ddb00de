#include "render/sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

#include <fmt/format.h>

#include "render/canvas.h"
#include "render/colour_bar.h"
#include "render/label.h"
#include "render/map.h"
#include "render/map_text.h"
#include "render/page.h"
#include "render/surface_scene.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

constexpr Eigen::Index most_drawn = 3000000;  // vertices of all maps, each about 350 bytes

/// Some vertices of a design, and the triangles that are left between them.
struct Drawn {
  cutting::Design design;
  std::vector<Eigen::Index> vertices;  ///< of the whole design, one for each
};

/// One vertex, the first, of every cell of a grid.
Drawn one_of_each_cell(const cutting::Design& whole, double cell_mm) {
  Drawn d;
  std::map<std::array<long long, 3>, int> cells;
  std::vector<int> stand_in;
  for (Eigen::Index i = 0; i < whole.vertices.rows(); ++i) {
    std::array<long long, 3> cell{};
    for (int k = 0; k < 3; ++k) cell[k] = std::llround(whole.vertices(i, k) / cell_mm);
    const auto [place, is_new] = cells.emplace(cell, int(d.vertices.size()));
    if (is_new) d.vertices.push_back(i);
    stand_in.push_back(place->second);
  }
  std::vector<int> corners;
  for (const auto& t : whole.triangles.rowwise()) {
    const std::array<int, 3> now{stand_in[t[0]], stand_in[t[1]], stand_in[t[2]]};
    if (now[0] != now[1] && now[1] != now[2] && now[2] != now[0])
      corners.insert(corners.end(), now.begin(), now.end());
  }
  d.design.vertices = whole.vertices(d.vertices, Eigen::all);
  if (whole.normals.rows() == whole.vertices.rows())
    d.design.normals = whole.normals(d.vertices, Eigen::all);
  d.design.triangles = Eigen::Map<const cutting::Triangles>(
      corners.data(), static_cast<Eigen::Index>(corners.size() / 3), 3);
  if (whole.judged.size() == std::size_t(whole.vertices.rows()))
    for (const Eigen::Index i : d.vertices) d.design.judged.push_back(whole.judged[std::size_t(i)]);
  return d;
}

Drawn drawn(const cutting::Design& whole, std::size_t maps) {
  const Eigen::Index n = whole.vertices.rows(), most = most_drawn / Eigen::Index(maps);
  Drawn d{whole, {}};
  for (Eigen::Index i = 0; i < n; ++i) d.vertices.push_back(i);
  if (n <= most) return d;
  const Eigen::Vector3d size =
      whole.vertices.colwise().maxCoeff() - whole.vertices.colwise().minCoeff();
  for (double cell = std::max(size.norm(), 1e-6) / std::sqrt(double(n));
       Eigen::Index(d.vertices.size()) > most; cell *= 1.2)
    d = one_of_each_cell(whole, cell);
  return d;
}

/// The scale of a map.
struct MapScale {
  Span ends_um;
  Tally counts;
};

Field field_of(const cutting::Design& design, const SheetMap& map) {
  Field f;
  f.design = design;
  f.deviation_um = map.values_um;
  const bool all_judged = design.judged.size() != std::size_t(design.vertices.rows());
  for (Eigen::Index i = 0; i < map.values_um.size(); ++i) {
    const bool judged = all_judged || design.judged[std::size_t(i)] != 0;
    f.status.push_back(!judged ? 2 : (std::isfinite(map.values_um[i]) ? 0 : 1));
  }
  check(f);
  return f;
}

Span ends_of_all(const std::vector<MapScale>& maps) {
  std::vector<Span> ends;
  for (const MapScale& map : maps) ends.push_back(map.ends_um);
  return common_ends(ends);
}

std::vector<MapScale> scales(const cutting::Design& design, const std::vector<SheetMap>& maps,
                             bool one_range) {
  std::vector<MapScale> all;
  for (const SheetMap& map : maps) {
    if (map.range_um && (!(*map.range_um > 0.0) || !std::isfinite(*map.range_um)))
      throw std::invalid_argument("sheet: a range must be positive");
    const Field field = field_of(design, map);
    all.push_back({map.range_um ? Span{-*map.range_um, *map.range_um} : fitted_ends_um(field), {}});
  }
  const Span common = ends_of_all(all);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (one_range) all[i].ends_um = common;
    all[i].counts = tally(field_of(design, maps[i]), all[i].ends_um);
  }
  return all;
}

/// Rows and columns, and the sizes of a cell.
struct Layout {
  int columns = 1;
  int rows = 1;
  double width = 0.0;
  double map_height = 0.0;
  double height = 0.0;
  TextStyle title;
  TextStyle body;
  std::size_t title_lines = 1;
};

Layout laid_out(int columns, const std::vector<SheetMap>& maps, double width, double shape) {
  Layout l;
  l.columns = columns;
  l.rows = (int(maps.size()) + columns - 1) / columns;
  l.width = width / columns;
  const double em = std::clamp(l.width / 17.0, 11.0 * width / 2400.0, 24.0 * width / 2400.0);
  l.title = {.size_px = em, .bold = true};
  l.body = {.size_px = 0.92 * em};
  l.map_height = std::round((l.width - 1.2 * em) * std::clamp(shape, 0.25, 1.2));
  for (const SheetMap& map : maps)
    l.title_lines =
        std::max(l.title_lines, wrapped(map.title, l.title, l.width - 1.2 * em, 2).size());
  l.height = l.map_height + double(l.title_lines) * line_height(l.title) +
             2.0 * line_height(l.body) + 2.2 * em;
  return l;
}

Layout layout(const std::vector<SheetMap>& maps, const SheetOptions& options, double width,
              double shape) {
  const int most = int(maps.size());
  if (options.columns > 0) return laid_out(std::min(options.columns, most), maps, width, shape);
  int best = 1;
  double least = 0.0;
  for (int columns = 1; columns <= std::min(most, 16); ++columns) {
    // about what laid_out() gives, without measuring every title
    const int rows = (most + columns - 1) / columns;
    const double height = rows * (width / columns) * (std::clamp(shape, 0.25, 1.2) + 0.35);
    const double badness =
        std::abs(std::log(width / height * 0.75)) + 0.3 * (rows * columns - most) / most;
    if (columns > 1 && badness >= least) continue;
    best = columns;
    least = badness;
  }
  return laid_out(best, maps, width, shape);
}

/// What is drawn in one cell.
struct Cell {
  const Field& field;
  const SheetMap& map;
  const MapScale& scale;
  Vector2d corner;  ///< the lower left one
};

View draw_cell(Canvas& canvas, const Layout& l, const Cell& cell, const SheetOptions& options) {
  const double em = l.title.size_px, width = l.width - 1.2 * em;
  const Vector2d top_left = cell.corner + Vector2d(0.6 * em, l.height - 0.3 * em);
  const std::vector<std::string> title = wrapped(cell.map.title, l.title, width, 2);
  double y = top_left.y() - double(l.title_lines - title.size()) * line_height(l.title);
  y -= paragraph(canvas, {top_left.x(), y}, title, l.title);
  TextStyle faint = l.body;
  faint.colour = colours::faint_ink;
  paragraph(canvas, {top_left.x(), y}, wrapped(cell.map.figures, faint, width, 1), faint);
  const Rectangle box{std::round(top_left.x()),
                      std::round(y - line_height(l.body) - 0.3 * em - l.map_height), width,
                      l.map_height};
  const View view = fitted_view(cell.field.design.vertices, options.from, options.up, box);
  const MapScale& s = cell.scale;
  const ColourScale colours = colour_scale(s.ends_um.lower, s.ends_um.upper);
  const SurfaceScene scene =
      surface_scene(cell.field, cell.field.deviation_um, colours, view.toward);
  canvas.scene(view, scene.solids, scene.wires);
  lying_colour_bar(
      canvas, {box.x, box.y - 0.2 * em - line_height(l.body), width, line_height(l.body)},
      ColourBar{colours, s.counts.lowest_um<s.ends_um.lower, s.counts.highest_um> s.ends_um.upper},
      l.body);
  return view;
}

std::vector<std::string> common_text(const std::vector<MapScale>& maps, const SheetOptions& options,
                                     std::size_t vertices, std::size_t drawn_vertices) {
  const View view = fitted_view({}, options.from, options.up, {});
  std::vector<std::string> lines;
  std::string first = options.values.value_or(sign_convention);
  if (maps.size() > 1) {
    if (!first.empty()) first += "  ·  ";
    first += options.one_range ? "one scale for all maps" : "every map has its own scale";
  }
  if (!first.empty()) lines.push_back(first);
  lines.push_back(fmt::format("view {}  ·  {} vertices", view_name(view), grouped(vertices)));
  if (drawn_vertices < vertices)
    lines.back() += fmt::format(", drawn on {} of them", grouped(drawn_vertices));
  const bool beyond =
      std::any_of(maps.begin(), maps.end(), [](const MapScale& s) { return s.counts.beyond > 0; });
  if (beyond) lines.back() += "  ·  arrow colours: beyond the scale of the map";
  lines.insert(lines.end(), options.caption.begin(), options.caption.end());
  return lines;
}

/// Scale bar, swatches and axes below the maps.
void draw_foot(Canvas& canvas, const Page& p, double height, const View& view,
               const std::vector<MapScale>& maps) {
  const double em = p.body.size_px;
  Vector2d at(p.inner.x + 4.2 * em, p.inner.y + 0.5 * height);
  triad(canvas, view, {p.inner.x + 2.0 * em, at.y() - 0.2 * em}, 1.6 * em, p.body);
  at.x() += 1.5 * em;
  scale_bar(canvas, view, at, 0.7 * view.area.width, p.body);
  at.x() += 0.7 * view.area.width + 8.0 * em;
  const auto any = [&](std::size_t Tally::*kind) {
    return std::any_of(maps.begin(), maps.end(),
                       [&](const MapScale& s) { return s.counts.*kind > 0; });
  };
  if (any(&Tally::uncut)) at.x() += swatch(canvas, at, colours::uncut, "no value", p.body) + em;
  if (any(&Tally::outside))
    swatch(canvas, at, colours::outside, "outside the judged region", p.body);
}

}  // namespace

void write_sheet(const std::filesystem::path& path, const cutting::Design& design,
                 const std::vector<SheetMap>& maps, const SheetOptions& options) {
  if (maps.empty() || maps.size() > most_sheet_maps)
    throw std::invalid_argument("sheet: expected 1 to 256 maps");
  const std::vector<MapScale> shown = scales(design, maps, options.one_range);
  const double unit = options.width / 2400.0, foot = 110.0 * unit;
  const Drawn d = drawn(design, maps.size());
  const std::vector<std::string> caption =
      common_text(shown, options, std::size_t(design.vertices.rows()), d.vertices.size());
  const double margins = page_margins(options.width, options.title, caption, unit);
  const double width = page(options.width, 1000, options.title, caption, unit).inner.width;
  const Layout l = layout(maps, options, width, aspect(design.vertices, options.from, options.up));
  const double height = std::ceil(l.rows * l.height + foot + margins + 0.6 * l.title.size_px);
  if (!(height <= longest_side))
    throw std::invalid_argument("sheet: the picture would be higher than 16384 px");
  const Page p = page(options.width, int(height), options.title, caption, unit);

  Canvas canvas(p.width, p.height);
  View view;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const int column = int(i) % l.columns, row = int(i) / l.columns;
    const Vector2d corner(p.inner.x + column * l.width,
                          p.inner.y + foot + (l.rows - 1 - row) * l.height);
    const SheetMap map{maps[i].title, maps[i].figures, maps[i].values_um(d.vertices), {}};
    view = draw_cell(canvas, l, {field_of(d.design, map), map, shown[i], corner}, options);
  }
  draw_foot(canvas, p, foot, view, shown);
  draw_page(canvas, p);
  canvas.write_png(path);
}

}  // namespace abbe::render
