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
#include "sim/cut/resources.h"
#include "sim/dialects/read_program.h"
#include "sim/machine/truth.h"
#include "sim/program/generators.h"
#include "sim/program/pvt.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

cutting::MarkedMesh read_named_mesh(const MeshFile& mesh, const MeshUse& use,
                                    cutting::ReadMeshOptions options,
                                    const cutting::MarkSelection& wanted) {
  options.unit_mm *= mesh.unit;
  options.open = mesh.open;
  try {
    return cutting::read_marked_mesh(mesh.file, options, wanted);
  } catch (const cutting::MeshWithRim& rim) {
    const Place& at = mesh.place;
    throw BadInput(at.file ? *at.file : mesh.file.string(), at.line, at.column,
                   fmt::format("a closed mesh for {}{}", use.what,
                               use.may_open ? fmt::format(", or {}.open = true for a surface with "
                                                          "a rim",
                                                          use.table)
                                            : ""),
                   fmt::format("{} with {}", mesh.file.string(), rim.seen));
  }
}

Eigen::Vector3d extents(const cutting::Points& vertices) {
  return (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).transpose();
}

// 1e-9: far above rounding, far below the ratio of any two units.
std::string unit_label(double unit_mm) {
  static const std::array<std::pair<double, const char*>, 5> words = {
      {{1.0, "mm"}, {units::inch, "inch"}, {10.0, "cm"}, {1000.0, "m"}, {units::um, "um"}}};
  for (const auto& [mm, word] : words)
    if (std::abs(unit_mm / mm - 1.0) < 1e-9) return word;
  return {};
}

std::string mesh_size_warning(const MeshFile& mesh, const MeshUse& use,
                              const Eigen::Vector3d& size) {
  // a mesh in metres that is read as mm is usually below 1 mm
  constexpr double small = 1.0;  // mm
  if (mesh.any_size) return {};
  const bool large = use.travel && size.maxCoeff() > *use.travel;
  if (!large && !(size.maxCoeff() < small)) return {};
  const std::string word = unit_label(mesh.unit);
  return fmt::format(
      "the mesh of {}, read in {}, is {:.4g} x {:.4g} x {:.4g} mm, {}: {} says another unit, "
      "{}.any_size = true that this size is meant",
      use.what, word.empty() ? fmt::format("units of {:.4g} mm", mesh.unit) : word, size.x(),
      size.y(), size.z(),
      large ? fmt::format("more than the travel of {:.4g} mm", *use.travel) : "less than 1 mm",
      large ? use.table + ".unit" : fmt::format("{}.unit (\"m\" for metres)", use.table),
      use.table);
}

std::string unreached_text(const program::Unreached& unreached) {
  if (unreached.points == 0) return {};
  return fmt::format(
      "the machine does not reach {} of {} points of the program ({:.3g} %), which leaves out {} "
      "of "
      "{} passes and parts of {}; first in pass {}, at ({:.3f}, {:.3f}, {:.3f}) mm of the "
      "workpiece: "
      "{}",
      unreached.points, unreached.all_points, 100.0 * unreached.points / unreached.all_points,
      unreached.passes, unreached.all_passes, unreached.broken_passes, unreached.first_pass,
      unreached.tip_w.x(), unreached.tip_w.y(), unreached.tip_w.z(),
      unreached.why == kinematics::Reach::OutOfLimits
          ? "an axis would leave its travel"
          : "no position of its axes gives the direction");
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
  if (judged.empty() || std::any_of(judged.begin(), judged.end(), [](auto one) { return one; }))
    return;
  const auto* mesh = std::get_if<MeshFile>(&scene.part.shape);
  const Eigen::Vector3d size = extents(design.vertices);
  const std::string odd =
      mesh != nullptr ? mesh_size_warning(*mesh, part_mesh_use(scene), size) : std::string();
  const Eigen::VectorXd radius = design.vertices.leftCols<2>().rowwise().norm();
  throw BadInput(mesh != nullptr ? mesh->file.string() : scene.file.string(), 0, 0,
                 "a part with vertices to be judged (part.judged_normal_z, judged_margin_mm, "
                 "judged_radius_min_mm, judged_radius_max_mm, region)",
                 fmt::format("{} vertices, all of them left out, of a part of {:.4g} x {:.4g} x "
                             "{:.4g} mm that lies {:.4g} to {:.4g} mm from its z axis{}{}",
                             judged.size(), size.x(), size.y(), size.z(), radius.minCoeff(),
                             radius.maxCoeff(), odd.empty() ? "" : "; ", odd));
}

