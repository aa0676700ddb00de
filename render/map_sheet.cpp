#include "render/map_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "render/canvas.h"
#include "render/colour_bar.h"
#include "render/figures.h"
#include "render/layout.h"
#include "render/residual_map.h"
#include "render/surface_scene.h"

namespace abbe::render {

namespace {

constexpr double gap_px = 36.0;  // between cells
// A map that needs less than this fraction of the common scale gets a second panel.
constexpr double own_scale_ratio = 0.4;
// Height of the cells of a picture of about 4 : 3, relative to its width. It is below 0.75, because
// the title and the legend add to the height.
constexpr double target_height_per_width = 0.7;
// An empty cell costs as much as a deviation of 15 % from this ratio.
constexpr double empty_cell_cost = 0.15;

/// A panel of a comparison.
struct MapPanel {
  std::size_t case_index = 0;
  bool has_own_scale = false;  ///< on its own scale, after the panel on the common scale
  Span scale_limits_um;
};

/// Arrangement of the panels, and the size of one map.
struct Grid {
  int columns = 1;
  int rows = 1;
  double cell_width = 0.0;
  double map_height = 0.0;
  std::vector<std::array<int, 2>> cell_positions;  ///< column and row of each panel
};

/// Returns a grid with the panels in order; the two panels of a case are in the same row.
Grid fill_grid(const std::vector<MapPanel>& panels, int columns) {
  Grid grid;
  grid.columns = columns;
  int cell = 0;
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const bool is_first_of_pair = i + 1 < panels.size() && panels[i + 1].has_own_scale;
    // The last cell of a row remains empty if it would separate a pair.
    if (is_first_of_pair && columns > 1 && cell % columns == columns - 1) ++cell;
    grid.cell_positions.push_back({cell % columns, cell / columns});
    ++cell;
  }
  grid.rows = grid.cell_positions.back()[1] + 1;
  return grid;
}

/// Returns the grid whose picture is nearest to 4 : 3.
Grid best_grid(const std::vector<MapPanel>& panels, double width, double aspect,
               double text_height) {
  Grid result;
  double min_layout_cost = 0.0;
  for (int columns = 1; columns <= std::min(int(panels.size()), 4); ++columns) {
    Grid grid = fill_grid(panels, columns);
    grid.cell_width = (width - (columns - 1) * gap_px) / columns;
    grid.map_height = std::round(grid.cell_width * std::clamp(aspect, 0.3, 1.1));
    const double height = grid.rows * (grid.map_height + text_height + gap_px);
    const int empty_cells = grid.rows * columns - int(panels.size());
    const double layout_cost = std::abs(std::log(width / height * target_height_per_width)) +
                               empty_cell_cost * empty_cells;
    if (columns == 1 || layout_cost < min_layout_cost) {
      result = std::move(grid);
      min_layout_cost = layout_cost;
    }
  }
  return result;
}

/// Text of a case, wrapped to the width of its cell.
struct CellText {
  std::vector<std::string> title;
  std::vector<std::string> below;
};

bool has_common_datum(const std::vector<MapPicture>& cases) {
  return std::all_of(cases.begin(), cases.end(), [&](const MapPicture& picture) {
    return picture.datum == cases.front().datum && picture.alignment == cases.front().alignment;
  });
}

std::vector<std::string> common_text(const std::vector<MapPicture>& cases,
                                     const std::vector<MapPanel>& panels,
                                     const std::vector<VertexCounts>& counts,
                                     const ComparisonOptions& options) {
  const bool has_own_scales =
      std::any_of(panels.begin(), panels.end(), [](const MapPanel& p) { return p.has_own_scale; });
  std::vector<std::string> lines{
      std::string("one scale for all maps") +
      (has_own_scales ? "; maps with small values are also shown on their own scale  ·  "
                      : "  ·  ") +
      sign_convention};
  const View view = fit_view({}, options.from, options.up, {});
  const VertexCounts& first_counts = counts.front();
  std::string line = has_common_datum(cases)
                         ? fmt::format("datum {}  ·  alignment {}  ·  ", cases.front().datum,
                                       cases.front().alignment)
                         : std::string();
  line += fmt::format("view {}  ·  {} vertices", view_description(view),
                      group_digits(first_counts.vertices()));
  if (const auto& tolerance = cases.front().tolerance_um; tolerance.rows() > 0)
    line += "  ·  tolerance " + limits_text(tolerance);
  lines.push_back(line);
  const bool exceeds_scale =
      std::any_of(counts.begin(), counts.end(),
                  [](const VertexCounts& panel_counts) { return panel_counts.beyond_scale > 0; });
  if (exceeds_scale) lines.push_back("arrow colours: beyond the scale");
  lines.insert(lines.end(), options.caption.begin(), options.caption.end());
  return lines;
}

/// Available widths for the text above and below a map, px.
struct TextWidths {
  double title, below;
};

CellText cell_text(const MapPicture& picture, const VertexCounts& counts, bool with_datum,
                   TextWidths width, const TextStyle& title, const TextStyle& body) {
  CellText text;
  text.title = wrap_text(picture.title, title, width.title, 2);
  std::vector<std::string> lines{figures_text(picture.figures, Mean::Omitted)};
  if (picture.tolerance_um.rows() > 0) lines.push_back(verdict_text(picture));
  lines.insert(lines.end(), picture.caption.begin(), picture.caption.end());
  if (with_datum)
    lines.push_back(fmt::format("datum {}, alignment {}", picture.datum, picture.alignment));
  for (std::string& line : excluded_text(counts)) lines.push_back(std::move(line));
  for (const std::string& line : lines) {
    for (const std::string& part : wrap_text(line, body, width.below, 4))
      text.below.push_back(part);
  }
  return text;
}

/// The layout of a comparison, computed before drawing.
struct Plan {
  std::vector<MapPanel> panels;
  std::vector<VertexCounts> counts;  ///< of the panels
  Grid cells;
  std::vector<CellText> text;  ///< of the panels
  std::size_t title_lines = 1;
  double text_height = 0.0;  ///< px, of one cell without its map
};

const TextStyle head_style{.size_px = 36.0, .bold = true};
const TextStyle title_style{.size_px = 23.0, .bold = true};
const TextStyle body_style{.size_px = 21.0};
constexpr double margin_px = 36.0, bar_row_px = 34.0, triad_px = 44.0;
constexpr double text_margin_px = 18.0;  // gaps around the texts of a cell

double max_magnitude(const Span& ends) {
  return std::max(std::abs(ends.lower), std::abs(ends.upper));
}

std::vector<MapPanel> make_panels(const std::vector<MapPicture>& cases,
                                  const ComparisonOptions& options) {
  if (options.range_um && (!(*options.range_um > 0.0) || !std::isfinite(*options.range_um)))
    throw std::invalid_argument("comparison: the range must be positive");
  std::vector<Span> own_ends;
  for (const MapPicture& picture : cases) own_ends.push_back(fitted_ends_um(picture.field));
  const Span common =
      options.range_um ? Span{-*options.range_um, *options.range_um} : common_ends(own_ends);
  std::vector<MapPanel> panels;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    panels.push_back({i, false, common});
    const bool has_cut_vertices = count_vertices(cases[i].field, common).cut > 0;
    const double own_range = max_magnitude(own_ends[i]);
    if (has_cut_vertices && own_range > min_range_um &&
        own_range < own_scale_ratio * max_magnitude(common))
      panels.push_back({i, true, own_ends[i]});
  }
  return panels;
}

