#include "render/comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "render/canvas.h"
#include "render/colour_bar.h"
#include "render/label.h"
#include "render/layout.h"
#include "render/map_text.h"
#include "render/surface_scene.h"

namespace abbe::render {
namespace {

constexpr double gap_px = 36.0;       // between cells
constexpr double hidden_below = 0.4;  // of the common scale: a map that needs less has two panels

/// A map in the picture.
struct MapPanel {
  std::size_t of = 0;  ///< case
  bool own = false;    ///< on its own scale, behind the one on that of all
  Span ends_um;
};

/// Where panels stand, and the size of one map.
struct Grid {
  int columns = 1;
  int rows = 1;
  double cell_width = 0.0;
  double map_height = 0.0;
  std::vector<std::array<int, 2>> at;  ///< column and row of each panel
};

/// Panels one after the other, the two of a case in one row.
Grid filled(const std::vector<MapPanel>& panels, int columns) {
  Grid g;
  g.columns = columns;
  int place = 0;
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const bool first_of_two = i + 1 < panels.size() && panels[i + 1].own;
    if (first_of_two && columns > 1 && place % columns == columns - 1) ++place;
    g.at.push_back({place % columns, place / columns});
    ++place;
  }
  g.rows = g.at.back()[1] + 1;
  return g;
}

/// The grid whose picture comes nearest to 4 : 3.
Grid grid(const std::vector<MapPanel>& panels, double width, double aspect, double text_height) {
  Grid best;
  double best_badness = 0.0;
  for (int columns = 1; columns <= std::min(int(panels.size()), 4); ++columns) {
    Grid g = filled(panels, columns);
    g.cell_width = (width - (columns - 1) * gap_px) / columns;
    g.map_height = std::round(g.cell_width * std::clamp(aspect, 0.3, 1.1));
    const double height = g.rows * (g.map_height + text_height + gap_px);
    const int empty = g.rows * columns - int(panels.size());
    const double badness = std::abs(std::log(width / height * 0.7)) + 0.15 * empty;
    if (columns == 1 || badness < best_badness) {
      best = std::move(g);
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
                                     const std::vector<MapPanel>& panels,
                                     const std::vector<Tally>& counts,
                                     const ComparisonOptions& options) {
  const bool two =
      std::any_of(panels.begin(), panels.end(), [](const MapPanel& p) { return p.own; });
  std::vector<std::string> lines{std::string("one scale for all maps") +
                                 (two ? ", those that it hides again on their own  ·  " : "  ·  ") +
                                 sign_convention};
  const View view = fitted_view({}, options.from, options.up, {});
  const Tally& first = counts.front();
  std::string line = same_setting(cases) ? fmt::format("datum {}  ·  alignment {}  ·  ",
                                                       cases.front().datum, cases.front().alignment)
                                         : std::string();
  line += fmt::format("view {}  ·  {} vertices", view_name(view), grouped(first.vertices()));
  if (const auto& tolerance = cases.front().tolerance_um; tolerance.rows() > 0)
    line += "  ·  tolerance " + limits_text(tolerance);
  lines.push_back(line);
  const bool beyond =
      std::any_of(counts.begin(), counts.end(), [](const Tally& t) { return t.beyond > 0; });
  if (beyond) lines.push_back("arrow colours: beyond the scale of the map");
  lines.insert(lines.end(), options.caption.begin(), options.caption.end());
  return lines;
}

/// Room for what stands above a map and below it, px.
struct TextWidths {
  double title, below;
};

CellText cell_text(const MapPicture& c, const Tally& counts, bool with_setting, TextWidths width,
                   const TextStyle& title, const TextStyle& body) {
  CellText text;
  text.title = wrapped(c.title, title, width.title, 2);
  std::vector<std::string> lines{figures_text(c.figures, Mean::LeftOut)};
  if (c.tolerance_um.rows() > 0) lines.push_back(verdict_text(c));
  lines.insert(lines.end(), c.caption.begin(), c.caption.end());
  if (with_setting) lines.push_back(fmt::format("datum {}, alignment {}", c.datum, c.alignment));
  for (std::string& line : left_out_text(counts)) lines.push_back(std::move(line));
  for (const std::string& line : lines) {
    for (const std::string& part : wrapped(line, body, width.below, 4)) text.below.push_back(part);
  }
  return text;
}

/// Everything of a comparison that is settled before it is drawn.
struct Plan {
  std::vector<MapPanel> panels;
  std::vector<Tally> counts;  ///< of the panels
  Grid cells;
  std::vector<CellText> text;  ///< of the panels
  std::size_t title_lines = 1;
  double text_height = 0.0;  ///< px of one cell, without its map
};

const TextStyle head_style{.size_px = 36.0, .bold = true};
const TextStyle title_style{.size_px = 23.0, .bold = true};
const TextStyle body_style{.size_px = 21.0};
constexpr double margin_px = 36.0, bar_row_px = 34.0, triad_px = 44.0;

double size_of(const Span& ends) { return std::max(std::abs(ends.lower), std::abs(ends.upper)); }

std::vector<MapPanel> panels_of(const std::vector<MapPicture>& cases,
                                const ComparisonOptions& options) {
  if (options.range_um && (!(*options.range_um > 0.0) || !std::isfinite(*options.range_um)))
    throw std::invalid_argument("comparison: the range must be positive");
  std::vector<Span> own;
  for (const MapPicture& c : cases) own.push_back(fitted_ends_um(c.field));
  const Span common =
      options.range_um ? Span{-*options.range_um, *options.range_um} : common_ends(own);
  std::vector<MapPanel> panels;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    panels.push_back({i, false, common});
    const bool any = tally(cases[i].field, common).cut > 0;
    const double size = size_of(own[i]);
    if (any && size > least_range_um && size < hidden_below * size_of(common))
      panels.push_back({i, true, own[i]});
  }
  return panels;
}

/// Of a second panel only what it is; all else stands below both.
CellText text_of(const std::vector<MapPanel>& panels, std::size_t i, const MapPicture& c,
                 const Tally& counts, bool with_setting, const Grid& cells) {
  const double width = cells.cell_width;
  const bool side_by_side = cells.columns > 1;
  if (panels[i].own)
    return {wrapped(side_by_side ? "own scale" : c.title + ", own scale", title_style, width, 2),
            {}};
  const bool two = side_by_side && i + 1 < panels.size() && panels[i + 1].own;
  return cell_text(c, counts, with_setting, {width, two ? 2.0 * width + gap_px : width},
                   title_style, body_style);
}

Plan plan(const std::vector<MapPicture>& cases, const ComparisonOptions& options) {
  Plan p;
  p.panels = panels_of(cases, options);
  for (const MapPanel& panel : p.panels)
    p.counts.push_back(tally(cases[panel.of].field, panel.ends_um));
  const double width = options.width - 2.0 * margin_px;
  double shape = 0.0;
  for (const MapPicture& c : cases)
    shape = std::max(shape, aspect(c.field.design.vertices, options.from, options.up));
  const bool with_setting = !same_setting(cases);
  p.cells = grid(p.panels, width, shape, 4.0 * line_height(body_style) + bar_row_px);
  std::size_t below = 0;
  for (std::size_t i = 0; i < p.panels.size(); ++i) {
    p.text.push_back(
        text_of(p.panels, i, cases[p.panels[i].of], p.counts[i], with_setting, p.cells));
    p.title_lines = std::max(p.title_lines, p.text.back().title.size());
    below = std::max(below, p.text.back().below.size());
  }
  p.text_height = static_cast<double>(p.title_lines) * line_height(title_style) +
                  static_cast<double>(below) * line_height(body_style) + bar_row_px + 18.0;
  return p;
}

/// A panel in its cell, not drawn yet.
struct Cell {
  double x = 0.0, y = 0.0;  ///< upper left corner, px
  Rectangle box;            ///< of the map
  View view;
  ColourScale colours;
  SurfaceScene scene;
};

double titles_height(const Plan& p) {
  return static_cast<double>(p.title_lines) * line_height(title_style);
}

/// @param top  upper edge of the first row
Cell cell_of(const Plan& p, std::size_t i, const MapPicture& c, const ComparisonOptions& options,
             double top) {
  const auto [column, row] = p.cells.at[i];
  Cell cell;
  cell.x = margin_px + column * (p.cells.cell_width + gap_px);
  cell.y = top - row * (p.text_height + p.cells.map_height + gap_px);
  cell.box = {cell.x, cell.y - titles_height(p) - 8.0 - p.cells.map_height, p.cells.cell_width,
              p.cells.map_height};
  cell.view = fitted_view(c.field.design.vertices, options.from, options.up, cell.box);
  cell.colours = colour_scale(p.panels[i].ends_um.lower, p.panels[i].ends_um.upper);
  cell.scene = surface_scene(c.field, c.field.deviation_um, cell.colours, cell.view.toward);
  return cell;
}

void draw_cell(Canvas& canvas, const Plan& p, std::size_t i, const Cell& cell) {
  const auto& [x, y, box, view, colours, scene] = cell;
  const double titles = titles_height(p);
  const Span& ends = p.panels[i].ends_um;
  canvas.scene(view, scene.solids, scene.wires);
  const double own = static_cast<double>(p.text[i].title.size()) * line_height(title_style);
  paragraph(canvas, {x, y - titles + own}, p.text[i].title, title_style);
  const Tally& counts = p.counts[i];
  lying_colour_bar(
      canvas, {x, box.y - bar_row_px, std::min(p.cells.cell_width, 460.0), bar_row_px - 6.0},
      ColourBar{colours, counts.lowest_um<ends.lower, counts.highest_um> ends.upper}, body_style);
  paragraph(canvas, {x, box.y - bar_row_px - 6.0}, p.text[i].below, body_style);
}

}  // namespace

void write_comparison(const std::filesystem::path& path, const std::vector<MapPicture>& cases,
                      const ComparisonOptions& options) {
  if (cases.empty()) throw std::invalid_argument("comparison: at least one case is needed");
  for (const MapPicture& c : cases) check(c.field);
  const Plan p = plan(cases, options);

  const double text_width = options.width - 2.0 * margin_px - 4.0 * triad_px;
  std::vector<std::string> lines;
  for (const std::string& text : common_text(cases, p.panels, p.counts, options)) {
    for (const std::string& line : wrapped(text, body_style, text_width)) lines.push_back(line);
  }
  const double foot =
      std::max(static_cast<double>(lines.size()) * line_height(body_style) + 56.0 + margin_px,
               margin_px + 3.4 * triad_px);
  const std::vector<std::string> title =
      wrapped(options.title, head_style, options.width - 2.0 * margin_px, 2);
  const double head = double(title.size()) * line_height(head_style) + margin_px;
  const double cells = p.cells.rows * (p.text_height + p.cells.map_height + gap_px);
  const int height = static_cast<int>(std::ceil(head + cells + foot));

  std::vector<Cell> drawn(p.panels.size());
  tbb::parallel_for(std::size_t(0), drawn.size(), [&](std::size_t i) {
    drawn[i] = cell_of(p, i, cases[p.panels[i].of], options, height - head);
  });

  Canvas canvas(options.width, height);
  paragraph(canvas, {margin_px, height - 0.7 * margin_px}, title, head_style);
  for (std::size_t i = 0; i < drawn.size(); ++i) draw_cell(canvas, p, i, drawn[i]);
  const View& view = drawn.back().view;
  triad(canvas, view, {options.width - margin_px - 1.6 * triad_px, margin_px + 1.4 * triad_px},
        triad_px, body_style);
  scale_bar(canvas, view, {margin_px, foot - 26.0}, 0.4 * p.cells.cell_width, body_style);
  paragraph(canvas, {margin_px, foot - 56.0}, lines, body_style);
  canvas.write_png(path);
}

}  // namespace abbe::render
