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

/// Returns the deviation as a map of the skin: compared vertices as cut, all others as outside.
Field skin_field(const StockField& stock, bool include_cut_off) {
  Field field;
  field.design.vertices = stock.mesh.vertices_w;
  field.design.triangles = stock.mesh.triangles;
  field.design.normals = cutting::vertex_normals(stock.mesh.vertices_w, stock.mesh.triangles);
  field.design.area = cutting::vertex_area(stock.mesh.vertices_w, stock.mesh.triangles);
  field.deviation_um = stock.deviation_um;
  for (Eigen::Index i = 0; i < stock.deviation_um.size(); ++i) {
    const auto status = cutting::SkinStatus(stock.compared[std::size_t(i)]);
    const bool shows = status == cutting::SkinStatus::Compared ||
                       (include_cut_off && status == cutting::SkinStatus::CutOff);
    field.status.push_back(shows ? 0 : 2);
    // A value cut off at the band lies beyond it and gets the colour beyond the scale.
    if (status == cutting::SkinStatus::CutOff) field.deviation_um[i] *= 1.01;
    if (!shows) field.deviation_um[i] = std::numeric_limits<double>::quiet_NaN();
  }
  return field;
}

bool has_compared(const Field& field) {
  return std::ranges::find(field.status, std::uint8_t(0)) != field.status.end();
}

/// Returns ends with zero and most of the compared values, at least 1 µm, the resolution of the
/// dexels where an axis turns.
Span scale_ends(const Field& field) {
  constexpr double min_um = 1.0;
  if (!has_compared(field)) return {-min_um, min_um};
  Span ends = fitted_ends_um(field);
  widen(ends, 0.0);
  return ends.upper - ends.lower < min_um ? Span{-min_um, min_um} : ends;
}

/// Returns the values for drawing: a value at an end of the scale is shown within it, not in the
/// colour beyond.
Eigen::VectorXd drawn_values(const Eigen::VectorXd& deviation_um, const ColourScale& scale) {
  const double least = 1e-3 * (scale.high - scale.low);
  Eigen::VectorXd values = deviation_um.array().isFinite().select(deviation_um, scale.low);
  for (double& value : values) {
    if (std::abs(value - scale.high) < 1e-6 * least) value = scale.high - least;
    if (std::abs(value - scale.low) < 1e-6 * least) value = scale.low + least;
  }
  return values;
}

