#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "cutting/alignment.h"
#include "cutting/primitive.h"
#include "kinematics/chain.h"
#include "sim/scene/mesh_file.h"

namespace abbe::sim {

struct PartDescription {
  std::string name;
  std::variant<cutting::Primitive, MeshFile> shape;
  kinematics::Pose T_wm = kinematics::Pose::Identity();  ///< part frame in the workpiece
  int vertices = 20000;                                  ///< wanted; not for mesh files
  std::optional<double>
      judged_radius_max;  ///< mm from the part's z axis; vertices beyond are left out
  std::optional<double> judged_radius_min;
  std::optional<double>
      judged_normal_z;  ///< mesh files: vertices whose normal's z is less are left out
  std::optional<double> judged_margin;  ///< mesh files: mm from the rim that are left out
  double tolerance = 0.0;               ///< mm, +- ; 0: none given
  struct Ring {                         ///< where the radius of a part of revolution is reported
    std::string name;
    double along = 0.0;  ///< mm, z of the part frame
    double width = 0.0;  ///< mm, > 0
  };
  std::vector<Ring> rings;
};

using Alignment = cutting::Alignment;

struct Limits {
  std::optional<double> pv_um, rms_um, max_abs_um;  ///< exceeded: exit 1
};

}  // namespace abbe::sim
