#include "sim/cut/part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <set>

#include <fmt/format.h>

#include "cutting/part/design_points.h"
#include "cutting/part/mesh.h"
#include "cutting/part/read_mesh.h"
#include "cutting/part/remeshing.h"
#include "kinematics/units.h"
#include "sim/cut/idle_machine.h"
#include "sim/cut/process.h"
#include "sim/dialects/read_program.h"
#include "sim/files/progress.h"
#include "sim/machine/truth.h"
#include "sim/program/generators.h"
#include "sim/program/program_writers.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

cutting::MarkedMesh read_named_mesh(const MeshFile& mesh, const MeshUse& use,
                                    cutting::ReadMeshOptions options,
                                    const cutting::MarkSelection& wanted) {
  options.unit_mm *= mesh.unit;
  options.open = mesh.open;
  try {
    return cutting::read_mesh_with_marks(mesh.file, options, wanted);
  } catch (const cutting::MeshWithRim& rim) {
    const SourcePosition& at = mesh.position;
    throw BadInput(
        at.file ? *at.file : mesh.file.string(), at.line, at.column,
        fmt::format("a closed mesh for {}{}", use.what,
                    use.accepts_open
                        ? fmt::format(", or {}.open = true for an open surface", use.table)
                        : ""),
        fmt::format("{} with {}", mesh.file.string(), rim.seen));
  }
}

Eigen::Vector3d extents(const cutting::Points& vertices) {
  return (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).transpose();
}

// The tolerance of 1e-9 is far above rounding and far below the ratio of any two units.
std::string unit_label(double unit_mm) {
  static const std::array<std::pair<double, const char*>, 5> labels = {
      {{1.0, "mm"}, {units::inch, "inch"}, {10.0, "cm"}, {1000.0, "m"}, {units::um, "um"}}};
  for (const auto& [mm, label] : labels)
    if (std::abs(unit_mm / mm - 1.0) < 1e-9) return label;
  return {};
}

std::string mesh_size_warning(const MeshFile& mesh, const MeshUse& use,
                              const Eigen::Vector3d& size) {
  // A mesh in metres that is read as mm is usually smaller than 1 mm.
  constexpr double min_size = 1.0;  // mm
  if (mesh.is_size_intended) return {};
  const bool is_large = use.travel && size.maxCoeff() > *use.travel;
  if (!is_large && !(size.maxCoeff() < min_size)) return {};
  const std::string label = unit_label(mesh.unit);
  return fmt::format(
      "the mesh of {}, read in {}, is {:.4g} x {:.4g} x {:.4g} mm, {}: set {} for another unit, or "
      "{}.any_size = true if the size is right",
      use.what, label.empty() ? fmt::format("units of {:.4g} mm", mesh.unit) : label, size.x(),
      size.y(), size.z(),
      is_large ? fmt::format("more than the travel of {:.4g} mm", *use.travel) : "less than 1 mm",
      is_large ? use.table + ".unit" : fmt::format("{}.unit (\"m\" for metres)", use.table),
      use.table);
}

std::string unreached_text(const program::UnreachedPoints& unreached) {
  if (unreached.points == 0) return {};
  return fmt::format(
      "the machine does not reach {} of {} points of the program ({:.3g} %), which omits {} of {} "
      "passes and parts of {}; first in pass {}, at ({:.3f}, {:.3f}, {:.3f}) mm in the workpiece: "
      "{}",
      unreached.points, unreached.all_points, 100.0 * unreached.points / unreached.all_points,
      unreached.passes, unreached.all_passes, unreached.broken_passes, unreached.first_pass,
      unreached.tip_w.x(), unreached.tip_w.y(), unreached.tip_w.z(),
      unreached.why == kinematics::Reachability::OutOfLimits
          ? "an axis would exceed its travel"
          : "no axis position gives the tool direction");
}

namespace {

using cutting::Design;

/// Excludes vertices from the judged ones by their distance from the z axis of the part.
void judge_by_radius(Design& design, const PartDescription& part) {
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) {
    const double r = design.vertices.row(i).head<2>().norm();
    if ((part.judged_radius_max && r > *part.judged_radius_max) ||
        (part.judged_radius_min && r < *part.judged_radius_min))
      design.judged[std::size_t(i)] = 0;
  }
}

