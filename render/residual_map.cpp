#include "render/residual_map.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "render/canvas.h"
#include "render/colour_bar.h"
#include "render/figures.h"
#include "render/layout.h"
#include "render/surface_scene.h"

namespace abbe::render {

namespace {

using Eigen::Vector2d;

/// Positions of the elements, px from the lower left corner.
struct MapPage {
  double margin;
  double title_top;
  Rectangle map;
  Rectangle strip;  ///< scale bar and legend, between map and text
  Rectangle bar;
  Vector2d triad;
};

MapPage map_page(const MapOptions& options, const TypeSizes& type, std::size_t title_lines,
                 double text_height) {
  const double u = type.unit;
  MapPage page{};
  page.margin = 40.0 * u;
  page.title_top = options.height - 30.0 * u;
  const double head =
      30.0 * u + 1.38 * (double(title_lines) * type.title + type.figures) + 22.0 * u;
  const double side = 270.0 * u;
  page.strip = {page.margin, page.margin * 0.7 + text_height, options.width - 2.0 * page.margin,
                64.0 * u};
  const double map_bottom = page.strip.y + page.strip.height;
  page.map = {page.margin, map_bottom, options.width - 2.0 * page.margin - side,
              options.height - head - map_bottom};
  const double bar_bottom = map_bottom + 190.0 * u;
  page.bar = {options.width - page.margin - side + 116.0 * u, bar_bottom, 38.0 * u,
              page.map.y + page.map.height - 72.0 * u - bar_bottom};
  page.triad = {options.width - page.margin - 0.5 * side + 30.0 * u, map_bottom + 62.0 * u};
  return page;
}

void draw_head(Canvas& canvas, const MapPage& page, const std::vector<std::string>& title,
               const Figures& figures, const TypeSizes& type) {
  const double title_height = draw_paragraph(canvas, {page.margin, page.title_top}, title,
                                             {.size_px = type.title, .bold = true});
  draw_paragraph(canvas, {page.margin, page.title_top - title_height}, {figures_text(figures)},
                 {.size_px = type.figures});
}

void draw_strip(Canvas& canvas, const MapPage& page, const View& view, const VertexCounts& counts,
                const TextStyle& body) {
  const double y = page.strip.y + 0.5 * page.strip.height;
  draw_scale_bar(canvas, view, {page.strip.x, y}, 0.22 * page.map.width, body);
  double x = page.strip.x + 0.42 * page.map.width;
  const double gap = 1.6 * body.size_px;
  if (counts.uncut > 0) x += draw_swatch(canvas, {x, y}, colours::uncut, "uncut", body) + gap;
  if (counts.gouged > 0)
    x += draw_swatch(canvas, {x, y}, colours::gouged, "gouged deeper", body) + gap;
  if (counts.outside > 0) {
    draw_swatch(canvas, {x, y}, colours::outside, "outside the judged region", body);
  }
}

/// Bound of the numerical error of the surface computation. Extremes of a smaller residual are not
/// flagged.
constexpr double numerical_floor_um = 1e-4;

/// Returns the limits if all vertices have the same; empty if they differ or without a tolerance.
std::optional<Span> common_limits(const cutting::ToleranceBands& tolerance_um) {
  if (tolerance_um.rows() == 0) return std::nullopt;
  const Eigen::RowVector2d first_limits = tolerance_um.row(0);
  // Regions may have different limits.
  if (!first_limits.allFinite() ||
      (tolerance_um.rowwise() - first_limits).cwiseAbs().maxCoeff() > 0.0)
    return std::nullopt;
  return Span{first_limits[0], first_limits[1]};
}

/// The values of a field that colours show, and their scale.
struct ColouredMap {
  Eigen::VectorXd values;
  Eigen::VectorXd within;  ///< values at the sample points of triangles; may be empty
  ColourScale scale;
  Span ends_um;                ///< a vertex outside these ends is beyond the scale
  std::vector<double> levels;  ///< values of isolines
};

/// Scales deviations linearly so that their limits become 0 and 1.
/// @param bands  (n) limits of each deviation
Eigen::VectorXd scale_to_bands(const Eigen::VectorXd& deviation_um,
                               const cutting::ToleranceBands& bands) {
  Eigen::VectorXd values(deviation_um.size());
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double width = bands(i, 1) - bands(i, 0);
    // A vertex without limits is in tolerance; it gets the middle of the band.
    values[i] = std::isfinite(width) ? (deviation_um[i] - bands(i, 0)) / width : 0.5;
  }
  return values;
}

/// Returns the limits at the sample points of triangles, the means of the limits at their corners.
cutting::ToleranceBands bands_at_sample_points(const Field& field,
                                               const cutting::ToleranceBands& bands) {
  cutting::ToleranceBands result(field.within_um.size(), 2);
  for (Eigen::Index t = 0; t < result.rows(); ++t) {
    const Eigen::RowVector3i corners = field.design.triangles.row(t);
    result.row(t) = (bands.row(corners[0]) + bands.row(corners[1]) + bands.row(corners[2])) / 3.0;
  }
  return result;
}

ColouredMap colour_map(const MapPicture& picture, const MapOptions& options) {
  const Field& field = picture.field;
  if (options.range_um && (!(*options.range_um > 0.0) || !std::isfinite(*options.range_um)))
    throw std::invalid_argument("map: the range must be positive");
  if (picture.tolerance_um.rows() != 0 && picture.tolerance_um.rows() != field.deviation_um.size())
    throw std::invalid_argument("map: expected one tolerance band per vertex");
  if (options.colours == MapColours::Tolerance) {
    if (picture.tolerance_um.rows() == 0)
      throw std::invalid_argument("map: tolerance colours need a tolerance");
    // On the scale of a tolerance no deviation is beyond the ends.
    const double max_double = std::numeric_limits<double>::max();
    const cutting::ToleranceBands& bands = picture.tolerance_um;
    return {scale_to_bands(field.deviation_um, bands),
            scale_to_bands(field.within_um, bands_at_sample_points(field, bands)),
            tolerance_scale(),
            {-max_double, max_double},
            {0.0, 1.0}};
  }
  const Span ends =
      options.range_um ? Span{-*options.range_um, *options.range_um} : fitted_ends_um(field);
  const Palette palette =
      options.colours == MapColours::Cividis ? Palette::Cividis : Palette::Diverging;
  return {field.deviation_um, field.within_um, colour_scale(ends.lower, ends.upper, palette), ends,
          round_ticks(ends.lower, ends.upper, 11).values};
}

/// Returns flags at the highest and the lowest cut vertex.
std::vector<Flag> extreme_vertex_flags(const View& view, const Field& field) {
  Eigen::Index low = -1, high = -1;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    if (!std::isfinite(field.deviation_um[i]) || field.status[std::size_t(i)] != 0) continue;
    if (low < 0 || field.deviation_um[i] < field.deviation_um[low]) low = i;
    if (high < 0 || field.deviation_um[i] > field.deviation_um[high]) high = i;
  }
  if (low < 0) return {};
  const double pv = field.deviation_um[high] - field.deviation_um[low];
  // Below the numerical floor the extremes are computation errors, and flags would mislead.
  if (!(pv > numerical_floor_um)) return {};
  const LengthUnit unit = length_unit(pv);
  std::vector<Flag> flags;
  for (const Eigen::Index vertex : {high, low}) {
    const double value = field.deviation_um[vertex] * unit.per_um;
    const Eigen::Vector3d p = field.design.vertices.row(vertex);
    const bool hidden = is_hidden(view, field.design, p);
    flags.push_back({project(view, p),
                     signed_fixed(value, significant_decimals(pv * unit.per_um)) + " " + unit.name +
                         (hidden ? ", behind" : ""),
                     hidden});
  }
  return flags;
}

