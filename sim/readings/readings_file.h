#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "errors/metrology/part.h"
#include "errors/metrology/readings.h"

/// Readings of instruments as text files.
namespace abbe::sim {

/// Readings of a part as stored in a file.
struct PartReadingsFile {
  std::string instrument;
  std::string kind;  ///< "cmm", "touch_probe"
  std::string part;  ///< title of the scene, and the case in which the part was cut
  errors::metrology::PartReadings readings;
};

/// Returns the text of readings of a part: a TOML header in lines that begin with "# ", then a row
/// for each point: x_mm, y_mm, z_mm on the design, normal nx, ny, nz, deviation_um, time_s. Numbers
/// have the fewest digits that read back to the same bits; the deviation reads back within one ulp.
std::string to_text(const PartReadingsFile& file);

/// Reads the text of readings of a part.
/// @param file  name in messages
/// @throws BadInput for an error in a row, BadScene with every error of the header
PartReadingsFile read_part_readings(std::string_view text, const std::string& file);

/// Returns true if a text holds readings of a part.
bool is_part_readings_text(std::string_view text);

/// Returns the text of readings: a TOML header in lines that begin with "# " (instrument, nominal
/// machine, every set-up and channel with the known uncertainty of its alignment), then a row for
/// each reading: set_up, channel, run, target, time_s, the commanded axes with direction and
/// stroke, the reading and its unit (mm, rad), temperatures. The text contains no part of the
/// truth. Numbers have the fewest digits that read back to the same bits; rotary positions, in
/// degrees, read back within one ulp.
std::string to_text(const errors::metrology::Readings& readings);

/// Reads the text of readings.
/// @param file  name in messages
/// @throws BadScene with every error of the header, BadInput with line and column of a row
errors::metrology::Readings read_readings(std::string_view text, const std::string& file);

/// Reads readings from a file of at most 256 MiB.
/// @throws BadInput also if the file is not a readable regular file
errors::metrology::Readings read_readings_file(const std::filesystem::path& file);

/// Returns true if a text holds readings.
bool is_readings_text(std::string_view text);

}  // namespace abbe::sim
