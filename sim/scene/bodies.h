#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "kinematics/pose.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// A mesh file that describes a part, a blank or a body.
struct MeshFile {
  std::filesystem::path file;
  double unit = 1.0;              ///< mm per unit of the file
  bool is_size_intended = false;  ///< the size is intended, so no warning questions the unit
  bool open = false;              ///< a surface with a rim is intended
  SourcePosition position = {};   ///< position of the file name in the scene, for messages
};

// Bodies of the machine, the tool and the clamping, used for pictures and for collision checks.
// Each shape is described in the body's own frame.

struct BoxShape {                                  ///< centred on the origin
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  ///< mm
};
struct CylinderShape {  ///< about z, on z = 0
  double radius = 0.0;  ///< mm
  double height = 0.0;  ///< mm
};
struct ConeShape {            ///< about z, on z = 0
  double radius_below = 0.0;  ///< mm
  double radius_above = 0.0;  ///< mm
  double height = 0.0;        ///< mm
};
struct SphereShape {    ///< centred on the origin
  double radius = 0.0;  ///< mm
};
struct RevolvedShape {             ///< about z
  Eigen::MatrixX2d profile{0, 2};  ///< (n x 2) mm, radius and height, upwards
};
struct ExtrudedShape {             ///< on z = 0
  Eigen::MatrixX2d outline{0, 2};  ///< (n x 2) mm, counter-clockwise
  double height = 0.0;             ///< mm
};
struct MeshShape {
  MeshFile mesh;
  double scale = 1.0;
};
using BodyShape = std::variant<BoxShape, CylinderShape, ConeShape, SphereShape, RevolvedShape,
                               ExtrudedShape, MeshShape>;

struct BodyDescription {
  std::string name;
  BodyShape shape;
  kinematics::Pose T = kinematics::Pose::Identity();  ///< pose of the body's own frame in the frame
                                                      ///< of its carrier
};

/// A component of the machine, such as its ram or its table.
struct MachineBody {
  std::optional<int> joint;  ///< the joint that carries the body; none for the bed
  BodyDescription body;      ///< its pose is in the bed frame, with all axes at zero
};

/// Settings of the collision check.
struct CollisionDescription {
  bool is_enabled = false;   ///< every run checks for collisions
  bool stop = false;         ///< a run with a collision ends before anything is cut
  double clearance = 1.0;    ///< mm; smaller distances are reported as a near miss
  double gouge = 0.1;        ///< mm; a tool deeper in the part than this collides with it
  double resolution = 5e-3;  ///< mm; bodies nearer than this are in contact
  struct Pair {
    std::string a, b;
  };
  std::vector<Pair> ignore;  ///< pairs of body names that may touch
};

struct KeyName;
template <typename T>
class Fields;

/// Returns the fields `file` and `unit` of a mesh.
/// @param file  name of the key, with the alternatives that may replace it
Fields<MeshFile> mesh_file_fields(const KeyName& file);

/// Returns the fields of a body and of its placement on its carrier.
Fields<BodyDescription> body_fields();
/// Returns the fields of a profile of revolution, `radii_mm` and `heights_mm`.
/// @param height_origin  the origin of the heights, in words for the manual
Fields<Eigen::MatrixX2d> profile_fields(const char* height_origin);
/// Returns the fields of `[collision]`.
const Fields<CollisionDescription>& collision_fields();

}  // namespace abbe::sim