/// Returns the histogram of the coloured values, weighted by the areas of the statistics.
std::vector<double> area_histogram(const Field& field, const ColouredMap& map, const Span& ends,
                                   int bins) {
  // Without areas every vertex has the same weight.
  if (field.design.area.size() == 0) return histogram_fractions(map.values, {}, ends, bins);
  const cutting::Weights w = weights(field);
  std::vector<double> sums = histogram_fractions(map.values, w.vertex, ends, bins);
  const std::vector<double> within = histogram_fractions(map.within, w.within, ends, bins);
  std::transform(sums.begin(), sums.end(), within.begin(), sums.begin(), std::plus<>());
  return sums;
}

void draw_scale(Canvas& canvas, const MapPage& page, const MapPicture& picture,
                const MapOptions& options, const ColouredMap& map, const VertexCounts& counts,
                const TextStyle& body) {
  const int bins = std::max(8, int(page.bar.height / 7.0));
  const double histogram = 74.0 / 38.0 * page.bar.width;
  const Field& field = picture.field;
  if (options.colours == MapColours::Tolerance) {
    const TolerancePercentages s =
        picture.percentages.value_or(tolerance_percentages(field, picture.tolerance_um));
    draw_tolerance_bar(canvas, page.bar,
                       {s.over, s.in, s.under, common_limits(picture.tolerance_um),
                        area_histogram(field, map, {-0.5, 1.5}, bins), histogram},
                       body);
    return;
  }
  ColourBar bar{map.scale, (counts.lowest_um < map.ends_um.lower),
                (counts.highest_um > map.ends_um.upper)};
  if (const auto limits = common_limits(picture.tolerance_um))
    bar.marks = {limits->lower, limits->upper};
  bar.histogram = area_histogram(field, map, map.ends_um, bins);
  bar.histogram_px = histogram;
  draw_colour_bar(canvas, page.bar, bar, body);
}