// Returns by how much a raster continues beyond the part, mm.
double overrun(const Scene& scene) {
  const auto* raster = std::get_if<program::Raster>(&scene.program.source);
  return raster != nullptr ? raster->overrun : 0.0;
}

Part load_primitive(const Scene& scene, const cutting::Primitive& primitive) {
  Part part;
  try {
    part.design_m = part.body_m = cutting::tessellate(primitive, {scene.part.vertices});
    // A raster continues beyond the rim, so its contacts lie on an enlarged surface.
    const auto beyond =
        std::make_shared<const cutting::Primitive>(cutting::enlarged(primitive, overrun(scene)));
    part.contact = [beyond](double x, double y) {
      return cutting::surface_point_above(*beyond, x, y);
    };
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a part that can be", fault.what());
  }
  return part;
}

/// Returns the distance from sharp edges, mm, within which nothing is judged: the tool rounds an
/// edge there which the design does not show.
double edge_margin(const Scene& scene) {
  constexpr double share = 0.05;  // fraction of the radius of the smallest tool
  if (scene.part.edge_margin) return *scene.part.edge_margin;
  if (scene.part.sampling.kind == PartSampling::Kind::Vertices) return 0.0;
  double least = std::numeric_limits<double>::infinity();
  for (const ToolDescription& tool : all_tools(scene)) {
    const auto* cutter = std::get_if<cutting::Cutter>(&tool.nominal);
    least = std::min(
        least, cutter != nullptr ? cutter->radius : std::get<cutting::Nose>(tool.nominal).radius);
  }
  return share * least;
}

/// Returns a warning about faces of a mesh excluded entirely because they lie at sharp edges; empty
/// if there are none.
std::string excluded_text(const Design& before, const Design& after, double margin) {
  double all = 0.0, left = 0.0;
  const std::vector<int> face = cutting::patches(after);
  const int faces = face.empty() ? 0 : 1 + *std::max_element(face.begin(), face.end());
  std::vector<char> seen(std::size_t(faces), 0);
  for (Eigen::Index i = 0; i < after.area.size(); ++i) {
    const auto v = std::size_t(i);
    // vertices that are excluded for another reason do not count
    if (!before.judged.empty() && !before.judged[v]) continue;
    all += after.area[i];
    if (after.judged.empty() || after.judged[v])
      seen[std::size_t(face[v])] = 1;
    else
      left += after.area[i];
  }
  const auto unseen = std::count(seen.begin(), seen.end(), 0);
  if (unseen == 0) return {};
  return fmt::format(
      "of {} of the {} faces of the mesh nothing is judged: they lie within {:.3g} mm of sharp "
      "edges, as {:.3g} of its {:.4g} mm^2 do (part.edge_margin_mm)",
      unseen, faces, margin, left, all);
}

/// Returns the options of `judge_top`; none if the scene excludes nothing by them.
std::optional<cutting::JudgeTopOptions> top_options(const PartDescription& part) {
  if (!part.judged_normal_z && !part.judged_margin) return std::nullopt;
  return cutting::JudgeTopOptions{part.judged_normal_z.value_or(-1.0),
                                  part.judged_margin.value_or(0.0)};
}

/// Returns the faces with additional vertices on the curved borders between recognised surfaces.
Design rounded(const PartDescription& described, const Part& part, const Design& faces) {
  constexpr double share = 0.1;  // fraction of the recognition tolerance
  if (part.recognised.empty()) return faces;
  return cutting::refine_round_borders(faces, part.recognised, share * described.recognise);
}

program::ContactField contact_on(cutting::MeshContact mesh) {
  const auto surface = std::make_shared<const cutting::MeshContact>(std::move(mesh));
  return [surface](double x, double y) { return cutting::surface_point_above(*surface, x, y); };
}

/// Returns the warning for a mesh that is close to a plane, sphere, cylinder, cone or torus at so
/// many places that the search was stopped.
std::string untried_text(const PartDescription& described, const cutting::Recognised& found) {
  return fmt::format(
      "looking for planes, spheres, cylinders, cones and tori within {:.3g} um on the mesh was "
      "given up: too many places are nearly one. {} of its {} triangles are on no surface, and "
      "judged as the mesh shows them; planes or cylinders may be among them. Set "
      "part.recognise_um to the accuracy of the mesh, or to 0 if it is a free form",
      described.recognise / units::um, found.unexamined_triangles, found.design.triangles.rows());
}

