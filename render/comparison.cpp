#include "render/comparison.h"

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

constexpr double side_px = 170.0;  // colour bar with labels
constexpr double gap_px = 36.0;    // between cells

/// Rows and columns, and the height of one cell's map.
struct Grid {
  int columns = 1;
  int rows = 1;
  double cell_width = 0.0;
  double map_height = 0.0;
};

/// The grid whose picture comes nearest to 4 : 3.
Grid grid(int cases, double width, double aspect, double text_height) {
  Grid best;
  double best_badness = 0.0;
  for (int columns = 1; columns <= std::min(cases, 4); ++columns) {
    Grid g;
    g.columns = columns;
    g.rows = (cases + columns - 1) / columns;
    g.cell_width = (width - (columns - 1) * gap_px) / columns;
    g.map_height = std::round(g.cell_width * std::clamp(aspect, 0.3, 1.1));
    const double height = g.rows * (g.map_height + text_height + gap_px);
    const int empty = g.rows * columns - cases;
    const double badness = std::abs(std::log(width / height * 0.7)) + 0.15 * empty;
    if (columns == 1 || badness < best_badness) {
      best = g;
      best_badness = badness;
    }
  }
  return best;
}

/// Text of a case, broken to the width of its cell.
struct CellText {
  std::vector<std::string> title;
  std::vector<std::string> below;
};

bool same_setting(const std::vector<MapPicture>& cases) {
  return std::all_of(cases.begin(), cases.end(), [&](const MapPicture& c) {
    return c.datum == cases.front().datum && c.alignment == cases.front().alignment;
  });
}

std::vector<std::string> common_text(const std::vector<MapPicture>& cases,
                                     const std::vector<Tally>& counts,
                                     const ComparisonOptions& options, double range) {
  std::vector<std::string> lines{std::string("one scale for all maps: ") + sign_convention};
  const View view = fitted_view({}, options.from, options.up, {});
  const Tally& first = counts.front();
  std::string line = same_setting(cases) ? fmt::format("datum {}  ·  alignment {}  ·  ",
                                                       cases.front().datum, cases.front().alignment)
                                         : std::string();
  line += fmt::format("view {}  ·  {} vertices", view_name(view), grouped(first.vertices()));
  lines.push_back(line);
  const bool beyond =
      std::any_of(counts.begin(), counts.end(), [](const Tally& t) { return t.beyond > 0; });
  if (beyond) {
    const LengthUnit unit = unit_for(range);
    lines.push_back(
        fmt::format("arrow colours: beyond ±{} {}", figure(range * unit.per_um), unit.name));
  }
  lines.insert(lines.end(), options.caption.begin(), options.caption.end());
  return lines;
}

CellText cell_text(const MapPicture& c, const Tally& counts, bool with_setting, double width,
                   const TextStyle& title, const TextStyle& body) {
  CellText text;
  text.title = wrapped(c.title, title, width, 2);
  std::vector<std::string> lines{figures_text(c.figures, Mean::LeftOut)};
  lines.insert(lines.end(), c.caption.begin(), c.caption.end());
  if (with_setting) lines.push_back(fmt::format("datum {}, alignment {}", c.datum, c.alignment));
  for (std::string& line : left_out_text(counts)) lines.push_back(std::move(line));
  for (const std::string& line : lines) {
    for (const std::string& part : wrapped(line, body, width, 2)) text.below.push_back(part);
  }
  return text;
}

/// Everything of a comparison that is settled before it is drawn.
struct Plan {
  double range = 1.0;
  std::vector<Tally> counts;
  Grid cells;
  std::vector<CellText> text;
  std::size_t title_lines = 1;
  double text_height = 0.0;  ///< px of one cell, without its map
};

const TextStyle head_style{.size_px = 36.0, .bold = true};
const TextStyle title_style{.size_px = 23.0, .bold = true};
const TextStyle body_style{.size_px = 21.0};
constexpr double margin_px = 36.0;

