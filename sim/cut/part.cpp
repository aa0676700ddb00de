#include "sim/cut/part.h"

#include <algorithm>
#include <memory>

#include <fmt/format.h>

#include "cutting/mesh_contact.h"
#include "cutting/read_mesh.h"
#include "sim/cut/unreached_text.h"
#include "sim/program/milling_text.h"
#include "sim/program/pvt.h"

namespace abbe::sim {
namespace {

using cutting::Design;

/// Leaves vertices out of the verdict by their distance from the part's axis.
void judge_by_radius(Design& design, const PartDescription& part) {
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) {
    const double r = design.vertices.row(i).head<2>().norm();
    if ((part.judged_radius_max && r > *part.judged_radius_max) ||
        (part.judged_radius_min && r < *part.judged_radius_min))
      design.judged[std::size_t(i)] = 0;
  }
}

/// Refuses a part of which nothing is judged.
void check_judged(const Scene& scene, const Design& design) {
  const auto& judged = design.judged;
  if (judged.empty() || std::any_of(judged.begin(), judged.end(), [](auto one) { return one; }))
    return;
  const auto* mesh = std::get_if<MeshFile>(&scene.part.shape);
  throw BadInput(mesh != nullptr ? mesh->file.string() : scene.file.string(), 0, 0,
                 "a part with vertices to be judged (part.judged_normal_z, judged_margin_mm, "
                 "judged_radius_min_mm, judged_radius_max_mm)",
                 fmt::format("{} vertices, all of them left out", judged.size()));
}

double overrun(const Scene& scene) {
  const auto* raster = std::get_if<program::Raster>(&scene.program.source);
  return raster != nullptr ? raster->overrun : 0.0;
}

/// Span of the slides: what a part in the right unit could fit into; nothing where travel has no
/// limits.
std::optional<Eigen::Vector3d> travel_box(const MachineDescription& machine) {
  constexpr double unlimited = 1e8;  // mm
  Eigen::Vector3d box = Eigen::Vector3d::Zero();
  for (const kinematics::Joint& joint : machine.joints)
    if (joint.motion == kinematics::Motion::Linear)
      box += (joint.max - joint.min) * joint.direction_b.cwiseAbs();
  if (box.maxCoeff() > unlimited) return std::nullopt;
  return box;
}

Part load_primitive(const Scene& scene, const cutting::Primitive& primitive) {
  Part part;
  try {
    part.design_m = cutting::tessellate(primitive, {scene.part.vertices});
    const auto beyond =
        std::make_shared<const cutting::Primitive>(cutting::enlarged(primitive, overrun(scene)));
    part.contact = [beyond](double x, double y) { return cutting::contact_above(*beyond, x, y); };
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a part that can be", fault.what());
  }
  return part;
}

Part load_mesh(const Scene& scene, const MeshFile& mesh) {
  cutting::ReadMeshOptions options;
  options.unit_mm = mesh.unit;
  options.open = mesh.open;
  if (!mesh.any_size) options.travel = travel_box(scene.machine);
  Part part;
  part.design_m = cutting::read_mesh(mesh.file, options);
  if (scene.part.judged_normal_z || scene.part.judged_margin)
    part.design_m = cutting::judge_top(part.design_m, {scene.part.judged_normal_z.value_or(-1.0),
                                                       scene.part.judged_margin.value_or(0.0)});
  const auto surface = std::make_shared<const cutting::MeshContact>(part.design_m);
  part.contact = [surface](double x, double y) { return cutting::contact_above(*surface, x, y); };
  return part;
}

bool is_nc(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  return ending == ".ngc" || ending == ".nc" || ending == ".tap";
}

program::Path read_program(const std::filesystem::path& file, const program::NcOptions& options) {
  return is_nc(file) ? program::read_nc_file(file, options) : program::read_pvt_file(file, options);
}

struct Generated {
  std::string text;
  std::string ending;
  program::Unreached unreached = {};
};

Generated generate(const Scene& scene, const Machine& machine, const Part& part) {
  const program::GenerateContext context{machine.control, scene.part.T_wm, part.lower, part.upper,
                                         1};
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  const auto* nose = std::get_if<cutting::Nose>(&scene.tool.nominal);
  const auto* primitive = std::get_if<cutting::Primitive>(&scene.part.shape);
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
  } catch (const program::NothingReached& nothing) {
    const std::string why = unreached_text(nothing.unreached);
    throw BadInput(scene.file.string(), 0, 0, "a program that the machine can run",
                   why.empty() ? nothing.what() : why);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a program that the machine can run", fault.what());
  }
}

}  // namespace

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
  check_judged(scene, part.design_m);
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(overrun(scene));
  part.lower = part.design_m.vertices.leftCols<2>().colwise().minCoeff().transpose() - margin;
  part.upper = part.design_m.vertices.leftCols<2>().colwise().maxCoeff().transpose() + margin;
  part.design_w = cutting::transformed(part.design_m, scene.part.T_wm);
  return part;
}

program::NcOptions nc_options(const Scene& scene, const Machine& machine) {
  program::NcOptions options;
  for (const kinematics::Joint& joint : machine.nominal.joints())
    options.axes.push_back({joint.name, joint.motion});
  options.start = scene.machine.home;
  options.tool_length = scene.program.tool_length;
  options.tool_length.emplace(1, scene.control.tool_length.value_or(scene.tool.length));
  options.control = machine.control;
  options.work_offset = scene.program.work_offset;
  options.rapid_speed = scene.machine.rapid_speed;
  options.rapid_turn = scene.machine.rapid_turn;
  return options;
}

Program load_program(const Scene& scene, const Machine& machine, const Part& part) {
  const program::NcOptions options = nc_options(scene, machine);
  if (const auto* given = std::get_if<ProgramDescription::File>(&scene.program.source))
    return {read_program(given->file, options), {}, {}};
  Generated generated = generate(scene, machine, part);
  const std::string name = "program" + generated.ending;
  program::Path path = generated.ending == ".ngc"
                           ? program::read_nc(generated.text, name, options)
                           : program::read_pvt(generated.text, name, options);
  return {std::move(path), std::move(generated.text), generated.unreached};
}

}  // namespace abbe::sim
