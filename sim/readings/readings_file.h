#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "errors/metrology/readings.h"

namespace abbe::sim {

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
bool holds_readings(std::string_view text);

}  // namespace abbe::sim