/// Returns a quantile of the magnitudes of the finite deviations; empty if there are none.
std::optional<double> magnitude_quantile_um(const Field& field, double fraction) {
  std::vector<double> magnitudes;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    if (std::isfinite(field.deviation_um[i])) magnitudes.push_back(std::abs(field.deviation_um[i]));
  }
  if (magnitudes.empty()) return std::nullopt;
  const auto rank =
      static_cast<std::ptrdiff_t>(std::ceil(fraction * static_cast<double>(magnitudes.size()))) - 1;
  std::nth_element(magnitudes.begin(), magnitudes.begin() + rank, magnitudes.end());
  return magnitudes[std::size_t(rank)];
}

/// Returns the symmetric scale with a side shortened if its values are small.
/// @param largest_below, largest_above  largest magnitudes below and above zero
Span trim_minor_side(const Span& ends, double largest_below, double largest_above) {
  constexpr double min_side_ratio = 0.25;
  const double range = ends.upper, step = round_up_125(range / 12.0);
  const auto end = [&](double largest) {
    return largest < min_side_ratio * range ? step * std::ceil(largest / step) : range;
  };
  return {-end(largest_below), end(largest_above)};
}

constexpr double scale_quantile = 0.995;  // of the cut vertices

}  // namespace

double fitted_range_um(const Field& field) {
  const std::optional<double> magnitude = magnitude_quantile_um(field, scale_quantile);
  return magnitude ? std::max(round_up_range(*magnitude), min_range_um) : 1.0;
}

Span fitted_ends_um(const Field& field) {
  const double range = fitted_range_um(field);
  const VertexCounts counts = count_vertices(field, range);
  if (counts.cut == 0 || (counts.lowest_um == 0.0 && counts.highest_um == 0.0))
    return {-range, range};
  if (counts.lowest_um < 0.0 && counts.highest_um > 0.0)
    return trim_minor_side({-range, range}, -counts.lowest_um, counts.highest_um);
  const bool is_positive = counts.lowest_um >= 0.0;
  const double min_um = is_positive ? counts.lowest_um : -counts.highest_um;
  const double max_um = *magnitude_quantile_um(field, scale_quantile);
  Span ends{0.0, range};
  // On a scale from zero, values far from zero with little spread would all have the same colour.
  if (min_um > 0.4 * max_um && max_um - min_um > 1e-3 * max_um) {
    const double step = round_up_125((max_um - min_um) / 10.0);
    ends = {step * std::floor(min_um / step), step * std::ceil(max_um / step)};
  }
  return is_positive ? ends : Span{-ends.upper, -ends.lower};
}

Span common_ends(const std::vector<Span>& ends_um) {
  Span total{0.0, 0.0};
  for (const Span& ends : ends_um) {
    widen(total, ends.lower);
    widen(total, ends.upper);
  }
  const double range = std::max(-total.lower, total.upper);
  return total.lower == 0.0 || total.upper == 0.0
             ? total
             : trim_minor_side({-range, range}, -total.lower, total.upper);
}