/// Returns the text of a panel. The second panel of a case only states its scale.
CellText panel_text(const std::vector<MapPanel>& panels, std::size_t i, const MapPicture& picture,
                    const VertexCounts& counts, bool with_datum, const Grid& grid) {
  const double width = grid.cell_width;
  const bool side_by_side = grid.columns > 1;
  if (panels[i].has_own_scale)
    return {wrap_text(side_by_side ? "own scale" : picture.title + ", own scale", title_style,
                      width, 2),
            {}};
  const bool is_pair = side_by_side && i + 1 < panels.size() && panels[i + 1].has_own_scale;
  return cell_text(picture, counts, with_datum, {width, is_pair ? 2.0 * width + gap_px : width},
                   title_style, body_style);
}

Plan make_plan(const std::vector<MapPicture>& cases, const ComparisonOptions& options) {
  Plan plan;
  plan.panels = make_panels(cases, options);
  for (const MapPanel& panel : plan.panels)
    plan.counts.push_back(count_vertices(cases[panel.case_index].field, panel.scale_limits_um));
  const double width = options.width - 2.0 * margin_px;
  double max_aspect = 0.0;
  for (const MapPicture& picture : cases)
    max_aspect =
        std::max(max_aspect, aspect(picture.field.design.vertices, options.from, options.up));
  const bool with_datum = !has_common_datum(cases);
  plan.cells =
      best_grid(plan.panels, width, max_aspect, 4.0 * line_height(body_style) + bar_row_px);
  std::size_t lines_below = 0;
  for (std::size_t i = 0; i < plan.panels.size(); ++i) {
    plan.text.push_back(panel_text(plan.panels, i, cases[plan.panels[i].case_index], plan.counts[i],
                                   with_datum, plan.cells));
    plan.title_lines = std::max(plan.title_lines, plan.text.back().title.size());
    lines_below = std::max(lines_below, plan.text.back().below.size());
  }
  plan.text_height = static_cast<double>(plan.title_lines) * line_height(title_style) +
                     static_cast<double>(lines_below) * line_height(body_style) + bar_row_px +
                     text_margin_px;
  return plan;
}

