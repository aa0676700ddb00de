#include "render/machine_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "render/canvas.h"
#include "render/figures.h"
#include "render/layout.h"

namespace abbe::render {

std::vector<std::array<int, 2>> sharp_edges(const cutting::Points& points,
                                            const cutting::Triangles& triangles) {
  using Eigen::Vector3d;
  constexpr double facet = 0.9;  // cosine of the largest angle between facets of one smooth face
                                 // (26 degrees)
  // An edge that is still open at the end has one triangle only: it is a rim.
  std::map<std::array<int, 2>, Vector3d> open;
  std::vector<std::array<int, 2>> sharp;
  for (const auto& t : triangles.rowwise()) {
    const Vector3d a = points.row(t[0]), b = points.row(t[1]), c = points.row(t[2]);
    const Vector3d normal = (b - a).cross(c - a).normalized();
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax({t[k], t[(k + 1) % 3]});
      const auto [seen, first] = open.try_emplace({low, high}, normal);
      // The first triangle at an edge only leaves its normal for the second.
      if (first) continue;
      if (seen->second.dot(normal) < facet) sharp.push_back({low, high});
      open.erase(seen);
    }
  }
  for (const auto& [edge, normal] : open) sharp.push_back(edge);
  return sharp;
}

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Colour edge_colour{0.35, 0.37, 0.40};

/// A body as points, faces and edges, in its own frame.
struct Shell {
  std::vector<Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::array<int, 2>> edges;
  Vector3d middle = Vector3d::Zero();
};

