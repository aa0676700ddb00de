#include "errors/compliance.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "errors/element.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/units.h"

namespace abbe::errors {

namespace {

constexpr double reference_arm = 100.0;  // mm; turns rotations into comparable translations

void require_physical(bool holds, const std::string& name, const std::string& expected,
                      double seen) {
  if (!holds)
    throw std::invalid_argument(fmt::format("{}: expected {}, seen {}", name, expected, seen));
}

// The conditions are written so that NaN fails them.
bool is_positive(double x) { return x > 0.0 && std::isfinite(x); }

void check(const CantileverSection& section, const std::string& name) {
  require_physical(is_positive(section.length), name, "a length above 0 mm", section.length);
  require_physical(is_positive(section.diameter), name, "a diameter above 0 mm", section.diameter);
  require_physical(is_positive(section.youngs_modulus), name, "a Young's modulus above 0 N/mm^2",
                   section.youngs_modulus);
  require_physical(section.poisson_ratio > -1.0 && section.poisson_ratio <= 0.5, name,
                   "a Poisson ratio above -1 and at most 0.5", section.poisson_ratio);
}

}  // namespace

void validate(const Compliance& C, const std::string& name) {
  Eigen::Matrix<double, 6, 1> scale;
  scale << 1.0, 1.0, 1.0, reference_arm, reference_arm, reference_arm;
  const Compliance scaled_C = scale.asDiagonal() * C * scale.asDiagonal();
  if (!scaled_C.allFinite())
    throw std::invalid_argument(name + ": expected finite compliances, seen NaN or infinity");
  const double max_entry = scaled_C.cwiseAbs().maxCoeff();
  // 1e-9 of the largest entry: more than the rounding of a compliance that was inverted or rotated,
  // far less than the uncertainty of any measured one.
  const double tolerance = 1e-9 * max_entry;
  const double skew = (scaled_C - scaled_C.transpose()).cwiseAbs().maxCoeff();
  require_physical(skew <= tolerance, name, "a symmetric compliance (to 1e-9 of its largest entry)",
                   skew / max_entry);
  // Normalised first, because squares of huge entries would overflow.
  const Compliance normalised = max_entry > 0.0 ? Compliance(scaled_C / max_entry) : scaled_C;
  const Eigen::SelfAdjointEigenSolver<Compliance> solver(normalised, Eigen::EigenvaluesOnly);
  require_physical(solver.eigenvalues()[0] >= -1e-9, name,
                   "a compliance without negative eigenvalues (it must not move against the force)",
                   solver.eigenvalues()[0] * max_entry);
}

Compliance stepped_cantilever(std::span<const CantileverSection> sections) {
  if (sections.empty())
    throw std::invalid_argument("cantilever: expected at least one section, seen none");
  Compliance C = Compliance::Zero();
  double start = 0.0;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const CantileverSection& section = sections[i];
    check(section, fmt::format("cantilever section {}", i + 1));
    const double end = start + section.length;
    const double E = section.youngs_modulus;
    const double squared_diameter = section.diameter * section.diameter;
    const double EI = E * pi * squared_diameter * squared_diameter / 64.0;
    const double GJ = EI / (1.0 + section.poisson_ratio);  // G = E / 2(1 + nu), J = 2 I
    // Integrals of 1, z and z^2 over the section (Castigliano).
    const double i0 = section.length / EI;
    const double i1 = 0.5 * (end + start) * i0;
    const double i2 = (end * end + end * start + start * start) / 3.0 * i0;
    C(0, 0) += i2;
    C(1, 1) += i2;
    C(2, 2) += section.length / (E * pi * squared_diameter / 4.0);
    C(3, 3) += i0;
    C(4, 4) += i0;
    C(5, 5) += section.length / GJ;
    C(3, 1) += i1;  // A force along y turns the free end about +x, since the clamp is at +z.
    C(4, 0) -= i1;
    start = end;
  }
  C(1, 3) = C(3, 1);
  C(0, 4) = C(4, 0);
  validate(C, "cantilever");
  return C;
}

