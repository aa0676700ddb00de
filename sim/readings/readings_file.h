#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "errors/metrology/part.h"
#include "errors/metrology/readings.h"

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
bool is_part_readings_text(std::string_view text);

/// Readings as text: a head of TOML in lines that begin with "# " which says all that there is to
/// know (instrument, nominal machine, every set-up and channel with what is known of its
/// alignment), then one row a reading: set_up, channel, run, target, time_s, the axes as commanded
/// with way and stroke, reading and its unit (mm, rad), temperatures. No truth. Numbers are as
/// short as reads back the same bits; of rotary positions, in degrees, within one ulp.
std::string to_text(const errors::metrology::Readings& readings);

/// Reads that text. @param file  what refusals call it
/// @throws BadScene with every fault of the head, BadInput with line and column of a row
errors::metrology::Readings read_readings(std::string_view text, const std::string& file);

/// The same from a file, at most 256 MiB. @throws BadInput also if it is no readable regular file
errors::metrology::Readings read_readings_file(const std::filesystem::path& file);

/// Whether a text is one of these.
bool is_readings_text(std::string_view text);

}  // namespace abbe::sim
