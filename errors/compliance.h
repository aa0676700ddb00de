#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "kinematics/chain.h"

namespace abbe::errors {

/// Deviation per wrench: rows [EX EY EZ | EA EB EC] in mm and rad, columns [FX FY FZ | MX MY MZ] in
/// N and N mm. A physical compliance is symmetric and has no negative eigenvalue.
using Compliance = Eigen::Matrix<double, 6, 6>;

/// Checks a compliance.
/// @throws std::invalid_argument beginning with `name` unless C is finite, and symmetric and
///         without a negative eigenvalue to 1e-9 of its largest entry, after rotations are scaled
///         to translations at a distance of 100 mm
void validate(const Compliance& C, const std::string& name);

/// A section of constant diameter of a tool or holder.
struct CantileverSection {
  double length = 0.0;            ///< mm, > 0
  double diameter = 0.0;          ///< mm, > 0; for a fluted section its effective diameter
  double youngs_modulus = 2.1e5;  ///< N/mm^2, > 0
  double poisson_ratio = 0.3;     ///< > -1, at most 0.5
};

/// Returns the compliance at the free end of slender round sections, clamped at the far end of the
/// last one, in frame t: z from the free end to the clamp. Bending after Euler and Bernoulli,
/// elongation and torsion along the axis; shear is neglected (it adds about 0.6 (d/L)^2 of the
/// bending for a round carbide bar). If a load at height a above the free end is given as a wrench
/// at the free end, the error there is at most F a^3 / (6 E I).
/// @param sections  from the free end to the clamp, at least one
/// @throws std::invalid_argument naming the section and the number that is not physical
Compliance stepped_cantilever(std::span<const CantileverSection> sections);

/// Models of the workpiece compliance: displacement of the surface per force at the contact point.
struct WorkpieceBar {  ///< cantilever bar along `direction_w`, loaded across it
  Eigen::Vector3d clamp_w = Eigen::Vector3d::Zero();       ///< mm, centre of the clamped end
  Eigen::Vector3d direction_w = Eigen::Vector3d::UnitZ();  ///< unit, from the clamp outwards
  double length = 0.0;                                     ///< mm
  double second_moment = 0.0;     ///< mm^4, the same about both axes across
  double youngs_modulus = 7.0e4;  ///< N/mm^2
};
struct WorkpiecePlate {  ///< wall clamped along its foot, long compared with its height
  Eigen::Vector3d foot_w = Eigen::Vector3d::Zero();     ///< mm, a point of the foot
  Eigen::Vector3d up_w = Eigen::Vector3d::UnitZ();      ///< unit, from the foot to the free edge
  Eigen::Vector3d normal_w = Eigen::Vector3d::UnitX();  ///< unit, across the wall
  double height = 0.0;                                  ///< mm
  double thickness = 0.0;                               ///< mm
  double youngs_modulus = 7.0e4;                        ///< N/mm^2
  double poisson_ratio = 0.33;                          ///< > -1, at most 0.5
};
struct WorkpieceField {  ///< nodes of the surface from a finite-element program, each loaded alone
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> points_w;  ///< (n x 3) mm
  std::vector<Eigen::Matrix3d> compliance_w;                           ///< (n) mm/N, symmetric
  std::string file = {};                                               ///< source file; empty: none
};
using WorkpieceCompliance = std::variant<WorkpieceBar, WorkpiecePlate, WorkpieceField>;

/// Checks a workpiece compliance.
/// @throws std::invalid_argument naming the quantity that is not physical or the node of a field,
///         counted from 1; the compliance of a node must be symmetric and not negative to 1e-6 of
///         its largest entry, which covers the residual of an iterative solver
void validate(const WorkpieceCompliance& workpiece);

/// Returns the displacement of the surface at a point per force at it, (3 x 3) mm/N, workpiece
/// frame.
/// A bar and a plate deflect only across themselves and only beyond the clamp; beyond the free end
/// they deflect as at the free end. The plate is an endless cantilever plate under a point load
/// (Kirchhoff; at the free edge 0.1665 c^2 / D for nu = 0.3, where Jaramillo 1950 gives 0.168). A
/// field is averaged over its four nearest nodes at distances d with weights (1/d - 1/d5)^2, d5 the
/// distance of the fifth, so that it is continuous where the neighbours change. NaN for a point
/// that is not finite. For single calls, since it integrates the plate (50 us) and searches the
/// whole field; for many calls see PreparedWorkpiece.
Eigen::Matrix3d local_compliance(const WorkpieceCompliance& workpiece,
                                 const Eigen::Vector3d& point_w);

/// Returns the compliance of an endless cantilever plate of height c and flexural rigidity D under
/// a point load at height s c above its foot, in units of c^2/D, to 1e-9 relative and 1e-17
/// absolute.
/// @param s  0 .. 1
double cantilever_plate(double s, double poisson_ratio);

/// A field with a k-d tree over its nodes.
struct FieldTree {
  WorkpieceField field;            ///< nodes in the order of the tree
  std::vector<int> node;           ///< (n) index of each node in the original field
  std::vector<std::int8_t> split;  ///< (n) coordinate along which a node splits the nodes around it
};
/// A plate with its compliance tabulated over the height.
struct PlateTable {
  static constexpr int intervals = 128;
  WorkpiecePlate plate;
  std::array<double, intervals + 1> ratio{};  ///< cantilever_plate / s^2 at s = (1 - cos(pi i/n))/2
};
/// A workpiece compliance prepared for many evaluations. Immutable.
using PreparedWorkpiece = std::variant<WorkpieceBar, PlateTable, FieldTree>;

/// Returns the prepared compliance. @throws std::invalid_argument as `validate`
PreparedWorkpiece prepare(const WorkpieceCompliance& workpiece);

/// Returns the same as for the original compliance: bar and field bit for bit, the plate within
/// 1e-6 of its value; 2 us in a field of 100 000 nodes.
Eigen::Matrix3d local_compliance(const PreparedWorkpiece& workpiece,
                                 const Eigen::Vector3d& point_w);

inline constexpr std::size_t max_field_bytes = std::size_t(64) << 20;

/// Reads a field from CSV. Header
/// `x_mm,y_mm,z_mm,Cxx_um_per_N,Cyy_um_per_N,Czz_um_per_N,Cxy_um_per_N,Cyz_um_per_N,Cxz_um_per_N`
/// in any order (cross terms may be omitted, then they are zero), one node a row; separated by
/// commas or semicolons. Empty lines and lines that begin with # are skipped.
/// @throws BadInput, also beyond max_field_bytes
WorkpieceField read_compliance_field(std::string_view text, const std::string& file);

/// Returns the typical distance between neighbouring nodes of a field: the median over up to 1000
/// nodes, mm; 0 if the field has one node.
double node_spacing(const WorkpieceField& field);

/// Returns the largest distance from any of the points to its nearest node of a field, mm; 0 if
/// there are no points. A large distance reveals a field of another mesh.
double max_node_distance(const WorkpieceField& field,
                         const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points_w);

/// A moving point mass, for gravity and inertia.
struct MovingMass {
  char axis = 'X';                                     ///< carriage that carries it; 'S' as for
                                                       ///< elements, 't' the tool, 'w' the part
  double mass_kg = 0.0;                                ///< >= 0
  Eigen::Vector3d centre_b = Eigen::Vector3d::Zero();  ///< mm, bed frame, axes at zero
};

/// Compliance of one joint.
struct JointCompliance {
  char axis = 'X';                    ///< letter of the joint; 'S' as for elements
  Compliance C = Compliance::Zero();  ///< at the joint's point, along its deviation axes
};
/// Compliances and masses of a machine.
struct ComplianceErrors {
  std::vector<JointCompliance> joints;
  Compliance tool = Compliance::Zero();     ///< nose to tip, at the tip in frame t
  Compliance fixture = Compliance::Zero();  ///< of the part on its carriage, at the origin of w in
                                            ///< frame w
  std::optional<WorkpieceCompliance> workpiece;
  double scale = 1.0;  ///< of every compliance, >= 0
  std::vector<MovingMass> masses;
  std::optional<Eigen::Vector3d> gravity_b;  ///< mm/s^2; no gravity if empty
  bool inertia = false;                      ///< inertia forces of the masses, from the
                                             ///< accelerations
  kinematics::Wrench clamping_w = kinematics::Wrench::Zero();  ///< on the part at the origin of w;
                                                               ///< loads the fixture alone
};

/// The compliance errors bound to the nominal chain. Immutable; created by `bind`.
struct ComplianceModel {
  kinematics::Chain nominal;
  std::vector<Compliance> joints;  ///< (chain size) zero where stiff
  Compliance tool, fixture;
  std::optional<PreparedWorkpiece> workpiece;
  double workpiece_factor = 1.0;
  struct Mass {
    std::vector<int> joints;  ///< joints that carry it, from the bed outwards
    bool on_tool = false;     ///< also loads the tool
    bool on_part = false;     ///< also loads the fixture
    double mass_kg = 0.0;
    Eigen::Vector3d centre_b;
  };
  std::vector<Mass> masses;
  std::optional<Eigen::Vector3d> gravity_b;
  bool inertia = false;
  kinematics::Wrench clamping_w = kinematics::Wrench::Zero();
};

/// Binds the errors to a chain.
/// @throws std::invalid_argument naming the joint: an axis that the chain lacks or that comes
///         twice, a compliance that is not physical, a negative mass, a number that is not finite
ComplianceModel bind(const ComplianceErrors& errors, const kinematics::Chain& nominal);

/// Load on the machine at an instant of the cut.
struct Load {
  kinematics::Wrench tool_wrench_t = kinematics::Wrench::Zero();  ///< cutting wrench on the tool at
                                                                  ///< the tip, frame t
  Eigen::Vector3d contact_t = Eigen::Vector3d::Zero();            ///< mm, contact point, frame t
  kinematics::AxisVector acceleration;  ///< (joints) mm/s^2, rad/s^2; may be empty: none
};

/// Deviations that forces cause.
struct ForceDeviations {
  std::vector<kinematics::JointDeviation> joints;                ///< (chain size)
  kinematics::Deviation tool_t = kinematics::Deviation::Zero();  ///< of the tip, in frame t
  /// of the part at the origin of w: fixture, and part at the contact
  kinematics::Deviation workpiece_w = kinematics::Deviation::Zero();
};

/// Returns the pose T_wt of the tool in the part under deviations of joints, part and tool.
kinematics::Pose tool_in_workpiece(const kinematics::Chain& chain, const kinematics::AxisVector& q,
                                   const ForceDeviations& deviations);

/// Returns the deviations under a load. Every joint deflects by C J^T W, J the motion Jacobian of
/// the nominal chain, so the workpiece side takes the reaction and moves in the opposite direction.
/// The change of lever arms by the deviations is of second order and neglected (20 um on 200 mm:
/// 1e-4 of the deviations). A mass loads every joint between it and the bed by its weight and by
/// -m a; terms of its acceleration that are quadratic in speed are neglected.
ForceDeviations deviations(const ComplianceModel& model, const kinematics::AxisState& state,
                           const Load& load);

/// Returns the model with every compliance multiplied by `factor`.
ComplianceModel scaled(const ComplianceModel& model, double factor);

}  // namespace abbe::errors