namespace {

using Eigen::Vector3d;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;
using kinematics::Wrench;

constexpr double newton = 1e-3;  // N in kg mm/s^2

/// Returns the joints of one side, from the bed outwards, up to and including `last`; without
/// `last` all of them.
std::vector<int> carriers(const Chain& chain, Side side, std::optional<int> last) {
  std::vector<int> result;
  for (int k = 0; k < chain.size(); ++k) {
    const int i = side == Side::Tool ? k : chain.size() - 1 - k;
    if (chain.joints()[std::size_t(i)].side != side) continue;
    result.push_back(i);
    if (last == i) break;
  }
  return result;
}

/// Returns a mass with the joints that carry it.
ComplianceModel::Mass bind(const MovingMass& mass, const Chain& chain) {
  const std::string who = fmt::format("mass on {}", mass.axis);
  if (!(mass.mass_kg >= 0.0) || !std::isfinite(mass.mass_kg))
    throw std::invalid_argument(
        fmt::format("{}: expected a mass of at least 0 kg, seen {}", who, mass.mass_kg));
  if (!mass.centre_b.allFinite())
    throw std::invalid_argument(who + ": expected a finite centre, seen NaN or infinity");
  ComplianceModel::Mass bound;
  bound.mass_kg = mass.mass_kg;
  bound.centre_b = mass.centre_b;
  bound.on_tool = mass.axis == 't';
  bound.on_part = mass.axis == 'w';
  if (bound.on_tool || bound.on_part) {
    bound.joints = carriers(chain, bound.on_tool ? Side::Tool : Side::Workpiece, std::nullopt);
  } else {
    const int joint = axis_joint(mass.axis, chain, who);
    bound.joints = carriers(chain, chain.joints()[std::size_t(joint)].side, joint);
  }
  return bound;
}

Wrench rotate_wrench(const Eigen::Matrix3d& R, const Wrench& wrench) {
  Wrench result;
  result << R * wrench.head<3>(), R * wrench.tail<3>();
  return result;
}

/// Returns the wrench of a force.
/// @param arm  from the reference point of the wrench to the point where the force acts
Wrench wrench_at(const Vector3d& force, const Vector3d& arm) {
  Wrench result;
  result << force, arm.cross(force);
  return result;
}

/// The joints that carry a mass, from the bed outwards, and its centre at a position of the axes.
struct MassPath {
  struct JointFrames {
    Pose T_before = Pose::Identity();     ///< displacement of the joint's parent from its
                                          ///< position with all axes at zero
    Pose T_deviation = Pose::Identity();  ///< displacement of the frame in which the
                                          ///< deviation of the joint is stated
  };
  std::array<JointFrames, kinematics::max_joints> frames;
  Vector3d centre_b;  ///< mm, current centre of the mass
};

/// Returns the frames of the joints that carry a mass, at positions q.
MassPath mass_path(const Chain& chain, const ComplianceModel::Mass& mass,
                   const kinematics::AxisVector& q) {
  MassPath result;
  Pose T = Pose::Identity();
  for (std::size_t k = 0; k < mass.joints.size(); ++k) {
    const int i = mass.joints[k];
    const Joint& joint = chain.joints()[std::size_t(i)];
    const Pose T_after =
        T * kinematics::carriage_displacement(joint, kinematics::carriage_travel(joint.side, q[i]));
    // ISO 230-7: the error motion of a rotary axis is stated along axes that do not turn with it.
    const bool is_before_motion =
        joint.motion == Motion::Rotary && joint.deviation_axes == kinematics::DeviationAxes::Fixed;
    result.frames[k] = {T, is_before_motion ? T : T_after};
    T = T_after;
  }
  result.centre_b = T * mass.centre_b;
  return result;
}

/// Returns the acceleration of a mass without centripetal and Coriolis terms, which are quadratic
/// in the speeds.
Vector3d mass_acceleration(const MassPath& path, const Chain& chain,
                           const ComplianceModel::Mass& mass,
                           const kinematics::AxisVector& acceleration) {
  Vector3d a = Vector3d::Zero();
  for (std::size_t k = 0; k < mass.joints.size(); ++k) {
    const int i = mass.joints[k];
    const Joint& joint = chain.joints()[std::size_t(i)];
    const Pose& T = path.frames[k].T_before;
    const Vector3d along =
        T.linear() * joint.direction_b * kinematics::carriage_travel(joint.side, acceleration[i]);
    if (joint.motion == Motion::Linear) a += along;
    if (joint.motion == Motion::Rotary) a += along.cross(path.centre_b - T * joint.point_b);
  }
  return a;
}

/// Adds the deviations by weight and inertia of a mass.
void add_mass(const ComplianceModel& model, const ComplianceModel::Mass& mass,
              const kinematics::AxisState& state, const Load& load, ForceDeviations& result) {
  const Chain& chain = model.nominal;
  const MassPath path = mass_path(chain, mass, state.q);
  Vector3d acceleration_b = model.gravity_b.value_or(Vector3d::Zero());
  // D'Alembert: a mass with acceleration a loads the machine like gravity of -a.
  if (model.inertia && load.acceleration.size() > 0)
    acceleration_b -= mass_acceleration(path, chain, mass, load.acceleration);
  const Vector3d force_b = newton * mass.mass_kg * acceleration_b;
  for (std::size_t k = 0; k < mass.joints.size(); ++k) {
    const std::size_t i = std::size_t(mass.joints[k]);
    const Pose& T = path.frames[k].T_deviation;
    const Vector3d arm_b = path.centre_b - T * chain.joints()[i].point_b;
    result.joints[i].motion +=
        model.joints[i] * rotate_wrench(T.linear().transpose(), wrench_at(force_b, arm_b));
  }
  if (!mass.on_tool && !mass.on_part) return;
  const Pose T_body = mass.on_tool ? chain.tool_in_bed(state.q) : chain.workpiece_in_bed(state.q);
  const Wrench body_wrench = rotate_wrench(
      T_body.linear().transpose(), wrench_at(force_b, path.centre_b - T_body.translation()));
  if (mass.on_tool) result.tool_t += model.tool * body_wrench;
  if (mass.on_part) result.workpiece_w += model.fixture * body_wrench;
}

bool is_compliant(const Compliance& C) { return !C.isZero(0.0); }

/// Adds the deviations by the cutting wrench.
void add_cutting_deviations(const ComplianceModel& model, const kinematics::AxisState& state,
                            const Load& load, ForceDeviations& result) {
  const Pose T_wt = model.nominal.tool_in_workpiece(state.q);
  const Wrench on_tool_w = rotate_wrench(T_wt.linear(), load.tool_wrench_t);
  if (std::any_of(model.joints.begin(), model.joints.end(), is_compliant)) {
    const Eigen::MatrixXd J = kinematics::motion_jacobian(model.nominal, state.q);
    // C J' W: by virtual work the transposed Jacobian transforms the wrench at the tip to the point
    // of the joint, with the opposite sign on the workpiece side.
    for (std::size_t i = 0; i < model.joints.size(); ++i) {
      if (!is_compliant(model.joints[i])) continue;
      result.joints[i].motion +=
          model.joints[i] * (J.middleCols<6>(6 * Eigen::Index(i)).transpose() * on_tool_w);
    }
  }
  result.tool_t += model.tool * load.tool_wrench_t;
  Wrench on_part_w = -on_tool_w;
  // The wrench is stated at the tip, the compliance of the fixture at the origin of w.
  on_part_w.tail<3>() -= T_wt.translation().cross(on_tool_w.head<3>());
  result.workpiece_w += model.fixture * on_part_w;
  if (model.workpiece) {
    result.workpiece_w.head<3>() -=
        model.workpiece_factor *
        (local_compliance(*model.workpiece, T_wt * load.contact_t) * on_tool_w.head<3>());
  }
}

}  // namespace

