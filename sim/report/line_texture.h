#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "cutting/map/residual.h"
#include "cutting/part/mesh.h"
#include "errors/metrology/surface_texture.h"

namespace abbe::sim {

/// Lines across a part, in the part frame.
enum class ProfileLine {
  X,       ///< along x through the middle of the part
  Y,       ///< along y through the middle of the part
  Radius,  ///< from the z axis outwards along +x
};
/// Returns the line named "x", "y" or "radius".
/// @throws std::invalid_argument for any other name
ProfileLine parse_profile_line(const std::string& name);

/// A map read from a file; its residuals may have any unit.
struct ProfiledMap {
  const cutting::Design& design;    ///< mm
  const Eigen::VectorXd& residual;  ///< (n) NaN where not cut
  cutting::Surface::InteriorSample interior_sample = cutting::Surface::InteriorSample::None;
  const Eigen::VectorXd& within;  ///< (m) at the sampled point inside every triangle; may be empty
};

/// The longest connected segment of a plane section through the cut area of a map. It is a polyline
/// with a point on each edge that the plane crosses; residuals are linear between vertices.
struct LineTrace {
  Eigen::VectorXd s;            ///< (k >= 2) mm, arc length along the surface
  cutting::Points points;       ///< (k x 3) mm
  Eigen::VectorXd along;        ///< (k) mm, x, y or radius
  Eigen::VectorXd residual;     ///< (k)
  double omitted_length = 0.0;  ///< mm, length of the other segments of the section
  int segments = 1;             ///< number of segments of the section
  /// Mean and largest distance, mm, between consecutive points; coinciding points count once.
  double mean_spacing = 0.0, max_spacing = 0.0;
  /// Error of linear interpolation at the sampled points inside the triangles of the line.
  struct InterpolationError {
    int points = 0;
    double rms = 0.0, max = 0.0;  ///< unit of the residuals
  };
  std::optional<InterpolationError> interpolation;  ///< only if the map has sampled points
};

/// Returns the trace of a line; empty if nothing on the line is cut. Points within 1e-9 mm are
/// merged. A closed section begins at its smallest coordinate along the line.
/// @throws std::invalid_argument if sizes differ
std::optional<LineTrace> line_trace(const ProfiledMap& map, ProfileLine line);

/// Settings of the evaluation; empty values follow from the part and the standard.
struct LineTextureOptions {
  std::optional<double> Nic;  ///< mm
  std::optional<double> Nis;  ///< mm
  int sections = 5;
};

/// A line of a map and its profiles by ISO 21920.
struct LineTexture {
  std::string line;        ///< "x", "y", "radius"
  std::string position;    ///< description of the position of the line
  LineTrace trace;         ///< residuals in mm
  double Nic = 0.0;        ///< mm
  std::string Nic_source;  ///< source of Nic
  errors::metrology::ProfileTexture texture;
  std::vector<std::string> warnings;
};

/// Evaluates a trace with residuals in mm. Adds a warning if the line is too short for the
/// settings, if segments are left out, if Nis had to be raised, or if the map does not resolve the
/// line. The last is the case if linear interpolation deviates from the sampled points of the
/// triangles by more than a twentieth of Rq (RMS), or, without sampled points, if the spacing of
/// the triangles is larger than the setting class of ISO 21920-3 allows.
/// @param form_cutoff  mm, cut-off of the areal filter of the result; the default of Nic
LineTexture line_texture(LineTrace trace, const std::optional<double>& form_cutoff,
                         const LineTextureOptions& options);

/// Returns text for a terminal: the evaluation, then a table of P, W and R with units.
std::string to_text(const LineTexture& texture);

/// Returns the texture as JSON. Its keys are stable, so that scripts may rely on them.
nlohmann::ordered_json to_json(const LineTexture& texture);

/// Returns the profiles as a table: s_mm, x_mm, y_mm, z_mm, residual_um, primary_um, waviness_um,
/// roughness_um, one row per point.
std::string to_csv(const LineTexture& texture);

/// Interpolates values at the points of the trace to the points of the profile. (n)
Eigen::VectorXd values_on_profile(const LineTexture& texture, const Eigen::VectorXd& values);

/// Returns the main parameters on one line, for a picture.
std::string main_parameters(const LineTexture& texture);

/// Returns the evaluation settings on one line, for a picture.
std::string main_settings(const LineTexture& texture);

/// Returns a warning that the map does not resolve the line, for a picture; empty if it does.
std::string resolution_warning(const LineTexture& texture);

}  // namespace abbe::sim
