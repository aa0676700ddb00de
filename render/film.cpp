#include "render/film.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include <vtkActor.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkMatrix4x4.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>

#include "render/layout.h"
#include "render/machine_picture.h"
#include "render/vtk_writer.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using kinematics::Pose;

constexpr Colour body_edge{0.35, 0.37, 0.40};
// FXAA smooths the edges of a film at a fraction of the cost of supersampling.
constexpr int samples_per_pixel_side = 1;
constexpr double min_triangle_px = 1.5;  // size of the triangles of a decimated part

/// Positions and sizes of the elements of a frame, px.
struct FilmLayout {
  TypeSizes type;
  double margin = 0.0;
  Rectangle machine, part;  ///< areas of the scenes
  double heading = 0.0;     ///< height of the text above a scene
  double foot = 0.0;        ///< top of the area below the scenes
};

FilmLayout film_layout(int width, int height) {
  FilmLayout layout;
  layout.type = type_sizes(width, height * 13 / 10);
  const double u = layout.type.unit;
  layout.margin = 30.0 * u;
  const double head = layout.margin + 1.5 * layout.type.title;
  layout.heading = 2.0 * 1.5 * layout.type.body;
  layout.foot = layout.margin + 5.2 * layout.type.body;
  const double low = layout.foot + 1.9 * layout.type.body;  // a scale bar is below each scene
  const double high = height - head - layout.heading - 8.0 * u;
  const double gap = 36.0 * u, room = width - 2.0 * layout.margin - gap;
  layout.machine = {layout.margin, low, 0.5 * room, high - low};
  layout.part = {layout.margin + 0.5 * room + gap, low, 0.5 * room, high - low};
  return layout;
}

vtkSmartPointer<vtkMatrix4x4> vtk_matrix(const Pose& T) {
  auto matrix = vtkSmartPointer<vtkMatrix4x4>::New();
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k) matrix->SetElement(i, k, T.matrix()(i, k));
  return matrix;
}

void colour_actor(vtkActor& actor, const Colour& colour, double shade) {
  vtkProperty& property = *actor.GetProperty();
  property.SetColor(colour.r, colour.g, colour.b);
  property.SetAmbient(1.0 - shade);
  property.SetDiffuse(shade);
  property.SetSpecular(0.0);
}

/// Returns a mapper that moves surfaces back slightly, so that they do not hide half of the lines
/// on them.
vtkSmartPointer<vtkPolyDataMapper> surface_mapper(vtkPolyData* data) {
  auto mapper = vtkSmartPointer<vtkPolyDataMapper>::New();
  mapper->SetInputData(data);
  mapper->SetResolveCoincidentTopologyToPolygonOffset();
  mapper->SetRelativeCoincidentTopologyPolygonOffsetParameters(2.0, 2.0);
  return mapper;
}

/// Faces and edges of one body.
struct BodyActors {
  vtkSmartPointer<vtkActor> faces, edges;
};

BodyActors body_actors(const FilmBody& body, double edge_px) {
  const auto data = poly_data(body.vertices);
  data->SetPolys(cells(body.triangles.data(), body.triangles.rows(), 3));
  const auto mapper = surface_mapper(data);
  mapper->ScalarVisibilityOff();
  BodyActors actors;
  actors.faces = vtkSmartPointer<vtkActor>::New();
  actors.faces->SetMapper(mapper);
  colour_actor(*actors.faces, body.colour, 0.4);
  actors.faces->GetProperty()->SetOpacity(body.opacity);
  // Smooth shading would blur the sharp edges of bodies.
  actors.faces->GetProperty()->SetInterpolationToFlat();
  actors.edges =
      wire_actor({body.vertices, sharp_edges(body.vertices, body.triangles), body_edge, edge_px});
  return actors;
}

/// Transforms a view from the workpiece frame to the bed frame, so that the eye moves with the
/// part.
View to_bed_frame(View view, const Pose& T_bw) {
  view.centre = T_bw * view.centre;
  for (Vector3d* axis : {&view.right, &view.up, &view.toward_eye}) *axis = T_bw.linear() * *axis;
  return view;
}

/// A mesh with at most one vertex in each cell of a grid.
struct DecimatedMesh {
  FilmMesh mesh;
  std::vector<Eigen::Index> original_rows;  ///< (vertices) rows in the original mesh
};

