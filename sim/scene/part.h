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

/// Selects the points of the part's surface at which the residual is evaluated.
struct PartSampling {
  enum class Kind {
    Adaptive,  ///< edges are refined until the residual is linear between vertices
    Spacing,   ///< no edge is longer than `spacing`
    Vertices,  ///< the vertices of the mesh, or `PartDescription::vertices` of them
  };
  Kind kind = Kind::Adaptive;
  std::optional<double> resolution;  ///< mm, tolerance of linear interpolation; none: a fraction of
                                     ///< the PV
  double spacing = 0.1;              ///< mm
  double min_edge_length = 2e-3;     ///< mm, least length of a refined edge
  int points = 1'000'000;            ///< largest number of vertices
};

/// Limits of the residual in mm, lower < upper.
struct Tolerance {
  double lower = 0.0, upper = 0.0;
};

/// A region of the part that is judged or excluded, or that has a tolerance of its own.
struct PartRegion {
  std::string name;
  std::optional<Eigen::VectorXd> z, radius;  ///< (2) mm, from and to, in the part frame
  std::optional<Eigen::VectorXd> box;        ///< (6) mm, least x, y, z, then greatest
  std::string group;                         ///< mesh files: group of its faces; empty: all
  std::optional<cutting::Rgb> colour;        ///< mesh files: colour of its faces
  std::optional<Tolerance> tolerance;
  bool judged = true;
  SourcePosition position;  ///< position in the scene, for errors found in the mesh
};

/// The part: its design, the points at which it is evaluated, and the tolerances.
struct PartDescription {
  std::string name;
  std::variant<cutting::Primitive, MeshFile> shape;
  kinematics::Pose T_wm = kinematics::Pose::Identity();  ///< part frame in the workpiece frame
  int vertices = 20000;                                  ///< requested number; not for mesh files
  PartSampling sampling;
  /// Judged surface, within the limits of the regions and numbers below.
  enum class JudgedArea { Cut, All, Regions };  ///< Cut: as the program intends
  JudgedArea judged = JudgedArea::Cut;
  bool flat_facets = false;  ///< mesh files: the facets are the surface; else a smooth surface
                             ///< through the vertices
  double recognition_tolerance =
      1e-4;  ///< mesh files: mm; a face within this distance of a plane, sphere,
             ///< cylinder, cone or torus is treated as that surface; 0: never
  double edge_angle =
      30.0 * std::numbers::pi / 180.0;  ///< mesh files: rad; edges sharper than this separate faces
  std::optional<double> edge_margin;  ///< mesh files: mm, excluded margin along sharp edges; none:
                                      ///< a fraction of the tool radius
  double form_cutoff = 2.5;           ///< mm, cut-off wavelength of the areal filter, which passes
                                      ///< half of its amplitude into the form
  std::optional<double>
      judged_radius_max;  ///< mm from the part's z axis; vertices farther out are excluded
  std::optional<double> judged_radius_min;
  std::optional<double>
      judged_normal_z;  ///< mesh files: vertices with a smaller normal z are excluded
  std::optional<double> judged_margin;  ///< mesh files: mm, excluded margin along the rim
  std::optional<Tolerance> tolerance;
  std::vector<PartRegion> regions;  ///< the last region that contains a point applies there
  struct Ring {                     ///< a zone whose mean radius is reported, for parts of
                                    ///< revolution
    std::string name;
    double z_middle = 0.0;  ///< mm, z of the part frame
    double width = 0.0;     ///< mm, > 0
  };
  std::vector<Ring> rings;
};

using Alignment = cutting::Alignment;

/// Limits of the residual; `abbe` exits with 1 if one of them is exceeded.
struct Limits {
  std::optional<double> pv_um, rms_um, max_abs_um;
  std::optional<double> form_pv_um, form_rms_um;  ///< of the residual after the areal filter
  std::optional<double> texture_sa_um, texture_sq_um, texture_sz_um;  ///< of the remainder
  bool tolerance = false;  ///< a verdict of FAIL counts as an exceeded limit
};

struct Key;

/// Reads and writes `[part]`.
PartDescription read_part(const Node& table, InputErrors& input_errors);
Node::Table part_to_table(const PartDescription& part);
std::vector<Key> part_keys();

/// Returns the material libraries that define the face colours of the part. They are named by its
/// OBJ file and not by the scene. Empty if no region selects faces by colour.
/// @throws BadInput if the OBJ file cannot be read
std::vector<std::filesystem::path> material_files(const PartDescription& part);

}  // namespace abbe::sim
