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

/// Lines across a part, in its frame.
enum class ProfileLine {
  X,       ///< along x through the middle of the part
  Y,       ///< along y through the middle of the part
  Radius,  ///< from the z axis outwards along +x
};
/// Returns the line named "x", "y" or "radius".
/// @throws std::invalid_argument for any other name
ProfileLine parse_profile_line(const std::string& word);

/// A map as read from a file, residuals in any unit.
struct ProfiledMap {
  const cutting::Design& design;    ///< mm
  const Eigen::VectorXd& residual;  ///< (n) NaN where not cut
  cutting::Surface::Within sampled_within = cutting::Surface::Within::None;
  const Eigen::VectorXd& within;  ///< (m) at the sampled point inside every triangle; may be empty
};

/// The longest connected segment of a plane's section through the cut area of a map, as a polyline
/// from triangle to triangle: residuals are linear between vertices.
struct LineTrace {
  Eigen::VectorXd s;         ///< (k >= 2) mm, arc length along the surface
  cutting::Points points;    ///< (k x 3) mm
  Eigen::VectorXd along;     ///< (k) mm, x, y or radius
  Eigen::VectorXd residual;  ///< (k)
  double left_out = 0.0;     ///< mm, length of the other segments of the same section
  int stretches = 1;         ///< number of segments of the section
  /// Mean and largest distance, mm, of the points where the line goes from triangle to triangle;
  /// coinciding points count once.
  double mean_spacing = 0.0, widest_spacing = 0.0;
  /// Residuals at the sampled points inside the triangles of the line, less the linear
  /// interpolation between corners.
  struct Between {
    int places = 0;
    double rms = 0.0, worst = 0.0;  ///< unit of the residuals
  };
  std::optional<Between> between;  ///< only if the map has sampled points
};

/// Returns the trace of a line. Points that coincide to 1e-9 mm are merged. A closed section begins
/// at its lowest coordinate along the line.
/// @return empty if nothing on the line is cut
/// @throws std::invalid_argument if sizes differ
std::optional<LineTrace> line_trace(const ProfiledMap& map, ProfileLine line);

/// Settings of the evaluation; empty ones follow from the part and the standard.
struct LineTextureOptions {
  std::optional<double> Nic;  ///< mm
  std::optional<double> Nis;  ///< mm
  int sections = 5;
};

/// A line of a map and its profiles by ISO 21920.
struct LineTexture {
  std::string line;    ///< "x", "y", "radius"
  std::string where;   ///< description of the line
  LineTrace trace;     ///< residuals in mm
  double Nic = 0.0;    ///< mm
  std::string Nic_of;  ///< source of Nic
  errors::metrology::ProfileTexture texture;
  std::vector<std::string> warnings;
};

/// Evaluates a trace, residuals in mm. Warns if the line is too short for the settings, if segments
/// are left out, if Nis had to be raised, and if the map does not resolve the line: linear
/// interpolation misses the sampled points of its triangles by more than a twentieth of Rq, or
/// there are none and its triangles are further apart than the setting class of ISO 21920-3
/// requires.
/// @param form_cutoff  mm, of the areal filter of the result; it is Nic unless the options set
/// another
LineTexture line_texture(LineTrace trace, const std::optional<double>& form_cutoff,
                         const LineTextureOptions& options);

/// Returns text for a terminal: the evaluation, then a table of P, W and R with units.
std::string to_text(const LineTexture& texture);

/// Returns the same as JSON; its keys are stable for scripts.
nlohmann::ordered_json to_json(const LineTexture& texture);

/// Returns the profiles as a table: s_mm, x_mm, y_mm, z_mm, residual_um, primary_um, waviness_um,
/// roughness_um, one row per point.
std::string to_csv(const LineTexture& texture);

/// Returns values given at the points of the trace, interpolated at the points of the profile. (n)
Eigen::VectorXd values_on_profile(const LineTexture& texture, const Eigen::VectorXd& values);

/// Returns the main parameters on one line, for a picture.
std::string main_parameters(const LineTexture& texture);

/// Returns the evaluation settings on one line, for a picture.
std::string main_settings(const LineTexture& texture);

/// Returns a warning that the map does not resolve the line, for a picture; empty if it does.
std::string resolution_warning(const LineTexture& texture);

}  // namespace abbe::sim
