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

/// Positions of the elements, from the lower left corner.
struct MapPage {
  double margin;
  double title_top;
  Rectangle map;
  Rectangle strip;  ///< scale bar and swatches, between map and text
  Rectangle bar;
  Vector2d triad;
};

MapPage map_page(const MapOptions& options, const TypeSizes& type, std::size_t title_lines,
                 double text_height) {
  const double u = type.unit;
  MapPage p{};
  p.margin = 40.0 * u;
  p.title_top = options.height - 30.0 * u;
  const double head =
      30.0 * u + 1.38 * (double(title_lines) * type.title + type.figures) + 22.0 * u;
  const double side = 270.0 * u;
  p.strip = {p.margin, p.margin * 0.7 + text_height, options.width - 2.0 * p.margin, 64.0 * u};
  const double map_bottom = p.strip.y + p.strip.height;
  p.map = {p.margin, map_bottom, options.width - 2.0 * p.margin - side,
           options.height - head - map_bottom};
  const double bar_bottom = map_bottom + 190.0 * u;
  p.bar = {options.width - p.margin - side + 116.0 * u, bar_bottom, 38.0 * u,
           p.map.y + p.map.height - 72.0 * u - bar_bottom};
  p.triad = {options.width - p.margin - 0.5 * side + 30.0 * u, map_bottom + 62.0 * u};
  return p;
}

void draw_head(Canvas& canvas, const MapPage& p, const std::vector<std::string>& title,
               const Figures& figures, const TypeSizes& type) {
  const double used =
      paragraph(canvas, {p.margin, p.title_top}, title, {.size_px = type.title, .bold = true});
  paragraph(canvas, {p.margin, p.title_top - used}, {figures_text(figures)},
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

/// Coloured values of a field, and their scale.
struct ColouredMap {
  Eigen::VectorXd values;
  Eigen::VectorXd within;  ///< values at the sample points of triangles; may be empty
  ColourScale scale;
  Span ends_um;                ///< a vertex outside these ends is beyond the scale
  std::vector<double> levels;  ///< of isolines
};

/// Returns deviations scaled such that their limits (one row each) become 0 and 1.
Eigen::VectorXd within_band(const Eigen::VectorXd& deviation_um,
                            const cutting::ToleranceBands& bands) {
  Eigen::VectorXd values(deviation_um.size());
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double width = bands(i, 1) - bands(i, 0);
    // Without limits a vertex is in tolerance, i.e. in the middle of the band.
    values[i] = std::isfinite(width) ? (deviation_um[i] - bands(i, 0)) / width : 0.5;
  }
  return values;
}

/// Returns the limits at the sample points of triangles: the mean of those of their corners.
cutting::ToleranceBands bands_at_centroids(const Field& field,
                                           const cutting::ToleranceBands& bands) {
  cutting::ToleranceBands found(field.within_um.size(), 2);
  for (Eigen::Index t = 0; t < found.rows(); ++t) {
    const Eigen::RowVector3i corners = field.design.triangles.row(t);
    found.row(t) = (bands.row(corners[0]) + bands.row(corners[1]) + bands.row(corners[2])) / 3.0;
  }
  return found;
}

ColouredMap colour_map(const MapPicture& picture, const MapOptions& options) {
  const Field& field = picture.field;
  if (options.range_um && (!(*options.range_um > 0.0) || !std::isfinite(*options.range_um)))
    throw std::invalid_argument("map: the range must be positive");
  if (picture.tolerance_um.rows() != 0 && picture.tolerance_um.rows() != field.deviation_um.size())
    throw std::invalid_argument("map: one band of tolerance a vertex is needed");
  if (options.colours == MapColours::Tolerance) {
    if (picture.tolerance_um.rows() == 0)
      throw std::invalid_argument("map: colours of a tolerance need one");
    // No deviation is beyond the scale of a tolerance.
    const double huge = std::numeric_limits<double>::max();
    const cutting::ToleranceBands& bands = picture.tolerance_um;
    return {within_band(field.deviation_um, bands),
            within_band(field.within_um, bands_at_centroids(field, bands)),
            tolerance_scale(),
            {-huge, huge},
            {0.0, 1.0}};
  }
  const Span ends =
      options.range_um ? Span{-*options.range_um, *options.range_um} : fitted_ends_um(field);
  const Palette palette =
      options.colours == MapColours::Cividis ? Palette::Cividis : Palette::Diverging;
  return {field.deviation_um, field.within_um, colour_scale(ends.lower, ends.upper, palette), ends,
          round_ticks(ends.lower, ends.upper, 11).values};
}

/// Returns flags at the highest and the lowest vertex that is cut.
std::vector<Flag> flags(const View& view, const Field& field) {
  Eigen::Index low = -1, high = -1;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    if (!std::isfinite(field.deviation_um[i]) || field.status[std::size_t(i)] != 0) continue;
    if (low < 0 || field.deviation_um[i] < field.deviation_um[low]) low = i;
    if (high < 0 || field.deviation_um[i] > field.deviation_um[high]) high = i;
  }
  if (low < 0) return {};
  const double pv = field.deviation_um[high] - field.deviation_um[low];
  // Below this value the extremes are rounding, and flags would only mislead.
  if (!(pv > numerical_floor_um)) return {};
  const LengthUnit unit = length_unit(pv);
  std::vector<Flag> both;
  for (const Eigen::Index vertex : {high, low}) {
    const double value = field.deviation_um[vertex] * unit.per_um;
    const Eigen::Vector3d p = field.design.vertices.row(vertex);
    const bool hidden = is_hidden(view, field.design, p);
    both.push_back({projected(view, p),
                    signed_fixed(value, significant_decimals(pv * unit.per_um)) + " " + unit.name +
                        (hidden ? ", behind" : ""),
                    hidden});
  }
  return both;
}

