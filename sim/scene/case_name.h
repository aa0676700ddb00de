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

/// Strategy and channel by which a plug-in's corrections are made and brought, "iterated-pulses";
/// and back.
/// @throws std::invalid_argument naming the token and what it could be; for tables
CaseDescription parse_plug_in_way(const std::string& words);
std::string plug_in_way(const CaseDescription& plug_in);

}  // namespace abbe::sim