/// Returns the faces on their recognised surfaces; a generated program then follows those surfaces,
/// not the facets.
Design recognised_faces(const PartDescription& described, Part& part, const Design& faces) {
  if (described.flat_facets || !(described.recognise > 0.0)) return faces;
  cutting::Recognised found = cutting::recognised(faces, described.recognise);
  part.recognised = std::move(found.patches);
  for (const auto& patch : part.recognised) part.recognised_fraction += patch.area / found.area;
  if (found.unexamined_triangles > 0) part.warnings.push_back(untried_text(described, found));
  if (!part.recognised.empty())
    part.contact =
        contact_on(cutting::MeshContact(rounded(described, part, found.design), part.recognised));
  return std::move(found.design);
}

/// Returns a warning about edges whose angle is within 0.05 degrees of the limit between smooth and
/// sharp: rounding decides there, and another program or pose of the part may decide differently.
std::string edge_angle_text(const PartDescription& described, const Design& body) {
  constexpr double within = 0.05 * units::deg, off = 5.0 * units::deg;
  const int edges = cutting::count_edges_near_angle(body, described.edge_angle, within);
  if (edges == 0) return {};
  return fmt::format(
      "{} edges of the mesh fold by {:.4g} degrees within {:.2g}, just where part.edge_angle_deg "
      "parts "
      "smooth from sharp: rounding decides which they are; set it to {:.4g} for sharp or {:.4g} "
      "for "
      "smooth",
      edges, described.edge_angle / units::deg, within / units::deg,
      std::max(0.5 * described.edge_angle, described.edge_angle - off) / units::deg,
      (described.edge_angle + off) / units::deg);
}

/// Returns a mesh as separate faces on their recognised surfaces, split where groups of triangles
/// meet, with large triangles divided so that every face has vertices away from its edges. Sharp
/// edges are found before recognition and groups split the faces, since those borders are no edges.
/// @param group  of the triangles; empty: none
Design faces_of(const PartDescription& described, Part& part, const std::vector<int>& group,
                double margin) {
  // Some 5000 vertices before the sampling refines them. Faces with many small triangles may need
  // up to four times as many again.
  constexpr double min_vertices = 5000.0;
  const double none_given = 4.0 * min_vertices;
  if (std::string text = edge_angle_text(described, part.body_m); !text.empty())
    part.warnings.push_back(std::move(text));
  Design faces = cutting::split_at_edges(part.body_m, described.edge_angle);
  std::vector<cutting::Segment> edges = cutting::sharp_edges(faces);
  std::optional<cutting::JudgeTopOptions> top = top_options(described);
  if (top) top->rim = cutting::top_rim(faces, top->min_normal_z);
  faces = recognised_faces(described, part, faces);
  // groups are split after recognition, which needs whole smooth patches
  if (!group.empty()) faces = cutting::split_at_groups(faces, group);
  if (!described.flat_facets) part.facet_uncertainty = cutting::facet_uncertainty(faces);
  if (described.sampling.kind != PartSampling::Kind::Vertices) {
    const double spacing = std::sqrt(faces.area.sum() / min_vertices);
    faces = rounded(described, part, faces);
    faces = cutting::subdivided(
        faces, surface_between_vertices(described, part.recognised, kinematics::Pose::Identity()),
        {spacing, faces.vertices.rows() + Eigen::Index(none_given)});
  }
  Design judged = cutting::judge_off_edges(faces, std::move(edges), margin);
  if (std::string text = excluded_text(faces, judged, margin); !text.empty())
    part.warnings.push_back(std::move(text));
  return top ? cutting::judge_top(judged, *top) : judged;
}

