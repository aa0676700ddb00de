#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "cutting/cutter_entry.h"
#include "sim/cut/tool_poses.h"
#include "sim/study/contact_motion.h"
#include "sim/study/influence_columns.h"

namespace abbe::sim::study {
namespace {

using cutting::Rival;
using Eigen::Index;
using Eigen::Vector3d;
using kinematics::Pose;

/// One of the two machines of a difference.
struct Machined {
  std::vector<Pose> T_wt;  ///< of the samples that rivals need
  std::optional<SpindleLine> spindle;
};

Machined machined(const BaseRun& run, const Scene& scene, const std::vector<std::size_t>& needed) {
  const Job job = with_errors(run.ready.job, scene);
  const Commands own = run.ready.commanded_for_each ? commands(run.ready.arm, job) : Commands{};
  const Commands& commanded = run.ready.commanded_for_each ? own : run.ready.commanded;
  if (commanded.samples.states.size() != run.T_wt.size())
    throw BadInput(run.study.file.string(), 0, 0,
                   "engine = \"full\" for a case whose samples depend on the machine",
                   run.ready.arm.name);
  // what gives way less takes more off, which loads it more
  const bool bends = job.truth.compliance && !run.process.steps.empty();
  Machined made{
      tool_poses(job, commanded, bends ? cut_process(job, commanded) : run.process, needed),
      std::nullopt};
  if (run.spindle) made.spindle = spindle_line(job.truth.actual, *job.machine.workpiece_spindle);
  return made;
}

/// mm along the normal, how far a cutter of another shape leaves the surface on a rival's own move.
double left_by(const BaseRun& run, const cutting::CutterMotion& motion, const Rival& rival,
               const cutting::Cutter& cutter) {
  const cutting::Design& design = run.ready.job.design_w;
  const cutting::Ray ray{design.vertices.row(rival.vertex).transpose(),
                         design.normals.row(rival.vertex).transpose(), run.ready.job.scene.band};
  const auto entry =
      cutting::first_entry(cutter, cutting::move_after(motion, rival.move), ray, ray.band);
  return entry ? entry->s : rival.distance;
}

/// mm from the centre to the edge of a nose in the direction psi.
double edge_at(const cutting::Nose& nose, double psi) {
  double radius = nose.radius;
  for (const cutting::NoseWave& wave : nose.waves)
    radius += wave.amplitude * std::cos(wave.order * psi + wave.phase);
  return radius;
}

/// How much farther out another edge is where one touches, in (x, z) of frame t.
Eigen::Vector2d farther_out(const cutting::EdgeProfile& from, const cutting::EdgeProfile& to,
                            const Vector3d& contact_t) {
  const Eigen::Vector2d at(contact_t.x(), contact_t.z());
  const cutting::OutlineDistance here = cutting::distance(from.pieces, at);
  return (here.value - cutting::distance(to.pieces, at).value) * here.gradient;
}

/// One column that does nothing.
Columns nothing(const BaseRun& run) {
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(1, Index(run.rivals.size()));
  return {zero, zero};
}

Columns of_cutter(const BaseRun& run, const cutting::Cutter& from, const cutting::Cutter& to,
                  double per_unit) {
  Columns columns = nothing(run);
  if (same_shape(from, to)) return columns;
  if (cutting::is_hollow(from) || cutting::is_hollow(to))
    throw std::invalid_argument(
        "influence maps: expected convex tools, seen a tool.kind = \"profile\" that bends inwards");
  const cutting::CutterMotion motion = cutter_motion(run.T_wt, run.ready.commanded.samples);
  tbb::parallel_for(std::size_t(0), run.rivals.size(), [&](std::size_t r) {
    const double larger = left_by(run, motion, run.rivals[r], to);
    const double smaller = left_by(run, motion, run.rivals[r], from);
    columns.slope(0, Index(r)) = (larger - smaller) * per_unit;
  });
  return columns;
}

/// One column of what moves the contacts of rivals: `moved(rival, ends of its move)`, mm per unit.
template <typename Moved>
Columns of_contacts(const BaseRun& run, const Moved& moved) {
  Columns columns = nothing(run);
  tbb::parallel_for(std::size_t(0), run.rivals.size(), [&](std::size_t r) {
    const Rival& rival = run.rivals[r];
    const Vector3d d = moved(rival, ends_of(run, rival));
    columns.slope(0, Index(r)) = rival.gradient.dot(d);
    columns.shift(0, Index(r)) = rival.across.dot(d);
  });
  return columns;
}

/// An edge that stands out farther moves the contact away from the centre.
Columns of_nose(const BaseRun& run, const cutting::Nose& from, const cutting::Nose& to,
                double per_unit) {
  return of_contacts(run, [&](const Rival& rival, const std::array<End, 2>& ends) -> Vector3d {
    const Pose T_wt =
        tool_at(run, rival, {{run.T_wt[ends[0].sample], run.T_wt[ends[1].sample]}, run.spindle});
    const Vector3d contact_t = T_wt.inverse() * rival.contact;
    if (from.profile) {
      const Eigen::Vector2d out = farther_out(*from.profile, *to.profile, contact_t) * per_unit;
      return T_wt.linear() * Vector3d(out.x(), 0.0, out.y());
    }
    const double psi = std::atan2(contact_t.z(), contact_t.x());
    const double out = (edge_at(to, psi) - edge_at(from, psi)) * per_unit;
    return out * (rival.contact - T_wt.translation()).normalized();
  });
}

/// What the shape of the tool does.
Columns of_shape(const BaseRun& run, const ToolDescription& from, const ToolDescription& to,
                 double per_unit) {
  if (const auto* cutter = std::get_if<cutting::Cutter>(&from.actual))
    return of_cutter(run, *cutter, std::get<cutting::Cutter>(to.actual), per_unit);
  return of_nose(run, std::get<cutting::Nose>(from.actual), std::get<cutting::Nose>(to.actual),
                 per_unit);
}

/// What the two machines' poses do.
Columns of_poses(const BaseRun& run, const std::array<Machined, 2>& sides,
                 const std::vector<std::size_t>& needed, double per_unit) {
  const auto tool = [&](const Machined& side, const std::array<End, 2>& ends) {
    Tool one{{}, side.spindle};
    for (std::size_t e = 0; e < 2; ++e)
      one.T_wt[e] = side.T_wt[std::size_t(
          std::lower_bound(needed.begin(), needed.end(), ends[e].sample) - needed.begin())];
    return one;
  };
  return of_contacts(run, [&](const Rival& rival, const std::array<End, 2>& ends) -> Vector3d {
    return per_unit * displacement(run, rival, tool(sides[0], ends), tool(sides[1], ends));
  });
}

}  // namespace

bool same_shape(const cutting::Cutter& a, const cutting::Cutter& b) {
  return a.radius == b.radius && a.corner_radius == b.corner_radius &&
         a.flank_length == b.flank_length &&
         (a.outline == b.outline || (a.outline && b.outline && *a.outline == *b.outline));
}

Columns difference_columns(const BaseRun& run, Index input, const std::array<Scene, 2>& scenes) {
  const std::array<double, 2> at = around(run.study, input);
  const double per_unit = 1.0 / (at[1] - at[0]);
  const std::vector<std::size_t> needed = samples_of_rivals(run);
  Columns columns = of_poses(
      run, {machined(run, scenes[0], needed), machined(run, scenes[1], needed)}, needed, per_unit);
  const Columns shape = of_shape(run, scenes[0].tool, scenes[1].tool, per_unit);
  columns.slope += shape.slope;
  columns.shift += shape.shift;
  return columns;
}

}  // namespace abbe::sim::study