/// Returns the histogram of the coloured values, by the areas of the statistics.
std::vector<double> shares_of(const Field& field, const ColouredMap& what, const Span& ends,
                              int bins) {
  // Without areas every vertex has the same weight.
  if (field.design.area.size() == 0) return histogram_fractions(what.values, {}, ends, bins);
  const cutting::Weights w = weights(field);
  std::vector<double> shares = histogram_fractions(what.values, w.vertex, ends, bins);
  const std::vector<double> within = histogram_fractions(what.within, w.within, ends, bins);
  std::transform(shares.begin(), shares.end(), within.begin(), shares.begin(), std::plus<>());
  return shares;
}

void draw_scale(Canvas& canvas, const MapPage& p, const MapPicture& picture,
                const MapOptions& options, const ColouredMap& what, const Tally& counts,
                const TextStyle& body) {
  const int bins = std::max(8, int(p.bar.height / 7.0));
  const double histogram = 74.0 / 38.0 * p.bar.width;
  const Field& field = picture.field;
  if (options.colours == MapColours::Tolerance) {
    const ToleranceShares s =
        picture.shares.value_or(tolerance_shares(field, picture.tolerance_um));
    tolerance_bar(canvas, p.bar,
                  {s.over, s.in, s.under, common_limits(picture.tolerance_um),
                   shares_of(field, what, {-0.5, 1.5}, bins), histogram},
                  body);
    return;
  }
  ColourBar bar{what.scale,
                counts.lowest_um<what.ends_um.lower, counts.highest_um> what.ends_um.upper};
  if (const auto limits = common_limits(picture.tolerance_um))
    bar.marks = {limits->lower, limits->upper};
  bar.shares = shares_of(field, what, what.ends_um, bins);
  bar.histogram_px = histogram;
  colour_bar(canvas, p.bar, bar, body);
}

/// Returns the magnitude below which the given fraction of the cut vertices lies; empty without
/// any.
std::optional<double> magnitude_um(const Field& field, double share) {
  std::vector<double> size;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    if (std::isfinite(field.deviation_um[i])) size.push_back(std::abs(field.deviation_um[i]));
  }
  if (size.empty()) return std::nullopt;
  const auto rank =
      static_cast<std::ptrdiff_t>(std::ceil(share * static_cast<double>(size.size()))) - 1;
  // Only one rank is needed, so a full sort would be wasted.
  std::nth_element(size.begin(), size.begin() + rank, size.end());
  return size[std::size_t(rank)];
}

/// Returns a scale about zero, with a nearly empty side cut short.
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
  const std::optional<double> size = magnitude_um(field, scale_quantile);
  return size ? std::max(round_up_range(*size), min_range_um) : 1.0;
}