Plan plan(const std::vector<MapPicture>& cases, const ComparisonOptions& options) {
  Plan p;
  p.range = 0.0;
  for (const MapPicture& c : cases) {
    p.range = std::max(p.range, options.range_um.value_or(fitted_range_um(c.field)));
  }
  if (!(p.range > 0.0) || !std::isfinite(p.range)) {
    throw std::invalid_argument("comparison: the range must be positive");
  }
  for (const MapPicture& c : cases) p.counts.push_back(tally(c.field, p.range));

  const double width = options.width - 2.0 * margin_px - side_px;
  double shape = 0.0;
  for (const MapPicture& c : cases)
    shape = std::max(shape, aspect(c.field.design.vertices, options.from, options.up));
  const bool with_setting = !same_setting(cases);
  p.cells = grid(static_cast<int>(cases.size()), width, shape, 4.0 * line_height(body_style));
  std::size_t below = 0;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    p.text.push_back(cell_text(cases[i], p.counts[i], with_setting, p.cells.cell_width, title_style,
                               body_style));
    p.title_lines = std::max(p.title_lines, p.text.back().title.size());
    below = std::max(below, p.text.back().below.size());
  }
  p.text_height = static_cast<double>(p.title_lines) * line_height(title_style) +
                  static_cast<double>(below) * line_height(body_style) + 18.0;
  return p;
}

/// Draws case `i` into its cell; `top` is the upper edge of the first row.
View draw_cell(Canvas& canvas, const Plan& p, std::size_t i, const MapPicture& c,
               const ComparisonOptions& options, double top) {
  const int column = static_cast<int>(i) % p.cells.columns;
  const int row = static_cast<int>(i) / p.cells.columns;
  const double x = margin_px + column * (p.cells.cell_width + gap_px);
  const double y = top - row * (p.text_height + p.cells.map_height + gap_px);
  const double titles = static_cast<double>(p.title_lines) * line_height(title_style);
  const Rectangle box{x, y - titles - 8.0 - p.cells.map_height, p.cells.cell_width,
                      p.cells.map_height};
  const View view = fitted_view(c.field.design.vertices, options.from, options.up, box);
  const SurfaceScene scene = surface_scene(c.field, p.range);
  canvas.scene(view, scene.solids, scene.wires);
  const double own = static_cast<double>(p.text[i].title.size()) * line_height(title_style);
  paragraph(canvas, {x, y - titles + own}, p.text[i].title, title_style);
  paragraph(canvas, {x, box.y - 10.0}, p.text[i].below, body_style);
  return view;
}

}  // namespace

void write_comparison(const std::filesystem::path& path, const std::vector<MapPicture>& cases,
                      const ComparisonOptions& options) {
  if (cases.empty()) throw std::invalid_argument("comparison: at least one case is needed");
  for (const MapPicture& c : cases) check(c.field);
  const Plan p = plan(cases, options);

  const double text_width = options.width - 2.0 * margin_px;
  std::vector<std::string> lines;
  for (const std::string& text : common_text(cases, p.counts, options, p.range)) {
    for (const std::string& line : wrapped(text, body_style, text_width)) lines.push_back(line);
  }
  const double foot =
      static_cast<double>(lines.size()) * line_height(body_style) + 56.0 + margin_px;
  const double head = line_height(head_style) + margin_px;
  const double cells = p.cells.rows * (p.text_height + p.cells.map_height + gap_px);
  const int height = static_cast<int>(std::ceil(std::max(head + cells, 640.0) + foot));

  Canvas canvas(options.width, height);
  paragraph(canvas, {margin_px, height - 0.7 * margin_px},
            wrapped(options.title, head_style, text_width, 1), head_style);
  const double top = height - head;
  View view;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    view = draw_cell(canvas, p, i, cases[i], options, top);
  }
  ColourBar bar{p.range, false, false};
  for (const Tally& t : p.counts) {
    bar.low_end = bar.low_end || t.lowest_um < -p.range;
    bar.high_end = bar.high_end || t.highest_um > p.range;
  }
  const double bar_x = options.width - margin_px - side_px + 40.0;
  const double bar_height = std::min(620.0, top - foot - 270.0);
  colour_bar(canvas, {bar_x, top - 80.0 - bar_height, 38.0, bar_height}, bar, body_style);
  triad(canvas, view, {bar_x + 45.0, foot + 60.0}, 44.0, body_style);
  scale_bar(canvas, view, {margin_px, foot - 26.0}, 0.4 * p.cells.cell_width, body_style);
  paragraph(canvas, {margin_px, foot - 56.0}, lines, body_style);
  canvas.write_png(path);
}

}  // namespace abbe::render
