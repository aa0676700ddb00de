#pragma once

#include <string>
#include <string_view>

#include "errors/metrology/part.h"

namespace abbe::sim {

/// Readings of a part as a file holds them.
struct PartReadingsFile {
  std::string instrument;
  std::string kind;  ///< "cmm", "touch_probe"
  std::string part;  ///< title of the scene and case it was cut in
  errors::metrology::PartReadings readings;
};

/// Text: a head of TOML in lines that begin with "# ", then one row a point: x_mm, y_mm, z_mm on
/// the design, normal nx, ny, nz, deviation_um, time_s. Numbers are as short as reads back the same
/// bits, the deviation within one ulp.
std::string to_text(const PartReadingsFile& file);

/// @param file  what refusals call it
/// @throws BadInput, BadScene
PartReadingsFile read_part_readings(std::string_view text, const std::string& file);

/// Whether a text is one of these.
bool holds_part_readings(std::string_view text);

}  // namespace abbe::sim