Part load_mesh(const Scene& scene, const MeshFile& mesh) {
  cutting::ReadMeshOptions options;
  if (!mesh.any_size) options.travel = travel_box(scene.machine);
  Part part;
  const cutting::MarkSelection wanted = wanted_marks(scene.part);
  const MeshUse use = part_mesh_use(scene);
  cutting::MarkedMesh read = read_named_mesh(mesh, use, options, wanted);
  part.body_m = std::move(read.design);
  if (std::string text = mesh_size_warning(mesh, use, extents(part.body_m.vertices)); !text.empty())
    part.warnings.push_back(std::move(text));
  GroupedFaces grouped;
  if (wanted.any()) grouped = grouped_faces(scene.part, read.marks);
  part.face_groups = std::move(grouped.groups);
  // The contacts follow the facets unless surfaces are recognised.
  part.contact = contact_on(cutting::MeshContact(part.body_m));
  part.design_m = faces_of(scene.part, part, grouped.of_triangle, edge_margin(scene));
  return part;
}

// Returns true if a program is a table of positions over time; the ending of the file decides.
bool is_pvt(const ProgramDescription::File& given) {
  const std::string ending = given.file.extension().string();
  return given.dialect != dialects::Dialect::Cl && (ending == ".csv" || ending == ".pvt");
}

std::string skipped_text(const dialects::ReadProgram& read) {
  std::size_t count = 0;
  std::string words;
  for (const dialects::SkippedWord& one : read.skipped) {
    count += one.count;
    words += fmt::format("{}{} ({} times, first in line {})", words.empty() ? " " : ", ", one.word,
                         one.count, one.line);
  }
  return fmt::format("{} words of the program were skipped as unknown to {}:{}", count,
                     name_of(read.dialect), words);
}

Program read_file(const ProgramDescription::File& given, const program::NcOptions& options) {
  if (is_pvt(given)) return {program::read_pvt_file(given.file, options), {}, {}};
  dialects::ReadOptions reading{.control = options,
                                .dialect = given.dialect,
                                .on_unknown = given.on_unknown,
                                .startup_code = given.startup_code,
                                .interpreter = given.interpreter,
                                .interpreter_limits = given.interpreter_limits,
                                .pole = given.pole,
                                .turning = given.turning};
  reading.limits.blocks = reading.control.max_moves = std::size_t(given.max_moves);
  reading.control.max_move_bytes = max_move_bytes();
  dialects::ReadProgram read = dialects::read_program_file(given.file, std::move(reading));
  Program program{std::move(read.path), {}, {}};
  program.warnings = std::move(read.warnings);
  if (!read.skipped.empty()) program.warnings.push_back(skipped_text(read));
  program.path.read_as = std::string(name_of(read.dialect));
  if (!read.sign.empty()) program.path.read_as += ", as " + read.sign;
  if (given.interpreter == dialects::Interpreter::LinuxCnc)
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
  const Eigen::Vector3d at = scene.part.T_wm.translation();
  std::string travels;
  for (const kinematics::Joint& joint : scene.machine.joints)
    if (joint.motion == kinematics::Motion::Linear)
      travels += (travels.empty() ? " " : ", ") + travel_text(joint);
  return fmt::format("; part.at_mm is [{:.6g}, {:.6g}, {:.6g}], and the slides go{}", at.x(),
                     at.y(), at.z(), travels);
}

struct Generated {
  std::string text;
  std::string ending;
  program::Unreached unreached = {};
};