Shell shell(const BlockShape& block) {
  Shell s;
  for (int i = 0; i < 8; ++i) {
    const Vector3d sign((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
    s.points.push_back(0.5 * block.size.cwiseProduct(sign));
    for (int bit = 1; bit < 8; bit *= 2) {
      if ((i & bit) == 0) s.edges.push_back({i, i | bit});
    }
  }
  s.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                 {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return s;
}

Shell shell(const CylinderShape& cylinder) {
  // 64 sides look round at the size of a machine in a picture.
  constexpr int sides = 64;
  Shell s;
  s.middle = {0.0, 0.0, 0.5 * cylinder.height};
  for (int i = 0; i < sides; ++i) {
    const double a = 2.0 * pi * i / sides;
    for (const double z : {0.0, cylinder.height}) {
      s.points.emplace_back(cylinder.radius * std::cos(a), cylinder.radius * std::sin(a), z);
    }
  }
  s.points.emplace_back(0.0, 0.0, 0.0);
  s.points.emplace_back(0.0, 0.0, cylinder.height);
  constexpr int low_centre = 2 * sides;
  for (int i = 0; i < sides; ++i) {
    const int low = 2 * i;
    const int next = 2 * ((i + 1) % sides);
    s.triangles.push_back({low, next, next + 1});
    s.triangles.push_back({low, next + 1, low + 1});
    s.triangles.push_back({low_centre, next, low});
    s.triangles.push_back({low_centre + 1, low + 1, next + 1});
    s.edges.push_back({low, next});
    s.edges.push_back({low + 1, next + 1});
  }
  return s;
}

Shell shell(const SolidShape& solid) {
  Shell s;
  for (const auto& row : solid.vertices.rowwise()) s.points.emplace_back(row.transpose());
  for (const auto& t : solid.triangles.rowwise()) s.triangles.push_back({t[0], t[1], t[2]});
  s.edges = sharp_edges(solid.vertices, solid.triangles);
  s.middle = 0.5 * (solid.vertices.colwise().minCoeff() + solid.vertices.colwise().maxCoeff());
  return s;
}

Shell shell(const Body& body) {
  return std::visit([](const auto& shape) { return shell(shape); }, body.shape);
}

/// Solids and wires, and all points that a view must contain.
struct Stage {
  std::vector<Solid> solids;
  std::vector<Wire> wires;
  cutting::Points points{0, 3};
};

void hold(Stage& stage, const cutting::Points& points) {
  const Eigen::Index n = stage.points.rows();
  stage.points.conservativeResize(n + points.rows(), 3);
  stage.points.bottomRows(points.rows()) = points;
}

void add(Stage& stage, const Body& body) {
  const Shell s = shell(body);
  cutting::Points points(static_cast<Eigen::Index>(s.points.size()), 3);
  for (std::size_t i = 0; i < s.points.size(); ++i) {
    points.row(static_cast<Eigen::Index>(i)) = (body.T * s.points[i]).transpose();
  }
  Solid solid;
  solid.points = points;
  solid.triangles = Eigen::Map<const cutting::Triangles>(
      s.triangles.front().data(), static_cast<Eigen::Index>(s.triangles.size()), 3);
  solid.colour = body.colour;
  solid.opacity = body.opacity;
  solid.shade = 0.4;
  stage.solids.push_back(std::move(solid));
  stage.wires.push_back({points, s.edges, edge_colour, 1.5});
  hold(stage, points);
}

/// Returns the points without those closer together than can be seen: segments shorter than a pixel
/// leave gaps in a line.
cutting::Points apart(const cutting::Points& points) {
  const Eigen::RowVector3d size = points.colwise().maxCoeff() - points.colwise().minCoeff();
  // A two-hundredth of the path is a few pixels in a picture of usual size.
  const double least = size.norm() / 200.0;
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    if (kept.empty() || i + 1 == points.rows() ||
        (points.row(i) - points.row(kept.back())).norm() >= least)
      kept.push_back(i);
  return points(kept, Eigen::all);
}

void add(Stage& stage, const Polyline& path) {
  if (path.points.rows() == 0) return;
  Wire wire{apart(path.points), {}, path.colour, path.width_px};
  for (int i = 1; i < static_cast<int>(wire.points.rows()); ++i)
    wire.segments.push_back({i - 1, i});
  stage.wires.push_back(std::move(wire));
  hold(stage, path.points);
}

void add_part(Stage& stage, const MachinePicture& picture) {
  if (picture.part_triangles.rows() == 0) return;
  Solid solid;
  solid.points = picture.part_vertices;
  solid.triangles = picture.part_triangles;
  solid.colour = picture.part_colour;
  solid.shade = 0.35;
  hold(stage, solid.points);
  stage.solids.push_back(std::move(solid));
}

void check(const MachinePicture& picture) {
  const auto require = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(std::string("machine picture: ") + what);
  };
  bool finite = picture.part_vertices.allFinite() && std::isfinite(picture.magnification);
  for (const Body& body : picture.bodies) {
    finite = finite && body.T.matrix().allFinite();
    for (const Vector3d& p : shell(body).points) finite = finite && p.allFinite();
  }
  for (const Polyline& path : picture.paths) finite = finite && path.points.allFinite();
  for (const Frame& frame : picture.frames) finite = finite && frame.T.matrix().allFinite();
  require(finite, "every number must be finite");
  const auto& t = picture.part_triangles;
  require(t.size() == 0 || (t.minCoeff() >= 0 && t.maxCoeff() < picture.part_vertices.rows()),
          "a triangle names a vertex that is not there");
  require(!picture.bodies.empty() || !picture.paths.empty() || t.size() > 0,
          "there is nothing to draw");
}

/// A name in the column beside the machine, and the point to which its leader points.
struct Callout {
  std::string text;
  Vector2d point;
};

std::vector<Callout> callouts(const MachinePicture& picture, const View& view) {
  std::vector<Callout> result;
  for (const Body& body : picture.bodies) {
    if (body.label.empty()) continue;
    // The rightmost corner is rarely hidden.
    Vector2d point = projected(view, body.T * shell(body).points.front());
    for (const Vector3d& p : shell(body).points) {
      const Vector2d seen = projected(view, body.T * p);
      if (seen.x() > point.x()) point = seen;
    }
    result.push_back({body.label, point});
  }
  for (const Frame& frame : picture.frames) {
    if (!frame.name.empty()) result.push_back({frame.name, projected(view, frame.T.translation())});
  }
  // Sorted by height, so that the leaders do not cross.
  std::stable_sort(result.begin(), result.end(),
                   [](const Callout& a, const Callout& b) { return a.point.y() > b.point.y(); });
  return result;
}

/// Returns the heights of labels, from above, as near to their points as possible and at least
/// `pitch` apart.
std::vector<double> spread(const std::vector<Callout>& all, const Rectangle& column, double pitch) {
  std::vector<double> y;
  for (const Callout& one : all) {
    const double free = y.empty() ? column.y + column.height - 0.5 * pitch : y.back() - pitch;
    y.push_back(std::min(one.point.y(), free));
  }
  // The first pass pushes labels down, the second pushes those back up that left the column.
  double lowest = column.y + 0.5 * pitch;
  for (std::size_t i = y.size(); i-- > 0;) {
    y[i] = std::max(y[i], lowest);
    lowest = y[i] + pitch;
  }
  return y;
}

/// Returns the width of the names beside the machine, px, at most `most`; longer names are cut.
double column_width(const std::vector<std::string>& names, const TextStyle& style, double most) {
  double width = 5.0 * style.size_px;
  for (const std::string& name : names) width = std::max(width, text_size(name, style).x() + 1.0);
  return std::min(width, most);
}

std::vector<std::string> names_of(const MachinePicture& picture) {
  std::vector<std::string> names;
  for (const Body& body : picture.bodies) names.push_back(body.label);
  for (const Frame& frame : picture.frames) names.push_back(frame.name);
  return names;
}

/// Returns the style, reduced if so many names would not fit one above the other.
TextStyle fitting(TextStyle style, std::size_t count, double height) {
  const double needed = double(count) * line_height(style);
  if (needed > height) style.size_px *= 0.98 * height / needed;
  return style;
}

void draw_callouts(Canvas& canvas, const std::vector<Callout>& all, const Rectangle& column,
                   const TextStyle& usual) {
  const TextStyle style = fitting(usual, all.size(), column.height);
  const std::vector<double> y = spread(all, column, line_height(style));
  TextStyle beside = style;
  beside.upward = 0.5;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double knee = column.x - 0.4 * style.size_px;
    canvas.line({all[i].point, {knee - style.size_px, y[i]}, {knee, y[i]}}, colours::faint_ink,
                1.5);
    const double dot = 0.12 * style.size_px;
    canvas.fill({all[i].point.x() - dot, all[i].point.y() - dot, 2.0 * dot, 2.0 * dot},
                colours::faint_ink);
    canvas.text({column.x, y[i]}, wrapped(all[i].text, beside, column.width, 1).front(), beside);
  }
}

/// Draws arrows along the axes of a frame; X red, Y green, Z blue.
void draw_frame(Canvas& canvas, const View& view, const Frame& frame, double length_px) {
  constexpr std::array<Colour, 3> colour{
      {{0.75, 0.15, 0.12}, {0.12, 0.50, 0.18}, {0.13, 0.27, 0.70}}};
  const Vector2d origin = projected(view, frame.T.translation());
  for (int i = 0; i < 3; ++i) {
    const Vector3d axis = frame.T.linear().col(i);
    const Vector2d tip = origin + length_px * Vector2d(axis.dot(view.right), axis.dot(view.up));
    canvas.line({origin, tip}, colour[i], 3.0);
  }
}

/// Draws colours and names of the paths and the part; returns the height used.
double legend(Canvas& canvas, const MachinePicture& picture, Vector2d at, const TextStyle& style) {
  const double top = at.y();
  const auto entry = [&](const Colour& colour, const std::string& name) {
    if (name.empty()) return;
    at.y() -= line_height(style);
    swatch(canvas, at, colour, name, style);
  };
  if (picture.part_triangles.rows() > 0) entry(picture.part_colour, picture.part_name);
  for (const Polyline& path : picture.paths) entry(path.colour, path.name);
  return top - at.y();
}

}  // namespace