/// Returns the triangles with a deviation at every corner, and those without, as two solids.
std::vector<Solid> skin_solids(const Field& field, const ColourScale& scale) {
  std::vector<int> corners[2];
  for (const auto& t : field.design.triangles.rowwise()) {
    bool shows = true;
    for (const int corner : t) shows = shows && field.status[std::size_t(corner)] == 0;
    std::vector<int>& list = corners[shows ? 0 : 1];
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

/// Returns the vertices of a finding, from its middle outwards.
std::vector<Eigen::Index> vertices_of(const StockField& field, int number) {
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

/// Returns a visible point of a finding, nearly its deepest if that is visible; empty if all points
/// tried are hidden.
std::optional<Eigen::Vector3d> visible_point(const StockField& field, int number, const View& view,
                                             const cutting::Design& design) {
  // 16 tries: each tests all triangles of the body.
  constexpr std::size_t max_tried = 16;
  // Within 80 % of the largest depth one point represents the finding as well as another.
  constexpr double about = 0.8;
  const auto depth = [&](Eigen::Index v) {
    const double um = std::abs(field.deviation_um[v]);
    return std::isfinite(um) ? um : 0.0;
  };
  const std::vector<Eigen::Index> all = vertices_of(field, number);
  if (all.empty()) return std::nullopt;
  const double least = about * std::ranges::max(all | std::views::transform(depth));
  std::vector<Eigen::Index> deep;
  std::ranges::copy_if(all, std::back_inserter(deep), [&](auto v) { return depth(v) >= least; });
  for (const std::vector<Eigen::Index>& tried : {deep, all})
    for (std::size_t i = 0; i < tried.size(); i += 1 + tried.size() / max_tried) {
      const Eigen::Vector3d place = field.mesh.vertices_w.row(tried[i]);
      if (!is_hidden(view, design, place)) return place;
    }
  return std::nullopt;
}

/// Returns the marks to be shown, in their order.
std::vector<Flag> extreme_flags(const StockPicture& picture, const View& view,
                                const cutting::Design& design) {
  std::vector<char> hidden, shown(picture.marks.size(), 0);
  std::vector<Eigen::Vector3d> at;
  for (const StockPicture::Mark& mark : picture.marks) {
    at.push_back(mark.at);
    hidden.push_back(is_hidden(view, design, mark.at));
    if (hidden.back() == 0 || mark.number == 0) continue;
    const auto other = visible_point(picture.field, mark.number, view, design);
    hidden.back() = !other;
    at.back() = other.value_or(mark.at);
  }
  // Visible marks first; hidden ones only fill the remaining places of their kind.
  std::map<int, int> count;  // by kind
  for (const char wanted : {0, 1})
    for (std::size_t i = 0; i < hidden.size(); ++i)
      if (hidden[i] == wanted && count[picture.marks[i].kind] < picture.max_marks_per_kind) {
        ++count[picture.marks[i].kind];
        shown[i] = 1;
      }
  std::vector<Flag> flags;
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    const StockPicture::Mark& mark = picture.marks[i];
    if (shown[i] != 0)
      flags.push_back(
          {projected(view, at[i]), mark.text + (hidden[i] != 0 ? ", behind" : ""), hidden[i] != 0});
  }
  return flags;
}

}  // namespace

void write_stock_picture(const std::filesystem::path& path, const StockPicture& picture) {
  const StockField& stock = picture.field;
  const auto n = std::size_t(stock.mesh.vertices_w.rows());
  require(stock.mesh.triangles.rows() > 0, "stock: there is nothing to draw");
  require(std::size_t(stock.deviation_um.size()) == n && stock.compared.size() == n,
          "stock: one deviation a vertex is needed");
  const Field field = skin_field(stock, true), within = skin_field(stock, false);
  const Span ends = scale_ends(within);
  const ColourScale scale = colour_scale(ends.lower, ends.upper);

  const TypeSizes type = type_sizes(picture.width, picture.height);
  const double u = type.unit, margin = 40.0 * u;
  const TextStyle title{.size_px = type.title, .bold = true}, body{.size_px = type.body};
  const double text_width = picture.width - 2.0 * margin, side = 270.0 * u;
  std::vector<std::string> lines;
  for (const std::string& text : picture.caption)
    for (const std::string& line : wrapped(text, body, text_width)) lines.push_back(line);
  const std::vector<std::string> head = wrapped(picture.title, title, text_width, 2);
  const double head_height = 30.0 * u + 1.38 * double(head.size()) * type.title + 22.0 * u;
  const double strip = 0.7 * margin + double(lines.size()) * line_height(body),
               bottom = strip + 64.0 * u;
  const Rectangle map{margin, bottom, text_width - side, picture.height - head_height - bottom};
  const Rectangle bar{picture.width - margin - side + 116.0 * u, bottom + 190.0 * u, 38.0 * u,
                      map.height - 72.0 * u - 190.0 * u};

  Canvas canvas(picture.width, picture.height);
  const View view = fit_view(field.design.vertices, picture.from, picture.up, map);
  canvas.scene(view, skin_solids(field, scale), {});
  paragraph(canvas, {margin, picture.height - 30.0 * u}, head, title);
  const double middle = strip + 32.0 * u;
  scale_bar(canvas, view, {margin, middle}, 0.22 * map.width, body);
  if (std::ranges::find(field.status, std::uint8_t(2)) != field.status.end())
    swatch(canvas, {margin + 0.42 * map.width, middle}, colours::outside,
           "not compared with the design", body);
  if (has_compared(field)) {
    const double lowest =
        field.deviation_um.array().isFinite().select(field.deviation_um, ends.lower).minCoeff();
    const double highest =
        field.deviation_um.array().isFinite().select(field.deviation_um, ends.upper).maxCoeff();
    ColourBar side_bar{scale, lowest<ends.lower, highest> ends.upper};
    side_bar.shares = histogram_fractions(field.deviation_um, field.design.area, ends,
                                          std::max(8, int(bar.height / 7.0)));
    side_bar.histogram_px = 74.0 / 38.0 * bar.width;
    colour_bar(canvas, bar, side_bar, body);
  }
  triad(canvas, view, {picture.width - margin - 0.5 * side + 30.0 * u, bottom + 62.0 * u}, 46.0 * u,
        body);
  draw_flags(canvas, extreme_flags(picture, view, field.design), map, body);
  paragraph(canvas, {margin, strip}, lines, body);
  canvas.write_png(path);
}

}  // namespace abbe::render
