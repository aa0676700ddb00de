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
  constexpr double min_cosine = 0.9;  // of the angle between facets of a smooth face (26 degrees)
  // Normals of the triangles at edges with one triangle so far.
  std::map<std::array<int, 2>, Vector3d> open_edges;
  std::vector<std::array<int, 2>> sharp;
  for (const auto& t : triangles.rowwise()) {
    const Vector3d a = points.row(t[0]), b = points.row(t[1]), c = points.row(t[2]);
    const Vector3d normal = (b - a).cross(c - a).normalized();
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax({t[k], t[(k + 1) % 3]});
      const auto [entry, is_first_triangle] = open_edges.try_emplace({low, high}, normal);
      if (is_first_triangle) continue;
      if (entry->second.dot(normal) < min_cosine) sharp.push_back({low, high});
      open_edges.erase(entry);
    }
  }
  // The remaining edges have one triangle only; the surface ends there.
  for (const auto& [edge, normal] : open_edges) sharp.push_back(edge);
  return sharp;
}

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Colour edge_colour{0.35, 0.37, 0.40};

/// The shape of a body as points, faces and edges, in its own frame.
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
  // With 64 sides a cylinder looks round at the size of a picture.
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

/// The solids and lines of a view, and all points that the view must contain.
struct MachineScene {
  std::vector<Solid> solids;
  std::vector<Wire> wires;
  cutting::Points points{0, 3};
};

/// Adds points that the view must contain.
void add_view_points(MachineScene& scene, const cutting::Points& points) {
  const Eigen::Index n = scene.points.rows();
  scene.points.conservativeResize(n + points.rows(), 3);
  scene.points.bottomRows(points.rows()) = points;
}

void add(MachineScene& scene, const Body& body) {
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
  scene.solids.push_back(std::move(solid));
  scene.wires.push_back({points, s.edges, edge_colour, 1.5});
  add_view_points(scene, points);
}

/// Returns the points of a path without those that are too close to the previous one. Segments
/// shorter than a pixel would leave gaps in a line.
cutting::Points spaced_points(const cutting::Points& points) {
  const Eigen::RowVector3d size = points.colwise().maxCoeff() - points.colwise().minCoeff();
  // A two-hundredth of the path is a few pixels in a picture of usual size.
  const double min_distance = size.norm() / 200.0;
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    if (rows.empty() || i + 1 == points.rows() ||
        (points.row(i) - points.row(rows.back())).norm() >= min_distance)
      rows.push_back(i);
  return points(rows, Eigen::all);
}

void add(MachineScene& scene, const DrawnPath& path) {
  if (path.points.rows() == 0) return;
  Wire wire{spaced_points(path.points), {}, path.colour, path.width_px};
  for (int i = 1; i < static_cast<int>(wire.points.rows()); ++i)
    wire.segments.push_back({i - 1, i});
  scene.wires.push_back(std::move(wire));
  add_view_points(scene, path.points);
}

void add_part(MachineScene& scene, const MachinePicture& picture) {
  if (picture.part_triangles.rows() == 0) return;
  Solid solid;
  solid.points = picture.part_vertices;
  solid.triangles = picture.part_triangles;
  solid.colour = picture.part_colour;
  solid.shade = 0.35;
  add_view_points(scene, solid.points);
  scene.solids.push_back(std::move(solid));
}

void check_picture(const MachinePicture& picture) {
  const auto require = [](bool condition, const char* message) {
    if (!condition) throw std::invalid_argument(std::string("machine picture: ") + message);
  };
  bool is_finite = picture.part_vertices.allFinite() && std::isfinite(picture.magnification);
  for (const Body& body : picture.bodies) {
    is_finite = is_finite && body.T.matrix().allFinite();
    for (const Vector3d& p : shell(body).points) is_finite = is_finite && p.allFinite();
  }
  for (const DrawnPath& path : picture.paths) is_finite = is_finite && path.points.allFinite();
  for (const Frame& frame : picture.frames) is_finite = is_finite && frame.T.matrix().allFinite();
  require(is_finite, "all numbers must be finite");
  const auto& t = picture.part_triangles;
  require(t.size() == 0 || (t.minCoeff() >= 0 && t.maxCoeff() < picture.part_vertices.rows()),
          "a triangle refers to a vertex that does not exist");
  require(!picture.bodies.empty() || !picture.paths.empty() || t.size() > 0,
          "there is nothing to draw");
}

/// A name in the column beside the machine, and the point to which its leader line leads.
struct Callout {
  std::string text;
  Vector2d point;
};