/// The scene and the view of a panel, before it is drawn.
struct Cell {
  double x = 0.0, y = 0.0;  ///< upper left corner, px
  Rectangle box;            ///< of the map
  View view;
  ColourScale colours;
  SurfaceScene scene;
};

double titles_height(const Plan& plan) {
  return static_cast<double>(plan.title_lines) * line_height(title_style);
}

/// Returns the scene and the view of panel i, placed in its cell.
/// @param top  upper edge of the first row, px
Cell make_cell(const Plan& plan, std::size_t i, const MapPicture& picture,
               const ComparisonOptions& options, double top) {
  const auto [column, row] = plan.cells.cell_positions[i];
  Cell cell;
  cell.x = margin_px + column * (plan.cells.cell_width + gap_px);
  cell.y = top - row * (plan.text_height + plan.cells.map_height + gap_px);
  cell.box = {cell.x, cell.y - titles_height(plan) - 8.0 - plan.cells.map_height,
              plan.cells.cell_width, plan.cells.map_height};
  cell.view = fit_view(picture.field.design.vertices, options.from, options.up, cell.box);
  cell.colours =
      colour_scale(plan.panels[i].scale_limits_um.lower, plan.panels[i].scale_limits_um.upper);
  cell.scene =
      surface_scene(picture.field, picture.field.deviation_um, cell.colours, cell.view.toward_eye);
  return cell;
}

void draw_cell(Canvas& canvas, const Plan& plan, std::size_t i, const Cell& cell) {
  const auto& [x, y, box, view, colours, scene] = cell;
  const double titles = titles_height(plan);
  const Span& ends = plan.panels[i].scale_limits_um;
  canvas.scene(view, scene.solids, scene.wires);
  const double title = static_cast<double>(plan.text[i].title.size()) * line_height(title_style);
  draw_paragraph(canvas, {x, y - titles + title}, plan.text[i].title, title_style);
  const VertexCounts& counts = plan.counts[i];
  draw_horizontal_colour_bar(
      canvas, {x, box.y - bar_row_px, std::min(plan.cells.cell_width, 460.0), bar_row_px - 6.0},
      ColourBar{colours, (counts.lowest_um < ends.lower), (counts.highest_um > ends.upper)},
      body_style);
  draw_paragraph(canvas, {x, box.y - bar_row_px - 6.0}, plan.text[i].below, body_style);
}

}  // namespace

