#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "sim/dialects/program_run.h"
#include "sim/dialects/read_options.h"

namespace abbe::sim::dialects {

/// Reads a program with LinuxCNC's own interpreter, rs274, in a separate process with a private
/// folder, and issues the canonical moves that it prints. Tools, work offsets and initial axis
/// positions are those of `run.options().control`. Positions agree with `read_linuxcnc` within 1e-9
/// mm plus 1e-12 of the position. An error of rs274 is reported as one input error with its
/// message. Words that it misinterprets or does not print are input errors; the README of this
/// folder lists them. Throws BadInput if rs274 is not installed or `detected` is another dialect.
void read_by_linuxcnc(std::string_view text, const DetectedDialect& detected, ProgramRun& run);

/// Returns the folder that contains LinuxCNC's interpreter as usr/bin/rs274: that of the
/// environment variable ABBE_LINUXCNC, else `linuxcnc` next to the build (`./abbe setup
/// --linuxcnc`), else the root of the system. Returns nothing if there is none.
std::optional<std::filesystem::path> find_linuxcnc();

/// Returns the shared library that, when preloaded, makes rs274 print its numbers with all digits.
/// Throws BadInput if it is neither built nor installed.
std::filesystem::path all_digits_library();

}  // namespace abbe::sim::dialects