Generated generate(const Scene& scene, const Machine& machine, const Part& part) {
  const program::GeneratorContext context{machine.control, scene.part.T_wm, part.lower, part.upper,
                                          1};
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  const auto* nose = std::get_if<cutting::Nose>(&scene.tool.nominal);
  const auto* primitive = std::get_if<cutting::Primitive>(&scene.part.shape);
  // A generator needs the kind of tool and part it was written for.
  const auto wants = [&](bool has, const char* what) {
    if (!has) throw BadInput(scene.file.string(), 0, 0, what, "another");
  };
  try {
    if (const auto* raster = std::get_if<program::Raster>(&scene.program.source)) {
      wants(cutter != nullptr, "a milling cutter for a raster program");
      program::MillingProgram made =
          program::generate_raster(*raster, part.contact, *cutter, context);
      return {std::move(made.text), ".ngc", made.unreached};
    }
    if (const auto* flank = std::get_if<program::Flank>(&scene.program.source)) {
      wants(cutter != nullptr, "a milling cutter for a flank program");
      wants(primitive != nullptr && std::holds_alternative<cutting::Cone>(*primitive),
            "a cone frustum as the part of a flank program");
      return {
          program::generate_flank(*flank, std::get<cutting::Cone>(*primitive), *cutter, context),
          ".ngc"};
    }
    const auto& spiral = std::get<program::Spiral>(scene.program.source);
    wants(nose != nullptr, "a turning tool for a spiral program");
    wants(primitive != nullptr, "a declared surface as the part of a spiral program");
    return {program::generate_spiral(spiral, *primitive, *nose, context),
            spiral.write_nc ? ".ngc" : ".csv"};
  } catch (const program::NoReachablePose& nothing) {
    const std::string why = unreached_text(nothing.unreached);
    throw BadInput(scene.file.string(), 0, 0, "a program that the machine can run",
                   why.empty() ? nothing.what() : why + travels_text(scene));
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a program that the machine can run", fault.what());
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

// Beyond 100 km a limit means none; the sum of diagonal slides bounds the box along each axis.
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

/// Enters the tools of the control's table, and its chain to the tip of each tool that the scene
/// has.
void take_tool_table(program::NcOptions& options, const Scene& scene) {
  const auto& table = scene.program.tools->table.tools;
  options.tool_table = true;
  if (scene.tool.number && table.contains(*scene.tool.number))
    options.control_tool = *scene.tool.number;
  // The table replaces what the scene believes: a tool that it lacks is unknown to the control.
  options.tool_length.clear();
  options.tool_radius.clear();
  for (const auto& [number, tool] : table) {
    if (tool.length) options.tool_length.emplace(number, *tool.length);
    if (tool.radius) options.tool_radius.emplace(number, *tool.radius);
    if (tool.length_wear != 0.0) options.length_wear.emplace(number, tool.length_wear);
    if (tool.radius_wear != 0.0) options.radius_wear.emplace(number, tool.radius_wear);
    if (!tool.name.empty()) options.tool_number.emplace(tool.name, number);
  }
  options.control_of_h.clear();
  for (const ToolDescription& tool : all_tools(scene))
    if (tool.number && options.tool_length.contains(*tool.number))
      options.control_of_h.emplace(*tool.number, compile(with_tool(scene, *tool.number)).control);
}

void take_offset_table(program::NcOptions& options, const dialects::ControlTable& table) {
  for (const auto& [number, offset] : table.offsets) {
    // G54 to G59 are offsets 1 to 6; further ones go by number.
    kinematics::AxisVector shift = kinematics::AxisVector::Zero(Eigen::Index(options.axes.size()));
    for (std::size_t j = 0; j < options.axes.size(); ++j)
      if (const auto found = offset.axes.find(options.axes[j].name); found != offset.axes.end())
        shift[Eigen::Index(j)] =
            found->second.value *
            (options.axes[j].motion == kinematics::Motion::Linear ? 1.0 : units::deg);
    if (number >= 1 && number <= 6)
      options.work_offset[std::size_t(number - 1)] = std::move(shift);
    else
      options.more_offset.emplace(number, std::move(shift));
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
  // With a single tool, number 1 means it as well, whatever number the scene gives it.
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
      options.control_of_h.emplace(*tool.number, compile(with_tool(scene, *tool.number)).control);
  if (scene.program.tools) take_tool_table(options, scene);
  options.work_offset = scene.program.work_offset;
  if (scene.program.offsets) take_offset_table(options, scene.program.offsets->table);
  options.rapid_speed = scene.machine.rapid_speed;
  options.rapid_turn = scene.machine.rapid_turn;
  // The description has rad/s, the control rpm.
  if (scene.machine.max_spindle_speed)
    options.max_spindle_rpm = *scene.machine.max_spindle_speed / units::rpm;
  return options;
}

Program load_program(const Scene& scene, const Machine& machine, const Part& part) {
  program::NcOptions options = nc_options(scene, machine);
  if (const auto* given = std::get_if<ProgramDescription::File>(&scene.program.source)) {
    options.block_skip = given->block_skip;
    Program program = read_file(*given, options);
    add_warnings(control_table_warnings(scene, program.path), program.warnings);
    return program;
  }
  Generated generated = generate(scene, machine, part);
  const std::string name = "program" + generated.ending;
  program::Path path = generated.ending == ".ngc"
                           ? program::read_nc(generated.text, name, options)
                           : program::read_pvt(generated.text, name, options);
  path.assumptions.clear();  // a generated program is read without assumptions on its dialect
  return {std::move(path), std::move(generated.text), generated.unreached};
}

}  // namespace abbe::sim