void write_machine(const std::filesystem::path& path, const MachinePicture& picture,
                   const MachineOptions& options) {
  check(picture);
  const TypeSizes type = type_sizes(options.width, options.height * 6 / 5);
  const double u = type.unit;
  const TextStyle title{.size_px = type.title, .bold = true};
  const TextStyle body{.size_px = type.body};
  const double margin = 40.0 * u;
  const double text_width = options.width - 2.0 * margin;
  std::vector<std::string> lines;
  for (const std::string& text : picture.caption) {
    for (const std::string& line : wrapped(text, body, text_width)) lines.push_back(line);
  }
  const double foot = 0.7 * margin + static_cast<double>(lines.size()) * line_height(body);
  const double strip = picture.bodies.empty() ? 84.0 * u : 140.0 * u;
  const double head = 30.0 * u + 1.38 * (type.title + type.figures) + 16.0 * u;

  Stage detail;
  add_part(detail, picture);
  for (const Polyline& line : picture.paths) add(detail, line);
  // The detailed view has no bodies yet, and those near the part are added to it afterwards.
  Stage whole = detail;
  for (const Body& one : picture.bodies) add(whole, one);
  for (const Frame& frame : picture.frames) hold(whole, frame.T.translation().transpose());
  for (const Body& one : picture.bodies)
    if (one.close) add(detail, one);

  const bool both = detail.points.rows() > 0 && !picture.bodies.empty();
  const double height = options.height - head - foot - strip;
  const double left_width = both ? 0.54 * text_width : text_width;
  const Rectangle left{margin, foot + strip, left_width, height};
  const Rectangle right{margin + left_width + 40.0 * u, foot + strip,
                        text_width - left_width - 40.0 * u, height};

  Canvas canvas(options.width, options.height);
  const double used = paragraph(canvas, {margin, options.height - 30.0 * u},
                                wrapped(picture.title, title, text_width, 1), title);
  if (picture.magnification != 1.0) {
    paragraph(canvas, {margin, options.height - 30.0 * u - used},
              {fmt::format("errors magnified {} ×", figure(picture.magnification))},
              {.size_px = type.figures});
  }
  const double lines_px = 36.0 * u;  // between the machine and the names
  const double names = picture.bodies.empty() && picture.frames.empty()
                           ? 0.0
                           : lines_px + column_width(names_of(picture), body, 0.4 * left.width);
  const Rectangle stage{left.x, left.y, left.width - names, left.height};
  const View view = fit_view(whole.points, options.from, options.up, stage);
  canvas.scene(view, whole.solids, whole.wires);
  for (const Frame& frame : picture.frames) draw_frame(canvas, view, frame, 1.6 * body.size_px);
  draw_callouts(canvas, callouts(picture, view),
                {stage.x + stage.width + lines_px, left.y, names - lines_px, left.height}, body);
  if (!picture.bodies.empty()) {
    triad(canvas, view, {left.x + left.width - 90.0 * u, foot + 0.4 * strip}, 40.0 * u, body);
  }
  scale_bar(canvas, view, {left.x, foot + 0.5 * strip}, 0.3 * left.width, body);

  const Rectangle& beside = both ? right : left;
  const double legend_height = legend(canvas, picture, {beside.x, beside.y + beside.height}, body);
  if (both) {
    const Rectangle rest{right.x, right.y, right.width, right.height - legend_height - 16.0 * u};
    const View close = fit_view(detail.points, options.from, options.up, rest);
    canvas.scene(close, detail.solids, detail.wires);
    scale_bar(canvas, close, {right.x, foot + 0.5 * strip}, 0.4 * right.width, body);
  }
  paragraph(canvas, {margin, foot}, lines, body);
  canvas.write_png(path);
}

}  // namespace abbe::render
