#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "sim/dialects/control_table.h"

/// Tool tables and work offsets in the file formats of controls.
///
/// The control is recognised by the first line with a distinctive text, comments excluded:
/// Heidenhain, a line that begins with BEGIN; Siemens, `%_N_`, `$TC_` or `$P_UIFR`; Fanuc, G10 or a
/// line of O and a number; LinuxCNC, T and a number (tools) or two numbers (offsets).
///
/// - LinuxCNC: tools in the format that `src/emc/rs274ngc/tool_parse.cc` reads, with words T P D X
/// Y Z A B C U V W I J Q and a comment after `;`, in machine units; offsets are parameters 5221 to
/// 5390 of the parameter file (User Manual, "Coordinate System").
/// - Fanuc: a listing of blocks G10 L10 to L13 P R (length, its wear, radius, its wear), G10 L2 P0
/// to P6 and L20 P1 to P300 with axis words. Assumed: R of L12 and L13 is a radius; a value without
/// a decimal point is a count of increments and an error unless it is zero.
/// - Siemens: `$TC_DP` 3, 6, 12, 15, 21 of cutting edge 1 (Programming Guide Advanced, 04.00, 8.1,
/// p. 8-265), the name `$TC_TP2`; `$P_UIFR[n, axis, TR]`, n 1 to 99, and FI, or CTRANS and CFINE.
/// Assumed: length 1 lies along the tool, as in G17 for types 100 to 299.
/// - Heidenhain: columns located by their names in the header, from BEGIN, with MM or INCH, to
/// `[END]`: T NAME L R DL DR of a tool table (TNC7 User's Manual, "Tool table tool.t"). Preset
/// tables have NR 1 to 9999 and X Y Z A B C U V W; these names, and `-` for a value that is not
/// set, are assumed.
///
/// An offset of Siemens or Heidenhain beyond the sixth that is rotated or cannot be read is left
/// out and counted; a program that calls it is an error.
namespace abbe::sim::dialects {

/// Reads a table in time and memory proportional to its text; more than 64 MiB is an input error.
/// `unit` is mm per unit of length; it must be given if the file does not state the unit, and agree
/// with the file if it does. Throws BadProgram with all errors, up to 200, each with line and
/// column.
ControlTable read_control_table(std::string_view text, const std::string& file,
                                ControlTableKind kind, std::optional<double> unit = {});
/// Reads a table from a file.
ControlTable read_control_table_file(const std::filesystem::path& file, ControlTableKind kind,
                                     std::optional<double> unit = {});

}  // namespace abbe::sim::dialects
