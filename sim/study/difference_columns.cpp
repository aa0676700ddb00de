#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "cutting/cutter_entry.h"
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
  const Compensated own = run.ready.told_for_each ? commands(run.ready.arm, job) : Compensated{};
  const Compensated& told = run.ready.told_for_each ? own : run.ready.told;
  if (told.samples.states.size() != run.T_wt.size())
    throw BadInput(run.study.file.string(), 0, 0,
                   "engine = \"full\" for a case whose samples depend on the machine",
                   run.ready.arm.name);
  // what gives way less takes more off, which loads it more
  const bool bends = job.truth.compliance && !run.process.steps.empty();
  Machined made{tool_poses(job, told, bends ? cut_process(job, told) : run.process, needed),
                std::nullopt};
  if (run.spindle) made.spindle = spindle_line(job.machine.actual, *job.machine.workpiece_spindle);
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

bool same_shape(const cutting::Cutter& a, const cutting::Cutter& b) {
  return a.radius == b.radius && a.corner_radius == b.corner_radius &&
         a.flank_length == b.flank_length;
}

void add_cutter(const BaseRun& run, Index input, const std::array<cutting::Cutter, 2>& cutters,
                double per_unit, InfluenceMap& map) {
  if (same_shape(cutters[0], cutters[1])) return;
  const cutting::CutterMotion motion = cutter_motion(run.T_wt, run.ready.told.samples);
  tbb::parallel_for(std::size_t(0), run.rivals.size(), [&](std::size_t r) {
    const double larger = left_by(run, motion, run.rivals[r], cutters[1]);
    const double smaller = left_by(run, motion, run.rivals[r], cutters[0]);
    map.slope(input, Index(r)) += (larger - smaller) * per_unit;
  });
}

/// An edge that stands out farther moves the contact away from the centre.
void add_nose(const BaseRun& run, Index input, const std::array<cutting::Nose, 2>& noses,
              double per_unit, InfluenceMap& map) {
  tbb::parallel_for(std::size_t(0), run.rivals.size(), [&](std::size_t r) {
    const Rival& rival = run.rivals[r];
    const std::array<End, 2> ends = ends_of(run, rival);
    const Pose T_wt =
        tool_at(run, rival, {{run.T_wt[ends[0].sample], run.T_wt[ends[1].sample]}, run.spindle});
    const Vector3d contact_t = T_wt.inverse() * rival.contact;
    const double psi = std::atan2(contact_t.z(), contact_t.x());
    const double out = (edge_at(noses[1], psi) - edge_at(noses[0], psi)) * per_unit;
    const Vector3d d = out * (rival.contact - T_wt.translation()).normalized();
    map.slope(input, Index(r)) += rival.gradient.dot(d);
    map.shift(input, Index(r)) += rival.across.dot(d);
  });
}

/// What the shape of the tool does.
void add_shape(const BaseRun& run, Index input, const std::array<Scene, 2>& scenes, double per_unit,
               InfluenceMap& map) {
  const auto &a = scenes[0].tool.actual, &b = scenes[1].tool.actual;
  if (std::holds_alternative<cutting::Cutter>(a))
    add_cutter(run, input, {std::get<cutting::Cutter>(a), std::get<cutting::Cutter>(b)}, per_unit,
               map);
  else
    add_nose(run, input, {std::get<cutting::Nose>(a), std::get<cutting::Nose>(b)}, per_unit, map);
}

}  // namespace

void add_difference(const BaseRun& run, Index input, const std::array<Scene, 2>& scenes,
                    InfluenceMap& map) {
  const std::array<double, 2> at = around(run.study, input);
  const double per_unit = 1.0 / (at[1] - at[0]);
  const std::vector<std::size_t> needed = samples_of_rivals(run);
  const std::array sides{machined(run, scenes[0], needed), machined(run, scenes[1], needed)};
  const auto tool = [&](const Machined& side, const std::array<End, 2>& ends) {
    Tool one{{}, side.spindle};
    for (std::size_t e = 0; e < 2; ++e)
      one.T_wt[e] = side.T_wt[std::size_t(
          std::lower_bound(needed.begin(), needed.end(), ends[e].sample) - needed.begin())];
    return one;
  };
  tbb::parallel_for(std::size_t(0), run.rivals.size(), [&](std::size_t r) {
    const Rival& rival = run.rivals[r];
    const std::array<End, 2> ends = ends_of(run, rival);
    const Vector3d d =
        per_unit * displacement(run, rival, tool(sides[0], ends), tool(sides[1], ends));
    map.slope(input, Index(r)) = rival.gradient.dot(d);
    map.shift(input, Index(r)) = rival.across.dot(d);
  });
  add_shape(run, input, scenes, per_unit, map);
}

}  // namespace abbe::sim::study
