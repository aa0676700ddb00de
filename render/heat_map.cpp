#include "render/heat_map.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "render/canvas.h"
#include "render/colour_bar.h"
#include "render/figures.h"
#include "render/layout.h"

namespace abbe::render {
namespace {

using Eigen::Index;
using Eigen::Vector2d;

constexpr int max_rows = 256;
constexpr int max_columns = 64;
// Matrices up to these sizes get larger cells, so that the picture is not a narrow strip.
constexpr std::size_t few_rows = 6, few_columns = 8;
constexpr double row_px = 36.0;  // in a picture 1600 px wide

/// The values that the colours represent, from -`limit` to `limit`.
struct ColourRange {
  double limit = 1.0;
  bool one_sided = false;                  ///< the colours start at 0
  bool low_end = false, high_end = false;  ///< there are values beyond the limit
};

ColourRange colour_range(const HeatMap& map, const HeatMapOptions& options) {
  double low = 0.0, high = 0.0;
  for (const double value : map.values.reshaped()) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  ColourRange range;
  range.limit = options.range.value_or(std::max(-low, high));
  // A matrix of zeros needs a scale as well.
  if (!options.range && range.limit == 0.0) range.limit = 1.0;
  if (!(range.limit > 0.0) || !std::isfinite(range.limit))
    throw std::invalid_argument("heat map: the range must be positive");
  // Without negative values half of the diverging scale would be unused.
  range.one_sided = !options.range && low >= 0.0 && high > 0.0;
  range.low_end = low < -range.limit;
  range.high_end = high > range.limit;
  return range;
}

Colour cell_colour(double value, const ColourRange& range) {
  // The number is odd, so that zero has the neutral colour.
  static const std::vector<Colour> table = diverging(511);
  if (value > range.limit) return colours::beyond_high;
  if (value < -range.limit) return colours::beyond_low;
  return table[std::size_t(std::lround(255.0 + 255.0 * value / range.limit))];
}

// Luma by the weights of Rec. 601; text is white on dark cells.
bool is_dark(const Colour& c) { return 0.3 * c.r + 0.59 * c.g + 0.11 * c.b < 0.5; }

/// Returns the number of decimals.
int decimal_count(const HeatMap& map, const HeatMapOptions& options) {
  if (options.decimals >= 0) return options.decimals;
  double largest = 0.0;
  for (const double value : map.values.reshaped())
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  return significant_decimals(largest);
}

std::string number_text(double value, int digits) {
  return std::isfinite(value) ? fixed(value, digits) : "";
}

double max_text_width(const std::vector<std::string>& texts, const TextStyle& style) {
  double max_width = 0.0;
  for (const std::string& text : texts) max_width = std::max(max_width, text_size(text, style).x());
  return max_width;
}

/// Sizes of the elements, px.
struct TableSizes {
  double unit = 1.0;
  TextStyle body;
  double names = 0.0;   ///< width of the row names, including the gap
  double cell = 0.0;    ///< width of a cell
  double row = 0.0;     ///< height of a row
  double heads = 0.0;   ///< height of the column names
  bool turned = false;  ///< column names read upwards
  int width = 0;        ///< width of the picture
};

TableSizes table_sizes(const HeatMap& map, const HeatMapOptions& options) {
  TableSizes sizes;
  sizes.unit = options.width / 1600.0;
  sizes.body = {.size_px = 22.0 * sizes.unit};
  const double em = sizes.body.size_px, margins = 120.0 * sizes.unit;
  const int digits = decimal_count(map, options);
  const double names =
      std::max(max_text_width(map.rows, sizes.body), text_size(options.row_label, sizes.body).x());
  // Long names are shortened, so that the cells have most of the width.
  sizes.names = std::min(names, 0.4 * options.width) + 0.8 * em;
  sizes.row = row_px * sizes.unit * (map.rows.size() <= few_rows ? 2.0 : 1.0);
  double number_px = 2.0 * em;
  for (const double value : map.values.reshaped())
    number_px = std::max(number_px, text_size(number_text(value, digits), sizes.body).x());
  const double max_cell = (options.width - margins - sizes.names) / double(map.columns.size());
  const double heads = max_text_width(map.columns, sizes.body);
  // Column names are horizontal if they fit.
  sizes.turned = heads + em > std::min(max_cell, 9.0 * em);
  const double min_cell = map.columns.size() <= few_columns ? 7.0 * em : 0.0;
  sizes.cell =
      std::min(max_cell, std::max({number_px, sizes.turned ? 0.0 : heads, min_cell}) + 1.2 * em);
  sizes.heads = (sizes.turned ? std::min(heads, 16.0 * em) : line_height(sizes.body)) + 0.5 * em +
                (options.column_label.empty() ? 0.0 : 1.4 * em);
  const double legend = text_size(options.value_label, sizes.body).x() + 20.0 * em;
  const double width =
      std::max(sizes.names + sizes.cell * double(map.columns.size()), legend) + margins;
  sizes.width = int(std::lround(std::clamp(width, 0.6 * options.width, double(options.width))));
  return sizes;
}

void draw_names(Canvas& canvas, const HeatMap& map, const HeatMapOptions& options,
                const TableSizes& sizes, const Rectangle& box) {
  const double em = sizes.body.size_px;
  TextStyle style = sizes.body;
  style.vertical_anchor = 0.5;
  style.horizontal_anchor = 1.0;
  const double name_width = sizes.names - 0.7 * em;
  for (std::size_t i = 0; i < map.rows.size(); ++i)
    canvas.text({box.x - 0.5 * em, box.y + box.height - (double(i) + 0.5) * sizes.row},
                wrap_text(map.rows[i], style, name_width, 1).front(), style);
  style.horizontal_anchor = sizes.turned ? 0.0 : 0.5;
  style.vertical_anchor = sizes.turned ? 0.5 : 0.0;
  style.turned_left = sizes.turned;
  for (std::size_t j = 0; j < map.columns.size(); ++j)
    canvas.text({box.x + (double(j) + 0.5) * sizes.cell, box.y + box.height + 0.3 * em},
                wrap_text(map.columns[j], style, sizes.turned ? 16.0 * em : sizes.cell, 1).front(),
                style);
  TextStyle head = sizes.body;
  head.colour = colours::faint_ink;
  canvas.text({box.x, box.y + box.height + sizes.heads - 1.2 * em}, options.column_label, head);
  head.horizontal_anchor = 1.0;
  canvas.text({box.x - 0.5 * em, box.y + box.height + 0.3 * em},
              wrap_text(options.row_label, head, name_width, 1).front(), head);
}

void draw_cells(Canvas& canvas, const HeatMap& map, const HeatMapOptions& options,
                const TableSizes& sizes, const Rectangle& box) {
  const ColourRange range = colour_range(map, options);
  const int digits = decimal_count(map, options);
  TextStyle style = sizes.body;
  style.horizontal_anchor = style.vertical_anchor = 0.5;
  for (Index i = 0; i < map.values.rows(); ++i)
    for (Index j = 0; j < map.values.cols(); ++j) {
      const double value = map.values(i, j);
      const Rectangle cell{box.x + double(j) * sizes.cell,
                           box.y + box.height - double(i + 1) * sizes.row, sizes.cell, sizes.row};
      const Vector2d middle(cell.x + 0.5 * cell.width, cell.y + 0.5 * cell.height);
      if (!std::isfinite(value)) {
        style.colour = colours::faint_ink;
        canvas.text(middle, "–", style);
        continue;
      }
      const Colour colour = cell_colour(value, range);
      canvas.fill({cell.x + 1.0, cell.y + 1.0, cell.width - 2.0, cell.height - 2.0}, colour);
      style.colour = is_dark(colour) ? colours::white : colours::ink;
      const std::string text = number_text(value, digits);
      // A number that does not fit is omitted; the colour of its cell shows the value.
      if (text_size(text, style).x() < cell.width - 4.0) canvas.text(middle, text, style);
    }
}

void check_sizes(const HeatMap& map) {
  if (map.values.size() == 0 || map.values.rows() > max_rows || map.values.cols() > max_columns)
    throw std::invalid_argument("heat map: expected 1 to 256 rows and 1 to 64 columns");
  if (map.values.rows() != Index(map.rows.size()) || map.values.cols() != Index(map.columns.size()))
    throw std::invalid_argument("heat map: expected one name per row and per column");
}

}  // namespace

void write_heat_map(const std::filesystem::path& path, const HeatMap& map,
                    const HeatMapOptions& options) {
  check_sizes(map);
  const ColourRange range = colour_range(map, options);
  const TableSizes sizes = table_sizes(map, options);
  const double em = sizes.body.size_px, foot = 2.6 * em;
  const double cells = sizes.row * double(map.rows.size());
  const double margins = page_margins(sizes.width, options.title, options.caption, sizes.unit);
  const int height = int(std::ceil(cells + sizes.heads + foot + 0.8 * em + margins));
  const Page sheet = page(sizes.width, height, options.title, options.caption, sizes.unit);
  const Rectangle box{sheet.inner.x + 0.5 * em + sizes.names, sheet.inner.y + foot,
                      sizes.cell * double(map.columns.size()), cells};
  Canvas canvas(sheet.width, sheet.height);
  draw_cells(canvas, map, options, sizes, box);
  draw_names(canvas, map, options, sizes, box);
  const Vector2d legend(sheet.inner.x + 0.5 * em, sheet.inner.y + 1.2 * em);
  TextStyle name = sheet.body;
  name.vertical_anchor = 0.5;
  canvas.text(legend, options.value_label, name);
  const double label_width =
      options.value_label.empty() ? 0.0 : text_size(options.value_label, name).x() + 1.2 * em;
  draw_horizontal_colour_bar(
      canvas, {legend.x() + label_width, legend.y() - 0.7 * em, 16.0 * em, 1.4 * em},
      {range.limit, "", range.one_sided, range.low_end, range.high_end}, sheet.body);
  draw_page(canvas, sheet);
  canvas.write_png(path);
}

}  // namespace abbe::render