/// Returns the mean edge length of a mesh, from a sample of its triangles.
double mean_edge(const FilmMesh& mesh) {
  // About a thousand triangles are enough.
  const Eigen::Index step = std::max<Eigen::Index>(1, mesh.triangles.rows() / 1000);
  double sum = 0.0;
  Eigen::Index count = 0;
  for (Eigen::Index i = 0; i < mesh.triangles.rows(); i += step, ++count)
    sum +=
        (mesh.vertices.row(mesh.triangles(i, 0)) - mesh.vertices.row(mesh.triangles(i, 1))).norm();
  return count > 0 ? sum / double(count) : 0.0;
}

/// Returns the mesh with one vertex per cell of a grid. Details smaller than a cell are invisible
/// but cost time to render.
/// @param cell  mm, edge length of the cells
DecimatedMesh decimate(const FilmMesh& mesh, double cell) {
  // A mesh that is coarser than the grid remains as it is.
  if (mean_edge(mesh) >= cell) {
    DecimatedMesh result{mesh, std::vector<Eigen::Index>(std::size_t(mesh.vertices.rows()))};
    std::iota(result.original_rows.begin(), result.original_rows.end(), Eigen::Index(0));
    return result;
  }
  std::unordered_map<std::uint64_t, int> vertex_of_cell;
  std::vector<int> number(std::size_t(mesh.vertices.rows()));
  DecimatedMesh result;
  const Eigen::RowVector3d low = mesh.vertices.colwise().minCoeff();
  for (Eigen::Index i = 0; i < mesh.vertices.rows(); ++i) {
    const Eigen::Array3d cell_index = ((mesh.vertices.row(i) - low) / cell).array().floor();
    // Three indices of 21 bits fit into a key of 64 bits.
    constexpr double max_index = double(1 << 21) - 1.0;
    std::uint64_t key = 0;
    for (int k = 0; k < 3; ++k) key = key << 21 | std::uint64_t(std::min(cell_index[k], max_index));
    const auto [entry, is_new] = vertex_of_cell.try_emplace(key, int(result.original_rows.size()));
    if (is_new) result.original_rows.push_back(i);
    number[std::size_t(i)] = entry->second;
  }
  std::vector<std::array<int, 3>> triangles;
  for (const auto& t : mesh.triangles.rowwise()) {
    const std::array<int, 3> corners{number[std::size_t(t[0])], number[std::size_t(t[1])],
                                     number[std::size_t(t[2])]};
    // A triangle with two corners in one cell has no area.
    if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0])
      triangles.push_back(corners);
  }
  result.mesh.vertices = mesh.vertices(result.original_rows, Eigen::all);
  if (mesh.normals.rows() > 0) result.mesh.normals = mesh.normals(result.original_rows, Eigen::all);
  result.mesh.triangles.resize(Eigen::Index(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    result.mesh.triangles.row(Eigen::Index(i)) << triangles[i][0], triangles[i][1], triangles[i][2];
  return result;
}

/// The part in one view, decimated to the resolution of this view.
class PartActor {
 public:
  /// @param cell  mm, edge length of the cells for decimation
  PartActor(const std::vector<FilmSettings::Named>& vertex_styles, double cell) : cell_(cell) {
    for (const FilmSettings::Named& entry : vertex_styles)
      colours_.push_back(
          {to_byte(entry.colour.r), to_byte(entry.colour.g), to_byte(entry.colour.b)});
    colour_actor(*actor, {1.0, 1.0, 1.0}, 0.5);
  }

  void show(const FilmState& state) {
    actor->SetVisibility(state.part != nullptr && state.part->triangles.rows() > 0);
    if (!actor->GetVisibility()) return;
    // The shape is rebuilt only if the pointer changes; colours change in every frame.
    if (state.part != mesh_) reshape(state.part);
    vtkNew<vtkUnsignedCharArray> rgb;
    rgb->SetNumberOfComponents(3);
    rgb->SetNumberOfTuples(vtkIdType(decimated_.original_rows.size()));
    unsigned char* byte = rgb->GetPointer(0);
    for (const Eigen::Index i : decimated_.original_rows)
      byte = std::ranges::copy(colours_.at(state.vertex_styles[std::size_t(i)]), byte).out;
    data_->GetPointData()->SetScalars(rgb);
    actor->SetUserMatrix(vtk_matrix(state.T_bw));
  }

  vtkNew<vtkActor> actor;

 private:
  void reshape(const std::shared_ptr<const FilmMesh>& new_mesh) {
    mesh_ = new_mesh;
    decimated_ = decimate(*new_mesh, cell_);
    const FilmMesh& mesh = decimated_.mesh;
    data_ = poly_data(mesh.vertices);
    data_->SetPolys(cells(mesh.triangles.data(), mesh.triangles.rows(), 3));
    if (mesh.normals.rows() > 0) {
      vtkNew<vtkFloatArray> normals;
      normals->SetNumberOfComponents(3);
      normals->SetNumberOfTuples(mesh.normals.rows());
      std::copy(mesh.normals.data(), mesh.normals.data() + mesh.normals.size(),
                normals->GetPointer(0));
      data_->GetPointData()->SetNormals(normals);
    } else {
      actor->GetProperty()->SetInterpolationToFlat();
    }
    // The inner side of a closed mesh is never visible.
    actor->GetProperty()->SetBackfaceCulling(new_mesh->closed);
    if (mapper_ == nullptr) {
      mapper_ = surface_mapper(data_);
      actor->SetMapper(mapper_);
    }
    mapper_->SetInputData(data_);
  }

  double cell_;
  std::vector<std::array<unsigned char, 3>> colours_;
  std::shared_ptr<const FilmMesh> mesh_;
  DecimatedMesh decimated_;
  vtkSmartPointer<vtkPolyData> data_;
  vtkSmartPointer<vtkPolyDataMapper> mapper_;
};

void check_state(const FilmSettings& setting, const FilmState& state) {
  const bool has_matching_sizes =
      state.T_b.size() == setting.bodies.size() && state.values.size() == setting.labels.size() &&
      (state.part == nullptr ||
       state.vertex_styles.size() == std::size_t(state.part->vertices.rows()));
  const bool are_colours_known = std::ranges::all_of(state.vertex_styles, [&](std::uint8_t index) {
    return index < setting.vertex_styles.size();
  });
  if (!has_matching_sizes || !are_colours_known)
    throw std::invalid_argument("a film state that matches the film setting");
}

}  // namespace

