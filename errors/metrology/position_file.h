#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "errors/metrology/position_set.h"

namespace abbe::errors::metrology {

/// Either form: a text that begins with HEADER:: is an .rtl. @throws BadInput as these
std::vector<PositionSet> read_positions(std::string_view text, const std::string& file,
                                        const PositionFileOptions& options = {});

/// The same from a file.
/// @throws BadInput also if it is no readable regular file
std::vector<PositionSet> read_position_file(const std::filesystem::path& file,
                                            const PositionFileOptions& options = {});

}  // namespace abbe::errors::metrology
