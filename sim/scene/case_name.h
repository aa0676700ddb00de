#pragma once

#include <filesystem>
#include <string>

#include "sim/scene/case_description.h"

namespace abbe::sim {

/// Reads a case name "perfect-iterated-ideal"; one with a dot or slash is a plug-in's file.
/// @throws std::invalid_argument naming the token and what it could be
CaseDescription parse_case(const std::string& name);

/// The case of a plug-in's file, called by its name with extension.
/// @throws std::invalid_argument if that name cannot be a folder's
CaseDescription plug_in_case(const std::filesystem::path& file);

}  // namespace abbe::sim