struct Film::Stage {
  explicit Stage(FilmSettings film_setting);

  void update_scenes(const FilmState& state);
  void draw_flat_elements(const FilmState& state);
  void draw_values(const FilmState& state);
  void draw_legend();

  FilmSettings setting;
  FilmLayout layout;
  Canvas canvas;
  View machine_view, part_view;
  vtkNew<vtkRenderer> machine, part;
  std::vector<BodyActors> bodies;
  PartActor part_far, part_near;
  std::vector<vtkSmartPointer<vtkActor>> paths;
};

Film::Stage::Stage(FilmSettings film_setting)
    : setting(std::move(film_setting)),
      layout(film_layout(setting.width, setting.height)),
      canvas(setting.width, setting.height, samples_per_pixel_side),
      machine_view(fit_view(setting.machine_b, setting.from_b, Vector3d::UnitZ(), layout.machine)),
      part_view(fit_view(setting.part_w, setting.from_w, setting.up_w, layout.part)),
      part_far(setting.vertex_styles, min_triangle_px * machine_view.mm_per_px),
      part_near(setting.vertex_styles, min_triangle_px * part_view.mm_per_px) {
  // The clipping planes must not cut off the tool above the part.
  part_view.depth = std::max(part_view.depth, setting.part_depth);
  for (const FilmBody& body : setting.bodies) {
    bodies.push_back(body_actors(body, std::max(1.0, 1.6 * layout.type.unit)));
    for (vtkActor* actor : {bodies.back().faces.Get(), bodies.back().edges.Get()}) {
      machine->AddActor(actor);
      if (body.in_close_up) part->AddActor(actor);
    }
  }
  // Each view has its own actor of the part, decimated to the resolution of the view.
  machine->AddActor(part_far.actor);
  part->AddActor(part_near.actor);
  for (vtkRenderer* scene : {machine.Get(), part.Get()}) scene->UseFXAAOn();
  canvas.add(*machine, machine_view);
  canvas.add(*part, part_view);
}

void Film::Stage::update_scenes(const FilmState& state) {
  for (std::size_t i = 0; i < bodies.size(); ++i)
    for (vtkActor* actor : {bodies[i].faces.Get(), bodies[i].edges.Get()}) {
      actor->SetVisibility(state.T_b[i].has_value());
      if (state.T_b[i]) actor->SetUserMatrix(vtk_matrix(*state.T_b[i]));
    }
  part_far.show(state);
  part_near.show(state);
  // Paths change in every frame, so their actors are replaced.
  for (const auto& path : paths) part->RemoveActor(path);
  paths.clear();
  const View view = to_bed_frame(part_view, state.T_bw);
  Pose path_pose = state.T_bw;
  // Paths on the surface are moved towards the eye by two pixels, so that they remain visible.
  path_pose.translation() += 2.0 * view.mm_per_px * view.toward_eye;
  for (const Wire& wire : state.paths) {
    if (wire.segments.empty()) continue;
    paths.push_back(wire_actor(wire));
    paths.back()->SetUserMatrix(vtk_matrix(path_pose));
    part->AddActor(paths.back());
  }
  set_camera(*part, view);
}