std::vector<Callout> callouts(const MachinePicture& picture, const View& view) {
  std::vector<Callout> list;
  for (const Body& body : picture.bodies) {
    if (body.label.empty()) continue;
    // The corner farthest to the right is rarely hidden.
    Vector2d point = project(view, body.T * shell(body).points.front());
    for (const Vector3d& p : shell(body).points) {
      const Vector2d projected_point = project(view, body.T * p);
      if (projected_point.x() > point.x()) point = projected_point;
    }
    list.push_back({body.label, point});
  }
  for (const Frame& frame : picture.frames) {
    if (!frame.name.empty()) list.push_back({frame.name, project(view, frame.T.translation())});
  }
  // In the order of height, so that the leader lines do not cross.
  std::stable_sort(list.begin(), list.end(),
                   [](const Callout& a, const Callout& b) { return a.point.y() > b.point.y(); });
  return list;
}

/// Returns the heights of labels, top to bottom, near their points and at least `pitch` apart.
std::vector<double> label_heights(const std::vector<Callout>& callouts, const Rectangle& column,
                                  double pitch) {
  std::vector<double> y;
  for (const Callout& callout : callouts) {
    const double highest = y.empty() ? column.y + column.height - 0.5 * pitch : y.back() - pitch;
    y.push_back(std::min(callout.point.y(), highest));
  }
  // The first pass pushes labels down; the second one pushes those up that are below the column.
  double lowest = column.y + 0.5 * pitch;
  for (std::size_t i = y.size(); i-- > 0;) {
    y[i] = std::max(y[i], lowest);
    lowest = y[i] + pitch;
  }
  return y;
}

/// Returns the width of the column of names, px. Names that do not fit are shortened.
double column_width(const std::vector<std::string>& names, const TextStyle& style,
                    double max_width) {
  double width = 5.0 * style.size_px;
  for (const std::string& name : names) width = std::max(width, text_size(name, style).x() + 1.0);
  return std::min(width, max_width);
}

std::vector<std::string> body_and_frame_names(const MachinePicture& picture) {
  std::vector<std::string> names;
  for (const Body& body : picture.bodies) names.push_back(body.label);
  for (const Frame& frame : picture.frames) names.push_back(frame.name);
  return names;
}

/// Returns the style, in a smaller size if so many lines would not fit into the height.
TextStyle fit_style(TextStyle style, std::size_t line_count, double height) {
  const double required_height = double(line_count) * line_height(style);
  if (required_height > height) style.size_px *= 0.98 * height / required_height;
  return style;
}

void draw_callouts(Canvas& canvas, const std::vector<Callout>& callouts, const Rectangle& column,
                   const TextStyle& body_style) {
  const TextStyle style = fit_style(body_style, callouts.size(), column.height);
  const std::vector<double> y = label_heights(callouts, column, line_height(style));
  TextStyle label_style = style;
  label_style.vertical_anchor = 0.5;
  for (std::size_t i = 0; i < callouts.size(); ++i) {
    const Vector2d& point = callouts[i].point;
    const double leader_end = column.x - 0.4 * style.size_px;
    canvas.line({point, {leader_end - style.size_px, y[i]}, {leader_end, y[i]}}, colours::faint_ink,
                1.5);
    const double dot = 0.12 * style.size_px;
    canvas.fill({point.x() - dot, point.y() - dot, 2.0 * dot, 2.0 * dot}, colours::faint_ink);
    canvas.text({column.x, y[i]}, wrap_text(callouts[i].text, label_style, column.width, 1).front(),
                label_style);
  }
}

/// Draws the axes of a frame: X red, Y green, Z blue.
void draw_frame(Canvas& canvas, const View& view, const Frame& frame, double length_px) {
  constexpr std::array<Colour, 3> colour{
      {{0.75, 0.15, 0.12}, {0.12, 0.50, 0.18}, {0.13, 0.27, 0.70}}};
  const Vector2d origin = project(view, frame.T.translation());
  for (int i = 0; i < 3; ++i) {
    const Vector3d axis = frame.T.linear().col(i);
    const Vector2d tip = origin + length_px * Vector2d(axis.dot(view.right), axis.dot(view.up));
    canvas.line({origin, tip}, colour[i], 3.0);
  }
}