Span fitted_ends_um(const Field& field) {
  const double range = fitted_range_um(field);
  const Tally all = tally(field, range);
  // Both signs need a scale about zero; without any deviation the usual scale is kept.
  if (all.cut == 0 || (all.lowest_um == 0.0 && all.highest_um == 0.0)) return {-range, range};
  if (all.lowest_um < 0.0 && all.highest_um > 0.0)
    return trim_minor_side({-range, range}, -all.lowest_um, all.highest_um);
  const bool positive = all.lowest_um >= 0.0;
  const double least = positive ? all.lowest_um : -all.highest_um;
  const double most = *magnitude_um(field, scale_quantile);
  Span ends{0.0, range};
  // Values far from zero with little spread would all have the same colour on a scale from zero.
  if (least > 0.4 * most && most - least > 1e-3 * most) {
    const double step = round_up_125((most - least) / 10.0);
    ends = {step * std::floor(least / step), step * std::ceil(most / step)};
  }
  return positive ? ends : Span{-ends.upper, -ends.lower};
}

Span common_ends(const std::vector<Span>& ends_um) {
  Span all{0.0, 0.0};
  for (const Span& one : ends_um) {
    widen(all, one.lower);
    widen(all, one.upper);
  }
  const double range = std::max(-all.lower, all.upper);
  return all.lower == 0.0 || all.upper == 0.0
             ? all
             : trim_minor_side({-range, range}, -all.lower, all.upper);
}

ToleranceShares tolerance_shares(const Field& field, const cutting::ToleranceBands& tolerance_um) {
  ToleranceShares s;
  double all = 0.0;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    const auto status = cutting::VertexStatus(field.status[std::size_t(i)]);
    // Vertices outside of the judged area have no verdict.
    if (status == cutting::VertexStatus::Outside) continue;
    const double area = field.design.area.size() > 0 ? field.design.area[i] : 1.0;
    const double d = field.deviation_um[i];
    all += area;
    (status == cutting::VertexStatus::Uncut    ? s.uncut
     : status == cutting::VertexStatus::Gouged ? s.under
     : d > tolerance_um(i, 1)                  ? s.over
     : d < tolerance_um(i, 0)                  ? s.under
                                               : s.in) += area;
  }
  const double percent = all > 0.0 ? 100.0 / all : 0.0;
  return {percent * s.in, percent * s.over, percent * s.under, percent * s.uncut};
}

namespace {

void draw_map(const MapPicture& picture, const MapOptions& options,
              const std::function<void(Canvas&)>& use) {
  check(picture.field);
  const ColouredMap what = colour_map(picture, options);
  const Tally counts = tally(picture.field, what.ends_um);
  const TypeSizes type = type_sizes(options.width, options.height);
  const TextStyle body{.size_px = type.body};
  const View named = fit_view({}, options.from, options.up, {});
  // Before any text is measured, which waits while another picture is drawn.
  SurfaceScene scene = surface_scene(picture.field, what.values, what.scale, named.toward);
  if (options.isolines) scene.wires.push_back(isolines(picture.field, what.values, what.levels));
  std::vector<std::string> lines;
  const double width = options.width - 80.0 * type.unit;
  const double size = std::max(std::abs(counts.lowest_um), std::abs(counts.highest_um));
  for (const std::string& text : map_text(picture, counts, size, view_description(named))) {
    for (const std::string& line : wrapped(text, body, width)) lines.push_back(line);
  }
  const double text_height = static_cast<double>(lines.size()) * line_height(body);
  const std::vector<std::string> title =
      wrapped(picture.title, {.size_px = type.title, .bold = true}, width, 2);
  const MapPage p = map_page(options, type, title.size(), text_height);
  const View view = fit_view(picture.field.design.vertices, options.from, options.up, p.map);
  const std::vector<Flag> flagged = flags(view, picture.field);

  // Only one canvas exists at a time in the whole program, so everything else is done before.
  Canvas canvas(options.width, options.height);
  canvas.scene(view, scene.solids, scene.wires);
  draw_head(canvas, p, title, picture.figures, type);
  draw_strip(canvas, p, view, counts, body);
  draw_scale(canvas, p, picture, options, what, counts, body);
  triad(canvas, view, p.triad, 46.0 * type.unit, body);
  draw_flags(canvas, flagged, p.map, body);
  paragraph(canvas, {p.margin, p.strip.y}, lines, body);
  use(canvas);
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
    constexpr double min_um = 1e-6;  // below it figures are rounding
    const std::string length =
        um < min_um ? "under 0.001 nm"
                    : fmt::format("{} {}", fixed(um * unit.per_um, decimals), unit.name);
    parts.push_back(fmt::format("{} {}", name, length));
  };
  const int rms_decimals = significant_decimals(figures.rms_um * unit.per_um);
  if (std::isfinite(figures.pv_um)) {
    add("PV", figures.pv_um, significant_decimals(figures.pv_um * unit.per_um));
  }
  if (std::isfinite(figures.rms_um)) add("RMS", figures.rms_um, rms_decimals);
  if (std::isfinite(figures.mean_um) && mean == Mean::Stated) {
    // No more digits than the RMS: a mean near zero is rounding.
    parts.push_back(fmt::format(
        "mean {} {}", signed_fixed(figures.mean_um * unit.per_um, rms_decimals), unit.name));
  }
  return parts.empty() ? "nothing was cut" : fmt::format("{}", fmt::join(parts, "    "));
}