void Film::Stage::draw_legend() {
  const TextStyle small_text{.size_px = 0.85 * layout.type.body};
  Vector2d at(layout.part.x, layout.part.y + layout.part.height + 0.35 * layout.heading);
  for (const auto* entries : {&setting.vertex_styles, &setting.lines})
    for (const FilmSettings::Named& entry : *entries)
      if (!entry.name.empty())
        at.x() += draw_swatch(canvas, at, entry.colour, entry.name, small_text) +
                  1.2 * small_text.size_px;
}

void Film::Stage::draw_values(const FilmState& state) {
  const double y = layout.foot - 2.35 * layout.type.body;
  const TextStyle label{
      .size_px = 0.8 * layout.type.body, .colour = colours::faint_ink, .vertical_anchor = 1.0};
  const TextStyle value{.size_px = layout.type.body, .bold = true, .vertical_anchor = 1.0};
  double total_share = 0.0, x = layout.margin;
  for (const FilmSettings::Label& column : setting.labels) total_share += column.relative_width;
  for (std::size_t i = 0; i < setting.labels.size(); ++i) {
    const double column_width =
        (setting.width - 2.0 * layout.margin) * setting.labels[i].relative_width / total_share;
    const double text_width = column_width - 0.5 * layout.type.body;
    canvas.text({x, y}, setting.labels[i].name, label);
    canvas.text({x, y - 1.15 * layout.type.body},
                wrap_text(state.values[i], value, text_width, 1).front(), value);
    x += column_width;
  }
}

void Film::Stage::draw_flat_elements(const FilmState& state) {
  canvas.clear_flat_elements();
  const double margin = layout.margin, room = setting.width - 2.0 * margin;
  const TypeSizes& type = layout.type;
  const TextStyle title{.size_px = type.title, .bold = true, .vertical_anchor = 1.0};
  const TextStyle subtitle_style{
      .size_px = type.body, .horizontal_anchor = 1.0, .vertical_anchor = 1.0};
  const TextStyle heading{
      .size_px = type.body, .colour = colours::faint_ink, .vertical_anchor = 0.5};
  const double top = setting.height - 0.8 * margin;
  const double right = text_size(setting.subtitle, subtitle_style).x();
  canvas.text({margin, top}, wrap_text(setting.title, title, room - right - margin, 1).front(),
              title);
  canvas.text({setting.width - margin, top - 0.25 * type.title}, setting.subtitle, subtitle_style);
  for (const auto& [area, name] :
       {std::pair(layout.machine, setting.machine_name), std::pair(layout.part, setting.part_name)})
    canvas.text({area.x, area.y + area.height + 0.8 * layout.heading},
                wrap_text(name, heading, area.width, 1).front(), heading);
  draw_legend();
  const TextStyle small_text{.size_px = 0.85 * type.body};
  for (const auto& [view, area] :
       {std::pair(&machine_view, layout.machine), std::pair(&part_view, layout.part)})
    draw_scale_bar(canvas, *view, {area.x, layout.foot + 0.9 * type.body}, 0.3 * area.width,
                   small_text);
  draw_triad(canvas, machine_view,
             {layout.machine.x + layout.machine.width - 2.6 * type.body,
              layout.machine.y + layout.machine.height - 2.6 * type.body},
             1.5 * type.body, small_text);
  const TextStyle program{.size_px = type.body, .vertical_anchor = 0.5};
  canvas.line({{margin, layout.foot}, {setting.width - margin, layout.foot}}, colours::rule, 1.0);
  canvas.text({margin, layout.foot - 1.2 * type.body},
              wrap_text(state.text, program, room, 1).front(), program);
  draw_values(state);
  const double height = 0.3 * type.body, y = 0.5 * margin;
  canvas.fill({margin, y, room, height}, colours::rule);
  canvas.fill({margin, y, std::clamp(state.progress, 0.0, 1.0) * room, height}, series_colour(0));
}

Film::Film(FilmSettings setting) : stage_(std::make_unique<Stage>(std::move(setting))) {}

Film::~Film() = default;

Pixels Film::frame(const FilmState& state) {
  check_state(stage_->setting, state);
  stage_->update_scenes(state);
  stage_->draw_flat_elements(state);
  return stage_->canvas.pixels();
}

}  // namespace abbe::render
