#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sim/program/canon.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// Reads an RS274/NGC program strictly. README of this folder lists the words taken.
/// @throws BadInput (file:line:column, the word, what was expected) on anything else
Path read_nc(std::string_view text, const std::string& file, const NcOptions& options);
/// The same on a control that stands somewhere already.
void read_nc(std::string_view text, Canon& canon);
Path read_nc_file(const std::filesystem::path& file, const NcOptions& options);

}  // namespace abbe::sim::program