/// Excludes vertices from the judged ones by their region.
void judge_by_region(Design& design, const PartDescription& part, const FaceGroups& groups) {
  const bool only_regions = part.judged == PartDescription::JudgedArea::Regions;
  if (part.regions.empty() && !only_regions) return;
  design.judged.resize(std::size_t(design.vertices.rows()), 1);
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) {
    const PartRegion* region = region_at(part, groups, region_point(design, i));
    if (region != nullptr ? !region->judged : only_regions) design.judged[std::size_t(i)] = 0;
  }
}

/// Throws BadInput if no vertex of the part is judged.
void check_judged(const Scene& scene, const Design& design) {
  const auto& judged = design.judged;
  if (judged.empty() ||
      std::any_of(judged.begin(), judged.end(), [](auto is_judged) { return is_judged; }))
    return;
  const auto* mesh = std::get_if<MeshFile>(&scene.part.shape);
  const Eigen::Vector3d size = extents(design.vertices);
  const std::string size_warning =
      mesh != nullptr ? mesh_size_warning(*mesh, part_mesh_use(scene), size) : std::string();
  const Eigen::VectorXd radius = design.vertices.leftCols<2>().rowwise().norm();
  throw BadInput(
      mesh != nullptr ? mesh->file.string() : scene.file.string(), 0, 0,
      "a part with judged vertices (part.edge_margin_mm, judged_normal_z, judged_margin_mm, "
      "judged_radius_min_mm, judged_radius_max_mm, region)",
      fmt::format("{} vertices, all excluded, on a part of {:.4g} x {:.4g} x {:.4g} mm "
                  "that is {:.4g} to {:.4g} mm from its z axis{}{}",
                  judged.size(), size.x(), size.y(), size.z(), radius.minCoeff(), radius.maxCoeff(),
                  size_warning.empty() ? "" : "; ", size_warning));
}

// Returns the distance by which a raster continues beyond the part, mm.
double overrun(const Scene& scene) {
  const auto* raster = std::get_if<program::Raster>(&scene.program.source);
  return raster != nullptr ? raster->overrun : 0.0;
}

Part load_primitive(const Scene& scene, const cutting::Primitive& primitive) {
  Part part;
  try {
    part.design_m = part.body_m = cutting::tessellate(primitive, {scene.part.vertices});
    // A raster continues beyond the rim, so its contacts lie on an enlarged surface.
    const auto enlarged_surface =
        std::make_shared<const cutting::Primitive>(cutting::enlarge(primitive, overrun(scene)));
    part.contact = [enlarged_surface](double x, double y) {
      return cutting::highest_surface_point(*enlarged_surface, x, y);
    };
  } catch (const std::invalid_argument& error) {
    throw BadInput(scene.file.string(), 0, 0, "a valid part", error.what());
  }
  return part;
}

/// Returns the distance from sharp edges, mm, within which nothing is judged, since the tool rounds
/// edges that are sharp in the design.
double edge_margin(const Scene& scene) {
  constexpr double margin_fraction = 0.05;  // fraction of the radius of the smallest tool
  if (scene.part.edge_margin) return *scene.part.edge_margin;
  // Most vertices of a coarse mesh lie on its edges.
  if (scene.part.sampling.kind == PartSampling::Kind::Vertices) return 0.0;
  double smallest_radius = std::numeric_limits<double>::infinity();
  for (const ToolDescription& tool : all_tools(scene)) {
    const auto* cutter = std::get_if<cutting::Cutter>(&tool.nominal);
    smallest_radius =
        std::min(smallest_radius,
                 cutter != nullptr ? cutter->radius : std::get<cutting::Nose>(tool.nominal).radius);
  }
  return margin_fraction * smallest_radius;
}

