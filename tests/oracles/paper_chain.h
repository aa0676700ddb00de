#pragma once

#include <vector>

#include <Eigen/Core>

/// A second machine chain, written with plain 4 x 4 matrices as the papers write it, to hold the
/// first against. It shares no code with the modules. Lengths in mm, angles in rad.
namespace abbe::oracles {

/// Six errors of one pair of bodies: translations, then rotations about x, y, z.
struct SixErrors {
  double dx = 0, dy = 0, dz = 0, alpha = 0, beta = 0, gamma = 0;
};

enum class Angles {
  Linearised,  ///< 1 + theta, the error matrix as the papers print it: not quite a rotation
  Exact,       ///< the rotation whose vector is theta
};

/// One body of a multi-body system, connected to a lower one. Its transform in that body is
/// T_p dT_p T_s dT_s: place, error of place, motion, error of motion (Peng et al. 2017).
struct Body {
  int lower = 0;  ///< number of the body that carries it, from 1; 0 is the bed
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  ///< origin in the frame of the lower body
  SixErrors place_error;
  char motion = '-';  ///< x y z: slide along; a b c: turn about x y z; -: fixed
  double amount = 0;  ///< mm or rad, of the body itself in the lower one
  SixErrors motion_error;
  bool error_before_motion = false;  ///< T_p dT_p dT_s T_s instead
};

/// Transform of a body (numbered from 1) in the bed: the product up its row of lower bodies.
Eigen::Matrix4d in_bed(const std::vector<Body>& bodies, int body, Angles angles);

/// Transform of `body` in the frame of `other`.
Eigen::Matrix4d relative(const std::vector<Body>& bodies, int other, int body, Angles angles);

/// The servo platform: elements of X and Z, squareness of Z to X, positions of the carriages
/// themselves (the carriage of X carries the workpiece).
struct Platform {
  SixErrors x, z;
  double squareness = 0;  ///< beta_xz
  double x_position = 0, z_position = 0;
};

/// E = W - T minus its error-free value, bed frame, from the matrices of the bodies.
/// @param p_w, p_t  the point of the workpiece in the X carriage and of the tool in the Z carriage
Eigen::Vector3d platform_error(const Platform& platform, const Eigen::Vector3d& p_w,
                               const Eigen::Vector3d& p_t, Angles angles);

/// The same by the formulas e_x, e_y, e_z that multiply those matrices out.
Eigen::Vector3d platform_formula(const Platform& platform, const Eigen::Vector3d& p_w,
                                 const Eigen::Vector3d& p_t);

/// The CXYZA gantry: the 42 elements of Guo et al. 2016 and four rotary offsets beyond them.
struct Gantry {
  SixErrors x, y, z, a, c;           ///< 30
  SixErrors spindle;                 ///< 5: no gamma
  double gamma_xy = 0;               ///< squareness of Y to X about z
  double beta_xz = 0, alpha_yz = 0;  ///< of Z to X about y, to Y about x
  double beta_a = 0, gamma_a = 0;    ///< parallelism of A about y and z
  double alpha_c = 0, beta_c = 0;    ///< of C about x and y
  double dy_a = 0, dz_a = 0;         ///< offsets of the A line
  double dx_c = 0, dy_c = 0;         ///< offsets of the C line
};

/// Where the parts of the gantry stand in the bed with all axes at zero; frames are parallel.
struct GantryPlaces {
  Eigen::Vector3d c, x, y, z, a, spindle, workpiece, tool;
};

/// Positions of the gantry's bodies themselves (the table turns against its command).
struct GantryPositions {
  double c = 0, x = 0, y = 0, z = 0, a = 0;
};

struct GantryForm {
  Angles angles = Angles::Exact;
  bool turning = true;  ///< errors of A and C after their rotation, the body order of the paper
};

/// Tool in workpiece, T_a of the paper; T_i with a Gantry that has no errors.
Eigen::Matrix4d gantry_tool_in_workpiece(const Gantry& errors, const GantryPlaces& places,
                                         const GantryPositions& positions, const GantryForm& form);

}  // namespace abbe::oracles