void write_comparison(const std::filesystem::path& path, const std::vector<MapPicture>& cases,
                      const ComparisonOptions& options) {
  if (cases.empty()) throw std::invalid_argument("comparison: expected at least one case");
  for (const MapPicture& picture : cases) check_field(picture.field);
  const Plan plan = make_plan(cases, options);

  const double text_width = options.width - 2.0 * margin_px - 4.0 * triad_px;
  std::vector<std::string> lines;
  for (const std::string& text : common_text(cases, plan.panels, plan.counts, options)) {
    for (const std::string& line : wrap_text(text, body_style, text_width)) lines.push_back(line);
  }
  const double foot =
      std::max(static_cast<double>(lines.size()) * line_height(body_style) + 56.0 + margin_px,
               margin_px + 3.4 * triad_px);
  const std::vector<std::string> title =
      wrap_text(options.title, head_style, options.width - 2.0 * margin_px, 2);
  const double head = double(title.size()) * line_height(head_style) + margin_px;
  const double cells = plan.cells.rows * (plan.text_height + plan.cells.map_height + gap_px);
  const int height = static_cast<int>(std::ceil(head + cells + foot));

  std::vector<Cell> panel_cells(plan.panels.size());
  // The scenes are built in parallel; OpenGL then draws them one after the other.
  tbb::parallel_for(std::size_t(0), panel_cells.size(), [&](std::size_t i) {
    panel_cells[i] = make_cell(plan, i, cases[plan.panels[i].case_index], options, height - head);
  });

  Canvas canvas(options.width, height);
  draw_paragraph(canvas, {margin_px, height - 0.7 * margin_px}, title, head_style);
  for (std::size_t i = 0; i < panel_cells.size(); ++i) draw_cell(canvas, plan, i, panel_cells[i]);
  const View& view = panel_cells.back().view;
  draw_triad(canvas, view, {options.width - margin_px - 1.6 * triad_px, margin_px + 1.4 * triad_px},
             triad_px, body_style);
  draw_scale_bar(canvas, view, {margin_px, foot - 26.0}, 0.4 * plan.cells.cell_width, body_style);
  draw_paragraph(canvas, {margin_px, foot - 56.0}, lines, body_style);
  canvas.write_png(path);
}

namespace {

using Eigen::Vector2d;

// Largest number of vertices of all maps together, about 350 bytes each.
constexpr Eigen::Index max_total_vertices = 3000000;

/// A design with some of its vertices.
struct DecimatedDesign {
  cutting::Design design;
  std::vector<Eigen::Index> vertices;  ///< (vertices) rows in the whole design
};

/// Returns the design with the first vertex of each cell of a grid.
/// @param cell_size  mm, length of the edges of a cell
DecimatedDesign decimate_by_cells(const cutting::Design& whole, double cell_size) {
  DecimatedDesign decimated;
  std::map<std::array<long long, 3>, int> cells;
  std::vector<int> representative;
  for (Eigen::Index i = 0; i < whole.vertices.rows(); ++i) {
    std::array<long long, 3> cell{};
    for (int k = 0; k < 3; ++k) cell[k] = std::llround(whole.vertices(i, k) / cell_size);
    const auto [entry, is_new] = cells.emplace(cell, int(decimated.vertices.size()));
    if (is_new) decimated.vertices.push_back(i);
    representative.push_back(entry->second);
  }
  std::vector<int> corners;
  for (const auto& t : whole.triangles.rowwise()) {
    const std::array<int, 3> triangle{representative[t[0]], representative[t[1]],
                                      representative[t[2]]};
    if (triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0])
      corners.insert(corners.end(), triangle.begin(), triangle.end());
  }
  decimated.design.vertices = whole.vertices(decimated.vertices, Eigen::all);
  if (whole.normals.rows() == whole.vertices.rows())
    decimated.design.normals = whole.normals(decimated.vertices, Eigen::all);
  decimated.design.triangles = Eigen::Map<const cutting::Triangles>(
      corners.data(), static_cast<Eigen::Index>(corners.size() / 3), 3);
  if (whole.judged.size() == std::size_t(whole.vertices.rows()))
    for (const Eigen::Index i : decimated.vertices)
      decimated.design.judged.push_back(whole.judged[std::size_t(i)]);
  return decimated;
}