/// Returns the warning about faces of a mesh that are excluded entirely because they lie at sharp
/// edges; empty if there are none.
std::string excluded_text(const Design& faces, const Design& judged_faces, double margin) {
  double total_area = 0.0, excluded_area = 0.0;
  const std::vector<int> face = cutting::patches(judged_faces);
  const int face_count = face.empty() ? 0 : 1 + *std::max_element(face.begin(), face.end());
  std::vector<char> has_judged(std::size_t(face_count), 0);
  for (Eigen::Index i = 0; i < judged_faces.area.size(); ++i) {
    const auto vertex = std::size_t(i);
    // Vertices excluded for another reason do not count.
    if (!faces.judged.empty() && !faces.judged[vertex]) continue;
    total_area += judged_faces.area[i];
    if (judged_faces.judged.empty() || judged_faces.judged[vertex])
      has_judged[std::size_t(face[vertex])] = 1;
    else
      excluded_area += judged_faces.area[i];
  }
  const auto excluded_faces = std::count(has_judged.begin(), has_judged.end(), 0);
  if (excluded_faces == 0) return {};
  return fmt::format(
      "{} of the {} faces of the mesh are not judged: they are within {:.3g} mm of sharp edges, as "
      "are {:.3g} of its {:.4g} mm^2 (part.edge_margin_mm)",
      excluded_faces, face_count, margin, excluded_area, total_area);
}

/// Returns the options of `judge_top`; none if the scene sets neither.
std::optional<cutting::JudgeTopOptions> judge_top_options(const PartDescription& part) {
  if (!part.judged_normal_z && !part.judged_margin) return std::nullopt;
  return cutting::JudgeTopOptions{part.judged_normal_z.value_or(-1.0),
                                  part.judged_margin.value_or(0.0)};
}

/// Adds vertices to faces on the curved borders between recognised surfaces.
Design refine_borders(const PartDescription& described, const Part& part, const Design& faces) {
  constexpr double tolerance_fraction = 0.1;  // fraction of the recognition tolerance
  if (part.recognised.empty()) return faces;
  return cutting::refine_round_borders(faces, part.recognised,
                                       tolerance_fraction * described.recognition_tolerance);
}

program::ContactField contact_on(cutting::MeshHeightMap contact) {
  const auto surface = std::make_shared<const cutting::MeshHeightMap>(std::move(contact));
  return [surface](double x, double y) { return cutting::highest_surface_point(*surface, x, y); };
}

/// Returns the warning about a search for surfaces that was stopped, since the mesh is close to a
/// plane, sphere, cylinder, cone or torus at too many places.
std::string unfinished_recognition_text(const PartDescription& described,
                                        const cutting::RecognisedMesh& recognition) {
  return fmt::format(
      "the search for planes, spheres, cylinders, cones and tori within {:.3g} um on the mesh was "
      "abandoned: too many regions nearly match. {} of its {} triangles were not recognised and "
      "are judged as meshed; planes or cylinders may be among them. Set part.recognise_um to the "
      "accuracy of the mesh, or to 0 for a free form",
      described.recognition_tolerance / units::um, recognition.unexamined_triangles,
      recognition.design.triangles.rows());
}

/// Returns the faces on their recognised surfaces. A generated program then follows those surfaces
/// instead of the facets.
Design recognise_faces(const PartDescription& described, Part& part, const Design& faces) {
  if (described.flat_facets || !(described.recognition_tolerance > 0.0)) return faces;
  cutting::RecognisedMesh recognition =
      cutting::recognise_patches(faces, described.recognition_tolerance);
  part.recognised = std::move(recognition.patches);
  for (const auto& patch : part.recognised)
    part.recognised_fraction += patch.area / recognition.area;
  if (recognition.unexamined_triangles > 0)
    part.warnings.push_back(unfinished_recognition_text(described, recognition));
  if (!part.recognised.empty())
    part.contact = contact_on(cutting::MeshHeightMap(
        refine_borders(described, part, recognition.design), part.recognised));
  return std::move(recognition.design);
}

/// Returns the warning about edges whose angle is within 0.05 degrees of the limit between smooth
/// and sharp; empty if there are none. Rounding decides on such an edge, and may decide differently
/// in another program or pose of the part.
std::string edge_angle_warning(const PartDescription& described, const Design& body) {
  constexpr double tolerance = 0.05 * units::deg, offset = 5.0 * units::deg;
  const int edge_count = cutting::count_edges_near_angle(body, described.edge_angle, tolerance);
  if (edge_count == 0) return {};
  return fmt::format(
      "{} edges of the mesh fold by {:.4g} degrees within {:.2g}, exactly at the limit "
      "part.edge_angle_deg between smooth and sharp, so rounding decides; set it to {:.4g} for "
      "sharp or {:.4g} for smooth",
      edge_count, described.edge_angle / units::deg, tolerance / units::deg,
      std::max(0.5 * described.edge_angle, described.edge_angle - offset) / units::deg,
      (described.edge_angle + offset) / units::deg);
}

