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

/// A surface from a file: of a part, a blank, or a body.
struct MeshFile {
  std::filesystem::path file;
  double unit = 1.0;      ///< mm per unit of the file
  bool any_size = false;  ///< its size is meant: no doubt is cast on the unit
  bool open = false;      ///< a surface with a rim is meant
  Place place = {};       ///< in the scene, where it is named
};

// What the machine, the tool and the clamping are made of: for pictures, and for what meets what.

struct BoxShape {                                  ///< about its middle
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
struct SphereShape {    ///< about its middle
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
  kinematics::Pose T = kinematics::Pose::Identity();  ///< of its own frame in that of its carrier
};

/// A part of the machine, such as its ram or its table.
struct MachineBody {
  std::optional<int> joint;  ///< that carries it; none: the bed
  BodyDescription body;      ///< placed in the bed, axes at zero
};

/// How a program is searched for collisions, and whether every run does it.
struct CollisionDescription {
  bool on = false;
  bool stop = false;         ///< a run with a collision cuts nothing
  double clearance = 1.0;    ///< mm, less is reported as a near miss
  double gouge = 0.1;        ///< mm, deeper in the part than this is a collision of the tool
  double resolution = 5e-3;  ///< mm, nearer than this is contact
  struct Pair {
    std::string a, b;
  };
  std::vector<Pair> ignore;  ///< bodies by name that may meet
};

struct KeyName;
template <typename T>
class Fields;

/// `file` and `unit` of a mesh.
/// @param file  name of the key, with what else may stand in its place
Fields<MeshFile> mesh_file_fields(const KeyName& file);

/// A body and its place in what carries it.
Fields<BodyDescription> body_fields();
/// The profile of a body of revolution: `radii_mm`, `heights_mm`. @param from  where heights count
Fields<Eigen::MatrixX2d> profile_fields(const char* from);
/// `[collision]`
const Fields<CollisionDescription>& collision_fields();

}  // namespace abbe::sim