TolerancePercentages tolerance_percentages(const Field& field,
                                           const cutting::ToleranceBands& tolerance_um) {
  TolerancePercentages s;
  double total_area = 0.0;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    const auto status = cutting::VertexStatus(field.status[std::size_t(i)]);
    // Vertices outside the judged region have no verdict.
    if (status == cutting::VertexStatus::Outside) continue;
    const double area = field.design.area.size() > 0 ? field.design.area[i] : 1.0;
    const double deviation = field.deviation_um[i];
    total_area += area;
    (status == cutting::VertexStatus::Uncut    ? s.uncut
     : status == cutting::VertexStatus::Gouged ? s.under
     : deviation > tolerance_um(i, 1)          ? s.over
     : deviation < tolerance_um(i, 0)          ? s.under
                                               : s.in) += area;
  }
  const double percent = total_area > 0.0 ? 100.0 / total_area : 0.0;
  return {percent * s.in, percent * s.over, percent * s.under, percent * s.uncut};
}

namespace {

/// Draws a map on a canvas of its own.
/// @param finish  takes the canvas with the map
void draw_map(const MapPicture& picture, const MapOptions& options,
              const std::function<void(Canvas&)>& finish) {
  check_field(picture.field);
  const ColouredMap map = colour_map(picture, options);
  const VertexCounts counts = count_vertices(picture.field, map.ends_um);
  const TypeSizes type = type_sizes(options.width, options.height);
  const TextStyle body{.size_px = type.body};
  const View direction = fit_view({}, options.from, options.up, {});
  SurfaceScene scene = surface_scene(picture.field, map.values, map.scale, direction.toward_eye);
  if (options.isolines) scene.wires.push_back(isolines(picture.field, map.values, map.levels));
  std::vector<std::string> lines;
  const double width = options.width - 80.0 * type.unit;
  const double magnitude = std::max(std::abs(counts.lowest_um), std::abs(counts.highest_um));
  for (const std::string& text :
       map_text(picture, counts, magnitude, view_description(direction))) {
    for (const std::string& line : wrap_text(text, body, width)) lines.push_back(line);
  }
  const double text_height = static_cast<double>(lines.size()) * line_height(body);
  const std::vector<std::string> title =
      wrap_text(picture.title, {.size_px = type.title, .bold = true}, width, 2);
  const MapPage page = map_page(options, type, title.size(), text_height);
  const View view = fit_view(picture.field.design.vertices, options.from, options.up, page.map);
  const std::vector<Flag> flags = extreme_vertex_flags(view, picture.field);

  // Only one canvas with a scene exists at a time in the process, so everything else is done
  // before.
  Canvas canvas(options.width, options.height);
  canvas.scene(view, scene.solids, scene.wires);
  draw_head(canvas, page, title, picture.figures, type);
  draw_strip(canvas, page, view, counts, body);
  draw_scale(canvas, page, picture, options, map, counts, body);
  draw_triad(canvas, view, page.triad, 46.0 * type.unit, body);
  draw_flags(canvas, flags, page.map, body);
  draw_paragraph(canvas, {page.margin, page.strip.y}, lines, body);
  finish(canvas);
}

}  // namespace

void write_map(const std::filesystem::path& path, const MapPicture& picture,
               const MapOptions& options) {
  draw_map(picture, options, [&](Canvas& canvas) { canvas.write(path, options.format); });
}

Pixels map_pixels(const MapPicture& picture, const MapOptions& options) {
  Pixels pixels;
  draw_map(picture, options, [&](Canvas& canvas) { pixels = canvas.pixels(); });
  return pixels;
}

std::string figures_text(const Figures& figures, Mean mean) {
  const LengthUnit unit = length_unit(std::isfinite(figures.pv_um) ? figures.pv_um : 0.0);
  std::vector<std::string> parts;
  const auto add = [&](const char* name, double um, int decimals) {
    constexpr double min_um = 1e-6;  // smaller figures are rounding errors
    const std::string length =
        um < min_um ? "below 0.001 nm"
                    : fmt::format("{} {}", fixed(um * unit.per_um, decimals), unit.name);
    parts.push_back(fmt::format("{} {}", name, length));
  };
  const int rms_decimals = significant_decimals(figures.rms_um * unit.per_um);
  if (std::isfinite(figures.pv_um)) {
    add("PV", figures.pv_um, significant_decimals(figures.pv_um * unit.per_um));
  }
  if (std::isfinite(figures.rms_um)) add("RMS", figures.rms_um, rms_decimals);
  if (std::isfinite(figures.mean_um) && mean == Mean::Stated) {
    // The mean has the decimals of the RMS, because more digits of a mean near zero are rounding
    // errors.
    parts.push_back(fmt::format(
        "mean {} {}", signed_fixed(figures.mean_um * unit.per_um, rms_decimals), unit.name));
  }
  return parts.empty() ? "nothing was cut" : fmt::format("{}", fmt::join(parts, "    "));
}