/// Separates a mesh into faces on their recognised surfaces. Faces are split where groups of
/// triangles meet, and large triangles are divided, so that every face has vertices away from its
/// edges. Sharp edges are found first, since borders of recognised surfaces and of groups are no
/// edges.
/// @param groups  (triangles) number of the group; empty: none
Design separate_faces(const PartDescription& described, Part& part, const std::vector<int>& groups,
                      double margin) {
  // The sampling starts from some 5000 vertices. Faces with many small triangles may need up to
  // four times that number in addition.
  constexpr double min_vertices = 5000.0;
  const double max_added_vertices = 4.0 * min_vertices;
  if (std::string text = edge_angle_warning(described, part.body_m); !text.empty())
    part.warnings.push_back(std::move(text));
  Design faces = cutting::split_at_edges(part.body_m, described.edge_angle);
  std::vector<cutting::Segment> edges = cutting::sharp_edges(faces);
  std::optional<cutting::JudgeTopOptions> top_options = judge_top_options(described);
  if (top_options) top_options->rim = cutting::top_rim(faces, top_options->min_normal_z);
  faces = recognise_faces(described, part, faces);
  // Recognition needs whole smooth patches, so groups are split after it.
  if (!groups.empty()) faces = cutting::split_at_groups(faces, groups);
  if (!described.flat_facets) part.facet_uncertainty = cutting::facet_uncertainty(faces);
  if (described.sampling.kind != PartSampling::Kind::Vertices) {
    const double spacing = std::sqrt(faces.area.sum() / min_vertices);
    faces = refine_borders(described, part, faces);
    faces = cutting::subdivide(
        faces, surface_between_vertices(described, part.recognised, kinematics::Pose::Identity()),
        {spacing, faces.vertices.rows() + Eigen::Index(max_added_vertices)});
  }
  Design judged_faces = cutting::exclude_near_edges(faces, std::move(edges), margin);
  if (std::string text = excluded_text(faces, judged_faces, margin); !text.empty())
    part.warnings.push_back(std::move(text));
  return top_options ? cutting::judge_top(judged_faces, *top_options) : judged_faces;
}

Part load_mesh(const Scene& scene, const MeshFile& mesh) {
  cutting::ReadMeshOptions options;
  if (!mesh.is_size_intended) options.travel = travel_box(scene.machine);
  Part part;
  const cutting::MarkSelection selection = required_marks(scene.part);
  const MeshUse use = part_mesh_use(scene);
  cutting::MarkedMesh marked_mesh = read_named_mesh(mesh, use, options, selection);
  part.body_m = std::move(marked_mesh.design);
  if (std::string text = mesh_size_warning(mesh, use, extents(part.body_m.vertices)); !text.empty())
    part.warnings.push_back(std::move(text));
  GroupedFaces grouping;
  if (selection.any()) grouping = grouped_faces(scene.part, marked_mesh.marks);
  part.face_groups = std::move(grouping.groups);
  // The contacts follow the facets unless surfaces are recognised.
  part.contact = contact_on(cutting::MeshHeightMap(part.body_m));
  part.design_m = separate_faces(scene.part, part, grouping.group_of_triangle, edge_margin(scene));
  return part;
}

std::string skipped_text(const dialects::ParsedProgram& program_read) {
  std::size_t count = 0;
  std::string list;
  for (const dialects::SkippedWord& skipped : program_read.skipped) {
    count += skipped.count;
    list += fmt::format("{}{} ({} times, first on line {})", list.empty() ? " " : ", ",
                        skipped.word, skipped.count, skipped.line);
  }
  return fmt::format("{} words of the program are unknown to {} and were skipped:{}", count,
                     name_of(program_read.dialect), list);
}

