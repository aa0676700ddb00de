#pragma once

#include <string_view>

#include "sim/dialects/dialect.h"
#include "sim/dialects/program_run.h"

namespace abbe::sim::dialects {

/// Reads a program by LinuxCNC's own interpreter, rs274, as a process of its own with a private
/// folder, and makes the canonical moves that it puts out. Tools, work offsets and the place of the
/// axes are those of `run.options().control`; positions agree with `read_linuxcnc` within 1e-9 mm
/// (and 1e-12 of the position). What rs274 refuses is one fault with its message; what it gets
/// wrong or does not print is refused by name: the README of this folder lists it.
/// @throws BadInput where it is not there, or `found` is another dialect
void read_by_linuxcnc(std::string_view text, const Recognised& found, ProgramRun& run);

}  // namespace abbe::sim::dialects
