#include "render/stock_picture.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <ranges>

#include "cutting/stock/part_deviation.h"
#include "kinematics/bad_input.h"
#include "render/canvas.h"
#include "render/colour_bar.h"
#include "render/figures.h"
#include "render/layout.h"
#include "render/residual_map.h"
#include "render/surface_scene.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

/// Inclusion of the values beyond the band in a field of the skin.
enum class ValuesBeyondBand { Included, Excluded };

/// Returns the deviations as a field on the skin of the body. Compared vertices have the status
/// cut, all others the status outside.
Field skin_field(const StockField& stock, ValuesBeyondBand values_beyond_band) {
  Field field;
  field.design.vertices = stock.mesh.vertices_w;
  field.design.triangles = stock.mesh.triangles;
  field.design.normals = cutting::vertex_normals(stock.mesh.vertices_w, stock.mesh.triangles);
  field.design.area = cutting::vertex_area(stock.mesh.vertices_w, stock.mesh.triangles);
  field.deviation_um = stock.deviation_um;
  for (Eigen::Index i = 0; i < stock.deviation_um.size(); ++i) {
    const auto status = cutting::SkinStatus(stock.compared[std::size_t(i)]);
    const bool is_shown = status == cutting::SkinStatus::Compared ||
                          (values_beyond_band == ValuesBeyondBand::Included &&
                           status == cutting::SkinStatus::BeyondBand);
    field.status.push_back(is_shown ? 0 : 2);
    // A value limited to the band is increased, so that it gets the colour beyond the scale.
    if (status == cutting::SkinStatus::BeyondBand) field.deviation_um[i] *= 1.01;
    if (!is_shown) field.deviation_um[i] = std::numeric_limits<double>::quiet_NaN();
  }
  return field;
}

bool has_compared_vertices(const Field& field) {
  return std::ranges::find(field.status, std::uint8_t(0)) != field.status.end();
}

/// Returns the ends of a scale that contains zero and most of the compared values. Its length is at
/// least 1 µm, the resolution of the dexels where an axis turns.
Span scale_ends(const Field& field) {
  constexpr double min_um = 1.0;
  if (!has_compared_vertices(field)) return {-min_um, min_um};
  Span ends = fitted_ends_um(field);
  widen(ends, 0.0);
  return ends.upper - ends.lower < min_um ? Span{-min_um, min_um} : ends;
}

/// Returns the values for drawing. Values at an end of the scale are moved inside, so that they do
/// not get the colour beyond it.
Eigen::VectorXd drawn_values(const Eigen::VectorXd& deviation_um, const ColourScale& scale) {
  const double margin = 1e-3 * (scale.high - scale.low);
  Eigen::VectorXd values = deviation_um.array().isFinite().select(deviation_um, scale.low);
  for (double& value : values) {
    if (std::abs(value - scale.high) < 1e-6 * margin) value = scale.high - margin;
    if (std::abs(value - scale.low) < 1e-6 * margin) value = scale.low + margin;
  }
  return values;
}

/// Returns two solids: the triangles with a deviation at every corner, and the others.
std::vector<Solid> skin_solids(const Field& field, const ColourScale& scale) {
  std::vector<int> corners[2];
  for (const auto& t : field.design.triangles.rowwise()) {
    bool has_deviation = true;
    for (const int corner : t)
      has_deviation = has_deviation && field.status[std::size_t(corner)] == 0;
    std::vector<int>& list = corners[has_deviation ? 0 : 1];
    list.insert(list.end(), t.begin(), t.end());
  }
  std::vector<Solid> solids;
  for (const int grey : {0, 1}) {
    if (corners[grey].empty()) continue;
    Solid solid;
    solid.points = field.design.vertices;
    solid.normals = field.design.normals;
    solid.triangles = Eigen::Map<const cutting::Triangles>(
        corners[grey].data(), Eigen::Index(corners[grey].size() / 3), 3);
    solid.colour = colours::outside;
    solid.shade = 0.35;
    if (grey == 0) {
      solid.scale = scale;
      solid.values = drawn_values(field.deviation_um, scale);
    }
    solids.push_back(std::move(solid));
  }
  return solids;
}

/// Returns the vertices of a finding in the order of their distance from its middle.
std::vector<Eigen::Index> finding_vertices(const StockField& field, int number) {
  std::vector<Eigen::Index> vertices;
  Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
  for (std::size_t v = 0; v < field.finding.size(); ++v) {
    if (field.finding[v] != number && field.undercut[v] != number) continue;
    vertices.push_back(Eigen::Index(v));
    middle += field.mesh.vertices_w.row(Eigen::Index(v));
  }
  middle /= std::max(1.0, double(vertices.size()));
  std::ranges::stable_sort(vertices, {}, [&](Eigen::Index v) {
    return (field.mesh.vertices_w.row(v) - middle).squaredNorm();
  });
  return vertices;
}