Program read_file(const ProgramDescription::File& description, const program::NcOptions& options) {
  if (is_pvt(description)) return {program::read_pvt_file(description.file, options), {}, {}};
  dialects::ReadOptions read_options{.control = options,
                                     .dialect = description.dialect,
                                     .on_unknown = description.on_unknown,
                                     .startup_code = description.startup_code,
                                     .interpreter = description.interpreter,
                                     .interpreter_limits = description.interpreter_limits,
                                     .pole = description.pole,
                                     .turning = description.turning};
  read_options.limits.blocks = read_options.control.max_moves = std::size_t(description.max_moves);
  read_options.control.max_move_bytes = max_move_bytes();
  dialects::ParsedProgram program_read =
      dialects::read_program_file(description.file, std::move(read_options));
  Program program{std::move(program_read.path), {}, {}};
  program.warnings = std::move(program_read.warnings);
  if (!program_read.skipped.empty()) program.warnings.push_back(skipped_text(program_read));
  program.path.read_as = std::string(name_of(program_read.dialect));
  if (!program_read.sign.empty()) program.path.read_as += ", as " + program_read.sign;
  if (description.interpreter == dialects::Interpreter::LinuxCnc)
    program.path.read_as += ", by LinuxCNC's own interpreter";
  return program;
}

/// Returns warnings about the tables of the control.
std::vector<std::string> control_table_warnings(const Scene& scene, const program::Path& path) {
  std::vector<std::string> warnings = tool_table_warnings(scene);
  std::set<int> called;
  for (const program::Block& block : path.blocks)
    if (block.work_offset >= 0) called.insert(block.work_offset + 1);
  for (const auto* table : {&scene.program.tools, &scene.program.offsets})
    if (*table) add_warnings(table_warnings((*table)->table, path.read_as, called), warnings);
  return warnings;
}

/// Returns a text such as "; part.at_mm is [900, 0, 0], and the slides go X between -400 and 400
/// mm".
std::string travels_text(const Scene& scene) {
  const Eigen::Vector3d position = scene.part.T_wm.translation();
  std::string travels;
  for (const kinematics::Joint& joint : scene.machine.joints)
    if (joint.motion == kinematics::Motion::Linear)
      travels += (travels.empty() ? " " : ", ") + travel_text(joint);
  return fmt::format("; part.at_mm is [{:.6g}, {:.6g}, {:.6g}], and the slides travel{}",
                     position.x(), position.y(), position.z(), travels);
}

struct GeneratedProgram {
  std::string text;
  std::string extension;  ///< ".ngc" or ".csv"
  program::UnreachedPoints unreached = {};
};

GeneratedProgram generate(const Scene& scene, const Machine& machine, const Part& part) {
  const program::GeneratorContext context{machine.control, scene.part.T_wm, part.lower, part.upper,
                                          1};
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  const auto* nose = std::get_if<cutting::Nose>(&scene.tool.nominal);
  const auto* primitive = std::get_if<cutting::Primitive>(&scene.part.shape);
  const auto require = [&](bool is_present, const char* what) {
    if (!is_present) throw BadInput(scene.file.string(), 0, 0, what, "a different one");
  };
  try {
    if (const auto* raster = std::get_if<program::Raster>(&scene.program.source)) {
      require(cutter != nullptr, "a milling cutter for a raster program");
      program::MillingProgram milling =
          program::generate_raster(*raster, part.contact, *cutter, context);
      return {std::move(milling.text), ".ngc", milling.unreached};
    }
    if (const auto* flank = std::get_if<program::Flank>(&scene.program.source)) {
      require(cutter != nullptr, "a milling cutter for a flank program");
      require(primitive != nullptr && std::holds_alternative<cutting::Cone>(*primitive),
              "a cone frustum as the part for a flank program");
      return {
          program::generate_flank(*flank, std::get<cutting::Cone>(*primitive), *cutter, context),
          ".ngc"};
    }
    const auto& spiral = std::get<program::Spiral>(scene.program.source);
    require(nose != nullptr, "a turning tool for a spiral program");
    require(primitive != nullptr, "a declared surface as the part for a spiral program");
    return {program::generate_spiral(spiral, *primitive, *nose, context),
            spiral.write_nc ? ".ngc" : ".csv"};
  } catch (const program::NoReachablePose& unreachable) {
    const std::string reason = unreached_text(unreachable.unreached);
    throw BadInput(scene.file.string(), 0, 0, "a program that the machine can run",
                   reason.empty() ? unreachable.what() : reason + travels_text(scene));
  } catch (const std::invalid_argument& error) {
    throw BadInput(scene.file.string(), 0, 0, "a program that the machine can run", error.what());
  }
}

}  // namespace