std::vector<std::string> excluded_text(const VertexCounts& counts) {
  std::vector<std::string> parts;
  if (counts.uncut > 0)
    parts.push_back(fmt::format("{} uncut ({:.3g} %)", group_digits(counts.uncut),
                                100.0 * double(counts.uncut) / double(counts.judged())));
  if (counts.gouged > 0)
    parts.push_back(fmt::format("{} gouged deeper than the band", group_digits(counts.gouged)));
  return parts;
}

std::string limits_text(const cutting::ToleranceBands& tolerance_um) {
  const auto limits = common_limits(tolerance_um);
  if (!limits) return "by region";
  const LengthUnit unit = length_unit(std::max(std::abs(limits->lower), std::abs(limits->upper)));
  const auto limit_text = [&](double um) {
    return fmt::format("{}{:.4g}",
                       um < 0.0   ? "−"
                       : um > 0.0 ? "+"
                                  : "",
                       std::abs(um * unit.per_um));
  };
  return fmt::format("{} to {} {}", limit_text(limits->lower), limit_text(limits->upper),
                     unit.name);
}

std::string verdict_text(const MapPicture& picture) {
  const TolerancePercentages s =
      picture.percentages.value_or(tolerance_percentages(picture.field, picture.tolerance_um));
  std::string text = picture.verdict.empty() ? "" : picture.verdict + "  ·  ";
  text += percent_text(s.in) + " of the area in tolerance";
  for (const auto& [name, percent] :
       {std::pair{"over", s.over}, {"under", s.under}, {"uncut", s.uncut}})
    if (percent > 0.0) text += fmt::format(", {} {}", name, percent_text(percent));
  return text;
}

namespace {

/// Returns e.g. "0.31 % of the cut vertices lie beyond the scale; values from −31.2 to 40.0 µm";
/// empty if no vertex is beyond the scale.
std::string outlier_text(const VertexCounts& counts, double range_um) {
  if (counts.beyond_scale == 0) return {};
  const LengthUnit unit = length_unit(range_um);
  const double percent =
      100.0 * static_cast<double>(counts.beyond_scale) / static_cast<double>(counts.cut);
  return fmt::format("{} % of the cut vertices lie beyond the scale; values from {} to {} {}",
                     percent < 0.01 ? "less than 0.01" : figure(percent),
                     figure(counts.lowest_um * unit.per_um),
                     figure(counts.highest_um * unit.per_um), unit.name);
}

}  // namespace

std::vector<std::string> map_text(const MapPicture& picture, const VertexCounts& counts,
                                  double range_um, const std::string& view) {
  std::vector<std::string> lines{sign_convention};
  if (picture.tolerance_um.rows() > 0)
    lines.push_back(fmt::format("tolerance {}  ·  {}", limits_text(picture.tolerance_um),
                                verdict_text(picture)));
  std::string numbers = fmt::format("{} vertices, ", group_digits(counts.vertices()));
  const std::vector<std::string> excluded = excluded_text(counts);
  numbers += excluded.empty() ? "0 uncut" : fmt::format("{}", fmt::join(excluded, ", "));
  if (counts.outside > 0) numbers += fmt::format(", {} outside", group_digits(counts.outside));
  lines.push_back(fmt::format("datum {}  ·  alignment {}  ·  view {}  ·  {}", picture.datum,
                              picture.alignment, view, numbers));
  if (const std::string outliers = outlier_text(counts, range_um); !outliers.empty()) {
    lines.push_back(outliers);
  }
  lines.insert(lines.end(), picture.caption.begin(), picture.caption.end());
  return lines;
}

}  // namespace abbe::render
