#include "sim/loop/beliefs.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/cut/tool_motion.h"

namespace abbe::sim {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Kind = CaseDescription::Belief;

[[noreturn]] void refuse(const Seen& seen, const std::string& expected, const std::string& found) {
  throw BadInput(seen.file.string(), 0, 0, expected, found);
}

bool gives(const BeliefDescription& belief, Kind kind) {
  switch (kind) {
    case Kind::Identified:
      return belief.identified.has_value();
    case Kind::Thermal:
      return belief.thermal.has_value();
    case Kind::Force:
      return belief.force.has_value();
    case Kind::Part:
      return belief.part.has_value();
    default:
      return false;
  }
}

void add_force(compensation::MachineBelief& belief, const Seen& seen, const Evidence& evidence) {
  using From = BeliefDescription::Force::From;
  const BeliefDescription::Force& force = *seen.belief.force;
  if (force.from == From::Current) {
    if (evidence.law) belief.bending = compensation::bending(*evidence.law, evidence.log);
    return;
  }
  compensation::LoadCourse load;
  if (force.from == From::Model)
    load = evidence.model_load.value_or(compensation::LoadCourse{});
  else
    load = compensation::load_of_dynamometer(evidence.log, force.smoothing_s);
  belief.force = {errors::bind(force.compliance, seen.machine.control), std::move(load)};
}

/// Number of rapids before each instant: what was cut between two of them is one pass.
Eigen::VectorXi passes_at(const program::Path& path, const VectorXd& time_s) {
  std::vector<double> rapids_s;
  for (const program::Block& block : path.blocks)
    if (block.interpolation == program::Interpolation::Rapid) rapids_s.push_back(block.end_s);
  return time_s.unaryExpr([&](double t) {
    return int(std::upper_bound(rapids_s.begin(), rapids_s.end(), t) - rapids_s.begin());
  });
}

/// Rotation of the workpiece's carriage against its place with the spindle at zero.
Eigen::Matrix3d turned_by_spindle(const Seen& seen, double time_s) {
  const int spindle = *seen.machine.workpiece_spindle;
  const auto& states = seen.samples.states;
  const std::size_t i = sample_at(seen.samples, time_s);
  kinematics::AxisVector q = states[i].q;
  if (i > 0 && states[i].time_s > states[i - 1].time_s) {
    const double u = (time_s - states[i - 1].time_s) / (states[i].time_s - states[i - 1].time_s);
    q = states[i - 1].q + u * (states[i].q - states[i - 1].q);
  }
  const Eigen::Matrix3d R_now = seen.machine.nominal.workpiece_in_bed(q).linear();
  q[spindle] = 0.0;
  return seen.machine.nominal.workpiece_in_bed(q).linear().transpose() * R_now;
}

}  // namespace

bool believes(const BeliefDescription& given, Kind belief, Kind kind) {
  if (belief == Kind::Fused) return gives(given, kind);
  if (belief == Kind::Composite) return kind == Kind::Identified || kind == Kind::Thermal;
  return belief == kind;
}

compensation::MachineBelief machine_belief(const Seen& seen, const CaseDescription& compensator,
                                           const Evidence& evidence) {
  const BeliefDescription& given = seen.belief;
  const auto wants = [&](Kind kind, const char* section) {
    if (!believes(given, compensator.belief, kind)) return false;
    if (!gives(given, kind))
      refuse(seen, fmt::format("{} in [belief] for the case {}", section, compensator.name),
             "none");
    return true;
  };
  compensation::MachineBelief belief{
      seen.machine.control, seen.machine.workpiece_spindle, {}, {}, {}, {}, {}};
  try {
    if (wants(Kind::Identified, "identified"))
      belief.geometric =
          errors::scaled(errors::bind(*given.identified, seen.machine.control), given.scale);
    if (wants(Kind::Thermal, "thermal")) {
      belief.thermal = compensation::course_of(*given.thermal, evidence.log, seen.machine.control);
      belief.thermal->value *= given.scale;
    }
    if (wants(Kind::Force, "force")) add_force(belief, seen, evidence);
    if (wants(Kind::Part, "part")) belief.part = evidence.part;
  } catch (const std::invalid_argument& fault) {
    refuse(seen, "a belief that fits the machine and what it reads", fault.what());
  }
  if (!belief.geometric && !belief.thermal && !belief.force && !belief.bending && !belief.part &&
      compensator.belief == Kind::Fused && !given.part)
    refuse(seen, "something to believe in [belief] for the case " + compensator.name, "nothing");
  return belief;
}

Index nearest_vertex(const cutting::Points& vertices, const Eigen::RowVector3d& point) {
  Index row = 0;
  (vertices.rowwise() - point).rowwise().squaredNorm().minCoeff(&row);
  return row;
}

Eigen::VectorXd left_by_program(const Seen& seen, const cutting::Surface& error_free,
                                const Eigen::MatrixX3d& points_w) {
  VectorXd left(points_w.rows());
  for (Index i = 0; i < left.size(); ++i) {
    const Index vertex = nearest_vertex(seen.design_w.vertices, points_w.row(i));
    const bool is_cut = error_free.status[std::size_t(vertex)] == cutting::VertexStatus::Cut;
    left[i] = is_cut ? error_free.residual[vertex] : 0.0;
  }
  return left;
}

compensation::PartCourse course_of_part(const Seen& seen, const cutting::Surface& error_free,
                                        const VectorXd& total) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < error_free.status.size(); ++i)
    if (error_free.status[i] == cutting::VertexStatus::Cut) rows.push_back(Index(i));
  compensation::KnownPart part{seen.design_w.normals(rows, Eigen::all), total(rows),
                               error_free.cut_time_s(rows),
                               passes_at(seen.path, error_free.cut_time_s(rows))};
  if (seen.machine.workpiece_spindle)
    for (Index i = 0; i < part.time_s.size(); ++i)
      part.normals.row(i) =
          part.normals.row(i) * turned_by_spindle(seen, part.time_s[i]).transpose();
  return compensation::explained(part);
}

}  // namespace abbe::sim