cutting::SurfaceInterpolator surface_between_vertices(
    const PartDescription& part, const std::vector<cutting::AnalyticPatch>& recognised,
    const kinematics::Pose& T) {
  if (const auto* primitive = std::get_if<cutting::Primitive>(&part.shape))
    return cutting::primitive_interpolator(*primitive, T);
  if (part.flat_facets) return cutting::facet_point;
  return recognised.empty() ? cutting::smooth_facet_point
                            : cutting::patch_interpolator(recognised, T);
}

// A travel beyond 100 km means no limit. Slides that are not parallel to an axis of the bed
// add to the box along each axis.
std::optional<Eigen::Vector3d> travel_box(const MachineDescription& machine) {
  constexpr double unlimited = 1e8;  // mm
  Eigen::Vector3d box = Eigen::Vector3d::Zero();
  for (const kinematics::Joint& joint : machine.joints)
    if (joint.motion == kinematics::Motion::Linear)
      box += (joint.max - joint.min) * joint.direction_b.cwiseAbs();
  if (box.maxCoeff() > unlimited) return std::nullopt;
  return box;
}

MeshUse part_mesh_use(const Scene& scene) {
  const auto travel = travel_box(scene.machine);
  return {"the part", "part", true,
          travel ? std::optional(travel->maxCoeff()) : std::optional<double>()};
}

Part load_part(const Scene& scene) {
  Part part = std::visit(
      [&](const auto& shape) -> Part {
        if constexpr (std::is_same_v<std::decay_t<decltype(shape)>, MeshFile>)
          return load_mesh(scene, shape);
        else
          return load_primitive(scene, shape);
      },
      scene.part.shape);
  judge_by_radius(part.design_m, scene.part);
  judge_by_region(part.design_m, scene.part, part.face_groups);
  for (std::string& text :
       region_warnings(region_coverage(scene.part, part.face_groups, part.design_m)))
    part.warnings.push_back(std::move(text));
  check_judged(scene, part.design_m);
  // The raster covers the part and its overrun on every side.
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(overrun(scene));
  part.lower = part.design_m.vertices.leftCols<2>().colwise().minCoeff().transpose() - margin;
  part.upper = part.design_m.vertices.leftCols<2>().colwise().maxCoeff().transpose() + margin;
  part.design_w = cutting::transformed(part.design_m, scene.part.T_wm);
  return part;
}

namespace {

/// Enters the tools of the control's table, and the chain of the control to the tip of each tool of
/// the scene.
void enter_tool_table(program::NcOptions& options, const Scene& scene) {
  const auto& table = scene.program.tools->table.tools;
  options.tool_table = true;
  if (scene.tool.number && table.contains(*scene.tool.number))
    options.control_tool = *scene.tool.number;
  // The table replaces the lengths and radii of the scene: the control knows no other tool.
  options.tool_length.clear();
  options.tool_radius.clear();
  for (const auto& [number, tool] : table) {
    if (tool.length) options.tool_length.emplace(number, *tool.length);
    if (tool.radius) options.tool_radius.emplace(number, *tool.radius);
    if (tool.length_wear != 0.0) options.length_wear.emplace(number, tool.length_wear);
    if (tool.radius_wear != 0.0) options.radius_wear.emplace(number, tool.radius_wear);
    if (!tool.name.empty()) options.tool_number.emplace(tool.name, number);
  }
  options.control_by_h.clear();
  for (const ToolDescription& tool : all_tools(scene))
    if (tool.number && options.tool_length.contains(*tool.number))
      options.control_by_h.emplace(*tool.number,
                                   make_machine(select_tool(scene, *tool.number)).control);
}

void enter_offset_table(program::NcOptions& options, const dialects::ControlTable& table) {
  for (const auto& [number, offset] : table.offsets) {
    // Offsets 1 to 6 are G54 to G59.
    kinematics::AxisVector shift = kinematics::AxisVector::Zero(Eigen::Index(options.axes.size()));
    for (std::size_t j = 0; j < options.axes.size(); ++j)
      if (const auto position = offset.axes.find(options.axes[j].name);
          position != offset.axes.end())
        shift[Eigen::Index(j)] =
            position->second.value *
            (options.axes[j].motion == kinematics::Motion::Linear ? 1.0 : units::deg);
    if (number >= 1 && number <= 6)
      options.work_offset[std::size_t(number - 1)] = std::move(shift);
    else
      options.extra_offsets.emplace(number, std::move(shift));
  }
}

}  // namespace

