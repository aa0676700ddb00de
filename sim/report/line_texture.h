#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "errors/metrology/profile.h"
#include "sim/report/line_trace.h"

namespace abbe::sim {

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
Eigen::VectorXd at_places(const LineTexture& texture, const Eigen::VectorXd& values);

/// The chief parameters in a line, for a picture.
std::string chief_parameters(const LineTexture& texture);

/// How they were evaluated, the same.
std::string chief_settings(const LineTexture& texture);

/// That the map does not resolve them, the same; empty where it does.
std::string chief_doubt(const LineTexture& texture);

}  // namespace abbe::sim