/// Returns the design, decimated until `map_count` maps of it stay within the limit on vertices.
DecimatedDesign decimate_design(const cutting::Design& whole, std::size_t map_count) {
  const Eigen::Index n = whole.vertices.rows();
  const Eigen::Index max_vertices = max_total_vertices / Eigen::Index(map_count);
  DecimatedDesign decimated{whole, {}};
  for (Eigen::Index i = 0; i < n; ++i) decimated.vertices.push_back(i);
  if (n <= max_vertices) return decimated;
  const Eigen::Vector3d size =
      whole.vertices.colwise().maxCoeff() - whole.vertices.colwise().minCoeff();
  // Starting at about the mean distance of vertices, cells grow by a fifth until few enough
  // vertices remain.
  for (double cell_size = std::max(size.norm(), 1e-6) / std::sqrt(double(n));
       Eigen::Index(decimated.vertices.size()) > max_vertices; cell_size *= 1.2)
    decimated = decimate_by_cells(whole, cell_size);
  return decimated;
}

/// Limits of the colour scale of a map, and the number of vertices within and beyond them.
struct MapScale {
  Span scale_limits_um;
  VertexCounts counts;
};

/// Returns the field of one map: vertices outside the judged region are Outside, those without a
/// finite value Uncut.
Field make_field(const cutting::Design& design, const SheetMap& map) {
  using cutting::VertexStatus;
  Field field;
  field.design = design;
  field.deviation_um = map.values_um;
  const bool all_judged = design.judged.size() != std::size_t(design.vertices.rows());
  for (Eigen::Index i = 0; i < map.values_um.size(); ++i) {
    const bool is_judged = all_judged || design.judged[std::size_t(i)] != 0;
    const VertexStatus status = !is_judged                        ? VertexStatus::Outside
                                : std::isfinite(map.values_um[i]) ? VertexStatus::Cut
                                                                  : VertexStatus::Uncut;
    field.status.push_back(std::uint8_t(status));
  }
  check_field(field);
  return field;
}

Span widest_scale(const std::vector<MapScale>& maps) {
  std::vector<Span> ends;
  for (const MapScale& map : maps) ends.push_back(map.scale_limits_um);
  return common_ends(ends);
}

std::vector<MapScale> fit_scales(const cutting::Design& design, const std::vector<SheetMap>& maps,
                                 bool common_range) {
  std::vector<MapScale> scales;
  for (const SheetMap& map : maps) {
    if (map.range_um && (!(*map.range_um > 0.0) || !std::isfinite(*map.range_um)))
      throw std::invalid_argument("sheet: the range must be positive");
    const Field field = make_field(design, map);
    scales.push_back(
        {map.range_um ? Span{-*map.range_um, *map.range_um} : fitted_ends_um(field), {}});
  }
  const Span common = widest_scale(scales);
  for (std::size_t i = 0; i < scales.size(); ++i) {
    if (common_range) scales[i].scale_limits_um = common;
    scales[i].counts = count_vertices(make_field(design, maps[i]), scales[i].scale_limits_um);
  }
  return scales;
}

/// Rows and columns of a sheet, and the sizes of a cell, px.
struct SheetLayout {
  int columns = 1;
  int rows = 1;
  double width = 0.0;
  double map_height = 0.0;
  double height = 0.0;
  TextStyle title;
  TextStyle body;
  std::size_t title_lines = 1;
};