/// Returns a visible point of a finding, preferably near its largest depth. Returns nothing if all
/// candidates are hidden.
std::optional<Eigen::Vector3d> visible_point(const StockField& field, int number, const View& view,
                                             const cutting::Design& design) {
  // Each candidate is tested against all triangles of the body, which takes time.
  constexpr std::size_t max_candidates = 16;
  // Points with at least 80 % of the largest depth represent the finding equally well.
  constexpr double min_depth_ratio = 0.8;
  const auto depth = [&](Eigen::Index v) {
    const double um = std::abs(field.deviation_um[v]);
    return std::isfinite(um) ? um : 0.0;
  };
  const std::vector<Eigen::Index> vertices = finding_vertices(field, number);
  if (vertices.empty()) return std::nullopt;
  const double min_depth =
      min_depth_ratio * std::ranges::max(vertices | std::views::transform(depth));
  std::vector<Eigen::Index> deep_vertices;
  std::ranges::copy_if(vertices, std::back_inserter(deep_vertices),
                       [&](auto v) { return depth(v) >= min_depth; });
  for (const std::vector<Eigen::Index>& candidates : {deep_vertices, vertices})
    for (std::size_t i = 0; i < candidates.size(); i += 1 + candidates.size() / max_candidates) {
      const Eigen::Vector3d point = field.mesh.vertices_w.row(candidates[i]);
      if (!is_hidden(view, design, point)) return point;
    }
  return std::nullopt;
}

/// Returns flags for the marks to be drawn, in the order of the marks.
std::vector<Flag> mark_flags(const StockPicture& picture, const View& view,
                             const cutting::Design& design) {
  std::vector<char> hidden, selected(picture.marks.size(), 0);
  std::vector<Eigen::Vector3d> at;
  for (const StockPicture::Mark& mark : picture.marks) {
    at.push_back(mark.at);
    hidden.push_back(is_hidden(view, design, mark.at));
    if (hidden.back() == 0 || mark.number == 0) continue;
    const auto point = visible_point(picture.field, mark.number, view, design);
    hidden.back() = !point;
    at.back() = point.value_or(mark.at);
  }
  // Visible marks are selected first; hidden ones only if their kind has fewer than the maximum.
  std::map<int, int> count;  // by kind
  for (const char hidden_value : {0, 1})
    for (std::size_t i = 0; i < hidden.size(); ++i)
      if (hidden[i] == hidden_value && count[picture.marks[i].kind] < picture.max_marks_per_kind) {
        ++count[picture.marks[i].kind];
        selected[i] = 1;
      }
  std::vector<Flag> flags;
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    const StockPicture::Mark& mark = picture.marks[i];
    if (selected[i] != 0)
      flags.push_back(
          {project(view, at[i]), mark.text + (hidden[i] != 0 ? ", behind" : ""), hidden[i] != 0});
  }
  return flags;
}

}  // namespace

void write_stock_picture(const std::filesystem::path& path, const StockPicture& picture) {
  const StockField& stock = picture.field;
  const auto n = std::size_t(stock.mesh.vertices_w.rows());
  require(stock.mesh.triangles.rows() > 0, "stock: there is nothing to draw");
  require(std::size_t(stock.deviation_um.size()) == n && stock.compared.size() == n,
          "stock: expected one deviation per vertex");
  const Field field = skin_field(stock, ValuesBeyondBand::Included);
  const Span ends = scale_ends(skin_field(stock, ValuesBeyondBand::Excluded));
  const ColourScale scale = colour_scale(ends.lower, ends.upper);

  const TypeSizes type = type_sizes(picture.width, picture.height);
  const double u = type.unit, margin = 40.0 * u;
  const TextStyle title{.size_px = type.title, .bold = true}, body{.size_px = type.body};
  const double text_width = picture.width - 2.0 * margin, side = 270.0 * u;
  std::vector<std::string> lines;
  for (const std::string& text : picture.caption)
    for (const std::string& line : wrap_text(text, body, text_width)) lines.push_back(line);
  const std::vector<std::string> head = wrap_text(picture.title, title, text_width, 2);
  const double head_height = 30.0 * u + 1.38 * double(head.size()) * type.title + 22.0 * u;
  const double strip = 0.7 * margin + double(lines.size()) * line_height(body),
               bottom = strip + 64.0 * u;
  const Rectangle map{margin, bottom, text_width - side, picture.height - head_height - bottom};
  const Rectangle bar{picture.width - margin - side + 116.0 * u, bottom + 190.0 * u, 38.0 * u,
                      map.height - 72.0 * u - 190.0 * u};

  Canvas canvas(picture.width, picture.height);
  const View view = fit_view(field.design.vertices, picture.from, picture.up, map);
  canvas.scene(view, skin_solids(field, scale), {});
  draw_paragraph(canvas, {margin, picture.height - 30.0 * u}, head, title);
  const double middle = strip + 32.0 * u;
  draw_scale_bar(canvas, view, {margin, middle}, 0.22 * map.width, body);
  if (std::ranges::find(field.status, std::uint8_t(2)) != field.status.end())
    draw_swatch(canvas, {margin + 0.42 * map.width, middle}, colours::outside,
                "not compared with the design", body);
  if (has_compared_vertices(field)) {
    const double lowest =
        field.deviation_um.array().isFinite().select(field.deviation_um, ends.lower).minCoeff();
    const double highest =
        field.deviation_um.array().isFinite().select(field.deviation_um, ends.upper).maxCoeff();
    ColourBar side_bar{scale, (lowest < ends.lower), (highest > ends.upper)};
    side_bar.histogram = histogram_fractions(field.deviation_um, field.design.area, ends,
                                             std::max(8, int(bar.height / 7.0)));
    side_bar.histogram_px = 74.0 / 38.0 * bar.width;
    draw_colour_bar(canvas, bar, side_bar, body);
  }
  draw_triad(canvas, view, {picture.width - margin - 0.5 * side + 30.0 * u, bottom + 62.0 * u},
             46.0 * u, body);
  draw_flags(canvas, mark_flags(picture, view, field.design), map, body);
  draw_paragraph(canvas, {margin, strip}, lines, body);
  canvas.write_png(path);
}

}  // namespace abbe::render
