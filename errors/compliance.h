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
/// N and N mm. Physical ones are symmetric and have no negative eigenvalue.
using Compliance = Eigen::Matrix<double, 6, 6>;

/// @throws std::invalid_argument beginning with `what` unless C is finite, and symmetric and
///         without a negative eigenvalue to 1e-9 of its largest scaled entry (scaled: lengths by
///         100 mm)
void validate(const Compliance& C, const std::string& what);

/// A round piece of a tool or holder.
struct CantileverSection {
  double length = 0.0;            ///< mm, > 0
  double diameter = 0.0;          ///< mm, > 0; of a fluted part its effective one
  double youngs_modulus = 2.1e5;  ///< N/mm^2, > 0
  double poisson_ratio = 0.3;     ///< > -1, at most 0.5
};

/// Compliance at the free end of slender round sections, clamped at the far end of the last one, in
/// frame t: z from the free end to the clamp. Bending after Euler and Bernoulli, stretch and
/// torsion along the axis; shear is left out (it adds about 0.6 (d/L)^2 of the bending for a round
/// carbide bar). A load at height a above the free end, handed over as a wrench at the free end,
/// errs at the free end by at most F a^3 / (6 E I).
/// @param sections  from the free end to the clamp, at least one
/// @throws std::invalid_argument naming the section and its number that is not physical
Compliance stepped_cantilever(std::span<const CantileverSection> sections);

/// How a part gives way where the tool touches it: displacement of the surface per force there.
struct WorkpieceBar {  ///< cantilever bar along `direction`, loaded across it
  Eigen::Vector3d clamp_w = Eigen::Vector3d::Zero();       ///< mm, centre of the clamped end
  Eigen::Vector3d direction_w = Eigen::Vector3d::UnitZ();  ///< unit, from the clamp outwards
  double length = 0.0;                                     ///< mm
  double second_moment = 0.0;     ///< mm^4, the same about both axes across
  double youngs_modulus = 7.0e4;  ///< N/mm^2
};
struct WorkpiecePlate {  ///< wall clamped along its foot, long against its height
  Eigen::Vector3d foot_w = Eigen::Vector3d::Zero();     ///< mm, a point of the foot
  Eigen::Vector3d up_w = Eigen::Vector3d::UnitZ();      ///< unit, from the foot to the free edge
  Eigen::Vector3d normal_w = Eigen::Vector3d::UnitX();  ///< unit, across the wall
  double height = 0.0;                                  ///< mm
  double thickness = 0.0;                               ///< mm
  double youngs_modulus = 7.0e4;                        ///< N/mm^2
  double poisson_ratio = 0.33;                          ///< > -1, at most 0.5
};
struct WorkpieceField {  ///< from a finite-element program: nodes of the surface, each loaded alone
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> points_w;  ///< (n x 3) mm
  std::vector<Eigen::Matrix3d> compliance_w;                           ///< (n) mm/N, symmetric
  std::string file = {};  ///< that it was read from; empty: none
};
using WorkpieceCompliance = std::variant<WorkpieceBar, WorkpiecePlate, WorkpieceField>;

/// @throws std::invalid_argument naming what is not physical, or the node of a field, counted from
///         1; a node's compliance is symmetric and not negative to 1e-6 of its largest entry, which
///         leaves room for what an iterative solver leaves
void validate(const WorkpieceCompliance& part);

/// Displacement of the surface at a point per force at it, (3 x 3) mm/N, workpiece frame. A bar and
/// a plate give way only across themselves and only beyond the clamp; beyond their free end they
/// give way as there. A plate's is that of an endless cantilever plate under a point load
/// (Kirchhoff; at the free edge 0.1665 c^2 / D for nu = 0.3, for which Jaramillo 1950 prints
/// 0.168). A field is weighted over its four nearest nodes at distances d by (1/d - 1/d5)^2, d5
/// that of the fifth, so that it does not jump where the neighbours change. NaN of a point that is
/// not finite. One-off: it integrates the plate (50 us) and searches the whole field. See
/// PreparedWorkpiece.
Eigen::Matrix3d local_compliance(const WorkpieceCompliance& part, const Eigen::Vector3d& point_w);

/// Compliance of an endless cantilever plate under a point load at height s c above its foot,
/// in units of c^2/D, to 1e-9 of itself and 1e-17. @param s  0 .. 1
double cantilever_plate(double s, double poisson_ratio);

/// A field with a tree over its nodes.
struct IndexedField {
  WorkpieceField field;            ///< nodes in the order of the tree
  std::vector<int> node;           ///< (n) number of each in the field that was given
  std::vector<std::int8_t> split;  ///< (n) coordinate by which a node parts those around it
};
/// A plate with its compliance tabulated over the height.
struct PlateTable {
  static constexpr int intervals = 128;
  WorkpiecePlate plate;
  std::array<double, intervals + 1> ratio{};  ///< cantilever_plate / s^2 at s = (1 - cos(pi i/n))/2
};
/// What a part's compliance becomes to be asked often. Immutable.
using PreparedWorkpiece = std::variant<WorkpieceBar, PlateTable, IndexedField>;

/// @throws std::invalid_argument as `validate`
PreparedWorkpiece prepare(const WorkpieceCompliance& part);