SheetLayout lay_out_grid(int columns, const std::vector<SheetMap>& maps, double width,
                         double shape) {
  SheetLayout layout;
  layout.columns = columns;
  layout.rows = (int(maps.size()) + columns - 1) / columns;
  layout.width = width / columns;
  const double em = std::clamp(layout.width / 17.0, 11.0 * width / 2400.0, 24.0 * width / 2400.0);
  layout.title = {.size_px = em, .bold = true};
  layout.body = {.size_px = 0.92 * em};
  layout.map_height = std::round((layout.width - 1.2 * em) * std::clamp(shape, 0.25, 1.2));
  for (const SheetMap& map : maps)
    layout.title_lines = std::max(
        layout.title_lines, wrap_text(map.title, layout.title, layout.width - 1.2 * em, 2).size());
  layout.height = layout.map_height + double(layout.title_lines) * line_height(layout.title) +
                  2.0 * line_height(layout.body) + 2.2 * em;
  return layout;
}

SheetLayout sheet_layout(const std::vector<SheetMap>& maps, const SheetOptions& options,
                         double width, double shape) {
  const int map_count = int(maps.size());
  if (options.columns > 0)
    return lay_out_grid(std::min(options.columns, map_count), maps, width, shape);
  int best_columns = 1;
  double min_cost = 0.0;
  for (int columns = 1; columns <= std::min(map_count, 16); ++columns) {
    // The height is estimated, because lay_out_grid() would measure all titles each time.
    const int rows = (map_count + columns - 1) / columns;
    const double height = rows * (width / columns) * (std::clamp(shape, 0.25, 1.2) + 0.35);
    const double cost =
        std::abs(std::log(width / height * 0.75)) + 0.3 * (rows * columns - map_count) / map_count;
    if (columns > 1 && cost >= min_cost) continue;
    best_columns = columns;
    min_cost = cost;
  }
  return lay_out_grid(best_columns, maps, width, shape);
}

/// Contents of one cell.
struct SheetCell {
  const Field& field;
  const SheetMap& map;
  const MapScale& scale;
  Vector2d corner;  ///< lower left corner
};

View draw_cell(Canvas& canvas, const SheetLayout& layout, const SheetCell& cell,
               const SheetOptions& options) {
  const double em = layout.title.size_px, width = layout.width - 1.2 * em;
  const Vector2d top_left = cell.corner + Vector2d(0.6 * em, layout.height - 0.3 * em);
  const std::vector<std::string> title = wrap_text(cell.map.title, layout.title, width, 2);
  double y = top_left.y() - double(layout.title_lines - title.size()) * line_height(layout.title);
  y -= draw_paragraph(canvas, {top_left.x(), y}, title, layout.title);
  TextStyle faint = layout.body;
  faint.colour = colours::faint_ink;
  draw_paragraph(canvas, {top_left.x(), y}, wrap_text(cell.map.figures, faint, width, 1), faint);
  const Rectangle box{std::round(top_left.x()),
                      std::round(y - line_height(layout.body) - 0.3 * em - layout.map_height),
                      width, layout.map_height};
  const View view = fit_view(cell.field.design.vertices, options.from, options.up, box);
  const MapScale& scale = cell.scale;
  const ColourScale colours =
      colour_scale(scale.scale_limits_um.lower, scale.scale_limits_um.upper);
  const SurfaceScene scene =
      surface_scene(cell.field, cell.field.deviation_um, colours, view.toward_eye);
  canvas.scene(view, scene.solids, scene.wires);
  draw_horizontal_colour_bar(
      canvas, {box.x, box.y - 0.2 * em - line_height(layout.body), width, line_height(layout.body)},
      ColourBar{colours, (scale.counts.lowest_um < scale.scale_limits_um.lower),
                (scale.counts.highest_um > scale.scale_limits_um.upper)},
      layout.body);
  return view;
}