ComplianceModel bind(const ComplianceErrors& errors, const Chain& nominal) {
  if (!(errors.scale >= 0.0) || !std::isfinite(errors.scale))
    throw std::invalid_argument(
        fmt::format("compliance: expected a scale of at least 0, seen {}", errors.scale));
  if (errors.gravity_b && !errors.gravity_b->allFinite())
    throw std::invalid_argument("gravity: expected a finite vector, seen NaN or infinity");
  if (!errors.clamping_w.allFinite())
    throw std::invalid_argument("clamping: expected a finite wrench, seen NaN or infinity");
  validate(errors.tool, "compliance of the tool");
  validate(errors.fixture, "compliance of the fixture");
  const std::size_t n = std::size_t(nominal.size());
  ComplianceModel model{nominal,
                        std::vector<Compliance>(n, Compliance::Zero()),
                        errors.tool,
                        errors.fixture,
                        {},
                        1.0,
                        {},
                        errors.gravity_b,
                        errors.inertia,
                        errors.clamping_w};
  std::vector<char> seen(n, 0);
  for (const JointCompliance& joint : errors.joints) {
    const std::string who = fmt::format("compliance of axis {}", joint.axis);
    const std::size_t i = std::size_t(axis_joint(joint.axis, nominal, who));
    if (seen[i]) throw std::invalid_argument(who + ": expected each axis only once, seen twice");
    seen[i] = 1;
    validate(joint.C, who);
    model.joints[i] = joint.C;
  }
  if (errors.workpiece) model.workpiece = prepare(*errors.workpiece);
  for (const MovingMass& mass : errors.masses) model.masses.push_back(bind(mass, nominal));
  return scaled(model, errors.scale);
}

Pose tool_in_workpiece(const Chain& chain, const kinematics::AxisVector& q,
                       const ForceDeviations& deviations) {
  Pose T_wt = chain.tool_in_workpiece(q, deviations.joints);
  if (!deviations.workpiece_w.isZero(0.0))
    T_wt = kinematics::motion(deviations.workpiece_w, Vector3d::Zero()).inverse() * T_wt;
  if (!deviations.tool_t.isZero(0.0))
    T_wt = T_wt * kinematics::motion(deviations.tool_t, Vector3d::Zero());
  return T_wt;
}

ForceDeviations deviations(const ComplianceModel& model, const kinematics::AxisState& state,
                           const Load& load) {
  assert(load.acceleration.size() == 0 || load.acceleration.size() == model.nominal.size());
  ForceDeviations sum;
  sum.joints.resize(model.joints.size());
  // The clamping wrench loads the fixture at all times, not only during a cut.
  sum.workpiece_w = model.fixture * model.clamping_w;
  if (!load.tool_wrench_t.isZero(0.0)) add_cutting_deviations(model, state, load, sum);
  if (model.gravity_b || (model.inertia && load.acceleration.size() > 0)) {
    for (const ComplianceModel::Mass& mass : model.masses) add_mass(model, mass, state, load, sum);
  }
  return sum;
}

ComplianceModel scaled(const ComplianceModel& model, double factor) {
  ComplianceModel result = model;
  for (Compliance& C : result.joints) C *= factor;
  result.tool *= factor;
  result.fixture *= factor;
  result.workpiece_factor *= factor;
  return result;
}

}  // namespace abbe::errors
