#pragma once

#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "cutting/map/form.h"
#include "cutting/part/mesh.h"
#include "cutting/part/primitive.h"
#include "kinematics/chain.h"
#include "sim/scene/bodies.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// At which places of the part's surface the residual is looked at.
struct PartSampling {
  enum class Kind {
    Adaptive,  ///< where the cut needs it, until the residual is linear between vertices
    Spacing,   ///< no edge longer than a spacing
    Vertices,  ///< those of the mesh, or as many as `vertices` asks for
  };
  Kind kind = Kind::Adaptive;
  std::optional<double> resolution;  ///< mm, wanted of linear interpolation; none: of PV
  double spacing = 0.1;              ///< mm
  double finest = 2e-3;              ///< mm, no edge is made shorter
  int points = 1'000'000;            ///< at most
};

/// Limits of the residual, mm: lower < upper.
struct Tolerance {
  double lower = 0.0, upper = 0.0;
};

/// A stretch of the part that is judged, or not, or has a tolerance of its own.
struct PartRegion {
  std::string name;
  std::optional<Eigen::VectorXd> z, radius;  ///< (2) mm, from and to, of the part frame
  std::optional<Eigen::VectorXd> box;        ///< (6) mm, least x, y, z and greatest
  std::string group;                         ///< mesh files: of its faces; empty: all
  std::optional<cutting::Rgb> colour;        ///< mesh files: of its faces
  std::optional<Tolerance> tolerance;
  bool judged = true;
  Place place;  ///< in the scene, for what its mesh does not have
};

struct PartDescription {
  std::string name;
  std::variant<cutting::Primitive, MeshFile> shape;
  kinematics::Pose T_wm = kinematics::Pose::Identity();  ///< part frame in the workpiece
  int vertices = 20000;                                  ///< wanted; not for mesh files
  PartSampling sampling;
  /// What is judged, of what the regions and the numbers below leave.
  enum class JudgedSurface { Cut, All, Regions };  ///< Cut: what the program means to cut
  JudgedSurface judged = JudgedSurface::Cut;
  bool flat_facets = false;  ///< mesh files: the facets are the surface, not a smooth one
  double recognise = 1e-4;   ///< mesh files: mm, within which a face is a plane, sphere, cylinder,
                             ///< cone or torus; 0: never
  double edge_angle =
      30.0 * std::numbers::pi / 180.0;  ///< mesh files: rad, sharper edges part faces
  std::optional<double> edge_margin;  ///< mesh files: mm from sharp edges that are left out; none:
                                      ///< a share of the tool's radius
  double form_cutoff = 2.5;           ///< mm, wave that passes by half into the form
  std::optional<double>
      judged_radius_max;  ///< mm from the part's z axis; vertices beyond are left out
  std::optional<double> judged_radius_min;
  std::optional<double>
      judged_normal_z;  ///< mesh files: vertices whose normal's z is less are left out
  std::optional<double> judged_margin;  ///< mesh files: mm from the rim that are left out
  std::optional<Tolerance> tolerance;
  std::vector<PartRegion> regions;  ///< the last that holds a place decides there
  struct Ring {                     ///< where the radius of a part of revolution is reported
    std::string name;
    double along = 0.0;  ///< mm, z of the part frame
    double width = 0.0;  ///< mm, > 0
  };
  std::vector<Ring> rings;
};

using Alignment = cutting::Alignment;

struct Limits {
  std::optional<double> pv_um, rms_um, max_abs_um;  ///< exceeded: exit 1
  std::optional<double> form_pv_um, form_rms_um;    ///< of the map through the areal filter
  std::optional<double> texture_sa_um, texture_sq_um, texture_sz_um;  ///< of the rest
  bool tolerance = false;  ///< a verdict of FAIL exceeds it
};

struct Key;

PartDescription read_part(const Node& table, InputErrors& input_errors);
Node::Table written_part(const PartDescription& part);
std::vector<Key> part_keys();

/// The libraries of materials that say which colours the faces of a part have: those that its OBJ
/// names, if a region asks for a colour. No key of a scene names them.
/// @throws BadInput if the OBJ cannot be read
std::vector<std::filesystem::path> material_files(const PartDescription& part);

}  // namespace abbe::sim
