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
/// "x", "y" or "radius". @throws std::invalid_argument for anything else
ProfileLine parse_profile_line(const std::string& word);

/// A map as it is read, residuals in any unit.
struct ProfiledMap {
  const cutting::Design& design;    ///< mm
  const Eigen::VectorXd& residual;  ///< (n) NaN where not cut
  cutting::Surface::Within sampled_within = cutting::Surface::Within::None;
  const Eigen::VectorXd& within;  ///< (m) at that place of every triangle; empty without
};

/// The longest stretch of a plane's section through a map where it is cut, as a line from triangle
/// to triangle: residuals between vertices are linear.
struct LineTrace {
  Eigen::VectorXd s;         ///< (k >= 2) mm, the way along the surface
  cutting::Points points;    ///< (k x 3) mm
  Eigen::VectorXd along;     ///< (k) mm, x, y or radius
  Eigen::VectorXd residual;  ///< (k)
  double left_out = 0.0;     ///< mm, of other stretches of the same section
  int stretches = 1;
  double mean_spacing = 0.0,
         widest_spacing = 0.0;  ///< mm, of places where it goes from triangle to
                                ///< triangle, those that coincide counted once
  /// What its triangles have at the places within them, less what is linear between their corners.
  struct Between {
    int places = 0;
    double rms = 0.0, worst = 0.0;  ///< unit of the residuals
  };
  std::optional<Between> between;  ///< where the map has any
};

/// Places that coincide to 1e-9 mm are one. Where a section closes on itself it begins where it is
/// lowest along the line.
/// @return none where nothing on the line is cut
/// @throws std::invalid_argument if sizes differ
std::optional<LineTrace> line_trace(const ProfiledMap& map, ProfileLine line);

struct LineTextureOptions {
  std::optional<double> Nic;  ///< mm
  std::optional<double> Nis;  ///< mm
  int sections = 5;
};

/// A line of a map and its profiles by ISO 21920.
struct LineTexture {
  std::string line;    ///< "x", "y", "radius"
  std::string where;   ///< in words
  LineTrace trace;     ///< residuals in mm
  double Nic = 0.0;    ///< mm
  std::string Nic_of;  ///< who says so
  errors::metrology::ProfileTexture texture;
  std::vector<std::string> warnings;
};

/// Evaluates a trace, residuals in mm; warns where the line is too short for what is asked, where
/// stretches are left out, where Nis had to be raised, and where the map does not resolve it: its
/// triangles have places at which straight lines miss by more than a twentieth of Rq, or none at
/// all and lie further apart than the setting class of ISO 21920-3 wants.
/// @param form_cutoff  mm, of the areal filter of the result: Nic, unless options say another
LineTexture line_texture(LineTrace trace, const std::optional<double>& form_cutoff,
                         const LineTextureOptions& options);

/// Lines for a terminal: what was evaluated, then a table of P, W and R with units.
std::string to_text(const LineTexture& texture);

/// The same as JSON; its keys are a promise to scripts.
nlohmann::ordered_json to_json(const LineTexture& texture);

/// The profiles as a table: s_mm, x_mm, y_mm, z_mm, residual_um, primary_um, waviness_um,
/// roughness_um, a row a place.
std::string to_csv(const LineTexture& texture);

/// Values of the trace at the places of the profile (n).
Eigen::VectorXd values_on_profile(const LineTexture& texture, const Eigen::VectorXd& values);

/// The chief parameters in a line, for a picture.
std::string main_parameters(const LineTexture& texture);

/// How they were evaluated, the same.
std::string main_settings(const LineTexture& texture);

/// That the map does not resolve them, the same; empty where it does.
std::string resolution_warning(const LineTexture& texture);

}  // namespace abbe::sim