/// The same as of what it was made from: bar and field to the last bit, the plate within 1e-6 of
/// its value; 2 us in a field of 100 000 nodes.
Eigen::Matrix3d local_compliance(const PreparedWorkpiece& part, const Eigen::Vector3d& point_w);

inline constexpr std::size_t max_field_bytes = std::size_t(64) << 20;

/// Reads a field from CSV: a head `x_mm,y_mm,z_mm,Cxx_um_per_N,Cyy_um_per_N,Czz_um_per_N,
/// Cxy_um_per_N,Cyz_um_per_N,Cxz_um_per_N` in any order (cross terms may be left out, then they are
/// zero), a node a row; commas or semicolons, empty lines and lines that begin with # are skipped.
/// @throws BadInput, also beyond max_field_bytes
WorkpieceField read_compliance_field(std::string_view text, const std::string& file);

/// Distance of neighbouring nodes of a field: the median over up to 1000 of them, mm;
/// 0 for one node.
double node_spacing(const WorkpieceField& field);

/// Largest distance from a point to the nearest node of a field, mm: shows one of another mesh.
/// Zero without points.
double coverage(const WorkpieceField& field,
                const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points_w);

/// A moving mass, for gravity and inertia, as a point.
struct MovingMass {
  char axis = 'X';                                     ///< carriage that carries it; 'S' as for
                                                       ///< elements, 't' the tool, 'w' the part
  double mass_kg = 0.0;                                ///< >= 0
  Eigen::Vector3d centre_b = Eigen::Vector3d::Zero();  ///< mm, bed frame, axes at zero
};

/// What of a machine gives way.
struct JointCompliance {
  char axis = 'X';                    ///< joint of that letter; 'S' as for elements
  Compliance C = Compliance::Zero();  ///< at the joint's point, along its deviation axes
};
struct ComplianceErrors {
  std::vector<JointCompliance> joints;
  Compliance tool = Compliance::Zero();     ///< nose to tip, at the tip in frame t
  Compliance fixture = Compliance::Zero();  ///< of the part on its carriage, at w in frame w
  std::optional<WorkpieceCompliance> workpiece;
  double scale = 1.0;  ///< of every compliance, >= 0
  std::vector<MovingMass> masses;
  std::optional<Eigen::Vector3d> gravity_b;  ///< mm/s^2; off unless given
  bool inertia = false;                      ///< of the masses, from the accelerations
  kinematics::Wrench clamping_w = kinematics::Wrench::Zero();  ///< on the part at w; bears on the
                                                               ///< fixture alone
};

/// The same bound to the nominal chain. Immutable: made by `bind`.
struct ComplianceModel {
  kinematics::Chain nominal;
  std::vector<Compliance> joints;  ///< (chain size) zero where stiff
  Compliance tool, fixture;
  std::optional<PreparedWorkpiece> workpiece;
  double workpiece_factor = 1.0;
  struct Mass {
    std::vector<int> joints;  ///< of the chain that carry it, from the bed outwards
    bool on_tool = false;     ///< bears on the tool too
    bool on_part = false;     ///< bears on the fixture too
    double mass_kg = 0.0;
    Eigen::Vector3d centre_b;
  };
  std::vector<Mass> masses;
  std::optional<Eigen::Vector3d> gravity_b;
  bool inertia = false;
  kinematics::Wrench clamping_w = kinematics::Wrench::Zero();
};

/// @throws std::invalid_argument naming the joint: an axis that the chain lacks or twice, a
///         compliance that is not physical, a negative mass, a number that is not finite
ComplianceModel bind(const ComplianceErrors& errors, const kinematics::Chain& nominal);

/// What acts on the machine at an instant.
struct Load {
  kinematics::Wrench on_tool_t = kinematics::Wrench::Zero();  ///< of the cut, at the tip, frame t
  Eigen::Vector3d contact_t = Eigen::Vector3d::Zero();        ///< mm, where it acts, frame t
  kinematics::AxisVector acceleration;  ///< (joints) mm/s^2, rad/s^2; may be empty: none
};

/// Force part of the deviations.
struct ForceDeviations {
  std::vector<kinematics::JointDeviation> joints;                     ///< (chain size)
  kinematics::Deviation tool_t = kinematics::Deviation::Zero();       ///< of the tip, in frame t
  kinematics::Deviation workpiece_w = kinematics::Deviation::Zero();  ///< of the part at w: fixture
                                                                      ///< and wall at the contact
};

/// Where a chain brings the tool in the part, T_wt, under deviations of joints, part and tool.
kinematics::Pose tool_in_workpiece(const kinematics::Chain& chain, const kinematics::AxisVector& q,
                                   const ForceDeviations& all);

/// Every joint gives way by C J^T W, J the motion Jacobian of the nominal chain, so the workpiece
/// side bears the reaction and moves the other way; of second order in the deviations are left out
/// the changes of arm (20 um on 200 mm: 1e-4 of the force part). A mass bears by its weight and by
/// -m a on every joint between it and the bed; of its acceleration the terms with squares of speed
/// are left out.
ForceDeviations deviations(const ComplianceModel& model, const kinematics::AxisState& state,
                           const Load& load);

/// Every compliance of the model times `factor`.
ComplianceModel scaled(const ComplianceModel& model, double factor);

}  // namespace abbe::errors