std::vector<std::string> common_text(const std::vector<MapScale>& maps, const SheetOptions& options,
                                     std::size_t vertices, std::size_t drawn_vertices) {
  const View view = fit_view({}, options.from, options.up, {});
  std::vector<std::string> lines;
  std::string first = options.values.value_or(sign_convention);
  if (maps.size() > 1) {
    if (!first.empty()) first += "  ·  ";
    first += options.common_range ? "one scale for all maps" : "every map has its own scale";
  }
  if (!first.empty()) lines.push_back(first);
  lines.push_back(
      fmt::format("view {}  ·  {} vertices", view_description(view), group_digits(vertices)));
  if (drawn_vertices < vertices)
    lines.back() += fmt::format(", {} of them drawn", group_digits(drawn_vertices));
  const bool exceeds_scale = std::any_of(maps.begin(), maps.end(), [](const MapScale& scale) {
    return scale.counts.beyond_scale > 0;
  });
  if (exceeds_scale) lines.back() += "  ·  arrow colours: beyond the scale";
  lines.insert(lines.end(), options.caption.begin(), options.caption.end());
  return lines;
}

/// Draws axes, scale bar and the legend below the maps.
void draw_foot(Canvas& canvas, const Page& sheet, double height, const View& view,
               const std::vector<MapScale>& maps) {
  const double em = sheet.body.size_px;
  Vector2d at(sheet.inner.x + 4.2 * em, sheet.inner.y + 0.5 * height);
  draw_triad(canvas, view, {sheet.inner.x + 2.0 * em, at.y() - 0.2 * em}, 1.6 * em, sheet.body);
  at.x() += 1.5 * em;
  draw_scale_bar(canvas, view, at, 0.7 * view.area.width, sheet.body);
  at.x() += 0.7 * view.area.width + 8.0 * em;
  const auto has_vertices = [&](std::size_t VertexCounts::*kind) {
    return std::any_of(maps.begin(), maps.end(),
                       [&](const MapScale& scale) { return scale.counts.*kind > 0; });
  };
  if (has_vertices(&VertexCounts::uncut))
    at.x() += draw_swatch(canvas, at, colours::uncut, "no value", sheet.body) + em;
  if (has_vertices(&VertexCounts::outside))
    draw_swatch(canvas, at, colours::outside, "outside the judged region", sheet.body);
}

}  // namespace

void write_sheet(const std::filesystem::path& path, const cutting::Design& design,
                 const std::vector<SheetMap>& maps, const SheetOptions& options) {
  if (maps.empty() || maps.size() > max_sheet_maps)
    throw std::invalid_argument("sheet: expected 1 to 256 maps");
  const std::vector<MapScale> scales = fit_scales(design, maps, options.common_range);
  const double unit = options.width / 2400.0, foot = 110.0 * unit;
  const DecimatedDesign decimated = decimate_design(design, maps.size());
  const std::vector<std::string> caption =
      common_text(scales, options, std::size_t(design.vertices.rows()), decimated.vertices.size());
  const double margins = page_margins(options.width, options.title, caption, unit);
  const double width = page(options.width, 1000, options.title, caption, unit).inner.width;
  const SheetLayout layout =
      sheet_layout(maps, options, width, aspect(design.vertices, options.from, options.up));
  const double height =
      std::ceil(layout.rows * layout.height + foot + margins + 0.6 * layout.title.size_px);
  if (!(height <= max_side_px))
    throw std::invalid_argument("sheet: the picture would exceed a height of 16384 px");
  const Page sheet = page(options.width, int(height), options.title, caption, unit);

  Canvas canvas(sheet.width, sheet.height);
  View view;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const int column = int(i) % layout.columns, row = int(i) / layout.columns;
    const Vector2d corner(sheet.inner.x + column * layout.width,
                          sheet.inner.y + foot + (layout.rows - 1 - row) * layout.height);
    const SheetMap map{maps[i].title, maps[i].figures, maps[i].values_um(decimated.vertices), {}};
    view = draw_cell(canvas, layout, {make_field(decimated.design, map), map, scales[i], corner},
                     options);
  }
  draw_foot(canvas, sheet, foot, view, scales);
  draw_page(canvas, sheet);
  canvas.write_png(path);
}

}  // namespace abbe::render