program::NcOptions nc_options(const Scene& scene, const Machine& machine) {
  program::NcOptions options;
  for (const kinematics::Joint& joint : machine.nominal.joints())
    options.axes.push_back({joint.name, joint.motion});
  for (std::size_t j = 0; j < scene.machine.rollover.size(); ++j)
    options.axes[j].rollover = scene.machine.rollover[j];
  options.start = scene.machine.home;
  options.reference = scene.machine.reference;
  options.machine_zero = scene.machine.machine_zero;
  options.tool_length = scene.program.tool_length;
  options.control = machine.control;
  const double length = scene.control.tool_length.value_or(scene.tool.length);
  // A single tool is number 1 too, whatever number the scene gives it.
  if (scene.additional_tools.empty()) options.tool_length.emplace(1, length);
  if (scene.tool.number) options.tool_length.emplace(*scene.tool.number, length);
  const auto believe_radius = [&](int number, const ToolDescription& tool) {
    if (const auto* cutter = std::get_if<cutting::Cutter>(&tool.nominal))
      options.tool_radius.emplace(number, cutter->radius);
    else if (const auto* nose = std::get_if<cutting::Nose>(&tool.nominal))
      options.tool_radius.emplace(number, nose->radius);
  };
  if (scene.additional_tools.empty()) believe_radius(1, scene.tool);
  if (scene.tool.number) believe_radius(*scene.tool.number, scene.tool);
  for (const ToolDescription& tool : scene.additional_tools) believe_radius(*tool.number, tool);
  for (const ToolDescription& tool : scene.additional_tools)
    options.tool_length.emplace(*tool.number, tool.length);
  for (const ToolDescription& tool : all_tools(scene))
    if (!tool.name.empty()) options.tool_number.emplace(tool.name, tool.number.value_or(1));
  if (!scene.additional_tools.empty())
    for (const ToolDescription& tool : all_tools(scene))
      options.control_by_h.emplace(*tool.number,
                                   make_machine(select_tool(scene, *tool.number)).control);
  if (scene.program.tools) enter_tool_table(options, scene);
  options.work_offset = scene.program.work_offset;
  if (scene.program.offsets) enter_offset_table(options, scene.program.offsets->table);
  options.rapid_speed = scene.machine.rapid_speed;
  options.rapid_rotation_speed = scene.machine.rapid_rotation_speed;
  if (scene.machine.max_spindle_speed)
    options.max_spindle_rpm = *scene.machine.max_spindle_speed / units::rpm;
  return options;
}

Program load_program(const Scene& scene, const Machine& machine, const Part& part) {
  program::NcOptions options = nc_options(scene, machine);
  if (const auto* file = std::get_if<ProgramDescription::File>(&scene.program.source)) {
    options.block_skip = file->block_skip;
    Program program = read_file(*file, options);
    add_warnings(control_table_warnings(scene, program.path), program.warnings);
    return program;
  }
  GeneratedProgram generated = generate(scene, machine, part);
  const std::string name = "program" + generated.extension;
  program::Path path = generated.extension == ".ngc"
                           ? program::read_nc(generated.text, name, options)
                           : program::read_pvt(generated.text, name, options);
  path.assumptions.clear();  // the dialect of a generated program is known
  return {std::move(path), std::move(generated.text), generated.unreached};
}

}  // namespace abbe::sim