/// Draws colours and names of the part and the paths.
/// @return the height used, px
double draw_legend(Canvas& canvas, const MachinePicture& picture, Vector2d at,
                   const TextStyle& style) {
  const double top = at.y();
  const auto entry = [&](const Colour& colour, const std::string& name) {
    if (name.empty()) return;
    at.y() -= line_height(style);
    draw_swatch(canvas, at, colour, name, style);
  };
  if (picture.part_triangles.rows() > 0) entry(picture.part_colour, picture.part_name);
  for (const DrawnPath& path : picture.paths) entry(path.colour, path.name);
  return top - at.y();
}

}  // namespace

void write_machine_picture(const std::filesystem::path& path, const MachinePicture& picture,
                           const MachinePictureOptions& options) {
  check_picture(picture);
  const TypeSizes type = type_sizes(options.width, options.height * 6 / 5);
  const double u = type.unit;
  const TextStyle title{.size_px = type.title, .bold = true};
  const TextStyle body{.size_px = type.body};
  const double margin = 40.0 * u;
  const double text_width = options.width - 2.0 * margin;
  std::vector<std::string> lines;
  for (const std::string& text : picture.caption) {
    for (const std::string& line : wrap_text(text, body, text_width)) lines.push_back(line);
  }
  const double foot = 0.7 * margin + static_cast<double>(lines.size()) * line_height(body);
  const double strip = picture.bodies.empty() ? 84.0 * u : 140.0 * u;
  const double head = 30.0 * u + 1.38 * (type.title + type.figures) + 16.0 * u;

  MachineScene close_up;
  add_part(close_up, picture);
  for (const DrawnPath& drawn_path : picture.paths) add(close_up, drawn_path);
  MachineScene whole = close_up;
  for (const Body& machine_body : picture.bodies) add(whole, machine_body);
  for (const Frame& frame : picture.frames)
    add_view_points(whole, frame.T.translation().transpose());
  for (const Body& machine_body : picture.bodies)
    if (machine_body.in_close_up) add(close_up, machine_body);

  const bool has_close_up = close_up.points.rows() > 0 && !picture.bodies.empty();
  const double height = options.height - head - foot - strip;
  const double left_width = has_close_up ? 0.54 * text_width : text_width;
  const Rectangle left{margin, foot + strip, left_width, height};
  const Rectangle right{margin + left_width + 40.0 * u, foot + strip,
                        text_width - left_width - 40.0 * u, height};

  Canvas canvas(options.width, options.height);
  const double title_height = draw_paragraph(canvas, {margin, options.height - 30.0 * u},
                                             wrap_text(picture.title, title, text_width, 1), title);
  if (picture.magnification != 1.0) {
    draw_paragraph(canvas, {margin, options.height - 30.0 * u - title_height},
                   {fmt::format("errors magnified {} ×", figure(picture.magnification))},
                   {.size_px = type.figures});
  }
  const double leader_px = 36.0 * u;  // width of the leader lines between the machine and the names
  const double names_px =
      picture.bodies.empty() && picture.frames.empty()
          ? 0.0
          : leader_px + column_width(body_and_frame_names(picture), body, 0.4 * left.width);
  const Rectangle machine_area{left.x, left.y, left.width - names_px, left.height};
  const View view = fit_view(whole.points, options.from, options.up, machine_area);
  canvas.scene(view, whole.solids, whole.wires);
  for (const Frame& frame : picture.frames) draw_frame(canvas, view, frame, 1.6 * body.size_px);
  draw_callouts(
      canvas, callouts(picture, view),
      {machine_area.x + machine_area.width + leader_px, left.y, names_px - leader_px, left.height},
      body);
  if (!picture.bodies.empty()) {
    draw_triad(canvas, view, {left.x + left.width - 90.0 * u, foot + 0.4 * strip}, 40.0 * u, body);
  }
  draw_scale_bar(canvas, view, {left.x, foot + 0.5 * strip}, 0.3 * left.width, body);

  const Rectangle& legend_area = has_close_up ? right : left;
  const double legend_height =
      draw_legend(canvas, picture, {legend_area.x, legend_area.y + legend_area.height}, body);
  if (has_close_up) {
    const Rectangle close_up_area{right.x, right.y, right.width,
                                  right.height - legend_height - 16.0 * u};
    const View close_up_view = fit_view(close_up.points, options.from, options.up, close_up_area);
    canvas.scene(close_up_view, close_up.solids, close_up.wires);
    draw_scale_bar(canvas, close_up_view, {right.x, foot + 0.5 * strip}, 0.4 * right.width, body);
  }
  draw_paragraph(canvas, {margin, foot}, lines, body);
  canvas.write_png(path);
}

}  // namespace abbe::render
