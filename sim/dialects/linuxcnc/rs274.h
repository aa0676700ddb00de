#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "sim/dialects/program_run.h"
#include "sim/dialects/read_options.h"

namespace abbe::sim::dialects {

/// Reads a program by LinuxCNC's own interpreter, rs274, as a process of its own with a private
/// folder, and makes the canonical moves that it puts out. Tools, work offsets and the place of the
/// axes are those of `run.options().control`; positions agree with `read_linuxcnc` within 1e-9 mm
/// (and 1e-12 of the position). What rs274 refuses is one fault with its message; what it gets
/// wrong or does not print is refused by name: the README of this folder lists it.
/// @throws BadInput where it is not there, or `found` is another dialect
void read_by_linuxcnc(std::string_view text, const Recognised& found, ProgramRun& run);

/// The folder that holds LinuxCNC's interpreter as usr/bin/rs274: what the environment variable
/// ABBE_LINUXCNC names, else `linuxcnc` beside the build (`./abbe setup --linuxcnc`), else the
/// system's own.
/// @return none where there is none
std::optional<std::filesystem::path> find_linuxcnc();

/// The library that, preloaded into rs274, gives its numbers all their digits.
/// @throws BadInput where it was not built or installed
std::filesystem::path all_digits_library();

}  // namespace abbe::sim::dialects