std::string outlier_text(const Tally& counts, double range_um) {
  if (counts.beyond == 0) return {};
  const LengthUnit unit = length_unit(range_um);
  const double percent =
      100.0 * static_cast<double>(counts.beyond) / static_cast<double>(counts.cut);
  return fmt::format("{} % of the cut vertices lie beyond the scale; values from {} to {} {}",
                     percent < 0.01 ? "less than 0.01" : figure(percent),
                     figure(counts.lowest_um * unit.per_um),
                     figure(counts.highest_um * unit.per_um), unit.name);
}

std::vector<std::string> excluded_text(const Tally& counts) {
  std::vector<std::string> parts;
  if (counts.uncut > 0)
    parts.push_back(fmt::format("{} uncut ({:.3g} %)", grouped(counts.uncut),
                                100.0 * double(counts.uncut) / double(counts.judged())));
  if (counts.gouged > 0)
    parts.push_back(fmt::format("{} gouged deeper than the band", grouped(counts.gouged)));
  return parts;
}

std::optional<Span> common_limits(const cutting::ToleranceBands& tolerance_um) {
  if (tolerance_um.rows() == 0) return std::nullopt;
  const Eigen::RowVector2d first = tolerance_um.row(0);
  // Limits that differ between regions cannot be stated as a single pair.
  if (!first.allFinite() || (tolerance_um.rowwise() - first).cwiseAbs().maxCoeff() > 0.0)
    return std::nullopt;
  return Span{first[0], first[1]};
}

std::string limits_text(const cutting::ToleranceBands& tolerance_um) {
  const auto common = common_limits(tolerance_um);
  if (!common) return "by region";
  const LengthUnit unit = length_unit(std::max(std::abs(common->lower), std::abs(common->upper)));
  const auto end = [&](double um) {
    return fmt::format("{}{:.4g}",
                       um < 0.0   ? "−"
                       : um > 0.0 ? "+"
                                  : "",
                       std::abs(um * unit.per_um));
  };
  return fmt::format("{} to {} {}", end(common->lower), end(common->upper), unit.name);
}

std::string verdict_text(const MapPicture& picture) {
  const ToleranceShares s =
      picture.shares.value_or(tolerance_shares(picture.field, picture.tolerance_um));
  std::string text = picture.verdict.empty() ? "" : picture.verdict + "  ·  ";
  text += percent_text(s.in) + " of the area in tolerance";
  for (const auto& [name, percent] :
       {std::pair{"over", s.over}, {"under", s.under}, {"uncut", s.uncut}})
    if (percent > 0.0) text += fmt::format(", {} {}", name, percent_text(percent));
  return text;
}

std::vector<std::string> map_text(const MapPicture& picture, const Tally& counts, double range_um,
                                  const std::string& view) {
  std::vector<std::string> lines{sign_convention};
  if (picture.tolerance_um.rows() > 0)
    lines.push_back(fmt::format("tolerance {}  ·  {}", limits_text(picture.tolerance_um),
                                verdict_text(picture)));
  std::string numbers = fmt::format("{} vertices, ", grouped(counts.vertices()));
  const std::vector<std::string> left_out = excluded_text(counts);
  numbers += left_out.empty() ? "0 uncut" : fmt::format("{}", fmt::join(left_out, ", "));
  if (counts.outside > 0) numbers += fmt::format(", {} outside", grouped(counts.outside));
  lines.push_back(fmt::format("datum {}  ·  alignment {}  ·  view {}  ·  {}", picture.datum,
                              picture.alignment, view, numbers));
  if (const std::string beyond = outlier_text(counts, range_um); !beyond.empty()) {
    lines.push_back(beyond);
  }
  lines.insert(lines.end(), picture.caption.begin(), picture.caption.end());
  return lines;
}

}  // namespace abbe::render
